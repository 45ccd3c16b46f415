# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The farthest point of a shape in a direction: all that the general method asks of a shape.

A sphere and a capsule are seen as their core, a point and a segment; `radius` is what lies around
it.
"""

from rigid_sim_ros.engine.maths.algebra import add, dot
from rigid_sim_ros.engine.maths.pose import axis, origin, to_shape, to_world
from rigid_sim_ros.engine.model.kinds.table import (
    extreme as core_extreme, is_rounded, is_unbounded)
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def radius(kind: IntArray, size: Array, s: int) -> float:
    """Return the radius [m] around the core of shape s."""
    return size[s, 0] if is_rounded(kind[s]) else 0.0


@kernel
def extreme(pose: Array, kind: IntArray, size: Array, first: IntArray, count: IntArray,
            vertices: Array, hull: IntArray, s: int, d_W: Vector) -> Vector:
    """Return the point of the core of shape s farthest in the direction d, in the world."""
    p = core_extreme(kind[s], size, first, count, vertices, hull[s], s, to_shape(pose, s, d_W))
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


@kernel
def separation(pose: Array, shapes: Shapes, a: int, b: int, n: Vector) -> float:
    """Return how far [m] a unit vector n parts shape a from shape b, < 0: it does not."""
    return -_reach_of(pose, shapes, a, n) - _reach_of(pose, shapes, b, (-n[0], -n[1], -n[2]))


@kernel
def _reach_of(pose: Array, shapes: Shapes, s: int, n: Vector) -> float:
    """Return max n . x [m] over a shape; of a half space n is the normal."""
    if is_unbounded(shapes.kind[s]):
        return dot(n, origin(pose, s))
    hulls = shapes.hulls
    return reach(pose, shapes.kind, shapes.size, hulls.first, hulls.count, hulls.vertices,
                 shapes.hull, s, n)
