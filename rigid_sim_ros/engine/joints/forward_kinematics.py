# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Poses and motions of bodies from the coordinates of the joints that hold them, and back."""

from rigid_sim_ros.engine.joints.articulated import along, axis_part, write_momenta
from rigid_sim_ros.engine.joints.buffers import JointMotion, JointWork
from rigid_sim_ros.engine.joints.joint_coordinates import (
    has_one_coordinate, joint_position, joint_side)
from rigid_sim_ros.engine.maths.rotation import (
    conjugate, exponential, multiply, rotate, rotate_back, set_quaternion, unit)
from rigid_sim_ros.engine.maths.spatial import minus, motion_at, set_six, Six, six
from rigid_sim_ros.engine.maths.vector import add, cross, row, set_column, subtract
from rigid_sim_ros.engine.model.joints import (
    FIXED, JointTable, NONE, PLANAR, PRISMATIC, REVOLUTE, UNIVERSAL)
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import body_spin, body_velocity, State
from rigid_sim_ros.kernels.arrays import Array, Quaternion, Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def pose_forest(table: JointTable, state: State, position: Array, work: JointWork) -> None:
    """
    Put the bodies where the coordinates of their joints say, (j,) [rad or m].

    Bodies that hang on nothing stay. A joint with several axes keeps its angles; what a joint
    forbids is taken away.
    """
    for i in range(table.body.shape[0]):
        if table.joint[i] != NONE:
            _note_relative_pose(table, state, position, work, i)
    for i in range(table.body.shape[0]):
        if table.joint[i] != NONE:
            _hang(table, state, work, i)


@kernel
def _note_relative_pose(table: JointTable, state: State, position: Array, work: JointWork,
                        i: int) -> None:
    """Write the wanted pose of K of the child in K of the parent, of the joint of row i."""
    j = table.joint[i]
    kind = table.kind[j]
    p, q = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    if kind == REVOLUTE:
        q = exponential((0.0, 0.0, position[j]))
    elif kind == PRISMATIC:
        p = (0.0, 0.0, position[j])
    elif kind != FIXED:
        p_A, q_A = joint_side(state, table.body_a[j], table.p_A, table.q_A, j)
        p_B, q_B = joint_side(state, table.body_b[j], table.p_B, table.q_B, j)
        q = multiply(conjugate(q_A), q_B)
        if kind == PLANAR:
            d = rotate_back(q_A, subtract(p_B, p_A))
            p = (d[0], d[1], 0.0)
            q = unit((0.0, 0.0, q[2], q[3]))
        elif kind == UNIVERSAL:
            # About z and then about x: the product has these components.
            half = unit((q[0], 0.0, 0.0, q[3]))
            other = unit((0.0, 0.0, q[2], q[3]))
            q = multiply(other, half)
    for k in range(3):
        work.x[i, k] = p[k]
    for k in range(4):
        work.q[i, k] = q[k]


@kernel
def _hang(table: JointTable, state: State, work: JointWork, i: int) -> None:
    """Put the body of row i where its joint wants it, given what the row hangs on."""
    j = table.joint[i]
    p, q = row(work.x, i), (work.q[i, 0], work.q[i, 1], work.q[i, 2], work.q[i, 3])
    if table.sense[i] > 0.0:
        p_WK, q_WK = joint_side(state, table.body_a[j], table.p_A, table.q_A, j)
        _place(state, table.body[i], add(p_WK, rotate(q_WK, p)), multiply(q_WK, q),
               table.p_B, table.q_B, j)
    else:
        p_WK, q_WK = joint_side(state, table.body_b[j], table.p_B, table.q_B, j)
        q_WK = multiply(q_WK, conjugate(q))
        _place(state, table.body[i], subtract(p_WK, rotate(q_WK, p)), q_WK,
               table.p_A, table.q_A, j)


@kernel
def _place(state: State, body: int, p_WK: Vector, q_WK: Quaternion, p: Array, q: Array,
           j: int) -> None:
    """Put a body so that its frame K of joint j is there."""
    q_WC = unit(multiply(q_WK, (-q[j, 0], -q[j, 1], -q[j, 2], q[j, 3])))
    set_quaternion(state.q, body, q_WC)
    set_column(state.x, body, subtract(p_WK, rotate(q_WC, row(p, j))))


@kernel
def _motion_of(model: Model, table: JointTable, state: State, work: JointWork, i: int) -> Six:
    """Return the motion of the body of row i at its reference point."""
    w = body_spin(model, state, table.body[i])
    v = subtract(body_velocity(model, state, table.body[i]), cross(w, row(work.com, i)))
    return (v[0], v[1], v[2], w[0], w[1], w[2])


@kernel
def _motion_below(table: JointTable, work: JointWork, i: int) -> Six:
    """Return the motion of what row i hangs on, at its reference point."""
    if table.parent[i] == NONE:
        return six(work.base, i)
    return motion_at(six(work.V, table.parent[i]), row(work.arm, i))


@kernel
def read_rates(model: Model, table: JointTable, state: State, work: JointWork,
               rate: Array) -> None:
    """Write the velocities along the axes, (k,); `place_joints` has been called."""
    for i in range(table.body.shape[0]):
        V = _motion_of(model, table, state, work, i)
        set_six(work.V, i, V)
        relative = minus(V, 1.0, _motion_below(table, work, i))
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            rate[k] = axis_part(table, work, k, relative)


@kernel
def move_forest(model: Model, table: JointTable, state: State, work: JointWork,
                rate: Array) -> None:
    """Give the bodies the motions with these velocities along the axes, (k,)."""
    for i in range(table.body.shape[0]):
        V = _motion_below(table, work, i)
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            V = minus(V, -rate[k], along(table, work, k))
        set_six(work.V, i, V)
    write_momenta(model, table, state, work)


@kernel
def read_positions(table: JointTable, state: State, motion: JointMotion) -> None:
    """Write the coordinates of the joints; whole turns are those nearest to what was there."""
    for j in range(table.kind.shape[0]):
        if has_one_coordinate(table.kind[j]):
            motion.position[j] = joint_position(table, state, j, motion.position[j])
