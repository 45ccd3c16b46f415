# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The circle of the model `event`, compiled: it runs until the steps are done, or needs help.

What needs help is a buffer that has to grow, and a small contact problem that only OSQP can solve.
The kernel then returns the reason; Python does what is asked (event.py) and calls again, and it
goes on from the stage at which it stopped.
"""

import numpy as np

from rigid_sim_ros.engine.algebra import norm
from rigid_sim_ros.engine.arrays import Array, IntArray
from rigid_sim_ros.engine.backtrack import film, first_event, pairs_ahead
from rigid_sim_ros.engine.contact_ahead import carry_ahead, turn_bodies
from rigid_sim_ros.engine.contact_newton import FEW_STEPS, number_bodies, solve_rows
from rigid_sim_ros.engine.contact_qp import COMPLIANCE, TOLERANCE
from rigid_sim_ros.engine.contact_rows import (
    apply_forces, Rows, sweep_rows, violation, write_rows)
from rigid_sim_ros.engine.contacts import (
    Bodies, Contacts, gather, length, push_rows, read_bodies, read_rates, relative, row, row_count,
    to_contact, to_world, torque_in_world)
from rigid_sim_ros.engine.detect import detect_ahead
from rigid_sim_ros.engine.event_buffers import (
    BOUNCED, Buffers, Carried, CHOSEN, COLLISIONS, CUT_SHORT, DEEP, DEEPEST, DONE, EVENTS,
    EventSettings, FRESH, KNOWN, LEFT, MEET, MORE_CONTACTS, MORE_FORCES, MORE_MANIFOLDS,
    MORE_MEMORY, MORE_PAIRS, MORE_ROOM, MORE_ROWS, NEEDED, PUSHED, RESIDUAL, REST, SETTLE, SPAN,
    STAGE, STEPS, STUCK, TOUCHED, TRAVEL, UNSOLVED, WIDTH, WORST)
from rigid_sim_ros.engine.event_move import load, move, shift_levers
from rigid_sim_ros.engine.impulse import collide_all, resting_speed, STILL
from rigid_sim_ros.engine.integrate import sum_loads
from rigid_sim_ros.engine.kernel import kernel
from rigid_sim_ros.engine.kinematic import begin_kinematic, end_kinematic
from rigid_sim_ros.engine.loads import kick, Loads
from rigid_sim_ros.engine.manifolds import current, Manifolds, Memory
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.shapes import Materials, Shapes
from rigid_sim_ros.engine.state import State
from rigid_sim_ros.engine.wrenches import count_down, Wrenches


# A gap left at rest is closed at this rate per step. The gap and its rate then shrink with the
# factors 0.6 and 0.25 a step without swinging; above 0.34 they would swing.
CLOSING = 0.3
# Of a step: no part in which forces stay constant is shorter.
SHORTEST = 1.0 / 256.0
CUT = 1.0 / 16.0  # of a step: gaps are not closed within less
# Of the speed of a rebound that is too short to be one: no faster may a force lift what overlaps.
LIFTING = 0.1
# Multiplications for each body, and for 20 at least, that a step may take, about 0.2 ms; what is
# left of the step then runs without backtracking, and contact problems are used as far as they
# came. In the same unit what an event takes, and for each pair that may meet.
EFFORT, PER_EVENT, PER_PAIR = 2e5, 1e4, 5e3
# Forces that violate the laws by more than this part of the accelerations are not looked at for
# how deep bodies get under them.
ROUGH = 1e-4
# Points of a problem that OSQP is asked for where sweeps and Newton's method do not do; for more
# it takes too long.
FOR_OSQP = 8
AGAIN = 10  # times at most that forces are found again for what follows from them
PUSH_SWEEPS = 30  # over the points, for displacements: what they leave is for the next step


@kernel
def _choose(contacts: Contacts, bodies: Bodies, h: float, touching: float,
            chosen: IntArray) -> int:
    """Write the points that get a force: those that touch, and slow ones that nearly do."""
    m = 0
    for k in range(contacts.count[0]):
        slow = resting_speed(contacts, bodies, k, h)
        touch = touching * contacts.size[k]
        if contacts.gap[k] > touch:
            u = to_contact(contacts, k, relative(bodies.velocity, contacts, k))
            # It rises to slow^2 / 2a = slow h / 4 with slow = a h / 2.
            if contacts.gap[k] > touch + 0.25 * slow * h or u[0] < -slow:
                continue
        chosen[m] = k
        m += 1
    return m


@kernel
def _rates(model: Model, shapes: Shapes, contacts: Contacts, bodies: Bodies, chosen: IntArray,
           width: int, u: Array, span: float, closing: float, b: Array) -> bool:
    """
    Write b of a = A f + b: accelerations without contact forces, and what stops points.

    a = 0 then means that the point, with the rates u at the end of the span [s] but for the loads,
    has stopped there, so that neither a velocity nor a gap that rounding left behind can grow from
    step to step: of the gap a part is closed in `closing` [s]. Returns whether a point overlaps so
    much that this would give it a speed worth mentioning: that is left to `_push_apart`.
    """
    deep = False
    for c in range(chosen.shape[0]):
        k, at = chosen[c], width * c
        read_rates(model, contacts, bodies.acceleration, k, width, b, at)
        gap = contacts.gap[k] - film(shapes, contacts.shape_a[k], contacts.shape_b[k])
        wanted = -CLOSING * gap / closing
        if wanted <= LIFTING * resting_speed(contacts, bodies, k, model.h):
            u[at] -= wanted
        else:
            deep = True
        for i in range(width):
            b[at + i] += u[at + i] / span
    return deep


@kernel
def _push_apart(model: Model, state: State, shapes: Shapes, settings: EventSettings, m: int,
                span: float, closing: float, w: Buffers) -> None:
    """
    Add momenta that displace what overlaps, and are taken back when the span is over.

    So nothing that comes apart gains a velocity, however deep it was. The momenta and what they
    are at the bodies are left in `w.pushed`.
    """
    rows, width = w.rows, w.count[WIDTH]
    contacts = w.contacts
    violation(rows, m, width, rows.f)
    for c in range(m):
        k, at = w.chosen[c], width * c
        depth = film(shapes, contacts.shape_a[k], contacts.shape_b[k]) - contacts.gap[k]
        wanted = min(CLOSING * depth / closing,
                     settings.push_out * contacts.size[k] / model.h)
        if CLOSING * depth / closing <= LIFTING * resting_speed(contacts, w.bodies, k, model.h):
            wanted = 0.0
        for i in range(at, at + width):
            rows.trial[i] = 0.0
        # Not what leaves its overlap by itself.
        w.newton.y[at] = -wanted + span * max(rows.a[at], 0.0)
    for c in range(m):
        rows.mu[c, 0], rows.mu[c, 1], rows.mu[c, 2] = 0.0, 0.0, 0.0
        rows.b[width * c] = w.newton.y[width * c]
    apply_forces(rows, m, width, rows.trial)
    sweep_rows(rows, m, width, rows.trial, PUSH_SWEEPS, 0.0)
    for j in range(model.m.shape[0]):
        for i in range(3):
            w.pushed.F[i, j], w.pushed.tau[i, j] = state.P[i, j], state.L[i, j]
    for c in range(m):
        push_rows(model, state, contacts, w.chosen[c], width, rows.trial, width * c)
    for j in range(model.m.shape[0]):
        for i in range(3):
            w.pushed.F[i, j] = state.P[i, j] - w.pushed.F[i, j]
            w.pushed.tau[i, j] = state.L[i, j] - w.pushed.tau[i, j]
    w.count[PUSHED] = 1


@kernel
def _take_back(model: Model, state: State, w: Buffers) -> None:
    """Take the momenta that only displaced."""
    if w.count[PUSHED] == 1:
        kick(state, w.pushed, -1.0)
        w.count[PUSHED] = 0


@kernel
def _recall(model: Model, contacts: Contacts, chosen: IntArray, width: int, carried: Carried,
            known: int, f: Array) -> bool:
    """
    Write the forces of the last step at the points that were there already, 0 at the others.

    Returns whether any was.
    """
    f[:] = 0.0
    at, size, found = 0, known, False
    for c in range(chosen.shape[0]):
        k = chosen[c]
        for tried in range(size):
            # Both are in the same order, so the search nearly always ends at once.
            i = (at + tried) % size
            if (carried.shape_a[i] == contacts.shape_a[k]
                    and carried.shape_b[i] == contacts.shape_b[k]
                    and carried.feature[i] == contacts.feature[k]):
                to = width * c
                f[to], f[to + 1], f[to + 2] = to_contact(contacts, k, row(carried.force, i))
                if width == 6:
                    tau = to_contact(contacts, k, row(carried.torque, i))
                    arm = length(model, contacts, k)
                    f[to + 3], f[to + 4], f[to + 5] = tau[0] / arm, tau[1] / arm, tau[2] / arm
                at, found = i + 1, True
                break
    return found


@kernel
def _remember(model: Model, contacts: Contacts, chosen: IntArray, width: int, f: Array,
              carried: Carried) -> None:
    """Write the forces to what is carried over."""
    for c in range(chosen.shape[0]):
        k, at = chosen[c], width * c
        carried.shape_a[c], carried.shape_b[c] = contacts.shape_a[k], contacts.shape_b[k]
        carried.feature[c] = contacts.feature[k]
        F = to_world(contacts, k, (f[at], f[at + 1], f[at + 2]))
        tau = torque_in_world(model, contacts, k, width, f, at)
        for i in range(3):
            carried.force[c, i] = F[i]
            carried.torque[c, i] = tau[i]


@kernel
def _sink(contacts: Contacts, bodies: Bodies, chosen: IntArray, span: float, overlap: float,
          depth: Array) -> None:
    """
    Write how deep [m, < 0] the points that get forces may go within the span.

    Stopped over the span, not at once, a slow approach u_n gets |u_n| t / 2 deeper.
    """
    for c in range(chosen.shape[0]):
        k = chosen[c]
        u = to_contact(contacts, k, relative(bodies.velocity, contacts, k))
        depth[c] = (min(contacts.gap[k], 0.0) + 0.5 * min(u[0], 0.0) * span
                    - overlap * contacts.size[k])


@kernel
def _allow(pairs: IntArray, count: int, contacts: Contacts, chosen: IntArray, depth: Array,
           allowed: Array) -> None:
    """Write how deep the pairs that get forces may go, 0 for the others; see `first_event`."""
    allowed[:count] = 0.0
    p = 0
    for c in range(chosen.shape[0]):
        k = chosen[c]
        for _ in range(count):
            if pairs[p, 0] == contacts.shape_a[k] and pairs[p, 1] == contacts.shape_b[k]:
                allowed[p] = min(allowed[p], depth[c])
                break
            p = (p + 1) % count


@kernel
def _record(model: Model, manifolds: Manifolds, contacts: Contacts, impulses: Array) -> None:
    """Add impulses, (c, 6) [N s, contact axes], to those of the manifolds."""
    r = 0
    for k in range(contacts.count[0]):
        a, b = contacts.shape_a[k], contacts.shape_b[k]
        for _ in range(manifolds.count[0]):
            if manifolds.shape_a[r] == a and manifolds.shape_b[r] == b:
                break
            r = (r + 1) % manifolds.count[0]
        for j in range(manifolds.points[r]):
            if manifolds.feature[j, r] == contacts.feature[k]:
                manifolds.impulse[j, r] += impulses[k, 0]
        rubbing = to_world(contacts, k, (0.0, impulses[k, 1], impulses[k, 2]))
        for i in range(3):
            manifolds.friction[r, i] += rubbing[i]
        manifolds.spin[r] += length(model, contacts, k) * impulses[k, 3]


@kernel
def _deepest(manifolds: Manifolds) -> float:
    deepest = 0.0
    for r in range(manifolds.count[0]):
        for j in range(manifolds.points[r]):
            deepest = max(deepest, -manifolds.gap[j, r])
    return deepest


@kernel
def _look_near(model: Model, shapes: Shapes, settings: EventSettings, loads: Loads,
               memory: Memory) -> None:
    """
    Let detection find what touches, or is as near as a rebound that is too short to be one.

    A share of both shapes: that of a plane, which has no size, is its partner's.
    """
    h = model.h
    for s in range(shapes.kind.shape[0]):
        i, size = shapes.body[s], shapes.bound[s]
        pull = model.inv_m[i] * norm((loads.F[0, i], loads.F[1, i], loads.F[2, i]))
        if size == np.inf:
            size = 0.0
        memory.ahead[s] = 1.01 * (settings.touching * size
                                  + 0.25 * h * (0.5 * h * pull + STILL * size / h))
    memory.calm[0] = np.inf  # no pair is looked at farther ahead than it touches


@kernel
def _forget_impulses(manifolds: Manifolds) -> None:
    for r in range(manifolds.count[0]):
        manifolds.spin[r] = 0.0
        for j in range(manifolds.points[r]):
            manifolds.impulse[j, r] = 0.0
        for i in range(3):
            manifolds.friction[r, i] = 0.0


@kernel
def _find(model: Model, state: State, shapes: Shapes, materials: Materials, memory: Memory,
          settings: EventSettings, w: Buffers) -> int:
    """Find the points that touch, or are as near as a rebound that is too short to be one."""
    manifolds = current(memory)
    for r in range(manifolds.count[0]):
        # Polyhedra that hardly moved would keep points that are right to second order: not enough
        # here.
        manifolds.found_at[r, 0] = np.inf
    _look_near(model, shapes, settings, w.work.loads, memory)
    if not detect_ahead(model, state, shapes, memory, 0, None):
        return MORE_MEMORY
    manifolds = current(memory)
    rows = manifolds.count[0]
    if rows > w.order.shape[1]:
        w.count[NEEDED] = rows
        return MORE_MANIFOLDS
    found = gather(state, manifolds, shapes, materials, np.inf, w.order[0, :rows],
                   w.order[1, :rows], w.contacts)
    if found > w.contacts.gap.shape[0]:
        w.count[NEEDED] = found
        return MORE_CONTACTS
    largest = 0
    for k in range(w.contacts.count[1]):
        largest = max(largest, w.contacts.first[k + 1] - w.contacts.first[k])
    w.count[NEEDED] = largest
    if largest > w.room.chosen.shape[0]:
        return MORE_ROOM
    w.count[NEEDED] = w.count[BOUNCED] + w.contacts.count[1]
    if w.count[NEEDED] > w.bounced.shape[0]:
        return MORE_MANIFOLDS
    if w.count[FRESH] == 1:
        _forget_impulses(manifolds)
        w.count[FRESH] = 0
    w.number[DEEPEST] = max(w.number[DEEPEST], _deepest(manifolds))
    return DONE


@kernel
def _bounce(contacts: Contacts, k: int, w: Buffers) -> int:
    """Return the row of `bounced` that belongs to the bodies of block k, after adding it."""
    a, b = contacts.body_a[contacts.first[k]], contacts.body_b[contacts.first[k]]
    for i in range(w.count[BOUNCED]):
        if w.bounced[i, 0] == a and w.bounced[i, 1] == b:
            return i
    i = w.count[BOUNCED]
    w.bounced[i, 0], w.bounced[i, 1], w.bounced[i, 2] = a, b, 0
    w.count[BOUNCED] += 1
    return i


@kernel
def _collide(model: Model, state: State, settings: EventSettings, w: Buffers) -> int:
    """Apply the impulses of all that collides now."""
    contacts = w.contacts
    blocks = contacts.count[1]
    for k in range(contacts.count[0]):
        for i in range(6):
            w.impulses[k, i] = 0.0
    if blocks == 0:
        return DONE
    for k in range(blocks):
        tired = False
        for i in range(w.count[BOUNCED]):
            at = contacts.first[k]
            if (w.bounced[i, 0] == contacts.body_a[at] and w.bounced[i, 1] == contacts.body_b[at]
                    and w.bounced[i, 2] >= settings.max_bounces):
                tired = True
        for i in range(contacts.first[k], contacts.first[k + 1]):
            w.elastic[i] = 0 if tired else 1
    limit = 50 + 10 * blocks
    quiet = max(STILL / model.h, 2.0 * settings.dip / min(w.number[SPAN], w.number[LEFT]))
    if not _room_for(model, w, touching_points(settings, w)):
        return MORE_ROWS
    w.newton.effort[0] += PER_EVENT
    done = collide_all(model, state, contacts, w.bodies, model.h, settings.touching, quiet,
                       w.count[WIDTH], w.elastic, limit, w.room, w.impulses)
    if done == 0:
        return DONE
    w.count[COLLISIONS] += limit if done < 0 else done
    w.newton.effort[0] += PER_PAIR * (limit if done < 0 else done)
    for k in range(blocks):
        pushed = False
        for i in range(contacts.first[k], contacts.first[k + 1]):
            pushed = pushed or w.impulses[i, 0] != 0.0
        if pushed:
            w.bounced[_bounce(contacts, k, w), 2] += 1
    read_bodies(model, state, w.work.loads.F, w.work.loads.tau, w.bodies)
    if done < 0:
        _stop_together(model, state, settings, w)
    return DONE


@kernel
def _effort_left(model: Model, w: Buffers) -> float:
    """Return how many multiplications the rest of the step may take."""
    return EFFORT * max(20, model.m.shape[0]) - w.newton.effort[0]


@kernel
def _room_for(model: Model, w: Buffers, m: int) -> bool:
    """Return whether there is room for the first m chosen points, and number their bodies."""
    w.count[NEEDED] = w.count[WIDTH] * m
    w.count[TOUCHED] = number_bodies(w.contacts, w.chosen[:m], model.inv_m, w.newton.slot)
    return (w.count[NEEDED] <= w.rows.b.shape[0]
            and 6 * w.count[TOUCHED] <= w.newton.p.shape[0])


@kernel
def _balance(model: Model, state: State, shapes: Shapes, memory: Memory, settings: EventSettings,
             carried: Carried, w: Buffers) -> int:
    """Find the forces at the resting points."""
    contacts, width = w.contacts, w.count[WIDTH]
    if w.count[EVENTS] >= settings.max_events or _effort_left(model, w) < 0.0:
        # The forces are to last for the rest of the step, and are found for that.
        w.count[CUT_SHORT] = 1
        w.number[SPAN] = w.number[LEFT]
    m = _choose(contacts, w.bodies, model.h, settings.touching, w.chosen)
    w.count[CHOSEN] = m
    if not _room_for(model, w, m):
        return MORE_ROWS
    if m == 0:
        return DONE
    chosen, rows = w.chosen[:m], w.rows
    span = min(w.number[SPAN], w.number[LEFT])
    _sink(contacts, w.bodies, chosen, span, settings.overlap, w.depth)
    turn_bodies(model, state, w.work.loads.tau, span, w.bodies, w.then)
    carry_ahead(model, state, w.still, shapes, contacts, w.bodies, w.then, chosen, width, span,
                w.pose, memory.scratch, rows.trial)
    # What is left of a step after a collision may be nothing: a gap of rounding over that is no
    # speed.
    closing = min(max(w.number[SPAN], CUT * model.h), model.h)
    w.count[DEEP] = 0
    if _rates(model, shapes, contacts, w.bodies, chosen, width, rows.trial, span, closing, rows.b):
        w.count[DEEP] = 1
    write_rows(model, contacts, w.bodies, chosen, width, COMPLIANCE, rows)
    known = _recall(model, contacts, chosen, width, carried, w.count[KNOWN], rows.f)
    _solve_with_levers(model, m, FEW_STEPS if known else 0, span, w)
    return STUCK if w.number[WORST] > TOLERANCE and m <= FOR_OSQP else DONE


@kernel
def _solve(model: Model, m: int, width: int, steps: int, w: Buffers) -> None:
    """
    Find the forces of the first m points from what stands there, whatever they have to carry.

    Points give way with give f, COMPLIANCE R g below a load of R times a body's weight. Where that
    is more than TOLERANCE it is taken back from b, which leaves give (f - f') with the forces f'
    of the time before (the proximal point algorithm: Rockafellar, Monotone operators and the
    proximal point algorithm, SIAM J. Control Optim. 14 (1976)).
    """
    rows, size = w.rows, 0.0
    for i in range(width * m):
        size = max(size, abs(rows.b[i]))
    w.number[WORST] = solve_rows(rows, m, width, w.count[TOUCHED], steps, _effort_left(model, w),
                                 w.newton)
    for _ in range(AGAIN):
        yields = 0.0
        for i in range(width * m):
            yields = max(yields, abs(rows.give[i] * rows.f[i] - w.eased[i]))
        if yields <= TOLERANCE * size:
            return
        for i in range(width * m):
            now = rows.give[i] * rows.f[i]
            rows.b[i] -= now - w.eased[i]
            w.eased[i] = now
        w.number[WORST] = solve_rows(rows, m, width, w.count[TOUCHED], FEW_STEPS,
                                     _effort_left(model, w), w.newton)


@kernel
def _solve_with_levers(model: Model, m: int, steps: int, span: float, w: Buffers) -> None:
    """
    Find the forces with the levers that bodies have which move under them.

    Both forces of a pair act at one point only with the levers of where the centres really are in
    the middle of the span. A shift after the forces are known would be a torque that nothing
    balances: below a load of R times its weight a light body would turn by R times as much.
    """
    rows, width = w.rows, w.count[WIDTH]
    for c in range(m):
        for side in range(2):
            for i in range(3):
                w.assumed[rows.body[c, side], i] = 0.0
    w.eased[:width * m] = 0.0
    _solve(model, m, width, steps, w)
    for _ in range(AGAIN):
        apply_forces(rows, m, width, rows.f)
        if not shift_levers(model, w.contacts, w.bodies, w.chosen[:m], rows.z, span, w.assumed):
            return
        write_rows(model, w.contacts, w.bodies, w.chosen[:m], width, COMPLIANCE, rows)
        _solve(model, m, width, FEW_STEPS, w)


@kernel
def _settle(model: Model, state: State, settings: EventSettings, shapes: Shapes,
            w: Buffers) -> None:
    """See to it that the forces that were found do no work, and that overlaps end."""
    m, width, rows = w.count[CHOSEN], w.count[WIDTH], w.rows
    if m == 0:
        return
    span = min(w.number[SPAN], w.number[LEFT])
    w.number[RESIDUAL] = max(w.number[RESIDUAL], w.number[WORST])
    if w.number[WORST] > TOLERANCE:
        w.count[UNSOLVED] += 1
        for c in range(m):
            read_rates(model, w.contacts, w.bodies.velocity, w.chosen[c], width, rows.trial,
                       width * c)
        _take_no_energy(rows, m, width, span)
    if w.count[DEEP] == 1:
        closing = min(max(w.number[SPAN], CUT * model.h), model.h)
        _push_apart(model, state, shapes, settings, m, span, closing, w)


@kernel
def _take_no_energy(rows: Rows, m: int, width: int, span: float) -> None:
    """
    Make forces that are no solution smaller where they would do work on the bodies.

    It is span [s] times f . (u_0 + u_1) / 2 with the rates u_0 of the points now, in rows.trial,
    and u_1 = span (A f + b) in the end.
    """
    violation(rows, m, width, rows.f)
    before, gain = 0.0, 0.0
    for i in range(width * m):
        before += rows.f[i] * (rows.trial[i] + span * rows.b[i])
        gain += rows.f[i] * span * (rows.a[i] - rows.b[i])
    if before + gain > 0.0 and gain > 0.0:
        share = max(-before / gain, 0.0)
        for i in range(width * m):
            rows.f[i] *= share


@kernel
def _travel(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, memory: Memory,
            settings: EventSettings, w: Buffers) -> int:
    """Let the forces act until the next pair meets, or the span is over."""
    m, width = w.count[CHOSEN], w.count[WIDTH]
    chosen, f, loads = w.chosen[:m], w.rows.f[:width * m], w.work.loads
    left = w.number[LEFT]
    until = min(w.number[SPAN], left)
    load(model, w.contacts, chosen, width, f, w.loads, w.work)
    t, which = until, -1
    if w.count[CUT_SHORT] == 0:
        w.newton.effort[0] += PER_EVENT
        count = pairs_ahead(model, state, loads, shapes, until, w.pose, w.reach[0], w.reach[1],
                            w.sweep, w.pairs)
        if count > w.pairs.shape[0]:
            w.count[NEEDED] = count
            sum_loads(model, state, wrenches, loads)
            return MORE_PAIRS
        w.newton.effort[0] += PER_PAIR * count
        if w.number[RESIDUAL] > ROUGH:  # shorter spans would not help
            w.depth[:m] = -np.inf
        _allow(w.pairs, count, w.contacts, chosen, w.depth, w.allowed)
        t, which = first_event(model, state, loads, shapes, w.pairs, count, w.allowed,
                               settings.overlap, until, w.pose, memory.scratch)
    for c in range(m):
        for i in range(width):
            w.impulses[chosen[c], i] += t * f[width * c + i]
    _record(model, current(memory), w.contacts, w.impulses)
    if w.count[PUSHED] == 0:
        w.rows.trial[:width * m] = 0.0
    move(model, state, wrenches, w.contacts, w.bodies, chosen, width, f, w.rows.trial, w.loads,
         w.work, w.assumed, until, t)
    _take_back(model, state, w)
    w.number[LEFT] = left - t if which >= 0 or t < left else 0.0
    _next_span(model, t, which, w)
    return DONE


@kernel
def _next_span(model: Model, t: float, which: int, w: Buffers) -> None:
    """
    Choose for how long the next forces are to act.

    A point that sinks in under its force shows that its motion curves more within the span than
    the force can know. The span is then cut to the time for which it was right, and doubled again
    when nothing happens in it.
    """
    if which < 0:
        w.number[SPAN] = 2.0 * w.number[SPAN]
        return
    w.count[EVENTS] += 1
    if w.allowed[which] < 0.0:
        w.number[SPAN] = max(t, SHORTEST * model.h)


@kernel
def run(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, materials: Materials,
        memory: Memory, settings: EventSettings, carried: Carried, w: Buffers) -> int:
    """Run through the circle until no steps are left; return DONE, or what is needed first."""
    while w.count[STEPS] > 0:
        if w.count[STAGE] == MEET:
            if w.number[LEFT] == 0.0:
                begin_kinematic(model, state)
                _begin_step(model, materials, w)
            sum_loads(model, state, wrenches, w.work.loads)
            read_bodies(model, state, w.work.loads.F, w.work.loads.tau, w.bodies)
            why = _find(model, state, shapes, materials, memory, settings, w)
            if why != DONE:
                return why
            why = _collide(model, state, settings, w)
            if why != DONE:
                return why
            w.count[STAGE] = REST
        if w.count[STAGE] == REST:
            if w.contacts.count[0] > carried.feature.shape[0]:
                w.count[NEEDED] = w.contacts.count[0]
                return MORE_FORCES
            why = _balance(model, state, shapes, memory, settings, carried, w)
            if why in (DONE, STUCK):
                w.count[STAGE] = SETTLE
            if why != DONE:
                return why
        if w.count[STAGE] == SETTLE:
            _settle(model, state, settings, shapes, w)
            w.count[STAGE] = TRAVEL
        m, width = w.count[CHOSEN], w.count[WIDTH]
        why = _travel(model, state, wrenches, shapes, memory, settings, w)
        if why != DONE:
            return why
        _remember(model, w.contacts, w.chosen[:m], width, w.rows.f[:width * m], carried)
        w.count[KNOWN] = m
        w.count[STAGE] = MEET
        if w.number[LEFT] == 0.0:
            end_kinematic(model, state)
            count_down(wrenches)
            w.count[STEPS] -= 1
    return DONE


@kernel
def _begin_step(model: Model, materials: Materials, w: Buffers) -> None:
    w.number[LEFT], w.number[SPAN] = model.h, model.h
    w.number[RESIDUAL], w.number[DEEPEST] = 0.0, 0.0
    w.count[FRESH] = 1
    w.count[EVENTS], w.count[COLLISIONS], w.count[CUT_SHORT], w.count[BOUNCED] = 0, 0, 0, 0
    w.count[UNSOLVED] = 0
    w.newton.effort[0] = 0.0
    w.count[WIDTH] = row_count(materials)


@kernel
def touching_points(settings: EventSettings, w: Buffers) -> int:
    """Choose all points that touch, for a shock; return how many."""
    m = 0
    for k in range(w.contacts.count[0]):
        if w.contacts.gap[k] <= settings.touching * w.contacts.size[k]:
            w.chosen[m] = k
            m += 1
    return m


@kernel
def _stop_together(model: Model, state: State, settings: EventSettings, w: Buffers) -> None:
    """End a shock that goes to and fro for ever: all points at once, with e = 0."""
    m, width, rows = touching_points(settings, w), w.count[WIDTH], w.rows
    w.count[TOUCHED] = number_bodies(w.contacts, w.chosen[:m], model.inv_m, w.newton.slot)
    write_rows(model, w.contacts, w.bodies, w.chosen[:m], width, COMPLIANCE, rows)
    for c in range(m):
        read_rates(model, w.contacts, w.bodies.velocity, w.chosen[c], width, rows.b, width * c)
    for i in range(width * m):
        rows.f[i], w.eased[i] = 0.0, 0.0
    _solve(model, m, width, 0, w)
    w.number[RESIDUAL] = max(w.number[RESIDUAL], w.number[WORST])
    if w.number[WORST] > TOLERANCE:
        w.count[UNSOLVED] += 1
        for i in range(width * m):
            rows.trial[i] = rows.b[i]
        _take_no_energy(rows, m, width, 1.0)
    for c in range(m):
        push_rows(model, state, w.contacts, w.chosen[c], width, rows.f, width * c)
        for i in range(width):
            w.impulses[w.chosen[c], i] += rows.f[width * c + i]
    read_bodies(model, state, w.work.loads.F, w.work.loads.tau, w.bodies)
