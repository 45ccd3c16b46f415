# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the node publishes: topics, types, QoS, and that the figures are those of a World."""
from importlib.util import find_spec
from itertools import pairwise
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from nodes.live import nanoseconds, running
from nodes.scenes import crates, world_of
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import String, UInt64
from visualization_msgs.msg import Marker, MarkerArray

from rigid_sim_ros.nodes.parameters import default_parameters
from rigid_sim_ros.world import World

PUBLISHED = {
    '/clock': 'rosgraph_msgs/msg/Clock',
    '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    '/rigid_sim/markers': 'visualization_msgs/msg/MarkerArray',
    '/rigid_sim/scene': 'std_msgs/msg/String',
    '/rigid_sim/state': 'sensor_msgs/msg/MultiDOFJointState',
    '/rigid_sim/state_hash': 'std_msgs/msg/UInt64',
    **{f'/rigid_sim/{body}/{topic}': f'geometry_msgs/msg/{message}'
       for body in ('crate', 'ball')
       for topic, message in (('pose', 'PoseStamped'), ('twist', 'TwistStamped'),
                              ('applied_wrench', 'WrenchStamped'))},
}
SUBSCRIBED = {
    '/rigid_sim/wrenches': 'sensor_msgs/msg/MultiDOFJointState',
    **{f'/rigid_sim/{body}/{topic}': f'geometry_msgs/msg/{message}'
       for body in ('crate', 'ball')
       for topic, message in (('wrench', 'WrenchStamped'), ('set_pose', 'PoseStamped'),
                              ('set_twist', 'TwistStamped'))},
}


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    return crates(tmp_path_factory.mktemp('scene'))


@pytest.fixture(scope='module')
def sim(probe, scene, tmp_path_factory):
    # ground gets no topics; the scene of fast hashes, so that one need not be waited for
    with running(tmp_path_factory.mktemp('sim'), str(scene), bodies='[crate, "b*"]',
                 hash_interval=100, frame_id='map',
                 **{'qos.twist.reliability': 'best_effort', 'qos.twist.depth': 7}) as process:
        probe.some(MultiDOFJointState, '/rigid_sim/state')
        yield process


def published_by(probe):
    return probe.publishers_of('rigid_sim')


def steps(message) -> int:
    t_ns = nanoseconds(message.header.stamp)
    assert t_ns % 1_000_000 == 0
    return t_ns // 1_000_000


def test_every_topic_is_published_with_its_type(probe, sim):
    probe.wait_for(lambda: PUBLISHED.keys() <= published_by(probe).keys())
    topics = published_by(probe)
    assert {name: [kind] for name, kind in PUBLISHED.items()}.items() <= topics.items()
    assert topics.keys() - PUBLISHED.keys() <= {'/rosout', '/parameter_events'}


def test_every_input_is_subscribed_to_with_its_type(probe, sim):
    probe.wait_for(lambda: SUBSCRIBED.keys() <= probe.subscriptions_of('rigid_sim').keys())
    expected = {name: [kind] for name, kind in SUBSCRIBED.items()}
    assert expected.items() <= probe.subscriptions_of('rigid_sim').items()


def test_the_services_are_there(probe, sim):
    expected = {
        '/rigid_sim/pause': ['std_srvs/srv/SetBool'],
        '/rigid_sim/step': ['std_srvs/srv/Trigger'],
        '/rigid_sim/reset': ['std_srvs/srv/Trigger'],
    }
    probe.wait_for(lambda: expected.keys() <= probe.services_of('rigid_sim').keys())
    assert expected.items() <= probe.services_of('rigid_sim').items()


def test_only_the_chosen_bodies_have_topics_of_their_own(probe, sim):
    probe.wait_for(lambda: PUBLISHED.keys() <= published_by(probe).keys())
    assert not [topic for topic in published_by(probe) if 'ground' in topic]
    state, = probe.some(MultiDOFJointState, '/rigid_sim/state')
    assert state.joint_names == ['crate', 'ball', 'ground']


@pytest.mark.parametrize('kind, topic', [
    ('pose', '/rigid_sim/crate/pose'), ('applied_wrench', '/rigid_sim/crate/applied_wrench'),
    ('state', '/rigid_sim/state'), ('markers', '/rigid_sim/markers'),
    ('scene', '/rigid_sim/scene'), ('state_hash', '/rigid_sim/state_hash'),
    ('clock', '/clock'), ('diagnostics', '/diagnostics'), ('wrench', '/rigid_sim/crate/wrench'),
    ('wrenches', '/rigid_sim/wrenches'), ('set_pose', '/rigid_sim/crate/set_pose'),
    ('set_twist', '/rigid_sim/crate/set_twist'),
])
def test_the_qos_of_a_topic_is_that_of_the_defaults_file(probe, sim, kind, topic):
    defaults = default_parameters()
    publishes = topic in PUBLISHED
    look = (probe.node.get_publishers_info_by_topic if publishes
            else probe.node.get_subscriptions_info_by_topic)
    end, = probe.wait_for(lambda: [e for e in look(topic) if e.node_name == 'rigid_sim'])
    qos = end.qos_profile
    assert qos.reliability.name.lower() == defaults[f'qos.{kind}.reliability']
    assert qos.durability.name.lower() == defaults[f'qos.{kind}.durability']


def test_the_qos_of_a_topic_follows_its_parameters(probe, sim):
    end, = probe.wait_for(
        lambda: probe.node.get_publishers_info_by_topic('/rigid_sim/crate/twist'))
    assert end.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT


