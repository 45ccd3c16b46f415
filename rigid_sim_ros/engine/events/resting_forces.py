# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The forces at the resting points of a group, for the time until its next event."""

from rigid_sim_ros.engine.contact.carried_forces import copy_force, keep_force, recall_forces
from rigid_sim_ros.engine.contact.classify import classify, COLLIDING, resting_speed
from rigid_sim_ros.engine.contact.contact_ahead import carry_ahead, turn_bodies
from rigid_sim_ros.engine.contact.contact_newton import (
    FEW_STEPS, NEWTON_STEPS, number_bodies, refine_rows)
from rigid_sim_ros.engine.contact.contact_rows import (
    Rows, sweep_rows, violation, write_effects, write_rows)
from rigid_sim_ros.engine.contact.contact_search import DONE
from rigid_sim_ros.engine.contact.contact_solution import (
    continue_rows, effort_of, move_proximal, solve_contact_rows)
from rigid_sim_ros.engine.contact.contacts import (
    Bodies, Contacts, push_rows, read_rates, relative, to_contact)
from rigid_sim_ros.engine.contact.coulomb import COMPLIANCE, TOLERANCE
from rigid_sim_ros.engine.contact.resting_qp import (
    CLOSING, common_film, LIFTING, resting_rates)
from rigid_sim_ros.engine.events.buffers import (
    BORNE, Buffers, EventArguments, HELD, MORE_ROWS, STUCK)
from rigid_sim_ros.engine.events.groups import (
    Groups, MANY_EVENTS, MUCH_WORK, NO_FORCES, NOTHING, WORKS)
from rigid_sim_ros.engine.events.move import load, shift_levers
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import least_lever, Shapes
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Of a step: gaps are not closed within less, and spans not cut to less since forces do work.
CUT = 1.0 / 16.0
# Multiplications for each body of a group, and for 20 at least, that a step may take, about 0.2
# ms; what is left of the step then runs without backtracking, and contact problems are used as far
# as they came.
EFFORT = 2e5
# Points of a problem that OSQP is asked for where sweeps and Newton's method do not do; for more
# it takes too long.
FOR_OSQP = 8
# A problem counts as so many steps of Newton's method, however many it takes: that may depend on
# rounding, and what is cut short should not. What a hard one takes besides is counted.
COUNTED = 4
# Of the accelerations: as much points may yield to their forces by their compliance. 1e-6 of g
# sinks in by 3e-6 g h^2.
YIELDS = 1e-6
# Levers are right where what they still change is this part of the accelerations: as much as a
# solution may be off.
LEVERS = TOLERANCE
AGAIN = 10  # times at most that forces are found again for their levers, within the budget
ROUNDS = 40  # times at most that they are for what points yield
# What points yield without end falls by less than this part of it in a round.
STUCK_AT = 1e-3
PUSH_SWEEPS = 30  # over the points, for displacements, before Newton's method
UNPUSHED = 1e-3  # of what is wanted: points that lack, or yield by, more cannot be displaced
# Of the energy that the impulses of a span give to what is at rest: forces that do more work than
# this act for too long.
WORK = 0.1


@kernel
def _choose(contacts: Contacts, bodies: Bodies, first: int, last: int, h: float, touching: float,
            chosen: IntArray) -> int:
    """Write which of some points get a force: what touches, and slow ones that nearly do."""
    m = 0
    for k in range(first, last):
        if contacts.spare[k] == 1:
            continue
        slow = resting_speed(contacts, bodies, k, h)
        touch = touching * contacts.size[k]
        if contacts.gap[k] > touch:
            u = to_contact(contacts, k, relative(bodies.velocity, contacts, k))
            # It rises to slow^2 / 2a = slow h / 4 with slow = a h / 2.
            if (contacts.gap[k] > touch + 0.25 * slow * h
                    or classify(u[0], slow) == COLLIDING):
                continue
        chosen[m] = k
        m += 1
    return m


