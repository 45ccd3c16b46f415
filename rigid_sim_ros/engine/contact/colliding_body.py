# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What collisions inside a step need to know of one body, and what they do to it."""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.impact_offsets import COLLIDED, has_collided, SHIFT
from rigid_sim_ros.engine.contact.impulse import make_room, MOST_ALIKE, Room
from rigid_sim_ros.engine.detection.manifolds import POINTS
from rigid_sim_ros.engine.dynamics.free_rotation import (
    are_alike, may_turn_by, SAME_ATTITUDE, turn_fast)
from rigid_sim_ros.engine.maths.rotation import (
    exponential, multiply, quaternion, set_quaternion, unit)
from rigid_sim_ros.engine.maths.vector import (
    add, add_scaled, add_to_column, column, cross, dot, scale, subtract, symmetric_times)
from rigid_sim_ros.engine.state.rates import velocity_at
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.engine.state.world_inertia import write_world_inertia
from rigid_sim_ros.kernels.arrays import Array, IntArray, integers, Quaternion, room, Vector
from rigid_sim_ros.kernels.kernel import inlined, kernel

NEVER = 1e30  # [s]
# Pairs that collide together, at most.
TOGETHER = 32
# Columns of `CollisionWork.body`.
VELOCITY, SPIN, ACCELERATION, INVERSE, INV_M, DP, DL, COLUMNS = 0, 3, 6, 9, 15, 16, 19, 29


class CollidingPairs(NamedTuple):
    """Pairs of bodies that collide at the same time; k is TOGETHER."""

    body: IntArray  # (k, 2) A and B
    points: IntArray  # (k,)
    normal: Array  # (k, 3) from A to B
    between: Array  # (k, 3) [m] from the centre of mass of A to that of B
    added: Array  # (k, 3) [m/s] what forces add to the relative velocity until then
    mu: Array  # (k,) coefficient of friction
    centre: Array  # (k, 3) [m] of the pressure, from the centre of mass of A
    slide: Array  # (k, 3) [N s] the impulse of friction on B


class CollisionWork(NamedTuple):
    """Buffers for n bodies and c manifolds."""

    candidates: IntArray  # (1,) how many manifolds may bounce
    rows: IntArray  # (c,) of 32 bits, which
    time: Array  # (c,) when they touch [s] after the start of the step
    # (c,) of 8 bits, ACTS, DORMANT, or LEFT_OUT: too fast to be at rest, but will not touch in
    # this step
    activity: IntArray
    met: IntArray  # (c,) of 8 bits, how often they met anew in this step; see next_touch.py
    first: Array  # (n,) the earliest of the times of a body and of those near it
    nearby: Array  # (n,) scratch for that
    # (n,) [s] after the start of the step, when a body that can be pushed collided last
    last: Array
    collisions: IntArray  # (n,) of 32 bits, how many pairs of a body that moves collided so far
    # (c,) of 32 bits, the sum of that of both bodies, when they collided with each other; when
    # their time was found; when their ways were followed. -1: not yet
    collided_at: IntArray
    timed_at: IntArray
    followed_at: IntArray
    pairs: IntArray  # (n,) of 32 bits, how many pairs of a body touch first
    # (n, 29) v, w, F / m, inverse inertia in world axes, 1 / m, new momenta, and the columns of
    # impact_offsets.py
    body: Array
    together: IntArray  # (TOGETHER,) places in `rows` of the pairs that collide together
    pair: CollidingPairs
    # (TOGETHER, POINTS, 3) their points from the centres of mass of A [m]
    point: Array
    # (TOGETHER, POINTS) normal velocity after it [m/s], NEVER for a point that takes no part
    target: Array
    impulse: Array  # (TOGETHER, POINTS) [N s]
    chosen: IntArray  # (MOST_ALIKE, 2) pair and point of those that are solved at once
    room: Room  # for them


def make_collision_work(n: int, capacity: int) -> CollisionWork:
    """Return buffers for n bodies and `capacity` manifolds."""
    return CollisionWork(integers(1), room(capacity, kind=np.int32), room(capacity),
                         room(capacity, kind=np.int8), room(capacity, kind=np.int8), room(n),
                         room(n), room(n), room(n, kind=np.int32), room(capacity, kind=np.int32),
                         room(capacity, kind=np.int32), room(capacity, kind=np.int32),
                         room(n, kind=np.int32), room(n, COLUMNS),
                         integers(TOGETHER), _no_pairs(),
                         np.zeros((TOGETHER, POINTS, 3)), np.zeros((TOGETHER, POINTS)),
                         np.zeros((TOGETHER, POINTS)),
                         np.zeros((MOST_ALIKE, 2), dtype=np.int64), make_room(MOST_ALIKE, 3))


def _no_pairs() -> CollidingPairs:
    k = TOGETHER
    return CollidingPairs(
        integers(k, 2), integers(k), np.zeros((k, 3)), np.zeros((k, 3)), np.zeros((k, 3)),
        np.zeros(k), np.zeros((k, 3)), np.zeros((k, 3)))


