# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Start the node `simulate`.

    ros2 launch rigid_sim_ros simulate.launch.py scene:=tumbling_cubesat
    ros2 launch rigid_sim_ros simulate.launch.py scene:=/path/scene.yaml params_file:=my.yaml
    ros2 launch rigid_sim_ros simulate.launch.py duration:=10 record:=session
    ros2 launch rigid_sim_ros simulate.launch.py scene:=tower rviz:=true

`ros2 launch rigid_sim_ros simulate.launch.py --show-args` lists the arguments. When the node ends,
so does the launch, with RViz; when RViz is closed, the node goes on.

Another launch file may include this one, more than once: with different names, and publish_clock
false for all but one. Such a launch goes on when a node ends, unless `ends_launch` says otherwise.
Launch hands the arguments of one inclusion, such as `record`, on to the next ones that do not
give their own: put each into a GroupAction.
"""
from pathlib import Path
from typing import Any

from ament_index_python import get_package_share_directory, get_packages_with_prefixes
from launch import LaunchDescription  # type: ignore[attr-defined]
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from rigid_sim_ros.nodes.launching import ends_launch

ARGUMENTS = {
    'scene': ('', 'path of a scene file or name of an example; empty: what the parameters say'),
    'params_file': ('', 'ROS parameter file, see msg_config/default.yaml; empty: the defaults'),
    'duration': ('', 'stop after so many seconds of simulation time; empty: run until Ctrl-C'),
    'record': ('', 'record into this new folder; empty: what the parameters say'),
    'name': ('rigid_sim', 'name of the node, and so of its topics: two sims need two names'),
    'namespace': ('', 'namespace of the node'),
    'ends_launch': ('', 'whether the launch ends with the node; empty: if this file was launched '
                    'by itself, and not included by another'),
    'rviz': ('false', 'whether to open RViz too, with msg_config/rigid_sim.rviz'),
}
_MARKERS = '/rigid_sim/markers'     # as the RViz configuration has it


def generate_launch_description() -> LaunchDescription:
    """Return the arguments and the node."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])


def _nodes(context: Any) -> list[Node]:
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    words = [given['scene']] if given['scene'] else []
    if given['duration']:
        words += ['--duration', given['duration']]
    if given['record']:
        words += ['--record', given['record']]
    is_shown = given['rviz'].lower() in ('true', '1')
    return [*([_rviz(given)] if is_shown else []), Node(
        package='rigid_sim_ros',
        executable='simulate',
        name=given['name'],
        namespace=given['namespace'],
        arguments=words,
        parameters=[given['params_file']] if given['params_file'] else [],
        output='screen',
        # None for nothing: launch fails with an empty list.
        on_exit=[Shutdown()] if ends_launch(given['ends_launch'], __file__) else None,
    )]


def _rviz(given: dict[str, str]) -> Node:
    """Return RViz with the markers of the node, whatever its name."""
    if 'rviz2' not in get_packages_with_prefixes():
        raise RuntimeError('rviz:=true needs RViz: apt install ros-$ROS_DISTRO-rviz2')
    node = '/'.join(['', *filter(None, [given['namespace'].strip('/'), given['name']])])
    config = Path(get_package_share_directory('rigid_sim_ros')) / 'msg_config' / 'rigid_sim.rviz'
    return Node(
        package='rviz2',
        executable='rviz2',
        arguments=['-d', str(config)],
        parameters=[{'use_sim_time': True}],
        remappings=[(_MARKERS, f'{node}/markers')],
    )
