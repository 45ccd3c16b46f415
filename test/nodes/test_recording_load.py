# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Nothing is lost of what the node records: under load, at a gap, and when it is killed."""
from functools import cache
from importlib.util import find_spec
import random
import signal
import threading
import time
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from bag.sessions import messages_of
from effort import either
from geometry_msgs.msg import PoseStamped, TwistStamped
from nodes.live import kept, simulate
from nodes.scenes import crates, free_bodies, world_of
import pytest
from rclpy.node import Node
from sensor_msgs.msg import MultiDOFJointState

from rigid_sim_ros.bag import recorder as recorder_module, topics as kinds
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.info import info
from rigid_sim_ros.bag.recover import recover
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.bag.writer import BagWriter
from rigid_sim_ros.nodes.parameters import default_parameters
from rigid_sim_ros.nodes.publishers import Publishers
from rigid_sim_ros.nodes.qos import profiles
from rigid_sim_ros.nodes.recording import Recording

BODIES = 100
SECONDS = either(2, 8)
LISTENED = {'state': MultiDOFJointState, 'body_0/pose': PoseStamped, 'body_50/twist': TwistStamped,
            'body_99/pose': PoseStamped}

# [ns] What the contract allows to be lost before a kill.
MOST_LOST = 1_000_000_000


@pytest.fixture(scope='module')
def loaded(probe, tmp_path_factory):
    """Record 100 bodies at 1 kHz while all is published; return the bag and what was heard."""
    folder = tmp_path_factory.mktemp('loaded')
    heard = {topic: [] for topic in LISTENED}
    subscriptions = [
        probe.subscribe(message, f'/loaded/{topic}', heard[topic].append, raw=True)
        for topic, message in LISTENED.items()]
    deep = {f'qos.{topic}.depth': 10_000 for topic in ('state', 'pose', 'twist')}
    process = simulate(folder, str(free_bodies(folder, BODIES)), name='loaded', words=[
        '--duration', str(SECONDS), '--record', str(folder / 'bag')], paused=True, **deep)
    with kept(process):
        assert probe.pause(False, '/loaded').success    # it knows who listens
        assert process.wait() == 0
    probe.wait_for(lambda: all(
        messages and bytes(messages[-1]) == recorded(folder / 'bag', topic)[-1]
        for topic, messages in heard.items()), 'the last message on every topic')
    for subscription in subscriptions:
        probe.node.destroy_subscription(subscription)
    return folder / 'bag', heard


@cache
def recorded(bag, topic):
    """Return what a bag holds on a topic of the node `loaded`."""
    return [data for kind in (kinds.STATE, kinds.POSE, kinds.TWIST)
            for name, _, data in messages_of(bag, kind) if name == f'/loaded/{topic}']


@pytest.mark.long
@pytest.mark.parametrize('topic', LISTENED)
def test_the_recorded_bytes_are_those_that_a_subscriber_gets(loaded, topic):
    bag, heard = loaded
    received = [bytes(data) for data in heard[topic]]
    # All but perhaps the first one, of before the subscription was known to the node.
    assert len(received) >= 100 * SECONDS
    assert received == recorded(bag, topic)[-len(received):]


@pytest.mark.long
def test_every_publication_is_recorded_and_there_is_no_gap(loaded):
    found = info(loaded[0])
    assert found.gaps == ()
    # At 100 Hz, and once at the start.
    counts = {found.topics[f'/loaded/body_{k}/{kind}'][1]
              for k in range(BODIES) for kind in ('pose', 'twist')}
    assert counts == {100 * SECONDS + 1} == {found.topics['/loaded/state'][1]}


@pytest.mark.long
def test_what_was_recorded_under_load_comes_out_again(loaded):
    verdict = verify(loaded[0])
    assert (verdict.difference, verdict.faults, verdict.steps) == (None, (), 1000 * SECONDS)


@pytest.mark.long
@pytest.mark.parametrize('storage, kills', [('mcap', either(2, 8)), ('sqlite3', 2)])
def test_a_kill_of_the_node_at_any_moment_loses_at_most_a_second(probe, tmp_path, storage, kills):
    scene, chance = str(crates(tmp_path)), random.Random(11)
    for k in range(kills):
        bag = tmp_path / f'bag{k}'
        heard = []      # times at which states came, and their bytes
        subscription = probe.subscribe(
            MultiDOFJointState, f'/victim{k}/state',
            lambda data, heard=heard: heard.append((time.time_ns(), bytes(data))), raw=True)
        with kept(simulate(tmp_path / f'log{k}', scene, name=f'victim{k}', record=True,
                           bag_path=bag, bag_storage=storage,
                           bag_segment_duration=(0.7, 60.0)[k % 2])) as process:
            probe.wait_for(lambda: heard, 'a state')    # noqa: B023
            time.sleep(0.3 + chance.uniform(0.0, 1.5))
            process.signal(signal.SIGKILL)
            killed_ns = time.time_ns()
            assert process.wait() == -signal.SIGKILL
        probe.node.destroy_subscription(subscription)
        # What was heard a second before the kill was published then. On a busy machine the node
        # may have published nothing in that second, and then the bag ends before it.
        needed = {data for at_ns, data in heard if at_ns <= killed_ns - MOST_LOST}
        try:
            recover(bag)
        except BagError as error:       # nothing was flushed yet
            assert 'no message' in str(error)
            assert not needed
            continue
        assert needed <= {data for _, _, data in messages_of(bag, kinds.STATE)}
        verdict = verify(bag)
        assert (verdict.difference, verdict.faults, verdict.gaps) == (None, (), 0)
        assert verdict.note == 'the recording was cut off'


def test_a_disk_that_stands_still_makes_a_gap_that_is_logged_and_shown(
        ros, tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(recorder_module, 'REAL_TIME_QUEUE', 20_000)
    stands_still, write = threading.Event(), BagWriter.write

    def stalled(writer, *args):
        stands_still.wait()
        write(writer, *args)
    monkeypatch.setattr(BagWriter, 'write', stalled)
    world, parameters = world_of(crates(tmp_path)), default_parameters()
    node = Node('gap')
    publishers = Publishers(node, world, range(len(world.names)), parameters,
                            profiles(parameters))
    recording = Recording(node, world, publishers, {
        **parameters, 'bag_path': str(tmp_path / 'bag')})
    recording.create()
    recording.begin()
    for _ in range(100):
        world.step(10)
        publishers.publish_state(world)
        recording.turn()
    assert recording.status().lost_messages > 0
    world.reset()
    stands_still.set()
    recorder = recording._recorder
    for _ in range(3):
        recorder.wait_for_room()
        recording.turn()
        world.step(10)
        publishers.publish_state(world)
    recording.close()
    node.destroy_node()
    said = capfd.readouterr().err
    assert 'does not keep up' in said
    assert 'ends at' in said
    assert (recording.status().gaps, recording.status().lost_events) == (1, 1)
    verdict = verify(tmp_path / 'bag')
    assert verdict.holds
    assert verdict.gaps == 1
