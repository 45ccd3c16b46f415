# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The convex hull of a mesh; the origin of S is the middle of its bounding box.

`size` is half of the lengths of that box [m]; vertices and faces are in the hull table.
"""

import math
from typing import Any

import numpy as np

from rigid_sim_ros.engine.maths.algebra import dot, subtract
from rigid_sim_ros.engine.maths.pose import point_to_world, to_shape, to_world
from rigid_sim_ros.engine.model.hulls import HullTable
from rigid_sim_ros.engine.model.inertia import mesh, mesh_volume
from rigid_sim_ros.engine.model.kinds.box import reach_of_box
from rigid_sim_ros.engine.model.kinds.drawing import Surface
from rigid_sim_ros.engine.model.kinds.kind import Kind, Size
from rigid_sim_ros.engine.model.kinds.points import copy_candidate, put_near_plane, write_corner
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def _extreme(size: Array, first: IntArray, count: IntArray, vertices: Array, hull: int, s: int,
             d: Vector) -> Vector:
    start = first[hull]
    best, farthest = start, -math.inf
    for v in range(start, start + count[hull]):
        reach = vertices[v, 0] * d[0] + vertices[v, 1] * d[1] + vertices[v, 2] * d[2]
        if reach > farthest:
            best, farthest = v, reach
    return (vertices[best, 0], vertices[best, 1], vertices[best, 2])


@kernel
def _height(size: Array, hulls: HullTable, hull: int, s: int, p: Vector) -> float:
    most = -math.inf
    first = hulls.first_face[hull]
    for f in range(first, first + hulls.face_count[hull]):
        most = max(most, hulls.normals[f, 0] * p[0] + hulls.normals[f, 1] * p[1]
                   + hulls.normals[f, 2] * p[2] - hulls.offsets[f])
    return most


@kernel
def _way_out(size: Array, hulls: HullTable, hull: int, s: int, p: Vector, d: Vector) -> float:
    way = math.inf
    first = hulls.first_face[hull]
    for f in range(first, first + hulls.face_count[hull]):
        n = (hulls.normals[f, 0], hulls.normals[f, 1], hulls.normals[f, 2])
        along = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
        if along > 0.0:
            depth = hulls.offsets[f] - n[0] * p[0] - n[1] * p[1] - n[2] * p[2]
            way = min(way, depth / along)
    return way


@kernel
def _face_count(hulls: HullTable, hull: int) -> int:
    return hulls.face_count[hull]


@kernel
def _face(pose: Array, size: Array, hulls: HullTable, hull: int, s: int,
          f: int) -> tuple[Vector, float]:
    k = hulls.first_face[hull] + f
    n = to_world(pose, s, (hulls.normals[k, 0], hulls.normals[k, 1], hulls.normals[k, 2]))
    return n, hulls.offsets[k]


@kernel
def _best_face(hulls: HullTable, hull: int, n: Vector) -> int:
    """Return the face of a hull that looks along n, in the axes of the shape."""
    best, most = 0, -math.inf
    start = hulls.first_face[hull]
    for f in range(start, start + hulls.face_count[hull]):
        along = (hulls.normals[f, 0] * n[0] + hulls.normals[f, 1] * n[1]
                 + hulls.normals[f, 2] * n[2])
        # Rounding must not change the choice between two faces from step to step.
        if along > most + 1e-6:
            best, most = f, along
    return best


@kernel
def _face_along(pose: Array, size: Array, hulls: HullTable, hull: int, s: int,
                n_W: Vector) -> Vector:
    f = _best_face(hulls, hull, to_shape(pose, s, n_W))
    return to_world(pose, s, (hulls.normals[f, 0], hulls.normals[f, 1], hulls.normals[f, 2]))


@kernel
def _outline(pose: Array, size: Array, s: int, hulls: HullTable, hull: int, n_W: Vector,
             corners: Array) -> tuple[int, int]:
    best = _best_face(hulls, hull, to_shape(pose, s, n_W))
    for k in range(hulls.corner_count[best]):
        v = hulls.corners[hulls.first_corner[best] + k]
        write_corner(corners, k, point_to_world(pose, s, (
            hulls.vertices[v, 0], hulls.vertices[v, 1], hulls.vertices[v, 2])))
    return hulls.corner_count[best], best - hulls.first_face[hull]


@kernel
def _on_plane(pose: Array, size: Array, s: int, hulls: HullTable, hull: int, n: Vector, p: Vector,
              margin: float, points: Array, ids: IntArray) -> int:
    """
    Write the vertices near a plane; of more than there is room for evenly many, and the deepest.

    What is left out is found by number: the vertices of a rim mostly stand in its order. The last
    place is that of the deepest one.
    """
    count, near, every, deepest, least = 0, 0, 1, -1, margin
    room = points.shape[0] - 1
    for v in range(hulls.count[hull]):
        q = _vertex(pose, s, hulls, hull, v)
        gap = dot(n, subtract(q, p))
        if gap >= margin:
            continue
        if gap < least:
            deepest, least = v, gap
        if count == room:
            count, every = _keep_every_second(points, ids, count), 2 * every
        if near % every == 0:
            count = put_near_plane(points, ids, count, n, p, q, v, margin)
        near += 1
    if every > 1:
        count = put_near_plane(points, ids, count, n, p, _vertex(pose, s, hulls, hull, deepest),
                               deepest, margin)
    return count


@kernel
def _vertex(pose: Array, s: int, hulls: HullTable, hull: int, v: int) -> Vector:
    """Return vertex v of a hull [m, world axes]."""
    k = hulls.first[hull] + v
    return point_to_world(pose, s, (hulls.vertices[k, 0], hulls.vertices[k, 1],
                                    hulls.vertices[k, 2]))


@kernel
def _keep_every_second(points: Array, ids: IntArray, count: int) -> int:
    """Keep candidates 0, 2, 4, ...; return their number."""
    kept = 0
    for k in range(0, count, 2):
        copy_candidate(points, ids, kept, k)
        kept += 1
    return kept


def _size(part: Any) -> Size:
    return 0.0, 0.0, 0.0  # `make_hulls` finds it


KIND = Kind(
    name='hull', type='mesh', size=_size, sizes=3,
    volume=lambda part: mesh_volume(part.vertices, part.faces),
    mass_properties=lambda m, part: mesh(m, part.vertices, part.faces),
    summary=lambda part: f'of {0 if part.faces is None else len(part.faces)} triangles',
    bounding_radius=lambda size: float(np.linalg.norm(size)), half_width=min,
    is_flat=True, is_faceted=True,
    surface=lambda part, sides: Surface(np.array(part.vertices), np.array(part.faces)),
    reach_along=reach_of_box, extreme=_extreme, height=_height, way_out=_way_out,
    face_count=_face_count, face=_face, face_along=_face_along, outline=_outline,
    on_plane=_on_plane)
