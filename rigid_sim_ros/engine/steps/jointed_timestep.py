# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The model `timestep` of bodies that joints hold and that touch each other.

Kick, drift, kick as without contacts (articulated.py), with impulses of contact in both halves. If
shapes met on the way that took no part, it is taken again with them.
"""

from rigid_sim_ros.engine.constraints.articulated_buffers import WOKEN
from rigid_sim_ros.engine.constraints.articulated_points import (
    leave_arriving, take_close, take_loaded, wake, wake_met)
from rigid_sim_ros.engine.contact.contact_search import DONE
from rigid_sim_ros.engine.contact.contacts import read_bodies
from rigid_sim_ros.engine.detection.manifolds import current
from rigid_sim_ros.engine.dynamics.integrate import sum_loads
from rigid_sim_ros.engine.joints.shake import MOST_PARTS
from rigid_sim_ros.engine.steps.articulated import go_back, next_size
from rigid_sim_ros.engine.steps.jointed_contact import (
    BEGIN, begin, choose, end, find_touching, JointedContact, keep_first_half, PARTS_DONE,
    reach, read_way, retry_unresolved, SIZE, SLOWED, STAGE, STEPS, take_first_half,
    take_second_half, take_way, TRIES)
from rigid_sim_ros.kernels.kernel import kernel

# Ways that are tried with what met on the ones before; of a chain of shapes that hit each other
# one more in each.
MOST_TRIES = 4
# At which stage a step goes on: what touches is found; the first half of a part of it; what met on
# the way is found; the way is taken; what presses at its end is chosen; the second half.
SEEK, FIRST, LOOK_BACK, ARRIVE, CHOOSE, SECOND = range(BEGIN + 1, BEGIN + 7)


@kernel
def run(c: JointedContact) -> int:
    """Run through the stages until no steps are left; return DONE, or what is needed first."""
    while c.place[STEPS] > 0:
        stage, why = c.place[STAGE], DONE
        if stage == BEGIN:
            begin(c)
            c.place[PARTS_DONE], c.place[SIZE] = 0, next_size(c.joints.motion)
            _begin_part(c)
        elif stage == SEEK:
            why = _seek(c)
        elif stage == FIRST:
            _take_first_half(c)
        elif stage == LOOK_BACK:
            why = _look_back(c)
        elif stage == ARRIVE:
            take_way(c, _length(c))
            c.place[STAGE] = CHOOSE
        elif stage == CHOOSE:
            _choose_loaded(c)
            why = choose(c, SECOND)
        else:
            _take_second_half(c)
        if why != DONE:
            return why
    return DONE


@kernel
def _begin_part(c: JointedContact) -> None:
    """Begin a part of a step, in which nothing has met yet."""
    c.place[TRIES], c.place[SLOWED], c.buffers.count[WOKEN] = 0, 0, 0
    c.place[STAGE] = SEEK


@kernel
def _seek(c: JointedContact) -> int:
    """Find the points that take part in the first half of a part of a step."""
    joints, w, h = c.joints, c.buffers, c.joints.model.h
    why = find_touching(c, h)
    if why != DONE:
        return why
    sum_loads(joints.model, joints.state, joints.wrenches, joints.work.loads)
    manifolds = current(c.memory)
    for r in range(manifolds.count[0]):
        speed, least = reach(c, r, h)
        here = c.elsewhere[manifolds.body_a[r]] + c.elsewhere[manifolds.body_b[r]] == 0
        if here and speed * h > least:
            wake(w, manifolds.shape_a[r], manifolds.shape_b[r])
    take_close(w)
    return choose(c, FIRST)


@kernel
def _look_back(c: JointedContact) -> int:
    """Go back if shapes met on the way that took no part in it."""
    why = find_touching(c, 0.0)
    if why != DONE:
        return why
    w = c.buffers
    read_way(c)
    if c.place[TRIES] < MOST_TRIES and wake_met(_length(c), w):
        go_back(c.joints)
        c.place[TRIES] += 1
        c.place[STAGE] = SEEK
    else:
        c.place[STAGE] = ARRIVE
    return DONE


@kernel
def _choose_loaded(c: JointedContact) -> None:
    """Let take part in the second half of a part what it has to stop, or to send back."""
    model, loads = c.joints.model, c.joints.work.loads
    take_loaded(model, c.buffers)
    read_bodies(model, c.joints.state, loads.F, loads.tau, c.buffers.bodies)
    leave_arriving(_length(c), c.buffers)


@kernel
def _length(c: JointedContact) -> float:
    """Return the length [s] of the part of a step that is taken."""
    return c.joints.model.h * c.place[SIZE] / MOST_PARTS


@kernel
def _take_first_half(c: JointedContact) -> None:
    """Take the first half of a part, of a shorter one if its motion is not resolved."""
    if not take_first_half(c, _length(c)):
        if c.place[SIZE] > 1:
            go_back(c.joints)
            c.place[SIZE] //= 2
            return      # what touches is still the same
        if retry_unresolved(c):
            return
    keep_first_half(c)
    c.place[STAGE] = LOOK_BACK


@kernel
def _take_second_half(c: JointedContact) -> None:
    """Take the second half of a part, and end the step after its last one."""
    take_second_half(c, _length(c))
    c.place[PARTS_DONE] += c.place[SIZE]
    _begin_part(c)
    if c.place[PARTS_DONE] == MOST_PARTS:
        c.joints.motion.parts[0] = MOST_PARTS // c.place[SIZE]
        end(c)
