# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The launch file starts the installed node with its arguments, where launch is installed."""
from importlib.util import find_spec
import os
from pathlib import Path
import sys
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from ament_index_python import get_packages_with_prefixes
from nodes.launching import LAUNCH    # skips this too where there is no launch
from nodes.live import kept, Process, ROOT
from nodes.scenes import crates
import pytest
from sensor_msgs.msg import MultiDOFJointState


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
    # Launch returns 0 whatever the node did.
    assert 'process has finished cleanly' in (tmp_path / 'stdout').read_text(encoding='utf-8')


def test_a_launch_that_includes_the_file_twice_goes_on_when_one_node_ends(probe, tmp_path, scene):
    file = ROOT / 'launch' / 'simulate.launch.py'
    parent = tmp_path / 'parent.launch.py'
    parent.write_text(f"""
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource


def generate_launch_description():
    return LaunchDescription([
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource({str(file)!r}),
            launch_arguments={{'scene': {scene!r}, **words}}.items())
        for words in ({{'name': 'short', 'duration': '0.1'}},
                      {{'name': 'long', 'duration': '600'}})])
""", encoding='utf-8')
    with kept(Process([sys.executable, '-c', LAUNCH, str(parent)], tmp_path)) as process:
        out = tmp_path / 'stdout'
        probe.wait_for(lambda: 'process has finished cleanly' in out.read_text(encoding='utf-8'))
        probe.some(MultiDOFJointState, '/long/state')
        assert process.is_running()


@pytest.fixture
def rviz(monkeypatch, tmp_path):
    """Put a program that writes down its arguments in the place of RViz."""
    prefix = tmp_path / 'prefix'
    packages = prefix / 'share' / 'ament_index' / 'resource_index' / 'packages'
    packages.mkdir(parents=True)
    (packages / 'rviz2').touch()
    program = prefix / 'lib' / 'rviz2' / 'rviz2'
    program.parent.mkdir(parents=True)
    said = tmp_path / 'said'
    program.write_text(f'#!/bin/sh\necho "$@" > {said}\nexec sleep 600\n', encoding='utf-8')
    program.chmod(0o755)
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{prefix}:{os.environ["AMENT_PREFIX_PATH"]}')
    return said


def test_rviz_shows_the_markers_of_this_node_and_ends_with_it(probe, rviz, tmp_path, scene):
    with launch(tmp_path, f'scene:={scene}', 'name:=seen', 'namespace:=lab', 'duration:=1.0',
                'rviz:=true') as process:
        assert process.wait() == 0
    words = rviz.read_text(encoding='utf-8').split()
    config, = (Path(word) for word in words if word.endswith('rigid_sim.rviz'))
    assert words[0] == '-d'
    assert 'Value: /rigid_sim/markers' in config.read_text(encoding='utf-8')
    assert '/rigid_sim/markers:=/lab/seen/markers' in words


def test_without_rviz_the_launch_says_what_to_install(probe, tmp_path, scene):
    if 'rviz2' in get_packages_with_prefixes():
        pytest.skip('RViz is installed')
    with launch(tmp_path, f'scene:={scene}', 'rviz:=true') as process:
        process.wait()
    said = (tmp_path / 'stdout').read_text(encoding='utf-8') + process.stderr
    assert 'rviz:=true needs RViz: apt install ros-$ROS_DISTRO-rviz2' in said
