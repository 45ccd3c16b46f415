# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments that are kept from call to call are the same as arguments that are given anew."""

import numpy as np
import pytest

from rigid_sim_ros.engine.dynamics.integrate import make_work
from rigid_sim_ros.engine.steps.timestep import TimestepSettings
from rigid_sim_ros.kernels import argument_pack as engine_kept
from rigid_sim_ros.kernels.argument_pack import contents, Kept
from rigid_sim_ros.kernels.kernel import kernel

SETTINGS = TimestepSettings(bounce_speed=2.5, sleep_steps=10)


def work(n):
    """Return NamedTuples in a NamedTuple: the work of n bodies, with forces 0, 1, 2, ... [N]."""
    made = make_work(n)
    made.loads.F[...] = np.arange(3.0 * n).reshape(3, n)
    return made


def add_up(box, weight):
    scratch, settings, (flags, total) = contents(box)
    total[0] = settings.bounce_speed * settings.sleep_steps
    for i in range(scratch.loads.F.shape[1]):
        total[0] += weight * scratch.loads.F[1, i] * flags[i]
    return total[0]


def double(box):
    _, _, (_, total) = contents(box)
    return 2 * total[0]


add_up.__module__ = double.__module__ = engine_kept.__name__    # whose place in the cache they get
add_up, double = kernel(add_up), kernel(double)


def pair(n):
    return np.ones(n, dtype=np.int64), np.zeros(1)


def test_a_kernel_finds_numbers_arrays_and_tuples_in_a_box():
    arrays = pair(3)
    assert add_up(Kept().box(work(3), SETTINGS, arrays), 2.0) == 25 + 2.0 * (3 + 4 + 5)
    assert arrays[1][0] == 49


def test_what_python_writes_to_an_array_the_next_call_sees():
    scratch, arrays, kept = work(3), pair(3), Kept()
    add_up(kept.box(scratch, SETTINGS, arrays), 2.0)
    scratch.loads.F[1] = 1.0
    arrays[0][0] = 0
    assert add_up(kept.box(scratch, SETTINGS, arrays), 2.0) == 25 + 2.0 * 2


def test_the_same_objects_are_taken_apart_once_and_others_anew():
    first, second, arrays, kept = work(3), work(4), pair(4), Kept()
    box = kept.box(first, SETTINGS, arrays)
    assert kept.box(first, SETTINGS, arrays) is box
    assert add_up(kept.box(second, SETTINGS, arrays), 1.0) == 25 + (4 + 5 + 6 + 7)
    assert add_up(kept.box(first, SETTINGS, arrays), 1.0) == 25 + (3 + 4 + 5)
    faster = SETTINGS._replace(bounce_speed=3.0)
    assert add_up(kept.box(first, faster, arrays), 1.0) == 30 + (3 + 4 + 5)


def test_boxes_of_other_types_are_told_apart():
    flags, total = pair(3)
    assert add_up(Kept().box(work(3), SETTINGS, (flags.astype(np.int32), total)), 1.0) == 37
    assert add_up(Kept().box(work(3), SETTINGS, (flags, total)), 1.0) == 37


@pytest.mark.parametrize('other', [np.float32(1.0), 1 + 2j])
def test_what_has_no_64_bits_of_its_own_is_refused(other):
    with pytest.raises(TypeError, match='cannot be kept, only arrays and numbers of 64 bits'):
        Kept().box(work(3), (1, other))


def test_arguments_of_one_type_are_each_taken_apart():
    """How is found out once for a type: with other lengths, strides and places it still holds."""
    kept = Kept()
    for n in (3, 5, 4):
        flags, total = np.ones(2 * n, dtype=np.int64)[::2], np.zeros(1)
        assert not flags.flags.c_contiguous
        flags[0] = n
        assert add_up(kept.box(work(n), SETTINGS, (flags, total)), 1.0) == 25 + n * n + sum(
            range(n + 1, 2 * n))


def test_a_box_runs_kernels_of_its_type_with_numbers():
    for kind, weight in ((np.int64, 2), (np.int32, 3), (np.int64, 4)):
        flags, total = pair(3)
        box = Kept().box(work(3), SETTINGS, (flags.astype(kind), total))
        for _ in range(2):
            assert box.run(add_up, weight) == 25 + weight * (3 + 4 + 5)
            assert box.run(double) == 2 * (25 + weight * (3 + 4 + 5))
