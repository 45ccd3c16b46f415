# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What joints that come or go do to the state of the bodies that they hold."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.joints.buffers import JointMotion
from rigid_sim_ros.engine.model.joints import NONE
from rigid_sim_ros.engine.state.state import copy_state, MOVING_FIELDS, State
from rigid_sim_ros.engine.steps.jointed_motion import JointedMotion
from rigid_sim_ros.scene import schema
from rigid_sim_ros.scene.joints import CLOSED, gap_of
from rigid_sim_ros.world.joint_numbering import Articulation, articulations

# [m, rad, or of a quaternion] What a few sums and products change of a pose: nothing has to be
# moved for it.
ROUNDED = 1e-12


class Before(NamedTuple):
    """What there was before a change, by names."""

    bodies: frozenset[str]
    at_start: frozenset[str]    # of these, that have not moved since the world began
    joints: frozenset[str]
    articulations: frozenset[tuple[frozenset[str], frozenset[str]]]     # joints and bodies


class Others:
    """Bodies and joints as they are before a change, for those that it is not about."""

    def __init__(self, state: State, motion: JointMotion) -> None:
        """Copy what a change may write to."""
        self._state = copy_state(state)
        self._of_axes = {name: getattr(motion, name).copy() for name in (
            'rate', 'held', 'held_at')}
        self._position = motion.position.copy()

    def stay(self, state: State, motion: JointMotion, bodies: np.ndarray, axes: np.ndarray,
             joints: np.ndarray) -> None:
        """Let what is True in these be as it was, to the last bit: what sleeps sleeps on."""
        for name in MOVING_FIELDS:
            getattr(state, name)[:, bodies] = getattr(self._state, name)[:, bodies]
        for name, before in self._of_axes.items():
            getattr(motion, name)[axes] = before[axes]
        motion.position[joints] = self._position[joints]


class Joining:
    """Takes the state of articulations over from what there was before a change."""

    def __init__(self, joints: JointedMotion, state: State, spec: schema.Scene,
                 bodies: Sequence[str], before: Before) -> None:
        """Take the joints and the state of the world after the change, which are written to."""
        self._joints, self._state, self._before = joints, state, before
        self._spec = {joint.name: joint for joint in spec.joints or ()}
        self._index = {name: j for j, name in enumerate(self._spec)}
        self._touched = [
            one for one in articulations(joints.table, list(self._spec), bodies)
            if (one.joints, one.bodies) not in before.articulations]

    def settle(self, fresh: Mapping[str, np.ndarray], brings: frozenset[str]) -> None:
        """
        Let new joints hold what they join; `brings` are those that may move what they hold.

        An articulation whose bodies have not moved yet begins as one that was there from the
        start, with the arrays `fresh`. ValueError for a joint that cannot close.
        """
        moved = []
        for one in self._touched:
            old = one.bodies & self._before.bodies
            if one.joints - self._before.joints and old <= self._before.at_start:
                self._begin(one, fresh)
            else:
                moved.append(one)
        if moved:
            self._settle(moved, brings)

    def _begin(self, one: Articulation, fresh: Mapping[str, np.ndarray]) -> None:
        body = self._joints.table.body[one.rows]
        for name in MOVING_FIELDS:
            getattr(self._state, name)[:, body] = fresh[name][:, body]
        motion = self._joints.motion
        motion.rate[one.axes] = fresh['joint_rate'][one.axes]
        places = [self._index[name] for name in one.joints]
        motion.position[places] = fresh['joint_position'][places]

    def _settle(self, moved: Sequence[Articulation], brings: frozenset[str]) -> None:
        motion, table = self._joints.motion, self._joints.table
        others = Others(self._state, motion)
        known, parts = motion.known.copy(), motion.parts.copy()
        new = [self._index[name] for one in moved for name in one.joints
               if name not in self._before.joints]
        if new:
            self._join(new, brings)
        else:
            self._joints.read_anew(self._state)
        bodies, axes, joints = (np.ones(count, bool) for count in (
            self._state.x.shape[1], len(motion.rate), len(motion.position)))
        for one in moved:
            bodies[table.body[one.rows]], axes[one.axes] = False, False
            joints[[self._index[name] for name in one.joints]] = False
        others.stay(self._state, motion, bodies, axes, joints)
        motion.known[:], motion.parts[:] = known, parts

    def _join(self, new: Sequence[int], brings: frozenset[str]) -> None:
        """Put together what new joints join, and let them answer to the momenta."""
        motion, table = self._joints.motion, self._joints.table
        named = list(self._spec.values())
        gaps = {j: gap_of(table, self._state, j) for j in new}
        for j, gap in gaps.items():
            if not gap <= CLOSED and named[j].name not in brings:
                raise ValueError(
                    f"joint '{named[j].name}': its frames in '{named[j].parent}' and "
                    f"'{named[j].child}' are {gap:.3g} m or rad apart now, must meet: leave "
                    'child_pose out, move a body, or write brings_child: true')
        position, rate = motion.position.copy(), np.full(len(motion.rate), np.nan)
        given = np.zeros(len(motion.rate), dtype=np.int64)
        for j in new:
            position[j] = self._wanted(named[j], position)
            r = int(table.row_of_joint[j])
            if r == NONE or named[j].type not in schema.ONE_AXIS:
                continue
            k = int(table.first_axis[r])
            given[k] = named[j].position is not None
            if named[j].velocity is not None:
                rate[k] = named[j].velocity
        if max(gaps.values()) <= ROUNDED and not any(position[new]):
            self._joints.project(self._state, rate)
            return
        gap = self._joints.join(self._state, position, given, rate)
        if not gap <= CLOSED:
            raise ValueError(f"joint '{named[new[0]].name}': {gap:.3g} rad, or of the length "
                             'of the articulation, are left where it and the other joints are to '
                             'meet, must be closed: begin from another pose of the bodies')

    def _wanted(self, joint: schema.Joint, position: np.ndarray) -> float:
        """Return the position at which a joint that comes begins."""
        if joint.position is None and joint.mimic is not None:
            other = self._index[joint.mimic.joint]
            return float(joint.mimic.multiplier * position[other] + joint.mimic.offset)
        return joint.position or 0.0
