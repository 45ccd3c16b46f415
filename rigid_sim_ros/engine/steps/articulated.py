# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sequence of the stages of a step of bodies that joints hold and that touch nothing."""

from collections.abc import Callable
import math
from typing import Any, NamedTuple

from rigid_sim_ros.engine.dynamics.force_and_torque import kick, Loads
from rigid_sim_ros.engine.dynamics.free_flight import drift
from rigid_sim_ros.engine.dynamics.integrate import sum_loads, Work
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic, move_kinematic
from rigid_sim_ros.engine.dynamics.wrenches import count_down, Wrenches
from rigid_sim_ros.engine.joints.buffers import (
    Drives, EFFORT, FORESEEN, JointMotion, JointWork, LASTS)
from rigid_sim_ros.engine.joints.forward_kinematics import read_positions
from rigid_sim_ros.engine.joints.joint_coordinates import has_one_coordinate
from rigid_sim_ros.engine.joints.limits import (
    first_hit, note_arrived, release_hits, SHARP, SHORTEST, stop_hits, way_until)
from rigid_sim_ros.engine.joints.reactions import add_wrenches_of_joints, note_momenta
from rigid_sim_ros.engine.joints.settle import prepare_step
from rigid_sim_ros.engine.joints.shake import (
    foresee, leaves_active_set, MOST_PARTS, rattle, remember, shake, undo_motion)
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import copy_into, State
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.kernel import kernel

# What not even MOST_PARTS parts of a step resolve, such as motions that rounding or a far too long
# step spoiled, is slowed down by half, so often at most in a step; then the step is left as it is.
MOST_SLOWED = 64
# A joint that passes its limit in spite of its rate is locked there, and the step is done again:
# once as a rule, and once more for each joint that then does.
MOST_TRIES = 8
# In a step: limits that are met after which the rest of it is one way, with the others at its end.
MOST_HITS = 8
# Ways that are tried until the time of such a meeting is known well enough.
MOST_ENDS = 40
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


def steps_by(take: Callable[[JointedArguments, float, bool, bool, bool], float]) -> Any:
    """Return the kernel that takes steps, their parts by `take`, which is like `take_part`."""

    @kernel
    def step(c: JointedArguments, record: bool) -> None:
        """Take a step, in as many parts as it needs; record the wrenches through the joints."""
        h = c.model.h
        left, size, slowed, hits, tries = h, next_size(c.motion), 0, 0, 0
        begin_efforts(c.motion)
        _stop_arrived(c, h)
        way = h * size / MOST_PARTS
        while left > SHORTEST * h:
            may_end = hits < MOST_HITS and tries < MOST_ENDS
            until = take(c, way, slowed == MOST_SLOWED, may_end, record)
            if until == way:
                if tries > 0:
                    c.motion.known[0] = 0   # what joints needed is of ways of one length
                    hits, tries = hits + 1, 0
                left -= way
                way = h * size / MOST_PARTS
                if left < (1.0 - SHARP) * way:
                    way = left
            elif until > 0.0:
                way, tries = way_until(until, left, h), tries + 1
            elif size > 1:
                size //= 2
                way = min(0.5 * way, h * size / MOST_PARTS)
            else:
                slow_down(c)
                slowed += 1
        c.motion.parts[0] = MOST_PARTS // size

    @kernel
    def advance(c: JointedArguments, count: int) -> None:
        prepare_step(c.model, c.table, c.state, c.scratch)
        for n in range(count):
            begin_kinematic(c.model, c.state)
            # Wrenches are of the latest step only: nobody sees those of the others.
            step(c, n == count - 1)
            end_step(c)
        read_positions(c.table, c.state, c.motion)

    return advance


@kernel
def _stop_arrived(c: JointedArguments, h: float) -> None:
    """Stop in no time what has met its limit just as the step before ended, of h [s]."""
    if note_arrived(c.table, c.motion, c.scratch, h):
        stop_hits(c.model, c.table, c.state, c.motion, c.scratch)


@kernel
def take_part(c: JointedArguments, h: float, last: bool, may_end: bool, record: bool) -> float:
    """
    Kick, drift, kick for h [s], with the impulses of the joints: order 2.

    `prepare_step` has been called for the present poses, and is then for the new ones. Returns h,
    or, with nothing done, until when [s] a way is to be tried, at the end of which a joint meets
    its limit, if may_end, or 0 if h is too long to resolve the motion; `last`: goes on with what
    there is.
    """
    begin_part(c)
    kick(c.state, c.work.loads, 0.5 * h)
    if not move_bodies(c, h) and not last:
        go_back(c)
        return 0.0
    met = first_hit(c.table, c.scratch, h) if may_end and c.table.lawful > 0 else math.inf
    if met < h:
        go_back(c)
        return met
    hit = release_hits(c.table, c.scratch, h)
    arrive(c, h, record)
    kick(c.state, later_loads(c, h), 0.5 * h)
    finish(c, h, record)
    if hit:
        stop_hits(c.model, c.table, c.state, c.motion, c.scratch)
    return h


@kernel
def begin_step(c: JointedArguments) -> None:
    """Begin a step that stands by itself: nothing is known of the poses yet."""
    begin_kinematic(c.model, c.state)
    prepare_step(c.model, c.table, c.state, c.scratch)
    begin_efforts(c.motion)


@kernel
def slow_down(c: JointedArguments) -> None:
    """
    Halve the momenta of what joints hold, whose motion no part of a step resolves.

    That loses energy; to go on with joints that do not hold would make it.
    """
    c.scratch.unresolved[0] += 1
    for i in c.table.body:
        for k in range(3):
            c.state.P[k, i] *= 0.5
            c.state.L[k, i] *= 0.5
    for k in range(c.motion.rate.shape[0]):
        c.motion.rate[k] *= 0.5


