# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The model `penalty` of bodies that joints hold.

Kick, drift, kick as without contacts (articulated.py), with the forces of springs and dampers at
the points that overlap at both ends of each part (penalty.py).
"""

from typing import NamedTuple

from rigid_sim_ros.engine.contact.contact_search import DONE
from rigid_sim_ros.engine.contact.recorded_impulses import forget_all_impulses
from rigid_sim_ros.engine.detection.manifolds import current
from rigid_sim_ros.engine.dynamics.force_and_torque import kick
from rigid_sim_ros.engine.joints.forward_kinematics import read_positions
from rigid_sim_ros.engine.joints.shake import MOST_PARTS
from rigid_sim_ros.engine.steps.articulated import (
    arrive, begin_part, begin_step, end_step, finish, go_back, JointedArguments, later_loads,
    MOST_SLOWED, move_bodies, next_size, slow_down)
from rigid_sim_ros.engine.steps.penalty import (
    find_overlaps, PenaltyArguments, push, record, with_room)
from rigid_sim_ros.kernels.argument_pack import ArgumentPack, packed
from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.kernel import kernel

# The stages of a step, in `penalty.Buffers.stage`: it begins; what overlaps is found at the start
# and at the end of a part of it, with a half of the part after each.
BEGIN, SEEK, FIRST_HALF, SEEK_AGAIN, SECOND_HALF = range(5)


class JointedPenalty(NamedTuple):
    """What the kernels of a step read and write."""

    joints: JointedArguments
    contact: PenaltyArguments
    parts_done: IntArray  # (1,) of a step, of MOST_PARTS
    size: IntArray  # (1,) of the part that is taken
    slowed: IntArray  # (1,) how often the motion was slowed down in this step


@kernel
def run(c: JointedPenalty) -> int:
    """Step until no steps are left; return DONE, or what is needed first."""
    now = c.contact.buffers
    while now.steps_left[0] > 0:
        stage = now.stage[0]
        if stage == BEGIN:
            _begin(c)
        elif stage == FIRST_HALF:
            _take_first_half(c)
        elif stage == SECOND_HALF:
            _take_second_half(c)
        else:
            why = find_overlaps(c.contact)
            if why != DONE:
                return why
            now.stage[0] = FIRST_HALF if stage == SEEK else SECOND_HALF
    return DONE


@kernel
def _begin(c: JointedPenalty) -> None:
    """Begin a step."""
    begin_step(c.joints)
    forget_all_impulses(current(c.contact.memory))
    c.parts_done[0], c.size[0], c.slowed[0] = 0, next_size(c.joints.motion), 0
    c.contact.buffers.stage[0] = SEEK


@kernel
def _take_first_half(c: JointedPenalty) -> None:
    """Kick, and let bodies and joints move to the new poses."""
    joints, h = c.joints, c.joints.model.h * c.size[0] / MOST_PARTS
    begin_part(joints)
    push(c.contact, 0.0, 0.5 * h)
    kick(joints.state, joints.work.loads, 0.5 * h)
    if not move_bodies(joints, h):
        if c.size[0] > 1:
            go_back(joints)
            c.size[0] //= 2
            return      # what overlaps is still the same
        if c.slowed[0] < MOST_SLOWED:
            go_back(joints)
            slow_down(joints)
            c.slowed[0] += 1
            return
    arrive(joints, h, True)
    c.contact.buffers.stage[0] = SEEK_AGAIN


@kernel
def _take_second_half(c: JointedPenalty) -> None:
    """Kick by the forces at the new poses, and let the joints answer."""
    joints, h = c.joints, c.joints.model.h * c.size[0] / MOST_PARTS
    kick(joints.state, later_loads(joints, h), 0.5 * h)
    push(c.contact, h, 0.5 * h)
    finish(joints, h, True)
    record(c.contact, h)
    c.parts_done[0] += c.size[0]
    c.contact.buffers.stage[0] = SEEK
    if c.parts_done[0] == MOST_PARTS:
        joints.motion.parts[0] = MOST_PARTS // c.size[0]
        end_step(joints)
        read_positions(joints.table, joints.state, joints.motion)
        c.contact.buffers.steps_left[0] -= 1
        c.contact.buffers.stage[0] = BEGIN


def advance(c: JointedPenalty, count: int,
            pack: ArgumentPack | None) -> tuple[JointedPenalty, ArgumentPack]:
    """Advance the state by `count` steps; return the arguments, whose buffers may have grown."""
    c.contact.buffers.steps_left[0], c.contact.buffers.stage[0] = count, BEGIN
    while True:
        pack = packed(c, pack)
        why = pack.run(run)
        if why == DONE:
            return c, pack
        c = c._replace(contact=with_room(c.contact, why))
