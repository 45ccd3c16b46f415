# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a world offers of its joints."""

from collections.abc import Mapping, Sequence
import math
from typing import TYPE_CHECKING

import numpy as np

from rigid_sim_ros.engine.joints.buffers import JointMotion
from rigid_sim_ros.engine.joints.carrying import articulation_of, carry_along, hangs_on_something
from rigid_sim_ros.engine.joints.joint_coordinates import joint_coordinates
from rigid_sim_ros.engine.joints.joint_rates import joint_rate
from rigid_sim_ros.engine.joints.part import articulation_of_joint
from rigid_sim_ros.engine.maths.rotation_in_python import rotate
from rigid_sim_ros.engine.model.joints import axis_groups, NONE
from rigid_sim_ros.engine.state.state import copy_state, write_motion
from rigid_sim_ros.engine.steps.jointed_motion import JointedMotion, JointSetup
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.scene import Scene
from rigid_sim_ros.scene.joints import CLOSED, gap_of
from rigid_sim_ros.scene.schema import Bounds
from rigid_sim_ros.world.bounds import check_joint
from rigid_sim_ros.world.commands import Commanded
from rigid_sim_ros.world.joining import Others
from rigid_sim_ros.world.values import finite, some

if TYPE_CHECKING:
    from rigid_sim_ros.engine.state.state import BodyMotion

# What is taken back of a motion of joints that cannot be assembled: all but what drives are told.
_KEPT = tuple(name for name in JointMotion._fields if name != 'drives')


