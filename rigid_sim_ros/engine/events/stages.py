# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The stages of the model `event`, in the order in which steps/event.py goes through them.

All groups of bodies (groups.py) that have not come to the end of the step go through the circle
side by side, each at its own time: what touches is found for all at once, and all move at once.

Each stage says which one follows it, and returns DONE or what it needs before it can go on: a
buffer that has to grow, or a small contact problem that only OSQP can solve.
"""

from rigid_sim_ros.engine.contact.carried_forces import copy_forces, match_forces
from rigid_sim_ros.engine.contact.contact_search import DONE
from rigid_sim_ros.engine.contact.contacts import Contacts, read_bodies, row_count
from rigid_sim_ros.engine.contact.recorded_impulses import record
from rigid_sim_ros.engine.detection.backtrack import deepest, first_passage
from rigid_sim_ros.engine.detection.first_event import first_event
from rigid_sim_ros.engine.detection.manifolds import current
from rigid_sim_ros.engine.dynamics.integrate import sum_loads
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic
from rigid_sim_ros.engine.dynamics.wrenches import count_down
from rigid_sim_ros.engine.events.buffers import (
    Buffers, EventArguments, HELD, MORE_FORCES, MORE_PAIRS, STUCK)
from rigid_sim_ros.engine.events.contact_work import take_back
from rigid_sim_ros.engine.events.groups import (
    find_groups, keep_groups, may_go, MET, near_pairs, note_way, NOTHING, reach_out, SANK,
    SHORTEST, WORKS)
from rigid_sim_ros.engine.events.impacts import (
    collide_group, find_points, look_near, PER_EVENT, PER_PAIR)
from rigid_sim_ros.engine.events.move import move
from rigid_sim_ros.engine.events.progress import (
    BEGIN, CONTACTS, FORCES, GROUP, IMPULSES, MOVE, SETTLE)
from rigid_sim_ros.engine.events.resting_forces import balance, remember, settle
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.state import copy_into
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.kernel import kernel

# Forces that violate the laws by more than this part of the accelerations are not looked at for
# how deep bodies get under them.
ROUGH = 1e-4


@kernel
def begin_step(c: EventArguments) -> int:
    """Begin a step: keep the state and the forces, to which it goes back if it begins anew."""
    w, known = c.buffers, c.buffers.now.known[0]
    if known > w.forces_before.feature.shape[0]:
        w.now.needed[0] = known
        return MORE_FORCES
    begin_kinematic(c.model, c.state)
    copy_into(w.before, c.state)
    copy_forces(w.forces_before, c.carried, known)
    w.now.known_before[0], w.now.tries[0] = known, 0
    w.now.width[0] = row_count(c.materials)
    w.now.stage[0] = GROUP
    return DONE


@kernel
def group_bodies(c: EventArguments) -> int:
    """Find the groups of the step, and put all of them at its start."""
    model, state, shapes, w = c.model, c.state, c.shapes, c.buffers
    sum_loads(model, state, c.wrenches, w.work.loads)
    look_near(c)
    reach_out(model, state, w.work.loads, shapes, c.memory.margin, w.now.tries[0], w.pose,
              w.groups)
    groups, pairs = find_groups(model, state, shapes, w.pose, w.pairs, w.groups)
    if pairs > w.pairs.shape[0]:
        w.now.needed[0] = pairs
        return MORE_PAIRS
    w.now.groups[0] = groups
    for g in range(groups):
        w.groups.left[g] = w.groups.span[g] = model.h
        w.groups.effort[g] = w.groups.residual[g] = 0.0
        w.groups.share[g] = 1.0
        w.groups.events[g] = w.groups.short[g] = 0
    w.now.deepest[0] = 0.0
    w.now.forgets[0] = 1
    w.now.collisions[0], w.now.bounced[0], w.now.unsolved[0] = 0, 0, 0
    w.now.stage[0] = CONTACTS
    return DONE


@kernel
def find_contacts(c: EventArguments) -> int:
    """Find what touches now, in all groups."""
    model, state, carried, w = c.model, c.state, c.carried, c.buffers
    sum_loads(model, state, c.wrenches, w.work.loads)
    read_bodies(model, state, w.work.loads.F, w.work.loads.tau, w.bodies)
    why = find_points(c)
    if why != DONE:
        return why
    points = w.contacts.count[0]
    if points + w.now.known[0] > carried.feature.shape[0]:
        w.now.needed[0] = points + w.now.known[0]
        return MORE_FORCES
    match_forces(w.contacts, carried, w.now.known[0], w.match)
    w.held[:points] = 0
    for field in (w.impulses, w.force, w.push):
        field[:points] = 0.0
    for loads in (w.loads, w.pushed):
        loads.F[:] = 0.0
        loads.tau[:] = 0.0
    for i in range(model.m.shape[0]):
        for k in range(6):
            w.then[i, k] = w.bodies.velocity[i, k]
    w.now.stage[0], w.now.group[0] = IMPULSES, 0
    return DONE


@kernel
def apply_impulses(c: EventArguments) -> int:
    """Apply the impulses of all that collides now."""
    w = c.buffers
    for g in range(w.now.group[0], w.now.groups[0]):
        w.now.group[0] = g
        if w.groups.left[g] > 0.0:
            why = collide_group(c, g)
            if why != DONE:
                return why
    w.now.stage[0], w.now.group[0] = FORCES, 0
    return DONE


@kernel
def find_forces(c: EventArguments) -> int:
    """Find the forces at the resting points of all groups."""
    w = c.buffers
    for g in range(w.now.group[0], w.now.groups[0]):
        w.now.group[0] = g
        if w.groups.left[g] == 0.0:
            continue
        if w.now.stage[0] == FORCES:
            why = balance(c, g)
            if why == STUCK:
                w.now.stage[0] = SETTLE
            if why != DONE:
                return why
        settle(c, g)
        w.now.stage[0] = FORCES
    w.now.stage[0] = MOVE
    return DONE


@kernel
def move_bodies(c: EventArguments) -> int:
    """Let the forces act in each group until its next pair meets, or its span is over."""
    _add_contact_loads(c)
    while not _may_go(c):
        if not keep_groups(c.model, c.state, c.buffers.work.loads, c.shapes,
                           c.buffers.now.groups[0], c.buffers.pose, c.buffers.pairs,
                           c.buffers.groups):
            _begin_anew(c)
            return DONE
    _backtrack(c)
    _go(c)
    remember(c)
    if _has_ended(c):
        end_step(c)
    else:
        c.buffers.now.stage[0] = CONTACTS
    return DONE


@kernel
def _add_contact_loads(c: EventArguments) -> None:
    loads, w = c.buffers.work.loads, c.buffers
    for j in range(c.model.m.shape[0]):
        for i in range(3):
            loads.F[i, j] += w.loads.F[i, j]
            loads.tau[i, j] += w.loads.tau[i, j]


@kernel
def _may_go(c: EventArguments) -> bool:
    """Return whether no shape goes farther than was thought when the groups were made."""
    w, groups, within = c.buffers, c.buffers.groups, True
    for g in range(w.now.groups[0]):
        if groups.left[g] > 0.0:
            until = min(groups.span[g], groups.left[g])
            within &= may_go(c.model, c.state, w.work.loads, c.shapes, g, until, groups)
    return within


@kernel
def _begin_anew(c: EventArguments) -> None:
    """Go back to the start of the step, for other groups."""
    w = c.buffers
    copy_into(c.state, w.before)
    copy_forces(c.carried, w.forces_before, w.now.known_before[0])
    w.now.known[0] = w.now.known_before[0]
    w.now.tries[0] += 1
    w.now.stage[0] = GROUP


@kernel
def _backtrack(c: EventArguments) -> None:
    """Find for how long each group may move: until a pair meets, or the end of its span."""
    w, groups = c.buffers, c.buffers.groups
    for g in range(w.now.groups[0]):
        groups.way[g] = 0.0
        if groups.left[g] > 0.0:
            _find_way(c, g)
            note_way(c.model, c.state, w.work.loads, c.shapes, g, groups.way[g], groups)


@kernel
def _find_way(c: EventArguments, g: int) -> None:
    """Find how long the forces of a group act, and what ends that."""
    shapes, memory, w = c.shapes, c.memory, c.buffers
    groups, contacts = w.groups, w.contacts
    if groups.met[g] == WORKS:
        groups.way[g] = 0.0
        return
    until = min(groups.span[g], groups.left[g])
    groups.way[g] = until
    first, last = contacts.first[groups.block[g]], contacts.first[groups.block[g + 1]]
    count = near_pairs(shapes, g, memory.pose, memory.box, groups, w.pairs)
    groups.effort[g] += PER_EVENT + PER_PAIR * count
    if groups.short[g] != 0:
        t, which = first_passage(c.model, c.state, w.work.loads, shapes, w.pairs, count, until,
                                 w.pose, memory.scratch)
        groups.way[g], groups.met[g] = t, MET if which >= 0 else NOTHING
        return
    if groups.residual[g] > ROUGH:  # shorter spans would not help
        _let_sink(shapes, contacts, first, last, w.sunk)
    _allow(w, count, first, last)
    t, which = first_event(c.model, c.state, w.work.loads, shapes, w.pairs, count, w.allowed,
                           c.settings.overlap, until, w.pose, memory.scratch)
    groups.way[g] = t
    if which >= 0:
        groups.met[g] = SANK if w.allowed[which] < 0.0 else MET


@kernel
def _let_sink(shapes: Shapes, contacts: Contacts, first: int, last: int, sunk: Array) -> None:
    """Let points sink in as deep as they may under any force, so that none gets through."""
    for k in range(first, last):
        sunk[k] = deepest(shapes, contacts.shape_a[k], contacts.shape_b[k], contacts.gap[k])


@kernel
def _allow(w: Buffers, count: int, first: int, last: int) -> None:
    """
    Write how deep the pairs that get forces may go, 0 for the others; see `first_event`.

    Of the first `count` pairs, whose points of contact are those from first to last.
    """
    pairs, contacts, allowed = w.pairs, w.contacts, w.allowed
    allowed[:count] = 0.0
    p = 0
    for k in range(first, last):
        if w.held[k] == 0:
            continue
        for _ in range(count):
            if pairs[p, 0] == contacts.shape_a[k] and pairs[p, 1] == contacts.shape_b[k]:
                allowed[p] = min(allowed[p], w.sunk[k])
                break
            p = (p + 1) % count


@kernel
def _go(c: EventArguments) -> None:
    """
    Move the bodies of each group as far as it may go, and record what acts meanwhile.

    What is moved by a twist of its own goes all of its way, also where its group ends short.
    """
    model, w, groups = c.model, c.buffers, c.buffers.groups
    for i in range(model.m.shape[0]):
        g = groups.of[i]
        w.times[i] = groups.way[g] if g >= 0 else 0.0
        if g >= 0 and groups.short[g] != 0 and model.inv_m[i] == 0.0:
            w.times[i] = groups.left[g]
    copy_into(w.here, c.state)
    move(c)
    take_back(c)
    _add_impulses(model, w)
    record(model, current(c.memory), w.contacts, w.impulses)


@kernel
def _add_impulses(model: Model, w: Buffers) -> None:
    """Add what the forces give in the time for which they act."""
    for k in range(w.contacts.count[0]):
        if w.held[k] == HELD:
            a, b = w.contacts.body_a[k], w.contacts.body_b[k]
            t = w.times[a] if model.inv_m[a] > 0.0 else w.times[b]
            for i in range(w.now.width[0]):
                w.impulses[k, i] += t * w.force[k, i]


@kernel
def _has_ended(c: EventArguments) -> bool:
    """Take the ways of the groups from what is left of the step; return whether it is over."""
    w, groups, over = c.buffers, c.buffers.groups, True
    for g in range(w.now.groups[0]):
        if groups.left[g] > 0.0:
            t = groups.way[g]
            # What is left where a group that has spent its budget might get through is lost.
            ends = (groups.met[g] == NOTHING and t == groups.left[g]) or (
                groups.short[g] != 0 and groups.met[g] != WORKS)
            groups.left[g] = 0.0 if ends else groups.left[g] - t
            _next_span(c.model, g, w)
        over = over and groups.left[g] == 0.0
    return over


@kernel
def _next_span(model: Model, g: int, w: Buffers) -> None:
    """
    Choose for how long the next forces of a group are to act.

    A point that sinks in under its force shows that its motion curves more within the span than
    the force can know. The span is then cut to the time for which it was right, and doubled again
    when nothing happens in it.
    """
    groups = w.groups
    if groups.met[g] == NOTHING:
        groups.span[g] = 2.0 * groups.span[g]
    else:
        groups.events[g] += 1
        if groups.met[g] == SANK:
            groups.span[g] = max(groups.way[g], SHORTEST * model.h)


@kernel
def end_step(c: EventArguments) -> None:
    """End a step, and sum up what happened in it."""
    w, groups = c.buffers, c.buffers.groups
    end_kinematic(c.model, c.state)
    count_down(c.wrenches)
    w.now.events[0] = w.now.cut_short[0] = 0
    w.now.residual[0] = 0.0
    for g in range(w.now.groups[0]):
        w.now.events[0] += groups.events[g]
        w.now.cut_short[0] = max(w.now.cut_short[0], groups.short[g])
        w.now.residual[0] = max(w.now.residual[0], groups.residual[g])
    w.now.steps_left[0] -= 1
    w.now.stage[0] = BEGIN
