# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The sequential solver: a step of touching bodies in short substeps.

Each substep lets the forces act, pushes overlaps apart softly while it solves all contacts one after the
other, moves the bodies, and solves once more without the push, so that it leaves no velocity behind
(Catto, Solver2D, 2024; Macklin et al., Small Steps in Physics Simulation, SCA 2019). One sweep per
substep and many substeps converge better than many sweeps of one long step.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray
from rigid_sim_ros.engine.coloring import color_manifolds, Coloring, make_coloring, most_blocks
from rigid_sim_ros.engine.contact_blocks import (
    ABSENT, ARM_A, ARM_B, BLOCK_SIZE, FRICTION, GAP, IMPULSE, INV_M_A, INV_M_B, J_A, J_B, MASS, MOVED, MU, NORMAL,
    PAIR, POINT, POINT_ROWS, prepare_block, put_three, RESIDUAL, ROLL_LEVER, S, SPIN_LEVER, T, TANGENT,
    three, TORSION, TOTAL, TOTAL_T)
from rigid_sim_ros.engine.contact_sweep import Sweep, visit
from rigid_sim_ros.engine.free_flight import fly
from rigid_sim_ros.engine.kernel import kernel
from rigid_sim_ros.engine.loads import kick, Loads
from rigid_sim_ros.engine.manifolds import Manifolds, POINTS
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.shapes import Materials, Shapes
from rigid_sim_ros.engine.solver_bodies import (
    BODY_ROWS, drift_bodies, HELD, INV_M, J, kick_bodies, LANES, load_bodies, make_bodies, motion_at, row_at,
    SolverBodies, store_bodies, WARM)
from rigid_sim_ros.engine.state import State
from rigid_sim_ros.engine.vector import add, add_scaled, cross, dot, row, subtract


class SequentialSettings(NamedTuple):
    """Numbers that trade accuracy for time and softness for speed."""

    substeps: int = 4  # more: stiffer and slower; an overlap under load shrinks with the square
    stiffness: float = 0.25  # frequency of a soft contact times the substep; above 0.5 it rings
    damping: float = 10.0  # its damping ratio; less pushes overlaps out faster
    push_speed: float = 3.0  # [m/s] at most, out of an overlap; more throws what starts inside another


class SequentialWork(NamedTuple):
    """Buffers for one step: nothing here outlives it but the impulses to report."""

    bodies: SolverBodies
    coloring: Coloring
    rolls: IntArray  # (c,) 1 where a manifold resists rolling
    blocks: Array  # flat, BLOCK_SIZE for each block
    lane_row: IntArray  # (lanes,) manifold of a lane, -1 for none
    at_A: IntArray  # (lanes,) where body A stands in bodies.motion
    at_B: IntArray
    shift: Array  # (6, n) displacement [m] and rotation [rad] by collisions since detection
    normal_impulse: Array  # (c, 4) [N s] of the whole step, collisions included
    friction_impulse: Array  # (c, 3) on B [N s], world axes
    residual: Array  # (1,) [m/s] largest change of a contact's velocity in the last sweep
    overlap: Array  # (1,) [m] deepest


