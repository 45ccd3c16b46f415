# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Choose the four points of a manifold that carry it best."""

import math

from rigid_sim_ros.engine.maths.algebra import cross, dot
from rigid_sim_ros.engine.model.kinds.points import copy_candidate
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

# A point has to be deeper, or farther out, by this fraction to be preferred to an earlier one:
# rounding must not change the choice from step to step. 0 makes it flicker; 0.1 would leave out
# real corners.
PREFERENCE = 1e-3
# Of the size: a point deeper than all that were chosen by more than this takes the place of the
# one nearest to it, so that nothing sinks in unseen.
UNSEEN = 1e-6
# Of the size: a point that is so much farther from touching than the deepest one carries nothing
# soon. More lets the upper corners of what is as small as it looks ahead span the manifold.
FAR = 0.5
# Points in the corners are preferred to the farthest ones where the area between them is so much
# larger. At 1 those of a square would be chosen by rounding.
WIDER = 1.25


@kernel
def reduce_to_four(points: Array, ids: IntArray, count: int, normal: Vector, size: float) -> int:
    """
    Keep at most four of `count` candidates, and return how many.

    Of the deepest the one farthest from any other, the one farthest from it, the one that spans
    the largest triangle with these, and the one that adds most to that triangle; or the corners of
    the rectangle around all, where these span more. Of points that are alike, as on a rim, that
    with the least feature: their order begins where rounding lets the clipping begin. `size` [m]
    is that of the smaller shape.
    """
    if count > 4:
        count = _drop_far(points, ids, count, size)
    if count <= 4:
        return count
    _sort(points, ids, count)
    first = _outermost(points, count, _deepest(points, count) + PREFERENCE * size)
    second, best = -1, 0.0
    for k in range(count):
        d = _between(points, first, k)
        length = dot(d, d)
        if length > best * (1.0 + PREFERENCE):
            second, best = k, length
    if second < 0:
        return _keep_deepest(points, ids, count, first, first, first, first, size)
    third, best, side = -1, PREFERENCE * PREFERENCE * best, 1.0
    for k in range(count):
        area = _area(points, first, second, k, normal)
        if abs(area) > best * (1.0 + PREFERENCE):
            third, best = k, abs(area)
            side = 1.0 if area > 0.0 else -1.0
    if third < 0:
        return _keep_deepest(points, ids, count, first, second, second, second, size)
    fourth, spanned, best = third, best, PREFERENCE * best
    for k in range(count):
        # What lies outside of an edge of the triangle has the other sign there.
        gain = -min(side * _area(points, first, second, k, normal),
                    side * _area(points, second, third, k, normal),
                    side * _area(points, third, first, k, normal))
        if gain > best * (1.0 + PREFERENCE):
            fourth, best = k, gain
    if fourth != third:
        a, b, c, e = _corners(points, count, first, second, normal)
        if _span(points, a, b, c, e, normal) > WIDER * (spanned + best):
            first, second, third, fourth = a, b, c, e
    return _keep_deepest(points, ids, count, first, second, third, fourth, size)


@kernel
def _corners(points: Array, count: int, first: int, second: int,
             normal: Vector) -> tuple[int, int, int, int]:
    """
    Return the candidates farthest towards the corners of the rectangle around all of them.

    Its sides are along the line from `first` to `second` and across. Where that line is the
    longest of a strip whose ends are round or pointed, as of a box under a disk that is as long,
    its ends are not corners of the strip, and with them it is borne on half of its width.
    """
    along = _between(points, first, second)
    across = cross(normal, along)
    x_low, x_high, y_low, y_high = 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        d = _between(points, first, k)
        x, y = dot(along, d), dot(across, d)
        x_low, x_high = min(x_low, x), max(x_high, x)
        y_low, y_high = min(y_low, y), max(y_high, y)
    a, b, c, bottom = first, first, first, first
    best_a, best_b, best_c, best_d = -math.inf, -math.inf, -math.inf, -math.inf
    for k in range(count):
        d = _between(points, first, k)
        # From 0 to 1 across the rectangle.
        x = (dot(along, d) - x_low) / (x_high - x_low)
        y = (dot(across, d) - y_low) / (y_high - y_low)
        if x + y > best_a + PREFERENCE:
            a, best_a = k, x + y
        if y - x > best_b + PREFERENCE:
            b, best_b = k, y - x
        if -x - y > best_c + PREFERENCE:
            c, best_c = k, -x - y
        if x - y > best_d + PREFERENCE:
            bottom, best_d = k, x - y
    return a, b, c, bottom


