# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Joints on topics: what the node says of them, and what others tell them, is as in a World.

The simulation is paused for each test and stepped one step a call, so the test knows at which step
a message acts; the world beside it is told the same at the same step.
"""
from importlib.util import find_spec
import math
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from nodes.jointed import DESCRIPTION, jointed, PERIOD
from nodes.live import DEEP, nanoseconds, running
from nodes.replays import hearing, LATE, of_topic, replaying, texts_of
from nodes.scenes import world_of
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.verify import verify

ARM = '/rigid_sim/arm'
NAN = math.nan
TIMEOUT = 5 * PERIOD
ARM_JOINTS = ['shoulder', 'elbow', 'slide']


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    return jointed(tmp_path_factory.mktemp('scene'))


@pytest.fixture(scope='module')
def sim(probe, scene, tmp_path_factory):
    with running(tmp_path_factory.mktemp('sim'), str(scene), command_timeout=TIMEOUT,
                 diagnostics_rate=20.0, publish_joint_states=True, joint_wrenches='["arm/*"]',
                 publish_rate=1000.0, reset_time=True) as process:
        probe.pause(True)
        yield process


@pytest.fixture
def world(probe, sim, scene):
    """Put the simulation back to its start, paused, and give a world in the same state."""
    assert probe.pause(True).success
    assert probe.trigger('/rigid_sim/reset').success
    return world_of(scene)


def counts(probe):
    """Return what the inputs' diagnostics count."""
    message, = probe.some(DiagnosticArray, '/diagnostics')
    status = next(s for s in message.status if s.name.endswith('inputs'))
    return {v.key.removeprefix('refused: '): int(v.value) for v in status.values}


def send(probe, topic, message):
    """Publish what is taken, and wait until the simulation has it."""
    before = counts(probe)['joint messages accepted']
    probe.publish(topic, message)
    probe.wait_for(lambda: counts(probe)['joint messages accepted'] > before)


def states(probe, count, topic=f'{ARM}/joint_states', message=JointState):
    """Step one step a call and return a message of each."""
    with probe.listening(message, topic) as received:
        for _ in range(count):
            assert probe.trigger('/rigid_sim/step').success
        probe.wait_for(lambda: len(received) >= count, 'a message for each step')
        return received[:count]


def figures(state):
    return [list(state.position), list(state.velocity), list(state.effort)]


def same_in(world):
    """Step a world and return the figures of the arm's joints."""
    world.step()
    return [a[:3].tolist() for a in (world.joint_position, world.joint_velocity,
                                     world.joint_effort)]


def same(probe, world, count):
    """Step both; return whether all figures of all steps are the same, to the bit."""
    return [figures(s) for s in states(probe, count)] == [same_in(world) for _ in range(count)]


def state_of(name, **columns):
    return JointState(name=name, **columns)


def point(at, positions, velocities=(), accelerations=(), effort=()):
    return JointTrajectoryPoint(
        positions=positions, velocities=velocities, accelerations=accelerations, effort=effort,
        time_from_start=Duration(sec=int(at), nanosec=round(at % 1 * 1e9)))


def trajectory(names, *points, start=0.0):
    message = JointTrajectory(joint_names=names, points=points)
    message.header.stamp = Time(sec=int(start), nanosec=round(start % 1 * 1e9))
    return message


def test_the_joints_of_a_model_and_all_joints_are_told_as_a_world_has_them(probe, world):
    with probe.listening(JointState, '/joint_states') as everything:
        for state in states(probe, 3):
            assert state.name == ARM_JOINTS
            assert figures(state) == same_in(world)
            assert nanoseconds(state.header.stamp) == world.time_ns
        probe.wait_for(lambda: len(everything) >= 3)
    assert everything[2].name == [*(f'arm/{name}' for name in ARM_JOINTS), 'pivot']
    assert list(everything[2].position) == world.joint_position.tolist()


def test_joints_without_a_model_are_the_nodes_own(probe, world):
    state, = states(probe, 1, '/rigid_sim/joint_states')
    world.step()
    assert state.name == ['pivot']
    assert state.velocity[0] == world.joint_velocity[3]


def test_the_wrench_through_a_chosen_joint_is_published(probe, world):
    message, = states(probe, 1, f'{ARM}/shoulder/wrench', WrenchStamped)
    world.step()
    f, n = message.wrench.force, message.wrench.torque
    assert [f.x, f.y, f.z, n.x, n.y, n.z] == world.joint_wrench('arm/shoulder').tolist()
    assert message.header.frame_id == 'arm/shoulder'
    topics = probe.wait_for(lambda: probe.publishers_of('rigid_sim'))
    assert '/rigid_sim/pivot/wrench' not in topics


