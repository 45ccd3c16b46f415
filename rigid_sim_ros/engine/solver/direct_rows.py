# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The rows of an island that is solved directly, read from its blocks and written back.

A manifold has up to nine impulses f, about its common point c: four along the normal, at its
points; friction along t1, t2; about n; against rolling about t1, t2. The last three are divided by
a lever, so that all are in N s: the size of the smaller shape against rolling, and about n the one
with which the impulses that friction can make are a ball. With the twists of both bodies, the rate
of row i is

    a_i = G_i (v, w) + least,     G_i (1, 12),

and an impulse f_i adds G_i' f_i to the momenta of the bodies, W_i = G_i M^-1 of which are rates
again. The sequential solver has the same rows, in other words; see contact_blocks.py.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.constraints.contact_blocks import (
    ABSENT, ARM_A, ARM_B, axes, FRICTION, GAP, IMPULSE, INV_I_A, INV_I_B, LEVER_A, LEVER_B, MU,
    NORMAL, POINT, POINT_ROWS, PRESSED, ROLL, ROLL_LEVER, S, SIZE, SPEED, SPIN, SPIN_LEVER,
    store_three, T, TURN_T)
from rigid_sim_ros.engine.constraints.contact_rules import least_speed, Sweep
from rigid_sim_ros.engine.maths.vector import (
    cross, dot, symmetric_cofactors, symmetric_times)
from rigid_sim_ros.engine.solver.coloring import are_balls, Blocks, numbers_of, points_in, resists
from rigid_sim_ros.engine.solver.direct_islands import MOST_MANIFOLDS
from rigid_sim_ros.engine.solver.solver_bodies import INV_I, INV_M, SolverBodies, STRIDE
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.eight import LANES, store
from rigid_sim_ros.kernels.kernel import INDEX, kernel

# Rows of a manifold: four normal impulses, friction, about the normal, against rolling.
WIDTH, SLIDE, ABOUT, ROLLS = 9, 4, 6, 7
DISKS = 3  # at most, of a manifold


class DirectRows(NamedTuple):
    """Room for one island: c manifolds, b bodies."""

    body: IntArray  # (c, 2) places of A and B among the bodies, -1: does not move
    slot: IntArray  # (b,) of the bodies
    place: IntArray  # (slots,) of a slot among the bodies, -1 for none
    there: IntArray  # (c, 9) 1 for a row that there is
    G: Array  # (c, 9, 12)
    W: Array  # (c, 9, 12)
    stiff: Array  # (c, 9) [1/kg] diagonal of A
    rate: Array  # (c, 9) [m/s] a at the impulses to begin with
    least: Array  # (c, 9) [m/s] its part that is no velocity
    f: Array  # (c, 9) [N s] the impulses
    start: Array  # (c, 9) [N s] those to begin with
    inertia: Array  # (b, 7) [kg], [kg m^2] masses and inertia of the bodies, six numbers
    limit: Array  # (c, 3) of the disks per normal force, see `disk_of`
    size: Array  # (c,) [m] of the smaller shape
    lever: Array  # (c,) [m] of the row about n
    centre: Array  # (c, 2) [m] where friction acts, from the common point along t1, t2
    scratch: Array  # (10 * 8,) n, t1, t2 and the least speed of a point, of all lanes of a block


def make_direct_rows(slots: int) -> DirectRows:
    """Return room for the largest island."""
    c, each = MOST_MANIFOLDS, (MOST_MANIFOLDS, WIDTH)
    return DirectRows(np.zeros((c, 2), dtype=np.int64), np.zeros(2 * c, dtype=np.int64),
                      np.full(slots, -1), np.zeros(each, dtype=np.int64), np.zeros((*each, 12)),
                      np.zeros((*each, 12)), np.zeros(each), np.zeros(each), np.zeros(each),
                      np.zeros(each), np.zeros(each), np.zeros((2 * c, 7)), np.zeros((c, 3)),
                      np.zeros(c), np.zeros(c), np.zeros((c, 2)), np.zeros(10 * LANES))


