# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Islands whose contacts are new, as all are at the start of a scene: where their impulses begin.

A warm start from nothing lets a stack sink until its impulses have grown. So where a body touches
something and nothing pressed it in the step before, and half of all that touches in its island is
new, the impulses that bear the forces of a substep are found first, by many sweeps. Who takes part
follows from the island alone: what is elsewhere in the world changes nothing in it.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.constraints.contact_blocks import SIZE, smallest_gap
from rigid_sim_ros.engine.constraints.contact_rules import SETTLED, SKIN, Sweep
from rigid_sim_ros.engine.maths.union_find import first_of, unite
from rigid_sim_ros.engine.solver.block_impacts import excuse_approach, forget_excuse
from rigid_sim_ros.engine.solver.coloring import (
    awake_in, Blocks, first_block, most_blocks, numbers_of, points_in, REGIONS)
from rigid_sim_ros.engine.solver.contact_sweep import visit_lanes
from rigid_sim_ros.engine.solver.solver_bodies import (
    INV_M, kick, most_slots, slots_of, SolverBodies, STRIDE, unkick)
from rigid_sim_ros.kernels.arrays import Array, IntArray, integers, room
from rigid_sim_ros.kernels.eight import bits_of, LANES, load
from rigid_sim_ros.kernels.kernel import apart, INDEX, kernel

# The sweeps of an island end when they change less than this part of what is SETTLED: what is left
# of a friction that grows with its pressure lets a box creep on a slope.
ENDS = 1e-6


class NewIslands(NamedTuple):
    """Room for the islands of n bodies and c manifolds."""

    count: IntArray  # type: ignore[assignment]  # (REGIONS,) blocks that take part
    block: IntArray  # (blocks,) of 32 bits, those of a region from its first block on
    lanes: IntArray  # (blocks,) of 16 bits, the bits of the lanes that are still visited
    parent: IntArray  # (slots,) of 32 bits, the first slot of the island, its root
    touching: IntArray  # (slots,) of 32 bits, at the root: manifolds that touch
    new: IntArray  # (slots,) of 32 bits, at the root: those without an impulse to begin with
    begins: IntArray  # (slots,) of 8 bits, at the root: 1 if the island takes part
    moved: IntArray  # (slots,) of 8 bits, at the root: 1 if a visit of this round changed anything


def make_new_islands(n: int, capacity: int) -> NewIslands:
    """Return room for n bodies and `capacity` manifolds."""
    slots, blocks = most_slots(n), most_blocks(capacity)
    return NewIslands(integers(REGIONS), room(blocks, kind=np.int32), room(blocks, kind=np.int16),
                      room(slots, kind=np.int32), room(slots, kind=np.int32),
                      room(slots, kind=np.int32), room(slots, kind=np.int8),
                      room(slots, kind=np.int8))


@kernel
def find_new_islands(blocks: Blocks, bodies: SolverBodies, fresh: IntArray,
                     work: NewIslands) -> bool:
    """
    List the lanes of the islands in which most is new; return whether there are any.

    fresh (blocks,) are the bits of the lanes that touch without an impulse to begin with.
    """
    if not _any_begins(blocks, bodies, fresh):
        return False
    _find_islands(blocks, bodies, work)
    _count_new(blocks, bodies, fresh, work)
    begins = False
    for half in range(2):
        first, last = slots_of(bodies.used, half)
        for slot in range(first, last):
            most = work.begins[slot] == 1 and 2 * work.new[slot] > work.touching[slot]
            work.begins[slot] = 1 if most else 0
            begins |= most
    if begins:
        _list_lanes(blocks, bodies, work)
    return begins


@kernel
def _any_begins(blocks: Blocks, bodies: SolverBodies, fresh: IntArray) -> bool:
    """Return whether anything new touches a body that nothing pressed."""
    for region in range(REGIONS):
        first = first_block(blocks, region)
        for block in range(first, first + blocks.count[region]):
            bits = fresh[block] & awake_in(blocks, block)
            for i in range(LANES if bits != 0 else 0):
                if bits & 1 << i != 0 and _is_first(blocks, bodies, block * LANES + i):
                    return True
    return False


@kernel
def _is_first(blocks: Blocks, bodies: SolverBodies, lane: int) -> bool:
    """Return whether nothing presses a body of a lane yet."""
    return (_is_unpressed(bodies, blocks.at_A[lane] & INDEX)
            or _is_unpressed(bodies, blocks.at_B[lane] & INDEX))


@kernel
def _is_unpressed(bodies: SolverBodies, at: int) -> bool:
    """Return whether a body that moves begins without impulses."""
    if bodies.motion[at + INV_M] == 0.0:
        return False
    for k in range(6):
        if bodies.base[at + k] != 0.0:
            return False
    return True


