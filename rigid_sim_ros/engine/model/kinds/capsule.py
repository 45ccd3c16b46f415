# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A capsule: all points within a radius of a segment along z, whose middle is the origin of S.

`size` is the radius and half of the length of the segment, without the caps [m].
"""

from collections.abc import Sequence
import math
from typing import Any

from rigid_sim_ros.engine.maths.algebra import add_scaled, clamp, norm, scale, subtract
from rigid_sim_ros.engine.maths.pose import axis, origin, point_to_world, to_shape
from rigid_sim_ros.engine.model.hulls import HullTable
from rigid_sim_ros.engine.model.inertia import about_origin, MassProperties
from rigid_sim_ros.engine.model.kinds.cylinder import cylinder_volume
from rigid_sim_ros.engine.model.kinds.drawing import arc, Form, revolved, Surface
from rigid_sim_ros.engine.model.kinds.kind import Kind, Size
from rigid_sim_ros.engine.model.kinds.points import put_near_plane, write_corner
from rigid_sim_ros.engine.model.kinds.sphere import sphere_volume
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel


def capsule_volume(radius: float, length: float) -> float:
    """Return the volume [m^3] of a capsule; length [m] without the caps."""
    return cylinder_volume(radius, length) + sphere_volume(radius)


def capsule(m: float, radius: float, length: float) -> MassProperties:
    """
    Return the mass properties of a homogeneous capsule about the z axis.

    length [m] is that of the cylinder, without the caps. A half ball of mass m_h has its centre of
    mass 3/8 r from the flat face and the moment 2/5 m_h r^2 about any axis through the centre of
    that face; the parallel axes theorem moves it to the middle of the capsule.
    """
    volume = capsule_volume(radius, length)
    m_cylinder = m * cylinder_volume(radius, length) / volume
    m_caps = m * sphere_volume(radius) / volume
    across = (m_cylinder * (3.0 * radius ** 2 + length ** 2) / 12.0
              + m_caps * (0.4 * radius ** 2 + length ** 2 / 4.0 + 3.0 / 8.0 * radius * length))
    along = 0.5 * m_cylinder * radius ** 2 + 0.4 * m_caps * radius ** 2
    return about_origin(m, [across, across, along])


@kernel
def _reach_along(size: Array, s: int, x: float, y: float, z: float) -> tuple[float, float]:
    reach = abs(z) * size[s, 1] + size[s, 0]
    return reach, reach


@kernel
def _extreme(size: Array, first: IntArray, count: IntArray, vertices: Array, hull: int, s: int,
             d: Vector) -> Vector:
    return (0.0, 0.0, math.copysign(size[s, 1], d[2]))


@kernel
def from_capsule(r: float, half: float, p: Vector) -> tuple[float, Vector, Vector]:
    """
    Return the signed distance [m] of p from a capsule, the outward normal and the foot of p.

    All in the frame of the capsule, whose half length is `half` [m].
    """
    q = (0.0, 0.0, clamp(p[2], -half, half))
    d = subtract(p, q)
    length = norm(d)
    n = scale(1.0 / length, d) if length > 0.0 else (1.0, 0.0, 0.0)
    return length - r, n, add_scaled(q, r, n)


@kernel
def _from_point(size: Array, s: int, p: Vector) -> tuple[float, Vector, Vector]:
    return from_capsule(size[s, 0], size[s, 1], p)


@kernel
def height_over_capsule(r: float, half: float, p: Vector) -> float:
    """Return how far p is outside of a capsule [m]."""
    z = p[2] - min(max(p[2], -half), half)
    return math.sqrt(p[0] * p[0] + p[1] * p[1] + z * z) - r


@kernel
def _height(size: Array, hulls: HullTable, hull: int, s: int, p: Vector) -> float:
    return height_over_capsule(size[s, 0], size[s, 1], p)


@kernel
def _way_out(size: Array, hulls: HullTable, hull: int, s: int, p: Vector, d: Vector) -> float:
    return -height_over_capsule(size[s, 0], size[s, 1], p)


@kernel
def _outline(pose: Array, size: Array, s: int, hulls: HullTable, hull: int, n_W: Vector,
             corners: Array) -> tuple[int, int]:
    n, r, half = to_shape(pose, s, n_W), size[s, 0], size[s, 1]
    write_corner(corners, 0, point_to_world(pose, s, (r * n[0], r * n[1], -half + r * n[2])))
    write_corner(corners, 1, point_to_world(pose, s, (r * n[0], r * n[1], half + r * n[2])))
    return 2, 0


@kernel
def _on_plane(pose: Array, size: Array, s: int, hulls: HullTable, hull: int, n: Vector, p: Vector,
              margin: float, points: Array, ids: IntArray) -> int:
    count = 0
    for end in range(2):
        middle = add_scaled(origin(pose, s), size[s, 1] if end == 1 else -size[s, 1],
                            axis(pose, s, 2))
        count = put_near_plane(points, ids, count, n, p, add_scaled(middle, -size[s, 0], n), end,
                               margin)
    return count


def _size(part: Any) -> Size:
    return part.radius, part.length / 2, 0.0


def _forms(part: Any) -> Sequence[Form]:
    width, end = 2 * part.radius, 0.5 * part.length
    half_turn = (1.0, 0.0, 0.0, 0.0)  # about x
    return [Form('tube', (width, width, part.length)), Form('dome', (width,) * 3, (0.0, 0.0, end)),
            Form('dome', (width,) * 3, (0.0, 0.0, -end), half_turn)]


def _surface(part: Any, sides: int) -> Surface:
    r, end, quarter = part.radius, 0.5 * part.length, math.pi / 2
    lower, upper = arc(sides // 4, r, -quarter, 0.0, -end), arc(sides // 4, r, 0.0, quarter, end)
    return revolved([*lower, *upper], sides)


def _unit_dome(rings: int, sides: int) -> Surface:
    """Return the upper half of a ball of the diameter 1 m, open below."""
    return revolved(arc(rings // 2, 0.5, 0.0, math.pi / 2), sides)


def _unit_tube(rings: int, sides: int) -> Surface:
    """Return a cylinder of diameter and length 1 m without its caps."""
    return revolved([(0.5, -0.5), (0.5, 0.5)], sides)


KIND = Kind(
    name='capsule', type='capsule', size=_size, sizes=2,
    volume=lambda part: capsule_volume(part.radius, part.length),
    mass_properties=lambda m, part: capsule(m, part.radius, part.length),
    summary=lambda part: f'r {part.radius:g} l {part.length:g}',
    half_lengths=lambda size: (size[0], size[0], size[0] + size[1]),
    bounding_radius=lambda size: size[0] + size[1], half_width=lambda size: size[0],
    is_rounded=True, most_points=2,
    forms=_forms, surface=_surface, units={'dome': _unit_dome, 'tube': _unit_tube},
    reach_along=_reach_along, extreme=_extreme, from_point=_from_point, height=_height,
    way_out=_way_out, outline=_outline, on_plane=_on_plane)
