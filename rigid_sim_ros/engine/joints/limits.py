# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Axes that meet their limits just at the end of a way stop there in no time.

Until then they are free, and what drives them drives them, in both halves of the way. Stopped in
its second half, they would lose half of that, and with it what contacts gave: a leg that jumps
pushes the floor until it is stretched.
"""

import math

from rigid_sim_ros.engine.joints.articulated import write_momenta
from rigid_sim_ros.engine.joints.buffers import AT_LOWER, AT_UPPER, JointMotion, JointWork
from rigid_sim_ros.engine.joints.reactions import add_wrenches_of_joints, note_momenta
from rigid_sim_ros.engine.joints.settle import find_motions_after_impact, prepare_step
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.kernel import kernel

# Of the length of a way: an axis meets its limit at its end, and not before.
AT_END = 1e-5
# As a part of a way: what the time of a limit is known to.
SHARP = 1e-9
# Of a step: no way is shorter, as joints that close to a tolerance of the position then have no
# velocity that means anything.
SHORTEST = 1.0 / 1024.0
# [rad, or lengths of the articulation] What is at its limit, and would pass it by more than this
# in a step, has just arrived.
PASSES = 1e-9
# Of what joints are closed to: so near to its limit an axis is there.
NEAR = 10.0


@kernel
def first_hit(table: JointTable, work: JointWork, way: float) -> float:
    """Return until when [s] a way has to go so that a joint meets its limit there; inf: none."""
    law, first = work.law, math.inf
    for k in range(table.has_laws.shape[0]):
        if table.has_laws[k] == 1 and law.bound[k] != 0 and law.approach[k] != 0.0:
            t = (law.target[k] - law.before[k]) / law.approach[k]
            if t > SHARP * way:
                first = min(first, t)
    # A little later, so that it is met for certain.
    return (1.0 + SHARP) * first if first < (1.0 - 2.0 * SHARP) * way else math.inf


@kernel
def way_until(t: float, left: float, h: float) -> float:
    """
    Return the length [s] of a way of about t: neither it nor what is left is too short.

    Of a step of h [s] so much is left.
    """
    shortest = SHORTEST * h
    if t >= left or left < 2.0 * shortest:
        return left
    return max(shortest, min(t, left - shortest))


@kernel
def release_hits(table: JointTable, work: JointWork, h: float) -> bool:
    """Let axes that meet a limit just as a way of h [s] ends be free; return whether any does."""
    law, found = work.law, False
    for k in range(table.has_laws.shape[0]):
        law.share[k], law.met[k] = 0.0, 0
        if table.has_laws[k] == 0 or law.bound[k] == 0 or law.approach[k] == 0.0:
            continue
        way = law.target[k] - law.before[k]
        if abs(law.approach[k] * h - way) <= AT_END * abs(way):
            law.share[k] = table.laws.restitution[k] if law.back[k] != 0.0 else 0.0
            law.met[k], law.bound[k], found = law.bound[k], 0, True
    return found


@kernel
def note_arrived(table: JointTable, motion: JointMotion, work: JointWork, h: float) -> bool:
    """Note which axes have met a limit just as the step before ended, of h [s]; return if any."""
    laws, found = table.laws, False
    for k in range(table.has_laws.shape[0]):
        if table.has_laws[k] == 0:
            continue
        q, way = motion.position[table.axis_joint[k]], h * motion.rate[k]
        near, passes = NEAR * work.near[k], PASSES * work.unit[k]
        if way < -passes and q <= laws.lower[k] + near:
            work.law.share[k], work.law.met[k], found = laws.restitution[k], AT_LOWER, True
        elif way > passes and q >= laws.upper[k] - near:
            work.law.share[k], work.law.met[k], found = laws.restitution[k], AT_UPPER, True
    return found


@kernel
def stop_hits(model: Model, table: JointTable, state: State, motion: JointMotion,
              work: JointWork) -> None:
    """Stop, or send back, in no time what `release_hits` found; the way is over."""
    note_momenta(table, state, work)
    find_motions_after_impact(model, table, state, motion, work)
    work.law.share[:], work.law.met[:] = 0.0, 0
    for k in range(work.rate.shape[0]):
        motion.rate[k] = work.rate[k]
    write_momenta(model, table, state, work)
    add_wrenches_of_joints(table, state, motion, work, model.h, False)
    prepare_step(model, table, state, work)
