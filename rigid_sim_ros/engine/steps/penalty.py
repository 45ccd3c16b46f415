# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Contact model `penalty`: a spring and a damper at each point where bodies overlap.

The force law is that of penalty_force.py. A step is kick, drift, kick, with forces at both ends.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.contacts import (
    Bodies, Contacts, gather, make_bodies, make_contacts, read_velocity, to_world)
from rigid_sim_ros.engine.contact.penalty_force import penalty_forces, PenaltySettings
from rigid_sim_ros.engine.contact.recorded_impulses import forget_impulses
from rigid_sim_ros.engine.detection.detect import detect_ahead
from rigid_sim_ros.engine.detection.manifold_rows import find_anew
from rigid_sim_ros.engine.detection.manifolds import current, grown, Manifolds, Memory
from rigid_sim_ros.engine.dynamics.free_flight import fly
from rigid_sim_ros.engine.dynamics.integrate import kick_by_change, make_work, sum_loads, Work
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic, move_kinematic
from rigid_sim_ros.engine.dynamics.loads import empty_loads, kick, Loads
from rigid_sim_ros.engine.dynamics.wrenches import count_down, Wrenches
from rigid_sim_ros.engine.maths.algebra import quaternion, rotate, row
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Of a shape's size: so far detection looks ahead of its surface; only overlap gives a force, so it
# may be tiny.
MARGIN = 1e-9


class Bristles(NamedTuple):
    """The bristles of the points that touched last."""

    shape_a: IntArray  # (c,)
    shape_b: IntArray  # (c,)
    feature: IntArray  # (c,)
    stretch: Array  # (c, 3) [m] of B over A, axes of C of body A, with which they turn


class Buffers(NamedTuple):
    """Memory of the kernel, and where it stands; capacity c points."""

    count: IntArray  # type: ignore[assignment]  # (5,) see STEPS
    work: Work
    bodies: Bodies
    loads: Loads
    order: IntArray  # (2, rows of the memory) for `gather`
    contacts: Contacts
    impulses: Array  # (c, 3) [N, contact axes] on B
    stretch: Array  # (c, 3) [m, world axes]
    bristles: Bristles  # (c,) of the end of the last step, or of the middle of this one


# Places in `Buffers.count`.
STEPS, STAGE, KNOWN, NEEDED = range(4)
# Stages of a step, and why the kernel stops.
BEGIN, END = range(2)
DONE, MORE_MEMORY, MORE_MANIFOLDS, MORE_CONTACTS = range(4)


class PenaltyWork:
    """The buffers of the kernel, and the bristles, which carry over from step to step."""

    def __init__(self, bodies: int) -> None:
        """Make room for a world without contacts."""
        c = 64
        self.buffers = Buffers(np.zeros(5, dtype=np.int64), make_work(bodies), make_bodies(bodies),
                               empty_loads(bodies), np.zeros((2, c), dtype=np.int64),
                               make_contacts(c), np.zeros((c, 3)), np.zeros((c, 3)),
                               _longer(no_bristles(), c))

    @property
    def bristles(self) -> Bristles:
        """Return all that influences later steps, besides the state."""
        known = int(self.buffers.count[KNOWN])
        return Bristles._make(field[:known].copy() for field in self.buffers.bristles)

    @bristles.setter
    def bristles(self, kept: Bristles) -> None:
        room = len(self.buffers.bristles.feature)
        self.buffers = self.buffers._replace(bristles=_longer(kept, room))
        self.buffers.count[KNOWN] = len(kept.feature)

    def lasting(self) -> Bristles:
        """Return all that influences later steps, besides the state."""
        return self.bristles

    def give(self, why: int) -> None:
        """Make the room that the kernel stopped for."""
        w, c = self.buffers, 2 * int(self.buffers.count[NEEDED])
        if why == MORE_MANIFOLDS:
            self.buffers = w._replace(order=np.zeros((2, c), dtype=np.int64))
        else:
            self.buffers = w._replace(contacts=make_contacts(c), impulses=np.zeros((c, 3)),
                                      stretch=np.zeros((c, 3)), bristles=_longer(w.bristles, c))


def _longer(bristles: Bristles, rows: int) -> Bristles:
    """Return bristles with room for so many rows, or as many as there are."""
    found = []
    for field in bristles:
        room = np.zeros((max(rows, len(field)), *field.shape[1:]), dtype=field.dtype)
        room[:len(field)] = field
        found.append(room)
    return Bristles._make(found)


def no_bristles() -> Bristles:
    """Return the bristles of a world in which nothing touches."""
    none = np.zeros(0, dtype=np.int64)
    return Bristles(none, none, none, np.zeros((0, 3)))


@kernel
def _recall(contacts: Contacts, state: State, bristles: Bristles, size: int,
            stretch: Array) -> None:
    """Write the stretches of points that were there before, world axes, 0 for the others."""
    at = 0
    for k in range(contacts.count[0]):
        for i in range(3):
            stretch[k, i] = 0.0
        for tried in range(size):
            j = (at + tried) % size
            if (bristles.shape_a[j] == contacts.shape_a[k]
                    and bristles.shape_b[j] == contacts.shape_b[k]
                    and bristles.feature[j] == contacts.feature[k]):
                s = rotate(quaternion(state.q, contacts.body_a[k]), row(bristles.stretch, j))
                for i in range(3):
                    stretch[k, i] = s[i]
                at = j + 1
                break


