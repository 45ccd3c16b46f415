# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A box about the origin of S along its axes; `size` is half of its lengths [m]."""

from collections.abc import Sequence
import math
from typing import Any

import numpy as np

from rigid_sim_ros.engine.maths.algebra import clamp, dot, norm, scale, subtract
from rigid_sim_ros.engine.maths.pose import axis, origin, point_to_world, to_shape
from rigid_sim_ros.engine.model.hulls import HullTable
from rigid_sim_ros.engine.model.inertia import about_origin, MassProperties
from rigid_sim_ros.engine.model.kinds.drawing import Form, scaled, Surface
from rigid_sim_ros.engine.model.kinds.kind import Kind, Size
from rigid_sim_ros.engine.model.kinds.points import put, write_corner
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel


def box_volume(size: Sequence[float]) -> float:
    """Return the volume [m^3] of a cuboid with these full edge lengths [m]."""
    return float(size[0] * size[1] * size[2])


def box(m: float, size: Sequence[float]) -> MassProperties:
    """
    Return the mass properties of a homogeneous cuboid with full edge lengths a, b, c [m].

    I = m / 12 diag(b^2 + c^2, a^2 + c^2, a^2 + b^2) (Parent, Rigid Body Dynamics, "Inertia Tensor
    for a Cuboid").
    """
    a, b, c = size
    return about_origin(m, [
        m / 12.0 * (b * b + c * c), m / 12.0 * (a * a + c * c), m / 12.0 * (a * a + b * b)])


@kernel
def reach_of_box(size: Array, s: int, x: float, y: float, z: float) -> tuple[float, float]:
    """Return how far [m] a box reaches from its middle in a direction: sum h_k |n_k|."""
    reach = abs(x) * size[s, 0] + abs(y) * size[s, 1] + abs(z) * size[s, 2]
    return reach, reach


@kernel
def _extreme(size: Array, first: IntArray, count: IntArray, vertices: Array, hull: int, s: int,
             d: Vector) -> Vector:
    return (math.copysign(size[s, 0], d[0]), math.copysign(size[s, 1], d[1]),
            math.copysign(size[s, 2], d[2]))


@kernel
def _from_point(size: Array, s: int, p: Vector) -> tuple[float, Vector, Vector]:
    h = (size[s, 0], size[s, 1], size[s, 2])
    q = (clamp(p[0], -h[0], h[0]), clamp(p[1], -h[1], h[1]), clamp(p[2], -h[2], h[2]))
    d = subtract(p, q)
    distance = norm(d)
    if distance > 0.0:
        return distance, scale(1.0 / distance, d), q
    # Inside, the nearest face counts.
    x, y, z = abs(p[0]) - h[0], abs(p[1]) - h[1], abs(p[2]) - h[2]
    if x >= y and x >= z:
        e = 1.0 if p[0] >= 0.0 else -1.0
        return x, (e, 0.0, 0.0), (e * h[0], p[1], p[2])
    if y >= z:
        e = 1.0 if p[1] >= 0.0 else -1.0
        return y, (0.0, e, 0.0), (p[0], e * h[1], p[2])
    e = 1.0 if p[2] >= 0.0 else -1.0
    return z, (0.0, 0.0, e), (p[0], p[1], e * h[2])


@kernel
def _height(size: Array, hulls: HullTable, hull: int, s: int, p: Vector) -> float:
    return max(abs(p[0]) - size[s, 0], abs(p[1]) - size[s, 1], abs(p[2]) - size[s, 2])


@kernel
def _way_out(size: Array, hulls: HullTable, hull: int, s: int, p: Vector, d: Vector) -> float:
    way = math.inf
    for k in range(3):
        if d[k] != 0.0:
            way = min(way, (size[s, k] - math.copysign(1.0, d[k]) * p[k]) / abs(d[k]))
    return way


@kernel
def _face_count(hulls: HullTable, hull: int) -> int:
    return 6


