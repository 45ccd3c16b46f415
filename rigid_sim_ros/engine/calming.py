# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How an impact runs its course within one substep of the sequential solver.

A sweep visits every block of contacts once, in a fixed order. What a rough change reaches after
its visit, such as the far end of a row of balls, would wait for the next sweep; here it is visited
at once, and what that changes roughly, and so on.

All that waits is visited in turns, against the order of the sweep and along it: across, in both
halves, in both halves again, across. So the halves have two visits at a time to themselves, and
two cores may pay them: no body of one half is touched by a contact of the other.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import IntArray, integers, room
from rigid_sim_ros.engine.coloring import BETWEEN, Blocks, first_block, most_blocks, SHAKEN
from rigid_sim_ros.engine.contact_rules import Sweep
from rigid_sim_ros.engine.contact_sweep import note_left, visit_block
from rigid_sim_ros.engine.kernel import apart, INDEX, kernel
from rigid_sim_ros.engine.lanes import LANES
from rigid_sim_ros.engine.solver_bodies import most_slots, slots_of, SolverBodies, STRIDE

# So many turns at most. What waits then has to wait for the next sweep.
CALMING_TURNS = 15


class Calming(NamedTuple):
    """Which blocks hold a body, and which are to be visited again."""

    listed: IntArray  # (2,) 1 when the lists of the slots of a half are those of this step
    # The list of a slot leads from place to place, to -1. Places are numbers 2 lane of a block's
    # body A and 2 lane + 1 of its B, with lanes counted over all blocks.
    first: IntArray  # (slots,) of 32 bits, where it begins
    further: IntArray  # (16 blocks,) of 32 bits, the place after a place
    waits: IntArray  # (blocks,) of 8 bits, 1 for what a rough change reached after its last visit


def make_calming(n: int, capacity: int) -> Calming:
    """Return room for n bodies and `capacity` manifolds."""
    blocks = most_blocks(capacity)
    return Calming(integers(2), room(most_slots(n), kind=np.int32),
                   room(2 * LANES * blocks, kind=np.int32), room(blocks, kind=np.int8))


@kernel
def tell_of_sweep(region: int, was_rough: bool, blocks: Blocks, bodies: SolverBodies,
                  work: Calming) -> None:
    """
    Let those wait whom a rough change reached after the visit that a sweep through a region paid.

    It visited the blocks in their order, what is across after the halves: who comes later has
    heard of what was before.
    """
    first, count = first_block(blocks, region), blocks.count[region]
    if not was_rough:
        work.waits[first:first + count] = 0
        return
    for block in range(first, first + count):
        work.waits[block] = 0
        _tell(region, blocks, block, bodies, work)


@kernel
def calm(region: int, blocks: Blocks, bodies: SolverBodies, what: Sweep, work: Calming) -> bool:
    """
    Visit what waits in a region, in a half back and forth, across forth only, as a turn ends.

    Returns whether anybody may wait afterwards: in this half; and, if any was visited across,
    whomever that told.
    """
    if region == BETWEEN:
        return visit_waiting(region, False, blocks, bodies, what, work)
    visit_waiting(region, True, blocks, bodies, what, work)
    visit_waiting(region, False, blocks, bodies, what, work)
    first, any_waits = first_block(blocks, region), False
    for block in range(first, first + blocks.count[region]):
        any_waits |= work.waits[block] == 1
    return any_waits


@apart
def visit_waiting(region: int, backwards: bool, blocks: Blocks, bodies: SolverBodies,
                  what: Sweep, work: Calming) -> bool:
    """Visit what waits in a region, in its order or the opposite one; return whether any did."""
    first, count, any_did = first_block(blocks, region), blocks.count[region], False
    for j in range(count):
        block = first + (count - 1 - j if backwards else j) & INDEX
        if work.waits[block] == 1:
            any_did = True
            note_left(blocks, block,
                      visit_block(blocks, block, bodies.motion, bodies.motion, what))
            work.waits[block] = 0
            _tell(region, blocks, block, bodies, work)
    return any_did


@kernel
def _tell(region: int, blocks: Blocks, block: int, bodies: SolverBodies, work: Calming) -> None:
    """Let all other blocks of whom the last visit to a block changed roughly wait for theirs."""
    if blocks.left[block] < SHAKEN:
        return
    for half in range(2):
        if (half == region or region == BETWEEN) and work.listed[half] == 0:
            _list_blocks(half, blocks, bodies, work)
            work.listed[half] = 1
    for i in range(LANES):
        if blocks.left[block] & SHAKEN << i != 0:
            for at in (blocks.at_A[block * LANES + i], blocks.at_B[block * LANES + i]):
                place = work.first[(at & INDEX) // STRIDE]
                while place >= 0:
                    work.waits[(place & INDEX) // (2 * LANES)] = 1
                    place = work.further[place & INDEX]
    work.waits[block] = 0


@kernel
def _list_blocks(half: int, blocks: Blocks, bodies: SolverBodies, work: Calming) -> None:
    """List the places of each slot of a half that moves: those in the half and those across."""
    still, last = slots_of(bodies.used, half)
    work.first[still:last] = -1
    for region in (half, BETWEEN):
        begin = first_block(blocks, region) * LANES
        for lane in range(begin, begin + blocks.count[region] * LANES):
            a, b = (blocks.at_A[lane] & INDEX) // STRIDE, (blocks.at_B[lane] & INDEX) // STRIDE
            if still < a < last:
                work.further[2 * lane], work.first[a] = work.first[a], 2 * lane
            if still < b < last:
                work.further[2 * lane + 1], work.first[b] = work.first[b], 2 * lane + 1
