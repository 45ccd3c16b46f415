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

import math

from rigid_sim_ros.engine.constraints.articulated_buffers import NEEDED, POINTS_IN_USE, WIDTH
from rigid_sim_ros.engine.constraints.articulated_impact import collide
from rigid_sim_ros.engine.constraints.articulated_points import (
    choose_points, meeting_within, take_all, take_loaded, take_touching)
from rigid_sim_ros.engine.contact.contact_search import DONE
from rigid_sim_ros.engine.contact.contacts import read_bodies
from rigid_sim_ros.engine.contact.recorded_impulses import note, record
from rigid_sim_ros.engine.detection.manifolds import current
from rigid_sim_ros.engine.dynamics.integrate import sum_loads
from rigid_sim_ros.engine.joints.shake import MOST_PARTS
from rigid_sim_ros.engine.steps.articulated import go_back, next_size
from rigid_sim_ros.engine.steps.jointed_contact import (
    BEGIN, begin, choose, COLLISIONS, CUT_SHORT, end, EVENTS, find_touching, JointedContact,
    keep_first_half, MORE_ROWS, reach, read_way, retry_unresolved, SIZE, SLOWED, STAGE, STEPS,
    take_first_half, take_second_half, take_way, TRIES)
from rigid_sim_ros.kernels.kernel import kernel

# In a step: events after which nothing bounces any more, and after which it is not backtracked.
MOST_BOUNCES, MOST_EVENTS = 100, 300
# Ways that are tried until the time of a meeting is known well enough, and as a part of a way what
# the time of a limit is known to.
MOST_TRIES, SHARP = 40, 1e-6
# Of a step: no way is shorter, as joints that close to a tolerance of the position then have no
# velocity that means anything. What would meet within so little touches already.
SHORTEST = 1.0 / 1024.0
# At which stage a step goes on: what touches is found, and collides; the first half of a way; what
# overlaps is found at its end; the second half.
SEEK, FIRST, LOOK_BACK, ARRIVE, CHOOSE, SECOND = range(BEGIN + 1, BEGIN + 7)
# Places in `JointedContact.span`: [s] what is left of the step, and the way that is tried.
LEFT, WAY = range(2)


@kernel
def run(c: JointedContact) -> int:
    """Run through the circle until no steps are left; return DONE, or what is needed first."""
    while c.place[STEPS] > 0:
        stage, why = c.place[STAGE], DONE
        if stage == BEGIN:
            _begin(c)
        elif stage == SEEK:
            why = _meet(c)
        elif stage == FIRST:
            _take_first_half(c)
        elif stage == LOOK_BACK:
            why = _look_back(c)
        elif stage == ARRIVE:
            take_way(c, c.span[WAY])
            c.place[STAGE] = CHOOSE
        elif stage == CHOOSE:
            why = _choose_for_second(c)
        else:
            _take_second_half(c)
        if why != DONE:
            return why
    return DONE


@kernel
def _begin(c: JointedContact) -> None:
    """Begin a step."""
    begin(c)
    place = c.place
    place[EVENTS], place[TRIES], place[COLLISIONS], place[CUT_SHORT] = 0, 0, 0, 0
    place[SLOWED], place[SIZE] = 0, next_size(c.joints.motion)
    c.span[LEFT] = c.joints.model.h
    _try_part(c)
    place[STAGE] = SEEK


@kernel
def _part(c: JointedContact) -> float:
    """Return how long [s] ways are at most: as the motion of the joints is resolved by."""
    return c.joints.model.h * c.place[SIZE] / MOST_PARTS


@kernel
def _try_part(c: JointedContact) -> None:
    """Let the way that is tried be as long as may be, or all that is left."""
    left, part = c.span[LEFT], _part(c)
    c.span[WAY] = left if left < part + SHORTEST * c.joints.model.h else part


@kernel
def _meet(c: JointedContact) -> int:
    """Find what touches now, and let it collide."""
    joints, w = c.joints, c.buffers
    model, state = joints.model, joints.state
    why = find_touching(c, c.span[WAY])
    if why != DONE:
        return why
    sum_loads(model, state, joints.wrenches, joints.work.loads)
    read_bodies(model, state, joints.work.loads.F, joints.work.loads.tau, w.bodies)
    if c.place[CUT_SHORT] == 1:
        take_all(w)
    else:
        take_touching(model.h, SHORTEST * model.h, w)
    w.count[NEEDED] = choose_points(model, joints.table, w)
    if w.count[NEEDED] > w.system.rows.at.shape[0]:
        return MORE_ROWS
    collisions = collide(model, state, joints.table, joints.motion, joints.scratch, model.h,
                         c.place[EVENTS] < MOST_BOUNCES, w)
    if collisions > 0:
        c.place[COLLISIONS] += collisions
        _record_collisions(c)
    if c.place[CUT_SHORT] == 0:
        _go_until(c, _safe_way(c))
    c.place[STAGE] = FIRST
    return DONE


