# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Start the node `replay`.

    ros2 launch rigid_sim_ros replay.launch.py bag:=session
    ros2 launch rigid_sim_ros replay.launch.py bag:=session rate:=0.5 loop:=true

`ros2 launch rigid_sim_ros replay.launch.py --show-args` lists the arguments. When the node ends,
so does the launch, unless another launch file includes this one, or `ends_launch` says otherwise.
"""
from typing import Any

from launch import LaunchDescription  # type: ignore[attr-defined]
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from rigid_sim_ros.nodes.launching import ends_launch

ARGUMENTS = {
    'bag': ('', 'folder of a ROS 2 bag; empty: what the parameters say'),
    'rate': ('', 'seconds of the bag per second'),
    'loop': ('false', 'whether to begin again at the end'),
    'start': ('', 'where to begin [s]'),
    'duration': ('', 'how much to play [s]; empty: to the end'),
    'topics': ('', 'names or patterns, separated by blanks; empty: all topics'),
    'pause': ('false', 'whether to begin paused'),
    'params_file': ('', 'ROS parameter file, see msg_config/replay.yaml; empty: the defaults'),
    'ends_launch': ('', 'whether the launch ends with the node; empty: if this file was launched '
                    'by itself, and not included by another'),
    'name': ('replay', 'name of the node'),
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
    words = [given['bag']] if given['bag'] else []
    for name in ('rate', 'start', 'duration'):
        words += [f'--{name}', given[name]] if given[name] else []
    for pattern in given['topics'].split():
        words += ['--topics', pattern]
    words += [f'--{name}' for name in ('loop', 'pause') if given[name].lower() in ('true', '1')]
    return [Node(
        package='rigid_sim_ros',
        executable='replay',
        name=given['name'],
        namespace=given['namespace'],
        arguments=words,
        parameters=[given['params_file']] if given['params_file'] else [],
        output='screen',
        # None for nothing: launch fails with an empty list.
        on_exit=[Shutdown()] if ends_launch(given['ends_launch'], __file__) else None,
    )]
