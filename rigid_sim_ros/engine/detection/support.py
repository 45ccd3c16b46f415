# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The farthest point of a shape in a direction: all that the general method asks of a shape.

A sphere and a capsule are seen as their core, a point and a segment; `radius` is what lies around
it.
"""

import math

from rigid_sim_ros.engine.maths.algebra import add, dot
from rigid_sim_ros.engine.maths.pose import axis, origin, to_shape, to_world
from rigid_sim_ros.engine.model.shapes import BOX, CAPSULE, CYLINDER, SPHERE
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def radius(kind: IntArray, size: Array, s: int) -> float:
    """Return the radius [m] around the core of shape s."""
    return size[s, 0] if kind[s] == SPHERE or kind[s] == CAPSULE else 0.0


@kernel
def extreme(pose: Array, kind: IntArray, size: Array, first: IntArray, count: IntArray,
            vertices: Array, hull: IntArray, s: int, d_W: Vector) -> Vector:
    """Return the point of the core of shape s farthest in the direction d, in the world."""
    if kind[s] == SPHERE:
        return origin(pose, s)
    d = to_shape(pose, s, d_W)
    if kind[s] == BOX:
        p = (math.copysign(size[s, 0], d[0]), math.copysign(size[s, 1], d[1]),
             math.copysign(size[s, 2], d[2]))
    elif kind[s] == CAPSULE:
        p = (0.0, 0.0, math.copysign(size[s, 1], d[2]))
    elif kind[s] == CYLINDER:
        across = math.sqrt(d[0] * d[0] + d[1] * d[1])
        # Straight up every point of the cap is as far as another; one on the rim is taken.
        x, y = (d[0] / across, d[1] / across) if across > 0.0 else (1.0, 0.0)
        p = (size[s, 0] * x, size[s, 0] * y, math.copysign(size[s, 1], d[2]))
    else:
        start = first[hull[s]]
        best, farthest = start, -math.inf
        for v in range(start, start + count[hull[s]]):
            reach = vertices[v, 0] * d[0] + vertices[v, 1] * d[1] + vertices[v, 2] * d[2]
            if reach > farthest:
                best, farthest = v, reach
        p = (vertices[best, 0], vertices[best, 1], vertices[best, 2])
    return add(origin(pose, s), to_world(pose, s, p))


@kernel
def reach(pose: Array, kind: IntArray, size: Array, first: IntArray, count: IntArray,
          vertices: Array, hull: IntArray, s: int, n: Vector) -> float:
    """Return max n . x [m] over the shape, with its radius, for a unit vector n."""
    p = extreme(pose, kind, size, first, count, vertices, hull, s, n)
    return dot(n, p) + radius(kind, size, s)


@kernel
def box_reach(pose: Array, size: Array, s: int, n: Vector) -> float:
    """Return the same for a box, from its middle: sum h_k |n . axis k|."""
    return (abs(dot(axis(pose, s, 0), n)) * size[s, 0] + abs(dot(axis(pose, s, 1), n)) * size[s, 1]
            + abs(dot(axis(pose, s, 2), n)) * size[s, 2])
