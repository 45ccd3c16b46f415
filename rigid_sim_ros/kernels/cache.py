# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where compiled kernels are kept.

Numba looks at one source file when it decides whether a cached kernel is still valid, while ours
call each other across files. The folder of a module's cache therefore carries a digest of its
source and of all that it imports: a change compiles anew what depends on it and nothing else, and
a package that lies in a read-only place finds its cache again. Where the package lies does not
matter: a second environment, or a clone, finds what the first one compiled. What arguments are
made of may stand in modules that a kernel does not import: that is part of the kernel's key.

What is read from a cache is run: whoever can write to its folder can do what this user can. So the
folder must belong to this user alone; and a file is read only if its digest fits, for a damaged
one could be anything.
"""

import atexit
import contextlib
from functools import cache
import grp
import hashlib
import logging
import os
from pathlib import Path
import pickle
import pwd
import re
import shutil
import stat
import tempfile
from typing import Any

import numba
from numba.core import caching

from rigid_sim_ros.kernels.type_description import description

_NumbasCache: Any = caching.FunctionCache
_NumbasFiles: Any = caching.IndexDataCacheFile
_OfSourceFile: Any = caching._SourceFileBackedLocatorMixin
_NumbasLocator: Any = caching._CacheLocator
_NumbasImpl: Any = caching.CompileResultCacheImpl
_logger = logging.getLogger(__name__)
_ROOT = Path(__file__).parents[1]       # of the package
_DIGEST = 16        # bytes
_BELOW = Path('rigid_sim_ros', 'kernels')
_PACKAGE = __package__.rpartition('.')[0]
# The import of a module of the package: its name, and the names that come from it. To parse all
# sources instead would take a fifth of a second at each start.
_IMPORT = re.compile(
    rf'\n *from ({re.escape(_PACKAGE)}[\w.]*) import (\([^)]*\)|[^\n]*)')


def cache_folder(module: str) -> Path:
    """
    Return the folder in which compiled kernels of a module, given by its full name, are kept.

    It lies below NUMBA_CACHE_DIR when that is set, else below the user's cache folder; if neither
    is a folder that this user alone can write to, in a temporary one, for this process only.
    """
    short = module.removeprefix(f'{_PACKAGE}.')
    return base_folder() / f'{short}-{_digest(module)}'


@cache
def base_folder() -> Path:
    """Return the folder below which all compiled kernels are kept."""
    home = os.environ.get('XDG_CACHE_HOME') or os.path.join(os.path.expanduser('~'), '.cache')
    # Without links, which somebody might let lead elsewhere later.
    bases = [Path(os.path.realpath(base))
             for base in (os.environ.get('NUMBA_CACHE_DIR'), home) if base]
    for base in bases:
        if _is_private(base):
            return base / _BELOW
    tried = ', '.join(str(base / _BELOW) for base in bases)
    try:
        fresh = Path(tempfile.mkdtemp(prefix='rigid_sim_ros_'))
    except OSError:
        _logger.warning('compiled kernels are not kept: no folder can be written to; set '
                        'NUMBA_CACHE_DIR to one that belongs to you alone')
        return bases[0] / _BELOW
    atexit.register(shutil.rmtree, fresh, ignore_errors=True)
    _logger.warning('compiled kernels are kept for this run only, %s cannot be written to or may '
                    'be written to by others: set NUMBA_CACHE_DIR to a folder that belongs to you '
                    'alone', tried)
    (fresh / _BELOW).mkdir(parents=True)
    return fresh / _BELOW


def _is_private(base: Path) -> bool:
    """Return whether the folder of kernels below a folder is there, and this user's alone."""
    folder = base / _BELOW
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        facts, *above = (path.lstat() for path in (folder, *folder.parents))
    except OSError:
        return False
    return (stat.S_ISDIR(facts.st_mode) and facts.st_uid == os.geteuid()
            and not _others_may_write(facts) and os.access(folder, os.W_OK | os.X_OK)
            # Whoever may write to a folder above can put another one in the place of this one.
            and not any(_others_may_replace(each) for each in above)
            and all(stat.S_ISDIR(each.st_mode) and each.st_uid in (0, os.geteuid())
                    for each in above[:len(_BELOW.parts)]))


def _others_may_replace(facts: os.stat_result) -> bool:
    """Return whether others may move what is in a folder; in one that is sticky nobody can."""
    return not facts.st_mode & stat.S_ISVTX and _others_may_write(facts)


def _others_may_write(facts: os.stat_result) -> bool:
    by_group = bool(facts.st_mode & stat.S_IWGRP) and not _is_own_group(facts.st_gid)
    return by_group or bool(facts.st_mode & stat.S_IWOTH)


def _is_own_group(group: int) -> bool:
    """Return whether a group is that of this user and nobody else, as many systems give one."""
    try:
        name, entry = pwd.getpwuid(os.geteuid()).pw_name, grp.getgrgid(group)
    except KeyError:
        return False
    return entry.gr_name == name and set(entry.gr_mem) <= {name}


