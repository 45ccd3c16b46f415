# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Impacts: what is inelastic stays together, and what is symmetric stays so."""

from collections.abc import Callable
import math

from laws.motion import Build, look, masses, Verdict
from laws.scenes import (
    any_attitude, body, direction, draw_masses, draw_scales, draw_surface, G, matrix, plane,
    Scales, Scene, turn, world)
from laws.solids import draw_solid, flat_solid, Generator, Solid, sphere
from laws.symmetric_scenes import draw_several
import numpy as np


def draw_inelastic(rng: Generator,
                   draw: Callable[[Generator, float], Solid] = flat_solid) -> Scene:
    """Draw a column of which the upper part falls on the lower, or a ball that hits a body."""
    scales = draw_scales(rng)
    surface = draw_surface(rng, restitution=0.0)
    if rng.random() < 0.5:
        return _hit(rng, scales, surface, draw)
    count = int(rng.integers(1, 7))
    standing = int(rng.integers(0, count))
    drop = scales.size * rng.uniform(0.1, 3.0)
    fall = scales.speed * rng.uniform(0.0, 2.0)
    bodies, height = [], 0.0
    for k, mass in enumerate(draw_masses(rng, count)):
        solid = draw(rng, scales.size)
        up = solid.reach(np.array((0.0, 0.0, 1.0)))
        height += drop if k == standing else 0.0
        v = (0, 0, -fall) if k >= standing else (0, 0, 0)
        bodies.append(body(f'b{k}', solid, mass, (0, 0, height + up), linear=v))
        height += 2 * up
    approach = math.sqrt(fall ** 2 + 2 * G * drop)
    # Until it lies, and as long again.
    steps = math.ceil(2 * (approach - fall) / G / scales.h) + scales.steps(0.5)
    return Scene(world([*bodies, plane()], scales.h, surface), scales.size, steps,
                 {'kind': 'column', 'approach': approach})


def _hit(rng: Generator, scales: Scales, surface: dict[str, float],
         draw: Callable[[Generator, float], Solid]) -> Scene:
    """Return a ball that hits the middle of a flat side, or another ball, in space."""
    r = 0.5 * scales.size * rng.uniform(0.2, 1.0)
    q = any_attitude(rng)
    masses_ = draw_masses(rng, 2)
    other = sphere(0.5 * scales.size) if rng.random() < 0.3 else draw(rng, scales.size)
    # The place hit is on the side +z of the other body, or anywhere on a ball; off the middle by
    # up to half of what there is.
    n = np.array((0.0, 0.0, 1.0))
    top = other.reach(n)
    off = np.zeros(3)
    if other.shape['type'] != 'sphere':
        off[:2] = 0.35 * rng.uniform(-1, 1, 2) * _half_widths(other)
    else:
        n = direction(rng)
    point = top * n + off
    # It crosses 0.01 % to 1 % of its size in a step, so that a side which it turns is still much
    # as it was when the speeds are compared: see judge_inelastic.
    v = float(scales.size / scales.h * 10 ** rng.uniform(-4, -2))
    n_W, point_W = matrix(q) @ n, matrix(q) @ point
    gap = scales.size * rng.uniform(0.01, 0.1)
    common = scales.speed * rng.normal(size=3) * rng.integers(0, 2)
    spin = rng.normal(size=3) / scales.time * rng.integers(0, 2)
    ball = body('ball', sphere(r), masses_[0], point_W + (r + gap) * n_W, (0, 0, 0, 1),
                common - v * n_W, spin)
    hit = body('hit', other, masses_[1], (0, 0, 0), q, common)
    spec = world([ball, hit], scales.h, surface, gravity=(0, 0, 0))
    steps = math.ceil(gap / v / scales.h) + 2
    return Scene(spec, scales.size, steps,
                 {'kind': 'hit', 'approach': v, 'normal': n.tolist(), 'radius': r, 'top': top,
                  'ball': other.shape['type'] == 'sphere'})


def _half_widths(solid: Solid) -> np.ndarray:
    return np.array([solid.reach(e) for e in np.eye(3)[:2]])


def judge_inelastic(scene: Scene, build: Build) -> Verdict:
    """
    Compare the speed of separation with that of the approach.

    In a column nothing may rise: what rises has got more than it lost. All of it ends at rest
    whatever the masses, since every contact closes. Speeds are known to g h. A ball that hit a
    side keeps to it; in up to three steps after it the side turns by w t, and the ball, which
    flies on straight, leaves it with w^2 R t.
    """
    approach, h = scene.facts['approach'], scene.h
    run = build(scene.spec)
    if scene.facts['kind'] == 'column':
        fastest, every = 0.0, math.ceil(scene.steps / 400)
        for _ in range(0, scene.steps, every):
            run.step(every)
            fastest = max(fastest, float(np.nan_to_num(run.motion()[:, 9], nan=np.inf).max()))
        return Verdict(fastest, 0.02 * approach + G * h, 'm/s upwards after an inelastic impact')
    run.step(scene.steps)
    ball, hit = run.motion()
    R = matrix(hit[3:7])
    if scene.facts['ball']:
        n = ball[:3] - hit[:3]
        n /= np.linalg.norm(n)
    else:
        n = R @ scene.facts['normal']
    p = ball[:3] - scene.facts['radius'] * n
    relative = ball[7:10] - hit[7:10] - np.cross(hit[10:], p - hit[:3])
    w = float(np.linalg.norm(hit[10:]))
    slip = float(np.linalg.norm(relative)) + w * scene.size
    allowed = 0.02 * approach + 3 * h * slip * max(w, slip / scene.size)
    return Verdict(float(relative @ n), allowed, 'm/s of separation after an inelastic hit')


