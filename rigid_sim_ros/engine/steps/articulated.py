# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sequence of the stages of a step of bodies that joints hold and that touch nothing."""

from typing import Any

from rigid_sim_ros.engine.dynamics.free_flight import drift
from rigid_sim_ros.engine.dynamics.integrate import sum_loads, Work
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic, move_kinematic
from rigid_sim_ros.engine.dynamics.loads import kick
from rigid_sim_ros.engine.dynamics.wrenches import count_down, Wrenches
from rigid_sim_ros.engine.joints.articulated import factor
from rigid_sim_ros.engine.joints.buffers import JointMotion, JointWork
from rigid_sim_ros.engine.joints.kinematics import place_joints
from rigid_sim_ros.engine.joints.shake import rattle, shake
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import copy_into, State
from rigid_sim_ros.kernels.argument_pack import contents
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.kernel import kernel

# A step that does not resolve the motion is taken in halves, again and again, up to this many
# parts; smaller ones would mean that something else is wrong, and the step is left as it is.
MOST_PARTS = 64
# Steps until half as many parts are tried once more.
PATIENCE = 16


@kernel
def advance(box: Any, count: int) -> None:
    """Take some steps; the box holds all that `articulated_step` needs."""
    model, state, wrenches, work, table, motion, scratch, times, start = contents(box)
    place_joints(model, table, state, scratch)
    factor(model, table, scratch, 0, table.body.shape[0])
    for _ in range(count):
        begin_kinematic(model, state)
        _step(model, state, wrenches, work, table, motion, scratch, times, start)
        end_kinematic(model, state)
        count_down(wrenches)


@kernel
def _step(model: Model, state: State, wrenches: Wrenches, work: Work, table: JointTable,
          motion: JointMotion, scratch: JointWork, times: Array, start: State) -> None:
    """Take a step, in as many parts as it needs."""
    done, size = 0, MOST_PARTS // motion.parts[0]
    if motion.parts[0] > 1:
        motion.known[1] += 1
        if motion.known[1] >= PATIENCE:
            size *= 2
            motion.known[1] = 0
    while done < MOST_PARTS:
        copy_into(start, state)
        h = model.h * size / MOST_PARTS
        if substep(model, state, wrenches, work, table, motion, scratch, times, h) or size == 1:
            done += size
        else:
            copy_into(state, start)
            place_joints(model, table, state, scratch)
            factor(model, table, scratch, 0, table.body.shape[0])
            motion.known[0], motion.known[1] = 0, 0
            size //= 2
    motion.parts[0] = MOST_PARTS // size


@kernel
def substep(model: Model, state: State, wrenches: Wrenches, work: Work, table: JointTable,
            motion: JointMotion, scratch: JointWork, times: Array, h: float) -> bool:
    """
    Kick, drift, kick, with the impulses of the joints: order 2.

    place and factor are of the present poses, and then of the new ones. Returns False, with the
    state spoiled, if h [s] is too long to resolve the motion.
    """
    sum_loads(model, state, wrenches, work.loads)
    kick(state, work.loads, 0.5 * h)
    for i in range(times.shape[0]):
        times[i] = h if table.row_of_body[i] < 0 else 0.0
    drift(model, state, times, work.block)
    move_kinematic(model, state, h)
    if not shake(model, table, state, motion, scratch, h):
        return False
    place_joints(model, table, state, scratch)
    factor(model, table, scratch, 0, table.body.shape[0])
    kick(state, work.loads, 0.5 * h)
    if model.forces.kind.shape[0] + wrenches.in_use[0] > 0:
        # Loads that depend on velocities want these as they will be.
        rattle(model, table, state, motion, scratch)
        kick(state, work.loads, -0.5 * h)
        sum_loads(model, state, wrenches, work.later)
        kick(state, work.later, 0.5 * h)
    rattle(model, table, state, motion, scratch)
    return True
