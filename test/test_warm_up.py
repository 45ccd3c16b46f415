# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who waits for the compiler is told so."""
import io
import os
from pathlib import Path
import subprocess
import sys
import threading
import time

import pytest

from rigid_sim_ros import load_scene, warm_up
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.warm_up import announced

# The command, which announces what takes longer than 0.2 s.
SOON = 'from rigid_sim_ros import cli, warm_up; warm_up.QUIET = 0.2; cli.main()'


def test_what_is_done_at_once_is_not_worth_a_line() -> None:
    stream = io.StringIO()
    announced(lambda: None, stream=stream)
    assert stream.getvalue() == ''


def test_what_takes_long_is_announced_and_its_end_too(monkeypatch) -> None:
    monkeypatch.setattr(warm_up, 'QUIET', 0.05)
    stream = io.StringIO()
    announced(lambda: time.sleep(0.5), stream=stream)
    first, *_, last = stream.getvalue().splitlines()
    assert first.startswith('compiling the physics kernels (first start only) ... ')
    assert ' took ' in last


def test_what_goes_wrong_is_raised_where_it_is_waited_for() -> None:
    def fail() -> None:
        raise ArithmeticError('too fast')
    with pytest.raises(ArithmeticError, match='too fast'):
        announced(fail)


def test_who_is_stopped_does_not_wait_on() -> None:
    stopped, go_on = threading.Event(), threading.Event()
    threading.Timer(0.1, stopped.set).start()
    warm_up.watched(lambda: go_on.wait(60.0), stopped, io.StringIO())
    assert stopped.is_set()
    go_on.set()


@pytest.mark.parametrize('command', [['batch', 't_handle', '--duration', '0.01', '--output'],
                                     ['verify']])
def test_batch_and_verify_say_when_they_compile(tmp_path: Path, command) -> None:
    bag = tmp_path / 'bag'
    if command == ['verify']:
        batch = Batch(load_scene('t_handle'), bag)
        batch.run(10)
        batch.close()
    # A cache of its own holds nothing. A fast machine fills it in less than the 3 s that are not
    # announced, none in 0.2 s.
    result = subprocess.run(
        [sys.executable, '-c', SOON, *command, str(bag)],
        env=os.environ | {'NUMBA_CACHE_DIR': str(tmp_path)}, capture_output=True, text=True,
        check=False, timeout=300)
    assert result.returncode == 0, result.stderr
    assert result.stderr.startswith('compiling the physics kernels')