@kernel
def _face(pose: Array, size: Array, hulls: HullTable, hull: int, s: int,
          f: int) -> tuple[Vector, float]:
    return scale(1.0 if f % 2 == 1 else -1.0, axis(pose, s, f // 2)), size[s, f // 2]


@kernel
def _face_along(pose: Array, size: Array, hulls: HullTable, hull: int, s: int,
                n_W: Vector) -> Vector:
    n = to_shape(pose, s, n_W)
    along = 0 if abs(n[0]) >= abs(n[1]) else 1
    along = along if abs(n[along]) >= abs(n[2]) else 2
    return scale(math.copysign(1.0, n[along]), axis(pose, s, along))


@kernel
def _outline(pose: Array, size: Array, s: int, hulls: HullTable, hull: int, n_W: Vector,
             corners: Array) -> tuple[int, int]:
    n = to_shape(pose, s, n_W)
    x, y, z = size[s, 0], size[s, 1], size[s, 2]
    ax, ay, az = abs(n[0]), abs(n[1]), abs(n[2])
    for k in range(4):
        u = 1.0 if k == 1 or k == 2 else -1.0
        v = 1.0 if k >= 2 else -1.0
        # Anticlockwise from outside: the order turns over with the side.
        if ax >= ay and ax >= az:
            e = math.copysign(1.0, n[0])
            p, name = (e * x, u * y, e * v * z), 0
        elif ay >= az:
            e = math.copysign(1.0, n[1])
            p, name = (e * v * x, e * y, u * z), 2
        else:
            e = math.copysign(1.0, n[2])
            p, name = (u * x, e * v * y, e * z), 4
        write_corner(corners, k, point_to_world(pose, s, p))
    return 4, name + (1 if e > 0.0 else 0)


@kernel
def _on_plane(pose: Array, size: Array, s: int, hulls: HullTable, hull: int, n: Vector, p: Vector,
              margin: float, points: Array, ids: IntArray) -> int:
    X, Y, Z = scale(size[s, 0], axis(pose, s, 0)), scale(size[s, 1], axis(pose, s, 1)), scale(
        size[s, 2], axis(pose, s, 2))
    c, count = origin(pose, s), 0
    nx, ny, nz = dot(n, X), dot(n, Y), dot(n, Z)
    height = dot(n, subtract(c, p))
    if height - abs(nx) - abs(ny) - abs(nz) >= margin:
        return 0
    for corner in range(8):
        sx = 1.0 if corner & 1 else -1.0
        sy = 1.0 if corner & 2 else -1.0
        sz = 1.0 if corner & 4 else -1.0
        gap = height + sx * nx + sy * ny + sz * nz
        if gap < margin:
            q = (c[0] + sx * X[0] + sy * Y[0] + sz * Z[0] - gap * n[0],
                 c[1] + sx * X[1] + sy * Y[1] + sz * Z[1] - gap * n[1],
                 c[2] + sx * X[2] + sy * Y[2] + sz * Z[2] - gap * n[2])
            put(points, ids, count, q, gap, corner)
            count += 1
    return count


def _size(part: Any) -> Size:
    return part.size[0] / 2, part.size[1] / 2, part.size[2] / 2


def _unit_cube(rings: int, sides: int) -> Surface:
    """Return the surface of a cube of the edge 1 m."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4],
                      [1, 5, 7, 3]])
    return Surface(corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


KIND = Kind(
    name='box', type='box', size=_size, sizes=3,
    volume=lambda part: box_volume(part.size),
    mass_properties=lambda m, part: box(m, part.size),
    summary=lambda part: ' x '.join(f'{length:g}' for length in part.size),
    bounding_radius=lambda size: float(np.linalg.norm(size)), half_width=min,
    is_flat=True, is_faceted=True,
    forms=lambda part: [Form('box', part.size)],
    surface=lambda part, sides: scaled(_unit_cube(0, 0), part.size),
    units={'box': _unit_cube},
    reach_along=reach_of_box, extreme=_extreme, from_point=_from_point, height=_height,
    way_out=_way_out, face_count=_face_count, face=_face, face_along=_face_along,
    outline=_outline, on_plane=_on_plane)
