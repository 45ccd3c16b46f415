# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Joints: what never changes of them while a world moves.

A joint holds a frame K of its parent A and the same frame of its child B together, but for the
motions that its kind allows; the axis of the joint is the z axis of K. The joints of a world span
a forest of bodies, whose trees hang on the world or, where nothing holds them, on one of their own
bodies. Each body of the forest has one row here, after the row of its parent. Joints that are left
over close loops.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.maths import union_find
from rigid_sim_ros.engine.maths.rotation_in_python import rotate
from rigid_sim_ros.engine.model.model import WORLD
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import in_python

FIXED, REVOLUTE, PRISMATIC, SPHERICAL, UNIVERSAL, PLANAR, DISTANCE, FREE = range(8)
NONE = -1       # no row, no joint
NO_LIMIT = np.inf

_first_of, _unite = in_python(union_find.first_of), in_python(union_find.unite)
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_OF_A, _OF_B, _OF_WORLD = range(3)
# The motions that a kind allows, as axes of rotation (0) and of translation (1), and the body in
# whose frame K an axis is fixed. Any three axes span the motions of a ball joint, so those of the
# world do.
_MOTIONS: dict[int, tuple[tuple[int, tuple[float, float, float], int], ...]] = {
    FIXED: (),
    REVOLUTE: ((0, _Z, _OF_A),),
    PRISMATIC: ((1, _Z, _OF_A),),
    SPHERICAL: ((0, _X, _OF_WORLD), (0, _Y, _OF_WORLD), (0, _Z, _OF_WORLD)),
    UNIVERSAL: ((0, _Z, _OF_A), (0, _X, _OF_B)),
    PLANAR: ((1, _X, _OF_A), (1, _Y, _OF_A), (0, _Z, _OF_A)),
}
_FLOATING = ((1, _X, _OF_WORLD), (1, _Y, _OF_WORLD), (1, _Z, _OF_WORLD), *_MOTIONS[SPHERICAL])
# Scalar conditions that a joint of a kind sets when it closes a loop.
_CONDITIONS = {FIXED: 6, REVOLUTE: 5, PRISMATIC: 5, SPHERICAL: 3, UNIVERSAL: 4, PLANAR: 3,
               DISTANCE: 1}


class Laws(NamedTuple):
    """
    Forces and bounds along the axes of motion of one joint.

    Units are those of a rotation; for a translation read m for rad and N for N m.
    """

    armature: float = 0.0       # reflected inertia of the motor [kg m^2]
    damping: float = 0.0        # [N m s/rad]
    friction: float = 0.0       # dry [N m]
    stiffness: float = 0.0      # of the spring [N m/rad]
    rest: float = 0.0           # position without a force of the spring [rad]
    lower: float = -NO_LIMIT    # bounds of the position [rad]
    upper: float = NO_LIMIT
    restitution: float = 0.0    # at these bounds
    velocity: float = NO_LIMIT  # up to which a drive accelerates [rad/s]
    effort: float = NO_LIMIT    # of a drive [N m]


class LawTable(NamedTuple):
    """`Laws` of all axes, each (k,)."""

    armature: Array
    damping: Array
    friction: Array
    stiffness: Array
    rest: Array
    lower: Array
    upper: Array
    restitution: Array
    velocity: Array
    effort: Array


class Mimic(NamedTuple):
    """Position = multiplier * position of another joint + offset, and both feel it."""

    joint: int
    multiplier: float
    offset: float   # [rad] or [m]


class Joint(NamedTuple):
    """How to make one joint."""

    kind: int
    body_a: int     # parent, WORLD for the world
    body_b: int     # child
    p_A: Array      # origin of K from C of A, (3,) [m], axes of C; of the world: from its origin
    q_A: Array      # axes of K to axes of C of A, (4,) x, y, z, w
    p_B: Array      # the same in B
    q_B: Array
    length: float = 0.0     # of a distance [m]
    laws: Laws = Laws()
    has_drive: bool = False
    mimic: Mimic | None = None


