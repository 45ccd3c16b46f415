# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The sequential solver: a step of touching bodies in short substeps.

Each substep lets the forces act, solves the velocities of all contacts one after the other, back
and forth, and moves the bodies (Macklin et al., Small Steps in Physics Simulation, SCA 2019: many
substeps converge better than many sweeps of one long step). Overlaps are pushed apart by
displacements of their own. A push by the velocities would make the warm-started impulses an
integral controller of the gap: with the rate e at which the sweeps converge and the rate b of the
push, an error obeys

    s^3 + e s^2 + e s + e b = 0,

which is unstable for b > e. A stack of ten has e = 0.01 a substep, so it would sway for ever.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import aligned_zeros, Array, IntArray, Vector
from rigid_sim_ros.engine.coloring import (
    color_manifolds, Coloring, make_coloring, most_blocks, points_in, QUIET, resists)
from rigid_sim_ros.engine.contact_blocks import (
    ABSENT, ARM_A, ARM_B, BLOCK_SIZE, FRICTION, GAP, IMPULSE, INV_M_A, INV_M_B, J_A, J_B, MOVED,
    MU, NORMAL, PAIR, POINT, POINT_ROWS, prepare_block, put_three, RESIDUAL, ROLL_LEVER, S, SHOVE,
    SPIN_LEVER, T, TANGENT, three, TORSION, TOTAL, TOTAL_T)
from rigid_sim_ros.engine.contact_sweep import (
    count_impulses, is_settled, overlaps, separate, SKIN, Sweep, visit)
from rigid_sim_ros.engine.free_flight import fly
from rigid_sim_ros.engine.kernel import INDEX, kernel, part
from rigid_sim_ros.engine.lanes import LANES
from rigid_sim_ros.engine.loads import kick, Loads
from rigid_sim_ros.engine.manifolds import Manifolds, POINTS
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.shapes import Materials, Shapes
from rigid_sim_ros.engine.shifts import displacement, gap_now
from rigid_sim_ros.engine.solver_bodies import (
    BODY_ROWS, drift_bodies, HELD, J, kick_bodies, load_bodies, make_bodies,
    SolverBodies, store_bodies, STRIDE)
from rigid_sim_ros.engine.state import State
from rigid_sim_ros.engine.vector import add, add_scaled, cross, dot, row


class SequentialSettings(NamedTuple):
    """Numbers that trade accuracy for time and softness for speed."""

    substeps: int = 4  # more: stiffer and slower; an overlap under load shrinks with the square
    # part of an overlap that a substep pushes out; above 0.5 neighbours overshoot
    push: float = 0.2
    # [m/s] at most, out of an overlap; more throws what starts inside another
    push_speed: float = 3.0


