# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How fast the coordinates of joints change that no axis of the solution has: those of loops."""

from rigid_sim_ros.engine.joints.joint_coordinates import axis_z, joint_side
from rigid_sim_ros.engine.maths.vector import column, dot, subtract
from rigid_sim_ros.engine.model.joints import JointTable, PRISMATIC, REVOLUTE
from rigid_sim_ros.engine.model.model import Model, WORLD
from rigid_sim_ros.engine.state.rates import velocity_at
from rigid_sim_ros.engine.state.state import body_spin, body_velocity, State
from rigid_sim_ros.kernels.arrays import Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def joint_rate(model: Model, table: JointTable, state: State, j: int) -> float:
    """
    Return the rate of the coordinate of joint j [rad/s or m/s], 0 if it keeps it or has none.

    It is how B moves against A, which turns the axis along, about or along that axis.
    """
    kind = table.kind[j]
    if kind not in (REVOLUTE, PRISMATIC):
        return 0.0
    a, b = table.body_a[j], table.body_b[j]
    z = axis_z(joint_side(state, a, table.p_A, table.q_A, j)[1])
    p = joint_side(state, b, table.p_B, table.q_B, j)[0]
    v_A, w_A = _motion_at(model, state, a, p)
    v_B, w_B = _motion_at(model, state, b, p)
    return dot(z, subtract(w_B, w_A) if kind == REVOLUTE else subtract(v_B, v_A))


@kernel
def _motion_at(model: Model, state: State, body: int, p: Vector) -> tuple[Vector, Vector]:
    """Return the velocity [m/s] of a body, or of the world, at p [m], and its spin [rad/s]."""
    if body == WORLD:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    w = body_spin(model, state, body)
    return velocity_at(body_velocity(model, state, body), w,
                       subtract(p, column(state.x, body))), w
