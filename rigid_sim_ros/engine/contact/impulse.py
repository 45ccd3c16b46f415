# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Impulses of colliding bodies, as in the model `event` (in `timestep`: collision_impulses.py).

A collision changes velocities in no time: N . (v_a - v_b) becomes -e times what it was (Meyer,
Rigid Body Dynamics, "Impulse"), and the tangential impulse obeys Coulomb's law, |J_t| <= mu J_n,
against the slip that is left. All points of one pair of bodies are solved together, so that a box
that lands flat stays flat; pairs are solved one after the other, the one that approaches fastest
first, until nothing approaches: that is how a shock travels through a row of touching balls
(Newton's cradle), which no simultaneous rule reproduces. Pairs that approach equally fast collide
before what follows from any of them, and are solved together if they share a body: in which order
they stand decides nothing.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.classify import classify, COLLIDING, resting_speed
from rigid_sim_ros.engine.contact.contact_newton import (
    make_newton, Newton, NEWTON_STEPS, refine_rows)
from rigid_sim_ros.engine.contact.contact_rows import make_rows, read_matrix, Rows
from rigid_sim_ros.engine.contact.contacts import (
    Bodies, Contacts, push_rows, read_coefficients, read_rates, read_velocity, relative,
    share_a_body, to_contact)
from rigid_sim_ros.engine.contact.coulomb import COMPLIANCE, GOAL, onto_disk, TOLERANCE
from rigid_sim_ros.engine.contact.resting_qp import effective_mass
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Sweeps over the points: at most over a single one, before Newton's method, and at most where that
# fails: redundant points on the verge of slipping, towards which they creep. 2000 take seven times
# as long and leave as much.
MAX_SWEEPS, FEW, LAST_SWEEPS = 2000, 30, 300
# Times that points give way by what is more than before: 1e-8 of it, and rounding.
SHARPER = 2
# The fastest approach of what does not bounce becomes less by this factor in twice as many
# collisions as there are pairs, or all collide at once: an impact that goes to and fro in a heap
# takes hundreds of them, and where it ends depends on their order.
LESS = 0.5
# What moves by less than this part of the speeds, and in so many sweeps by no less than before,
# moves by rounding.
ROUNDING, NO_LESS = 1e-14, 10
# Approaches that differ by less than this part are equally fast: more than rounding and what
# brackets of the time leave. And the most points that are solved together for that reason.
ALIKE, MOST_ALIKE = 1e-6, 32


class Room(NamedTuple):
    """Scratch memory for the points that collide together: m points, w rows each."""

    chosen: IntArray  # (m,)
    block: IntArray  # (m,) the pairs that collide together
    A: Array  # (wm, wm)
    arm: Array  # (2, wm, 3)
    u0: Array  # (wm,)
    u: Array  # (wm,)
    J: Array  # (wm,)
    mu: Array  # (m, 3)
    e: Array  # (m,)
    plastic: Array  # (m,) zeros
    soft: Rows  # the same problem with a small compliance
    newton: Newton


def make_room(m: int, width: int) -> Room:
    """Return room for m points that collide together."""
    rows = width * m
    return Room(np.zeros(m, dtype=np.int64), np.zeros(m, dtype=np.int64),
                np.zeros((rows, rows)), np.zeros((2, rows, 3)),
                np.zeros(rows), np.zeros(rows), np.zeros(rows), np.zeros((m, 3)), np.zeros(m),
                np.zeros(m), make_rows(m, rows, 0, 0, matrix=rows),
                make_newton(m, rows, 0, 0, rows))


@kernel
def collide_all(model: Model, state: State, contacts: Contacts, bodies: Bodies, h: float,
                touching: float, quiet: float, width: int, elastic: IntArray, limit: int,
                first: int, last: int, room: Room, impulses: Array) -> int:
    """
    Apply impulses until no touching point approaches faster than it may at rest.

    Of the points in the blocks from `first` to `last` - 1.

    Points with a gap of at most `touching` of their size touch. At most `quiet` [1/s] times it,
    and less than `resting_speed` with the step h [s], is left to the resting forces. width: rows
    of a point; elastic, (c,) is 1 where a point may bounce back. The impulses on B, (c, 6) [N s,
    contact axes], are added to `impulses`. Returns the number of collisions of pairs, with a minus
    if something still approaches: after `limit` of them, or sooner where nothing bounces and the
    fastest approach does not become less. Between bodies that nothing pushes and that close, or
    between heavy ones, a light body would go to and fro for ever.
    """
    count, check, before = 0, 0, -np.inf
    bounces = _any_bounces(contacts, elastic, first, last)
    while True:
        fastest = 0.0
        for k in range(first, last):
            fastest = min(fastest, _approach(contacts, bodies, h, touching, quiet, k))
        if fastest == 0.0:
            return count
        if count >= limit or (count >= check and not bounces and fastest <= LESS * before):
            return -count
        if count >= check:
            check, before = count + 2 * (last - first), fastest
        _mark_alike(contacts, bodies, h, touching, quiet, fastest, first, last)
        for k in range(first, last):
            if contacts.alike[k] == 1:
                together = _choose_alike(model, contacts, touching, k, first, last, room)
                _collide(model, state, contacts, bodies, h, touching, width, elastic, together,
                         room, impulses)
                count += 1


@kernel
def _any_bounces(contacts: Contacts, elastic: IntArray, first: int, last: int) -> bool:
    """Return whether any point of some pairs has a restitution."""
    for i in range(contacts.first[first], contacts.first[last]):
        if elastic[i] == 1 and contacts.restitution[i] > 0.0:
            return True
    return False


@kernel
def _approach(contacts: Contacts, bodies: Bodies, h: float, touching: float, quiet: float,
              block: int) -> float:
    """Return how fast the points of a pair approach that collide, below 0 [m/s]; else 0."""
    fastest = 0.0
    for i in range(contacts.first[block], contacts.first[block + 1]):
        if collides(contacts, touching, i):
            u = to_contact(contacts, i, relative(bodies.velocity, contacts, i))
            slow = min(resting_speed(contacts, bodies, i, h), quiet * contacts.size[i])
            if u[0] < fastest and classify(u[0], slow) == COLLIDING:
                fastest = u[0]
    return fastest


@kernel
def _touching_points(contacts: Contacts, touching: float, block: int) -> int:
    """Return how many points of a pair touch."""
    count = 0
    for i in range(contacts.first[block], contacts.first[block + 1]):
        count += 1 if collides(contacts, touching, i) else 0
    return count


@kernel
def collides(contacts: Contacts, touching: float, i: int) -> bool:
    """Return whether a point touches, and is not spare."""
    return bool(contacts.spare[i] == 0 and contacts.gap[i] <= touching * contacts.size[i])


@kernel
def _mark_alike(contacts: Contacts, bodies: Bodies, h: float, touching: float, quiet: float,
                fastest: float, first: int, last: int) -> None:
    """
    Mark the pairs that approach as fast as the fastest.

    All of them collide before what follows from any: the impact of one pair may speed up another
    beyond those that wait, and which of these comes first must not depend on their order.
    """
    for k in range(first, last):
        u = _approach(contacts, bodies, h, touching, quiet, k)
        contacts.alike[k] = 1 if u <= (1.0 - ALIKE) * fastest else 0


@kernel
def _choose_alike(model: Model, contacts: Contacts, touching: float, block: int, first: int,
                  last: int, room: Room) -> int:
    """
    Write the pairs to room.block that collide together with that of `block`; return how many.

    They are marked, and hang together by bodies that move. Their marks are taken off.
    """
    room.block[0], contacts.alike[block] = block, 0
    count, points, done = 1, _touching_points(contacts, touching, block), 0
    while done < count:
        for k in range(first, last):
            if contacts.alike[k] == 1 and _share_a_body(model, contacts, room.block[done], k):
                more = _touching_points(contacts, touching, k)
                if points + more <= MOST_ALIKE:
                    room.block[count], contacts.alike[k] = k, 0
                    count, points = count + 1, points + more
        done += 1
    return count


@kernel
def _share_a_body(model: Model, contacts: Contacts, j: int, k: int) -> bool:
    """Return whether two pairs have a body in common that moves."""
    at, other = contacts.first[j], contacts.first[k]
    return share_a_body(model.inv_m, contacts.body_a[at], contacts.body_b[at],
                        contacts.body_a[other], contacts.body_b[other])


@kernel
def _collide(model: Model, state: State, contacts: Contacts, bodies: Bodies, h: float,
             touching: float, width: int, elastic: IntArray, alike: int, room: Room,
             impulses: Array) -> None:
    """Let the pairs in room.block collide, `alike` of them."""
    m = 0
    for k in range(alike):
        for i in range(contacts.first[room.block[k]], contacts.first[room.block[k] + 1]):
            if collides(contacts, touching, i):
                room.chosen[m] = i
                m += 1
    effective_mass(model, contacts, bodies, room.chosen, m, width, room.arm, room.A)
    for j in range(m):
        i = room.chosen[j]
        read_rates(model, contacts, bodies.velocity, i, width, room.u0, width * j)
        read_coefficients(model, contacts, i, width, room.mu, j)
        rebound = -contacts.restitution[i] * room.u0[width * j]
        bounces = elastic[i] == 1 and rebound > resting_speed(contacts, bodies, i, h)
        room.e[j] = contacts.restitution[i] if bounces else 0.0
    solve_impact(room, m, width)
    for j in range(m):
        i = room.chosen[j]
        push_rows(model, state, contacts, i, width, room.J, width * j)
        for k in range(width):
            impulses[i, k] += room.J[width * j + k]
    for k in range(alike):
        at = contacts.first[room.block[k]]
        read_velocity(model, state, contacts.body_a[at], bodies)
        read_velocity(model, state, contacts.body_b[at], bodies)


@kernel
def solve_impact(room: Room, m: int, width: int) -> None:
    """
    Write the impulses room.J, (wm,) [N s], of m points of pairs that collide together.

    A of the room, (wm, wm) [1/kg], gives the change of velocity A J; u0 [m/s] is the velocity of B
    relative to A before; mu and e are the coefficients of friction and restitution. w = 3 rows to
    a point, (n, t1, t2), or 6 with those for spinning and rolling: see `contacts`. Points that
    approach get u_n >= -e u_n0 and the others u_n >= 0, with J_n >= 0, and equality where J_n > 0.

    Newton's restitution together with friction can create energy where A couples normal and
    tangent (Kane, Levinson, Dynamics, 1985). Where that happens the impulse is (1 + e) times the
    one for e = 0 instead, with the smallest e > 0. For that one J . (u0 + u1) / 2, the change of
    energy, is at most (1 - e^2) / 2 J_0 . u0 <= 0, because the plastic impulse J_0 leaves
    J_0 . (u0 + A J_0) <= 0.
    """
    rows, A, J, u0 = width * m, room.A, room.J, room.u0
    _solve(room, room.e, m, width)
    least = 2.0
    for j in range(m):
        if 0.0 < room.e[j] < least:
            least = room.e[j]
    if least == 2.0:
        return
    change, scale = 0.0, 0.0
    for i in range(rows):
        gain = 0.0
        for j in range(rows):
            gain += A[i, j] * J[j]
        change += J[i] * (u0[i] + 0.5 * gain)
        scale += abs(J[i] * u0[i])
    # An elastic collision without friction has a change of 0, up to rounding.
    if change > 1e-12 * scale:
        _solve(room, room.plastic, m, width)
        for i in range(rows):
            J[i] *= 1.0 + least


@kernel
def _solve(room: Room, e: Array, m: int, width: int) -> None:
    """
    Find the impulses for these coefficients of restitution.

    Sweeps leave the load on redundant points with those that they came to first, and how friction
    turns a body then depends on the order of its points. So after a few Newton's method goes on
    for points that give way a little, and share the impulse (coulomb.COMPLIANCE), and then for
    points that give way by what is more than that. Where it does not get there sweeps have to.
    """
    rows, size, soft = width * m, 0.0, room.soft
    for i in range(rows):
        room.J[i] = 0.0
    _sweep(room.A, room.u0, room.mu, e, room.J, room.u, m, width, MAX_SWEEPS if m == 1 else FEW)
    if m == 1:
        return
    read_matrix(soft, m, width, room.A, room.mu, COMPLIANCE)
    for i in range(rows):
        soft.f[i], soft.b[i] = room.J[i], room.u0[i]
        if i % width == 0:
            soft.b[i] += e[i // width] * min(room.u0[i], 0.0)
        size = max(size, abs(soft.b[i]))
        room.u[i] = 0.0     # what they give way by, without a force
    worst = refine_rows(soft, m, width, 0, GOAL * size, NEWTON_STEPS, room.newton)
    for _ in range(SHARPER if worst <= TOLERANCE * size else 0):
        for i in range(rows):
            gives = COMPLIANCE * room.A[i, i] * soft.f[i]
            soft.b[i] -= gives - room.u[i]
            room.u[i] = gives
        worst = refine_rows(soft, m, width, 0, ROUNDING * size, NEWTON_STEPS, room.newton)
    for i in range(rows):
        room.J[i] = soft.f[i]
    # One sweep takes what rounding left outside of the cones.
    _sweep(room.A, room.u0, room.mu, e, room.J, room.u, m, width,
           LAST_SWEEPS if worst > GOAL * size else 1)


@kernel
def _sweep(A: Array, u0: Array, mu: Array, e: Array, J: Array, u: Array, m: int,
           width: int, most: int) -> None:
    """Sweep over the points (projected Gauss-Seidel), from J, until that moves no more."""
    scale, least, since = 0.0, np.inf, 0
    for i in range(width * m):
        u[i] = u0[i]
        for j in range(width * m):
            u[i] += A[i, j] * J[j]
        scale = max(scale, abs(u0[i]))
    for _ in range(most):
        moved = 0.0
        for j in range(m):
            n = width * j
            wanted = -e[j] * min(u0[n], 0.0)
            before = J[n]
            J[n] = max(0.0, J[n] - (u[n] - wanted) / A[n, n])
            step = J[n] - before
            moved = max(moved, abs(step) * A[n, n])
            for i in range(width * m):
                u[i] += A[i, n] * step
            moved = max(moved, _rub(A, u, mu[j, 0] * J[n], n + 1, n + 2, J, width * m))
            if width == 6:
                moved = max(moved, _stop_spin(A, u, mu[j, 1] * J[n], n + 3, J, width * m))
                moved = max(moved, _rub(A, u, mu[j, 2] * J[n], n + 4, n + 5, J, width * m))
        since = 0 if moved < least else since + 1
        least = min(least, moved)
        if moved <= 1e-16 * scale or (since >= NO_LESS and least <= ROUNDING * scale):
            return


@kernel
def _stop_spin(A: Array, u: Array, limit: float, s: int, J: Array, rows: int) -> float:
    """Update the impulse of row s: it stops the spin, or opposes it in full."""
    before = J[s]
    J[s] = min(max(before - u[s] / A[s, s], -limit), limit)
    step = J[s] - before
    for i in range(rows):
        u[i] += A[i, s] * step
    return abs(step) * A[s, s]


@kernel
def _rub(A: Array, u: Array, limit: float, x: int, y: int, J: Array, rows: int) -> float:
    """Update the impulses of rows x, y: they stop the slip, or oppose it in full."""
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
            new_x, new_y = onto_disk(old_x - u[x] / largest, old_y - u[y] / largest, limit)
        J[x], J[y] = new_x, new_y
    step_x, step_y = J[x] - old_x, J[y] - old_y
    for i in range(rows):
        u[i] += A[i, x] * step_x + A[i, y] * step_y
    return max(abs(step_x) * A[x, x], abs(step_y) * A[y, y])
