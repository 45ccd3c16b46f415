# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What must make no difference: bodies that are never touched, and seams of a flush floor."""

from collections.abc import Callable
from itertools import pairwise
import math
from typing import Any

from laws.motion import Build, Verdict, worst
from laws.scenes import (
    any_attitude, between, body, direction, draw_masses, draw_scales, draw_surface, fixed, G, heap,
    matrix, plane, product, Scales, Scene, Spec, turn, world)
from laws.solids import box, capsule, cylinder, draw_solid, Generator, Solid, sphere
import numpy as np


def draw_untouched(rng: Generator,
                   draw: Callable[[Generator, float], Solid] = draw_solid) -> Scene:
    """Draw a body that flies past others, or two heaps on one ground that never meet."""
    scales = draw_scales(rng)
    if rng.random() < 0.3:
        return _two_heaps(rng, scales, draw)
    # Without gravity; `forth` is the way of the body that passes, `aside` the normal of a plane
    # that parts it from the others.
    aside = direction(rng) if rng.random() < 0.5 else np.eye(3)[rng.integers(3)]
    forth = np.cross(aside, direction(rng) if rng.random() < 0.5 else np.roll(aside, 1))
    forth /= np.linalg.norm(forth)
    count = int(rng.integers(1, 10))
    masses_ = draw_masses(rng, count + 1)
    gap = scales.size * between(rng, 1e-6, 1e-1)
    spins = rng.random() < 0.3
    v = scales.size / scales.h * 10 ** rng.uniform(-3.5, 0.0)
    passer = draw(rng, scales.size * rng.uniform(0.05, 1.0))
    q = _aligned(rng, aside)
    far = passer.radius if spins else passer.reach(matrix(q).T @ aside)
    w = rng.normal(size=3) * v / scales.size if spins else np.zeros(3)
    # It crosses the row of the others, which starts half a size ahead of it, in at most 600 steps.
    bodies = [body('passer', passer, masses_[0], -aside * far, q, v * forth, w)]
    along = passer.radius + 0.5 * v * scales.h
    for k in range(count):
        other = draw(rng, scales.size)
        q = _aligned(rng, aside)
        near = other.reach(-(matrix(q).T @ aside))
        along += other.radius
        place = aside * (gap + near) + along * forth
        along += other.radius * 1.01
        bodies.append(fixed(f'other{k}', other, place, q) if rng.random() < 0.5
                      else body(f'other{k}', other, masses_[1 + k], place, q))
    steps = min(600, math.ceil((along + passer.radius) / v / scales.h) + 2)
    spec = world(bodies, scales.h, draw_surface(rng), gravity=(0, 0, 0))
    return Scene(spec, scales.size, steps, {'kind': 'passing', 'kept': 1})


def _aligned(rng: Generator, aside: np.ndarray) -> np.ndarray:
    """Draw an attitude; in half of the cases an axis of the body lies along `aside`."""
    if rng.random() < 0.5:
        return any_attitude(rng)
    half = np.add(aside, (0.0, 0.0, 1.0))
    if np.linalg.norm(half) < 1e-6:
        return np.array((1.0, 0.0, 0.0, 0.0))
    return turn(half, math.pi)


def _two_heaps(rng: Generator, scales: Scales,
               draw: Callable[[Generator, float], Solid]) -> Scene:
    """Return two heaps, the second a hundred sizes away."""
    first, second = heap(rng, scales, 4, draw), heap(rng, scales, 4, draw)
    for one in second:
        one['name'] = 'far_' + one['name']
        one['pose']['position'][0] += 100.0 * scales.size
    spec = world([*first, *second, plane()], scales.h, draw_surface(rng))
    return Scene(spec, scales.size, scales.steps(4.0), {'kind': 'heaps', 'kept': len(first)})


def judge_untouched(scene: Scene, build: Build) -> Verdict:
    """
    Compare the first bodies, bit for bit, with those of a world without the others.

    Nothing that does not touch acts: not a bit may differ.
    """
    kept = scene.facts['kept']
    ground = [one for one in scene.spec['bodies'] if one['name'] == 'ground']
    both = build(scene.spec)
    alone = build(scene.spec | {'bodies': [*scene.spec['bodies'][:kept], *ground]})
    apart, every = 0.0, math.ceil(scene.steps / 50)
    for _ in range(0, scene.steps, every):
        both.step(every)
        alone.step(every)
        apart = max(apart, float(np.abs(both.motion()[:kept] - alone.motion()[:kept]).max()))
    return Verdict(apart, 0.0, f"difference, SI units, of {scene.facts['kind']}")


