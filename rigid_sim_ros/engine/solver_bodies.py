# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The moving bodies that may touch something, in blocks of eight, as the sequential solver sees them.

A body has a slot here for one step. Velocity v and angular momentum L are all that contacts change; the
inverse inertia in world axes stays what it was at the start of the step, so that a step is a
linear problem, and the pose moves once, at its end. Slot 0 stands for every body that does not
move: nothing that is added to it is ever different from 0.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray
from rigid_sim_ros.engine.free_rotation import MAX_ANGLE, turn, turn_fast
from rigid_sim_ros.engine.kernel import kernel
from rigid_sim_ros.engine.loads import Loads
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.rotation import exponential, multiply, quaternion, set_quaternion, to_matrix
from rigid_sim_ros.engine.state import State
from rigid_sim_ros.engine.vector import column

LANES = 8
# Rows of a block of `motion`: v [m/s], L [kg m^2/s], world axes.
MOTION_ROWS = 6
# Rows of a block of `bodies`.
SMOOTH = 0  # F / m [m/s^2] and torque [N m] of all that is no contact
BASE = 6  # v, L of this substep without contacts
WARM = 12  # what contacts added in the last substep
SUM = 18  # sums of v, L over the substeps
START = 24  # v, L at the start of the step
J = 30  # inverse inertia, world axes: xx, xy, xz, yy, yz, zz
INV_M = 36
HELD = 37  # 1: pressed against a body that moves
POSE = 38  # x and q at the start of the step
BODY_ROWS = 45


class SolverBodies(NamedTuple):
    """Slots for up to n bodies and the one that stands still."""

    slot: IntArray  # (n,) of a body, 0 if it does not take part
    body: IntArray  # (n + 1,) in a slot; -1 in slot 0
    used: IntArray  # (1,) slots in use
    motion: Array  # flat, see MOTION_ROWS
    rows: Array  # flat, see BODY_ROWS


def make_bodies(n: int) -> SolverBodies:
    """Return room for n bodies."""
    blocks = n // LANES + 1
    return SolverBodies(np.zeros(n, dtype=np.int64), np.zeros(n + 1, dtype=np.int64),
                        np.zeros(1, dtype=np.int64), np.zeros(blocks * MOTION_ROWS * LANES),
                        np.zeros(blocks * BODY_ROWS * LANES))


@kernel
def motion_at(slot: int) -> int:
    """Return where v_x of a slot stands in `motion`; the next row is LANES further."""
    return (slot >> 3) * (MOTION_ROWS * LANES) + (slot & 7)


@kernel
def row_at(slot: int) -> int:
    """Return where the first row of a slot stands in `rows`."""
    return (slot >> 3) * (BODY_ROWS * LANES) + (slot & 7)


