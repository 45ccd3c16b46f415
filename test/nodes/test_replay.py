# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a replay publishes: whose messages, which of them, and in which order."""
from importlib.util import find_spec
import signal
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from bag.foreign import BEST_EFFORT, LATCHED, mcap, rosbag2, texts
from bag.sessions import NODE, shared_session
from geometry_msgs.msg import PoseStamped
from nodes.live import DEEP, nanoseconds
from nodes.replays import (
    hearing, LATE, of_topic, replay, replaying, replaying_to, texts_of)
import pytest
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import String

from rigid_sim_ros.bag.playable_files import Message
from rigid_sim_ros.messages.codec import encode_clock, encode_string

SECOND = 10 ** 9
FAST = ('--rate', '20')


@pytest.mark.parametrize('storage, mode', [('mcap', 'none'), ('sqlite3', 'zstd')])
def test_the_bytes_of_a_recording_arrive_as_they_are(probe, tmp_path, storage, mode) -> None:
    bag = shared_session(storage, mode)
    topics = {f'{NODE}/state': MultiDOFJointState, f'{NODE}/ball/pose': PoseStamped,
              '/clock': Clock}
    with hearing(probe, topics['/clock'], '/clock') as clock, \
            hearing(probe, PoseStamped, f'{NODE}/ball/pose') as poses, \
            hearing(probe, MultiDOFJointState, f'{NODE}/state') as states, \
            replaying_to(probe, tmp_path, bag, *FAST) as process:
        for received, topic in zip((states, poses, clock), topics, strict=True):
            expected = [data for _, data in of_topic(bag, topic)]
            probe.wait_for(lambda: len(received) >= len(expected), topic)    # noqa: B023
            assert received == expected
        assert process.wait() == 0


@pytest.mark.parametrize('storage, mode', [
    ('mcap', 'STORAGE'), ('mcap', 'FILE'), ('sqlite3', 'NONE'), ('sqlite3', 'FILE')])
