# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Inertia in world axes (Meyer, Rigid Body Dynamics, "Inertia Tensor")."""

import numpy as np

from rigid_sim_ros.engine.maths import algebra
from rigid_sim_ros.engine.maths.rotation import Matrix, to_matrix
from rigid_sim_ros.kernels.arrays import Array, Quaternion, Vector
from rigid_sim_ros.kernels.kernel import in_python, kernel, part


@kernel
def world_inertia(q_WC: Quaternion, moments: Vector) -> Matrix:
    """
    Return R I R^T by rows [kg m^2], world axes, of the principal moments I.

    Of their reciprocals it is the inverse, R I^-1 R^T [1/(kg m^2)].
    """
    R = to_matrix(q_WC)
    return (_row(R, 0, moments), _row(R, 1, moments), _row(R, 2, moments))


@kernel
def _row(R: Matrix, j: int, moments: Vector) -> Vector:
    r = R[j]
    scaled = (r[0] * moments[0], r[1] * moments[1], r[2] * moments[2])
    return (algebra.dot(scaled, R[0]), algebra.dot(scaled, R[1]), algebra.dot(scaled, R[2]))


@part
def write_world_inertia(q_WC: Quaternion, moments: Vector, numbers: Array, at: int) -> None:
    """Write `world_inertia`, which is symmetric: xx, xy, xz, yy, yz, zz from a place on."""
    x, y, z = world_inertia(q_WC, moments)
    numbers[at], numbers[at + 1], numbers[at + 2] = x
    numbers[at + 3], numbers[at + 4], numbers[at + 5] = y[1], y[2], z[2]


_world_inertia = in_python(world_inertia)


def world_inertia_of(q_WC: Array, moments: Array) -> Array:
    """Return `world_inertia`, (3, 3), as Python works it out: of (4,) and (3,) numbers."""
    return np.array(_world_inertia(tuple(q_WC.tolist()), tuple(moments.tolist())))
