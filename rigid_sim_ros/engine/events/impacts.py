# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What touches now in the model `event`, and the impulses of what collides."""

import numpy as np

from rigid_sim_ros.engine.contact.classify import STILL
from rigid_sim_ros.engine.contact.contact_newton import number_bodies
from rigid_sim_ros.engine.contact.contact_rows import write_rows
from rigid_sim_ros.engine.contact.contact_search import (
    DONE, find_manifolds, MORE_CONTACTS, MORE_MANIFOLDS)
from rigid_sim_ros.engine.contact.contacts import (
    Contacts, gather_by_key, push_rows, read_body, read_rates)
from rigid_sim_ros.engine.contact.coulomb import COMPLIANCE, TOLERANCE
from rigid_sim_ros.engine.contact.impulse import collide_all, collides
from rigid_sim_ros.engine.contact.recorded_impulses import forget_all_impulses
from rigid_sim_ros.engine.contact.spare_points import mark_spare
from rigid_sim_ros.engine.detection.manifolds import current, Manifolds
from rigid_sim_ros.engine.events.buffers import (
    Buffers, EventArguments, EventSettings, MORE_ROOM, MORE_ROWS)
from rigid_sim_ros.engine.events.groups import Groups, NO_IMPULSES
from rigid_sim_ros.engine.events.resting_forces import end_short, room_for, solve, take_no_energy
from rigid_sim_ros.engine.maths.algebra import norm
from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.kernel import kernel

# In multiplications, see resting_forces.EFFORT: what an event takes, and for each pair that may
# meet, or that collides.
PER_EVENT, PER_PAIR = 1e4, 5e3


@kernel
def look_near(c: EventArguments) -> None:
    """
    Let detection find what touches, or is as near as a rebound that is too short to be one.

    A share of both shapes: that of a plane, which has no size, is its partner's.
    """
    model, shapes, loads, memory = c.model, c.shapes, c.buffers.work.loads, c.memory
    h = model.h
    s = 0
    while s < shapes.kind.shape[0]:
        i, size = shapes.body[s], shapes.bound[s]
        pull = model.inv_m[i] * norm((loads.F[0, i], loads.F[1, i], loads.F[2, i]))
        if size == np.inf:
            size = 0.0
        margin = 1.01 * (c.settings.touching * size
                         + 0.25 * h * (0.5 * h * pull + STILL * size / h))
        # Those of what nothing pushes are always the same.
        if shapes.still[s] == 1 and memory.margin[s] == margin:
            s = shapes.after[s]
            continue
        memory.margin[s] = margin
        s += 1
    memory.rest_margin[:] = np.inf  # no pair is looked at farther ahead than it touches


@kernel
def find_points(c: EventArguments) -> int:
    """Find the points that touch, or are as near as a rebound that is too short to be one."""
    state, w = c.state, c.buffers
    why, rows = find_manifolds(c.model, state, c.shapes, c.memory, w.order)
    if why != DONE:
        w.now.needed[0] = rows
        return why
    manifolds = current(c.memory)
    _sort_by_group(manifolds, w.groups, state.x.shape[1], w.order[0])
    found = gather_by_key(state, manifolds, c.shapes, c.materials, np.inf, w.order[0, :rows],
                          w.order[1, :rows], w.contacts)
    if found > w.contacts.gap.shape[0]:
        w.now.needed[0] = found
        return MORE_CONTACTS
    _list_blocks(w)
    # Both are scratch here.
    mark_spare(c.shapes, w.contacts, c.settings.touching, w.push, w.chosen)
    largest = 0
    for k in range(w.contacts.count[1]):
        borne = 0
        for i in range(w.contacts.first[k], w.contacts.first[k + 1]):
            borne += 1 - w.contacts.spare[i]
        largest = max(largest, borne)
    w.now.needed[0] = largest
    if largest > w.room.chosen.shape[0]:
        return MORE_ROOM
    w.now.needed[0] = w.now.bounced[0] + w.contacts.count[1]
    if w.now.needed[0] > w.bounced.shape[0]:
        return MORE_MANIFOLDS
    if w.now.forgets[0] == 1:
        forget_all_impulses(manifolds)
        w.now.forgets[0] = 0
    w.now.deepest[0] = max(w.now.deepest[0], _deepest(manifolds))
    return DONE


@kernel
def _sort_by_group(manifolds: Manifolds, groups: Groups, n: int, key: IntArray) -> None:
    """Write keys that sort manifolds by group and pair of bodies; -1: of two groups, or none."""
    for k in range(manifolds.count[0]):
        a, b = manifolds.body_a[k], manifolds.body_b[k]
        g = max(groups.of[a], groups.of[b])
        key[k] = -1
        if groups.of[a] in (g, -1) and groups.of[b] in (g, -1) and g >= 0:
            key[k] = (g * n + min(a, b)) * n + max(a, b)


@kernel
def _list_blocks(w: Buffers) -> None:
    """Write which blocks of contacts belong to each group."""
    contacts, groups, k = w.contacts, w.groups, 0
    for g in range(w.now.groups[0]):
        groups.block[g] = k
        while k < contacts.count[1]:
            at = contacts.first[k]
            if max(groups.of[contacts.body_a[at]], groups.of[contacts.body_b[at]]) != g:
                break
            k += 1
        groups.block[g + 1] = k


