# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Collisions with restitution inside a step, as events on straight or parabolic paths.

A pair that will touch within the step and approaches fast enough gets its impulse J now, but as if
it had acted at the time tau of the touch: the velocities change by J / M at once, and the
positions by -tau J / M, so that the motion over the whole step passes through the same places
after tau as a motion with the impulse at tau. With constant forces that is exact, in energy and in
time; P and L are those of the true motion. Collisions of a body are taken in the order of their
times, so that an impulse runs through a row of touching bodies one by one; those at the same time
are one collision, so that the order of the bodies decides nothing. What approaches slower than a
threshold is left to the contact solver, which makes it rest: so ends the sequence of ever smaller
bounces.
"""

from rigid_sim_ros.engine.contact.classify import classify, COLLIDING
from rigid_sim_ros.engine.contact.colliding_body import (
    ACCELERATION, CollisionWork, get, INV_M, load_body, NEVER, put, SPIN, store_body, TOGETHER,
    turn_body, VELOCITY, velocity_on)
from rigid_sim_ros.engine.contact.collision_impulses import find_impulses
from rigid_sim_ros.engine.contact.contacts import share_a_body
from rigid_sim_ros.engine.contact.impact_offsets import gap_now
from rigid_sim_ros.engine.detection.manifolds import (
    ACTS, LEFT_OUT, Manifolds, rows_in_use, StepImpulses)
from rigid_sim_ros.engine.maths.vector import (
    add, add_scaled, column, cross, dot, norm, row, scale, subtract)
from rigid_sim_ros.engine.model.kinds.table import is_ball
from rigid_sim_ros.engine.model.shapes import Materials, Shapes, smaller
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import INDEX, inlined, kernel

# Points of a manifold that touch within this distance of each other collide together; a part of
# the size of the smaller shape.
ALIKE = 1e-6
# Pairs of a body that touch within this part of a step touch at the same time.
AT_ONCE = 1e-6
# Times of a pair that differ by less than this part of a step are the same: that is rounding.
SAME = 1e-13
# What approaches slower does not bounce: this part of what the forces make of rest within a step,
# and in a step this part of the size of the smaller shape, where no force acts.
SLOWEST, STILL = 0.1, 1e-8
# A pair collides when no pair within so many touches earlier: what is farther away would have to
# pass that on in as many collisions, in between.
REACH = 2
# Rounds of collisions in a step. A row of k touching bodies takes about k; what is left after the
# last round is stopped without a bounce by the contact solver.
ROUNDS = 200


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
                   materials: Materials, manifolds: Manifolds, acted: StepImpulses,
                   work: CollisionWork) -> int:
    """
    Let all pairs with restitution bounce that touch within h [s], and not too slowly.

    Only pairs that act take part. F (3, n) are the forces [N]. Changes the state; the
    displacements and rotations are in work.body afterwards. Adds to the impulses that `acted`.
    Returns the number of collisions.
    """
    first_row, count = rows_in_use(manifolds)
    candidates = 0
    for k in range(count if may_bounce(materials.restitution) else 0):
        r = (first_row + k) & INDEX
        a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
        if (bounces(shapes, materials, manifolds, r) and inv_m[a] + inv_m[b] > 0.0
                and work.activity[r] == ACTS):
            work.rows[candidates] = r
            candidates += 1
    work.candidates[0] = candidates
    for k in range(count if candidates > 0 else 0):
        r = (first_row + k) & INDEX
        work.met[r] = 0
        work.collided_at[r] = work.timed_at[r] = work.followed_at[r] = -1
        for body in (manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX):
            load_body(inv_m, inv_I_C, state, F, body, work.body[body])
            work.last[body], work.collisions[body] = 0.0, 0
    return collide_candidates(h, inv_m, inv_I_C, state, shapes, materials, manifolds, acted, work)


@kernel
def collide_candidates(h: float, inv_m: Array, inv_I_C: Array, state: State, shapes: Shapes,
                       materials: Materials, manifolds: Manifolds, acted: StepImpulses,
                       work: CollisionWork) -> int:
    """Let the chosen pairs collide, in the order of time, as their bodies move by now."""
    candidates, collisions = work.candidates[0], 0
    for _ in range(ROUNDS if candidates > 0 else 0):
        done = False
        for k in range(candidates):
            r = work.rows[k]
            now = collisions_of(manifolds, r, work)
            if work.timed_at[r] != now:
                work.timed_at[r] = now
                work.time[k] = _touch(h, state.x, shapes.kind, shapes.size, manifolds,
                                      _size(shapes, manifolds, r), r, work)
        _find_first(inv_m, candidates, manifolds, work)
        _count_first(h, inv_m, candidates, manifolds, work)
        for k in range(candidates):
            if _is_first(h, k, manifolds, work):
                count = _choose_together(h, inv_m, k, candidates, manifolds, work)
                collisions += _collide(inv_m, inv_I_C, state, shapes, materials, manifolds, count,
                                       acted, work)
                _seek_again(h, state, shapes, manifolds, count, work)
                done = True
        if not done:
            break
    return collisions


@kernel
def _find_first(inv_m: Array, candidates: int, manifolds: Manifolds, work: CollisionWork) -> None:
    """Find the first touch of each body, and of those to which REACH pairs lead from it."""
    for k in range(candidates):
        r = work.rows[k]
        work.first[manifolds.body_a[r]] = work.first[manifolds.body_b[r]] = NEVER
    for k in range(candidates):
        r = work.rows[k]
        for body in (manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX):
            if inv_m[body] > 0.0:
                work.first[body] = min(work.first[body], work.time[k])
    for _ in range(REACH):
        for k in range(candidates):
            r = work.rows[k]
            for body in (manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX):
                work.nearby[body] = work.first[body]
        for k in range(candidates):
            r = work.rows[k]
            a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
            # Through what nothing pushes nothing is passed on: its first touch is never.
            if inv_m[a] > 0.0 and inv_m[b] > 0.0:
                work.first[a] = min(work.first[a], work.nearby[b])
                work.first[b] = min(work.first[b], work.nearby[a])


@inlined
def collisions_of(manifolds: Manifolds, r: int, work: CollisionWork) -> int:
    """Return how often the bodies of a manifold collided: the same number, the same ways."""
    return work.collisions[manifolds.body_a[r]] + work.collisions[manifolds.body_b[r]]


@kernel
def bounces(shapes: Shapes, materials: Materials, manifolds: Manifolds, r: int) -> bool:
    """Return whether a pair has a restitution."""
    return _restitution(shapes, materials, manifolds.shape_a[r], manifolds.shape_b[r]) > 0.0


@kernel
def _is_first(h: float, k: int, manifolds: Manifolds, work: CollisionWork) -> bool:
    """Return whether nothing near candidate k touches before it; or at once."""
    a, b = manifolds.body_a[work.rows[k]] & INDEX, manifolds.body_b[work.rows[k]] & INDEX
    return bool(work.time[k] <= h
                and work.time[k] <= min(work.first[a], work.first[b]) + AT_ONCE * h)


@kernel
def _count_first(h: float, inv_m: Array, candidates: int, manifolds: Manifolds,
                 work: CollisionWork) -> None:
    """Count of each body the pairs that touch first."""
    for k in range(candidates):
        r = work.rows[k]
        work.pairs[manifolds.body_a[r]] = work.pairs[manifolds.body_b[r]] = 0
    for k in range(candidates):
        if _is_first(h, k, manifolds, work):
            r = work.rows[k]
            for body in (manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX):
                work.pairs[body] += 1 if inv_m[body] > 0.0 else 0


@kernel
def _choose_together(h: float, inv_m: Array, first: int, candidates: int, manifolds: Manifolds,
                     work: CollisionWork) -> int:
    """
    Write the candidates that collide together with the first one; return how many.

    They touch at the same time and hang together by bodies that move.
    """
    work.together[0] = first
    count, done = 1, 0
    while done < count:
        r = work.rows[work.together[done]]
        a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
        # Counted are those that move.
        alone = work.pairs[a] <= 1 and work.pairs[b] <= 1
        for k in range(first + 1, candidates if not alone else 0):
            at = work.rows[k]
            c, d = manifolds.body_a[at] & INDEX, manifolds.body_b[at] & INDEX
            if (share_a_body(inv_m, a, b, c, d) and count < TOGETHER
                    and _is_first(h, k, manifolds, work)
                    and not _is_among(work.together, count, k)):
                work.together[count] = k
                count += 1
        done += 1
    return count


@kernel
def _is_among(numbers: IntArray, count: int, k: int) -> bool:
    for i in range(count):
        if numbers[i] == k:
            return True
    return False


@kernel
def _collide(inv_m: Array, inv_I_C: Array, state: State, shapes: Shapes, materials: Materials,
             manifolds: Manifolds, count: int, acted: StepImpulses, work: CollisionWork) -> int:
    """Let the chosen pairs collide, at the time of the first; return how many had an impulse."""
    tau = NEVER
    for k in range(count):
        tau = min(tau, work.time[work.together[k]])
    for k in range(count):
        r = work.rows[work.together[k]] & INDEX
        for body in (manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX):
            turn_body(inv_I_C, state, body, tau, work.body[body])
        one, other = manifolds.shape_a[r], manifolds.shape_b[r]
        work.pair.mu[k] = materials.friction[shapes.material[one], shapes.material[other]]
        _read_pair(state.x, shapes.kind, shapes.size, manifolds,
                   ALIKE * _size(shapes, manifolds, r),
                   _restitution(shapes, materials, one, other), r, tau, k, work)
    find_impulses(count, work)
    collided = 0
    for k in range(count):
        r = work.rows[work.together[k]] & INDEX
        if not _acted(k, manifolds.points[r], work):
            continue
        collided += 1
        _write_pair(shapes.kind, manifolds, r, k, acted, work)
        for body in (manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX):
            store_body(inv_I_C, state, body, tau, work.body[body])
            # What nothing pushes goes on as before, whatever it was met by.
            if inv_m[body] > 0.0:
                work.last[body] = max(work.last[body], tau)
                # Their other times are no longer true.
                work.first[body] = -1.0
                work.collisions[body] += 1
    for k in range(count):
        r = work.rows[work.together[k]] & INDEX
        if _acted(k, manifolds.points[r], work):
            work.collided_at[r] = collisions_of(manifolds, r, work)
    return collided


@kernel
def _acted(k: int, points: int, work: CollisionWork) -> bool:
    """Return whether pair k of a collision has an impulse."""
    for p in range(points):
        if work.impulse[k, p] > 0.0:
            return True
    return False


@kernel
def _seek_again(h: float, state: State, shapes: Shapes, manifolds: Manifolds, count: int,
                work: CollisionWork) -> None:
    """
    Find another time for those of the chosen pairs that had no impulse; NEVER if there is none.

    The angular velocity of a body that precesses is that of the collision by now: with it a point
    may touch at another time than with that of the start, or not at all.
    """
    for k in range(count):
        i = work.together[k]
        r = work.rows[i] & INDEX
        if not _acted(k, manifolds.points[r], work):
            time = _touch(h, state.x, shapes.kind, shapes.size, manifolds,
                          _size(shapes, manifolds, r), r, work)
            work.time[i] = time if abs(time - work.time[i]) > SAME * h else NEVER


@inlined
def _size(shapes: Shapes, manifolds: Manifolds, r: int) -> float:
    return smaller(shapes, manifolds.shape_a[r], manifolds.shape_b[r])


@inlined
def _restitution(shapes: Shapes, materials: Materials, a: int, b: int) -> float:
    return materials.restitution[shapes.material[a], shapes.material[b]]


@kernel
def _time_of_touch(gap: float, v: float, a: float, h: float, slowest: float) -> float:
    """
    Return when gap + v t + a t^2 / 2 becomes 0 within h.

    An overlap that grows touches at 0. NEVER if it does not touch, or slower than `slowest`; twice
    NEVER if it is fast but later than h, or parts fast: whether that would ever come back would be
    a matter of rounding where both fall alike.
    """
    if gap <= 0.0:
        return 0.0 if classify(v, slowest) == COLLIDING else NEVER
    square = v * v - 2.0 * a * gap
    if square <= slowest * slowest:
        return NEVER
    speed = square ** 0.5
    if v > slowest:
        return 2.0 * NEVER
    if speed <= v:
        return NEVER
    t = 2.0 * gap / (speed - v)
    return t if t <= h else 2.0 * NEVER


@inlined
def slowest_bounce(h: float, acceleration: float, pull: float, smallest: float) -> float:
    """
    Return how fast [m/s] two shapes approach, at the least, that bounce off each other.

    Under a relative acceleration along the normal and up to `pull` of either [m/s^2].
    """
    # Too slow is also what a force alone makes of rest within two steps.
    return max(SLOWEST * h * pull, STILL * smallest / h, 2.0 * abs(acceleration) * h)


@kernel
def _touch(h: float, x: Array, kind: IntArray, size: Array, manifolds: Manifolds, smallest: float,
           r: int, work: CollisionWork) -> float:
    """
    Return when the first point of a manifold touches [s] after the start of the step.

    smallest [m] is the size of the smaller of its shapes.
    """
    a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    n = row(manifolds.normal, r)
    of_A, of_B = get(work.body[a], ACCELERATION), get(work.body[b], ACCELERATION)
    acceleration, pull = dot(n, subtract(of_B, of_A)), max(norm(of_A), norm(of_B))
    slowest = slowest_bounce(h, acceleration, pull, smallest)
    earliest = 3.0 * NEVER
    slow = False
    for p in range(manifolds.points[r]):
        gap, v = gap_now(manifolds, work.body, r, p), _rate(manifolds, r, p, n, work.body)
        time = _time_of_touch(gap, v, acceleration, h, slowest)
        slow = slow or time == NEVER
        earliest = min(earliest, time)
    if _are_balls(kind, manifolds, r) and earliest <= h:
        earliest, _ = _touch_of_spheres(h, x, size, manifolds, r, earliest, work.body)
    work.activity[r] = LEFT_OUT if earliest > NEVER and not slow else ACTS
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
    v = subtract(velocity_on(body[b], o_B), velocity_on(body[a], o_A))
    acceleration = subtract(get(body[b], ACCELERATION), get(body[a], ACCELERATION))
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


@inlined
def _rate(manifolds: Manifolds, r: int, p: int, n: Vector, body: Array) -> float:
    """Return how fast the gap of a point grows [m/s], with the levers of its manifold."""
    A, B = body[manifolds.body_a[r] & INDEX], body[manifolds.body_b[r] & INDEX]
    return dot(n, subtract(velocity_on(B, row(manifolds.r_B[p], r)),
                           velocity_on(A, row(manifolds.r_A[p], r))))


@inlined
def _are_balls(kind: IntArray, manifolds: Manifolds, r: int) -> bool:
    return is_ball(kind[manifolds.shape_a[r]]) and is_ball(kind[manifolds.shape_b[r]])


@kernel
def _read_pair(x: Array, kind: IntArray, size: Array, manifolds: Manifolds, together: float,
               restitution: float, r: int, tau: float, k: int, work: CollisionWork) -> None:
    """
    Write what pair k of a collision at tau [s] is, and what the law of Newton wants of it.

    Its points that touch within a distance of `together` [m] take part.
    """
    a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    A, B, pair = work.body[a], work.body[b], work.pair
    n = row(manifolds.normal, r)
    acceleration = subtract(get(B, ACCELERATION), get(A, ACCELERATION))
    spheres = _are_balls(kind, manifolds, r)
    on_A = on_B = (0.0, 0.0, 0.0)
    if spheres:
        before = n
        _, n = _touch_of_spheres(tau, x, size, manifolds, r, tau, work.body)
        on_A = _on_sphere(A, row(manifolds.r_A[0], r), size[manifolds.shape_a[r], 0], before, n,
                          tau)
        on_B = _on_sphere(B, row(manifolds.r_B[0], r), -size[manifolds.shape_b[r], 0], before, n,
                          tau)
    # From the centre of mass of A to that of B at tau.
    d = subtract(column(x, b), column(x, a))
    d = add_scaled(d, tau, subtract(get(B, VELOCITY), get(A, VELOCITY)))
    d = add_scaled(d, 0.5 * tau * tau, acceleration)
    # Until tau the point of contact moves with the ball, else with the body that moves, else with
    # both.
    follows_B = 0.5
    if is_ball(kind[manifolds.shape_b[r]]) or A[INV_M] == 0.0:
        follows_B = 1.0
    elif is_ball(kind[manifolds.shape_a[r]]) or B[INV_M] == 0.0:
        follows_B = 0.0
    pair.body[k, 0], pair.body[k, 1], pair.points[k] = a, b, manifolds.points[r]
    put(pair.normal[k], 0, n)
    put(pair.between[k], 0, d)
    put(pair.added[k], 0, scale(tau, acceleration))
    for p in range(manifolds.points[r]):
        r_A, r_B = row(manifolds.r_A[p], r), add(row(manifolds.r_B[p], r), d)
        if spheres:
            # What is known of A and of B differs where they overlap, or turn about other points.
            r_A, r_B, follows_B = on_A, add(on_B, d), 0.5
        c = add_scaled(r_A, follows_B, subtract(r_B, r_A))
        put(work.point[k, p], 0, c)
        work.impulse[k, p] = 0.0
        work.target[k, p] = NEVER
        u = dot(n, subtract(velocity_on(B, subtract(c, d)), velocity_on(A, c)))
        u += tau * dot(n, acceleration)
        # As the time of touch was found: by another lever a point that touches would be apart.
        gap = gap_now(manifolds, work.body, r, p) + tau * _rate(manifolds, r, p, n, work.body)
        gap += 0.5 * tau * tau * dot(n, acceleration)
        if (gap <= together or spheres) and u < 0.0:
            work.target[k, p] = -restitution * u


@kernel
def _on_sphere(body: Array, r: Vector, radius: float, before: Vector, n: Vector,
               tau: float) -> Vector:
    """
    Return where the normal n leaves a sphere at tau [s], from the centre of mass of its body [m].

    At the start that is r, and the normal `before`; `radius` is below 0 for the one that n enters.
    A sphere that is a part of a body moves with it.
    """
    o = add_scaled(r, -radius, before)
    return add_scaled(add_scaled(o, tau, cross(get(body, SPIN), o)), radius, n)


@kernel
def _write_pair(kind: IntArray, manifolds: Manifolds, r: int, k: int, acted: StepImpulses,
                work: CollisionWork) -> None:
    """Add the impulses of pair k of a collision to those that acted on its manifold."""
    J = row(work.pair.slide, k)
    if _are_balls(kind, manifolds, r):
        # The manifold has the normal from the start of the step.
        before = row(manifolds.normal, r)
        J = add_scaled(J, work.impulse[k, 0], row(work.pair.normal, k))
        along = dot(J, before)
        J = add_scaled(J, -along, before)
        acted.normal[0, r] += along
    else:
        for p in range(manifolds.points[r]):
            acted.normal[p, r] += work.impulse[k, p]
    for j in range(3):
        acted.friction[r, j] += J[j]
