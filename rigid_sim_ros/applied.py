# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The book of the wrenches in effect: what a world's users applied, and until when."""

import numpy as np

from rigid_sim_ros.engine.arrays import Array
from rigid_sim_ros.engine.wrenches import no_wrenches, Wrenches


class AppliedWrenches:
    """
    Rows in the order in which they were applied, which is the order in which they are added up.

    Floating-point sums depend on their order, so runs repeat only if the order does.
    """

    def __init__(self) -> None:
        """Begin with none."""
        self._room = no_wrenches(8)
        self._sources: list[str] = []
        self._rows = self._view()

    def _view(self) -> Wrenches:
        return Wrenches._make(field[:len(self._sources)] for field in self._room)

    @property
    def rows(self) -> Wrenches:
        """The rows, as the kernels read them and count them down."""
        return self._rows

    @property
    def sources(self) -> list[str]:
        """Who applied each row, '' for nobody in particular."""
        return self._sources

    def add(self, source: str, body: int, frame: int, point: Array | None, force: Array,
            torque: Array, steps: int) -> None:
        """Append a row."""
        r = len(self._sources)
        if r == self._room.body.shape[0]:
            grown = no_wrenches(2 * r)
            for new, old in zip(grown, self._room, strict=True):
                new[:r] = old
            self._room = grown
        self._sources.append(source)
        self._rows = self._view()
        rows = self._rows
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
        active = self._rows.steps_left > 0
        if not active.all():
            self._keep(active)

    def replace(self, rows: Wrenches, sources: list[str]) -> None:
        """Put these rows in the place of all."""
        self._room = Wrenches._make(np.concatenate([row, free]) for row, free in zip(
            rows, no_wrenches(8), strict=True))
        self._sources = list(sources)
        self._rows = self._view()

    def _keep(self, chosen: np.ndarray) -> None:
        for field in self._room:
            kept = field[:len(self._sources)][chosen]
            field[:len(kept)] = kept
        self._sources = [name for name, keep in zip(self._sources, chosen, strict=True) if keep]
        self._rows = self._view()