class JointTable(NamedTuple):
    """The constants of j joints, r bodies that they hold, and k axes along which these move."""

    # --- a row for each joint, in the order of the scene
    kind: IntArray      # (j,)
    body_a: IntArray    # (j,) parent, WORLD for the world
    body_b: IntArray    # (j,) child
    p_A: Array          # (j, 3) [m], see `Joint`
    q_A: Array          # (j, 4)
    p_B: Array          # (j, 3)
    q_B: Array          # (j, 4)
    length: Array       # (j,) [m] of a distance
    row_of_joint: IntArray      # (j,) the body that it holds in the forest, NONE for others
    # --- a row for each body, behind its parent's
    body: IntArray      # (r,)
    parent: IntArray    # (r,) row, NONE: hangs on the world or on nothing
    joint: IntArray     # (r,) through which it hangs on its parent, NONE on nothing
    base: IntArray      # (r,) the body that nothing pushes on which it hangs, WORLD for none
    # (r,) 1: the row is of the child of its joint; -1: of its parent, and the joint is passed
    # from its child to its parent
    sense: Array
    first_axis: IntArray        # (r + 1,)
    welded: IntArray    # (r,) the first row of those that fixed joints make one body of
    welded_to: IntArray     # (r,) how many others these are
    row_of_body: IntArray       # (n,) NONE: no joint holds it
    # --- a row for each axis
    translates: IntArray        # (k,) 1 or 0: rotates
    axis_body: IntArray         # (k,) in which it is fixed, WORLD for the world
    axis: Array                 # (k, 3) unit, axes of C of that body
    axis_joint: IntArray        # (k,) the joint that it belongs to, NONE: of a body that floats
    laws: LawTable
    has_laws: IntArray          # (k,) 1 if any force or bound acts along it
    lawful: int                 # how many of these there are
    # --- conditions that close loops and couple joints, a row for each, by articulation
    condition_joint: IntArray   # (c,)
    condition_place: IntArray   # (c,) which condition of the joint; MIMIC: a coupling
    coupled_axis: IntArray      # (c, 2) of a coupling: its own axis and the other one
    coupling: Array             # (c, 2) multiplier, offset
    # --- articulations: what hangs together, a row for each
    first_row: IntArray         # (a + 1,)
    first_condition: IntArray   # (a + 1,)


MIMIC = -1


def has_laws(joint: Joint) -> bool:
    """Return whether more than the geometry of a joint acts on its position."""
    return joint.has_drive or joint.mimic is not None or joint.laws != Laws()


class _Row(NamedTuple):
    """A body of the forest, see `JointTable`."""

    body: int
    parent: int
    joint: int
    base: int
    sense: float


class _Condition(NamedTuple):
    """A condition beside the tree, see `JointTable`."""

    joint: int
    place: int
    axes: tuple[int, int]
    coupling: tuple[float, float]


