# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measure whether the node holds real time, and what that costs.

    python benchmarks/node_speed.py                  # 100 bodies, 1 kHz steps, 100 Hz publishing
    python benchmarks/node_speed.py --bodies 1000 --seconds 30 --subscribe

The node runs as its own process, as a user runs it; the figures are those that it publishes on
/diagnostics every second, the first second left out. With --subscribe this process listens to
every pose and twist as well, which costs the node a copy of each message into another process.
"""
import argparse
from collections.abc import Sequence
import os
from pathlib import Path
import platform
import signal
from statistics import median
import subprocess
import sys
import tempfile
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from sensor_msgs.msg import MultiDOFJointState

DOMAIN = 87
TARGETS = {
    'real-time factor': '1.000 +- 0.001',
    'overruns': '0',
    'step thread CPU share [%]': '< 20',
    'cost per message [us]': '<= 3',
    'start to first pose [s]': '<= 2',
}


def write_scene(folder: Path, count: int) -> Path:
    """Write a scene of free bodies under gravity."""
    bodies = '\n'.join(
        f'  - {{name: body_{k}, shape: {{type: box, size: [0.1, 0.2, 0.3]}}, mass: 1.0, '
        f'pose: {{position: [{k}, 0, 0]}}, twist: {{angular: [0.01, 5, 0.01]}}}}'
        for k in range(count))
    path = folder / 'free_bodies.yaml'
    path.write_text(f'format: 1\nworld: {{step: 0.001}}\nbodies:\n{bodies}\n', encoding='utf-8')
    return path


def start(scene: Path) -> 'subprocess.Popen[bytes]':
    """Start the node in a process of its own."""
    return subprocess.Popen([
        sys.executable, '-m', 'rigid_sim_ros.nodes.simulate', str(scene), '--ros-args', '-p',
        'publish_rate:=100.0'])


def start_time(scene: Path) -> float:
    """Return the wall time from starting the process to its first pose [s]."""
    node, received = Node('node_speed'), []
    node.create_subscription(PoseStamped, '/rigid_sim/body_0/pose', received.append, 10)
    executor = EventsExecutor()
    executor.add_node(node)
    begun = time.monotonic()
    process = start(scene)
    while not received and process.poll() is None:
        executor.spin_once(timeout_sec=0.1)
    taken = time.monotonic() - begun
    stop(process)
    node.destroy_node()
    return taken


def measure(scene: Path, count: int, seconds: int, subscribe: bool) -> list[dict[str, str]]:
    """Return the values of the status `pace`, one dict for each second after the first."""
    node, windows = Node('node_speed'), []

    def keep(message: DiagnosticArray) -> None:
        windows.extend({v.key: v.value for v in status.values}
                       for status in message.status if status.name.endswith(': pace'))

    node.create_subscription(DiagnosticArray, '/diagnostics', keep, 10)
    if subscribe:
        listen(node, count)
    executor = EventsExecutor()
    executor.add_node(node)
    process = start(scene)
    while len(windows) < seconds + 1 and process.poll() is None:
        executor.spin_once(timeout_sec=0.1)
    stop(process)
    node.destroy_node()
    return windows


def listen(node: Node, count: int) -> None:
    """Subscribe to the topics of all bodies."""
    def drop(message: Any) -> None:
        pass

    node.create_subscription(MultiDOFJointState, '/rigid_sim/state', drop, 10, raw=True)
    for k in range(count):
        for message, topic in ((PoseStamped, 'pose'), (TwistStamped, 'twist')):
            node.create_subscription(message, f'/rigid_sim/body_{k}/{topic}', drop, 10, raw=True)


def empty_loop(seconds: int) -> list[int]:
    """Return how late a loop that only sleeps until each millisecond wakes up [ns]."""
    step_ns, late_ns = 1_000_000, []
    begun = time.monotonic_ns()
    for k in range(1, 1000 * seconds + 1):
        time.sleep(max(0, begun + k * step_ns - time.monotonic_ns()) / 1e9)
        late_ns.append(time.monotonic_ns() - begun - k * step_ns)
    return sorted(late_ns)


def stop(process: 'subprocess.Popen[bytes]') -> None:
    """End the node as Ctrl-C does."""
    process.send_signal(signal.SIGINT)
    process.wait(20.0)


def report(windows: Sequence[dict[str, str]], start_times: Sequence[float]) -> None:
    """Print the figures beside the targets."""
    first, rest = windows[0], windows[1:]
    print(f'{"":34}{"median":>12}{"least":>12}{"most":>12}   target')
    for key in rest[0]:
        try:
            values = [float(window[key]) for window in rest]
        except ValueError:
            continue
        if key == 'overruns':
            late = int(rest[-1][key]) - int(first[key])
            print(f'{"overruns after the first second":34}{late:12}{"":24}   {TARGETS[key]}')
        elif key not in ('simulation time [s]', 'step [s]', 'overruns lately'):
            print(f'{key:34}{median(values):12.4g}{min(values):12.4g}{max(values):12.4g}   '
                  f'{TARGETS.get(key, "")}')
    key = 'start to first pose [s]'
    print(f'{key:34}{median(start_times):12.3f}{min(start_times):12.3f}{max(start_times):12.3f}'
          f'   {TARGETS[key]}')


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--bodies', type=int, default=100)
    parser.add_argument('--seconds', type=int, default=20)
    parser.add_argument('--starts', type=int, default=3)
    parser.add_argument('--subscribe', action='store_true', help='listen to every pose and twist')
    options = parser.parse_args()
    os.environ['ROS_DOMAIN_ID'] = str(DOMAIN)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    rclpy.init()
    print(f'{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}; '
          f'{options.bodies} bodies, {options.seconds} s; steps of 1 ms, 100 Hz of pose, twist '
          f'and state{", all subscribed to" if options.subscribe else ""}')
    with tempfile.TemporaryDirectory() as folder:
        scene = write_scene(Path(folder), options.bodies)
        start_time(scene)       # fills the cache of compiled kernels
        times = [start_time(scene) for _ in range(options.starts)]
        windows = measure(scene, options.bodies, options.seconds, options.subscribe)
        late_ns = empty_loop(options.seconds)
    rclpy.try_shutdown()
    report(windows, times)
    # An overrun is a step that begins more than 1 ms late: what this machine does to a loop
    # that has nothing to do is not the node's.
    overruns = sum(late > 1_000_000 for late in late_ns)
    print(f'beside it a loop that only sleeps: {overruns} overruns in {options.seconds} s, '
          f'lateness median {late_ns[len(late_ns) // 2] / 1e3:.0f} us, '
          f'99 % {late_ns[len(late_ns) * 99 // 100] / 1e3:.0f} us, '
          f'worst {late_ns[-1] / 1e3:.0f} us')
    return 0


if __name__ == '__main__':
    sys.exit(main())
