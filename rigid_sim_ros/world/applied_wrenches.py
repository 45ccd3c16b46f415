# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The book of the wrenches in effect: what a world's users applied, and until when."""

from collections.abc import Mapping, Sequence

import numpy as np

from rigid_sim_ros.engine.dynamics.wrenches import no_wrenches, Wrenches
from rigid_sim_ros.kernels.arrays import Array


# What is said of a wrench.
FIELDS = tuple(name for name in Wrenches._fields if name != 'in_use')
_LEAST = 8      # rows to begin with


class AppliedWrenches:
    """
    Rows in the order in which they were applied, which is the order in which they are added up.

    Floating-point sums depend on their order, so runs repeat only if the order does.
    """

    def __init__(self) -> None:
        """Begin with none."""
        self._wrenches = no_wrenches(_LEAST)
        self._sources: list[str] = []

    @property
    def wrenches(self) -> Wrenches:
        """The rows and room for more, as the kernels read them and count them down."""
        return self._wrenches

    def rows(self) -> dict[str, np.ndarray]:
        """Return the rows, by the names of their fields."""
        return {name: getattr(self._wrenches, name)[:len(self._sources)] for name in FIELDS}

    @property
    def sources(self) -> list[str]:
        """Who applied each row, '' for nobody in particular."""
        return self._sources

    def add(self, source: str, body: int, frame: int, point: Array | None, force: Array,
            torque: Array, steps: int) -> None:
        """Append a row."""
        r = len(self._sources)
        if r == self._wrenches.body.shape[0]:
            self._put(self.rows(), 2 * r)
        self._sources.append(source)
        rows = self._wrenches
        rows.in_use[0] = r + 1
        rows.body[r], rows.frame[r], rows.at_point[r] = body, frame, point is not None
        rows.force[r], rows.torque[r] = force, torque
        rows.point[r] = 0.0 if point is None else point
        rows.steps_left[r] = steps

    def remove(self, source: str) -> None:
        """Drop the rows of a source."""
        if source in self._sources:
            self._keep(np.array([name != source for name in self._sources]))

    def remove_finished(self) -> None:
        """Drop the rows whose time is over."""
        if not self._sources:
            return      # of most steps
        active = self._wrenches.steps_left[:len(self._sources)] > 0
        if not active.all():
            self._keep(active)

    def steps_until_one_ends(self, at_most: int) -> int:
        """Return how many steps can be taken with all of them, up to a limit."""
        if not self._sources:
            return at_most
        return min(at_most, int(self._wrenches.steps_left[:len(self._sources)].min()))

    def replace(self, rows: Mapping[str, np.ndarray], sources: Sequence[str]) -> None:
        """Put these rows in the place of all, as `rows` returns them."""
        self._sources = list(sources)
        self._put(rows, len(sources) + _LEAST)

    def clear(self) -> None:
        """Drop all rows."""
        self._sources = []
        self._wrenches.in_use[0] = 0

    def _put(self, rows: Mapping[str, np.ndarray], room: int) -> None:
        self._wrenches = no_wrenches(room)
        for name, row in rows.items():
            getattr(self._wrenches, name)[:len(row)] = row
        self._wrenches.in_use[0] = len(self._sources)

    def _keep(self, chosen: np.ndarray) -> None:
        for row in self.rows().values():
            kept = row[chosen]
            row[:len(kept)] = kept
        self._sources = [name for name, keep in zip(self._sources, chosen, strict=True) if keep]
        self._wrenches.in_use[0] = len(self._sources)
