# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Scene text and Python dictionaries become plain data that knows its lines.

YAML is read as a tree of nodes and turned into dict, list, str, int, float, bool and None here: no
tag can construct anything else, a key that appears twice is seen, and every value can name its
line.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Protocol

import numpy as np
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from rigid_sim_ros.problems import Problem
from rigid_sim_ros.scene.errors import dotted, Path, SceneError, shown
from rigid_sim_ros.scene.yaml_tree import compose, MAPPING, SCALAR, SEQUENCE

# Largest number of values in a scene once its aliases are written out, where these are more than
# twice what stands there. A thousand bodies have 3e4; a "billion laughs" file of 1 kB has 1e9 and
# would fill the memory.
MAX_VALUES = 500_000
# Largest number of values in Python data, which has no text that it could be compared with.
_MOST_DATA = 20_000_000
# Deepest nesting. A scene needs 8; a thousand open brackets would exhaust the interpreter's stack.
MAX_DEPTH = 40

_PREFIX = 'tag:yaml.org,2002:'  # of the tags of YAML itself
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
        self._known: dict[int, tuple[Any, int]] = {}    # of mappings and lists
        self._open: set[int] = set()
        self._read_so_far = 0   # values, one that an alias repeats only once
        self.data = self._value(self._root, ())[0]
        self._known.clear()

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
        if isinstance(node, SCALAR):
            self._read_so_far += 1
            return self._scalar(node, path), 1
        if id(node) in self._known:
            return self._known[id(node)]
        if id(node) in self._open:
            raise self._error(node, path, 'an alias that contains itself, must be written out')
        if len(path) > MAX_DEPTH:
            raise self._error(node, path[:8], _TOO_DEEP)
        self._open.add(id(node))
        data, count = self._mapping(node, path) if isinstance(node, MAPPING) else (
            self._list(node, path))
        self._read_so_far += 1
        if count > max(MAX_VALUES, 2 * self._read_so_far):
            raise self._error(node, path, _TOO_MANY)
        self._open.remove(id(node))
        self._known[id(node)] = data, count
        return data, count

    def _item(self, node: Any, path: Path, step: str | int) -> tuple[Any, int]:
        """Return what stands at `step` in the mapping or list at `path`, and its count."""
        if isinstance(node, SCALAR) and (convert := _SCALARS.get(str(node.tag))) is not None:
            # Most values of a scene: without a path, which is for mistakes.
            try:
                data = convert(node.value)
            except (KeyError, ValueError):
                return self._value(node, (*path, step))
            self._read_so_far += 1
            return data, 1
        return self._value(node, (*path, step))

    def _scalar(self, node: Any, path: Path) -> Any:
        tag = str(node.tag)
        if tag not in _SCALARS:
            raise self._tag_error(node, path)
        try:
            return _SCALARS[tag](node.value)
        except (KeyError, ValueError):
            problem = f'{shown(node.value)}, cannot be read as {_tag(node)}'
            raise self._error(node, path, problem) from None

    def _list(self, node: Any, path: Path) -> tuple[list[Any], int]:
        if _tag(node) != 'seq':
            raise self._tag_error(node, path)
        items = [self._item(item, path, i) for i, item in enumerate(node.value)]
        return [data for data, _ in items], 1 + sum([count for _, count in items])

    def _mapping(self, node: Any, path: Path) -> tuple[dict[str, Any], int]:
        if _tag(node) != 'map':
            raise self._tag_error(node, path)
        own: dict[str, Any] = {}
        merged: dict[str, Any] = {}
        keys: dict[str, Any] = {}
        total = 1
        for key_node, value_node in node.value:
            key, tag = key_node.value, _tag(key_node)
            if tag not in ('str', 'merge'):
                shape = key if isinstance(key_node, SCALAR) else 'of several values'
                raise self._error(key_node, path, f'key {shape}, must be text')
            if key in keys:
                raise self._error(key_node, (*path, key), 'the key appears twice, first in line '
                                  f'{_line(keys[key])}: remove one of them')
            keys[key] = key_node
            data, count = self._item(value_node, path, key)
            total += count
            if tag == 'str':
                own[key] = data
            elif isinstance(data, dict):
                merged = data
            else:
                raise self._error(key_node, (*path, key), 'must name one mapping: <<: *name')
        return {**merged, **own} if merged else own, total

    def _tag_error(self, node: Any, path: Path) -> SceneError:
        tag = shown(_tag(node))
        return self._error(node, path, f'tag {tag}, must be plain data: remove the tag')

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
    return str(node.tag).removeprefix(_PREFIX)


def _line(node: Any) -> int:
    return int(node.start_mark.line) + 1


def _int(text: str) -> int:
    digits = text.replace('_', '')
    based = digits.lstrip('+-')[:2].lower() in ('0x', '0o', '0b')
    return int(digits, 0 if based else 10)


def _float(text: str) -> float:
    with suppress(ValueError):
        return float(text)
    # YAML writes .inf and .nan where Python has inf and nan.
    return float(text.replace('_', '').lower().replace('.inf', 'inf').replace('.nan', 'nan'))


# The scalar types of YAML 1.2 by tag, and dates, which a scene has no use for, as the text they
# are.
_SCALARS: dict[str, Callable[[str], Any]] = {
    f'{_PREFIX}str': str,
    f'{_PREFIX}timestamp': str,
    f'{_PREFIX}null': lambda _: None,
    f'{_PREFIX}bool': lambda text: {'true': True, 'false': False}[text.lower()],
    f'{_PREFIX}int': _int,
    f'{_PREFIX}float': _float,
}
