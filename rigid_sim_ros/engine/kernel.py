# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Compile the engine's kernels, and keep what was compiled.

Numba looks at one source file when it decides whether a cached kernel is still valid, while ours
call each other across files. The folder of the cache therefore carries a digest of all engine
sources: a change anywhere compiles anew, and a package that lies in a read-only place finds its
cache again.
"""

from collections.abc import Callable
import hashlib
import os
from pathlib import Path
import tempfile
from typing import Any, TypeVar

import numba
from numba import types

Function = TypeVar('Function', bound=Callable[..., Any])


def _digest() -> str:
    """Return a name for the present state of the engine's sources."""
    digest = hashlib.blake2b(digest_size=8)
    for path in sorted(Path(__file__).parent.rglob('*.py')):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


def cache_folder() -> Path:
    """
    Return the folder in which compiled kernels are kept.

    It lies below NUMBA_CACHE_DIR when that is set, else below the user's cache folder, else (a
    user without a home that can be written to) below the system's temporary folder.
    """
    bases = [Path(os.environ['NUMBA_CACHE_DIR'])] if os.environ.get('NUMBA_CACHE_DIR') else []
    home = os.environ.get('XDG_CACHE_HOME') or os.path.join(os.path.expanduser('~'), '.cache')
    bases += [Path(home), Path(tempfile.gettempdir()) / f'user-{os.getuid()}']
    name = f'kernels-{_digest()}'
    for base in bases:
        folder = base / 'rigid_sim_ros' / name
        if _writable(folder):
            return folder
    return bases[-1] / 'rigid_sim_ros' / name


_CACHE = cache_folder()


def _compiled(function: Function, **options: Any) -> Any:
    config: Any = numba.config
    njit: Any = numba.njit
    elsewhere = config.CACHE_DIR
    config.CACHE_DIR = str(_CACHE)
    try:
        return njit(cache=True, nogil=True, error_model='numpy', no_cfunc_wrapper=True,
                    **options)(function)
    finally:
        config.CACHE_DIR = elsewhere


def kernel(function: Function) -> Function:
    """
    Compile a function of numbers and arrays, on its first call, and cache the result.

    The compiled code holds no lock of the interpreter (other threads run meanwhile) and keeps the
    order of every floating-point operation: fastmath stays off, so that runs repeat bit for bit. A
    quotient by zero is infinite or not a number, as in NumPy.

    A kernel makes no array, only writes to those that it is given. So references need not be
    counted, which Numba would do for every array that a call passes, atomically and one by one,
    also inside of a NamedTuple: 1.4 us for a call that works for 0.1 us. And it is compiled once
    for numbers of a type, not once more for every constant that a caller writes, as Numba would:
    that was a third of the time to compile.
    """
    return _without_literals(_compiled(function, _nrt=False))


def allocating(function: Function) -> Function:
    """Compile like `kernel` a function that makes arrays: for where memory is not the time."""
    return _without_literals(_compiled(function))


def _without_literals(compiled: Any) -> Any:
    template = compiled.get_call_template
    unliteral: Any = types.unliteral

    def without_literals(args: Any, kws: Any) -> Any:
        return template(tuple(unliteral(arg) for arg in args),
                        {name: unliteral(arg) for name, arg in kws.items()})

    compiled.get_call_template = without_literals
    return compiled


def inlined(function: Function) -> Function:
    """
    Compile like `kernel`, but paste the body into each caller before types are known.

    For small functions that a loop over bodies calls: a real call, even one that LLVM inlines
    later, keeps that loop from becoming vector instructions.
    """
    return _compiled(function, _nrt=False, inline='always')
