# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Collisions with restitution inside a step, as events on straight or parabolic paths.

A pair that will touch within the step and approaches fast enough gets its impulse J now, but as if it had acted
at the time tau of the touch: the velocities change by J / M at once, and the positions by -tau J / M, so that
the motion over the whole step passes through the same places after tau as a motion with the impulse at
tau. With constant forces that is exact, in energy and in time; P and L are those of the true motion.
Collisions of a body are taken in the order of their times, so that an impulse runs through a row of
touching bodies one by one. What approaches slower than a threshold is left to the contact solver, which makes it rest:
so ends the sequence of ever smaller bounces.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray, Vector
from rigid_sim_ros.engine.kernel import kernel
from rigid_sim_ros.engine.loads import Loads
from rigid_sim_ros.engine.manifolds import Manifolds, POINTS
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.rotation import (
    angular_velocity, exponential, multiply, quaternion, set_quaternion, unit)
from rigid_sim_ros.engine.shapes import Materials, Shapes, SPHERE
from rigid_sim_ros.engine.state import body_spin, body_velocity, State
from rigid_sim_ros.engine.vector import (
    add, add_scaled, add_to_column, column, cross, dot, norm, row, scale, subtract)

NEVER = 1e30  # [s]
# Points of a manifold that touch within this distance of each other collide together [m].
TOGETHER = 1e-7
# Rounds of collisions in a step. A row of k touching bodies takes about k; what is left after the last
# round is stopped without a bounce by the contact solver.
ROUNDS = 200
# Visits to the points and the friction of one collision. Four corners of a falling box agree to 1e-6 after 30.
VISITS = 30


class CollisionWork(NamedTuple):
    """Buffers for n bodies and c manifolds."""

    rows: IntArray  # (c,) manifolds that may bounce
    time: Array  # (c,) when they touch [s] after the start of the step
    first: Array  # (n,) of these times, the earliest of a body
    point: Array  # (POINTS, 3) points of one collision from the centre of mass of A [m]
    target: Array  # (POINTS,) normal velocity after it [m/s], NEVER for a point that takes no part
    impulse: Array  # (POINTS,) [N s]
    before: Array  # (2, 6) P and L of the two bodies before it


def make_collision_work(n: int, capacity: int) -> CollisionWork:
    """Return buffers for n bodies and `capacity` manifolds."""
    return CollisionWork(np.zeros(capacity, dtype=np.int64), np.zeros(capacity), np.zeros(n),
                         np.zeros((POINTS, 3)), np.zeros(POINTS), np.zeros(POINTS), np.zeros((2, 6)))


@kernel
def collide_bodies(model: Model, state: State, loads: Loads, shapes: Shapes, materials: Materials,
                   manifolds: Manifolds, slowest: float, shift: Array, normal_impulse: Array,
                   friction_impulse: Array, work: CollisionWork) -> int:
    """
    Let all pairs with restitution bounce that touch within the step faster than `slowest` [m/s].

    Changes the state; shift (6, n) gains the displacements [m] and rotations [rad], the impulses (c, 4) and (c, 3)
    what acted on B [N s]. Returns the number of collisions.
    """
    candidates = 0
    for r in range(manifolds.count[0]):
        if materials.restitution[shapes.material[manifolds.shape_a[r]],
                                 shapes.material[manifolds.shape_b[r]]] > 0.0:
            work.rows[candidates] = r
            candidates += 1
    collisions = 0
    for _ in range(ROUNDS if candidates > 0 else 0):
        earlier = collisions
        work.first[:] = NEVER
        for k in range(candidates):
            r = work.rows[k]
            a, b = manifolds.body_a[r], manifolds.body_b[r]
            work.time[k] = _touch(model, state, loads, shapes, manifolds, shift, slowest, r)
            work.first[a] = min(work.first[a], work.time[k])
            work.first[b] = min(work.first[b], work.time[k])
        for k in range(candidates):
            r = work.rows[k]
            a, b = manifolds.body_a[r], manifolds.body_b[r]
            first_a = work.first[a] if model.inv_m[a] > 0.0 else NEVER
            first_b = work.first[b] if model.inv_m[b] > 0.0 else NEVER
            if work.time[k] <= model.h and work.time[k] <= min(first_a, first_b):
                _bounce(model, state, loads, shapes, materials, manifolds, shift, slowest, r,
                        work.time[k], normal_impulse, friction_impulse, work)
                # Their other times are no longer true.
                work.first[a] = work.first[b] = -1.0
                collisions += 1
        if collisions == earlier:
            break
    return collisions


