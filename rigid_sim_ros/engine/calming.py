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
from rigid_sim_ros.engine.coloring import Blocks, first_block, most_blocks, REGIONS, SHAKEN
from rigid_sim_ros.engine.contact_rules import Sweep
from rigid_sim_ros.engine.contact_sweep import note_left, visit_block
from rigid_sim_ros.engine.kernel import INDEX, kernel
from rigid_sim_ros.engine.lanes import LANES
from rigid_sim_ros.engine.solver_bodies import (
    most_slots, SECOND_BEGIN, SECOND_END, STRIDE)

# In so many sweeps at most others hear of a rough change.
CALMING_SWEEPS = 30


class Calming(NamedTuple):
    """Which blocks hold a body, and which are to be visited again."""

    listed: IntArray  # (1,) 1 when the lists are those of this step
    # The list of a slot leads from place to place, to -1. Places are numbers 2 lane of a block's
    # body A and 2 lane + 1 of its B, with lanes counted over all blocks.
    first: IntArray  # (slots,) of 32 bits, where it begins
    further: IntArray  # (16 blocks,) of 32 bits, the place after a place
    waits: IntArray  # (blocks,) of 8 bits, 1 for what a rough change reached after its last visit


def make_calming(n: int, capacity: int) -> Calming:
    """Return room for n bodies and `capacity` manifolds."""
    blocks = most_blocks(capacity)
    return Calming(integers(1), room(most_slots(n), kind=np.int32),
                   room(2 * LANES * blocks, kind=np.int32), room(blocks, kind=np.int8))


@kernel
def calm(blocks: Blocks, motion: Array, used: IntArray, work: Calming, inv_h: float) -> None:
    """Visit what a rough change reached, until there is no more; see SolverBodies for `used`."""
    if work.listed[0] == 0:
        _list_blocks(blocks, used, work)
        work.listed[0] = 1
    # The sweep before this visited the blocks in their order: who comes later has heard of it.
    for region in range(REGIONS):
        first = first_block(blocks, region)
        for block in range(first, first + blocks.count[region]):
            work.waits[block] = 0
            _tell(blocks, block, work)
    for k in range(CALMING_SWEEPS):
        if not _visit_waiting(blocks, motion, k % 2 == 0, work, Sweep(inv_h, 0.0, False)):
            break


@kernel
def _visit_waiting(blocks: Blocks, motion: Array, backwards: bool, work: Calming,
                   what: Sweep) -> bool:
    """Visit the blocks that wait, in their order or the opposite one; return whether any did."""
    any_did = False
    for k in range(REGIONS):
        region = REGIONS - 1 - k if backwards else k
        first, count = first_block(blocks, region), blocks.count[region]
        for j in range(count):
            block = first + (count - 1 - j if backwards else j) & INDEX
            if work.waits[block] == 1:
                any_did = True
                note_left(blocks, block, visit_block(blocks, block, motion, motion, what))
                work.waits[block] = 0
                _tell(blocks, block, work)
    return any_did


@kernel
def _tell(blocks: Blocks, block: int, work: Calming) -> None:
    """Let all other blocks of whom the last visit to a block changed roughly wait for theirs."""
    if blocks.left[block] < SHAKEN:
        return
    for i in range(LANES):
        if blocks.left[block] & SHAKEN << i != 0:
            for at in (blocks.at_A[block * LANES + i], blocks.at_B[block * LANES + i]):
                place = work.first[(at & INDEX) // STRIDE]
                while place >= 0:
                    work.waits[(place & INDEX) // (2 * LANES)] = 1
                    place = work.further[place & INDEX]
    work.waits[block] = 0


@kernel
def _list_blocks(blocks: Blocks, used: IntArray, work: Calming) -> None:
    """List the places of each slot that moves."""
    work.first[:used[SECOND_END] + 1] = -1
    for region in range(REGIONS):
        begin = first_block(blocks, region) * LANES
        for lane in range(begin, begin + blocks.count[region] * LANES):
            a, b = (blocks.at_A[lane] & INDEX) // STRIDE, (blocks.at_B[lane] & INDEX) // STRIDE
            work.further[2 * lane], work.first[a] = work.first[a], 2 * lane
            work.further[2 * lane + 1], work.first[b] = work.first[b], 2 * lane + 1
    work.first[0] = work.first[used[SECOND_BEGIN]] = -1
