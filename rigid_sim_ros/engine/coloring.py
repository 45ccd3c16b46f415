# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which manifolds are solved side by side.

Manifolds get colours, greedily and in their order, so that no moving body has one colour twice;
eight of a colour fill a block. Where there are many, each piece of them is coloured by itself.
Manifolds with one, two and more points are coloured apart from each other, and so are those of
balls, and those that resist rolling or are near but did not touch: a block then holds nothing that
only some of its lanes need.
"""

from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import aligned_zeros, Array, IntArray
from rigid_sim_ros.engine.contact_blocks import (
    BALLS_BEGIN, BALLS_SIZE, BLOCK_SIZE, SMALL_SIZE)
from rigid_sim_ros.engine.kernel import INDEX, inlined, kernel, part, pasted
from rigid_sim_ros.engine.lanes import LANES

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


class Coloring(NamedTuple):
    """Room to colour c manifolds of n bodies."""

    mask: IntArray  # (CLASSES, n + 1) colours in use at the slot of a body
    kind: IntArray  # (c,) of 8 bits, classes of the manifolds
    # (c,) of 16 bits, CLASSES * colour + class of a manifold, -1: it is not solved
    color: IntArray
    # (CLASSES * (COLORS + 1),) manifolds of a class and colour, then their next lane
    fill: IntArray
    lane: IntArray  # (c,) of 32 bits, lane of a manifold, counted through all blocks


class Blocks(NamedTuple):
    """The blocks of a step: b of them, room for the most_blocks() of c manifolds."""

    kind: IntArray  # (b,) class
    start: IntArray  # (b,) where its row 0 is in `numbers`, or would be
    numbers: Array  # flat, the rows of contact_blocks.py
    row: IntArray  # (8 b,) of 32 bits, as the next two, manifold of a lane, -1 for none
    at_A: IntArray  # (8 b,) where body A of a lane stands in SolverBodies.motion
    at_B: IntArray


def make_coloring(n: int, capacity: int) -> Coloring:
    """Return room for the manifolds of n bodies."""

    def integers(*shape: int) -> IntArray:
        return np.zeros(shape, dtype=np.int64)

    kind: Any = np.zeros(capacity, dtype=np.int8)
    color: Any = np.zeros(capacity, dtype=np.int16)
    lane: Any = np.zeros(capacity, dtype=np.int32)
    return Coloring(integers(CLASSES, n + 1), kind, color, integers(CLASSES * (COLORS + 1)), lane)


def make_blocks(capacity: int) -> Blocks:
    """Return room for so many manifolds: address space, most of which is never written."""
    b = most_blocks(capacity)

    def lanes() -> Any:
        return np.zeros(b * LANES, dtype=np.int32)

    return Blocks(np.zeros(b, dtype=np.int64), np.zeros(b, dtype=np.int64),
                  aligned_zeros((b + 1) * BLOCK_SIZE), lanes(), lanes(), lanes())


def most_blocks(capacity: int) -> int:
    """Return the most blocks that so many manifolds can need."""
    return capacity // LANES + min(capacity, CLASSES * (COLORS + 1)) + capacity


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
    """Return whether the blocks of a class are those of contact_balls.py."""
    return kind >= BALLS


@pasted
def numbers_of(blocks: Blocks, block: int) -> Array:
    """Return the rows of a block, and what follows."""
    first = blocks.start[block] & INDEX
    return blocks.numbers[first:first + BLOCK_SIZE]


@pasted
def lanes_of(block: int) -> slice:
    """Return where the lanes of a block are among all lanes."""
    first = block * LANES & INDEX
    return slice(first, first + LANES)


@kernel
def color_manifolds(count: int, body_a: IntArray, body_b: IntArray, kinds: IntArray,
                    slot: IntArray, waits: IntArray, work: Coloring,
                    block_kind: IntArray, block_start: IntArray) -> int:
    """
    Give every manifold with a body that takes part its lane; return the number of blocks.

    kinds (c,) are the classes of the manifolds. slot is that of a body, 0 where it does not move.
    waits (c,) is 1 for a manifold that is left out. block_kind
    and block_start are written for `Blocks`.
    """
    # Balls have no rows before BALLS_BEGIN: where these would be, the block before ends.
    blocks, end = 0, BALLS_BEGIN * LANES
    for first in range(0, count, PIECE):
        last = min(first + PIECE, count)
        _color_piece(first, last, body_a, body_b, kinds, slot, waits, work)
        blocks, end = _place_piece(first, last, blocks, end, work, block_kind, block_start)
    return blocks


@part
def _color_piece(first: int, last: int, body_a: IntArray, body_b: IntArray, kinds: IntArray,
                 slot: IntArray, waits: IntArray, work: Coloring) -> None:
    work.fill[:] = 0
    for r in range(first, last):
        kind = kinds[r]
        work.mask[kind, slot[body_a[r] & INDEX] & INDEX] = 0
        work.mask[kind, slot[body_b[r] & INDEX] & INDEX] = 0
    for r in range(first, last):
        work.color[r] = -1
        a, b, kind = slot[body_a[r] & INDEX] & INDEX, slot[body_b[r] & INDEX] & INDEX, kinds[r]
        if waits[r] == 1 or (a == 0 and b == 0):
            continue
        color = _lowest_free(work.mask[kind, a] | work.mask[kind, b])
        if color < _NONE_LEFT:
            # A body that does not move may be anywhere: its bits are never set.
            if a != 0:
                work.mask[kind, a] |= 1 << color
            if b != 0:
                work.mask[kind, b] |= 1 << color
        work.color[r] = color * CLASSES + kind
        work.fill[color * CLASSES + kind] += 1


@kernel
def _lowest_free(mask: int) -> int:
    for color in range(COLORS):
        if mask & (1 << color) == 0:
            return color
    return _NONE_LEFT


@part
def _place_piece(first: int, last: int, blocks: int, end: int, work: Coloring,
                 block_kind: IntArray, block_start: IntArray) -> tuple[int, int]:
    """Give the lanes of a piece; return the number of blocks so far, and where they end."""
    for kind in range(CLASSES):
        size, skipped = SMALL_SIZE if is_small(kind) else BLOCK_SIZE, 0
        if are_balls(kind):
            size, skipped = BALLS_SIZE, BALLS_BEGIN * LANES
        for color in range(COLORS + 1):
            at = color * CLASSES + kind
            wanted = work.fill[at]
            work.fill[at] = blocks * LANES
            more = wanted if color == _NONE_LEFT else (wanted + LANES - 1) // LANES
            for block in range(blocks, blocks + more):
                block_kind[block], block_start[block] = kind, end - skipped
                end += size
            blocks += more
    for row in range(first, last):
        at = work.color[row]
        if at >= 0:
            work.lane[row] = work.fill[at]
            work.fill[at] += LANES if at // CLASSES == _NONE_LEFT else 1
    return blocks, end
