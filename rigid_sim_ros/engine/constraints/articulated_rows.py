# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Rows of contact on bodies that joints hold: the matrix A = G M~^-1 G^T of an island.

A unit impulse along a row of a point moves every body of an articulation, as far as its joints let
them: M~^-1 G^T is one solution of the articulated-body method, and of what closes loops in it
(Mirtich, Impulse-based Dynamic Simulation of Rigid Body Systems, PhD thesis (1996), chapter 4). A
body that no joint holds answers as if it were alone. Joints then stay closed to the last digit,
whatever the impulses at the points become.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.contact_rows import make_rows, Rows, SIDES, write_rows
from rigid_sim_ros.engine.contact.contacts import Bodies, Contacts
from rigid_sim_ros.engine.contact.coulomb import (
    coefficients, COMPLIANCE, ENOUGH, GOAL, NEWTON_STEPS, refine, sweep_in_place)
from rigid_sim_ros.engine.dynamics.loads import Loads
from rigid_sim_ros.engine.joints.articulated import momenta_of, solve
from rigid_sim_ros.engine.joints.buffers import JointWork
from rigid_sim_ros.engine.joints.loops import answer_within_loops, ask_nothing
from rigid_sim_ros.engine.maths.spatial import add_six, set_six, six
from rigid_sim_ros.engine.maths.vector import add, column, cross, row, set_column
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# A row that moves less than this part of what it would without joints does not move: it is
# rounding.
_HELD = 1e-8
# Of what a row moves without joints: by this much more it gives way to impulses that displace.
# Joints that nearly forbid a way, or wedge two bodies, would ask for any impulse.
_WEDGED = 0.2
# Of what a row moves without joints: by this much it gives way while a solution is looked for, and
# so often at most that is taken back, until it is this part of the rates, while it gets less by
# this factor.
EASE, MOST_TAKEN_BACK, YIELDS, CONTRACTS = 1e-5, 20, 1e-10, 0.7
# Newton's method for a matrix of more rows takes longer than sweeps that do as much.
MOST_FOR_NEWTON = 240
# Sweeps before each run of Newton's method, and runs at most.
SWEEPS, ROUNDS = 30, 8
# Sweeps, from no impulses at all, where that finds no solution.
MANY_SWEEPS = 200


class System(NamedTuple):
    """Room for the problem a = A f + b of one island, of r rows."""

    rows: Rows  # G, mu, b, f and the effect z of one impulse
    A: Array  # (r r,) [1/kg], the matrix of an island by rows
    M: Array  # (r r,) scratch
    x: Array  # (r,) scratch
    center: Array  # (r,) impulses for which points do not give way
    mu: Array  # (r,) the coefficients of an island by points
    articulation: IntArray  # (n,) of a body, NONE: joints do not hold it
    residual: Array  # (1,) the largest violation of a step, relative to the largest rate


