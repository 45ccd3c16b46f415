# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What every runner of an engine does: read a scene, step it, write down where the bodies were.

A runner is started as `python run_ENGINE.py SCENE.json OUTPUT LIMIT`. It writes OUTPUT, an array
of float64 with 13 numbers for each body and look: position, orientation x, y, z, w, linear and
angular velocity; and prints one line of JSON: steps done, seconds of stepping alone, and the mean
vertical force [N] of the ground in the last step (null where the engine does not say). After LIMIT
seconds of stepping it ends early. Runners know nothing of each other and import one engine each.
"""

from collections.abc import Callable
import json
from pathlib import Path
import sys
import time
from typing import Any, NamedTuple, Protocol

import numpy as np


class Running(NamedTuple):
    """A scene in an engine."""

    advance: Callable[[int], object]  # by so many steps
    motion: Callable[[], np.ndarray]  # (bodies, 13)
    ground_force: Callable[[], float | None] = lambda: None


class Build(Protocol):
    """How a runner puts a scene into its engine."""

    def __call__(self, scene: dict[str, Any]) -> Running:
        """Return the scene, ready to step."""


def each_step(step: Callable[[], object]) -> Callable[[int], object]:
    """Return how to advance an engine that takes one step at a time."""
    def advance(count: int) -> None:
        for _ in range(count):
            step()
    return advance


class Clock:
    """Advances an engine and adds up the time of that."""

    def __init__(self, advance: Callable[[int], object], limit: float) -> None:
        """Start at 0, with so many seconds to spend."""
        self._advance, self._limit = advance, limit
        self.done, self.seconds = 0, 0.0

    def run(self, count: int) -> bool:
        """Advance by so many steps; return whether there was time for all of them."""
        left = count
        while left > 0:
            # Who has no time for all of them at the speed so far goes on step by step.
            slow = self.seconds * (self.done + left) >= self._limit * self.done
            piece = 1 if slow else left
            start = time.perf_counter()
            self._advance(piece)
            self.seconds += time.perf_counter() - start
            self.done += piece
            left -= piece
            if self.seconds >= self._limit:
                return False
        return True


def main(build: Build) -> None:
    """Run the scene that the command line names."""
    source, output, limit = sys.argv[1:4]
    scene = json.loads(Path(source).read_text(encoding='utf-8'))
    running = build(scene)
    clock = Clock(running.advance, float(limit))
    looks = [running.motion()]
    while clock.done < scene['steps'] and clock.run(min(scene['every'],
                                                        scene['steps'] - clock.done)):
        looks.append(running.motion())
    np.asarray(looks, dtype='<f8').tofile(output)
    print(json.dumps({'steps': clock.done, 'seconds': clock.seconds,
                      'ground': running.ground_force()}))
