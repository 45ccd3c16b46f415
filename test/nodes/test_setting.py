# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Poses and twists set by other nodes, and the services pause, step and reset."""
from importlib.util import find_spec
import math
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, PoseStamped, Quaternion, TwistStamped, Vector3, WrenchStamped
from nodes.live import nanoseconds, running
from nodes.scenes import crates, world_of
import numpy as np
import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import MultiDOFJointState

POSITION, ORIENTATION = [4.0, 5.0, 6.0], [0.5, -0.5, 0.5, 0.5]
LINEAR, ANGULAR = [-1.0, 0.5, 0.25], [2.0, 0.0, -1.0]


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    return crates(tmp_path_factory.mktemp('scene'))


@pytest.fixture(scope='module')
def sim(probe, scene, tmp_path_factory):
    with running(tmp_path_factory.mktemp('sim'), str(scene), diagnostics_rate=20.0):
        yield


@pytest.fixture
def world(probe, sim, scene):
    """Put the simulation back to its start, paused, and give a world in the same state."""
    probe.set_parameter('reset_time', False)
    assert probe.pause(True).success
    assert probe.trigger('/rigid_sim/reset').success
    return world_of(scene)


def pose(position=POSITION, orientation=ORIENTATION, frame_id=''):
    message = PoseStamped()
    message.header.frame_id = frame_id
    message.pose.position = Point(**dict(zip('xyz', position, strict=True)))
    message.pose.orientation = Quaternion(**dict(zip('xyzw', orientation, strict=True)))
    return message


def twist(linear=LINEAR, angular=ANGULAR, frame_id=''):
    message = TwistStamped()
    message.header.frame_id = frame_id
    message.twist.linear = Vector3(**dict(zip('xyz', linear, strict=True)))
    message.twist.angular = Vector3(**dict(zip('xyz', angular, strict=True)))
    return message


def stamps(states):
    return [nanoseconds(state.header.stamp) for state in states]


def time_in(answer):
    """Return the time [ns] that the answer of a service tells."""
    return round(float(answer.split()[-2]) * 1e9)


def numbers(state, body=0):
    """Return position, orientation, linear and angular velocity of a body as lists."""
    p, q = state.transforms[body].translation, state.transforms[body].rotation
    v, w = state.twist[body].linear, state.twist[body].angular
    return [[p.x, p.y, p.z], [q.x, q.y, q.z, q.w], [v.x, v.y, v.z], [w.x, w.y, w.z]]


def numbers_of(world, body=0):
    return [world.position[body].tolist(), world.orientation[body].tolist(),
            world.linear_velocity[body].tolist(), world.angular_velocity[body].tolist()]


def send(probe, topic, message):
    """Publish, and return the state that the paused simulation then shows."""
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:
        probe.publish(f'/rigid_sim/{topic}', message)
        probe.wait_for(lambda: states, f'the state after {topic}')
        return states[-1]


def step(probe):
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:
        answer = probe.trigger('/rigid_sim/step')
        assert answer.success, answer.message
        probe.wait_for(lambda: states)
        return states[-1]


def refused(probe, reason):
    message, = probe.some(DiagnosticArray, '/diagnostics')
    status = next(s for s in message.status if s.name.endswith('inputs'))
    values = {v.key: int(v.value) for v in status.values}
    return values.get(f'refused: {reason}', 0)


def test_set_pose_moves_a_body_and_keeps_its_twist(probe, world):
    world.set_pose('crate', POSITION, ORIENTATION)
    state = numbers(send(probe, 'crate/set_pose', pose()))
    assert state == numbers_of(world)
    # The twist goes through momenta about the centre of mass and back: a few roundings.
    assert state[2] == pytest.approx([0.1, 0.2, -0.3], rel=1e-13)
    assert state[3] == pytest.approx([0.3, -0.2, 0.5], rel=1e-13)


def test_what_follows_a_set_pose_is_what_a_world_does(probe, world):
    send(probe, 'crate/set_pose', pose())
    world.set_pose('crate', POSITION, ORIENTATION)
    world.step(1)
    assert numbers(step(probe)) == numbers_of(world)


def test_set_twist_changes_the_twist_and_keeps_the_pose(probe, world):
    before = numbers_of(world)
    state = numbers(send(probe, 'crate/set_twist', twist()))
    world.set_twist('crate', LINEAR, ANGULAR)
    assert state == numbers_of(world)
    # The pose goes through the central frame and back: a few roundings of numbers below 4.
    assert np.concatenate(state[:2]) == pytest.approx(np.concatenate(before[:2]), abs=2e-15)


