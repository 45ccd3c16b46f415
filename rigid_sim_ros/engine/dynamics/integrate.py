# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Step the state of all bodies by h, by one of five methods and three ways to turn them.

The equations are d/dt (x, R, P, L) = (v, w* R, F, tau) with v = P / M and w = R I^-1 R^T L (Meyer,
Rigid Body Dynamics, "Rigid Body Equations of Motion"). Measured orders and errors stand in
docs/integrators.md.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.dynamics.force_and_torque import empty_loads, kick, Loads
from rigid_sim_ros.engine.dynamics.forces import add_gravity, add_scene_forces
from rigid_sim_ros.engine.dynamics.free_flight import BLOCK_SIZE, fly
from rigid_sim_ros.engine.dynamics.kinematic import move_kinematic
from rigid_sim_ros.engine.dynamics.wrenches import add_wrenches, Wrenches
from rigid_sim_ros.engine.maths.rotation import (
    exponential, from_matrix, multiply, quaternion, set_quaternion, to_matrix, unit)
from rigid_sim_ros.engine.maths.vector import add_scaled, cross, dot, norm, scale
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.rates import axis_rate, quaternion_rate
from rigid_sim_ros.engine.state.state import body_spin, copy_into, empty_state, State
from rigid_sim_ros.kernels.arrays import Array, Quaternion, Vector
from rigid_sim_ros.kernels.kernel import kernel, part

ORIENTATIONS = ('quaternion', 'matrix', 'axis_angle')
_QUATERNION, _MATRIX, _AXIS_ANGLE = range(3)
# Of a step: a symmetric method of order 2, taken over these parts, is one of order 4, since their
# sum is 1 and that of their third powers 0 (Suzuki, Phys. Lett. A 146 (1990); Hairer, Lubich,
# Wanner, section II.4). Three parts would do (Yoshida 1990), but these go back in time by 1.7
# steps, and their errors are far larger. All stages begin within the step.
_PART = 1.0 / (4.0 - 4.0 ** (1.0 / 3.0))
STAGES = (_PART, _PART, 1.0 - 4.0 * _PART, _PART, _PART)


class Work(NamedTuple):
    """Scratch memory of a step; it carries nothing from one step to the next."""

    loads: Loads  # at the start of the step
    later: Loads  # at its end, or at a stage of rk4
    stage: State  # the state at a stage of rk4
    slope: State  # the weighted sum of the slopes of rk4
    block: Array  # for `fly`


def make_work(n: int) -> Work:
    """Return scratch memory for n bodies."""
    return Work(empty_loads(n), empty_loads(n), empty_state(n), empty_state(n),
                np.zeros(BLOCK_SIZE))


@kernel
def sum_loads(model: Model, state: State, wrenches: Wrenches, loads: Loads) -> None:
    """Write gravity, forces and wrenches to the loads; fixed bodies feel none."""
    begin_loads(model, state, loads)
    add_scene_forces(model, state, loads)
    end_loads(model, state, wrenches, loads)


@part
def begin_loads(model: Model, state: State, loads: Loads) -> None:
    """Write gravity to the loads."""
    loads.F[:] = 0.0
    loads.tau[:] = 0.0
    add_gravity(model, state, loads)


@part
def end_loads(model: Model, state: State, wrenches: Wrenches, loads: Loads) -> None:
    """Add the wrenches; take everything from fixed bodies."""
    add_wrenches(model, state, wrenches, loads)
    for i in model.fixed:
        loads.F[:, i] = 0.0
        loads.tau[:, i] = 0.0


@kernel
def translate(model: Model, state: State, h: float) -> None:
    """Advance the centres of mass under constant momentum: x += h P / M."""
    for k in range(3):
        for i in range(state.x.shape[1]):
            state.x[k, i] += h * (model.inv_m[i] * state.P[k, i])


@kernel
def turn_quaternion(q: Quaternion, w: Vector, h: float) -> Quaternion:
    """Return q + h w q / 2, normalised (Meyer, "Using Quaternions")."""
    dq = quaternion_rate(q, w)
    return unit((q[0] + h * dq[0], q[1] + h * dq[1], q[2] + h * dq[2], q[3] + h * dq[3]))


