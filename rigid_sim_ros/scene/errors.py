# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a scene: every mistake with its place, its value and its mend."""
from collections.abc import Callable, Iterable
from typing import TypeAlias

from rigid_sim_ros.problems import counted, Problem

# The way from the top of a scene to a value: keys of mappings and indices of lists.
Path: TypeAlias = tuple[str | int, ...]
# Takes the place of a mistake and what it is.
Report: TypeAlias = Callable[[Path, str], None]

# [characters] A value longer than this is cut in a message; one line of a terminal stays one line.
_SHOWN = 60


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
        rest = f' (and {counted(more, "more problem")})' if more else ''
        return f'{self.problems[0]}{rest}'


def dotted(path: Path) -> str:
    """Write a path as a user would: ``('bodies', 0, 'mass')`` is ``bodies[0].mass``."""
    text = ''
    for step in path:
        text += f'[{step}]' if isinstance(step, int) else f'.{step}'
    return text.removeprefix('.')


def below(place: Path, report: Report) -> Report:
    """Return what reports mistakes whose places are given from `place` on."""
    return lambda path, message: report((*place, *path), message)


def shown(value: object) -> str:
    """Write a value as Python does, cut to a readable length."""
    try:
        text = repr(value)
    except Exception:  # An int with more digits than Python prints, or a stranger's object.
        text = f'<{type(value).__name__}>'
    return text if len(text) <= _SHOWN else f'{text[:_SHOWN - 4]}...{text[-1]}'
