# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags of other tools with whatever numbers, names and times: plots and films show what can be."""

from itertools import count

from bag.foreign import rosbag2
import numpy as np
import pytest

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.motion import read_motion
from rigid_sim_ros.bag.topics import typestore
from rigid_sim_ros.messages.codec import encode_string
from rigid_sim_ros.plots.command import make_diagram
from rigid_sim_ros.plots.panels import OF_SCENE
from rigid_sim_ros.plots.picture import write_picture

TYPES = typestore().types
STATE, POSE = 'sensor_msgs/msg/MultiDOFJointState', 'geometry_msgs/msg/PoseStamped'
ODOMETRY = 'nav_msgs/msg/Odometry'
NAN, INF = float('nan'), float('inf')
EXTREME = [NAN, INF, -INF, 1e308, -1e308, 1e160, 5e-324, 0.0]
SCENE = """
format: 1
bodies:
  - {name: x, mass: 1.0, shape: {type: sphere, radius: 1.0}}
  - {name: y, mass: 1.0, shape: {type: box, size: [1, 1, 1]}}
"""


def made(kind, **fields):
    return TYPES[kind](**fields)


def header(t_ns):
    return made('std_msgs/msg/Header', frame_id='world', stamp=made(
        'builtin_interfaces/msg/Time', sec=t_ns // 10 ** 9, nanosec=t_ns % 10 ** 9))


def vector(x, kind='Vector3'):
    return made(f'geometry_msgs/msg/{kind}', x=x, y=0.0, z=-x)


def turn(w):
    return made('geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=0.0, w=w)


def state(t_ns, names, numbers, w=1.0):
    """Return a state of some bodies at places, which are their velocities too."""
    return bytes(typestore().serialize_cdr(made(
        STATE, header=header(t_ns), joint_names=list(names), wrench=[],
        transforms=[made('geometry_msgs/msg/Transform', translation=vector(x), rotation=turn(w))
                    for x in numbers],
        twist=[made('geometry_msgs/msg/Twist', linear=vector(x), angular=vector(x))
               for x in numbers]), STATE))


def pose(t_ns, x):
    return bytes(typestore().serialize_cdr(made(
        POSE, header=header(t_ns), pose=made('geometry_msgs/msg/Pose', orientation=turn(1.0),
                                             position=vector(x, 'Point'))), POSE))


def bag_of(folder, *messages):
    """Return a bag of messages, each a topic, its type and the bytes."""
    stamps = count(10 ** 9)
    return rosbag2(folder / 'bag', [(next(stamps), topic, data) for topic, _, data in messages],
                   types={topic: kind for topic, kind, _ in messages})


def extreme_states(w=1.0):
    return [('/a/state', STATE, state(1 + 10 ** 7 * k, 'xy', np.roll(EXTREME, k)[:2], w))
            for k in range(2 * len(EXTREME))]


@pytest.mark.filterwarnings('error')
def test_numbers_that_cannot_be_drawn_are_left_out_and_told_of(tmp_path):
    diagram, notes = make_diagram(str(bag_of(tmp_path, *extreme_states())), (), (), 0.0, None)
    assert sum('are left out' in note for note in notes) == 1
    write_picture(diagram, tmp_path / 'a.png')
    assert all(np.nanmax(np.abs(line.y)) < 1e200 for panel in diagram.panels
               for line in panel.lines if np.isfinite(line.y).any())


def with_scene(folder, w):
    return bag_of(folder, ('/a/scene', 'std_msgs/msg/String', encode_string(SCENE)),
                  *extreme_states(w))


@pytest.mark.parametrize('w', [1.0, 0.0, NAN, 1e300, 1e-300])
def test_of_a_body_that_is_drawn_a_pose_is_there_as_a_whole_or_not_at_all(tmp_path, w):
    motion = read_motion(with_scene(tmp_path, w))
    there = np.isfinite(motion.position).all(axis=2)
    assert (np.isfinite(motion.orientation).all(axis=2) == there).all()
    assert there.any() == (w == 1.0)


@pytest.mark.filterwarnings('error')
def test_energies_are_those_of_the_numbers_that_can_be_drawn(tmp_path):
    diagram, _ = make_diagram(str(with_scene(tmp_path, 1.0)), (), OF_SCENE, 0.0, None)
    write_picture(diagram, tmp_path / 'a.png')


def odometry(t_ns, turned, x):
    pose = made('geometry_msgs/msg/Pose', position=vector(1.0, 'Point'), orientation=made(
        'geometry_msgs/msg/Quaternion', **dict(zip('xyzw', turned, strict=True))))
    twist = made('geometry_msgs/msg/Twist', linear=vector(x), angular=vector(0.0))
    return bytes(typestore().serialize_cdr(made(
        ODOMETRY, header=header(t_ns), child_frame_id='',
        pose=made('geometry_msgs/msg/PoseWithCovariance', pose=pose, covariance=np.zeros(36)),
        twist=made('geometry_msgs/msg/TwistWithCovariance', twist=twist,
                   covariance=np.zeros(36))), ODOMETRY))


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('turned, known', [
    ((0, 0, 0, 0), True), ((0, 0, 0, 2), True), ((0, 0, 1e-200, 0), False),
    ((1e200, 1e200, 0, 0), False), ((NAN, 0, 0, 1), False), ((0, INF, 0, 1), False)])
def test_a_twist_in_axes_that_nobody_knows_is_left_out(tmp_path, turned, known):
    turned = tuple(map(float, turned))
    motion = read_motion(bag_of(tmp_path, *[
        ('/a/odom', ODOMETRY, odometry(1 + k, turned, x)) for k, x in enumerate([1.0, 1e300])]))
    assert np.isfinite(motion.linear_velocity[:, 0, 0]).tolist() == [known, False]


def test_bodies_that_have_little_to_do_with_each_other_are_refused_before_they_fill_the_memory(
        tmp_path):
    many = [('/a/state', STATE, state(1 + k, [f'{k} {j}' for j in range(40)], np.zeros(40)))
            for k in range(400)]
    with pytest.raises(BagError, match='more than can be shown together'):
        read_motion(bag_of(tmp_path, *many))


def test_poses_at_times_of_their_own_too(tmp_path):
    many = [(f'/r{k % 300}/pose', POSE, pose(1 + k, 1.0)) for k in range(18000)]
    with pytest.raises(BagError, match='300 bodies at 18000 times'):
        read_motion(bag_of(tmp_path, *many))