@kernel
def _acceleration(model: Model, loads: Loads, i: int) -> Vector:
    return scale(model.inv_m[i], column(loads.F, i))


@kernel
def _point_velocity(model: Model, state: State, i: int, r: Vector) -> Vector:
    return add(body_velocity(model, state, i), cross(body_spin(model, state, i), r))


@kernel
def _gap_now(manifolds: Manifolds, shift: Array, r: int, p: int) -> float:
    """Return the gap of a point at the start of the step, after the shifts of earlier collisions."""
    a, b = manifolds.body_a[r], manifolds.body_b[r]
    n = row(manifolds.normal, r)
    moved_a = add((shift[0, a], shift[1, a], shift[2, a]),
                  cross((shift[3, a], shift[4, a], shift[5, a]), row(manifolds.r_A[r], p)))
    moved_b = add((shift[0, b], shift[1, b], shift[2, b]),
                  cross((shift[3, b], shift[4, b], shift[5, b]), row(manifolds.r_B[r], p)))
    return manifolds.gap[r, p] + dot(n, subtract(moved_b, moved_a))


@kernel
def _time_of_touch(gap: float, v: float, a: float, h: float, slowest: float) -> float:
    """
    Return when gap + v t + a t^2 / 2 becomes 0 within h, NEVER if it does not or does so too slowly.

    An overlap that grows touches at 0. Too slow is also what a force alone makes of rest within two steps.
    """
    slowest = max(slowest, 2.0 * abs(a) * h)
    if gap <= 0.0:
        return 0.0 if -v > slowest else NEVER
    square = v * v - 2.0 * a * gap
    if square <= slowest * slowest:
        return NEVER
    speed = square ** 0.5
    if speed <= v:
        return NEVER
    t = 2.0 * gap / (speed - v)
    return t if t <= h else NEVER


@kernel
def _touch(model: Model, state: State, loads: Loads, shapes: Shapes, manifolds: Manifolds, shift: Array,
           slowest: float, r: int) -> float:
    """Return when the first point of a manifold touches [s] after the start of the step."""
    a, b = manifolds.body_a[r], manifolds.body_b[r]
    if model.inv_m[a] + model.inv_m[b] == 0.0:
        return NEVER
    n = row(manifolds.normal, r)
    acceleration = subtract(_acceleration(model, loads, b), _acceleration(model, loads, a))
    earliest = NEVER
    for p in range(manifolds.points[r]):
        v = subtract(_point_velocity(model, state, b, row(manifolds.r_B[r], p)),
                     _point_velocity(model, state, a, row(manifolds.r_A[r], p)))
        gap = _gap_now(manifolds, shift, r, p)
        time = _time_of_touch(gap, dot(n, v), dot(n, acceleration), model.h, slowest)
        earliest = min(earliest, time)
    both = shapes.kind[manifolds.shape_a[r]] == SPHERE and shapes.kind[manifolds.shape_b[r]] == SPHERE
    if both and earliest < NEVER:
        earliest, _ = _touch_of_spheres(model, state, shapes, manifolds, acceleration, r, earliest)
    return earliest


