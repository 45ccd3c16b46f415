# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The impulses of one collision inside a step: several points, friction, no gain of energy."""

from rigid_sim_ros.engine.contact.colliding_body import (
    change_at, CollisionWork, NEVER, push_body, relative_after, response)
from rigid_sim_ros.engine.maths.vector import add, add_scaled, dot, norm, row, scale, subtract
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel

# Visits to the points and the friction of one collision, at most, and the part of the impulse by
# which one of them may still change it.
VISITS, CONVERGED = 100, 1e-12


@kernel
def _visit_point(A: Array, B: Array, n: Vector, d: Vector, dv: Vector, p: int,
                 work: CollisionWork) -> None:
    """Bring one point to its target by an impulse >= 0."""
    r_A = row(work.point, p)
    r_B = subtract(r_A, d)
    u = relative_after(A, B, r_A, d, dv)
    k = response(A, r_A, n) + response(B, r_B, n)
    after = max(0.0, work.impulse[p] + (work.target[p] - dot(n, u)) / k)
    change = after - work.impulse[p]
    push_body(A, r_A, scale(-change, n))
    push_body(B, r_B, scale(change, n))
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
            missing += work.target[p] - dot(n, relative_after(A, B, row(work.point, p), d, dv))
    if count < 2:
        return
    r_A = scale(1.0 / count, c)
    r_B = subtract(r_A, d)
    J = max(0.0, missing / count / (response(A, r_A, n) + response(B, r_B, n)))
    push_body(A, r_A, scale(-J, n))
    push_body(B, r_B, scale(J, n))
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
def impulses_of(A: Array, B: Array, n: Vector, d: Vector, dv: Vector, mu: float, points: int,
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
        u = relative_after(A, B, c, d, dv)
        u = add_scaled(u, -dot(n, u), n)
        speed = norm(u)
        if speed == 0.0:
            break
        e = scale(1.0 / speed, u)
        k = response(A, c, e) + response(B, subtract(c, d), e)
        wanted = add_scaled(J, -speed / k, e)
        size = norm(wanted)
        if size > mu * pressure:
            wanted = scale(mu * pressure / size, wanted)
        change = subtract(wanted, J)
        push_body(A, c, scale(-1.0, change))
        push_body(B, subtract(c, d), change)
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
    changed = dot(J, subtract(change_at(B, subtract(c, d)), change_at(A, c)))
    after = dot(J, relative_after(A, B, c, d, dv))
    for p in range(points):
        r, f = row(work.point, p), work.impulse[p]
        changed += f * dot(n, subtract(change_at(B, subtract(r, d)), change_at(A, r)))
        after += f * dot(n, relative_after(A, B, r, d, dv))
    if after - 0.5 * changed <= 0.0:
        return J
    less = 2.0 * (changed - after) / changed - 1.0
    for p in range(points):
        change = scale(less * work.impulse[p], n)
        push_body(A, row(work.point, p), scale(-1.0, change))
        push_body(B, subtract(row(work.point, p), d), change)
        work.impulse[p] *= 1.0 + less
    change = scale(less, J)
    push_body(A, c, scale(-1.0, change))
    push_body(B, subtract(c, d), change)
    return add(J, change)
