# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A cylinder about the axis z, its middle at the origin of S; `size`: radius, half length [m]."""

import math
from typing import Any

import numpy as np

from rigid_sim_ros.engine.maths.algebra import add_scaled, clamp, dot, scale
from rigid_sim_ros.engine.maths.pose import axis, origin, point_to_world, to_shape
from rigid_sim_ros.engine.model.hulls import HullTable
from rigid_sim_ros.engine.model.inertia import about_origin, MassProperties
from rigid_sim_ros.engine.model.kinds.drawing import Form, revolved, scaled, Surface
from rigid_sim_ros.engine.model.kinds.kind import Kind, Size
from rigid_sim_ros.engine.model.kinds.points import put_near_plane, write_corner
from rigid_sim_ros.engine.model.kinds.rim import down_the_rim, put_rim, rim_corners
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel


def cylinder_volume(radius: float, length: float) -> float:
    """Return the volume [m^3] of a cylinder of this radius and length [m]."""
    return math.pi * radius ** 2 * length


def cylinder(m: float, radius: float, length: float) -> MassProperties:
    """Return the mass properties of a homogeneous cylinder about the z axis."""
    across = m * (3.0 * radius ** 2 + length ** 2) / 12.0
    return about_origin(m, [across, across, 0.5 * m * radius ** 2])


@kernel
def _reach_along(size: Array, s: int, x: float, y: float, z: float) -> tuple[float, float]:
    # A disc at right angles to its axis reaches r sin(angle) along another one.
    reach = abs(z) * size[s, 1] + size[s, 0] * math.sqrt(max(0.0, 1.0 - z * z))
    return reach, reach


@kernel
def _extreme(size: Array, first: IntArray, count: IntArray, vertices: Array, hull: int, s: int,
             d: Vector) -> Vector:
    across = math.sqrt(d[0] * d[0] + d[1] * d[1])
    # Straight up every point of the cap is as far as another; one on the rim is taken.
    x, y = (d[0] / across, d[1] / across) if across > 0.0 else (1.0, 0.0)
    return (size[s, 0] * x, size[s, 0] * y, math.copysign(size[s, 1], d[2]))


@kernel
def _from_point(size: Array, s: int, p: Vector) -> tuple[float, Vector, Vector]:
    r, half = size[s, 0], size[s, 1]
    rho = math.sqrt(p[0] * p[0] + p[1] * p[1])
    # On the axis every direction is as near as another; x is taken.
    ex, ey = (p[0] / rho, p[1] / rho) if rho > 0.0 else (1.0, 0.0)
    up = 1.0 if p[2] >= 0.0 else -1.0
    side, cap = rho - r, abs(p[2]) - half
    if side <= 0.0 and cap <= 0.0:
        if side >= cap:
            return side, (ex, ey, 0.0), (r * ex, r * ey, p[2])
        return cap, (0.0, 0.0, up), (p[0], p[1], up * half)
    x, z = max(side, 0.0), max(cap, 0.0)
    distance = math.sqrt(x * x + z * z)
    foot = min(rho, r)
    return (distance, (x / distance * ex, x / distance * ey, z / distance * up),
            (foot * ex, foot * ey, clamp(p[2], -half, half)))


@kernel
def _height(size: Array, hulls: HullTable, hull: int, s: int, p: Vector) -> float:
    return max(math.sqrt(p[0] * p[0] + p[1] * p[1]) - size[s, 0], abs(p[2]) - size[s, 1])


@kernel
def _way_out(size: Array, hulls: HullTable, hull: int, s: int, p: Vector, d: Vector) -> float:
    way = math.inf
    if d[2] != 0.0:
        way = (size[s, 1] - math.copysign(1.0, d[2]) * p[2]) / abs(d[2])
    # |p + t d| = r in the plane at right angles to the axis.
    dd, pd = d[0] * d[0] + d[1] * d[1], p[0] * d[0] + p[1] * d[1]
    if dd > 0.0:
        inside = size[s, 0] * size[s, 0] - p[0] * p[0] - p[1] * p[1]
        way = min(way, (math.sqrt(max(pd * pd + dd * inside, 0.0)) - pd) / dd)
    return way


