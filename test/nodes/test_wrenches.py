# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Wrenches from other nodes do what World.apply_wrench does, to the bit.

The simulation is paused for each test, so that the test knows at which step a wrench arrives, and
stepped one step a call. The world beside it gets the same wrenches at the same steps.
"""
from importlib.util import find_spec
import math
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from nodes.live import nanoseconds, running
from nodes.scenes import crates, world_of
import pytest
from sensor_msgs.msg import MultiDOFJointState

FORCE, TORQUE = (1.0, -2.0, 3.0), (0.3, 0.1, -0.2)
TIMEOUT = 0.004     # s: four steps


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    return crates(tmp_path_factory.mktemp('scene'))


@pytest.fixture(scope='module')
def sim(probe, scene, tmp_path_factory):
    with running(tmp_path_factory.mktemp('sim'), str(scene), wrench_timeout=TIMEOUT,
                 frame_id='map', diagnostics_rate=20.0):
        probe.pause(True)
        yield


@pytest.fixture
def world(probe, sim, scene):
    """Put the simulation back to its start, paused, and give a world in the same state."""
    assert probe.pause(True).success
    assert probe.trigger('/rigid_sim/reset').success
    return world_of(scene)


def wrench(force=FORCE, torque=TORQUE):
    return Wrench(force=Vector3(**dict(zip('xyz', force, strict=True))),
                  torque=Vector3(**dict(zip('xyz', torque, strict=True))))


def stamped(frame_id='', force=FORCE, torque=TORQUE):
    message = WrenchStamped(wrench=wrench(force, torque))
    message.header.frame_id = frame_id
    return message


def many(names, wrenches, frame_id=''):
    message = MultiDOFJointState(joint_names=names, wrench=wrenches)
    message.header.frame_id = frame_id
    return message


def send(probe, topic, message, body='crate'):
    """Publish a wrench and return its echo: then it is in effect."""
    with probe.listening(WrenchStamped, f'/rigid_sim/{body}/applied_wrench') as echoes:
        probe.publish(f'/rigid_sim/{topic}', message)
        probe.wait_for(lambda: echoes, f'the echo of {topic}')
        return echoes[0]


def step_both(probe, world, count):
    """Step simulation and world; return both states as lists."""
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:
        for _ in range(count):
            assert probe.trigger('/rigid_sim/step').success
        world.step(count)
        probe.wait_for(lambda: len(states) >= count, 'a state for each step')
    twists = [(t.linear, t.angular) for t in states[-1].twist]
    measured = [[v.x, v.y, v.z, w.x, w.y, w.z] for v, w in twists]
    expected = [[*v, *w] for v, w in zip(
        world.linear_velocity.tolist(), world.angular_velocity.tolist(), strict=True)]
    return measured, expected


def refused(probe):
    """Return what the inputs' diagnostics count, by reason."""
    message, = probe.some(DiagnosticArray, '/diagnostics')
    status = next(s for s in message.status if s.name.endswith('inputs'))
    return {v.key.removeprefix('refused: '): int(v.value) for v in status.values}


@pytest.mark.parametrize('frame_id, frame', [
    ('', 'world'), ('world', 'world'), ('map', 'world'), ('crate', 'crate'),
    ('crate/handle', 'crate/handle'), ('ball', 'ball'),
])
def test_a_wrench_acts_in_the_axes_and_at_the_point_of_its_frame(probe, world, frame_id, frame):
    send(probe, 'crate/wrench', stamped(frame_id))
    world.apply_wrench('crate', FORCE, TORQUE, frame, duration=TIMEOUT)
    measured, expected = step_both(probe, world, 3)
    assert measured == expected


def test_a_wrench_holds_for_the_timeout_in_simulation_time(probe, world):
    send(probe, 'crate/wrench', stamped())
    world.apply_wrench('crate', FORCE, TORQUE, duration=TIMEOUT)
    before = world.linear_momentum[0]
    measured, expected = step_both(probe, world, 10)
    # Four steps of the force and not one more; first order in nothing, the force is constant.
    assert world.linear_momentum[0] - before == pytest.approx(
        [TIMEOUT * f for f in FORCE], rel=1e-12)
    assert measured == expected


def test_the_next_message_on_the_topic_replaces_a_wrench(probe, world):
    send(probe, 'crate/wrench', stamped())
    send(probe, 'crate/wrench', stamped(force=(0.0, 0.0, 5.0)))
    world.apply_wrench('crate', (0.0, 0.0, 5.0), TORQUE, duration=TIMEOUT)
    measured, expected = step_both(probe, world, 3)
    assert measured == expected


def test_a_wrench_of_zero_ends_one_before_its_time(probe, world):
    send(probe, 'crate/wrench', stamped())
    send(probe, 'crate/wrench', stamped(force=(0.0,) * 3, torque=(0.0,) * 3))
    measured, expected = step_both(probe, world, 3)
    assert measured == expected


