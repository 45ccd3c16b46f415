# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Impacts within a substep of the sequential solver: what closes a gap stops, or passes on.

Where contacts close faster than forces alone would make them in a substep, velocities change at
once, before forces act. The impulses of that start from 0 and act once: the next substep begins
with those that bear forces, not with these. Each visit to a manifold takes the impulses >= 0
that stop its approach as nearly as they can, which is a descent of the kinetic energy

    T(f) = T(0) + f . b + f . A f / 2,    f >= 0,   b = J v < 0 where points approach,

so whatever the order of the visits, their number and the masses, no energy is made (Moreau,
Unilateral contact and dry friction in finite freedom dynamics, 1988, for an inelastic impact as
the closest admissible velocity in the kinetic metric, which is the end of this descent).

A visit that changes velocities lets the other manifolds of the same bodies wait for theirs. All
that waits is visited in turns, against the order of the sweep and along it: across, in both
halves, in both halves again, across. So the halves have two visits at a time to themselves, and
two cores may pay them: no body of one half is touched by a contact of the other.

A pair that would not have met as it moved is dormant, and wakes when it is told to wait.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.constraints.contact_rules import SETTLED_POINT, Sweep
from rigid_sim_ros.engine.solver.block_impacts import begin_impact, end_impact
from rigid_sim_ros.engine.solver.coloring import BETWEEN, Blocks, first_block, most_blocks
from rigid_sim_ros.engine.solver.contact_sweep import begin_block, drift_block, visit_lanes
from rigid_sim_ros.engine.solver.solver_bodies import most_slots, slots_of, STRIDE
from rigid_sim_ros.kernels.arrays import Array, IntArray, integers, room
from rigid_sim_ros.kernels.eight import LANES
from rigid_sim_ros.kernels.kernel import apart, INDEX, kernel

# So many turns at most. What waits then still approaches, and has its turn in the next substep.
TURNS = 500


class Impacts(NamedTuple):
    """Which blocks hold a body, and which are to be visited again."""

    listed: IntArray  # (2,) 1 when the lists of the slots of a half are those of this step
    # The list of a slot leads from place to place, to -1. Places are numbers 2 lane of a block's
    # body A and 2 lane + 1 of its B, with lanes counted over all blocks.
    first: IntArray  # (slots,) of 32 bits, where it begins
    further: IntArray  # (16 blocks,) of 32 bits, the place after a place
    # (2, blocks) of 16 bits, the bits of the lanes that approach, or whose bodies changed since
    # their last visit; in either row those that one half told, as halves write side by side
    waits: IntArray
    hit: IntArray  # (blocks,) of 16 bits, those of the lanes that have the impulses of an impact


def make_impacts(n: int, capacity: int) -> Impacts:
    """Return room for n bodies and `capacity` manifolds."""
    blocks = most_blocks(capacity)
    return Impacts(integers(2), room(most_slots(n), kind=np.int32),
                   room(2 * LANES * blocks, kind=np.int32), room(2, blocks, kind=np.int16),
                   room(blocks, kind=np.int16))


@kernel
def find_approaching(region: int, blocks: Blocks, motion: Array, what: Sweep, tolerance: float,
                     work: Impacts) -> bool:
    """
    Let the blocks of a region wait in which something approaches; return whether any does.

    `motion` is that with which a step begins, without the forces of its first substep.
    """
    first, any_waits = first_block(blocks, region), False
    for block in range(first, first + blocks.count[region]):
        meets = begin_block(blocks, block, motion, what, tolerance)
        work.waits[0, block], work.waits[1, block], work.hit[block] = meets, 0, 0
        any_waits |= meets != 0
    return any_waits


@kernel
def drift_blocks(region: int, blocks: Blocks, drifted: Array, h: float, what: Sweep,
                 tolerance: float, work: Impacts) -> bool:
    """Move the gaps on by a drift of h [s], and find the pairs that approach at its end."""
    first, any_waits = first_block(blocks, region), False
    for block in range(first, first + blocks.count[region]):
        meets = drift_block(blocks, block, drifted, h, what, tolerance)
        work.waits[0, block], work.waits[1, block] = meets, 0
        any_waits |= meets != 0
    return any_waits


