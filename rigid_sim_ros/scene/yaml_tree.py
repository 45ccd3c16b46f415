# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
YAML text becomes a tree of nodes.

ruamel.yaml knows YAML 1.2 and says well what is wrong, and takes 50 us for a value. The parser of
libyaml, in PyYAML, takes 1 us. So libyaml reads what is right, with ruamel's rules for what a
plain word means, and ruamel what libyaml refuses. Where PyYAML was built without libyaml all is
ruamel's.
"""

from collections.abc import Iterator
from contextlib import contextmanager
import gc
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode
from ruamel.yaml.resolver import implicit_resolvers
from yaml.error import MarkedYAMLError, YAMLError
import yaml.nodes

try:
    from yaml.cyaml import CParser
except ImportError:
    CParser = None

MAPPING = (MappingNode, yaml.nodes.MappingNode)
SEQUENCE = (SequenceNode, yaml.nodes.SequenceNode)
SCALAR = (ScalarNode, yaml.nodes.ScalarNode)

# What libyaml says of more than a thousand levels; ruamel takes two seconds to find the same.
_TOO_DEEP = 'exceeded maximum nesting depth'
_PREFIX = 'tag:yaml.org,2002:'
# By the first letter of a plain word, the tags that it may have and what tells whether it does.
_WORDS: dict[str, list[tuple[str, Any]]] = {}
for _versions, _name, _form, _letters in implicit_resolvers:
    if (1, 2) in _versions:
        for _letter in _letters:
            _WORDS.setdefault(_letter, []).append((str(_name), _form.match))


def compose(text: str) -> Any:
    """
    Return the tree of the only document, None without one.

    Errors are those of ruamel.yaml, and RecursionError where the text is nested too deeply.
    """
    if CParser is not None:
        try:
            return _Quick(text).get_single_node()
        except (YAMLError, ValueError, RecursionError) as error:
            if isinstance(error, MarkedYAMLError) and error.problem == _TOO_DEEP:
                raise RecursionError(_TOO_DEEP) from None
            # ruamel says what is wrong, if it finds that too
    slow = YAML(typ='safe', pure=True)
    slow.composer.warn_double_anchors = False
    return slow.compose(text)


@contextmanager
def collector_paused() -> Iterator[None]:
    """
    Keep Python's collector of cycles from running.

    It would look again and again through the values of a large scene, none of which is garbage:
    four fifths of the time to read 10 000 bodies.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


if CParser is not None:
    class _Quick(CParser):
        """libyaml's parser, with the words of YAML 1.2."""

        def __init__(self, text: str) -> None:
            """Begin to read."""
            super().__init__(text)
            self._tags: dict[str, str] = {}     # of plain words: many occur again and again

        def resolve(self, kind: Any, value: Any, implicit: Any) -> str:
            """Return the tag of a node that is given none."""
            if kind is not yaml.nodes.ScalarNode:
                return _PREFIX + ('map' if kind is yaml.nodes.MappingNode else 'seq')
            if not implicit[0]:
                return _PREFIX + 'str'
            if value not in self._tags:
                self._tags[value] = next((name for name, match in _WORDS.get(value[:1], ())
                                          if match(value)), _PREFIX + 'str')
            return self._tags[value]

        def descend_resolver(self, parent: Any, index: Any) -> None:
            """Tags do not depend on where a node stands."""

        def ascend_resolver(self) -> None:
            """Nor on where it does not any more."""
