# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A helper compiles pieces of a kernel; whatever becomes of it, the kernel runs and is right."""

import os
import signal
import subprocess
import sys
import time

import fresh
import pytest

from rigid_sim_ros.kernels.helper_process import cores
from rigid_sim_ros.kernels.numba_target import SUPPORTED

needs_helper = pytest.mark.skipif(
    not SUPPORTED or cores() < 2, reason='no helper is started on this machine')

# A module that a helper can import, with kernels that lie in the engine's cache.
KERNELS = """
import os
import time
from typing import Any, NamedTuple

from rigid_sim_ros.kernels.kernel import kernel
from rigid_sim_ros.kernels.separate import by_address


class Arguments(NamedTuple):
    values: Any
    number: float


def of_the_engine(decorator):
    def decorated(function):
        function.__module__ = 'rigid_sim_ros.kernels.argument_pack'
        compiled = decorator(function)
        function.__module__ = __name__
        return compiled
    return decorated


@of_the_engine(by_address)
def add_up(c, weight):
    total = 0
    for i in range(c.values.shape[0]):
        total += c.values[i]
    return weight * total


@of_the_engine(by_address)
def count(c, more):
    return c.values.shape[0] + int(c.number) + more


@of_the_engine(kernel)
def both(c, weight):
    return add_up(c, weight) + count(c, 1)


if 'HELPER_WAITS' in os.environ and os.environ['HELPER_WAITS'] != str(os.getpid()):
    time.sleep(60.0)
"""
RUN = """
import os
import sys
import numpy as np
{before}
os.environ['HELPER_WAITS'] = str(os.getpid())
import kernels
os.environ.pop('HELPER_WAITS')
from rigid_sim_ros.kernels import helper_process, separate
from rigid_sim_ros.kernels.argument_pack import ArgumentPack
from rigid_sim_ros.kernels.symbols import declare
{change}
pack = ArgumentPack(kernels.Arguments(np.arange(5), 2.0))
pieces = separate.Pieces([kernels.count], {helped})
separate.link(kernels.both, pack, pieces)
{late}
print(pack.run(kernels.both, 100), sum(kernels.add_up.stats.cache_hits.values()))
"""
RESULT = 100 * (0 + 1 + 2 + 3 + 4) + 5 + 2 + 1
# What has to happen before a piece that may wait is called: whether it is there, and its address.
LATE = """
print(int(declare(separate.symbol_of(kernels.add_up, pack.type)).value == 0), end=' ')
{happens}
separate.link_late(kernels.add_up, pack)
"""
# Let something happen to a helper when it is started.
TO_A_HELPER = """
start = helper_process.start
def changed(*arguments):
    os.environ['HELPER_WAITS'] = '{waits}'
    helper = start(*arguments)
    {happens}
    return helper
helper_process.start = changed
"""


@pytest.fixture(name='started')
def _started(tmp_path):
    """Give a function that starts a process with a new cache, whose start may be changed."""
    (tmp_path / 'kernels.py').write_text(KERNELS, encoding='utf-8')

    def start(change='', before='', late=None):
        path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
        return fresh.Fresh(
            ['-c', RUN.format(
                before=before, change=change,
                helped='[kernels.add_up]' if late is None else '[], [kernels.add_up]',
                late='' if late is None else LATE.format(happens=late))],
            env=os.environ | {'NUMBA_CACHE_DIR': str(tmp_path / 'cache'), 'PYTHONPATH': path})

    return start


def result(process):
    """Return what a process found, and whether it loaded what a helper was to compile."""
    done = process.wait()
    assert done.returncode == 0, done.stderr
    return tuple(map(int, done.stdout.split()))


@needs_helper
def test_what_a_helper_compiled_is_loaded(started):
    assert result(started()) == (RESULT, 1)


@pytest.mark.parametrize('change', [
    pytest.param("sys.executable = ''", id='no-python'),
    pytest.param("sys.executable = '/nowhere/python3'", id='no-such-python'),
    pytest.param('helper_process.cores = lambda: 1', id='one-core'),
    pytest.param('helper_process.os.access = lambda *_: False', id='read-only-cache'),
    pytest.param(TO_A_HELPER.format(waits='', happens='helper.process.kill()'),
                 id='killed-at-once'),
    pytest.param(TO_A_HELPER.format(waits='no', happens='helper_process.PATIENCE = 0.1'),
                 id='hangs'),
])
def test_without_a_helper_that_gets_done_all_is_compiled_here(started, change):
    assert result(started(change)) == (RESULT, 0)


def test_a_numba_that_is_not_supported_calls_pieces_too(started):
    before = "import numba; numba.__version__ = '0.1'"
    assert result(started(before=before)) == (RESULT, 0)


def test_a_second_start_finds_all_in_the_cache_and_starts_no_helper(started):
    result(started())
    assert result(started('helper_process.start = None')) == (RESULT, 1)


def test_two_first_starts_at_the_same_time_do_not_disturb_each_other(started):
    both = [started(), started()]
    assert [result(process)[0] for process in both] == [RESULT, RESULT]


@needs_helper
@pytest.mark.parametrize(('happens', 'loaded'), [
    pytest.param('', 1, id='asked for at once'),
    pytest.param('separate.finish()', 1, id='long done'),
    pytest.param('separate._behind[0].process.kill()', 0, id='killed'),
])
def test_a_piece_that_may_wait_is_there_when_it_is_asked_for(started, happens, loaded):
    # What is to be killed must not be done before.
    change = '' if loaded else TO_A_HELPER.format(waits='no', happens='')
    assert result(started(change, late=happens)) == (1, RESULT, loaded)


def test_a_piece_that_may_wait_is_there_at_once_where_nobody_goes_on_with_it(started):
    assert result(started('helper_process.cores = lambda: 1', late='')) == (0, RESULT, 0)
    assert result(started('helper_process.start = None', late='')) == (0, RESULT, 1)


@needs_helper
def test_who_may_not_wait_waits_for_a_helper_that_goes_on(started):
    again = """
helper_process.start = None
separate.link(kernels.both, pack, separate.Pieces([kernels.count], [kernels.add_up]))
"""
    assert result(started(late=again)) == (1, RESULT, 1)


@needs_helper
def test_a_helper_ends_when_who_started_it_is_killed(started):
    happens = 'print(helper.process.pid, flush=True); os.kill(os.getpid(), 9)'
    process = started(TO_A_HELPER.format(waits='no', happens=happens))
    done = process.wait()
    assert done.returncode == -signal.SIGKILL
    helper = int(done.stdout)
    for _ in range(500):    # it would wait for 60 s
        if not is_running(helper):
            return
        time.sleep(0.1)
    os.kill(helper, signal.SIGKILL)
    pytest.fail('the helper runs on')


def is_running(process):
    """Return whether a process of this number does something; who ended may still be listed."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    found = subprocess.run(['ps', '-o', 'stat=', '-p', str(process)], capture_output=True,
                           text=True, check=False)
    return found.stdout.strip()[:1] not in ('', 'Z')
