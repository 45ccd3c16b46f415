# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What the steps of bodies that joints hold and that touch each other have in common.

Their arguments, how they find the points that touch, what they record of the impulses there, and
what Python does when a kernel stops (jointed_progress.py).
"""

from collections.abc import Callable
import math
from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.constraints.articulated_buffers import ContactBuffers, more_points
from rigid_sim_ros.engine.constraints.articulated_contact import (
    keep_impulses, solve_contacts, undo_displacing)
from rigid_sim_ros.engine.constraints.articulated_points import choose_points
from rigid_sim_ros.engine.constraints.articulated_rows import make_system
from rigid_sim_ros.engine.constraints.foreseen_rates import astray
from rigid_sim_ros.engine.contact.carried_forces import match_forces, recall_forces
from rigid_sim_ros.engine.contact.contact_search import (
    DONE, find_points, MORE_CONTACTS, MORE_MANIFOLDS, MORE_MEMORY)
from rigid_sim_ros.engine.contact.contacts import read_velocity
from rigid_sim_ros.engine.contact.recorded_impulses import (
    forget_all_impulses, note, note_all, record)
from rigid_sim_ros.engine.detection.manifolds import current, grown, Memory, smallest_gap
from rigid_sim_ros.engine.detection.margins import set_margins
from rigid_sim_ros.engine.detection.motion_ahead import approach_bound
from rigid_sim_ros.engine.dynamics.force_and_torque import kick
from rigid_sim_ros.engine.joints.buffers import FORESEEN
from rigid_sim_ros.engine.joints.forward_kinematics import read_positions
from rigid_sim_ros.engine.joints.shake import MOST_PARTS, RESOLVED
from rigid_sim_ros.engine.maths.vector import row
from rigid_sim_ros.engine.model.kinds.table import is_unbounded
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.steps.articulated import (
    arrive, begin_part, begin_step, end_step, finish, go_back, JointedArguments, later_loads,
    MOST_SLOWED, move_bodies, put_back, reads_positions, slow_down)
from rigid_sim_ros.engine.steps.jointed_progress import BEGIN, Progress
from rigid_sim_ros.kernels.argument_pack import ArgumentPack, packed
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel
from rigid_sim_ros.kernels.separate import by_address, link, Pieces

# Of the half thickness of a shape: contacts are found this far ahead, and as far as it moves.
MARGIN = 0.01
# Why the kernel stops, besides what contact_search.py says: bodies that another solver moves are
# met, which are CALLED in `elsewhere`.
MORE_ROWS, MORE_BODIES = 4, 5
# Times at most that the impulses of a way are found, each with what the joints needed before,
# until points go as was foreseen but for this part of the rates without impulses. What is left
# of it is as little against the error of a step as 1 % of the force.
MOST_FORESEEN, ASTRAY = 8, 1e-2
CALLED = 2


class JointedContact(NamedTuple):
    """What the kernels of a step read and write."""

    joints: JointedArguments
    shapes: Shapes
    materials: Materials
    memory: Memory
    radius: Array  # (n,) [m] how far the shapes of a body reach from its centre of mass
    thickness: Array  # (s,) [m] half of the least that a shape measures across
    thinnest: float  # [m] the least of these, but for planes
    elsewhere: IntArray  # (n,) 1: another solver moves the body, and it touches nothing here
    # (s,) [m] how far shapes go in the step, as was known when bodies were given to solvers
    looked: Array
    buffers: ContactBuffers
    now: Progress


@kernel
def begin(c: JointedContact) -> None:
    """Begin a step."""
    begin_step(c.joints)
    forget_all_impulses(current(c.memory))
    c.buffers.acted.count[0] = c.buffers.half_acted.count[0] = 0
    c.buffers.system.residual[0] = 0.0


@kernel
def find_touching(c: JointedContact, h: float) -> int:
    """Write the points that may touch within h [s]; return DONE, or what is needed first."""
    c.now.within[0] = h
    return find_within(c, 0)


@by_address
def find_within(c: JointedContact, _: int) -> int:
    """Write the points that may touch within the time that `find_touching` was given."""
    memory, shapes, w, h = c.memory, c.shapes, c.buffers, c.now.within[0]
    model, state = c.joints.model, c.joints.state
    set_margins(model, h, state, MARGIN, c.radius, c.thickness, shapes, memory, 0,
                shapes.body.shape[0])
    s = 0
    while s < shapes.body.shape[0]:
        i, after = shapes.body[s], shapes.after[s]
        # What met on a way that was gone is to be found, however fast it was on that.
        sudden = max(w.sudden[i], w.gained[i]) if w.counts.woken[0] > 0 else w.sudden[i]
        for k in range(s, after if sudden > 0.0 else s):
            memory.margin[k] += h * sudden
        s = after
    why, w.counts.needed[0] = find_points(model, state, shapes, c.materials, memory, np.inf,
                                          w.order, w.contacts)
    if why != DONE:
        return why
    for k in range(w.contacts.count[0]):
        if c.elsewhere[w.contacts.body_a[k]] + c.elsewhere[w.contacts.body_b[k]] > 0:
            w.contacts.gap[k] = np.inf
    # What acts at these comes to what acted in this step.
    w.counts.needed[0] += w.acted.count[0] + w.half_acted.count[0]
    return MORE_CONTACTS if w.counts.needed[0] > w.contacts.gap.shape[0] else DONE


@kernel
def reach(c: JointedContact, r: int, h: float) -> tuple[float, float]:
    """
    Return how fast [m/s] the shapes of a manifold come nearer within h [s], at most.

    And how near [m] they may come so that nothing passes through anything unseen: as near as they
    are, or one into the other by half of the thinner one (conservative advancement; Mirtich,
    Impulse-based Dynamic Simulation, PhD thesis, Berkeley 1996, section 2.3). The loads have been
    summed.
    """
    joints, shapes, manifolds = c.joints, c.shapes, current(c.memory)
    model, state, loads = joints.model, joints.state, joints.work.loads
    a, b = manifolds.shape_a[r], manifolds.shape_b[r]
    if is_unbounded(shapes.kind[a]) or is_unbounded(shapes.kind[b]):
        return 0.0, math.inf    # nothing comes out on the other side of a half space
    n = row(manifolds.normal, r)
    speed = (approach_bound(model, state, loads, shapes, a, n, h)
             + approach_bound(model, state, loads, shapes, b, (-n[0], -n[1], -n[2]), h)
             + c.buffers.sudden[shapes.body[a]] + c.buffers.sudden[shapes.body[b]])
    return speed, max(smallest_gap(manifolds, r), 0.5 * min(c.thickness[a], c.thickness[b]))


@kernel
def read_way(c: JointedContact) -> None:
    """Read the velocities of the way that was taken, and which points took part in it."""
    model, state, w = c.joints.model, c.joints.state, c.buffers
    for n in range(w.contacts.count[1]):
        k = w.contacts.first[n]
        read_velocity(model, state, w.contacts.body_a[k], w.bodies)
        read_velocity(model, state, w.contacts.body_b[k], w.bodies)
    match_forces(w.contacts, w.half, w.counts.half_known[0], w.match)


@kernel
def retry_unresolved(c: JointedContact) -> bool:
    """
    Go back from the shortest way, which did not resolve the motion; return False to go on.

    What joints hold may be wedged in somewhere: then the way is taken as if it were not. What
    moves too fast without that is slowed down.
    """
    w = c.buffers
    if w.counts.points[0] > 0:
        go_back(c.joints)
        c.joints.scratch.unresolved[0] += 1
        w.counts.points[0] = 0
        return True
    if c.now.slowed[0] == MOST_SLOWED:
        return False
    go_back(c.joints)
    slow_down(c.joints)
    c.now.slowed[0] += 1
    return True


@kernel
def take_first_half(c: JointedContact, h: float) -> bool:
    """
    Kick, find the impulses of contact, and let bodies and joints move to the poses after h [s].

    The impulses are found with what the joints are foreseen to need on this way, which a blow
    changes suddenly: where it is nearly taut, a chain that needs something else moves sideways ten
    times as far. Impulses for another motion than that which follows give energy, so they are
    found again with what the joints needed, from the same state. Returns False, with the state
    spoiled, if h is too long to resolve the motion: joints do not close, or what points are off
    does not shrink as fast as what joints are.
    """
    joints = c.joints
    state, loads = joints.state, joints.work.loads
    begin_part(joints)
    before = np.inf
    for n in range(MOST_FORESEEN):
        kick(state, loads, 0.5 * h)
        solve_contacts(joints.model, state, joints.table, joints.motion, joints.scratch, loads, h,
                       True, c.buffers)
        if not move_bodies(joints, h):
            return False
        off = astray(joints.model, joints.start, state, h, c.buffers)
        if off <= ASTRAY:
            break
        if n == MOST_FORESEEN - 1 or off > RESOLVED * before:
            return bool(MOST_PARTS * h <= joints.model.h)
        before = off
        put_back(joints)
        joints.scratch.known[FORESEEN] = 1
    return True


@kernel
def keep_first_half(c: JointedContact) -> None:
    """Keep the impulses of the first half of a way that may be taken."""
    w = c.buffers
    keep_impulses(c.joints.model, True, w)
    w.half_acted.count[0] = 0
    for k in w.chosen[:w.counts.points[0]]:
        note(c.joints.state, w.contacts, k, w.impulse[k], w.half_acted)


@kernel
def take_way(c: JointedContact, h: float) -> None:
    """Note what a way of h [s] did, which is taken now."""
    arrive(c.joints, h, True)
    undo_displacing(c.joints.model, c.joints.state, h, c.buffers)


@kernel
def choose(c: JointedContact, after: int) -> int:
    """Choose the points that take part; go on with a stage if there is room for them."""
    w = c.buffers
    w.counts.needed[0] = choose_points(c.joints.model, c.joints.table, w)
    if w.counts.needed[0] > w.system.rows.at.shape[0]:
        return MORE_ROWS
    c.now.stage[0] = after
    return DONE


@kernel
def take_second_half(c: JointedContact, h: float) -> None:
    """Kick, find the impulses of contact at the new poses, and let the joints answer."""
    joints = c.joints
    loads = later_loads(joints, h)
    kick(joints.state, loads, 0.5 * h)
    solve_contacts(joints.model, joints.state, joints.table, joints.motion, joints.scratch, loads,
                   h, False, c.buffers)
    finish(joints, h, True)
    _keep_part(c)


@kernel
def _keep_part(c: JointedContact) -> None:
    """Record the impulses of both halves of a part, and carry those of the second over."""
    model, state, w = c.joints.model, c.joints.state, c.buffers
    note_all(w.acted, w.half_acted)
    w.half_acted.count[0] = 0
    for k in w.chosen[:w.counts.points[0]]:
        note(state, w.contacts, k, w.impulse[k], w.acted)
    chosen, width = w.chosen[:w.counts.points[0]], w.counts.width[0]
    recall_forces(model, w.contacts, chosen, width, w.half, w.match, w.row)
    w.pushed[:] = 0.0
    for n in range(chosen.shape[0]):
        for i in range(width):
            w.pushed[chosen[n], i] = w.impulse[chosen[n], i] + w.row[width * n + i]
    record(model, current(c.memory), w.contacts, w.pushed)
    keep_impulses(model, False, w)


@kernel
def end(c: JointedContact) -> None:
    """End a step."""
    end_step(c.joints)
    if not reads_positions(c.joints.table):
        read_positions(c.joints.table, c.joints.state, c.joints.motion)
    c.now.steps_left[0] -= 1
    c.now.stage[0] = BEGIN


def advance(run: Callable[..., Any], c: JointedContact, count: int,
            pack: ArgumentPack | None) -> tuple[JointedContact, ArgumentPack]:
    """
    Advance the state by `count` steps of a kernel `run`, that of the model, or until it calls.

    Returns the arguments, whose buffers may have grown, and their pack. Steps are left where it
    calls bodies that are elsewhere: it is for the caller to give these to this solver, and to
    begin that step again.
    """
    c.now.steps_left[0], c.now.stage[0] = count, BEGIN
    while True:
        pack = packed(c, pack)
        if not pack.is_linked:
            # What the helper compiles takes as long as all the rest.
            link(run, pack, Pieces(here=[], helped=[find_within]), numbers=0)
        why = pack.run(run)
        if why in (DONE, MORE_BODIES):
            return c, pack
        w, needed = c.buffers, int(c.buffers.counts.needed[0])
        if why == MORE_MEMORY:
            c = c._replace(memory=grown(c.memory))
        elif why == MORE_MANIFOLDS:
            c = c._replace(buffers=w._replace(order=np.zeros((2, 2 * needed), dtype=np.int64)))
        elif why == MORE_CONTACTS:
            c = c._replace(buffers=more_points(w, c.joints.table, needed))
        else:
            system = make_system(2 * needed, c.joints.table, len(c.joints.times))
            c = c._replace(buffers=w._replace(system=system))
