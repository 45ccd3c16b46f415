# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Heaps of all shapes that fall into a box or a bowl or on a plane, and what they must come to."""

import math

from laws.motion import Build, Look, look, masses, potential, Verdict, worst
from laws.scenes import any_attitude, body, draw_scales, fixed, G, plane, Scene, Spec, world
from laws.solids import box, compound, DRAW, draw_solid, Generator, Solid
import numpy as np

# In units of sqrt(size / g), after a body has fallen from the highest place.
REST = 40.0


def draw_heap(rng: Generator) -> Scene:
    """Draw five to twelve bodies above each other, half of the boxes in flush pieces."""
    scales = draw_scales(rng, coarsest=0.05)
    size = scales.size
    kinds = tuple(DRAW) if rng.random() < 0.6 else (str(rng.choice(list(DRAW))),)
    mass, spread, z, bodies = 1000.0 * size ** 3, 10 ** rng.uniform(0.0, 2.0), 2.0 * size, []
    container = (_box, _bowl, _plane)[rng.integers(3)](size)
    for k in range(int(rng.integers(5, 13))):
        solid = draw_solid(rng, size * rng.uniform(0.5, 1.0), kinds)
        if solid.shape['type'] == 'box' and rng.random() < 0.5:
            solid = _in_pieces(rng, solid)
        z += solid.radius
        bodies.append(body(f'b{k}', solid, mass * spread ** rng.random(),
                           (*size * rng.uniform(-0.7, 0.7, 2), z), any_attitude(rng)))
        z += solid.radius + 0.05 * size
    # Balls come to rest as well.
    resists = {'rolling': 0.03 * size, 'spinning': 0.03 * size}
    surface = {'friction': float(rng.uniform(0.2, 1.0)), 'restitution': 0.0, **resists}
    spec = world([*bodies, *container], scales.h, surface)
    return Scene(spec, size, scales.steps(REST + math.sqrt(2.0 * z / size)),
                 {'highest': z, 'container': [one['name'] for one in container]})


def _plane(size: float) -> list[Spec]:
    return [plane()]


def _box(size: float) -> list[Spec]:
    """Return a floor and four walls, flush with each other, 3 sizes wide inside."""
    half, thick, high = 1.5 * size, 0.3 * size, 3.0 * size
    walls = [fixed('floor', box((2 * (half + thick), 2 * (half + thick), thick)),
                   (0, 0, -0.5 * thick))]
    for k, (x, y) in enumerate(((1, 0), (-1, 0), (0, 1), (0, -1))):
        length = 2 * half if x else 2 * (half + thick)
        across = (thick, length, high) if x else (length, thick, high)
        at = half + 0.5 * thick
        walls.append(fixed(f'wall{k}', box(across), (at * x, at * y, 0.5 * high)))
    return walls


def _bowl(size: float) -> list[Spec]:
    """Return a paraboloid 20 sizes wide and 20 high at its corners: nothing gets over its rim."""
    x = np.linspace(-10.0, 10.0, 25) * size
    z = 0.1 / size * (x[:, None] ** 2 + x[None, :] ** 2)
    return [{'name': 'bowl', 'fixed': True, 'shape': {
        'type': 'heightfield', 'heights': z.tolist(), 'size': [20.0 * size, 20.0 * size]}}]


def _in_pieces(rng: Generator, whole: Solid) -> Solid:
    """Return a box as two to eight boxes that lie flush, in any order."""
    size, counts = np.asarray(whole.shape['size']), rng.integers(1, 3, 3)
    counts[rng.integers(3)] = 2
    parts = [(box(size / counts), size / counts * (np.array(k) - 0.5 * (counts - 1)))
             for k in np.ndindex(*counts)]
    rng.shuffle(parts)
    return compound(parts)


def judge_heap(scene: Scene, build: Build) -> Verdict:
    """
    Ask of each step whether anything overlaps or gains energy, and of the end whether all rests.

    What hits at the speed v of a fall from the highest place may, where an impact within the step
    turns its way, overlap by a part of v h, and by no more than that: it is pushed apart before
    the next one. The energy may grow by what a push lifts: g h^2 a step is what gravity does in
    one, and 1e-3 m g size more are not a hundredth of a size for a tenth of the bodies. At rest
    the container bears the weight, nothing moves by what gravity adds in a step, and overlaps are
    those of rest.
    """
    run, of, spec = build(scene.spec), masses(scene.spec), scene.spec
    scale = float(of.m.sum()) * G * scene.size
    fast = math.sqrt(2.0 * G * scene.facts['highest'])

    def energy(now: Look) -> float:
        return float(now.kinetic.sum()) + potential(spec, of, now)

    least, gained, deepest = energy(look(of, run.motion())), 0.0, 0.0
    for _ in range(scene.steps):
        run.step(1)
        now = energy(look(of, run.motion()))
        gained, least = max(gained, now - least), min(least, now)
        deepest = max(deepest, run.deepest())
    force = sum(run.force_on(name) for name in scene.facts['container'])
    weight = G * float(of.m.sum())
    return worst([
        Verdict(deepest, 0.02 * scene.size + 0.5 * fast * scene.h, 'm of overlap on the way'),
        Verdict(gained / scale, 1e-3, 'm g size of energy gained'),
        Verdict(float(np.abs(force / weight + (0, 0, 1)).max()), 1e-2,
                'force on what holds the heap, share of the weight'),
        Verdict(float(np.abs(run.motion()[:, 7:10]).max()), G * scene.h, 'm/s at rest'),
        Verdict(run.deepest(), 1e-3 * scene.size, 'm of overlap at rest')])
