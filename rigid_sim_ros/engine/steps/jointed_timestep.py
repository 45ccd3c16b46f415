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
    choose, find_touching, JointedContact, MORE_BODIES, reach, read_way)
from rigid_sim_ros.engine.steps.jointed_progress import (
    ARRIVE, COLLIDE, FIRST_HALF, SECOND_HALF)
from rigid_sim_ros.engine.steps.jointed_ways import (
    collide_chosen, go_until, may_end_earlier, safe_way, try_again_until)
from rigid_sim_ros.engine.steps.sudden_ways import bounces_at_others, reaches_others
from rigid_sim_ros.kernels.kernel import kernel

# Ways that are tried with what met on the ones before; of a chain of shapes that hit each other
# one more in each.
MOST_LOOKS = 4
# In a step: bounces and limits that are met after which the rest of it is one way, in which what
# bounces does so together at its end.
MOST_EVENTS = 8


@kernel
def collide(c: JointedContact) -> int:
    """Let collide what is to bounce, and choose the points that take part in the first half."""
    joints, w, h = c.joints, c.buffers, c.joints.model.h
    why = find_touching(c, h)
    if why != DONE:
        return why
    sum_loads(joints.model, joints.state, joints.wrenches, joints.work.loads)
    if has_restitution(w):
        _read_touched(c)
    if c.now.cut_short[0] == 0 and any_bounces(h, SHORTEST * h, w):
        take_touching(h, SHORTEST * h, w)
        before = c.now.collisions[0]
        why, again = collide_chosen(c, True, h)
        if why == DONE and c.now.collisions[0] > before and bounces_at_others(c):
            return MORE_BODIES
        if why != DONE or again:
            return why
        _read_touched(c)
    _wake_what_comes_near(c, h)
    take_close(w)
    if may_end_earlier(c):
        _end_at_bounce(c, h)
    return choose(c, FIRST_HALF)


@kernel
def _read_touched(c: JointedContact) -> None:
    """Read the velocities of what touches, under the loads that have been summed."""
    model, state, loads = c.joints.model, c.joints.state, c.joints.work.loads
    read_touched(model, state, loads.F, loads.tau, c.buffers.contacts, c.buffers.bodies)


@kernel
def _wake_what_comes_near(c: JointedContact, h: float) -> None:
    """Let all points of shapes take part that may pass through each other within h [s]."""
    manifolds = current(c.memory)
    for r in range(manifolds.count[0]):
        speed, least = reach(c, r, h)
        here = c.elsewhere[manifolds.body_a[r]] + c.elsewhere[manifolds.body_b[r]] == 0
        if here and speed * h > least:
            wake(c.buffers, manifolds.shape_a[r], manifolds.shape_b[r])


@kernel
def _end_at_bounce(c: JointedContact, h: float) -> None:
    """Leave out what is to bounce at the end of the way, and let that be where it does."""
    bounces = leave_bouncing(h, c.buffers)
    if bounces < math.inf:
        # What goes suddenly passes nothing from which it is to bounce.
        bounces = min(bounces, safe_way(c, sudden=True))
    if bounces < c.now.way[0]:
        go_until(c, bounces)


@kernel
def look_back(c: JointedContact) -> int:
    """Go back if shapes met on the way that took no part in it, or that are elsewhere."""
    if c.now.left[0] == c.joints.model.h and reaches_others(c, c.now.way[0]):
        return MORE_BODIES
    why = find_touching(c, 0.0)
    if why != DONE:
        return why
    w, h = c.buffers, c.now.way[0]
    read_way(c)
    c.now.stage[0] = COLLIDE
    if may_end_earlier(c):
        bounces = bouncing_within(h, c.joints.model.h, w)
        if bounces < h:
            try_again_until(c, bounces)
            return DONE
    if c.now.looks[0] < MOST_LOOKS and wake_met(h, w):
        go_back(c.joints)
        c.now.looks[0] += 1
        return DONE
    c.now.stage[0] = ARRIVE
    return DONE


@kernel
def choose_for_second(c: JointedContact) -> int:
    """Choose for the second half of a way what it has to stop, or to send back."""
    take_loaded(c.joints.model, c.buffers)
    if has_restitution(c.buffers):
        _read_touched(c)
        leave_arriving(c.joints.model.h, c.buffers)
    return choose(c, SECOND_HALF)
