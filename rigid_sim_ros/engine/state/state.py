# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What changes while a world moves.

The state is that of the course: S = (x, R, P, L) (Parent, Rigid Body Dynamics, "Update State
Vector"), with R as a unit quaternion. Momenta are the state, velocities follow: v = P / M, w =
I^-1 L. What nothing pushes has no momentum that could follow it: its twist V is prescribed. So v =
P / M + V_v and w = I^-1 L + V_w hold for every body, with 1 / M = 0 or V = 0.
"""

from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.maths.rotation import multiply, quaternion, rotate
from rigid_sim_ros.engine.maths.vector import (
    add, column, cross, row, scale, set_column, subtract)
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.rates import angular_momentum, angular_velocity, velocity_at
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import apart, in_python, INDEX, inlined, kernel


class State(NamedTuple):
    """Motion of n bodies, as a struct of arrays: column i belongs to body i."""

    x: Array  # centres of mass, (3, n) [m], world axes
    q: Array  # q_WC, central principal axes to world axes, (4, n) x, y, z, w
    P: Array  # linear momenta, (3, n) [kg m/s], world axes
    L: Array  # angular momenta about the centres of mass, (3, n) [kg m^2/s], world axes
    # twists of the frames C of fixed and kinematic bodies in this step, (6, n) v and w [m/s,
    # rad/s], world axes; 0 for all others
    V: Array
    twist_steps_left: IntArray  # (n,) steps for which V still holds, see kinematic.py


MOVING_FIELDS = ('x', 'q', 'P', 'L')     # of what can be pushed, the rest is of what cannot


class BodyMotion(NamedTuple):
    """Motion of the n body frames B, as users see it: row i belongs to body i."""

    position: Array  # p_WB, (n, 3) [m], world axes
    orientation: Array  # q_WB, (n, 4) x, y, z, w
    linear: Array  # velocity of the origin of B, (n, 3) [m/s], world axes
    angular: Array  # (n, 3) [rad/s], world axes


class MotionArguments(NamedTuple):
    """What the kernels that read the motion of all bodies are given."""

    model: Model
    state: State
    motion: BodyMotion


def empty_state(n: int) -> State:
    """Return a state of n bodies at rest at the origin."""
    q = np.zeros((4, n))
    q[3] = 1.0
    return State(np.zeros((3, n)), q, np.zeros((3, n)), np.zeros((3, n)), np.zeros((6, n)),
                 np.zeros(n, dtype=np.int64))


def copy_state(state: State) -> State:
    """Return an independent copy."""
    return State(state.x.copy(), state.q.copy(), state.P.copy(), state.L.copy(), state.V.copy(),
                 state.twist_steps_left.copy())


@kernel
def copy_into(target: State, source: State) -> None:
    """Make one state equal to another."""
    for i in range(source.x.shape[1]):
        copy_body(target, source, i)


@kernel
def copy_body(target: State, source: State, i: int) -> None:
    """Make body i of one state equal to that of another."""
    for k in range(3):
        target.x[k, i] = source.x[k, i]
        target.P[k, i] = source.P[k, i]
        target.L[k, i] = source.L[k, i]
    for k in range(4):
        target.q[k, i] = source.q[k, i]
    for k in range(6):
        target.V[k, i] = source.V[k, i]
    target.twist_steps_left[i] = source.twist_steps_left[i]


@apart
def _unfinite(rows: Array) -> int:
    """Count the numbers that are not finite; as integers add up in any order, by vectors."""
    count = 0
    for k in range(rows.shape[0]):
        for i in range(rows.shape[1]):
            number = rows[k, i & INDEX]
            count += 0 if number - number == 0.0 else 1
    return count


@kernel
def first_unfinite(c: MotionArguments) -> int:
    """Return the first body whose motion is not finite, -1 if all are."""
    state = c.state
    if _unfinite(state.x) + _unfinite(state.q) + _unfinite(state.P) + _unfinite(state.L) == 0:
        return -1
    for i in range(state.x.shape[1]):
        total = 0.0
        for k in range(3):
            # 0 * infinity and 0 * nan are nan; finite numbers leave the sum at 0.
            total += 0.0 * state.x[k, i] + 0.0 * state.P[k, i] + 0.0 * state.L[k, i]
        for k in range(4):
            total += 0.0 * state.q[k, i]
        if total != 0.0:
            return i
    return -1


def empty_motion(n: int) -> BodyMotion:
    """Return room for the motion of n body frames."""
    return BodyMotion(np.zeros((n, 3)), np.zeros((n, 4)), np.zeros((n, 3)), np.zeros((n, 3)))


@inlined
def body_velocity(model: Model, state: State, i: int) -> tuple[float, float, float]:
    """Return v = P / M + V_v [m/s] of the centre of mass of body i, world axes."""
    return add((state.V[0, i], state.V[1, i], state.V[2, i]),
               scale(model.inv_m[i], column(state.P, i)))


@inlined
def body_spin(model: Model, state: State, i: int) -> tuple[float, float, float]:
    """Return w = R I^-1 R^T L + V_w [rad/s] of body i, world axes."""
    return add((state.V[3, i], state.V[4, i], state.V[5, i]), angular_velocity(
        quaternion(state.q, i), column(state.L, i), column(model.inv_I_C, i)))


@kernel
def read_motion(c: MotionArguments) -> None:
    """
    Write the motion of the body frames.

    p_WB = x + R p_CB, q_WB = q_WC q_CB, v_B = v + w x (p_WB - x).
    """
    model, state, motion = c.model, c.state, c.motion
    for i in range(model.m.shape[0]):
        q = quaternion(state.q, i)
        r = rotate(q, row(model.p_CB, i))
        w = body_spin(model, state, i)
        p = add(column(state.x, i), r)
        v = velocity_at(body_velocity(model, state, i), w, r)
        q_CB = (model.q_CB[i, 0], model.q_CB[i, 1], model.q_CB[i, 2], model.q_CB[i, 3])
        q_WB = multiply(q, q_CB)
        for k in range(3):
            motion.position[i, k] = p[k]
            motion.linear[i, k] = v[k]
            motion.angular[i, k] = w[k]
        for k in range(4):
            motion.orientation[i, k] = q_WB[k]


@in_python
def _of_motion(model: Model, motion: BodyMotion, i: Any) -> tuple[Any, ...]:
    """Return q, x, v, w, P and L of body i, or as columns of the bodies that a slice i names."""
    q_WB = (motion.orientation[i, 0], motion.orientation[i, 1], motion.orientation[i, 2],
            motion.orientation[i, 3])
    q_BC = (-model.q_CB[i, 0], -model.q_CB[i, 1], -model.q_CB[i, 2], model.q_CB[i, 3])
    q = multiply(q_WB, q_BC)
    r = rotate(q, row(model.p_CB, i))
    w = row(motion.angular, i)
    v = subtract(row(motion.linear, i), cross(w, r))
    return (q, subtract(row(motion.position, i), r), v, w, scale(model.m[i], v),
            angular_momentum(q, w, column(model.I_C, i)))


def write_motion(model: Model, state: State, motion: BodyMotion, i: int) -> None:
    """Set the state of body i from its row of body-frame motion: undo `read_motion`."""
    q, x, v, w, P, L = _of_motion(model, motion, i)
    state.q[:, i], state.x[:, i] = q, x
    if model.inv_m[i] > 0.0:
        state.P[:, i], state.L[:, i] = P, L
    else:
        state.V[:, i] = (*v, *w)


def write_motions(model: Model, state: State, motion: BodyMotion) -> None:
    """Set the state of all bodies, a hundred times as fast as one by one."""
    q, x, v, w, P, L = map(np.array, _of_motion(model, motion, slice(None)))
    pushed = model.inv_m > 0.0
    state.q[...], state.x[...] = q, x
    state.P[:, pushed], state.L[:, pushed] = P[:, pushed], L[:, pushed]
    state.V[:, ~pushed] = np.concatenate([v, w])[:, ~pushed]


@kernel
def kinetic_energy(model: Model, state: State) -> float:
    """Return sum P^2 / (2 M) + w . L / 2 [J]."""
    energy = 0.0
    for i in range(model.m.shape[0]):
        w = body_spin(model, state, i)
        for k in range(3):
            energy += 0.5 * (model.inv_m[i] * state.P[k, i] * state.P[k, i] + w[k] * state.L[k, i])
    return energy


@kernel
def total_angular_momentum(state: State) -> tuple[float, float, float]:
    """Return sum x x P + L [kg m^2/s] about the world origin, world axes."""
    total = (0.0, 0.0, 0.0)
    for i in range(state.x.shape[1]):
        total = add(total, add(column(state.L, i), cross(column(state.x, i), column(state.P, i))))
    return total


@kernel
def add_impulse(model: Model, state: State, i: int, p_W: tuple[float, float, float],
                J_W: tuple[float, float, float]) -> None:
    """Let an impulse J_W [N s] act on body i at the point p_W [m], both in world axes."""
    add_impulse_with_lever(model.inv_m, state, i, subtract(p_W, column(state.x, i)), J_W)


@kernel
def add_impulse_with_lever(inv_m: Array, state: State, i: int,
                           r_W: tuple[float, float, float],
                           J_W: tuple[float, float, float]) -> None:
    """
    Change P by J [N s] and L by r x J (Meyer, "Impulse") where something can push the body.

    r_W [m] from its centre of mass to where the impulse acts, world axes like J_W.
    """
    if inv_m[i] > 0.0:
        set_column(state.P, i, add(column(state.P, i), J_W))
        set_column(state.L, i, add(column(state.L, i), cross(r_W, J_W)))