@kernel
def turn_matrix(q: Quaternion, w: Vector, h: float) -> Quaternion:
    """
    Return R + h w* R, re-orthonormalised (Parent, "Update Orientation - options").

    The columns are the axes of the body; Gram and Schmidt's procedure, the first axis first.
    """
    rows = to_matrix(q)
    a = (rows[0][0], rows[1][0], rows[2][0])
    b = (rows[0][1], rows[1][1], rows[2][1])
    a = add_scaled(a, h, axis_rate(a, w))
    b = add_scaled(b, h, axis_rate(b, w))
    a = scale(1.0 / norm(a), a)
    b = add_scaled(b, -dot(a, b), a)
    b = scale(1.0 / norm(b), b)
    c = cross(a, b)
    return from_matrix(((a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2])))


@kernel
def turn_axis_angle(q: Quaternion, w: Vector, h: float) -> Quaternion:
    """Return R, columns rotated by |w| h about w (Parent, "Update Orientation - options")."""
    return unit(multiply(exponential(scale(h, w)), q))


@kernel
def turn_explicitly(model: Model, state: State, orientation: int, h: float) -> None:
    """Turn every body with the angular velocity that it has now, in the chosen way."""
    for i in range(state.q.shape[1]):
        w = body_spin(model, state, i)
        q = quaternion(state.q, i)
        if model.inv_m[i] == 0.0:
            continue
        if orientation == _QUATERNION:
            q = turn_quaternion(q, w, h)
        elif orientation == _MATRIX:
            q = turn_matrix(q, w, h)
        else:
            q = turn_axis_angle(q, w, h)
        set_quaternion(state.q, i, q)


@kernel
def euler(model: Model, state: State, wrenches: Wrenches, orientation: int, work: Work) -> None:
    """Explicit Euler, order 1: all slopes at the start. Energy grows; here for comparison."""
    sum_loads(model, state, wrenches, work.loads)
    translate(model, state, model.h)
    turn_explicitly(model, state, orientation, model.h)
    move_kinematic(model, state, model.h)
    kick(state, work.loads, model.h)


@kernel
def semi_implicit(model: Model, state: State, wrenches: Wrenches, orientation: int,
                  work: Work) -> None:
    """Semi-implicit Euler, order 1: the momenta first, then the pose with the new momenta."""
    sum_loads(model, state, wrenches, work.loads)
    kick(state, work.loads, model.h)
    translate(model, state, model.h)
    turn_explicitly(model, state, orientation, model.h)
    move_kinematic(model, state, model.h)


@kernel
def kick_drift_kick(model: Model, state: State, loads: Loads, h: float, block: Array) -> None:
    """Advance by h [s] under constant loads; `block` is scratch memory of `fly`."""
    kick(state, loads, 0.5 * h)
    # np.int64(1) and not 1: Numba would compile another copy for the literal.
    fly(model, state, (0.0, 0.0, 0.0), h, np.int64(1), block)
    move_kinematic(model, state, h)
    kick(state, loads, 0.5 * h)


@kernel
def kick_by_change(state: State, loads: Loads, later: Loads, h: float) -> None:
    """Put the loads at the new poses in the place of those before, in the second half of h."""
    kick(state, later, 0.5 * h)
    kick(state, loads, -0.5 * h)


@kernel
def symplectic(model: Model, state: State, wrenches: Wrenches, orientation: int,
               work: Work) -> None:
    """
    Kick, drift, kick (velocity Verlet), order 2; order 5 in the attitude while no torque acts.

    The momenta change by half of h F, the pose drifts under constant momenta, which for the
    attitude is the rotation of a free body, and the momenta change by the other half with the
    loads at the new pose. Symplectic for loads that depend on the pose alone (Hairer, Lubich,
    Wanner, Geometric Numerical Integration, sections I.1.4 and VII.5); exact for constant forces.
    """
    _verlet(model, state, wrenches, work, model.h)


