# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Contact model `penalty`: a spring and a damper at each point where bodies overlap.

The force law is that of penalty_force.py. A step is kick, drift, kick, with forces at both ends.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.basis import Basis
from rigid_sim_ros.engine.contact.carried_forces import longer, match_forces
from rigid_sim_ros.engine.contact.contact_search import (
    DONE, find_points, MORE_CONTACTS, MORE_MANIFOLDS, MORE_MEMORY)
from rigid_sim_ros.engine.contact.contacts import (
    Bodies, Contacts, make_bodies, make_contacts, read_velocity, to_world)
from rigid_sim_ros.engine.contact.penalty_force import penalty_forces, PenaltySettings
from rigid_sim_ros.engine.contact.recorded_impulses import forget_all_impulses
from rigid_sim_ros.engine.detection.manifolds import current, grown, Memory, point_of_feature
from rigid_sim_ros.engine.dynamics.force_and_torque import empty_loads, kick, Loads
from rigid_sim_ros.engine.dynamics.free_flight import fly
from rigid_sim_ros.engine.dynamics.integrate import kick_by_change, make_work, sum_loads, Work
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic, move_kinematic
from rigid_sim_ros.engine.dynamics.wrenches import count_down, Wrenches
from rigid_sim_ros.engine.maths.algebra import quaternion, rotate, row
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.argument_pack import ArgumentPack, packed
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
    """
    Memory of the kernel, and how far a step has come; capacity c points.

    A step that needs a larger buffer returns to Python and goes on with the same stage.
    """

    steps_left: IntArray  # (1,)
    stage: IntArray  # (1,) of a step
    known: IntArray  # (1,) bristles in use
    needed: IntArray  # (1,) what there has to be room for
    work: Work
    bodies: Bodies
    loads: Loads
    order: IntArray  # (2, rows of the memory) for `gather`
    contacts: Contacts
    forces: Array  # (c, 3) [N, contact axes] on B
    stretch: Array  # (c, 3) [m, world axes]
    match: IntArray  # (c,) which of the bristles each point has, -1: none
    bristles: Bristles  # (c,) of the end of the last step, or of the middle of this one


class PenaltyArguments(NamedTuple):
    """What the kernels of a step read and write."""

    model: Model
    state: State
    wrenches: Wrenches
    shapes: Shapes
    materials: Materials
    memory: Memory
    settings: PenaltySettings
    buffers: Buffers


# Stages of a step.
BEGIN, END = range(2)


@kernel
def run(c: PenaltyArguments) -> int:
    """Take steps until none are left; return DONE, or what is needed before they go on."""
    while c.buffers.steps_left[0] > 0:
        if c.buffers.stage[0] == BEGIN:
            begin_kinematic(c.model, c.state)
        why = find_overlaps(c)
        if why != DONE:
            return why
        if c.buffers.stage[0] == BEGIN:
            take_first_half(c)
        else:
            take_second_half(c)
    return DONE


@kernel
def take_first_half(c: PenaltyArguments) -> None:
    """Kick by half of the loads, and drift by a whole step."""
    loads = c.buffers.work.loads
    push(c, 0.0, 0.5 * c.model.h)
    sum_loads(c.model, c.state, c.wrenches, loads)
    kick(c.state, loads, 0.5 * c.model.h)
    fly(c.model, c.state, (0.0, 0.0, 0.0), c.model.h, np.int64(1), c.buffers.work.block)
    move_kinematic(c.model, c.state, c.model.h)
    c.buffers.stage[0] = END


@kernel
def take_second_half(c: PenaltyArguments) -> None:
    """Kick by the other half, with the loads at the new poses; see `integrate.symplectic`."""
    work = c.buffers.work
    push(c, c.model.h, 0.5 * c.model.h)
    kick(c.state, work.loads, 0.5 * c.model.h)
    sum_loads(c.model, c.state, c.wrenches, work.later)
    kick_by_change(c.state, work.loads, work.later, c.model.h)
    end_kinematic(c.model, c.state)
    count_down(c.wrenches)
    forget_all_impulses(current(c.memory))
    record(c, c.model.h)
    c.buffers.stage[0] = BEGIN
    c.buffers.steps_left[0] -= 1


@kernel
def find_overlaps(c: PenaltyArguments) -> int:
    """Find the points that overlap, and how bodies move; return DONE, or what is needed first."""
    shapes, memory, w = c.shapes, c.memory, c.buffers
    for s in range(shapes.bound.shape[0]):
        memory.margin[s] = MARGIN * shapes.bound[s] if shapes.bound[s] < np.inf else 0.0
    memory.rest_margin[:] = np.inf
    why, w.needed[0] = find_points(c.model, c.state, shapes, c.materials, memory, 0.0, w.order,
                                   w.contacts)
    if why != DONE:
        return why
    w.needed[0] = max(w.needed[0], w.known[0])
    if w.needed[0] > w.contacts.gap.shape[0]:
        return MORE_CONTACTS
    for i in range(c.model.m.shape[0]):
        read_velocity(c.model, c.state, i, w.bodies)
    return DONE


