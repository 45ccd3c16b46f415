# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The step of the method `symplectic4` of bodies that joints hold and that touch nothing.

Five steps of second order, one of them back in time, are one of fourth (`integrate.STAGES`). That
is so where what acts along axes is smooth, and forward and back in time alike. A part of a step in
which a limit or the bound of a speed locks a joint, or in which a damper is of more than h d /
(inertia that its axis feels) = 2, is one of second order instead; so are all in worlds with dry
friction.
"""

from rigid_sim_ros.engine.dynamics.force_and_torque import kick
from rigid_sim_ros.engine.dynamics.integrate import STAGES
from rigid_sim_ros.engine.joints.buffers import JointMotion, STAGE, StartWork
from rigid_sim_ros.engine.joints.laws import has_friction, is_smooth
from rigid_sim_ros.engine.joints.settle import prepare_step
from rigid_sim_ros.engine.joints.shake import MOST_PARTS
from rigid_sim_ros.engine.state.state import copy_into
from rigid_sim_ros.engine.steps.articulated import (
    arrive, begin_part, finish, JointedArguments, later_loads, move_bodies, steps_by, take_part)
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def take_in_stages(c: JointedArguments, h: float, last: bool, may_end: bool,
                   record: bool) -> float:
    """Take a part of h [s] of a step in stages, or as it is where that is not possible."""
    if has_friction(c.table):
        return take_part(c, h, last, may_end, record)
    _keep(c)
    for n in range(len(STAGES)):
        c.scratch.known[STAGE] = n + 1
        if not _take_stage(c, STAGES[n] * h, record):
            c.scratch.known[STAGE] = 0
            too_long = is_smooth(c.table, c.motion, c.scratch, c.model.h)
            _go_back(c)
            if too_long and MOST_PARTS * h > c.model.h:
                return 0.0
            until = take_part(c, h, last, may_end, record)
            c.motion.known[0] = 0   # nothing yet of stages
            return until
    c.scratch.known[STAGE] = 0
    return h


@kernel
def _keep(c: JointedArguments) -> None:
    """Keep how all is as a part of a step begins."""
    copy_into(c.work.stage, c.state)
    _copy(c.scratch.start, c.motion)


@kernel
def _go_back(c: JointedArguments) -> None:
    copy_into(c.state, c.work.stage)
    _copy(c.motion, c.scratch.start)
    prepare_step(c.model, c.table, c.state, c.scratch)
    c.motion.known[0] = 0   # what joints needed is known of stages only


@kernel
def _copy(to: StartWork | JointMotion, of: StartWork | JointMotion) -> None:
    for k in range(of.rate.shape[0]):
        to.rate[k], to.effort[k] = of.rate[k], of.effort[k]
    for j in range(of.position.shape[0]):
        to.position[j] = of.position[j]
        for n in range(6):
            to.wrench[j, n] = of.wrench[j, n]


@kernel
def _take_stage(c: JointedArguments, h: float, record: bool) -> bool:
    """Take a stage of h [s]: kick, drift, kick; returns False if it is not smooth or too long."""
    begin_part(c)
    kick(c.state, c.work.loads, 0.5 * h)
    if not move_bodies(c, h) or not is_smooth(c.table, c.motion, c.scratch, c.model.h):
        return False
    arrive(c, h, record)
    kick(c.state, later_loads(c, h), 0.5 * h)
    finish(c, h, record)
    return is_smooth(c.table, c.motion, c.scratch, c.model.h)


advance_in_stages = steps_by(take_in_stages)
