# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The ways that a step of bodies that joints hold is made of, one after the other.

A way is as long as the motion of the joints is resolved by, and ends where something collides or a
joint meets its limit: the state goes back to its start, and it is tried again until then.
"""

from rigid_sim_ros.engine.constraints.articulated_impact import collide
from rigid_sim_ros.engine.constraints.articulated_points import choose_points
from rigid_sim_ros.engine.contact.contact_search import DONE
from rigid_sim_ros.engine.contact.recorded_impulses import note, record
from rigid_sim_ros.engine.detection.manifolds import current
from rigid_sim_ros.engine.joints.limits import SHORTEST, way_until
from rigid_sim_ros.engine.joints.shake import MOST_PARTS
from rigid_sim_ros.engine.steps.articulated import go_back
from rigid_sim_ros.engine.steps.jointed_contact import JointedContact, MORE_ROWS, reach
from rigid_sim_ros.engine.steps.sudden_ways import outruns_detection
from rigid_sim_ros.kernels.kernel import kernel

# Ways that are tried until the time of a meeting is known well enough.
MOST_TRIES = 40
# Times that what touches is found again where bodies go farther than was known.
MOST_SEARCHES = 8


@kernel
def part(c: JointedContact) -> float:
    """Return how long [s] ways are at most: as the motion of the joints is resolved by."""
    return c.joints.model.h * c.now.size[0] / MOST_PARTS


@kernel
def go_until(c: JointedContact, t: float) -> None:
    """Let the way that is tried be of about t [s]: neither it nor what is left is too short."""
    c.now.way[0] = way_until(t, c.now.left[0], c.joints.model.h)


@kernel
def may_end_earlier(c: JointedContact) -> bool:
    """Return whether the way may be made shorter."""
    return (c.now.cut_short[0] == 0 and c.now.tries[0] < MOST_TRIES
            and c.now.way[0] > SHORTEST * c.joints.model.h)


@kernel
def try_again_until(c: JointedContact, t: float) -> None:
    """Go back to the start of the way, and try one of about t [s]."""
    go_back(c.joints)
    go_until(c, t)
    c.now.tries[0] += 1


@kernel
def collide_chosen(c: JointedContact, elastic: bool, h: float) -> tuple[int, bool]:
    """
    Let the points that take part collide in no time.

    Returns DONE, or what is needed first; and whether what touches is to be found again, as what
    collided goes farther in h [s] than was known.
    """
    joints, w = c.joints, c.buffers
    model, state = joints.model, joints.state
    w.counts.needed[0] = choose_points(model, joints.table, w)
    if w.counts.needed[0] > w.system.rows.at.shape[0]:
        return MORE_ROWS, False
    collisions = collide(model, state, joints.table, joints.motion, joints.scratch, model.h,
                         elastic, w)
    if collisions == 0:
        return DONE, False
    c.now.collisions[0] += collisions
    _record_collisions(c)
    again = c.now.searches[0] < MOST_SEARCHES and outruns_detection(c, h)
    if again:
        c.now.searches[0] += 1
    return DONE, again


@kernel
def safe_way(c: JointedContact, sudden: bool) -> float:
    """
    Return for how long [s] bodies may go so that nothing passes through anything unseen.

    `sudden`: only what goes suddenly is asked.
    """
    way, manifolds, noted = c.now.way[0], current(c.memory), c.buffers.sudden
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
    for k in w.chosen[:w.counts.points[0]]:
        for i in range(w.counts.width[0]):
            w.pushed[k, i] = w.impulse[k, i]
        note(c.joints.state, w.contacts, k, w.impulse[k], w.acted)
    record(c.joints.model, current(c.memory), w.contacts, w.pushed)
