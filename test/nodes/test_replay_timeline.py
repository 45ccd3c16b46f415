# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When a message is due, on a wall clock that the test sets."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from hypothesis import given, strategies as st
import pytest

from rigid_sim_ros.nodes.replay.timeline import Timeline

SECOND = 10 ** 9
times = st.integers(0, 2 * 10 ** 18)
spans = st.integers(0, 10 ** 15)        # 11 days
rates = st.floats(1e-3, 1e3)


def running(rate: float, bag_ns: int = 0, wall_ns: int = 0) -> Timeline:
    timeline = Timeline(rate)
    timeline.jump(bag_ns, wall_ns)
    timeline.run(wall_ns)
    return timeline


@given(rate=rates, bag=times, wall=times, span=spans)
def test_a_message_is_due_when_its_time_has_come_and_no_sooner(rate, bag, wall, span) -> None:
    timeline = running(rate, bag, wall)
    due = timeline.due(bag + span)
    # A double has 53 bits: 1e15 ns of the bag are known to 0.2 ns, and a wall time is whole.
    slack = 2 + int(2 * rate)
    assert bag + span - slack <= timeline.at(due) <= bag + span + slack
    assert timeline.at(due - 2) <= bag + span


@pytest.mark.parametrize('rate', [0.1, 1.0, 7.0])
def test_time_passes_at_the_rate(rate) -> None:
    timeline = running(rate, 5 * SECOND, 100 * SECOND)
    assert timeline.at(110 * SECOND) == (5 + 10 * rate) * SECOND


def test_a_new_rate_holds_from_now_on() -> None:
    timeline = running(1.0)
    timeline.set_rate(2.0, 10 * SECOND)
    assert timeline.at(10 * SECOND) == 10 * SECOND
    assert timeline.at(15 * SECOND) == 20 * SECOND


def test_nothing_is_due_while_time_stands_still() -> None:
    timeline = running(1.0)
    timeline.stop(3 * SECOND)
    assert timeline.at(1000 * SECOND) == 3 * SECOND
    assert timeline.due(3 * SECOND) > 1000 * SECOND


@given(pause=spans)
def test_the_length_of_a_pause_changes_nothing_afterwards(pause) -> None:
    timeline = running(1.0)
    timeline.stop(3 * SECOND)
    timeline.run(3 * SECOND + pause)
    assert timeline.due(5 * SECOND) == 5 * SECOND + pause


def test_a_delay_below_the_limit_is_caught_up() -> None:
    timeline = running(1.0)
    assert timeline.limit_delay(10 * SECOND, 10 * SECOND + 50, 100) == 0
    assert timeline.due(11 * SECOND) == 11 * SECOND


@given(rate=rates, stall=spans)
def test_a_delay_beyond_the_limit_shifts_what_follows(rate, stall) -> None:
    timeline, limit = running(rate), 100_000_000
    due = timeline.due(10 * SECOND)
    given_up = timeline.limit_delay(10 * SECOND, due + stall, limit)
    assert given_up == max(0, stall - limit)
    assert due + stall - timeline.due(10 * SECOND) <= limit


def test_a_jump_into_the_future_waits_for_it() -> None:
    timeline = running(2.0, 7 * SECOND, 10 * SECOND)
    assert timeline.due(7 * SECOND) == 10 * SECOND
    assert timeline.at(9 * SECOND) < 7 * SECOND