def test_bags_of_ros2_bag_record_are_replayed(probe, tmp_path, storage, mode) -> None:
    messages = texts('/chatter', 50, SECOND // 50)
    bag = rosbag2(tmp_path / 'bag', messages, storage=storage, mode=mode)
    with hearing(probe, String, '/chatter') as received, \
            replaying(tmp_path, bag, *FAST) as process:
        assert process.wait() == 0
        probe.wait_for(lambda: len(received) == 50)
        assert texts_of(received) == texts_of([data for _, _, data in messages])


def test_a_latched_topic_reaches_those_who_come_late(probe, tmp_path) -> None:
    bag = shared_session()
    with replaying(tmp_path, bag, '--loop'):
        probe.some(PoseStamped, f'{NODE}/ball/pose')
        with hearing(probe, String, f'{NODE}/scene', LATE) as received:
            probe.wait_for(lambda: received)
            scene = of_topic(bag, f'{NODE}/scene')[0][1]
            assert texts_of(received)[0] == texts_of([scene])[0]


def test_topics_have_the_qos_with_which_they_were_recorded(probe, tmp_path) -> None:
    messages = texts('/kept', 3, SECOND) + texts('/lossy', 3, SECOND)
    bag = rosbag2(tmp_path / 'bag', sorted(messages),
                  qos={'/kept': [LATCHED], '/lossy': [BEST_EFFORT]})
    with replaying(tmp_path, bag, '--pause'):
        for topic, reliability, durability in (
                ('/kept', ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL),
                ('/lossy', ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE)):
            info, = probe.wait_for(
                lambda: probe.node.get_publishers_info_by_topic(topic))    # noqa: B023
            assert info.qos_profile.reliability == reliability
            assert info.qos_profile.durability == durability


@pytest.mark.parametrize('by_file', [True, False])
def test_a_user_overrides_the_qos(probe, tmp_path, by_file) -> None:
    bag = mcap(tmp_path / 'a.mcap', texts('/chatter', 100, SECOND))
    words, given = [], {'qos_overrides./chatter.publisher.reliability': 'best_effort',
                        'qos_overrides./chatter.publisher.deadline': SECOND}
    if by_file:
        file = tmp_path / 'qos.yaml'
        file.write_text('/chatter: {reliability: best_effort, deadline: {sec: 1, nsec: 0}}',
                        encoding='utf-8')
        words, given = ['--qos-profile-overrides-path', str(file)], {}
    # With a name of its own: the end of the replay of another test may not be known yet.
    with replaying(tmp_path, bag, *words, name='overridden', **given) as process:
        info, = probe.wait_for(lambda: [
            end for end in probe.node.get_publishers_info_by_topic('/chatter')
            if end.node_name == 'overridden'], 'the publisher')
        assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
        assert info.qos_profile.deadline.nanoseconds == SECOND
        probe.wait_for(lambda: 'waiting for subscribers, ' in process.stderr)
        assert 'no parameter' not in process.stderr


def test_the_clock_can_be_remapped(probe, tmp_path) -> None:
    bag = mcap(tmp_path / 'a.mcap', texts('/chatter', 100, SECOND))
    with replaying(tmp_path, bag, name='remapped', remaps=['/clock:=/bag_clock']):
        first, *_, last = probe.some(Clock, '/bag_clock', 3)
        assert nanoseconds(last.clock) > nanoseconds(first.clock)
        topics = probe.wait_for(lambda: '/bag_clock' in (
            found := probe.publishers_of('remapped')) and found, 'the topics')
        assert '/clock' not in topics


def test_a_start_in_the_middle_publishes_what_was_latched_before(probe, tmp_path) -> None:
    latched = [(SECOND + k, '/map', encode_string(f'map {k}')) for k in (0, 100, 10 * SECOND)]
    bag = rosbag2(tmp_path / 'bag', sorted(latched + texts('/chatter', 100, SECOND // 10)),
                  qos={'/map': [LATCHED]})
    with hearing(probe, String, '/map', LATE) as maps, \
            hearing(probe, String, '/chatter') as chatter, \
            replaying_to(probe, tmp_path, bag, *FAST, '--start', '5') as process:
        assert process.wait() == 0
        probe.wait_for(lambda: len(chatter) >= 50 and len(maps) >= 2)
        assert texts_of(maps) == ['map 100', f'map {10 * SECOND}']
        assert texts_of(chatter)[0] == '/chatter 50'


def test_a_duration_ends_the_replay(probe, tmp_path) -> None:
    bag = rosbag2(tmp_path / 'bag', texts('/chatter', 100, SECOND // 10))
    with hearing(probe, String, '/chatter') as chatter, replaying(
            tmp_path, bag, *FAST, '--start', '2', '--duration', '3') as process:
        assert process.wait() == 0
        probe.wait_for(lambda: len(chatter) >= 31)
        assert texts_of(chatter) == [f'/chatter {k}' for k in range(20, 51)]


def test_only_topics_that_match_are_published(probe, tmp_path) -> None:
    with replaying(tmp_path, shared_session(), '--topics', '*/ball/*', '--topics', '/clock',
                   '--loop', name='choosy', clock_rate=0.0):
        probe.some(PoseStamped, f'{NODE}/ball/pose')
        expected = {'/clock', f'{NODE}/ball/pose', f'{NODE}/ball/twist'}
        probe.wait_for(lambda: expected <= probe.publishers_of('choosy').keys())
        others = probe.publishers_of('choosy').keys() - expected
        assert others <= {'/rosout', '/parameter_events'}


def test_topics_can_be_remapped(probe, tmp_path) -> None:
    bag = rosbag2(tmp_path / 'bag', texts('/chatter', 5, SECOND // 10))
    with hearing(probe, String, '/elsewhere') as received, replaying(
            tmp_path, bag, remaps=['/chatter:=/elsewhere']) as process:
        assert process.wait() == 0
        probe.wait_for(lambda: len(received) == 5)


def test_a_loop_begins_again_and_can_be_ended_while_it_runs(probe, tmp_path) -> None:
    bag = rosbag2(tmp_path / 'bag', texts('/chatter', 5, SECOND // 10))
    with hearing(probe, String, '/chatter') as received, replaying(
            tmp_path, bag, '--loop', name='loops') as process:
        probe.wait_for(lambda: len(received) >= 11)
        assert probe.set_parameter('loop', False, '/loops').successful
        assert process.wait() == 0
        assert texts_of(received)[:11] == [f'/chatter {k % 5}' for k in range(11)]


def test_what_each_file_repeats_is_not_published_again(probe, tmp_path) -> None:
    bag = shared_session()
    assert len(of_topic(bag, f'{NODE}/scene')) > 2
    with hearing(probe, String, f'{NODE}/scene', LATE) as scenes, \
            hearing(probe, MultiDOFJointState, f'{NODE}/state') as states, \
            replaying_to(probe, tmp_path, bag, *FAST) as process:
        assert process.wait() == 0
        probe.wait_for(lambda: len(states) == len(of_topic(bag, f'{NODE}/state')) and scenes)
        assert len(scenes) == 1


def test_a_latched_topic_that_says_the_same_again_is_heard_twice(probe, tmp_path) -> None:
    messages: list[Message] = [(k * SECOND, '/map', encode_string('same')) for k in (1, 2)]
    bag = rosbag2(tmp_path / 'bag', messages, qos={'/map': [LATCHED]})
    with hearing(probe, String, '/map', LATE) as maps, replaying(tmp_path, bag, *FAST) as process:
        assert process.wait() == 0
        probe.wait_for(lambda: len(maps) == 2)


def test_the_clock_shows_the_time_of_a_bag_that_has_none(probe, tmp_path) -> None:
    bag = mcap(tmp_path / 'a.mcap', texts('/chatter', 11, SECOND // 10, 10 * SECOND))
    with hearing(probe, Clock, '/clock') as received, \
            replaying_to(probe, tmp_path, bag, clock_rate=50.0) as process:
        assert process.wait() == 0
        # Times at which the machine had no time for the clock are left out.
        probe.wait_for(lambda: len(set(received)) >= 5, 'five times')
        shown = [nanoseconds(deserialize_message(data, Clock).clock) for data in list(received)]
    assert shown == sorted(shown)
    assert shown[0] >= 10 * SECOND and shown[-1] <= 11 * SECOND
    assert len(set(shown)) < 60     # 50 in this second, and at its ends and the pause


def test_a_clock_in_the_bag_is_the_only_one(probe, tmp_path) -> None:
    bag = rosbag2(tmp_path / 'bag', [
        (k * SECOND, '/clock', encode_clock(k * 1000)) for k in range(1, 11)],
        types={'/clock': 'rosgraph_msgs/msg/Clock'})
    with hearing(probe, Clock, '/clock') as received, \
            replaying(tmp_path, bag, *FAST, clock_rate=1000.0) as process:
        assert process.wait() == 0
        probe.wait_for(lambda: len(received) == 10)
        assert received == [data for _, data in of_topic(bag, '/clock')]


def test_clock_rate_0_leaves_the_clock_to_others(probe, tmp_path) -> None:
    bag = mcap(tmp_path / 'a.mcap', texts('/chatter', 3, SECOND // 10))
    with replaying(tmp_path, bag, '--loop', name='clockless', clock_rate=0.0):
        probe.some(String, '/chatter', 3)
        topics = probe.wait_for(lambda: '/chatter' in (
            found := probe.publishers_of('clockless')) and found, 'the topics')
        assert '/clock' not in topics


def test_types_that_are_not_installed_are_skipped_with_one_line(probe, tmp_path) -> None:
    bag = rosbag2(tmp_path / 'bag', sorted(texts('/chatter', 3, 10) + texts('/tf', 3, 10)
                                           + texts('/tf_static', 3, 10)),
                  types=dict.fromkeys(('/tf', '/tf_static'), 'tf2_msgs/msg/TFMessage'))
    if find_spec('tf2_msgs') is not None:
        pytest.skip('tf2_msgs is installed, so its messages are published')
    with hearing(probe, String, '/chatter') as received, replaying(tmp_path, bag) as process:
        assert process.wait() == 0
        probe.wait_for(lambda: len(received) == 3)
        lines = [line for line in process.stderr.splitlines() if 'skipping' in line]
    assert len(lines) == 1
    assert lines[0].endswith('skipping /tf, /tf_static: tf2_msgs/msg/TFMessage is not installed')


def test_another_version_of_a_type_is_skipped(probe, tmp_path) -> None:
    bag = mcap(tmp_path / 'a.mcap', texts('/chatter', 3, 10), type_hash='RIHS01_' + 64 * '0')
    with replaying(tmp_path, bag, subscriber_timeout=0.0) as process:
        assert process.wait() == 0
        assert 'skipping /chatter: std_msgs/msg/String was recorded in another' in process.stderr


def test_messages_in_another_encoding_are_skipped(probe, tmp_path) -> None:
    bag = mcap(tmp_path / 'a.mcap', texts('/chatter', 3, 10), encoding='json')
    with replaying(tmp_path, bag, subscriber_timeout=0.0) as process:
        assert process.wait() == 0
        assert "skipping /chatter: the messages are encoded as 'json'" in process.stderr


@pytest.mark.parametrize('topic, reason', [
    ('/not a name', 'that is no name of a ROS topic'),
    ('/replay/seek', 'that would steer this replay'),
])
def test_topics_that_cannot_be_published_are_skipped(probe, tmp_path, topic, reason) -> None:
    bag = mcap(tmp_path / 'a.mcap', texts(topic, 3, 10))
    with replaying(tmp_path, bag, subscriber_timeout=0.0) as process:
        assert process.wait() == 0
        assert f'skipping {topic}: {reason}' in process.stderr


def test_no_message_is_lost_to_a_subscriber_that_was_there(probe, tmp_path) -> None:
    bag = mcap(tmp_path / 'a.mcap', texts('/chatter', 200, 10))
    with hearing(probe, String, '/chatter', DEEP) as received, replaying(tmp_path, bag) as process:
        assert process.wait() == 0
        probe.wait_for(lambda: len(received) == 200)


def test_an_empty_bag_is_no_mistake(ros, tmp_path) -> None:
    process = replay(tmp_path, mcap(tmp_path / 'a.mcap', []), subscriber_timeout=0.0)
    assert process.wait() == 0


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('words', [[], ['--pause']])
def test_a_signal_ends_a_replay(probe, tmp_path, number, words) -> None:
    with replaying(tmp_path, shared_session(), '--loop', *words) as process:
        probe.wait_for(lambda: 'replaying' in process.stderr)
        process.signal(number)
        assert process.wait() == 0