def draw_flush(rng: Generator) -> Scene:
    """Draw a body that slides or rolls over a floor of flush pieces."""
    scales = draw_scales(rng, coarsest=0.1)
    size = scales.size
    pieces = int(rng.integers(2, 8))
    length, width, deep = size * between(rng, 0.3, 3.0), 20.0 * size, size * rng.uniform(0.2, 1.0)
    kind = str(rng.choice(['box', 'ball', 'roller', 'standing', 'capsule']))
    solid, q, height, axis = _slider(rng, kind, size)
    angle = rng.uniform(-0.5, 0.5) if rng.random() < 0.5 else 0.0
    forth = np.array((math.cos(angle), math.sin(angle), 0.0))
    yaw = turn((0, 0, 1), angle if kind in ('roller', 'capsule') else
               angle + rng.uniform(0, math.pi) * rng.integers(0, 2))
    v = scales.speed * between(rng, 0.1, 3.0)
    friction = 0.0 if rng.random() < 0.6 else rng.uniform(0.05, 1.0)
    # What rolls rolls without slipping where there is friction; what slides is too low to topple.
    rolls = friction > 0 and axis
    w = np.cross((0, 0, 1), forth) * v / height * rolls
    start = np.array((-1.0 * size, 0.0, height))
    surface = draw_surface(rng, restitution=0.0, friction=friction)
    slider = body('slider', solid, draw_masses(rng, 1)[0], start, product(yaw, q), v * forth, w)
    total = 3.0 * size + pieces * length
    # The first piece begins behind the start, and the last goes on for long.
    edges = [-3.0 * size, *(k * length for k in range(pieces)), pieces * length + 100.0 * size]
    tiles = [(box((b - a, width, deep)), (0.5 * (a + b), 0.0, -0.5 * deep))
             for a, b in pairwise(edges)]
    if rng.random() < 0.7:
        floor = [fixed(f'tile{k}', *tile) for k, tile in enumerate(tiles)]
    else:
        floor = [_compound_floor(tiles)]
    whole = fixed('whole', box((edges[-1] - edges[0], width, deep)),
                  (0.5 * (edges[-1] + edges[0]), 0.0, -0.5 * deep))
    steps = min(math.ceil(total / v / scales.h), 2000)
    return Scene(world([slider, *floor], scales.h, surface), size, steps,
                 {'whole': whole, 'v': v, 'kind': kind, 'friction': friction})


def _slider(rng: Generator, kind: str, size: float) -> tuple[Solid, np.ndarray, float, bool]:
    """Return a solid, its attitude, the height of its centre and whether it rolls along x."""
    level = np.array((0.0, 0.0, 0.0, 1.0))
    lying = turn((1, 0, 0), math.pi / 2)  # z of the body along y
    r = 0.5 * size
    if kind == 'ball':
        return sphere(r), level, r, True
    if kind == 'roller':
        return cylinder(r, size * rng.uniform(0.5, 2.0)), lying, r, True
    if kind == 'capsule':
        return capsule(r, size * rng.uniform(0.5, 2.0)), lying, r, True
    if kind == 'standing':
        high = 0.3 * size
        return cylinder(r, high), level, 0.5 * high, False
    low = size * np.array((rng.uniform(0.5, 1.0), rng.uniform(0.5, 1.0), 0.2))
    return box(low), level, 0.5 * low[2], False


def _compound_floor(tiles: list[Any]) -> Spec:
    """Return the tiles as one fixed body."""
    parts = [tile.shape | {'pose': {'position': [float(x) for x in place]}}
             for tile, place in tiles]
    return {'name': 'floor', 'shape': {'type': 'compound', 'compound': parts}, 'fixed': True}


def judge_flush(scene: Scene, build: Build) -> Verdict:
    """
    Compare with the same body on a floor of one piece.

    The surface is the same, so the motion is. Forces that stay constant for a step put where the
    floor holds the body up to g h^2 up or down and its speed up to g h; with friction the force
    on each point of the body is another, but its sum is mu m g however it is shared: known to
    mu g h, and after a time t the place to mu g h t. Without friction nothing at all acts along
    the floor: a normal is known to 1e-6.
    """
    pieces = build(scene.spec)
    one = build(scene.spec | {'bodies': [scene.spec['bodies'][0], scene.facts['whole']]})
    h, kind, verdicts = scene.h, scene.facts['kind'], []
    every = math.ceil(scene.steps / 50)
    along = 2 * min(1.0, scene.facts['friction']) * G * h + 1e-6 * scene.facts['v']
    for k in range(every, scene.steps + every, every):
        pieces.step(every)
        one.step(every)
        apart = np.abs(pieces.motion()[0] - one.motion()[0])
        verdicts += [
            Verdict(float(apart[2]), G * h * h + 1e-6 * scene.size, f'm of lift, {kind}'),
            Verdict(float(apart[7:9].max()), along, f'm/s along the floor, {kind}'),
            Verdict(float(apart[9]), 2 * G * h, f'm/s up, {kind}'),
            Verdict(float(scene.size * apart[10:].max()), 4 * G * h, f'm/s of turning, {kind}'),
            Verdict(float(apart[:2].max()), along * k * h + 1e-6 * scene.size,
                    f'm of way, {kind}')]
    return worst(verdicts)