@kernel
def _deepest(manifolds: Manifolds) -> float:
    deepest = 0.0
    for r in range(manifolds.count[0]):
        for j in range(manifolds.points[r]):
            deepest = max(deepest, -manifolds.gap[j, r])
    return deepest


@kernel
def _bounce(contacts: Contacts, k: int, w: Buffers) -> int:
    """Return the row of `bounced` that belongs to the bodies of block k, after adding it."""
    a, b = contacts.body_a[contacts.first[k]], contacts.body_b[contacts.first[k]]
    for i in range(w.now.bounced[0]):
        if w.bounced[i, 0] == a and w.bounced[i, 1] == b:
            return i
    i = w.now.bounced[0]
    w.bounced[i, 0], w.bounced[i, 1], w.bounced[i, 2] = a, b, 0
    w.now.bounced[0] += 1
    return i


@kernel
def collide_group(c: EventArguments, g: int) -> int:
    """Apply the impulses of all that collides now in a group."""
    model, state, settings, w = c.model, c.state, c.settings, c.buffers
    contacts, groups = w.contacts, w.groups
    first, last = groups.block[g], groups.block[g + 1]
    if first == last:
        return DONE
    w.newton.effort[0] = groups.effort[g] + PER_EVENT
    for k in range(first, last):
        is_inelastic = False
        for i in range(w.now.bounced[0]):
            at = contacts.first[k]
            if (w.bounced[i, 0] == contacts.body_a[at] and w.bounced[i, 1] == contacts.body_b[at]
                    and w.bounced[i, 2] >= settings.max_bounces):
                is_inelastic = True
        for i in range(contacts.first[k], contacts.first[k + 1]):
            w.elastic[i] = 0 if is_inelastic else 1
    limit = 50 + 10 * (last - first)
    quiet = max(STILL / model.h, 2.0 * settings.dip / min(groups.span[g], groups.left[g]))
    if not room_for(model, w, _touching_points(settings, g, w)):
        return MORE_ROWS
    done = collide_all(model, state, contacts, w.bodies, model.h, settings.touching, quiet,
                       w.now.width[0], w.elastic, limit, first, last, w.room, w.impulses)
    if done != 0:
        w.now.collisions[0] += abs(done)
        w.newton.effort[0] += PER_PAIR * abs(done)
        for k in range(first, last):
            pushed = False
            for i in range(contacts.first[k], contacts.first[k + 1]):
                pushed = pushed or w.impulses[i, 0] != 0.0
            if pushed:
                w.bounced[_bounce(contacts, k, w), 2] += 1
        if done < 0:
            _read_group(c, g)
            if not _stop_together(c, g):
                end_short(g, NO_IMPULSES, groups)
        _read_group(c, g)
    groups.effort[g] = w.newton.effort[0]
    return DONE


@kernel
def _read_group(c: EventArguments, g: int) -> None:
    """Read the bodies of a group again."""
    loads, groups, bodies = c.buffers.work.loads, c.buffers.groups, c.buffers.bodies
    for at in range(groups.first[g], groups.first[g + 1]):
        read_body(c.model, c.state, loads.F, loads.tau, groups.body[at], bodies)


@kernel
def _touching_points(settings: EventSettings, g: int, w: Buffers) -> int:
    """Choose all points of a group that touch, for an impact; return how many."""
    m, contacts, block = 0, w.contacts, w.groups.block
    for k in range(contacts.first[block[g]], contacts.first[block[g + 1]]):
        if collides(contacts, settings.touching, k):
            w.chosen[m] = k
            m += 1
    return m


@kernel
def _stop_together(c: EventArguments, g: int) -> bool:
    """
    End an impact that goes to and fro for ever: all points at once, with e = 0.

    Returns whether nothing approaches afterwards; see `solve`.
    """
    model, state, w = c.model, c.state, c.buffers
    m, width, rows = _touching_points(c.settings, g, w), w.now.width[0], w.rows
    w.now.touched[0] = number_bodies(w.contacts, w.chosen[:m], model.inv_m, w.newton.slot)
    write_rows(model, w.contacts, w.bodies, w.chosen[:m], width, COMPLIANCE, rows)
    for n in range(m):
        read_rates(model, w.contacts, w.bodies.velocity, w.chosen[n], width, rows.b, width * n)
    for i in range(width * m):
        rows.f[i], w.proximal[i] = 0.0, 0.0
    stops = solve(c.shapes, m, width, 0, False, 0.0, w)
    w.groups.residual[g] = max(w.groups.residual[g], w.now.worst[0])
    if w.now.worst[0] > TOLERANCE:
        w.now.unsolved[0] += 1
        for i in range(width * m):
            rows.trial[i] = rows.b[i]
        take_no_energy(rows, m, width, 1.0)
    for n in range(m):
        push_rows(model, state, w.contacts, w.chosen[n], width, rows.f, width * n)
        for i in range(width):
            w.impulses[w.chosen[n], i] += rows.f[width * n + i]
    return stops
