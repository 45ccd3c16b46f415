# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A cone about the axis z: its apex is half of its height above the origin of S, its base below.

`size` is the radius of the base and half of the height [m]. In a half plane through the axis, with
the distance rho from it, the outward normal of the mantle is (2 half, radius) / slant.
"""

import math
from typing import Any

import numpy as np

from rigid_sim_ros.engine.maths.algebra import add_scaled, scale
from rigid_sim_ros.engine.maths.pose import axis, origin, point_to_world, to_shape
from rigid_sim_ros.engine.model.hulls import HullTable
from rigid_sim_ros.engine.model.inertia import MassProperties
from rigid_sim_ros.engine.model.kinds.drawing import Form, revolved, scaled, Surface
from rigid_sim_ros.engine.model.kinds.kind import Kind, Size
from rigid_sim_ros.engine.model.kinds.points import put_near_plane, write_corner
from rigid_sim_ros.engine.model.kinds.rim import down_the_rim, put_rim, rim_corners
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel


def cone_volume(radius: float, length: float) -> float:
    """Return the volume [m^3] of a cone of this radius and height [m]."""
    return math.pi * radius ** 2 * length / 3.0


def cone(m: float, radius: float, length: float) -> MassProperties:
    """
    Return the mass properties of a homogeneous cone about the z axis, its origin at half height.

    The centre of mass is a quarter of the height above the base. About it I_zz = 3/10 m r^2 and
    I_xx = I_yy = 3/80 m (4 r^2 + h^2): of discs of the radius r z / h at z below the apex.
    """
    across = 3.0 / 80.0 * m * (4.0 * radius ** 2 + length ** 2)
    return MassProperties(m, np.array([0.0, 0.0, -0.25 * length]),
                          np.diag([across, across, 0.3 * m * radius ** 2]))


@kernel
def _reach_along(size: Array, s: int, x: float, y: float, z: float) -> tuple[float, float]:
    rim, apex = size[s, 0] * math.sqrt(max(0.0, 1.0 - z * z)), z * size[s, 1]
    return max(-apex, apex + rim), max(apex, -apex + rim)


@kernel
def _extreme(size: Array, first: IntArray, count: IntArray, vertices: Array, hull: int, s: int,
             d: Vector) -> Vector:
    across = math.sqrt(d[0] * d[0] + d[1] * d[1])
    if 2.0 * size[s, 1] * d[2] >= size[s, 0] * across:
        return (0.0, 0.0, size[s, 1])
    # Straight down every point of the base is as far as another; one on the rim is taken.
    x, y = (d[0] / across, d[1] / across) if across > 0.0 else (1.0, 0.0)
    return (size[s, 0] * x, size[s, 0] * y, -size[s, 1])


@kernel
def _slant(size: Array, s: int) -> tuple[float, float]:
    """Return the parts of the unit normal of the mantle away from the axis and along it."""
    slant = math.sqrt(4.0 * size[s, 1] * size[s, 1] + size[s, 0] * size[s, 0])
    return 2.0 * size[s, 1] / slant, size[s, 0] / slant


@kernel
def _from_point(size: Array, s: int, p: Vector) -> tuple[float, Vector, Vector]:
    r, half = size[s, 0], size[s, 1]
    out, up = _slant(size, s)
    rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
    # On the axis every direction is as near as another; x is taken.
    ex, ey = (p[0] / rho, p[1] / rho) if rho > 0.0 else (1.0, 0.0)
    side, below = out * rho + up * (p[2] - half), -half - p[2]
    inside = side <= 0.0 and below <= 0.0
    if (rho <= r and below > 0.0) or (inside and below > side):
        return below, (0.0, 0.0, -1.0), (p[0], p[1], -half)
    # Along the mantle from the rim to the apex.
    slant = r / up
    way = out * (p[2] + half) - up * (rho - r)
    if inside or 0.0 <= way <= slant:
        return side, (out * ex, out * ey, up), (
            p[0] - side * out * ex, p[1] - side * out * ey, p[2] - side * up)
    edge, z = (r, -half) if way < 0.0 else (0.0, half)
    distance = math.sqrt((rho - edge) * (rho - edge) + (p[2] - z) * (p[2] - z))
    away = (rho - edge) / distance
    return distance, (away * ex, away * ey, (p[2] - z) / distance), (edge * ex, edge * ey, z)


@kernel
def _height(size: Array, hulls: HullTable, hull: int, s: int, p: Vector) -> float:
    out, up = _slant(size, s)
    rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
    return max(out * rho + up * (p[2] - size[s, 1]), -size[s, 1] - p[2])


@kernel
def _way_out(size: Array, hulls: HullTable, hull: int, s: int, p: Vector, d: Vector) -> float:
    way, r, half = math.inf, size[s, 0], size[s, 1]
    if d[2] < 0.0:
        way = (half + p[2]) / -d[2]
    # a t^2 + 2 b t + c = 0 where 2 half rho = r (half - z), and c <= 0 inside.
    h, below = 4.0 * half * half, half - p[2]
    a = h * (d[0] * d[0] + d[1] * d[1]) - r * r * d[2] * d[2]
    b = h * (p[0] * d[0] + p[1] * d[1]) + r * r * below * d[2]
    c = min(h * (p[0] * p[0] + p[1] * p[1]) - r * r * below * below, 0.0)
    towards = b + math.sqrt(max(b * b - a * c, 0.0))
    return min(way, -c / towards) if towards > 0.0 else way


@kernel
def _face_count(hulls: HullTable, hull: int) -> int:
    return 1


@kernel
def _face(pose: Array, size: Array, hulls: HullTable, hull: int, s: int,
          f: int) -> tuple[Vector, float]:
    return scale(-1.0, axis(pose, s, 2)), size[s, 1]


@kernel
def _meets_base(size: Array, s: int, n: Vector) -> bool:
    """Return whether the base looks along n more than the mantle does."""
    out, up = _slant(size, s)
    return -n[2] > out * math.sqrt(n[0] * n[0] + n[1] * n[1]) + up * n[2]


@kernel
def _face_along(pose: Array, size: Array, hulls: HullTable, hull: int, s: int,
                n_W: Vector) -> Vector:
    base = _meets_base(size, s, to_shape(pose, s, n_W))
    return scale(-1.0, axis(pose, s, 2)) if base else n_W


@kernel
def _outline(pose: Array, size: Array, s: int, hulls: HullTable, hull: int, n_W: Vector,
             corners: Array) -> tuple[int, int]:
    n, r, half = to_shape(pose, s, n_W), size[s, 0], size[s, 1]
    if _meets_base(size, s, n):
        return rim_corners(pose, s, r, -half, n, -1.0, corners)
    across = math.sqrt(n[0] * n[0] + n[1] * n[1])
    x, y = (n[0] / across, n[1] / across) if across > 0.0 else (1.0, 0.0)
    write_corner(corners, 0, point_to_world(pose, s, (r * x, r * y, -half)))
    write_corner(corners, 1, point_to_world(pose, s, (0.0, 0.0, half)))
    return 2, 0


@kernel
def _on_plane(pose: Array, size: Array, s: int, hulls: HullTable, hull: int, n: Vector, p: Vector,
              margin: float, points: Array, ids: IntArray) -> int:
    """Take four points around the rim and the apex."""
    X, first = down_the_rim(pose, s, n)
    count = put_rim(pose, s, size[s, 0], -size[s, 1], X, first, n, p, margin, points, ids)
    apex = add_scaled(origin(pose, s), size[s, 1], axis(pose, s, 2))
    return put_near_plane(points, ids, count, n, p, apex, 16, margin)


def _half_width(size: Size) -> float:
    # A triangle is least wide along one of its altitudes.
    r, half = size[0], size[1]
    return float(min(half, 2.0 * r * half / np.hypot(r, 2.0 * half)))


def _unit_cone(rings: int, sides: int) -> Surface:
    """Return the surface of a cone of diameter and height 1 m."""
    return revolved([(0.0, -0.5), (0.5, -0.5), (0.0, 0.5)], sides)


def _size(part: Any) -> Size:
    return part.radius, part.length / 2, 0.0


def _scale(part: Any) -> Size:
    return 2 * part.radius, 2 * part.radius, part.length


KIND = Kind(
    name='cone', type='cone', size=_size, sizes=2,
    volume=lambda part: cone_volume(part.radius, part.length),
    mass_properties=lambda m, part: cone(m, part.radius, part.length),
    summary=lambda part: f'r {part.radius:g} l {part.length:g}',
    half_lengths=lambda size: (size[0], size[0], size[1]),
    bounding_radius=lambda size: float(np.hypot(size[0], size[1])), half_width=_half_width,
    is_faceted=True, is_curved=True, has_disc=True,
    forms=lambda part: [Form('cone', _scale(part))],
    surface=lambda part, sides: scaled(_unit_cone(0, sides), _scale(part)),
    units={'cone': _unit_cone},
    reach_along=_reach_along, extreme=_extreme, from_point=_from_point, height=_height,
    way_out=_way_out, face_count=_face_count, face=_face, face_along=_face_along,
    outline=_outline, on_plane=_on_plane)
