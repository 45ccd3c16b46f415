# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether two bodies separate, rest or collide at a point where they touch."""

from rigid_sim_ros.engine.contact.contacts import Bodies, Contacts, linear
from rigid_sim_ros.engine.maths.algebra import norm
from rigid_sim_ros.kernels.kernel import kernel

SEPARATING, RESTING, COLLIDING = range(3)
# Of the size of the smaller shape, in a step: an approach slower than this is rounding, not a
# collision; ten times more is still below every tolerance here. 1e-10 m/s for 0.1 m and 1 ms.
STILL = 1e-12


@kernel
def classify(u_n: float, slow: float) -> int:
    """
    Return what a point does whose gap changes with u_n [m/s]: the rule of the sign.

    (Meyer, Rigid Body Dynamics, "Collision Detection", conditions for collision.) A rate of at
    most `slow` [m/s] counts as 0.
    """
    if u_n > slow:
        return SEPARATING
    return COLLIDING if u_n < -slow else RESTING


@kernel
def resting_speed(contacts: Contacts, bodies: Bodies, k: int, h: float) -> float:
    """
    Return the speed [m/s] along the normal below which point k rests.

    A body thrown up with v falls back after 2 v / a, with a the larger free acceleration of the
    two bodies. What falls back within a step h is no bounce: this ends the infinitely many bounces
    in finite time of every ball with e < 1 (Zeno) once they are shorter than a step. Without a
    load there is no such threshold.
    """
    a = contacts.body_a[k]
    b = contacts.body_b[k]
    pull_A = norm(linear(bodies.acceleration, a))
    pull_B = norm(linear(bodies.acceleration, b))
    return 0.5 * h * max(pull_A, pull_B) + STILL * contacts.size[k] / h
