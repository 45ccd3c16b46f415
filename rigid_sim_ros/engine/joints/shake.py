# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The impulses that keep bodies in their joints: in the position, and in the velocity.

SHAKE finds the joint impulses at the start of a step with which the free motion of the bodies ends
where the joints hold. They change the momenta, and the poses follow from these: a correction of
the poses alone would be of first order in the step. RATTLE takes from the momenta at the end what
would tear the joints apart. Both together are of second order and symplectic (Andersen, Rattle,
J. Comp. Phys. 52 (1983); Hairer, Lubich, Wanner, Geometric Numerical Integration, section VII.1).
"""

import math

from rigid_sim_ros.engine.dynamics.free_flight import drift_from
from rigid_sim_ros.engine.joints.articulated import (
    add_momenta, along, axis_part, solve, write_momenta)
from rigid_sim_ros.engine.joints.buffers import (
    FORESEEN, JointMotion, JointWork, LOCKED, PAST, STAGE, STIFF, UNLOCKED)
from rigid_sim_ros.engine.joints.joint_coordinates import joint_error, joint_position
from rigid_sim_ros.engine.joints.laws import follows_way
from rigid_sim_ros.engine.joints.loops import close_one, condition_unit, measure_conditions
from rigid_sim_ros.engine.joints.settle import solve_motions
from rigid_sim_ros.engine.maths.rotation import multiply, quaternion, set_quaternion, unit
from rigid_sim_ros.engine.maths.spatial import minus, set_six, Six, six
from rigid_sim_ros.engine.maths.vector import add_scaled, column, cross, dot, norm, row, set_column
from rigid_sim_ros.engine.model.joints import JointTable, MIMIC, NONE
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.kernel import inlined, kernel

# A round leaves a part of the error that is proportional to the angle of the fastest body in the
# step: 0.1 to 0.6 times that was seen, more where the fastest body is the lightest by far. So a
# last round need not be measured that is known to leave less than _UNSEEN [rad]; metres are over
# the length of the articulation here.
# Where it leaves less than _NEAR the bodies are moved on by what the correction does to first
# order: so far their poses may be from where their momenta would have brought them, but the joints
# are measured, and closed, there.
_LEFT, _UNSEEN, _NEAR = 4.0, 2e-13, 1e-10
# Of the length of an articulation: a lever counts as this much longer, so that none is 0.
_SHORTEST = 1e-3
# As a part, and of what a way is known to in a step: less than this beyond its piece a rate is on
# it.
_PIECE_SLACK, _WAY_SLACK = 1e-9, 10.0
# [rad, or lengths of the articulation] No axis that is STIFF yields by more: errors of the steps
# before, over short levers.
YIELDING = 1e-9
# Of the error, in angles: a step of which the first round leaves more is taken in halves. That is
# a matter of h |w|, not of how large all is or how well the error was expected. With twice as much
# an arm that falls is off three times as far at steps of 4 ms.
RESOLVED = 0.1
# A step that does not resolve the motion is taken in halves, again and again, up to this many
# parts; smaller ones would mean that something else is wrong, and these need but converge.
MOST_PARTS = 64
# Of what joints are closed to: angles that may be of rounding say nothing of that.
_ROUGH = 10.0
# Rounds at most: each leaves half of the error at most. Usually one is enough.
MOST_ROUNDS = 40
_ZERO = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def keep_poses(table: JointTable, state: State, work: JointWork) -> None:
    """Note where the bodies are."""
    for i in range(table.body.shape[0]):
        body = table.body[i]
        for k in range(3):
            work.x[i, k] = state.x[k, body]
        for k in range(4):
            work.q[i, k] = state.q[k, body]


@kernel
def shift_poses(table: JointTable, state: State, work: JointWork, h: float, g: int) -> None:
    """Move articulation g by h [s] of the motions V, which are so small that their order is 1."""
    for i in range(table.first_row[g], table.first_row[g + 1]):
        body, V = table.body[i], six(work.V, i)
        w = (V[3], V[4], V[5])
        r = cross(w, row(work.com, i))
        set_column(state.x, body, add_scaled(column(state.x, body), h, (
            V[0] + r[0], V[1] + r[1], V[2] + r[2])))
        half = 0.5 * h
        set_quaternion(state.q, body, unit(multiply(
            (half * w[0], half * w[1], half * w[2], 1.0), quaternion(state.q, body))))


@kernel
def measure(table: JointTable, state: State, motion: JointMotion, work: JointWork,
            yields: bool, g: int) -> float:
    """
    Write how the joints of articulation g are off; return the largest of it as an angle [rad].

    Metres are over its length. yields: but for axes that are STIFF, off from where they are locked
    by YIELDING at most.
    """
    worst, way, angle = measure_conditions(table, state, motion, work, g), 0.0, 0.0
    for i in range(table.first_row[g], table.first_row[g + 1]):
        j = table.joint[i]
        if j == NONE:
            continue
        e = joint_error(table, state, j)
        # The motions that the joint allows do not count, unless it is locked at a position.
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            e = _without_axis(table, work, k, e)
            work.law.astray[k] = 0.0
            if work.locked[k] != UNLOCKED:
                target, astray = work.law.target[k], 0.0
                if target < math.inf:
                    astray = joint_position(table, state, j, target) - target
                work.law.astray[k] = astray
                off = abs(astray) / work.unit[k]
                if yields and work.locked[k] == STIFF and off <= YIELDING:
                    continue
                worst = max(worst, off)
        for n in range(6):
            work.error[i, n] = table.sense[i] * e[n]
        d, a = dot((e[0], e[1], e[2]), (e[0], e[1], e[2])), dot(
            (e[3], e[4], e[5]), (e[3], e[4], e[5]))
        # A comparison with what is not a number is false: it has to be caught as well.
        way, angle = way if d <= way else d, angle if a <= angle else a
    work.largest[0], work.largest[1] = way, angle
    off = joints_off(work, g)
    return worst if off <= worst else off


@inlined
def joints_off(work: JointWork, g: int) -> float:
    """Return the largest angle [rad], or way over the length, in the joints measured last."""
    way, angle = math.sqrt(work.largest[0]) / work.length[g], math.sqrt(work.largest[1])
    return way if not way <= angle else angle


@kernel
def _measure_ways(table: JointTable, state: State, work: JointWork, h: float, g: int) -> float:
    """
    Write by how much the ways of free axes of articulation g differ from h (rate + bent).

    Returns the largest of these as an angle [rad]; other axes have a 0 there.
    """
    law, worst = work.law, 0.0
    begin, end = table.first_row[g], table.first_row[g + 1]
    for k in range(table.first_axis[begin], table.first_axis[end]):
        if work.locked[k] == UNLOCKED and follows_way(table, work, k):
            q = joint_position(table, state, table.axis_joint[k], law.left_at[k])
            law.astray[k] = q - law.left_at[k] - h * (law.half_rate[k] + law.bent[k])
            worst = max(worst, abs(law.astray[k]) / work.unit[k])
    return worst


@inlined
def _without_axis(table: JointTable, work: JointWork, k: int, e: Six) -> Six:
    s = row(work.s, k)
    a = axis_part(table, work, k, e)
    if table.translates[k] == 1:
        return (e[0] - a * s[0], e[1] - a * s[1], e[2] - a * s[2], e[3], e[4], e[5])
    return (e[0], e[1], e[2], e[3] - a * s[0], e[4] - a * s[1], e[5] - a * s[2])


@kernel
def foresee(table: JointTable, motion: JointMotion, work: JointWork) -> None:
    """Write the relative motions that the joints will need: as a way that was tried, or before."""
    if work.known[FORESEEN] == 0:
        for k in range(work.law.bend.shape[0]):
            work.law.bend[k] = 0.0
        expect(table, motion, work)


@kernel
def expect(table: JointTable, motion: JointMotion, work: JointWork) -> None:
    """
    Write the relative motions c / h that the joints will need, as the steps before needed them.

    c / h is a smooth function of time: a polynomial through n values leaves an error of the order
    h^(n+2) in the pose at the end of the step, and n <= PAST.
    """
    known, past, strain, weight = motion.known[0], motion.curvature, motion.strain, -1.0
    curved, latest = work.curved, PAST * work.known[STAGE]
    curved[:], work.loop.curved[:] = 0.0, 0.0
    for n in range(known):
        # The binomial coefficients of `known`, with changing signs.
        weight = weight * (n - known) / (n + 1)
        for i in range(table.body.shape[0]):
            for k in range(6):
                curved[i, k] += weight * past[latest + n, i, k]
        for m in range(strain.shape[1]):
            work.loop.curved[m] += weight * strain[latest + n, m]
    for i in range(table.body.shape[0]):
        c = six(curved, i)
        # Along its axes a joint needs nothing: what were there would grow, as nothing holds it. So
        # that is where it is remembered by how much ways differ from what rates say.
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            work.law.bent[k] = (axis_part(table, work, k, c) if follows_way(table, work, k)
                                else 0.0)
            c = _without_axis(table, work, k, c)
        set_six(curved, i, c)


@kernel
def remember(table: JointTable, motion: JointMotion, work: JointWork) -> None:
    """Note the relative motions that were needed, of a whole way or of a stage of it."""
    past, strain, latest = motion.curvature, motion.strain, PAST * work.known[STAGE]
    for n in range(latest + PAST - 1, latest, -1):
        for i in range(table.body.shape[0]):
            for k in range(6):
                past[n, i, k] = past[n - 1, i, k]
        for m in range(strain.shape[1]):
            strain[n, m] = strain[n - 1, m]
    for i in range(table.body.shape[0]):
        c = six(work.curved, i)
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            if work.law.bent[k] != 0.0:
                c = minus(c, -work.law.bent[k], along(table, work, k))
        set_six(past[latest], i, c)
    for m in range(strain.shape[1]):
        strain[latest, m] = work.loop.curved[m]
    # All stages of a way are known when the last one is.
    if latest == 0 or latest + PAST == past.shape[0]:
        motion.known[0] = min(motion.known[0] + 1, PAST)


@kernel
def largest_turn(table: JointTable, work: JointWork, h: float, g: int) -> float:
    """
    Return by how much the geometry of articulation g changes in h [s], at most and about.

    By the largest angle of a body [rad], and the longest way along an axis over the levers of its
    body.
    """
    fastest, longest = 0.0, 0.0
    for i in range(table.first_row[g], table.first_row[g + 1]):
        V = six(work.V, i)
        fastest = max(fastest, V[3] * V[3] + V[4] * V[4] + V[5] * V[5])
        if table.joint[i] != NONE:
            for k in range(table.first_axis[i], table.first_axis[i + 1]):
                if table.translates[k] == 1:
                    levers = norm(row(work.arm, i)) + norm(row(work.com, i))
                    levers += _SHORTEST * work.length[g]
                    longest = max(longest, abs(work.rate[k]) / levers)
    return abs(h) * (math.sqrt(fastest) + longest)


@kernel
def shake(model: Model, table: JointTable, state: State, motion: JointMotion, work: JointWork,
          h: float) -> bool:
    """
    Advance the poses by h [s] so that the joints hold, with the joint impulses that this takes.

    The momenta are those after the first kick; place and factor are of the present poses. Returns
    False, with poses and momenta spoiled, if the motion is not resolved by such a step.
    """
    solve_motions(model, table, state, motion, work, h, True)
    for k in range(work.rate.shape[0]):
        work.law.half_rate[k] = work.rate[k]
    # Another row may be the one that depends in the next step: none may have been left to itself.
    for m in range(work.loop.wanted.shape[0]):
        work.loop.curved[m] = work.loop.wanted[m] / h
    write_momenta(model, table, state, work)
    keep_poses(table, state, work)
    for k in range(work.rate.shape[0]):
        if follows_way(table, work, k):
            work.law.left_at[k] = joint_position(table, state, table.axis_joint[k], 0.0)
    drift_from(model, state, table.body, 0, table.body.shape[0], work.x, work.q, h, work.block)
    # Articulations do not know of each other: each takes the rounds that it needs.
    for g in range(table.first_row.shape[0] - 1):
        if not _close_poses(model, table, state, motion, work, h, g):
            return False
    return True


@kernel
def _close_poses(model: Model, table: JointTable, state: State, motion: JointMotion,
                 work: JointWork, h: float, g: int) -> bool:
    """
    Correct the momenta of articulation g, moved by h [s], until it ends where its joints hold.

    An axis may be locked, by dry friction or at its limit, at a position that its loops or its
    coupling give as well, to the tolerance of the steps before. Then both cannot be had to this
    tolerance, and the axis yields.
    """
    stiff = table.lawful > 0 and any_stiff(table, work, g)
    left = _LEFT * largest_turn(table, work, h, g)
    first, last = table.first_row[g], table.first_row[g + 1]
    yields, rounds, before, angle = False, 0, math.inf, math.inf
    for _ in range(MOST_ROUNDS):
        worst = measure(table, state, motion, work, yields, g)
        if table.lawful > 0:
            worst = max(worst, _measure_ways(table, state, work, h, g))
        # Also for what is not a number.
        if stiff and not yields and not worst <= 0.5 * before:
            yields, rounds, before = True, 0, math.inf
            worst = measure(table, state, motion, work, True, g)
        if worst <= work.tolerance[g]:
            return True
        if rounds > 0:
            asked = rounds == 1 and MOST_PARTS * abs(h) > model.h
            most = (RESOLVED if asked else 0.5) * angle
            angle = largest_angle(table, work, yields, g)
            if not angle <= max(most, _ROUGH * work.tolerance[g]):
                return False
            left = max(left, worst / before)
        rounds, before = rounds + 1, worst
        correct(model, table, state, work, h, g)
        for k in range(table.first_axis[first], table.first_axis[last]):
            work.law.half_rate[k] += work.rate[k]
        leaves = worst * (left + worst)
        if leaves <= _NEAR:
            shift_poses(table, state, work, h, g)
        else:
            drift_from(model, state, table.body, first, last, work.x, work.q, h, work.block)
        if not stiff and leaves <= _UNSEEN:
            return True
        if rounds == 1:
            angle = largest_angle(table, work, yields, g)   # of what was measured
    return False


@kernel
def largest_angle(table: JointTable, work: JointWork, yields: bool, g: int) -> float:
    """
    Return the largest way or angle that joints are off [rad], metres over the length.

    Those of articulation g, which was measured last, without axes that yield. That is the same
    where all is larger, smaller or turned.
    """
    worst = joints_off(work, g)
    begin, end = table.first_row[g], table.first_row[g + 1]
    for k in range(table.first_axis[begin], table.first_axis[end]):
        if work.locked[k] == LOCKED or (work.locked[k] == STIFF and not yields):
            off = abs(work.law.astray[k]) / work.unit[k]
            worst = worst if off <= worst else off
    for m in range(table.first_condition[g], table.first_condition[g + 1]):
        off = abs(work.loop.off[m]) / condition_unit(table, work, m, g)
        worst = worst if off <= worst else off
    return worst


@kernel
def any_stiff(table: JointTable, work: JointWork, g: int) -> bool:
    """Return whether any axis of articulation g is STIFF."""
    begin, end = table.first_row[g], table.first_row[g + 1]
    for k in range(table.first_axis[begin], table.first_axis[end]):
        if work.locked[k] == STIFF:
            return True
    return False


@kernel
def correct(model: Model, table: JointTable, state: State, work: JointWork, h: float,
            g: int) -> None:
    """Change momenta of articulation g by joint impulses that take its errors back, to order 1."""
    first, last = table.first_row[g], table.first_row[g + 1]
    ask_back(table, work, h, g)
    solve(table, work, first, last, False, True)
    if table.first_condition[g + 1] > table.first_condition[g]:
        close_one(model, table, state, work, False, g)
    for m in range(table.first_condition[g], table.first_condition[g + 1]):
        work.loop.curved[m] += work.loop.wanted[m] / h
    add_momenta(model, table, state, work, first, last)


@kernel
def ask_back(table: JointTable, work: JointWork, h: float, g: int) -> None:
    """Ask for the relative motions that take the errors of articulation g back in h [s]."""
    rate, first, last = 1.0 / h, table.first_row[g], table.first_row[g + 1]
    for k in range(table.first_axis[first], table.first_axis[last]):
        work.tau[k], work.given[k] = 0.0, 0.0
        if work.locked[k] == UNLOCKED and work.law.astray[k] != 0.0:
            # It goes another way than its armature and springs were reckoned with.
            work.tau[k] = -work.extra[k] * rate * work.law.astray[k]
            work.law.bent[k] += rate * work.law.astray[k]
    for i in range(first, last):
        set_six(work.F, i, _ZERO)
        c = minus(_ZERO, rate, six(work.error, i))
        set_six(work.curved, i, minus(six(work.curved, i), -rate, c))
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            if work.locked[k] == UNLOCKED or work.law.target[k] == math.inf:
                continue
            c = minus(c, work.law.astray[k] / h, along(table, work, k))
            if work.locked[k] == LOCKED:
                work.law.bend[k] += work.law.astray[k] / h
            else:
                # It has yielded, at a rate that the conditions have seen: so they see this one.
                work.given[k] = -work.law.astray[k] / h
                way = work.law.target[k] + work.law.astray[k] - work.law.before[k]
                work.law.bend[k] = way / h - work.law.half_rate[k]
        set_six(work.c, i, c)
    for m in range(table.first_condition[g], table.first_condition[g + 1]):
        work.loop.wanted[m] = -work.loop.off[m] / h
        if table.condition_place[m] == MIMIC:
            # How such an axis goes back is no rate along it, which the condition would see.
            own, other = table.coupled_axis[m, 0], table.coupled_axis[m, 1]
            work.loop.wanted[m] += (_way_back(work, own)
                                    - table.coupling[m, 0] * _way_back(work, other)) / h


@inlined
def _way_back(work: JointWork, k: int) -> float:
    """Return how far an axis that is LOCKED is from where it is to be."""
    return work.law.astray[k] if work.locked[k] == LOCKED else 0.0


@kernel
def rattle(model: Model, table: JointTable, state: State, motion: JointMotion, work: JointWork,
           h: float) -> None:
    """
    Take from the momenta what would tear the joints apart; place and factor are given.

    With what acts along the axes in the second half of a step of h [s].
    """
    solve_motions(model, table, state, motion, work, h, False)
    for k in range(work.rate.shape[0]):
        motion.rate[k] = work.rate[k]
    write_momenta(model, table, state, work)


@kernel
def leaves_active_set(table: JointTable, state: State, work: JointWork, h: float,
                      strict: bool) -> bool:
    """
    Return whether a joint that is free has passed its limit, and note what its rate did not say.

    A position goes its rate times h [s], and a little more or less where its parent turns.
    strict: also whether a rate has left its piece, which was chosen by the expected c: after a
    shock they are not those that were needed in the end.
    """
    law, found = work.law, False
    for k in range(table.has_laws.shape[0]):
        if table.has_laws[k] == 0 or work.locked[k] != UNLOCKED:
            continue
        q = joint_position(table, state, table.axis_joint[k], law.before[k])
        # Also for what is not a number, of an axis without limits too.
        # Loops that hold the axis at its limit are closed to this, and so is its own joint.
        near = 2.0 * work.near[k]
        if not table.laws.lower[k] - near <= q <= table.laws.upper[k] + near:
            law.bend[k] = (q - law.before[k]) / h - law.half_rate[k]
            found = True
        v = law.half_rate[k]
        slack = _PIECE_SLACK * abs(v) + _WAY_SLACK * work.near[k] / abs(h)
        found = found or (strict and not law.begin[k] - slack <= v <= law.end[k] + slack)
    return found


@kernel
def undo_motion(table: JointTable, state: State, motion: JointMotion, work: JointWork) -> None:
    """Put the bodies back to where they were, with the momenta before the joints acted."""
    for i in range(table.body.shape[0]):
        body = table.body[i]
        for k in range(3):
            state.x[k, body] = work.x[i, k]
            state.P[k, body] = work.before[i, k]
            state.L[k, body] = work.before[i, 3 + k]
        for k in range(4):
            state.q[k, body] = work.q[i, k]
    for k in range(motion.held.shape[0]):
        motion.held[k], motion.held_at[k] = work.law.held[k], work.law.held_at[k]
