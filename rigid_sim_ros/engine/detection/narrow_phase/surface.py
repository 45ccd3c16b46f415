# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The surface of one convex shape: how far a point is outside, the way out, and the flat faces.

Of a polyhedron the distances are those from the planes of its faces: exact inside and beside one
face, too small beside an edge, which is enough to tell whether a point lies on the surface.
"""

import math

from rigid_sim_ros.engine.maths.algebra import scale
from rigid_sim_ros.engine.maths.pose import axis, point_to_shape, to_shape, to_world
from rigid_sim_ros.engine.model.shapes import BOX, CAPSULE, CYLINDER, HULL, PLANE, Shapes, SPHERE
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def extent(shapes: Shapes, s: int) -> float:
    """Return the smallest half extent of shape s [m]; infinite for a plane."""
    kind, size = shapes.kind[s], shapes.size
    if kind == PLANE:
        return math.inf
    if kind in (SPHERE, CAPSULE):
        return size[s, 0]
    if kind == CYLINDER:
        return min(size[s, 0], size[s, 1])
    return min(size[s, 0], size[s, 1], size[s, 2])


@kernel
def is_faceted(kind: int) -> bool:
    """Return whether shapes of a kind have flat faces with edges around them."""
    return kind in (BOX, HULL, CYLINDER)


@kernel
def height(pose: Array, shapes: Shapes, s: int, p_W: Vector) -> float:
    """Return how far the point p is outside of shape s [m], below 0 inside."""
    p, kind, size = point_to_shape(pose, s, p_W), shapes.kind[s], shapes.size
    if kind == PLANE:
        return p[2]
    if kind == BOX:
        return max(abs(p[0]) - size[s, 0], abs(p[1]) - size[s, 1], abs(p[2]) - size[s, 2])
    if kind == CYLINDER:
        return max(math.sqrt(p[0] * p[0] + p[1] * p[1]) - size[s, 0], abs(p[2]) - size[s, 1])
    if kind == HULL:
        hulls, most = shapes.hulls, -math.inf
        first = hulls.first_face[shapes.hull[s]]
        for f in range(first, first + hulls.face_count[shapes.hull[s]]):
            most = max(most, hulls.normals[f, 0] * p[0] + hulls.normals[f, 1] * p[1]
                       + hulls.normals[f, 2] * p[2] - hulls.offsets[f])
        return most
    half = size[s, 1] if kind == CAPSULE else 0.0
    z = p[2] - min(max(p[2], -half), half)
    return math.sqrt(p[0] * p[0] + p[1] * p[1] + z * z) - size[s, 0]


@kernel
def way_out(pose: Array, shapes: Shapes, s: int, p_W: Vector, d_W: Vector) -> float:
    """
    Return how far [m] the point p has to go in the direction d to leave shape s.

    0 where it is outside, infinite where it stays inside for ever. Of a ball or a capsule, which
    have no flat face, it is the depth of p.
    """
    p, d = point_to_shape(pose, s, p_W), to_shape(pose, s, d_W)
    kind, size, way = shapes.kind[s], shapes.size, math.inf
    if kind == PLANE:
        way = -p[2] / d[2] if d[2] > 0.0 else math.inf
    elif kind == BOX:
        for k in range(3):
            if d[k] != 0.0:
                way = min(way, (size[s, k] - math.copysign(1.0, d[k]) * p[k]) / abs(d[k]))
    elif kind == CYLINDER:
        if d[2] != 0.0:
            way = (size[s, 1] - math.copysign(1.0, d[2]) * p[2]) / abs(d[2])
        # |p + t d| = r in the plane at right angles to the axis.
        dd, pd = d[0] * d[0] + d[1] * d[1], p[0] * d[0] + p[1] * d[1]
        if dd > 0.0:
            inside = size[s, 0] * size[s, 0] - p[0] * p[0] - p[1] * p[1]
            way = min(way, (math.sqrt(max(pd * pd + dd * inside, 0.0)) - pd) / dd)
    elif kind == HULL:
        hulls = shapes.hulls
        first = hulls.first_face[shapes.hull[s]]
        for f in range(first, first + hulls.face_count[shapes.hull[s]]):
            n = (hulls.normals[f, 0], hulls.normals[f, 1], hulls.normals[f, 2])
            along = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
            if along > 0.0:
                depth = hulls.offsets[f] - n[0] * p[0] - n[1] * p[1] - n[2] * p[2]
                way = min(way, depth / along)
    else:
        way = -height(pose, shapes, s, p_W)
    return max(way, 0.0)


@kernel
def face_count(shapes: Shapes, s: int) -> int:
    """Return how many flat faces shape s has."""
    kind = shapes.kind[s]
    if kind == BOX:
        return 6
    if kind == CYLINDER:
        return 2
    return int(shapes.hulls.face_count[shapes.hull[s]]) if kind == HULL else 0


@kernel
def face(pose: Array, shapes: Shapes, s: int, f: int) -> tuple[Vector, float]:
    """Return the outward normal of flat face f of shape s, world axes, and max n . x [m] on it."""
    if shapes.kind[s] == HULL:
        hulls = shapes.hulls
        k = hulls.first_face[shapes.hull[s]] + f
        n = to_world(pose, s, (hulls.normals[k, 0], hulls.normals[k, 1], hulls.normals[k, 2]))
        offset = hulls.offsets[k]
    else:
        k = f // 2 if shapes.kind[s] == BOX else 2
        n = scale(1.0 if f % 2 == 1 else -1.0, axis(pose, s, k))
        offset = shapes.size[s, k] if shapes.kind[s] == BOX else shapes.size[s, 1]
    return n, offset + n[0] * pose[s, 0] + n[1] * pose[s, 1] + n[2] * pose[s, 2]
