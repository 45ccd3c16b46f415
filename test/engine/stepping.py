# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scenes that run with the contact model `timestep`."""

from engine.touching import _Scene, ball, box, G, ground
import numpy as np

from rigid_sim_ros.engine.detection.manifolds import (
    empty_memory, lasting, latest_impulses, with_lasting)
from rigid_sim_ros.engine.model.shapes import Material
from rigid_sim_ros.engine.solver.arguments import make_arguments, TimestepSettings
from rigid_sim_ros.engine.state.state import copy_state
from rigid_sim_ros.engine.steps.timestep import advance


class TimestepScene(_Scene):
    """A scene that runs with the model `timestep`."""

    def __init__(self, things, material, h=1e-3, gravity=(0.0, 0.0, -G),
                 settings=None):
        super().__init__(things, material, h, gravity)
        self.settings = settings or TimestepSettings()
        self.arguments, self.pack = self._begin(), None

    def _begin(self):
        return make_arguments(self.basis(), self.settings)

    @property
    def work(self):
        """Return the buffers of the solver."""
        return self.arguments.work

    @property
    def rest(self):
        """Return who sleeps."""
        return self.arguments.rest

    def step(self, count=1) -> None:
        self.arguments, self.pack = advance(self.arguments, count, self.pack)
        self.memory = self.arguments.memory

    def twin(self) -> 'TimestepScene':
        """Return a scene that continues from the state and from the manifolds only."""
        other = object.__new__(TimestepScene)
        other.__dict__.update(self.__dict__)
        other.state = copy_state(self.state)
        count = len(self.shapes.body)
        other.memory = with_lasting(empty_memory(len(self.model.m), count), lasting(self.memory))
        other.arguments, other.pack = other._begin(), None
        return other

    def ground_force(self) -> float:
        """Return the vertical force of what is fixed on what moves, over the last step [N]."""
        manifolds, total = self.manifolds(), 0.0
        acted = latest_impulses(self.memory)
        for r in range(manifolds.count[0]):
            if self.model.inv_m[manifolds.body_a[r]] == 0.0:
                total += (acted.normal[:manifolds.points[r], r].sum() * manifolds.normal[r, 2]
                          + acted.friction[r, 2])
        return total / self.model.h

    def deepest(self) -> float:
        """Return the deepest overlap at the start of the last step [m]."""
        return float(self.work.solver.overlap[0])


def tower(count: int, h: float) -> TimestepScene:
    boxes = [box((1, 1, 1), 1.0, position=(0, 0, 0.5 + k)) for k in range(count)]
    return TimestepScene([ground(), *boxes], Material(friction=0.6), h)


def pyramid(rows: int, h: float) -> TimestepScene:
    boxes = [box((1, 1, 1), 1.0, position=((i - (rows - k - 1) / 2) * 1.05, 0, 0.5 + k))
             for k in range(rows) for i in range(rows - k)]
    return TimestepScene([ground(), *boxes], Material(friction=0.6), h)


def falling_balls(h: float) -> TimestepScene:
    rng, r = np.random.default_rng(2), 0.1
    places = [np.array((i - 4, j - 4, k)) * 2.2 * r + (0, 0, 0.3) + rng.uniform(-0.01, 0.01, 3)
              for k in range(9) for j in range(9) for i in range(9)][:666]
    mass = 4 / 3 * np.pi * r ** 3 * 1000
    return TimestepScene([ground(), *(ball(r, mass, position=p) for p in places)],
                         Material(friction=0.5), h)


def falling_boxes(h: float) -> TimestepScene:
    rng = np.random.default_rng(3)
    boxes = []
    for k in range(10):
        for j in range(10):
            for i in range(10):
                w, x, y, z = rng.normal(0, 1, 4)
                q = np.array((x, y, z, w)) / np.sqrt(w * w + x * x + y * y + z * z)
                p = (np.array((i - 4.5, j - 4.5, k)) * 0.36 + (0, 0, 0.4)
                     + rng.uniform(-0.005, 0.005, 3))
                boxes.append(box((0.2, 0.2, 0.2), 8.0, position=p, orientation=q))
    return TimestepScene([ground(), *boxes], Material(friction=0.5), h)