@kernel
def _keep(contacts: Contacts, state: State, world: Array, bristles: Bristles) -> None:
    """Write the bristles of all points, turned into the axes of A."""
    for k in range(contacts.count[0]):
        bristles.shape_a[k], bristles.shape_b[k] = contacts.shape_a[k], contacts.shape_b[k]
        bristles.feature[k] = contacts.feature[k]
        q = quaternion(state.q, contacts.body_a[k])
        s = rotate((-q[0], -q[1], -q[2], q[3]), row(world, k))
        for i in range(3):
            bristles.stretch[k, i] = s[i]


@kernel
def record(manifolds: Manifolds, contacts: Contacts, forces: Array, t: float) -> None:
    """Add what the forces of the points give in t [s] to the impulses of the manifolds."""
    for k in range(contacts.count[0]):
        r = contacts.manifold[k]
        for j in range(manifolds.points[r]):
            if manifolds.feature[j, r] == contacts.feature[k]:
                manifolds.impulse[j, r] += t * forces[k, 0]
        rubbing = to_world(contacts, k, (0.0, t * forces[k, 1], t * forces[k, 2]))
        for i in range(3):
            manifolds.friction[r, i] += rubbing[i]


@kernel
def _velocities(model: Model, state: State, bodies: Bodies) -> None:
    # Whose twist is over stands still; in the second half of a step that is nobody.
    begin_kinematic(model, state)
    for i in range(model.m.shape[0]):
        read_velocity(model, state, i, bodies)


@kernel
def _drift(model: Model, state: State, wrenches: Wrenches, work: Work) -> None:
    """Half a kick of the loads other than contact, and the drift of a whole step."""
    sum_loads(model, state, wrenches, work.loads)
    kick(state, work.loads, 0.5 * model.h)
    fly(model, state, (0.0, 0.0, 0.0), model.h, np.int64(1), work.block)
    move_kinematic(model, state, model.h)


@kernel
def _last_kick(model: Model, state: State, wrenches: Wrenches, work: Work) -> None:
    """Kick by the other half, with the loads at the new pose; see `integrate.symplectic`."""
    kick(state, work.loads, 0.5 * model.h)
    sum_loads(model, state, wrenches, work.later)
    kick_by_change(state, work.loads, work.later, model.h)
    end_kinematic(model, state)
    count_down(wrenches)


@kernel
def find_overlaps(model: Model, state: State, shapes: Shapes, materials: Materials, memory: Memory,
                  w: Buffers) -> int:
    """Find the points that overlap; return DONE, or what is needed first."""
    find_anew(current(memory))
    for s in range(shapes.bound.shape[0]):
        memory.ahead[s] = MARGIN * shapes.bound[s] if shapes.bound[s] < np.inf else 0.0
    memory.calm[0] = np.inf
    if not detect_ahead(model, state, shapes, memory, None):
        return MORE_MEMORY
    manifolds = current(memory)
    rows = manifolds.count[0]
    w.count[NEEDED] = rows
    if rows > w.order.shape[1]:
        return MORE_MANIFOLDS
    found = gather(state, manifolds, shapes, materials, 0.0, w.order[0, :rows], w.order[1, :rows],
                   w.contacts)
    w.count[NEEDED] = max(found, w.count[KNOWN])
    if w.count[NEEDED] > w.contacts.gap.shape[0]:
        return MORE_CONTACTS
    _velocities(model, state, w.bodies)
    return DONE


@kernel
def push(model: Model, state: State, shapes: Shapes, materials: Materials,
         settings: PenaltySettings, t: float, h: float, w: Buffers) -> None:
    """Kick by h [s] of the forces of all points, after a slip of t [s]; keep bristles."""
    _recall(w.contacts, state, w.bristles, w.count[KNOWN], w.stretch)
    penalty_forces(model, state, shapes, materials, settings, w.contacts, w.bodies, w.stretch, t,
                   w.loads, w.impulses)
    _keep(w.contacts, state, w.stretch, w.bristles)
    w.count[KNOWN] = w.contacts.count[0]
    kick(state, w.loads, h)


@kernel
def run(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, materials: Materials,
        memory: Memory, settings: PenaltySettings, w: Buffers) -> int:
    """Step until no steps are left; return DONE, or what is needed first."""
    while w.count[STEPS] > 0:
        why = find_overlaps(model, state, shapes, materials, memory, w)
        if why != DONE:
            return why
        if w.count[STAGE] == BEGIN:
            push(model, state, shapes, materials, settings, 0.0, 0.5 * model.h, w)
            _drift(model, state, wrenches, w.work)
            w.count[STAGE] = END
        else:
            push(model, state, shapes, materials, settings, model.h, 0.5 * model.h, w)
            _last_kick(model, state, wrenches, w.work)
            forget_impulses(current(memory))
            record(current(memory), w.contacts, w.impulses, model.h)
            w.count[STAGE] = BEGIN
            w.count[STEPS] -= 1
    return DONE


def advance(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, materials: Materials,
            memory: Memory, settings: PenaltySettings, work: PenaltyWork, count: int) -> Memory:
    """
    Advance all bodies by `count` steps, in place; return the memory, which may have grown.

    Kick, drift, kick: order 2 while the points stay the same. work.bristles together with the
    state is all that the next step depends on.
    """
    work.buffers.count[STEPS] = count
    while (why := run(model, state, wrenches, shapes, materials, memory, settings,
                      work.buffers)) != DONE:
        if why == MORE_MEMORY:
            memory = grown(memory)
        else:
            work.give(why)
    return memory
