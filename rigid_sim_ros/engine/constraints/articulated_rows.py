# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Rows of contact on bodies that joints hold: what impulses at the points of an island do.

A unit impulse along a row of a point moves every body of an articulation, as far as its joints let
them: M~^-1 G^T is one solution of the articulated-body method, and of what closes loops in it
(Mirtich, Impulse-based Dynamic Simulation of Rigid Body Systems, PhD thesis (1996), chapter 4). A
body that no joint holds answers as if it were alone. Joints then stay closed to the last digit,
whatever the impulses at the points become. Of these answers the rows keep those of the bodies that
are touched: with them the problem is that of contact_rows.py, and solved by its means.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.constraints.articulated_axes import (
    AxisRows, HELD, list_rows, make_axis_rows, note_rates, write_axis_rows)
from rigid_sim_ros.engine.contact.contact_newton import (
    make_newton, Newton, number_bodies, refine_rows)
from rigid_sim_ros.engine.contact.contact_rows import (
    all_rows, coupling, effect, make_rows, Rows, SIDES, sweep_rows, violation, write_effects,
    write_matrix, write_rows)
from rigid_sim_ros.engine.contact.contacts import Bodies, Contacts
from rigid_sim_ros.engine.contact.coulomb import COMPLIANCE, EARLY_TOLERANCE, GOAL
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.joints.answers import (
    answer, motion_in, push, push_nothing, want_all, want_parents)
from rigid_sim_ros.engine.joints.articulated import momenta_of, solve, velocity_of_center
from rigid_sim_ros.engine.joints.buffers import JointWork
from rigid_sim_ros.engine.joints.loops import (
    answer_within_loops, ask_nothing, take_within_loops)
from rigid_sim_ros.engine.joints.welded_bodies import welded_answer
from rigid_sim_ros.engine.maths.spatial import set_six, six
from rigid_sim_ros.engine.maths.vector import add, column, cross, row, set_column
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.eight import LANES
from rigid_sim_ros.kernels.kernel import kernel

# Of what a row moves without joints: its compliance to impulses that displace grows by as much.
# Joints that nearly forbid a way, or wedge two bodies, would ask for any impulse.
_WEDGED = 0.2
# Of what a row moves without joints: its compliance while a solution is looked for, MORE times as
# much where none is found, up to MOST_REGULARISATION.
REGULARISATION, MORE, MOST_REGULARISATION = 1e-5, 10.0, 1e-2
# Steps of the proximal point algorithm at most, until what the compliance does is this part of the
# rates, while it gets less by this factor.
MOST_PROXIMAL_STEPS, YIELDS, CONTRACTS = 20, 1e-10, 0.7
# Of the largest rate: what still yields by more in the end is far from a solution.
ASTRAY = 1e-3
# Sweeps before each run of Newton's method, its steps, and runs at most.
SWEEPS, NEWTON_STEPS, ROUNDS = 60, 12, 5
# Sweeps, from no impulses at all, where that finds no solution.
MANY_SWEEPS = 200
_NOT_YET = -2       # in `System.following`, of a body that is touched and not in a list


class System(NamedTuple):
    """Room for the problem of one island, of r rows."""

    rows: Rows
    newton: Newton
    touched: IntArray  # (1,) bodies that are touched and can move
    center: Array  # (r,) impulses to which points do not yield
    articulation: IntArray  # (n,) of a body, NONE: joints do not hold it
    first: IntArray  # (g,) of an articulation, a body that is touched
    following: IntArray  # (n,) of such a body, another one of its articulation, NONE: no more
    pushed: IntArray  # (1 + g,) how many articulations are touched, and which
    lanes: IntArray  # (2, 8) the points and rows that are answered at once
    axes: AxisRows
    residual: Array  # (1,) the largest violation of a step, relative to the largest rate


def make_system(rows: int, table: JointTable, bodies: int) -> System:
    """Return room for so many rows of contact."""
    articulation = np.full(bodies, NONE, dtype=np.int64)
    sizes = np.diff(table.first_row)
    for g in range(len(sizes)):
        articulation[table.body[table.first_row[g]:table.first_row[g + 1]]] = g
    points, axes = rows // 3, len(table.translates)
    moved, touched = 2 + 2 * int(min(sizes.max(initial=0), 2 * points)), min(2 * points, bodies)
    return System(make_rows(points, rows, bodies, moved, axes, rows + axes),
                  make_newton(points, rows, touched, bodies, rows + axes),
                  np.zeros(1, dtype=np.int64), np.zeros(rows + axes), articulation,
                  np.zeros(len(sizes), dtype=np.int64), np.zeros(bodies, dtype=np.int64),
                  np.zeros(1 + len(sizes), dtype=np.int64), np.zeros((2, LANES), dtype=np.int64),
                  make_axis_rows(axes), np.zeros(1))


