# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Start the node `simulate`.

    ros2 launch rigid_sim_ros simulate.launch.py scene:=tumbling_cubesat
    ros2 launch rigid_sim_ros simulate.launch.py scene:=/path/scene.yaml params_file:=my.yaml
    ros2 launch rigid_sim_ros simulate.launch.py duration:=10 record:=session

`ros2 launch rigid_sim_ros simulate.launch.py --show-args` lists the arguments. When the node ends,
so does the launch.
"""
from typing import Any

from launch import LaunchDescription  # type: ignore[attr-defined]
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = {
    'scene': ('', 'path of a scene file or name of an example; empty: what the parameters say'),
    'params_file': ('', 'ROS parameter file, see msg_config/default.yaml; empty: the defaults'),
    'duration': ('', 'stop after so many seconds of simulation time; empty: run until Ctrl-C'),
    'record': ('', 'record into this new folder; empty: what the parameters say'),
    'name': ('rigid_sim', 'name of the node, and so of its topics: two sims need two names'),
    'namespace': ('', 'namespace of the node'),
}


def generate_launch_description() -> LaunchDescription:
    """Return the arguments and the node."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()]
    return LaunchDescription([*arguments, OpaqueFunction(function=_node)])


def _node(context: Any) -> list[Node]:
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    words = [given['scene']] if given['scene'] else []
    if given['duration']:
        words += ['--duration', given['duration']]
    if given['record']:
        words += ['--record', given['record']]
    return [Node(
        package='rigid_sim_ros',
        executable='simulate',
        name=given['name'],
        namespace=given['namespace'],
        arguments=words,
        parameters=[given['params_file']] if given['params_file'] else [],
        output='screen',
        on_exit=Shutdown(),
    )]
