# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Poses of frames in each other, for the numbers of a description."""

from collections.abc import Sequence
import math
from typing import NamedTuple

from rigid_sim_ros.engine.maths.rotation_in_python import multiply, rotate, to_matrix

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class Pose(NamedTuple):
    """Where a frame is in another one: its origin [m], and x, y, z, w of its attitude."""

    position: Vector
    orientation: Quaternion


IDENTITY = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def combined(outer: Pose, inner: Pose) -> Pose:
    """Return the pose in A of a frame C, from the pose of B in A and that of C in B."""
    x, y, z = rotate(outer.orientation, inner.position)
    a, b, c = outer.position
    return Pose((a + x, b + y, c + z), _unit(multiply(outer.orientation, inner.orientation)))


def inverse(pose: Pose) -> Pose:
    """Return the pose of A in B, from that of B in A."""
    a, b, c, d = pose.orientation
    x, y, z = rotate((-a, -b, -c, d), pose.position)
    return Pose((-x, -y, -z), (-a, -b, -c, d))


def turned(pose: Pose, vector: Sequence[float]) -> Vector:
    """Return a vector in the outer axes, from the inner ones."""
    x, y, z = rotate(pose.orientation, (vector[0], vector[1], vector[2]))
    return x, y, z


def from_rpy(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the attitude R = Rz(yaw) Ry(pitch) Rx(roll), as URDF and SDF have it."""
    a, b, c = 0.5 * roll, 0.5 * pitch, 0.5 * yaw
    x, y, z = (((math.sin(a), 0.0, 0.0, math.cos(a))), (0.0, math.sin(b), 0.0, math.cos(b)),
               (0.0, 0.0, math.sin(c), math.cos(c)))
    return _unit(multiply(z, multiply(y, x)))


def turned_tensor(orientation: Quaternion, tensor: Sequence[float]) -> tuple[float, ...]:
    """Return R I R^T of a symmetric I, both as xx, yy, zz, xy, xz, yz."""
    if orientation == IDENTITY.orientation:
        return tuple(tensor)
    R = to_matrix(orientation)
    xx, yy, zz, xy, xz, yz = tensor
    rows = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    return tuple(sum(R[i][k] * rows[k][m] * R[j][m] for k in range(3) for m in range(3))
                 for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))


def _unit(q: Sequence[float]) -> Quaternion:
    norm = math.hypot(*q)
    return q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm
