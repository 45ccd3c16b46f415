# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The part of the page that switches overlays and the ground, the same for runs and bags."""
from collections.abc import Callable, Sequence
from typing import Any

import viser

from rigid_sim_ros.viewer.inputs import put
from rigid_sim_ros.viewer.overlays import Overlays, SPRINGS
from rigid_sim_ros.viewer.stage import Stage

_GRID, _SHADOWS = 'ground grid', 'shadows'
_FIRST = frozenset({SPRINGS})   # what is switched on at first: part of the scene
# [bodies] Larger scenes begin without shadows.
_MOST_SHADOWS = 60


class ShowPanel:
    """Checkboxes for what is shown; they keep their state when the scene changes."""

    def __init__(self, server: viser.ViserServer, kinds: Sequence[str],
                 switched: Callable[[str, bool], None]) -> None:
        self._server = server
        self._switched = switched
        self._stage: Stage | None = None
        self._overlays: Overlays | None = None
        self._boxes = {kind: server.gui.add_checkbox(kind, initial_value=kind in _FIRST)
                       for kind in kinds}
        self._grid = server.gui.add_checkbox(_GRID, initial_value=True)
        self._shadows = server.gui.add_checkbox(_SHADOWS, initial_value=True)
        for kind, box in self._boxes.items():
            box.on_update(self._switcher(kind))
        self._grid.on_update(lambda _: self._switch_grid())
        self._shadows.on_update(lambda _: self._switch_shadows())

    def attach(self, stage: Stage, overlays: Overlays) -> None:
        """Apply the switches to a new scene."""
        self._stage, self._overlays = stage, overlays
        for kind in self._boxes:
            self._switch(kind)
        self._switch_grid()
        # Each of the three shadow maps costs as much as the picture itself.
        put(self._shadows, len(stage.moving) <= _MOST_SHADOWS)
        self._switch_shadows()

    def _switcher(self, kind: str) -> Callable[[Any], None]:
        return lambda _: self._switch(kind)

    def _switch(self, kind: str) -> None:
        wanted = self._boxes[kind].value
        if self._overlays is not None:
            self._overlays.switch(kind, wanted)
        self._switched(kind, wanted)

    def _switch_shadows(self) -> None:
        if self._stage is not None:
            self._stage.show_shadows(self._shadows.value)

    def _switch_grid(self) -> None:
        if self._stage is not None:
            self._stage.show_ground(self._grid.value)
