# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Collisions with restitution inside a step, as events on straight or parabolic paths.

A pair that will touch within the step and approaches fast enough gets its impulse J now, but as if
it had acted at the time tau of the touch: the velocities change by J / M at once, and the
positions by -tau J / M, so that the motion over the whole step passes through the same places
after tau as a motion with the impulse at tau. With constant forces that is exact, in energy and in
time; P and L are those of the true motion. Collisions of a body are taken in the order of their
times, so that an impulse runs through a row of touching bodies one by one. What approaches slower
than a threshold is left to the contact solver, which makes it rest: so ends the sequence of ever
smaller bounces.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.classify import classify, COLLIDING
from rigid_sim_ros.engine.contact.impact_offsets import gap_now, SHIFT
from rigid_sim_ros.engine.detection.manifolds import ACTS, LEFT_OUT, Manifolds, POINTS, rows_in_use
from rigid_sim_ros.engine.maths.rotation import (
    exponential, multiply, quaternion, set_quaternion, to_matrix, unit)
from rigid_sim_ros.engine.maths.vector import (
    add, add_scaled, add_to_column, column, cross, dot, norm, row, scale, subtract, times)
from rigid_sim_ros.engine.model.kinds.table import is_ball
from rigid_sim_ros.engine.model.shapes import Materials, Shapes, smaller
from rigid_sim_ros.engine.state.rates import velocity_at
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray, room, Vector
from rigid_sim_ros.kernels.kernel import INDEX, inlined, kernel

NEVER = 1e30  # [s]
# Points of a manifold that touch within this distance of each other collide together; a part of
# the size of the smaller shape.
TOGETHER = 1e-6
# What approaches slower does not bounce: this part of what the forces make of rest within a step,
# and in a step this part of the size of the smaller shape, where no force acts.
SLOWEST, STILL = 0.1, 1e-8
# Rounds of collisions in a step. A row of k touching bodies takes about k; what is left after the
# last round is stopped without a bounce by the contact solver.
ROUNDS = 200
# Visits to the points and the friction of one collision, at most, and the part of the impulse by
# which one of them may still change it.
VISITS, CONVERGED = 100, 1e-12


# Columns of `CollisionWork.body`.
_V, _W, _A, _J, _INV_M, _DP, _DL, _COLUMNS = 0, 3, 6, 9, 15, 16, 19, 28


class CollisionWork(NamedTuple):
    """Buffers for n bodies and c manifolds."""

    rows: IntArray  # (c,) of 32 bits, manifolds that may bounce
    time: Array  # (c,) when they touch [s] after the start of the step
    # (c,) of 8 bits, ACTS, DORMANT, or LEFT_OUT: approaches too fast to be at rest, but will not
    # touch in this step
    waits: IntArray
    first: Array  # (n,) the earliest of a body's times
    body: Array  # (n, 28) v, w, F / m, inverse inertia in world axes, 1 / m, new momenta, shifts
    point: Array  # (POINTS, 3) points of one collision from the centre of mass of A [m]
    target: Array  # (POINTS,) normal velocity after it [m/s], NEVER for a point that takes no part
    impulse: Array  # (POINTS,) [N s]


def make_collision_work(n: int, capacity: int) -> CollisionWork:
    """Return buffers for n bodies and `capacity` manifolds."""
    return CollisionWork(room(capacity, kind=np.int32), room(capacity),
                         room(capacity, kind=np.int8), room(n), room(n, _COLUMNS),
                         np.zeros((POINTS, 3)), np.zeros(POINTS), np.zeros(POINTS))


@kernel
def may_bounce(restitution: Array) -> bool:
    """Return whether anything bounces off anything."""
    for i in range(restitution.shape[0]):
        for j in range(i + 1):
            if restitution[i, j] > 0.0:
                return True
    return False


