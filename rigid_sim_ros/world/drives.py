# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What the drives of a world's joints are told: goals, and trajectories that they lead along.

How they act: engine/joints/laws.py.
"""

from collections.abc import Mapping, Sequence
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rigid_sim_ros.engine.joints.buffers import LASTS
from rigid_sim_ros.engine.model.joints import NONE
from rigid_sim_ros.engine.model.model import WORLD
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.scene.joint_groups import model_of
from rigid_sim_ros.scene.joints import MODES, set_drive
from rigid_sim_ros.scene.schema import Joint, JointDrive
from rigid_sim_ros.world.bounds import check_joint, check_joint_change
from rigid_sim_ros.world.joints import WithJoints
from rigid_sim_ros.world.trajectories import (
    extremes, FIELDS as PATH_FIELDS, pieces, start_of, Trajectories, Waypoints)
from rigid_sim_ros.world.values import duration_in_steps, finite

_TURN = 2.0 * math.pi
# [rad/s or m/s] What a planner leaves of a velocity of 0 in single precision.
_AT_REST = 1e-6


class _Goal(NamedTuple):
    """What a drive is told."""

    joint: int
    axis: int
    drive: JointDrive
    mode: str
    position: float     # [rad or m]
    velocity: float     # [rad/s or m/s]
    effort: float       # [N m or N]


def how_to_drive(joint: Joint) -> str:
    """Return what to do for a joint without a drive that is told something."""
    if joint.mimic is not None:
        return f"it follows '{joint.mimic.joint}', which is to be told"
    return 'write `drive: {mode: effort}` in the scene'


class WithDrives(WithJoints):
    """The part of `World` that tells drives what to do."""

    step_ns: int
    _paths: Trajectories
    _leads: bool        # whether there may be any: `step` asks before each step

    def _begin_joints(self) -> None:
        self._paths, self._leads = Trajectories(), False
        super()._begin_joints()

    def set_joint_command(self, name: str, mode: str | None = None,
                          position: float | None = None, velocity: float | None = None,
                          effort: float | None = None, duration: float | None = None) -> None:
        """
        Tell the drive of a joint what to do from the next step on.

        mode is 'effort', 'velocity' or 'position'; None: the mode of the scene. position [rad or
        m] and velocity [rad/s or m/s] are what it is to reach, effort [N m or N] what it exerts
        in any case; what is not given is 0, a position the present one. After `duration` [s] of
        simulation time, in whole steps, the drive lets go; None: it never does. ValueError for an
        unknown joint, one without the gains that the mode needs, or numbers that are not finite.
        """
        goal = self._goal(name, mode, position, velocity, effort)
        self._follow_goals([goal], duration)
        self._tell('set_joint_command', name=name, mode=goal.mode, position=goal.position,
                   velocity=goal.velocity, effort=goal.effort, duration=duration)

    def set_joint_commands(self, commands: Mapping[str, Mapping[str, Any]],
                           duration: float | None = None) -> None:
        """
        Tell the drives of several joints what to do, all of them or none.

        commands are by the names of the joints: what `set_joint_command` takes besides them, as
        in {'shoulder': {'mode': 'position', 'position': 0.5}}.
        """
        if not isinstance(commands, Mapping) or not all(
                isinstance(told, Mapping) for told in commands.values()):
            raise ValueError(f'commands {commands!r:.80}, must be a mapping of joints to mappings')
        goals = [self._goal(name, **told) for name, told in commands.items()]
        self._follow_goals(goals, duration)
        self._tell('set_joint_commands', commands={
            name: {'mode': goal.mode, 'position': goal.position, 'velocity': goal.velocity,
                   'effort': goal.effort}
            for name, goal in zip(commands, goals, strict=True)}, duration=duration)

    def _goal(self, name: str, mode: str | None = None, position: float | None = None,
              velocity: float | None = None, effort: float | None = None) -> _Goal:
        """Return what a drive is told, with what is not given; ValueError for what cannot be."""
        joints, j = self._known_joint(name)
        drive, k = (self.scene.spec.joints or ())[j].drive, self._axis_of(j)
        if drive is None or k == NONE:
            raise ValueError(f"joint '{name}' has no drive: "
                             f'{how_to_drive((self.scene.spec.joints or ())[j])}')
        mode = drive.mode if mode is None else mode
        if mode not in MODES:
            raise ValueError(f'mode {mode!r}, must be one of: {", ".join(MODES)}')
        needed = {'velocity': 'gain', 'position': 'stiffness'}.get(mode)
        if needed is not None and getattr(drive, needed) is None:
            raise ValueError(f"joint '{name}' has no {needed} for the mode {mode!r}: write it in "
                             'the drive in the scene')
        q, rate = float(joints.motion.position[j]), float(joints.motion.rate[k])
        p, v, e = (finite(what, value, default) for what, value, default in (
            ('position', position, q), ('velocity', velocity, 0.0), ('effort', effort, 0.0)))
        self._check_pull(name, j, k, drive, mode, (abs(p - q), abs(v - rate), abs(e)))
        return _Goal(j, k, drive, mode, p, v, e)

    def _follow_goals(self, goals: Sequence[_Goal], duration: float | None) -> None:
        steps = LASTS if duration is None else duration_in_steps(duration, self._model.h)
        if steps == 0 or self._joints is None:
            return
        drives = self._joints.motion.drives
        for goal in goals:
            self._paths.drop(goal.joint)
            set_drive(drives, goal.axis, goal.drive, goal.mode, goal.position, goal.velocity,
                      goal.effort)
            drives.steps_left[goal.axis] = steps

    def follow_trajectory(self, names: Sequence[str], times: ArrayLike, positions: ArrayLike,
                          velocities: ArrayLike | None = None,
                          accelerations: ArrayLike | None = None,
                          start: float | None = None) -> None:
        """
        Let the drives of some joints lead them along a trajectory, from the next step on.

        It has p points at `times` (p,) [s] after `start` [s] of simulation time, None: now; points
        are positions, and, as far as they are given, velocities and accelerations, each (p, j) for
        the j names, with nan in points that have none. Between points it is interpolated as
        ros2_control's joint_trajectory_controller does, see trajectories.py; it begins where the
        joints are, and they hold the last point. It takes the place of what the joints were told
        before; other joints of these models that followed a trajectory stay at their goals.
        ValueError for an unknown joint or one whose drive has no stiffness, for numbers that are
        not finite, positions and velocities beyond the limits, a velocity at the end, and times
        that do not grow or are over.
        """
        points = Waypoints(names, times, positions, velocities, accelerations)
        chosen = [self._led(name) for name in names]
        for i, name in enumerate(names):
            self._check_goals(name, points.positions[:, i], points.velocities[:, i])
        now_ns = self.step_index * self.step_ns
        start_ns = start_of(start, now_ns, points)
        assert self._joints is not None
        motion = self._joints.motion
        paths = []
        for i, (name, (j, k, drive)) in enumerate(zip(names, chosen, strict=True)):
            q, rate = float(motion.position[j]), float(motion.rate[k])
            path = pieces(points, i, start_ns, now_ns, q, rate,
                          _TURN if self._is_continuous(j) else 0.0)
            p, v = extremes(*path)
            self._check_pull(name, j, k, drive, 'position', (
                float(np.abs(p - q).max()), float(np.abs(v - rate).max()), 0.0))
            paths.append(path)
        models = {model_of(name) for name in names}
        for j in self._paths.joints.tolist():
            if model_of(self.joint_names[j]) in models:
                self._paths.drop(j)
                motion.drives.velocity[self._axis_of(j)] = 0.0
        for (j, k, drive), path in zip(chosen, paths, strict=True):
            self._paths.put(j, *path)
            set_drive(motion.drives, k, drive, 'position', float(motion.position[j]),
                      float(motion.rate[k]), 0.0)
            motion.drives.steps_left[k] = LASTS
        self._leads = True
        self._tell('follow_trajectory', names=list(names), times=points.seconds,
                   positions=points.positions, velocities=points.velocities,
                   accelerations=points.accelerations, start=start)

    def _is_continuous(self, j: int) -> bool:
        return (self.scene.spec.joints or ())[j].type == 'continuous'

    def _led(self, name: str) -> tuple[int, int, JointDrive]:
        """Return a joint that can be led, its axis and its drive; ValueError for others."""
        _, j = self._known_joint(name)
        drive, k = (self.scene.spec.joints or ())[j].drive, self._axis_of(j)
        if drive is None or drive.stiffness is None or k == NONE:
            raise ValueError(f"joint '{name}' has no drive that leads it to a position: write "
                             '`drive: {mode: position, stiffness: ..., damping: ...}` in the '
                             'scene')
        return j, k, drive

    def _check_pull(self, name: str, j: int, k: int, drive: JointDrive, mode: str,
                    most: tuple[float, float, float]) -> None:
        """
        Raise ValueError if a drive may change the velocity of a joint beyond the bounds.

        most are distances from its goals: of the position, of the velocity, and the effort. In a
        step of h the implicit drive changes the velocity of a joint with the inertia I by
        h F / (I + h damping + h^2 stiffness); the lightest that I can be is one of its bodies.
        """
        assert self._joints is not None
        table, model = self._joints.table, self._model
        h, is_slide = model.h, bool(table.translates[k])
        stiffness = (drive.stiffness or 0.0) if mode == 'position' else 0.0
        damping = {'effort': 0.0, 'velocity': drive.gain or 0.0, 'position': drive.damping}[mode]
        lightness = max(float(model.inv_m[i] if is_slide else model.inv_I_C[:, i].max())
                        for i in (int(table.body_a[j]), int(table.body_b[j])) if i != WORLD)
        force = min(most[2] + stiffness * most[0] + damping * most[1],
                    float(table.laws.effort[k]))
        check_joint_change(self._bounds, name, is_slide, h * force * lightness / (
            1.0 + h * (damping + h * stiffness) * lightness))

    def _check_goals(self, name: str, positions: Array, velocities: Array) -> None:
        """Raise ValueError for points beyond the limits of a joint, and a velocity at the end."""
        joint = (self.scene.spec.joints or ())[self.joint_names.index(name)]
        check_joint(self._bounds, name, joint.type == 'prismatic',
                    float(np.abs(positions).max()), float(np.nanmax(np.abs([*velocities, 0.0]))))
        for k, (p, v) in enumerate(zip(positions.tolist(), velocities.tolist(), strict=True)):
            wrong = joint.limits.beyond(p, v, name, f' in point {k}')
            if wrong:
                raise ValueError(wrong)
        if abs(velocities[-1]) > _AT_REST:
            raise ValueError(f"velocity {velocities[-1]:g} of joint '{name}' in the last point, "
                             'must be 0: there the joint stays')

    def _lead(self, left: int) -> int:
        """
        Give the drives on trajectories their goals for the end of the next step.

        Returns for how many steps all drives keep their goals, `left` at most.
        """
        self._leads = not self._paths.are_empty
        if not self._leads:
            return left
        assert self._joints is not None
        joints, position, velocity = self._paths.at((self.step_index + 1) * self.step_ns)
        axes = [self._axis_of(j) for j in joints.tolist()]
        drives = self._joints.motion.drives
        drives.position[axes], drives.velocity[axes] = position, velocity
        return left if self._paths.are_empty else 1

    def _path_rows(self) -> dict[str, np.ndarray]:
        """Return the trajectories for a snapshot, of a world with joints."""
        return {} if self._joints is None else self._paths.rows()

    def _check_paths(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Raise ValueError for trajectories in a snapshot such as no world has."""
        if self._joints is None:
            return
        joint, begin, _ = (arrays[name] for name in PATH_FIELDS)
        drives = [one.drive for one in self.scene.spec.joints or ()]
        if any((drive := drives[j]) is None or drive.stiffness is None or self._axis_of(j) == NONE
               for j in set(joint.tolist())):
            raise ValueError('the snapshot has trajectories of joints whose drives cannot lead '
                             'them: it was changed, or saved by another version')
        if (np.diff(joint) < 0).any() or (np.diff(begin)[np.diff(joint) == 0] <= 0).any():
            raise ValueError('the snapshot has trajectories that are not sorted: it was changed, '
                             'or saved by another version')

    def _take_paths(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go on with the trajectories of a snapshot, if there are joints."""
        if self._joints is not None:
            self._paths.replace(arrays)
            self._leads = True
