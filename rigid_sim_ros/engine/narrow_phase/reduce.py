# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Choose the four points of a manifold that carry it best."""

from rigid_sim_ros.engine.algebra import cross, dot
from rigid_sim_ros.engine.arrays import Array, IntArray, Vector
from rigid_sim_ros.engine.kernel import kernel

# A point has to be deeper, or farther out, by this fraction to be preferred to an earlier one:
# rounding must not change the choice from step to step. 0 makes it flicker; 0.1 would leave out
# real corners.
PREFERENCE = 1e-3


@kernel
def reduce_to_four(points: Array, ids: IntArray, count: int, normal: Vector, size: float) -> int:
    """
    Keep at most four of `count` candidates, in their order, and return how many.

    The deepest point, the one farthest from it, the one that spans the largest triangle with
    these, and the one that adds most to that triangle. `size` [m] is that of the smaller shape.
    """
    if count <= 4:
        return count
    first = 0
    for k in range(1, count):
        if points[k, 3] < points[first, 3] - PREFERENCE * size:
            first = k
    second, best = -1, 0.0
    for k in range(count):
        d = _between(points, first, k)
        length = dot(d, d)
        if length > best * (1.0 + PREFERENCE):
            second, best = k, length
    if second < 0:
        return _keep(points, ids, first, first, first, first)
    third, best, side = -1, PREFERENCE * PREFERENCE * best, 1.0
    for k in range(count):
        area = _area(points, first, second, k, normal)
        if abs(area) > best * (1.0 + PREFERENCE):
            third, best = k, abs(area)
            side = 1.0 if area > 0.0 else -1.0
    if third < 0:
        return _keep(points, ids, first, second, second, second)
    fourth, best = third, PREFERENCE * best
    for k in range(count):
        # What lies outside of an edge of the triangle has the other sign there.
        gain = -min(side * _area(points, first, second, k, normal),
                    side * _area(points, second, third, k, normal),
                    side * _area(points, third, first, k, normal))
        if gain > best * (1.0 + PREFERENCE):
            fourth, best = k, gain
    return _keep(points, ids, first, second, third, fourth)


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
            for i in range(4):
                points[kept, i] = points[k, i]
            ids[kept] = ids[k]
            kept += 1
    return kept
