# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What other nodes ask for: checked where it arrives, queued, and applied between two steps.

A callback runs in the executor's thread while the step thread may be in the middle of a step, so
it only checks the message and puts an input into the queue. The step thread takes the inputs out
in the order of their arrival.
"""
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
import math
import threading
import time
from typing import Any, NamedTuple

from rigid_sim_ros.problems import printable
from rigid_sim_ros.scene.values import UNIT_TOLERANCE
from rigid_sim_ros.world.commands import Command, FRAME_ID

_LOG_PERIOD = 5.0   # s of wall time between two log lines for the same reason

# How the sources of wrenches from ~/wrenches begin.
_WRENCHES = 'wrenches['

# The answer to a service call that comes too late.
ENDED = False, 'the simulation has ended'

Vector = tuple[float, float, float]


class Wrenches(NamedTuple):
    """Wrenches on several bodies that act from the same step and replace the ones before."""

    commands: tuple[Command, ...]


class JointInput(NamedTuple):
    """What one message tells joints: all of it acts from the same step."""

    topic: str
    commands: tuple[Command, ...]


class ParameterInput(NamedTuple):
    """A parameter that was set while the node runs."""

    name: str
    value: Any


class Request(NamedTuple):
    """A service call: the step thread sets the answer, a pair of success and text."""

    name: str           # pause, resume, step, reset, start_recording, stop_recording
    answer: 'Future[tuple[bool, str]]'


Input = Command | JointInput | ParameterInput | Request | Wrenches


class Refusals:
    """Counts what was refused, by reason, and logs each reason once in a while."""

    def __init__(self, log: Callable[[str], object]) -> None:
        self._counts: Counter[str] = Counter()
        self._log = log
        self._logged: dict[str, tuple[float, int]] = {}     # reason: when, and the count then
        self._lock = threading.Lock()                       # both threads refuse

    def counts(self) -> dict[str, int]:
        """Return how many were refused so far, by reason."""
        with self._lock:
            return dict(self._counts)

    def refuse(self, reason: str, text: str) -> None:
        """Count a refusal, and log it unless one for the same reason was logged just now."""
        with self._lock:
            self._counts[reason] += 1
            count, now = self._counts[reason], time.monotonic()
            when, counted = self._logged.get(reason, (-math.inf, 0))
            if now - when < _LOG_PERIOD:
                return
            self._logged[reason] = now, count
        more = count - counted - 1
        self._log(printable(f'refused {text}') + (f' (and {more} like it before)' if more else ''))


class Queue:
    """Inputs on their way to the step thread."""

    def __init__(self) -> None:
        self._inputs: deque[Input] = deque()
        self._arrived = threading.Event()
        self._lock = threading.Lock()
        self._closed = False

    def put(self, item: Input) -> bool:
        """Hand an input over and wake the step thread; return whether there still is one."""
        with self._lock:
            if self._closed:
                return False
            self._inputs.append(item)
        self._arrived.set()
        return True

    def take(self) -> Iterator[Input]:
        """Take out what has arrived so far."""
        if self._arrived.is_set():
            self._arrived.clear()   # before the look: what arrives after it sets the event again
            while self._inputs:
                yield self._inputs.popleft()

    def close(self) -> list[Input]:
        """Take nothing more; return what nobody will take out."""
        with self._lock:
            self._closed = True
        return list(self._inputs)

    def wait(self, seconds: float) -> None:
        """Sleep until something arrives, at most this long."""
        self._arrived.wait(seconds)

    def wake(self) -> None:
        """Wake the step thread with nothing to hand over."""
        self._arrived.set()


class Receiver:
    """Checks ROS messages and queues them as inputs; what is wrong is refused."""

    def __init__(
        self, queue: Queue, refusals: Refusals, bodies: Sequence[str], frames: Iterable[str],
        frame_id: str,
    ) -> None:
        self._put = queue.put
        self._refuse = refusals.refuse
        self._bodies = frozenset(bodies)
        self._world: Mapping[str, str] = dict.fromkeys(('', 'world', frame_id), 'world')
        self._frames: Mapping[str, str] = {**{name: name for name in frames}, **self._world}

    def wrench(self, body: str, message: Any) -> None:
        """Take a geometry_msgs/WrenchStamped for a body."""
        frame_id = message.header.frame_id
        topic = f'{body}/wrench'
        if self._is_known(frame_id, self._frames, topic):
            wrench = self._wrench(topic, body, frame_id, message.wrench, topic)
            if wrench is not None:
                self._put(wrench)

    def wrenches(self, message: Any) -> None:
        """Take a sensor_msgs/MultiDOFJointState with wrenches; all of them count, or none."""
        names, frame_id, topic = message.joint_names, message.header.frame_id, 'wrenches'
        if len(names) != len(message.wrench):
            self._refuse('length', f'{topic}: {len(names)} joint_names and {len(message.wrench)} '
                         'wrenches, must be as many')
            return
        if not self._is_known(frame_id, self._frames, topic):
            return
        wrenches = []
        for k, (body, ros_wrench) in enumerate(zip(names, message.wrench, strict=True)):
            if body not in self._bodies:
                self._refuse('unknown body', f'{topic}: there is no body {body!r}')
                return
            # A source of its own for each entry: two entries for one body add up.
            wrench = self._wrench(f'{_WRENCHES}{k}]', body, frame_id, ros_wrench, topic)
            if wrench is None:
                return
            wrenches.append(wrench)
        self._put(Wrenches(tuple(wrenches)))

    def set_pose(self, body: str, message: Any) -> None:
        """Take a geometry_msgs/PoseStamped that moves a body."""
        topic = f'{body}/set_pose'
        position = _vector(message.pose.position)
        q = message.pose.orientation
        orientation = (q.x, q.y, q.z, q.w)
        if not self._is_known(message.header.frame_id, self._world, topic):
            return
        if not self._is_finite((*position, *orientation), topic):
            return
        norm = math.hypot(*orientation)
        if abs(norm - 1.0) > UNIT_TOLERANCE:
            self._refuse('quaternion', f'{topic}: orientation {list(orientation)} has length '
                         f'{norm:.6g}, must be 1: x, y, z, w with w last')
            return
        self._put(Command('set_pose', {'name': body, 'position': position,
                                       'orientation': orientation}))

    def set_twist(self, body: str, message: Any) -> None:
        """Take a geometry_msgs/TwistStamped that sets a body's velocity."""
        topic = f'{body}/set_twist'
        linear, angular = _vector(message.twist.linear), _vector(message.twist.angular)
        if (self._is_known(message.header.frame_id, self._world, topic)
                and self._is_finite((*linear, *angular), topic)):
            self._put(Command('set_twist', {'name': body, 'linear': linear,
                                            'angular': angular}))

    def _wrench(
        self, source: str, body: str, frame_id: str, message: Any, topic: str,
    ) -> Command | None:
        force, torque = _vector(message.force), _vector(message.torque)
        if not self._is_finite((*force, *torque), topic):
            return None
        return Command('apply_wrench', {
            'name': body, 'force': force, 'torque': torque, 'frame': self._frames[frame_id],
            'source': source, FRAME_ID: frame_id})

    def _is_known(self, frame_id: str, known: Mapping[str, str], topic: str) -> bool:
        if frame_id in known:
            return True
        legal = 'must be empty or the world frame' if known is self._world else (
            'must be empty, the world frame, BODY or BODY/FRAME')
        self._refuse('unknown frame', f'{topic}: frame_id {frame_id!r}, {legal}')
        return False

    def _is_finite(self, values: tuple[float, ...], topic: str) -> bool:
        if all(map(math.isfinite, values)):
            return True
        self._refuse('not finite', f'{topic}: {list(values)}, must be finite numbers')
        return False


def is_of_wrenches(source: str) -> bool:
    """Return whether a wrench came in a message on ~/wrenches."""
    return source.startswith(_WRENCHES)


def _vector(message: Any) -> Vector:
    return message.x, message.y, message.z
