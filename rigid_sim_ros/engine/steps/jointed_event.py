# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The model `event` of bodies that joints hold: every collision at its own time.

The circle of the classic algorithm (Meyer, Rigid Body Dynamics, "Simulation Algorithm"), with
joints: what touches collides in no time (articulated_impact.py); kick, drift, kick with constant
impulses of contact in both halves, as in `timestep`, but only at points that touch; and if shapes
overlap afterwards that were apart, or a joint met its limit on the way, the state goes back to
where it was and the way ends at the time of that.

All bodies go through this side by side. After MOST_EVENTS in a step the rest of it is taken as
`timestep` takes it.
"""

from rigid_sim_ros.engine.constraints.articulated_points import (
    meeting_within, take_all, take_loaded, take_touching)
from rigid_sim_ros.engine.contact.contact_search import DONE
from rigid_sim_ros.engine.contact.contacts import read_touched
from rigid_sim_ros.engine.dynamics.integrate import sum_loads
from rigid_sim_ros.engine.joints.limits import SHORTEST
from rigid_sim_ros.engine.steps.jointed_contact import (
    BEGIN, choose, CUT_SHORT, EVENTS, find_touching, JointedContact, read_way, STAGE,
    STEPS, take_way)
from rigid_sim_ros.engine.steps.jointed_ways import (
    begin_ways, collide_chosen, go_until, may_end_earlier, safe_way, take_rest, try_again_until,
    try_first_half, WAY)
from rigid_sim_ros.kernels.kernel import kernel

# In a step: events after which nothing bounces any more, and after which it is not backtracked.
MOST_BOUNCES, MOST_EVENTS = 100, 300
# At which stage a step goes on: what touches is found, and collides; the first half of a way; what
# overlaps is found at its end; the second half.
SEEK, FIRST, LOOK_BACK, ARRIVE, CHOOSE, SECOND = range(BEGIN + 1, BEGIN + 7)


@kernel
def run(c: JointedContact) -> int:
    """Run through the circle until no steps are left; return DONE, or what is needed first."""
    while c.place[STEPS] > 0:
        stage, why = c.place[STAGE], DONE
        if stage == BEGIN:
            begin_ways(c)
            c.place[STAGE] = SEEK
        elif stage == SEEK:
            why = _meet(c)
        elif stage == FIRST:
            if try_first_half(c, SEEK):
                c.place[STAGE] = LOOK_BACK
        elif stage == LOOK_BACK:
            why = _look_back(c)
        elif stage == ARRIVE:
            take_way(c, c.span[WAY])
            c.place[STAGE] = CHOOSE
        elif stage == CHOOSE:
            why = _choose_for_second(c)
        else:
            c.place[STAGE] = SEEK
            take_rest(c, MOST_EVENTS)
        if why != DONE:
            return why
    return DONE


@kernel
def _meet(c: JointedContact) -> int:
    """Find what touches now, and let it collide."""
    joints, w = c.joints, c.buffers
    model, state = joints.model, joints.state
    why = find_touching(c, c.span[WAY])
    if why != DONE:
        return why
    sum_loads(model, state, joints.wrenches, joints.work.loads)
    read_touched(model, state, joints.work.loads.F, joints.work.loads.tau, w.contacts, w.bodies)
    if c.place[CUT_SHORT] == 1:
        take_all(w)
    else:
        take_touching(model.h, SHORTEST * model.h, w)
    why, again = collide_chosen(c, c.place[EVENTS] < MOST_BOUNCES, c.span[WAY])
    if why != DONE or again:
        return why
    if c.place[CUT_SHORT] == 0:
        go_until(c, safe_way(c, sudden=False))
    c.place[STAGE] = FIRST
    return DONE


@kernel
def _look_back(c: JointedContact) -> int:
    """Go back if shapes met on the way; else let it be taken."""
    w, h = c.buffers, c.span[WAY]
    why = find_touching(c, 0.0)
    if why != DONE:
        return why
    read_way(c)
    if may_end_earlier(c):
        met = meeting_within(h, w)
        if met < h:
            try_again_until(c, met)
            c.place[STAGE] = SEEK
            return DONE
    c.place[STAGE] = ARRIVE
    return DONE


@kernel
def _choose_for_second(c: JointedContact) -> int:
    """Choose the points that take part in the second half."""
    w = c.buffers
    take_loaded(c.joints.model, w)
    if c.place[CUT_SHORT] == 0:
        # What has just met collides when the next way begins.
        for k in range(w.contacts.count[0]):
            w.active[k] = 1 if w.match[k] >= 0 else 0
    return choose(c, SECOND)
