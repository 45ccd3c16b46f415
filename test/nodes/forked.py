# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Programs of the package in processes that have imported them already.

They are forks of a process that has imported the programs and loaded their kernels (preloaded.py),
so that each one starts at once: that takes more than a second of a processor, and the tests start
some hundred nodes.
"""
from collections.abc import Mapping, Sequence
import multiprocessing
from multiprocessing import forkserver
import os
from pathlib import Path
import sys
from unittest.mock import patch

from rigid_sim_ros.programs import start

_context = multiprocessing.get_context('forkserver')
_context.set_forkserver_preload(['nodes.preloaded'])


class Fork:
    """A program in such a process, with the methods of subprocess.Popen that the tests need."""

    def __init__(self, words: Sequence[str], out: Path, err: Path, cwd: Path) -> None:
        """Start a program with its arguments, nothing to read, and files that it writes to."""
        _start_server()
        # A daemon is killed with the process of the tests, if nobody has ended it before.
        self._process = _context.Process(
            target=_run, args=(list(words), out.absolute(), err.absolute(), cwd.absolute(),
                               dict(os.environ)), daemon=True)
        self._process.start()

    @property
    def pid(self) -> int:
        """The number of the process."""
        assert self._process.pid is not None
        return self._process.pid

    def send_signal(self, number: int) -> None:
        """Send a signal, if it still runs."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def poll(self) -> int | None:
        """Return the exit code, None while it runs."""
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end and return the exit code; TimeoutError if it does not come."""
        self._process.join(timeout)
        code = self.poll()
        if code is None:
            raise TimeoutError(f'waited {timeout} s for the end of a process')
        return code

    def kill(self) -> None:
        """End it by force."""
        self._process.kill()


def _start_server() -> None:
    """Start the process that is forked, unless it is there; it finds what it is to import."""
    above = os.environ.get('PYTHONPATH', '').split(os.pathsep)
    paths = os.pathsep.join([str(Path(__file__).parents[1]), *filter(None, above)])
    with patch.dict(os.environ, PYTHONPATH=paths):
        forkserver.ensure_running()


def _run(words: Sequence[str], out: Path, err: Path, cwd: Path,
         environment: Mapping[str, str]) -> None:
    for number, path, flags in ((0, os.devnull, os.O_RDONLY), (1, out, os.O_WRONLY | os.O_APPEND),
                                (2, err, os.O_WRONLY | os.O_APPEND)):
        opened = os.open(path, flags)
        os.dup2(opened, number)
        os.close(opened)
    os.chdir(cwd)
    os.environ.clear()
    os.environ.update(environment)
    name, *rest = words
    sys.argv = [name, *rest]
    # A daemon may not start processes, and the page of a bag verifies it in one.
    multiprocessing.current_process()._config['daemon'] = False
    start(name)