@kernel
def _push_apart(c: EventArguments, m: int, g: int, span: float) -> None:
    """
    Add momenta that displace what overlaps, and are removed when the span is over.

    So nothing that comes apart gains a velocity, however deep it was. The momenta are left in
    `w.push`, and what they are at the bodies in `w.pushed`.
    """
    model, state, w = c.model, c.state, c.buffers
    rows, width, contacts, closing = w.rows, w.now.width[0], w.contacts, _closing(c, g)
    violation(rows, m, width, rows.f)
    fastest = 0.0
    for n in range(m):
        k, at = w.chosen[n], width * n
        depth = common_film(c.shapes, contacts, w.chosen[:m], n) - contacts.gap[k]
        wanted = min(CLOSING * depth / closing,
                     c.settings.push_out * contacts.size[k] / model.h)
        if CLOSING * depth / closing <= LIFTING * resting_speed(contacts, w.bodies, k, model.h):
            wanted = 0.0
        for i in range(at, at + width):
            rows.f[i] = 0.0
        rows.mu[n, 0], rows.mu[n, 1], rows.mu[n, 2] = 0.0, 0.0, 0.0
        # Not what leaves its overlap by itself.
        rows.b[at] = -wanted + span * max(rows.a[at], 0.0)
        fastest = max(fastest, wanted)
    write_effects(rows, m, width, rows.f)
    sweep_rows(rows, m, width, rows.f, PUSH_SWEEPS, 0.0)
    _refine_push(rows, m, width, fastest, w)
    members = w.groups.body[w.groups.first[g]:w.groups.first[g + 1]]
    for j in members:
        for i in range(3):
            w.pushed.F[i, j], w.pushed.tau[i, j] = state.P[i, j], state.L[i, j]
    for n in range(m):
        push_rows(model, state, contacts, w.chosen[n], width, rows.f, width * n)
        for i in range(width):
            w.push[w.chosen[n], i] = rows.f[width * n + i]
    for j in members:
        for i in range(3):
            w.pushed.F[i, j] = state.P[i, j] - w.pushed.F[i, j]
            w.pushed.tau[i, j] = state.L[i, j] - w.pushed.tau[i, j]


@kernel
def _refine_push(rows: Rows, m: int, width: int, fastest: float, w: Buffers) -> None:
    """
    Bring the displacing momenta of the first m points to a solution, if there is one.

    Where bodies that nothing pushes hold one between them there is none: points would yield by as
    much as is wanted of them, `fastest` [m/s], and not by rounding. Then those of the sweeps stay.
    """
    yields = 0.0
    for i in range(width * m):
        w.proximal[i] = rows.f[i]
    worst = refine_rows(rows, m, width, w.now.touched[0], TOLERANCE * fastest, NEWTON_STEPS,
                        w.newton)
    for i in range(width * m):
        yields = max(yields, rows.compliance[i] * rows.f[i])
    for i in range(width * m if max(worst, yields) > UNPUSHED * fastest else 0):
        rows.f[i] = w.proximal[i]


@kernel
def remember(c: EventArguments) -> None:
    """Carry over the forces of the groups that moved, and keep those of the others."""
    model, shapes, carried, w = c.model, c.shapes, c.carried, c.buffers
    contacts, g, width, kept = w.contacts, w.groups, w.now.width[0], 0
    for k in range(w.now.known[0]):
        of = max(g.of[shapes.body[carried.shape_a[k]]], g.of[shapes.body[carried.shape_b[k]]])
        if of >= 0 and g.way[of] == 0.0:
            copy_force(carried, kept, carried, k)
            kept += 1
    for k in range(contacts.count[0]):
        if w.held[k] != HELD:
            continue
        keep_force(model, contacts, k, width, w.force[k], carried, kept)
        kept += 1
    w.now.known[0] = kept


@kernel
def _sink(contacts: Contacts, bodies: Bodies, chosen: IntArray, span: float, overlap: float,
          depth: Array) -> None:
    """
    Write how deep [m, < 0] the points that get forces may go within the span.

    Stopped over the span, not at once, a slow approach u_n gets |u_n| t / 2 deeper.
    """
    for c in range(chosen.shape[0]):
        depth[c] = _depth(contacts, bodies, chosen[c], span, overlap)


