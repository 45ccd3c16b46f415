# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An articulation that hangs on nothing moves as one, when one of its bodies is put elsewhere."""

from rigid_sim_ros.engine.maths.rotation import (
    conjugate, multiply, quaternion, rotate, set_quaternion, unit)
from rigid_sim_ros.engine.maths.vector import add, column, cross, scale, set_column, subtract
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.rates import angular_momentum
from rigid_sim_ros.engine.state.state import body_spin, body_velocity, State
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def articulation_of(table: JointTable, body: int) -> int:
    """Return the articulation of a body, NONE if no joint holds it."""
    row = table.row_of_body[body]
    if row == NONE:
        return NONE
    g = 0
    while table.first_row[g + 1] <= row:
        g += 1
    return g


@kernel
def hangs_on_something(table: JointTable, g: int) -> bool:
    """Return whether joints hold articulation g to the world, or to what nothing pushes."""
    for i in range(table.first_row[g], table.first_row[g + 1]):
        if table.parent[i] == NONE and table.joint[i] != NONE:
            return True
    for m in range(table.first_condition[g], table.first_condition[g + 1]):
        j = table.condition_joint[m]
        for body in (table.body_a[j], table.body_b[j]):
            if body < 0 or table.row_of_body[body] == NONE:
                return True
    return False


@kernel
def carry_along(model: Model, table: JointTable, state: State, before: State, body: int) -> None:
    """
    Move the others of an articulation with a body that was put elsewhere, or got another twist.

    `before` is the state before that. What turned and shifted the body turns and shifts all, so
    that the joints keep their coordinates; all get the change of its twist as one rigid body has
    it, so that they keep their velocities.
    """
    g = articulation_of(table, body)
    turn = unit(multiply(quaternion(state.q, body), conjugate(quaternion(before.q, body))))
    dw = subtract(body_spin(model, state, body), rotate(turn, body_spin(model, before, body)))
    dv = subtract(body_velocity(model, state, body),
                  rotate(turn, body_velocity(model, before, body)))
    for i in range(table.first_row[g], table.first_row[g + 1]):
        other = table.body[i]
        if other == body:
            continue
        r = rotate(turn, subtract(column(before.x, other), column(before.x, body)))
        v = add(add(rotate(turn, body_velocity(model, before, other)), dv), cross(dw, r))
        w = add(rotate(turn, body_spin(model, before, other)), dw)
        q = unit(multiply(turn, quaternion(before.q, other)))
        set_column(state.x, other, add(column(state.x, body), r))
        set_quaternion(state.q, other, q)
        set_column(state.P, other, scale(model.m[other], v))
        set_column(state.L, other, angular_momentum(q, w, column(model.I_C, other)))
