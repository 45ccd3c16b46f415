# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A page that a test tells of a simulation, without one."""
import time
from typing import Any

import numpy as np
from viewer.browsing import SCENE

from rigid_sim_ros.messages.codec import Marker, MarkersEncoder, StateEncoder
from rigid_sim_ros.scene.reader import scene_from_text
from rigid_sim_ros.viewer.live import LivePage
from rigid_sim_ros.viewer.server import PageServer
from rigid_sim_ros.viewer.simulation import Applied, Inbox, Report

_POINTS, _LINES = 7, 5      # visualization_msgs/Marker
_NS = 1_000_000_000


class Nobody:
    """Takes what the page wants of a simulation."""

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments: None


class Told:
    """A page of bodies on circles; each turn tells it everything anew, a chart's point too."""

    def __init__(self, server: PageServer, driver: Any = None) -> None:
        self._inbox = Inbox()
        self._inbox.node = '/told'
        self._live = LivePage(server, self._inbox, driver or Nobody())
        self.turns = 0
        self.show(SCENE)

    def show(self, scene: str) -> None:
        """Change the scene."""
        self._inbox.scene = scene
        self._inbox.applied = {}
        self._names = scene_from_text(scene).names
        self._encoder = StateEncoder('world', self._names)

    @property
    def time(self) -> float:
        """The simulation time [s] of the last turn."""
        return self.turns / 4

    def turn(self) -> None:
        """Tell of a state, a contact, a wrench on each body, and a report."""
        self.turns += 1
        t_ns, inbox, n = round(self.time * _NS), self._inbox, len(self._names)
        angle = 0.1 * self.turns + np.arange(n)
        p = np.stack([np.cos(angle), np.sin(angle), 0.1 * angle % 1.0], axis=1)
        q = np.stack([np.zeros(n), np.zeros(n), np.sin(angle), np.cos(angle)], axis=1)
        inbox.state = self._encoder.encode(t_ns, p, q, p, p)
        inbox.contacts = contact(t_ns, p[0])
        inbox.applied = {name: Applied(t_ns, '', (0.1, 0.0, float(p[0, 2])), (0.0, 0.0, 0.0))
                         for name in self._names}
        inbox.reports = self._reports(t_ns / _NS)
        inbox.reported += 1
        inbox.state_at = inbox.reported_at = time.monotonic()
        self._live.update(inbox.state_at + 1e6 * self.turns)    # each text is due

    def _reports(self, seconds: float) -> dict[str, Report]:
        """Return what /diagnostics would say: each figure another one."""
        k = self.turns
        figures = {
            'pace': {'simulation time [s]': seconds, 'real-time factor': 0.5 + 0.01 * k,
                     'real-time factor wanted': 1},
            'physics': {
                'energy [J]': 3.0 * k, 'kinetic energy [J]': k, 'potential energy [J]': 2.0 * k,
                **{f'{kind} {axis} [{unit}]': sign * k + place
                   for kind, unit, sign in (('momentum', 'kg m/s', 1),
                                            ('angular momentum', 'kg m^2/s', -1))
                   for place, axis in enumerate('xyz')}},
            'contact': {'contacts': k % 7}}
        return {part: Report(0, 'running', {key: str(value) for key, value in values.items()})
                for part, values in figures.items()}


def contact(t_ns: int, point: np.ndarray) -> bytes:
    """Return a message of one contact."""
    ends = np.array([point, np.add(point, (0.0, 0.0, 0.3))])
    size = 0.1, 0.1, 0.1
    markers = [Marker('contact_points', 0, _POINTS, size, (1.0, 0.0, 0.0, 1.0), ends[:1]),
               Marker('contact_forces', 0, _LINES, size, (1.0, 0.0, 0.0, 1.0), ends)]
    still = np.zeros((2, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))
    return MarkersEncoder('world', markers).encode(t_ns, *still)
