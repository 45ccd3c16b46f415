# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The sequence of the stages of a step of bodies that joints hold and that touch each other.

Kick, drift, kick as without contacts (articulated.py), with impulses of contact in both halves.
What needs help is a buffer that has to grow: the kernel returns the reason, Python does what is
asked, and it goes on from the stage at which it stopped.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.constraints.articulated_contact import (
    choose_points, keep_impulses, press, take_back_displacing)
from rigid_sim_ros.engine.constraints.articulated_rows import make_system
from rigid_sim_ros.engine.constraints.pressing import (
    more_points, NEEDED, POINTS_IN_USE, Pressing, WIDTH)
from rigid_sim_ros.engine.contact.carried_forces import recall_forces
from rigid_sim_ros.engine.contact.contacts import gather
from rigid_sim_ros.engine.contact.recorded_impulses import forget_impulses, record
from rigid_sim_ros.engine.detection.detect import detect_ahead
from rigid_sim_ros.engine.detection.look_ahead import look_ahead
from rigid_sim_ros.engine.detection.manifold_rows import find_anew
from rigid_sim_ros.engine.detection.manifolds import current, grown, Memory
from rigid_sim_ros.engine.dynamics.free_flight import drift
from rigid_sim_ros.engine.dynamics.integrate import sum_loads, Work
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic, move_kinematic
from rigid_sim_ros.engine.dynamics.loads import kick
from rigid_sim_ros.engine.dynamics.wrenches import count_down, Wrenches
from rigid_sim_ros.engine.joints.buffers import JointMotion, JointWork
from rigid_sim_ros.engine.joints.posture import read_positions
from rigid_sim_ros.engine.joints.reactions import add_wrenches_of_joints
from rigid_sim_ros.engine.joints.settle import prepare_step
from rigid_sim_ros.engine.joints.shake import remember
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.state.state import copy_into, State
from rigid_sim_ros.engine.steps.articulated import (
    begin_efforts, end_commands, finish, follow_positions, halve, keep_held, MOST_PARTS,
    next_size, note_part, shake_within_limits, sum_later_loads)
from rigid_sim_ros.kernels.argument_pack import ArgumentPack, packed
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Of the half thickness of a shape: contacts are found this far ahead, and as far as it moves.
MARGIN = 0.01
# Why the kernel stops.
DONE, MORE_MEMORY, MORE_MANIFOLDS, MORE_CONTACTS, MORE_ROWS = range(5)
# At which stage it goes on: a step begins; what touches is found, at the start of the step and at
# the end of a part of it; the first and the second half of a part.
BEGIN, SEEK, FIRST, SEEK_AGAIN, SECOND = range(5)
# Places in `JointedTimestep.place`: steps that are left, the stage, and of a step the parts that
# are done and the size of the next one, in MOST_PARTS.
STEPS, STAGE, PARTS_DONE, SIZE = range(4)


class JointedTimestep(NamedTuple):
    """What the kernels of a step read and write."""

    model: Model
    state: State
    wrenches: Wrenches
    work: Work
    table: JointTable
    motion: JointMotion
    scratch: JointWork
    times: Array  # (n,) [s]
    start: State  # of the part of a step that is taken
    shapes: Shapes
    materials: Materials
    memory: Memory
    radius: Array  # (n,) [m] how far the shapes of a body reach from its centre of mass
    thickness: Array  # (s,) [m] half of the least that a shape measures across
    pressing: Pressing
    place: IntArray  # (4,) see STEPS


@kernel
def run(c: JointedTimestep) -> int:
    """Run through the stages until no steps are left; return DONE, or what is needed first."""
    place, why = c.place, DONE
    while place[STEPS] > 0:
        stage = place[STAGE]
        if stage == BEGIN:
            _begin(c)
        elif stage in (SEEK, SEEK_AGAIN):
            why = _seek(c, stage == SEEK)
            if why != DONE:
                return why
            place[STAGE] = stage + 1
        elif stage == FIRST:
            _take_first_half(c)
        else:
            _take_second_half(c)
    return DONE


@kernel
def _begin(c: JointedTimestep) -> None:
    """Begin a step."""
    begin_kinematic(c.model, c.state)
    prepare_step(c.model, c.table, c.state, c.scratch)
    begin_efforts(c.motion)
    forget_impulses(current(c.memory))
    c.pressing.system.residual[0] = 0.0
    c.place[PARTS_DONE], c.place[SIZE] = 0, next_size(c.motion)
    c.place[STAGE] = SEEK


@kernel
def _seek(c: JointedTimestep, first: bool) -> int:
    """Find the points that may touch in the part of a step, or that do at its end."""
    memory, shapes, state, model, w = c.memory, c.shapes, c.state, c.model, c.pressing
    find_anew(current(memory))
    # At the end of a part only what touches is asked for.
    h = model.h if first else 0.0
    look_ahead(h, model.inv_m, model.inv_I_C, state.P, state.L, state.V, MARGIN, c.radius,
               c.thickness, shapes.body, memory, 0, shapes.body.shape[0])
    if not detect_ahead(model, state, shapes, memory, None):
        return MORE_MEMORY
    manifolds = current(memory)
    rows = manifolds.count[0]
    w.count[NEEDED] = rows
    if rows > w.order.shape[1]:
        return MORE_MANIFOLDS
    w.count[NEEDED] = gather(state, manifolds, shapes, c.materials, np.inf, w.order[0, :rows],
                             w.order[1, :rows], w.contacts)
    if w.count[NEEDED] > w.contacts.gap.shape[0]:
        return MORE_CONTACTS
    w.count[NEEDED] = choose_points(model, c.table, first, w)
    return MORE_ROWS if w.count[NEEDED] > w.system.x.shape[0] else DONE


