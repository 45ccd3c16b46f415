# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Impulses of colliding bodies.

A collision changes velocities in no time: N . (v_a - v_b) becomes -e times what it was (Meyer, Rigid Body
Dynamics, "Impulse"), and the tangential impulse obeys Coulomb's law, |J_t| <= mu J_n, against the slip that
is left. All points of one pair of bodies are solved together, so that a box that lands flat stays flat; pairs are
solved one after the other, the one that approaches fastest first, until nothing approaches: that is how a shock
travels through a row of touching balls (Newton's cradle), which no simultaneous rule reproduces.
"""

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray
from rigid_sim_ros.engine.bare import bare
from rigid_sim_ros.engine.contacts import (
    Bodies, Contacts, couple, push, read_velocity, relative, to_contact, to_world)
from rigid_sim_ros.engine.kernel import allocating, kernel
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.narrow_phase.algebra import norm
from rigid_sim_ros.engine.state import State

# Approach slower than this [m/s] is rounding, not a collision; ten times more is still below every tolerance here.
STILL = 1e-10
# Sweeps over the points of one pair. A box on four corners takes about 50 to reach rounding.
MAX_SWEEPS = 2000


@bare
def resting_speed(contacts: Contacts, bodies: Bodies, k: int, h: float) -> float:
    """
    Return the speed [m/s] along the normal below which point k rests.

    A body thrown up with v falls back after 2 v / a, with a the larger free acceleration of the two bodies. What
    falls back within a step h is no bounce: this ends the infinitely many bounces in finite time of every
    ball with e < 1 (Zeno) once they are shorter than a step. Without a load there is no such threshold.
    """
    a = contacts.body_a[k]
    b = contacts.body_b[k]
    pull_A = norm((bodies.acceleration[a, 0], bodies.acceleration[a, 1], bodies.acceleration[a, 2]))
    pull_B = norm((bodies.acceleration[b, 0], bodies.acceleration[b, 1], bodies.acceleration[b, 2]))
    return 0.5 * h * max(pull_A, pull_B) + STILL


@allocating
def collide(model: Model, state: State, contacts: Contacts, bodies: Bodies, h: float, touching: float,
            elastic: IntArray, limit: int, impulses: Array) -> int:
    """
    Apply impulses until no touching point approaches faster than it may at rest.

    Points with a gap of at most `touching` [m] touch. elastic, (c,) is 1 where a point may bounce back; h is
    the step [s] of `resting_speed`. The impulses on B, (c, 3) [N s, contact axes], are added to `impulses`.
    Returns the number of collisions of pairs, or -1 if after `limit` of them something still approaches.
    """
    for count in range(limit + 1):
        block = -1
        fastest = 0.0
        for k in range(contacts.count[1]):
            for i in range(contacts.first[k], contacts.first[k + 1]):
                if contacts.gap[i] > touching:
                    continue
                u = to_contact(contacts, i, relative(bodies.velocity, contacts, i))
                if u[0] < -resting_speed(contacts, bodies, i, h) and u[0] < fastest:
                    block, fastest = k, u[0]
        if block < 0:
            return count
        if count < limit:
            _collide_pair(model, state, contacts, bodies, h, touching, elastic, block, impulses)
    return -1


@allocating
def _collide_pair(model: Model, state: State, contacts: Contacts, bodies: Bodies, h: float,
                  touching: float, elastic: IntArray, block: int, impulses: Array) -> None:
    first, after = contacts.first[block], contacts.first[block + 1]
    chosen = np.empty(after - first, dtype=np.int64)
    m = 0
    for i in range(first, after):
        if contacts.gap[i] <= touching:
            chosen[m] = i
            m += 1
    chosen = chosen[:m]
    A = np.empty((3 * m, 3 * m))
    couple(model, contacts, bodies, chosen, A)
    u0, mu, e = np.empty(3 * m), np.empty(m), np.zeros(m)
    for j in range(m):
        i = chosen[j]
        u = to_contact(contacts, i, relative(bodies.velocity, contacts, i))
        u0[3 * j], u0[3 * j + 1], u0[3 * j + 2] = u
        mu[j] = contacts.friction[i]
        rebound = -contacts.restitution[i] * u[0]
        if elastic[i] == 1 and rebound > resting_speed(contacts, bodies, i, h):
            e[j] = contacts.restitution[i]
    J = np.zeros(3 * m)
    impact(A, u0, mu, e, J)
    for j in range(m):
        i = chosen[j]
        J_contact = (J[3 * j], J[3 * j + 1], J[3 * j + 2])
        push(state, contacts, i, to_world(contacts, i, J_contact), model)
        for k in range(3):
            impulses[i, k] += J_contact[k]
    read_velocity(model, state, contacts.body_a[first], bodies)
    read_velocity(model, state, contacts.body_b[first], bodies)


@allocating
def impact(A: Array, u0: Array, mu: Array, e: Array, J: Array) -> None:
    """
    Write the impulses J, (3m,) [N s], of m points of one pair of bodies; triples (n, t1, t2).

    A, (3m, 3m) [1/kg], gives the change of velocity A J; u0 [m/s] is the velocity of B relative to A before;
    mu and e, (m,), are the coefficients of friction and restitution. Points that approach get u_n >= -e u_n0 and
    the others u_n >= 0, with J_n >= 0, and equality where J_n > 0.

    Newton's restitution together with friction can create energy where A couples normal and tangent (Kane,
    Levinson, Dynamics, 1985). Where that happens the impulse is (1 + e) times the one for e = 0 instead, with
    the smallest e > 0. For that one J . (u0 + u1) / 2, the change of energy, is at most
    (1 - e^2) / 2 J_0 . u0 <= 0, because the plastic impulse J_0 leaves J_0 . (u0 + A J_0) <= 0.
    """
    m = mu.shape[0]
    _sweep(A, u0, mu, e, J)
    least = 1.0
    for j in range(m):
        if 0.0 < e[j] < least:
            least = e[j]
    if not e.any():
        return
    change, scale = 0.0, 0.0
    for i in range(3 * m):
        gain = 0.0
        for j in range(3 * m):
            gain += A[i, j] * J[j]
        change += J[i] * (u0[i] + 0.5 * gain)
        scale += abs(J[i] * u0[i])
    # An elastic collision without friction has a change of 0, up to rounding.
    if change > 1e-12 * scale:
        J[:] = 0.0
        _sweep(A, u0, mu, np.zeros(m), J)
        for i in range(3 * m):
            J[i] *= 1.0 + least


@allocating
def _sweep(A: Array, u0: Array, mu: Array, e: Array, J: Array) -> None:
    """Sweep over the points (projected Gauss-Seidel) until the impulses move no more."""
    m = mu.shape[0]
    u = u0.copy()
    scale = np.abs(u0).max()
    for _ in range(MAX_SWEEPS):
        moved = 0.0
        for j in range(m):
            n = 3 * j
            wanted = -e[j] * min(u0[n], 0.0)
            before = J[n]
            J[n] = max(0.0, J[n] - (u[n] - wanted) / A[n, n])
            step = J[n] - before
            moved = max(moved, abs(step) * A[n, n])
            for i in range(3 * m):
                u[i] += A[i, n] * step
            moved = max(moved, _rub(A, u, mu[j], n, J))
        if moved <= 1e-16 * scale:
            return


@bare
def _rub(A: Array, u: Array, mu: float, n: int, J: Array) -> float:
    """Update the friction impulse at one point: it stops the slip, or has the largest size against it."""
    x, y = n + 1, n + 2
    limit = mu * J[n]
    old_x, old_y = J[x], J[y]
    if limit == 0.0:
        J[x], J[y] = 0.0, 0.0
    else:
        determinant = A[x, x] * A[y, y] - A[x, y] * A[y, x]
        new_x = old_x - (A[y, y] * u[x] - A[x, y] * u[y]) / determinant
        new_y = old_y - (A[x, x] * u[y] - A[y, x] * u[x]) / determinant
        if new_x * new_x + new_y * new_y > limit * limit:
            # The largest eigenvalue bounds the step: below 2 / it the projection converges.
            largest = max(A[x, x], A[y, y]) + abs(A[x, y])
            new_x, new_y = old_x - u[x] / largest, old_y - u[y] / largest
            size = np.sqrt(new_x * new_x + new_y * new_y)
            if size > limit:
                new_x, new_y = new_x * limit / size, new_y * limit / size
        J[x], J[y] = new_x, new_y
    step_x, step_y = J[x] - old_x, J[y] - old_y
    for i in range(u.shape[0]):
        u[i] += A[i, x] * step_x + A[i, y] * step_y
    return max(abs(step_x) * A[x, x], abs(step_y) * A[y, y])