@kernel
def _touch_of_spheres(model: Model, state: State, shapes: Shapes, manifolds: Manifolds, acceleration: Vector,
                      r: int, guess: float) -> tuple[float, Vector]:
    """
    Return when two spheres touch and the normal there.

    While they pass each other the line of their centres turns: Newton's method on the distance itself.
    """
    a, b = manifolds.body_a[r], manifolds.body_b[r]
    n = row(manifolds.normal, r)
    radius_a = shapes.size[manifolds.shape_a[r], 0]
    radius_b = shapes.size[manifolds.shape_b[r], 0]
    # Centres of the spheres from the centres of mass.
    o_A = add_scaled(row(manifolds.r_A[r], 0), -radius_a, n)
    o_B = add_scaled(row(manifolds.r_B[r], 0), radius_b, n)
    d = subtract(add(column(state.x, b), o_B), add(column(state.x, a), o_A))
    v = subtract(_point_velocity(model, state, b, o_B), _point_velocity(model, state, a, o_A))
    t = guess
    for _ in range(6):
        at = add_scaled(add_scaled(d, t, v), 0.5 * t * t, acceleration)
        distance = norm(at)
        if distance == 0.0:
            break
        n = scale(1.0 / distance, at)
        rate = dot(n, add_scaled(v, t, acceleration))
        if rate >= 0.0:
            return NEVER, n
        t = max(0.0, t - (distance - radius_a - radius_b) / rate)
    return t if t <= model.h else NEVER, n


@kernel
def _bounce(model: Model, state: State, loads: Loads, shapes: Shapes, materials: Materials,
            manifolds: Manifolds, shift: Array, slowest: float, r: int, tau: float,
            normal_impulse: Array, friction_impulse: Array, work: CollisionWork) -> None:
    """Collide one pair at tau [s]: Newton's law at the points that touch, within Coulomb's cone."""
    a, b = manifolds.body_a[r], manifolds.body_b[r]
    first, second = shapes.material[manifolds.shape_a[r]], shapes.material[manifolds.shape_b[r]]
    n = row(manifolds.normal, r)
    acceleration = subtract(_acceleration(model, loads, b), _acceleration(model, loads, a))
    spheres = shapes.kind[manifolds.shape_a[r]] == SPHERE and shapes.kind[manifolds.shape_b[r]] == SPHERE
    o_A = (0.0, 0.0, 0.0)
    if spheres:
        radius = shapes.size[manifolds.shape_a[r], 0]
        o_A = add_scaled(row(manifolds.r_A[r], 0), -radius, n)
        _, n = _touch_of_spheres(model, state, shapes, manifolds, acceleration, r, tau)
        o_A = add_scaled(o_A, radius, n)
    _remember(state, a, work.before[0])
    _remember(state, b, work.before[1])
    # From the centre of mass of A to that of B at tau.
    d = subtract(column(state.x, b), column(state.x, a))
    v = subtract(body_velocity(model, state, b), body_velocity(model, state, a))
    d = add_scaled(add_scaled(d, tau, v), 0.5 * tau * tau, acceleration)
    for p in range(manifolds.points[r]):
        c = o_A if spheres else row(manifolds.r_A[r], p)
        work.point[p, 0], work.point[p, 1], work.point[p, 2] = c
        work.impulse[p] = 0.0
        work.target[p] = NEVER
        u = dot(n, subtract(_point_velocity(model, state, b, subtract(c, d)),
                            _point_velocity(model, state, a, c)))
        gap = _gap_now(manifolds, shift, r, p)
        gap += tau * u + 0.5 * tau * tau * dot(n, acceleration)
        u += tau * dot(n, acceleration)
        if (gap <= TOGETHER or spheres) and u < 0.0:
            work.target[p] = -materials.restitution[first, second] * u
    acceleration = scale(tau, acceleration)
    J = _impulses(model, state, a, b, n, d, acceleration, materials.friction[first, second],
                  manifolds.points[r], work)
    for p in range(manifolds.points[r]):
        normal_impulse[r, p] += work.impulse[p]
    for k in range(3):
        friction_impulse[r, k] += J[k]
    _rewind(model, state, a, tau, work.before[0], shift)
    _rewind(model, state, b, tau, work.before[1], shift)


