# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Three to seven bodies that are symmetric about the plane x = 0.

Bodies are added in pairs of mirror images, or alone where they are images of themselves; the pairs
stand in `facts` as rows of two numbers, the same one twice for what stands in the plane.
"""

from collections.abc import Sequence
import math

from laws.scenes import body, draw_masses, draw_surface, G, plane, Scales, Scene, Spec, world
from laws.solids import box, draw_box, draw_capsule, draw_sphere, flat_solid, Generator, Solid
import numpy as np

ALONG_X, UP = np.eye(3)[0], np.eye(3)[2]


class _Pairs:
    """Bodies and their images."""

    def __init__(self, rng: Generator) -> None:
        self.rng = rng
        self.bodies: list[Spec] = []
        self.images: list[tuple[int, int]] = []
        self.masses = draw_masses(rng, 7)

    def add(self, solid: Solid, place: Sequence[float], v: Sequence[float] = (0, 0, 0)) -> None:
        """Add a body, and its image unless it is at x = 0; none is turned."""
        k, m = len(self.bodies), self.masses[len(self.images)]
        x, y, z = place
        self.bodies.append(body(f'b{k}', solid, m, (x, y, z), linear=v))
        if x == 0.0:
            self.images.append((k, k))
            return
        self.bodies.append(body(f'b{k + 1}', solid, m, (-x, y, z), linear=(-v[0], v[1], v[2])))
        self.images.append((k, k + 1))


def draw_several(rng: Generator, scales: Scales) -> Scene:
    """Draw a body that falls on two, a row that is hit from both ends, or a pyramid."""
    surface = draw_surface(rng)
    pairs, kind = _Pairs(rng), rng.integers(3)
    arrange = (_falls_on_two, _row, _pyramid)[kind]
    until = arrange(pairs, scales)
    gravity = (0.0, 0.0, 0.0) if arrange is _row else (0.0, 0.0, -G)
    bodies = pairs.bodies if arrange is _row else [*pairs.bodies, plane()]
    # Rounding, 1e-16, grows with each impact by the lever over the size of what touches, about 3,
    # and between impacts by exp(t / time) at most: that of a pendulum on its head. Some 15 impacts
    # or times later it is 1e-8. Without restitution there are few impacts; with it, as many as
    # follow within a quarter of the time that gravity takes.
    after = scales.steps(1.0 if surface['restitution'] == 0.0 else 0.25)
    spec = world(bodies, scales.h, surface, gravity)
    return Scene(spec, scales.size, math.ceil(until / scales.h) + min(after, 50),
                 {'kind': 'several', 'images': pairs.images, 'arranged': arrange.__name__})


def _fall_time(drop: float, v: float) -> float:
    return (math.sqrt(v * v + 2 * G * drop) - v) / G


def _falls_on_two(pairs: _Pairs, scales: Scales) -> float:
    """Let a body fall on two, or on two of each height; return when it meets them [s]."""
    rng, size = pairs.rng, scales.size
    levels, wide, height = int(rng.integers(1, 3)), 0.0, 0.0
    solids = [flat_solid(rng, size) for _ in range(levels)]
    wide = max(solid.reach(ALONG_X) for solid in solids)
    apart = 0.5 * size * rng.uniform(0.01, 0.3)
    for solid in solids:
        up = solid.reach(UP)
        pairs.add(solid, (wide + apart, 0.0, height + up))
        height += 2 * up
    drop, v = size * rng.uniform(0.02, 1.0), scales.speed * rng.uniform(0.0, 2.0)
    # Wide enough to lie on both, or round and caught between them.
    if rng.random() < 0.5:
        falls = box((2 * (wide + apart) * rng.uniform(1.0, 2.0), size * rng.uniform(0.3, 1.0),
                     size * rng.uniform(0.2, 1.0)))
    else:
        falls = draw_sphere(rng, size * rng.uniform(0.5, 2.0))
    pairs.add(falls, (0.0, 0.0, height + falls.reach(UP) + drop), (0.0, 0.0, -v))
    return _fall_time(drop, v)


def _row(pairs: _Pairs, scales: Scales) -> float:
    """Hit a row in space from both ends; return when the last of it has been hit [s]."""
    rng, size = pairs.rng, scales.size
    draw = (draw_sphere, draw_box, draw_capsule)[rng.integers(3)]
    count, gap = int(rng.integers(3, 8)), size * rng.choice((0.0, rng.uniform(0.001, 0.1)))
    v = size / scales.h * 10 ** rng.uniform(-3, -1)
    edge, start = 0.5 * gap, 0
    if count % 2:
        solid = draw(rng, size)
        pairs.add(solid, (0.0, 0.0, 0.0))
        edge, start = solid.reach(ALONG_X) + gap, 1
    for k in range(start, count, 2):
        solid, last = draw(rng, size), k >= count - 2
        if last:
            edge += 0.05 * size
        reach = solid.reach(ALONG_X)
        pairs.add(solid, (edge + reach, 0.0, 0.0), (-v if last else 0.0, 0.0, 0.0))
        edge += 2 * reach + gap
    return (0.05 * size + count * gap) / v


def _pyramid(pairs: _Pairs, scales: Scales) -> float:
    """Drop a pyramid of bricks on the ground; return when it meets that [s]."""
    rng, size = pairs.rng, scales.size
    brick = box(size * 10 ** rng.uniform(-0.5, 0.0, 3))
    wide, up = 2 * brick.reach(ALONG_X) * (1.0 + rng.uniform(0.02, 0.3)), brick.reach(UP)
    rows = int(rng.integers(2, 4))
    drop = size * rng.choice((0.0, rng.uniform(0.02, 0.5)))
    for row in range(rows):
        count = rows - row
        z = drop + up * (2 * row + 1)
        for k in range(count % 2 == 0, count, 2):
            pairs.add(brick, (0.5 * wide * k, 0.0, z))
    return _fall_time(drop, 0.0)