@kernel
def read_island(blocks: Blocks, bodies: SolverBodies, lanes: IntArray, what: Sweep,
                rows: DirectRows) -> tuple[int, int]:
    """
    Read the manifolds of some lanes that are not dormant; return their number and the bodies'.

    `lanes` are changed: those that were read come first.
    """
    count = moving = 0
    for k in range(lanes.shape[0]):
        lane = lanes[k] & INDEX
        if blocks.dormant[lane // LANES] & 1 << lane % LANES != 0:
            continue
        lanes[k], lanes[count] = lanes[count], lane
        for side in range(2):
            at = (blocks.at_A[lane] if side == 0 else blocks.at_B[lane]) & INDEX
            slot = at // STRIDE
            if bodies.motion[at + INV_M] > 0.0 and rows.place[slot] < 0:
                rows.place[slot], rows.slot[moving] = moving, slot
                _write_inertia(blocks, bodies, lane, side, moving, rows)
                moving += 1
            rows.body[count, side] = rows.place[slot]
        _read_manifold(blocks, bodies, lane, count, what, rows)
        count += 1
    for k in range(moving):
        rows.place[rows.slot[k]] = -1
    return count, moving


@kernel
def _write_inertia(blocks: Blocks, bodies: SolverBodies, lane: int, side: int, k: int,
                   rows: DirectRows) -> None:
    """Write the mass and inertia of body A or B of a lane as those of body k."""
    block, i = lane // LANES, lane % LANES
    b, at = numbers_of(blocks, block), blocks.at_A[lane] if side == 0 else blocks.at_B[lane]
    to = rows.inertia[k]
    to[0] = 1.0 / bodies.motion[at + INV_M]
    if are_balls(blocks.kind[block]):
        to[1] = to[4] = to[6] = 1.0 / bodies.motion[at + INV_I]
        to[2] = to[3] = to[5] = 0.0
        return
    inv_I = INV_I_A if side == 0 else INV_I_B
    first = _three(b, inv_I, i)
    (to[1], to[2], to[3]), (to[4], to[5], to[6]) = symmetric_cofactors(
        first, _three(b, inv_I + 3, i))
    determinant = first[0] * to[1] + first[1] * to[2] + first[2] * to[3]
    for j in range(1, 7):
        to[j] /= determinant


@kernel
def _read_manifold(blocks: Blocks, bodies: SolverBodies, lane: int, c: int, what: Sweep,
                   rows: DirectRows) -> None:
    """Write the rows of a lane as those of manifold c."""
    block, i = lane // LANES, lane % LANES
    b, kind, aside = numbers_of(blocks, block), blocks.kind[block], rows.scratch
    balls, rolls = are_balls(kind), resists(kind)
    _write_axes(b, aside)
    n, t1, t2 = _three(aside, 0, i), _three(aside, 3, i), _three(aside, 6, i)
    rows.size[c] = _number(b, SIZE, i)
    mu, lever = _number(b, MU, i), 0.0 if balls else _number(b, SPIN_LEVER, i)
    rows.lever[c] = lever / mu if mu > 0.0 else rows.size[c]
    rows.limit[c, 0], rows.limit[c, 1] = mu, 0.0 if mu > 0.0 else lever / rows.size[c]
    rows.limit[c, 2] = _number(b, ROLL_LEVER, i) / rows.size[c] if rolls else 0.0
    many = not balls and points_in(kind) > 1
    d1, d2 = (_number(b, PRESSED, i), _number(b, PRESSED + 1, i)) if many else (0.0, 0.0)
    rows.centre[c, 0], rows.centre[c, 1] = d1, d2
    for r in range(WIDTH):
        rows.there[c, r] = 0
    for p in range(4 if points_in(kind) > 1 else 1):
        point = POINT + p * POINT_ROWS
        if _number(b, point + GAP, i) < ABSENT:
            s = 0.0 if balls else _number(b, point + S, i)
            t = 0.0 if balls else _number(b, point + T, i)
            at = (s * t1[0] + t * t2[0], s * t1[1] + t * t2[1], s * t1[2] + t * t2[2])
            rows.f[c, p] = _number(b, point + IMPULSE, i)
            _write_least(b, point, what, aside)
            _write_row(blocks, bodies, lane, c, p, n, cross(at, n), rows, _number(aside, 9, i))
    if mu > 0.0:
        for k in range(2):
            rows.f[c, SLIDE + k] = _number(b, FRICTION + k, i)
            turn = -d2 if k == 0 else d1
            _write_row(blocks, bodies, lane, c, SLIDE + k, t1 if k == 0 else t2,
                       (turn * n[0], turn * n[1], turn * n[2]), rows,
                       what.when * _number(b, TURN_T + k, i))
    if lever > 0.0:
        moved = d1 * rows.f[c, SLIDE + 1] - d2 * rows.f[c, SLIDE] if mu > 0.0 else 0.0
        rows.f[c, ABOUT] = (_number(b, SPIN, i) - moved) / rows.lever[c]
        _write_turning_row(blocks, bodies, lane, c, ABOUT, n, rows.lever[c], rows)
    if rows.limit[c, 2] > 0.0:
        for k in range(2):
            rows.f[c, ROLLS + k] = _number(b, ROLL + k, i) / rows.size[c]
            _write_turning_row(blocks, bodies, lane, c, ROLLS + k, t1 if k == 0 else t2,
                               rows.size[c], rows)
    for r in range(WIDTH):
        # Neither of two bodies that move by their twists, or that joints hold, gives way.
        if rows.stiff[c, r] == 0.0:
            rows.there[c, r] = 0
        if rows.there[c, r] == 0:
            rows.f[c, r] = 0.0
        rows.start[c, r] = rows.f[c, r]
    _share_stiffness(c, rows)


@kernel
def _share_stiffness(c: int, rows: DirectRows) -> None:
    """Let all rows of a disk have one number, so that its direction is not bent."""
    for d in range(DISKS):
        first, size = disk_of(c, d, rows)
        stiff = 0.0
        for r in range(first, first + size):
            stiff = max(stiff, rows.stiff[c, r])
        rows.stiff[c, first:first + size] = stiff


@kernel
def pressure_of(c: int, rows: DirectRows) -> float:
    """Return the sum of the normal impulses of a manifold [N s]."""
    return rows.f[c, 0] + rows.f[c, 1] + rows.f[c, 2] + rows.f[c, 3]


@kernel
def disk_of(c: int, d: int, rows: DirectRows) -> tuple[int, int]:
    """
    Return the first row and the number of rows of a disk of manifold c, 0 if there is none.

    Of friction, with the row about n if there is one, which makes it a ball; of that row alone
    where there is no other friction; against rolling.
    """
    first = SLIDE if d == 0 else ABOUT if d == 1 else ROLLS
    if rows.limit[c, d] == 0.0 or rows.there[c, first] == 0:
        return first, 0
    if d == 0:
        return first, 3 if rows.there[c, ABOUT] != 0 else 2
    return first, 1 if d == 1 else 2


@kernel
def _number(b: Array, row: int, i: int) -> float:
    """Return lane i of a row."""
    return b[row * LANES + i]


@kernel
def _three(b: Array, row: int, i: int) -> Vector:
    """Return lane i of three rows."""
    return (_number(b, row, i), _number(b, row + 1, i), _number(b, row + 2, i))


@kernel
def _write_axes(b: Array, aside: Array) -> None:
    n, t1, t2 = axes(b)
    store_three(aside, 0, n)
    store_three(aside, 3, t1)
    store_three(aside, 6, t2)


@kernel
def _write_least(b: Array, point: int, what: Sweep, aside: Array) -> None:
    store(aside, 9, least_speed(b, point, what))


@kernel
def _write_turning_row(blocks: Blocks, bodies: SolverBodies, lane: int, c: int, r: int,
                       axis: Vector, lever: float, rows: DirectRows) -> None:
    """Write the row of a torque about an axis, for 1 N s of an impulse at a lever [m]."""
    turn = (lever * axis[0], lever * axis[1], lever * axis[2])
    _write_row(blocks, bodies, lane, c, r, (0.0, 0.0, 0.0), turn, rows, 0.0)


@kernel
def _write_row(blocks: Blocks, bodies: SolverBodies, lane: int, c: int, r: int, force: Vector,
               torque: Vector, rows: DirectRows, least: float) -> None:
    """Write the row of an impulse at c and one that turns, on B; on A acts the opposite."""
    block, i = lane // LANES, lane % LANES
    b, balls = numbers_of(blocks, block), are_balls(blocks.kind[block])
    n = _three(b, NORMAL, i)
    rows.there[c, r], rows.stiff[c, r] = 1, 0.0
    rows.rate[c, r] = rows.least[c, r] = least
    for side in range(2):
        at = (blocks.at_A[lane] if side == 0 else blocks.at_B[lane]) & INDEX
        sign, first, inv_m = 2.0 * side - 1.0, 6 * side, bodies.motion[at + INV_M]
        if balls:
            lever = _number(b, LEVER_A if side == 0 else LEVER_B, i)
            arm = (lever * n[0], lever * n[1], lever * n[2])
        else:
            arm = _three(b, ARM_A if side == 0 else ARM_B, i)
        on = cross(arm, force)
        turn = (sign * (on[0] + torque[0]), sign * (on[1] + torque[1]),
                sign * (on[2] + torque[2]))
        if balls:
            inv_I = bodies.motion[at + INV_I]
            w = (inv_I * turn[0], inv_I * turn[1], inv_I * turn[2])
        else:
            w = _turned(b, INV_I_A if side == 0 else INV_I_B, i, turn)
        L = (bodies.motion[at + 3], bodies.motion[at + 4], bodies.motion[at + 5])
        rows.rate[c, r] += dot(w, L)
        for k in range(3):
            rows.G[c, r, first + k], rows.G[c, r, first + 3 + k] = sign * force[k], turn[k]
            rows.W[c, r, first + k] = sign * inv_m * force[k]
            rows.W[c, r, first + 3 + k] = w[k] if inv_m > 0.0 else 0.0
            rows.rate[c, r] += sign * force[k] * bodies.motion[at + k]
            rows.stiff[c, r] += (rows.W[c, r, first + k] * rows.G[c, r, first + k]
                                 + rows.W[c, r, first + 3 + k] * rows.G[c, r, first + 3 + k])


@kernel
def _turned(b: Array, row: int, i: int, v: Vector) -> Vector:
    """Return the product of lane i of a symmetric matrix in six rows with v."""
    return symmetric_times(_three(b, row, i), _three(b, row + 3, i), v)


@kernel
def rate_by(table: Array, c: int, r: int, of: Array, rows: DirectRows) -> float:
    """Return the rate [m/s] of a row by momenta (6 b,), of rows.W, or twists, of rows.G."""
    total = 0.0
    for side in range(2):
        at = 6 * rows.body[c, side]
        if at >= 0:
            for k in range(6):
                total += table[c, r, 6 * side + k] * of[at + k]
    return total


@kernel
def write_island(blocks: Blocks, bodies: SolverBodies, lanes: IntArray, count: int, moving: int,
                 p: Array, rows: DirectRows) -> None:
    """Write the impulses of `count` lanes back, and add p (6 moving,), momenta, to the bodies."""
    for k in range(moving):
        at = rows.slot[k] * STRIDE
        for j in range(3):
            bodies.motion[at + j] += bodies.motion[at + INV_M] * p[6 * k + j]
            bodies.motion[at + 3 + j] += p[6 * k + 3 + j]
    for c in range(count):
        lane = lanes[c] & INDEX
        block, i = lane // LANES, lane % LANES
        b = numbers_of(blocks, block)
        for r in range(4):
            if rows.there[c, r] != 0:
                o = (POINT + r * POINT_ROWS) * LANES + i
                b[o + IMPULSE * LANES] = rows.f[c, r]
                before = rows.rate[c, r] - rows.least[c, r]
                b[o + SPEED * LANES] = before + rate_by(rows.W, c, r, p, rows)
        for k in range(2 if rows.there[c, SLIDE] != 0 else 0):
            b[(FRICTION + k) * LANES + i] = rows.f[c, SLIDE + k]
        if rows.there[c, ABOUT] != 0:
            moved = (rows.centre[c, 0] * rows.f[c, SLIDE + 1]
                     - rows.centre[c, 1] * rows.f[c, SLIDE])
            b[SPIN * LANES + i] = rows.lever[c] * rows.f[c, ABOUT] + moved
        for k in range(2 if rows.there[c, ROLLS] != 0 else 0):
            b[(ROLL + k) * LANES + i] = rows.size[c] * rows.f[c, ROLLS + k]
