# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Put bodies together by their joints: poses without gaps, motions without tearing."""

import math

from rigid_sim_ros.engine.joints.articulated import gather_momenta, lock, solve, write_momenta
from rigid_sim_ros.engine.joints.buffers import (
    JointMotion, JointWork, LOCKED, UNLOCKED)
from rigid_sim_ros.engine.joints.forward_kinematics import (
    move_forest, pose_forest, read_positions, read_rates)
from rigid_sim_ros.engine.joints.joint_coordinates import has_one_coordinate
from rigid_sim_ros.engine.joints.loops import close
from rigid_sim_ros.engine.joints.settle import factor_all, prepare
from rigid_sim_ros.engine.joints.shake import ask_back, measure, shift_poses
from rigid_sim_ros.engine.maths.rotation import quaternion
from rigid_sim_ros.engine.maths.spatial import set_six
from rigid_sim_ros.engine.maths.vector import column, set_column
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.rates import angular_momentum
from rigid_sim_ros.engine.state.state import body_spin, State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Newton's method squares the gap in each round: a loop that needs more than these cannot close.
_ROUNDS = 60
_ZERO = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
# [rad, or lengths of an articulation] The most by which bodies are moved in a round, so that loops
# close the near way.
_STRIDE = 0.2


@kernel
def assemble(model: Model, table: JointTable, state: State, motion: JointMotion, work: JointWork,
             position: Array, given: IntArray) -> float:
    """
    Put the bodies where the coordinates (j,) say, and close the loops.

    Returns the gap left, an angle [rad] or a way over the length of the articulation.

    Axes with a 1 in given (k,) keep their coordinate; the others may change so that loops close,
    as little as the masses want. Velocities and angular velocities stay what they are.
    """
    _spins_for_momenta(model, table, state)
    pose_forest(table, state, position, work)
    for j in range(position.shape[0]):
        motion.position[j] = position[j]
    gap = math.inf
    for _ in range(_ROUNDS):
        _prepare(model, table, state, work, position, given)
        gap, closed, articulations = 0.0, True, table.first_row.shape[0] - 1
        for g in range(articulations):
            off = measure(table, state, motion, work, False, g)
            gap, closed = gap if off <= gap else off, closed and off <= work.tolerance[g]
            # A change in a time of 1 s is the way itself.
            ask_back(table, work, max(1.0, off / _STRIDE), g)
        if closed or not gap < math.inf:
            break
        solve(table, work, 0, table.body.shape[0], False, True)
        close(model, table, state, work, False)
        for g in range(articulations):
            shift_poses(table, state, work, 1.0, g)
        read_positions(table, state, motion)
        pose_forest(table, state, motion.position, work)
    _momenta_for_spins(model, table, state)
    motion.known[0], motion.parts[0] = 0, 1
    for k in range(motion.held.shape[0]):
        motion.held[k] = 0
    return gap


@kernel
def _spins_for_momenta(model: Model, table: JointTable, state: State) -> None:
    """Let L hold the angular velocities of the bodies while these are turned."""
    for i in range(table.body.shape[0]):
        body = table.body[i]
        set_column(state.L, body, body_spin(model, state, body))


@kernel
def _momenta_for_spins(model: Model, table: JointTable, state: State) -> None:
    for i in range(table.body.shape[0]):
        body = table.body[i]
        set_column(state.L, body, angular_momentum(
            quaternion(state.q, body), column(state.L, body), column(model.I_C, body)))


@kernel
def _prepare(model: Model, table: JointTable, state: State, work: JointWork,
             position: Array, given: IntArray) -> None:
    """Write the factors with the given axes locked where they are."""
    prepare(model, table, state, work)
    for k in range(given.shape[0]):
        work.locked[k] = LOCKED if given[k] == 1 else UNLOCKED
        work.given[k], work.law.astray[k] = 0.0, 0.0
        if given[k] == 1:
            j = table.axis_joint[k]
            # What has no one coordinate keeps its angles, and what floats its place.
            has_one = j != NONE and has_one_coordinate(table.kind[j])
            work.law.target[k] = position[j] if has_one else math.inf
    factor_all(model, table, work)


@kernel
def set_rates(model: Model, table: JointTable, state: State, motion: JointMotion,
              work: JointWork, wanted: Array) -> None:
    """
    Give the bodies motions that the joints allow.

    wanted (k,) are velocities along the axes [rad/s or m/s]; where one is not a number the axis
    keeps what the momenta of the bodies say, as far as the joints allow it.
    """
    prepare(model, table, state, work)
    read_rates(model, table, state, work, motion.rate)
    for k in range(wanted.shape[0]):
        if wanted[k] == wanted[k]:
            motion.rate[k] = wanted[k]
    move_forest(model, table, state, work, motion.rate)
    project(model, table, state, motion, work, wanted)


@kernel
def project(model: Model, table: JointTable, state: State, motion: JointMotion, work: JointWork,
            wanted: Array) -> None:
    """Take from the momenta what would tear joints apart; wanted rates are kept."""
    for k in range(wanted.shape[0]):
        work.locked[k] = LOCKED if wanted[k] == wanted[k] else UNLOCKED
        work.extra[k] = table.laws.armature[k]
    factor_all(model, table, work)
    for k in range(wanted.shape[0]):
        work.given[k] = wanted[k] if work.locked[k] == LOCKED else 0.0
        work.tau[k] = table.laws.armature[k] * motion.rate[k]
    gather_momenta(table, state, work)
    for i in range(table.body.shape[0]):
        set_six(work.c, i, _ZERO)
    for m in range(work.loop.wanted.shape[0]):
        work.loop.wanted[m] = 0.0
    lock(table, work, 0, table.body.shape[0])
    solve(table, work, 0, table.body.shape[0], True, True)
    close(model, table, state, work, True)
    write_momenta(model, table, state, work)
    for k in range(wanted.shape[0]):
        motion.rate[k] = work.rate[k]
        work.locked[k], work.tau[k], work.given[k] = UNLOCKED, 0.0, 0.0
        work.extra[k] = table.laws.armature[k]
    motion.known[0] = 0
