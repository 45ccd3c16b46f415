# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The package as pip installs it, and as colcon builds it into a workspace."""
from importlib.metadata import distribution
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from typing import NamedTuple
from xml.etree import ElementTree

from free import free_domain
import pytest

import rigid_sim_ros

SOURCE = Path(__file__).resolve().parent.parent
SCENES = {path.name for path in (SOURCE / 'rigid_sim_ros' / 'example_scenes').iterdir()
          if path.suffix == '.yaml'}
LEFT_OUT = shutil.ignore_patterns(
    '.*', '__pycache__', '*.egg-info', 'build', 'install', 'log', 'session')


class Workspace(NamedTuple):
    """What colcon made of a copy of this package."""

    prefix: Path
    environment: dict[str, str]

    def run(self, *command: str, **options) -> subprocess.CompletedProcess[str]:
        """Run a command in the sourced workspace, away from the sources."""
        result = subprocess.run(
            command, env=self.environment, cwd=self.prefix, capture_output=True, text=True,
            check=False, timeout=300, **options)
        assert result.returncode == 0, result.stdout + result.stderr
        return result


@pytest.fixture(scope='module', params=['copied', 'symlinked'])
def workspace(request, tmp_path_factory) -> Workspace:
    """Build a copy of the package in a workspace of its own, in both of colcon's ways."""
    base = tmp_path_factory.mktemp(request.param)
    shutil.copytree(SOURCE, base / 'src' / 'rigid_sim_ros', symlinks=True, ignore=LEFT_OUT)
    # The colcon of this environment, so that the executables it writes start this Python.
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ['PATH']])
    colcon = shutil.which('colcon', path=path)
    assert colcon, "colcon is missing: pip install '.[test]'"
    flags = ['--symlink-install'] if request.param == 'symlinked' else []
    build = subprocess.run(
        [colcon, 'build', '--base-paths', 'src', *flags], cwd=base,
        env=os.environ | {'PATH': path}, capture_output=True, text=True, check=False, timeout=300)
    assert build.returncode == 0, build.stdout + build.stderr
    sourced = subprocess.run(
        ['bash', '-c', 'source install/setup.bash && env -0'], cwd=base, capture_output=True,
        text=True, check=True, timeout=300)
    environment = dict(line.split('=', 1) for line in sourced.stdout.split('\0') if line)
    return Workspace(base / 'install' / 'rigid_sim_ros', environment)


def test_the_version_is_the_same_everywhere() -> None:
    manifest = ElementTree.parse(SOURCE / 'package.xml').findtext('version')
    setup = re.search(r"version='(.+?)'", (SOURCE / 'setup.py').read_text())
    assert setup
    assert {manifest, setup[1], distribution('rigid_sim_ros').version} == {
        rigid_sim_ros.__version__}


def test_pip_puts_rigid_sim_on_the_path_and_no_plain_name_like_view() -> None:
    scripts = {entry.name for entry in distribution('rigid_sim_ros').entry_points}
    assert scripts == {'rigid_sim'}
    command = Path(sys.executable).parent / 'rigid_sim'
    result = subprocess.run([command, '--version'], capture_output=True, text=True, check=True)
    assert result.stdout == f'rigid_sim {rigid_sim_ros.__version__}\n'


def test_the_installed_package_holds_scenes_types_and_default_parameters() -> None:
    home = Path(rigid_sim_ros.__file__).parent
    assert len(SCENES) >= 5
    assert {path.name for path in (home / 'example_scenes').glob('*.yaml')} == SCENES
    assert (home / 'py.typed').exists()
    assert (home / 'msg_config' / 'default.yaml').exists()


def test_every_rosdep_key_of_a_python_library_is_also_a_requirement_of_pip() -> None:
    manifest = ElementTree.parse(SOURCE / 'package.xml')
    keys = [element.text or '' for element in manifest.iter('exec_depend')]
    libraries = {re.sub('^python3-|-pip$', '', key) for key in keys if key.startswith('python3-')}
    libraries = {{'yaml': 'pyyaml'}.get(name, name) for name in libraries}
    required = {re.split('[<>=; ]', line)[0]
                for line in distribution('rigid_sim_ros').requires or [] if 'extra' not in line}
    # What rosdep does not know, or on Ubuntu 24.04 not in the version needed.
    page = (SOURCE / 'docs' / 'install.md').read_text(encoding='utf-8')
    unknown = required - libraries
    assert unknown == {'llvmlite', 'lz4', 'mcap', 'osqp', 'pycollada', 'pydantic', 'zstandard'}
    line, = (line for line in page.splitlines() if line.startswith('pip install osqp'))
    assert all(name in line for name in unknown)
    assert libraries <= required


def test_colcon_puts_the_executables_where_ros2_run_looks(workspace: Workspace) -> None:
    executables = {path.name for path in (workspace.prefix / 'lib/rigid_sim_ros').iterdir()
                   if os.access(path, os.X_OK)}
    assert executables >= {'rigid_sim', 'replay', 'simulate'}
    assert not (workspace.prefix / 'bin').exists()


def test_colcon_shares_manifest_launch_files_and_msg_config(workspace: Workspace) -> None:
    share = workspace.prefix / 'share'
    assert (share / 'rigid_sim_ros/package.xml').is_file()
    assert (share / 'rigid_sim_ros/launch/simulate.launch.py').is_file()
    assert (share / 'rigid_sim_ros/launch/replay.launch.py').is_file()
    assert (share / 'rigid_sim_ros/msg_config/default.yaml').is_file()
    assert (share / 'rigid_sim_ros/msg_config/replay.yaml').is_file()
    assert (share / 'ament_index/resource_index/packages/rigid_sim_ros').is_file()


def test_a_workspace_of_colcon_finds_the_example_scenes(workspace: Workspace) -> None:
    found = workspace.run(
        sys.executable, '-c', """
from importlib.resources import files
import rigid_sim_ros
scenes = (files('rigid_sim_ros') / 'example_scenes').iterdir()
print(rigid_sim_ros.__file__, *[path.name for path in scenes])
""")
    module, *scenes = found.stdout.split()
    assert workspace.prefix.parent.parent in Path(module).parents
    assert set(scenes) >= SCENES


def test_the_node_that_colcon_built_runs_to_its_end(workspace: Workspace) -> None:
    domain = {'ROS_DOMAIN_ID': str(free_domain()), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    result = workspace._replace(environment=workspace.environment | domain).run(
        str(workspace.prefix / 'lib/rigid_sim_ros/simulate'), 't_handle', '--duration', '0.5')
    assert 'simulating t_handle: 1 body' in result.stderr


def test_the_command_that_colcon_built_checks_a_scene(workspace: Workspace) -> None:
    command = workspace.prefix / 'lib/rigid_sim_ros/rigid_sim'
    assert 't_handle: 1 body' in workspace.run(str(command), 'check', 't_handle').stdout