@kernel
def _verlet(model: Model, state: State, wrenches: Wrenches, work: Work, h: float) -> None:
    sum_loads(model, state, wrenches, work.loads)
    kick_drift_kick(model, state, work.loads, h, work.block)
    # The momenta are now what constant loads would have made of them, right to first order: good
    # enough for loads that depend on velocities to keep the whole step at order 2.
    sum_loads(model, state, wrenches, work.later)
    kick_by_change(state, work.loads, work.later, h)


@kernel
def symplectic4(model: Model, state: State, wrenches: Wrenches, orientation: int,
                work: Work) -> None:
    """Five steps of `symplectic`: order 4, with loads that depend on velocities 3."""
    for share in STAGES:
        _verlet(model, state, wrenches, work, share * model.h)


@kernel
def add_slope(model: Model, at: State, loads: Loads, weight: float, sum_of: State) -> None:
    """Add weight * d/dt (x, q, P, L) at a state to a sum; dq/dt = w q / 2."""
    for i in range(at.x.shape[1]):
        w = body_spin(model, at, i)
        dq = quaternion_rate(quaternion(at.q, i), w)
        for k in range(3):
            sum_of.x[k, i] += weight * (model.inv_m[i] * at.P[k, i] + at.V[k, i])
            sum_of.P[k, i] += weight * loads.F[k, i]
            sum_of.L[k, i] += weight * loads.tau[k, i]
        for k in range(4):
            sum_of.q[k, i] += weight * dq[k]


@kernel
def normalise(model: Model, state: State) -> None:
    """Scale the quaternions of what can move to unit length."""
    for i in range(state.q.shape[1]):
        if model.inv_m[i] > 0.0:
            set_quaternion(state.q, i, unit(quaternion(state.q, i)))


@kernel
def rk4(model: Model, state: State, wrenches: Wrenches, orientation: int, work: Work) -> None:
    """
    Run the classical Runge-Kutta method on the whole state, order 4.

    The stages lie at 0, h/2, h/2, h, and their slopes count 1/6, 1/3, 1/3, 1/6. A wrench holds for
    the whole step, in its frame as it turns. Quaternions are normalised at each stage.
    """
    h = model.h
    slope, stage = work.slope, work.stage
    copy_into(slope, state)
    copy_into(stage, state)
    for ahead, weight in ((0.5 * h, h / 6.0), (0.5 * h, h / 3.0), (h, h / 3.0), (0.0, h / 6.0)):
        sum_loads(model, stage, wrenches, work.loads)
        add_slope(model, stage, work.loads, weight, slope)
        if ahead > 0.0:
            advance_stage(model, state, work.loads, ahead, stage)
    # What moves by its twist does so exactly.
    copy_into(stage, state)
    move_kinematic(model, stage, h)
    copy_into(state, slope)
    for i in model.fixed:
        for k in range(3):
            state.x[k, i] = stage.x[k, i]
        for k in range(4):
            state.q[k, i] = stage.q[k, i]
    normalise(model, state)


@kernel
def advance_stage(model: Model, state: State, loads: Loads, ahead: float, stage: State) -> None:
    """Replace the stage by state + ahead * (slope at the stage)."""
    for i in range(state.x.shape[1]):
        w = body_spin(model, stage, i)
        dq = quaternion_rate(quaternion(stage.q, i), w)
        q = (state.q[0, i] + ahead * dq[0], state.q[1, i] + ahead * dq[1],
             state.q[2, i] + ahead * dq[2], state.q[3, i] + ahead * dq[3])
        set_quaternion(stage.q, i, unit(q))
        for k in range(3):
            stage.x[k, i] = state.x[k, i] + ahead * (
                model.inv_m[i] * stage.P[k, i] + stage.V[k, i])
            stage.P[k, i] = state.P[k, i] + ahead * loads.F[k, i]
            stage.L[k, i] = state.L[k, i] + ahead * loads.tau[k, i]