def test_poses_are_those_of_a_world_to_the_bit(probe, sim, scene):
    world = World(world_of(scene).scene)
    for message in probe.some(PoseStamped, '/rigid_sim/crate/pose', 20):
        world.step(steps(message) - world.step_index)
        p, q = message.pose.position, message.pose.orientation
        assert [p.x, p.y, p.z] == world.position[0].tolist()
        assert [q.x, q.y, q.z, q.w] == world.orientation[0].tolist()


def test_twists_are_those_of_a_world_to_the_bit(probe, sim, scene):
    world = world_of(scene)
    qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    for message in probe.some(TwistStamped, '/rigid_sim/crate/twist', 20, qos=qos):
        world.step(steps(message) - world.step_index)
        v, w = message.twist.linear, message.twist.angular
        assert [v.x, v.y, v.z] == world.linear_velocity[0].tolist()
        assert [w.x, w.y, w.z] == world.angular_velocity[0].tolist()


def test_the_state_is_that_of_a_world_to_the_bit(probe, sim, scene):
    world = world_of(scene)
    for message in probe.some(MultiDOFJointState, '/rigid_sim/state', 20):
        world.step(steps(message) - world.step_index)
        for k, (pose, twist) in enumerate(zip(message.transforms, message.twist, strict=True)):
            p, q, v, w = pose.translation, pose.rotation, twist.linear, twist.angular
            assert [p.x, p.y, p.z] == world.position[k].tolist()
            assert [q.x, q.y, q.z, q.w] == world.orientation[k].tolist()
            assert [v.x, v.y, v.z] == world.linear_velocity[k].tolist()
            assert [w.x, w.y, w.z] == world.angular_velocity[k].tolist()


def test_the_rate_is_that_of_the_parameter_in_simulation_time(probe, sim):
    stamps = [steps(m) for m in probe.some(PoseStamped, '/rigid_sim/crate/pose', 30)]
    assert all(stamp % 10 == 0 for stamp in stamps)
    assert [b - a for a, b in pairwise(stamps)] == [10] * 29


def test_hashes_are_those_of_a_world(probe, sim, scene):
    received = [m.data for m in probe.some(UInt64, '/rigid_sim/state_hash', 3)]
    later, = probe.some(MultiDOFJointState, '/rigid_sim/state')
    world = world_of(scene)
    expected = [world.state_hash()]
    while world.step_index < steps(later) and received[-1] not in expected:
        world.step(100)
        expected.append(world.state_hash())
    assert expected[-3:] == received


def test_every_message_names_the_frame_of_the_parameter(probe, sim):
    state, = probe.some(MultiDOFJointState, '/rigid_sim/state')
    pose, = probe.some(PoseStamped, '/rigid_sim/crate/pose')
    markers, = probe.some(MarkerArray, '/rigid_sim/markers')
    assert {state.header.frame_id, pose.header.frame_id,
            *(m.header.frame_id for m in markers.markers)} == {'map'}


def test_a_late_subscriber_gets_the_scene_in_effect(probe, sim, scene):
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    with probe.listening(PoseStamped, '/rigid_sim/crate/pose') as poses:
        probe.wait_for(lambda: poses)       # the scene was published long ago
    received = []
    late = probe.node.create_subscription(String, '/rigid_sim/scene', received.append, latched)
    probe.wait_for(lambda: received, 'the scene')
    probe.node.destroy_subscription(late)
    assert received[0].data == world_of(scene).scene.text


def test_the_clock_runs_with_the_steps_and_never_backwards(probe, sim):
    clocks = [nanoseconds(m.clock) for m in probe.some(Clock, '/clock', 50)]
    assert [b - a for a, b in pairwise(clocks)] == [10_000_000] * 49


def test_markers_stand_where_the_bodies_are(probe, sim, scene):
    message, = probe.some(MarkerArray, '/rigid_sim/markers')
    markers = {m.ns: m for m in message.markers}
    assert markers.keys() == {'crate', 'ball', 'ground'}
    world = world_of(scene, steps(markers['crate']))
    crate, ball = markers['crate'], markers['ball']
    assert (crate.type, ball.type) == (Marker.CUBE, Marker.SPHERE)
    assert [crate.scale.x, crate.scale.y, crate.scale.z] == [0.4, 0.3, 0.2]
    assert [ball.scale.x, ball.scale.y, ball.scale.z] == [0.2, 0.2, 0.2]
    p = crate.pose.position
    assert [p.x, p.y, p.z] == world.position[0].tolist()
    q = crate.pose.orientation
    assert [q.x, q.y, q.z, q.w] == world.orientation[0].tolist()


def test_diagnostics_tell_pace_inputs_and_physics(probe, sim, scene):
    message, = probe.some(DiagnosticArray, '/diagnostics')
    parts = {s.name: {v.key: v.value for v in s.values} for s in message.status}
    assert {'/rigid_sim: pace', '/rigid_sim: inputs', '/rigid_sim: physics'} <= parts.keys()
    assert {'real-time factor', 'overruns', 'lateness worst [us]', 'steps per second',
            'step thread CPU share [%]'} <= parts['/rigid_sim: pace'].keys()
    assert parts['/rigid_sim: inputs']['refused'] == '0'
    world = world_of(scene)
    physics = parts['/rigid_sim: physics']
    # Free motion without gravity keeps energy and momentum; nine digits are shown.
    assert float(physics['kinetic energy [J]']) == pytest.approx(world.kinetic_energy(), rel=1e-8)
    for axis, value in zip('xyz', world.total_momentum(), strict=True):
        shown = float(physics[f'momentum {axis} [kg m/s]'])
        assert shown == pytest.approx(value, rel=1e-8, abs=1e-12)