@kernel
def collide_bodies(h: float, inv_m: Array, inv_I_C: Array, state: State, F: Array, shapes: Shapes,
                   materials: Materials, manifolds: Manifolds, normal_impulse: Array,
                   friction_impulse: Array, work: CollisionWork) -> int:
    """
    Let all pairs with restitution bounce that touch within h [s], and not too slowly.

    What waits already takes no part. F (3, n) are the forces [N]. Changes the state; the
    displacements and rotations are in work.body afterwards. The impulses (4, c) and (c, 3) are
    what acted on B [N s]. Returns the number of collisions.
    """
    first_row, count = rows_in_use(manifolds)
    candidates = 0
    for k in range(count if may_bounce(materials.restitution) else 0):
        r = (first_row + k) & INDEX
        a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
        if _restitution(shapes, materials, manifolds.shape_a[r], manifolds.shape_b[r]) > 0.0 and (
                inv_m[a] + inv_m[b] > 0.0) and work.waits[r] == ACTS:
            work.rows[candidates] = r
            candidates += 1
    for k in range(count if candidates > 0 else 0):
        r = (first_row + k) & INDEX
        a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
        _load(inv_m, inv_I_C, state, F, a, work.body[a])
        _load(inv_m, inv_I_C, state, F, b, work.body[b])
    collisions = 0
    for _ in range(ROUNDS if candidates > 0 else 0):
        earlier = collisions
        for k in range(candidates):
            r = work.rows[k]
            work.first[manifolds.body_a[r]] = work.first[manifolds.body_b[r]] = NEVER
        for k in range(candidates):
            r = work.rows[k]
            a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
            work.time[k] = _touch(h, state.x, shapes.kind, shapes.size, manifolds,
                                  _size(shapes, manifolds, r), r, work)
            if inv_m[a] > 0.0:
                work.first[a] = min(work.first[a], work.time[k])
            if inv_m[b] > 0.0:
                work.first[b] = min(work.first[b], work.time[k])
        for k in range(candidates):
            r = work.rows[k]
            a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
            if work.time[k] <= h and work.time[k] <= min(work.first[a], work.first[b]):
                first = shapes.material[manifolds.shape_a[r]]
                second = shapes.material[manifolds.shape_b[r]]
                _bounce(state.x, shapes.kind, shapes.size, manifolds,
                        TOGETHER * _size(shapes, manifolds, r),
                        materials.restitution[first, second],
                        materials.friction[first, second], r, work.time[k], normal_impulse,
                        friction_impulse, work)
                _store(inv_I_C, state, a, work.time[k], work.body[a])
                _store(inv_I_C, state, b, work.time[k], work.body[b])
                # Their other times are no longer true.
                if inv_m[a] > 0.0:
                    work.first[a] = -1.0
                if inv_m[b] > 0.0:
                    work.first[b] = -1.0
                collisions += 1
        if collisions == earlier:
            break
    return collisions


@inlined
def _size(shapes: Shapes, manifolds: Manifolds, r: int) -> float:
    return smaller(shapes, manifolds.shape_a[r], manifolds.shape_b[r])


@inlined
def _restitution(shapes: Shapes, materials: Materials, a: int, b: int) -> float:
    return materials.restitution[shapes.material[a], shapes.material[b]]


@inlined
def _put(line: Array, at: int, v: Vector) -> None:
    line[at], line[at + 1], line[at + 2] = v


@inlined
def _get(line: Array, at: int) -> Vector:
    return (line[at], line[at + 1], line[at + 2])


@kernel
def _load(inv_m: Array, inv_I_C: Array, state: State, F: Array, i: int, line: Array) -> None:
    """Write what collisions need to know of a body."""
    q, inv_I = quaternion(state.q, i), column(inv_I_C, i)
    R = to_matrix(q)
    line[_INV_M] = inv_m[i]
    at = _J
    for k in range(3):
        line[_V + k] = inv_m[i] * state.P[k, i] + state.V[k, i]
        line[_A + k] = inv_m[i] * F[k, i]
        for j in range(k, 3):
            line[at] = dot(times(R[k], inv_I), R[j])
            at += 1
    w = _turned(line, column(state.L, i))
    _put(line, _W, add(w, (state.V[3, i], state.V[4, i], state.V[5, i])))
    for k in range(_DP, _COLUMNS):
        line[k] = 0.0


