# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where shapes will be within a step, and how far and how fast their points can get until then.

Within a step the loads are constant, so the pose of a body at any time of the step follows from
its state at the start alone.
"""

from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.dynamics.free_rotation import turn_fast
from rigid_sim_ros.engine.dynamics.kinematic import (
    is_carried, pose_ahead, prescribed_spin, prescribed_velocity)
from rigid_sim_ros.engine.maths.algebra import (
    add_scaled, column, norm, quaternion, rotate, row, scale)
from rigid_sim_ros.engine.maths.rotation import multiply, to_matrix
from rigid_sim_ros.engine.model.kinds.table import is_ball
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.rates import fastest_turning
from rigid_sim_ros.engine.state.state import body_velocity, State
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def place_ahead(model: Model, state: State, loads: Loads, shapes: Shapes, s: int, t: float,
                pose: Array) -> None:
    """
    Write row s of the shape poses as it will be after a step of t [s] under constant loads.

    The pose part of kick, drift, kick: x + t (P + t F / 2) / M, and the free rotation with L + t
    tau / 2.
    """
    i = shapes.body[s]
    q = quaternion(state.q, i)
    x = column(state.x, i)
    if model.inv_m[i] > 0.0:
        P, L = column(state.P, i), column(state.L, i)
        F, tau = column(loads.F, i), column(loads.tau, i)
        ahead = t * model.inv_m[i]
        x = (x[0] + ahead * (P[0] + 0.5 * t * F[0]), x[1] + ahead * (P[1] + 0.5 * t * F[1]),
             x[2] + ahead * (P[2] + 0.5 * t * F[2]))
        L = (L[0] + 0.5 * t * tau[0], L[1] + 0.5 * t * tau[1], L[2] + 0.5 * t * tau[2])
        # A ball around the centre of mass is where it is, however it turns.
        if t != 0.0 and shapes.ball[s] == 0:
            q = turn_fast(q, L, column(model.inv_I_C, i), t)
    else:
        x, q = pose_ahead(state, i, t)
    r = rotate(q, row(shapes.p_CS, s))
    R = to_matrix(multiply(q, (shapes.q_CS[s, 0], shapes.q_CS[s, 1], shapes.q_CS[s, 2],
                               shapes.q_CS[s, 3])))
    for k in range(3):
        pose[s, k] = x[k] + r[k]
        for j in range(3):
            pose[s, 3 + 3 * k + j] = R[k][j]


@kernel
def way_ahead(model: Model, state: State, loads: Loads, i: int, t: float) -> Vector:
    """Return how far the centre of mass of a body moves in t [s] under constant loads [m]."""
    return scale(t, add_scaled(body_velocity(model, state, i), 0.5 * t * model.inv_m[i],
                               column(loads.F, i)))


@kernel
def reach_of_turning(shapes: Shapes, s: int) -> float:
    """Return how far [m] from the centre of mass turning moves the surface of shape s."""
    offset = norm(row(shapes.p_CS, s))
    # A sphere around the centre of mass looks the same however it turns.
    return offset if is_ball(shapes.kind[s]) else offset + shapes.bound[s]


@kernel
def _prescribed_turning(state: State, shapes: Shapes, s: int) -> float:
    """Return how fast [m/s] a prescribed spin moves the surface of shape s, at most."""
    spin = norm(prescribed_spin(state, shapes.body[s]))
    # A plane that stands still reaches infinitely far: 0 times that is no number.
    return spin * reach_of_turning(shapes, s) if spin > 0.0 else 0.0


@kernel
def approach_bound(model: Model, state: State, loads: Loads, shapes: Shapes, s: int, n: Vector,
                   t: float) -> float:
    """Return a bound on how fast a point of shape s moves along n [m/s] until t [s]."""
    i = shapes.body[s]
    if model.inv_m[i] == 0.0:
        v = prescribed_velocity(state, i)
        return n[0] * v[0] + n[1] * v[1] + n[2] * v[2] + _prescribed_turning(state, shapes, s)
    P, L = column(state.P, i), column(state.L, i)
    F, tau = column(loads.F, i), column(loads.tau, i)
    now = model.inv_m[i] * (n[0] * P[0] + n[1] * P[1] + n[2] * P[2])
    later = now + t * model.inv_m[i] * (n[0] * F[0] + n[1] * F[1] + n[2] * F[2])
    # The bound is convex in L: its larger end holds for all of the time.
    turning = max(_turning(model, state, shapes, s, L),
                  _turning(model, state, shapes, s, add_scaled(L, t, tau)))
    return max(now, later) + turning


@kernel
def _turning(model: Model, state: State, shapes: Shapes, s: int, L: Vector) -> float:
    """Return how fast [m/s] a body that turns with L moves the surface of shape s, at most."""
    i = shapes.body[s]
    return fastest_turning(quaternion(state.q, i), L, column(model.inv_I_C, i),
                           reach_of_turning(shapes, s), shapes.mobility[i])


@kernel
def _most_turning(model: Model, state: State, loads: Loads, shapes: Shapes, s: int,
                  t: float) -> float:
    """Return how fast [m/s] turning moves the surface of shape s until t [s], at most."""
    L, tau = column(state.L, shapes.body[s]), column(loads.tau, shapes.body[s])
    turning = _turning(model, state, shapes, s, L)
    if norm(tau) > 0.0:
        turning += _turning(model, state, shapes, s, scale(t, tau))
    return turning


@kernel
def motion_bound(model: Model, state: State, loads: Loads, shapes: Shapes, s: int,
                 t: float) -> float:
    """Return how far [m] any point of shape s can move within t [s], at most."""
    i = shapes.body[s]
    if model.inv_m[i] == 0.0:
        if not is_carried(state, i):
            return 0.0
        return t * (norm(prescribed_velocity(state, i)) + _prescribed_turning(state, shapes, s))
    speed = model.inv_m[i] * (norm(column(state.P, i)) + t * norm(column(loads.F, i)))
    return t * (speed + _most_turning(model, state, loads, shapes, s, t))


@kernel
def turning_bend(model: Model, state: State, loads: Loads, shapes: Shapes, s: int,
                 t: float) -> float:
    """
    Return how fast [m/s^2] turning bends the ways of the points of shape s until t [s], at most.

    |dw/dt x r + w x (w x r)|, where dw/dt = I^-1 (tau - w x L), and |w x L| is at most |L|^2 times
    the difference of the largest and the least 1 / I.
    """
    i, reach = shapes.body[s], reach_of_turning(shapes, s)
    if reach == 0.0:
        return 0.0
    if model.inv_m[i] == 0.0:
        spin = norm(prescribed_spin(state, i))
        return spin * _prescribed_turning(state, shapes, s) if spin > 0.0 else 0.0
    L, tau, inv_I = column(state.L, i), column(loads.tau, i), column(model.inv_I_C, i)
    most, least = max(inv_I[0], inv_I[1], inv_I[2]), min(inv_I[0], inv_I[1], inv_I[2])
    long = norm(L) + t * norm(tau)
    return (most * long * _most_turning(model, state, loads, shapes, s, t)
            + most * reach * (norm(tau) + (most - least) * long * long))
