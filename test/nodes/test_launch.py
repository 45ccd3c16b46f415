# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The launch file starts the installed node with its arguments, where launch is installed."""
from importlib.util import find_spec
import sys
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')
if find_spec('launch_ros') is None:
    raise SkipTest('launch_ros is not installed: it is not among the ROS wheels, use ROS from apt')

from ament_index_python import get_packages_with_prefixes
from nodes.live import kept, Process, ROOT
from nodes.scenes import crates
import pytest
from sensor_msgs.msg import MultiDOFJointState

if 'rigid_sim_ros' not in get_packages_with_prefixes():
    raise SkipTest('rigid_sim_ros is not in the ament index: colcon build, and source its setup')

LAUNCH = """
import sys
from launch import LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

file, *arguments = sys.argv[1:]
service = LaunchService()
service.include_launch_description(IncludeLaunchDescription(
    PythonLaunchDescriptionSource(file),
    launch_arguments=[argument.split(':=') for argument in arguments]))
sys.exit(service.run())
"""


def launch(folder, *arguments):
    file = str(ROOT / 'launch' / 'simulate.launch.py')
    return kept(Process([sys.executable, '-c', LAUNCH, file, *arguments], folder))


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    return str(crates(tmp_path_factory.mktemp('scene')))


def test_the_scene_and_the_name_are_arguments(probe, tmp_path, scene):
    with launch(tmp_path, f'scene:={scene}', 'name:=launched', 'namespace:=lab'):
        state, = probe.some(MultiDOFJointState, '/lab/launched/state')
    assert state.joint_names == ['crate', 'ball', 'ground']


def test_the_parameter_file_is_an_argument(probe, tmp_path, scene):
    file = tmp_path / 'parameters.yaml'
    file.write_text('/**: {ros__parameters: {frame_id: map}}', encoding='utf-8')
    with launch(tmp_path, f'scene:={scene}', 'name:=with_file', f'params_file:={file}'):
        state, = probe.some(MultiDOFJointState, '/with_file/state')
    assert state.header.frame_id == 'map'


def test_the_launch_ends_with_the_node(ros, tmp_path, scene):
    with launch(tmp_path, f'scene:={scene}', 'duration:=0.1') as process:
        assert process.wait() == 0
