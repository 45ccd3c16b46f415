# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motions of all articulations with what acts in their joints: one linear problem or more."""

import math

from rigid_sim_ros.engine.joints.articulated import factor, gather_momenta, lock, solve
from rigid_sim_ros.engine.joints.buffers import (
    AT_LOWER, AT_UPPER, FACTORED, FELT, JointMotion, JointWork, ROUNDED, SOLVED, TOLERANCE,
    UNLOCKED)
from rigid_sim_ros.engine.joints.effective_inertia import (
    add_loops, effective_inertias, has_damped_loops)
from rigid_sim_ros.engine.joints.joint_coordinates import place_joints
from rigid_sim_ros.engine.joints.laws import (
    begin_laws, end_laws, impact_laws, next_piece, note_efforts, reaction_of, speed_along)
from rigid_sim_ros.engine.joints.loops import close, factor_conditions, place_conditions
from rigid_sim_ros.engine.joints.welded_bodies import longest_lever
from rigid_sim_ros.engine.maths.spatial import minus, set_six, six
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.kernel import kernel

# All axes that left their pieces go on at once, in so many rounds; from then on one in a round,
# which ends for certain (Murty, Note on a Bard-type scheme for solving the complementarity
# problem, Opsearch 11 (1974)), and as many as this are never needed.
_TOGETHER, _ROUNDS = 20, 200
# A joint that meets its limit with no more than what the forces of this many steps give to it
# stays there: it would come back with ever smaller bounces.
_STEPS_AT_REST = 2.0


@kernel
def prepare(model: Model, table: JointTable, state: State, work: JointWork) -> None:
    """Write all that the present poses say, and the factors with every axis free."""
    place(model, table, state, work)
    _free_axes(table, work)
    factor_all(model, table, work)


@kernel
def prepare_step(model: Model, table: JointTable, state: State, work: JointWork) -> None:
    """Write what a step needs of it: where anything acts along axes, it factors by itself."""
    place(model, table, state, work)
    if table.lawful == 0:
        factor_all(model, table, work)


@kernel
def place(model: Model, table: JointTable, state: State, work: JointWork) -> None:
    """Write where everything is at the present poses, of which nothing else is known then."""
    work.known[FACTORED] = work.known[FELT] = work.known[SOLVED] = 0
    place_joints(model, table, state, work)
    for g in range(table.first_row.shape[0] - 1):
        _write_units(model, table, state, work, g)
    if table.condition_joint.shape[0] > 0:
        place_conditions(model, table, state, work)


@kernel
def _write_units(model: Model, table: JointTable, state: State, work: JointWork, g: int) -> None:
    """Write the length of articulation g, and to what its joints are closed: TOLERANCE."""
    farthest, length = 0.0, longest_lever(model, table, work, g)
    begin, end = table.first_row[g], table.first_row[g + 1]
    for i in range(begin, end):
        for n in range(3):
            farthest = max(farthest, abs(state.x[n, table.body[i]]))
    tolerance = max(TOLERANCE, ROUNDED * farthest / length)
    work.length[g], work.tolerance[g] = length, tolerance
    for k in range(table.first_axis[begin], table.first_axis[end]):
        work.unit[k] = length if table.translates[k] == 1 else 1.0
        work.near[k] = tolerance * work.unit[k]


@kernel
def _free_axes(table: JointTable, work: JointWork) -> None:
    if table.lawful > 0:
        for k in range(work.locked.shape[0]):
            work.locked[k], work.extra[k] = UNLOCKED, table.laws.armature[k]


@kernel
def factor_all(model: Model, table: JointTable, work: JointWork) -> None:
    """Write the factors of the trees and of what closes loops in them, if they are others."""
    if work.known[FACTORED] == 1 and _has_same_axes(work):
        return
    factor(model, table, work, 0, table.body.shape[0])
    if table.condition_joint.shape[0] > 0:
        factor_conditions(table, work)
    for k in range(work.locked.shape[0]):
        work.factored_locked[k], work.factored_extra[k] = work.locked[k], work.extra[k]
    work.known[FACTORED] = 1


@kernel
def _has_same_axes(work: JointWork) -> bool:
    """Return whether all axes are locked, and yield, as the factors were written for."""
    for k in range(work.locked.shape[0]):
        if (work.locked[k] != work.factored_locked[k]
                or work.extra[k] != work.factored_extra[k]):
            return False
    return True


@kernel
def _feel(model: Model, table: JointTable, motion: JointMotion, work: JointWork) -> None:
    """
    Write the inertias that the axes feel where all are free, whatever was before.

    With their loops where anything is damped, which is all that depends on them.
    """
    if work.known[FELT] == 1:
        return
    _free_axes(table, work)
    factor(model, table, work, 0, table.body.shape[0])
    effective_inertias(table, work)
    any_loop = False
    for g in range(table.first_row.shape[0] - 1):
        if has_damped_loops(table, motion, g):
            if not any_loop:
                factor_conditions(table, work)
            any_loop = True
            add_loops(table, work, g)
    work.known[FACTORED], work.known[FELT] = 0, 1


@kernel
def solve_motions(model: Model, table: JointTable, state: State, motion: JointMotion,
                  work: JointWork, h: float, first: bool) -> None:
    """
    Find the motions of all bodies, note efforts, and what locked axes are to reach.

    Where contacts found the same motions last they stand.
    """
    if work.known[SOLVED] == 0:
        find_motions(model, table, state, motion, work, h, first)
    work.known[SOLVED] = 0
    if table.lawful > 0:
        note_efforts(table, motion, work, h, first)
        if first:
            _aim(table, motion, work)


