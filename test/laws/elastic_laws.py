# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies of all shapes that fly in a closed box and bounce without loss or friction."""

import math

from laws.motion import Build, look, masses, Verdict, worst
from laws.scenes import any_attitude, between, body, fixed, G, Scene, Spec, world
from laws.solids import box, DRAW, draw_solid, Generator
import numpy as np

STEPS = 300
# Sizes that a body of middling speed flies in a step.
WAY = 1e-3, 0.03


def draw_elastic(rng: Generator) -> Scene:
    """Draw three to sixteen bodies at the places of a lattice, which fly and turn every way."""
    size, count = between(rng, 1e-3, 100.0), int(rng.integers(3, 17))
    kinds = tuple(DRAW) if rng.random() < 0.5 else (str(rng.choice(list(DRAW))),)
    speed, mass, spread = math.sqrt(G * size), 1000.0 * size ** 3, between(rng, 1.0, 30.0)
    side = math.ceil(count ** (1 / 3))
    cell = 2.2 * size
    places = (np.array(list(np.ndindex(side, side, side))) - 0.5 * (side - 1)) * cell
    bodies = []
    for k, place in enumerate(rng.permutation(places)[:count]):
        solid = draw_solid(rng, size * rng.uniform(0.3, 1.0), kinds)
        if solid.radius > 0.5 * cell:
            solid = draw_solid(rng, 0.3 * size, kinds)
        bodies.append(body(f'b{k}', solid, mass * spread ** rng.random(), tuple(place),
                           any_attitude(rng), speed * rng.normal(size=3),
                           speed / size * rng.normal(size=3)))
    surface = {'friction': 0.0, 'restitution': 1.0}
    half = 0.5 * side * cell
    spec = world([*bodies, *_walls(half)], between(rng, *WAY) * size / speed, surface,
                 (0.0, 0.0, 0.0))
    return Scene(spec, size, STEPS, {'half': half, 'moving': count})


def _walls(half: float) -> list[Spec]:
    """Return six walls around a cube that is 2 half wide."""
    thick, walls = half, []
    for k, axis in enumerate(np.vstack([np.eye(3), -np.eye(3)])):
        across = np.where(axis != 0.0, thick, 2.0 * (half + thick))
        walls.append(fixed(f'wall{k}', box(tuple(across)), tuple(axis * (half + 0.5 * thick))))
    return walls


def judge_elastic(scene: Scene, build: Build) -> Verdict:
    """
    Compare the energy with that of the start, and ask whether all are still in the box.

    A collision keeps the energy to 1e-8. What meets more often in a step than collisions are
    followed is stopped: of all bodies, one or the other loses a part of its energy so, and that is
    no more than a thousandth of all in so few steps.
    """
    run, of = build(scene.spec), masses(scene.spec)
    moves = slice(scene.facts['moving'])
    before, farthest, changed = float(look(of, run.motion()).kinetic.sum()), 0.0, 0.0
    for _ in range(scene.steps):
        run.step(1)
        now = look(of, run.motion())
        changed = max(changed, abs(float(now.kinetic.sum()) / before - 1.0))
        farthest = max(farthest, float(np.abs(now.x[moves]).max()))
    return worst([Verdict(changed, 1e-3, 'share of the energy'),
                  Verdict(farthest, scene.facts['half'], 'm from the middle of the box')])
