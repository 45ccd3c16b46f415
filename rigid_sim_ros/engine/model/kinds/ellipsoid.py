# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An ellipsoid about the origin of S, its axes along those of S; `size` is its three radii [m]."""

from collections.abc import Sequence
import math
from typing import Any

from rigid_sim_ros.engine.maths.algebra import norm, scale, subtract
from rigid_sim_ros.engine.maths.pose import origin, to_shape, to_world
from rigid_sim_ros.engine.model.hulls import HullTable
from rigid_sim_ros.engine.model.inertia import about_origin, MassProperties
from rigid_sim_ros.engine.model.kinds.drawing import Form, scaled, Surface
from rigid_sim_ros.engine.model.kinds.kind import Kind, Size
from rigid_sim_ros.engine.model.kinds.points import put_near_plane
from rigid_sim_ros.engine.model.kinds.sphere import unit_ball
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import apart, kernel

ROUNDS = 60  # of Newton's method for the nearest point; it needs 5 to 10


def ellipsoid_volume(radii: Sequence[float]) -> float:
    """Return the volume [m^3] of an ellipsoid of these radii [m]."""
    return float(4.0 / 3.0 * math.pi * radii[0] * radii[1] * radii[2])


def ellipsoid(m: float, radii: Sequence[float]) -> MassProperties:
    """
    Return the mass properties of a homogeneous ellipsoid.

    I = m / 5 diag(b^2 + c^2, a^2 + c^2, a^2 + b^2) for the radii a, b, c [m].
    """
    a, b, c = radii
    return about_origin(m, [0.2 * m * (b * b + c * c), 0.2 * m * (a * a + c * c),
                            0.2 * m * (a * a + b * b)])


@kernel
def support(size: Array, s: int, n: Vector) -> tuple[float, Vector]:
    """Return max n . x [m] over an ellipsoid, |(a n_x, b n_y, c n_z)|, and the point x, in S."""
    v = (size[s, 0] * n[0], size[s, 1] * n[1], size[s, 2] * n[2])
    h = norm(v)
    if h == 0.0:
        return 0.0, (size[s, 0], 0.0, 0.0)
    return h, (size[s, 0] * v[0] / h, size[s, 1] * v[1] / h, size[s, 2] * v[2] / h)


@kernel
def _reach_along(size: Array, s: int, x: float, y: float, z: float) -> tuple[float, float]:
    reach = norm((x * size[s, 0], y * size[s, 1], z * size[s, 2]))
    return reach, reach


@kernel
def _extreme(size: Array, first: IntArray, count: IntArray, vertices: Array, hull: int, s: int,
             d: Vector) -> Vector:
    return support(size, s, d)[1]


@kernel
def _sum_of_squares(size: Array, s: int, p: Vector, least: float, v: float) -> tuple[float, float]:
    """Return f and -f' / 2 of `_from_point`; what has y = 0 and w = 0 counts as 0."""
    f, slope = -1.0, 0.0
    for k in range(3):
        a = size[s, k]
        w = v + (a - least) * (a + least)
        if w > 0.0:
            part = (a * p[k] / w) * (a * p[k] / w)
            f += part
            slope += part / w
    return f, slope


@apart
def _from_point(size: Array, s: int, p: Vector) -> tuple[float, Vector, Vector]:
    """
    Return the signed distance [m] of p from an ellipsoid, the outward normal and the foot of p.

    The foot x is where y_i = x_i (1 + t / a_i^2), for p = y, with the one t for which x lies on
    the surface: the largest root of f = sum (a_i y_i / (t + a_i^2))^2 - 1 (Eberly, "Distance from
    a Point to an Ellipse, an Ellipsoid, or a Hyperellipsoid", Geometric Tools, 2013). f is convex
    and falls, so Newton's method comes from the left without a detour. v = t + the square of the
    least radius, which keeps the digits of a point deep inside. There, on the plane across the
    shortest axis, no root may be left: the foot is beside the plane then, as far as its other
    coordinates leave room.
    """
    least = min(size[s, 0], size[s, 1], size[s, 2])
    v = 0.0
    for k in range(3):
        a = size[s, k]
        v = max(v, a * abs(p[k]) - (a - least) * (a + least))
    f, slope = _sum_of_squares(size, s, p, least, v)
    for _ in range(ROUNDS if f > 0.0 else 0):
        further = v + 0.5 * f / slope
        if not further > v:
            break
        v = further
        f, slope = _sum_of_squares(size, s, p, least, v)
        if f <= 0.0:
            break
    # Of the gradient x_i / a_i^2: y_i / (t + a_i^2).
    g, rest = (0.0, 0.0, 0.0), math.sqrt(-f) if v == 0.0 and f < 0.0 else 0.0
    for k in range(3):
        a = size[s, k]
        w, e = v + (a - least) * (a + least), p[k]
        gradient = 0.0
        if w > 0.0:
            gradient = e / w
        elif rest > 0.0:
            gradient, rest = math.copysign(rest / a, e), 0.0
        g = (gradient if k == 0 else g[0], gradient if k == 1 else g[1],
             gradient if k == 2 else g[2])
    length = norm(g)
    n = scale(1.0 / length, g)
    foot = support(size, s, n)[1]
    return (v - least * least) * length, n, foot


@kernel
def _height(size: Array, hulls: HullTable, hull: int, s: int, p: Vector) -> float:
    return _from_point(size, s, p)[0]


@kernel
def _way_out(size: Array, hulls: HullTable, hull: int, s: int, p: Vector, d: Vector) -> float:
    return -_from_point(size, s, p)[0]


@kernel
def _on_plane(pose: Array, size: Array, s: int, hulls: HullTable, hull: int, n: Vector, p: Vector,
              margin: float, points: Array, ids: IntArray) -> int:
    """Take the lowest point."""
    _, x = support(size, s, to_shape(pose, s, n))
    return put_near_plane(points, ids, 0, n, p, subtract(origin(pose, s), to_world(pose, s, x)), 0,
                          margin)


def _size(part: Any) -> Size:
    return part.radii[0], part.radii[1], part.radii[2]


def _scale(part: Any) -> Size:
    return 2 * part.radii[0], 2 * part.radii[1], 2 * part.radii[2]


def _surface(part: Any, sides: int) -> Surface:
    return scaled(unit_ball(sides // 2, sides), _scale(part))


KIND = Kind(
    name='ellipsoid', type='ellipsoid', size=_size, sizes=3,
    volume=lambda part: ellipsoid_volume(part.radii),
    mass_properties=lambda m, part: ellipsoid(m, part.radii),
    summary=lambda part: 'radii ' + ' x '.join(f'{radius:g}' for radius in part.radii),
    bounding_radius=max, half_width=min,
    is_curved=True, is_smooth=True, most_points=1,
    forms=lambda part: [Form('sphere', _scale(part))], surface=_surface, has_octants=True,
    reach_along=_reach_along, extreme=_extreme, from_point=_from_point, height=_height,
    way_out=_way_out, on_plane=_on_plane)