@kernel
def _face_count(hulls: HullTable, hull: int) -> int:
    return 2


@kernel
def _face(pose: Array, size: Array, hulls: HullTable, hull: int, s: int,
          f: int) -> tuple[Vector, float]:
    return scale(1.0 if f % 2 == 1 else -1.0, axis(pose, s, 2)), size[s, 1]


@kernel
def _face_along(pose: Array, size: Array, hulls: HullTable, hull: int, s: int,
                n_W: Vector) -> Vector:
    n = to_shape(pose, s, n_W)
    return scale(math.copysign(1.0, n[2]), axis(pose, s, 2))


@kernel
def _outline(pose: Array, size: Array, s: int, hulls: HullTable, hull: int, n_W: Vector,
             corners: Array) -> tuple[int, int]:
    n, r, half = to_shape(pose, s, n_W), size[s, 0], size[s, 1]
    across = math.sqrt(n[0] * n[0] + n[1] * n[1])
    if across > abs(n[2]):
        x, y = r * n[0] / across, r * n[1] / across
        write_corner(corners, 0, point_to_world(pose, s, (x, y, -half)))
        write_corner(corners, 1, point_to_world(pose, s, (x, y, half)))
        return 2, 0
    e = math.copysign(1.0, n[2])
    return rim_corners(pose, s, r, e * half, n, e, corners)


@kernel
def _on_plane(pose: Array, size: Array, s: int, hulls: HullTable, hull: int, n: Vector, p: Vector,
              margin: float, points: Array, ids: IntArray) -> int:
    """Take four points around the rim that is lower and the lowest point of the other rim."""
    Z, r = axis(pose, s, 2), size[s, 0]
    lower = -1.0 if dot(n, Z) > 0.0 else 1.0
    X, first = down_the_rim(pose, s, n)
    count = put_rim(pose, s, r, lower * size[s, 1], X, first, n, p, margin, points, ids)
    if first > 0:
        cap = add_scaled(origin(pose, s), lower * size[s, 1], Z)
        far = add_scaled(add_scaled(cap, -2.0 * lower * size[s, 1], Z), r, X)
        count = put_near_plane(points, ids, count, n, p, far, 16, margin)
    return count


def _size(part: Any) -> Size:
    return part.radius, part.length / 2, 0.0


def _unit_cylinder(rings: int, sides: int) -> Surface:
    """Return the surface of a cylinder of diameter and length 1 m."""
    return revolved([(0.0, -0.5), (0.5, -0.5), (0.5, 0.5), (0.0, 0.5)], sides)


def _scale(part: Any) -> Size:
    return 2 * part.radius, 2 * part.radius, part.length


KIND = Kind(
    name='cylinder', type='cylinder', size=_size, sizes=2,
    volume=lambda part: cylinder_volume(part.radius, part.length),
    mass_properties=lambda m, part: cylinder(m, part.radius, part.length),
    summary=lambda part: f'r {part.radius:g} l {part.length:g}',
    half_lengths=lambda size: (size[0], size[0], size[1]),
    bounding_radius=lambda size: float(np.hypot(size[0], size[1])),
    half_width=lambda size: min(size[0], size[1]),
    is_faceted=True, is_curved=True, has_disc=True,
    forms=lambda part: [Form('cylinder', _scale(part))],
    surface=lambda part, sides: scaled(_unit_cylinder(0, sides), _scale(part)),
    units={'cylinder': _unit_cylinder},
    reach_along=_reach_along, extreme=_extreme, from_point=_from_point, height=_height,
    way_out=_way_out, face_count=_face_count, face=_face, face_along=_face_along,
    outline=_outline, on_plane=_on_plane)
