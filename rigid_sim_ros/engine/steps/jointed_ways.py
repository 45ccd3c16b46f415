# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The ways that a step of bodies that joints hold is made of, one after the other.

A way is as long as the motion of the joints is resolved by, and ends where something collides or a
joint meets its limit: the state goes back to its start, and it is tried again until then.
"""

from rigid_sim_ros.engine.constraints.articulated_buffers import (
    NEEDED, POINTS_IN_USE, WIDTH)
from rigid_sim_ros.engine.constraints.articulated_impact import collide
from rigid_sim_ros.engine.constraints.articulated_points import choose_points
from rigid_sim_ros.engine.contact.contact_search import DONE
from rigid_sim_ros.engine.contact.recorded_impulses import note, record
from rigid_sim_ros.engine.detection.manifolds import current
from rigid_sim_ros.engine.joints.limits import (
    first_hit, note_arrived, release_hits, SHARP, SHORTEST, stop_hits, way_until)
from rigid_sim_ros.engine.joints.shake import MOST_PARTS
from rigid_sim_ros.engine.steps.articulated import go_back, next_size
from rigid_sim_ros.engine.steps.jointed_contact import (
    begin, COLLISIONS, CUT_SHORT, end, EVENTS, JointedContact, keep_first_half, LOOKS, MORE_ROWS,
    reach, retry_unresolved, SEARCHES, SIZE, SLOWED, STAGE, take_first_half, take_second_half,
    TRIES)
from rigid_sim_ros.engine.steps.sudden_ways import (
    forget_sudden, goes_suddenly, outruns_detection)
from rigid_sim_ros.kernels.kernel import kernel

# Ways that are tried until the time of a meeting is known well enough.
MOST_TRIES = 40
# Times that what touches is found again where bodies go farther than was known.
MOST_SEARCHES = 8
# Places in `JointedContact.span`: [s] what is left of the step, and the way that is tried.
LEFT, WAY = range(2)


@kernel
def begin_ways(c: JointedContact) -> None:
    """Begin a step."""
    begin(c)
    place = c.place
    place[EVENTS], place[TRIES], place[COLLISIONS], place[CUT_SHORT] = 0, 0, 0, 0
    place[LOOKS], place[SLOWED], place[SEARCHES] = 0, 0, 0
    place[SIZE] = next_size(c.joints.motion)
    c.span[LEFT] = c.joints.model.h
    forget_sudden(c)
    try_part(c)
    joints = c.joints
    if note_arrived(joints.table, joints.motion, joints.scratch, joints.model.h):
        stop_hits(joints.model, joints.table, joints.state, joints.motion, joints.scratch)


@kernel
def part(c: JointedContact) -> float:
    """Return how long [s] ways are at most: as the motion of the joints is resolved by."""
    return c.joints.model.h * c.place[SIZE] / MOST_PARTS


@kernel
def try_part(c: JointedContact) -> None:
    """Let the way that is tried be as long as may be, or all that is left."""
    left, most = c.span[LEFT], part(c)
    c.span[WAY] = left if left < most + SHORTEST * c.joints.model.h else most


@kernel
def go_until(c: JointedContact, t: float) -> None:
    """Let the way that is tried be of about t [s]: neither it nor what is left is too short."""
    c.span[WAY] = way_until(t, c.span[LEFT], c.joints.model.h)


@kernel
def may_end_earlier(c: JointedContact) -> bool:
    """Return whether the way may be made shorter."""
    return (c.place[CUT_SHORT] == 0 and c.place[TRIES] < MOST_TRIES
            and c.span[WAY] > SHORTEST * c.joints.model.h)


@kernel
def try_again_until(c: JointedContact, t: float) -> None:
    """Go back to the start of the way, and try one of about t [s]."""
    go_back(c.joints)
    go_until(c, t)
    c.place[TRIES] += 1


@kernel
def collide_chosen(c: JointedContact, elastic: bool, h: float) -> tuple[int, bool]:
    """
    Let the points that take part collide in no time.

    Returns DONE, or what is needed first; and whether what touches is to be found again, as what
    collided goes farther in h [s] than was known.
    """
    joints, w = c.joints, c.buffers
    model, state = joints.model, joints.state
    w.count[NEEDED] = choose_points(model, joints.table, w)
    if w.count[NEEDED] > w.system.rows.at.shape[0]:
        return MORE_ROWS, False
    collisions = collide(model, state, joints.table, joints.motion, joints.scratch, model.h,
                         elastic, w)
    if collisions == 0:
        return DONE, False
    c.place[COLLISIONS] += collisions
    _record_collisions(c)
    again = c.place[SEARCHES] < MOST_SEARCHES and outruns_detection(c, h)
    if again:
        c.place[SEARCHES] += 1
    return DONE, again


@kernel
def safe_way(c: JointedContact, sudden: bool) -> float:
    """
    Return for how long [s] bodies may go so that nothing passes through anything unseen.

    `sudden`: only what goes suddenly is asked.
    """
    way, manifolds, noted = c.span[WAY], current(c.memory), c.buffers.sudden
    for r in range(manifolds.count[0]):
        if not sudden or noted[manifolds.body_a[r]] + noted[manifolds.body_b[r]] > 0.0:
            speed, least = reach(c, r, way)
            if speed * way > least:
                way = least / speed
    return way


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
def try_first_half(c: JointedContact, seek: int) -> bool:
    """
    Take the first half of a way; return False, with the state back, if another is to be tried.

    That is a shorter one, if its motion is not resolved or a joint meets its limit on it; or what
    touches is to be found again, at the stage `seek`, where bodies went farther than was known.
    """
    joints, h = c.joints, c.span[WAY]
    if not take_first_half(c, h):
        if MOST_PARTS * h > joints.model.h:
            go_back(joints)
            c.span[WAY] = 0.5 * h
            while c.place[SIZE] > 1 and part(c) > (1.0 + SHARP) * c.span[WAY]:
                c.place[SIZE] //= 2
            return False      # what touches is still the same
        if retry_unresolved(c):
            return False
    if may_end_earlier(c):
        met = first_hit(joints.table, joints.scratch, h)
        if met < h:
            try_again_until(c, met)
            return False
    if c.place[SEARCHES] < MOST_SEARCHES and goes_suddenly(c, h):
        go_back(joints)
        c.place[SEARCHES] += 1
        c.place[STAGE] = seek
        return False
    keep_first_half(c)
    return True


@kernel
def take_rest(c: JointedContact, most_events: int) -> None:
    """Take the second half of a way, begin the next one, and end the step after its last one."""
    h, joints = c.span[WAY], c.joints
    hit = release_hits(joints.table, joints.scratch, h)
    take_second_half(c, h)
    if hit:
        stop_hits(joints.model, joints.table, joints.state, joints.motion, joints.scratch)
    if abs(h - part(c)) > SHARP * h:
        joints.motion.known[0] = 0      # what joints needed is of ways of one length
        c.place[EVENTS] += 1
    c.place[TRIES], c.place[LOOKS], c.place[SLOWED], c.place[SEARCHES] = 0, 0, 0, 0
    if h >= c.span[LEFT]:
        joints.motion.parts[0] = MOST_PARTS // c.place[SIZE]
        end(c)
        return
    c.place[CUT_SHORT] = 1 if c.place[EVENTS] >= most_events else 0
    c.span[LEFT] -= h
    forget_sudden(c)
    try_part(c)