def test_a_quaternion_with_the_rounding_of_float32_is_normalised(probe, world):
    rough = [0.5 * (1.0 + 1e-7), -0.5, 0.5, 0.5]
    state = numbers(send(probe, 'crate/set_pose', pose(orientation=rough)))
    assert math.hypot(*state[1]) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize('topic, message, reason', [
    ('crate/set_pose', pose(orientation=[0.0, 0.0, 0.0, 0.0]), 'quaternion'),
    ('crate/set_pose', pose(orientation=[1.0, 1.0, 0.0, 0.0]), 'quaternion'),
    ('crate/set_pose', pose(position=[math.nan, 0.0, 0.0]), 'not finite'),
    ('crate/set_pose', pose(orientation=[math.nan] * 4), 'not finite'),
    ('crate/set_pose', pose(frame_id='ball'), 'unknown frame'),
    ('crate/set_twist', twist(angular=[0.0, math.inf, 0.0]), 'not finite'),
    ('crate/set_twist', twist(frame_id='nowhere'), 'unknown frame'),
    ('ground/set_twist', twist(), 'impossible'),
    ('crate/set_pose', pose(position=[0.0, 0.0, 1e308]), 'impossible'),
    ('crate/set_twist', twist(linear=[1e308, 0.0, 0.0]), 'impossible'),
    ('crate/set_twist', twist(angular=[0.0, 1e308, 0.0]), 'impossible'),
])
def test_a_bad_pose_or_twist_is_refused_and_counted(probe, world, topic, message, reason):
    before = refused(probe, reason)
    probe.publish(f'/rigid_sim/{topic}', message)
    probe.wait_for(lambda: refused(probe, reason) == before + 1)
    world.step(1)
    assert numbers(step(probe)) == numbers_of(world)


def test_a_pause_stops_time_and_its_end_lets_it_go_on(probe, world):
    before = nanoseconds(step(probe).header.stamp)
    assert nanoseconds(step(probe).header.stamp) == before + 1_000_000
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:
        assert probe.pause(False).success
        probe.wait_for(lambda: len(states) > 10)
    assert probe.pause(True).success
    probe.some(DiagnosticArray, '/diagnostics', 10)         # the state of the pause has arrived
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:
        probe.some(DiagnosticArray, '/diagnostics', 10)     # half a second
        assert states == []


def test_a_pause_shows_its_moment_and_a_step_the_next(probe, world):
    # Once in 0.1 s: the pause falls on a step that is not published anyway, or hardly ever does.
    probe.set_parameter('publish_rate', 10.0)
    try:
        with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:
            for _ in range(3):
                before = len(states)
                assert probe.pause(False).success
                # Else the pause may fall on the step that was shown last.
                probe.wait_for(lambda before=before: len(states) > before)
                paused = probe.pause(True).message
                stepped = probe.trigger('/rigid_sim/step').message
                last = [time_in(paused), time_in(stepped)]
                probe.wait_for(lambda last=last: stamps(states)[-2:] == last)
                assert time_in(stepped) == time_in(paused) + 1_000_000
            assert len(set(stamps(states))) == len(states)
    finally:
        probe.set_parameter('publish_rate', 100.0)


def test_a_step_is_refused_while_the_simulation_runs(probe, world):
    assert probe.pause(False).success
    answer = probe.trigger('/rigid_sim/step')
    assert not answer.success
    assert 'pause' in answer.message


def test_a_pause_twice_is_no_mistake(probe, world):
    assert probe.pause(True).message.startswith('already paused')


def test_reset_restores_what_moved(probe, world, scene):
    send(probe, 'crate/set_pose', pose())
    send(probe, 'ball/set_twist', twist())
    step(probe)
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:
        assert probe.trigger('/rigid_sim/reset').success
        probe.wait_for(lambda: states)
    assert [numbers(states[-1], k) for k in range(3)] == [
        numbers_of(world_of(scene), k) for k in range(3)]


def test_reset_ends_the_wrenches_in_effect(probe, world):
    message = WrenchStamped()
    message.wrench.force.x = 100.0
    with probe.listening(WrenchStamped, '/rigid_sim/crate/applied_wrench') as echoes:
        probe.publish('/rigid_sim/crate/wrench', message)
        probe.wait_for(lambda: echoes)
    assert probe.trigger('/rigid_sim/reset').success
    world.step(1)
    assert numbers(step(probe)) == numbers_of(world)


def test_reset_does_not_turn_the_clock_back(probe, world):
    before = nanoseconds(step(probe).header.stamp)
    with probe.listening(Clock, '/clock') as clocks:
        assert probe.trigger('/rigid_sim/reset').success
        probe.wait_for(lambda: clocks)
    assert nanoseconds(clocks[-1].clock) == before


def test_reset_turns_the_clock_back_where_reset_time_says_so(probe, world):
    step(probe)
    assert probe.set_parameter('reset_time', True).successful
    with probe.listening(Clock, '/clock') as clocks:
        assert probe.trigger('/rigid_sim/reset').success
        probe.wait_for(lambda: clocks)
    assert nanoseconds(clocks[-1].clock) == 0


def test_what_is_done_to_the_simulation_is_logged(probe, scene, tmp_path):
    with running(tmp_path, str(scene), name='told', publish_clock=False) as process:
        assert probe.pause(True, '/told').success
        assert probe.trigger('/told/reset').success
        assert probe.pause(False, '/told').success
        assert probe.set_parameter('real_time_factor', 2.0, '/told').successful
        for text in ('paused at ', 'reset ', 'resumed at ', 'parameter real_time_factor: 2.0'):
            probe.wait_for(lambda text=text: f'[told]: {text}' in process.stderr)
