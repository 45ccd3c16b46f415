# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The half space below the plane z = 0 of S; it needs no `size`."""

import math
from typing import Any

from rigid_sim_ros.engine.model.hulls import HullTable
from rigid_sim_ros.engine.model.kinds.kind import Kind, Size
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def _reach_along(size: Array, s: int, x: float, y: float, z: float) -> tuple[float, float]:
    return math.inf, math.inf


@kernel
def _from_point(size: Array, s: int, p: Vector) -> tuple[float, Vector, Vector]:
    return p[2], (0.0, 0.0, 1.0), (p[0], p[1], 0.0)


@kernel
def _height(size: Array, hulls: HullTable, hull: int, s: int, p: Vector) -> float:
    return p[2]


@kernel
def _way_out(size: Array, hulls: HullTable, hull: int, s: int, p: Vector, d: Vector) -> float:
    return -p[2] / d[2] if d[2] > 0.0 else math.inf


def _size(part: Any) -> Size:
    return 0.0, 0.0, 0.0


KIND = Kind(
    name='plane', type='plane', size=_size, sizes=0,
    half_lengths=lambda size: (math.inf, math.inf, math.inf),
    bounding_radius=lambda size: math.inf, half_width=lambda size: math.inf,
    is_unbounded=True, is_flat=True,
    reach_along=_reach_along, from_point=_from_point, height=_height, way_out=_way_out)
