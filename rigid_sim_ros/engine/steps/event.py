# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Contact model `event`: the classic algorithm, event by event.

"current state, compute new state, detect collisions and backtrack, collision state, compute and
apply impulses, post-collision state, compute and apply constraint forces, next state" (Meyer,
Rigid Body Dynamics, "Simulation Algorithm"). The contact forces of the present state act on the
way to the new one, so a step runs through that circle from the impulses on: impulses, forces, new
state, backtrack, and again from the collision until the step is over. Each group of bodies that
may meet within the step (events/groups.py) goes through it by itself. The circle is compiled, and
comes back to Python for memory, and for OSQP.

Points of contact by the rate u_n of their gap: colliding below -resting_speed (impulse.py),
separating above 0 where the force law leaves them alone, resting between. Rules that make bodies
come to rest:

- A rebound that would be over within a step is none: the impulse has e = 0 there.
- Two bodies that collided more than `max_bounces` times in one step do so with e = 0 for its rest.
- A point as high above the surface as such a rebound would rise rests too, once it is that slow:
  the force lets it sink to the surface.

Rules that bound what a step may take, and what it may do then:

- After `max_events` of a group, or a budget of work, the rest of its step runs without
  backtracking, and ends where shapes would get through each other.
- Forces and impulses of a problem that is not solved by then are used as far as they came, smaller
  where they would do work on the bodies, and the report says so.
- What overlaps is displaced, by a share of the overlap in each step, and gains no velocity.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.basis import Basis
from rigid_sim_ros.engine.contact.carried_forces import Carried, more_forces, no_forces
from rigid_sim_ros.engine.contact.contact_search import (
    DONE, MORE_CONTACTS, MORE_MANIFOLDS, MORE_MEMORY)
from rigid_sim_ros.engine.contact.coulomb import coefficients
from rigid_sim_ros.engine.contact.impulse import make_room
from rigid_sim_ros.engine.contact.resting_qp import effective_mass, search, soften
from rigid_sim_ros.engine.detection.manifolds import grown
from rigid_sim_ros.engine.events.buffers import (
    EventArguments, EventSettings, make_buffers, more_contacts, more_manifolds, MORE_PAIRS,
    more_pairs, MORE_ROOM, MORE_ROWS, more_rows, STUCK)
from rigid_sim_ros.engine.events.progress import BEGIN, CONTACTS, GROUP, IMPULSES, MOVE
from rigid_sim_ros.engine.events.stages import (
    apply_impulses, begin_step, find_contacts, find_forces, group_bodies, move_bodies)
from rigid_sim_ros.kernels.argument_pack import ArgumentPack, packed
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def run(c: EventArguments) -> int:
    """Take steps until none are left; return DONE, or what is needed before they go on."""
    while c.buffers.now.steps_left[0] > 0:
        why = go_on(c)
        if why != DONE:
            return why
    return DONE


@kernel
def go_on(c: EventArguments) -> int:
    """
    Take the next stage of a step; return DONE, or what is needed before it can be taken.

    From the contacts on it is a circle, until no group has anything left of the step.
    """
    stage = c.buffers.now.stage[0]
    if stage == BEGIN:
        return begin_step(c)
    if stage == GROUP:
        return group_bodies(c)
    if stage == CONTACTS:
        return find_contacts(c)
    if stage == IMPULSES:
        return apply_impulses(c)
    if stage == MOVE:
        return move_bodies(c)
    return find_forces(c)


def advance(c: EventArguments, count: int,
            pack: ArgumentPack | None) -> tuple[EventArguments, ArgumentPack]:
    """
    Advance the state by `count` steps; return the arguments, whose buffers may have grown.

    The pack that is returned is for the next call. `carried_over` together with the state is all
    that the next step depends on.
    """
    c.buffers.now.steps_left[0], c.buffers.now.stage[0] = count, BEGIN
    while True:
        pack = packed(c, pack)
        why = pack.run(run)
        if why == DONE:
            return c, pack
        if why == STUCK:
            _search(c)
        else:
            c = _with_room(c, why)


def make_arguments(basis: Basis) -> EventArguments:
    """Return the arguments of a world with buffers of their own, and no forces to begin from."""
    buffers = make_buffers(len(basis.model.m), len(basis.shapes.body))
    return EventArguments(*basis, EventSettings(), no_forces(), buffers)


def _with_room(c: EventArguments, why: int) -> EventArguments:
    """Return arguments with the room that the kernel stopped for."""
    w, needed = c.buffers, int(c.buffers.now.needed[0])
    if why == MORE_MEMORY:
        return c._replace(memory=grown(c.memory))
    if why == MORE_CONTACTS:
        w = more_contacts(w, needed)
    elif why == MORE_MANIFOLDS:
        w = more_manifolds(w, needed)
    elif why == MORE_ROOM:
        w = w._replace(room=make_room(2 * needed, 6))
    elif why == MORE_ROWS:
        w = more_rows(w, needed, int(w.now.touched[0]))
    elif why == MORE_PAIRS:
        w = more_pairs(w, needed)
    else:
        c = c._replace(carried=more_forces(c.carried, needed))
        w = w._replace(forces_before=more_forces(w.forces_before, needed))
    return c._replace(buffers=w)


def _search(c: EventArguments) -> None:
    """Find the resting forces by OSQP, from those that were found."""
    w = c.buffers
    m, width = int(w.now.chosen[0]), int(w.now.width[0])
    rows = width * m
    A = np.zeros((rows, rows))
    effective_mass(c.model, w.contacts, w.bodies, w.chosen, m, width, np.zeros((2, rows, 3)), A)
    mu = np.ascontiguousarray(w.rows.mu[:m, :coefficients(width)])
    f, outcome = search(soften(A), w.rows.b[:rows], mu, w.rows.f[:rows].copy())
    if outcome.residual < w.now.worst[0]:
        w.rows.f[:rows] = f
        w.now.worst[0] = outcome.residual


def carried_over(c: EventArguments) -> Carried:
    """Return all that influences later steps, besides the state: the forces of the last one."""
    known = int(c.buffers.now.known[0])
    return Carried._make(field[:known] for field in c.carried)


def with_carried(c: EventArguments, forces: Carried) -> EventArguments:
    """Return arguments that go on with these forces."""
    c.buffers.now.known[0] = len(forces.feature)
    return c._replace(carried=forces)


class EventReport(NamedTuple):
    """What the latest step did."""

    contacts: int  # points of contact at the end
    events: int  # times at which the step was interrupted
    collisions: int  # of pairs of bodies
    deepest: float  # [m] the deepest overlap that was met during the step, >= 0
    residual: float  # the largest, relative to the accelerations (resting_qp.Outcome)
    unsolved: int  # problems of contact whose conditions could not be met to the tolerance
    cut_short: int  # why part of the step ran without backtracking, see groups.py; 0: none did


def report(c: EventArguments) -> EventReport:
    """Return what the latest step did."""
    w = c.buffers
    return EventReport(int(w.contacts.count[0]), int(w.now.events[0]), int(w.now.collisions[0]),
                       float(w.now.deepest[0]), float(w.now.residual[0]),
                       int(w.now.unsolved[0]), int(w.now.cut_short[0]))
