# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Spatial vectors and symmetric spatial matrices of rigid-body dynamics, in world axes.

A motion vector is (v, w), velocity of a point [m/s] and angular velocity [rad/s]; a force vector
is (f, n), force and moment about that point; both six numbers, the linear part first. A spatial
inertia maps the first to the second. It is symmetric, and stands here as its 21 numbers

    m00 m01 m02 m11 m12 m22   (the upper triangle of the linear block M)
    b00 b01 b02 b10 ... b22   (the block B from w to f, row by row)
    j00 j01 j02 j11 j12 j22   (the upper triangle of the angular block J)

(Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 2, with the linear part first.)
"""

from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import inlined

Six = tuple[float, float, float, float, float, float]
# 21 numbers; mypy knows no shorter way to say so.
Inertia = tuple[float, ...]

SIZE = 21   # numbers of an inertia


@inlined
def body_inertia(m: float, I_W: Six, r: Vector) -> Inertia:
    """
    Return the inertia of a rigid body about a point from which its centre of mass is at r [m].

    m is its mass [kg], I_W the upper triangle xx xy xz yy yz zz of its inertia tensor about the
    centre of mass [kg m^2], all in world axes: f = m (v + w x r), n = I w + r x f (Featherstone,
    equation 2.63).
    """
    x, y, z = r
    mx, my, mz = m * x, m * y, m * z
    return (m, 0.0, 0.0, m, 0.0, m,
            0.0, mz, -my, -mz, 0.0, mx, my, -mx, 0.0,
            I_W[0] + my * y + mz * z, I_W[1] - mx * y, I_W[2] - mx * z,
            I_W[3] + mx * x + mz * z, I_W[4] - my * z, I_W[5] + mx * x + my * y)


@inlined
def load(a: Array, i: int) -> Inertia:
    """Return row i of an array of shape (n, SIZE)."""
    return (a[i, 0], a[i, 1], a[i, 2], a[i, 3], a[i, 4], a[i, 5],
            a[i, 6], a[i, 7], a[i, 8], a[i, 9], a[i, 10], a[i, 11], a[i, 12], a[i, 13], a[i, 14],
            a[i, 15], a[i, 16], a[i, 17], a[i, 18], a[i, 19], a[i, 20])


@inlined
def store(a: Array, i: int, A: Inertia) -> None:
    """Write an inertia to row i of an array of shape (n, SIZE)."""
    a[i, 0], a[i, 1], a[i, 2], a[i, 3], a[i, 4], a[i, 5] = A[0], A[1], A[2], A[3], A[4], A[5]
    a[i, 6], a[i, 7], a[i, 8], a[i, 9], a[i, 10], a[i, 11] = A[6], A[7], A[8], A[9], A[10], A[11]
    a[i, 12], a[i, 13], a[i, 14] = A[12], A[13], A[14]
    a[i, 15], a[i, 16], a[i, 17] = A[15], A[16], A[17]
    a[i, 18], a[i, 19], a[i, 20] = A[18], A[19], A[20]


@inlined
def accumulate(a: Array, i: int, A: Inertia) -> None:
    """Add an inertia to row i of an array of shape (n, SIZE)."""
    store(a, i, (
        a[i, 0] + A[0], a[i, 1] + A[1], a[i, 2] + A[2], a[i, 3] + A[3], a[i, 4] + A[4],
        a[i, 5] + A[5], a[i, 6] + A[6], a[i, 7] + A[7], a[i, 8] + A[8], a[i, 9] + A[9],
        a[i, 10] + A[10], a[i, 11] + A[11], a[i, 12] + A[12], a[i, 13] + A[13],
        a[i, 14] + A[14], a[i, 15] + A[15], a[i, 16] + A[16], a[i, 17] + A[17],
        a[i, 18] + A[18], a[i, 19] + A[19], a[i, 20] + A[20]))


@inlined
def times_rotation(A: Inertia, s: Vector) -> Six:
    """Return A (0, s): the force vector that the rotation s needs."""
    return (A[6] * s[0] + A[7] * s[1] + A[8] * s[2],
            A[9] * s[0] + A[10] * s[1] + A[11] * s[2],
            A[12] * s[0] + A[13] * s[1] + A[14] * s[2],
            A[15] * s[0] + A[16] * s[1] + A[17] * s[2],
            A[16] * s[0] + A[18] * s[1] + A[19] * s[2],
            A[17] * s[0] + A[19] * s[1] + A[20] * s[2])


@inlined
def times_translation(A: Inertia, s: Vector) -> Six:
    """Return A (s, 0): the force vector that the translation s needs."""
    return (A[0] * s[0] + A[1] * s[1] + A[2] * s[2],
            A[1] * s[0] + A[3] * s[1] + A[4] * s[2],
            A[2] * s[0] + A[4] * s[1] + A[5] * s[2],
            A[6] * s[0] + A[9] * s[1] + A[12] * s[2],
            A[7] * s[0] + A[10] * s[1] + A[13] * s[2],
            A[8] * s[0] + A[11] * s[1] + A[14] * s[2])


@inlined
def times_motion(A: Inertia, V: Six) -> Six:
    """Return A V, the force vector of the motion vector V."""
    return (A[0] * V[0] + A[1] * V[1] + A[2] * V[2] + A[6] * V[3] + A[7] * V[4] + A[8] * V[5],
            A[1] * V[0] + A[3] * V[1] + A[4] * V[2] + A[9] * V[3] + A[10] * V[4] + A[11] * V[5],
            A[2] * V[0] + A[4] * V[1] + A[5] * V[2] + A[12] * V[3] + A[13] * V[4] + A[14] * V[5],
            A[6] * V[0] + A[9] * V[1] + A[12] * V[2] + A[15] * V[3] + A[16] * V[4] + A[17] * V[5],
            A[7] * V[0] + A[10] * V[1] + A[13] * V[2] + A[16] * V[3] + A[18] * V[4]
            + A[19] * V[5],
            A[8] * V[0] + A[11] * V[1] + A[14] * V[2] + A[17] * V[3] + A[19] * V[4]
            + A[20] * V[5])


@inlined
def without(A: Inertia, U: Six, inv_D: float) -> Inertia:
    """Return A - U U^T / D: what is left when the motion along one joint axis is free."""
    k0, k1, k2 = inv_D * U[0], inv_D * U[1], inv_D * U[2]
    k3, k4, k5 = inv_D * U[3], inv_D * U[4], inv_D * U[5]
    return (A[0] - k0 * U[0], A[1] - k0 * U[1], A[2] - k0 * U[2], A[3] - k1 * U[1],
            A[4] - k1 * U[2], A[5] - k2 * U[2],
            A[6] - k0 * U[3], A[7] - k0 * U[4], A[8] - k0 * U[5],
            A[9] - k1 * U[3], A[10] - k1 * U[4], A[11] - k1 * U[5],
            A[12] - k2 * U[3], A[13] - k2 * U[4], A[14] - k2 * U[5],
            A[15] - k3 * U[3], A[16] - k3 * U[4], A[17] - k3 * U[5], A[18] - k4 * U[4],
            A[19] - k4 * U[5], A[20] - k5 * U[5])


@inlined
def plus_products(A: Inertia, s: Six, a: Six, c: float, d: float) -> Inertia:
    """Return A + c (s a^T + a s^T) + d s s^T."""
    # Half of the last product in each of the first two.
    t0, t1, t2 = c * a[0] + 0.5 * d * s[0], c * a[1] + 0.5 * d * s[1], c * a[2] + 0.5 * d * s[2]
    t3, t4, t5 = c * a[3] + 0.5 * d * s[3], c * a[4] + 0.5 * d * s[4], c * a[5] + 0.5 * d * s[5]
    return (A[0] + 2.0 * t0 * s[0], A[1] + t0 * s[1] + s[0] * t1, A[2] + t0 * s[2] + s[0] * t2,
            A[3] + 2.0 * t1 * s[1], A[4] + t1 * s[2] + s[1] * t2, A[5] + 2.0 * t2 * s[2],
            A[6] + t0 * s[3] + s[0] * t3, A[7] + t0 * s[4] + s[0] * t4,
            A[8] + t0 * s[5] + s[0] * t5, A[9] + t1 * s[3] + s[1] * t3,
            A[10] + t1 * s[4] + s[1] * t4, A[11] + t1 * s[5] + s[1] * t5,
            A[12] + t2 * s[3] + s[2] * t3, A[13] + t2 * s[4] + s[2] * t4,
            A[14] + t2 * s[5] + s[2] * t5,
            A[15] + 2.0 * t3 * s[3], A[16] + t3 * s[4] + s[3] * t4, A[17] + t3 * s[5] + s[3] * t5,
            A[18] + 2.0 * t4 * s[4], A[19] + t4 * s[5] + s[4] * t5, A[20] + 2.0 * t5 * s[5])


@inlined
def about_other_point(A: Inertia, r: Vector) -> Inertia:
    """
    Return X^T A X: the inertia A about the point p, as it is about the point p - r.

    With v(p) = v(p - r) + w x r = v - [r] w the blocks become M, B + M T and J + B^T T + T^T (B +
    M T), T = -[r] (Featherstone, section 2.8).
    """
    x, y, z = r
    m00, m01, m02, m11, m12, m22 = A[0], A[1], A[2], A[3], A[4], A[5]
    b00, b01, b02, b10, b11, b12 = A[6], A[7], A[8], A[9], A[10], A[11]
    b20, b21, b22 = A[12], A[13], A[14]
    e00, e01, e02 = b00 - m01 * z + m02 * y, b01 + m00 * z - m02 * x, b02 - m00 * y + m01 * x
    e10, e11, e12 = b10 - m11 * z + m12 * y, b11 + m01 * z - m12 * x, b12 - m01 * y + m11 * x
    e20, e21, e22 = b20 - m12 * z + m22 * y, b21 + m02 * z - m22 * x, b22 - m02 * y + m12 * x
    return (m00, m01, m02, m11, m12, m22, e00, e01, e02, e10, e11, e12, e20, e21, e22,
            A[15] - z * e10 + y * e20 - b10 * z + b20 * y,
            A[16] - z * e11 + y * e21 + b00 * z - b20 * x,
            A[17] - z * e12 + y * e22 - b00 * y + b10 * x,
            A[18] + z * e01 - x * e21 + b01 * z - b21 * x,
            A[19] + z * e02 - x * e22 - b01 * y + b11 * x,
            A[20] - y * e02 + x * e12 - b02 * y + b12 * x)


@inlined
def six(a: Array, i: int) -> Six:
    """Return row i of an array of shape (n, 6)."""
    return (a[i, 0], a[i, 1], a[i, 2], a[i, 3], a[i, 4], a[i, 5])


@inlined
def set_six(a: Array, i: int, V: Six) -> None:
    """Write V to row i of an array of shape (n, 6)."""
    a[i, 0], a[i, 1], a[i, 2], a[i, 3], a[i, 4], a[i, 5] = V[0], V[1], V[2], V[3], V[4], V[5]


@inlined
def add_six(a: Array, i: int, V: Six) -> None:
    """Add V to row i of an array of shape (n, 6)."""
    a[i, 0] += V[0]
    a[i, 1] += V[1]
    a[i, 2] += V[2]
    a[i, 3] += V[3]
    a[i, 4] += V[4]
    a[i, 5] += V[5]


@inlined
def minus(V: Six, s: float, U: Six) -> Six:
    """Return V - s U."""
    return (V[0] - s * U[0], V[1] - s * U[1], V[2] - s * U[2],
            V[3] - s * U[3], V[4] - s * U[4], V[5] - s * U[5])


@inlined
def product(U: Six, V: Six) -> float:
    """Return U . V, of a force and a motion vector: a power."""
    return U[0] * V[0] + U[1] * V[1] + U[2] * V[2] + U[3] * V[3] + U[4] * V[4] + U[5] * V[5]


@inlined
def motion_at(V: Six, r: Vector) -> Six:
    """Return the motion vector V of a point as it is at the point that is farther by r [m]."""
    return (V[0] + V[4] * r[2] - V[5] * r[1], V[1] + V[5] * r[0] - V[3] * r[2],
            V[2] + V[3] * r[1] - V[4] * r[0], V[3], V[4], V[5])


@inlined
def force_about(F: Six, r: Vector) -> Six:
    """Return the force vector F about the point p, as it is about the point p - r: n + r x f."""
    return (F[0], F[1], F[2], F[3] + r[1] * F[2] - r[2] * F[1],
            F[4] + r[2] * F[0] - r[0] * F[2], F[5] + r[0] * F[1] - r[1] * F[0])
