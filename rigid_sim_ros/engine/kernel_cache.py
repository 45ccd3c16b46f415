# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where compiled kernels are kept.

Numba looks at one source file when it decides whether a cached kernel is still valid, while ours
call each other across files. The folder of a module's cache therefore carries a digest of its
source and of all that it imports: a change compiles anew what depends on it and nothing else, and
a package that lies in a read-only place finds its cache again.
"""

from functools import cache
import gc
import hashlib
import os
from pathlib import Path
import re
import tempfile
from typing import Any

import numba
from numba.core import caching, compiler_lock, event

_NumbasCache: Any = caching.FunctionCache
_one_at_a_time: Any = compiler_lock.global_compiler_lock    # of the threads of this process
_ENGINE = Path(__file__).parent
_PACKAGE = __package__.rpartition('.')[0] + '.engine'
# The import of a module of the engine: its name, and the names that come from it. To parse all
# sources instead would take a fifth of a second at each start.
_IMPORT = re.compile(
    rf'\n *from ({re.escape(_PACKAGE)}[\w.]*) import (\([^)]*\)|[^\n]*)')


def cache_folder(module: str) -> Path:
    """
    Return the folder in which compiled kernels of a module, given by its full name, are kept.

    It lies below NUMBA_CACHE_DIR when that is set, else below the user's cache folder, else (a
    user without a home that can be written to) below the system's temporary folder.
    """
    short = module.removeprefix(f'{_PACKAGE}.')
    return base_folder() / f'{short}-{_digest(module)}'


@cache
def base_folder() -> Path:
    """Return the folder below which all compiled kernels are kept."""
    bases = [Path(os.environ['NUMBA_CACHE_DIR'])] if os.environ.get('NUMBA_CACHE_DIR') else []
    home = os.environ.get('XDG_CACHE_HOME') or os.path.join(os.path.expanduser('~'), '.cache')
    bases += [Path(home), Path(tempfile.gettempdir()) / f'user-{os.getuid()}']
    folders = [base / 'rigid_sim_ros' / 'kernels' for base in bases]
    return next((folder for folder in folders if _writable(folder)), folders[-1])


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


@cache
def _digest(module: str) -> str:
    """Return a name for the present state of all sources that a module is made of."""
    needed: dict[str, bytes] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed[name], imports = _source(name)
            waiting += imports
    digest = hashlib.blake2b(digest_size=8)
    for name in sorted(needed):
        digest.update(name.encode() + b'\0' + needed[name])
    return digest.hexdigest()


@cache
def _source(module: str) -> tuple[bytes, tuple[str, ...]]:
    """Return a digest of a module's source, and the modules of the engine that it imports."""
    text = _path(module).read_bytes()
    imports: list[str] = []
    for parent, names in _IMPORT.findall('\n' + text.decode()):
        submodules = [f'{parent}.{name}' for name in re.findall(r'\w+', names)]
        imports += [name for name in (parent, *submodules) if _is_module(name)]
    return hashlib.blake2b(text).digest(), tuple(imports)


@cache
def _is_module(name: str) -> bool:
    return _path(name).is_file()


def _path(module: str) -> Path:
    relative = module.removeprefix(_PACKAGE).replace('.', '/').lstrip('/')
    path = _ENGINE / relative
    return path / '__init__.py' if path.is_dir() else path.with_suffix('.py')


class LateCache:
    """
    Stands where Numba's cache of a kernel will be, until somebody asks for that.

    To make one Numba tries whether it may write to the folder. Of some 550 kernels Python calls
    ten; the others would take a twelfth of a second at each start.
    """

    def __init__(self, kernel: Any, folder: Path) -> None:
        self._kernel = kernel
        self._folder = folder

    def __getattr__(self, name: str) -> Any:
        config: Any = numba.config
        with _one_at_a_time:
            elsewhere = config.CACHE_DIR
            config.CACHE_DIR = str(self._folder)
            try:
                self._kernel._cache = _Cache(self._kernel.py_func)
            finally:
                config.CACHE_DIR = elsewhere
        return getattr(self._kernel._cache, name)


class _Cache(_NumbasCache):
    """Numba's cache of a kernel, which reads machine code without what it takes to make some."""

    def __init__(self, function: Any) -> None:
        """Make the cache of a function, whose name tells it from others of the same source."""
        super().__init__(function)
        self._qualname = function.__qualname__

    def load_overload(self, kinds: Any, context: Any) -> Any:
        """
        Return the kernel for arguments of these types, or None.

        Before, Numba would see to it that all types and functions that it can compile are known
        and compile how references are counted, in a tenth of a second. Machine code of a kernel
        needs none of this: it counts no references. To compile one Numba does it all the same.
        """
        with self._guard_against_spurious_io_errors():
            return self._load_overload(kinds, context)

    def _index_key(self, kinds: Any, codegen: Any) -> Any:
        """
        Return what tells the entries of a kernel apart: types, processor and bytecode.

        Numba adds what the function closes over, pickled, and a pickled kernel holds a number that
        each process draws anew: no process would find what another one compiled. Here the name of
        the function says what it closes over, and the folder what that is made of.
        """
        kinds, target, (code, _) = super()._index_key(kinds, codegen)
        return kinds, target, code, self._qualname


class _NoCollector(event.Listener):
    """
    Keep Python's collector of cycles from running while Numba compiles.

    The compiler makes millions of objects and keeps most of them: to look through them again and
    again was an eighth of the time to compile.
    """

    def __init__(self) -> None:
        self._depth = 0
        self._was_on = False

    def on_start(self, event: Any) -> None:
        """Switch the collector off when the first of several nested compilations begins."""
        if self._depth == 0:
            self._was_on = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Switch it on again after the last."""
        self._depth -= 1
        if self._depth == 0 and self._was_on:
            gc.enable()


_register: Any = event.register
_register('numba:compile', _NoCollector())
