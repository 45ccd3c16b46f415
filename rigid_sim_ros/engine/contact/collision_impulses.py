# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The impulses of one collision inside a step: several points, friction, no gain of energy.

Two methods find them:

- One pair of bodies, as nearly always, is solved by visits to its points (Gauss-Seidel): first the
  normal impulses. Friction then acts at one point that stays, the centre of their pressure: at one
  that moved between visits its parts would leave a couple.
- Pairs that touch at the same time and share bodies are solved all at once by the method of the
  model `event` (impulse.py), each point with friction of its own: what visits find depends on the
  order of the pairs. Only where they have more points than it has room for visits have to do.
"""

from rigid_sim_ros.engine.contact.colliding_body import (
    change_at, CollisionWork, INV_M, NEVER, push_body, put, relative_after, response, turned)
from rigid_sim_ros.engine.contact.impulse import MOST_ALIKE, solve_impact
from rigid_sim_ros.engine.maths.algebra import perpendicular
from rigid_sim_ros.engine.maths.vector import (
    add, add_scaled, cross, dot, norm, row, scale, subtract)
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import inlined, kernel

# Visits to the points and the friction of one collision, at most, and the part of the impulse by
# which one of them may still change it.
VISITS, CONVERGED = 1000, 1e-12


@kernel
def find_impulses(count: int, work: CollisionWork) -> None:
    """Find and apply the impulses of one collision of some pairs."""
    for k in range(count):
        put(work.pair.slide[k], 0, (0.0, 0.0, 0.0))
    points = _choose_points(count, work) if count > 1 else 0
    if 0 < points <= MOST_ALIKE:
        _solve_at_once(points, work)
    else:
        _solve_by_visits(count, work)


@inlined
def _bodies(k: int, work: CollisionWork) -> tuple[Array, Array]:
    bodies = work.pair.body
    return work.body[bodies[k, 0]], work.body[bodies[k, 1]]


@kernel
def _push(k: int, r_A: Vector, J: Vector, work: CollisionWork) -> None:
    """Let an impulse act on B of a pair, r_A from the centre of mass of A, and -J on A."""
    A, B = _bodies(k, work)
    push_body(A, r_A, scale(-1.0, J))
    push_body(B, subtract(r_A, row(work.pair.between, k)), J)


@kernel
def _velocity(k: int, r_A: Vector, work: CollisionWork) -> Vector:
    """Return the velocity of B relative to A at a point of a pair, as it is by now."""
    A, B = _bodies(k, work)
    return relative_after(A, B, r_A, row(work.pair.between, k), row(work.pair.added, k))


@kernel
def _response(k: int, r_A: Vector, e: Vector, work: CollisionWork) -> float:
    """Return how much a unit impulse along e at a point changes the relative velocity there."""
    A, B = _bodies(k, work)
    return response(A, r_A, e) + response(B, subtract(r_A, row(work.pair.between, k)), e)


# --- by visits -----------------------------------------------------------------------------------


@kernel
def _solve_by_visits(count: int, work: CollisionWork) -> None:
    """Find and apply the impulses by visits: normals, then friction and normals in turn."""
    rubs = False
    for k in range(count):
        _visit_together(k, work)
    left = _visit_normals(count, VISITS, work)
    for k in range(count):
        _write_centre(k, work)
        rubs |= work.pair.mu[k] > 0.0 and _pressure(k, work) > 0.0
    while rubs and left > 0:
        moved = total = 0.0
        for k in range(count):
            moved += _visit_friction(k, work)
            total += norm(row(work.pair.slide, k))
        left = _visit_normals(count, left, work)
        if moved <= CONVERGED * total:
            break
    _limit_energy(count, work)


@kernel
def _visit_together(k: int, work: CollisionWork) -> None:
    """
    Bring the points of a pair to their targets, on the average, by the same impulse at each.

    Before each is visited alone, so that what lies symmetrically stays so.
    """
    n = row(work.pair.normal, k)
    count, c, missing = 0, (0.0, 0.0, 0.0), 0.0
    for p in range(work.pair.points[k]):
        if work.target[k, p] < NEVER:
            count += 1
            c = add(c, row(work.point[k], p))
            missing += work.target[k, p] - dot(n, _velocity(k, row(work.point[k], p), work))
    if count < 2:
        return
    r_A = scale(1.0 / count, c)
    J = max(0.0, missing / count / _response(k, r_A, n, work))
    _push(k, r_A, scale(J, n), work)
    for p in range(work.pair.points[k]):
        if work.target[k, p] < NEVER:
            work.impulse[k, p] = J / count


@kernel
def _visit_point(k: int, p: int, work: CollisionWork) -> float:
    """Bring one point to its target by an impulse >= 0; return by how much that changed [N s]."""
    n, r_A = row(work.pair.normal, k), row(work.point[k], p)
    missing = work.target[k, p] - dot(n, _velocity(k, r_A, work))
    after = max(0.0, work.impulse[k, p] + missing / _response(k, r_A, n, work))
    change = after - work.impulse[k, p]
    _push(k, r_A, scale(change, n), work)
    work.impulse[k, p] = after
    return abs(change)


@kernel
def _visit_normals(count: int, most: int, work: CollisionWork) -> int:
    """
    Visit the points of all pairs in turn until each has its target, so often at `most`.

    Returns how often they may still be visited.
    """
    left = most
    while left > 0:
        left -= 1
        moved = total = 0.0
        for k in range(count):
            for p in range(work.pair.points[k]):
                if work.target[k, p] < NEVER:
                    moved += _visit_point(k, p, work)
            total += _pressure(k, work)
        if moved <= CONVERGED * total:
            break
    return left


@kernel
def _pressure(k: int, work: CollisionWork) -> float:
    """Return the sum of the normal impulses of a pair [N s]."""
    total = 0.0
    for p in range(work.pair.points[k]):
        total += work.impulse[k, p]
    return total


@kernel
def _write_centre(k: int, work: CollisionWork) -> None:
    """Write the centre of the pressure of a pair, if there is any."""
    c, pressure = (0.0, 0.0, 0.0), _pressure(k, work)
    for p in range(work.pair.points[k]):
        c = add_scaled(c, work.impulse[k, p], row(work.point[k], p))
    put(work.pair.centre[k], 0, scale(1.0 / pressure, c) if pressure > 0.0 else c)


@kernel
def _visit_friction(k: int, work: CollisionWork) -> float:
    """Stop the sliding at c within the cone of Coulomb; return how much that changed J [N s]."""
    n, c, J = row(work.pair.normal, k), row(work.pair.centre, k), row(work.pair.slide, k)
    u = _velocity(k, c, work)
    u = add_scaled(u, -dot(n, u), n)
    speed, most = norm(u), work.pair.mu[k] * _pressure(k, work)
    wanted = J
    if speed > 0.0:
        e = scale(1.0 / speed, u)
        wanted = add_scaled(J, -speed / _response(k, c, e, work), e)
    size = norm(wanted)
    if size > most:
        wanted = scale(most / size, wanted)
    change = subtract(wanted, J)
    _push(k, c, change, work)
    put(work.pair.slide[k], 0, wanted)
    return norm(change)


@kernel
def _limit_energy(count: int, work: CollisionWork) -> None:
    """
    Reduce the impulses of a collision to where they do no work.

    Impulses f that change the velocities of their points from u to u + K f do the work f . u + f .
    K f / 2. Newton's law of restitution with friction may make it positive (Kane, A dynamics
    puzzle, Stanford Mechanics Alumni Club Newsletter 1984); s f with s = -2 f . u / f . K f does
    none.
    """
    changed = after = 0.0
    for k in range(count):
        n, c, J = row(work.pair.normal, k), row(work.pair.centre, k), row(work.pair.slide, k)
        changed += dot(J, _change(k, c, work))
        after += dot(J, _velocity(k, c, work))
        for p in range(work.pair.points[k]):
            r, f = row(work.point[k], p), work.impulse[k, p]
            changed += f * dot(n, _change(k, r, work))
            after += f * dot(n, _velocity(k, r, work))
    if after - 0.5 * changed <= 0.0:
        return
    less = 2.0 * (changed - after) / changed - 1.0
    for k in range(count):
        n, c, J = row(work.pair.normal, k), row(work.pair.centre, k), row(work.pair.slide, k)
        for p in range(work.pair.points[k]):
            _push(k, row(work.point[k], p), scale(less * work.impulse[k, p], n), work)
            work.impulse[k, p] *= 1.0 + less
        _push(k, c, scale(less, J), work)
        put(work.pair.slide[k], 0, scale(1.0 + less, J))


@kernel
def _change(k: int, r_A: Vector, work: CollisionWork) -> Vector:
    """Return how much the collision has changed the relative velocity at a point of a pair."""
    A, B = _bodies(k, work)
    return subtract(change_at(B, subtract(r_A, row(work.pair.between, k))), change_at(A, r_A))


# --- all at once ---------------------------------------------------------------------------------


@kernel
def _choose_points(count: int, work: CollisionWork) -> int:
    """Write the points of some pairs that take part, as far as there is room; return how many."""
    found = 0
    for k in range(count):
        for p in range(work.pair.points[k]):
            if work.target[k, p] < NEVER:
                if found < MOST_ALIKE:
                    work.chosen[found, 0], work.chosen[found, 1] = k, p
                found += 1
    return found


@kernel
def _solve_at_once(points: int, work: CollisionWork) -> None:
    """Find and apply the impulses of the chosen points, each with friction of its own."""
    room = work.room
    for i in range(points):
        k, p = work.chosen[i, 0], work.chosen[i, 1]
        axes, u = _axes(k, work), _velocity(k, row(work.point[k], p), work)
        for a in range(3):
            room.u0[3 * i + a] = dot(axes[a], u)
        room.e[i] = work.target[k, p] / -room.u0[3 * i]
        room.mu[i, 0] = work.pair.mu[k]
        for j in range(points):
            others = _axes(work.chosen[j, 0], work)
            for a in range(3):
                for b in range(3):
                    room.A[3 * i + a, 3 * j + b] = _coupling(i, axes[a], j, others[b], work)
    solve_impact(room, points, 3)
    for i in range(points):
        k, p = work.chosen[i, 0], work.chosen[i, 1]
        n, t1, t2 = _axes(k, work)
        work.impulse[k, p] = room.J[3 * i]
        slide = add(scale(room.J[3 * i + 1], t1), scale(room.J[3 * i + 2], t2))
        put(work.pair.slide[k], 0, add(row(work.pair.slide, k), slide))
        _push(k, row(work.point[k], p), add_scaled(slide, room.J[3 * i], n), work)


@kernel
def _axes(k: int, work: CollisionWork) -> tuple[Vector, Vector, Vector]:
    """Return the normal of a pair and two tangents."""
    n = row(work.pair.normal, k)
    t = perpendicular(n)
    return n, t, cross(n, t)


@kernel
def _coupling(i: int, e: Vector, j: int, f: Vector, work: CollisionWork) -> float:
    """Return the velocity along e at chosen point i that a unit impulse along f at j makes."""
    k, l = work.chosen[i, 0], work.chosen[j, 0]  # noqa: E741
    here, there = row(work.point[k], work.chosen[i, 1]), row(work.point[l], work.chosen[j, 1])
    total = 0.0
    for side in range(2):
        body = work.pair.body[k, side]
        r = here if side == 0 else subtract(here, row(work.pair.between, k))
        for other in range(2):
            if work.pair.body[l, other] == body:
                s = there if other == 0 else subtract(there, row(work.pair.between, l))
                line = work.body[body]
                change = line[INV_M] * dot(e, f) + dot(cross(r, e), turned(line, cross(s, f)))
                total += change if side == other else -change
    return total