def draw_symmetric(rng: Generator) -> Scene:
    """Draw a column that falls flat, a body that meets its image, or several and their images."""
    scales = draw_scales(rng)
    kind = rng.random()
    if kind < 0.5:
        return _mirrored_pair(rng, scales)
    if kind > 0.75:
        return draw_several(rng, scales)
    surface = draw_surface(rng)
    count = int(rng.integers(1, 4))
    bodies, height, drop = [], 0.0, scales.size * rng.uniform(0.05, 3.0)
    fall = scales.speed * rng.uniform(0.0, 2.0)
    yaw = turn((0, 0, 1), rng.uniform(0, math.pi) * rng.integers(0, 2))
    for k, mass in enumerate(draw_masses(rng, count)):
        solid = flat_solid(rng, scales.size)
        up = solid.reach(np.array((0.0, 0.0, 1.0)))
        bodies.append(body(f'b{k}', solid, mass, (0, 0, height + up + drop), yaw,
                           linear=(0, 0, -fall)))
        height += 2 * up
    # Up to the first impact and a bit more. What bounces flat again and again does not stay flat:
    # a tilt by rounding is a corner that hits first, however little.
    fall_time = (math.sqrt(fall ** 2 + 2 * G * drop) - fall) / G
    after = scales.steps(1.0) if surface['restitution'] == 0.0 else 2
    steps = math.ceil(fall_time / scales.h) + after
    return Scene(world([*bodies, plane()], scales.h, surface), scales.size, steps,
                 {'kind': 'flat'})


def _mirrored_pair(rng: Generator, scales: Scales) -> Scene:
    """Return a body and its mirror image that fly into each other through the plane x = 0."""
    solid = draw_solid(rng, scales.size, ('sphere', 'box', 'cylinder', 'capsule'))
    q = any_attitude(rng) if rng.random() < 0.7 else np.array((0.0, 0.0, 0.0, 1.0))
    v = scales.size / scales.h * 10 ** rng.uniform(-4, -1)
    gap = scales.size * rng.uniform(0.01, 0.2)
    reach = solid.reach(matrix(q).T @ (-1.0, 0.0, 0.0))
    y, z = 0.3 * v * rng.normal(size=2)
    mass, x = draw_masses(rng, 1)[0], reach + gap
    bodies = [body('right', solid, mass, (x, 0, 0), q, (-v, y, z)),
              body('left', solid, mass, (-x, 0, 0), (q[0], -q[1], -q[2], q[3]), (v, y, z))]
    spec = world(bodies, scales.h, draw_surface(rng), gravity=(0, 0, 0))
    return Scene(spec, scales.size, math.ceil(gap / v / scales.h) + 5, {'kind': 'mirrored'})


def judge_symmetric(scene: Scene, build: Build) -> Verdict:
    """
    Compare with what symmetry says.

    What falls flat does not turn and goes nowhere sideways; of mirror images each stays the image
    of the other, and what stands in the plane of symmetry its own. Both follow from the symmetry
    of the equations, whatever the step; a solver stops at a residual, relative to the speed of the
    impact: 1e-6 of it is a tenth of a millimetre in a fall of a hundred metres. It finds the
    impulses to 1e-9 of the largest, which on a light body below a heavy one is that times the
    ratio of the masses.
    """
    run, of = build(scene.spec), masses(scene.spec)
    speed = float(np.abs(look(of, run.motion()).v).max())
    speed += math.sqrt(2 * G * 3 * scene.size) * (scene.facts['kind'] != 'mirrored')
    m = of.m[of.m > 0]
    allowed = 1e-6 + 1e-9 * float(m.max() / m.min())
    run.step(scene.steps)
    motion = run.motion()[of.m > 0]
    if scene.facts['kind'] == 'flat':
        wrong = max(np.abs(motion[:, 7:9]).max(), scene.size * np.abs(motion[:, 10:]).max())
        return Verdict(float(wrong / speed), allowed, 'speed sideways and of turning, share')
    right, left = np.transpose(scene.facts.get('images', [(0, 1)]))
    right, left = motion[right], motion[left]
    image = np.array((-1.0, 1.0, 1.0))
    wrong = max(np.abs(right[:, 7:10] - image * left[:, 7:10]).max(),
                scene.size * np.abs(right[:, 10:] + image * left[:, 10:]).max())
    return Verdict(float(wrong / speed), allowed, 'speed by which images differ, share')
