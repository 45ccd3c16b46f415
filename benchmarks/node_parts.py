# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The node `simulate` with clocks in it, for node_speed.py.

    python benchmarks/node_parts.py REPORT SECONDS bytes|objects SCENE [--ros-args ...]

Runs the node as a user does, and from `SETTLED` s after the first step on, for SECONDS of wall
time, keeps what its parts take of the processor and how late each step began; REPORT is a JSON
file with that. With `objects` poses, twists and states are built as message objects and published
by `Publisher.publish`, as most nodes in Python do; what is recorded is serialised once more, as
users of rosbag2_py do.

    python benchmarks/node_parts.py REPORT SECONDS sleep

does nothing but wake up every millisecond, and reports how late.
"""

from collections.abc import Callable, Sequence
import json
from pathlib import Path
import sys
import threading
import time
from typing import Any

SETTLED = 4.0   # s
STEP_NS = 1_000_000


class Clocks:
    """Times of the processor by part, and the lateness of steps, from a first to a last moment."""

    def __init__(self, seconds: float) -> None:
        self.parts: dict[str, int] = {}
        self.late: list[tuple[int, int, int]] = []  # count, of the first [ns], a tick [ns]
        self.work: list[int] = []       # time of the processor from each step to the next [ns]
        self._inner = 0         # what parts inside of the present one took
        self._seconds = seconds
        self._origin = self._before = 0
        self._first: dict[str, Any] = {}
        self._last: dict[str, Any] = {}

    def wrap(self, owner: type, names: Sequence[str], part: str) -> None:
        """Count what these methods take, less the parts inside of them, as one part."""
        self.parts[part] = 0
        for name in names:
            setattr(owner, name, self._timed(getattr(owner, name), part))

    def _timed(self, function: Callable[..., Any], part: str) -> Callable[..., Any]:
        def timed(*args: Any, **keys: Any) -> Any:
            start, outer, self._inner = time.thread_time_ns(), self._inner, 0
            result = function(*args, **keys)
            taken = time.thread_time_ns() - start
            self.parts[part] += taken - self._inner
            self._inner = outer + taken
            return result
        return timed

    def watch(self, pacer: type) -> None:
        """Note how late each call of `Pacer.start` is; it is called before each step."""
        start = pacer.start     # type: ignore[attr-defined]

        def watched(this: Any, count: int, now_ns: int) -> Any:
            lateness = start(this, count, now_ns)
            self._origin = self._origin or now_ns
            since = (now_ns - self._origin) / 1e9 - SETTLED
            if 0.0 <= since < self._seconds:
                if not self._first:
                    self._first = self._moment(this, now_ns)
                self.late.append((count, lateness.late_ns, this.tick_ns))
                cpu_ns = time.thread_time_ns()
                self.work.append(cpu_ns - (self._before or cpu_ns))
                self._before = cpu_ns
            elif since >= self._seconds and not self._last:
                self._last = self._moment(this, now_ns)
            return lateness
        pacer.start = watched   # type: ignore[attr-defined]

    def _moment(self, pacer: Any, now_ns: int) -> dict[str, Any]:
        threads = {thread.name: time.clock_gettime_ns(time.pthread_getcpuclockid(thread.ident))
                   for thread in threading.enumerate() if thread.ident is not None}
        return {'wall': now_ns, 'process': time.process_time_ns(), 'threads': threads,
                'parts': dict(self.parts), 'steps': pacer.steps, 'overruns': pacer.overruns}

    def report(self) -> dict[str, Any]:
        """Return what happened in between."""
        first, last = self._first, self._last
        if not last:
            raise RuntimeError(f'the node ended before {SETTLED + self._seconds} s were over')
        wall = last['wall'] - first['wall']
        late = sorted(ns - k * tick for count, ns, tick in self.late for k in range(count))

        def share(kind: str) -> dict[str, float]:
            return {name: (ns - first[kind].get(name, 0)) / wall
                    for name, ns in last[kind].items()}

        return {'parts': share('parts'), 'threads': share('threads'),
                'process': (last['process'] - first['process']) / wall,
                'rate': (last['steps'] - first['steps']) * STEP_NS / wall,
                'overruns': last['overruns'] - first['overruns'],
                'late': quantiles(late), 'work': quantiles(sorted(self.work))}


def quantiles(ranked: Sequence[float]) -> list[float]:
    """Return median, 99 % and largest of sorted numbers."""
    return [ranked[len(ranked) // 2], ranked[len(ranked) * 99 // 100], ranked[-1]]


def sleep(seconds: float) -> list[int]:
    """Return how late a loop that only sleeps until each millisecond wakes up [ns], sorted."""
    late_ns = []
    begun = time.monotonic_ns()
    for k in range(1, round(1000 * seconds) + 1):
        time.sleep(max(0, begun + k * STEP_NS - time.monotonic_ns()) / 1e9)
        late_ns.append(time.monotonic_ns() - begun - k * STEP_NS)
    return sorted(late_ns)


def publish_objects(publishers: Any, world: Any) -> None:
    """Publish the state as message objects, in the place of `Publishers.publish_state`."""
    from builtin_interfaces.msg import Time
    from geometry_msgs.msg import (
        PoseStamped, Quaternion, Transform, Twist, TwistStamped, Vector3)
    from sensor_msgs.msg import MultiDOFJointState
    from std_msgs.msg import Header
    header = Header(frame_id='world', stamp=Time(sec=world.time_ns // 10 ** 9,
                                                 nanosec=world.time_ns % 10 ** 9))
    p, q = world.position.tolist(), world.orientation.tolist()
    v, w = world.linear_velocity.tolist(), world.angular_velocity.tolist()
    poses, twists = [], []
    for k in publishers._bodies.tolist():
        pose = PoseStamped(header=header)
        at, turned = pose.pose.position, pose.pose.orientation
        at.x, at.y, at.z = p[k]
        turned.x, turned.y, turned.z, turned.w = q[k]
        poses.append(pose)
        twist = TwistStamped(header=header)
        linear, angular = twist.twist.linear, twist.twist.angular
        linear.x, linear.y, linear.z = v[k]
        angular.x, angular.y, angular.z = w[k]
        twists.append(twist)
    state = MultiDOFJointState(header=header, joint_names=world.names)
    for k in range(len(world.names)):
        state.transforms.append(Transform(
            translation=Vector3(x=p[k][0], y=p[k][1], z=p[k][2]),
            rotation=Quaternion(x=q[k][0], y=q[k][1], z=q[k][2], w=q[k][3])))
        state.twist.append(Twist(linear=Vector3(x=v[k][0], y=v[k][1], z=v[k][2]),
                                 angular=Vector3(x=w[k][0], y=w[k][1], z=w[k][2])))
    for outlet, messages in ((publishers._pose, poses), (publishers._twist, twists),
                             (publishers._state, [state])):
        send_objects(publishers, outlet, messages)


def send_objects(publishers: Any, outlet: Any, messages: list[Any]) -> None:
    """Publish message objects, and record them."""
    from rclpy.serialization import serialize_message
    if not hasattr(outlet, 'publishers'):
        known = {id(publisher.handle): publisher for publisher in publishers._all}
        outlet.publishers = [known[id(handle)] for handle in outlet.handles]
    for publisher, message in zip(outlet.publishers, messages, strict=True):
        publisher.publish(message)
    if publishers._recorder is not None and outlet.channels:
        record_objects(publishers, outlet.channels, messages, serialize_message)


def record_objects(publishers: Any, channels: list[int], messages: list[Any],
                   serialize: Callable[[Any], bytes]) -> None:
    """Hand message objects to the recording."""
    publishers._recorder.publish(publishers._world.step_index, channels,
                                 [serialize(message) for message in messages])


def main() -> int:
    """Run the node, or the loop that sleeps, and report."""
    report, seconds, variant = Path(sys.argv[1]), float(sys.argv[2]), sys.argv[3]
    if variant == 'sleep':
        report.write_text(json.dumps(quantiles(sleep(seconds))))
        return 0
    from rigid_sim_ros.bag.recorder import Recorder
    from rigid_sim_ros.nodes import simulate
    from rigid_sim_ros.nodes.pacing import Pacer
    from rigid_sim_ros.nodes.publishers import Publishers
    from rigid_sim_ros.world import World
    if variant == 'objects':
        Publishers.publish_state = publish_objects  # type: ignore[method-assign]
    clocks = Clocks(seconds)
    clocks.wrap(World, ['step'], 'stepping')
    clocks.wrap(Publishers, ['publish_state', 'publish_clock', 'publish_markers', 'publish_hash',
                             'publish_applied_wrench', 'publish_diagnostics', 'send_waiting'],
                'publishing')
    clocks.wrap(Recorder, ['publish', 'event', 'snapshot'], 'recording')
    if variant == 'objects':
        clocks.wrap(sys.modules[__name__], ['record_objects'],  # type: ignore[arg-type]
                    'recording')
    clocks.watch(Pacer)
    code = simulate.main(sys.argv[4:])
    report.write_text(json.dumps(clocks.report()))
    return code


if __name__ == '__main__':
    sys.exit(main())
