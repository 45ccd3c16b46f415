# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sequence of the stages of a step of bodies that joints hold and that touch nothing."""

from typing import NamedTuple

from rigid_sim_ros.engine.dynamics.free_flight import drift
from rigid_sim_ros.engine.dynamics.integrate import sum_loads, Work
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic, move_kinematic
from rigid_sim_ros.engine.dynamics.loads import kick
from rigid_sim_ros.engine.dynamics.wrenches import count_down, Wrenches
from rigid_sim_ros.engine.joints.buffers import EFFORT, JointMotion, JointWork, LASTS
from rigid_sim_ros.engine.joints.kinematics import has_one_coordinate
from rigid_sim_ros.engine.joints.posture import read_positions
from rigid_sim_ros.engine.joints.reactions import add_wrenches_of_joints, note_momenta
from rigid_sim_ros.engine.joints.settle import prepare_step
from rigid_sim_ros.engine.joints.shake import (
    expect, leaves_pieces, rattle, remember, shake, take_back)
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import copy_into, State
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.kernel import kernel

# A step that does not resolve the motion is taken in halves, again and again, up to this many
# parts; smaller ones would mean that something else is wrong, and the step is left as it is.
MOST_PARTS = 64
# A joint that passes its limit in spite of its rate is locked there, and the step is done again:
# once as a rule, and once more for each joint that then does.
MOST_TRIES = 8
# Steps until half as many parts are tried once more.
PATIENCE = 16


class JointedArguments(NamedTuple):
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


@kernel
def advance(c: JointedArguments, count: int) -> None:
    """Take some steps."""
    model, state, table, motion = c.model, c.state, c.table, c.motion
    prepare_step(model, table, state, c.scratch)
    for n in range(count):
        begin_kinematic(model, state)
        # Wrenches are of the latest step only: nobody sees those of the others.
        _step(model, state, c.wrenches, c.work, table, motion, c.scratch, c.times, c.start,
              n == count - 1)
        end_kinematic(model, state)
        count_down(c.wrenches)
        end_commands(motion)
    read_positions(table, state, motion)


@kernel
def end_commands(motion: JointMotion) -> None:
    """Let one step pass for the commands of drives; a drive whose time is over exerts nothing."""
    drives = motion.drives
    for k in range(drives.mode.shape[0]):
        if drives.steps_left[k] > 0:
            drives.steps_left[k] -= 1
            if drives.steps_left[k] == 0:
                drives.mode[k] = EFFORT
                drives.stiffness[k], drives.damping[k], drives.effort[k] = 0.0, 0.0, 0.0
                drives.steps_left[k] = LASTS


@kernel
def _step(model: Model, state: State, wrenches: Wrenches, work: Work, table: JointTable,
          motion: JointMotion, scratch: JointWork, times: Array, start: State,
          record: bool) -> None:
    """Take a step, in as many parts as it needs; record the wrenches through the joints."""
    done, size = 0, next_size(motion)
    begin_efforts(motion)
    while done < MOST_PARTS:
        copy_into(start, state)
        keep_held(motion, scratch)
        h = model.h * size / MOST_PARTS
        if substep(model, state, wrenches, work, table, motion, scratch, times, start, h,
                   size == 1, record):
            done += size
            note_part(motion, scratch, model.h)
        else:
            halve(model, state, table, motion, scratch, start)
            size //= 2
    motion.parts[0] = MOST_PARTS // size


@kernel
def next_size(motion: JointMotion) -> int:
    """Return the size of the parts of a step, in MOST_PARTS; now and then larger."""
    size = MOST_PARTS // motion.parts[0]
    if motion.parts[0] > 1:
        motion.known[1] += 1
        if motion.known[1] >= PATIENCE:
            size *= 2
            motion.known[1] = 0
    return size


@kernel
def begin_efforts(motion: JointMotion) -> None:
    """Begin the means over a step."""
    for k in range(motion.effort.shape[0]):
        motion.effort[k] = 0.0
    motion.wrench[:] = 0.0


@kernel
def keep_held(motion: JointMotion, scratch: JointWork) -> None:
    """Note which joints stick, and where, at the start of a part of a step."""
    for k in range(motion.held.shape[0]):
        scratch.law.held[k], scratch.law.held_at[k] = motion.held[k], motion.held_at[k]


@kernel
def note_part(motion: JointMotion, scratch: JointWork, h: float) -> None:
    """Add what drives and springs did in a part of a step to the means over the step h [s]."""
    for k in range(motion.effort.shape[0]):
        motion.effort[k] += scratch.law.effort[k] / h