@kernel
def _find_islands(blocks: Blocks, bodies: SolverBodies, work: NewIslands) -> None:
    """Make one set of the bodies that lanes connect which sweeps visit."""
    for half in range(2):
        first, last = slots_of(bodies.used, half)
        for slot in range(first, last):
            work.parent[slot] = slot
            work.touching[slot] = work.new[slot] = 0
            work.begins[slot] = work.moved[slot] = 0
    for region in range(REGIONS):
        first = first_block(blocks, region)
        for block in range(first, first + blocks.count[region]):
            bits = awake_in(blocks, block)
            for i in range(LANES):
                a, b = blocks.at_A[block * LANES + i] & INDEX, blocks.at_B[block * LANES + i]
                if bits & 1 << i != 0 and bodies.motion[a + INV_M] > 0.0 and (
                        bodies.motion[(b & INDEX) + INV_M] > 0.0):
                    unite(work.parent, a // STRIDE, b // STRIDE)
    for half in range(2):
        first, last = slots_of(bodies.used, half)
        for slot in range(first, last):
            work.parent[slot] = first_of(work.parent, slot)


@kernel
def _root(blocks: Blocks, bodies: SolverBodies, work: NewIslands, lane: int) -> int:
    """Return the root of the island that a lane is in."""
    a, b = blocks.at_A[lane] & INDEX, blocks.at_B[lane] & INDEX
    return work.parent[(a if bodies.motion[a + INV_M] > 0.0 else b) // STRIDE] & INDEX


@kernel
def _count_new(blocks: Blocks, bodies: SolverBodies, fresh: IntArray, work: NewIslands) -> None:
    """Count the manifolds of each island, and mark those with a body that nothing pressed."""
    for region in range(REGIONS):
        first = first_block(blocks, region)
        for block in range(first, first + blocks.count[region]):
            b, awake = numbers_of(blocks, block), awake_in(blocks, block)
            touches = awake & bits_of(
                smallest_gap(b, points_in(blocks.kind[block])) < SKIN * load(b, SIZE))
            for i in range(LANES if touches != 0 else 0):
                if touches & 1 << i != 0:
                    root = _root(blocks, bodies, work, block * LANES + i)
                    work.touching[root] += 1
                    if fresh[block] & 1 << i != 0:
                        work.new[root] += 1
                        if _is_first(blocks, bodies, block * LANES + i):
                            work.begins[root] = 1


@kernel
def _list_lanes(blocks: Blocks, bodies: SolverBodies, work: NewIslands) -> None:
    """List the lanes of the islands that take part."""
    for region in range(REGIONS):
        first = first_block(blocks, region)
        work.count[region] = 0
        for block in range(first, first + blocks.count[region]):
            awake, bits = awake_in(blocks, block), 0
            for i in range(LANES):
                lane = block * LANES + i
                if awake & 1 << i != 0 and blocks.row[lane] >= 0 and (
                        work.begins[_root(blocks, bodies, work, lane)] == 1):
                    bits |= 1 << i
            work.lanes[block] = bits
            if bits != 0:
                work.block[first + work.count[region]] = block
                work.count[region] += 1


@kernel
def kick_new(half: int, begins: bool, bodies: SolverBodies, h: float, work: NewIslands) -> None:
    """
    Let forces act on the bodies of a half that take part, for h [s], as their sweeps begin.

    As these end, undo that, but for what contacts did, with which the step begins.
    """
    (first, last), alike = slots_of(bodies.used, half), bodies.alike[0] == 1
    for slot in range(first + 1, last):
        if work.begins[work.parent[slot] & INDEX] == 1:
            forces = first if alike else slot
            if begins:
                kick(slot, bodies.motion, bodies.smooth, forces, bodies.base, h)
            else:
                unkick(slot, bodies.motion, bodies.smooth, forces, bodies.base, h)


@kernel
def excuse_approaches(region: int, blocks: Blocks, motion: Array, work: NewIslands) -> None:
    """Let forces not stop what approaches in a region."""
    first = first_block(blocks, region)
    for k in range(first, first + work.count[region]):
        excuse_approach(blocks, work.block[k] & INDEX, motion)


@kernel
def forget_excuses(region: int, blocks: Blocks, work: NewIslands) -> None:
    """End what `excuse_approaches` began."""
    first = first_block(blocks, region)
    for k in range(first, first + work.count[region]):
        forget_excuse(blocks, work.block[k] & INDEX)


@apart
def sweep_new(region: int, backwards: bool, blocks: Blocks, bodies: SolverBodies, what: Sweep,
              work: NewIslands) -> None:
    """Visit what takes part in a region once, and note which islands that changed."""
    first, count = first_block(blocks, region), work.count[region]
    for k in range(count):
        block = work.block[first + (count - 1 - k if backwards else k) & INDEX] & INDEX
        bits = work.lanes[block]
        if bits != 0:
            bits = visit_lanes(blocks, block, bodies.motion, what, bits, ENDS * SETTLED, 0.0)
        for i in range(LANES if bits != 0 else 0):
            if bits & 1 << i != 0:
                work.moved[_root(blocks, bodies, work, block * LANES + i)] = 1


@kernel
def end_round(blocks: Blocks, bodies: SolverBodies, work: NewIslands) -> bool:
    """Leave alone the islands that the last sweeps did not change; return whether any are left."""
    left = False
    for region in range(REGIONS):
        first = first_block(blocks, region)
        for k in range(first, first + work.count[region]):
            block = work.block[k] & INDEX
            for i in range(LANES if work.lanes[block] != 0 else 0):
                if work.moved[_root(blocks, bodies, work, block * LANES + i)] == 0:
                    work.lanes[block] &= ~(1 << i)
            left |= work.lanes[block] != 0
    for half in range(2):
        first, last = slots_of(bodies.used, half)
        work.moved[first:last] = 0
    return left