@kernel
def _take_first_half(c: JointedTimestep) -> None:
    """Kick, find the impulses of contact, and let bodies and joints move to the new poses."""
    model, state, table, motion, scratch = c.model, c.state, c.table, c.motion, c.scratch
    h = model.h * c.place[SIZE] / MOST_PARTS
    copy_into(c.start, state)
    keep_held(motion, scratch)
    sum_loads(model, state, c.wrenches, c.work.loads)
    kick(state, c.work.loads, 0.5 * h)
    press(model, state, table, motion, scratch, c.work.loads, h, True, c.pressing)
    for i in range(c.times.shape[0]):
        c.times[i] = h if table.row_of_body[i] < 0 else 0.0
    drift(model, state, c.times, c.work.block)
    move_kinematic(model, state, h)
    if not shake_within_limits(model, state, table, motion, scratch, h):
        if c.place[SIZE] > 1:
            halve(model, state, table, motion, scratch, c.start)
            c.place[SIZE] //= 2
            return      # what touches is still the same
        scratch.unresolved[0] += 1
        if c.pressing.count[POINTS_IN_USE] > 0:
            # What joints hold is wedged in somewhere: this part goes on as if it were not.
            halve(model, state, table, motion, scratch, c.start)
            c.pressing.count[POINTS_IN_USE] = 0
            return
    remember(table, motion, scratch)
    add_wrenches_of_joints(table, state, motion, scratch, model.h, True)
    take_back_displacing(state, c.pressing)
    keep_impulses(model, True, c.pressing)
    follow_positions(table, state, motion, scratch, h)
    prepare_step(model, table, state, scratch)
    c.place[STAGE] = SEEK_AGAIN


@kernel
def _take_second_half(c: JointedTimestep) -> None:
    """Kick, find the impulses of contact at the new poses, and let the joints answer."""
    model, state, table, motion, scratch = c.model, c.state, c.table, c.motion, c.scratch
    loads, h = c.work.loads, model.h * c.place[SIZE] / MOST_PARTS
    if model.forces.kind.shape[0] + c.wrenches.in_use[0] > 0:
        sum_later_loads(model, state, c.wrenches, c.work, table, motion, scratch, c.start, h)
        loads = c.work.later
    kick(state, loads, 0.5 * h)
    press(model, state, table, motion, scratch, loads, h, False, c.pressing)
    finish(model, state, table, motion, scratch, h, True)
    _record(c)
    keep_impulses(model, False, c.pressing)
    note_part(motion, scratch, model.h)
    c.place[PARTS_DONE] += c.place[SIZE]
    c.place[STAGE] = SEEK
    if c.place[PARTS_DONE] == MOST_PARTS:
        _end(c)


@kernel
def _record(c: JointedTimestep) -> None:
    """Add the impulses of both halves to those of the manifolds."""
    w = c.pressing
    chosen = w.chosen[:w.count[POINTS_IN_USE]]
    width = w.count[WIDTH]
    recall_forces(c.model, w.contacts, chosen, width, w.half, w.match, w.row)
    w.pushed[:] = 0.0
    for n in range(chosen.shape[0]):
        for i in range(width):
            w.pushed[chosen[n], i] = w.impulse[chosen[n], i] + w.row[width * n + i]
    record(c.model, current(c.memory), w.contacts, w.pushed)


@kernel
def _end(c: JointedTimestep) -> None:
    """End a step."""
    c.motion.parts[0] = MOST_PARTS // c.place[SIZE]
    end_kinematic(c.model, c.state)
    count_down(c.wrenches)
    end_commands(c.motion)
    read_positions(c.table, c.state, c.motion)
    c.place[STEPS] -= 1
    c.place[STAGE] = BEGIN


def advance(c: JointedTimestep, count: int, pack: ArgumentPack | None) -> tuple[
        JointedTimestep, ArgumentPack]:
    """Advance the state by `count` steps; return the arguments, whose buffers may have grown."""
    c.place[STEPS], c.place[STAGE] = count, BEGIN
    while True:
        pack = packed(c, pack)
        why = pack.run(run)
        if why == DONE:
            return c, pack
        w, needed = c.pressing, int(c.pressing.count[NEEDED])
        if why == MORE_MEMORY:
            c = c._replace(memory=grown(c.memory))
        elif why == MORE_MANIFOLDS:
            c = c._replace(pressing=w._replace(order=np.zeros((2, 2 * needed), dtype=np.int64)))
        elif why == MORE_CONTACTS:
            c = c._replace(pressing=more_points(w, c.table, needed))
        else:
            system = make_system(2 * needed, c.table, len(c.times))
            c = c._replace(pressing=w._replace(system=system))
