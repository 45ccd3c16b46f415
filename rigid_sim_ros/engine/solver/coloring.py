# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which manifolds are solved side by side.

Manifolds get colours, greedily and in their order, so that no moving body has one colour twice;
eight of a colour fill a block. Where there are many, each piece of them is coloured by itself, and
brought into its blocks before the next. So are the regions of a world that is cut in halves (see
`partition.py`): those inside of either half, and those across.

Manifolds with one, two and more points are coloured apart from each other, and so are those of
balls, and those that resist rolling or are near but did not touch: a block then holds nothing that
only some of its lanes need.
"""

from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.constraints.contact_blocks import (
    BALLS_BEGIN, BALLS_SIZE, BLOCK_SIZE, SMALL_SIZE)
from rigid_sim_ros.engine.solver.solver_bodies import most_slots
from rigid_sim_ros.kernels.arrays import Array, IntArray, integers, room
from rigid_sim_ros.kernels.bits import fetch, FETCHING_PAYS, lowest_zero
from rigid_sim_ros.kernels.eight import EVERY, LANES
from rigid_sim_ros.kernels.kernel import INDEX, inlined, kernel, part, pasted

# Classes of manifolds. 0, 1, 2: up to one, two, four points; 3, 4, 5: the same, and they resist
# rolling; QUIET: one point and no impulse in the last step; BALLS, QUIET_BALLS: the same for balls
# that do not resist rolling.
CLASSES, QUIET, BALLS, QUIET_BALLS = 9, 6, 7, 8
# A colour is a bit of a mask; the last one means "none left", and each of its manifolds has a
# block of its own.
COLORS = 62
_NONE_LEFT = COLORS
# Manifolds in a piece. What one colour leaves in the cache, the next one needs again; the blocks
# of a piece that is too small are not full.
PIECE = 2048
# Blocks of a region that the processor's own cache has room for, about: who goes through more of
# them asks for each ahead of time, where that pays.
CACHED = 512 if FETCHING_PAYS else 1 << 40
# What a visit leaves to do in a block: an overlap; that it was pushed since the last substep; and
# the bits of the lanes that it changed, the first of which is given here.
OVERLAPPING, SHOVED, CHANGED = 1, 2, 4
# The regions of a world: the halves, the first of which has all if there is no second, and what is
# across.
REGIONS, BETWEEN = 3, 2


class Coloring(NamedTuple):
    """Room to colour c manifolds of n bodies."""

    member: IntArray  # (REGIONS, c) of 32 bits, manifolds of a region
    members: IntArray  # (REGIONS,) how many these are
    # Of the manifolds in the order of `member`, as two cores should not write next to each other:
    # class, of 8 bits; CLASSES * colour + class, of 16; lane, counted through all blocks, of 32.
    kind: IntArray  # (REGIONS, c)
    color: IntArray  # (REGIONS, c)
    lane: IntArray  # (REGIONS, c)
    mask: IntArray  # (CLASSES, slots) colours in use at the slot of a body
    # (REGIONS, CLASSES * (COLORS + 1)) manifolds of a class and colour, then their next lane
    fill: IntArray


class Blocks(NamedTuple):
    """
    The blocks of a step: room for b.

    Those of the first half begin at the start, and those across follow them; those of the second
    half begin in the middle.
    """

    count: IntArray  # type: ignore[assignment]  # (REGIONS,) how many there are
    end: IntArray  # (REGIONS,) where the last one of a region ends in `numbers`
    kind: IntArray  # (b,) class
    start: IntArray  # (b,) where its row 0 is in `numbers`, or would be
    left: IntArray  # (b,) of 16 bits, see OVERLAPPING, SHOVED and CHANGED
    dormant: IntArray  # (b,) of 16 bits, the bits of the lanes of DORMANT manifolds
    direct: IntArray  # (b,) of 16 bits, of the lanes of small islands, see direct_islands.py
    held: IntArray  # (b,) of 16 bits, of those of them whose island has a fixed body
    unsettled: IntArray  # (b,) of 16 bits, of the lanes that the latest visits changed by much
    residual: Array  # (b,) largest change of velocity that the last visit made [m/s]
    again: IntArray  # (b,) of 32 bits, those of a region with something left, from its first on
    numbers: Array  # flat, the rows of contact_blocks.py
    row: IntArray  # (8 b,) of 32 bits, as the next two, manifold of a lane, -1 for none
    at_A: IntArray  # (8 b,) where body A of a lane stands in SolverBodies.motion
    at_B: IntArray


def make_coloring(n: int, capacity: int) -> Coloring:
    """Return room for the manifolds of n bodies."""
    each = REGIONS, capacity
    return Coloring(room(*each, kind=np.int32), integers(REGIONS), room(*each, kind=np.int8),
                    room(*each, kind=np.int16), room(*each, kind=np.int32),
                    integers(CLASSES, most_slots(n)), integers(REGIONS, CLASSES * (COLORS + 1)))


def make_blocks(capacity: int) -> Blocks:
    """Return room for so many manifolds: address space, most of which is never written."""
    b = most_blocks(capacity)

    def lanes() -> Any:
        return room(b * LANES, kind=np.int32)

    return Blocks(integers(REGIONS), integers(REGIONS), integers(b), integers(b),
                  room(b, kind=np.int16), room(b, kind=np.int16), room(b, kind=np.int16),
                  room(b, kind=np.int16), room(b, kind=np.int16), room(b),
                  room(b, kind=np.int32),
                  room((b + 1) * BLOCK_SIZE),
                  lanes(), lanes(), lanes())


def most_blocks(capacity: int) -> int:
    """Return room for the blocks of so many manifolds, whatever region they are in."""
    return 2 * capacity     # none is empty


@inlined
def points_in(kind: int) -> int:
    """Return 1, 2 or 3 for a class with up to one, two or four points."""
    return 1 if kind >= QUIET else kind % 3 + 1


@inlined
def resists(kind: int) -> bool:
    """Return whether manifolds of a class resist rolling."""
    return 3 <= kind < QUIET


@inlined
def is_small(kind: int) -> bool:
    """Return whether manifolds of a class have one point, do not resist rolling, are no balls."""
    return kind == 0 or kind == QUIET


@inlined
def are_balls(kind: int) -> bool:
    """Return whether the blocks of a class are those of sphere_sweep.py."""
    return kind >= BALLS


@kernel
def _extent(kind: int) -> tuple[int, int]:
    """Return how many numbers a block of a class has, and without how many before them."""
    if are_balls(kind):
        return BALLS_SIZE, BALLS_BEGIN * LANES
    return (SMALL_SIZE if is_small(kind) else BLOCK_SIZE), 0


@pasted
def numbers_of(blocks: Blocks, block: int) -> Array:
    """Return the rows of a block, and what follows."""
    first = blocks.start[block] & INDEX
    return blocks.numbers[first:first + BLOCK_SIZE]


@part
def fetch_block(blocks: Blocks, block: int) -> None:
    """
    Ask for the rows of a block that is needed soon; there may be none of that number.

    A visit is so long that the processor does not see the next one coming, and of what is read row
    by row it asks for nothing beyond the end of a page.
    """
    block = min(max(block, 0), blocks.kind.shape[0] - 1)
    size, skipped = _extent(blocks.kind[block])
    begin, end = skipped // LANES, (skipped + size) // LANES
    if are_balls(blocks.kind[block]):
        # Most do not overlap.
        begin, end = begin + 1, end - 1
    for row in range(begin, end):
        fetch(blocks.numbers, (blocks.start[block] + row * LANES) & INDEX)


@pasted
def lanes_of(block: int) -> slice:
    """Return where the lanes of a block are among all lanes."""
    first = block * LANES & INDEX
    return slice(first, first + LANES)


@inlined
def awake_in(blocks: Blocks, block: int) -> int:
    """Return the bits of the lanes of a block that sweeps visit."""
    return EVERY & ~(blocks.dormant[block] | blocks.direct[block])


@inlined
def first_block(blocks: Blocks, region: int) -> int:
    """Return the first block of a region; that of what is across once the first half has its."""
    if region == BETWEEN:
        return blocks.count[0]
    return region * (blocks.kind.shape[0] // 2)


@kernel
def begin_blocks(region: int, blocks: Blocks) -> None:
    """Let a region have no blocks yet."""
    # Balls have no rows before BALLS_BEGIN: where these would be, the block before ends.
    end = first_block(blocks, region) * BLOCK_SIZE + BALLS_BEGIN * LANES
    blocks.count[region], blocks.end[region] = 0, blocks.end[0] if region == BETWEEN else end


@part
def color_piece(region: int, begin: int, end: int, body_a: IntArray, body_b: IntArray,
                slot: IntArray, work: Coloring) -> int:
    """
    Give the manifolds of a region from `begin` to `end` their colours; return how many those are.

    And count the manifolds of each. slot is that of a body, 0 where it does not move.
    """
    work.fill[region, :] = 0
    highest = 0
    for k in range(begin, end):
        r, kind = work.member[region, k] & INDEX, work.kind[region, k]
        a, b = slot[body_a[r] & INDEX] & INDEX, slot[body_b[r] & INDEX] & INDEX
        if a != 0:
            work.mask[kind, a] = 0
        if b != 0:
            work.mask[kind, b] = 0
    for k in range(begin, end):
        r, kind = work.member[region, k] & INDEX, work.kind[region, k]
        a, b = slot[body_a[r] & INDEX] & INDEX, slot[body_b[r] & INDEX] & INDEX
        color = min(lowest_zero(work.mask[kind, a] | work.mask[kind, b]), _NONE_LEFT)
        if color < _NONE_LEFT:
            # A body that does not move may be anywhere: its bits are never set.
            if a != 0:
                work.mask[kind, a] |= 1 << color
            if b != 0:
                work.mask[kind, b] |= 1 << color
        work.color[region, k] = color * CLASSES + kind
        work.fill[region, color * CLASSES + kind] += 1
        highest = max(highest, color)
    return highest + 1


@part
def make_room(region: int, begin: int, end: int, colors: int, work: Coloring,
              blocks: Blocks) -> None:
    """Give a piece of coloured manifolds its lanes, in blocks behind those that there are."""
    first = first_block(blocks, region)
    block, place = first + blocks.count[region], blocks.end[region]
    for kind in range(CLASSES):
        size, skipped = _extent(kind)
        for color in range(colors):
            at = color * CLASSES + kind
            wanted = work.fill[region, at]
            work.fill[region, at] = block * LANES
            more = wanted if color == _NONE_LEFT else (wanted + LANES - 1) // LANES
            for _ in range(more):
                blocks.kind[block], blocks.start[block] = kind, place - skipped
                place += size
                block += 1
    for k in range(begin, end):
        at = work.color[region, k]
        work.lane[region, k] = work.fill[region, at]
        work.fill[region, at] += LANES if at // CLASSES == _NONE_LEFT else 1
    blocks.count[region], blocks.end[region] = block - first, place
