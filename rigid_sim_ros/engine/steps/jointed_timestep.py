# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The model `timestep` of bodies that joints hold and that touch each other.

Kick, drift, kick as without contacts (articulated.py), with impulses of contact in both halves. If
shapes met on the way that took no part, it is taken again with them. What bounces does so at its
own time, in no time: a drive of a high gain gives nothing in that, but far too much to a ball that
it holds against for a step. A way ends there, and where a joint meets its limit.
"""

import math

from rigid_sim_ros.engine.constraints.articulated_buffers import WOKEN
from rigid_sim_ros.engine.constraints.articulated_points import (
    any_bounces, bouncing_within, has_restitution, leave_arriving, leave_bouncing, take_close,
    take_loaded, take_touching, wake, wake_met)
from rigid_sim_ros.engine.contact.contact_search import DONE
from rigid_sim_ros.engine.contact.contacts import read_touched
from rigid_sim_ros.engine.detection.manifolds import current
from rigid_sim_ros.engine.dynamics.integrate import sum_loads
from rigid_sim_ros.engine.joints.limits import SHORTEST
from rigid_sim_ros.engine.steps.articulated import go_back
from rigid_sim_ros.engine.steps.jointed_contact import (
    BEGIN, choose, CUT_SHORT, find_touching, JointedContact, LOOKS, MORE_BODIES, reach,
    read_way, STAGE, STEPS, take_way)
from rigid_sim_ros.engine.steps.jointed_ways import (
    begin_ways, collide_chosen, go_until, LEFT, may_end_earlier, safe_way, take_rest,
    try_again_until, try_first_half, WAY)
from rigid_sim_ros.engine.steps.sudden_ways import reaches_others
from rigid_sim_ros.kernels.kernel import kernel

# Ways that are tried with what met on the ones before; of a chain of shapes that hit each other
# one more in each.
MOST_LOOKS = 4
# In a step: bounces and limits that are met after which the rest of it is one way, in which what
# bounces does so together at its end.
MOST_EVENTS = 8
# At which stage a step goes on: what touches is found; the first half of a way; what met on
# the way is found; the way is taken; what presses at its end is chosen; the second half.
SEEK, FIRST, LOOK_BACK, ARRIVE, CHOOSE, SECOND = range(BEGIN + 1, BEGIN + 7)


@kernel
def run(c: JointedContact) -> int:
    """Run through the stages until no steps are left; return DONE, or what is needed first."""
    while c.place[STEPS] > 0:
        stage, why = c.place[STAGE], DONE
        if stage == BEGIN:
            begin_ways(c)
            _begin_way(c)
        elif stage == SEEK:
            why = _seek(c)
        elif stage == FIRST:
            if try_first_half(c, SEEK):
                c.place[STAGE] = LOOK_BACK
        elif stage == LOOK_BACK:
            why = _look_back(c)
        elif stage == ARRIVE:
            take_way(c, c.span[WAY])
            c.place[STAGE] = CHOOSE
        elif stage == CHOOSE:
            _choose_loaded(c)
            why = choose(c, SECOND)
        else:
            _begin_way(c)
            take_rest(c, MOST_EVENTS)
        if why != DONE:
            return why
    return DONE


@kernel
def _begin_way(c: JointedContact) -> None:
    """Begin a way, on which nothing has met yet."""
    c.buffers.count[WOKEN] = 0
    c.place[STAGE] = SEEK


@kernel
def _seek(c: JointedContact) -> int:
    """Let collide what is to bounce, and find the points that take part in the first half."""
    joints, w, h = c.joints, c.buffers, c.joints.model.h
    model, loads = joints.model, joints.work.loads
    why = find_touching(c, h)
    if why != DONE:
        return why
    sum_loads(model, joints.state, joints.wrenches, loads)
    if has_restitution(w):
        read_touched(model, joints.state, loads.F, loads.tau, w.contacts, w.bodies)
    if c.place[CUT_SHORT] == 0 and any_bounces(h, SHORTEST * h, w):
        take_touching(h, SHORTEST * h, w)
        why, again = collide_chosen(c, True, h)
        if why != DONE or again:
            return why
        read_touched(model, joints.state, loads.F, loads.tau, w.contacts, w.bodies)
    manifolds = current(c.memory)
    for r in range(manifolds.count[0]):
        speed, least = reach(c, r, h)
        here = c.elsewhere[manifolds.body_a[r]] + c.elsewhere[manifolds.body_b[r]] == 0
        if here and speed * h > least:
            wake(w, manifolds.shape_a[r], manifolds.shape_b[r])
    take_close(w)
    if may_end_earlier(c):
        bounces = leave_bouncing(h, w)
        if bounces < math.inf:
            # What goes suddenly passes nothing from which it is to bounce.
            bounces = min(bounces, safe_way(c, sudden=True))
        if bounces < c.span[WAY]:
            go_until(c, bounces)
    return choose(c, FIRST)


@kernel
def _look_back(c: JointedContact) -> int:
    """Go back if shapes met on the way that took no part in it, or that are elsewhere."""
    # Bodies that are elsewhere are still where they were as the step began.
    if c.span[LEFT] == c.joints.model.h and reaches_others(c, c.span[WAY]):
        go_back(c.joints)
        c.place[STAGE] = SEEK
        return MORE_BODIES
    why = find_touching(c, 0.0)
    if why != DONE:
        return why
    w, h = c.buffers, c.span[WAY]
    read_way(c)
    c.place[STAGE] = SEEK
    if may_end_earlier(c):
        bounces = bouncing_within(h, c.joints.model.h, w)
        if bounces < h:
            try_again_until(c, bounces)
            return DONE
    if c.place[LOOKS] < MOST_LOOKS and wake_met(h, w):
        go_back(c.joints)
        c.place[LOOKS] += 1
        return DONE
    c.place[STAGE] = ARRIVE
    return DONE


@kernel
def _choose_loaded(c: JointedContact) -> None:
    """Let take part in the second half of a way what it has to stop, or to send back."""
    model, loads = c.joints.model, c.joints.work.loads
    take_loaded(model, c.buffers)
    if has_restitution(c.buffers):
        read_touched(model, c.joints.state, loads.F, loads.tau, c.buffers.contacts,
                     c.buffers.bodies)
        leave_arriving(c.joints.model.h, c.buffers)