@cache
def _digest(module: str) -> str:
    """Return a name for Numba and the present state of all sources that a module is made of."""
    needed: dict[str, bytes] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed[name], imports = _source(name)
            waiting += imports
    # Two environments with different versions of Numba would overwrite what the other one reads.
    digest = hashlib.blake2b(numba.__version__.encode(), digest_size=8)
    for name in sorted(needed):
        digest.update(name.encode() + b'\0' + needed[name])
    return digest.hexdigest()


@cache
def _source(module: str) -> tuple[bytes, tuple[str, ...]]:
    """Return a digest of a module's source, and the modules of the package that it imports."""
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
    path = _ROOT / relative
    return path / '__init__.py' if path.is_dir() else path.with_suffix('.py')


class LateCache:
    """
    Stands where Numba's cache of a kernel will be, until somebody asks for that.

    To make one Numba tries whether it may write to the folder. Of some 550 kernels Python calls
    ten; the others would take a twelfth of a second at each start.
    """

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel

    def __getattr__(self, name: str) -> Any:
        try:
            self._kernel._cache = _Cache(self._kernel.py_func)
        except (OSError, RuntimeError):     # no folder: then nothing is kept
            null: Any = caching.NullCache
            self._kernel._cache = null()
        return getattr(self._kernel._cache, name)


class _Locator(_OfSourceFile, _NumbasLocator):
    """Tells where the cache of a kernel is, wherever Numba is to keep that of other functions."""

    def __init__(self, function: Any, file: str) -> None:
        self._py_file, self._lineno = file, function.__code__.co_firstlineno
        folder = cache_folder(function.__module__)
        if Path(file) != _path(function.__module__):
            # It is compiled as a kernel of a module and stands elsewhere: no digest covers that.
            folder /= self.get_suitable_cache_subpath(file)
        self._cache_path = str(folder)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return self._cache_path


class _Impl(_NumbasImpl):
    """How a kernel is made bytes, with a place of its own."""

    _locator_classes = (_Locator,)


class _Files(_NumbasFiles):
    """
    The files of a kernel's cache, each with a digest of its bytes before them.

    Two processes that add kernels for different types at the same time may choose the same file:
    so a file also holds what its kernel is for, and is read for nothing else.
    """

    _index_path: str

    def save(self, key: Any, data: Any) -> None:
        super().save(key, (key, data))

    def load(self, key: Any) -> Any:
        found = super().load(key)
        return found[1] if found is not None and found[0] == key else None

    def _load_index(self) -> Any:
        try:
            version, stamp, overloads = _unpickled(self._index_path)
        except OSError:
            return {}
        is_fresh = (version, stamp) == (self._version, self._source_stamp)
        return overloads if is_fresh else {}

    def _save_index(self, overloads: Any) -> None:
        self._write(self._index_path, (self._version, self._source_stamp, overloads))

    def _load_data(self, name: str) -> Any:
        return _unpickled(self._data_path(name))

    def _save_data(self, name: str, data: Any) -> None:
        self._write(self._data_path(name), data)

    def _write(self, path: str, content: Any) -> None:
        data = self._dump(content)
        with self._open_for_write(path) as file:
            file.write(_digest_of(data) + data)


def _unpickled(path: str) -> Any:
    """Return what a file holds; OSError if it cannot be read or is not what was written."""
    raw = Path(path).read_bytes()
    if raw[:_DIGEST] != _digest_of(raw[_DIGEST:]):
        raise OSError(f'{path} is damaged')
    try:
        return pickle.loads(raw[_DIGEST:])
    except (AttributeError, ImportError) as error:      # of a class that this version lacks
        raise OSError(f'{path} is of another version') from error


def _digest_of(data: bytes) -> bytes:
    return hashlib.blake2b(data, digest_size=_DIGEST).digest()


class _Cache(_NumbasCache):
    """Numba's cache of a kernel, which reads machine code without what it takes to make some."""

    _impl_class = _Impl

    def __init__(self, function: Any) -> None:
        """Make the cache of a function, whose name tells it from others of the same source."""
        super().__init__(function)
        self._qualname = function.__qualname__
        self._cache_file: Any = _Files(self._cache_path, self._impl.filename_base,
                                       self._impl.locator.get_source_stamp())

    def save_overload(self, kinds: Any, data: Any) -> None:
        """Keep a compiled kernel, unless the disk takes no more."""
        with contextlib.suppress(OSError):
            super().save_overload(kinds, data)

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

        All of it is text and numbers, which every version of the package can read. Numba adds what
        the function closes over, pickled, and a pickled kernel holds a number that each process
        draws anew: no process would find what another one compiled. Here the name of the function
        says what it closes over, and the folder what that is made of.
        """
        kinds, target, (code, _) = super()._index_key(kinds, codegen)
        return tuple(map(description, kinds)), target, code, self._qualname
