# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The circle of the model `event`, compiled: it runs until the steps are done, or needs help.

All groups of bodies (groups.py) that have not come to the end of the step go through it side
by side, each at its own time: what touches is found for all at once, and all move at once.

What needs help is a buffer that has to grow, and a small contact problem that only OSQP can solve.
The kernel then returns the reason; Python does what is asked (event.py) and calls again, and it
goes on from the stage, and the group, at which it stopped.
"""

import numpy as np

from rigid_sim_ros.engine.contact.carried_forces import Carried, copy_forces, match_forces
from rigid_sim_ros.engine.contact.contacts import Contacts, read_bodies, row_count
from rigid_sim_ros.engine.contact.recorded_impulses import record
from rigid_sim_ros.engine.detection.backtrack import first_event
from rigid_sim_ros.engine.detection.manifolds import current, Memory
from rigid_sim_ros.engine.dynamics.integrate import sum_loads
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic
from rigid_sim_ros.engine.dynamics.wrenches import count_down, Wrenches
from rigid_sim_ros.engine.events.buffers import (
    BEGIN, BOUNCED, Buffers, COLLISIONS, CUT_SHORT, DEEPEST, DONE, EVENTS, EventSettings, FRESH,
    GROUP, GROUPS, KNOWN, KNOWN_BEFORE, MEET, MORE_FORCES, MORE_PAIRS, NEEDED, NOW, RESIDUAL,
    REST, SETTLE, SHOCK, STAGE, STEPS, STUCK, TRAVEL, TRIES, UNSOLVED, WIDTH)
from rigid_sim_ros.engine.events.forces import balance, remember, settle
from rigid_sim_ros.engine.events.groups import find_groups, may_go, near_pairs, note_way, reach_out
from rigid_sim_ros.engine.events.move import move
from rigid_sim_ros.engine.events.shock import find, look_near, PER_EVENT, PER_PAIR, shock
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.state.state import copy_into, State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Of a step: no part in which forces stay constant is shorter.
SHORTEST = 1.0 / 256.0
# Forces that violate the laws by more than this part of the accelerations are not looked at for
# how deep bodies get under them.
ROUGH = 1e-4
# How the way of a group ends, in `Groups.met`: nothing met, a pair met, one sank in.
NOTHING, MET, SANK = -1, 0, 1


@kernel
def run(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, materials: Materials,
        memory: Memory, settings: EventSettings, carried: Carried, w: Buffers) -> int:
    """Run through the circle until no steps are left; return DONE, or what is needed first."""
    while w.count[STEPS] > 0:
        stage, why = w.count[STAGE], DONE
        if stage == BEGIN:
            why = _begin(model, state, materials, carried, w)
        elif stage == GROUP:
            why = _group(model, state, wrenches, shapes, settings, memory, w)
        elif stage == MEET:
            why = _meet(model, state, wrenches, shapes, materials, memory, settings, carried, w)
        elif stage == SHOCK:
            why = _shock(model, state, settings, w)
        elif stage in (REST, SETTLE):
            why = _rest(model, state, shapes, memory, settings, carried, w)
        else:
            _travel(model, state, wrenches, shapes, memory, settings, carried, w)
        if why != DONE:
            return why
    return DONE


@kernel
def _begin(model: Model, state: State, materials: Materials, carried: Carried,
           w: Buffers) -> int:
    """Begin a step."""
    known = w.count[KNOWN]
    if known > w.forces_before.feature.shape[0]:
        w.count[NEEDED] = known
        return MORE_FORCES
    begin_kinematic(model, state)
    copy_into(w.before, state)
    copy_forces(w.forces_before, carried, known)
    w.count[KNOWN_BEFORE], w.count[TRIES] = known, 0
    w.count[WIDTH] = row_count(materials)
    w.count[STAGE] = GROUP
    return DONE


@kernel
def _group(model: Model, state: State, wrenches: Wrenches, shapes: Shapes,
           settings: EventSettings, memory: Memory, w: Buffers) -> int:
    """Find the groups of the step, and put all of them at its start."""
    sum_loads(model, state, wrenches, w.work.loads)
    look_near(model, shapes, settings, w.work.loads, memory)
    reach_out(model, state, w.work.loads, shapes, memory.ahead, w.count[TRIES], w.pose, w.groups)
    groups, pairs = find_groups(model, state, shapes, w.pose, w.pairs, w.groups)
    if pairs > w.pairs.shape[0]:
        w.count[NEEDED] = pairs
        return MORE_PAIRS
    w.count[GROUPS] = groups
    for g in range(groups):
        w.groups.left[g] = w.groups.span[g] = model.h
        w.groups.effort[g] = w.groups.residual[g] = 0.0
        w.groups.events[g] = w.groups.short[g] = 0
    w.number[DEEPEST] = 0.0
    w.count[FRESH] = 1
    w.count[COLLISIONS], w.count[BOUNCED], w.count[UNSOLVED] = 0, 0, 0
    w.count[STAGE] = MEET
    return DONE


@kernel
def _meet(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, materials: Materials,
          memory: Memory, settings: EventSettings, carried: Carried, w: Buffers) -> int:
    """Find what touches now, in all groups."""
    sum_loads(model, state, wrenches, w.work.loads)
    read_bodies(model, state, w.work.loads.F, w.work.loads.tau, w.bodies)
    why = find(model, state, shapes, materials, memory, settings, w)
    if why != DONE:
        return why
    points = w.contacts.count[0]
    if points + w.count[KNOWN] > carried.feature.shape[0]:
        w.count[NEEDED] = points + w.count[KNOWN]
        return MORE_FORCES
    match_forces(w.contacts, carried, w.count[KNOWN], w.match)
    w.held[:points] = 0
    for field in (w.impulses, w.force, w.push):
        field[:points] = 0.0
    for loads in (w.loads, w.pushed):
        loads.F[:] = 0.0
        loads.tau[:] = 0.0
    for i in range(model.m.shape[0]):
        for k in range(6):
            w.then[i, k] = w.bodies.velocity[i, k]
    w.count[STAGE], w.count[NOW] = SHOCK, 0
    return DONE


@kernel
def _shock(model: Model, state: State, settings: EventSettings, w: Buffers) -> int:
    """Apply the impulses of all that collides now."""
    for g in range(w.count[NOW], w.count[GROUPS]):
        w.count[NOW] = g
        if w.groups.left[g] > 0.0:
            why = shock(model, state, settings, g, w)
            if why != DONE:
                return why
    w.count[STAGE], w.count[NOW] = REST, 0
    return DONE


@kernel
def _rest(model: Model, state: State, shapes: Shapes, memory: Memory, settings: EventSettings,
          carried: Carried, w: Buffers) -> int:
    """Find the forces at the resting points of all groups."""
    for g in range(w.count[NOW], w.count[GROUPS]):
        w.count[NOW] = g
        if w.groups.left[g] == 0.0:
            continue
        if w.count[STAGE] == REST:
            why = balance(model, state, shapes, memory, settings, carried, g, w)
            if why == STUCK:
                w.count[STAGE] = SETTLE
            if why != DONE:
                return why
        settle(model, state, settings, shapes, g, w)
        w.count[STAGE] = REST
    w.count[STAGE] = TRAVEL
    return DONE


@kernel
def _travel(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, memory: Memory,
            settings: EventSettings, carried: Carried, w: Buffers) -> None:
    """Let the forces act in each group until its next pair meets, or its span is over."""
    loads, groups = w.work.loads, w.groups
    for j in range(model.m.shape[0]):
        for i in range(3):
            loads.F[i, j] += w.loads.F[i, j]
            loads.tau[i, j] += w.loads.tau[i, j]
    if not _may_go(model, state, shapes, w):
        copy_into(state, w.before)
        copy_forces(carried, w.forces_before, w.count[KNOWN_BEFORE])
        w.count[KNOWN] = w.count[KNOWN_BEFORE]
        w.count[TRIES] += 1
        w.count[STAGE] = GROUP
        return
    for g in range(w.count[GROUPS]):
        groups.way[g] = 0.0
        if groups.left[g] > 0.0:
            _look_ahead(model, state, shapes, memory, settings, g, w)
            note_way(model, state, loads, shapes, g, groups.way[g], groups)
    for i in range(model.m.shape[0]):
        w.times[i] = groups.way[groups.of[i]] if groups.of[i] >= 0 else 0.0
    _add_impulses(w)
    record(model, current(memory), w.contacts, w.impulses)
    move(model, state, wrenches, w.contacts, w.bodies, w.force, w.push, w.assumed, groups, w.loads,
         w.pushed, w.times, w.work)
    remember(model, shapes, w, carried)
    over = True
    for g in range(w.count[GROUPS]):
        if groups.left[g] > 0.0:
            t = groups.way[g]
            ends = groups.met[g] == NOTHING and t == groups.left[g]
            groups.left[g] = 0.0 if ends else groups.left[g] - t
            _next_span(model, g, w)
        over = over and groups.left[g] == 0.0
    w.count[STAGE] = MEET
    if over:
        _end(model, state, wrenches, w)


@kernel
def _may_go(model: Model, state: State, shapes: Shapes, w: Buffers) -> bool:
    """Return whether no shape goes farther than was thought when the groups were made."""
    groups, within = w.groups, True
    for g in range(w.count[GROUPS]):
        if groups.left[g] > 0.0 and groups.short[g] == 0:
            until = min(groups.span[g], groups.left[g])
            within &= may_go(model, state, w.work.loads, shapes, g, until, groups)
    return within


@kernel
def _look_ahead(model: Model, state: State, shapes: Shapes, memory: Memory,
                settings: EventSettings, g: int, w: Buffers) -> None:
    """Find how long the forces of a group act, and what ends that."""
    groups, contacts = w.groups, w.contacts
    until = min(groups.span[g], groups.left[g])
    groups.way[g], groups.met[g] = until, NOTHING
    if groups.short[g] == 1:
        return
    first, last = contacts.first[groups.block[g]], contacts.first[groups.block[g + 1]]
    count = near_pairs(shapes, g, memory.pose, groups, w.pairs)
    groups.effort[g] += PER_EVENT + PER_PAIR * count
    if groups.residual[g] > ROUGH:  # shorter spans would not help
        w.sunk[first:last] = -np.inf
    _allow(w.pairs, count, contacts, first, last, w.held, w.sunk, w.allowed)
    t, which = first_event(model, state, w.work.loads, shapes, w.pairs, count, w.allowed,
                           settings.overlap, until, w.pose, memory.scratch)
    groups.way[g] = t
    if which >= 0:
        groups.met[g] = SANK if w.allowed[which] < 0.0 else MET


@kernel
def _allow(pairs: IntArray, count: int, contacts: Contacts, first: int, last: int, held: IntArray,
           sunk: Array, allowed: Array) -> None:
    """Write how deep the pairs that get forces may go, 0 for the others; see `first_event`."""
    allowed[:count] = 0.0
    p = 0
    for k in range(first, last):
        if held[k] == 0:
            continue
        for _ in range(count):
            if pairs[p, 0] == contacts.shape_a[k] and pairs[p, 1] == contacts.shape_b[k]:
                allowed[p] = min(allowed[p], sunk[k])
                break
            p = (p + 1) % count


@kernel
def _add_impulses(w: Buffers) -> None:
    """Add what the forces give in the time for which they act."""
    for k in range(w.contacts.count[0]):
        if w.held[k] == 1:
            t = max(w.times[w.contacts.body_a[k]], w.times[w.contacts.body_b[k]])
            for i in range(w.count[WIDTH]):
                w.impulses[k, i] += t * w.force[k, i]


@kernel
def _next_span(model: Model, g: int, w: Buffers) -> None:
    """
    Choose for how long the next forces of a group are to act.

    A point that sinks in under its force shows that its motion curves more within the span than
    the force can know. The span is then cut to the time for which it was right, and doubled again
    when nothing happens in it.
    """
    groups = w.groups
    if groups.met[g] < 0:
        groups.span[g] = 2.0 * groups.span[g]
    else:
        groups.events[g] += 1
        if groups.met[g] == SANK:
            groups.span[g] = max(groups.way[g], SHORTEST * model.h)


@kernel
def _end(model: Model, state: State, wrenches: Wrenches, w: Buffers) -> None:
    """End a step, and sum up what happened in it."""
    end_kinematic(model, state)
    count_down(wrenches)
    w.count[EVENTS] = w.count[CUT_SHORT] = 0
    w.number[RESIDUAL] = 0.0
    for g in range(w.count[GROUPS]):
        w.count[EVENTS] += w.groups.events[g]
        w.count[CUT_SHORT] = max(w.count[CUT_SHORT], w.groups.short[g])
        w.number[RESIDUAL] = max(w.number[RESIDUAL], w.groups.residual[g])
    w.count[STEPS] -= 1
    w.count[STAGE] = BEGIN