@kernel
def push(c: PenaltyArguments, t: float, h: float) -> None:
    """Kick by h [s] of the forces of all points, after a slip of t [s]; keep bristles."""
    w = c.buffers
    match_forces(w.contacts, w.bristles, w.known[0], w.match)
    _recall(w.contacts, c.state, w.bristles, w.match, w.stretch)
    penalty_forces(c.model, c.state, c.shapes, c.materials, c.settings, w.contacts, w.bodies,
                   w.stretch, t, w.loads, w.forces)
    _keep(w.contacts, c.state, w.stretch, w.bristles)
    w.known[0] = w.contacts.count[0]
    kick(c.state, w.loads, h)


@kernel
def _recall(contacts: Contacts, state: State, bristles: Bristles, match: IntArray,
            stretch: Array) -> None:
    """Write the stretches of points that were there before, world axes, 0 for the others."""
    for k in range(contacts.count[0]):
        s = (0.0, 0.0, 0.0)
        if match[k] >= 0:
            s = rotate(quaternion(state.q, contacts.body_a[k]), row(bristles.stretch, match[k]))
        for i in range(3):
            stretch[k, i] = s[i]


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
def record(c: PenaltyArguments, t: float) -> None:
    """Add what the forces of the points give in t [s] to the impulses of the manifolds."""
    manifolds, contacts, forces = current(c.memory), c.buffers.contacts, c.buffers.forces
    for k in range(contacts.count[0]):
        r = contacts.manifold[k]
        p = point_of_feature(manifolds, r, contacts.feature[k])
        if p >= 0:
            manifolds.impulse[p, r] += t * forces[k, 0]
        rubbing = to_world(contacts, k, (0.0, t * forces[k, 1], t * forces[k, 2]))
        for i in range(3):
            manifolds.friction[r, i] += rubbing[i]


def _longer(bristles: Bristles, rows: int) -> Bristles:
    """Return bristles with room for so many rows, or as many as there are."""
    return Bristles._make(longer(field, rows) for field in bristles)


def no_bristles() -> Bristles:
    """Return the bristles of a world in which nothing touches."""
    none = np.zeros(0, dtype=np.int64)
    return Bristles(none, none, none, np.zeros((0, 3)))


def make_arguments(basis: Basis) -> PenaltyArguments:
    """Return the arguments of a world with buffers of their own, and no bristles."""
    n, c = len(basis.model.m), 64
    left, stage, known, needed = np.zeros((4, 1), dtype=np.int64)
    buffers = Buffers(
        left, stage, known, needed, make_work(n), make_bodies(n), empty_loads(n),
        np.zeros((2, c), dtype=np.int64), make_contacts(c), np.zeros((c, 3)), np.zeros((c, 3)),
        np.zeros(c, dtype=np.int64), _longer(no_bristles(), c))
    return PenaltyArguments(*basis, PenaltySettings(), buffers)


def with_room(c: PenaltyArguments, why: int) -> PenaltyArguments:
    """Return arguments with the room that a kernel stopped for."""
    w, rows = c.buffers, 2 * int(c.buffers.needed[0])
    if why == MORE_MEMORY:
        return c._replace(memory=grown(c.memory))
    if why == MORE_MANIFOLDS:
        return c._replace(buffers=w._replace(order=np.zeros((2, rows), dtype=np.int64)))
    return c._replace(buffers=w._replace(
        contacts=make_contacts(rows), forces=np.zeros((rows, 3)), stretch=np.zeros((rows, 3)),
        match=np.zeros(rows, dtype=np.int64), bristles=_longer(w.bristles, rows)))


def carried_over(c: PenaltyArguments) -> Bristles:
    """Return all that influences later steps, besides the state."""
    known = int(c.buffers.known[0])
    return Bristles._make(field[:known].copy() for field in c.buffers.bristles)


def with_carried(c: PenaltyArguments, bristles: Bristles) -> PenaltyArguments:
    """Return arguments that go on with these bristles."""
    c.buffers.known[0] = len(bristles.feature)
    room = len(c.buffers.bristles.feature)
    return c._replace(buffers=c.buffers._replace(bristles=_longer(bristles, room)))


def advance(c: PenaltyArguments, count: int,
            pack: ArgumentPack | None) -> tuple[PenaltyArguments, ArgumentPack]:
    """
    Advance the state by `count` steps; return the arguments, whose buffers may have grown.

    Kick, drift, kick: order 2 while the points stay the same. The pack that is returned is for the
    next call. `carried_over` together with the state is all that the next step depends on.
    """
    c.buffers.steps_left[0] = count
    while True:
        pack = packed(c, pack)
        why = pack.run(run)
        if why == DONE:
            return c, pack
        c = with_room(c, why)
