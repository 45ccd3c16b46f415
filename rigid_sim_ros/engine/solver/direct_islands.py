# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Small islands: the bodies that hang together by contacts, where they are few.

Sweeps over contacts end near a solution that depends on their order, as near as their tolerance
times the number of sweeps that an error lives. An island of few bodies can do better: it is swept
until it is settled, and if that takes long, its impulses are found all at once; see
direct_solve.py. So is what sweeps do badly: a light body between heavy ones hands on about twice
its mass over theirs of what is missing, and until the sweeps have ended, thousands of them for a
ratio of a thousand, what lies on it sinks. No other manifold has a body of an island.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.constraints.contact_blocks import IMPULSE, POINT, POINT_ROWS
from rigid_sim_ros.engine.maths.union_find import first_of, unite
from rigid_sim_ros.engine.solver.block_impacts import begin_impact
from rigid_sim_ros.engine.solver.coloring import (
    Blocks, first_block, most_blocks, numbers_of, points_in, REGIONS)
from rigid_sim_ros.engine.solver.impacts import Impacts
from rigid_sim_ros.engine.solver.solver_bodies import (
    INV_M, most_slots, slots_of, SolverBodies, STRIDE)
from rigid_sim_ros.kernels.arrays import Array, IntArray, integers, room
from rigid_sim_ros.kernels.eight import LANES
from rigid_sim_ros.kernels.kernel import INDEX, kernel

# Masses of an island that differ more are not swept.
RATIO = 30.0
# Worlds with more manifolds have small islands of uneven masses only: some hundred islands that
# fall over at the same time would take 0.1 ms each, a hundred times what sweeps take.
FEW = 64
# Of a small island. The direct solution takes the cube of the number of bodies.
MOST_BODIES, MOST_MANIFOLDS = 16, 48


class Islands(NamedTuple):
    """Room for the small islands of n bodies and c manifolds."""

    count: IntArray  # type: ignore[assignment]  # (1,) how many there are
    parent: IntArray  # (slots,) of 32 bits, a slot of the same island, its own at the root
    bodies: IntArray  # (slots,) of 32 bits, at the root: how many bodies, then which island
    manifolds: IntArray  # (slots,) of 32 bits, at the root: manifolds, then the next place
    held: IntArray  # (slots,) of 8 bits, at the root: 1 if something fixed is in contact with it
    heaviest: Array  # (slots,) [kg^-1] at the root: the inverse mass of the heaviest body
    lightest: Array  # (slots,) [kg^-1] at the root: of the lightest one
    share: Array  # (slots,) at the root: the part of the last impulses to begin with
    bend: Array  # (slots,) [J] at the root: twice the energy of these alone
    begin: IntArray  # (islands + 1,) of 32 bits, where the lanes of an island begin in `lane`
    lane: IntArray  # (c,) of 32 bits, lanes, counted over all blocks, island by island
    uneven: IntArray  # (islands,) of 8 bits, 1 if its masses differ by more than RATIO
    redundant: IntArray  # (islands,) of 8 bits, 1 if it has more manifolds than bodies
    blocks: IntArray  # (1,) how many blocks have lanes of small islands
    block: IntArray  # (blocks,) of 32 bits, which
    number: IntArray  # (8 blocks,) of 32 bits, the island of a lane, written where it has one
    visited: IntArray  # (blocks,) of 16 bits, the bits of the lanes that the next sweep visits
    moved: IntArray  # (islands,) of 8 bits, 1 if a visit changed anything that counts


def make_islands(n: int, capacity: int) -> Islands:
    """Return room for n bodies and `capacity` manifolds."""
    slots = most_slots(n)

    def numbers(count: int) -> IntArray:
        found: IntArray = room(count, kind=np.int32)
        return found

    blocks = most_blocks(capacity)
    return Islands(integers(1), numbers(slots), numbers(slots), numbers(slots),
                   room(slots, kind=np.int8), room(slots), room(slots), room(slots), room(slots),
                   numbers(slots + 1), numbers(capacity), room(slots, kind=np.int8),
                   room(slots, kind=np.int8), integers(1),
                   numbers(blocks), numbers(LANES * blocks), room(blocks, kind=np.int16),
                   room(slots, kind=np.int8))