@kernel
def find_motions(model: Model, table: JointTable, state: State, motion: JointMotion,
                 work: JointWork, h: float, first: bool) -> None:
    """
    Write the motions that follow from the momenta, the joints and what acts along their axes.

    In the first half of a step of h [s] the joints ask for the relative motions that `expect`
    found, in the second for none.
    """
    if table.lawful > 0 and first:
        _feel(model, table, motion, work)
        begin_laws(table, motion, work, h)
    elif table.lawful > 0:
        end_laws(table, motion, work, h)
    find_pieces(model, table, state, work, h if first else 0.0)


@kernel
def find_motions_after_impact(model: Model, table: JointTable, state: State, motion: JointMotion,
                              work: JointWork) -> None:
    """Write the motions that follow from the momenta and the joints, in no time."""
    if table.lawful > 0:
        impact_laws(table, motion, work)
    find_pieces(model, table, state, work, 0.0)


@kernel
def find_pieces(model: Model, table: JointTable, state: State, work: JointWork,
                ahead: float) -> None:
    """
    Solve for the motions on those pieces of what acts along the axes that they end on.

    It begins on those that they are on; c = ahead * curved.
    """
    if table.lawful == 0:
        _solve(model, table, state, work, ahead)
        return
    for n in range(_ROUNDS):
        find_motions_of_pieces(model, table, state, work, ahead)
        # The last solution stands, with its pieces and factors.
        if n == _ROUNDS - 1 or not _leave_pieces(table, work, n >= _TOGETHER):
            break


@kernel
def find_motions_of_pieces(model: Model, table: JointTable, state: State, work: JointWork,
                           ahead: float) -> None:
    """Write the motions with each axis on its piece, whether it stays on that or not."""
    _factor_pieces(model, table, work)
    _solve(model, table, state, work, ahead)


@kernel
def _solve(model: Model, table: JointTable, state: State, work: JointWork, ahead: float) -> None:
    """Solve with the relative motions c = ahead * curved."""
    asked = ahead != 0.0 or table.lawful > 0
    if asked:
        for i in range(table.body.shape[0]):
            set_six(work.c, i, minus((0.0, 0.0, 0.0, 0.0, 0.0, 0.0), -ahead, six(work.curved, i)))
    gather_momenta(table, state, work)
    if table.lawful > 0:
        lock(table, work, 0, table.body.shape[0])
    solve(table, work, 0, table.body.shape[0], True, asked)
    if table.condition_joint.shape[0] > 0:
        for m in range(work.loop.wanted.shape[0]):
            work.loop.wanted[m] = ahead * work.loop.curved[m]
        close(model, table, state, work, True)


@kernel
def _factor_pieces(model: Model, table: JointTable, work: JointWork) -> None:
    """Write the factors with each axis on its piece; loops use tau and given for their own."""
    law = work.law
    for k in range(work.tau.shape[0]):
        law.tau[k], law.given[k] = work.tau[k], work.given[k]
    factor_all(model, table, work)
    for k in range(work.tau.shape[0]):
        work.tau[k], work.given[k] = law.tau[k], law.given[k]


@kernel
def _leave_pieces(table: JointTable, work: JointWork, one: bool) -> bool:
    """Let the axes go on whose solution is beyond their piece, or only one; return whether any."""
    left = False
    for i in range(table.body.shape[0]):
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            if table.has_laws[k] == 1:
                reaction, speed = 0.0, 0.0
                if work.locked[k] == UNLOCKED:
                    speed = speed_along(table, work, i, k)
                else:
                    reaction = reaction_of(table, work, i, k)
                left = next_piece(work, k, reaction, speed) or left
                if left and one:
                    return True
    return left


@kernel
def _rebound(table: JointTable, motion: JointMotion, work: JointWork, k: int) -> float:
    """Return the rate with which axis k comes back from its limit."""
    approach, bound = work.law.approach[k], work.law.bound[k]
    pushed = abs(approach - motion.rate[k])
    if abs(approach) <= 2.0 * _STEPS_AT_REST * pushed or bound == AT_LOWER | AT_UPPER:
        return 0.0
    return -table.laws.restitution[k] * approach


@kernel
def _aim(table: JointTable, motion: JointMotion, work: JointWork) -> None:
    """Note at which positions the locked axes have to end."""
    law = work.law
    for k in range(table.has_laws.shape[0]):
        if table.has_laws[k] == 0:
            continue
        was_held = motion.held[k] == 1
        motion.held[k] = 0
        if work.locked[k] == UNLOCKED:
            continue
        v = work.given[k]
        if v == law.low[k]:
            law.bound[k] |= AT_LOWER
            law.target[k] = table.laws.lower[k]
        if v == law.high[k]:
            law.bound[k] |= AT_UPPER
            law.target[k] = table.laws.upper[k]
        if law.bound[k] != 0:
            law.back[k] = _rebound(table, motion, work, k)
            if abs(law.target[k] - law.before[k]) <= 10.0 * work.near[k]:
                law.approach[k] = 0.0   # it was there: it meets nothing on this way
        elif v == law.stick[k]:
            if not was_held:
                motion.held_at[k] = law.before[k]
            motion.held[k], law.target[k] = 1, motion.held_at[k]
        else:
            # Its speed is bounded, not its way, which a turning parent bends: to force the way
            # would be more than the drive gives.
            law.target[k] = math.inf
