# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Poses of shapes in the world: rows (12,) of the origin p_WS [m] and the rotation matrix R_WS.

The matrix follows the origin, row by row.
"""

from rigid_sim_ros.engine.maths.algebra import add, subtract
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def origin(pose: Array, s: int) -> Vector:
    """Return the origin of shape s [m, world axes]."""
    return (pose[s, 0], pose[s, 1], pose[s, 2])


@kernel
def axis(pose: Array, s: int, k: int) -> Vector:
    """Return axis k of the frame of shape s, world axes: column k of its rotation matrix."""
    return (pose[s, 3 + k], pose[s, 6 + k], pose[s, 9 + k])


@kernel
def to_world(pose: Array, s: int, v: Vector) -> Vector:
    """Return R v: a direction of frame S in world axes."""
    return (pose[s, 3] * v[0] + pose[s, 4] * v[1] + pose[s, 5] * v[2],
            pose[s, 6] * v[0] + pose[s, 7] * v[1] + pose[s, 8] * v[2],
            pose[s, 9] * v[0] + pose[s, 10] * v[1] + pose[s, 11] * v[2])


@kernel
def to_shape(pose: Array, s: int, v: Vector) -> Vector:
    """Return R^T v: a direction of the world in axes of S."""
    return (pose[s, 3] * v[0] + pose[s, 6] * v[1] + pose[s, 9] * v[2],
            pose[s, 4] * v[0] + pose[s, 7] * v[1] + pose[s, 10] * v[2],
            pose[s, 5] * v[0] + pose[s, 8] * v[1] + pose[s, 11] * v[2])


@kernel
def point_to_world(pose: Array, s: int, p: Vector) -> Vector:
    """Return the point p of frame S [m] in the world."""
    return add(origin(pose, s), to_world(pose, s, p))


@kernel
def point_to_shape(pose: Array, s: int, p: Vector) -> Vector:
    """Return the point p of the world [m] in frame S."""
    return to_shape(pose, s, subtract(p, origin(pose, s)))
