# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How an impact runs its course within one substep of the sequential solver.

A sweep visits every block of contacts once, in a fixed order. What a rough change reaches after
its visit, such as the far end of a row of balls, would wait for the next sweep; here it is visited
at once, and what that changes roughly, and so on. A half does so by itself, before what is across
is swept; what that changes roughly may then reach both.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray, room
from rigid_sim_ros.engine.coloring import (
    BETWEEN, Blocks, first_block, most_blocks, REGIONS, SHAKEN)
from rigid_sim_ros.engine.contact_rules import Sweep
from rigid_sim_ros.engine.contact_sweep import note_left, visit_block
from rigid_sim_ros.engine.kernel import INDEX, kernel
from rigid_sim_ros.engine.lanes import LANES
from rigid_sim_ros.engine.solver_bodies import most_slots, slots_of, still_slot, STRIDE

# In so many sweeps at most others hear of a rough change.
CALMING_SWEEPS = 30
# In the notes of a region (see sequential.py): whether its blocks are listed in this step.
LISTED = 7


class Calming(NamedTuple):
    """Which blocks hold a body, and which are to be visited again."""

    # A list of a slot leads from place to place, to -1. Places are numbers 2 lane of a block's
    # body A and 2 lane + 1 of its B, with lanes counted over all blocks.
    first: IntArray  # (2, slots) of 32 bits, where those begin: in a half, and across
    further: IntArray  # (16 blocks,) of 32 bits, the place after a place
    waits: IntArray  # (blocks,) of 8 bits, 1 for what a rough change reached after its last visit


def make_calming(n: int, capacity: int) -> Calming:
    """Return room for n bodies and `capacity` manifolds."""
    blocks = most_blocks(capacity)
    return Calming(room(2, most_slots(n), kind=np.int32),
                   room(2 * LANES * blocks, kind=np.int32), room(blocks, kind=np.int8))


@kernel
def calm(region: int, blocks: Blocks, motion: Array, used: IntArray, inv_h: float, notes: Array,
         work: Calming) -> None:
    """
    Visit what rough changes in a region reached, until there is no more.

    Of a half, what else is in that half; of what is across, everything. See SolverBodies for
    `used`; notes (REGIONS, 8).
    """
    begin, end = (0, REGIONS) if region == BETWEEN else (region, region + 1)
    for listed in range(begin, end):
        if notes[listed, LISTED] == 0.0:
            _list_blocks(listed, blocks, used, work)
            notes[listed, LISTED] = 1.0
    # The sweep before this visited the blocks in their order: who comes later has heard of it.
    first = first_block(blocks, region)
    for block in range(first, first + blocks.count[region]):
        work.waits[block] = 0
        _tell(region, blocks, block, work)
    for k in range(CALMING_SWEEPS):
        if not _visit_waiting(region, begin, end, blocks, motion, k % 2 == 0, work,
                              Sweep(inv_h, 0.0, False)):
            break


@kernel
def _visit_waiting(region: int, begin: int, end: int, blocks: Blocks, motion: Array,
                   backwards: bool, work: Calming, what: Sweep) -> bool:
    """
    Visit the blocks that wait, in their order or the opposite one; return whether any did.

    Those of the regions from `begin` to `end`, because of `region`.
    """
    any_did = False
    for k in range(begin, end):
        there = end - 1 - (k - begin) if backwards else k
        first, count = first_block(blocks, there), blocks.count[there]
        for j in range(count):
            block = first + (count - 1 - j if backwards else j) & INDEX
            if work.waits[block] == 1:
                any_did = True
                note_left(blocks, block, visit_block(blocks, block, motion, motion, what))
                work.waits[block] = 0
                _tell(region, blocks, block, work)
    return any_did


@kernel
def _tell(region: int, blocks: Blocks, block: int, work: Calming) -> None:
    """Let all other blocks of whom the last visit to a block changed roughly wait for theirs."""
    if blocks.left[block] < SHAKEN:
        return
    for i in range(LANES):
        if blocks.left[block] & SHAKEN << i != 0:
            for at in (blocks.at_A[block * LANES + i], blocks.at_B[block * LANES + i]):
                for across in range(2 if region == BETWEEN else 1):
                    place = work.first[across, (at & INDEX) // STRIDE]
                    while place >= 0:
                        work.waits[(place & INDEX) // (2 * LANES)] = 1
                        place = work.further[place & INDEX]
    work.waits[block] = 0


@kernel
def _list_blocks(region: int, blocks: Blocks, used: IntArray, work: Calming) -> None:
    """List the places of each slot that moves, those of a region."""
    first, across = work.first, 1 if region == BETWEEN else 0
    for half in range(2):
        if region in (half, BETWEEN):
            begin, end = slots_of(used, half)
            first[across, begin:end] = -1
    block, count = first_block(blocks, region), blocks.count[region]
    work.waits[block:block + count] = 0
    for lane in range(block * LANES, (block + count) * LANES):
        a, b = (blocks.at_A[lane] & INDEX) // STRIDE, (blocks.at_B[lane] & INDEX) // STRIDE
        work.further[2 * lane], first[across, a] = first[across, a], 2 * lane
        work.further[2 * lane + 1], first[across, b] = first[across, b], 2 * lane + 1
    if region != BETWEEN:
        first[across, still_slot(used, region)] = -1
