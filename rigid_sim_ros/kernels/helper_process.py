# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A process of its own that compiles kernels into the cache, while this process compiles others.

Numba uses one core. The helper ends with its work or with this process, whichever comes first: it
reads from a pipe whose other end closes when this process ends, however that ends.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
import os
from pathlib import Path
import pickle
from queue import SimpleQueue
import subprocess
import sys
import threading
from typing import Any

from rigid_sim_ros.kernels.cache import base_folder
from rigid_sim_ros.kernels.numba_target import SUPPORTED
from rigid_sim_ros.kernels.symbols import declare

# [s] How long a helper is waited for once this process has done its part: it needs a few.
PATIENCE = 120.0
# Called with True when this process begins to wait for a helper, and with False when it ends to.
waiting: list[Callable[[bool], None]] = []
_ROOT = Path(__file__).parents[2]
_DONE = b'\6'   # what a helper writes for every kernel


class HelperProcess:
    """A process that compiles kernels into the cache, one after the other."""

    def __init__(self, process: Any) -> None:
        """Take a process that runs `main`."""
        self.process = process
        self.given: list[tuple[Any, Any]] = []      # pieces and the types of their arguments
        self.later: list[tuple[Any, Any]] = []      # those of them that nobody waits for
        # Remembers what it has written: the types fill a third of a pipe that nobody reads yet.
        self._pickler = pickle.Pickler(process.stdin)
        self._done = 0
        self._ended = False
        self._news = threading.Condition()
        threading.Thread(target=self._listen, daemon=True).start()

    def give(self, pieces: Sequence[Any], kinds: Any, symbols: Sequence[str]) -> None:
        """Let it compile pieces, whose code may name these symbols, unless it was told before."""
        for piece in pieces:
            if (piece, kinds) not in self.given:
                self.given.append((piece, kinds))
                self._send((piece.py_func.__module__, piece.py_func.__name__, kinds, symbols))

    def go_on(self, pieces: Sequence[Any], kinds: Any) -> None:
        """Let it do what nobody waits for, and end."""
        self.later = [(piece, kinds) for piece in pieces]
        self._send(None)

    def wait(self, count: int) -> bool:
        """Wait until it has compiled so many pieces, and return whether it has."""
        _tell_that_it_waits(True)
        try:
            with self._news:
                self._news.wait_for(lambda: self._done >= count or self._ended, PATIENCE)
                return self._done >= count
        finally:
            _tell_that_it_waits(False)

    def stop(self, patience: float) -> None:
        """End it, if it does not end in so many seconds."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(patience)
        self.process.kill()     # does nothing once it has ended
        self.process.wait()
        with suppress(OSError):     # for what it was told and never read
            self.process.stdin.close()

    def _send(self, work: Any) -> None:
        with suppress(OSError):     # it has ended already
            self._pickler.dump(work)
            self.process.stdin.flush()

    def _listen(self) -> None:
        with self.process.stdout as pipe:
            while said := pipe.read(1):
                with self._news:
                    self._done += said == _DONE
                    self._news.notify_all()
        with self._news:
            self._ended = True
            self._news.notify_all()


def _tell_that_it_waits(begins: bool) -> None:
    for tell in tuple(waiting):
        tell(begins)


def start() -> HelperProcess | None:
    """Return a helper; None where there can be none."""
    folder = base_folder()
    if not SUPPORTED or cores() < 2 or not os.access(folder, os.W_OK) or (
            'python' not in Path(sys.executable or '').name):
        return None
    environment = os.environ | {
        'PYTHONPATH': os.pathsep.join(entry or os.getcwd() for entry in sys.path),
        'NUMBA_CACHE_DIR': str(folder.parents[1])}
    try:
        # Python looks for modules where it starts first: there, as here.
        return HelperProcess(subprocess.Popen(
            [sys.executable, '-m', __name__], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, cwd=_ROOT, env=environment))
    except OSError:
        return None


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _read_work(pipe: Any, work: Any) -> None:
    """Pass on what is read, until the process that writes it ends."""
    unpickler = pickle.Unpickler(pipe)
    try:
        while True:
            work.put(unpickler.load())
    except (EOFError, OSError, pickle.UnpicklingError):
        os._exit(1)


def main() -> None:
    """Compile what is read from a pipe."""
    work: SimpleQueue[Any] = SimpleQueue()
    threading.Thread(target=_read_work, args=(sys.stdin.buffer, work), daemon=True).start()
    while (one := work.get()) is not None:
        module, name, kinds, symbols = one
        for symbol in symbols:
            declare(symbol)
        getattr(import_module(module), name).compile(kinds)
        os.write(1, _DONE)
    os._exit(0)     # or Python would wait for the pipe


if __name__ == '__main__':
    main()
