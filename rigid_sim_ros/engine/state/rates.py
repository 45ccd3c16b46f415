# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What follows from momenta and attitude: velocities and rates of change.

Meyer, Rigid Body Dynamics: "Angular Momentum", "Inertia Tensor", "Orientation".
"""

import math

from rigid_sim_ros.engine.maths.rotation import multiply, rotate, rotate_back
from rigid_sim_ros.engine.maths.vector import add, cross, dot, norm, subtract, times
from rigid_sim_ros.kernels.arrays import Quaternion, Vector
from rigid_sim_ros.kernels.kernel import inlined, kernel

# Moments of inertia that differ by more are those of something thin. Smaller: what is not thin
# takes longer, for a bound that is no less.
THIN = 4.0


@inlined
def angular_velocity(q_WC: Quaternion, L: Vector, inv_I: Vector) -> Vector:
    """
    Return w = R I^-1 R^T L [rad/s, world axes].

    L is the angular momentum about the centre of mass [kg m^2/s, world axes], inv_I the
    reciprocals of the principal moments [1/(kg m^2)] (Meyer, Rigid Body Dynamics, "Angular
    Momentum", "Inertia Tensor").
    """
    return rotate(q_WC, times(inv_I, rotate_back(q_WC, L)))


@inlined
def angular_momentum(q_WC: Quaternion, w: Vector, moments: Vector) -> Vector:
    """Return L = R I R^T w [kg m^2/s, world axes], the inverse of `angular_velocity`."""
    return rotate(q_WC, times(moments, rotate_back(q_WC, w)))


# The same as a real call, for code that branches; see algebra.py.
spin_of = kernel(angular_velocity.py_func)  # type: ignore[attr-defined]


@kernel
def fastest_turning(q_WC: Quaternion, L: Vector, inv_I: Vector, radius: float,
                    mobility: float) -> float:
    """
    Return a bound of |w x r| [m/s] of the points of a body, for as long as no torque acts.

    `radius` [m] is how far they are from the centre of mass, `mobility` that of `Shapes` [1/kg].
    |w| is at most |L| over the least moment; of a needle it is a thousandth of that, as long as it
    does not turn about its axis, where its points are a thousandth as far away. What counts is the
    energy of rotation, which stays.
    """
    most, least = max(inv_I[0], inv_I[1], inv_I[2]), min(inv_I[0], inv_I[1], inv_I[2])
    speed = most * norm(L) * radius
    if most > THIN * least:
        L_C = rotate_back(q_WC, L)
        speed = min(speed, math.sqrt(dot(L_C, times(inv_I, L_C)) * mobility))
    return speed


@inlined
def velocity_at(v: Vector, w: Vector, r: Vector) -> Vector:
    """Return v + w x r [m/s]: the velocity of a point r [m] from the centre of mass."""
    return add(v, cross(w, r))


@inlined
def relative_velocity(v_A: Vector, w_A: Vector, r_A: Vector, v_B: Vector, w_B: Vector,
                      r_B: Vector) -> Vector:
    """
    Return the velocity of B relative to A at a point [m/s], v_B + w_B x r_B - v_A - w_A x r_A.

    r_A and r_B [m] are where the point is from the centres of mass of A and B.
    """
    return subtract(add(subtract(v_B, v_A), cross(w_B, r_B)), cross(w_A, r_A))


@inlined
def quaternion_rate(q: Quaternion, w: Vector) -> Quaternion:
    """Return dq/dt = (w, 0) q / 2 [1/s] for the angular velocity w [rad/s, world axes]."""
    dq = multiply((w[0], w[1], w[2], 0.0), q)
    return (0.5 * dq[0], 0.5 * dq[1], 0.5 * dq[2], 0.5 * dq[3])


@inlined
def axis_rate(axis: Vector, w: Vector) -> Vector:
    """Return w x a [1/s], a column of dR/dt = w* R for a column a of R."""
    return cross(w, axis)