@inlined
def _turned(line: Array, L: Vector) -> Vector:
    """Return J L."""
    return (line[_J] * L[0] + line[_J + 1] * L[1] + line[_J + 2] * L[2],
            line[_J + 1] * L[0] + line[_J + 3] * L[1] + line[_J + 4] * L[2],
            line[_J + 2] * L[0] + line[_J + 4] * L[1] + line[_J + 5] * L[2])


@kernel
def _store(inv_I_C: Array, state: State, i: int, tau: float, line: Array) -> None:
    """Give a body its new momenta; start its step where they would have."""
    if line[_INV_M] == 0.0:
        return
    dP, dL = _get(line, _DP), _get(line, _DL)
    dx, angle = scale(-tau * line[_INV_M], dP), scale(-tau, _turned(line, dL))
    add_to_column(state.P, i, dP)
    add_to_column(state.L, i, dL)
    add_to_column(state.x, i, dx)
    set_quaternion(state.q, i, unit(multiply(exponential(angle), quaternion(state.q, i))))
    for k in range(3):
        line[SHIFT + k] += dx[k]
        line[SHIFT + 3 + k] += angle[k]
    _put(line, _DP, (0.0, 0.0, 0.0))
    _put(line, _DL, (0.0, 0.0, 0.0))


@kernel
def _velocity_at(line: Array, r: Vector) -> Vector:
    return velocity_at(_get(line, _V), _get(line, _W), r)


@kernel
def _time_of_touch(gap: float, v: float, a: float, h: float, slowest: float) -> float:
    """
    Return when gap + v t + a t^2 / 2 becomes 0 within h.

    An overlap that grows touches at 0. NEVER if it does not touch, or slower than `slowest`; twice
    NEVER if it is fast but later than h.
    """
    if gap <= 0.0:
        return 0.0 if classify(v, slowest) == COLLIDING else NEVER
    square = v * v - 2.0 * a * gap
    if square <= slowest * slowest:
        return NEVER
    speed = square ** 0.5
    if speed <= v:
        return NEVER
    t = 2.0 * gap / (speed - v)
    return t if t <= h else 2.0 * NEVER


@kernel
def _touch(h: float, x: Array, kind: IntArray, size: Array, manifolds: Manifolds, smallest: float,
           r: int, work: CollisionWork) -> float:
    """
    Return when the first point of a manifold touches [s] after the start of the step.

    smallest [m] is the size of the smaller of its shapes.
    """
    a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    n = row(manifolds.normal, r)
    acceleration = dot(n, subtract(_get(work.body[b], _A), _get(work.body[a], _A)))
    pull = max(norm(_get(work.body[a], _A)), norm(_get(work.body[b], _A)))
    # Too slow is also what a force alone makes of rest within two steps.
    slowest = max(SLOWEST * h * pull, STILL * smallest / h, 2.0 * abs(acceleration) * h)
    earliest = 3.0 * NEVER
    slow = False
    for p in range(manifolds.points[r]):
        v = subtract(_velocity_at(work.body[b], row(manifolds.r_B[p], r)),
                     _velocity_at(work.body[a], row(manifolds.r_A[p], r)))
        gap = gap_now(manifolds, work.body, r, p)
        time = _time_of_touch(gap, dot(n, v), acceleration, h, slowest)
        slow = slow or time == NEVER
        earliest = min(earliest, time)
    both = is_ball(kind[manifolds.shape_a[r]]) and is_ball(kind[manifolds.shape_b[r]])
    if both and earliest <= h:
        earliest, _ = _touch_of_spheres(h, x, size, manifolds, r, earliest, work.body)
    work.waits[r] = LEFT_OUT if earliest > NEVER and not slow else ACTS
    return earliest


