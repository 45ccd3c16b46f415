# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The rotation of a rigid body on which no torque acts.

In the axes of the body the angular momentum l obeys Euler's equation l' = l x w with w = I^-1 l,
and the attitude q' = q w / 2. The logarithm r(t) of the attitude, q(t) = q(0) exp(r / 2), then
obeys

    r' = w + r x w / 2 + r x (r x w) / 12 + O(r^4 w),    r(0) = 0

(Magnus, Comm. Pure Appl. Math. 7 (1954); Iserles, Munthe-Kaas, Norsett, Zanna, Lie-group methods,
Acta Numerica 9 (2000), section 4). Euler's equation gives the derivatives w1, w2, ... of w, and
with c = w0 x w1 the Taylor series of r is

    r = h w0 + h^2 w1 / 2 + h^3 (w2 / 6 + c / 12) + h^4 (w3 + w0 x w2) / 24
      + h^5 (w4 / 120 + w0 x w3 / 80 + w1 x w2 / 120 - w1 x c / 240 + w0 x (w0 x w2 - w0 x c) /
      720) + O(h^6).

A step of this Lie-group method has order five. The momentum is a constant of the motion that is
stored, not computed, so |L| cannot drift; only w0 survives for a sphere or about a principal axis,
so these turn exactly. So does what is fast and has two equal moments, by the formula of a top.
"""

import math

from rigid_sim_ros.engine.maths.rotation import exponential, multiply, rotate_back, unit
from rigid_sim_ros.engine.maths.vector import (
    add, add_scaled, cross, dot, norm, subtract, times)
from rigid_sim_ros.kernels.arrays import Quaternion, Vector
from rigid_sim_ros.kernels.kernel import inlined, kernel

# A call of `turn` is good for at most this angle [rad]; a faster body takes more, shorter calls.
# Here the neglected terms are of the order 0.25^6 / 1000 = 2e-7 rad a call; twice the angle costs
# 64 times the error.
MAX_ANGLE = 0.25
# More than MAX_ANGLE * MAX_SUBSTEPS = 256 rad in one step: the calls become longer, not more
# numerous. What turns by more about its odd axis is taken for a top: where it is none exactly,
# longer calls would end at an attitude that has nothing to do with L, and so with any energy.
MAX_SUBSTEPS = 1024
# [rad] What turns by less has the inertia about the axes of the world that it had before.
SAME_ATTITUDE = 1e-6


@inlined
def rotation_vector(l0: Vector, inv_I: Vector, h: float) -> Vector:
    """
    Return r, the rotation [rad, body axes] of a free body in h [s], to fifth order in h.

    l0 is the angular momentum at the start [kg m^2/s, body axes], inv_I the reciprocals of the
    principal moments [1/(kg m^2)]. The formula is derived at the top of this file.
    """
    w0 = times(inv_I, l0)
    l1 = cross(l0, w0)
    w1 = times(inv_I, l1)
    l2 = add(cross(l1, w0), cross(l0, w1))
    w2 = times(inv_I, l2)
    l3 = add(add_scaled(cross(l2, w0), 2.0, cross(l1, w1)), cross(l0, w2))
    w3 = times(inv_I, l3)
    l4 = add(add_scaled(cross(l3, w0), 3.0, add(cross(l2, w1), cross(l1, w2))), cross(l0, w3))
    w4 = times(inv_I, l4)

    c = cross(w0, w1)
    w02 = cross(w0, w2)
    r3 = add_scaled(w2, 1 / 2, c)
    r4 = add(w3, w02)
    r5 = add_scaled(add(w4, cross(w1, w2)), 3 / 2, cross(w0, w3))
    r5 = add_scaled(r5, -1 / 2, cross(w1, c))
    r5 = add_scaled(r5, 1 / 6, cross(w0, subtract(w02, cross(w0, c))))
    # Horner's scheme for h r1 + h^2/2 r2 + ... + h^5/120 r5.
    r = add_scaled(r4, h / 5.0, r5)
    r = add_scaled(r3, h / 4.0, r)
    r = add_scaled(w1, h / 3.0, r)
    r = add_scaled(w0, h / 2.0, r)
    return (h * r[0], h * r[1], h * r[2])


@inlined
def small_exponential(r: Vector) -> Quaternion:
    """
    Return the rotation by the vector r, |r| <= 2 MAX_ANGLE, without a branch or a call.

    Taylor series of sin(a / 2) / a and cos(a / 2) in u = (a / 2)^2 <= 1/16; the first terms left
    out, u^6 / 13! and u^7 / 14!, are below 1e-17.
    """
    u = 0.25 * (r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    s = 0.5 + u * (-1 / 12 + u * (1 / 240 + u * (-1 / 10080 + u * (
        1 / 725760 + u * (-1 / 79833600)))))
    c = 1.0 + u * (-1 / 2 + u * (1 / 24 + u * (-1 / 720 + u * (
        1 / 40320 + u * (-1 / 3628800 + u * (1 / 479001600))))))
    return (s * r[0], s * r[1], s * r[2], c)


@inlined
def turn(q_WC: Quaternion, L: Vector, inv_I: Vector, h: float) -> Quaternion:
    """Return the attitude of a free body after h [s], |w| h <= MAX_ANGLE; L in world axes."""
    r = rotation_vector(rotate_back(q_WC, L), inv_I, h)
    q = multiply(q_WC, small_exponential(r))
    # |q|^2 is off by rounding only: one Newton step for 1 / |q| from 1 restores it.
    s = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (q[0] * s, q[1] * s, q[2] * s, q[3] * s)


@inlined
def are_alike(inv_I: Vector) -> bool:
    """Return whether a body turns about every axis as easily: its spin is constant."""
    return bool(inv_I[0] == inv_I[1] and inv_I[1] == inv_I[2])


@inlined
def may_turn_by(angle: float, L: Vector, inv_I: Vector, h: float) -> bool:
    """Return whether a body may turn by more than an angle in h [s], wherever L points in it."""
    # |I^-1 l| <= max(I^-1) |L|: never below the angle that it bounds.
    bound = h * max(inv_I[0], max(inv_I[1], inv_I[2]))
    return bound * bound * dot(L, L) > angle * angle


@kernel
def turn_fast(q_WC: Quaternion, L: Vector, inv_I: Vector, h: float) -> Quaternion:
    """Return the attitude of a free body after h [s] at any speed; L in world axes."""
    w_C = times(inv_I, rotate_back(q_WC, L))
    angle, substeps = norm(w_C) * abs(h), MAX_SUBSTEPS
    if angle > MAX_ANGLE:
        axis = _odd_axis(inv_I)
        is_top = inv_I[(axis + 1) % 3] == inv_I[(axis + 2) % 3]
        if is_top or abs(w_C[axis] * h) > MAX_ANGLE * MAX_SUBSTEPS:
            return _turn_top(q_WC, L, inv_I, axis, h)
    if angle < MAX_ANGLE * MAX_SUBSTEPS:
        substeps = max(1, math.ceil(angle / MAX_ANGLE))
    for _ in range(substeps):
        r = rotation_vector(rotate_back(q_WC, L), inv_I, h / substeps)
        q_WC = unit(multiply(q_WC, exponential(r)))
    return q_WC


@kernel
def _odd_axis(inv_I: Vector) -> int:
    """Return the principal axis whose other two have the moments that differ least."""
    a, b, c = abs(inv_I[1] - inv_I[2]), abs(inv_I[2] - inv_I[0]), abs(inv_I[0] - inv_I[1])
    if c <= min(a, b):
        return 2
    return 0 if a <= b else 1


@kernel
def _turn_top(q_WC: Quaternion, L: Vector, inv_I: Vector, axis: int, h: float) -> Quaternion:
    """
    Return the attitude of a free symmetric top after h [s].

    With 1 / I about two axes, w = L / I + s e, e the third axis, fixed in the body, and s
    constant: the body turns by h L / I in the world and by h s e in its own axes. Where the two
    moments differ the mean of 1 / I is taken: the part of L along e stays, and so the energy to
    the difference.
    """
    across = 0.5 * (inv_I[(axis + 1) % 3] + inv_I[(axis + 2) % 3])
    s = h * (inv_I[axis] - across) * rotate_back(q_WC, L)[axis]
    own = (s if axis == 0 else 0.0, s if axis == 1 else 0.0, s if axis == 2 else 0.0)
    ahead = exponential((h * across * L[0], h * across * L[1], h * across * L[2]))
    return unit(multiply(ahead, multiply(q_WC, exponential(own))))
