# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Kernels go through the numbers that Python goes through."""

from hypothesis import example, given
from hypothesis import strategies as st
from kernels.own_kernels import of_the_engine
import numpy as np
import pytest

from rigid_sim_ros.kernels import kernel as kernels

kernel = of_the_engine(kernels.kernel)
small = st.integers(-6, 6)


@kernel
def up_to(stop, out):
    count, last = 0, -1
    for i in range(stop):
        out[count] = last = i
        count += 1
    return count, last


@kernel
def from_to(start, stop, out):
    count, last = 0, -1
    for i in range(start, stop):
        if i == 3:
            continue
        if i == 5:
            break
        out[count] = last = i
        count += 1
    else:
        count += 1
    return count, last


@kernel
def by(start, stop, step, out):
    count = 0
    for i in range(start, stop, step):
        out[count] = i
        count += 1
    return count, len(range(start, stop)), len(range(stop))


@kernel
def backwards(stop, out):
    count = 0
    for i in range(stop, -1, -1):
        for j in range(i):
            out[count] = j
            count += 1
    return count


@kernel
def one_of_two(stop, other, choose, out):
    numbers = range(stop) if choose else range(other, stop)
    count = 0
    for i in numbers:
        out[count] = i
        count += 1
    for _ in numbers:
        count += 1
    return count


def same(function, *arguments):
    ours, pythons = (np.full(64, 99, dtype=np.int64) for _ in range(2))
    assert function(*arguments, ours) == function.py_func(*arguments, pythons)
    np.testing.assert_array_equal(ours, pythons)


@given(small, small, st.sampled_from((-3, -2, -1, 1, 2, 3)), st.booleans())
@example(0, 0, 1, True)
@example(-2, 6, 1, False)
def test_numbers_come_as_in_python(start, stop, step, choose):
    same(up_to, stop)
    same(from_to, start, stop)
    same(by, start, stop, step)
    same(backwards, stop)
    same(one_of_two, stop, start, choose)


def test_a_step_of_zero_is_an_error():
    with pytest.raises(ValueError, match='must not be zero'):
        by(0, 3, 0, np.zeros(8, dtype=np.int64))


@pytest.mark.parametrize('kind', (np.int32, np.int8, np.uint64))
def test_lengths_of_other_types_count_as_well(kind):
    assert up_to(kind(4), np.zeros(8, dtype=np.int64)) == (4, 3)
