# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Room for arrays."""

from itertools import pairwise

from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros.kernels.arrays import _LARGE, integers, room

MB = 1 << 20


@given(shape=st.lists(st.integers(0, 60), min_size=1, max_size=3),
       kind=st.sampled_from([np.float64, np.int64, np.int32, np.int16, np.int8]))
def test_room_is_zero_and_begins_on_a_line_of_the_cache(shape, kind):
    array = room(*shape, kind=kind)
    assert array.shape == tuple(shape)
    assert array.dtype == kind
    assert array.flags.c_contiguous and array.flags.writeable
    # What is empty lies nowhere.
    assert array.size == 0 or array.ctypes.data % 64 == 0
    assert not array.any()
    array[...] = 1
    assert array.sum() == array.size


def test_integers_have_64_bits():
    assert integers(2, 3).dtype == np.int64


def test_two_rooms_share_no_line_of_the_cache():
    # Two cores may write to them at once.
    rooms = sorted((room(k % 7 + 1) for k in range(50)), key=lambda one: one.ctypes.data)
    lines = [(one.ctypes.data // 64, (one.ctypes.data + one.nbytes - 1) // 64) for one in rooms]
    assert all(end < begin for (_, end), (begin, _) in pairwise(lines))


def test_large_rooms_do_not_all_want_the_same_lines_of_the_cache():
    rooms = [room(_LARGE) for _ in range(8)]
    assert len({one.ctypes.data % 4096 for one in rooms}) == 8


def test_room_takes_memory_where_it_is_written_to():
    def resident():
        with open('/proc/self/statm', encoding='ascii') as file:
            return int(file.read().split()[1]) * 4096

    try:
        before = resident()
    except FileNotFoundError:
        pytest.skip('the system has no /proc/self/statm')
    array = room(8 * MB)    # 64 MB
    array[::MB] = 1.0       # in 8 places
    # 8 pages of 4 KiB, with as much again for what else happens; of pages of 2 MB it would be 16.
    assert resident() - before < MB


def test_room_outlives_its_neighbours():
    kept = [room(_LARGE) for _ in range(20)][7]
    kept[:] = 3.0
    assert kept.sum() == 3.0 * _LARGE
