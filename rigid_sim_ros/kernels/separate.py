# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Kernels that one kernel calls by address, so that two processes can compile them.

To compile the kernels of a step takes half a minute, and Numba uses one core. So the step's kernel
calls its largest pieces through pointers, once a step each. Before the first step, and as soon as
a scene is built, a helper, a process of its own, compiles these into the cache while this process
compiles the rest, which then loads what it finds there. Nothing rests on the helper: what the
cache does not hold when it ends, however it ends, is compiled here.

A piece that a world hardly ever calls need not be there when it begins to step: the helper goes on
with it, and a world that calls it sooner waits.

The helper ends with its work or with this process, whichever comes first: it reads from a pipe
whose other end closes when this process ends, however that ends.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
import os
from pathlib import Path
import pickle
from queue import SimpleQueue
import subprocess
import sys
import threading
from typing import Any

from numba import types

from rigid_sim_ros.kernels.cache import base_folder
from rigid_sim_ros.kernels.numba_target import SUPPORTED

# [s] How long a helper is waited for once this process has done its part: it needs a few.
PATIENCE = 120.0
# Called with True when this process begins to wait for a helper, and with False when it ends to.
waiting: list[Callable[[bool], None]] = []
_ROOT = Path(__file__).parents[2]
_DONE = b'\6'   # what a helper writes for every piece
_lock = threading.Lock()
_begun: list[Any] = []      # a helper that nobody has waited for yet
_behind: list[Any] = []     # helpers with pieces that worlds step without


def compile_together(caller: Any, arguments: Sequence[Any], pieces: Sequence[Any],
                     may_wait: Collection[int], shared_out: int) -> list[int]:
    """
    Compile a kernel, or find it in the cache, and those that it calls; return their addresses.

    `arguments` are the types of those of the caller; each of the pieces takes the first of them, a
    box, and an int, and returns an int. A piece that is None is none, at address 0. The first
    `shared_out` pieces are for a helper. Those of them at the places in `may_wait` have the
    address 0 as long as a helper goes on with them; `compile_late` then gives it.
    """
    kinds = arguments[0], types.int64
    with _lock:
        missing = {place: piece for place, piece in enumerate(pieces[:shared_out])
                   if piece and not _is_cached(piece, kinds) and not _who_goes_on(piece, kinds)}
        later = [missing.pop(place) for place in may_wait if place in missing]
        with _helped([*missing.values()], later, kinds):
            _compile(caller, tuple(arguments))
            for piece in filter(None, pieces[shared_out:]):
                _compile(piece, kinds)
        return [0 if piece is None or (place in may_wait and _who_goes_on(piece, kinds))
                else _address(piece, kinds) for place, piece in enumerate(pieces)]


def compile_late(piece: Any, box: Any) -> int:
    """Return the address of a piece that `compile_together` did not wait for."""
    with _lock:
        return _address(piece, (box, types.int64))


def finish() -> None:
    """Wait until no helper goes on with anything: the next process finds all in the cache."""
    with _lock:
        for helper in _behind:
            helper.stop(PATIENCE)


def begin(pieces: Sequence[Any], box: Any) -> None:
    """
    Let a helper compile some pieces from now on, for `compile_together` to wait for it.

    `box` is the type of their first argument, as there. What is in the cache needs no helper.
    """
    kinds = box, types.int64
    with _lock:
        missing = [piece for piece in pieces if not _is_cached(piece, kinds)]
        if missing and not _begun and (helper := _start()) is not None:
            helper.give(missing, kinds)
            _begun.append(helper)


def _compile(kernel: Any, arguments: Any) -> None:
    """Compile a kernel, or load it, unless it is there: Numba takes 12 us to see that it is."""
    if arguments not in kernel.overloads:
        kernel.compile(arguments)


def _address(piece: Any, arguments: Any) -> int:
    for helper in _who_goes_on(piece, arguments):
        helper.wait(len(helper.given))
    _compile(piece, arguments)
    compiled = piece.overloads[arguments]
    address: int = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
    if address == 0:
        raise AssertionError(f'{piece.__name__} has no machine code')
    return address


def _who_goes_on(piece: Any, kinds: Any) -> list[Any]:
    """Return helpers that nobody waited for, and that have not ended, if they have this piece."""
    _behind[:] = [helper for helper in _behind if helper.process.poll() is None]
    return [helper for helper in _behind if (piece, kinds) in helper.later]


def _is_cached(piece: Any, arguments: Any) -> bool:
    """Return whether a kernel need not be compiled, as far as the list of the cache tells."""
    if arguments in piece.overloads:
        return True
    try:
        key = piece._cache._index_key(arguments, piece.targetctx.codegen())
        return key in piece._cache._cache_file._load_index()
    except (AttributeError, OSError):   # another Numba, or a cache that cannot be read
        return True


@contextmanager
def _helped(missing: Sequence[Any], later: Sequence[Any], kinds: Any) -> Iterator[None]:
    """Let a helper compile some kernels meanwhile; wait for it in the end, but not for `later`."""
    helper = _begun.pop() if _begun else _start() if missing or later else None
    if helper is None:
        yield
        return
    helper.give(missing, kinds)
    awaited = len(helper.given)
    helper.give(later, kinds)
    patience = 0.0
    try:
        yield
        if helper.wait(awaited):
            helper.go_on(later, kinds)
            patience = PATIENCE
            if later:
                _behind.append(helper)
    finally:
        if helper not in _behind:
            helper.stop(patience)


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

    def give(self, pieces: Sequence[Any], kinds: Any) -> None:
        """Let it compile pieces, unless it was told to before."""
        for piece in pieces:
            if (piece, kinds) not in self.given:
                self.given.append((piece, kinds))
                self._send((piece.py_func.__module__, piece.py_func.__name__, kinds))

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


def _start() -> Any:
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
        module, name, kinds = one
        getattr(import_module(module), name).compile(kinds)
        os.write(1, _DONE)
    os._exit(0)     # or Python would wait for the pipe


if __name__ == '__main__':
    main()
