# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The surface of one convex shape: how far a point is outside, the way out, and the flat faces.

Of a polyhedron the distances are those from the planes of its faces: exact inside and beside one
face, too small beside an edge, which is enough to tell whether a point lies on the surface.
"""

import math

from rigid_sim_ros.engine.maths.pose import point_to_shape, to_shape
from rigid_sim_ros.engine.maths.vector import dot, subtract
from rigid_sim_ros.engine.model.kinds import table as of_kind
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel

# The square of the difference of two normals that are the same.
SAME = 1e-14


@kernel
def height(pose: Array, shapes: Shapes, s: int, p_W: Vector) -> float:
    """Return how far the point p is outside of shape s [m], below 0 inside."""
    return of_kind.height(shapes.kind[s], shapes.size, shapes.hulls, shapes.hull[s], s,
                          point_to_shape(pose, s, p_W))


@kernel
def way_out(pose: Array, shapes: Shapes, s: int, p_W: Vector, d_W: Vector) -> float:
    """
    Return how far [m] the point p has to go in the direction d to leave shape s.

    0 where it is outside, infinite where it stays inside for ever. Of a ball or a capsule, which
    have no flat face, it is the depth of p.
    """
    p, d = point_to_shape(pose, s, p_W), to_shape(pose, s, d_W)
    return max(of_kind.way_out(shapes.kind[s], shapes.size, shapes.hulls, shapes.hull[s], s, p, d),
               0.0)


@kernel
def face_count(shapes: Shapes, s: int) -> int:
    """Return how many flat faces shape s has."""
    return of_kind.face_count(shapes.kind[s], shapes.hulls, shapes.hull[s])


@kernel
def face(pose: Array, shapes: Shapes, s: int, f: int) -> tuple[Vector, float]:
    """Return the outward normal of flat face f of shape s, world axes, and max n . x [m] on it."""
    n, offset = of_kind.face(shapes.kind[s], pose, shapes.size, shapes.hulls, shapes.hull[s], s, f)
    return n, offset + n[0] * pose[s, 0] + n[1] * pose[s, 1] + n[2] * pose[s, 2]


@kernel
def face_normal_along(pose: Array, shapes: Shapes, s: int, n_W: Vector) -> Vector:
    """Return the normal of the flat face of s that looks along n; n itself where it has none."""
    return of_kind.face_along(shapes.kind[s], pose, shapes.size, shapes.hulls, shapes.hull[s], s,
                              n_W)


@kernel
def nearest_face(pose: Array, shapes: Shapes, s: int, p_W: Vector) -> Vector:
    """Return the normal of the flat face of s that p is nearest to or farthest above; 0: none."""
    nearest, normal = -math.inf, (0.0, 0.0, 0.0)
    for f in range(face_count(shapes, s)):
        n, offset = face(pose, shapes, s, f)
        if dot(n, p_W) - offset > nearest:
            nearest, normal = dot(n, p_W) - offset, n
    return normal


@kernel
def are_same(n: Vector, m: Vector) -> bool:
    """Return whether two normals are the same."""
    apart = subtract(n, m)
    return dot(apart, apart) <= SAME


@kernel
def meets_face(pose: Array, shapes: Shapes, a: int, b: int, n: Vector) -> bool:
    """Return whether n, from A to B, is the normal of a flat face of A, or the other way of B."""
    for s in (a, b):
        if of_kind.is_unbounded(shapes.kind[s]):
            return True
        if of_kind.is_faceted(shapes.kind[s]):
            out = n if s == a else (-n[0], -n[1], -n[2])
            if are_same(out, face_normal_along(pose, shapes, s, out)):
                return True
    return False
