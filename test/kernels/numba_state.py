# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a process holds in the modules of Numba and llvmlite, in words.

All modules are walked from their names on: functions by where they are written, classes by their
attributes, containers by their contents whatever the order, and objects of Numba's own classes by
their attributes. What is only known by a place in memory is described by its type.
"""

from collections import Counter, deque
from collections.abc import Mapping
from functools import cache
import re
import sys
import types
import weakref

# What everybody adds to who needs something first: types are numbered as they come and known by a
# weak reference, and some have a class made of the type alone; so are blocks of what is inlined;
# Python notes how it pickles.
SHARED = '_code', '_typecache', '_struct_proxy_cache', '_the_max_label', '__slotnames__'
LIBRARIES = 'numba', 'llvmlite'
# Of an object, and the number of a function.
_ADDRESS = re.compile(r' at 0x[0-9a-fA-F]+|B\d+v\d+|\d{9,}')
_PLAIN = str, bytes, int, float, complex, bool, type(None)
_WEAK = weakref.WeakKeyDictionary, weakref.WeakValueDictionary, weakref.WeakSet
_PROXIES = weakref.ProxyTypes   # which nobody can ask anything once their object is gone


def modules():
    """Return the names of the modules of both libraries that this process has imported."""
    return [name for name in list(sys.modules) if _is_theirs(name)]


def _is_theirs(name):
    return name.partition('.')[0] in LIBRARIES


class Walk:
    """Looks at everything that can be reached from some modules, each object once."""

    def __init__(self, names):
        """Begin with the modules of these names."""
        self.lines = {}         # by the path of an attribute: what it is
        self._seen = set()
        self._waiting = deque((name, sys.modules[name]) for name in names)
        while self._waiting:
            path, owner = self._waiting.popleft()
            if id(owner) not in self._seen:
                self._seen.add(id(owner))
                self._attributes(path, owner)

    def _attributes(self, path, owner):
        for name, value in sorted(_attributes_of(owner).items()):
            self.lines[f'{path}.{name}'] = self.describe(value)
            for key, part in self._parts(name, value):
                if _is_open(part):
                    self._waiting.append((f'{path}.{key}', part))

    def describe(self, value, depth=4):
        """Return a value in words, without what lies behind objects in it."""
        if type(value) in _PROXIES:
            return 'proxy'
        if isinstance(value, _PLAIN):
            return _word(value)
        if isinstance(value, types.FunctionType):
            code = value.__code__
            return (f'{value.__module__}.{value.__qualname__} '
                    f'{code.co_filename}:{code.co_firstlineno}')
        if isinstance(value, type):
            return f'{value.__module__}.{value.__qualname__}'
        if isinstance(value, (classmethod, staticmethod)):
            return self.describe(value.__func__)
        if isinstance(value, property):
            return str([self.describe(each) for each in (value.fget, value.fset, value.fdel)])
        kind = self.describe(type(value))
        if isinstance(value, _WEAK) or depth == 0:
            return kind
        if _is_mapping(type(value)):
            value = list(value.items())
        elif not isinstance(value, (list, tuple, set, frozenset, deque)):
            return kind
        return f'{kind} of {len(value)}: {sorted(self.describe(one, depth - 1) for one in value)}'

    def _parts(self, name, value, depth=3):
        """Return what an attribute holds that may have attributes itself, each with its path."""
        yield name, value
        if depth == 0 or type(value) in _PROXIES or isinstance(value, _WEAK):
            return
        within = []
        if _is_mapping(type(value)):
            within = [(_ADDRESS.sub('', str(key)), part) for key, part in list(value.items())]
        elif isinstance(value, tuple):
            within = list(enumerate(value))
        elif isinstance(value, (list, deque)):
            within = [(self.describe(part, 2), part) for part in value]
        elif isinstance(value, types.FunctionType):
            within = [(cell, getattr(content, 'cell_contents', None)) for cell, content in zip(
                value.__code__.co_freevars, value.__closure__ or (), strict=True)]
        taken = Counter()
        for key, part in within:
            taken[key] += 1
            yield from self._parts(f'{name}[{key} {taken[key]}]', part, depth - 1)


@cache
def _is_mapping(kind):
    return issubclass(kind, (Mapping, types.MappingProxyType))


def _word(value):
    """Return a value without what differs from process to process: places, and machine code."""
    if isinstance(value, bytes):
        return 'bytes'
    if isinstance(value, int) and value > 1 << 32:
        return 'address'
    return _ADDRESS.sub('', repr(value))


def _attributes_of(owner):
    found = getattr(owner, '__dict__', None)
    if not isinstance(found, (dict, types.MappingProxyType)):
        return {}
    return {name: value for name, value in list(found.items())
            if isinstance(name, str) and name not in SHARED}


def _is_open(value):
    """Return whether the attributes of a value are looked at: those of objects of theirs."""
    if type(value) in _PROXIES or isinstance(value, types.ModuleType):
        return False    # each module is walked by its own name
    of = value if isinstance(value, (type, types.FunctionType)) else type(value)
    return _is_theirs(getattr(of, '__module__', None) or '')
