# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The settings of the model `event`, and the memory of its compiled part."""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.carried_forces import Carried, longer, no_forces
from rigid_sim_ros.engine.contact.contact_newton import make_newton, Newton
from rigid_sim_ros.engine.contact.contact_rows import make_rows, Rows
from rigid_sim_ros.engine.contact.contacts import Bodies, Contacts, make_bodies, make_contacts
from rigid_sim_ros.engine.contact.impulse import make_room, MOST_ALIKE, Room
from rigid_sim_ros.engine.contact.interior_point import Interior, make_interior
from rigid_sim_ros.engine.detection.manifolds import Memory
from rigid_sim_ros.engine.detection.transform_update import unplaced
from rigid_sim_ros.engine.dynamics.force_and_torque import empty_loads, Loads
from rigid_sim_ros.engine.dynamics.integrate import make_work, Work
from rigid_sim_ros.engine.dynamics.wrenches import Wrenches
from rigid_sim_ros.engine.events.groups import Groups, make_groups
from rigid_sim_ros.engine.events.progress import no_progress, Progress
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.state.state import empty_state, State
from rigid_sim_ros.kernels.arrays import Array, IntArray


class EventSettings(NamedTuple):
    """What may be tuned. Lengths are parts of the size of the smaller of two shapes."""

    # Points with a smaller gap touch; far above rounding, far below anything seen
    touching: float = 1e-7
    # By which touching pairs may sink in within a step before it is split
    overlap: float = 1e-6
    # By which a slow approach may sink in while the forces stop it; what is faster is stopped by
    # an impulse. 1e-4 is seen as bodies that dip in when they land, 1e-8: rounding collides.
    dip: float = 2e-6
    # By so much at most overlaps become less in a step
    push_out: float = 0.005
    # In a step; the rest of it then runs without backtracking while nothing gets through, and
    # says so
    max_events: int = 300
    max_bounces: int = 32  # of two bodies in one step, before they collide with e = 0


# Why the kernel stops, besides what contact_search.py says.
MORE_ROOM, MORE_ROWS, MORE_PAIRS, MORE_FORCES, STUCK = range(4, 9)
# Of a point in `Buffers.held`.
HELD, BORNE = 1, 2


class Buffers(NamedTuple):
    """Scratch memory of the kernel, and where it stands; capacities c points, r rows, p pairs."""

    now: Progress
    work: Work
    bodies: Bodies
    then: Array  # (n, 6) velocities at the end of a span
    assumed: Array  # (n, 3) accelerations for which the levers are right
    loads: Loads  # of the contacts
    still: Loads  # zeros
    pose: Array  # (s, 12)
    contacts: Contacts
    order: IntArray  # (2, rows of the memory) for `gather`
    impulses: Array  # (c, 6) [N s, contact axes]
    force: Array  # (c, 6) [N, contact axes]
    push: Array  # (c, 6) [N s, contact axes] that only displaces
    held: IntArray  # (c,) HELD: a point that got a force; BORNE: a spare one, others hold its body
    sunk: Array  # (c,) [m, < 0] how deep it may go
    match: IntArray  # (c,) the same point among the forces of the last step, or -1
    elastic: IntArray  # (c,)
    chosen: IntArray  # (c,) points that get a force
    depth: Array  # (c,) [m, < 0] to which these may go
    bounced: IntArray  # (p, 3) two bodies and how often they collided in this step
    room: Room  # for the largest block
    rows: Rows  # of the chosen points
    proximal: Array  # (r,) rates by the compliance at the proximal point, not in rows.b
    newton: Newton
    interior: Interior
    pushed: Loads  # momenta that only displace, for the time of a span
    pairs: IntArray  # (p, 2) that may meet
    allowed: Array  # (p,)
    groups: Groups
    times: Array  # (n,) [s] how long each body moves now
    before: State  # at the start of the step
    here: State  # at the start of the way
    forces_before: Carried


class EventArguments(NamedTuple):
    """What the kernels of a step read and write."""

    model: Model
    state: State
    wrenches: Wrenches
    shapes: Shapes
    materials: Materials
    memory: Memory
    settings: EventSettings
    carried: Carried  # with room to spare: as many rows are in use as `Progress.known` says
    buffers: Buffers


def make_buffers(bodies: int, shapes: int) -> Buffers:
    """Make room for a world without contacts."""

    def whole(*shape: int) -> IntArray:
        return np.zeros(shape, dtype=np.int64)

    c = 64
    return Buffers(no_progress(), make_work(bodies), make_bodies(bodies),
                   np.zeros((bodies, 6)), np.zeros((bodies, 3)),
                   empty_loads(bodies), empty_loads(bodies), unplaced(shapes),
                   make_contacts(c), whole(2, c), np.zeros((c, 6)), np.zeros((c, 6)),
                   np.zeros((c, 6)), whole(c), np.zeros(c), whole(c), whole(c), whole(c),
                   np.zeros(c),
                   whole(c, 3), make_room(MOST_ALIKE, 6), make_rows(16, 48, bodies), np.zeros(48),
                   make_newton(16, 48, 4, bodies), make_interior(16, 48, 4), empty_loads(bodies),
                   whole(c, 2), np.zeros(c),
                   make_groups(bodies, shapes, c), np.zeros(bodies), empty_state(bodies),
                   empty_state(bodies),
                   no_forces())


def more_contacts(buffers: Buffers, points: int) -> Buffers:
    """Return buffers with room for twice as many points."""
    c = 2 * points
    return buffers._replace(contacts=make_contacts(c), impulses=np.zeros((c, 6)),
                            force=np.zeros((c, 6)), push=np.zeros((c, 6)),
                            held=np.zeros(c, dtype=np.int64), sunk=np.zeros(c),
                            match=np.zeros(c, dtype=np.int64),
                            elastic=np.zeros(c, dtype=np.int64),
                            chosen=np.zeros(c, dtype=np.int64), depth=np.zeros(c))


def more_rows(buffers: Buffers, rows: int, touched: int) -> Buffers:
    """Return buffers with room for a problem with twice as many rows, of so many bodies."""
    r, bodies = max(2 * rows, len(buffers.rows.b)), len(buffers.then)
    s = max(touched + touched // 2, len(buffers.newton.p) // 6)
    return buffers._replace(rows=make_rows(r // 3, r, bodies), proximal=np.zeros(r),
                            newton=make_newton(r // 3, r, s, bodies),
                            interior=make_interior(r // 3, r, s))


def more_pairs(buffers: Buffers, pairs: int) -> Buffers:
    """Return buffers with room for twice as many pairs that may meet."""
    room = np.zeros((2 * pairs, 2), dtype=np.int64)
    return buffers._replace(pairs=room, allowed=np.zeros(2 * pairs),
                            groups=buffers.groups._replace(pair=room.copy()))


def more_manifolds(buffers: Buffers, rows: int) -> Buffers:
    """Return buffers for twice as many manifolds, or pairs of bodies that collided."""
    return buffers._replace(order=np.zeros((2, 2 * rows), dtype=np.int64),
                            bounced=longer(buffers.bounced, 2 * rows))
