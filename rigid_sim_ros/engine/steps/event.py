# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Contact model `event`: the classic algorithm, event by event.

"current state, compute new state, detect collisions and backtrack, collision state, compute and
apply impulses, post-collision state, compute and apply constraint forces, next state" (Meyer,
Rigid Body Dynamics, "Simulation Algorithm"). The contact forces of the present state act on the
way to the new one, so a step runs through that circle from the impulses on: impulses, forces, new
state, backtrack, and again from the collision until the step is over. Each group of bodies that
may meet within the step (groups.py) goes through it by itself. The circle is compiled
(loop.py) and comes back here for memory, and for OSQP.

Points of contact by the rate u_n of their gap: colliding below -resting_speed (impulse.py),
separating above 0 where the force law leaves them alone, resting between. Rules that make bodies
come to rest:

- A rebound that would be over within a step is none: the impulse has e = 0 there.
- Two bodies that collided more than `max_bounces` times in one step do so with e = 0 for its rest.
- A point as high above the surface as such a rebound would rise rests too, once it is that slow:
  the force lets it sink to the surface.

Rules that bound what a step may take, and what it may do then:

- After `max_events` of a group, or a budget of work, the rest of its step runs without
  backtracking.
- Forces and impulses of a problem that is not solved by then are used as far as they came, smaller
  where they would do work on the bodies, and the report says so.
- What overlaps is displaced, by a share of the overlap in each step, and gains no velocity.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.carried_forces import Carried, more_forces, no_forces
from rigid_sim_ros.engine.contact.coulomb import coefficients
from rigid_sim_ros.engine.contact.impulse import make_room
from rigid_sim_ros.engine.contact.resting_qp import effective_mass, search, soften
from rigid_sim_ros.engine.detection.manifolds import grown, Memory
from rigid_sim_ros.engine.dynamics.wrenches import Wrenches
from rigid_sim_ros.engine.events.buffers import (
    BEGIN, CHOSEN, COLLISIONS, CUT_SHORT, DEEPEST, DONE, EVENTS, EventSettings, KNOWN,
    make_buffers, MORE_CONTACTS, more_contacts, MORE_MANIFOLDS, more_manifolds, MORE_MEMORY,
    MORE_PAIRS, more_pairs, MORE_ROOM, MORE_ROWS, more_rows, NEEDED, RESIDUAL, STAGE, STEPS, STUCK,
    TOUCHED, UNSOLVED, WIDTH, WORST)
from rigid_sim_ros.engine.events.loop import run
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.state.state import State


class EventReport(NamedTuple):
    """What the latest step did."""

    contacts: int  # points of contact at the end
    events: int  # times at which the step was interrupted
    collisions: int  # of pairs of bodies
    deepest: float  # [m] the deepest overlap that was met during the step, >= 0
    residual: float  # the largest, relative to the accelerations (coulomb.residual)
    unsolved: int  # problems of contact whose conditions could not be met to the tolerance
    cut_short: bool  # more than `max_events`: part of the step ran without backtracking


class EventWork:
    """Scratch memory, and the arrays that carry over from step to step."""

    def __init__(self, bodies: int, shapes: int) -> None:
        """Make room for a world without contacts."""
        self.buffers = make_buffers(bodies, shapes)
        self.forces: Carried = no_forces()  # with room to spare: `known` rows are in use
        self.report = EventReport(0, 0, 0, 0.0, 0.0, 0, False)

    @property
    def carried(self) -> Carried:
        """All that influences later steps, besides the state: the forces of the last one."""
        known = int(self.buffers.count[KNOWN])
        return Carried._make(field[:known] for field in self.forces)

    @carried.setter
    def carried(self, forces: Carried) -> None:
        self.forces = forces
        self.buffers.count[KNOWN] = len(forces.feature)


class _Help:
    """What the kernel asks for."""

    def __init__(self, model: Model, memory: Memory, work: EventWork) -> None:
        self.model, self.memory, self.work = model, memory, work

    def give(self, why: int) -> None:
        """Do what the kernel stopped for."""
        work, needed = self.work, int(self.work.buffers.count[NEEDED])
        if why == MORE_MEMORY:
            self.memory = grown(self.memory)
        elif why == MORE_CONTACTS:
            work.buffers = more_contacts(work.buffers, needed)
        elif why == MORE_MANIFOLDS:
            work.buffers = more_manifolds(work.buffers, needed)
        elif why == MORE_ROOM:
            work.buffers = work.buffers._replace(room=make_room(2 * needed, 6))
        elif why == MORE_ROWS:
            work.buffers = more_rows(work.buffers, needed, int(work.buffers.count[TOUCHED]))
        elif why == MORE_PAIRS:
            work.buffers = more_pairs(work.buffers, needed)
        elif why == STUCK:
            self._search()
        else:
            work.forces = more_forces(work.forces, needed)
            before = more_forces(work.buffers.forces_before, needed)
            work.buffers = work.buffers._replace(forces_before=before)

    def _search(self) -> None:
        """Find the resting forces by OSQP, from those that were found."""
        w = self.work.buffers
        m, width = int(w.count[CHOSEN]), int(w.count[WIDTH])
        rows = width * m
        A = np.zeros((rows, rows))
        effective_mass(self.model, w.contacts, w.bodies, w.chosen, m, width,
                       np.zeros((2, rows, 3)), A)
        mu = np.ascontiguousarray(w.rows.mu[:m, :coefficients(width)])
        f, outcome = search(soften(A), w.rows.b[:rows], mu, w.rows.f[:rows].copy())
        if outcome.residual < w.number[WORST]:
            w.rows.f[:rows] = f
            w.number[WORST] = outcome.residual

    def report(self) -> EventReport:
        """Return what the latest step did."""
        w = self.work.buffers
        return EventReport(int(w.contacts.count[0]), int(w.count[EVENTS]),
                           int(w.count[COLLISIONS]), float(w.number[DEEPEST]),
                           float(w.number[RESIDUAL]), int(w.count[UNSOLVED]),
                           bool(w.count[CUT_SHORT]))


def advance(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, materials: Materials,
            memory: Memory, settings: EventSettings, work: EventWork, count: int) -> Memory:
    """
    Advance all bodies by `count` steps, in place; return the memory, which may have grown.

    work.report says how the last step went, and `work.carried` together with the state is all that
    the next step depends on.
    """
    if count <= 0:
        return memory
    helper = _Help(model, memory, work)
    work.buffers.count[STEPS], work.buffers.count[STAGE] = count, BEGIN
    while (why := run(model, state, wrenches, shapes, materials, helper.memory, settings,
                      work.forces, work.buffers)) != DONE:
        helper.give(why)
    work.report = helper.report()
    return helper.memory