def make_system(rows: int, table: JointTable, bodies: int) -> System:
    """Return room for so many rows of contact."""
    articulation = np.full(bodies, NONE, dtype=np.int64)
    for g in range(len(table.first_row) - 1):
        articulation[table.body[table.first_row[g]:table.first_row[g + 1]]] = g
    return System(make_rows(rows // 3, rows, bodies), np.zeros(rows * rows),
                  np.zeros(rows * rows), np.zeros(rows), np.zeros(rows), np.zeros(rows),
                  articulation, np.zeros(1))


@kernel
def write_system(model: Model, table: JointTable, work: JointWork, contacts: Contacts,
                 bodies: Bodies, chosen: IntArray, width: int, system: System) -> None:
    """
    Write G, A and the coefficients of the chosen points.

    The factors of the articulations are given, and so are the pieces that their axes are on.
    """
    rows, r = system.rows, width * chosen.shape[0]
    A = system.A[:r * r].reshape((r, r))
    write_rows(model, contacts, bodies, chosen, width, COMPLIANCE, rows)
    m = chosen.shape[0]
    for c in range(m):
        for side in range(2):
            _clear(table, system, rows.body[c, side])
    for c in range(m):
        for i in range(width * c, width * c + width):
            _answer(table, work, system, c, i)
            for d in range(m):
                a, b = rows.body[d, 0], rows.body[d, 1]
                for j in range(width * d, width * d + width):
                    total = 0.0
                    for k in range(6):
                        total += (rows.G[j, k] * rows.z[a, k] + rows.G[j, 6 + k] * rows.z[b, k])
                    A[j, i] = total
            for side in range(2):
                _clear(table, system, rows.body[c, side])
            _ease(rows, A, i)


@kernel
def _ease(rows: Rows, A: Array, i: int) -> None:
    """
    Let row i give way; where joints do not let it move at all, let it be without effect.

    rows.stiff, 1/m of the point without joints, is then 0.
    """
    free = rows.stiff[i] - rows.give[i]
    rows.give[i] = EASE * free
    if A[i, i] <= _HELD * free:
        rows.stiff[i] = rows.give[i] = 0.0
        for k in range(SIDES):
            rows.G[i, k] = 0.0
        for j in range(A.shape[0]):
            A[j, i] = 0.0
        A[i, i] = max(free, 1e-300)
    else:
        A[i, i] += rows.give[i]


@kernel
def _clear(table: JointTable, system: System, body: int) -> None:
    """Write that nothing moves of what hangs together with a body."""
    z, g = system.rows.z, system.articulation[body]
    if g == NONE:
        z[body, :] = 0.0
        return
    for r in range(table.first_row[g], table.first_row[g + 1]):
        z[table.body[r], :] = 0.0


@kernel
def _answer(table: JointTable, work: JointWork, system: System, c: int, i: int) -> None:
    """Write how all bodies answer to a unit impulse along row i, of point c, to z."""
    rows, of = system.rows, system.articulation
    a, b = rows.body[c, 0], rows.body[c, 1]
    for side in range(2):
        body, g = rows.body[c, side], of[rows.body[c, side]]
        if g == NONE:
            for k in range(6):
                rows.z[body, k] += rows.W[i, 6 * side + k]
            continue
        # Two bodies of one articulation are pushed together.
        if side == 0 or of[a] != g:
            ask_nothing(table, work, table.first_row[g], table.first_row[g + 1])
        _push(table, work, body, rows.G, i, 6 * side)
        if side == 1 or of[b] != g:
            _move(table, work, g, rows.z)


@kernel
def _push(table: JointTable, work: JointWork, body: int, G: Array, i: int, at: int) -> None:
    """Add the unit impulse of row i on a body, about its reference point."""
    r = table.row_of_body[body]
    f = (G[i, at], G[i, at + 1], G[i, at + 2])
    n = cross(row(work.com, r), f)
    add_six(work.F, r, (f[0], f[1], f[2], G[i, at + 3] + n[0], G[i, at + 4] + n[1],
                        G[i, at + 5] + n[2]))


@kernel
def _move(table: JointTable, work: JointWork, g: int, z: Array) -> None:
    """Write how articulation g answers to the impulses F, at the centres of mass."""
    begin, end = table.first_row[g], table.first_row[g + 1]
    solve(table, work, begin, end, False, False)
    answer_within_loops(table, work, g)
    write_velocities(table, work, begin, end, z)


@kernel
def answer_to_impulses(model: Model, table: JointTable, work: JointWork, g: int,
                       loads: Loads) -> None:
    """Put the momenta of the answer of articulation g in the place of impulses on its bodies."""
    begin, end = table.first_row[g], table.first_row[g + 1]
    ask_nothing(table, work, begin, end)
    for r in range(begin, end):
        P, L = column(loads.F, table.body[r]), column(loads.tau, table.body[r])
        n = add(L, cross(row(work.com, r), P))
        set_six(work.F, r, (P[0], P[1], P[2], n[0], n[1], n[2]))
    solve(table, work, begin, end, False, False)
    answer_within_loops(table, work, g)
    for r in range(begin, end):
        P, L = momenta_of(model, table, work, r)
        set_column(loads.F, table.body[r], P)
        set_column(loads.tau, table.body[r], L)


@kernel
def write_velocities(table: JointTable, work: JointWork, begin: int, end: int,
                     velocity: Array) -> None:
    """Write v of the centre of mass and w of the bodies of some rows to velocity, (n, 6)."""
    for r in range(begin, end):
        V, body = six(work.V, r), table.body[r]
        turned = cross((V[3], V[4], V[5]), row(work.com, r))
        for k in range(3):
            velocity[body, k] = V[k] + turned[k]
            velocity[body, 3 + k] = V[3 + k]


@kernel
def read_row_rates(rows: Rows, m: int, width: int, velocity: Array, u: Array) -> None:
    """Write the rates of the rows of m points with the velocities (n, 6) of the bodies."""
    for c in range(m):
        a, b = rows.body[c, 0], rows.body[c, 1]
        for i in range(width * c, width * c + width):
            total = 0.0
            for k in range(SIDES // 2):
                total += rows.G[i, k] * velocity[a, k] + rows.G[i, 6 + k] * velocity[b, k]
            u[i] = total


@kernel
def solve_system(system: System, m: int, width: int, is_new: bool) -> float:
    """
    Find the impulses f of m points from what stands there; return the violation, 0 if none.

    Points give way by give (f - f') with the impulses f' of the time before, first none (the
    proximal point algorithm: Rockafellar, Monotone operators and the proximal point algorithm,
    SIAM J. Control Optim. 14 (1976)). That is repeated as long as it gets less: between bodies
    that are wedged in it does not.
    """
    r, rows, size = width * m, system.rows, 0.0
    for i in range(r):
        size = max(size, abs(rows.b[i]))
        system.center[i] = 0.0
    worst, before = _improve(system, m, width, is_new, size), np.inf
    for _ in range(MOST_TAKEN_BACK):
        yields = 0.0
        for i in range(r):
            yields = max(yields, abs(rows.give[i] * (rows.f[i] - system.center[i])))
        if not YIELDS * size < yields <= CONTRACTS * before:
            break
        before = yields
        for i in range(r):
            rows.b[i] -= rows.give[i] * (rows.f[i] - system.center[i])
            system.center[i] = rows.f[i]
        worst = _improve(system, m, width, False, size)
    if size > 0.0:
        system.residual[0] = max(system.residual[0], worst / size)
    return worst if worst > ENOUGH * size else 0.0


@kernel
def _improve(system: System, m: int, width: int, is_new: bool, size: float) -> float:
    """
    Find the impulses f of m points that give way; return the violation, where `size` is max |b|.

    Newton's method finds which points press and slide from where it begins, or does not; sweeps
    bring it nearer.
    """
    r = width * m
    rows, kinds = system.rows, coefficients(width)
    A, M = system.A[:r * r].reshape((r, r)), system.M[:r * r].reshape((r, r))
    b, f, a, trial, x = rows.b[:r], rows.f[:r], rows.a[:r], rows.trial[:r], system.x[:r]
    _write_coefficients(system, m, kinds)
    mu = system.mu[:kinds * m].reshape((m, kinds))
    worst = np.inf
    for n in range(ROUNDS):
        if n > 0 or is_new or r > MOST_FOR_NEWTON:
            sweep_in_place(A, b, mu, f, SWEEPS, a)
        if r <= MOST_FOR_NEWTON or n == ROUNDS - 1:
            steps = NEWTON_STEPS if r <= MOST_FOR_NEWTON else 0
            worst, _ = refine(A, b, mu, f, GOAL * size, steps, a, trial, M, x)
        if worst <= ENOUGH * size:
            return worst
    # What Newton's method leaves may be of any size where A is nearly singular.
    f[:] = 0.0
    sweep_in_place(A, b, mu, f, MANY_SWEEPS, a)
    worst, _ = refine(A, b, mu, f, GOAL * size, 0, a, trial, M, x)
    return worst


@kernel
def _write_coefficients(system: System, m: int, kinds: int) -> None:
    """Write the coefficients of m points side by side."""
    for c in range(m):
        for d in range(kinds):
            system.mu[kinds * c + d] = system.rows.mu[c, d]


@kernel
def push_apart(system: System, m: int, width: int, displaced: Array) -> None:
    """
    Write impulses along the normals, (r,), with which the points get the rates -b [m/s].

    A is spoiled.
    """
    r, rows, kinds = width * m, system.rows, coefficients(width)
    A = system.A[:r * r].reshape((r, r))
    for i in range(r):
        A[i, i] += _WEDGED * rows.stiff[i]
    displaced[:r] = 0.0
    system.mu[:kinds * m] = 0.0
    sweep_in_place(A, rows.b[:r],
                   system.mu[:kinds * m].reshape((m, kinds)), displaced[:r], SWEEPS, rows.a[:r])
