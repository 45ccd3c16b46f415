# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A session recorded live, with everything that can happen, comes out again to the bit."""
from importlib.util import find_spec
import signal
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from bag.sessions import events_of, messages_of, rewrite, session_of
from geometry_msgs.msg import PoseStamped, TwistStamped, Vector3, Wrench, WrenchStamped
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from nodes.live import running
from nodes.scenes import crates
import pytest
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import MultiDOFJointState

from rigid_sim_ros import cli
from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.info import info
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.bag.verify import verify

NODE = '/rec'


def wrench(x: float, frame: str = '') -> WrenchStamped:
    message = WrenchStamped()
    message.header.frame_id = frame
    message.wrench.force.x = x
    message.wrench.torque.z = 0.1 * x
    return message


def wrenches(*names: str) -> MultiDOFJointState:
    message = MultiDOFJointState(joint_names=list(names))
    message.wrench = [Wrench(force=Vector3(y=0.3 + k)) for k in range(len(names))]
    return message


def set_pose() -> PoseStamped:
    message = PoseStamped()
    message.pose.position.x = 3.25
    message.pose.orientation.y = message.pose.orientation.w = 0.5 ** 0.5
    return message


def set_twist() -> TwistStamped:
    message = TwistStamped()
    message.twist.linear.z = 0.7
    message.twist.angular.x = -2.0
    return message


def let_pass(probe, publications: int = 20) -> None:
    """Let so many publications of the state go by."""
    probe.some(MultiDOFJointState, f'{NODE}/state', publications)


def push(probe, topic: str, message) -> None:
    """Send a wrench to the crate or all bodies, and wait for its echo."""
    with probe.listening(WrenchStamped, f'{NODE}/crate/applied_wrench') as echoes:
        probe.publish(f'{NODE}/{topic}', message)
        probe.wait_for(lambda: echoes, f'the echo of {topic}')


def drive(probe) -> None:
    """Let everything happen to the node that can."""
    let_pass(probe)
    push(probe, 'crate/wrench', wrench(1.0, 'crate/handle'))
    push(probe, 'wrenches', wrenches('crate', 'ball', 'crate'))
    push(probe, 'crate/wrench', wrench(-2.5))
    let_pass(probe)
    probe.publish(f'{NODE}/ball/set_pose', set_pose())
    push(probe, 'wrenches', wrenches('ball', 'crate'))
    assert probe.trigger(f'{NODE}/reset').success
    let_pass(probe)
    assert probe.pause(True, NODE).success
    for _ in range(3):
        assert probe.trigger(f'{NODE}/step').success
    with probe.listening(MultiDOFJointState, f'{NODE}/state') as states:
        probe.publish(f'{NODE}/crate/set_twist', set_twist())
        probe.wait_for(lambda: states, 'the state with the new twist')
    assert probe.pause(False, NODE).success
    assert probe.set_parameter('real_time_factor', 3.0, NODE).successful
    push(probe, 'crate/wrench', wrench(0.5, 'ball'))
    let_pass(probe, 80)
    assert probe.set_parameter('reset_time', True, NODE).successful
    assert probe.trigger(f'{NODE}/reset').success
    assert probe.set_parameter('wrench_timeout', 0.05, NODE).successful
    push(probe, 'crate/wrench', wrench(4.0))
    assert probe.set_parameter('real_time_factor', 0.0, NODE).successful
    let_pass(probe, 200)
    assert probe.set_parameter('real_time_factor', 1.0, NODE).successful
    let_pass(probe, 60)


@pytest.fixture(scope='module')
def session(probe, tmp_path_factory):
    """Record such a session in several files and return the bag."""
    folder = tmp_path_factory.mktemp('session')
    bag = folder / 'bag'
    with running(folder, str(crates(folder)), name='rec', words=['--record', str(bag)],
                 bag_segment_duration=0.2, hash_interval=100) as process:
        drive(probe)
        process.signal(signal.SIGINT)
        assert process.wait() == 0
    return bag


def exit_code(*args: object) -> int:
    with pytest.raises(SystemExit) as leaving:
        cli.main([str(arg) for arg in args])
    return leaving.value.code