@kernel
def load_bodies(model: Model, state: State, loads: Loads, bodies: SolverBodies) -> None:
    """Copy the bodies that have a slot, and what moves them, into their blocks."""
    used = bodies.used[0]
    end = ((used - 1) // LANES + 1) * LANES
    bodies.motion[:end * MOTION_ROWS] = 0.0
    bodies.rows[:end * BODY_ROWS] = 0.0
    rows = bodies.rows
    for slot in range(1, used):
        i = bodies.body[slot]
        at, motion = row_at(slot), motion_at(slot)
        for k in range(3):
            rows[at + (SMOOTH + k) * LANES] = model.inv_m[i] * loads.F[k, i]
            rows[at + (SMOOTH + 3 + k) * LANES] = loads.tau[k, i]
            v = model.inv_m[i] * state.P[k, i]
            bodies.motion[motion + k * LANES] = v
            bodies.motion[motion + (3 + k) * LANES] = state.L[k, i]
            rows[at + (START + k) * LANES] = v
            rows[at + (START + 3 + k) * LANES] = state.L[k, i]
            rows[at + (POSE + k) * LANES] = state.x[k, i]
        for k in range(4):
            rows[at + (POSE + 3 + k) * LANES] = state.q[k, i]
        rows[at + INV_M * LANES] = model.inv_m[i]
        R = to_matrix(quaternion(state.q, i))
        d = column(model.inv_I_C, i)
        line = at + J * LANES
        for k in range(3):
            for j in range(k, 3):
                rows[line] = (R[k][0] * d[0] * R[j][0] + R[k][1] * d[1] * R[j][1]
                              + R[k][2] * d[2] * R[j][2])
                line += LANES


@kernel
def kick_bodies(bodies: SolverBodies, h: float, first: bool) -> None:
    """
    Begin a substep: forces act for h [s], and contacts as they did in the last substep.

    That is a warm start of every contact at once, without a pass over contacts. In the first
    substep WARM holds what the contacts bring from the step before.
    """
    b, m = bodies.rows, bodies.motion
    for block in range((bodies.used[0] - 1) // LANES + 1):
        at, motion = block * BODY_ROWS * LANES, block * MOTION_ROWS * LANES
        for i in range(MOTION_ROWS * LANES):
            if not first:
                b[at + WARM * LANES + i] = m[motion + i] - b[at + BASE * LANES + i]
                base = m[motion + i] + h * b[at + SMOOTH * LANES + i]
            else:
                base = m[motion + i] + h * b[at + SMOOTH * LANES + i]
            b[at + BASE * LANES + i] = base
            m[motion + i] = base + b[at + WARM * LANES + i]


@kernel
def drift_bodies(bodies: SolverBodies) -> None:
    """Add the motion of this substep to the sums of which the displacements are made."""
    b, m = bodies.rows, bodies.motion
    for block in range((bodies.used[0] - 1) // LANES + 1):
        at, motion = (block * BODY_ROWS + SUM) * LANES, block * MOTION_ROWS * LANES
        for i in range(MOTION_ROWS * LANES):
            b[at + i] += m[motion + i]


@kernel
def store_bodies(model: Model, state: State, bodies: SolverBodies, substeps: int) -> None:
    """
    Write momenta and poses back.

    The substeps moved the bodies with the velocities at their ends, which is of first order: for a constant
    acceleration a it displaces by a h^2 / (2 substeps) too much. That much is taken back from a body whose
    velocity changed smoothly. It is not when the change is an impact, more than twice what the forces alone would make
    in a step, nor against a body that moves, where it would change L of the pair.
    """
    h = model.h
    b = bodies.rows
    for slot in range(1, bodies.used[0]):
        i = bodies.body[slot]
        at, motion = row_at(slot), motion_at(slot)
        forces = changes = 0.0
        for k in range(3):
            a = b[at + (SMOOTH + k) * LANES]
            dv = bodies.motion[motion + k * LANES] - b[at + (START + k) * LANES]
            forces += a * a * h * h
            changes += dv * dv
        smooth = changes <= 4.0 * forces and b[at + HELD * LANES] == 0.0
        back = 0.5 / substeps if smooth else 0.0
        for k in range(3):
            v = bodies.motion[motion + k * LANES]
            dv = v - b[at + (START + k) * LANES]
            mean = b[at + (SUM + k) * LANES] / substeps - back * dv
            state.x[k, i] = b[at + (POSE + k) * LANES] + h * mean
            state.P[k, i] = model.m[i] * v
            state.L[k, i] = bodies.motion[motion + (3 + k) * LANES]
        L = _mean_momentum(b, at, state, i, substeps, back)
        inv_I = column(model.inv_I_C, i)
        bound = max(inv_I[0], inv_I[1], inv_I[2]) * h
        o = at + (POSE + 3) * LANES
        q = (b[o], b[o + LANES], b[o + 2 * LANES], b[o + 3 * LANES])
        if bound * bound * (L[0] * L[0] + L[1] * L[1] + L[2] * L[2]) <= MAX_ANGLE * MAX_ANGLE:
            set_quaternion(state.q, i, turn(q, L, inv_I, h))
        else:
            set_quaternion(state.q, i, turn_fast(q, L, inv_I, h))


@kernel
def _mean_momentum(b: Array, at: int, state: State, i: int, substeps: int,
                   back: float) -> tuple[float, float, float]:
    at_sum, at_start = at + (SUM + 3) * LANES, at + (START + 3) * LANES
    return (b[at_sum] / substeps - back * (state.L[0, i] - b[at_start]),
            b[at_sum + LANES] / substeps - back * (state.L[1, i] - b[at_start + LANES]),
            b[at_sum + 2 * LANES] / substeps - back * (state.L[2, i] - b[at_start + 2 * LANES]))