class WithJoints(Commanded):
    """
    The part of `World` that is about joints.

    A joint has the quantities of its scene: positions, velocities and efforts are of the child
    relative to the parent, about or along +axis. Those of joints with several axes, or none, are
    0 in the arrays; `joint_coordinates` has all.
    """

    scene: Scene
    _bounds: Bounds
    _joints: JointedMotion | None

    def _joint_setup(self) -> JointSetup | None:
        joints = self.scene.joints
        if joints is None:
            return None
        return JointSetup(joints.table, joints.position, joints.drives)

    def _begin_joints(self) -> None:
        """Take over the joints of the contact model, and read how they move at the start."""
        contact = getattr(self, '_contact', None)
        self._joints = contact if isinstance(contact, JointedMotion) else None
        if self._joints is not None:
            self._joints.read(self._state)

    @property
    def joint_names(self) -> list[str]:
        """The names of the joints, in the order of the scene."""
        return [joint.name for joint in self.scene.spec.joints or ()]

    @property
    def joint_position(self) -> Array:
        """Positions, (j,) [rad] or [m], with all turns; of a distance its length."""
        return np.zeros(0) if self._joints is None else self._joints.motion.position.copy()

    @property
    def joint_velocity(self) -> Array:
        """Velocities, (j,) [rad/s] or [m/s]; in a loop as well."""
        rates = self._by_joint('rate')
        if self._joints is not None:
            table = self._joints.table
            for j in np.flatnonzero(table.row_of_joint == NONE):
                rates[j] = joint_rate(self._model, table, self._state, int(j))
        return rates

    @property
    def joint_effort(self) -> Array:
        """Efforts of drive and spring, (j,) [N m] or [N], means over the latest step."""
        return self._by_joint('effort')

    def _by_joint(self, field: str) -> Array:
        """Return the numbers of the axes (k,) as those of joints with one axis, (j,)."""
        if self._joints is None:
            return np.zeros(0)
        along: Array = getattr(self._joints.motion, field)
        return np.array([along[k] if k != NONE else 0.0 for k in map(
            self._axis_of, range(len(self._joints.table.kind)))])

    def _axis_of(self, j: int) -> int:
        """Return the only axis of a joint, NONE if it has several, or none that is solved for."""
        assert self._joints is not None
        table = self._joints.table
        r = int(table.row_of_joint[j])
        if r == NONE or table.first_axis[r + 1] - table.first_axis[r] != 1:
            return NONE
        return int(table.first_axis[r])

    def joint_coordinates(self, name: str) -> Array:
        """
        Return the pose of the child's joint frame in that of the parent, (6,) [m, rad].

        The z axis of both is that of the joint. A position, then a rotation vector, or for a
        universal joint the angle about z, 0, and the one about the second axis, as x. ValueError
        for an unknown joint.
        """
        joints, j = self._known_joint(name)
        p, turn = joint_coordinates(joints.table, self._state, j)
        return np.array([*p, *turn])

    def joint_wrench(self, name: str) -> Array:
        """
        Return force [N] and moment [N m] through a joint on its child, (6,).

        About the origin of the joint frame of the child and in its axes, mean over the latest
        step. ValueError for an unknown joint.
        """
        joints, j = self._known_joint(name)
        assert self.scene.joints is not None
        x, y, z, w = self.scene.joints.q_JK[j].tolist()
        f, n = joints.motion.wrench[j].reshape(2, 3).tolist()
        return np.array([*rotate((x, y, z, w), tuple(f)), *rotate((x, y, z, w), tuple(n))])

    def set_joint_state(self, name: str, position: float, velocity: float = 0.0) -> None:
        """
        Put a joint with one axis at a position [rad or m] and a velocity [rad/s or m/s].

        What hangs on it moves with it; where it is part of a loop the other joints of the loop
        follow. The other joints keep their positions and velocities. ValueError for an unknown
        joint, one with several axes, numbers that are not finite or beyond the joint's limits, or
        a loop that cannot close there; then nothing has changed.
        """
        ((p, v),) = self._set_joints({name: (position, velocity)})
        self._tell('set_joint_state', name=name, position=p, velocity=v)

    def set_joint_states(self, states: Mapping[str, Mapping[str, float]]) -> None:
        """
        Do for several joints what `set_joint_state` does for one, at once: all of them, or none.

        states are by the names of the joints, as in {'shoulder': {'position': 0.5, 'velocity':
        0.0}}; a velocity that is not given is 0. Joints of one loop may be given together.
        """
        if not isinstance(states, Mapping) or not all(
                isinstance(one, Mapping) and 'position' in one
                and one.keys() <= {'position', 'velocity'} for one in states.values()):
            raise ValueError(f'states {states!r:.80}, must be a mapping of joints to mappings '
                             'with a position, and a velocity if any')
        found = self._set_joints({name: (one['position'], one.get('velocity', 0.0))
                                  for name, one in states.items()})
        self._tell('set_joint_states', states={
            name: {'position': p, 'velocity': v}
            for name, (p, v) in zip(states, found, strict=True)})

    def _set_joints(self, goals: Mapping[str, tuple[float, float]]) -> list[tuple[float, float]]:
        """Put joints at positions and velocities, and return these; ValueError changes nothing."""
        found = [self._joint_goal(name, *goal) for name, goal in goals.items()]
        if not found:
            return []
        assert self._joints is not None
        joints, before = self._joints, self._kept()
        positions, rates = joints.motion.position.copy(), joints.motion.rate.copy()
        groups = axis_groups(joints.table)
        follows = (groups != NONE) & np.isin(groups, groups[[k for _, k, *_ in found]])
        given = 1 - follows.astype(np.int64)
        rates[follows] = np.nan
        for j, k, p, v in found:
            positions[j], rates[k], given[k] = p, v, 1
        gap = self._assemble([j for j, *_ in found], positions, given, rates)
        if not gap <= CLOSED:
            self._take_back(before)
            told = ', '.join(f"position {p:g} of joint '{name}'"
                             for name, (_, _, p, _) in zip(goals, found, strict=True))
            raise ValueError(f'{told}: its loop cannot close there, {gap:.3g} rad, or of '
                             'the length of the articulation, are left; must be one that it '
                             'can reach')
        self._motion_is_current = False
        return [(p, v) for *_, p, v in found]

    def _joint_goal(self, name: str, position: float,
                    velocity: float) -> tuple[int, int, float, float]:
        """Return joint, axis, position and velocity; ValueError for what cannot be."""
        joints, j = self._known_joint(name)
        k = self._axis_of(j)
        if k == NONE:
            raise ValueError(f"joint '{name}' has not one axis of its own, must be a revolute, "
                             'continuous or prismatic one that closes no loop')
        p, v = finite('position', position, 0.0), finite('velocity', velocity, 0.0)
        check_joint(self._bounds, name, bool(joints.table.translates[k]), p, v)
        wrong = (self.scene.spec.joints or ())[j].limits.beyond(p, math.nan, name)
        if wrong:
            raise ValueError(wrong)
        return j, k, p, v

    def _assemble(self, moved: Sequence[int], position: Array, given: IntArray,
                  rate: Array) -> float:
        """
        Put the bodies of the articulations of some joints where coordinates and rates say.

        See `JointedMotion.assemble`; all others stay as they are.
        """
        assert self._joints is not None
        table, motion = self._joints.table, self._joints.motion
        others = Others(self._state, motion)
        gap = self._joints.assemble(self._state, position, given, rate)
        of_joint = articulation_of_joint(table)
        stays = ~np.isin(np.arange(len(table.first_row) - 1), of_joint[list(moved)])
        rows = stays.repeat(np.diff(table.first_row))
        bodies = np.zeros(self._state.x.shape[1], bool)
        bodies[table.body[rows]] = True
        others.stay(self._state, motion, bodies, rows.repeat(np.diff(table.first_axis)),
                    (of_joint != NONE) & stays[of_joint])
        return gap

    def _kept(self) -> tuple[list[np.ndarray], list[np.ndarray]]:
        assert self._joints is not None
        motion = self._joints.motion
        return ([array.copy() for array in self._state],
                [getattr(motion, name).copy() for name in _KEPT])

    def _take_back(self, kept: tuple[list[np.ndarray], list[np.ndarray]]) -> None:
        assert self._joints is not None
        motion = self._joints.motion
        for array, old in zip(self._state, kept[0], strict=True):
            array[...] = old
        for name, old in zip(_KEPT, kept[1], strict=True):
            getattr(motion, name)[...] = old

    def _known_joint(self, name: str) -> tuple[JointedMotion, int]:
        names = self.joint_names
        if self._joints is None or name not in names:
            raise ValueError(f'joint {name!r} does not exist, must be one of: '
                             f'{some(names) or "none, the scene has no joints"}')
        return self._joints, names.index(name)

    def kinetic_energy(self) -> float:
        """Return the kinetic energy of all bodies, and of what turns in joints [J]."""
        return super().kinetic_energy() + self._armature_energy()

    def potential_energy(self) -> float:
        """Return the potential energy of gravity, of the scene's forces and of springs [J]."""
        return super().potential_energy() + self._spring_energy()

    def _armature_energy(self) -> float:
        """Return the kinetic energy of what turns with the axes and is no body [J]."""
        if self._joints is None:
            return 0.0
        motion = self._joints.motion
        return float((0.5 * self._joints.table.laws.armature * motion.rate ** 2).sum())

    def _spring_energy(self) -> float:
        if self._joints is None:
            return 0.0
        table = self._joints.table
        stretch = self._joints.motion.position[np.maximum(table.axis_joint, 0)] - table.laws.rest
        return float((0.5 * table.laws.stiffness * stretch ** 2).sum())

    def _pass_on(self, body: int) -> None:
        """Let joints answer to a change of the momenta of a body."""
        if self._joints is not None and self._joints.table.row_of_body[body] != NONE:
            self._joints.project(self._state)

    def _check_can_be_put(self, body: int) -> None:
        """Raise ValueError for a body that joints hold to the world: its pose is theirs."""
        if self._joints is None:
            return
        g = articulation_of(self._joints.table, body)
        if g != NONE and hangs_on_something(self._joints.table, g):
            raise ValueError(f"body '{self.names[body]}' is held to the world by joints: use "
                             'set_joint_state')

    def _put(self, body: int, motion: 'BodyMotion') -> None:
        """Give a body its row of motion; what hangs together with it goes along."""
        if self._joints is None or self._joints.table.row_of_body[body] == NONE:
            write_motion(self._model, self._state, motion, body)
            return
        before = copy_state(self._state)
        write_motion(self._model, self._state, motion, body)
        carry_along(self._model, self._joints.table, self._state, before, body)
        self._joints.project(self._state)

    def _follow(self, body: int) -> None:
        """Let all that hangs on a body that nothing pushes be where that is put at once."""
        if self._joints is None:
            return
        table, motion = self._joints.table, self._joints.motion
        on = np.flatnonzero((table.body_a == body) | (table.body_b == body)).tolist()
        # It may as well move there in the next step, and carry them.
        if max((gap_of(table, self._state, j) for j in on), default=0.0) <= CLOSED:
            return
        self._assemble(on, motion.position.copy(), np.zeros(len(motion.rate), dtype=np.int64),
                       motion.rate.copy())