def test_it_comes_out_again_to_the_bit(session):
    verdict = verify(session)
    assert (verdict.difference, verdict.faults, verdict.gaps, verdict.note) == (None, (), 0, '')
    assert exit_code('verify', session) == 0


def test_everything_that_happened_is_in_it(session):
    assert {event.kind for event in events_of(session)} == {
        'apply_wrench', 'cancel_wrenches', 'set_pose', 'set_twist', 'reset', 'pause', 'resume',
        'step', 'speed', 'parameter', 'written', 'end'}


def test_it_lies_in_several_files_and_has_no_gap(session):
    found = info(session)
    assert found.files >= 4     # the states alone that are waited for take 1.2 s
    assert found.gaps == ()
    assert found.is_closed


def test_wrenches_tell_their_sources_frames_and_how_long_they_hold(session):
    told = [event.arguments for event in events_of(session) if event.kind == 'apply_wrench']
    assert {given['source'] for given in told} == {
        'crate/wrench', 'wrenches[0]', 'wrenches[1]', 'wrenches[2]'}
    assert {given['frame'] for given in told} == {'world', 'crate/handle', 'ball'}
    assert {given['duration'] for given in told} == {0.5, 0.05}


def test_all_that_is_published_is_recorded(session):
    counts = {name: count for name, (_, count) in info(session).topics.items()}
    for topic in ('/clock', '/diagnostics', f'{NODE}/state', f'{NODE}/state_hash',
                  f'{NODE}/markers', f'{NODE}/crate/pose', f'{NODE}/ball/twist',
                  f'{NODE}/crate/applied_wrench', f'{NODE}/scene'):
        assert counts[topic] > 0, topic


def test_it_tells_the_parameters(session):
    parameters = session_of(session).parameters
    assert (parameters['hash_interval'], parameters['wrench_timeout']) == (100, 0.5)


@pytest.mark.parametrize('kind, offset', [
    (kinds.POSE, -1), (kinds.TWIST, -8), (kinds.STATE, -12), (kinds.APPLIED_WRENCH, -48),
    (kinds.EVENT, -60), (kinds.STATE_HASH, -1)])
def test_one_changed_byte_fails_with_1_although_the_checksums_fit(
        session, tmp_path, kind, offset):
    seen = []

    def change(topic, data):
        if topic.kind != kind:
            return data
        seen.append(topic)
        if len(seen) != 5:
            return data
        return data[:offset] + bytes([data[offset] ^ 1]) + data[len(data) + offset + 1:]
    assert exit_code('verify', rewrite(session, tmp_path, change)) == 1


@pytest.mark.parametrize('kind', [kinds.POSE, kinds.APPLIED_WRENCH])
def test_one_changed_byte_in_the_file_itself_fails_with_1(session, tmp_path, kind):
    copy = tmp_path / 'bag'
    copy.mkdir()
    _, _, data = messages_of(session, kind)[3]
    changed = 0
    for path in session.iterdir():
        raw = bytearray(path.read_bytes())
        place = raw.find(data) if path.suffix == '.mcap' and not changed else -1
        if place >= 0:
            raw[place + len(data) - 1] ^= 0x10
            changed += 1
        (copy / path.name).write_bytes(raw)
    assert changed == 1
    assert exit_code('verify', copy) == 1


def test_rosbags_reads_every_message(session):
    with AnyReader([session]) as reader:
        read = [reader.deserialize(data, connection.msgtype) is not None
                for connection, _, data in reader.messages()]
        assert len(read) == reader.message_count
    assert len(read) == sum(1 for _ in BagReader(session).messages())


def test_the_mcap_library_decodes_every_message(session):
    topics = set()
    for path in sorted(session.glob('*.mcap')):
        with path.open('rb') as file:
            reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
            decoded = [channel.topic for _, channel, _, _ in reader.iter_decoded_messages()]
            assert len(decoded) == reader.get_summary().statistics.message_count
            topics |= set(decoded)
    assert {'/diagnostics', f'{NODE}/markers', f'{NODE}/crate/pose'} <= topics
