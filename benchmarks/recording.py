# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What recording costs, and how fast a recording is verified.

    python benchmarks/recording.py
    python benchmarks/recording.py --session 600
    python benchmarks/recording.py --node 20            needs ROS; nothing but part 4

Part 1 is what the thread that steps the world pays for a message: it must stay below 3 us. Part 2
is why messages are packed in this package: what else could write MCAP. Part 3 simulates a session
again, which must be 20 times faster than real time. Part 4 is the node with 100 bodies, 1 kHz,
100 Hz, which records while it publishes: what its diagnostics say. Each figure is the median of
several runs, or of the seconds of one.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
import os
from pathlib import Path
from statistics import median
import subprocess
import sys
from tempfile import TemporaryDirectory
import time
from typing import Any, NamedTuple

import click
from mcap.writer import CompressionType, Writer as LibraryWriter
from rosbags.rosbag2 import StoragePlugin, Writer as RosbagsWriter

from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.mcap_file import McapFile
from rigid_sim_ros.bag.outputs import Outputs, state_topics
from rigid_sim_ros.bag.recorder import Recorder
from rigid_sim_ros.bag.topics import definition, typestore
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.world import World

NODE = '/rigid_sim'
RUNS = 5
PUBLICATIONS = 200      # 2 s at 100 Hz
EVENTS = 10             # in a row, as when several nodes push bodies


def world(bodies: int) -> World:
    """Return boxes that tumble in free fall, 1 kHz."""
    return World.from_dict({
        'format': 1, 'world': {'step': 0.001, 'contact': 'none'},
        'bodies': [{'name': f'box{k}', 'shape': {'type': 'box', 'size': [1, 2, 3]}, 'mass': 1.0,
                    'pose': {'position': [5 * k, 0, 0]}, 'twist': {'angular': [0.1, 1, 0.2 * k]}}
                   for k in range(bodies)]})


@contextmanager
def folder() -> Iterator[Path]:
    """Give a folder for a bag."""
    with TemporaryDirectory() as name:
        yield Path(name)


def print_cost_per_message(bodies: int) -> None:
    """Time the calls of Recorder in a loop that runs in real time, as that of the node does."""
    the_world = world(bodies)
    topics = state_topics(NODE, the_world.names)
    outputs = Outputs(the_world, topics, 'world')
    pairs = [pair for kind in (kinds.POSE, kinds.TWIST, kinds.STATE)
             for pair in outputs.encode(kind)]
    messages = [data for _, data in pairs]
    publish, event = [], []
    with folder() as path:
        recorder = Recorder(path / 'bag', the_world, topics)
        recorder.snapshot(the_world)
        channels = [recorder.channel(name) for name, _ in pairs]
        for k in range(PUBLICATIONS):
            start = time.perf_counter()
            recorder.publish(k, channels, messages)
            middle = time.perf_counter()
            for _ in range(EVENTS):
                recorder.event(k, 'cancel_wrenches', source='nobody')
            publish.append((middle - start) / len(messages))
            event.append((time.perf_counter() - middle) / EVENTS)
            time.sleep(0.01)
        recorder.close(the_world)
        assert not recorder.status().gaps
    late = sorted(publish)[int(0.99 * len(publish))] * len(messages)
    click.echo(f'1. in the step thread, {bodies} bodies, {len(messages)} messages at 100 Hz:')
    click.echo(f'   publish {median(publish) * 1e6:.3f} us a message (must be < 3), 99 % of the '
               f'calls below {late * 1e6:.0f} us; event {median(event) * 1e6:.1f} us (< 3)')


