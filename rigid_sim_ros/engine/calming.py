# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How an impact runs its course within one substep of the sequential solver.

A sweep visits every block of contacts once, in a fixed order. What a rough change reaches after
its visit, such as the far end of a row of balls, would wait for the next sweep; here it is visited
at once, and what that changes roughly, and so on.
"""

from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray
from rigid_sim_ros.engine.coloring import Blocks, most_blocks, numbers_of
from rigid_sim_ros.engine.contact_blocks import RESIDUAL
from rigid_sim_ros.engine.contact_rules import Sweep
from rigid_sim_ros.engine.contact_sweep import is_settled, visit_block
from rigid_sim_ros.engine.kernel import INDEX, kernel
from rigid_sim_ros.engine.lanes import LANES
from rigid_sim_ros.engine.solver_bodies import STRIDE

# [m/s] a change that others must hear of before the substep ends, in so many sweeps at most
ROUGH = 0.2
CALMING_SWEEPS = 30


class Calming(NamedTuple):
    """Which blocks hold a body, and a clock that counts visits."""

    listed: IntArray  # (1,) 1 when the lists are those of this step
    first: IntArray  # (n + 3,) where the blocks of a slot begin in `member`
    member: IntArray  # (16 blocks,) of 32 bits
    reached: IntArray  # (blocks,) when a visit last changed a body of a block roughly
    visited: IntArray  # (blocks,) when a block was visited last


def make_calming(n: int, capacity: int) -> Calming:
    """Return room for n bodies and `capacity` manifolds."""
    blocks = most_blocks(capacity)

    def integers(count: int) -> IntArray:
        return np.zeros(count, dtype=np.int64)

    member: Any = np.zeros(2 * LANES * blocks, dtype=np.int32)
    return Calming(integers(1), integers(n + 3), member, integers(blocks), integers(blocks))


@kernel
def calm(count: int, blocks: Blocks, motion: Array, used: int, work: Calming,
         inv_h: float) -> None:
    """Visit what a rough change reached, until there is no more; `used` is how many slots are."""
    for block in range(count):
        if not is_settled(numbers_of(blocks, block), ROUGH):
            _run(count, blocks, motion, used, work, inv_h)
            return


@kernel
def _run(count: int, blocks: Blocks, motion: Array, used: int, work: Calming,
         inv_h: float) -> None:
    if work.listed[0] == 0:
        _list_blocks(count, blocks, used, work.first, work.member)
        work.listed[0] = 1
    work.reached[:count] = 0
    # The sweep before this was visit 1, 2, ... in the order of the blocks.
    for block in range(count):
        work.visited[block] = block + 1
        _shake(blocks, block, block + 1, work)
    clock = count
    for k in range(CALMING_SWEEPS):
        before = clock
        for j in range(count):
            block = count - 1 - j if k % 2 == 0 else j
            if work.reached[block] > work.visited[block]:
                visit_block(blocks, block, motion, motion, Sweep(inv_h, 0.0))
                clock += 1
                work.visited[block] = clock
                _shake(blocks, block, clock, work)
        if clock == before:
            break


@kernel
def _shake(blocks: Blocks, block: int, clock: int, work: Calming) -> None:
    """Note whom the last visit to a block reached: all blocks of what it changed roughly."""
    b = numbers_of(blocks, block)
    if is_settled(b, ROUGH):
        return
    for i in range(LANES):
        if b[RESIDUAL * LANES + i] > ROUGH:
            for at in (blocks.at_A[block * LANES + i], blocks.at_B[block * LANES + i]):
                slot = (at & INDEX) // STRIDE
                for k in range(work.first[slot], work.first[slot + 1]):
                    work.reached[work.member[k] & INDEX] = clock


@kernel
def _list_blocks(count: int, blocks: Blocks, used: int, first: IntArray, member: IntArray) -> None:
    """List the blocks of each slot but 0, which stands still: count, add up, distribute."""
    first[:used + 2] = 0
    for lane in range(count * LANES):
        first[(blocks.at_A[lane] & INDEX) // STRIDE + 2] += 1
        first[(blocks.at_B[lane] & INDEX) // STRIDE + 2] += 1
    first[2] = 0
    for slot in range(2, used + 1):
        first[slot + 1] += first[slot]
    # What is the start of a slot now, one place too far on, moves to its end.
    for lane in range(count * LANES):
        for at in (blocks.at_A[lane], blocks.at_B[lane]):
            slot = (at & INDEX) // STRIDE
            if slot > 0:
                member[first[slot + 1]] = lane // LANES
                first[slot + 1] += 1
