# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether the node holds real time, and what that costs: stepping, publishing and recording at once.

    python benchmarks/node_speed.py                         # 1 to 1000 bodies, 60 s each
    python benchmarks/node_speed.py --bodies 100 --seconds 20 --output docs/performance.md

The node runs as its own process, as a user runs it: free bodies, steps of 1 ms, pose, twist and
state at 100 Hz, markers, clock and diagnostics as by default, and it records all of it. Each size
runs twice, as the node is and with message objects (node_parts.py); the largest once more with
~/state alone. Meanwhile this process sends wrenches at random times and waits for the twist that
shows them, and another one does nothing but wake up every millisecond: what this machine does to a
loop that has nothing to do is not the node's. The work between two steps is what the step thread
takes of the processor from one to the next: so late may a step be by the node's own doing.
"""
import argparse
import json
import os
from pathlib import Path
import random
import signal
from statistics import median
import struct
import subprocess
import sys
import tempfile
import time
from typing import Any, NamedTuple

from geometry_msgs.msg import PoseStamped, TwistStamped, Wrench, WrenchStamped
from node_parts import quantiles, SETTLED, sleep
from page import heading, line, machine, write
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from sensor_msgs.msg import MultiDOFJointState

DOMAIN = 87
HERE = Path(__file__).resolve().parent
PUSH = 1.0          # N s per kg: 1 mm/s in a step of 1 ms
PATIENCE = 1.0      # s after which a wrench counts as lost
STARTING = 120.0    # s for a node to compile and to make its topics
ALONE = ('bodies:=[nobody]', 'publish_markers:=false')


def write_scene(folder: Path, count: int) -> Path:
    """Write a scene of free bodies."""
    bodies = '\n'.join(
        f'  - {{name: body_{k}, shape: {{type: box, size: [0.1, 0.2, 0.3]}}, mass: 1.0, '
        f'pose: {{position: [{k}, 0, 0]}}, twist: {{angular: [0.01, 5, 0.01]}}}}'
        for k in range(count))
    path = folder / 'free_bodies.yaml'
    path.write_text(f'format: 1\nworld: {{step: 0.001, gravity: [0, 0, 0]}}\nbodies:\n{bodies}\n',
                    encoding='utf-8')
    return path


def empty_loop(seconds: int) -> list[int]:
    """Return how late a loop that only sleeps until each millisecond wakes up [ns], sorted."""
    return sleep(seconds)


class Run(NamedTuple):
    """A node that is measured."""

    bodies: int
    way: str            # bytes | objects
    alone: bool         # ~/state alone
    report: dict[str, Any]
    idle: list[float]   # lateness of the loop that sleeps [ns]: median, 99 %, worst
    latency: list[float]    # from a wrench to the twist that shows it [ns], sorted
    lost: int

    @property
    def name(self) -> str:
        """What it is called in a table."""
        way = 'message objects' if self.way == 'objects' else 'the node'
        return f'{self.bodies}, ~/state alone' if self.alone else f'{self.bodies}, {way}'


class Pusher:
    """Sends a wrench now and then, and waits for the twist that shows it."""

    def __init__(self, alone: bool, bodies: int) -> None:
        self.node = Node('node_speed')
        self.latency: list[float] = []
        self.lost = self.heard = 0
        self._speed = 0.0
        self._sent_ns = self._next_ns = 0
        self._force = PUSH
        self._alone = alone
        # To make message objects of a thousand bodies takes longer than the period of a message.
        # The twists are the last numbers of both, of a state before an empty list of wrenches.
        self._place = -4 - 48 * bodies + 8 if alone else -48 + 8
        if alone:
            self._publisher = self.node.create_publisher(
                MultiDOFJointState, '/rigid_sim/wrenches', 10)
            self.node.create_subscription(MultiDOFJointState, '/rigid_sim/state',
                                          self._hear, 10, raw=True)
        else:
            self._publisher = self.node.create_publisher(
                WrenchStamped, '/rigid_sim/body_0/wrench', 10)
            self.node.create_subscription(TwistStamped, '/rigid_sim/body_0/twist',
                                          self._hear, 10, raw=True)
        self._executor = EventsExecutor()
        self._executor.add_node(self.node)

    def spin(self, until: float) -> None:
        """Listen, and push if it is time to."""
        while time.monotonic() < until:
            now_ns = time.monotonic_ns()
            if self._sent_ns and now_ns - self._sent_ns > PATIENCE * 1e9:
                self.lost, self._sent_ns = self.lost + 1, 0
            if not self._sent_ns and self.heard > 10 and now_ns >= self._next_ns:
                self._push()
            wait_ns = self._next_ns - time.monotonic_ns()
            self._executor.spin_once(
                timeout_sec=min(max(wait_ns / 1e9, 0.0) if not self._sent_ns else 0.05, 0.05))

    def _push(self) -> None:
        self._force = -self._force
        wrench = Wrench()
        wrench.force.y = self._force
        message: Any = WrenchStamped(wrench=wrench)
        if self._alone:
            message = MultiDOFJointState(joint_names=['body_0'], wrench=[wrench])
        self._sent_ns = time.monotonic_ns()
        self._publisher.publish(message)

    def _hear(self, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        speed: float = struct.unpack_from('<d', data, len(data) + self._place)[0]
        # A wrench holds for one step of 1 ms.
        if self._sent_ns and abs(speed - self._speed) > 0.5e-3 * PUSH:
            self.latency.append(now_ns - self._sent_ns)
            self._sent_ns = 0
            self._next_ns = now_ns + random.randrange(50_000_000, 150_000_000)
        self._speed = speed
        self.heard += 1

    def close(self) -> None:
        """Leave the topics."""
        self._executor.shutdown()
        self.node.destroy_node()


def stop(process: 'subprocess.Popen[bytes]') -> None:
    """End the node as Ctrl-C does."""
    process.send_signal(signal.SIGINT)
    process.wait(60.0)


def run(folder: Path, bodies: int, way: str, alone: bool, seconds: float) -> Run:
    """Run a node and measure it."""
    print(f'  {bodies} bodies, {way}{", ~/state alone" if alone else ""}', file=sys.stderr,
          flush=True)
    scene, report = write_scene(folder, bodies), folder / f'{bodies}_{way}_{alone}.json'
    options = ['wrench_timeout:=0.0', 'publish_rate:=100.0', 'record:=true',
               f'bag_path:={folder}/{bodies}_{way}_{alone}', *(ALONE if alone else ())]
    words = [word for option in options for word in ('-p', option)]
    pusher = Pusher(alone, bodies)
    parts = [sys.executable, str(HERE / 'node_parts.py')]
    process = subprocess.Popen([*parts, str(report), str(seconds), way, str(scene), '--ros-args',
                                '--log-level', 'error', *words])
    end = time.monotonic() + STARTING
    while not pusher.heard and process.poll() is None and time.monotonic() < end:
        pusher.spin(time.monotonic() + 0.1)
    pusher.spin(time.monotonic() + SETTLED)
    pusher.latency.clear()
    idle = subprocess.Popen([*parts, str(folder / 'idle.json'), str(seconds), 'sleep'])
    pusher.spin(time.monotonic() + seconds)
    idle.wait()
    pusher.spin(time.monotonic() + 1.0)
    stop(process)
    pusher.close()
    return Run(bodies, way, alone, json.loads(report.read_text()),
               json.loads((folder / 'idle.json').read_text()), sorted(pusher.latency), pusher.lost)


def start_time(scene: Path) -> float:
    """Return the wall time from starting the process to its first pose [s]."""
    node, received = Node('node_speed'), []
    node.create_subscription(PoseStamped, '/rigid_sim/body_0/pose', received.append, 10)
    executor = EventsExecutor()
    executor.add_node(node)
    begun = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, '-m', 'rigid_sim_ros.programs', 'simulate', str(scene)])
    while not received and process.poll() is None:
        executor.spin_once(timeout_sec=0.1)
    taken = time.monotonic() - begun
    stop(process)
    executor.shutdown()
    node.destroy_node()
    return taken


def shares_table(runs: list[Run]) -> str:
    """Return what each part takes of the processor."""
    lines = heading(['bodies, share of a core [%]', 'stepping', 'encoding and publishing',
                     'recording', 'the rest of the loop', 'callbacks',
                     'middleware and the rest', 'all'])
    for one in runs:
        parts, threads = one.report['parts'], one.report['threads']
        # The recording has a part in the step thread and threads of its own.
        in_loop = threads['step'] - sum(parts.values())
        written = sum(share for name, share in threads.items() if name.startswith('bag '))
        row = [parts['stepping'], parts['publishing'], parts['recording'] + written, in_loop,
               threads['spin']]
        whole = one.report['process']
        lines.append(line([one.name, *(f'{100 * share:.1f}' for share in (
            *row, whole - sum(row), whole))]))
    return '\n'.join(lines)


def pace_table(runs: list[Run]) -> str:
    """
    Return how well the nodes keep their pace, and what a loop does that only sleeps.

    The last columns are the time from a wrench to the twist that shows it.
    """
    lines = heading(['bodies', 'real-time factor', 'overruns', 'late: median [us]', '99 % [us]',
                     'worst [ms]', 'a loop that sleeps: 99 % [us]', 'worst [ms]',
                     'work between steps: 99 % [us]', 'worst [ms]',
                     'wrench to twist: median [ms]', '99 % [ms]', 'worst [ms]', 'wrenches',
                     'lost'])
    for one in runs:
        late, idle, work = one.report['late'], one.idle, one.report['work']
        latency = quantiles(one.latency) if one.latency else [float('nan')] * 3
        lines.append(line([
            one.name, f'{one.report["rate"]:.4f}', one.report['overruns'], f'{late[0] / 1e3:.0f}',
            f'{late[1] / 1e3:.0f}', f'{late[2] / 1e6:.2f}', f'{idle[1] / 1e3:.0f}',
            f'{idle[2] / 1e6:.2f}', f'{work[1] / 1e3:.0f}', f'{work[2] / 1e6:.2f}',
            *(f'{ns / 1e6:.1f}' for ns in latency), len(one.latency), one.lost]))
    return '\n'.join(lines)


WANTED = ('Wanted of the node with 100 bodies: 99 % of the steps late by less than 1 ms, none by '
          '10 ms, half of the wrenches seen within 11 ms; of 1000 bodies on ~/state alone a '
          'real-time factor of 1. A step is an overrun when it begins more than 1 ms late.')


def main() -> int:
    """Measure, print and write down."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--bodies', type=int, nargs='+', default=[1, 10, 100, 1000])
    parser.add_argument('--seconds', type=int, default=60)
    parser.add_argument('--starts', type=int, default=5, help='at least 1')
    parser.add_argument('--ways', nargs='+', default=['bytes', 'objects'],
                        choices=['bytes', 'objects'])
    parser.add_argument('--output', type=Path, help='a Markdown file to write, besides')
    options = parser.parse_args()
    os.environ |= {'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    rclpy.init()
    pages = [machine()]
    print(pages[0], flush=True)
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        scene = write_scene(Path(folder), 100)
        start_time(scene)       # fills the cache of compiled kernels
        starts = [start_time(scene) for _ in range(options.starts)]
        for bodies in options.bodies:
            runs += [run(Path(folder), bodies, way, False, options.seconds)
                     for way in options.ways]
        most = max(options.bodies)
        runs.append(run(Path(folder), most, 'bytes', True, options.seconds))
    rclpy.try_shutdown()
    pages += [f'{options.seconds} s each. {WANTED}', shares_table(runs), pace_table(runs),
              f'From starting the process of a node with 100 bodies to its first pose: '
              f'{median(starts):.2f} s ({min(starts):.2f} to {max(starts):.2f}, {len(starts)} '
              'starts).']
    print('', *pages[1:], sep='\n\n')
    if options.output:
        write(options.output, pages, 'node')
    return 0


if __name__ == '__main__':
    sys.exit(main())