def print_cost_of_writers(channels: int) -> None:
    """Time what the writer thread does with a message, and what libraries would do."""
    data, kind = bytes(84), kinds.TYPES[kinds.POSE]
    names = [f'{NODE}/box{k}/pose' for k in range(channels)]
    text = definition(kind)[0]

    def ours(path: Path) -> Callable[[int], None]:
        file = McapFile(path, [kinds.topic(kinds.POSE, name) for name in names], False)
        everyone, messages = range(1, channels + 1), [data] * channels
        return lambda k: file.write(everyone, k * channels + 1, messages)

    def library(path: Path) -> Callable[[int], None]:
        writer = LibraryWriter(path.open('wb'), compression=CompressionType.NONE)
        writer.start('ros2')
        schema = writer.register_schema(kind, 'ros2msg', text.encode())
        ids = [writer.register_channel(name, 'cdr', schema) for name in names]

        def write(k: int) -> None:
            for i in ids:
                writer.add_message(i, k, data, k)
        return write

    def rosbags(path: Path) -> Callable[[int], None]:
        writer = RosbagsWriter(path, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.open()
        connections = [writer.add_connection(name, kind, typestore=typestore()) for name in names]

        def write(k: int) -> None:
            for connection in connections:
                writer.write(connection, k, data)
        return write

    click.echo(f'2. in the writer thread, {channels} topics, 84 bytes, MCAP:')
    for name, make in (('this package', ours), ('mcap.writer', library),
                       ('rosbags.rosbag2.Writer', rosbags)):
        click.echo(f'   {name:24}{_per_call(make) / channels * 1e6:.2f} us a message')


def _per_call(make: Callable[[Path], Callable[[int], None]]) -> float:
    times = []
    for _ in range(RUNS):
        with folder() as path:
            write = make(path / 'file')
            write(0)
            start = time.perf_counter()
            for k in range(1, 101):
                write(k)
            times.append((time.perf_counter() - start) / 100)
    return median(times)


def print_verify_speed(bodies: int, seconds: float, runs: int) -> None:
    """Record a session with pushes and resets, and simulate it again."""
    with folder() as path:
        batch = Batch(world(bodies), path / 'bag')
        start = time.perf_counter()
        _push(batch, seconds)
        batch.close()
        recorded = time.perf_counter() - start
        verdicts: list[Any] = []
        times = []
        for _ in range(runs):
            start = time.perf_counter()
            verdicts.append(verify(path / 'bag'))
            times.append(time.perf_counter() - start)
        size = sum(file.stat().st_size for file in (path / 'bag').iterdir())
    assert all(verdict.holds for verdict in verdicts)
    click.echo(f'3. a session of {seconds:g} s with {bodies} bodies, '
               f'{verdicts[0].messages} messages, {size / 1e6:.0f} MB:')
    click.echo(f'   batch records it in {recorded:.1f} s, {seconds / recorded:.0f} times real '
               f'time; verify takes {median(times):.1f} s, {seconds / median(times):.0f} times '
               '(must be >= 20)')


def _push(batch: Batch, seconds: float) -> None:
    batch.run(1)
    for k in range(round(seconds)):
        batch.tell('apply_wrench', name='box1', force=(0.1, 0.0, 0.05 * k), duration=0.5,
                   source='push')
        batch.run(1000)
        if k % 60 == 59:
            batch.tell('reset', keep_time=True)


def print_node(bodies: int, seconds: int) -> None:
    """Let a node record every other two seconds, and print what it says of itself in both."""
    import node_speed       # beside this file; imports rclpy
    import rclpy

    os.environ |= {'ROS_DOMAIN_ID': str(node_speed.DOMAIN),
                   'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    rclpy.init()
    click.echo(f'4. in the node, {bodies} bodies, 1 kHz, {2 * bodies + 1} messages at 100 Hz, and '
               f'markers, for {seconds} s; seconds with and without a recording take turns:')
    with folder() as path:
        windows = alternate(node_speed.write_scene(path, bodies), path, seconds)
    late = node_speed.empty_loop(seconds)
    rclpy.try_shutdown()
    for recorded in (False, True):
        chosen = [window for window in windows if window.recorded == recorded]
        pace = [window.pace for window in chosen]
        click.echo(
            f'   {"recorded" if recorded else "not recorded":14}{len(chosen)} s: overruns '
            f'{sum(int(p["overruns lately"]) for p in pace)}, lateness median '
            f'{_median(pace, "lateness median [us]"):.0f} us, 99 % '
            f'{_median(pace, "lateness 99 % [us]"):.0f} us; step thread '
            f'{_median(pace, "step thread CPU share [%]"):.1f} % of a core; '
            f'encoding and sending {_median(pace, "cost per message [us]"):.2f} us a message')
    told = [window.recording for window in windows if window.recorded]
    click.echo(f'   recording {_median(told, "cost per message [us]"):.2f} us a message, most '
               f'{max(float(t["cost per message [us]"]) for t in told):.2f} (must be <= 3); '
               f'gaps {sum(int(t["gaps"]) for t in told)}')
    click.echo(f'   beside it a loop that only sleeps: {sum(ns > 1_000_000 for ns in late)} '
               f'overruns in {seconds} s')


class Window(NamedTuple):
    """A second of a node, as /diagnostics tells of it."""

    recorded: bool
    pace: dict[str, str]
    recording: dict[str, str]


def alternate(scene: Path, path: Path, seconds: int) -> list[Window]:
    """Start a node, let it record now and then; return its seconds but the mixed ones."""
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.experimental import EventsExecutor
    from rclpy.node import Node
    from std_srvs.srv import Trigger

    node, windows = Node('alternate'), []
    clients = [node.create_client(Trigger, f'/rigid_sim/{name}_recording')
               for name in ('start', 'stop')]

    def keep(message: DiagnosticArray) -> None:
        values = {status.name.rpartition(': ')[2]: (status.message, {
            value.key: value.value for value in status.values}) for status in message.status}
        says, recording = values['recording']
        windows.append(Window(says.startswith('recording into'), values['pace'][1], recording))
        if len(windows) % 3 == 1:
            clients[len(windows) // 3 % 2].call_async(Trigger.Request())

    node.create_subscription(DiagnosticArray, '/diagnostics', keep, 10)
    executor = EventsExecutor()
    executor.add_node(node)
    process = subprocess.Popen([
        sys.executable, '-m', 'rigid_sim_ros', 'run', str(scene), '--ros-args', '--log-level',
        'error'], cwd=path)
    while len(windows) < 3 * (seconds // 2) + 3 and process.poll() is None:
        executor.spin_once(timeout_sec=0.1)
    process.terminate()
    process.wait()
    node.destroy_node()
    # The second in which a recording begins or ends is neither.
    return [now for before, now in pairwise(windows[1:]) if before.recorded == now.recorded]


def _median(rows: list[dict[str, str]], key: str) -> float:
    return median(float(row[key]) for row in rows)


@click.command()
@click.option('--session', default=60.0, help='Seconds of the session that is verified.')
@click.option('--runs', default=3, help='How often it is verified.')
@click.option('--node', default=0, help='Seconds of the recording in the node; 0: none.')
def main(session: float, runs: int, node: int) -> None:
    """Print what recording costs and how fast verifying is."""
    world(2).step(10)       # compiles
    if node:
        print_node(bodies=100, seconds=node)
        return
    print_cost_per_message(bodies=100)
    print_cost_of_writers(channels=200)
    print_verify_speed(bodies=20, seconds=session, runs=runs)


if __name__ == '__main__':
    main()
