# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which pairs of shapes may touch: those whose fat boxes overlap.

A fat box is a bounding box with room to move in. While a shape stays inside of its fat box nothing
has to be done for it. Those that left theirs are looked up in a hierarchical grid (see grid.py),
but for planes and the like: everything is tried against them.

The pairs that come out are sorted, and a superset of those whose bounding boxes overlap; who goes
through them tests the bounding boxes first, so that no result depends on when a fat box was made.
Of two spheres, most of what bounding boxes have in common are corners that the spheres do not
reach: there they are taken for what they are.
"""

import math

from rigid_sim_ros.engine.detection.grid import (
    boxes_overlap, column_key, find_cell, Grid, inverse_size, levels_in_use, shapes_on, WIDE)
from rigid_sim_ros.engine.detection.manifolds import PAIRS_LISTED
from rigid_sim_ros.engine.model.kinds.table import is_ball, is_unbounded
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import apart, INDEX, kernel, part

# Room around a bounding box, as a fraction of its largest side. A smaller one makes shapes leave
# their box more often, a larger one makes more pairs that do not touch.
ROOM = 0.1
# A fat box reaches as far ahead as the shape flies in so many steps, but no farther than its own
# size.
STEPS_AHEAD = 16.0
# Less room than that, and a shape gets a new box along with the others.
_USED = 0.05
# Spheres are taken to be farther apart than they can come only beyond rounding, wherever they are.
_NEARLY = 1.01


@kernel
def may_collide(shapes: Shapes, bodies: int, a: int, b: int) -> bool:
    """Apply the filters: not both still, not one body, groups against masks, pairs to ignore."""
    i, j = shapes.body[a], shapes.body[b]
    if i == j or shapes.still[a] + shapes.still[b] == 2:
        return False
    if shapes.mask[a] & shapes.group[b] == 0 or shapes.mask[b] & shapes.group[a] == 0:
        return False
    key = min(i, j) * bodies + max(i, j)
    low, high = 0, shapes.ignored.shape[0]
    while low < high:
        middle = (low + high) // 2
        if shapes.ignored[middle] < key:
            low = middle + 1
        else:
            high = middle
    return not (low < shapes.ignored.shape[0] and shapes.ignored[low] == key)


@kernel
def near_pairs(kind: IntArray, pair: IntArray, box: Array, first: int, last: int,
               near: IntArray) -> int:
    """
    List the pairs from `first` to `last` whose boxes overlap; return how many these are.

    Of two spheres, the boxes of which are cubes, the balls in them must overlap. Nothing here is a
    branch: the processor could only guess, and be wrong every third time.
    """
    count = 0
    for k in range(first, last):
        a, b = pair[k, 0] & INDEX, pair[k, 1] & INDEX
        spheres = is_ball(kind[a]) & is_ball(kind[b])
        near[count] = k
        count += 1 if boxes_overlap(box, a, b) & ((not spheres) | balls_overlap(box, a, b)) else 0
    return count


@kernel
def balls_overlap(box: Array, a: int, b: int) -> bool:
    """Return whether the balls in two cubes have a point in common."""
    # Twice the way from middle to middle, and twice the sum of the radii.
    x = box[a, 0] + box[a, 3] - box[b, 0] - box[b, 3]
    y = box[a, 1] + box[a, 4] - box[b, 1] - box[b, 4]
    z = box[a, 2] + box[a, 5] - box[b, 2] - box[b, 5]
    r = box[a, 3] - box[a, 0] + box[b, 3] - box[b, 0]
    return x * x + y * y + z * z <= r * r


@kernel
def mark_moved(kind: IntArray, pose: Array, box: Array, all_of_them: bool, grid: Grid, first: int,
               last: int) -> int:
    """Mark which of some shapes left their fat box, or are about to; return how many left."""
    fat, moved, count = grid.fat, grid.moved, 0
    for s in range(first, last):
        room, little = _room(kind, pose, box, fat, s), _USED * _side(box, s)
        # What is not a number has no room either.
        stays = room >= 0.0 and not all_of_them
        moved[s] = 0 if stays and (room >= little or is_unbounded(kind[s])) else 1
        count += 0 if stays else 1
    return count


@kernel
def refresh(shapes: Shapes, pose: Array, box: Array, inv_m: Array, P: Array, h: float,
            all_of_them: bool, grid: Grid, first: int, last: int) -> int:
    """
    Give some shapes, if they are marked, a new fat box, and return how many look for partners.

    As soon as one left its own, so get those that are about to: to look up many costs little more
    than to look up one. Where all have moved, those of fixed bodies do not look, but are found.
    """
    count = 0
    for s in range(first, last):
        if grid.moved[s] == 1:
            i = shapes.body[s] & INDEX
            _fatten(shapes.kind, pose, box, h * inv_m[i], P, i, grid.fat, s)
            find_cell(grid.fat, grid.cells, s, not is_unbounded(shapes.kind[s]))
            grid.moved[s] = 0 if all_of_them and shapes.still[s] == 1 else 1
            count += grid.moved[s]
    return count


@part
def _room(kind: IntArray, pose: Array, box: Array, fat: Array, s: int) -> float:
    """Return how much room a fat box has around a shape [m], below 0 if it does not hold it."""
    if is_unbounded(kind[s]):
        n, offset = _plane(pose, s)
        same = (fat[s, 0] == n[0] and fat[s, 1] == n[1] and fat[s, 2] == n[2]
                and fat[s, 3] == offset)
        return 0.0 if same else -1.0
    below = min(box[s, 0] - fat[s, 0], min(box[s, 1] - fat[s, 1], box[s, 2] - fat[s, 2]))
    above = min(fat[s, 3] - box[s, 3], min(fat[s, 4] - box[s, 4], fat[s, 5] - box[s, 5]))
    return min(below, above)


@part
def _fatten(kind: IntArray, pose: Array, box: Array, way: float, P: Array, i: int, fat: Array,
            s: int) -> None:
    """Make a fat box; `way` times P is how far body i flies in a step [m]."""
    if is_unbounded(kind[s]):
        n, offset = _plane(pose, s)
        fat[s, 0], fat[s, 1], fat[s, 2], fat[s, 3] = n[0], n[1], n[2], offset
        return
    side = _side(box, s)
    for k in range(3):
        ahead = min(max(STEPS_AHEAD * way * P[k, i], -side), side)
        fat[s, k] = box[s, k] - ROOM * side + min(ahead, 0.0)
        fat[s, 3 + k] = box[s, 3 + k] + ROOM * side + max(ahead, 0.0)


@part
def _side(box: Array, s: int) -> float:
    return max(box[s, 3] - box[s, 0], box[s, 4] - box[s, 1], box[s, 5] - box[s, 2])


@part
def _plane(pose: Array, s: int) -> tuple[Vector, float]:
    """Return the normal of a plane and how far it is from the origin along it [m]."""
    n = (pose[s, 5], pose[s, 8], pose[s, 11])
    return n, n[0] * pose[s, 0] + n[1] * pose[s, 1] + n[2] * pose[s, 2]


@kernel
def can_meet(kind: IntArray, size: Array, fat: Array, margin: Array, a: int, b: int) -> bool:
    """
    Return whether two shapes can be a near pair while they are in their fat boxes.

    Those of two spheres must come near enough; a plane takes up all below it and some above.
    """
    if is_unbounded(kind[a]) or is_unbounded(kind[b]):
        p, s = (a, b) if is_unbounded(kind[a]) else (b, a)
        lowest = -fat[p, 3]
        for k in range(3):
            n = fat[p, k]
            lowest += n * (fat[s, k] if n > 0.0 else fat[s, 3 + k])
        return lowest <= margin[p]
    spheres = is_ball(kind[a]) & is_ball(kind[b])
    return boxes_overlap(fat, a, b) & ((not spheres) | _spheres_can_meet(size, fat, a, b))


@kernel
def _spheres_can_meet(size: Array, fat: Array, a: int, b: int) -> bool:
    """
    Return whether two spheres can touch somewhere in their boxes.

    The middle of either is at least its radius from the sides of its box. That they look ahead
    changes nothing: a larger ball in the box is a union of such spheres.
    """
    r_A, r_B, square = size[a, 0], size[b, 0], 0.0
    for k in range(3):
        between = max(fat[b, k] - fat[a, 3 + k], fat[a, k] - fat[b, 3 + k]) + r_A + r_B
        square += max(between, 0.0) ** 2
    return square <= (_NEARLY * (r_A + r_B)) ** 2


@kernel
def _offer(shapes: Shapes, fat: Array, moved: IntArray, fresh: IntArray, bodies: int,
           margin: Array, count: int, s: int, other: int) -> int:
    """Note a pair if it can meet and the filters let it; return the number of pairs."""
    # Two that both moved find each other twice.
    if other == s or (moved[other] == 1 and other < s):
        return count
    if not can_meet(shapes.kind, shapes.size, fat, margin, s, other):
        return count
    return _note(shapes, fresh, bodies, count, s, other)


@kernel
def _note(shapes: Shapes, fresh: IntArray, bodies: int, count: int, s: int, other: int) -> int:
    """Note a pair if the filters let it; return the number of pairs."""
    a, b = min(s, other), max(s, other)
    if not may_collide(shapes, bodies, a, b):
        return count
    if count < fresh.shape[0]:
        fresh[count, 0] = a
        fresh[count, 1] = b
    return count + 1


@kernel
def _near_members(grid: Grid, key: int, s: int, first: int, last: int, near: IntArray) -> int:
    """
    List those members of a column whose fat boxes overlap that of shape s, which moved.

    Without a branch, as in `near_pairs`. Two that both moved would find each other twice. Spheres
    that cannot meet are left to `forget_parted`: to test each member takes longer than a few pairs
    too many. Returns how many are listed.
    """
    count = 0
    for k in range(first, last):
        other = grid.members[k & INDEX] & INDEX
        once = (grid.moved[other] == 0) | (other > s)
        near[count] = other
        count += 1 if ((grid.keys[k & INDEX] == key) & once
                       & boxes_overlap(grid.fat, s, other)) else 0
    return count


@part
def _look_into_column(shapes: Shapes, grid: Grid, fresh: IntArray, bodies: int, near: IntArray,
                      count: int, s: int, level: int, x: int, y: int, z0: int, z1: int) -> int:
    """Find partners of shape s in the cells (x, y, z0 .. z1); return the number of pairs."""
    t, key = grid.buckets.shape[0] - 2, column_key(level, x, y)
    first, last = (key + z0) & (t - 1), (key + z1) & (t - 1)
    # What lies beyond the last bucket is in the first ones.
    for begin, end in ((first, last), (0, -1)) if first <= last else ((first, t - 1), (0, last)):
        k, until = grid.buckets[begin & INDEX], grid.buckets[(end + 1) & INDEX]
        while k < until:
            some = min(k + PAIRS_LISTED, until)
            for i in range(_near_members(grid, key, s, k, some, near)):
                other = near[i] & INDEX
                if (grid.cells[other, 1] == x and grid.cells[other, 2] == y
                        and grid.cells[other, 0] == level):
                    count = _note(shapes, fresh, bodies, count, s, other)
            k = some
    return count


@kernel
def _partners(shapes: Shapes, grid: Grid, fresh: IntArray, bodies: int, margin: Array,
              near: IntArray, used: tuple[int, int], count: int, s: int) -> int:
    """Find the partners of shape s, which moved; return the number of pairs so far."""
    fat, everything = grid.fat, shapes.kind.shape[0]
    t = grid.buckets.shape[0] - 2
    if grid.cells[s, 0] == WIDE:
        for other in range(everything):
            count = _offer(shapes, fat, grid.moved, fresh, bodies, margin, count, s, other)
        return count
    for k in range(grid.buckets[t], grid.buckets[t + 1]):
        count = _offer(shapes, fat, grid.moved, fresh, bodies, margin, count, s, grid.members[k])
    for level in range(used[0], used[1] + 1):
        if shapes_on(level, grid) == 0:
            continue
        inverse = inverse_size(level)
        # The middle of a shape that reaches into the fat box lies at most half a cell outside.
        x0, x1 = math.floor(fat[s, 0] * inverse - 0.5), math.floor(fat[s, 3] * inverse + 0.5)
        y0, y1 = math.floor(fat[s, 1] * inverse - 0.5), math.floor(fat[s, 4] * inverse + 0.5)
        z0, z1 = math.floor(fat[s, 2] * inverse - 0.5), math.floor(fat[s, 5] * inverse + 0.5)
        visits = (float(x1 - x0) + 1.0) * (float(y1 - y0) + 1.0) * (float(z1 - z0) + 1.0)
        if visits > float(everything):
            for other in range(everything):
                if grid.cells[other, 0] == level:
                    count = _offer(shapes, fat, grid.moved, fresh, bodies, margin, count, s, other)
            continue
        for x in range(x0, x1 + 1):
            for y in range(y0, y1 + 1):
                count = _look_into_column(shapes, grid, fresh, bodies, near, count, s, level,
                                          x, y, z0, z1)
    return count


@apart
def look_around(shapes: Shapes, grid: Grid, fresh: IntArray, bodies: int, margin: Array,
                near: IntArray, begin: int, end: int) -> tuple[int, int]:
    """
    List the partners of what moved, of some shapes, until there may be no room for more.

    `fresh` (>= s, 2) gets the pairs. Returns the shape from which to go on, `end` if all are done,
    and the number of pairs.
    """
    found, most = 0, shapes.kind.shape[0] - 1  # partners of one shape, at most
    used = levels_in_use(grid.levels)
    for s in range(begin, end):
        if grid.moved[s] == 0:
            continue
        if found + most > fresh.shape[0]:
            return s, found
        found = _partners(shapes, grid, fresh, bodies, margin, near, used, found, s)
    return end, found
