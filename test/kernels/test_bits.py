# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Instructions of the processor do what they say, and asking for memory does nothing else."""

from hypothesis import example, given, strategies as st
from kernels.own_kernels import of_the_engine
import numpy as np

from rigid_sim_ros.kernels import bits
from rigid_sim_ros.kernels.bits import fetch, lowest_zero

kernel = of_the_engine(module=bits)


@kernel
def place_of_zero(mask):
    return lowest_zero(mask)


@kernel
def ask(numbers, at):
    fetch(numbers, at)


@example(0)
@example(-1)    # all ones
@example(2**63 - 1)
@given(st.integers(-2**63, 2**63 - 1))
def test_the_lowest_zero_is_that_of_the_written_number(mask):
    written = f'{mask & (2**64 - 1):064b}'[::-1]
    assert place_of_zero(mask) == (written + '0').index('0')


def test_asking_for_memory_changes_nothing_wherever_it_is():
    numbers = np.arange(100.0)
    for at in (0, 99, -1, 100, 1 << 40):    # also beyond both ends: there it is not read
        ask(numbers, at)
    assert (numbers == np.arange(100.0)).all()
