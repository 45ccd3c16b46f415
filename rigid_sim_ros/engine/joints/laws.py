# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Drives, limits, friction, springs and dampers of joints: forces and bounds along their axes.

In each half of a step what acts along an axis is an impulse over the rate v at the end of that
half: piecewise straight, and nowhere rising. It falls with the gains of dampers, drives and
springs, which are implicit; it is flat where a drive gives all it can; and it is vertical where a
bound lets v not pass, at v = 0 where dry friction sticks, and at the speed up to which a drive
accelerates. Each axis is on one of these pieces. On a straight one the slope enters the factor and
the axis is free; on a vertical one v is given, the axis is locked, and the impulse follows. After
a solution every axis that left its piece goes on to the next one, until none has to.

The two halves of a step are chosen so that each force is of second order, and no gain is too large
for a step. A spring acts with the mean of its forces at both ends of the step (the trapezoidal
rule; Newmark's with beta = 1/4, which is stable for any stiffness). Half of a damper acts in
each half of the step: in the second with the rate at its end, in the first with that at the start,
which is the trapezoidal rule. Of a damper of more than z = h d / (inertia that the axis feels; of
a joint with several, what these feel together) = 2 only 1/z acts with the rate at the start, which
it stops, and 1/2 - 1/z with that at the end of the first half: that keeps a joint that is damped
faster than a step from swinging to the other side. A rate F / d is kept by both halves, whatever
d: what a steady force drags through a damper moves at the rate that it is said to have.
"""

import math

from rigid_sim_ros.engine.joints.articulated import axis_part
from rigid_sim_ros.engine.joints.buffers import (
    AT_LOWER, AT_UPPER, EFFORT, JointMotion, JointWork, STAGE, UNLOCKED)
from rigid_sim_ros.engine.joints.joint_coordinates import has_one_coordinate
from rigid_sim_ros.engine.maths.spatial import load, minus, Six, six, times_motion
from rigid_sim_ros.engine.maths.vector import norm, row
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.kernels.kernel import inlined, kernel

# An axis leaves its piece when impulse or rate are beyond its end by more than this part of them:
# rounding alone must not let it go back and forth.
_SLACK = 1e-12
KINKS = 7       # ends of pieces that an axis may have


@kernel
def begin_laws(table: JointTable, motion: JointMotion, work: JointWork, h: float) -> None:
    """Write what acts in the first half of a step of h [s]; what the axes feel is known."""
    law, laws, drives = work.law, table.laws, motion.drives
    for k in range(table.translates.shape[0]):
        if table.has_laws[k] == 0:
            continue
        q, v = motion.position[table.axis_joint[k]], motion.rate[k]
        z = h * (laws.damping[k] + drives.damping[k]) * _yield(table, work, k)
        begun = (0.5 if z <= 2.0 else 1.0 / z) * h
        ended = 0.5 * h - begun
        law.before[k], law.bound[k] = q, 0
        law.a[k] = (laws.armature[k] * v - begun * laws.damping[k] * v
                    - 0.5 * h * laws.stiffness[k] * (q - laws.rest[k]))
        law.b[k] = (laws.armature[k] + ended * laws.damping[k]
                    + 0.25 * h * h * laws.stiffness[k])
        law.u[k] = (0.5 * h * (drives.effort[k] + drives.stiffness[k] * (drives.position[k] - q))
                    + drives.damping[k] * (begun * (drives.velocity[k] - v)
                                           + ended * drives.velocity[k]))
        law.g[k] = ended * drives.damping[k] + 0.25 * h * h * drives.stiffness[k]
        _go_by_way(work, k)
        law.low[k] = ((laws.lower if h > 0.0 else laws.upper)[k] - q) / h - law.bend[k]
        law.high[k] = ((laws.upper if h > 0.0 else laws.lower)[k] - q) / h - law.bend[k]
        law.stick[k] = -law.bend[k]
        _bound_forces(table, motion, work, k, h)
        # What is to meet a limit begins free: the rate that it would have tells how fast it comes.
        far, is_free = work.near[k] / abs(h), law.high[k] > law.low[k]
        if is_free and v <= law.low[k] < -far:
            _go_to(work, k, law.low[k], 1)
        elif is_free and v >= law.high[k] > far:
            _go_to(work, k, law.high[k], -1)
        else:
            _begin_on(work, k, v, motion.held[k] == 1)


@inlined
def _go_by_way(work: JointWork, k: int) -> None:
    """Let what acts in the first half depend on the mean rate of the step, v + bent."""
    law = work.law
    law.a[k] -= law.b[k] * law.bent[k]
    law.u[k] -= law.g[k] * law.bent[k]


@kernel
def follows_way(table: JointTable, work: JointWork, k: int) -> bool:
    """
    Return whether the mean rate of a step, and not that at its start, is asked of axis k.

    The rotor of a motor is a body that keeps its own momentum while the axis turns with its
    parent: with the rate at the start armatures are of first order there, and springs of second.
    With the mean both are of fourth order in stages.
    """
    if table.has_laws[k] == 0 or not has_one_coordinate(table.kind[table.axis_joint[k]]):
        return False
    return work.known[STAGE] > 0


@kernel
def _yield(table: JointTable, work: JointWork, k: int) -> float:
    """
    Return 1 / (the inertia that axis k feels), summed over all such axes of its joint.

    The sum is the same for whatever axes span the motions of a ball joint, and bounds what any
    direction feels.
    """
    total, j = 0.0, table.axis_joint[k]
    r = table.row_of_joint[j]
    for n in range(table.first_axis[r], table.first_axis[r + 1]):
        if table.translates[n] == table.translates[k]:
            total += 1.0 / work.felt[n]
    return total


@kernel
def has_friction(table: JointTable) -> bool:
    """Return whether there is dry friction in any joint."""
    for k in range(table.has_laws.shape[0]):
        if table.has_laws[k] == 1 and table.laws.friction[k] > 0.0:
            return True
    return False


@kernel
def is_smooth(table: JointTable, motion: JointMotion, work: JointWork, h: float) -> bool:
    """
    Return whether each axis is free after a half step, and none is damped too fast.

    That is by more than can be followed back in time in a step of h [s]: back by a part p < 1 of
    it a damper makes the rate (1 + p z / 2) / (1 - p z / 2) times as large.
    """
    for k in range(table.has_laws.shape[0]):
        if table.has_laws[k] == 1 and (work.locked[k] != UNLOCKED or h * _yield(table, work, k) * (
                table.laws.damping[k] + motion.drives.damping[k]) > 2.0):
            return False
    return True


@kernel
def end_laws(table: JointTable, motion: JointMotion, work: JointWork, h: float) -> None:
    """Write what acts in the second half of a step of h [s]; positions are those at its end."""
    law, laws, drives = work.law, table.laws, motion.drives
    for k in range(table.translates.shape[0]):
        if table.has_laws[k] == 0:
            continue
        q, v = motion.position[table.axis_joint[k]], law.half_rate[k]
        mean = 0.5 * (law.before[k] + q)
        law.a[k] = (laws.armature[k] * (v + law.bent[k])
                    - 0.5 * h * laws.stiffness[k] * (mean - laws.rest[k]))
        law.b[k] = laws.armature[k] + 0.5 * h * laws.damping[k]
        law.u[k] = 0.5 * h * (drives.effort[k] + drives.stiffness[k] * (drives.position[k] - mean)
                              + drives.damping[k] * drives.velocity[k])
        law.g[k] = 0.5 * h * drives.damping[k]
        law.low[k], law.high[k], law.stick[k] = -math.inf, math.inf, 0.0
        if law.bound[k] & AT_LOWER:
            law.low[k] = law.back[k]
        if law.bound[k] & AT_UPPER:
            law.high[k] = law.back[k]
        _bound_forces(table, motion, work, k, h)
        # In no time friction gives no impulse, and holds nothing.
        _begin_on(work, k, v, motion.held[k] == 1 and law.F[k] > 0.0)


@kernel
def impact_laws(table: JointTable, motion: JointMotion, work: JointWork) -> None:
    """
    Write what acts along the axes in no time: armatures, and limits that are reached.

    An axis that has just met one comes back with its share of the rate (limits.py).
    """
    law, laws = work.law, table.laws
    for k in range(table.translates.shape[0]):
        if table.has_laws[k] == 0:
            continue
        q = motion.position[table.axis_joint[k]]
        law.before[k], law.half_rate[k], law.bent[k] = q, motion.rate[k], 0.0
        law.back[k], law.bound[k] = -law.share[k] * motion.rate[k], law.met[k]
        if q <= laws.lower[k] + work.near[k]:
            law.bound[k] |= AT_LOWER
        if q >= laws.upper[k] - work.near[k]:
            law.bound[k] |= AT_UPPER
    end_laws(table, motion, work, 0.0)


@inlined
def _bound_forces(table: JointTable, motion: JointMotion, work: JointWork, k: int,
                  h: float) -> None:
    """Write what friction and drive give in half a step, at most."""
    law, laws = work.law, table.laws
    law.F[k], law.E[k] = 0.5 * h * laws.friction[k], 0.5 * abs(h) * laws.effort[k]
    has_drive = abs(law.u[k]) + law.g[k] > 0.0
    law.fast[k] = laws.velocity[k] if has_drive else math.inf
    law.brakes[k] = 0 if motion.drives.mode[k] == EFFORT else 1


@kernel
def kink_of(work: JointWork, k: int, n: int) -> float:
    """Return the rate where one of the pieces of axis k ends; infinite if there is none."""
    law = work.law
    if n == 0:
        return law.low[k]
    if n == 1:
        return law.high[k]
    if n == 2:
        return law.stick[k] if law.F[k] > 0.0 else math.inf
    if n == 3:
        return law.fast[k]
    if n == 4:
        return -law.fast[k]
    if law.g[k] == 0.0 or law.E[k] == math.inf:
        return math.inf
    return (law.u[k] + (law.E[k] if n == 5 else -law.E[k])) / law.g[k]


@kernel
def drive_impulse(work: JointWork, k: int, v: float, side: int) -> float:
    """Return what the drive of axis k exerts at a rate v, coming from above it (1) or below."""
    law = work.law
    given = min(max(law.u[k] - law.g[k] * v, -law.E[k]), law.E[k])
    if v > law.fast[k] or (v == law.fast[k] and side > 0):
        return min(given, -law.E[k] if law.brakes[k] == 1 else 0.0)
    if v < -law.fast[k] or (v == -law.fast[k] and side < 0):
        return max(given, law.E[k] if law.brakes[k] == 1 else 0.0)
    return given


@kernel
def impulse_at(work: JointWork, k: int, v: float, side: int) -> float:
    """Return all that acts along axis k at a rate v, coming from above it (1) or below (-1)."""
    law = work.law
    if v < law.low[k] or (v == law.low[k] and side < 0):
        return math.inf
    if v > law.high[k] or (v == law.high[k] and side > 0):
        return -math.inf
    friction = law.F[k]
    if v > law.stick[k] or (v == law.stick[k] and side > 0):
        friction = -friction
    return law.a[k] - law.b[k] * v + friction + drive_impulse(work, k, v, side)


@kernel
def _go_to(work: JointWork, k: int, v: float, side: int) -> None:
    """Put axis k on the straight piece that begins at the rate v and goes up (1) or down (-1)."""
    law = work.law
    low, high = -math.inf, math.inf
    for n in range(KINKS):
        kink = kink_of(work, k, n)
        if kink > v or (kink == v and side < 0):
            high = min(high, kink)
        elif kink < v or (kink == v and side > 0):
            low = max(low, kink)
    law.begin[k], law.end[k] = low, high
    work.locked[k] = UNLOCKED
    # A rate in the middle of the piece says whether the drive gives all it can.
    middle = 0.5 * (low + high)
    if low == -math.inf:
        middle = 0.0 if high == math.inf else high - 1.0
    elif high == math.inf:
        middle = low + 1.0
    raw = law.u[k] - law.g[k] * middle
    full = abs(raw) > law.E[k] or abs(middle) > law.fast[k]
    slope = law.b[k] + (0.0 if full else law.g[k])
    work.extra[k] = slope
    work.tau[k] = impulse_at(work, k, middle, side) + slope * middle


@kernel
def _stop_at(work: JointWork, k: int, v: float) -> None:
    """Lock axis k at the rate v, where its law is vertical."""
    work.locked[k], work.given[k], work.tau[k] = work.law.lock[k], v, 0.0
    work.law.begin[k], work.law.end[k] = v, v


@kernel
def _begin_on(work: JointWork, k: int, v: float, held: bool) -> None:
    """Put axis k on the piece of a rate v that is near to the one that will come out."""
    law = work.law
    if held and law.low[k] <= law.stick[k] <= law.high[k]:
        _stop_at(work, k, law.stick[k])
    elif v <= law.low[k]:
        law.approach[k] = v
        _stop_at(work, k, law.low[k])
    elif v >= law.high[k]:
        law.approach[k] = v
        _stop_at(work, k, law.high[k])
    elif abs(v) >= law.fast[k]:
        _stop_at(work, k, law.fast[k] if v > 0.0 else -law.fast[k])
    else:
        _go_to(work, k, v, 1)


@kernel
def next_piece(work: JointWork, k: int, reaction: float, speed: float) -> bool:
    """
    Put axis k on another piece if the solution has left its own; return whether it has.

    reaction is the impulse along a locked axis that the solution needs; speed is that of what the
    axis moves, whose rounding is all that is left of the rate where a loop forbids any.
    """
    law, v = work.law, work.rate[k]
    if work.locked[k] != UNLOCKED:
        v = work.given[k]
        slack = _SLACK * abs(reaction)
        if reaction > impulse_at(work, k, v, -1) + slack:
            _go_to(work, k, v, -1)
            return True
        if reaction < impulse_at(work, k, v, 1) - slack:
            _go_to(work, k, v, 1)
            return True
        return False
    slack = _SLACK * (abs(v) + speed)
    if v < law.begin[k] - slack:
        _cross(work, k, law.begin[k], -1)
        return True
    if v > law.end[k] + slack:
        _cross(work, k, law.end[k], 1)
        return True
    return False


@inlined
def _cross(work: JointWork, k: int, kink: float, side: int) -> None:
    """Go on from a straight piece over its end: to a lock, or to the next straight piece."""
    law = work.law
    if kink == law.low[k] or kink == law.high[k]:
        law.approach[k] = work.rate[k]
    if impulse_at(work, k, kink, -1) > impulse_at(work, k, kink, 1):
        _stop_at(work, k, kink)
    else:
        _go_to(work, k, kink, side)


@kernel
def speed_along(table: JointTable, work: JointWork, i: int, k: int) -> float:
    """Return how fast row i moves [rad/s or m/s], in the manner of its axis k."""
    V = six(work.V, i)
    turning = abs(V[3]) + abs(V[4]) + abs(V[5])
    if table.translates[k] == 0:
        return turning
    return abs(V[0]) + abs(V[1]) + abs(V[2]) + turning * norm(row(work.arm, i))


@kernel
def reaction_of(table: JointTable, work: JointWork, i: int, k: int) -> float:
    """
    Return the impulse along axis k of row i after a solution: s . (A V - F).

    F is also what the conditions beside the tree hand down to the row.
    """
    F: Six = minus(times_motion(load(work.A, i), six(work.V, i)), 1.0, six(work.F, i))
    reaction = axis_part(table, work, k, F)
    if table.condition_joint.shape[0] > 0:
        g = 0
        while table.first_row[g + 1] <= i:
            g += 1
        at = k - table.first_axis[table.first_row[g]]
        for m in range(table.first_condition[g], table.first_condition[g + 1]):
            reaction -= work.loop.impulse[m] * work.loop.handed[m, at]
    return reaction


@kernel
def note_efforts(table: JointTable, motion: JointMotion, work: JointWork, h: float,
                 first: bool) -> None:
    """Write what drive and spring have exerted until the first or second half is over [N m s]."""
    law, laws = work.law, table.laws
    for i in range(table.body.shape[0]):
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            if table.has_laws[k] == 0:
                continue
            v = work.given[k] if work.locked[k] != UNLOCKED else work.rate[k]
            drive = drive_impulse(work, k, v, 0)
            if work.locked[k] != UNLOCKED and v != law.stick[k] and abs(v) == law.fast[k]:
                friction = law.F[k] if v < law.stick[k] else -law.F[k]
                drive = reaction_of(table, work, i, k) - law.a[k] + law.b[k] * v - friction
            way = (h * (v + law.bent[k]) if first
                   else motion.position[table.axis_joint[k]] - law.before[k])
            stretch = law.before[k] + 0.5 * way - laws.rest[k]
            impulse = drive - 0.5 * h * laws.stiffness[k] * stretch
            if first:
                law.half_effort[k] = impulse
            law.effort[k] = impulse + (0.0 if first else law.half_effort[k])
