# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The wrenches through joints, as a force and torque sensor in them would measure.

What the joints have done in half a step is the change of the momenta of their bodies in it. The
impulse through a joint of a tree is that of all bodies beyond it together, without what came to
these through joints that close loops.
"""

from rigid_sim_ros.engine.joints.buffers import JointMotion, JointWork
from rigid_sim_ros.engine.joints.loops import impulse_of
from rigid_sim_ros.engine.maths.rotation import multiply, quaternion, rotate_back
from rigid_sim_ros.engine.maths.spatial import (
    add_six, force_about, minus, set_six, Six, six)
from rigid_sim_ros.engine.maths.vector import column, cross, row, subtract
from rigid_sim_ros.engine.model.joints import JointTable, MIMIC, NONE
from rigid_sim_ros.engine.model.model import WORLD
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Quaternion
from rigid_sim_ros.kernels.kernel import inlined, kernel

_ZERO = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def note_momenta(table: JointTable, state: State, work: JointWork) -> None:
    """Write the momenta before the joints act, about the centres of mass."""
    for i in range(table.body.shape[0]):
        P, L = column(state.P, table.body[i]), column(state.L, table.body[i])
        set_six(work.before, i, (P[0], P[1], P[2], L[0], L[1], L[2]))


@kernel
def add_wrenches_of_joints(table: JointTable, state: State, motion: JointMotion, work: JointWork,
                           h: float, first: bool) -> None:
    """
    Add what the joints have done since `note_momenta`, over h [s], to their mean wrenches.

    first: in the first half of a step, whose poses are those that were noted at its start.
    """
    for i in range(table.body.shape[0]):
        P, L, b = column(state.P, table.body[i]), column(state.L, table.body[i]), six(
            work.before, i)
        d = (P[0] - b[0], P[1] - b[1], P[2] - b[2])
        n = cross(row(work.com, i), d)
        set_six(work.F, i, (d[0], d[1], d[2], L[0] - b[3] + n[0], L[1] - b[4] + n[1],
                            L[2] - b[5] + n[2]))
    for m in range(table.condition_joint.shape[0]):
        if table.condition_place[m] != MIMIC:
            _take_loop(table, state, motion, work, m, h, first)
    for back in range(table.body.shape[0]):
        i = table.body.shape[0] - 1 - back
        if table.parent[i] != NONE:
            add_six(work.F, table.parent[i], force_about(six(work.F, i), row(work.arm, i)))
        j = table.joint[i]
        if j != NONE:
            _add(table, state, motion, work, j, minus(_ZERO, -table.sense[i] / h, six(work.F, i)),
                 first)


@kernel
def _take_loop(table: JointTable, state: State, motion: JointMotion, work: JointWork, m: int,
               h: float, first: bool) -> None:
    """Take from the bodies what condition m has done to them; it is its joint's own."""
    j = table.condition_joint[m]
    F = impulse_of(work, m)
    for side in range(2):
        body = table.body_a[j] if side == 0 else table.body_b[j]
        if body != WORLD and table.row_of_body[body] != NONE:
            i = table.row_of_body[body]
            p = row(work.loop.held_a, m) if side == 0 else row(work.loop.held_b, m)
            its = force_about(F, subtract(p, row(work.p, i)))
            add_six(work.F, i, minus(_ZERO, -1.0 if side == 0 else 1.0, its))
    _add(table, state, motion, work, j, minus(_ZERO, -1.0 / h, F), first)


@inlined
def _add(table: JointTable, state: State, motion: JointMotion, work: JointWork, j: int, F: Six,
         first: bool) -> None:
    """Add a wrench on the child, in world axes, to that of joint j."""
    q = _child_frame(table, state, work, j, first)
    f, n = rotate_back(q, (F[0], F[1], F[2])), rotate_back(q, (F[3], F[4], F[5]))
    add_six(motion.wrench, j, (f[0], f[1], f[2], n[0], n[1], n[2]))


@kernel
def _child_frame(table: JointTable, state: State, work: JointWork, j: int,
                 first: bool) -> Quaternion:
    """Return q_WK of the child of joint j, at the start of the step or now."""
    q_BK = (table.q_B[j, 0], table.q_B[j, 1], table.q_B[j, 2], table.q_B[j, 3])
    body = table.body_b[j]
    if body == WORLD:
        return q_BK
    q = quaternion(state.q, body)
    i = table.row_of_body[body]
    if first and i != NONE:
        q = (work.q[i, 0], work.q[i, 1], work.q[i, 2], work.q[i, 3])
    return multiply(q, q_BK)
