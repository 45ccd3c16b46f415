# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is sent between steps: all of it, in order, and in time."""
from importlib.util import find_spec
from math import inf
from time import monotonic_ns
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from geometry_msgs.msg import PoseStamped
from nodes.live import nanoseconds, running
from nodes.scenes import free_bodies
import pytest

from rigid_sim_ros.nodes.outbox import Outbox

BODIES = 60
LAST = f'/rigid_sim/body_{BODIES - 1}/pose'


class Handle:
    """A publisher that takes its time, and remembers what was sent when."""

    def __init__(self, takes_ns: int = 0) -> None:
        self.sent: list[tuple[int, bytes]] = []
        self._takes_ns = takes_ns

    def publish_raw(self, data: bytes) -> None:
        end_ns = monotonic_ns() + self._takes_ns
        self.sent.append((end_ns, data))
        while monotonic_ns() < end_ns:
            pass


def numbers(count: int, first: int = 0) -> list[bytes]:
    return [b'%d' % k for k in range(first, first + count)]


def test_everything_is_sent_in_order() -> None:
    outbox, handle = Outbox(), Handle()
    outbox.put([handle] * 50, numbers(50))
    outbox.put([handle] * 7, numbers(7, 50))
    assert outbox.send(inf)
    assert [data for _, data in handle.sent] == numbers(57)
    assert not outbox.send(inf)


def test_nothing_is_begun_when_the_time_is_over() -> None:
    outbox, handle = Outbox(), Handle(takes_ns=100_000)
    outbox.put([handle] * 100, numbers(100))        # 10 ms of work
    assert not outbox.send(monotonic_ns())
    end_ns = monotonic_ns() + 2_000_000
    assert outbox.send(end_ns)
    # At most the eight that are sent between two looks at the clock begin after the end.
    assert sum(ended_ns - 100_000 > end_ns for ended_ns, _ in handle.sent) <= 8
    assert 0 < len(handle.sent) < 100
    assert outbox.send(inf)
    assert [data for _, data in handle.sent] == numbers(100)


def test_a_message_without_a_publisher_is_refused() -> None:
    with pytest.raises(ValueError, match='longer'):
        Outbox().put([Handle()], numbers(2))


@pytest.mark.parametrize('factor', [1.0, 0.0], ids=['real time', 'as fast as possible'])
def test_the_last_of_many_bodies_misses_nothing(probe, tmp_path, factor) -> None:
    scene = free_bodies(tmp_path, BODIES)
    # Nearly stands still until somebody listens.
    with running(tmp_path / 'log', str(scene), words=['--duration', '1'],
                 real_time_factor=0.001) as process, \
            probe.listening(PoseStamped, LAST) as received:
        assert probe.set_parameter('real_time_factor', factor).successful
        assert process.wait() == 0
        probe.wait_for(lambda: nanoseconds(received[-1].header.stamp) == 10 ** 9)
        stamps = [nanoseconds(message.header.stamp) for message in received]
    assert stamps == list(range(stamps[0], 10 ** 9 + 1, 10_000_000))


def test_a_pause_sends_what_belongs_to_its_time(probe, tmp_path) -> None:
    with running(tmp_path / 'log', str(free_bodies(tmp_path, BODIES)), publish_rate=1000.0), \
            probe.listening(PoseStamped, LAST) as received:
        probe.wait_for(lambda: len(received) > 10)
        answer = probe.pause(True)
        paused_ns = round(float(answer.message.split()[-2]) * 1e9)
        probe.wait_for(lambda: nanoseconds(received[-1].header.stamp) == paused_ns)