@kernel
def _touch_of_spheres(h: float, x: Array, size: Array, manifolds: Manifolds, r: int, guess: float,
                      body: Array) -> tuple[float, Vector]:
    """
    Return when two spheres touch and the normal there.

    While they pass each other the line of their centres turns: Newton's method on the distance
    itself.
    """
    a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    n = row(manifolds.normal, r)
    radius_a, radius_b = size[manifolds.shape_a[r], 0], size[manifolds.shape_b[r], 0]
    # Centres of the spheres from the centres of mass.
    o_A = add_scaled(row(manifolds.r_A[0], r), -radius_a, n)
    o_B = add_scaled(row(manifolds.r_B[0], r), radius_b, n)
    d = subtract(add(column(x, b), o_B), add(column(x, a), o_A))
    v = subtract(_velocity_at(body[b], o_B), _velocity_at(body[a], o_A))
    acceleration = subtract(_get(body[b], _A), _get(body[a], _A))
    t = guess
    for _ in range(6):
        at = add_scaled(add_scaled(d, t, v), 0.5 * t * t, acceleration)
        distance = norm(at)
        if distance == 0.0:
            break
        n = scale(1.0 / distance, at)
        rate = dot(n, add_scaled(v, t, acceleration))
        if rate >= 0.0:
            return 2.0 * NEVER, n
        t = max(0.0, t - (distance - radius_a - radius_b) / rate)
    return t if t <= h else 2.0 * NEVER, n


@kernel
def _bounce(x: Array, kind: IntArray, size: Array, manifolds: Manifolds, together: float,
            restitution: float, mu: float, r: int, tau: float, normal_impulse: Array,
            friction_impulse: Array, work: CollisionWork) -> None:
    """
    Collide one pair at tau [s], by the law of Newton within the cone of Coulomb.

    Its points that touch within a distance of `together` [m] take part.
    """
    a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    A, B = work.body[a], work.body[b]
    n = row(manifolds.normal, r)
    acceleration = subtract(_get(B, _A), _get(A, _A))
    spheres = is_ball(kind[manifolds.shape_a[r]]) and is_ball(kind[manifolds.shape_b[r]])
    o_A = (0.0, 0.0, 0.0)
    if spheres:
        radius = size[manifolds.shape_a[r], 0]
        o_A = add_scaled(row(manifolds.r_A[0], r), -radius, n)
        _, n = _touch_of_spheres(tau, x, size, manifolds, r, tau, work.body)
        o_A = add_scaled(o_A, radius, n)
    # From the centre of mass of A to that of B at tau.
    d = subtract(column(x, b), column(x, a))
    d = add_scaled(add_scaled(d, tau, subtract(_get(B, _V), _get(A, _V))), 0.5 * tau * tau,
                   acceleration)
    # Until tau the point of contact moves with the ball, else with the body that moves, else with
    # both.
    follows_B = 0.5
    if is_ball(kind[manifolds.shape_b[r]]) or A[_INV_M] == 0.0:
        follows_B = 1.0
    elif is_ball(kind[manifolds.shape_a[r]]) or B[_INV_M] == 0.0:
        follows_B = 0.0
    for p in range(manifolds.points[r]):
        r_A, r_B = row(manifolds.r_A[p], r), add(row(manifolds.r_B[p], r), d)
        c = o_A if spheres else add_scaled(r_A, follows_B, subtract(r_B, r_A))
        _put(work.point[p], 0, c)
        work.impulse[p] = 0.0
        work.target[p] = NEVER
        u = dot(n, subtract(_velocity_at(B, subtract(c, d)), _velocity_at(A, c)))
        gap = gap_now(manifolds, work.body, r, p)
        gap += tau * u + 0.5 * tau * tau * dot(n, acceleration)
        u += tau * dot(n, acceleration)
        if (gap <= together or spheres) and u < 0.0:
            work.target[p] = -restitution * u
    J = _impulses(A, B, n, d, scale(tau, acceleration), mu, manifolds.points[r], work)
    if spheres:
        # The manifold has the normal from the start of the step.
        before = row(manifolds.normal, r)
        J = add_scaled(J, work.impulse[0], n)
        work.impulse[0] = dot(J, before)
        J = add_scaled(J, -work.impulse[0], before)
    for p in range(manifolds.points[r]):
        normal_impulse[p, r] += work.impulse[p]
    for k in range(3):
        friction_impulse[r, k] += J[k]