def test_wrenches_of_different_topics_add_up(probe, world):
    send(probe, 'crate/wrench', stamped('crate'))
    send(probe, 'wrenches', many(['crate'], [wrench((0.0, 4.0, 0.0))]))
    world.apply_wrench('crate', FORCE, TORQUE, 'crate', duration=TIMEOUT)
    world.apply_wrench('crate', (0.0, 4.0, 0.0), TORQUE, duration=TIMEOUT)
    measured, expected = step_both(probe, world, 3)
    assert measured == expected


def test_one_message_drives_several_bodies_from_the_same_step(probe, world):
    send(probe, 'wrenches', many(['ball', 'crate'], [wrench((2.0, 0.0, 0.0)), wrench()]))
    world.apply_wrench('ball', (2.0, 0.0, 0.0), TORQUE, duration=TIMEOUT)
    world.apply_wrench('crate', FORCE, TORQUE, duration=TIMEOUT)
    measured, expected = step_both(probe, world, 1)
    assert measured == expected


def test_one_message_may_name_a_body_twice(probe, world):
    send(probe, 'wrenches', many(['crate', 'crate'], [wrench(), wrench((0.0, 0.0, 9.0))]))
    world.apply_wrench('crate', FORCE, TORQUE, duration=TIMEOUT)
    world.apply_wrench('crate', (0.0, 0.0, 9.0), TORQUE, duration=TIMEOUT)
    measured, expected = step_both(probe, world, 1)
    assert measured == expected


def test_a_new_message_of_wrenches_replaces_everything_of_the_one_before(probe, world):
    send(probe, 'wrenches', many(['ball', 'crate'], [wrench(), wrench()]))
    send(probe, 'wrenches', many(['crate'], [wrench((0.0, 0.0, 9.0))]))
    world.apply_wrench('crate', (0.0, 0.0, 9.0), TORQUE, duration=TIMEOUT)
    measured, expected = step_both(probe, world, 3)
    assert measured == expected


def test_the_echo_has_the_time_of_the_step_from_which_a_wrench_acts(probe, world):
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:
        assert probe.trigger('/rigid_sim/step').success
        probe.wait_for(lambda: states)
    world.step(1)
    echo = send(probe, 'crate/wrench', stamped('crate/handle'))
    assert nanoseconds(echo.header.stamp) == nanoseconds(states[-1].header.stamp)
    assert echo.header.frame_id == 'crate/handle'
    assert echo.wrench == wrench()


def test_the_echo_of_a_wrench_without_a_frame_names_the_world(probe, world):
    assert send(probe, 'crate/wrench', stamped()).header.frame_id == 'map'


NAN, INFINITY = math.nan, math.inf
BAD = [
    ('crate/wrench', stamped(force=(NAN, 0.0, 0.0)), 'not finite'),
    ('crate/wrench', stamped(torque=(0.0, INFINITY, 0.0)), 'not finite'),
    ('crate/wrench', stamped('nowhere'), 'unknown frame'),
    ('crate/wrench', stamped('crate/nowhere'), 'unknown frame'),
    ('wrenches', many(['crate', 'nobody'], [wrench(), wrench()]), 'unknown body'),
    ('wrenches', many(['crate'], [wrench(), wrench()]), 'length'),
    ('wrenches', many(['crate', 'ball'], [wrench(), wrench((NAN,) * 3)]), 'not finite'),
    ('wrenches', many(['crate'], [wrench()], 'nowhere'), 'unknown frame'),
]


@pytest.mark.parametrize('topic, message, reason', BAD)
def test_a_bad_wrench_is_refused_and_counted(probe, world, topic, message, reason):
    before = refused(probe)
    probe.publish(f'/rigid_sim/{topic}', message)
    probe.wait_for(lambda: refused(probe)['refused'] > before['refused'])
    after = refused(probe)
    assert after[reason] == before.get(reason, 0) + 1
    measured, expected = step_both(probe, world, 3)
    assert measured == expected


def test_a_refused_wrench_leaves_the_one_in_effect(probe, world):
    send(probe, 'crate/wrench', stamped())
    before = refused(probe)['refused']
    probe.publish('/rigid_sim/crate/wrench', stamped('nowhere'))
    probe.wait_for(lambda: refused(probe)['refused'] > before)
    world.apply_wrench('crate', FORCE, TORQUE, duration=TIMEOUT)
    measured, expected = step_both(probe, world, 3)
    assert measured == expected


def test_bytes_that_are_no_wrench_do_no_harm(probe, world):
    publisher = probe.node.create_publisher(WrenchStamped, '/rigid_sim/crate/wrench', 10)
    probe.wait_for(publisher.get_subscription_count)
    for junk in (b'', b'\x00\x01\x00\x00abc', b'\x00\x01\x00\x00' + b'\xff' * 90):
        publisher.publish(junk)
    measured, expected = step_both(probe, world, 3)
    probe.node.destroy_publisher(publisher)
    assert measured == expected
