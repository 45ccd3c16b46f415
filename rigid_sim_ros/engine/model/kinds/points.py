# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Candidates of a manifold: rows of a point on A [m, world axes] and its gap [m]."""

from rigid_sim_ros.engine.maths.algebra import add_scaled, dot, subtract
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def put(points: Array, ids: IntArray, k: int, p: Vector, gap: float, feature: int) -> None:
    """Write candidate k of a manifold: the point on A [m, world axes], gap [m], feature."""
    points[k, 0] = p[0]
    points[k, 1] = p[1]
    points[k, 2] = p[2]
    points[k, 3] = gap
    ids[k] = feature


@kernel
def copy_candidate(points: Array, ids: IntArray, to: int, k: int) -> None:
    """Write candidate k in the place `to`."""
    for i in range(4):
        points[to, i] = points[k, i]
    ids[to] = ids[k]


@kernel
def put_near_plane(points: Array, ids: IntArray, count: int, n: Vector, p: Vector, q: Vector,
                   feature: int, margin: float) -> int:
    """Add the point q of a shape if it is near the plane; return the new number of points."""
    gap = dot(n, subtract(q, p))
    if gap >= margin:
        return count
    put(points, ids, count, add_scaled(q, -gap, n), gap, feature)
    return count + 1


@kernel
def write_corner(corners: Array, k: int, q: Vector) -> None:
    """Write corner k of an outline [m, world axes]."""
    corners[k, 0], corners[k, 1], corners[k, 2] = q