def test_a_late_subscriber_gets_the_description_of_a_model(probe, sim):
    assert probe.pause(False).success
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    probe.some(JointState, f'{ARM}/joint_states')   # it was published long ago
    received = []
    late = probe.node.create_subscription(String, f'{ARM}/robot_description', received.append,
                                          latched)
    probe.wait_for(lambda: received, 'the description')
    probe.node.destroy_subscription(late)
    assert received[0].data == DESCRIPTION


def test_each_joint_follows_what_is_filled_for_it(probe, world):
    send(probe, f'{ARM}/joint_commands', state_of(
        ARM_JOINTS, position=[0.5, NAN, NAN], velocity=[0.1, NAN, 0.3], effort=[NAN, NAN, 2.0]))
    world.set_joint_commands({
        'arm/shoulder': {'mode': 'position', 'position': 0.5, 'velocity': 0.1},
        'arm/slide': {'mode': 'velocity', 'velocity': 0.3, 'effort': 2.0}}, duration=TIMEOUT)
    assert same(probe, world, 4)


def test_a_command_of_efforts_alone_is_an_effort(probe, world):
    send(probe, f'{ARM}/joint_commands', state_of(['slide', 'elbow'], effort=[30.0, 1.0]))
    world.set_joint_command('arm/slide', 'effort', effort=30.0, duration=TIMEOUT)
    world.set_joint_command('arm/elbow', 'effort', effort=1.0, duration=TIMEOUT)
    assert same(probe, world, 4)


def test_a_drive_lets_go_when_its_controller_says_no_more(probe, world):
    send(probe, f'{ARM}/joint_commands', state_of(['shoulder'], position=[0.5]))
    efforts = [state.effort[0] for state in states(probe, 8)]
    assert all(efforts[:5])
    assert efforts[5:] == [0.0, 0.0, 0.0]


def test_joints_are_put_where_a_message_says_with_all_their_turns(probe, world):
    send(probe, f'{ARM}/set_joint_states', state_of(
        ['elbow', 'slide'], position=[7.0, NAN], velocity=[0.5, NAN]))
    world.set_joint_state('arm/elbow', 7.0, 0.5)
    state, = states(probe, 1)
    assert figures(state) == same_in(world)
    # The drive pulls it back to 0, but not by a turn within a step.
    assert state.position[1] > 7.0 - math.pi


def test_a_trajectory_is_followed_as_in_a_world(probe, world):
    names, points = ['elbow', 'shoulder'], [(0.01, [0.1, 0.3], [1.0, 2.0]),
                                            (0.02, [0.2, 0.4], [0.0, 0.0])]
    send(probe, f'{ARM}/joint_trajectory', trajectory(names, *(point(*one) for one in points)))
    world.follow_trajectory([f'arm/{name}' for name in names], [0.01, 0.02],
                            [one[1] for one in points], [one[2] for one in points])
    assert same(probe, world, 25)


def test_a_new_trajectory_takes_the_place_of_the_old_one(probe, world):
    send(probe, f'{ARM}/joint_trajectory', trajectory(
        ['shoulder', 'elbow'], point(0.05, [1.0, 1.0])))
    world.follow_trajectory(['arm/shoulder', 'arm/elbow'], [0.05], [[1.0, 1.0]])
    assert same(probe, world, 3)
    send(probe, f'{ARM}/joint_trajectory', trajectory(
        ['shoulder'], point(0.002, [0.25]), start=world.time_ns * 1e-9 + 0.001))
    world.follow_trajectory(['arm/shoulder'], [0.002], [[0.25]],
                            start=world.time_ns * 1e-9 + 0.001)
    assert same(probe, world, 6)


