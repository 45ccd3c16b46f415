# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A kinematic body that other nodes move carries what lies on it, recorded and verified."""
from importlib.util import find_spec
import json
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from carrying import crate, floor, UPRIGHT, world_of
from geometry_msgs.msg import Point, PoseStamped, Quaternion, TwistStamped, Vector3
from nodes.live import running
import pytest
from sensor_msgs.msg import MultiDOFJointState

from rigid_sim_ros.bag.verify import verify

BODIES = [floor(), crate()]


@pytest.fixture
def sim(probe, tmp_path):
    """Run the scene, paused before its first step and recorded; give the folder of the bag."""
    scene = {'world': {'step': 1e-3}, 'bodies': BODIES, 'materials': {
        'default': {'friction': 0.5, 'restitution': 0.0, 'stiffness': 2e4}}}
    (tmp_path / 'scene.yaml').write_text(json.dumps(scene), encoding='utf-8')
    with running(tmp_path / 'sim', str(tmp_path / 'scene.yaml'), bag_path=str(tmp_path / 'bag'),
                 record=True):
        assert probe.pause(True).success
        assert probe.trigger('/rigid_sim/reset').success
        yield tmp_path / 'bag'


def steps(probe, count):
    """Take steps and return the state after the last one."""
    for _ in range(count):
        with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:
            assert probe.trigger('/rigid_sim/step').success
            probe.wait_for(lambda: states)
    return states[-1]


def told(probe, topic, message):
    """Publish what a paused simulation takes in, and wait until it has."""
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:
        probe.publish(f'/rigid_sim/floor/{topic}', message)
        probe.wait_for(lambda: states)


def test_twists_and_poses_on_topics_move_it_as_they_move_a_world(probe, sim):
    world = world_of('timestep', *BODIES)
    twist, pose = TwistStamped(), PoseStamped()
    twist.twist.linear = Vector3(x=0.2, y=0.0, z=0.0)
    told(probe, 'set_twist', twist)
    steps(probe, 3)
    told(probe, 'set_twist', TwistStamped())
    world.set_twist('floor', (0.2, 0, 0), (0, 0, 0))
    world.step(3)
    world.set_twist('floor', (0, 0, 0), (0, 0, 0))
    pose.pose.orientation = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
    for k in range(3):
        position = (1e-3 * (k + 1), 0.0, -0.5)
        pose.pose.position = Point(**dict(zip('xyz', position, strict=True)))
        told(probe, 'set_pose', pose)
        state = steps(probe, 2)
        world.set_pose('floor', position, UPRIGHT)
        world.step(2)
    for k in range(2):
        p, v = state.transforms[k].translation, state.twist[k].linear
        assert [p.x, p.y, p.z] == world.position[k].tolist()
        assert [v.x, v.y, v.z] == world.linear_velocity[k].tolist()
    assert world.linear_velocity[1, 0] > 0.0
    assert probe.trigger('/rigid_sim/stop_recording').success
    assert verify(sim).holds
