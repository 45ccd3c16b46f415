# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C ends a program that has only begun to start."""
from importlib.util import find_spec
import os
from pathlib import Path
import signal
import subprocess
import sys

import pytest

from rigid_sim_ros.signals import INTERRUPTED

# A module in the place of one that a program imports: it presses Ctrl-C, where Python ignores
# exceptions, and goes on.
PRESSES = f"""
import os

class Ending:
    def __del__(self):
        os.kill(os.getpid(), {int(signal.SIGINT)})
        for _ in range(1000):
            pass

Ending()
raise ImportError('the program has gone on')
"""
needs_ros = pytest.mark.skipif(find_spec('rclpy') is None, reason='rclpy is not installed')


def starting(tmp_path: Path, imported: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a program in which somebody presses Ctrl-C as soon as it imports a module."""
    (tmp_path / f'{imported}.py').write_text(PRESSES, encoding='utf-8')
    path = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    return subprocess.run([sys.executable, '-m', *words], capture_output=True, text=True,
                          check=False, timeout=300, env=os.environ | {'PYTHONPATH': path})


@pytest.mark.parametrize('imported, words', [
    ('click', ['rigid_sim_ros', 'check', 't_handle']),
    pytest.param('rclpy', ['rigid_sim_ros', 'run', 't_handle'], marks=needs_ros),
    pytest.param('rclpy', ['rigid_sim_ros', 'replay', 'session'], marks=needs_ros),
    pytest.param('rclpy', ['rigid_sim_ros.programs', 'simulate', 't_handle'], marks=needs_ros),
    pytest.param('rclpy', ['rigid_sim_ros.programs', 'replay', 'session'], marks=needs_ros),
    pytest.param('rclpy', ['rigid_sim_ros.programs', 'view'], marks=needs_ros),
])
def test_ctrl_c_during_the_imports_ends_a_program_without_a_word(tmp_path, imported, words):
    result = starting(tmp_path, imported, *words)
    assert (result.returncode, result.stdout, result.stderr) == (INTERRUPTED, '', '')


def test_ctrl_c_that_is_ignored_stays_so(tmp_path):
    """As a shell starts what it puts in the background."""
    (tmp_path / 'click.py').write_text(PRESSES, encoding='utf-8')
    code = ('import signal; signal.signal(signal.SIGINT, signal.SIG_IGN); '
            'from rigid_sim_ros.programs import rigid_sim; rigid_sim()')
    result = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=False, timeout=300,
        env=os.environ | {'PYTHONPATH': str(tmp_path)})
    assert result.returncode == 1
    assert 'ImportError: the program has gone on' in result.stderr


def test_python_ends_a_program_without_a_look_at_all_that_was_imported():
    code = ('import gc; from rigid_sim_ros import programs\n'
            'try: programs.rigid_sim()\n'
            'finally: print(gc.get_freeze_count() > 100_000)')
    result = subprocess.run([sys.executable, '-c', code, 'check', 't_handle'],
                            capture_output=True, text=True, check=False, timeout=300)
    assert (result.returncode, result.stderr) == (0, '')
    assert result.stdout.splitlines()[-1] == 'True'