@kernel
def halve(model: Model, state: State, table: JointTable, motion: JointMotion, scratch: JointWork,
          start: State) -> None:
    """Go back to the start of a part of a step, to take it in halves."""
    copy_into(state, start)
    for k in range(motion.held.shape[0]):
        motion.held[k], motion.held_at[k] = scratch.law.held[k], scratch.law.held_at[k]
    prepare_step(model, table, state, scratch)
    motion.known[0], motion.known[1] = 0, 0


@kernel
def substep(model: Model, state: State, wrenches: Wrenches, work: Work, table: JointTable,
            motion: JointMotion, scratch: JointWork, times: Array, start: State,
            h: float, last: bool, record: bool) -> bool:
    """
    Kick, drift, kick, with the impulses of the joints: order 2.

    `prepare_step` has been called for the present poses, and is then for the new ones. Returns
    False, with the state spoiled, if h [s] is too long to resolve the motion; the last resort is
    to go on with what there is.
    """
    sum_loads(model, state, wrenches, work.loads)
    kick(state, work.loads, 0.5 * h)
    for i in range(times.shape[0]):
        times[i] = h if table.row_of_body[i] < 0 else 0.0
    drift(model, state, times, work.block)
    move_kinematic(model, state, h)
    if not shake_within_limits(model, state, table, motion, scratch, h):
        if not last:
            return False
        scratch.unresolved[0] += 1
    remember(table, motion, scratch)
    if record:
        add_wrenches_of_joints(table, state, motion, scratch, model.h, True)
    follow_positions(table, state, motion, scratch, h)
    prepare_step(model, table, state, scratch)
    if model.forces.kind.shape[0] + wrenches.in_use[0] == 0:
        kick(state, work.loads, 0.5 * h)
        finish(model, state, table, motion, scratch, h, record)
        return True
    sum_later_loads(model, state, wrenches, work, table, motion, scratch, start, h)
    kick(state, work.later, 0.5 * h)
    finish(model, state, table, motion, scratch, h, record)
    return True


@kernel
def sum_later_loads(model: Model, state: State, wrenches: Wrenches, work: Work, table: JointTable,
                    motion: JointMotion, scratch: JointWork, start: State, h: float) -> None:
    """
    Write the loads at the end of a step of h [s] to work.later; `start` is scratch.

    Loads that depend on velocities want these as they will be then.
    """
    copy_into(start, state)
    kick(state, work.loads, 0.5 * h)
    rattle(model, table, state, motion, scratch, h)
    sum_loads(model, state, wrenches, work.later)
    copy_into(state, start)


@kernel
def shake_within_limits(model: Model, state: State, table: JointTable, motion: JointMotion,
                        scratch: JointWork, h: float) -> bool:
    """Let the joints act in the first half of a step of h [s], so that none passes its limits."""
    for k in range(scratch.law.bend.shape[0]):
        scratch.law.bend[k] = 0.0
    note_momenta(table, state, scratch)
    expect(table, motion, scratch)
    for n in range(MOST_TRIES):
        if not shake(model, table, state, motion, scratch, h):
            return False
        if table.lawful == 0 or not leaves_pieces(table, state, scratch, h, n == 0):
            break
        # What the joints need is known now: the pieces are chosen by that.
        take_back(table, state, motion, scratch)
        note_momenta(table, state, scratch)
    else:
        return False
    return True


@kernel
def finish(model: Model, state: State, table: JointTable, motion: JointMotion,
           scratch: JointWork, h: float, record: bool) -> None:
    """Let the joints act in the second half of a step of h [s]."""
    if record:
        note_momenta(table, state, scratch)
    rattle(model, table, state, motion, scratch, h)
    if record:
        add_wrenches_of_joints(table, state, motion, scratch, model.h, False)


@kernel
def follow_positions(table: JointTable, state: State, motion: JointMotion, scratch: JointWork,
                     h: float) -> None:
    """
    Keep count of the turns of joints, and of all positions where anything depends on them.

    The way of half a step is far less than half a turn off: `read_positions` takes the value
    itself from the poses.
    """
    if table.lawful + table.condition_joint.shape[0] > 0:
        read_positions(table, state, motion)
        return
    for k in range(table.axis_joint.shape[0]):
        j = table.axis_joint[k]
        if j != NONE and has_one_coordinate(table.kind[j]):
            motion.position[j] += h * scratch.law.half_rate[k]
