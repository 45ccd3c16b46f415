# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The moving bodies that may touch something, in blocks of eight, as the sequential solver sees them.

A body has a slot here for one step. Velocity v and angular momentum L are all that contacts
change; the inverse inertia in world axes stays what it was at the start of the step, so that a
step is a linear problem, and the pose moves once, at its end. Slot 0 stands for every body that
does not move: nothing that is added to it is ever different from 0.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray, Vector
from rigid_sim_ros.engine.free_rotation import MAX_ANGLE, turn, turn_fast
from rigid_sim_ros.engine.kernel import inlined, kernel
from rigid_sim_ros.engine.loads import Loads
from rigid_sim_ros.engine.rotation import quaternion, to_matrix
from rigid_sim_ros.engine.state import State
from rigid_sim_ros.engine.vector import add_scaled, column, dot, subtract

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
X = 38  # at the start of the step
Q = 41
INV_I = 45  # reciprocals of the principal moments
BODY_ROWS = 48


class SolverBodies(NamedTuple):
    """Slots for up to n bodies and the one that stands still."""

    slot: IntArray  # (n,) of a body, 0 if it does not take part
    body: IntArray  # (n + 1,) in a slot; -1 in slot 0
    used: IntArray  # (1,) slots in use
    motion: Array  # flat, see MOTION_ROWS
    push: Array  # motion that only displaces, out of overlaps
    drifted: Array  # the sum of both, with which the bodies moved in this substep
    rows: Array  # flat, see BODY_ROWS