@kernel
def _depth(contacts: Contacts, bodies: Bodies, k: int, span: float, overlap: float) -> float:
    """Return how deep [m, < 0] a point may go that is stopped over the span."""
    u = to_contact(contacts, k, relative(bodies.velocity, contacts, k))
    return (min(contacts.gap[k], 0.0) + 0.5 * min(u[0], 0.0) * span
            - overlap * contacts.size[k])


@kernel
def effort_left(w: Buffers, g: int) -> float:
    """Return how many multiplications the rest of the step of a group may take."""
    bodies = w.groups.first[g + 1] - w.groups.first[g]
    return EFFORT * max(20, bodies) - w.newton.effort[0]


@kernel
def room_for(model: Model, w: Buffers, m: int) -> bool:
    """Return whether there is room for the first m chosen points, and number their bodies."""
    w.now.needed[0] = w.now.width[0] * m
    w.now.touched[0] = number_bodies(w.contacts, w.chosen[:m], model.inv_m, w.newton.slot)
    return (w.now.needed[0] <= w.rows.b.shape[0]
            and 6 * w.now.touched[0] <= w.newton.p.shape[0])


@kernel
def solve(shapes: Shapes, m: int, width: int, steps: int, again: bool, span: float,
          w: Buffers) -> bool:
    """
    Find the forces of the first m points from what stands there, whatever they have to carry.

    Points yield by R f, R their compliance: COMPLIANCE k g below k times a body's weight. Where
    that is more than YIELDS it is subtracted from b, which leaves R (f - f') with the forces f' of
    the time before (the proximal point algorithm: Rockafellar, Monotone operators and the proximal
    point algorithm, SIAM J. Control Optim. 14 (1976)). A light body under a load tilts by what is
    left, and is driven aside by a part of the load, so that is to be as much smaller as the load
    would move it in the span, in levers as short as it is thin; 0 s asks for nothing of that.

    `again`: a problem like the one before, of the same points.

    Returns whether there are such forces. Where bodies that nothing pushes close on one between
    them there are none, and each time adds the same to those of the time before, for ever: the
    least change of b with which there were any (Pazy, Asymptotic behavior of contractions in
    Hilbert space, Israel J. Math. 9 (1971)). The first ones let that body go where the points
    yield least, and stay. Where it is no more than YIELDS, redundant points differ in what they
    ask for, as by gaps that rounding leaves to the corners of a box, and the bodies move alike.
    """
    rows, size, last = w.rows, 0.0, 0.0
    for i in range(width * m):
        size = max(size, abs(rows.b[i]))
    w.now.worst[0] = solve_contact_rows(rows, m, width, w.now.touched[0], steps, again,
                                        w.proximal, w.newton, w.interior)
    for _ in range(ROUNDS):
        yields = 0.0
        for i in range(width * m):
            yields = max(yields, abs(rows.compliance[i] * rows.f[i] - w.proximal[i]))
        if (w.now.worst[0] > TOLERANCE
                or yields * max(1.0, _reach(shapes, m, width, span, w)) <= YIELDS * size):
            return True
        if abs(yields - last) < STUCK_AT * yields:
            return yields <= YIELDS * size
        last = yields
        move_proximal(rows, width * m, w.proximal)
        w.now.worst[0] = continue_rows(rows, m, width, w.now.touched[0], w.newton)
    return True


@kernel
def _reach(shapes: Shapes, m: int, width: int, span: float, w: Buffers) -> float:
    """Return how far the force at one point alone would move its bodies in a span, in levers."""
    rows, contacts, reach = w.rows, w.contacts, 0.0
    for c in range(m):
        k, far = w.chosen[c], rows.f[width * c] * rows.stiff[width * c] * span * span
        reach = max(reach, far / least_lever(shapes, contacts.shape_a[k], contacts.shape_b[k]))
    return reach


