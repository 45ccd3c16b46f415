# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The motion in a bag as arrays: for plots and films.

Of a simulation it is read from ~/state. Any other bag gives what it has on topics of the types
PoseStamped, TwistStamped and Odometry, a body for each.
"""

from collections.abc import Sequence
import contextlib
import os
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from rigid_sim_ros.bag import decode, events, session as sessions, topics as kinds
from rigid_sim_ros.bag.arrivals import Arrivals, with_arrivals
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.bag.session import Session
from rigid_sim_ros.messages.topics import body_of
from rigid_sim_ros.scene import Scene, scene_from_text, SceneError
from rigid_sim_ros.times import SECOND

Array: TypeAlias = npt.NDArray[np.float64]

# Stamps beyond this [s] are a date, not the time of a simulation: 1 January 2001.
_DATE = 978_307_200.0
_ODOMETRY = 'nav_msgs/msg/Odometry'
_POSE, _TWIST = slice(0, 7), slice(7, 13)
_WIDTH = 13
# Numbers in a table of all bodies at all times, 0.5 GB, and how many times as many as the messages
# hold: bodies that have nothing to do with each other's times leave most of it empty.
_MOST_NUMBERS = 1 << 26
_MOST_FILLED = 4
# What is farther from 0 cannot be drawn: its square times a mass would leave the range of numbers.
_FARTHEST = 1e100
_LEAST_TURN = 1e-6      # length of a quaternion that tells an orientation


class Motion(NamedTuple):
    """What moved in a bag: n bodies at t times."""

    names: list[str]
    time: Array                 # (t,) [s], never going back: see `Clock`
    position: Array             # (t, n, 3) [m]; nan where the bag has none
    orientation: Array          # (t, n, 4) x, y, z, w
    linear_velocity: Array      # (t, n, 3) [m/s]
    angular_velocity: Array     # (t, n, 3) [rad/s]
    resets: list[int]           # rows at which the clock had been set back
    starts_at_date: bool        # stamps are dates: the time counts from the first
    scene: Scene | None         # None: a bag without one
    session: Session | None     # None: not recorded by rigid_sim_ros
    wrenches: dict[str, tuple[Array, Array]]    # of contact by body: (k,) [s], (k, 6) [N, N m]
    # Of joints by name: times (k,) [s], and position, velocity and effort (k, 3) [rad or m ...].
    joints: dict[str, tuple[Array, Array]]
    notes: list[str]            # what is not as one may expect
    # With which the session began; `scene` has the bodies that came later too, and its first
    # bodies are the first ones here.
    origin: Scene | None = None


def joint_prefix(topic: str, node: str | None) -> str | None:
    """
    Return what stands before the names of joints on a topic, None for one that is left out.

    Of a session of the node it is their model; /joint_states says there what others say. Of any
    other bag it is what stands before joint_states, so that robots are told apart.
    """
    before, _, last = topic.rpartition('/')
    if last != 'joint_states' or (node is not None and not f'{before}/'.startswith(f'{node}/')):
        return None
    model = before.removeprefix(node or '').strip('/')
    return f'{model}/' if model else ''


class Clock:
    """
    Time that goes on where that of a simulation is set back by a reset.

    It starts with the first stamp; of stamps that are dates it counts from there.
    """

    def __init__(self) -> None:
        self.starts_at_date = False
        self._before: int | None = None
        self._offset = 0

    def seconds(self, t_ns: int) -> tuple[float, bool]:
        """Return the time [s] of the next stamp, and whether the clock was set back."""
        if self._before is None:
            self.starts_at_date = t_ns > _DATE * 1e9
            self._offset = -t_ns if self.starts_at_date else 0
            self._before = t_ns
        is_back = t_ns < self._before
        if is_back:
            self._offset += self._before - t_ns
        self._before = t_ns
        return (t_ns + self._offset) / 1e9, is_back


def read_motion(path: str | os.PathLike[str]) -> Motion:
    """Return the motion in a bag; BagError if it cannot be read or holds none."""
    reader = BagReader(path)
    gathering = _Gathering()
    types: dict[str, str] = {}
    for topic, stamp, data in reader.messages():
        if topic not in types:
            types = reader.types
        take = _TAKE.get(types[topic])
        if take is not None:
            take(gathering, topic, stamp, data)
    motion = gathering.motion(path)
    return motion._replace(notes=[*motion.notes, *(f'{path}: {fault}' for fault in reader.faults)])


class _Gathering:
    """What the messages told so far."""

    def __init__(self) -> None:
        # Each with the stamp in the message and that of the bag [ns].
        self._states: dict[str, list[tuple[int, int, tuple[str, ...], Array]]] = {}
        self._singles: dict[str, list[tuple[int, int, slice, Array]]] = {}
        self._wrenches: dict[str, list[tuple[int, int, Array]]] = {}
        self._joints: dict[str, list[tuple[int, int, list[str], Array]]] = {}
        self._scenes: dict[str, str] = {}
        self._session: Session | None = None
        self._arrivals = Arrivals()

    # --- one message each -----------------------------------------------------------------------

    def state(self, topic: str, stamp: int, data: bytes) -> None:
        t_ns, _, names, numbers = decode.multi_dof_state(data)
        self._states.setdefault(topic, []).append((t_ns, stamp, tuple(names), numbers))

    def text(self, topic: str, stamp: int, data: bytes) -> None:
        if sessions.is_session(topic) and self._session is None:
            self._session = sessions.read(topic, data)
        elif topic.endswith('/scene'):
            self._scenes.setdefault(topic, decode.string(data))
        elif topic.endswith(f'/bag/{kinds.EVENT}'):
            # Whether the events are as they were recorded is for `verify` to say.
            with contextlib.suppress(BagError):
                self._arrivals.take_event(events.decode(decode.string(data)))

    def snapshot(self, topic: str, stamp: int, data: bytes) -> None:
        if topic.endswith(f'/bag/{kinds.SNAPSHOT}'):
            self._arrivals.take_snapshot(data)

    def pose(self, topic: str, stamp: int, data: bytes) -> None:
        message = _message(kinds.TYPES[kinds.POSE], data)
        self._add(topic, 'pose', stamp, message, _POSE, _pose_numbers(message.pose))

    def twist(self, topic: str, stamp: int, data: bytes) -> None:
        message = _message(kinds.TYPES[kinds.TWIST], data)
        self._add(topic, 'twist', stamp, message, _TWIST, _twist_numbers(message.twist))

    def odometry(self, topic: str, stamp: int, data: bytes) -> None:
        message = _message(_ODOMETRY, data)
        pose, twist = message.pose.pose, message.twist.twist
        self._add(topic, 'odom', stamp, message, _POSE, _pose_numbers(pose))
        self._add(topic, 'odom', stamp, message, _TWIST, _turned(pose, twist))

    def wrench(self, topic: str, stamp: int, data: bytes) -> None:
        if topic.endswith('/contact_wrench'):
            t_ns, _, numbers = decode.wrench(data)
            self._wrenches.setdefault(topic, []).append((t_ns, stamp, numbers[0]))

    def joints(self, topic: str, stamp: int, data: bytes) -> None:
        prefix = joint_prefix(topic, self._node)
        if prefix is not None:
            t_ns, _, names, numbers = decode.joint_state(data)
            self._joints.setdefault(topic, []).append(
                (t_ns, stamp, [prefix + name for name in names], numbers))

    @property
    def _node(self) -> str | None:
        return None if self._session is None else self._session.node

    def _add(self, topic: str, suffix: str, stamp: int, message: Any, columns: slice,
             numbers: Array) -> None:
        name = topic.removesuffix(f'/{suffix}').strip('/')
        at = message.header.stamp
        t_ns = at.sec * SECOND + at.nanosec
        self._singles.setdefault(name, []).append((t_ns, stamp, columns, numbers))

    # --- all together ---------------------------------------------------------------------------

    def motion(self, path: str | os.PathLike[str]) -> Motion:
        notes: list[str] = []
        if self._states:
            topic = self._state_topic(notes)
            stamps, names, table = _table_of_states(self._states[topic])
            origin = self._scene(topic, notes)
            scene = None if origin is None else with_arrivals(origin, self._arrivals.parts, notes)
            if scene is not None:
                names, table = _in_order(names, table, scene.names)
        elif self._singles:
            stamps, names, table = _table_of_singles(self._singles)
            origin = scene = None
        else:
            raise BagError(f'{path} holds no motion: no topic is of the type '
                           f'{kinds.TYPES[kinds.STATE]}, {kinds.TYPES[kinds.POSE]}, '
                           f'{kinds.TYPES[kinds.TWIST]} or {_ODOMETRY}')
        if not _can_be_shown(table).all():
            notes.append(f'numbers that are not finite, or beyond {_FARTHEST:g}, are left out')
        _leave_out(table, is_drawn=scene is not None)
        clock = Clock()
        times = [clock.seconds(t_ns) for t_ns in stamps]
        start = stamps[0] if clock.starts_at_date else 0
        return Motion(
            names, np.array([at for at, _ in times]), table[..., :3], table[..., 3:7],
            table[..., 7:10], table[..., 10:], [k for k, (_, back) in enumerate(times) if back],
            clock.starts_at_date, scene, self._session, {
                body_of(topic, names): (
                    np.array([t_ns - start for t_ns in _stamps(rows)]) / 1e9,
                    _leave_out(np.array([row[2] for row in rows])))
                for topic, rows in self._wrenches.items()}, self._joint_series(), notes, origin)

    def _joint_series(self) -> dict[str, tuple[Array, Array]]:
        """Return the series of each joint; a clock that is set back goes on, as for bodies."""
        series: dict[str, tuple[list[float], list[Array]]] = {}
        for rows in self._joints.values():
            clock = Clock()
            for t_ns, (_, _, names, numbers) in zip(_stamps(rows), rows, strict=True):
                at, _ = clock.seconds(t_ns)
                for name, row in zip(names, numbers, strict=True):
                    times, values = series.setdefault(name, ([], []))
                    times.append(at)
                    values.append(row)
        return {name: (np.array(times), _leave_out(np.array(values)))
                for name, (times, values) in series.items()}

    def _state_topic(self, notes: list[str]) -> str:
        topics = list(self._states)
        own = f'{self._session.node}/state' if self._session else topics[0]
        chosen = own if own in topics else topics[0]
        if len(topics) > 1:
            others = ', '.join(topic for topic in topics if topic != chosen)
            notes.append(f'shows {chosen}; the bag has {others} too')
        return chosen

    def _scene(self, state_topic: str, notes: list[str]) -> Scene | None:
        """Return the scene that was published beside the state, None without one."""
        text = self._scenes.get(state_topic.removesuffix('/state') + '/scene')
        if text is None:
            return None
        try:
            return scene_from_text(text, self._session.scene if self._session else 'scene')
        except SceneError as error:
            notes.append(f'the scene in the bag cannot be used: {error.summary}')
            return None


_TAKE = {
    kinds.TYPES[kinds.STATE]: _Gathering.state,
    kinds.TYPES[kinds.SCENE]: _Gathering.text,
    kinds.TYPES[kinds.SNAPSHOT]: _Gathering.snapshot,
    kinds.TYPES[kinds.POSE]: _Gathering.pose,
    kinds.TYPES[kinds.TWIST]: _Gathering.twist,
    kinds.TYPES[kinds.APPLIED_WRENCH]: _Gathering.wrench,
    kinds.TYPES[kinds.JOINT_STATES]: _Gathering.joints,
    _ODOMETRY: _Gathering.odometry,
}


def _stamps(rows: Sequence[tuple[Any, ...]]) -> list[int]:
    """Return the stamps of the messages [ns], those of the bag where the messages have none."""
    return [row[0] for row in rows] if any(row[0] for row in rows) else [row[1] for row in rows]


def _in_order(names: list[str], table: Array, first: Sequence[str]) -> tuple[list[str], Array]:
    """Return names and numbers (t, n, 13) with some bodies before all others."""
    ordered = list(dict.fromkeys([*first, *names]))
    if ordered == names:
        return names, table
    moved = _empty_table(len(table), len(ordered), table.size)
    moved[:, [ordered.index(name) for name in names]] = table
    return ordered, moved


def _table_of_states(
    rows: Sequence[tuple[int, int, tuple[str, ...], Array]],
) -> tuple[list[int], list[str], Array]:
    """Return stamps, names and numbers (t, n, 13) of messages with several bodies each."""
    names = list(dict.fromkeys(name for row in rows for name in row[2]))
    if all(row[2] == rows[0][2] for row in rows):
        return _stamps(rows), names, np.stack([row[3] for row in rows])
    index = {name: k for k, name in enumerate(names)}
    table = _empty_table(len(rows), len(names), sum(row[3].size for row in rows))
    for k, (_, _, present, numbers) in enumerate(rows):
        table[k, [index[name] for name in present]] = numbers
    return _stamps(rows), names, table


def _table_of_singles(
    rows: dict[str, list[tuple[int, int, slice, Array]]],
) -> tuple[list[int], list[str], Array]:
    """Return stamps, names and numbers (t, n, 13) of messages with one body each."""
    names = sorted(rows)
    of_body = {name: _stamps(rows[name]) for name in names}
    stamps = sorted({t_ns for name in names for t_ns in of_body[name]})
    index = {t_ns: k for k, t_ns in enumerate(stamps)}
    table = _empty_table(len(stamps), len(names), _WIDTH * sum(map(len, rows.values())))
    for column, name in enumerate(names):
        for t_ns, (_, _, columns, numbers) in zip(of_body[name], rows[name], strict=True):
            table[index[t_ns], column, columns] = numbers
    return stamps, names, table


def _can_be_shown(numbers: Array) -> npt.NDArray[np.bool_]:
    """Return which numbers can be drawn; nan is none that somebody wrote."""
    can: npt.NDArray[np.bool_] = np.isnan(numbers) | (np.abs(numbers) <= _FARTHEST)
    return can


def _leave_out(numbers: Array, *, is_drawn: bool = False) -> Array:
    """
    Write nan for what cannot be shown, and return the array.

    In a table of bodies that are drawn a pose is there as a whole or not at all.
    """
    numbers[~_can_be_shown(numbers)] = np.nan
    if is_drawn:
        turn = np.linalg.norm(numbers[..., 3:7], axis=-1)
        there = np.isfinite(numbers[..., _POSE]).all(axis=-1) & (turn > _LEAST_TURN)
        numbers[~there, _POSE] = np.nan
    return numbers


def _empty_table(times: int, bodies: int, given: int) -> Array:
    """Return nan (t, n, 13); BagError where that is far more than the numbers that are given."""
    if times * bodies * _WIDTH > max(_MOST_NUMBERS, _MOST_FILLED * given):
        raise BagError(f'{bodies} bodies at {times} times, of which each has a few, are more than '
                       'can be shown together: cut the bag into pieces, as with `mcap filter`')
    return np.full((times, bodies, _WIDTH), np.nan)


def _message(kind: str, data: bytes) -> Any:
    try:
        return kinds.typestore().deserialize_cdr(data, kind)
    except Exception as error:      # bytes that were changed can break anything that reads them
        raise BagError(f'a message of the type {kind} is damaged ({error})') from None


def _pose_numbers(pose: Any) -> Array:
    p, q = pose.position, pose.orientation
    return np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])


def _twist_numbers(twist: Any) -> Array:
    v, w = twist.linear, twist.angular
    return np.array([v.x, v.y, v.z, w.x, w.y, w.z])


def _turned(pose: Any, twist: Any) -> Array:
    """Return a twist whose axes are the body's, as Odometry has it, in the axes of the pose."""
    from scipy.spatial.transform import Rotation

    q = _pose_numbers(pose)[3:]
    vectors = _leave_out(_twist_numbers(twist).reshape(2, 3))
    if not q.any():
        return vectors.ravel()
    if not _LEAST_TURN < np.abs(q).max() < _FARTHEST:
        return np.full(6, np.nan)
    return np.asarray(Rotation.from_quat(q).apply(vectors)).ravel()
