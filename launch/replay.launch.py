# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Start the node `replay`.

    ros2 launch rigid_sim_ros replay.launch.py bag:=session
    ros2 launch rigid_sim_ros replay.launch.py bag:=session rate:=0.5 loop:=true

`ros2 launch rigid_sim_ros replay.launch.py --show-args` lists the arguments. When the node ends,
so does the launch, unless another launch file includes this one, or `ends_launch` says otherwise.
"""
from itertools import pairwise
import os
from pathlib import Path
import sys
from typing import Any

from launch import LaunchDescription  # type: ignore[attr-defined]
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

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
        on_exit=_ending(given),
    )]


def _ending(given: dict[str, str]) -> list[Shutdown] | None:
    """Return what happens when the node ends; None, for launch fails with an empty list."""
    ends = (given['ends_launch'].lower() in ('true', '1') if given['ends_launch']
            else _is_launched(sys.argv))
    return [Shutdown()] if ends else None


def _is_launched(words: list[str]) -> bool:
    """Return whether a command line names this file, not another one of that name."""
    return any(
        (package, word) == ('rigid_sim_ros', Path(__file__).name)
        or (os.path.exists(word) and os.path.samefile(word, __file__))
        for package, word in pairwise(words))
