# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A sphere about the origin of S; `size` is its radius [m]."""

import math
from typing import Any

from rigid_sim_ros.engine.maths.algebra import norm, scale
from rigid_sim_ros.engine.model.hulls import HullTable
from rigid_sim_ros.engine.model.inertia import about_origin, MassProperties
from rigid_sim_ros.engine.model.kinds.drawing import arc, Form, revolved, scaled, Surface
from rigid_sim_ros.engine.model.kinds.kind import Kind, Size
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel


def sphere_volume(radius: float) -> float:
    """Return the volume [m^3] of a ball of this radius [m]."""
    return 4.0 / 3.0 * math.pi * radius ** 3


def sphere(m: float, radius: float) -> MassProperties:
    """Return the mass properties of a homogeneous ball, I = 2/5 m r^2."""
    return about_origin(m, [0.4 * m * radius ** 2] * 3)


@kernel
def _reach_along(size: Array, s: int, x: float, y: float, z: float) -> tuple[float, float]:
    return size[s, 0], size[s, 0]


@kernel
def _extreme(size: Array, first: IntArray, count: IntArray, vertices: Array, hull: int, s: int,
             d: Vector) -> Vector:
    return (0.0, 0.0, 0.0)


@kernel
def _from_point(size: Array, s: int, p: Vector) -> tuple[float, Vector, Vector]:
    length = norm(p)
    # In the middle every direction is as near as another; x is taken.
    n = scale(1.0 / length, p) if length > 0.0 else (1.0, 0.0, 0.0)
    return length - size[s, 0], n, scale(size[s, 0], n)


@kernel
def _height(size: Array, hulls: HullTable, hull: int, s: int, p: Vector) -> float:
    return norm(p) - size[s, 0]


@kernel
def _way_out(size: Array, hulls: HullTable, hull: int, s: int, p: Vector, d: Vector) -> float:
    return size[s, 0] - norm(p)


def _size(part: Any) -> Size:
    return part.radius, 0.0, 0.0


def unit_ball(rings: int, sides: int) -> Surface:
    """Return the surface of a ball of the diameter 1 m."""
    return revolved(arc(rings, 0.5, -math.pi / 2, math.pi / 2), sides)


KIND = Kind(
    name='sphere', type='sphere', size=_size, sizes=1,
    volume=lambda part: sphere_volume(part.radius),
    mass_properties=lambda m, part: sphere(m, part.radius),
    summary=lambda part: f'r {part.radius:g}',
    half_lengths=lambda size: (size[0], size[0], size[0]),
    bounding_radius=lambda size: size[0], half_width=lambda size: size[0],
    is_ball=True, is_rounded=True, most_points=1,
    forms=lambda part: [Form('sphere', (2 * part.radius,) * 3)],
    surface=lambda part, sides: scaled(unit_ball(sides // 2, sides), (2 * part.radius,) * 3),
    units={'sphere': unit_ball}, has_octants=True,
    reach_along=_reach_along, extreme=_extreme, from_point=_from_point, height=_height,
    way_out=_way_out)
