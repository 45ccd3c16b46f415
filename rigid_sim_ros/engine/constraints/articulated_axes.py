# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Axes of joints as rows beside those of contact.

What acts along an axis is piecewise straight (laws.py), and the impulses of contact are found for
given pieces. An axis that these put on another piece becomes a row of the same problem: dry
friction, limits and bounded drives are then found together with the impulses at the points.
There it is free but for what is proportional to its rate.

The rate of a row is that of its axis times a length, so that it can be compared with velocities of
points: the radius of gyration of what the axis feels, with the mass of its body,
and of what fixed joints hold to that.
"""

import math
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.contact_rows import Rows
from rigid_sim_ros.engine.joints.answers import answer, push_nothing, want_all
from rigid_sim_ros.engine.joints.buffers import JointWork, UNLOCKED
from rigid_sim_ros.engine.joints.laws import impulse_at, kink_of, KINKS, reaction_of
from rigid_sim_ros.engine.joints.loops import take_within_loops
from rigid_sim_ros.engine.joints.welded_bodies import welded_mass
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.eight import LANES
from rigid_sim_ros.kernels.kernel import kernel

# A row that moves less than this part of what it would without joints, or without what closes
# loops in them, does not move: it is rounding.
HELD = 1e-8


class AxisRows(NamedTuple):
    """Room for k axes, and what was found for the pieces that they are on."""

    is_row: IntArray  # (k,) 1: the axis is a row of the problem of its island
    axis: IntArray  # (k,) axes of the rows of the present island
    scale: Array  # (k,) [m; of a translation 1] the lengths by which rates count; 0: it is held
    impulse: Array  # (k,) of an axis that is a row, a guess [N m s], beside a - b v
    begin: Array  # (k,) pieces for which impulses of contact were found: from these rates
    end: Array  # (k,) to these


def make_axis_rows(axes: int) -> AxisRows:
    """Return room for so many axes, none of which is a row."""

    def whole() -> IntArray:
        return np.zeros(axes, dtype=np.int64)

    return AxisRows(whole(), whole(), *(np.zeros(axes) for _ in range(4)))


@kernel
def keep_pieces(work: JointWork, axes: AxisRows) -> None:
    """Note on which pieces all axes are."""
    for k in range(axes.begin.shape[0]):
        axes.begin[k], axes.end[k] = work.law.begin[k], work.law.end[k]


@kernel
def has_left_piece(work: JointWork, axes: AxisRows, k: int) -> bool:
    """
    Return whether axis k is on another piece than noted, but for rows.

    Where it begins and ends tells the piece. What the axis yields does not: it is locked by dry
    friction and at its limit alike, and yields as much to either side of dry friction.
    """
    return axes.is_row[k] == 0 and (work.law.begin[k] != axes.begin[k]
                                    or work.law.end[k] != axes.end[k])


@kernel
def any_left_piece(work: JointWork, axes: AxisRows) -> bool:
    """Return whether any axis is on another piece than noted, but for rows."""
    for k in range(axes.begin.shape[0]):
        if has_left_piece(work, axes, k):
            return True
    return False


@kernel
def take_rows(work: JointWork, axes: AxisRows) -> bool:
    """Let axes that have left their pieces be rows from now on; return whether any has."""
    found = False
    for k in range(axes.begin.shape[0]):
        if has_left_piece(work, axes, k):
            axes.is_row[k], found = 1, True
    return found


@kernel
def let_yield(table: JointTable, work: JointWork, axes: AxisRows, g: int) -> bool:
    """
    Let the axes of articulation g be rows that dry friction locks, or the bound of a speed.

    Limits hold against anything, these do not. Returns whether any was none before.
    """
    law, found = work.law, False
    for k in range(table.first_axis[table.first_row[g]],
                   table.first_axis[table.first_row[g + 1]]):
        v = work.given[k]
        if (axes.is_row[k] == 0 and work.locked[k] != UNLOCKED
                and v != law.low[k] and v != law.high[k]):
            axes.is_row[k], found = 1, True
    return found


@kernel
def free_rows(table: JointTable, work: JointWork, axes: AxisRows) -> bool:
    """
    Free the axes that are rows, and note what acted along them; return whether there are any.

    The motions have been found, with all axes on their pieces.
    """
    law, found = work.law, False
    for r in range(table.body.shape[0]):
        for k in range(table.first_axis[r], table.first_axis[r + 1]):
            if axes.is_row[k] == 0:
                continue
            found, v = True, work.rate[k]
            acted = work.tau[k] - work.extra[k] * v
            if work.locked[k] != UNLOCKED:
                v = work.given[k]
                acted = reaction_of(table, work, r, k)
            axes.impulse[k] = acted - (law.a[k] - law.b[k] * v)
            work.locked[k], work.given[k] = UNLOCKED, 0.0
            work.extra[k], work.tau[k] = law.b[k], law.a[k]
    return found


@kernel
def list_rows(model: Model, table: JointTable, work: JointWork, axes: AxisRows, g: int, n: int,
              rows: Rows) -> None:
    """Append the axes of articulation g that are rows, with rates, behind n rows of points."""
    for r in range(table.first_row[g], table.first_row[g + 1]):
        for k in range(table.first_axis[r], table.first_axis[r + 1]):
            if axes.is_row[k] == 1:
                q = rows.scalar.present[0]
                axes.axis[q] = k
                axes.scale[q] = math.sqrt(work.felt[k] / welded_mass(model, table, r))
                rows.b[n + q], rows.f[n + q] = axes.scale[q] * work.rate[k], 0.0
                rows.scalar.present[0] = q + 1


@kernel
def write_axis_rows(table: JointTable, work: JointWork, axes: AxisRows, n: int, compliance: float,
                    rows: Rows) -> None:
    """Write how the listed axes answer to each other, behind n rows of points, and their laws."""
    count = rows.scalar.present[0]
    size = n + count
    for q in range(count):
        for i in range(size):
            rows.A[size * (n + q) + i] = rows.A[size * i + n + q] = 0.0
    for g in range(table.first_row.shape[0] - 1):
        _answer_axes(table, work, axes, g, n, rows)
    for q in range(count):
        own, alone = rows.A[(size + 1) * (n + q)], axes.scale[q] ** 2 / work.felt[axes.axis[q]]
        rows.compliance[n + q] = compliance * own
        rows.stiff[n + q] = own + rows.compliance[n + q]
        _write_law(work, axes, q, rows)
        if own <= HELD * alone:
            _leave_out(axes, n, q, alone, rows)


@kernel
def _leave_out(axes: AxisRows, n: int, q: int, compliance: float, rows: Rows) -> None:
    """Let row q, whose axis conditions beside the tree hold, have no effect and no impulse."""
    size, i, s = n + rows.scalar.present[0], n + q, rows.scalar
    for j in range(size):
        rows.A[size * i + j] = rows.A[size * j + i] = 0.0
    axes.scale[q] = 0.0
    rows.compliance[i] = rows.stiff[i] = compliance
    s.kinks[q], s.slope[q] = 1, 0.0
    s.kink[q, 0] = s.below[q, 0] = s.above[q, 0] = 0.0


@kernel
def begin_with(axes: AxisRows, n: int, rows: Rows) -> None:
    """Begin with what acted along the listed axes that move, behind n rows of points."""
    for q in range(rows.scalar.present[0]):
        if axes.scale[q] > 0.0:
            rows.f[n + q] = axes.impulse[axes.axis[q]] / axes.scale[q]


@kernel
def _answer_axes(table: JointTable, work: JointWork, axes: AxisRows, g: int, n: int,
                 rows: Rows) -> None:
    """Write how the axes of articulation g answer to impulses along them."""
    begin, end = table.first_row[g], table.first_row[g + 1]
    start, stop = table.first_axis[begin], table.first_axis[end]
    first = 0
    while first < rows.scalar.present[0] and not start <= axes.axis[first] < stop:
        first += 1
    last = first    # those of an articulation were listed one after the other
    while last < rows.scalar.present[0] and start <= axes.axis[last] < stop:
        last += 1
    want_all(work.answers, begin, end, True)
    for block in range(first, last, LANES):
        lanes = min(LANES, last - block)
        push_nothing(table, work.answers, begin, end)
        for lane in range(lanes):
            work.answers.tau[LANES * axes.axis[block + lane] + lane] = axes.scale[block + lane]
        answer(table, work, begin, end)
        for lane in range(lanes):
            closes = take_within_loops(table, work, lane, g)
            note_rates(table, work, axes, g, lane, closes, n + block + lane, n, rows)


@kernel
def note_rates(table: JointTable, work: JointWork, axes: AxisRows, g: int, lane: int,
               closes: bool, i: int, n: int, rows: Rows) -> None:
    """
    Write how the axes of articulation g answer to row i, which is in a lane of the answers.

    closes: what `take_within_loops` returned.
    """
    start = table.first_axis[table.first_row[g]]
    stop = table.first_axis[table.first_row[g + 1]]
    size = n + rows.scalar.present[0]
    for q in range(rows.scalar.present[0]):
        k = axes.axis[q]
        if start <= k < stop:
            rate = work.rate[k] if closes else work.answers.rate[LANES * k + lane]
            rows.A[size * i + n + q] = rows.A[size * (n + q) + i] = axes.scale[q] * rate


@kernel
def _write_law(work: JointWork, axes: AxisRows, q: int, rows: Rows) -> None:
    """Write the law of row q, but for a - b v, which is in the factors of the articulation."""
    s, k, law = rows.scalar, axes.axis[q], work.law
    scale, count = axes.scale[q], 0
    for n in range(KINKS):
        v = kink_of(work, k, n)
        if not law.low[k] <= v <= law.high[k] or math.isinf(v):
            continue
        place = count
        while place > 0 and s.kink[q, place - 1] > scale * v:
            place -= 1
        if place > 0 and s.kink[q, place - 1] == scale * v:
            continue
        for m in range(count, place, -1):
            s.kink[q, m], s.below[q, m], s.above[q, m] = (
                s.kink[q, m - 1], s.below[q, m - 1], s.above[q, m - 1])
        smooth = law.a[k] - law.b[k] * v
        s.kink[q, place] = scale * v
        s.below[q, place] = (impulse_at(work, k, v, -1) - smooth) / scale
        s.above[q, place] = (impulse_at(work, k, v, 1) - smooth) / scale
        count += 1
    s.kinks[q] = count
    # A drive that can give any effort gives more and more.
    s.slope[q] = law.g[k] / (scale * scale) if math.isinf(law.E[k]) else 0.0
