# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a scene: every mistake with its place, its value and its mend."""
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import NamedTuple

# The way from the top of a scene to a value: keys of mappings and indices of lists.
Path = tuple[str | int, ...]

# [characters] A value longer than this is cut in a message; one line of a terminal stays one line.
_SHOWN = 60


class Problem(NamedTuple):
    """One mistake; as text it is always one line."""

    message: str
    key: str = ''
    file: str = ''
    line: int = 0

    def __str__(self) -> str:
        """Show 'FILE:LINE: bodies[0].mass: -2.0 kg, must be > 0'."""
        place = f'{self.file}:{self.line}' if self.line else self.file
        text = ': '.join(part for part in (place, self.key, self.message) if part)
        return ''.join(c if c.isprintable() else repr(c)[1:-1] for c in text)


class SceneError(ValueError):
    """
    A scene cannot be used.

    ``problems`` holds every mistake that was found, ``str()`` gives one line for each, and
    ``summary`` is a single line for a terminal or a log.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        """Keep the problems in the order of the file."""
        self.problems = tuple(sorted(problems, key=lambda problem: problem.line))
        assert self.problems, 'an error without a problem tells nobody anything'
        super().__init__('\n'.join(map(str, self.problems)))

    @property
    def summary(self) -> str:
        """Return the first problem on one line, and how many more there are."""
        more = len(self.problems) - 1
        rest = f' (and {more} more {"problems" if more > 1 else "problem"})' if more else ''
        return f'{self.problems[0]}{rest}'


def dotted(path: Path) -> str:
    """Write a path as a user would: ``('bodies', 0, 'mass')`` is ``bodies[0].mass``."""
    text = ''
    for step in path:
        text += f'[{step}]' if isinstance(step, int) else f'.{step}'
    return text.removeprefix('.')


def shown(value: object) -> str:
    """Write a value as Python does, cut to a readable length."""
    try:
        text = repr(value)
    except Exception:  # An int with more digits than Python prints, or a stranger's object.
        text = f'<{type(value).__name__}>'
    return text if len(text) <= _SHOWN else f'{text[:_SHOWN - 4]}...{text[-1]}'


def nearest(word: object, known: Iterable[str]) -> str:
    """
    Write the mend for a word that is not known.

    Names the most similar of the known words, or lists them all when none is similar.
    """
    names = list(known)
    match = get_close_matches(str(word)[:_SHOWN], names, n=1, cutoff=0.5)
    if match:
        return f"did you mean '{match[0]}'?"
    return f'must be {either(names)}' if names else 'there is none'


def either(words: Sequence[str]) -> str:
    """Write a choice: ``a``, ``a or b``, ``a, b or c``."""
    *head, last = words
    return f'{", ".join(head)} or {last}' if head else last