@kernel
def _span(points: Array, a: int, b: int, c: int, d: int, normal: Vector) -> float:
    """Return twice the area of the polygon a b c d [m^2]: the product of its diagonals."""
    return dot(cross(_between(points, a, c), _between(points, b, d)), normal)


@kernel
def _deepest(points: Array, count: int) -> float:
    """Return the smallest gap of the candidates [m]."""
    deepest = points[0, 3]
    for k in range(1, count):
        deepest = min(deepest, points[k, 3])
    return deepest


@kernel
def _sort(points: Array, ids: IntArray, count: int) -> None:
    """Sort the candidates by their features."""
    for k in range(1, count):
        x, y, z, gap, name = points[k, 0], points[k, 1], points[k, 2], points[k, 3], ids[k]
        to = k
        while to > 0 and ids[to - 1] > name:
            for i in range(4):
                points[to, i] = points[to - 1, i]
            ids[to] = ids[to - 1]
            to -= 1
        points[to, 0], points[to, 1], points[to, 2], points[to, 3] = x, y, z, gap
        ids[to] = name


@kernel
def _outermost(points: Array, count: int, deep: float) -> int:
    """
    Return the first that is farthest from any other, of the candidates with a gap up to `deep`.

    Not the farthest from the middle of all: where rounding doubles a corner, the middle is
    elsewhere.
    """
    best = 0.0
    for k in range(count):
        if points[k, 3] <= deep:
            best = max(best, _farthest(points, count, k))
    for k in range(count):
        if points[k, 3] <= deep and _farthest(points, count, k) * (1.0 + PREFERENCE) >= best:
            return k
    return 0


@kernel
def _farthest(points: Array, count: int, k: int) -> float:
    """Return the square of the distance of a candidate from the one farthest from it [m^2]."""
    best = 0.0
    for j in range(count):
        d = _between(points, k, j)
        best = max(best, dot(d, d))
    return best


@kernel
def _drop_far(points: Array, ids: IntArray, count: int, size: float) -> int:
    """
    Keep the candidates, in their order, that may touch; return how many.

    What is far from touching while another one is right below it touches after that one, and not
    in this step. What is far aside of all deeper ones stays: a thin plate that lands with one edge
    comes down with the other one in the same step, from many times its thickness.
    """
    deepest, kept = _deepest(points, count), 0
    for k in range(count):
        if points[k, 3] <= deepest + FAR * size or not _stands_above(points, count, k):
            copy_candidate(points, ids, kept, k)
            kept += 1
    return kept


@kernel
def _stands_above(points: Array, count: int, k: int) -> bool:
    """
    Return whether a deeper candidate is hardly farther aside than it is deeper.

    The limit is at a slope of 39 degrees, at which no corner of a cube that stands on a corner or
    on an edge is seen from another one: rounding does not decide.
    """
    for j in range(count):
        deeper = points[k, 3] - points[j, 3]
        aside = _between(points, k, j)
        if deeper > 0.0 and dot(aside, aside) < 1.5 * deeper * deeper:
            return True
    return False


@kernel
def _keep_deepest(points: Array, ids: IntArray, count: int, a: int, b: int, c: int, d: int,
                  size: float) -> int:
    """Keep four points, one of them replaced where the deepest of all is not among them."""
    deepest = 0
    for k in range(1, count):
        if points[k, 3] < points[deepest, 3]:
            deepest = k
    seen = min(min(points[a, 3], points[b, 3]), min(points[c, 3], points[d, 3]))
    if points[deepest, 3] >= seen - UNSEEN * size:
        return _keep(points, ids, a, b, c, d)
    near, where = math.inf, 0
    for k in range(4):
        one = a if k == 0 else b if k == 1 else c if k == 2 else d
        e = _between(points, one, deepest)
        if dot(e, e) < near:
            near, where = dot(e, e), k
    return _keep(points, ids, deepest if where == 0 else a, deepest if where == 1 else b,
                 deepest if where == 2 else c, deepest if where == 3 else d)


@kernel
def _between(points: Array, i: int, j: int) -> Vector:
    return (points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2])


@kernel
def _area(points: Array, i: int, j: int, k: int, normal: Vector) -> float:
    """Return twice the area of a triangle, positive if it runs anticlockwise about the normal."""
    return dot(cross(_between(points, i, j), _between(points, i, k)), normal)


@kernel
def _keep(points: Array, ids: IntArray, a: int, b: int, c: int, d: int) -> int:
    """Move the chosen candidates to the front without changing their order."""
    kept = 0
    for k in range(max(max(a, b), max(c, d)) + 1):
        if k in (a, b, c, d):
            copy_candidate(points, ids, kept, k)
            kept += 1
    return kept