@kernel
def _remember(state: State, i: int, before: Array) -> None:
    for k in range(3):
        before[k] = state.P[k, i]
        before[3 + k] = state.L[k, i]


@kernel
def _push(model: Model, state: State, a: int, b: int, r_A: Vector, d: Vector, J: Vector) -> None:
    """Let J act on B and -J on A at the point r_A from A; d leads from A to B."""
    if model.inv_m[a] > 0.0:
        add_to_column(state.P, a, scale(-1.0, J))
        add_to_column(state.L, a, cross(J, r_A))
    if model.inv_m[b] > 0.0:
        add_to_column(state.P, b, J)
        add_to_column(state.L, b, cross(subtract(r_A, d), J))


@kernel
def _response(model: Model, state: State, i: int, r: Vector, e: Vector) -> Vector:
    """Return the change of the velocity at r from the centre of mass by a unit impulse along e."""
    w = angular_velocity(quaternion(state.q, i), cross(r, e), column(model.inv_I_C, i))
    return add(scale(model.inv_m[i], e), cross(w, r))


@kernel
def _impulses(model: Model, state: State, a: int, b: int, n: Vector, d: Vector, dv: Vector, mu: float,
              points: int, work: CollisionWork) -> Vector:
    """Find and apply the impulses of one collision by visiting points and friction in turn; return friction's."""
    J = (0.0, 0.0, 0.0)
    for _ in range(VISITS):
        pressure = 0.0
        c = (0.0, 0.0, 0.0)
        for p in range(points):
            if work.target[p] == NEVER:
                continue
            r_A = row(work.point, p)
            r_B = subtract(r_A, d)
            u = add(dv, subtract(_point_velocity(model, state, b, r_B), _point_velocity(model, state, a, r_A)))
            k = dot(n, add(_response(model, state, a, r_A, n), _response(model, state, b, r_B, n)))
            after = max(0.0, work.impulse[p] + (work.target[p] - dot(n, u)) / k)
            _push(model, state, a, b, r_A, d, scale(after - work.impulse[p], n))
            work.impulse[p] = after
            pressure += after
            c = add_scaled(c, after, r_A)
        if mu == 0.0 or pressure == 0.0:
            if points == 1:
                break
            continue
        r_A = scale(1.0 / pressure, c)
        r_B = subtract(r_A, d)
        u = add(dv, subtract(_point_velocity(model, state, b, r_B), _point_velocity(model, state, a, r_A)))
        u = add_scaled(u, -dot(n, u), n)
        speed = norm(u)
        if speed == 0.0:
            continue
        e = scale(1.0 / speed, u)
        k = dot(e, add(_response(model, state, a, r_A, e), _response(model, state, b, r_B, e)))
        wanted = add_scaled(J, -speed / k, e)
        size = norm(wanted)
        if size > mu * pressure:
            wanted = scale(mu * pressure / size, wanted)
        _push(model, state, a, b, r_A, d, subtract(wanted, J))
        J = wanted
    return J


@kernel
def _rewind(model: Model, state: State, i: int, tau: float, before: Array, shift: Array) -> None:
    """Move a body to where it would have started the step had it always had its new momenta."""
    if model.inv_m[i] == 0.0:
        return
    q, inv_I = quaternion(state.q, i), column(model.inv_I_C, i)
    dP = subtract(column(state.P, i), (before[0], before[1], before[2]))
    dL = subtract(column(state.L, i), (before[3], before[4], before[5]))
    dx = scale(-tau * model.inv_m[i], dP)
    angle = scale(-tau, angular_velocity(q, dL, inv_I))
    add_to_column(state.x, i, dx)
    set_quaternion(state.q, i, unit(multiply(exponential(angle), q)))
    for k in range(3):
        shift[k, i] += dx[k]
        shift[3 + k, i] += angle[k]