def make_bodies(n: int) -> SolverBodies:
    """Return room for n bodies."""
    blocks = n // LANES + 1
    return SolverBodies(np.zeros(n, dtype=np.int64), np.zeros(n + 1, dtype=np.int64),
                        np.zeros(1, dtype=np.int64), np.zeros(blocks * MOTION_ROWS * LANES),
                        np.zeros(blocks * MOTION_ROWS * LANES),
                        np.zeros(blocks * MOTION_ROWS * LANES),
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
def load_bodies(inv_m: Array, inv_I_C: Array, state: State, loads: Loads,
                bodies: SolverBodies) -> None:
    """Copy the bodies that have a slot, and what moves them, into their blocks."""
    used = bodies.used[0]
    end = ((used - 1) // LANES + 1) * LANES
    bodies.motion[:end * MOTION_ROWS] = 0.0
    bodies.push[:end * MOTION_ROWS] = 0.0
    bodies.rows[:end * BODY_ROWS] = 0.0
    rows = bodies.rows
    for slot in range(1, used):
        i = bodies.body[slot]
        at, motion = row_at(slot), motion_at(slot)
        for k in range(3):
            rows[at + (SMOOTH + k) * LANES] = inv_m[i] * loads.F[k, i]
            rows[at + (SMOOTH + 3 + k) * LANES] = loads.tau[k, i]
            v = inv_m[i] * state.P[k, i]
            bodies.motion[motion + k * LANES] = v
            bodies.motion[motion + (3 + k) * LANES] = state.L[k, i]
            rows[at + (START + k) * LANES] = v
            rows[at + (START + 3 + k) * LANES] = state.L[k, i]
            rows[at + (X + k) * LANES] = state.x[k, i]
            rows[at + (INV_I + k) * LANES] = inv_I_C[k, i]
        for k in range(4):
            rows[at + (Q + k) * LANES] = state.q[k, i]
        rows[at + INV_M * LANES] = inv_m[i]
        R = to_matrix(quaternion(state.q, i))
        d = column(inv_I_C, i)
        line = at + J * LANES
        for k in range(3):
            for j in range(k, 3):
                rows[line] = (R[k][0] * d[0] * R[j][0] + R[k][1] * d[1] * R[j][1]
                              + R[k][2] * d[2] * R[j][2])
                line += LANES


@kernel
def kick_bodies(used: int, b: Array, m: Array, h: float, first: bool) -> None:
    """
    Begin a substep: forces act for h [s], and contacts as they did in the last substep.

    That is a warm start of every contact at once, without a pass over contacts. In the first
    substep WARM holds what the contacts bring from the step before.
    """
    for block in range((used - 1) // LANES + 1):
        at, motion = block * BODY_ROWS * LANES, block * MOTION_ROWS * LANES
        if not first:
            for i in range(MOTION_ROWS * LANES):
                b[at + WARM * LANES + i] = m[motion + i] - b[at + BASE * LANES + i]
        for i in range(MOTION_ROWS * LANES):
            base = m[motion + i] + h * b[at + SMOOTH * LANES + i]
            b[at + BASE * LANES + i] = base
            m[motion + i] = base + b[at + WARM * LANES + i]


@kernel
def drift_bodies(used: int, b: Array, m: Array, push: Array, drifted: Array) -> None:
    """Add the motion of this substep to the sums of displacements; forget the push."""
    for block in range((used - 1) // LANES + 1):
        at, motion = (block * BODY_ROWS + SUM) * LANES, block * MOTION_ROWS * LANES
        for i in range(MOTION_ROWS * LANES):
            drifted[motion + i] = m[motion + i] + push[motion + i]
            b[at + i] += drifted[motion + i]
            push[motion + i] = 0.0


@kernel
def store_bodies(h: float, m: Array, state: State, bodies: SolverBodies, substeps: int) -> None:
    """Move the bodies and write their momenta and poses back."""
    for block in range((bodies.used[0] - 1) // LANES + 1):
        b = bodies.rows[block * BODY_ROWS * LANES:(block + 1) * BODY_ROWS * LANES]
        _move(b, bodies.motion[block * MOTION_ROWS * LANES:(block + 1) * MOTION_ROWS * LANES], h,
              substeps)
    for slot in range(1, bodies.used[0]):
        i = bodies.body[slot]
        at, motion = row_at(slot), motion_at(slot)
        for k in range(3):
            state.x[k, i] = bodies.rows[at + (X + k) * LANES]
            state.P[k, i] = m[i] * bodies.motion[motion + k * LANES]
            state.L[k, i] = bodies.motion[motion + (3 + k) * LANES]
        for k in range(4):
            state.q[k, i] = bodies.rows[at + (Q + k) * LANES]


@kernel
def _move(b: Array, motion: Array, h: float, substeps: int) -> None:
    """
    Move the eight bodies of a block by the mean of their velocities over the substeps.

    The velocities are those at the ends of the substeps, which is of first order: a constant
    acceleration a displaces by a h^2 / (2 substeps) too much. That much is taken back from a body
    whose velocity changed smoothly. It is not when the change is an impact, more than twice what
    the forces alone would make in a step, nor against a body that moves, where it would change L
    of the pair.
    """
    for i in range(LANES):
        a, start = _three(b, SMOOTH, i), _three(b, START, i)
        dv = subtract((motion[i], motion[LANES + i], motion[2 * LANES + i]), start)
        smooth = dot(dv, dv) <= 4.0 * h * h * dot(a, a) and b[HELD * LANES + i] == 0.0
        back = -0.5 / substeps if smooth else 0.0
        share = 1.0 / substeps
        v, L, start = _three(b, SUM, i), _three(b, SUM + 3, i), _three(b, START + 3, i)
        dL = subtract((motion[3 * LANES + i], motion[4 * LANES + i], motion[5 * LANES + i]), start)
        v = add_scaled((share * v[0], share * v[1], share * v[2]), back, dv)
        L = add_scaled((share * L[0], share * L[1], share * L[2]), back, dL)
        for k in range(3):
            b[(X + k) * LANES + i] += h * v[k]
            b[(SUM + 3 + k) * LANES + i] = L[k]
    for i in range(LANES):
        L, inv_I = _three(b, SUM + 3, i), _three(b, INV_I, i)
        o = Q * LANES + i
        q = turn((b[o], b[o + LANES], b[o + 2 * LANES], b[o + 3 * LANES]), L, inv_I, h)
        # Too fast for `turn`: below, one by one.
        bound = h * max(inv_I[0], inv_I[1], inv_I[2])
        fast = bound * bound * dot(L, L) > MAX_ANGLE * MAX_ANGLE
        b[HELD * LANES + i] = 1.0 if fast else 0.0
        for k in range(4):
            o = (Q + k) * LANES + i
            b[o] = b[o] if fast else q[k]
    for i in range(LANES):
        if b[HELD * LANES + i] > 0.0:
            o = Q * LANES + i
            q = (b[o], b[o + LANES], b[o + 2 * LANES], b[o + 3 * LANES])
            q = turn_fast(q, _three(b, SUM + 3, i), _three(b, INV_I, i), h)
            for k in range(4):
                b[(Q + k) * LANES + i] = q[k]


@inlined
def _three(b: Array, first: int, i: int) -> Vector:
    """Return three rows of lane i."""
    return (b[first * LANES + i], b[(first + 1) * LANES + i], b[(first + 2) * LANES + i])