class SequentialWork(NamedTuple):
    """Buffers for one step: nothing here outlives it but the impulses to report."""

    bodies: SolverBodies
    coloring: Coloring
    kinds: IntArray  # (c,) classes of the manifolds
    blocks: Array  # flat, BLOCK_SIZE for each block
    fresh: IntArray  # (blocks + 1,) 1 where a lane touches without an impulse to begin with
    shaken: IntArray  # (n + 1,) see `calm`
    visited: IntArray  # (blocks,)
    lane_row: IntArray  # (lanes,) manifold of a lane, -1 for none
    at_A: IntArray  # (lanes,) where body A stands in bodies.motion
    at_B: IntArray
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
                          aligned_zeros(lanes // LANES * BLOCK_SIZE), integers(lanes // LANES + 1),
                          integers(n + 1), integers(lanes // LANES), integers(lanes),
                          integers(lanes), integers(lanes), np.zeros((capacity, POINTS)),
                          np.zeros((capacity, 3)), np.zeros(1), np.zeros(1))


@kernel
def solve_contacts(model: Model, state: State, loads: Loads, shapes: Shapes, materials: Materials,
                   manifolds: Manifolds, waits: IntArray, shifts: Array, shifted: bool,
                   settings: SequentialSettings, work: SequentialWork, block: Array) -> None:
    """
    Advance all bodies by one step, those with a slot in `work.bodies` with contacts.

    Impulses of the manifolds are those to begin with, and afterwards those of this step. A
    manifold with waits (c,) of 1 takes no part. `shifts` are what collisions moved, if `shifted`;
    `block` is scratch for `fly`.
    """
    bodies, blocks, substeps = work.bodies, work.blocks, settings.substeps
    h = model.h / substeps
    load_bodies(model.inv_m, model.inv_I_C, state, loads, bodies)
    classify(manifolds, shapes.material, materials.rolling, work.kinds)
    count = color_manifolds(manifolds.count[0], manifolds.body_a, manifolds.body_b, work.kinds,
                            bodies.slot, bodies.used[0], waits, work.coloring)
    place_lanes(manifolds.count[0], count, work.coloring.color, work.coloring.lane, work.lane_row)
    fill_blocks(count, state.x, shapes.material, materials, manifolds, shifts, shifted,
                1.0 / substeps, work)
    if bodies.used[1] > 0:
        kick(state, loads, 0.5 * model.h)
        fly(model, state, (0.0, 0.0, 0.0), model.h, np.int64(1), block)
        kick(state, loads, 0.5 * model.h)
    for substep in range(substeps):
        kick_bodies(bodies.used[0], bodies.motion, bodies.smooth, bodies.base, bodies.warm, h,
                    substep == 0)
        if substep == 0:
            settle(count, work.fresh, work.coloring.kind, blocks, bodies.motion, bodies.drifted,
                   work.at_A, work.at_B, 1.0 / h)
        sweep(count, work.coloring.kind, blocks, bodies.motion, bodies.drifted, work.at_A,
              work.at_B, Sweep(1.0 / h, h if substep > 0 else 0.0), False)
        calm(count, work.coloring.kind, blocks, bodies.motion, work.at_A, work.at_B, work.shaken,
             work.visited, 1.0 / h)
        sweep_back(count, work.coloring.kind, blocks, bodies.motion, bodies.push, work.at_A,
                   work.at_B, Sweep(1.0 / h, 0.0), settings.push / h, settings.push_speed)
        drift_bodies(bodies.used[0], bodies.motion, bodies.push, bodies.drifted, bodies.total)
    work.residual[0] = keep_impulses(count, blocks, work.lane_row, manifolds, bodies, work.at_A,
                                     work.at_B, h, substeps, work.normal_impulse,
                                     work.friction_impulse)
    store_bodies(model.h, model.m, model.inv_I_C, state, bodies, substeps)


@kernel
def classify(manifolds: Manifolds, material: IntArray, rolling: Array, kinds: IntArray) -> None:
    """Write the class of each manifold, as the colouring wants it."""
    for r in range(manifolds.count[0]):
        points = manifolds.points[r]
        first = material[manifolds.shape_a[r] & INDEX] & INDEX
        second = material[manifolds.shape_b[r] & INDEX] & INDEX
        kinds[r] = min(points - 1, 2)
        if rolling[first, second] > 0.0:
            kinds[r] += 3
        elif points == 1 and manifolds.impulse[r, 0] == 0.0:
            kinds[r] = QUIET


@part
def _visit(block: int, kind: IntArray, blocks: Array, motion: Array, drifted: Array,
           at_A: IntArray, at_B: IntArray, what: Sweep) -> None:
    visit(blocks[block * BLOCK_SIZE:(block + 1) * BLOCK_SIZE], motion, drifted,
          at_A[block * LANES:(block + 1) * LANES], at_B[block * LANES:(block + 1) * LANES],
          points_in(kind[block]), resists(kind[block]), what)


@kernel
def sweep(count: int, kind: IntArray, blocks: Array, motion: Array, drifted: Array, at_A: IntArray,
          at_B: IntArray, what: Sweep, backwards: bool) -> None:
    """
    Visit every block once.

    Backwards in the opposite order, so that two sweeps make a nearly symmetric iteration: its
    errors decay, while those of a one-sided one also rotate, and the warm start, an extrapolation,
    would make that a growing sway of a stack.
    """
    for k in range(count):
        block = count - 1 - k if backwards else k
        _visit(block, kind, blocks, motion, drifted, at_A, at_B, what)


# Visits to a block with new contacts. A box that is put down on a slope slips by 1e-7 m until its
# pressure has moved to where friction wants it; with 6 visits before the first sweep by 1e-10 m.
FRESH_VISITS = 6
# Sweeps where half of all that touches is new, as at the start of a scene: without them a stack of
# 20 sinks by 4 mm before its impulses have grown, and the shock moves it sideways.
FRESH_SWEEPS = 100
# [m/s] a change that others must hear of before the substep ends, in so many sweeps at most
ROUGH = 0.2
CALMING_SWEEPS = 30
# [m/s] a visit that changes velocities less has nothing left to do in this substep
SETTLED = 1e-6


@kernel
def settle(count: int, fresh: IntArray, kind: IntArray, blocks: Array, motion: Array,
           drifted: Array, at_A: IntArray, at_B: IntArray, inv_h: float) -> None:
    """Find impulses for new contacts; the last entry of `fresh` says that these are many."""
    if fresh[-1] == 1:
        for k in range(FRESH_SWEEPS):
            sweep(count, kind, blocks, motion, drifted, at_A, at_B,
                  Sweep(inv_h, 0.0), k % 2 == 1)
        return
    for block in range(count):
        b = blocks[block * BLOCK_SIZE:(block + 1) * BLOCK_SIZE]
        for _ in range(FRESH_VISITS * fresh[block]):
            _visit(block, kind, blocks, motion, drifted, at_A, at_B, Sweep(inv_h, 0.0))
            if is_settled(b, SETTLED):
                break


@kernel
def calm(count: int, kind: IntArray, blocks: Array, motion: Array, at_A: IntArray,
         at_B: IntArray, shaken: IntArray, visited: IntArray, inv_h: float) -> None:
    """
    Let an impact run its course: visit what a rough change reached, until there are no more.

    A clock counts the visits; `shaken` has for each slot when a visit last changed its velocity
    by more than ROUGH, `visited` for each block when it was visited last.
    """
    shaken[:] = 0
    clock = 0
    for block in range(count):
        clock += 1
        visited[block] = clock
        b = blocks[block * BLOCK_SIZE:(block + 1) * BLOCK_SIZE]
        if not is_settled(b, ROUGH):
            _shake(b, block * LANES, at_A, at_B, clock, shaken)
    for k in range(CALMING_SWEEPS if clock > 0 else 0):
        first = clock
        for j in range(count):
            block = count - 1 - j if k % 2 == 0 else j
            if not _was_reached(block, at_A, at_B, shaken, visited):
                continue
            b = blocks[block * BLOCK_SIZE:(block + 1) * BLOCK_SIZE]
            _visit(block, kind, blocks, motion, motion, at_A, at_B, Sweep(inv_h, 0.0))
            clock += 1
            visited[block] = clock
            if not is_settled(b, ROUGH):
                _shake(b, block * LANES, at_A, at_B, clock, shaken)
        if clock == first:
            break


@kernel
def _shake(b: Array, first: int, at_A: IntArray, at_B: IntArray, clock: int,
           shaken: IntArray) -> None:
    """Note which bodies a visit changed roughly; slot 0 stands still."""
    for i in range(LANES):
        if b[RESIDUAL * LANES + i] > ROUGH:
            shaken[at_A[first + i] // STRIDE] = clock
            shaken[at_B[first + i] // STRIDE] = clock
    shaken[0] = 0


@kernel
def _was_reached(block: int, at_A: IntArray, at_B: IntArray, shaken: IntArray,
                 visited: IntArray) -> bool:
    """Return whether a body of a block was shaken since its last visit."""
    for lane in range(block * LANES, (block + 1) * LANES):
        if (shaken[at_A[lane] // STRIDE] > visited[block]
                or shaken[at_B[lane] // STRIDE] > visited[block]):
            return True
    return False


@kernel
def sweep_back(count: int, kind: IntArray, blocks: Array, motion: Array, push: Array,
               at_A: IntArray, at_B: IntArray, what: Sweep, rate: float, speed: float) -> None:
    """
    End a substep: visit what is not settled, in the opposite order, and push overlaps apart.

    What the forward sweep hardly changed is only read: the next one visits every block again.
    """
    for k in range(count):
        block = count - 1 - k
        b = blocks[block * BLOCK_SIZE:(block + 1) * BLOCK_SIZE]
        a, c = at_A[block * LANES:(block + 1) * LANES], at_B[block * LANES:(block + 1) * LANES]
        points = points_in(kind[block])
        if not is_settled(b, SETTLED):
            _visit(block, kind, blocks, motion, motion, at_A, at_B, what)
        count_impulses(b, points)
        if overlaps(b, points):
            separate(b, push, a, c, points, rate, speed)


@kernel
def place_lanes(rows: int, blocks: int, color: IntArray, lane: IntArray,
                lane_row: IntArray) -> None:
    """Write the manifold of every lane."""
    lane_row[:blocks * LANES] = -1
    for r in range(rows):
        if color[r] >= 0:
            lane_row[lane[r]] = r


@kernel
def fill_blocks(count: int, x: Array, material: IntArray, materials: Materials,
                manifolds: Manifolds, shifts: Array, shifted: bool, share: float,
                work: SequentialWork) -> None:
    """Bring the manifolds into blocks; `share` is the part of a step that a substep is."""
    bodies = work.bodies
    work.overlap[0] = 0.0
    touching = fresh = 0
    for block in range(count):
        b = work.blocks[block * BLOCK_SIZE:(block + 1) * BLOCK_SIZE]
        b[:] = 0.0
        work.fresh[block] = 0
        for i in range(LANES):
            lane = block * LANES + i
            r = work.lane_row[lane]
            work.at_A[lane] = work.at_B[lane] = 0
            if r < 0:
                _fill_empty(b, i)
                continue
            body_a, body_b = manifolds.body_a[r], manifolds.body_b[r]
            first, second = material[manifolds.shape_a[r]], material[manifolds.shape_b[r]]
            b[MU * LANES + i] = materials.friction[first, second]
            b[SPIN_LEVER * LANES + i] = materials.spinning[first, second]
            b[ROLL_LEVER * LANES + i] = materials.rolling[first, second]
            gap, pressure = _fill_lane(manifolds, r, share, b, i)
            work.overlap[0] = max(work.overlap[0], -gap)
            if gap < SKIN:
                touching += 1
                if pressure == 0.0:
                    fresh += 1
                    work.fresh[block] = 1
            _fill_bodies(bodies.slot[body_a], bodies.slot[body_b], bodies.rows, b, i)
            for k in range(3):
                b[(ARM_B + k) * LANES + i] = x[k, body_a] - x[k, body_b]
            if shifted:
                _shift_lane(manifolds, r, shifts, b, i)
            work.at_A[lane] = bodies.slot[body_a] * STRIDE
            work.at_B[lane] = bodies.slot[body_b] * STRIDE
        prepare_block(b, points_in(work.coloring.kind[block]))
        for i in range(LANES):
            r = work.lane_row[block * LANES + i]
            if r >= 0:
                _warm_start(bodies.slot[manifolds.body_a[r]], bodies.slot[manifolds.body_b[r]],
                            bodies.warm, b, i)
    work.fresh[-1] = 1 if 2 * fresh > touching else 0


@part
def _fill_empty(b: Array, i: int) -> None:
    b[(NORMAL + 2) * LANES + i] = 1.0
    for p in range(POINTS):
        b[(POINT + p * POINT_ROWS + GAP) * LANES + i] = ABSENT


@part
def _fill_bodies(slot_a: int, slot_b: int, rows: Array, b: Array, i: int) -> None:
    """Copy the inverse masses of the two bodies to lane i."""
    at_a, at_b = (slot_a * BODY_ROWS + J) & INDEX, (slot_b * BODY_ROWS + J) & INDEX
    for k in range(7):
        # J and INV_M follow each other.
        to = J_A + k if k < 6 else INV_M_A
        b[to * LANES + i] = rows[at_a + k]
        to = J_B + k if k < 6 else INV_M_B
        b[to * LANES + i] = rows[at_b + k]
    b[PAIR * LANES + i] = 1.0 if slot_a > 0 and slot_b > 0 else 0.0


@part
def _fill_lane(manifolds: Manifolds, r: int, share: float, b: Array, i: int) -> tuple[float,
                                                                                      float]:
    """Copy manifold r to lane i; return its smallest gap and the sum of its impulses."""
    n = row(manifolds.normal, r)
    put_three(b, NORMAL, i, n)
    for k in range(3):
        b[(MOVED + k) * LANES + i] = share * manifolds.friction[r, k]
    b[(FRICTION + 2) * LANES + i] = share * manifolds.spin[r]
    smallest, pressure = ABSENT, 0.0
    for p in range(POINTS):
        o = (POINT + p * POINT_ROWS) * LANES + i
        if p >= manifolds.points[r]:
            b[o + GAP * LANES] = ABSENT
            continue
        gap = manifolds.gap[r, p]
        smallest = min(smallest, gap)
        pressure += manifolds.impulse[r, p]
        # Half way between the surfaces.
        for k in range(3):
            b[o + k * LANES] = manifolds.r_A[r, p, k] + 0.5 * gap * n[k]
        b[o + GAP * LANES] = gap
        b[o + IMPULSE * LANES] = share * manifolds.impulse[r, p]
    return smallest, pressure


@kernel
def _shift_lane(manifolds: Manifolds, r: int, shifts: Array, b: Array, i: int) -> None:
    """Move lane i by what collisions shifted since its manifold was found."""
    for p in range(manifolds.points[r]):
        o = (POINT + p * POINT_ROWS) * LANES + i
        b[o + GAP * LANES] = gap_now(manifolds, shifts, r, p)
        # The common point stays; the centre of mass of A moved.
        moved = displacement(shifts[manifolds.body_a[r]])
        for k in range(3):
            b[o + k * LANES] -= moved[k]


@kernel
def _wrench(b: Array, i: int, along_n: float, about_1: float, about_2: float,
            t: Vector) -> tuple[Vector, Vector]:
    """Return force and torque on B about c, world axes, from components in n, t1, t2."""
    n, t1 = three(b, NORMAL, i), three(b, TANGENT, i)
    t2 = cross(n, t1)
    F = add_scaled(add_scaled((along_n * n[0], along_n * n[1], along_n * n[2]), t[0], t1), t[1],
                   t2)
    torque = add_scaled(add_scaled((t[2] * n[0], t[2] * n[1], t[2] * n[2]), about_1, t1),
                        about_2, t2)
    return F, torque


@part
def _warm_start(slot_a: int, slot_b: int, warm: Array, b: Array, i: int) -> None:
    """Let the impulses of lane i act at the start of the first substep."""
    along = about_1 = about_2 = 0.0
    for p in range(POINTS):
        o = (POINT + p * POINT_ROWS) * LANES + i
        along += b[o + IMPULSE * LANES]
        about_1 += b[o + T * LANES] * b[o + IMPULSE * LANES]
        about_2 -= b[o + S * LANES] * b[o + IMPULSE * LANES]
    F, torque = _wrench(b, i, along, about_1, about_2, three(b, FRICTION, i))
    if slot_a > 0:
        _add_warm(warm, slot_a, -b[INV_M_A * LANES + i], F, -1.0, add(cross(three(b, ARM_A, i),
                                                                            F), torque))
    if slot_b > 0:
        _add_warm(warm, slot_b, b[INV_M_B * LANES + i], F, 1.0, add(cross(three(b, ARM_B, i), F),
                                                                    torque))


@part
def _add_warm(warm: Array, slot: int, inv_m: float, F: Vector, sign: float,
              torque: Vector) -> None:
    at = slot * STRIDE & INDEX
    for k in range(3):
        warm[at + k] += inv_m * F[k]
        warm[at + 3 + k] += sign * torque[k]


@kernel
def keep_impulses(count: int, blocks: Array, lane_row: IntArray, manifolds: Manifolds,
                  bodies: SolverBodies, at_A: IntArray, at_B: IntArray, h: float, substeps: int,
                  normal_impulse: Array, friction_impulse: Array) -> float:
    """
    Keep the impulses, and give pairs back what L their motion cost; return the residual [m/s].

    The manifolds get those of the last substep, as if it had lasted for the whole step: the next
    step begins with them. A mean over the substeps would lag behind, and a lag feeds the sway of a
    stack.
    """
    residual = 0.0
    for block in range(count):
        b = blocks[block * BLOCK_SIZE:(block + 1) * BLOCK_SIZE]
        for i in range(LANES):
            r = lane_row[block * LANES + i]
            if r < 0:
                continue
            residual = max(residual, b[RESIDUAL * LANES + i])
            pressure = 0.0
            for p in range(manifolds.points[r]):
                o = (POINT + p * POINT_ROWS) * LANES + i
                manifolds.impulse[r, p] = substeps * b[o + IMPULSE * LANES]
                normal_impulse[r, p] += b[o + TOTAL * LANES]
                pressure += b[o + TOTAL * LANES]
            F, _ = _wrench(b, i, 0.0, 0.0, 0.0, three(b, FRICTION, i))
            total, _ = _wrench(b, i, 0.0, 0.0, 0.0, three(b, TOTAL_T, i))
            for k in range(3):
                manifolds.friction[r, k] = substeps * F[k]
                friction_impulse[r, k] += total[k]
            manifolds.spin[r] = substeps * b[(FRICTION + 2) * LANES + i]
            gained = three(b, TORSION, i)
            if b[SHOVE * LANES + i] > 0.0:
                gained = add(gained, _shoved(b, i, bodies.drifted, at_A[block * LANES + i],
                                             at_B[block * LANES + i], h))
            if b[PAIR * LANES + i] == 1.0 and (pressure > 0.0 or dot(gained, gained) > 0.0):
                _give_back(bodies.slot[manifolds.body_a[r]], bodies, gained)
                _give_back(bodies.slot[manifolds.body_b[r]], bodies, gained)
    return residual


@kernel
def _shoved(b: Array, i: int, drifted: Array, at_A: int, at_B: int, h: float) -> Vector:
    """Return the L that a pair gained when the last push displaced its momenta."""
    v = (drifted[at_B] - drifted[at_A], drifted[at_B + 1] - drifted[at_A + 1],
         drifted[at_B + 2] - drifted[at_A + 2])
    n, shove = three(b, NORMAL, i), h * b[SHOVE * LANES + i]
    return cross((shove * n[0], shove * n[1], shove * n[2]), v)


@kernel
def _give_back(slot: int, bodies: SolverBodies, gained: Vector) -> None:
    """Take half of the L that a pair gained from one body: the point follows both."""
    bodies.rows[slot * BODY_ROWS + HELD] = 1.0
    for k in range(3):
        bodies.motion[slot * STRIDE + 3 + k] -= 0.5 * gained[k]
