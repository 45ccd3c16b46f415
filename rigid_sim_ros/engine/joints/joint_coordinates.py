# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where joints are, how far from what they should hold, and what their coordinates are.

The way back, from coordinates to poses: forward_kinematics.py.
"""

import math

from rigid_sim_ros.engine.joints.buffers import JointWork
from rigid_sim_ros.engine.maths.rotation import (
    conjugate, logarithm, multiply, quaternion, rotate, rotate_back)
from rigid_sim_ros.engine.maths.spatial import Six
from rigid_sim_ros.engine.maths.vector import add, column, cross, dot, row, scale, subtract
from rigid_sim_ros.engine.model.joints import (
    DISTANCE, FIXED, JointTable, NONE, PLANAR, PRISMATIC, REVOLUTE, UNIVERSAL)
from rigid_sim_ros.engine.model.model import Model, WORLD
from rigid_sim_ros.engine.state.state import body_spin, body_velocity, State
from rigid_sim_ros.engine.state.world_inertia import write_world_inertia
from rigid_sim_ros.kernels.arrays import Array, Quaternion, Vector
from rigid_sim_ros.kernels.kernel import inlined, kernel


@inlined
def _frame(a: Array, i: int) -> Quaternion:
    return (a[i, 0], a[i, 1], a[i, 2], a[i, 3])


@inlined
def joint_side(state: State, body: int, p: Array, q: Array, j: int) -> tuple[Vector, Quaternion]:
    """Return p_WK [m] and q_WK of the frame of joint j that is fixed in a body or in the world."""
    if body == WORLD:
        return row(p, j), _frame(q, j)
    q_WC = quaternion(state.q, body)
    return (add(column(state.x, body), rotate(q_WC, row(p, j))), multiply(q_WC, _frame(q, j)))


@inlined
def axis_z(q: Quaternion) -> Vector:
    """Return the z axis of a frame, the third column of R(q)."""
    return (2.0 * (q[0] * q[2] + q[3] * q[1]), 2.0 * (q[1] * q[2] - q[3] * q[0]),
            1.0 - 2.0 * (q[0] * q[0] + q[1] * q[1]))


@inlined
def axis_x(q: Quaternion) -> Vector:
    """Return the x axis of a frame, the first column of R(q)."""
    return (1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]), 2.0 * (q[0] * q[1] + q[3] * q[2]),
            2.0 * (q[0] * q[2] - q[3] * q[1]))


@kernel
def place_joints(model: Model, table: JointTable, state: State, work: JointWork) -> None:
    """Write reference points, arms, axes and inertias of all rows at the present poses."""
    for i in range(table.body.shape[0]):
        body, j, parent = table.body[i], table.joint[i], table.parent[i]
        x, q = column(state.x, body), quaternion(state.q, body)
        p = x
        if j != NONE:
            b = table.body_b[j]
            if b == WORLD:
                p = row(table.p_B, j)
            else:
                p = add(column(state.x, b), rotate(quaternion(state.q, b), row(table.p_B, j)))
        com = subtract(x, p)
        for k in range(3):
            work.p[i, k], work.com[i, k] = p[k], com[k]
        if parent != NONE:
            for k in range(3):
                work.arm[i, k] = p[k] - work.p[parent, k]
        elif table.base[i] != WORLD:
            place_base(model, table, state, work, i)
        write_world_inertia(q, column(model.I_C, body), work.I_W[i], 0)
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            s = row(table.axis, k)
            if table.axis_body[k] != WORLD:
                s = rotate(quaternion(state.q, table.axis_body[k]), s)
            for n in range(3):
                work.s[k, n] = table.sense[i] * s[n]


@inlined
def place_base(model: Model, table: JointTable, state: State, work: JointWork, i: int) -> None:
    """Write how the kinematic body moves on which row i hangs, at its reference point."""
    base = table.base[i]
    r = subtract(row(work.p, i), column(state.x, base))
    w = body_spin(model, state, base)
    v = add(body_velocity(model, state, base), cross(w, r))
    for k in range(3):
        work.base[i, k], work.base[i, 3 + k] = v[k], w[k]


@kernel
def joint_error(table: JointTable, state: State, j: int) -> Six:
    """
    Return how B is off from where joint j allows it to be, as small motion at K, world axes.

    Translation [m] and rotation [rad] of B against A, without what the joint leaves free.
    """
    kind = table.kind[j]
    p_A, q_A = joint_side(state, table.body_a[j], table.p_A, table.q_A, j)
    p_B, q_B = joint_side(state, table.body_b[j], table.p_B, table.q_B, j)
    d = subtract(p_B, p_A)
    turn = (0.0, 0.0, 0.0)
    if kind in (PRISMATIC, PLANAR):
        # By the axes as they are now: a long way along an axis of some time before is off by far.
        z = axis_z(q_A)
        way = scale(dot(d, z), z)
        d = subtract(d, way) if kind == PRISMATIC else way
    if kind in (REVOLUTE, PLANAR):
        turn = cross(axis_z(q_A), axis_z(q_B))
    elif kind in (FIXED, PRISMATIC):
        q = multiply(conjugate(q_A), q_B)
        s = 2.0 if q[3] >= 0.0 else -2.0
        turn = rotate(q_A, (s * q[0], s * q[1], s * q[2]))
    elif kind == UNIVERSAL:
        a, b = axis_z(q_A), axis_x(q_B)
        n = cross(b, a)
        # d(a . b) = t . (b x a) for a small turn t of B.
        turn = scale(dot(a, b) / dot(n, n), n)
    return (d[0], d[1], d[2], turn[0], turn[1], turn[2])


@kernel
def joint_distance(table: JointTable, state: State, j: int) -> tuple[float, Vector]:
    """Return the distance of the two ends of joint j [m], and the unit vector from A to B."""
    p_A, _ = joint_side(state, table.body_a[j], table.p_A, table.q_A, j)
    p_B, _ = joint_side(state, table.body_b[j], table.p_B, table.q_B, j)
    d = subtract(p_B, p_A)
    length = math.sqrt(dot(d, d))
    return length, scale(1.0 / length, d)


@kernel
def joint_coordinates(table: JointTable, state: State, j: int) -> tuple[Vector, Vector]:
    """
    Return the pose of K of B in K of A: the translation [m] and the turn about its axes [rad].

    The turn is a rotation vector; of a universal joint it is the angle about z of A, then the one
    about x of B.
    """
    p_A, q_A = joint_side(state, table.body_a[j], table.p_A, table.q_A, j)
    p_B, q_B = joint_side(state, table.body_b[j], table.p_B, table.q_B, j)
    d = rotate_back(q_A, subtract(p_B, p_A))
    q = multiply(conjugate(q_A), q_B)
    if table.kind[j] == UNIVERSAL:
        return d, (2.0 * math.atan2(q[0], q[3]), 0.0, 2.0 * math.atan2(q[2], q[3]))
    if table.kind[j] in (REVOLUTE, PLANAR):
        return d, (0.0, 0.0, 2.0 * math.atan2(q[2], q[3]))
    return d, logarithm(q)


@kernel
def joint_position(table: JointTable, state: State, j: int, near: float) -> float:
    """
    Return the coordinate of a joint that has one [rad or m], 0 of others.

    An angle is that of all with the same pose that is nearest to `near`.
    """
    kind = table.kind[j]
    if kind == DISTANCE:
        return joint_distance(table, state, j)[0]
    if kind not in (REVOLUTE, PRISMATIC):
        return 0.0
    d, turn = joint_coordinates(table, state, j)
    if kind == PRISMATIC:
        return d[2]
    whole = 2.0 * math.pi
    return turn[2] + whole * math.floor((near - turn[2]) / whole + 0.5)


@kernel
def has_one_coordinate(kind: int) -> bool:
    """Return whether `joint_position` has a meaning for a kind."""
    return kind in (REVOLUTE, PRISMATIC, DISTANCE)