def make_work(n: int, capacity: int) -> SequentialWork:
    """Return buffers for n bodies and `capacity` manifolds."""
    lanes = most_blocks(capacity) * LANES

    def integers(count: int) -> IntArray:
        return np.zeros(count, dtype=np.int64)

    # Most of the lanes are never written, and cost address space only.
    return SequentialWork(make_bodies(n), make_coloring(n, capacity), integers(capacity),
                          np.zeros(lanes // LANES * BLOCK_SIZE), integers(lanes), integers(lanes),
                          integers(lanes), np.zeros((6, n)), np.zeros((capacity, POINTS)),
                          np.zeros((capacity, 3)), np.zeros(1), np.zeros(1))


@kernel
def solve_contacts(model: Model, state: State, loads: Loads, shapes: Shapes, materials: Materials,
                   manifolds: Manifolds, settings: SequentialSettings, work: SequentialWork,
                   block: Array) -> None:
    """
    Advance all bodies by one step under the loads, those with a slot in `work.bodies` with contacts.

    Impulses of the manifolds are those to begin with, and afterwards those of this step. `block` is
    scratch for `fly`.
    """
    substeps = settings.substeps
    h = model.h / substeps
    load_bodies(model, state, loads, work.bodies)
    fill_blocks(model, state, shapes, materials, manifolds, 1.0 / substeps, work)
    kick(state, loads, 0.5 * model.h)
    fly(model, state, (0.0, 0.0, 0.0), model.h, np.int64(1), block)
    kick(state, loads, 0.5 * model.h)
    soft, rigid, last = sweeps(settings, h)
    for substep in range(substeps):
        kick_bodies(work.bodies, h, substep == 0)
        sweep(work, soft)
        drift_bodies(work.bodies)
        sweep(work, rigid if substep < substeps - 1 else last)
    keep_impulses(manifolds, work)
    store_bodies(model, state, work.bodies, substeps)


@kernel
def sweeps(settings: SequentialSettings, h: float) -> tuple[Sweep, Sweep, Sweep]:
    """Return the soft sweep, the relaxing one and the last of a step."""
    # An implicit spring and damper of angular frequency w and damping ratio z per unit of mass.
    w = 2.0 * np.pi * settings.stiffness / h
    a1 = 2.0 * settings.damping + h * w
    a2 = h * w * a1
    a3 = 1.0 / (1.0 + a2)
    soft = Sweep(1.0 / h, 0.0, w / a1, settings.push_speed, a2 * a3, a3, 0.0, 0.0)
    rigid = Sweep(1.0 / h, h, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0)
    last = Sweep(1.0 / h, h, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0)
    return soft, rigid, last


@kernel
def sweep(work: SequentialWork, what: Sweep) -> None:
    """Visit every block once."""
    for block in range(work.coloring.blocks[0]):
        lanes = slice(block * LANES, (block + 1) * LANES)
        kind = work.coloring.kind[block]
        points = kind % 3 + 1
        visit(work.blocks[block * BLOCK_SIZE:(block + 1) * BLOCK_SIZE], work.bodies.motion, work.at_A[lanes],
              work.at_B[lanes], points, kind >= 3, what)


@kernel
def fill_blocks(model: Model, state: State, shapes: Shapes, materials: Materials, manifolds: Manifolds,
                share: float, work: SequentialWork) -> None:
    """Bring the manifolds into blocks; `share` is the part of a step that a substep is."""
    for r in range(manifolds.count[0]):
        first, second = shapes.material[manifolds.shape_a[r]], shapes.material[manifolds.shape_b[r]]
        work.rolls[r] = 1 if materials.rolling[first, second] > 0.0 else 0
    blocks = color_manifolds(manifolds, work.bodies.slot, work.bodies.used[0], work.rolls, work.coloring)
    work.lane_row[:blocks * LANES] = -1
    for r in range(manifolds.count[0]):
        if work.coloring.color[r] >= 0:
            work.lane_row[work.coloring.lane[r]] = r
    work.overlap[0] = 0.0
    for block in range(blocks):
        b = work.blocks[block * BLOCK_SIZE:(block + 1) * BLOCK_SIZE]
        b[:] = 0.0
        for i in range(LANES):
            lane = block * LANES + i
            r = work.lane_row[lane]
            if r < 0:
                _fill_empty(b, i)
                work.at_A[lane] = work.at_B[lane] = 0
            else:
                _fill_lane(model, state, manifolds, r, share, work, b, i)
                first = shapes.material[manifolds.shape_a[r]]
                second = shapes.material[manifolds.shape_b[r]]
                b[MU * LANES + i] = materials.friction[first, second]
                b[SPIN_LEVER * LANES + i] = materials.spinning[first, second]
                b[ROLL_LEVER * LANES + i] = materials.rolling[first, second]
                work.at_A[lane] = motion_at(work.bodies.slot[manifolds.body_a[r]])
                work.at_B[lane] = motion_at(work.bodies.slot[manifolds.body_b[r]])
        prepare_block(b)
        for i in range(LANES):
            r = work.lane_row[block * LANES + i]
            if r >= 0:
                _warm_start(manifolds, r, work.bodies, b, i)


@kernel
def _fill_empty(b: Array, i: int) -> None:
    b[(NORMAL + 2) * LANES + i] = 1.0
    for p in range(POINTS):
        b[(POINT + p * POINT_ROWS + GAP) * LANES + i] = ABSENT


@kernel
def _fill_lane(model: Model, state: State, manifolds: Manifolds, r: int, share: float,
               work: SequentialWork, b: Array, i: int) -> None:
    """Copy manifold r to lane i, moved by what collisions shifted since it was found."""
    body_a, body_b = manifolds.body_a[r], manifolds.body_b[r]
    n = row(manifolds.normal, r)
    put_three(b, NORMAL, i, n)
    for k in range(3):
        b[(ARM_B + k) * LANES + i] = state.x[k, body_a] - state.x[k, body_b]
        b[(MOVED + k) * LANES + i] = share * manifolds.friction[r, k]
    b[(FRICTION + 2) * LANES + i] = share * manifolds.spin[r]
    slot_a, slot_b = work.bodies.slot[body_a], work.bodies.slot[body_b]
    rows = work.bodies.rows
    at_a, at_b = row_at(slot_a), row_at(slot_b)
    for k in range(6):
        b[(J_A + k) * LANES + i] = rows[at_a + (J + k) * LANES]
        b[(J_B + k) * LANES + i] = rows[at_b + (J + k) * LANES]
    b[INV_M_A * LANES + i] = rows[at_a + INV_M * LANES]
    b[INV_M_B * LANES + i] = rows[at_b + INV_M * LANES]
    b[PAIR * LANES + i] = 1.0 if slot_a > 0 and slot_b > 0 else 0.0
    shift_a = (work.shift[0, body_a], work.shift[1, body_a], work.shift[2, body_a])
    shift_b = (work.shift[0, body_b], work.shift[1, body_b], work.shift[2, body_b])
    turn_a = (work.shift[3, body_a], work.shift[4, body_a], work.shift[5, body_a])
    turn_b = (work.shift[3, body_b], work.shift[4, body_b], work.shift[5, body_b])
    for p in range(POINTS):
        o = (POINT + p * POINT_ROWS) * LANES + i
        if p >= manifolds.points[r]:
            b[o + GAP * LANES] = ABSENT
            continue
        r_A, r_B = row(manifolds.r_A[r], p), row(manifolds.r_B[r], p)
        gap = manifolds.gap[r, p]
        work.overlap[0] = max(work.overlap[0], -gap)
        # Half way between the surfaces.
        c = subtract(add_scaled(r_A, 0.5 * gap, n), shift_a)
        b[o + S * LANES] = c[0]
        b[o + T * LANES] = c[1]
        b[o + MASS * LANES] = c[2]
        moved = subtract(add(shift_b, cross(turn_b, r_B)), add(shift_a, cross(turn_a, r_A)))
        b[o + GAP * LANES] = gap + dot(n, moved)
        b[o + IMPULSE * LANES] = share * manifolds.impulse[r, p]


@kernel
def _wrench(b: Array, i: int, along_n: float, about_1: float, about_2: float,
            t: tuple[float, float, float]) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return force and torque on B about c, world axes, from components in n, t1, t2."""
    n, t1 = three(b, NORMAL, i), three(b, TANGENT, i)
    t2 = cross(n, t1)
    F = add_scaled(add_scaled((along_n * n[0], along_n * n[1], along_n * n[2]), t[0], t1), t[1], t2)
    torque = add_scaled(add_scaled((t[2] * n[0], t[2] * n[1], t[2] * n[2]), about_1, t1), about_2, t2)
    return F, torque


@kernel
def _warm_start(manifolds: Manifolds, r: int, bodies: SolverBodies, b: Array, i: int) -> None:
    """Let the impulses of lane i act at the start of the first substep."""
    along = about_1 = about_2 = 0.0
    for p in range(manifolds.points[r]):
        o = (POINT + p * POINT_ROWS) * LANES + i
        along += b[o + IMPULSE * LANES]
        about_1 += b[o + T * LANES] * b[o + IMPULSE * LANES]
        about_2 -= b[o + S * LANES] * b[o + IMPULSE * LANES]
    F, torque = _wrench(b, i, along, about_1, about_2, three(b, FRICTION, i))
    slot_a, slot_b = bodies.slot[manifolds.body_a[r]], bodies.slot[manifolds.body_b[r]]
    if slot_a > 0:
        _add_warm(bodies, slot_a, -b[INV_M_A * LANES + i], F, -1.0, add(cross(three(b, ARM_A, i), F), torque))
    if slot_b > 0:
        _add_warm(bodies, slot_b, b[INV_M_B * LANES + i], F, 1.0, add(cross(three(b, ARM_B, i), F), torque))


@kernel
def _add_warm(bodies: SolverBodies, slot: int, inv_m: float, F: tuple[float, float, float], sign: float,
              torque: tuple[float, float, float]) -> None:
    at = row_at(slot) + WARM * LANES
    for k in range(3):
        bodies.rows[at + k * LANES] += inv_m * F[k]
        bodies.rows[at + (3 + k) * LANES] += sign * torque[k]


@kernel
def keep_impulses(manifolds: Manifolds, work: SequentialWork) -> None:
    """Write the impulses of the step to the manifolds, and give pairs back what L their motion cost."""
    residual = 0.0
    for block in range(work.coloring.blocks[0]):
        b = work.blocks[block * BLOCK_SIZE:(block + 1) * BLOCK_SIZE]
        for i in range(LANES):
            r = work.lane_row[block * LANES + i]
            if r < 0:
                continue
            residual = max(residual, b[RESIDUAL * LANES + i])
            pressure = 0.0
            for p in range(manifolds.points[r]):
                impulse = b[(POINT + p * POINT_ROWS + TOTAL) * LANES + i]
                manifolds.impulse[r, p] = impulse
                work.normal_impulse[r, p] += impulse
                pressure += impulse
            F, _ = _wrench(b, i, 0.0, 0.0, 0.0, three(b, TOTAL_T, i))
            for k in range(3):
                manifolds.friction[r, k] = F[k]
                work.friction_impulse[r, k] += F[k]
            manifolds.spin[r] = b[(TOTAL_T + 2) * LANES + i]
            if b[PAIR * LANES + i] == 1.0 and pressure > 0.0:
                _give_back(manifolds, r, work.bodies, b, i)
    work.residual[0] = residual


@kernel
def _give_back(manifolds: Manifolds, r: int, bodies: SolverBodies, b: Array, i: int) -> None:
    """Take half of the angular momentum that a pair gained from each body: the point followed both."""
    gained = three(b, TORSION, i)
    for slot in (bodies.slot[manifolds.body_a[r]], bodies.slot[manifolds.body_b[r]]):
        bodies.rows[row_at(slot) + HELD * LANES] = 1.0
        at = motion_at(slot)
        for k in range(3):
            bodies.motion[at + (3 + k) * LANES] -= 0.5 * gained[k]
