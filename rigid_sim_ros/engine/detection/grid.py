# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The hierarchical grid in which the broad phase looks up what is near a fat box.

Level k has cells of 2^(k/2) m, and a shape lies on the first level whose cells are as large as its
fat box, in the cell of its middle. So few cells have to be visited on any level, and shapes of
very different size do not disturb each other. Cells on top of each other are a column, whose
shapes lie side by side. What is too large for any cell is wide: everything is tried against it.
"""

import math
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.kernels.arrays import Array, IntArray, integers, room
from rigid_sim_ros.kernels.kernel import INDEX, kernel

LEVELS = 163  # cells of 2^-40 m to 2^41 m, in steps of sqrt 2
WIDE = 1 << 20  # the level of what is too large for any cell
_LOWEST = -80  # the level of the smallest cells
_SQRT_HALF = math.sqrt(0.5)


class Grid(NamedTuple):
    """Fat boxes of s shapes, and where they are; t buckets, a power of two."""

    fat: Array  # (s, 6) lower and upper corner; a plane: normal and offset
    moved: IntArray  # (s,) of 8 bits, 1 for shapes that left their fat box
    cells: IntArray  # (s, 5) level, cell of the middle of the fat box, key of its column
    buckets: IntArray  # (t + 2,) where each bucket starts, then the wide shapes
    members: IntArray  # (s,) the shapes in the order of their buckets
    keys: IntArray  # (s,) of their columns, in that order
    tally: IntArray  # (s + 1,) room to count
    levels: IntArray  # (LEVELS,) number of shapes on each level


def make_grid(s: int) -> Grid:
    """Return a grid for s shapes that nobody has filled yet."""
    t = 1 << max(4, (2 * s - 1).bit_length())
    return Grid(room(s, 6), room(s, kind=np.int8), integers(s, 5), integers(t + 2), integers(s),
                integers(s), integers(s + 1), integers(LEVELS))


@kernel
def boxes_overlap(box: Array, a: int, b: int) -> bool:
    """Return whether two boxes have a point in common."""
    return ((box[a, 0] <= box[b, 3]) & (box[b, 0] <= box[a, 3])
            & (box[a, 1] <= box[b, 4]) & (box[b, 1] <= box[a, 4])
            & (box[a, 2] <= box[b, 5]) & (box[b, 2] <= box[a, 5]))


@kernel
def column_key(level: int, x: int, y: int) -> int:
    """
    Return the key of a column of cells; z more, its last bits are the bucket of a cell.

    So cells on top of each other have buckets side by side. Three large primes (Teschner et al.,
    Optimized Spatial Hashing, VMV 2003). Columns that share a key cost time only: who looks one up
    compares the cells themselves.
    """
    return x * 73856093 ^ y * 19349663 ^ level * 50331653


@kernel
def inverse_size(level: int) -> float:
    """Return 1 / 2^(level / 2), the cells of a level to a metre."""
    half = level >> 1
    return math.ldexp(_SQRT_HALF if level & 1 else 1.0, -half)


@kernel
def find_cell(fat: Array, cells: IntArray, s: int, bounded: bool) -> None:
    """Write level, cell and key of a shape."""
    level, key = WIDE, 0
    if bounded:
        side = max(fat[s, 3] - fat[s, 0], fat[s, 4] - fat[s, 1], fat[s, 5] - fat[s, 2])
        if side < math.inf:
            # side = m 2^e with m < 1.
            m, e = math.frexp(side)
            level = max(2 * e - (1 if m <= _SQRT_HALF else 0), _LOWEST)
        if level < LEVELS + _LOWEST:
            inverse = inverse_size(level)
            for k in range(3):
                cells[s, 1 + k] = math.floor(0.5 * (fat[s, k] + fat[s, 3 + k]) * inverse)
            key = column_key(level, cells[s, 1], cells[s, 2])
        else:
            level = WIDE
    cells[s, 0], cells[s, 4] = level, key


@kernel
def fill_grid(grid: Grid) -> None:
    """Sort the shapes by the bucket of their cell: count, add up, distribute."""
    cells, buckets, tally, levels = grid.cells, grid.buckets, grid.tally, grid.levels
    t = buckets.shape[0] - 2
    buckets[:] = 0
    levels[:] = 0
    for s in range(cells.shape[0]):
        level = cells[s, 0]
        bucket = t if level == WIDE else (cells[s, 4] + cells[s, 3]) & (t - 1)
        if level != WIDE:
            levels[level - _LOWEST] += 1
        tally[s] = bucket
        buckets[bucket & INDEX] += 1
    # Where each bucket ends.
    for k in range(t + 1):
        buckets[k + 1] += buckets[k]
    # Backwards, so that the shapes of a bucket end up in order, and its end becomes its start.
    for s in range(cells.shape[0] - 1, -1, -1):
        bucket = tally[s] & INDEX
        buckets[bucket] -= 1
        grid.members[buckets[bucket] & INDEX] = s
        grid.keys[buckets[bucket] & INDEX] = cells[s, 4]


@kernel
def levels_in_use(levels: IntArray) -> tuple[int, int]:
    """Return the lowest and the highest level with shapes; with none, a higher and a lower one."""
    lowest, highest = LEVELS, -1
    for k in range(LEVELS):
        if levels[k] > 0:
            lowest, highest = min(lowest, k), k
    return lowest + _LOWEST, highest + _LOWEST


@kernel
def shapes_on(level: int, grid: Grid) -> int:
    """Return how many shapes lie on a level."""
    return int(grid.levels[level - _LOWEST])
