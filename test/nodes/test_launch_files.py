# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the launch files hand to launch, which the ROS wheels do not have: to stand-ins for it."""
from pathlib import Path
import runpy
import sys
from types import ModuleType, SimpleNamespace

import pytest

ROOT = Path(__file__).parents[2]
FILES = ['simulate', 'replay']
# What launch takes for "nothing" where something may happen when a process ends: given an empty
# list, launch 3.4.3 fails when the process ends, and with it all that it has launched.
NOTHING = None


class Stand(SimpleNamespace):
    """Keeps what it is made with."""

    def __init__(self, *args, **options):
        super().__init__(args=args, **options)

    def perform(self, context):
        return context[self.args[0]]


@pytest.fixture
def node(monkeypatch):
    """Return what gives the node of a launch file, by its name and the words of a command."""
    parts = {
        'launch': ['LaunchDescription'],
        'launch.actions': ['DeclareLaunchArgument', 'OpaqueFunction', 'Shutdown'],
        'launch.substitutions': ['LaunchConfiguration'],
        'launch_ros': [], 'launch_ros.actions': ['Node'],
        'ament_index_python': ['get_package_share_directory', 'get_packages_with_prefixes']}
    for name, kinds in parts.items():
        module = ModuleType(name)
        for kind in kinds:
            setattr(module, kind, type(kind, (Stand,), {}))
        monkeypatch.setitem(sys.modules, name, module)

    def make(name, words, **given):
        monkeypatch.setattr(sys, 'argv', words)
        file = runpy.run_path(str(ROOT / 'launch' / f'{name}.launch.py'))
        *arguments, action = file['generate_launch_description']().args[0]
        context = {argument.args[0]: argument.default_value for argument in arguments}
        return action.function({**context, **given})[-1]

    return make


@pytest.mark.parametrize('name', FILES)
def test_the_launch_ends_with_the_node_of_the_file_that_was_launched(node, name):
    by_itself = ['ros2', 'launch', 'rigid_sim_ros', f'{name}.launch.py']
    included = ['ros2', 'launch', 'lab', 'lab.launch.py']
    assert [type(one).__name__ for one in node(name, by_itself).on_exit] == ['Shutdown']
    assert node(name, included).on_exit is NOTHING
    assert node(name, by_itself, ends_launch='false').on_exit is NOTHING
    assert len(node(name, included, ends_launch='true').on_exit) == 1


@pytest.mark.parametrize('name', FILES)
def test_another_launch_file_may_have_the_same_name(node, name, tmp_path, monkeypatch):
    """It includes this one, twice perhaps: then one node that ends is no end of the launch."""
    file = f'{name}.launch.py'
    (tmp_path / file).touch()
    monkeypatch.chdir(tmp_path)     # for a path that is relative
    for included in (['lab', file], [file], [str(tmp_path / file)]):
        assert node(name, ['ros2', 'launch', *included]).on_exit is NOTHING
    for by_itself in (['rigid_sim_ros', file], [str(ROOT / 'launch' / file)]):
        assert len(node(name, ['ros2', 'launch', *by_itself]).on_exit) == 1
