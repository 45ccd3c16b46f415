# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the numbers of joints go when joints come and go, see `snapshot_check.TABLE`."""

from collections.abc import Hashable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.kernels.arrays import IntArray

GONE = -1       # the new number of what is no longer there


class JointNumbering(NamedTuple):
    """How a world numbers what its joints hold, each thing by a name that lasts."""

    joints: Sequence[str]           # J
    rows: Sequence[Hashable]        # R
    axes: Sequence[Hashable]        # K
    conditions: Sequence[Hashable]  # C


class JointPlaces(NamedTuple):
    """The new number of each old one, GONE if there is none."""

    joint: IntArray         # (j,)
    row: IntArray           # (r,)
    axis: IntArray          # (k,)
    condition: IntArray     # (c,)

    def by_axis(self) -> Mapping[str, IntArray]:
        """Return these by what the axes of arrays are called."""
        return dict(zip('JRKC', self, strict=True))


class Articulation(NamedTuple):
    """Rows of a table that hang together, and their axes."""

    rows: slice
    axes: slice
    joints: frozenset[str]
    bodies: frozenset[str]


def articulations(table: JointTable, joints: Sequence[str],
                  bodies: Sequence[str]) -> list[Articulation]:
    """Return the articulations of a table, by the names of its joints and bodies."""
    found = []
    held: dict[int, set[str]] = {}
    for j, name in enumerate(joints):
        for body in (int(table.body_a[j]), int(table.body_b[j])):
            if body >= 0 and table.row_of_body[body] != NONE:
                held.setdefault(int(table.row_of_body[body]), set()).add(name)
    for first, end in zip(table.first_row[:-1].tolist(), table.first_row[1:].tolist(),
                          strict=True):
        rows = range(first, end)
        names = {name for r in rows for name in held.get(r, ())}
        found.append(Articulation(
            slice(first, end), slice(int(table.first_axis[first]), int(table.first_axis[end])),
            frozenset(names),
            frozenset(bodies[int(table.body[r])] for r in rows)))
    return found


def joint_numbering(table: JointTable | None, joints: Sequence[str],
                    bodies: Sequence[str]) -> JointNumbering:
    """
    Return the lasting names of what a table numbers.

    Rows and conditions are known by their whole articulation: what they remember of the past
    says nothing once other joints are in it. Axes are known by their joint, or of what floats by
    the body.
    """
    if table is None:
        return JointNumbering((), (), (), ())
    rows: list[Hashable] = []
    axes: list[Hashable] = []
    conditions: list[Hashable] = []
    for g, one in enumerate(articulations(table, joints, bodies)):
        for r in range(one.rows.start, one.rows.stop):
            body = bodies[int(table.body[r])]
            rows.append((one.joints, body))
            j, first = int(table.joint[r]), int(table.first_axis[r])
            owner = ('body', body) if j == NONE else ('joint', joints[j])
            axes += [(owner, k - first) for k in range(first, int(table.first_axis[r + 1]))]
        conditions += [(one.joints, joints[int(table.condition_joint[m])],
                        int(table.condition_place[m]))
                       for m in range(int(table.first_condition[g]),
                                      int(table.first_condition[g + 1]))]
    return JointNumbering(joints, rows, axes, conditions)


def joints_between(before: JointNumbering, after: JointNumbering) -> JointPlaces:
    """Return where the things of one numbering are in another one."""
    return JointPlaces(*(_between(old, new) for old, new in zip(before, after, strict=True)))


def _between(before: Sequence[Hashable], after: Sequence[Hashable]) -> IntArray:
    place = {one: i for i, one in enumerate(after)}
    return np.array([place.get(one, GONE) for one in before], dtype=np.int64)
