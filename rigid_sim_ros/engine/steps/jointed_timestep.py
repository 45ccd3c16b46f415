# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The model `timestep` of bodies that joints hold and that touch each other.

Kick, drift, kick as without contacts (articulated.py), with impulses of contact in both halves.
"""

from rigid_sim_ros.engine.constraints.articulated_contact import (
    choose_points, keep_impulses, press, take_all, take_back_displacing, take_pressing)
from rigid_sim_ros.engine.constraints.pressing import NEEDED, POINTS_IN_USE
from rigid_sim_ros.engine.dynamics.loads import kick
from rigid_sim_ros.engine.steps.articulated import (
    arrive, begin_part, finish, go_back, later_loads, MOST_PARTS, move_bodies, next_size)
from rigid_sim_ros.engine.steps.jointed_contact import (
    BEGIN, begin, DONE, end, find_points, JointedContact, keep_part, MORE_ROWS, PARTS_DONE, SIZE,
    STAGE, STEPS)
from rigid_sim_ros.kernels.kernel import kernel

# At which stage a step goes on: what touches is found, at the start of a part of it and at its
# end; the first and the second half of a part.
SEEK, FIRST, SEEK_AGAIN, SECOND = range(BEGIN + 1, BEGIN + 5)


@kernel
def run(c: JointedContact) -> int:
    """Run through the stages until no steps are left; return DONE, or what is needed first."""
    while c.place[STEPS] > 0:
        stage, why = c.place[STAGE], DONE
        if stage == BEGIN:
            begin(c)
            c.place[PARTS_DONE], c.place[SIZE] = 0, next_size(c.joints.motion)
            c.place[STAGE] = SEEK
        elif stage == SEEK:
            why = _seek(c, True)
        elif stage == FIRST:
            _take_first_half(c)
        elif stage == SEEK_AGAIN:
            why = _seek(c, False)
        else:
            _take_second_half(c)
        if why != DONE:
            return why
    return DONE


@kernel
def _seek(c: JointedContact, first: bool) -> int:
    """Find the points that may touch in the part of a step, or that do at its end."""
    # At the end of a part only what touches is asked for.
    why = find_points(c, c.joints.model.h if first else 0.0)
    if why != DONE:
        return why
    w = c.pressing
    if first:
        take_all(w)
    else:
        take_pressing(w)
    w.count[NEEDED] = choose_points(c.joints.model, c.joints.table, w)
    if w.count[NEEDED] > w.system.x.shape[0]:
        return MORE_ROWS
    c.place[STAGE] += 1
    return DONE


@kernel
def _take_first_half(c: JointedContact) -> None:
    """Kick, find the impulses of contact, and let bodies and joints move to the new poses."""
    joints = c.joints
    model, state, table, loads = joints.model, joints.state, joints.table, joints.work.loads
    h = model.h * c.place[SIZE] / MOST_PARTS
    begin_part(joints)
    kick(state, loads, 0.5 * h)
    press(model, state, table, joints.motion, joints.scratch, loads, h, True, c.pressing)
    if not move_bodies(joints, h):
        if c.place[SIZE] > 1:
            go_back(joints)
            c.place[SIZE] //= 2
            return      # what touches is still the same
        joints.scratch.unresolved[0] += 1
        if c.pressing.count[POINTS_IN_USE] > 0:
            # What joints hold is wedged in somewhere: this part goes on as if it were not.
            go_back(joints)
            c.pressing.count[POINTS_IN_USE] = 0
            return
    arrive(joints, h, True)
    take_back_displacing(state, c.pressing)
    keep_impulses(model, True, c.pressing)
    c.place[STAGE] = SEEK_AGAIN


@kernel
def _take_second_half(c: JointedContact) -> None:
    """Kick, find the impulses of contact at the new poses, and let the joints answer."""
    joints = c.joints
    model, state = joints.model, joints.state
    h = model.h * c.place[SIZE] / MOST_PARTS
    loads = later_loads(joints, h)
    kick(state, loads, 0.5 * h)
    press(model, state, joints.table, joints.motion, joints.scratch, loads, h, False, c.pressing)
    finish(joints, h, True)
    keep_part(c)
    c.place[PARTS_DONE] += c.place[SIZE]
    c.place[STAGE] = SEEK
    if c.place[PARTS_DONE] == MOST_PARTS:
        joints.motion.parts[0] = MOST_PARTS // c.place[SIZE]
        end(c)
