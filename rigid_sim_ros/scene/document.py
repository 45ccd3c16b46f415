# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Scene text and Python dictionaries become plain data that knows its lines.

YAML is read as a tree of nodes and turned into dict, list, str, int, float, bool and None here: no
tag can construct anything else, a key that appears twice is seen, and every value can name its
line.
"""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from rigid_sim_ros.problems import Problem
from rigid_sim_ros.scene.errors import dotted, Path, SceneError, shown
from rigid_sim_ros.scene.yaml_tree import compose, MAPPING, SCALAR, SEQUENCE

# Largest number of values in a scene once its aliases are written out, where these are more than
# twice what stands there. A thousand bodies have 3e4; a "billion laughs" file of 1 kB has 1e9 and
# would fill the memory.
MAX_VALUES = 2_000_000
# Largest number of values in Python data, which has no text that it could be compared with.
_MOST_DATA = 20_000_000
# Deepest nesting. A scene needs 8; a thousand open brackets would exhaust the interpreter's stack.
MAX_DEPTH = 40

_TOO_DEEP = f'nested deeper than {MAX_DEPTH} levels, a scene needs no more than 8'
_TOO_MANY = f'more than {MAX_VALUES} values with all aliases written out, must be fewer'


class Source(Protocol):
    """Where a scene comes from: its data, and how to name a place in it."""

    data: Any

    def problem(self, path: Path, message: str) -> Problem:
        """Return a problem that names the place of `path`."""


class DictSource:
    """A scene given as Python data: its problems name a key, but neither file nor line."""

    def __init__(self, data: object) -> None:
        """Copy the data; tuples, NumPy arrays and NumPy numbers become lists and numbers."""
        self._count = 0
        self.data = self._plain(data, ())

    def problem(self, path: Path, message: str) -> Problem:
        """Return a problem that names the key."""
        return Problem(message, dotted(path))

    def _plain(self, value: object, path: Path) -> Any:
        if isinstance(value, np.ndarray | np.generic):
            value = value.tolist()
        self._count += 1
        if len(path) > MAX_DEPTH:
            raise SceneError([self.problem(path[:8], _TOO_DEEP)])
        if self._count > _MOST_DATA:
            raise SceneError([self.problem(path[:8], _TOO_MANY)])
        if isinstance(value, Mapping):
            for key in value:
                if not isinstance(key, str):
                    raise SceneError([self.problem(path, f'key {shown(key)}, must be text')])
            return {key: self._plain(item, (*path, key)) for key, item in value.items()}
        if isinstance(value, list | tuple):
            return [self._plain(item, (*path, i)) for i, item in enumerate(value)]
        return value


class YamlSource:
    """A scene given as YAML: its problems name file, line and key."""

    def __init__(self, text: str, file: str) -> None:
        """Read the text; raises SceneError where it is not YAML or not plain data."""
        self._file = file
        self._root = _compose(text, file)
        self._known: dict[int, tuple[Any, int]] = {}
        self._open: set[int] = set()
        self.data = self._value(self._root, ())[0]

    def problem(self, path: Path, message: str) -> Problem:
        """Return a problem that names the key and the line where it stands or should stand."""
        node: Any = self._root
        line = _line(self._root)
        for step in path:
            if isinstance(node, MAPPING):
                node, line = _entry(node, step) or (None, line)
            elif isinstance(node, SEQUENCE) and step in range(len(node.value)):
                node = node.value[step]
                line = _line(node)
            else:
                break
        return Problem(message, dotted(path), self._file, line)

    def _value(self, node: Any, path: Path) -> tuple[Any, int]:
        """
        Return the data of a node, and how many values it is with all aliases written out.

        An alias shares its data with the anchor, so reading takes no longer than the file is.
        """
        if id(node) in self._known:
            return self._known[id(node)]
        if id(node) in self._open:
            raise self._error(node, path, 'an alias that contains itself, must be written out')
        if len(path) > MAX_DEPTH:
            raise self._error(node, path[:8], _TOO_DEEP)
        self._open.add(id(node))
        data, count = self._read(node, path)
        if count > max(MAX_VALUES, 2 * len(self._known)):
            raise self._error(node, path, _TOO_MANY)
        self._open.remove(id(node))
        self._known[id(node)] = data, count
        return data, count

    def _read(self, node: Any, path: Path) -> tuple[Any, int]:
        tag = _tag(node)
        if isinstance(node, MAPPING) and tag == 'map':
            return self._mapping(node, path)
        if isinstance(node, SEQUENCE) and tag == 'seq':
            items = [self._value(item, (*path, i)) for i, item in enumerate(node.value)]
            return [data for data, _ in items], 1 + sum(count for _, count in items)
        if isinstance(node, SCALAR) and tag in _SCALARS:
            try:
                return _SCALARS[tag](node.value), 1
            except (KeyError, ValueError):
                problem = f'{shown(node.value)}, cannot be read as {tag}'
                raise self._error(node, path, problem) from None
        raise self._error(node, path, f'tag {shown(tag)}, must be plain data: remove the tag')

    def _mapping(self, node: Any, path: Path) -> tuple[dict[str, Any], int]:
        own: dict[str, Any] = {}
        merged: dict[str, Any] = {}
        lines: dict[str, int] = {}
        total = 1
        for key_node, value_node in node.value:
            key = key_node.value
            if _tag(key_node) not in ('str', 'merge'):
                shape = key if isinstance(key_node, SCALAR) else 'of several values'
                raise self._error(key_node, path, f'key {shape}, must be text')
            if key in lines:
                raise self._error(key_node, (*path, key), 'the key appears twice, first in line '
                                  f'{lines[key]}: remove one of them')
            lines[key] = _line(key_node)
            data, count = self._value(value_node, (*path, key))
            total += count
            if _tag(key_node) == 'str':
                own[key] = data
            elif isinstance(data, dict):
                merged = data
            else:
                raise self._error(key_node, (*path, key), 'must name one mapping: <<: *name')
        return {**merged, **own}, total

    def _error(self, node: Any, path: Path, message: str) -> SceneError:
        return SceneError([Problem(message, dotted(path), self._file, _line(node))])


def _compose(text: str, file: str) -> Any:
    """Return the tree of the only document in the text."""
    line = 1
    try:
        root = compose(text)
        if root is not None:
            return root
        message = 'the scene is empty, must have bodies'
    except RecursionError:
        message = _TOO_DEEP
    except MarkedYAMLError as error:
        reason = ', '.join(filter(None, (error.context, error.problem)))
        message = f'not YAML: {reason}'
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else line
    except (YAMLError, ValueError) as error:
        message = f'not YAML: {" ".join(str(error).split())}'
    raise SceneError([Problem(message, '', file, line)])


def _entry(node: Any, key: str | int) -> tuple[Any, int] | None:
    """Return the value of a key and the key's line, in the mapping or in what it merges."""
    for key_node, value_node in node.value:
        if key_node.value == key:
            return value_node, _line(key_node)
    for key_node, value_node in node.value:
        if _tag(key_node) == 'merge' and isinstance(value_node, MAPPING):
            return _entry(value_node, key)
    return None


def _tag(node: Any) -> str:
    return str(node.tag).removeprefix('tag:yaml.org,2002:')


def _line(node: Any) -> int:
    return int(node.start_mark.line) + 1


def _int(text: str) -> int:
    digits = text.replace('_', '')
    based = digits.lstrip('+-')[:2].lower() in ('0x', '0o', '0b')
    return int(digits, 0 if based else 10)


def _float(text: str) -> float:
    # YAML writes .inf and .nan where Python has inf and nan.
    return float(text.replace('_', '').lower().replace('.inf', 'inf').replace('.nan', 'nan'))


# The scalar types of YAML 1.2 by tag, and dates, which a scene has no use for, as the text they
# are.
_SCALARS: dict[str, Callable[[str], Any]] = {
    'str': str,
    'timestamp': str,
    'null': lambda _: None,
    'bool': lambda text: {'true': True, 'false': False}[text.lower()],
    'int': _int,
    'float': _float,
}