BAD = [
    ('joint_commands', state_of(['nobody'], position=[0.0]), 'unknown joint'),
    ('joint_commands', state_of([], position=[]), 'length'),
    ('joint_commands', state_of(['elbow'], position=[0.0, 1.0]), 'length'),
    ('joint_commands', state_of(['elbow', 'elbow'], position=[0.0, 1.0]), 'named twice'),
    ('joint_commands', state_of(['elbow'], velocity=[math.inf]), 'not finite'),
    ('joint_commands', state_of(['elbow', 'shoulder'], position=[0.1, 1.6]), 'limits'),
    ('joint_commands', state_of(['shoulder'], velocity=[-11.0]), 'no drive'),
    ('joint_commands', state_of(['shoulder'], position=[0.1], velocity=[-11.0]), 'limits'),
    ('joint_commands', state_of(['slide'], position=[0.1]), 'no drive'),
    ('joint_commands', state_of(['elbow'], position=[1e9]), 'impossible'),
    ('set_joint_states', state_of(['elbow'], velocity=[1.0]), 'not finite'),
    ('set_joint_states', state_of(['shoulder'], position=[2.0]), 'impossible'),
    ('set_joint_states', state_of(['elbow', 'shoulder'], position=[0.3, 2.0]), 'impossible'),
    ('joint_trajectory', trajectory(['nobody'], point(1.0, [0.0])), 'unknown joint'),
    ('joint_trajectory', trajectory(['elbow']), 'length'),
    ('joint_trajectory', trajectory(['elbow'], point(1.0, [])), 'length'),
    ('joint_trajectory', trajectory(['elbow'], point(1.0, [0.0], [0.0, 0.0])), 'length'),
    ('joint_trajectory', trajectory(['elbow'], point(1.0, [NAN])), 'not finite'),
    ('joint_trajectory', trajectory(['elbow'], point(1.0, [0.0], [NAN])), 'not finite'),
    ('joint_trajectory', trajectory(['elbow'], point(1.0, [0.0], effort=[1.0])), 'effort'),
    ('joint_trajectory', trajectory(['elbow'], point(1.0, [0.1]), point(1.0, [0.2])),
     'impossible'),
    ('joint_trajectory', trajectory(['slide'], point(1.0, [0.1])), 'impossible'),
    ('joint_trajectory', trajectory(['shoulder'], point(1.0, [1.6])), 'impossible'),
    ('joint_trajectory', trajectory(['elbow'], point(1.0, [0.1], [1.0])), 'impossible'),
]


@pytest.mark.parametrize('topic, message, reason', BAD)
def test_a_bad_message_is_refused_and_changes_nothing(probe, world, topic, message, reason):
    before = counts(probe)
    probe.publish(f'{ARM}/{topic}', message)
    probe.wait_for(lambda: counts(probe)['refused'] > before['refused'])
    assert counts(probe)[reason] == before.get(reason, 0) + 1
    assert same(probe, world, 2)


def test_a_session_in_which_joints_were_told_is_verified(probe, sim, tmp_path):
    """Everything that joints were told and said while the node ran freely."""
    assert probe.trigger('/rigid_sim/reset').success
    assert probe.set_parameter('bag_path', str(tmp_path / 'bag')).successful
    assert probe.trigger('/rigid_sim/start_recording').success
    assert probe.pause(False).success
    send(probe, f'{ARM}/joint_trajectory', trajectory(
        ['shoulder', 'elbow'], point(0.2, [0.5, 1.0], [0.0, 0.0], [0.0, 0.0])))
    send(probe, f'{ARM}/joint_commands', state_of(['slide', 'elbow'], velocity=[0.1, NAN],
                                                  position=[]))
    send(probe, '/rigid_sim/set_joint_states', state_of(['pivot'], position=[0.3]))
    probe.some(JointState, f'{ARM}/joint_states', 300, DEEP)
    assert probe.trigger('/rigid_sim/stop_recording').success
    verdict = verify(tmp_path / 'bag')
    assert verdict.holds, str(verdict.difference)
    assert not verdict.others


def test_a_replay_says_of_joints_what_was_recorded(probe, scene, tmp_path):
    world = world_of(scene)
    batch = Batch(world, tmp_path / 'bag', node='/lab')
    batch.run(200)
    batch.close()
    recorded = [data for _, data in of_topic(tmp_path / 'bag', '/lab/arm/joint_states')]
    with hearing(probe, JointState, '/lab/arm/joint_states') as heard, \
            hearing(probe, String, '/lab/arm/robot_description', LATE) as descriptions, \
            replaying(tmp_path, tmp_path / 'bag', '--loop'):
        probe.wait_for(lambda: set(recorded) <= set(heard), 'all joint states')
        probe.wait_for(lambda: descriptions, 'the description')
    assert set(heard) == set(recorded)
    assert texts_of(descriptions[:1]) == [DESCRIPTION]