@kernel
def _solve_with_levers(model: Model, shapes: Shapes, g: int, m: int, steps: int, span: float,
                       w: Buffers) -> bool:
    """
    Find the forces with the levers that bodies have which move under them, if there are any.

    Both forces of a pair act at one point only with the levers of where the centres really are in
    the middle of the span. A shift after the forces are known would be a torque that nothing
    balances: below a load of R times its weight a light body would turn by R times as much.
    """
    rows, width = w.rows, w.now.width[0]
    for c in range(m):
        for side in range(2):
            for i in range(3):
                w.assumed[rows.body[c, side], i] = 0.0
    w.proximal[:width * m] = 0.0
    goal = 0.0
    for i in range(width * m):
        goal = max(goal, LEVERS * abs(rows.b[i]))
    if not solve(shapes, m, width, steps, False, span, w):
        return False
    for _ in range(AGAIN):
        if w.now.worst[0] > TOLERANCE or effort_left(w, g) < 0.0:
            return True
        write_effects(rows, m, width, rows.f)
        if not shift_levers(model, shapes, w.contacts, w.bodies, w.chosen[:m], width, rows, span,
                            goal, w.assumed):
            return True
        write_rows(model, w.contacts, w.bodies, w.chosen[:m], width, COMPLIANCE, rows)
        if not solve(shapes, m, width, FEW_STEPS, True, span, w):
            return False
    return True


@kernel
def balance(c: EventArguments, g: int) -> int:
    """Find the forces at the resting points of a group."""
    model, state, shapes, settings, w = c.model, c.state, c.shapes, c.settings, c.buffers
    contacts, width, groups = w.contacts, w.now.width[0], w.groups
    w.newton.effort[0] = groups.effort[g]
    # Then the forces are to last for the rest of the step, and are found for that.
    if groups.events[g] >= settings.max_events:
        end_short(g, MANY_EVENTS, groups)
    elif effort_left(w, g) < 0.0:
        end_short(g, MUCH_WORK, groups)
    first, last = contacts.first[groups.block[g]], contacts.first[groups.block[g + 1]]
    m = _choose(contacts, w.bodies, first, last, model.h, settings.touching, w.chosen)
    w.now.chosen[0], w.now.is_deep[0] = m, 0
    if not room_for(model, w, m):
        return MORE_ROWS
    if m == 0:
        return DONE
    w.newton.effort[0] += COUNTED * effort_of(m, width, w.now.touched[0])
    chosen, rows = w.chosen[:m], w.rows
    span = min(groups.span[g], groups.left[g])
    _sink(contacts, w.bodies, chosen, span, settings.overlap, w.depth)
    turn_bodies(model, state, w.work.loads.tau, span,
                groups.body[groups.first[g]:groups.first[g + 1]], w.bodies, w.then)
    carry_ahead(model, state, w.still, shapes, contacts, w.bodies, w.then, chosen, width, span,
                w.pose, c.memory.scratch, rows.trial)
    if resting_rates(model, shapes, contacts, w.bodies, chosen, width, rows.trial, span,
                     _closing(c, g), rows.b):
        w.now.is_deep[0] = 1
    write_rows(model, contacts, w.bodies, chosen, width, COMPLIANCE, rows)
    known = recall_forces(model, contacts, chosen, width, c.carried, w.match, rows.f)
    if not _solve_with_levers(model, shapes, g, m, FEW_STEPS if known else 0, span, w):
        end_short(g, NO_FORCES, groups)
    groups.effort[g] = w.newton.effort[0]
    return STUCK if w.now.worst[0] > TOLERANCE and m <= FOR_OSQP else DONE


@kernel
def end_short(g: int, why: int, groups: Groups) -> None:
    """Let the rest of the step of a group run without events; the first reason is kept."""
    groups.short[g] = why if groups.short[g] == 0 else groups.short[g]
    groups.span[g] = groups.left[g]


@kernel
def _closing(c: EventArguments, g: int) -> float:
    """
    Return the time [s] in which gaps of a group are closed in part.

    What is left of a step after a collision may be nothing: a gap of rounding over that is no
    speed.
    """
    return min(max(c.buffers.groups.span[g], CUT * c.model.h), c.model.h)