@kernel
def _push(line: Array, r: Vector, J: Vector) -> None:
    """Let an impulse J act on a body, r from its centre of mass."""
    if line[_INV_M] == 0.0:
        return
    dL = cross(r, J)
    _put(line, _DP, add(_get(line, _DP), J))
    _put(line, _DL, add(_get(line, _DL), dL))
    _put(line, _V, add_scaled(_get(line, _V), line[_INV_M], J))
    _put(line, _W, add(_get(line, _W), _turned(line, dL)))


@kernel
def _response(line: Array, r: Vector, e: Vector) -> float:
    """Return how much a unit impulse along e at r changes the velocity there along e."""
    c = cross(r, e)
    return line[_INV_M] + dot(c, _turned(line, c))


@kernel
def _change_at(line: Array, r: Vector) -> Vector:
    """Return how much a collision has changed the velocity at a point of a body so far."""
    return add(scale(line[_INV_M], _get(line, _DP)), cross(_turned(line, _get(line, _DL)), r))


@kernel
def _relative(A: Array, B: Array, r_A: Vector, d: Vector, dv: Vector) -> Vector:
    """Return the velocity of B relative to A at a point; `dv` is what forces add until then."""
    return add(dv, subtract(_velocity_at(B, subtract(r_A, d)), _velocity_at(A, r_A)))


@kernel
def _visit_point(A: Array, B: Array, n: Vector, d: Vector, dv: Vector, p: int,
                 work: CollisionWork) -> None:
    """Bring one point to its target by an impulse >= 0."""
    r_A = row(work.point, p)
    r_B = subtract(r_A, d)
    u = _relative(A, B, r_A, d, dv)
    k = _response(A, r_A, n) + _response(B, r_B, n)
    after = max(0.0, work.impulse[p] + (work.target[p] - dot(n, u)) / k)
    change = after - work.impulse[p]
    _push(A, r_A, scale(-change, n))
    _push(B, r_B, scale(change, n))
    work.impulse[p] = after


@kernel
def _visit_together(A: Array, B: Array, n: Vector, d: Vector, dv: Vector, points: int,
                    work: CollisionWork) -> None:
    """
    Bring the points to their targets, on the average, by the same impulse at each.

    Before each is visited alone: so what lies symmetrically stays so.
    """
    count, c, missing = 0, (0.0, 0.0, 0.0), 0.0
    for p in range(points):
        if work.target[p] < NEVER:
            count += 1
            c = add(c, row(work.point, p))
            missing += work.target[p] - dot(n, _relative(A, B, row(work.point, p), d, dv))
    if count < 2:
        return
    r_A = scale(1.0 / count, c)
    r_B = subtract(r_A, d)
    J = max(0.0, missing / count / (_response(A, r_A, n) + _response(B, r_B, n)))
    _push(A, r_A, scale(-J, n))
    _push(B, r_B, scale(J, n))
    for p in range(points):
        if work.target[p] < NEVER:
            work.impulse[p] = J / count


