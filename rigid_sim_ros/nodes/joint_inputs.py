# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What other nodes tell joints: checked where it arrives, and queued as inputs.py says."""
from collections.abc import Sequence
import math
from typing import Any

from rigid_sim_ros.messages.topics import JOINT_COMMANDS, JOINT_TRAJECTORY, SET_JOINT_STATES
from rigid_sim_ros.nodes.inputs import JointInput, Queue, Refusals
from rigid_sim_ros.scene import schema
from rigid_sim_ros.scene.joint_groups import full_name, joint_groups
from rigid_sim_ros.times import SECOND
from rigid_sim_ros.words import nearest
from rigid_sim_ros.world.commands import Command
from rigid_sim_ros.world.drives import how_to_drive

_NAN = math.nan

# What a drive needs so that it can be told one of these, and what it is told then.
_NEEDED = {'position': 'stiffness', 'velocity': 'gain', 'effort': ''}


class _Refused(Exception):
    """A message is refused, for a reason that is counted, with a text that is logged."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


class JointReceiver:
    """Checks ROS messages to the joints of models; one that is wrong in anything does nothing."""

    def __init__(self, queue: Queue, refusals: Refusals,
                 joints: Sequence[schema.Joint] | None) -> None:
        """Take the joints of the scene."""
        self._put = queue.put
        self._refuse = refusals.refuse
        named = joints or ()
        self._joints = {group.model: {name: named[j] for name, j in zip(
            group.names, group.places, strict=True)} for group in joint_groups(joints)}

    @property
    def models(self) -> list[str]:
        """The models that have joints, '' for those of the scene itself."""
        return list(self._joints)

    def commands(self, model: str, message: Any) -> None:
        """Take a sensor_msgs/JointState of goals: of each joint what is filled and no NaN."""
        self._take(model, JOINT_COMMANDS, message, self._commands)

    def trajectory(self, model: str, message: Any) -> None:
        """Take a trajectory_msgs/JointTrajectory."""
        self._take(model, JOINT_TRAJECTORY, message, self._trajectory)

    def states(self, model: str, message: Any) -> None:
        """Take a sensor_msgs/JointState of positions and velocities to be in at once."""
        self._take(model, SET_JOINT_STATES, message, self._states)

    def _take(self, model: str, kind: str, message: Any, read: Any) -> None:
        topic = full_name(model, kind)
        try:
            commands = read(model, message)
        except _Refused as refused:
            self._refuse(refused.reason, f'{topic}: {refused}')
            return
        self._put(JointInput(topic, commands))

    def _commands(self, model: str, message: Any) -> tuple[Command, ...]:
        joints = self._named(model, message.name)
        told = {}
        for name, joint, goals in self._rows(joints, message, tuple(_NEEDED)):
            given = {what: value for what, value in goals.items() if value == value}
            if not given:
                continue        # NaN in all: it goes on with what it was told
            mode = next(iter(given))
            _check_drive(name, joint, mode)
            _check_limits(name, joint, given)
            told[joint.name] = {'mode': mode, **given}
        return (Command('set_joint_commands', {'commands': told}),) if told else ()

    def _states(self, model: str, message: Any) -> tuple[Command, ...]:
        joints = self._named(model, message.name)
        states = {}
        for name, joint, goals in self._rows(joints, message, ('position', 'velocity')):
            position, velocity = goals['position'], goals['velocity']
            if position != position:
                if velocity == velocity:
                    raise _Refused('not finite', f'joint {name!r} has a velocity and no position, '
                                   'must have both')
                continue
            states[joint.name] = {'position': position,
                                  'velocity': velocity if velocity == velocity else 0.0}
        return (Command('set_joint_states', {'states': states}),) if states else ()

    def _trajectory(self, model: str, message: Any) -> tuple[Command, ...]:
        joints = self._named(model, message.joint_names)
        if not message.points:
            raise _Refused('length', 'no points, must be at least one: the present positions stop '
                           'a motion')
        columns: dict[str, list[list[float]]] = {
            'positions': [], 'velocities': [], 'accelerations': []}
        for k, point in enumerate(message.points):
            if len(point.effort):
                raise _Refused('effort', f'point {k} has efforts, must have none: the drives find '
                               'theirs')
            for what, rows in columns.items():
                rows.append(_row(what, k, list(getattr(point, what)), joints))
        start = _seconds(message.header.stamp)
        return (Command('follow_trajectory', {
            'names': [joint.name for joint in joints.values()],
            'times': [_seconds(point.time_from_start) for point in message.points],
            **columns, 'start': start or None}),)

    def _named(self, model: str, names: Sequence[str]) -> dict[str, schema.Joint]:
        """Return the joints that a message names, by these names."""
        known = self._joints[model]
        if not names:
            raise _Refused('length', f'no joint is named, must be some of: {", ".join(known)}')
        for name in names:
            if name not in known:
                raise _Refused('unknown joint', f'there is no joint {name!r}, '
                               f'{nearest(name, known)}')
        found = {name: known[name] for name in names}
        if len(found) < len(names):
            twice = next(name for name in names if list(names).count(name) > 1)
            raise _Refused('named twice', f'joint {twice!r} is named twice, must be named once')
        return found

    def _rows(self, joints: dict[str, schema.Joint], message: Any,
              fields: Sequence[str]) -> list[tuple[str, schema.Joint, dict[str, float]]]:
        """Return what a sensor_msgs/JointState says of each joint; NaN where it says nothing."""
        columns = {}
        for what in ('position', 'velocity', 'effort'):
            values = list(getattr(message, what))
            if len(values) not in (0, len(joints)):
                raise _Refused('length', f'{len(joints)} joints and {len(values)} of {what}, must '
                               'be as many, or none')
            if any(map(math.isinf, values)):
                raise _Refused('not finite', f'{what} {values}, must be finite, or NaN to leave a '
                               'joint alone')
            columns[what] = values or [_NAN] * len(joints)
        return [(name, joint, {what: columns[what][k] for what in fields})
                for k, (name, joint) in enumerate(joints.items())]


def _check_drive(name: str, joint: schema.Joint, mode: str) -> None:
    if joint.drive is None:
        raise _Refused('no drive', f'joint {name!r} has no drive that could follow a command: '
                       f'{how_to_drive(joint)}')
    needed = _NEEDED[mode]
    if needed and getattr(joint.drive, needed) is None:
        raise _Refused('no drive', f'the drive of joint {name!r} has no {needed} to follow a '
                       f'{mode}: write it in the scene, or leave {mode} out')


def _check_limits(name: str, joint: schema.Joint, given: dict[str, float]) -> None:
    """
    Refuse goals that a joint is not to reach.

    An effort beyond the limit is none: the drive exerts what it can, as with its own controller.
    """
    wrong = joint.limits.beyond(given.get('position', _NAN), given.get('velocity', _NAN), name)
    if wrong:
        raise _Refused('limits', wrong)


def _row(what: str, k: int, values: list[float], joints: dict[str, schema.Joint]) -> list[float]:
    """Return a row of a point of a trajectory; NaN for what it need not have."""
    if len(values) not in ((len(joints),) if what == 'positions' else (0, len(joints))):
        raise _Refused('length', f'{len(joints)} joints and {len(values)} {what} in point {k}, '
                       'must be as many' + ('' if what == 'positions' else ', or none'))
    if not all(map(math.isfinite, values)):
        raise _Refused('not finite', f'{what} {values} in point {k}, must be finite numbers')
    return values or [_NAN] * len(joints)


def _seconds(time: Any) -> float:
    """Return a builtin_interfaces/Time or Duration in s."""
    return float((time.sec * SECOND + time.nanosec) / SECOND)
