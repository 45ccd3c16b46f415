# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Replays in processes of their own, for the tests."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from nodes.live import DEEP, kept, PATIENCE, Probe, Process
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from rigid_sim_ros.bag.reader import BagReader

# Gets what a latched topic said before the subscription was found, too.
LATE = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def replay(
    folder: Path, bag: Path | str, *words: str, name: str = 'replay', remaps: Sequence[str] = (),
    **parameters: Any,
) -> Process:
    """
    Start the node with words of the command line, and parameters.

    It waits for whoever listens: on a machine under load the two may take more than the default
    time to find each other.
    """
    parameters.setdefault('subscriber_timeout', PATIENCE)
    ros = ['--ros-args', '-r', f'__node:={name}']
    for remap in remaps:
        ros += ['-r', remap]
    for key, value in parameters.items():
        text = str(value).lower() if isinstance(value, bool) else str(value)
        ros += ['-p', f'{key}:={text}']
    return Process(['replay', str(bag), *words, *ros], folder / 'process', is_forked=True)


@contextmanager
def replaying(*args: Any, **options: Any) -> Iterator[Process]:
    """Start the node and end it with the block."""
    with kept(replay(*args, **options)) as process:
        yield process


@contextmanager
def replaying_to(probe: Probe, *args: Any, name: str = 'replay', **options: Any,
                 ) -> Iterator[Process]:
    """
    Start the node as `replaying` does, and let it begin when it knows all that the probe hears.

    By itself it begins a moment after the last one that it has heard of, and knows of no others.
    """
    with replaying(*args, name=name, paused=True, **options) as process:
        assert probe.pause(False, f'/{name}').success
        yield process


def of_topic(bag: Path, topic: str) -> list[tuple[int, bytes]]:
    """Return times and bytes of what a bag holds on a topic."""
    return [(stamp, data) for name, stamp, data in BagReader(bag).messages() if name == topic]


@contextmanager
def hearing(probe: Probe, message: type, topic: str, qos: Any = DEEP) -> Iterator[list[bytes]]:
    """Collect the bytes that arrive on a topic; nobody needs to publish there yet."""
    received: list[bytes] = []
    subscription = probe.subscribe(message, topic, received.append, qos, raw=True)
    try:
        yield received
    finally:
        probe.node.destroy_subscription(subscription)


def texts_of(received: Sequence[bytes]) -> list[str]:
    """Return what messages of type String say; DDS may have padded the bytes."""
    return [deserialize_message(data, String).data for data in received]