@kernel
def end_step(c: JointedArguments) -> None:
    """Count down what lasts for some steps."""
    end_kinematic(c.model, c.state)
    count_down(c.wrenches)
    end_commands(c.motion)


@kernel
def end_commands(motion: JointMotion) -> None:
    """Let one step pass for the commands of drives."""
    for k in range(motion.drives.mode.shape[0]):
        end_command(motion.drives, k)


@kernel
def end_command(drives: Drives, k: int) -> None:
    """Let one step pass for a command; a drive whose time is over exerts nothing."""
    if drives.steps_left[k] > 0:
        drives.steps_left[k] -= 1
        if drives.steps_left[k] == 0:
            drives.mode[k] = EFFORT
            drives.stiffness[k], drives.damping[k], drives.effort[k] = 0.0, 0.0, 0.0
            drives.steps_left[k] = LASTS


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
def begin_part(c: JointedArguments) -> None:
    """Keep the state at the start of a part of a step, and sum the loads there."""
    copy_into(c.start, c.state)
    c.scratch.known[FORESEEN] = 0
    law = c.scratch.law
    for k in range(c.motion.held.shape[0]):
        law.held[k], law.held_at[k] = c.motion.held[k], c.motion.held_at[k]
    sum_loads(c.model, c.state, c.wrenches, c.work.loads)


@kernel
def go_back(c: JointedArguments) -> None:
    """Go back to the start of a part of a step, to take a shorter one."""
    put_back(c)
    prepare_step(c.model, c.table, c.state, c.scratch)
    c.motion.known[0], c.motion.known[1] = 0, 0


@kernel
def put_back(c: JointedArguments) -> None:
    """Put the bodies, and what holds their axes, back to the start of a part of a step."""
    copy_into(c.state, c.start)
    motion, law = c.motion, c.scratch.law
    for k in range(motion.held.shape[0]):
        motion.held[k], motion.held_at[k] = law.held[k], law.held_at[k]


@kernel
def move_bodies(c: JointedArguments, h: float) -> bool:
    """
    Let all bodies go on for h [s], and the joints act so that they hold after it.

    Returns False, with the state spoiled, if h is too long to resolve the motion.
    """
    for i in range(c.times.shape[0]):
        c.times[i] = h if c.table.row_of_body[i] < 0 else 0.0
    drift(c.model, c.state, c.times, c.work.block)
    move_kinematic(c.model, c.state, h)
    return _shake_within_limits(c, h)


@kernel
def _shake_within_limits(c: JointedArguments, h: float) -> bool:
    """Let the joints act in the first half of a step of h [s], so that none passes its limits."""
    model, state, table, motion, scratch = c.model, c.state, c.table, c.motion, c.scratch
    note_momenta(table, state, scratch)
    foresee(table, motion, scratch)
    for n in range(MOST_TRIES):
        if not shake(model, table, state, motion, scratch, h):
            return False
        if table.lawful == 0 or not leaves_active_set(table, state, scratch, h, n == 0):
            return True
        # What the joints need is known now: the pieces are chosen by that.
        undo_motion(table, state, motion, scratch)
        note_momenta(table, state, scratch)
    return False


@kernel
def arrive(c: JointedArguments, h: float, record: bool) -> None:
    """Note what the joints did on a way of h [s], and what the new poses say."""
    remember(c.table, c.motion, c.scratch)
    if record:
        add_wrenches_of_joints(c.table, c.state, c.motion, c.scratch, c.model.h, True)
    _follow_positions(c, h)
    prepare_step(c.model, c.table, c.state, c.scratch)


@kernel
def reads_positions(table: JointTable) -> bool:
    """Return whether anything depends on positions, which are then read in each step."""
    return table.lawful + table.condition_joint.shape[0] > 0


@kernel
def _follow_positions(c: JointedArguments, h: float) -> None:
    """
    Keep count of the turns of joints, and of all positions where anything depends on them.

    The way of half a step is far less than half a turn off: `read_positions` takes the value
    itself from the poses.
    """
    table = c.table
    if reads_positions(table):
        read_positions(table, c.state, c.motion)
        return
    for k in range(table.axis_joint.shape[0]):
        j = table.axis_joint[k]
        if j != NONE and has_one_coordinate(table.kind[j]):
            c.motion.position[j] += h * c.scratch.law.half_rate[k]


@kernel
def later_loads(c: JointedArguments, h: float) -> Loads:
    """
    Return the loads at the end of a part of h [s].

    Loads that depend on velocities want these as they will be then: `start` is scratch for it.
    """
    if c.model.forces.kind.shape[0] + c.wrenches.in_use[0] == 0:
        return c.work.loads
    copy_into(c.start, c.state)
    kick(c.state, c.work.loads, 0.5 * h)
    rattle(c.model, c.table, c.state, c.motion, c.scratch, h)
    sum_loads(c.model, c.state, c.wrenches, c.work.later)
    copy_into(c.state, c.start)
    return c.work.later


@kernel
def finish(c: JointedArguments, h: float, record: bool) -> None:
    """Let the joints act in the second half of a part of h [s]; add to the means of the step."""
    motion, scratch = c.motion, c.scratch
    if record:
        note_momenta(c.table, c.state, scratch)
    rattle(c.model, c.table, c.state, motion, scratch, h)
    if record:
        add_wrenches_of_joints(c.table, c.state, motion, scratch, c.model.h, False)
    for k in range(motion.effort.shape[0]):
        motion.effort[k] += scratch.law.effort[k] / c.model.h


advance = steps_by(take_part)
