# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a model's file, and what of it has no effect: each with its place."""

from collections.abc import Iterable
from typing import Protocol

from rigid_sim_ros.problems import counted, Problem


class Place(Protocol):
    """An element of a file."""

    file: str
    line: int

    @property
    def path(self) -> str:
        """Return where it stands, such as `joint 'shoulder'/limit`."""


class ModelError(ValueError):
    """A model cannot be used; ``findings`` says why, one for each mistake."""

    def __init__(self, findings: Iterable[Problem]) -> None:
        """Keep the findings."""
        self.findings = tuple(findings)
        super().__init__('\n'.join(map(str, self.findings)))


class Findings:
    """Collects what a reader finds, so that all of it can be told at once."""

    def __init__(self) -> None:
        """Begin without any."""
        self.errors: list[Problem] = []
        self._notes: list[Problem] = []
        self._ignored: dict[str, tuple[Problem, int]] = {}

    def error(self, place: Place, message: str) -> None:
        """Keep what makes the model unusable."""
        self.errors.append(Problem(message, place.path, place.file, place.line))

    def note(self, place: Place, message: str) -> None:
        """Keep what the author should know."""
        self._notes.append(Problem(message, place.path, place.file, place.line))

    def ignore(self, place: Place, what: str, why: str = '') -> None:
        """Keep that `what` has no effect here: one line for each kind, with its first place."""
        text = f'{what} is ignored{": " if why else ""}{why}'
        first, count = self._ignored.get(text, (Problem(text, '', place.file, place.line), 0))
        self._ignored[text] = first, count + 1

    @property
    def notes(self) -> list[Problem]:
        """Return a line for each thing that is worth one."""
        ignored = [first if count == 1 else first._replace(message=(
            f'{first.message} (here and at {counted(count - 1, "more place")})'))
            for first, count in self._ignored.values()]
        return [*self._notes, *ignored]

    def stop(self) -> None:
        """Raise ModelError if anything makes the model unusable."""
        if self.errors:
            raise ModelError(self.errors)
