# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Chains that hang nearly taut between two posts, with a heavy body on them, and their energy.

A taut chain moves sideways only as far as its links turn, and these, ever faster, the nearer to
straight it is: what presses on it, and what its joints need, depend on each other within a step.
"""

import math

from laws.jointed_laws import Holding
from laws.jointed_scenes import begins_apart
from laws.motion import Build, look, masses, Ours, potential, Verdict, worst
from laws.scenes import between, body, G, Scene, Spec, turn
from laws.solids import box, capsule, Generator, Solid, sphere
import numpy as np
from scipy.optimize import brentq

LINK = 0.2  # [m]
TIME = 0.6  # [s] in which what falls from 0.3 m lands and lies
LEVER = 0.05  # [m] of jointed_laws


def draw_bridge(rng: Generator) -> Scene:
    """Draw a chain of three to eight links, and a body of 1 to 30 times its mass above it."""
    while True:
        slack = between(rng, 1e-3, 0.05)
        spec = _draw(rng, slack)
        if begins_apart(spec):
            h = spec['world']['step']
            return Scene(spec, LINK, math.ceil(TIME / h), {'slack': slack})


def _draw(rng: Generator, slack: float) -> Spec:
    links = int(rng.integers(3, 9))
    ends, kind = _arc(links, slack), str(rng.choice(['revolute', 'spherical']))
    mass, radius = between(rng, 0.05, 0.5), 0.15 * LINK
    bodies = []
    for k in range(links):
        d = ends[k + 1] - ends[k]
        bodies.append(body(f'link{k}', capsule(radius, LINK), mass, 0.5 * (ends[k] + ends[k + 1]),
                           turn((0, 1, 0), math.atan2(d[0], d[2]))))
    joints = [{'name': f'joint{k}', 'type': kind, 'parent': f'link{k - 1}' if k else 'world',
               'child': f'link{k}' if k < links else 'world',
               'pose': {'position': [0, 0, 0.5 * LINK] if k else ends[0].tolist()}}
              | ({'axis': [0, 1, 0]} if kind == 'revolute' else {}) for k in range(links + 1)]
    size = float(rng.uniform(0.3, 0.8)) * LINK
    solid = sphere(size) if rng.random() < 0.5 else box([2 * size] * 3)
    bodies.append(_above(rng, ends, radius + size, solid, mass * links * between(rng, 1.0, 30.0)))
    return {'format': 1,
            'world': {'gravity': [0, 0, -G], 'step': float(rng.choice([1e-3, 2e-3]))},
            'materials': {'default': {'friction': float(rng.choice([0, 0.3, 0.8])),
                                      'restitution': 0.0}},
            'bodies': bodies, 'joints': joints}


def _arc(links: int, slack: float) -> np.ndarray:
    """Return the ends of links that hang in an arc, (links + 1, 3) [m], nearly as long as they."""
    # Chords 2 R sin a of a circle; the posts are 2 R sin(links a) apart.
    a = brentq(lambda a: math.sin(links * a) / math.sin(a) - (1 - slack) * links, 1e-9,
               math.pi / links)
    R, angles = 0.5 * LINK / math.sin(a), a * np.arange(-links, links + 1, 2)
    return np.column_stack([R * np.sin(angles), 0.0 * angles,
                            2.0 + R * (math.cos(links * a) - np.cos(angles))])


def _above(rng: Generator, ends: np.ndarray, reach: float, solid: Solid, mass: float) -> Spec:
    """Return a body above the chain, at rest or nearly on it, or where it falls for a while."""
    x = float(rng.uniform(-0.6, 0.6)) * ends[-1, 0]
    near = np.abs(ends[:, 0] - x) < reach + LINK
    z = float(ends[near, 2].max()) + reach + float(rng.choice([1e-3, 0.02, 0.3]))
    return body('heavy', solid, mass, [x, 0.0, z])


def judge_bridge(scene: Scene, build: Build) -> Verdict:
    """
    Compare the energy after each step with the least before it; joints hold at each look.

    Nothing gives energy, and what meets loses it. A second order method swings by (h W)^2 of the
    kinetic energy to either side. A chain that is longer by a share s than the posts are apart
    makes an angle sqrt(2 s) with the line between them where it is taut, and what is at its middle
    moves 1 / sqrt(2 s) times as fast as its ends would part: so a link that turns at w counts as
    W = w / sqrt(2 s). At least W is the rate of what hangs on a lever of 0.05 m. What lies in an
    overlap of depth d may be lifted out of it: m g d for each body.
    """
    spec, of, h = scene.spec, masses(scene.spec), scene.h
    run = build(spec)
    assert isinstance(run, Ours)
    bend = math.sqrt(2.0 * scene.facts['slack'])
    held, weight = Holding(spec, run.world), G * of.m.sum()
    rate, kinetic, deepest, least, verdicts = math.sqrt(G / LEVER), 0.0, 0.0, math.inf, []
    for _ in range(scene.steps):
        now = look(of, run.motion())
        energy = float(now.kinetic.sum()) + potential(spec, of, now)
        rate = max(rate, float(np.linalg.norm(now.w, axis=1).max()) / bend)
        kinetic = max(kinetic, float(now.kinetic.sum()))
        deepest = max(deepest, run.deepest())
        least = min(least, energy)
        allowed = 2.0 * (h * rate) ** 2 * kinetic + weight * deepest + 1e-9 * (kinetic + weight)
        verdicts += [Verdict(energy - least, allowed, 'J gained'), held.verdict()]
        if verdicts[-1].breach or not math.isfinite(energy):
            break
        run.step(1)
    return worst(verdicts)