@kernel
def write_system(model: Model, table: JointTable, work: JointWork, contacts: Contacts,
                 bodies: Bodies, chosen: IntArray, width: int, system: System) -> None:
    """
    Write the rows of the chosen points.

    The factors of the articulations are given, and so are the pieces that their axes are on.
    """
    rows, m = system.rows, chosen.shape[0]
    write_rows(model, contacts, bodies, chosen, width, COMPLIANCE, rows)
    _weld(model, table, work, width, m, rows)
    system.touched[0] = number_bodies(contacts, chosen, model.inv_m, system.newton.slot)
    _list_touched(rows, m, system)
    _list_moved(rows, m, width, system)
    _spread_rows(rows, m, width, system)
    for n in range(system.pushed[0]):
        list_rows(model, table, work, system.axes, system.pushed[1 + n], width * m, rows)
    write_axis_rows(table, work, system.axes, width * m, REGULARISATION, rows)
    for n in range(system.pushed[0]):
        _answer_rows(table, work, system, system.pushed[1 + n], m, width)
    for c in range(m):
        for i in range(width * c, width * c + width):
            _regularise(rows, c, i)
    # Of one island only: of several at once each would hear of the others, if only as rounding.
    if width * m < 6 * system.touched[0] or rows.scalar.present[0] > 0:
        write_matrix(rows, m, width, model.inv_m)


@kernel
def _weld(model: Model, table: JointTable, work: JointWork, width: int, m: int,
          rows: Rows) -> None:
    """Write to rows.stiff of m points what they move if fixed joints hold, and no others."""
    for c in range(m):
        for side in range(2):
            r = table.row_of_body[rows.body[c, side]]
            if r == NONE or table.welded_to[r] == 0:
                continue
            x, at = add(row(work.p, r), row(work.com, r)), 6 * side
            for i in range(width * c, width * c + width):
                f = (rows.G[i, at], rows.G[i, at + 1], rows.G[i, at + 2])
                n = (rows.G[i, at + 3], rows.G[i, at + 4], rows.G[i, at + 5])
                own = 0.0
                for k in range(at, at + 6):
                    own += rows.G[i, k] * rows.W[rows.at[i] + k]
                rows.stiff[i] += welded_answer(model, table, work, r, x, f, n) - own


@kernel
def _list_touched(rows: Rows, m: int, system: System) -> None:
    """List the articulations that the points touch, and chain the touched bodies of each."""
    system.pushed[0] = 0
    of, following = system.articulation, system.following
    for c in range(m):
        for side in range(2):
            body = rows.body[c, side]
            if of[body] != NONE:
                system.first[of[body]], following[body] = NONE, _NOT_YET
    for c in range(m):
        for side in range(2):
            body = rows.body[c, side]
            if of[body] != NONE and following[body] == _NOT_YET:
                if system.first[of[body]] == NONE:
                    system.pushed[0] += 1
                    system.pushed[system.pushed[0]] = of[body]
                following[body], system.first[of[body]] = system.first[of[body]], body


@kernel
def _list_moved(rows: Rows, m: int, width: int, system: System) -> None:
    """Write which bodies each point moves, its own first, and where the rows begin."""
    of, place, begin = system.articulation, 0, 0
    for c in range(m):
        rows.first[c] = place
        a, b = rows.body[c, 0], rows.body[c, 1]
        rows.moved[place], rows.moved[place + 1] = a, b
        place += 2
        for side in range(2):
            g = of[rows.body[c, side]]
            if g == NONE or (side == 1 and g == of[a]):
                continue
            other = system.first[g]
            while other != NONE:
                if other not in (a, b):
                    rows.moved[place] = other
                    place += 1
                other = system.following[other]
        for i in range(width * c, width * c + width):
            rows.at[i] = begin
            begin += 6 * (place - rows.first[c])
    rows.first[m] = place


@kernel
def _regularise(rows: Rows, c: int, i: int) -> None:
    """
    Give row i, of point c, a compliance; where joints do not let it move, let it have no effect.

    Then nothing is left of its diagonal but the compliance; see `moves`.
    """
    free, own = rows.stiff[i] - rows.compliance[i], coupling(rows, i, i)
    if own > HELD * free:
        rows.compliance[i] = REGULARISATION * free
        rows.stiff[i] = own + rows.compliance[i]
        return
    rows.compliance[i] = rows.stiff[i] = max(free, 1e-300)
    for k in range(SIDES):
        rows.G[i, k] = 0.0
    for k in range(6 * (rows.first[c + 1] - rows.first[c])):
        rows.W[rows.at[i] + k] = 0.0


