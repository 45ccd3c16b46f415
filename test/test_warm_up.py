# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who waits for the compiler is told so."""
import atexit
import io
import os
from pathlib import Path
import signal
import sys
import threading
import time

from effort import either
import fresh
from kernels.caches import cache_without
import numba
import numpy as np
import pytest

from rigid_sim_ros import load_scene, warm_up
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.signals import Stop
from rigid_sim_ros.warm_up import announced, Stopped, watched

# The command, which announces what takes longer than 0.1 s.
SOON = 'from rigid_sim_ros import cli, warm_up; warm_up.QUIET = 0.1; cli.main()'


def test_what_is_done_at_once_is_not_worth_a_line() -> None:
    stream = io.StringIO()
    announced(lambda: None, stream=stream)
    assert stream.getvalue() == ''


def compile_something() -> None:
    @numba.njit
    def kernel(x):
        return np.sort(x)
    kernel(np.zeros(3))


def test_compiling_is_announced_and_its_end_too(monkeypatch) -> None:
    monkeypatch.setattr(warm_up, 'QUIET', 0.01)
    monkeypatch.setattr(warm_up, '_LOOK', 0.01)
    monkeypatch.setattr(warm_up, '_LOG_PERIOD', 0.01)
    monkeypatch.setattr(warm_up, '_hints', [' (first start only)'])
    for first in ('compiling the physics kernels (first start only) ... ',
                  'compiling the physics kernels ... '):
        stream = io.StringIO()
        announced(compile_something, stream=stream)
        lines = stream.getvalue().splitlines()
        assert lines[0].startswith(first)
        assert not any('first' in line for line in lines[1:])
        assert ' took ' in lines[-1]


def test_nothing_is_said_of_compiling_when_something_else_takes_long(monkeypatch) -> None:
    monkeypatch.setattr(warm_up, 'QUIET', 0.01)
    stream = io.StringIO()
    announced(lambda: time.sleep(0.5), stream=stream)
    assert stream.getvalue() == ''


def test_what_goes_wrong_is_raised_where_it_is_waited_for() -> None:
    def fail() -> None:
        raise ArithmeticError('too fast')
    with pytest.raises(ArithmeticError, match='too fast'):
        announced(fail)


def test_who_is_stopped_does_not_wait_on(monkeypatch) -> None:
    at_exit: list[object] = []
    monkeypatch.setattr(atexit, 'register', lambda *words: at_exit.append(words[1]))
    stopped, go_on = Stop(), threading.Event()
    stopped.signal = signal.SIGTERM
    threading.Timer(0.1, stopped.set).start()
    with pytest.raises(Stopped):
        watched(lambda: go_on.wait(60.0), stopped, io.StringIO())
    assert at_exit == [143]     # this process would end so, with a thread that compiles
    go_on.set()


# Ctrl-C while a thread compiles; what Python does as it ends would be printed.
INTERRUPTED = """
import atexit, os, signal, threading, time
from rigid_sim_ros.warm_up import announced
atexit.register(print, 'Python ended')
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
announced(lambda: time.sleep(60))
"""


def test_ctrl_c_ends_the_process_before_python_takes_down_what_compiles() -> None:
    """Of LLVM too, which then ended by an assertion or worse, once in ten times."""
    result = fresh.run('-c', INTERRUPTED)
    assert (result.returncode, result.stdout) == (130, '')
    assert 'KeyboardInterrupt' in result.stderr


@pytest.mark.parametrize('command', [['batch', 't_handle', '--duration', '0.01', '--output'],
                                     ['verify'], ['plot', '--output', 'plot.svg']])
def test_commands_say_when_they_compile(tmp_path: Path, command) -> None:
    bag = tmp_path / 'bag'
    if command[0] != 'batch':
        # The energies of a plot are those of its forces as well.
        scene = 'spring_pendulum' if command[0] == 'plot' else 't_handle'
        batch = Batch(load_scene(scene), bag)
        batch.run(10)
        batch.close()
    # It takes less than the 3 s that are not announced, and on no machine 0.1 s.
    kernels = tmp_path / 'kernels'
    cache_without(kernels, 'add_scene_forces' if command[0] == 'plot' else 'read_motion')
    result = fresh.run('-c', SOON, *command, str(bag), cwd=tmp_path,
                       env=os.environ | {'NUMBA_CACHE_DIR': str(kernels)})
    assert result.returncode == 0, result.stderr
    assert result.stderr.startswith('compiling the physics kernels')


# Two boxes meet so that neither a face nor crossing edges tell what is nearest.
SEARCHES = """
import os, threading
from pathlib import Path
from rigid_sim_ros import warm_up, World
from rigid_sim_ros.kernels import helper_process
helper_process.__name__ = 'kernels.restoring_helper'    # what is started as the helper
warm_up.QUIET = 0.1
def wait_a_little(begins):
    threading.Timer(0.5, Path(os.environ['RESTORED_AFTER']).touch).start()
box = {'mass': 1.0, 'shape': {'type': 'box', 'size': [0.2, 0.3, 0.4]},
       'twist': {'angular': [3, 2, 1]}}
world = World.from_dict({'format': 1, 'bodies': [
    {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}},
    *({**box, 'name': f'box_{i}', 'pose': {'position': [0.05 * i, 0.03 * (i % 3), 0.5 + 0.6 * i]}}
      for i in range(6))]})
warm_up.warm_up(world.scene)
helper_process.waiting.append(wait_a_little)
world.step(3000)
"""


def test_a_step_that_waits_for_a_kernel_says_so(tmp_path: Path) -> None:
    full, lacking = tmp_path / 'full', tmp_path / 'lacking'
    cache_without(full)
    cache_without(lacking, 'search')
    tests = str(Path(__file__).parent)
    # The helper has it half a second after it is needed, in place of compiling it for ten.
    result = fresh.run(
        '-c', SEARCHES,
        env=os.environ | {'NUMBA_CACHE_DIR': str(lacking), 'RESTORED_FROM': str(full),
                          'RESTORED_AFTER': str(tmp_path / 'needed'),
                          'PYTHONPATH': os.pathsep.join([tests, *filter(None, sys.path)])})
    assert result.returncode == 0, result.stderr
    said = result.stderr.splitlines()
    assert said[0] == 'compiling the physics kernels: a step waits for one more'
    assert said[1].startswith('compiling the physics kernels took ')


@pytest.mark.long
@pytest.mark.parametrize('scene', either(['t_handle'], [
    't_handle', 'arm', 'gripper', 'tower', 'newtons_cradle', 'pile_of_shapes']))
def test_nothing_is_compiled_once_that_is_said_to_be_over(tmp_path: Path, scene: str) -> None:
    script = Path(__file__).with_name('first_calls.py')
    result = fresh.run(str(script), scene, env=os.environ | {'NUMBA_CACHE_DIR': str(tmp_path)})
    assert result.returncode == 0, result.stderr
    assert result.stdout == 'done\n'