def differ(inv_m: Array) -> bool:
    """Return whether masses differ by more than RATIO; inv_m (n,) [1/kg], 0 for what is fixed."""
    moving = inv_m[inv_m > 0.0]
    return len(moving) > 0 and bool(moving.max() > RATIO * moving.min())


@kernel
def find_islands(few: bool, blocks: Blocks, bodies: SolverBodies, islands: Islands) -> None:
    """Find the small islands, of a world with many manifolds the uneven ones; mark their lanes."""
    _begin(bodies, islands)
    for region in range(REGIONS):
        first = first_block(blocks, region) * LANES
        for lane in range(first, first + blocks.count[region] * LANES):
            a, b = _slots(blocks, lane)
            if blocks.row[lane] >= 0 and _moves(bodies, a) and _moves(bodies, b):
                unite(islands.parent, a, b)
    _weigh(bodies, islands)
    for region in range(REGIONS):
        first = first_block(blocks, region)
        for block in range(first, first + blocks.count[region]):
            blocks.direct[block] = blocks.held[block] = 0
            for lane in range(block * LANES, (block + 1) * LANES):
                if blocks.row[lane] >= 0:
                    root, (a, b) = root_of(blocks, bodies, islands, lane), _slots(blocks, lane)
                    islands.manifolds[root] += 1
                    if not (_moves(bodies, a) and _moves(bodies, b)):
                        islands.held[root] = 1
    _number(few, bodies, islands)
    islands.blocks[0] = 0
    for region in range(REGIONS):
        first = first_block(blocks, region)
        for block in range(first, first + blocks.count[region]):
            for i in range(LANES):
                if blocks.row[block * LANES + i] >= 0:
                    _list_lane(blocks, bodies, islands, block, i)
            if blocks.direct[block] != 0:
                islands.block[islands.blocks[0]] = block
                islands.blocks[0] += 1


@kernel
def _slots(blocks: Blocks, lane: int) -> tuple[int, int]:
    """Return the slots of both bodies of a lane."""
    return (blocks.at_A[lane] & INDEX) // STRIDE, (blocks.at_B[lane] & INDEX) // STRIDE


@kernel
def _moves(bodies: SolverBodies, slot: int) -> bool:
    return bool(bodies.motion[slot * STRIDE + INV_M] > 0.0)


@kernel
def _begin(bodies: SolverBodies, islands: Islands) -> None:
    """Let every slot be an island of its own."""
    islands.count[0] = 0
    for half in range(2):
        first, last = slots_of(bodies.used, half)
        for slot in range(first, last):
            islands.parent[slot] = slot
            islands.bodies[slot] = islands.manifolds[slot] = islands.held[slot] = 0
            islands.heaviest[slot], islands.lightest[slot] = np.inf, 0.0


@kernel
def _weigh(bodies: SolverBodies, islands: Islands) -> None:
    """Count the bodies of the islands, and find their lightest and heaviest."""
    for half in range(2):
        first, last = slots_of(bodies.used, half)
        for slot in range(first, last):
            if _moves(bodies, slot):
                root, inv_m = first_of(islands.parent, slot), bodies.motion[slot * STRIDE + INV_M]
                islands.bodies[root] += 1
                islands.heaviest[root] = min(islands.heaviest[root], inv_m)
                islands.lightest[root] = max(islands.lightest[root], inv_m)


@kernel
def root_of(blocks: Blocks, bodies: SolverBodies, islands: Islands, lane: int) -> int:
    """Return the root of the island that a lane is in."""
    a, b = _slots(blocks, lane)
    return first_of(islands.parent, a if _moves(bodies, a) else b)


@kernel
def is_uneven(islands: Islands, root: int) -> bool:
    """Return whether the masses of an island differ by more than RATIO."""
    return bool(islands.lightest[root] > RATIO * islands.heaviest[root])