@kernel
def moves(rows: Rows, i: int) -> bool:
    """Return whether the joints let row i move."""
    return bool(rows.stiff[i] > rows.compliance[i])


@kernel
def _spread_rows(rows: Rows, m: int, width: int, system: System) -> None:
    """Make room in W for all bodies that a point moves; what joints hold answers later."""
    # Backwards: what is written of a row is longer than what is read of it.
    for c in range(m - 1, -1, -1):
        for i in range(width * c + width - 1, width * c - 1, -1):
            at = rows.at[i]
            for side in range(1, -1, -1):
                free = system.articulation[rows.body[c, side]] == NONE
                for k in range(6 * side + 5, 6 * side - 1, -1):
                    rows.W[at + k] = rows.W[SIDES * i + k] if free else 0.0
            for k in range(SIDES, 6 * (rows.first[c + 1] - rows.first[c])):
                rows.W[at + k] = 0.0


@kernel
def _answer_rows(table: JointTable, work: JointWork, system: System, g: int, m: int,
                 width: int) -> None:
    """Write how articulation g answers to unit impulses along all rows that push it."""
    rows, of, lane = system.rows, system.articulation, 0
    begin, end = table.first_row[g], table.first_row[g + 1]
    _want_touched(table, work, system, g)
    for c in range(m):
        if of[rows.body[c, 0]] != g and of[rows.body[c, 1]] != g:
            continue
        for i in range(width * c, width * c + width):
            if lane == 0:
                push_nothing(table, work.answers, begin, end)
            for side in range(2):
                body, at = rows.body[c, side], 6 * side
                if of[body] == g:
                    push(work, lane, table.row_of_body[body],
                         (rows.G[i, at], rows.G[i, at + 1], rows.G[i, at + 2]),
                         (rows.G[i, at + 3], rows.G[i, at + 4], rows.G[i, at + 5]))
            system.lanes[0, lane], system.lanes[1, lane] = c, i
            lane += 1
            if lane == LANES:
                _write_answers(table, work, system, g, lane, width * m)
                lane = 0
    if lane > 0:
        _write_answers(table, work, system, g, lane, width * m)


@kernel
def _want_touched(table: JointTable, work: JointWork, system: System, g: int) -> None:
    """Ask for the answers of what is touched of articulation g; of all of it for other rows."""
    begin, end = table.first_row[g], table.first_row[g + 1]
    has_others = (table.first_condition[g + 1] > table.first_condition[g]
                  or system.rows.scalar.present[0] > 0)
    want_all(work.answers, begin, end, has_others)
    body = system.first[g]
    while body != NONE:
        work.answers.wanted[table.row_of_body[body]] = 1
        body = system.following[body]
    want_parents(table, work.answers, begin, end)


@kernel
def _write_answers(table: JointTable, work: JointWork, system: System, g: int, lanes: int,
                   n: int) -> None:
    """Write how what is touched of articulation g answers to the rows in the lanes, of n rows."""
    rows, of = system.rows, system.articulation
    answer(table, work, table.first_row[g], table.first_row[g + 1])
    for lane in range(lanes):
        c, i = system.lanes[0, lane], system.lanes[1, lane]
        closes = take_within_loops(table, work, lane, g)
        if rows.scalar.present[0] > 0:
            note_rates(table, work, system.axes, g, lane, closes, i, n, rows)
        at = rows.at[i]
        for e in range(rows.first[c], rows.first[c + 1]):
            body = rows.moved[e]
            if of[body] == g:
                r = table.row_of_body[body]
                V = six(work.V, r) if closes else motion_in(work.answers, lane, r)
                v = velocity_of_center(work, r, V)
                for k in range(3):
                    rows.W[at + k], rows.W[at + 3 + k] = v[k], V[3 + k]
            at += 6


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
        v = velocity_of_center(work, r, V)
        for k in range(3):
            velocity[body, k], velocity[body, 3 + k] = v[k], V[3 + k]


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
def take_off(rows: Rows, m: int, width: int, f: Array, u: Array) -> None:
    """Take what the impulses f at the points do off the rates u of all rows."""
    write_effects(rows, m, width, f)
    for c in range(m):
        for i in range(width * c, width * c + width):
            u[i] -= effect(rows, c, i, f)
    for i in range(width * m, all_rows(rows, m, width)):
        u[i] -= effect(rows, m, i, f)