@kernel
def _record_collisions(c: JointedContact) -> None:
    """Record the impulses of what collided; forces begin anew after it."""
    w = c.buffers
    w.pushed[:] = 0.0
    for k in w.chosen[:w.count[POINTS_IN_USE]]:
        for i in range(w.count[WIDTH]):
            w.pushed[k, i] = w.impulse[k, i]
        note(c.joints.state, w.contacts, k, w.impulse[k], w.acted)
    record(c.joints.model, current(c.memory), w.contacts, w.pushed)


@kernel
def _safe_way(c: JointedContact) -> float:
    """Return for how long [s] bodies may go so that nothing passes through anything unseen."""
    way = c.span[WAY]
    for r in range(current(c.memory).count[0]):
        speed, least = reach(c, r, way)
        if speed * way > least:
            way = least / speed
    return way


@kernel
def _go_until(c: JointedContact, t: float) -> None:
    """Let the way that is tried be of about t [s]: neither it nor what is left is too short."""
    left, shortest = c.span[LEFT], SHORTEST * c.joints.model.h
    if t >= left or left < 2.0 * shortest:
        c.span[WAY] = left
    else:
        c.span[WAY] = max(shortest, min(t, left - shortest))


@kernel
def _may_end_earlier(c: JointedContact) -> bool:
    """Return whether the way may be made shorter."""
    return (c.place[CUT_SHORT] == 0 and c.place[TRIES] < MOST_TRIES
            and c.span[WAY] > SHORTEST * c.joints.model.h)


@kernel
def _take_first_half(c: JointedContact) -> None:
    """Take the first half of a way, of a shorter one if a joint meets its limit on it."""
    joints, h = c.joints, c.span[WAY]
    if not take_first_half(c, h):
        if MOST_PARTS * h > joints.model.h:
            go_back(joints)
            c.span[WAY] = 0.5 * h
            while c.place[SIZE] > 1 and _part(c) > (1.0 + SHARP) * c.span[WAY]:
                c.place[SIZE] //= 2
            return      # what touches is still the same
        if retry_unresolved(c):
            return
    hit = _limit_hit(c)
    if _may_end_earlier(c) and hit < (1.0 - 2.0 * SHARP) * h:
        go_back(joints)
        _go_until(c, (1.0 + SHARP) * hit)   # so that it is met for certain
        c.place[TRIES] += 1
        return
    keep_first_half(c)
    c.place[STAGE] = LOOK_BACK


@kernel
def _limit_hit(c: JointedContact) -> float:
    """Return when [s] a joint met its limit on the way; inf: none did."""
    joints, first = c.joints, math.inf
    law, table = joints.scratch.law, joints.table
    for k in range(table.has_laws.shape[0]):
        if table.has_laws[k] == 1 and law.bound[k] != 0 and law.approach[k] != 0.0:
            t = (law.target[k] - law.before[k]) / law.approach[k]
            if t > SHARP * c.span[WAY]:
                first = min(first, t)
    return first


@kernel
def _look_back(c: JointedContact) -> int:
    """Go back if shapes met on the way; else let it be taken."""
    joints, w, h = c.joints, c.buffers, c.span[WAY]
    why = find_touching(c, 0.0)
    if why != DONE:
        return why
    read_way(c)
    if _may_end_earlier(c):
        met = meeting_within(h, w)
        if met < h:
            go_back(joints)
            _go_until(c, met)
            c.place[TRIES] += 1
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


@kernel
def _take_second_half(c: JointedContact) -> None:
    """Take the second half of a way, and end the step after its last one."""
    h = c.span[WAY]
    take_second_half(c, h)
    if abs(h - _part(c)) > SHARP * h:
        c.joints.motion.known[0] = 0      # what joints needed is of ways of one length
        c.place[EVENTS] += 1
    c.place[TRIES], c.place[SLOWED] = 0, 0
    c.place[STAGE] = SEEK
    if h >= c.span[LEFT]:
        c.joints.motion.parts[0] = MOST_PARTS // c.place[SIZE]
        end(c)
        return
    c.place[CUT_SHORT] = 1 if c.place[EVENTS] >= MOST_EVENTS else 0
    c.span[LEFT] -= h
    _try_part(c)
