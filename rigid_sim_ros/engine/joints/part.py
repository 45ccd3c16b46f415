# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Some of the articulations of a world, as a table of joints of their own.

Articulations do not know of each other, so those that are left out change nothing for the others.
Bodies keep their numbers; joints, rows, axes and conditions have numbers of their own.
"""

from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.joints.buffers import Drives, JointMotion, joints_at_rest, no_drives
from rigid_sim_ros.engine.model.joints import FREE, JointTable, LawTable, MIMIC, NONE
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import inlined, kernel


class Part(NamedTuple):
    """A table of some articulations, their motion, and which rows of the whole these are."""

    table: JointTable
    motion: JointMotion
    joint: IntArray     # (j,)
    row: IntArray       # (r,)
    axis: IntArray      # (k,)
    condition: IntArray     # (c,)


def part_of(table: JointTable, motion: JointMotion, chosen: np.ndarray) -> Part:
    """Return the articulations that are chosen, (a,) of bool; what all share stays shared."""
    row, condition = (np.flatnonzero(chosen.repeat(np.diff(first)))
                      for first in (table.first_row, table.first_condition))
    axis = np.flatnonzero(np.isin(_row_of_axis(table), row))
    joint = np.flatnonzero(np.isin(articulation_of_joint(table), np.flatnonzero(chosen)))
    part = _cut(table, chosen, joint, row, axis, condition)
    fresh = joints_at_rest(part, no_drives(part))
    return Part(part, fresh._replace(known=motion.known, parts=motion.parts), joint, row, axis,
                condition)


def _row_of_axis(table: JointTable) -> IntArray:
    return np.arange(len(table.body)).repeat(np.diff(table.first_axis))


def articulation_of_joint(table: JointTable) -> IntArray:
    """Return in which articulation each joint is, NONE for what holds nothing."""
    of_row = np.arange(len(table.first_row) - 1).repeat(np.diff(table.first_row))
    found = np.full(len(table.kind), NONE)
    for body in (table.body_a, table.body_b):
        row = np.where(body >= 0, table.row_of_body[body], NONE)
        moves = (row != NONE) & (table.kind != FREE)
        found[moves] = of_row[row[moves]]
    return found


def _cut(table: JointTable, chosen: np.ndarray, joint: IntArray, row: IntArray, axis: IntArray,
         condition: IntArray) -> JointTable:
    """Return the rows of a table that are given, with numbers of their own."""
    joints, rows, axes = (_numbers(there, len(all_of)) for there, all_of in (
        (joint, table.kind), (row, table.body), (axis, table.translates)))
    has_laws = table.has_laws[axis]
    is_mimic = (table.condition_place[condition] == MIMIC)[:, None]
    of_joint: dict[str, Any] = {name: getattr(table, name)[joint] for name in (
        'kind', 'body_a', 'body_b', 'p_A', 'q_A', 'p_B', 'q_B', 'length')}
    of_axis: dict[str, Any] = {name: getattr(table, name)[axis] for name in (
        'translates', 'axis_body', 'axis')}
    return JointTable(
        **of_joint, row_of_joint=rows[table.row_of_joint[joint]],
        body=table.body[row], parent=rows[table.parent[row]], joint=joints[table.joint[row]],
        base=table.base[row], sense=table.sense[row],
        first_axis=_first(np.diff(table.first_axis)[row]),
        welded=rows[table.welded[row]], welded_to=table.welded_to[row],
        row_of_body=rows[table.row_of_body],
        **of_axis, axis_joint=joints[table.axis_joint[axis]],
        laws=LawTable._make(law[axis] for law in table.laws),
        has_laws=has_laws, lawful=int(has_laws.sum()),
        condition_joint=joints[table.condition_joint[condition]],
        condition_place=table.condition_place[condition],
        coupled_axis=np.where(is_mimic, axes[table.coupled_axis[condition]], NONE),
        coupling=table.coupling[condition], first_row=_first(np.diff(table.first_row)[chosen]),
        first_condition=_first(np.diff(table.first_condition)[chosen]))


def _numbers(there: IntArray, count: int) -> IntArray:
    """Return the new number of each old one; NONE, which is -1, stays NONE."""
    numbers = np.full(count + 1, NONE)
    numbers[there] = np.arange(len(there))
    return numbers


def _first(counts: IntArray) -> IntArray:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


@kernel
def take_out(part: Part, motion: JointMotion) -> None:
    """Let the part move as the whole does now."""
    _copy(part, motion, part.motion, True)


@kernel
def put_back(part: Part, motion: JointMotion) -> None:
    """Let the whole move as the part does now."""
    _copy(part, part.motion, motion, False)


@kernel
def _copy(part: Part, of: JointMotion, to: JointMotion, out: bool) -> None:
    """Copy the rows of the part; out: from the whole, else back to it."""
    for n in range(part.joint.shape[0]):
        i, k = _places(part.joint, n, out)
        to.position[i] = of.position[k]
        _copy_six(to.wrench, i, of.wrench, k)
    for n in range(part.axis.shape[0]):
        i, k = _places(part.axis, n, out)
        to.rate[i], to.effort[i] = of.rate[k], of.effort[k]
        to.held[i], to.held_at[i] = of.held[k], of.held_at[k]
        _copy_drive(to.drives, i, of.drives, k)
    for past in range(of.curvature.shape[0]):
        for n in range(part.row.shape[0]):
            i, k = _places(part.row, n, out)
            _copy_six(to.curvature[past], i, of.curvature[past], k)
        for n in range(part.condition.shape[0]):
            i, k = _places(part.condition, n, out)
            to.strain[past, i] = of.strain[past, k]


@inlined
def _places(rows: IntArray, n: int, out: bool) -> tuple[int, int]:
    """Return where row n of a part is copied to, and where it is copied from."""
    return (n, rows[n]) if out else (rows[n], n)


@kernel
def _copy_drive(to: Drives, n: int, of: Drives, k: int) -> None:
    to.mode[n], to.stiffness[n], to.damping[n] = of.mode[k], of.stiffness[k], of.damping[k]
    to.position[n], to.velocity[n], to.effort[n] = of.position[k], of.velocity[k], of.effort[k]
    to.steps_left[n] = of.steps_left[k]


@kernel
def _copy_six(to: Array, n: int, of: Array, k: int) -> None:
    for i in range(6):
        to[n, i] = of[k, i]
