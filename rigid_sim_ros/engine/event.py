# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Contact model `event`: the classic algorithm, event by event.

"current state, compute new state, detect collisions and backtrack, collision state, compute and
apply impulses, post-collision state, compute and apply constraint forces, next state" (Meyer,
Rigid Body Dynamics, "Simulation Algorithm"). The contact forces of the present state act on the
way to the new one, so a step runs through that circle from the impulses on: impulses, forces, new
state, backtrack, and again from the collision until the step is over. The circle itself is
compiled (event_loop.py) and comes back here for memory, and for OSQP.

Points of contact by the rate u_n of their gap: colliding below -resting_speed (impulse.py),
separating above 0 where the force law leaves them alone, resting between. Rules that make bodies
come to rest:

- A rebound that would be over within a step is none: the impulse has e = 0 there.
- Two bodies that collided more than `max_bounces` times in one step do so with e = 0 for its rest.
- A point as high above the surface as such a rebound would rise rests too, once it is that slow:
  the force lets it sink to the surface.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array
from rigid_sim_ros.engine.contact_qp import coefficients, Outcome, search, solve
from rigid_sim_ros.engine.event_buffers import (
    Buffers, Carried, CHOSEN, COLLISIONS, CUT_SHORT, DEEPEST, DONE, EVENTS, EventSettings, KNOWN,
    LEFT, longer, make_buffers, MEET, MORE_CONTACTS, more_contacts, MORE_FORCES, MORE_MANIFOLDS,
    more_manifolds, MORE_MEMORY, MORE_PAIRS, more_pairs, MORE_ROOM, MORE_ROWS, more_rows, NEEDED,
    no_forces, RESIDUAL, SHOCK, STAGE, STEPS, TRAVEL, WIDTH)
from rigid_sim_ros.engine.event_loop import push_all, run, shock_problem, touching_points
from rigid_sim_ros.engine.impulse import make_room
from rigid_sim_ros.engine.manifolds import grown, Memory
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.shapes import Materials, Shapes
from rigid_sim_ros.engine.state import State
from rigid_sim_ros.engine.wrenches import Wrenches


class EventReport(NamedTuple):
    """What the latest step did."""

    contacts: int  # points of contact at the end
    events: int  # times at which the step was interrupted
    collisions: int  # of pairs of bodies
    deepest: float  # [m] the deepest overlap that was met during the step, >= 0
    residual: float  # the largest, relative to the accelerations (contact_qp.residual)
    iterations: int  # of OSQP
    unsolved: int  # problems of contact whose conditions could not be met to the tolerance
    status: str  # OSQP's word on the last of them, or ''
    cut_short: bool  # more than `max_events`: part of the step ran without backtracking


class EventWork:
    """Scratch memory, and the arrays that carry over from step to step."""

    def __init__(self, bodies: int, shapes: int) -> None:
        """Make room for a world without contacts."""
        self.buffers = make_buffers(bodies, shapes)
        self.forces: Carried = no_forces()  # with room to spare: `known` rows are in use
        self.report = EventReport(0, 0, 0, 0.0, 0.0, 0, 0, '', False)

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
    """What the kernel asks for; and what OSQP said in the latest step."""

    def __init__(self, model: Model, state: State, settings: EventSettings,
                 memory: Memory, work: EventWork) -> None:
        self.model, self.state, self.settings = model, state, settings
        self.memory, self.work = memory, work
        self.step, self.residual, self.iterations, self.unsolved, self.status = -1, 0.0, 0, 0, ''

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
            work.buffers = more_rows(work.buffers, needed)
        elif why == MORE_PAIRS:
            work.buffers = more_pairs(work.buffers, needed)
        elif why == MORE_FORCES:
            work.forces = Carried._make(longer(field, 2 * needed) for field in work.forces)
        elif why == SHOCK:
            self._stop_together()
        else:
            self._search()

    def _new_step(self) -> None:
        """Forget what OSQP said of an earlier step."""
        step = int(self.work.buffers.count[STEPS])
        if step != self.step:
            self.step, self.residual, self.iterations = step, 0.0, 0
            self.unsolved, self.status = 0, ''

    def _note(self, outcome: Outcome) -> None:
        self._new_step()
        self.residual = max(self.residual, outcome.residual)
        self.iterations += outcome.osqp_iterations
        if not outcome.solved:
            self.unsolved += 1
            self.status = outcome.status

    def _search(self) -> None:
        """Find the resting forces by OSQP, from those of the last step."""
        w = self.work.buffers
        m, rows = int(w.count[CHOSEN]), int(w.count[CHOSEN] * w.count[WIDTH])
        f, outcome = search(w.A[:rows * rows].reshape(rows, rows), w.b[:rows],
                            _coefficients(w, m), w.f[:rows].copy())
        w.f[:rows] = f
        w.count[STAGE] = TRAVEL
        self._note(outcome)

    def _stop_together(self) -> None:
        """End a shock that goes to and fro for ever: all points at once, with e = 0."""
        m = int(touching_points(self.settings, self.work.buffers))
        rows = m * int(self.work.buffers.count[WIDTH])
        if rows > len(self.work.buffers.b):
            self.work.buffers = more_rows(self.work.buffers, rows)
        w = self.work.buffers
        shock_problem(self.model, m, w)
        J, outcome = solve(w.A[:rows * rows].reshape(rows, rows), w.b[:rows],
                           _coefficients(w, m), np.zeros(rows))
        push_all(self.model, self.state, m, J, w)
        self._note(outcome)

    def report(self) -> EventReport:
        """Return what the latest step did."""
        w = self.work.buffers
        if self.step != 1:  # OSQP was asked in the last step when one was left
            self.residual, self.iterations, self.unsolved, self.status = 0.0, 0, 0, ''
        return EventReport(int(w.contacts.count[0]), int(w.count[EVENTS]),
                           int(w.count[COLLISIONS]), float(w.number[DEEPEST]),
                           max(self.residual, float(w.number[RESIDUAL])), self.iterations,
                           self.unsolved, self.status, bool(w.count[CUT_SHORT]))


def _coefficients(w: Buffers, m: int) -> Array:
    columns = int(coefficients(w.count[WIDTH]))
    return w.mu[:m * columns].reshape(m, columns)


def advance(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, materials: Materials,
            memory: Memory, settings: EventSettings, work: EventWork, count: int) -> Memory:
    """
    Advance all bodies by `count` steps, in place; return the memory, which may have grown.

    work.report says how the last step went, and `work.carried` together with the state is all that
    the next step depends on.
    """
    if count <= 0:
        return memory
    helper = _Help(model, state, settings, memory, work)
    work.buffers.count[STEPS], work.buffers.count[STAGE] = count, MEET
    work.buffers.number[LEFT] = 0.0
    while (why := run(model, state, wrenches, shapes, materials, helper.memory, settings,
                      work.forces, work.buffers)) != DONE:
        helper.give(why)
    work.report = helper.report()
    return helper.memory
