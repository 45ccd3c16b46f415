# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rows of bodies with small gaps: a blow goes through as many of them in a step as it should."""

import math

from laws.motion import Build, look, masses, Verdict, worst
from laws.scenes import between, body, G, Scene, world
from laws.solids import box, cylinder, Generator, sphere
import numpy as np

# Sizes that what hits a row flies in a step.
WAY = 0.05, 0.6
# Of the size: the gaps in a row.
GAPS = 0.01, 0.2
# Of the size: what is thrown less far in a step may meet something a step late.
LATE = 0.025
# How far what hits flies besides, in sizes, after it met the first.
AFTER = 12.0


def draw_row(rng: Generator) -> Scene:
    """Draw three to sixteen equal solids along x, and one before them that flies at them."""
    size, count = between(rng, 1e-3, 100.0), int(rng.integers(3, 17))
    solid = (sphere(0.5 * size), box((size,) * 3), cylinder(0.4 * size, size))[rng.integers(3)]
    gaps = size * np.array([between(rng, *GAPS) for _ in range(count)])
    speed, mass = math.sqrt(G * size) * between(rng, 0.3, 3.0), 1000.0 * size ** 3
    # Cylinders meet by their flat ends.
    along_x = (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))
    weights = mass * between(rng, 1.0, 4.0) ** rng.random(count + 1)
    x = np.concatenate([[0.0], np.cumsum(size + gaps)])
    bodies = [body(f'b{k}', solid, weights[k], (x[k], 0.0, 0.0), along_x,
                   (speed if k == 0 else 0.0, 0.0, 0.0)) for k in range(count + 1)]
    surface = {'friction': float(rng.choice([0.0, 0.5])),
               'restitution': 0.0 if rng.random() < 0.5 else float(rng.uniform(0.9, 1.0))}
    way = between(rng, *WAY)
    step = way * size / speed
    steps = math.ceil((AFTER * size + x[-1]) / (speed * step))
    return Scene(world(bodies, step, surface, (0.0, 0.0, 0.0)), size, steps, {'way': way})


def judge_row(scene: Scene, build: Build) -> Verdict:
    """
    Compare with collisions of two at a time, and with what sticks together where nothing bounces.

    What bounces is a chain of collisions, taken in their order. What is thrown by less than a
    fortieth of its size in a step may meet the next one a step late, and overlaps by so much then;
    two such steps are allowed for in the places at the end. What does not bounce closes its gaps
    by substeps, of which a step has four: it overlaps by no more than what hits the row flies in
    one, and is as far from its place at the end.
    """
    run, of = build(scene.spec), masses(scene.spec)
    e = scene.spec['materials']['default']['restitution']
    begin = look(of, run.motion())
    x, v = begin.x[:, 0].copy(), begin.v[:, 0].copy()
    deepest = 0.0
    for _ in range(scene.steps):
        run.step(1)
        gap = np.diff(look(of, run.motion()).x[:, 0]) - scene.size
        deepest = max(deepest, -float(gap.min()) / scene.size)
    pass_on(x, v, of.m, scene.size, e, scene.steps * scene.spec['world']['step'])
    late, twice = (LATE, 2.0 * LATE) if e > 0.0 else (0.25 * scene.facts['way'],) * 2
    apart = float(np.abs(look(of, run.motion()).x[:, 0] - x).max()) / scene.size
    return worst([Verdict(apart, twice, 'sizes from where it should be'),
                  Verdict(deepest, late, 'sizes of overlap')])


def pass_on(x: np.ndarray, v: np.ndarray, m: np.ndarray, size: float, e: float,
            time: float) -> None:
    """
    Move bodies (n,) along a line for some time [s], with collisions of restitution e.

    What does not bounce moves on as one. x [m] and v [m/s] change in place.
    """
    group = np.arange(len(x))   # which of them move as one: the first of its bodies
    while True:
        closing = v[:-1] - v[1:]
        gap = np.maximum(np.diff(x) - size, 0.0)
        meets = (closing > 1e-12 * np.abs(v).max()) & (group[:-1] != group[1:])
        when = np.where(meets, gap / np.where(meets, closing, 1.0), np.inf)
        k = int(when.argmin())
        if when[k] >= time:
            x += time * v
            return
        x += when[k] * v
        time -= when[k]
        if e == 0.0:
            both = (group == group[k]) | (group == group[k + 1])
            group[both] = group[k]
            v[both] = m[both] @ v[both] / m[both].sum()
        else:
            mean = (m[k] * v[k] + m[k + 1] * v[k + 1]) / (m[k] + m[k + 1])
            v[k:k + 2] = mean + e * (mean - v[k:k + 2])
