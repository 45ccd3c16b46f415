# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measure how well a replay keeps the times of a bag, as a subscriber in another process sees them.

    python benchmarks/replay_timing.py
    python benchmarks/replay_timing.py --bodies 100 --seconds 30 --runs 5

For each number of bodies a bag is made with 1 kHz steps and 100 Hz of pose, twist and state, and
replayed at rate 1 by `rigid_sim replay` in a process of its own. This process notes when each
message of ~/state and of the poses of the first and the last body arrives. Two figures are printed
of each run, and their medians over the runs:

* late: arrival minus recorded time, less the smallest such difference within the same second. That
  is how late a message is against the one that came earliest, so it holds the sending of the 201
  messages of one time stamp and the way through DDS as well as waking up. (By the second, because
  a stall of the machine beyond 0.1 s shifts all that follows.)
* interval: from one message of a topic to the next, against the recorded one; as an amount.
"""

import argparse
from collections.abc import Sequence
import os
from pathlib import Path
import platform
from statistics import median
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile

from rigid_sim_ros import World
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.reader import BagReader

DOMAIN = 88
DEEP = QoSProfile(depth=10_000)
TARGET_MS = 1.0     # at the median


def make_bag(folder: Path, count: int, seconds: float) -> Path:
    """Simulate free bodies into a bag."""
    world = World.from_dict({
        'format': 1, 'world': {'step': 0.001, 'contact': 'none'},
        'bodies': [{'name': f'body_{k}', 'shape': {'type': 'box', 'size': [0.1, 0.2, 0.3]},
                    'mass': 1.0, 'pose': {'position': [k, 0, 0]},
                    'twist': {'angular': [0.01, 5, 0.01]}} for k in range(count)]})
    bag = folder / f'bodies_{count}'
    batch = Batch(world, bag)
    batch.run(round(seconds * 1000))
    batch.close()
    return bag


def recorded(bag: Path, topics: Sequence[str]) -> dict[str, Any]:
    """Return the times [ns] of the messages of some topics."""
    found: dict[str, list[int]] = {name: [] for name in topics}
    for name, stamp, _ in BagReader(bag).messages():
        if name in found:
            found[name].append(stamp)
    return {name: np.array(times) for name, times in found.items()}


def replay(bag: Path, topics: dict[str, str]) -> dict[str, Any]:
    """Replay a bag and return when the messages of some topics arrived [ns]."""
    node = Node('replay_timing')
    arrived: dict[str, list[int]] = {name: [] for name in topics}
    subscriptions = [
        node.create_subscription(
            _message(kind), name,
            lambda _, times=arrived[name]: times.append(time.monotonic_ns()), DEEP, raw=True)
        for name, kind in topics.items()]
    executor = EventsExecutor()
    executor.add_node(node)
    process = subprocess.Popen(
        [sys.executable, '-m', 'rigid_sim_ros', 'replay', str(bag)], stdin=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL)
    while process.poll() is None:
        executor.spin_once(timeout_sec=0.1)
    end = time.monotonic() + 0.5        # what arrived is still to be taken
    while time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    for subscription in subscriptions:
        node.destroy_subscription(subscription)
    node.destroy_node()
    return {name: np.array(times) for name, times in arrived.items()}


def errors(due: dict[str, Any], arrived: dict[str, Any]) -> tuple[Any, Any]:
    """Return lateness and error of intervals [ms]."""
    for name, times in due.items():
        if len(times) != len(arrived[name]):
            raise SystemExit(f'{name}: {len(arrived[name])} of {len(times)} messages arrived')
    late = np.concatenate([arrived[name] - due[name] for name in due])
    seconds = np.concatenate([times // 1_000_000_000 for times in due.values()])
    for second in np.unique(seconds):
        late[seconds == second] -= late[seconds == second].min()
    intervals = np.concatenate([np.diff(arrived[name]) - np.diff(due[name]) for name in due])
    return late / 1e6, np.abs(intervals) / 1e6


def sleeping(seconds: float) -> Any:
    """Return how late a loop that only sleeps until each hundredth of a second is [ms]."""
    begun, late = time.monotonic_ns(), []
    for k in range(1, round(seconds * 100) + 1):
        due = begun + k * 10_000_000
        time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
        late.append((time.monotonic_ns() - due) / 1e6)
    return np.array(late)


def _message(kind: str) -> type:
    from geometry_msgs.msg import PoseStamped
    from sensor_msgs.msg import MultiDOFJointState
    return {'pose': PoseStamped, 'state': MultiDOFJointState}[kind]


def _row(name: str, values: Any) -> str:
    figures = '  '.join(f'{np.percentile(values, q):8.3f}' for q in (50, 90, 99, 100))
    return f'{name:<28} {figures}'


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description='Measure the timing of a replay.')
    parser.add_argument('--bodies', type=int, nargs='+', default=[1, 20, 100])
    parser.add_argument('--seconds', type=float, default=10.0)
    parser.add_argument('--runs', type=int, default=3)
    options = parser.parse_args()
    os.environ['ROS_DOMAIN_ID'] = str(DOMAIN)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    print(f'{platform.platform()}, {os.cpu_count()} CPUs, Python {platform.python_version()}, '
          f'{time.strftime("%Y-%m-%d", time.gmtime())}, load {os.getloadavg()[0]:.2f}')
    print(f'{"[ms]":<28} {"median":>8}  {"90 %":>8}  {"99 %":>8}  {"worst":>8}')
    print(_row('a loop that only sleeps', sleeping(options.seconds)))
    rclpy.init()
    with tempfile.TemporaryDirectory() as folder:
        for count in options.bodies:
            bag = make_bag(Path(folder), count, options.seconds)
            topics = {'/rigid_sim/state': 'state', '/rigid_sim/body_0/pose': 'pose',
                      f'/rigid_sim/body_{count - 1}/pose': 'pose'}
            due = recorded(bag, list(topics))
            medians = []
            for run in range(options.runs):
                late, intervals = errors(due, replay(bag, topics))
                medians.append((np.median(late), np.median(intervals)))
                print(_row(f'{count} bodies, run {run + 1}: late', late))
                print(_row('                  interval', intervals))
            print(f'{count} bodies: median of medians late {median(m[0] for m in medians):.3f}, '
                  f'interval {median(m[1] for m in medians):.3f}, must be at most {TARGET_MS:g}')
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
