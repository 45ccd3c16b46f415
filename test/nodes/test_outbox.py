# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is sent between steps: all of it, in order, and in time."""
from importlib.util import find_spec
from math import inf
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from geometry_msgs.msg import PoseStamped
from nodes.live import nanoseconds, running
from nodes.scenes import free_bodies
import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import MultiDOFJointState

from rigid_sim_ros.nodes import outbox as module
from rigid_sim_ros.nodes.outbox import Outbox

BODIES = 60
LAST = f'body_{BODIES - 1}/pose'


class Handle:
    """A publisher for which each message takes 100 ns of a clock that nothing else moves."""

    TAKES_NS = 100

    def __init__(self) -> None:
        self.now_ns = 0
        self.sent: list[bytes] = []

    def publish_raw(self, data: bytes) -> None:
        self.now_ns += self.TAKES_NS
        self.sent.append(data)


@pytest.fixture
def handle(monkeypatch):
    handle = Handle()
    monkeypatch.setattr(module, 'monotonic_ns', lambda: handle.now_ns)
    return handle


def numbers(count: int, first: int = 0) -> list[bytes]:
    return [b'%d' % k for k in range(first, first + count)]


def test_everything_is_sent_in_order(handle) -> None:
    outbox = Outbox()
    outbox.put([handle] * 50, numbers(50))
    outbox.put([handle] * 7, numbers(7, 50))
    assert outbox.send(inf)
    assert handle.sent == numbers(57)
    assert not outbox.send(inf)


def test_nothing_is_begun_when_the_time_is_over(handle) -> None:
    outbox = Outbox()
    outbox.put([handle] * 100, numbers(100))
    assert not outbox.send(handle.now_ns)
    # The thirtieth begins after 2900 ns, the next one would at 3000.
    assert outbox.send(3000)
    assert handle.sent == numbers(30)
    assert outbox.send(inf)
    assert handle.sent == numbers(100)


def test_a_message_without_a_publisher_is_refused(handle) -> None:
    with pytest.raises(ValueError, match='longer'):
        Outbox().put([handle], numbers(2))


@pytest.mark.parametrize('name, factor', [('in_time', 1.0), ('at_once', 0.0)])
def test_the_last_of_many_bodies_misses_nothing(probe, tmp_path, name, factor) -> None:
    # Nearly stands still until somebody listens.
    with running(tmp_path / 'log', str(free_bodies(tmp_path, BODIES)), name=name,
                 words=['--duration', '1'], real_time_factor=0.001,
                 **{'qos.pose.depth': 10_000}) as process, \
            probe.listening(PoseStamped, f'/{name}/{LAST}') as received:
        assert probe.set_parameter('real_time_factor', factor, f'/{name}').successful
        assert process.wait() == 0
        probe.wait_for(lambda: received and nanoseconds(received[-1].header.stamp) == 10 ** 9)
        stamps = [nanoseconds(message.header.stamp) for message in received]
    # At a thousandth of the pace a minute is 60 ms.
    assert stamps[0] <= 5 * 10 ** 8
    assert stamps == list(range(stamps[0], 10 ** 9 + 1, 10_000_000))


def test_what_waits_is_sent_though_no_other_state_follows(probe, tmp_path) -> None:
    with running(tmp_path / 'log', str(free_bodies(tmp_path, BODIES)), name='last'), \
            probe.listening(MultiDOFJointState, '/last/state') as states, \
            probe.listening(PoseStamped, f'/last/{LAST}') as poses, \
            probe.listening(Clock, '/clock') as clock:
        probe.wait_for(lambda: states and poses and clock)
        assert probe.set_parameter('publish_rate', 0.0, '/last').successful
        # No state for ten publishing periods: the last was the last.
        probe.wait_for(lambda: nanoseconds(clock[-1].clock)
                       > nanoseconds(states[-1].header.stamp) + 10 ** 8)
        probe.wait_for(lambda: poses[-1].header.stamp == states[-1].header.stamp)