@kernel
def _normal_impulses(A: Array, B: Array, n: Vector, d: Vector, dv: Vector, points: int,
                     work: CollisionWork) -> tuple[float, Vector]:
    """Bring the points to their targets; return the sum of their impulses and its centre."""
    pressure, c = 0.0, (0.0, 0.0, 0.0)
    for _ in range(VISITS):
        before, pressure, c = pressure, 0.0, (0.0, 0.0, 0.0)
        for p in range(points):
            if work.target[p] < NEVER:
                _visit_point(A, B, n, d, dv, p, work)
                pressure += work.impulse[p]
                c = add_scaled(c, work.impulse[p], row(work.point, p))
        if abs(pressure - before) <= CONVERGED * pressure:
            break
    return pressure, scale(1.0 / pressure, c) if pressure > 0.0 else c


@kernel
def _impulses(A: Array, B: Array, n: Vector, d: Vector, dv: Vector, mu: float, points: int,
              work: CollisionWork) -> Vector:
    """
    Find and apply the impulses of one collision; return that of friction.

    First those of the normals alone. Friction then acts at one point that stays, the centre of
    their pressure: at one that moved between visits its parts would leave a couple.
    """
    _visit_together(A, B, n, d, dv, points, work)
    pressure, c = _normal_impulses(A, B, n, d, dv, points, work)
    J = (0.0, 0.0, 0.0)
    if pressure > 0.0 and mu > 0.0:
        J = _friction(A, B, n, d, dv, mu, c, pressure, points, work)
    return _within_energy(A, B, n, d, dv, c, J, points, work)


@kernel
def _friction(A: Array, B: Array, n: Vector, d: Vector, dv: Vector, mu: float, c: Vector,
              pressure: float, points: int, work: CollisionWork) -> Vector:
    """Stop the sliding at c within the cone of Coulomb, and keep the points at their targets."""
    J = (0.0, 0.0, 0.0)
    for _ in range(VISITS):
        u = _relative(A, B, c, d, dv)
        u = add_scaled(u, -dot(n, u), n)
        speed = norm(u)
        if speed == 0.0:
            break
        e = scale(1.0 / speed, u)
        k = _response(A, c, e) + _response(B, subtract(c, d), e)
        wanted = add_scaled(J, -speed / k, e)
        size = norm(wanted)
        if size > mu * pressure:
            wanted = scale(mu * pressure / size, wanted)
        change = subtract(wanted, J)
        _push(A, c, scale(-1.0, change))
        _push(B, subtract(c, d), change)
        J = wanted
        pressure, _ = _normal_impulses(A, B, n, d, dv, points, work)
        if norm(change) <= CONVERGED * norm(J):
            break
    return J


@kernel
def _within_energy(A: Array, B: Array, n: Vector, d: Vector, dv: Vector, c: Vector, J: Vector,
                   points: int, work: CollisionWork) -> Vector:
    """
    Reduce the impulses of a collision to where they do no work; return what is left of J.

    Impulses f that change the velocities of their points from u to u + K f do the work f . u + f .
    K f / 2. Newton's law of restitution with friction may make it positive (Kane, A dynamics
    puzzle, Stanford Mechanics Alumni Club Newsletter 1984); s f with s = -2 f . u / f . K f does
    none.
    """
    changed = dot(J, subtract(_change_at(B, subtract(c, d)), _change_at(A, c)))
    after = dot(J, _relative(A, B, c, d, dv))
    for p in range(points):
        r, f = row(work.point, p), work.impulse[p]
        changed += f * dot(n, subtract(_change_at(B, subtract(r, d)), _change_at(A, r)))
        after += f * dot(n, _relative(A, B, r, d, dv))
    if after - 0.5 * changed <= 0.0:
        return J
    less = 2.0 * (changed - after) / changed - 1.0
    for p in range(points):
        change = scale(less * work.impulse[p], n)
        _push(A, row(work.point, p), scale(-1.0, change))
        _push(B, subtract(row(work.point, p), d), change)
        work.impulse[p] *= 1.0 + less
    change = scale(less, J)
    _push(A, c, scale(-1.0, change))
    _push(B, subtract(c, d), change)
    return add(J, change)
