# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Memory for the impulses of contact on what joints hold, and what is carried over of them."""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.constraints.articulated_rows import make_system, System
from rigid_sim_ros.engine.contact.carried_forces import Carried, longer, no_forces
from rigid_sim_ros.engine.contact.contacts import Bodies, Contacts, make_bodies, make_contacts
from rigid_sim_ros.engine.contact.recorded_impulses import Acted, nothing_acted
from rigid_sim_ros.engine.dynamics.force_and_torque import empty_loads, Loads
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.kernels.arrays import Array, IntArray


class Counts(NamedTuple):
    """How much of the buffers is in use; each an array of one number."""

    points: IntArray  # that take part
    islands: IntArray
    known: IntArray  # impulses carried over from the step before
    half_known: IntArray  # and from the first half of this part of a step
    width: IntArray  # rows of a point: 3, or 6 where anything resists rolling or spinning
    needed: IntArray  # points, or rows of an island, that there has to be room for
    woken: IntArray  # pairs


class ContactBuffers(NamedTuple):
    """Scratch memory for c points of contact, and the impulses that are carried over."""

    counts: Counts
    contacts: Contacts
    order: IntArray  # (2, rows of the memory) for `gather`
    bodies: Bodies
    match: IntArray  # (c,) the same point among impulses that were found before, or -1
    active: IntArray  # (c,) 1: the point takes part
    woken: IntArray  # (c, 2) pairs of shapes all of whose points take part in this part of a step
    chosen: IntArray  # (c,) points by islands
    pair: IntArray  # (c,) points of two bodies that collide
    first: IntArray  # (c + 1,) of the points of an island
    parent: IntArray  # (n,) sets of bodies that hang together
    held: IntArray  # (n,) 1: the set hangs on, or touches, what nothing pushes
    label: IntArray  # (n,) island of such a set
    impulse: Array  # (c, 6) [N s, contact axes] of half a step
    pushed: Array  # (c, 6) [N s, contact axes] that only displace
    displacing: Loads  # [N s, N m s] what these make of the momenta of the bodies
    approach: Array  # (c,) [m/s] rate of the gap of a point at the start of the step
    bounce: Array  # (c,) [m/s] with which a point comes apart at the end of the step
    work: Array  # (c,) [J] that the impulses of a half did
    foreseen: Array  # (c, 6) [m/s] rates of a point with its impulses, as its joints are foreseen
    brisk: Array  # (c,) [m/s] the largest rate without impulses on the island of a point
    free: Array  # (6 c + k,) [m/s] rates of the rows of an island without impulses
    before: Array  # (6 c + k,) [m/s] rates of the rows of points that collide, before that
    row: Array  # (6 c + k,) scratch
    system: System
    carried: Carried  # of the second half of the step before, (c,)
    half: Carried  # of the first half of this one
    half_bounce: Array  # (c,) of its points
    half_work: Array  # (c,)
    # (n,) [m/s] how much faster bodies are on the way that is tried than they began, and so far
    gained: Array
    sudden: Array
    acted: Acted  # in this step, (c,)
    half_acted: Acted  # in the first half of this part of it, (c,)


def make_buffers(table: JointTable, bodies: int, points: int, manifolds: int,
                 rows: int) -> ContactBuffers:
    """Return room for so many bodies, points, manifolds, and rows of an island."""

    def whole(*shape: int) -> IntArray:
        return np.zeros(shape, dtype=np.int64)

    c, r = points, 6 * points + len(table.translates)
    carried, half = (Carried._make(longer(field, c) for field in no_forces()) for _ in range(2))
    return ContactBuffers(
        Counts(*(whole(1) for _ in Counts._fields)), make_contacts(c), whole(2, manifolds),
        make_bodies(bodies), whole(c), whole(c), whole(c, 2), whole(c), whole(c), whole(c + 1),
        whole(bodies), whole(bodies), whole(bodies),
        np.zeros((c, 6)), np.zeros((c, 6)), empty_loads(bodies), np.zeros(c), np.zeros(c),
        np.zeros(c), np.zeros((c, 6)), np.zeros(c), np.zeros(r), np.zeros(r), np.zeros(r),
        make_system(rows, table, bodies),
        carried, half, np.zeros(c), np.zeros(c), np.zeros(bodies), np.zeros(bodies),
        nothing_acted(c), nothing_acted(c))


def more_points(w: ContactBuffers, table: JointTable, points: int) -> ContactBuffers:
    """Return scratch memory with room for twice as many points, and what is carried over."""
    fresh = make_buffers(table, len(w.parent), 2 * points, w.order.shape[1],
                         len(w.system.rows.at))
    return fresh._replace(
        counts=w.counts, displacing=w.displacing, parent=w.parent, held=w.held, gained=w.gained,
        sudden=w.sudden,
        woken=longer(w.woken, 2 * points),
        carried=_longer(w.carried, 2 * points),
        half=_longer(w.half, 2 * points),
        half_bounce=longer(w.half_bounce, 2 * points),
        half_work=longer(w.half_work, 2 * points),
        acted=_with_room(w.acted, 2 * points),
        half_acted=_with_room(w.half_acted, 2 * points))


def with_carried(w: ContactBuffers, table: JointTable, carried: Carried) -> ContactBuffers:
    """Return scratch memory that begins with these impulses of the step before."""
    known = len(carried.feature)
    w = more_points(w, table, known) if known > len(w.chosen) else w
    w.counts.known[0] = known
    return w._replace(carried=_longer(carried, len(w.chosen)))


def carried_over(w: ContactBuffers) -> Carried:
    """Return the impulses of the latest step from which the next one begins."""
    return Carried._make(field[:w.counts.known[0]].copy() for field in w.carried)


def _longer(carried: Carried, points: int) -> Carried:
    return Carried._make(longer(field, points) for field in carried)


def _with_room(acted: Acted, points: int) -> Acted:
    return Acted(acted.count, *(longer(field, points) for field in acted[1:]))