class _Forest:
    """The rows, while they are being found."""

    def __init__(self, joints: Sequence[Joint], mass: Sequence[float]) -> None:
        self.joints, self.mass = joints, mass
        self.moves = [m > 0.0 for m in mass]
        n = len(mass)
        self.in_forest = self._spanning(n)
        mimicked = {joint.mimic.joint for joint in joints if joint.mimic is not None}
        for j, joint in enumerate(joints):
            if not self.in_forest[j] and joint.kind not in (DISTANCE, FREE) and (
                    has_laws(joint) or j in mimicked):
                raise LoopError(j)
        self.groups = self._groups(n)
        self.rows: list[_Row] = []
        self.row_of = [NONE] * n
        self._hang()

    def node(self, body: int) -> int:
        """Return the body, or one number for all that nothing pushes."""
        return body if body != WORLD and self.moves[body] else len(self.moves)

    def _spanning(self, n: int) -> list[bool]:
        """
        Return which joints span the forest (Kruskal).

        First those along which forces act: they need an axis of their own. Then fixed joints, so
        that what they make one body of closes loops by the same joints as that body would.
        """
        first = np.arange(n + 1)
        chosen = [False] * len(self.joints)
        mimicked = {joint.mimic.joint for joint in self.joints if joint.mimic is not None}
        order = sorted(range(len(self.joints)), key=lambda j: (
            not (has_laws(self.joints[j]) or j in mimicked), self.joints[j].kind != FIXED))
        for j in order:
            joint = self.joints[j]
            a, b = self.node(joint.body_a), self.node(joint.body_b)
            if joint.kind not in (DISTANCE, FREE) and _first_of(first, a) != _first_of(first, b):
                _unite(first, a, b)
                chosen[j] = True
        return chosen

    def _groups(self, n: int) -> list[int]:
        """Return the first body of the articulation of each body that a joint holds, or NONE."""
        first = np.arange(n + 1)
        held = [False] * (n + 1)
        for joint in self.joints:
            if joint.kind == FREE:
                continue
            ends = [self.node(body) for body in (joint.body_a, joint.body_b)]
            other = None if joint.mimic is None else self.joints[joint.mimic.joint]
            if other is not None:
                ends += [self.node(other.body_a), self.node(other.body_b)]
            moving = [end for end in ends if end != n]
            for end in moving:
                held[end] = True
                _unite(first, moving[0], end)
        return [int(_first_of(first, i)) if held[i] else NONE for i in range(n)]

    def _hang(self) -> None:
        """Find the rows, articulation by articulation, each body behind its parent."""
        children = {joint.body_b for j, joint in enumerate(self.joints) if self.in_forest[j]}
        at: dict[int, list[int]] = {}
        for j, joint in enumerate(self.joints):
            if self.in_forest[j]:
                for body in (joint.body_a, joint.body_b):
                    at.setdefault(self.node(body), []).append(j)
        self.first_row = [0]
        world = len(self.moves)
        members: dict[int, list[int]] = {}
        for i, group in enumerate(self.groups):
            members.setdefault(group, []).append(i)
        members.pop(NONE, None)
        hanging: dict[int, list[tuple[int, int]]] = {group: [] for group in members}
        for j in at.get(world, []):
            joint = self.joints[j]
            end = joint.body_b if self.node(joint.body_a) == world else joint.body_a
            hanging[self.groups[end]].append((j, end))
        for group in sorted(members):
            for j, end in hanging[group]:
                if self.row_of[end] == NONE:
                    self._descend(NONE, j, at)
            # What hangs on nothing: from a body that is nobody's child, the heaviest of these. The
            # order in a file should not say which.
            for i in sorted(members[group], key=lambda i: (i in children, -self.mass[i], i)):
                if self.row_of[i] == NONE:
                    self.row_of[i] = len(self.rows)
                    self.rows.append(_Row(i, NONE, NONE, WORLD, 1.0))
                    self._descend_all(self.row_of[i], i, at)
            self.first_row.append(len(self.rows))

    def _descend(self, row: int, first: int, at: dict[int, list[int]]) -> None:
        """Add the rows of all that hangs on a row by a joint, in depth first order."""
        stack = [(row, first)]
        while stack:
            row, j = stack.pop()
            joint = self.joints[j]
            on = self.rows[row].body if row != NONE else len(self.moves)
            forward = self.node(joint.body_a) == on
            body = joint.body_b if forward else joint.body_a
            other = joint.body_a if forward else joint.body_b
            if self.row_of[body] != NONE:
                continue
            self.row_of[body] = len(self.rows)
            self.rows.append(_Row(body, row, j, WORLD if row != NONE else other,
                                  1.0 if forward else -1.0))
            stack += [(self.row_of[body], k) for k in reversed(at[body]) if k != j and self._other(
                k, body) != len(self.moves)]

    def _descend_all(self, row: int, body: int, at: dict[int, list[int]]) -> None:
        for j in at.get(body, []):
            self._descend(row, j, at)

    def _other(self, j: int, body: int) -> int:
        joint = self.joints[j]
        return self.node(joint.body_b if joint.body_a == body else joint.body_a)


class LoopError(ValueError):
    """A joint closes a loop and has forces of its own, which only joints of a tree have."""

    def __init__(self, joint: int) -> None:
        """Name the joint by its index."""
        super().__init__(joint)
        self.joint = joint


def build_joints(joints: Sequence[Joint], mass: Sequence[float]) -> JointTable:
    """
    Return the table of these joints; mass (n,) [kg] is 0 for what cannot be pushed.

    LoopError if forces act on a joint that closes a loop.
    """
    forest = _Forest(joints, mass)
    rows = forest.rows
    row_of_joint = [NONE] * len(joints)
    for r, row in enumerate(rows):
        if row.joint != NONE:
            row_of_joint[row.joint] = r
    first_axis, axes, axis_joint = [0], [], []
    laws: list[Laws] = []
    for row in rows:
        joint = joints[row.joint] if row.joint != NONE else None
        motions = _FLOATING if joint is None else _MOTIONS[joint.kind]
        axes += [_axis(joint, motion) for motion in motions]
        axis_joint += [row.joint] * len(motions)
        laws += [Laws() if joint is None else joint.laws] * len(motions)
        first_axis.append(len(axes))
    driven = [j != NONE and (joints[j].has_drive or joints[j].laws != Laws()) for j in axis_joint]
    conditions, first_condition = _conditions(joints, forest, row_of_joint, first_axis)
    welded = _welded(joints, forest)
    coupled = np.array([c.axes for c in conditions], dtype=np.int64).reshape(-1, 2)
    return JointTable(
        _integers([joint.kind for joint in joints]),
        _integers([joint.body_a for joint in joints]),
        _integers([joint.body_b for joint in joints]),
        _rows([joint.p_A for joint in joints], 3), _rows([joint.q_A for joint in joints], 4),
        _rows([joint.p_B for joint in joints], 3), _rows([joint.q_B for joint in joints], 4),
        np.array([joint.length for joint in joints], dtype=np.float64), _integers(row_of_joint),
        _integers([row.body for row in rows]), _integers([row.parent for row in rows]),
        _integers([row.joint for row in rows]), _integers([row.base for row in rows]),
        np.array([row.sense for row in rows], dtype=np.float64), _integers(first_axis),
        welded, np.bincount(welded, minlength=len(rows))[welded] - 1, _integers(forest.row_of),
        _integers([axis[0] for axis in axes]),
        _integers([axis[1] for axis in axes]), _rows([axis[2] for axis in axes], 3),
        _integers(axis_joint),
        LawTable._make(np.array([law[k] for law in laws], dtype=np.float64)
                       for k in range(len(Laws._fields))),
        _integers(driven), sum(driven),
        _integers([c.joint for c in conditions]), _integers([c.place for c in conditions]),
        coupled, _rows([np.array(c.coupling) for c in conditions], 2),
        _integers(forest.first_row), _integers(first_condition))