@kernel
def _number(few: bool, bodies: SolverBodies, islands: Islands) -> None:
    """Choose the islands, in the order of their roots, and where each has its lanes."""
    count = islands.begin[0] = 0
    for half in range(2):
        first, last = slots_of(bodies.used, half)
        for slot in range(first, last):
            manifolds = islands.manifolds[slot]
            islands.manifolds[slot] = -1
            uneven = is_uneven(islands, slot)
            if (0 < manifolds <= MOST_MANIFOLDS and islands.bodies[slot] <= MOST_BODIES
                    and (few or uneven)):
                islands.manifolds[slot] = islands.begin[count]
                islands.begin[count + 1] = islands.begin[count] + manifolds
                islands.uneven[count] = 1 if uneven else 0
                islands.redundant[count] = 1 if manifolds > islands.bodies[slot] else 0
                islands.bodies[slot] = count
                count += 1
    islands.count[0] = count


@kernel
def _list_lane(blocks: Blocks, bodies: SolverBodies, islands: Islands, block: int,
               i: int) -> None:
    """List lane i of a block, if it is in an island that was chosen; note whether that is held."""
    lane = block * LANES + i
    root = root_of(blocks, bodies, islands, lane)
    place = islands.manifolds[root]
    if place >= 0 or is_uneven(islands, root):
        blocks.held[block] |= islands.held[root] << i
    if place >= 0:
        islands.lane[place & INDEX], islands.manifolds[root] = lane, place + 1
        islands.number[lane] = islands.bodies[root]
        blocks.direct[block] |= 1 << i


@kernel
def begin_island_impact(blocks: Blocks, islands: Islands, island: int, impacts: Impacts) -> bool:
    """
    Let the impulses of an island be those of an impact, if anything in it waits for its part.

    Returns whether anything did. Nothing is dormant or waits any more.
    """
    lanes = islands.lane[islands.begin[island]:islands.begin[island + 1]]
    waited = False
    for lane in lanes:
        block, bit = lane // LANES, 1 << lane % LANES
        waited |= (impacts.waits[0, block] | impacts.waits[1, block]) & bit != 0
    if waited:
        for lane in lanes:
            block, bit = lane // LANES, 1 << lane % LANES
            impacts.waits[0, block] &= ~bit
            impacts.waits[1, block] &= ~bit
            blocks.dormant[block] &= ~bit
            if impacts.hit[block] & bit == 0:
                begin_impact(blocks, block, bit)
                impacts.hit[block] |= bit
    return waited


@kernel
def let_island_wait(islands: Islands, island: int, impacts: Impacts) -> None:
    """Let all manifolds of an island wait for their part in an impact."""
    for lane in islands.lane[islands.begin[island]:islands.begin[island + 1]]:
        impacts.waits[0, lane // LANES] |= 1 << lane % LANES


@kernel
def begins_to_bear(blocks: Blocks, fresh: IntArray, islands: Islands, island: int) -> bool:
    """
    Return whether a redundant island has fresh manifolds that have impulses now, and note these.

    `fresh` (blocks,): the bits of lanes without an impulse so far. Of redundant contacts sweeps
    give most to the first one that they come to: of four tiles below a disk one bore 84 %, and of
    two belts that pulled two ways the first one won. Found at once from none on, impulses are the
    smallest ones, which are symmetric where the scene is. Sweeps leave them so.
    """
    if islands.redundant[island] == 0:
        return False
    found = False
    for lane in islands.lane[islands.begin[island]:islands.begin[island + 1]]:
        block, i = lane // LANES, lane % LANES
        if fresh[block] & 1 << i != 0:
            b, pressure = numbers_of(blocks, block), 0.0
            for point in range(points_in(blocks.kind[block])):
                pressure += b[(POINT + point * POINT_ROWS + IMPULSE) * LANES + i]
            if pressure > 0.0:
                fresh[block] &= ~(1 << i)
                found = True
    return found
