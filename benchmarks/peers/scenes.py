# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The scenes in which engines are compared, in a form of no engine's own.

A scene is a dict of plain numbers that goes to the runners as JSON: SI units, world axes,
quaternions x, y, z, w, boxes by their full lengths. A ground is the plane z = 0. Restitution and
friction are those of every pair.
"""

from collections.abc import Callable, Sequence
import math
from typing import Any

import numpy as np

G = 9.81
H = 1 / 240
SLOPE = math.radians(20.0)
# Gravity that leans by the angle of the slope towards x: the ground stays level.
LEANING = (G * math.sin(SLOPE), 0.0, -G * math.cos(SLOPE))

Scene = dict[str, Any]


def _moments(shape: str, size: Sequence[float], mass: float) -> list[float]:
    """Return the principal moments [kg m^2] of a ball of radius size[0] or of a box."""
    if shape == 'sphere':
        return [0.4 * mass * size[0] ** 2] * 3
    x, y, z = (side * side for side in size)
    return [mass / 12 * (y + z), mass / 12 * (x + z), mass / 12 * (x + y)]


def body(shape: str, size: Sequence[float], mass: float, position: Sequence[float],
         orientation: Sequence[float] = (0, 0, 0, 1), linear: Sequence[float] = (0, 0, 0),
         angular: Sequence[float] = (0, 0, 0), moments: Sequence[float] = ()) -> dict[str, Any]:
    """Return one body; without moments it is solid."""
    vectors = {'size': size, 'position': position, 'orientation': orientation, 'linear': linear,
               'angular': angular, 'moments': moments or _moments(shape, size, mass)}
    return {'shape': shape, 'mass': float(mass),
            **{name: [float(entry) for entry in vector] for name, vector in vectors.items()}}


def scene(name: str, bodies: list[dict[str, Any]], step: float, steps: int, every: int,
          gravity: Sequence[float] = (0.0, 0.0, -G), ground: bool = True, friction: float = 0.5,
          restitution: float = 0.0) -> Scene:
    """Return a scene; the bodies are looked at every so many steps."""
    return {'name': name, 'step': step, 'steps': steps, 'every': every, 'gravity': list(gravity),
            'ground': ground, 'friction': friction, 'restitution': restitution, 'bodies': bodies}


def free() -> Scene:
    """1000 tumbling boxes in free fall."""
    rng = np.random.default_rng(1)
    boxes = []
    for i in range(1000):
        place = np.array([i % 10, i // 10 % 10, i // 100]) * 10.0 + 100.0
        v, w = rng.normal(0, 0.2, 3), rng.normal(0, 3, 3)
        boxes.append(body('box', (0.2, 0.3, 0.4), 24.0, place, linear=v, angular=w))
    return scene('free 1000', boxes, H, 2400, 240, ground=False)


def spheres() -> Scene:
    """666 balls that fall into a heap."""
    rng, r, up = np.random.default_rng(2), 0.1, np.array((0.0, 0.0, 0.3))
    places = [np.array((i - 4, j - 4, k)) * 2.2 * r + up + rng.uniform(-0.01, 0.01, 3)
              for k in range(9) for j in range(9) for i in range(9)][:666]
    mass = 4 / 3 * math.pi * r ** 3 * 1000
    return scene('spheres 666', [body('sphere', [r], mass, p) for p in places], H, 1200, 24)


def stack(count: int) -> Scene:
    """Build a tower of cubes."""
    cubes = [body('box', (1, 1, 1), 1.0, (0, 0, 0.5 + k)) for k in range(count)]
    return scene(f'stack {count}', cubes, H, 2400, 24, friction=0.6)


def pyramid() -> Scene:
    """210 cubes in 20 rows, with room between them."""
    cubes = [body('box', (1, 1, 1), 1.0, ((i - (19 - k) / 2) * 1.05, 0, 0.5 + k))
             for k in range(20) for i in range(20 - k)]
    return scene('pyramid 210', cubes, H, 1200, 24, friction=0.6)


def pile() -> Scene:
    """1000 cubes that fall into a heap, turned at random."""
    rng = np.random.default_rng(3)
    cubes = []
    for i in range(1000):
        w, x, y, z = rng.normal(0, 1, 4)
        q = np.array((x, y, z, w)) / math.sqrt(w * w + x * x + y * y + z * z)
        grid = np.array((i % 10 - 4.5, i // 10 % 10 - 4.5, i // 100)) * 0.36
        place = np.add(grid, (0.0, 0.0, 0.4)) + rng.uniform(-0.005, 0.005, 3)
        cubes.append(body('box', (0.2, 0.2, 0.2), 8.0, place, q))
    return scene('pile 1000', cubes, H, 1200, 24)


def torque_free() -> Scene:
    """Let a body turn next to its middle axis, where it flips, for 100 s."""
    flipping = body('sphere', [0.1], 1.0, (0, 0, 0), angular=(0.01, 5.0, 0.01), moments=(1, 2, 3))
    return scene('torque-free', [flipping], 1e-3, 100_000, 100, (0, 0, 0), ground=False)


def bounce() -> Scene:
    """Let a ball bounce from 1 m."""
    return scene('bounce', [body('sphere', [0.1], 1.0, (0, 0, 1.1))], 1e-3, 4000, 1, friction=0.0,
                 restitution=0.8)


def slope_hold() -> Scene:
    """Put a box on a slope whose friction is 2 % above the limit."""
    return scene('slope holds', [body('box', (1, 1, 0.5), 1.0, (0, 0, 0.25))], 1e-3, 5000, 50,
                 LEANING, friction=1.02 * math.tan(SLOPE))


def slope_slide() -> Scene:
    """Put a box on a slope whose friction is too weak."""
    return scene('slope slides', [body('box', (1, 1, 0.5), 1.0, (0, 0, 0.25))], 1e-3, 5000, 50,
                 LEANING, friction=0.2)


def roll() -> Scene:
    """Let a ball roll down a slope."""
    return scene('roll', [body('sphere', [0.1], 1.0, (0, 0, 0.1))], 1e-3, 2000, 20, LEANING)


SCENES: dict[str, Callable[[], Scene]] = {
    'free 1000': free, 'spheres 666': spheres, 'stack 10': lambda: stack(10),
    'stack 20': lambda: stack(20), 'pyramid 210': pyramid, 'pile 1000': pile,
    'torque-free': torque_free, 'bounce': bounce, 'slope holds': slope_hold,
    'slope slides': slope_slide, 'roll': roll}