@kernel
def solve_system(system: System, m: int, width: int, is_new: bool) -> float:
    """
    Find the impulses f of m points from what stands there; return the violation, 0 if none.

    Points yield by R (f - f'), R their compliance and f' the impulses of the time before, first
    those that stand there (the proximal point algorithm: Rockafellar, Monotone operators and the
    proximal point algorithm, SIAM J. Control Optim. 14 (1976)): where these are a solution, as of
    what rests, nothing is left to do. That is repeated as long as it gets less: between bodies
    that are wedged in it does not, nor where it began with impulses of another problem that are
    far too large. It then begins anew, with none.
    """
    r, rows, size = all_rows(system.rows, m, width), system.rows, 0.0
    for i in range(r):
        size = max(size, abs(rows.b[i]))
        system.center[i] = rows.f[i] if moves(rows, i) else 0.0
        rows.b[i] -= rows.compliance[i] * system.center[i]
    worst, yields = _approach(system, m, width, is_new, size)
    if not is_new and yields > ASTRAY * size:
        for i in range(r):
            if moves(rows, i):
                rows.b[i] += rows.compliance[i] * system.center[i]
            rows.f[i] = system.center[i] = 0.0
        worst, _ = _approach(system, m, width, True, size)
    if size > 0.0:
        system.residual[0] = max(system.residual[0], worst / size)
    return worst if worst > EARLY_TOLERANCE * size else 0.0


@kernel
def _approach(system: System, m: int, width: int, is_new: bool,
              size: float) -> tuple[float, float]:
    """
    Repeat what `solve_system` says; `size` is max |b|.

    Returns the violation, and what the points still yielded by the last time [m/s].
    """
    r, rows = all_rows(system.rows, m, width), system.rows
    regularisation = REGULARISATION
    worst, before, yields = np.inf, np.inf, 0.0
    for n in range(MOST_PROXIMAL_STEPS):
        worst, regularisation = _improve(system, m, width, is_new and n == 0, size, regularisation)
        yields = 0.0
        for i in range(r):
            if moves(rows, i):
                yields = max(yields, abs(rows.compliance[i] * (rows.f[i] - system.center[i])))
        if not YIELDS * size < yields <= CONTRACTS * before:
            break
        before = yields
        for i in range(r):
            if moves(rows, i):
                rows.b[i] -= rows.compliance[i] * (rows.f[i] - system.center[i])
                system.center[i] = rows.f[i]
    _add_regularisation(system, r, REGULARISATION / regularisation - 1.0)
    return worst, yields


@kernel
def _improve(system: System, m: int, width: int, is_new: bool, size: float,
             regularisation: float) -> tuple[float, float]:
    """
    Find the impulses f of m points with a compliance; `size` is max |b|.

    Newton's method finds which points press and slide from where it begins, or does not; sweeps
    bring it nearer, and it finds more where the compliance is larger. Returns the violation, and
    how large the compliance is now, which was `regularisation`.
    """
    rows, f, r = system.rows, system.rows.f, all_rows(system.rows, m, width)
    for n in range(ROUNDS):
        if n > 0 or is_new:
            violation(rows, m, width, f)
            sweep_rows(rows, m, width, f, SWEEPS, 0.1 * EARLY_TOLERANCE * size)
        worst = refine_rows(rows, m, width, system.touched[0], GOAL * size, NEWTON_STEPS,
                            system.newton)
        if worst <= EARLY_TOLERANCE * size:
            return worst, regularisation
        if regularisation < MOST_REGULARISATION:
            _add_regularisation(system, r, MORE - 1.0)
            regularisation *= MORE
    # What Newton's method leaves may be of any size where the rows are nearly dependent.
    f[:r] = 0.0
    violation(rows, m, width, f)
    sweep_rows(rows, m, width, f, MANY_SWEEPS, 0.1 * EARLY_TOLERANCE * size)
    return violation(rows, m, width, f), regularisation


@kernel
def _add_regularisation(system: System, r: int, part: float) -> None:
    """Let the compliance of rows grow by a part of it, from the same impulses."""
    rows = system.rows
    for i in range(r):
        if moves(rows, i):
            more = part * rows.compliance[i]
            rows.compliance[i] += more
            rows.stiff[i] += more
            rows.b[i] -= more * system.center[i]


@kernel
def push_apart(system: System, m: int, width: int, displaced: Array) -> None:
    """
    Write impulses along the normals, (r,), with which the points get the rates -b [m/s].

    Axes that are rows are free of what acts along them. The compliance of the rows, and their
    coefficients, are spoiled.
    """
    rows = system.rows
    system.center[:width * m] = 0.0
    displaced[:all_rows(rows, m, width)] = 0.0
    rows.scalar.present[0] = 0
    _add_regularisation(system, width * m, _WEDGED / REGULARISATION)
    rows.mu[:m] = 0.0
    violation(rows, m, width, displaced)
    sweep_rows(rows, m, width, displaced, SWEEPS, 0.0)
