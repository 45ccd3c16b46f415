# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A replay that is paused, stepped, sought, slowed down and hurried up from outside."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from bag.foreign import LATCHED, mcap, rosbag2, texts
from bag.sessions import NODE, shared_session
from geometry_msgs.msg import PoseStamped
from nodes.live import nanoseconds
from nodes.replays import hearing, LATE, of_topic, replaying, texts_of
import pytest
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Float64, String

from rigid_sim_ros.messages.codec import encode_string

SECOND = 10 ** 9


@pytest.fixture
def chatter(tmp_path):
    """Give a bag with three messages at each of a hundred seconds."""
    return mcap(tmp_path / 'a.mcap', sorted(
        each for name in ('/chatter', '/other', '/third') for each in texts(name, 100, SECOND)))


def test_a_pause_stops_the_messages_and_its_end_goes_on_with_the_next(probe, tmp_path) -> None:
    # So long that it is not over before a client has found the service on a busy machine.
    count = 200
    bag = mcap(tmp_path / 'a.mcap', texts('/chatter', count, SECOND // 20))
    with hearing(probe, String, '/chatter') as received, replaying(tmp_path, bag) as process:
        probe.wait_for(lambda: len(received) >= 5)
        paused = probe.pause(True, '/replay').message
        again = probe.pause(True, '/replay').message
        assert again == f'already {paused}'
        # What was sent before may still be on its way; nothing later has been sent.
        seconds = float(paused.split()[2])
        assert len(received) <= 20 * seconds + 1
        # At its own rate what is left takes ten seconds, in which nobody works.
        assert probe.set_parameter('rate', 10.0, '/replay').successful
        assert probe.pause(False, '/replay').success
        assert process.wait() == 0
        probe.wait_for(lambda: texts_of(received)[-1] == f'/chatter {count - 1}', 'the last one')
    assert texts_of(received) == [f'/chatter {k}' for k in range(count)]


def test_a_step_publishes_all_messages_of_the_next_time_stamp(probe, tmp_path, chatter) -> None:
    with hearing(probe, String, '/chatter') as one, hearing(probe, String, '/third') as other, \
            replaying(tmp_path, chatter, '--pause', '--start', '9.5'):
        for k in range(3):
            answer = probe.trigger('/replay/step')
            assert answer.success
            assert answer.message == f'stepped to {10 + k}.000000000 s: 3 messages'
        probe.wait_for(lambda: len(one) == len(other) == 3)
    assert texts_of(one) == ['/chatter 10', '/chatter 11', '/chatter 12']


def test_a_step_through_a_recording_is_a_step_of_the_simulation(probe, tmp_path) -> None:
    bag = shared_session()
    with hearing(probe, MultiDOFJointState, f'{NODE}/state') as states, \
            hearing(probe, PoseStamped, f'{NODE}/ball/pose') as poses, \
            replaying(tmp_path, bag, '--pause'):
        for count in (1, 2, 3):
            assert probe.trigger('/replay/step').success
            probe.wait_for(lambda: len(states) == len(poses) == count)    # noqa: B023
    assert states == [data for _, data in of_topic(bag, f'{NODE}/state')[:3]]


def test_a_step_needs_a_pause(probe, tmp_path, chatter) -> None:
    with replaying(tmp_path, chatter, '--loop', subscriber_timeout=0.0):
        answer = probe.trigger('/replay/step')
    assert not answer.success
    assert 'not paused' in answer.message


def test_a_step_at_the_end_says_so(probe, tmp_path) -> None:
    bag = mcap(tmp_path / 'a.mcap', texts('/chatter', 2, SECOND))
    with replaying(tmp_path, bag, '--pause', subscriber_timeout=0.0):
        assert [probe.trigger('/replay/step').success for _ in range(4)] == [
            True, True, False, False]


def test_seek_goes_to_a_time_from_the_beginning(probe, tmp_path, chatter) -> None:
    with hearing(probe, String, '/chatter') as received, \
            replaying(tmp_path, chatter, '--pause'):
        for at in (70.0, 20.0):
            probe.publish('/replay/seek', Float64(data=at))
            expected = f'already paused at {at:.9f} s'
            probe.wait_for(
                lambda: probe.pause(True, '/replay').message == expected)    # noqa: B023
            assert probe.trigger('/replay/step').success
        probe.wait_for(lambda: len(received) == 2)
    assert texts_of(received) == ['/chatter 70', '/chatter 20']


def test_after_a_seek_comes_first_what_was_latched_then(probe, tmp_path) -> None:
    latched = [((1 + 10 * k) * SECOND, '/map', encode_string(f'map {k}')) for k in range(3)]
    bag = rosbag2(tmp_path / 'bag', sorted(latched + texts('/chatter', 30, SECOND)),
                  qos={'/map': [LATCHED]})
    with hearing(probe, String, '/map', LATE) as maps, replaying(
            tmp_path, bag, '--pause'):
        for count, at in enumerate((25.0, 5.0, 15.0), 2):
            probe.publish('/replay/seek', Float64(data=at))
            probe.wait_for(lambda: len(maps) == count)    # noqa: B023
    assert texts_of(maps) == ['map 0', 'map 2', 'map 0', 'map 1']


@pytest.mark.parametrize('at, shown', [(-5.0, 0), (1e9, 99), (1e300, 99)])
def test_seek_stays_within_the_bag(probe, tmp_path, chatter, at, shown) -> None:
    with replaying(tmp_path, chatter, '--pause', '--start', '50', subscriber_timeout=0.0):
        probe.publish('/replay/seek', Float64(data=at))
        probe.wait_for(lambda: probe.pause(True, '/replay').message
                       == f'already paused at {shown}.000000000 s')


def test_seek_to_no_number_is_refused_and_the_replay_goes_on(probe, tmp_path, chatter) -> None:
    with replaying(tmp_path, chatter, '--pause', '--start', '50',
                   subscriber_timeout=0.0) as process:
        probe.publish('/replay/seek', Float64(data=float('nan')))
        probe.wait_for(lambda: 'refused ~/seek: nan' in process.stderr)
        assert probe.pause(True, '/replay').message == 'already paused at 50.000000000 s'


def test_a_seek_sets_the_clock(probe, tmp_path, chatter) -> None:
    with hearing(probe, Clock, '/clock') as clock, replaying(tmp_path, chatter, '--pause'):
        probe.publish('/replay/seek', Float64(data=42.0))
        probe.wait_for(lambda: clock and nanoseconds(
            deserialize_message(clock[-1], Clock).clock) == 43 * SECOND)


def test_the_rate_changes_while_the_replay_runs(probe, tmp_path, chatter) -> None:
    # At this rate it would take a day.
    with hearing(probe, String, '/chatter') as received, \
            replaying(tmp_path, chatter, '--rate', '0.001') as process:
        probe.wait_for(lambda: received)
        assert probe.set_parameter('rate', 1000.0, '/replay').successful
        assert process.wait() == 0
        probe.wait_for(lambda: len(received) == 100)


@pytest.mark.parametrize('name, value', [
    ('rate', 0.0), ('rate', -1.0), ('rate', float('nan')), ('clock_rate', -1.0),
    ('start', 3.0), ('bag', 'other')])
def test_parameters_that_cannot_be_set_are_refused(probe, tmp_path, chatter, name, value) -> None:
    with replaying(tmp_path, chatter, '--pause'):
        assert not probe.set_parameter(name, value, '/replay').successful
