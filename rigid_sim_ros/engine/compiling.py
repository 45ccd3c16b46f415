# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Kernels that one kernel calls by address, so that two processes can compile them.

To compile the kernels of a step takes half a minute, and Numba uses one core. So the step's kernel
calls its largest pieces through pointers, once a step each. Before the first step, and as soon as
a scene is built, a helper, a process of its own, compiles these into the cache while this process
compiles the rest, which then loads what it finds there. Nothing rests on the helper: what the
cache does not hold when it ends, however it ends, is compiled here.

The helper ends with its work or with this process, whichever comes first: it reads from a pipe
whose other end closes when this process ends, however that ends.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
import os
from pathlib import Path
import pickle
import subprocess
import sys
import threading
from typing import Any

from numba import types

from rigid_sim_ros.engine.kernel_cache import base_folder
from rigid_sim_ros.engine.kernel_linking import SUPPORTED

# [s] How long a helper is waited for once this process has done its part: it needs a few.
PATIENCE = 120.0
_ROOT = Path(__file__).parents[2]
_lock = threading.Lock()
_begun: list[Any] = []      # a helper that nobody has waited for yet


def compile_together(caller: Any, arguments: Sequence[Any], pieces: Sequence[Any],
                     shared_out: int) -> list[int]:
    """
    Compile a kernel, or find it in the cache, and those that it calls; return their addresses.

    `arguments` are the types of those of the caller; each of the pieces takes the first of them, a
    box, and an int, and returns an int. A piece that is None is none, at address 0. The first
    `shared_out` pieces are for a helper.
    """
    kinds = arguments[0], types.int64
    with _lock:
        missing = [piece for piece in pieces[:shared_out] if not _is_cached(piece, kinds)]
        with _helped(missing, kinds):
            caller.compile(tuple(arguments))
            for piece in filter(None, pieces[shared_out:]):
                piece.compile(kinds)
        return [_address(piece, kinds) if piece else 0 for piece in pieces]


def begin(pieces: Sequence[Any], box: Any) -> None:
    """
    Let a helper compile some pieces from now on, for `compile_together` to wait for it.

    `box` is the type of their first argument, as there. What is in the cache needs no helper.
    """
    kinds = box, types.int64
    with _lock:
        missing = [piece for piece in pieces if not _is_cached(piece, kinds)]
        if missing and not _begun and (helper := _start(missing, kinds)) is not None:
            _begun.append(helper)


def _address(piece: Any, arguments: Any) -> int:
    piece.compile(arguments)
    compiled = piece.overloads[arguments]
    address: int = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
    if address == 0:
        raise AssertionError(f'{piece.__name__} has no machine code')
    return address


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
def _helped(pieces: Sequence[Any], arguments: Any) -> Iterator[None]:
    """Let a helper compile some kernels meanwhile; wait for it in the end."""
    helper = _begun.pop() if _begun else None
    if helper is None and pieces:
        helper = _start(pieces, arguments)
    if helper is None:
        yield
        return
    try:
        yield
        helper.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        pass
    finally:
        helper.kill()       # does nothing once it has ended
        helper.wait()
        helper.stdin.close()


def _start(pieces: Sequence[Any], arguments: Any) -> Any:
    """Return a process that compiles some kernels into the cache; None where there can be none."""
    folder = base_folder()
    if not SUPPORTED or cores() < 2 or not os.access(folder, os.W_OK) or (
            'python' not in Path(sys.executable or '').name):
        return None
    environment = os.environ | {
        'PYTHONPATH': os.pathsep.join(entry or os.getcwd() for entry in sys.path),
        'NUMBA_CACHE_DIR': str(folder.parents[1])}
    work = pickle.dumps([(piece.py_func.__module__, piece.py_func.__name__, arguments)
                         for piece in pieces])
    try:
        # Python looks for modules where it starts first: there, as here.
        helper = subprocess.Popen(
            [sys.executable, '-m', __name__], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL, cwd=_ROOT, env=environment)
    except OSError:
        return None
    assert helper.stdin is not None
    try:
        helper.stdin.write(work)
        helper.stdin.flush()
    except OSError:     # it has ended already
        pass
    return helper


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _end_with(pipe: Any) -> None:
    pipe.read()
    os._exit(1)


def main() -> None:
    """Compile what is read from a pipe."""
    work = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with, args=(sys.stdin.buffer,), daemon=True).start()
    for module, name, arguments in work:
        getattr(import_module(module), name).compile(arguments)
    os._exit(0)     # or Python would wait for the pipe


if __name__ == '__main__':
    main()
