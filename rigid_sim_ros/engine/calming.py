# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How an impact runs its course within one substep of the sequential solver.

A sweep visits every block of contacts once, in a fixed order. What a rough change reaches after
its visit, such as the far end of a row of balls, would wait for the next sweep; here it is visited
at once, and what that changes roughly, and so on.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray, integers, room
from rigid_sim_ros.engine.coloring import (
    Blocks, first_block, most_blocks, SHAKEN)
from rigid_sim_ros.engine.contact_rules import Sweep
from rigid_sim_ros.engine.contact_sweep import note_left, visit_block
from rigid_sim_ros.engine.kernel import INDEX, inlined, kernel
from rigid_sim_ros.engine.lanes import LANES
from rigid_sim_ros.engine.solver_bodies import (
    most_slots, SECOND_BEGIN, SECOND_END, STRIDE)

# In so many sweeps at most others hear of a rough change.
CALMING_SWEEPS = 30


class Calming(NamedTuple):
    """Which blocks hold a body, and a clock that counts visits."""

    listed: IntArray  # (1,) 1 when the lists are those of this step
    first: IntArray  # (slots + 2,) where the blocks of a slot begin in `member`
    member: IntArray  # (16 blocks,) of 32 bits
    reached: IntArray  # (blocks,) when a visit last changed a body of a block roughly
    visited: IntArray  # (blocks,) when a block was visited last


def make_calming(n: int, capacity: int) -> Calming:
    """Return room for n bodies and `capacity` manifolds."""
    blocks = most_blocks(capacity)
    return Calming(integers(1), integers(most_slots(n) + 2),
                   room(2 * LANES * blocks, kind=np.int32), integers(blocks), integers(blocks))


@inlined
def _block(blocks: Blocks, k: int) -> int:
    """Return the block that is number k of all regions."""
    region = 0
    while k >= blocks.count[region]:
        k -= blocks.count[region]
        region += 1
    return first_block(blocks, region) + k


@kernel
def calm(blocks: Blocks, motion: Array, used: IntArray, work: Calming, inv_h: float) -> None:
    """Visit what a rough change reached, until there is no more; see SolverBodies for `used`."""
    count = blocks.count[0] + blocks.count[1] + blocks.count[2]
    if work.listed[0] == 0:
        _list_blocks(count, blocks, used, work.first, work.member)
        work.listed[0] = 1
    # The sweep before this was visit 1, 2, ... in the order of the blocks.
    for k in range(count):
        block = _block(blocks, k)
        work.reached[block], work.visited[block] = 0, k + 1
    for k in range(count):
        _shake(blocks, _block(blocks, k), k + 1, work)
    clock = count
    for k in range(CALMING_SWEEPS):
        before = clock
        for j in range(count):
            block = _block(blocks, count - 1 - j if k % 2 == 0 else j)
            if work.reached[block] > work.visited[block]:
                residual = visit_block(blocks, block, motion, motion, Sweep(inv_h, 0.0, False))
                note_left(blocks, block, residual)
                clock += 1
                work.visited[block] = clock
                _shake(blocks, block, clock, work)
        if clock == before:
            break


@kernel
def _shake(blocks: Blocks, block: int, clock: int, work: Calming) -> None:
    """Note whom the last visit to a block reached: all blocks of what it changed roughly."""
    if blocks.left[block] < SHAKEN:
        return
    for i in range(LANES):
        if blocks.left[block] & SHAKEN << i != 0:
            for at in (blocks.at_A[block * LANES + i], blocks.at_B[block * LANES + i]):
                slot = (at & INDEX) // STRIDE
                for k in range(work.first[slot], work.first[slot + 1]):
                    work.reached[work.member[k] & INDEX] = clock


@kernel
def _list_blocks(count: int, blocks: Blocks, used: IntArray, first: IntArray,
                 member: IntArray) -> None:
    """List the blocks of each slot that moves: count, add up, distribute."""
    first[:used[SECOND_END] + 2] = 0
    for k in range(count):
        block = _block(blocks, k)
        for lane in range(block * LANES, (block + 1) * LANES):
            first[(blocks.at_A[lane] & INDEX) // STRIDE + 2] += 1
            first[(blocks.at_B[lane] & INDEX) // STRIDE + 2] += 1
    first[2] = first[used[SECOND_BEGIN] + 2] = 0
    for slot in range(2, used[SECOND_END] + 1):
        first[slot + 1] += first[slot]
    # What is the start of a slot now, one place too far on, moves to its end.
    for k in range(count):
        block = _block(blocks, k)
        for lane in range(block * LANES, (block + 1) * LANES):
            for at in (blocks.at_A[lane], blocks.at_B[lane]):
                slot = (at & INDEX) // STRIDE
                if slot > 0 and slot != used[SECOND_BEGIN]:
                    member[first[slot + 1]] = block
                    first[slot + 1] += 1