@kernel
def settle(c: EventArguments, g: int) -> None:
    """
    See to it that the forces that were found do no work, and that overlaps end.

    The forces are then left in `w.force`, and what they are at the bodies in `w.loads`. None are
    left where they are to be found again for a shorter span; `Groups.met` then is WORKS.
    """
    model, w = c.model, c.buffers
    m, width, rows, groups = w.now.chosen[0], w.now.width[0], w.rows, w.groups
    groups.met[g] = NOTHING
    if m == 0:
        return
    span = min(groups.span[g], groups.left[g])
    works, share = _work(c, m, span)
    if works and groups.short[g] == 0 and span > CUT * model.h:
        groups.met[g], groups.span[g] = WORKS, 0.5 * span
        return
    for i in range(width * m if works else 0):
        rows.f[i] *= share
    groups.residual[g] = max(groups.residual[g], w.now.worst[0])
    if w.now.worst[0] > TOLERANCE:
        w.now.unsolved[0] += 1
        for n in range(m):
            read_rates(model, w.contacts, w.bodies.velocity, w.chosen[n], width, rows.trial,
                       width * n)
        take_no_energy(rows, m, width, span)
    for i in range(width * m):
        rows.f[i] *= groups.share[g]
    for n in range(m):
        k = w.chosen[n]
        w.held[k], w.sunk[k] = HELD, w.depth[n]
        for i in range(width):
            w.force[k, i] = rows.f[width * n + i]
    contacts = w.contacts
    for k in range(contacts.first[groups.block[g]], contacts.first[groups.block[g + 1]]):
        if contacts.spare[k] == 1:
            w.held[k] = BORNE
            w.sunk[k] = _depth(contacts, w.bodies, k, span, c.settings.overlap)
    load(model, w.contacts, w.chosen[:m], width, w.force, w.loads)
    if w.now.is_deep[0] == 1:
        _push_apart(c, m, g, span)


@kernel
def _work(c: EventArguments, m: int, span: float) -> tuple[bool, float]:
    """
    Return whether the forces of the first m points do work within a span [s], and what part not.

    The work of a point is span f . G_m (v_0 + v_1) / 2, see contact_ahead.py; along the normal a
    rigid contact does none that is positive. Where the place of contact runs along a body, as
    around the rim of a disk that is about to lie flat, or where a point that leaves would come
    back within the span, G_m is not that of the whole span: the work is then of third order in
    the span. What lifts an overlap, or is left of having lifted it, has a rate below that of
    LIFTING.
    """
    w, rows, width = c.buffers, c.buffers.rows, c.buffers.now.width[0]
    write_effects(rows, m, width, rows.f)
    work, scale, without, by_forces = 0.0, 0.0, 0.0, 0.0
    for n in range(m):
        i, k = width * n, w.chosen[n]
        lifts = LIFTING * resting_speed(w.contacts, w.bodies, k, c.model.h)
        before, gain = _mean_rates(rows, w.bodies, w.then, n, i, span)
        without += rows.f[i] * before
        by_forces += rows.f[i] * gain
        work += rows.f[i] * max(before + gain - lifts, 0.0)
        scale += rows.stiff[i] * rows.f[i] * rows.f[i] * span
    if work <= WORK * scale or without + by_forces <= 0.0:
        return False, 1.0
    return True, -without / by_forces if without < 0.0 else 0.0


@kernel
def _mean_rates(rows: Rows, bodies: Bodies, then: Array, n: int, i: int,
                span: float) -> tuple[float, float]:
    """
    Return the mean of the rates of row i, of point n, at the start and the end of a span.

    Without the forces, and what these add to it.
    """
    before, gain = 0.0, 0.0
    for side in range(2):
        body = rows.body[n, side]
        for j in range(6):
            G = 0.5 * rows.G[i, 6 * side + j]
            before += G * (bodies.velocity[body, j] + then[body, j]
                           + span * bodies.acceleration[body, j])
            gain += G * span * rows.z[body, j]
    return before, gain


@kernel
def take_no_energy(rows: Rows, m: int, width: int, span: float) -> None:
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
