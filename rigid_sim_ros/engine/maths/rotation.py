# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Unit quaternions (x, y, z, w) inside a kernel.

A quaternion q_AB turns the axes of B into those of A: v_A = q_AB v_B q_AB*. How
attitudes change with time, dR/dt and dq/dt: state/rates.py.
"""

import math

from rigid_sim_ros.engine.maths.vector import cross
from rigid_sim_ros.kernels.arrays import Array, Quaternion, Vector
from rigid_sim_ros.kernels.kernel import inlined, kernel

Matrix = tuple[Vector, Vector, Vector]


@inlined
def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the Hamilton product a b: first the rotation b, then a."""
    return (a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
            a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
            a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
            a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2])


@inlined
def conjugate(q: Quaternion) -> Quaternion:
    """Return q*, the inverse of a unit quaternion."""
    return (-q[0], -q[1], -q[2], q[3])


@kernel
def unit(q: Quaternion) -> Quaternion:
    """Return q / |q|."""
    s = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (q[0] * s, q[1] * s, q[2] * s, q[3] * s)


@inlined
def rotate(q: Quaternion, v: Vector) -> Vector:
    """Return q v q*: the vector v_B in the axes of A for q = q_AB."""
    u = (q[0], q[1], q[2])
    t = cross(u, v)
    t = (2.0 * t[0], 2.0 * t[1], 2.0 * t[2])
    c = cross(u, t)
    return (v[0] + q[3] * t[0] + c[0], v[1] + q[3] * t[1] + c[1], v[2] + q[3] * t[2] + c[2])


@inlined
def rotate_back(q: Quaternion, v: Vector) -> Vector:
    """Return q* v q: the vector v_A in the axes of B for q = q_AB."""
    return rotate(conjugate(q), v)


@kernel
def exponential(r: Vector) -> Quaternion:
    """Return the rotation about r / |r| by |r| [rad], for any r."""
    angle = math.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    half = 0.5 * angle
    # sin(angle / 2) / angle goes to 1/2 where the quotient itself is 0/0.
    s = math.sin(half) / angle if angle > 0.0 else 0.5
    return (s * r[0], s * r[1], s * r[2], math.cos(half))


@kernel
def logarithm(q: Quaternion) -> Vector:
    """Return the rotation vector [rad], |r| <= pi: the inverse of `exponential`."""
    sign = 1.0 if q[3] >= 0.0 else -1.0
    s = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    # angle / sin(angle / 2) goes to 2 where the quotient itself is 0/0.
    k = sign * (2.0 * math.atan2(s, sign * q[3]) / s if s > 0.0 else 2.0)
    return (k * q[0], k * q[1], k * q[2])


@kernel
def to_matrix(q: Quaternion) -> Matrix:
    """Return the rows of the rotation matrix R(q)."""
    x, y, z, w = q
    return ((1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)))


@kernel
def from_matrix(R: Matrix) -> Quaternion:
    """
    Return the unit quaternion of a rotation matrix given by its rows.

    Shepperd, Quaternion from rotation matrix, J. Guidance and Control 1 (1978): divide by the
    largest of the four components, so that nothing cancels.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R
    trace = xx + yy + zz
    if trace >= xx and trace >= yy and trace >= zz:
        return unit((zy - yz, xz - zx, yx - xy, 1.0 + trace))
    if xx >= yy and xx >= zz:
        return unit((1.0 + xx - yy - zz, xy + yx, xz + zx, zy - yz))
    if yy >= zz:
        return unit((xy + yx, 1.0 + yy - xx - zz, yz + zy, xz - zx))
    return unit((xz + zx, yz + zy, 1.0 + zz - xx - yy, yx - xy))


@inlined
def quaternion(a: Array, i: int) -> Quaternion:
    """Return column i of an array of shape (4, n)."""
    return (a[0, i], a[1, i], a[2, i], a[3, i])


@inlined
def set_quaternion(a: Array, i: int, q: Quaternion) -> None:
    """Write q to column i of an array of shape (4, n)."""
    a[0, i] = q[0]
    a[1, i] = q[1]
    a[2, i] = q[2]
    a[3, i] = q[3]
