# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A program that launches a file, for tests where launch is installed."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('launch_ros') is None:
    raise SkipTest('launch_ros is not installed: it is not among the ROS wheels, use ROS from apt')

from ament_index_python import get_packages_with_prefixes

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