@kernel
def pass_on(region: int, blocks: Blocks, motion: Array, used: IntArray, what: Sweep,
            tolerance: float, work: Impacts) -> bool:
    """
    Visit what waits in a region, in a half back and forth, across forth only, as a turn ends.

    Returns whether anybody may wait afterwards: in this half; and, if any was visited across,
    whomever that told.
    """
    if region == BETWEEN:
        return visit_waiting(region, False, blocks, motion, used, what, tolerance, work)
    visit_waiting(region, True, blocks, motion, used, what, tolerance, work)
    visit_waiting(region, False, blocks, motion, used, what, tolerance, work)
    first, any_waits = first_block(blocks, region), False
    for block in range(first, first + blocks.count[region]):
        any_waits |= work.waits[0, block] | work.waits[1, block] != 0
    return any_waits


@apart
def visit_waiting(region: int, backwards: bool, blocks: Blocks, motion: Array, used: IntArray,
                  what: Sweep, tolerance: float, work: Impacts) -> bool:
    """Visit what waits in a region, in its order or the opposite one; return whether any did."""
    first, count, any_did = first_block(blocks, region), blocks.count[region], False
    for j in range(count):
        block = first + (count - 1 - j if backwards else j) & INDEX
        bits = work.waits[0, block] | work.waits[1, block]
        if bits != 0:
            any_did = True
            blocks.dormant[block] &= ~bits
            if bits & ~work.hit[block] != 0:
                begin_impact(blocks, block, bits & ~work.hit[block])
                work.hit[block] |= bits
            # It waits itself, too: friction and each of its points change what the others found.
            changed = visit_lanes(blocks, block, motion, what, bits, SETTLED_POINT, tolerance)
            _tell(region, blocks, block, changed, used, work)
            work.waits[0, block], work.waits[1, block] = changed, 0
    return any_did


@kernel
def end_impacts(region: int, blocks: Blocks, motion: Array, drifted: Array,
                work: Impacts) -> None:
    """
    Put back the impulses that bear forces, before the forces of a substep act.

    `drifted` is the motion before the impact.
    """
    first = first_block(blocks, region)
    for block in range(first, first + blocks.count[region]):
        if work.hit[block] != 0:
            end_impact(blocks, block, work.hit[block], motion, drifted)
            work.hit[block] = 0


@kernel
def _tell(region: int, blocks: Blocks, block: int, bits: int, used: IntArray,
          work: Impacts) -> None:
    """Let all other lanes with the bodies of these lanes of a block wait for their visits."""
    if bits == 0:
        return
    for half in range(2):
        if (half == region or region == BETWEEN) and work.listed[half] == 0:
            _list_blocks(half, blocks, used, work)
            work.listed[half] = 1
    row = 1 if region == 1 else 0
    for i in range(LANES):
        if bits & 1 << i != 0:
            for at in (blocks.at_A[block * LANES + i], blocks.at_B[block * LANES + i]):
                place = work.first[(at & INDEX) // STRIDE]
                while place >= 0:
                    lane = (place & INDEX) // 2
                    work.waits[row, lane // LANES] |= 1 << lane % LANES
                    place = work.further[place & INDEX]


@kernel
def _list_blocks(half: int, blocks: Blocks, used: IntArray, work: Impacts) -> None:
    """List the places of each slot of a half that moves: those in the half and those across."""
    still, last = slots_of(used, half)
    work.first[still:last] = -1
    for region in (half, BETWEEN):
        begin = first_block(blocks, region) * LANES
        for lane in range(begin, begin + blocks.count[region] * LANES):
            a, b = (blocks.at_A[lane] & INDEX) // STRIDE, (blocks.at_B[lane] & INDEX) // STRIDE
            if still < a < last:
                work.further[2 * lane], work.first[a] = work.first[a], 2 * lane
            if still < b < last:
                work.further[2 * lane + 1], work.first[b] = work.first[b], 2 * lane + 1