def _welded(joints: Sequence[Joint], forest: _Forest) -> IntArray:
    """Return the first row of those that fixed joints make one body of, for each row (r,)."""
    first = np.arange(len(forest.rows))
    for joint in joints:
        if joint.kind == FIXED and WORLD not in (joint.body_a, joint.body_b):
            a, b = forest.row_of[joint.body_a], forest.row_of[joint.body_b]
            if NONE not in (a, b):
                _unite(first, a, b)
    return _integers([_first_of(first, r) for r in range(len(first))])


def axis_groups(table: JointTable) -> IntArray:
    """
    Return which axes move together so that loops close and couplings hold, (k,).

    Axes of one group have the same number; NONE is an axis that no condition sees.
    """
    first = np.arange(len(table.translates))
    seen = np.zeros(len(first), dtype=bool)
    for m in range(len(table.condition_joint)):
        axes = _axes_of_condition(table, m)
        seen[axes] = True
        for k in axes[1:]:
            _unite(first, axes[0], k)
    return _integers([_first_of(first, k) if seen[k] else NONE for k in range(len(first))])


def _axes_of_condition(table: JointTable, m: int) -> list[int]:
    """Return the axes that condition m sees: of a loop those between the bodies that it joins."""
    if table.condition_place[m] == MIMIC:
        return [int(k) for k in table.coupled_axis[m]]
    j = table.condition_joint[m]
    ways: list[set[int]] = []
    for body in (int(table.body_a[j]), int(table.body_b[j])):
        row = NONE if body == WORLD else int(table.row_of_body[body])
        ways.append(set())
        while row != NONE:
            ways[-1].add(row)
            row = int(table.parent[row])
    return [k for row in sorted(ways[0] ^ ways[1])
            for k in range(int(table.first_axis[row]), int(table.first_axis[row + 1]))]


def _conditions(joints: Sequence[Joint], forest: _Forest, row_of_joint: Sequence[int],
                first_axis: Sequence[int]) -> tuple[list[_Condition], list[int]]:
    """Return the conditions beside the tree, sorted by articulation, and where each begins."""
    found: list[_Condition] = []
    first = [0]
    groups = [forest.groups[forest.rows[r].body] for r in forest.first_row[:-1]]
    members: dict[int, list[int]] = {}
    for j, joint in enumerate(joints):
        for body in (joint.body_a, joint.body_b):
            if forest.node(body) == body:
                members.setdefault(forest.groups[body], []).append(j)
                break
    for group in groups:
        for j in members.get(group, []):
            joint = joints[j]
            if not forest.in_forest[j] and joint.kind != FREE:
                found += [_Condition(j, place, (NONE, NONE), (0.0, 0.0))
                          for place in range(_CONDITIONS[joint.kind])]
            if joint.mimic is not None:
                own, other = (first_axis[row_of_joint[k]] for k in (j, joint.mimic.joint))
                found.append(_Condition(j, MIMIC, (own, other),
                                        (joint.mimic.multiplier, joint.mimic.offset)))
        first.append(len(found))
    return found, first


def _axis(joint: Joint | None, motion: tuple[int, tuple[float, float, float], int]) -> tuple[
        int, int, Array]:
    """Return whether an axis translates, the body that it is fixed in, and its direction."""
    translates, direction, of = motion
    if joint is None or of == _OF_WORLD:
        return translates, WORLD, np.array(direction)
    q = joint.q_A if of == _OF_A else joint.q_B
    body = joint.body_a if of == _OF_A else joint.body_b
    turned: tuple[float, float, float] = rotate(tuple(q.tolist()), direction)
    return translates, body, np.array(turned)


def _integers(numbers: Sequence[int]) -> IntArray:
    return np.array(numbers, dtype=np.int64)


def _rows(rows: Sequence[Array], width: int) -> Array:
    return np.array(rows, dtype=np.float64).reshape(-1, width)
