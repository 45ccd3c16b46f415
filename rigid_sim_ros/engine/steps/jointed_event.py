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
    choose, find_touching, JointedContact, read_way)
from rigid_sim_ros.engine.steps.jointed_progress import (
    ARRIVE, COLLIDE, FIRST_HALF, SECOND_HALF)
from rigid_sim_ros.engine.steps.jointed_ways import (
    collide_chosen, go_until, may_end_earlier, safe_way, try_again_until)
from rigid_sim_ros.kernels.kernel import kernel

# In a step: events after which nothing bounces any more, and after which it is not backtracked.
MOST_BOUNCES, MOST_EVENTS = 100, 300


@kernel
def collide(c: JointedContact) -> int:
    """Find what touches now, and let it collide."""
    joints, w = c.joints, c.buffers
    model, state = joints.model, joints.state
    why = find_touching(c, c.now.way[0])
    if why != DONE:
        return why
    sum_loads(model, state, joints.wrenches, joints.work.loads)
    read_touched(model, state, joints.work.loads.F, joints.work.loads.tau, w.contacts, w.bodies)
    if c.now.cut_short[0] == 1:
        take_all(w)
    else:
        take_touching(model.h, SHORTEST * model.h, w)
    why, again = collide_chosen(c, c.now.events[0] < MOST_BOUNCES, c.now.way[0])
    if why != DONE or again:
        return why
    if c.now.cut_short[0] == 0:
        go_until(c, safe_way(c, sudden=False))
    c.now.stage[0] = FIRST_HALF
    return DONE


@kernel
def look_back(c: JointedContact) -> int:
    """Go back if shapes met on the way; else let it be taken."""
    w, h = c.buffers, c.now.way[0]
    why = find_touching(c, 0.0)
    if why != DONE:
        return why
    read_way(c)
    if may_end_earlier(c):
        met = meeting_within(h, w)
        if met < h:
            try_again_until(c, met)
            c.now.stage[0] = COLLIDE
            return DONE
    c.now.stage[0] = ARRIVE
    return DONE


@kernel
def choose_for_second(c: JointedContact) -> int:
    """Choose the points that take part in the second half."""
    w = c.buffers
    take_loaded(c.joints.model, w)
    if c.now.cut_short[0] == 0:
        # What has just met collides when the next way begins.
        for k in range(w.contacts.count[0]):
            w.active[k] = 1 if w.match[k] >= 0 else 0
    return choose(c, SECOND_HALF)