@inlined
def put(line: Array, at: int, v: Vector) -> None:
    line[at], line[at + 1], line[at + 2] = v


@inlined
def get(line: Array, at: int) -> Vector:
    return (line[at], line[at + 1], line[at + 2])


@kernel
def load_body(inv_m: Array, inv_I_C: Array, state: State, F: Array, i: int, line: Array) -> None:
    """Write what collisions need to know of a body."""
    line[INV_M] = inv_m[i]
    for k in range(3):
        line[VELOCITY + k] = inv_m[i] * state.P[k, i] + state.V[k, i]
        line[ACCELERATION + k] = inv_m[i] * F[k, i]
    _write_spin(inv_I_C, state, i, quaternion(state.q, i), line)
    for k in range(DP, COLUMNS):
        line[k] = 0.0


@kernel
def _write_spin(inv_I_C: Array, state: State, i: int, q: Quaternion, line: Array) -> None:
    """Write the inverse inertia and the angular velocity of a body with an attitude."""
    write_world_inertia(q, column(inv_I_C, i), line, INVERSE)
    w = turned(line, column(state.L, i))
    put(line, SPIN, add(w, (state.V[3, i], state.V[4, i], state.V[5, i])))


@kernel
def turn_body(inv_I_C: Array, state: State, i: int, tau: float, line: Array) -> None:
    """
    Bring the inverse inertia and the angular velocity of a body to tau [s], when it collides.

    With those of the start an impulse that keeps the energy there would change it by w tau of
    itself once the body has turned. What collided already in this step has those of that time.
    """
    L, inv_I = column(state.L, i), column(inv_I_C, i)
    if _wobbles(L, inv_I, tau) or has_collided(line):
        _write_spin(inv_I_C, state, i, turn_fast(quaternion(state.q, i), L, inv_I, tau), line)


@kernel
def _wobbles(L: Vector, inv_I: Vector, t: float) -> bool:
    """Return whether the inertia about the axes of the world changes within t [s]."""
    return not are_alike(inv_I) and may_turn_by(SAME_ATTITUDE, L, inv_I, t)


@inlined
def turned(line: Array, L: Vector) -> Vector:
    """Return I^-1 L [rad/s], world axes, of L [kg m^2/s]."""
    return symmetric_times(get(line, INVERSE), get(line, INVERSE + 3), L)


@kernel
def store_body(inv_I_C: Array, state: State, i: int, tau: float, line: Array) -> None:
    """Give a body its new momenta; start its step where they would have."""
    if line[INV_M] == 0.0:
        return
    dP, dL, L, inv_I = get(line, DP), get(line, DL), column(state.L, i), column(inv_I_C, i)
    dx, angle = scale(-tau * line[INV_M], dP), scale(-tau, turned(line, dL))
    q, later = quaternion(state.q, i), add(L, dL)
    if _wobbles(L, inv_I, tau) or _wobbles(later, inv_I, tau):
        # There as it was, and back as it goes on.
        q = turn_fast(turn_fast(q, L, inv_I, tau), scale(-1.0, later), inv_I, tau)
    else:
        q = unit(multiply(exponential(angle), q))
    add_to_column(state.P, i, dP)
    add_to_column(state.L, i, dL)
    add_to_column(state.x, i, dx)
    set_quaternion(state.q, i, q)
    for k in range(3):
        line[SHIFT + k] += dx[k]
        line[SHIFT + 3 + k] += angle[k]
    line[COLLIDED] = 1.0
    put(line, DP, (0.0, 0.0, 0.0))
    put(line, DL, (0.0, 0.0, 0.0))


@kernel
def velocity_on(line: Array, r: Vector) -> Vector:
    return velocity_at(get(line, VELOCITY), get(line, SPIN), r)


@kernel
def push_body(line: Array, r: Vector, J: Vector) -> None:
    """Let an impulse J act on a body, r from its centre of mass."""
    if line[INV_M] == 0.0:
        return
    dL = cross(r, J)
    put(line, DP, add(get(line, DP), J))
    put(line, DL, add(get(line, DL), dL))
    put(line, VELOCITY, add_scaled(get(line, VELOCITY), line[INV_M], J))
    put(line, SPIN, add(get(line, SPIN), turned(line, dL)))


@kernel
def response(line: Array, r: Vector, e: Vector) -> float:
    """Return how much a unit impulse along e at r changes the velocity there along e."""
    c = cross(r, e)
    return line[INV_M] + dot(c, turned(line, c))


@kernel
def change_at(line: Array, r: Vector) -> Vector:
    """Return how much a collision has changed the velocity at a point of a body so far."""
    return add(scale(line[INV_M], get(line, DP)), cross(turned(line, get(line, DL)), r))


@kernel
def relative_after(A: Array, B: Array, r_A: Vector, d: Vector, dv: Vector) -> Vector:
    """Return the velocity of B relative to A at a point; `dv` is what forces add until then."""
    return add(dv, subtract(velocity_on(B, subtract(r_A, d)), velocity_on(A, r_A)))
