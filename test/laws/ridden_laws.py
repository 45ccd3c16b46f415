# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What stands on a floor that moves to and fro, or up and down, goes with it."""

import math

from laws.motion import Build, Verdict
from laws.scenes import body, draw_masses, draw_scales, G, Scales, Scene, world
from laws.solids import box, flat_solid, Generator, Solid
import numpy as np

# What is asked of friction and of the width of bodies, as a part of what they could bear.
SHARE = 0.6
PERIODS = 2


def draw_ridden(rng: Generator) -> Scene:
    """Draw a column of one to ten bodies on a kinematic floor, and how that moves."""
    scales = draw_scales(rng, coarsest=0.1)
    count = int(rng.integers(1, 11))
    solids = [flat_solid(rng, scales.size) for _ in range(count)]
    heights = [2 * solid.reach(np.array((0.0, 0.0, 1.0))) for solid in solids]
    masses, friction = draw_masses(rng, count), rng.uniform(0.1, 2.0)
    bodies = [body(f'b{k}', solids[k], masses[k], (0, 0, sum(heights[:k]) + 0.5 * heights[k]))
              for k in range(count)]
    floor = {'name': 'floor', 'kinematic': True, 'pose': {'position': [0, 0, -0.5 * scales.size]},
             'shape': box((20 * scales.size, 20 * scales.size, scales.size)).shape}
    most = min(friction, _slimmest(solids, heights, masses)) * G
    along, way = SHARE * rng.uniform(0.2, 1.0) * most, rng.uniform(0.0, 2 * math.pi)
    steps = _steps(rng, scales)
    spec = world([*bodies, floor], scales.h, {'friction': friction, 'restitution': 0.0})
    return Scene(spec, scales.size, steps, {
        'count': count, 'acceleration': (along * math.cos(way), along * math.sin(way), 0.0)
        if rng.random() < 0.6 else (0.0, 0.0, rng.uniform(-0.3, 0.3) * G)})


def _slimmest(solids: list[Solid], heights: list[float], masses: np.ndarray) -> float:
    """
    Return the least a / g at which what stands above a body would tip over its border.

    With its centre of mass z above a face whose border is b away, that is at a z = g b.
    """
    least = math.inf
    for k in range(len(solids)):
        z = [sum(heights[k:i]) + 0.5 * heights[i] for i in range(k, len(solids))]
        b = min(solids[i].reach(n) for i in (max(k - 1, 0), k)
                for n in (np.array((1.0, 0.0, 0.0)), np.array((0.0, 1.0, 0.0))))
        least = min(least, b * masses[k:].sum() / float(masses[k:] @ z))
    return least


def _steps(rng: Generator, scales: Scales) -> int:
    """Draw the steps of all periods, of at least 40 and at most 120 steps each."""
    return PERIODS * int(np.clip(scales.steps(rng.uniform(3.0, 20.0)), 40, 120))


def judge_ridden(scene: Scene, build: Build) -> Verdict:
    """
    Compare where bodies stand on the floor after whole periods with where they stood.

    The floor goes by A (1 - cos wt), along itself or up and down, and its twist holds for a step
    each. So bodies are behind it by up to a h^2 / 2 a step, which adds up to h v / 2 and is 0 at
    the end of a period. Both at once would be another law: a floor that slows down as it goes up
    leaves bodies in the air for a part of each step, and what they lose in it friction does not
    give back. What the start, with a from nothing, and a soft contact leave is as in the law
    `weight`: g h^2 and a thousandth of a size for each body.
    """
    world_of = build(scene.spec).world
    h, a = scene.h, np.array(scene.facts['acceleration'])
    w = 2 * math.pi * PERIODS / (scene.steps * h)
    floor = world_of.names.index('floor')
    start = world_of.position - world_of.position[floor]
    for k in range(scene.steps):
        # The mean velocity of the step.
        v = a / w ** 2 * (math.cos(w * k * h) - math.cos(w * (k + 1) * h)) / h
        world_of.set_twist('floor', v.tolist(), (0.0, 0.0, 0.0))
        world_of.step()
    now = world_of.position - world_of.position[floor]
    return Verdict(float(np.abs(now - start).max()),
                   scene.facts['count'] * (G * h ** 2 + 1e-3 * scene.size),
                   'm that a column moved on the floor')
