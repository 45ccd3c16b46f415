# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the system does not allow is said in one line, or does not matter."""
from importlib.util import find_spec
import os
import subprocess
import sys

import pytest

NODE = [sys.executable, '-m', 'rigid_sim_ros', 'run', 't_handle', '--duration', '0.01']
CHECK = [sys.executable, '-m', 'rigid_sim_ros', 'check', 't_handle']
SCENES = [sys.executable, '-m', 'rigid_sim_ros', 'scenes']
RENDER = [sys.executable, '-m', 'rigid_sim_ros', 'render', 'bag', '--output', 'bag.png']
needs_ros = pytest.mark.skipif(find_spec('rclpy') is None, reason='rclpy is not installed')


def under(limits, command, **environment):
    """Run a command in a shell with limits; None takes a variable away."""
    words = {**os.environ, **environment}
    return subprocess.run(
        ['sh', '-c', f'{limits}exec "$@"', 'sh', *command], capture_output=True, text=True,
        check=False, timeout=300, env={k: v for k, v in words.items() if v is not None})


@pytest.mark.parametrize('limits, command, environment, said', [
    pytest.param('ulimit -n 12; ', NODE, {}, 'ulimit -n 1024', marks=needs_ros),
    pytest.param('ulimit -v 700000; ', NODE, {}, 'ulimit -v unlimited', marks=needs_ros),
    ('ulimit -v 200000; ', CHECK, {}, 'ulimit -v unlimited'),
    ('ulimit -v 1500000; ', RENDER, {}, 'ulimit -v unlimited'),
    ('', CHECK, {'NUMBA_DISABLE_JIT': '1'}, 'NUMBA_DISABLE_JIT'),
    ('exec >/dev/full; ', SCENES, {}, 'No space left'),
    ('exec >/dev/full; ', [*SCENES, '--help'], {}, 'No space left'),
])
def test_what_is_not_allowed_is_one_line_and_code_2(limits, command, environment, said):
    result = under(limits, command, **environment)
    assert result.returncode == 2, result.stderr
    line, = result.stderr.splitlines()
    assert line.startswith('rigid_sim: ')
    assert said in line


@needs_ros
@pytest.mark.parametrize('home', [None, '/dev/null/nowhere'])
def test_a_user_without_a_home_may_simulate(ros, tmp_path, home):
    result = under('ulimit -Sn 12; ', NODE, HOME=home, NUMBA_CACHE_DIR=os.environ.get(
        'NUMBA_CACHE_DIR', os.path.expanduser('~/.cache')))
    assert result.returncode == 0, result.stderr
    assert 'simulating' in result.stderr
    assert 'rcutils' not in result.stderr
