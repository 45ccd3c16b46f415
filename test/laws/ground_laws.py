# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Grounds of triangles: nothing gets through, they bear what lies on them, and flat is flat."""

import math

from laws.ground_scenes import inner_points
from laws.jointed_twins import Twin
from laws.motion import Build, look, masses, Verdict, worst
from laws.scenes import G, plane, Scene
from laws.solids import Generator
import numpy as np


def judge_through(scene: Scene, build: Build) -> Verdict:
    """
    Look for a body that has a point of its inside below the ground.

    That is half a thickness of the body, a tenth of its size and more, above any overlap that a
    contact leaves. What went over the edge of the ground, once, may be where it likes.
    """
    run, of, ground = build(scene.spec), masses(scene.spec), scene.facts['ground']
    there, deepest = None, -math.inf
    for _ in range(scene.steps):
        run.step(1)
        motion = run.motion()
        points = inner_points(scene.spec, look(of, motion), motion[:, 3:7])
        above = points[:, 2] - ground.height(points)
        there = np.isfinite(above) if there is None else there & np.isfinite(above)
        if not np.isfinite(points).all():
            return Verdict(math.inf, 0.0, 'of the scene itself: not finite')
        if not there.any():
            break
        deepest = max(deepest, -float(above[there].min()))
    return Verdict(deepest / scene.size, 0.0, 'sizes that the inside of a body is below')


def judge_resting(scene: Scene, build: Build) -> Verdict:
    """
    Compare the force on the ground with the weight, once all is at rest, and look for motion.

    The allowances are those of `judge_weight`. What came to rest may have rolled or slid before;
    what stood from the start has not moved.
    """
    run, of = build(scene.spec), masses(scene.spec)
    start = run.motion()
    run.step(scene.steps)
    now = run.motion()
    weight = G * of.m.sum()
    force = np.asarray(run.force_on('ground'))
    verdicts = [
        Verdict(float(np.abs(force / weight + (0, 0, 1)).max()), 1e-3,
                'force on the ground, share of the weight'),
        Verdict(float(np.abs(now[:, 7:10]).max()), G * scene.h, 'm/s of what is at rest')]
    if not scene.facts.get('comes'):
        moved = float(np.abs(now[:, :3] - start[:, :3]).max())
        verdicts.append(Verdict(
            moved, scene.facts['count'] * (G * scene.h ** 2 + 1e-3 * scene.size),
            'm that a standing column moved'))
    return worst(verdicts)


def on_a_plane(rng: Generator, scene: Scene) -> Twin:
    """Put a plane in place of a flat ground of triangles."""
    ground = scene.facts['ground']
    gx, gy = ground.slope
    x, y, z = ground.vertices[0]
    flat = plane() | {'shape': {'type': 'plane', 'normal': [-float(gx), -float(gy), 1.0]}}
    flat['pose'] = {'position': [0.0, 0.0, float(z - gx * x - gy * y)]}

    def back(m: np.ndarray) -> np.ndarray:
        return np.vstack([m[:-1], [0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0]])

    return Twin(scene.spec | {'bodies': [*scene.spec['bodies'][:-1], flat]}, back)
