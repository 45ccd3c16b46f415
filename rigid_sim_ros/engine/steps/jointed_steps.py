# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The step of bodies that joints hold and that touch each other, as a list of its stages.

The models `timestep` and `event` differ in some of the stages, and in after how many events the
rest of a step is one way.
"""

from collections.abc import Callable
from typing import Any

from rigid_sim_ros.engine.contact.contact_search import DONE
from rigid_sim_ros.engine.joints.limits import (
    first_hit, note_arrived, release_hits, SHARP, SHORTEST, stop_hits)
from rigid_sim_ros.engine.joints.shake import MOST_PARTS
from rigid_sim_ros.engine.steps import jointed_event, jointed_timestep
from rigid_sim_ros.engine.steps.articulated import go_back, next_size
from rigid_sim_ros.engine.steps.jointed_contact import (
    begin, end, JointedContact, keep_first_half, retry_unresolved, take_first_half,
    take_second_half, take_way)
from rigid_sim_ros.engine.steps.jointed_progress import (
    ARRIVE, BEGIN, CHOOSE, COLLIDE, FIRST_HALF, LOOK_BACK)
from rigid_sim_ros.engine.steps.jointed_ways import (
    may_end_earlier, MOST_SEARCHES, part, try_again_until)
from rigid_sim_ros.engine.steps.sudden_ways import forget_sudden, goes_suddenly
from rigid_sim_ros.kernels.kernel import kernel

# A stage that a contact model has for itself; it returns DONE, or what it needs first.
Stage = Callable[[JointedContact], int]


def _steps_by(collide: Stage, look_back: Stage, choose_for_second: Stage,
              most_events: int) -> Any:
    """Return the kernel that takes steps by a model with these stages."""

    @kernel
    def run(c: JointedContact) -> int:
        """Take steps until none are left; return DONE, or what is needed first."""
        while c.now.steps_left[0] > 0:
            stage, why = c.now.stage[0], DONE
            if stage == BEGIN:
                _begin_step(c)
            elif stage == COLLIDE:
                why = collide(c)
            elif stage == FIRST_HALF:
                _try_first_half(c)
            elif stage == LOOK_BACK:
                why = look_back(c)
            elif stage == ARRIVE:
                _arrive(c)
            elif stage == CHOOSE:
                why = choose_for_second(c)
            else:
                _take_second_half(c, most_events)
            if why != DONE:
                return why
        return DONE

    return run


@kernel
def _begin_step(c: JointedContact) -> None:
    """Begin a step, and its first way."""
    now, joints = c.now, c.joints
    begin(c)
    now.events[0], now.collisions[0], now.cut_short[0] = 0, 0, 0
    now.size[0], now.left[0] = next_size(joints.motion), joints.model.h
    _begin_way(c)
    if note_arrived(joints.table, joints.motion, joints.scratch, joints.model.h):
        stop_hits(joints.model, joints.table, joints.state, joints.motion, joints.scratch)


@kernel
def _begin_way(c: JointedContact) -> None:
    """Begin a way, on which nothing has met yet: as long as may be, or all that is left."""
    now, most = c.now, part(c)
    now.tries[0], now.looks[0], now.slowed[0], now.searches[0] = 0, 0, 0, 0
    c.buffers.counts.woken[0] = 0
    forget_sudden(c)
    is_last = now.left[0] < most + SHORTEST * c.joints.model.h
    now.way[0] = now.left[0] if is_last else most
    now.stage[0] = COLLIDE


@kernel
def _try_first_half(c: JointedContact) -> None:
    """
    Take the first half of a way; or go back, if another one is to be tried.

    That is a shorter one, if its motion is not resolved or a joint meets its limit on it; or what
    touches is to be found again, where bodies went farther than was known.
    """
    joints, h = c.joints, c.now.way[0]
    if not take_first_half(c, h):
        if MOST_PARTS * h > joints.model.h:
            go_back(joints)
            c.now.way[0] = 0.5 * h
            while c.now.size[0] > 1 and part(c) > (1.0 + SHARP) * c.now.way[0]:
                c.now.size[0] //= 2
            return      # what touches is still the same
        if retry_unresolved(c):
            return
    if may_end_earlier(c):
        met = first_hit(joints.table, joints.scratch, h)
        if met < h:
            try_again_until(c, met)
            return
    if c.now.searches[0] < MOST_SEARCHES and goes_suddenly(c, h):
        go_back(joints)
        c.now.searches[0] += 1
        c.now.stage[0] = COLLIDE
        return
    keep_first_half(c)
    c.now.stage[0] = LOOK_BACK


@kernel
def _arrive(c: JointedContact) -> None:
    take_way(c, c.now.way[0])
    c.now.stage[0] = CHOOSE


@kernel
def _take_second_half(c: JointedContact, most_events: int) -> None:
    """Take the second half of a way, begin the next one, and end the step after its last one."""
    h, joints = c.now.way[0], c.joints
    hit = release_hits(joints.table, joints.scratch, h)
    take_second_half(c, h)
    if hit:
        stop_hits(joints.model, joints.table, joints.state, joints.motion, joints.scratch)
    if abs(h - part(c)) > SHARP * h:
        joints.motion.known[0] = 0      # what joints needed is of ways of one length
        c.now.events[0] += 1
    if h >= c.now.left[0]:
        joints.motion.parts[0] = MOST_PARTS // c.now.size[0]
        end(c)
        return
    c.now.cut_short[0] = 1 if c.now.events[0] >= most_events else 0
    c.now.left[0] -= h
    _begin_way(c)


TIMESTEP: Any = _steps_by(jointed_timestep.collide, jointed_timestep.look_back,
                          jointed_timestep.choose_for_second, jointed_timestep.MOST_EVENTS)
EVENT: Any = _steps_by(jointed_event.collide, jointed_event.look_back,
                       jointed_event.choose_for_second, jointed_event.MOST_EVENTS)
