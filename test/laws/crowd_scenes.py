# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Scenes that users build and random shapes never are: crates of one size, and many that collapse.

Of equal boxes none is the larger one, and their faces, edges and corners meet each other exactly.
Twenty to sixty bodies are one island that is too large to be solved at once.
"""

import math

from laws.scenes import (
    any_attitude, body, draw_masses, draw_scales, draw_surface, extent, matrix, plane, product,
    Scales, Scene, Spec, turn, world)
from laws.solids import box, draw_solid, Generator, Solid, sphere
import numpy as np

UP = np.array((0.0, 0.0, 1.0))


def draw_crates(rng: Generator) -> Scene:
    """Draw two to six boxes of one size that stand or fall on a plane and on each other."""
    scales = draw_scales(rng)
    crate = box(scales.size * (np.ones(3) if rng.random() < 0.5
                               else 10 ** rng.uniform(-0.5, 0.0, 3)))
    places = (_column, _wall, _side_by_side)[rng.integers(3)](rng, crate)
    masses = draw_masses(rng, len(places))
    if rng.random() < 0.7:
        masses[:] = masses[0]
    yaw = turn(UP, rng.uniform(0, math.pi) * rng.integers(2))
    bodies = [body(f'b{k}', crate, mass, matrix(yaw) @ place, product(yaw, q))
              for k, (mass, (place, q)) in enumerate(zip(masses, places, strict=True))]
    if rng.random() < 0.6:
        # One is pushed, so that the others slide, tilt and fall; the turn makes it no symmetry.
        hit = bodies[rng.integers(len(bodies))]['twist']
        hit['linear'] = (scales.speed * rng.normal(size=3) * (1.0, 1.0, 0.2)).tolist()
        hit['angular'] = (0.3 / scales.time * rng.normal(size=3)).tolist()
    spec = world([*bodies, plane()], scales.h, draw_surface(rng))
    return Scene(spec, scales.size, min(scales.steps(4.0), 800),
                 {'seed': int(rng.integers(1 << 31))})


_Places = list[tuple[np.ndarray, np.ndarray]]


def _column(rng: Generator, crate: Solid) -> _Places:
    """Put crates above each other, exactly or not, touching or not, each turned about z or not."""
    high, size = 2 * crate.reach(UP), 2 * crate.reach(np.eye(3)[0])
    aside = size * rng.choice((0.0, 0.2, 0.45))
    gap = high * rng.choice((0.0, 0.0, rng.uniform(0.01, 0.5)))
    turned = math.pi * rng.choice((0.0, 0.25, rng.random()))
    places = []
    for k in range(int(rng.integers(2, 6))):
        x, y = aside * rng.uniform(-1, 1, 2)
        places.append((np.array((x, y, (k + 0.5) * high + (k + 1) * gap)),
                       turn(UP, turned * rng.integers(2))))
    return places


def _wall(rng: Generator, crate: Solid) -> _Places:
    """Put crates as the bricks of a small pyramid."""
    wide, high = 2 * crate.reach(np.eye(3)[0]), 2 * crate.reach(UP)
    wide *= rng.choice((1.0, 1.0 + rng.uniform(0.01, 0.3)))
    level, rows = np.array((0.0, 0.0, 0.0, 1.0)), int(rng.integers(2, 4))
    return [(np.array((wide * (k - 0.5 * (rows - row - 1)), 0.0, (row + 0.5) * high)), level)
            for row in range(rows) for k in range(rows - row)]


def _side_by_side(rng: Generator, crate: Solid) -> _Places:
    """Put crates in a row on the ground, flush or apart, some of them lying on another side."""
    places, x = [], 0.0
    gap = rng.choice((0.0, rng.uniform(0.01, 0.3)))
    for _ in range(int(rng.integers(2, 5))):
        q = turn(np.eye(3)[rng.integers(3)], 0.5 * math.pi * rng.integers(4))
        half = [crate.reach(_turned_back(q, n)) for n in np.eye(3)]
        places.append((np.array((x + half[0], 0.0, half[2])), q))
        x += 2 * half[0] * (1.0 + gap)
    return places


def _turned_back(q: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Return the world vector n in the axes of a body at attitude q."""
    undo = q * (-1.0, -1.0, -1.0, 1.0)
    return product(product(undo, np.append(n, 0.0)), q)[:3]


def draw_collapse(rng: Generator) -> Scene:
    """Draw twenty to sixty bodies: a tower that is knocked over, or a heap that falls."""
    # Not too fine, or sixty bodies take minutes.
    scales = draw_scales(rng)
    while scales.h / scales.time < 0.04:
        scales = draw_scales(rng)
    bodies = (_tower if rng.random() < 0.5 else _heap)(rng, scales, int(rng.integers(20, 61)))
    # What bounces with friction in many places at once takes minutes.
    spec = world([*bodies, plane()], scales.h, draw_surface(rng, restitution=0.0))
    return Scene(spec, scales.size, min(scales.steps(6.0), 150))


def _tower(rng: Generator, scales: Scales, count: int) -> list[Spec]:
    """Return layers of bricks, each across the one before, and a ball that flies into them."""
    size = scales.size
    # Two or three of them are as wide together as one is long, with room in between.
    across = int(rng.integers(2, 4))
    long, wide, high = size, size / across * rng.uniform(0.6, 1.0), size * rng.uniform(0.15, 0.4)
    brick, mass, bodies = box((long, wide, high)), draw_masses(rng, 1)[0], []
    for k in range(count):
        layer, place = divmod(k, across)
        aside = (place - 0.5 * (across - 1)) * (long - wide) / (across - 1)
        at = (0.0, aside) if layer % 2 == 0 else (aside, 0.0)
        q = turn(UP, 0.5 * math.pi * (layer % 2))
        bodies.append(body(f'b{k}', brick, mass, (*at, (layer + 0.5) * high), q))
    top = count / across * high
    ball, z = sphere(0.5 * size * rng.uniform(0.3, 1.0)), top * rng.uniform(0.1, 0.9)
    v = scales.speed * rng.uniform(1.0, 6.0)
    heavy = mass * 10 ** rng.uniform(0.0, 1.5)
    bodies.append(body('ball', ball, heavy, (-2.0 * size, 0.1 * size * rng.normal(),
                                             max(z, ball.radius)), linear=(v, 0, 0)))
    return bodies


def _heap(rng: Generator, scales: Scales, count: int) -> list[Spec]:
    """Return bodies at the places of a loose lattice above the ground."""
    kinds = [('box',), ('box', 'cylinder', 'sphere', 'capsule'), None][rng.integers(3)]
    side, bodies = int(rng.integers(2, 4)), []
    same = draw_solid(rng, scales.size, kinds) if kinds and rng.random() < 0.5 else None
    for k, mass in enumerate(draw_masses(rng, count)):
        solid = same or (draw_solid(rng, scales.size, kinds) if kinds
                         else draw_solid(rng, scales.size))
        layer, rest = divmod(k, side * side)
        x, y = np.divmod(rest, side)
        # No shape reaches farther than its bound, whatever its attitude.
        pitch = 2.02 * extent(solid.shape) if same else 2.6 * scales.size
        place = pitch * np.array((x, y, layer + 0.6)) + 0.01 * pitch * rng.uniform(-1, 1, 3)
        bodies.append(body(f'b{k}', solid, mass, place, any_attitude(rng)))
    return bodies
