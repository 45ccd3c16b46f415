# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Energy and momentum: what only work and outer forces may change."""

from collections.abc import Callable
import math

from laws.motion import Build, Look, look, Masses, masses, potential, Verdict, worst
from laws.scenes import (
    any_attitude, body, direction, draw_masses, draw_scales, draw_surface, extent, fixed, G, heap,
    matrix, plane, Scales, Scene, Spec, world)
from laws.solids import box, cylinder, draw_solid, Generator, Solid, sphere
import numpy as np

LOOKS = 200  # at most, over a run


def draw_energy(rng: Generator,
                draw: Callable[[Generator, float], Solid] = draw_solid) -> Scene:
    """Draw a heap that falls on a plane or on a fixed box, or bodies that meet in space."""
    scales = draw_scales(rng)
    if rng.random() < 0.2:
        return swarm(rng, scales, draw_surface(rng), draw)
    bodies = heap(rng, scales, draw=draw)
    width = 6.0 * scales.size
    bodies.append(plane() if rng.random() < 0.6
                  else fixed('floor', box((width, width, scales.size)), (0, 0, -scales.size / 2)))
    spec = world(bodies, scales.h, draw_surface(rng))
    return Scene(spec, scales.size, scales.steps(6.0))


def swarm(rng: Generator, scales: Scales, surface: dict[str, float],
          draw: Callable[[Generator, float], Solid] = draw_solid) -> Scene:
    """Return two to ten bodies on a sphere around the origin that fly towards it."""
    count = int(rng.integers(2, 11))
    bodies = []
    for k, mass in enumerate(draw_masses(rng, count)):
        # Bodies on the shells of radii 2 k sizes cannot touch at the start.
        n = direction(rng)
        place = n * scales.size * 1.01 * (k + 0.5) * 1.8
        v = -n * scales.speed * rng.uniform(0.5, 2.0) + 0.1 * scales.speed * rng.normal(size=3)
        bodies.append(body(f'b{k}', draw(rng, scales.size), mass, place, any_attitude(rng),
                           v, rng.normal(size=3) / scales.time))
    spec = world(bodies, scales.h, surface, gravity=(0, 0, 0))
    return Scene(spec, scales.size, scales.steps(6.0))


def judge_energy(scene: Scene, build: Build) -> Verdict:
    """
    Compare the energy at each look with the least before it.

    What a lawful method may add, and no more:
    - A second order method errs by third order within a step: where the line of contact turns by a
      in it, a body may gain a^3 of its kinetic energy. (A first order one gains a^2 each step,
      which adds up to a share per radian turned, whatever the step.) The line turns as the bodies
      do, w h, or as a body moves along the other, v h / size.
    - A velocity is known to g h: 1/2 m (g h)^2 for each body, once.
    - What lies in an overlap of depth d may be lifted out of it: m g d for each body. That takes
      several steps, so d is the deepest overlap since the least energy.
    - Rounding: of the positions, m g |x| eps in each step; relative to the energy 1e-9.
    """
    spec, of, h = scene.spec, masses(scene.spec), scene.h
    g = float(np.linalg.norm(spec['world']['gravity']))
    every = math.ceil(scene.steps / LOOKS)
    run = build(spec)
    now = look(of, run.motion())
    least = energy = now.kinetic.sum() + potential(spec, of, now)
    scale = float(now.kinetic.sum() + (of.m * g) @ (np.abs(now.x).sum(axis=1) + scene.size))
    once = of.m.sum() * (g * h) ** 2
    allowed = deepest = 0.0
    worst_yet = Verdict(0.0, 1e-9, 'gain of energy, share')
    for _ in range(0, scene.steps, every):
        before = now
        run.step(every)
        now = look(of, run.motion())
        energy = now.kinetic.sum() + potential(spec, of, now)
        allowed += every * float(np.maximum(now.kinetic, before.kinetic)
                                 @ _turns(spec, of, before, now, every * h, h) ** 3)
        deepest = max(deepest, run.deepest())
        lifted = of.m.sum() * g * deepest
        verdict = Verdict((energy - least) / scale,
                          1e-9 + (allowed + once + lifted) / scale, 'gain of energy, share')
        worst_yet = worst([worst_yet, verdict])
        # What was lost since pays for nothing later: the least so far is what counts, and what
        # turning was allowed before it is spent.
        if energy < least:
            least, allowed, deepest = energy, 0.0, run.deepest()
    return worst_yet


def judge_flight(scene: Scene, build: Build) -> Verdict:
    """
    Compare the energy after each step with the least before it, however far a body turns in one.

    In free space there is no work and nothing to be lifted out of. What is left is the gain of a
    thousandth that a body, or a pair, may keep in a step of what its turning gains, beside what
    impacts take: of one or two steps in a scene, and rarely of all of the energy.
    """
    of, run = masses(scene.spec), build(scene.spec)
    start = least = float(look(of, run.motion()).kinetic.sum())
    most = 0.0
    for _ in range(scene.steps):
        run.step(1)
        now = float(look(of, run.motion()).kinetic.sum())
        most, least = max(most, now - least), min(least, now)
        if not np.isfinite(now):
            return Verdict(math.inf, 0.0, 'of the scene itself: not finite')
    return Verdict(most / start, 1e-3, 'gain of energy, share')


def _turns(spec: Spec, of: Masses, before: Look, now: Look, time: float, h: float) -> np.ndarray:
    """
    Return by how much [rad] the lines turn along which each body is touched, in a step.

    What flies free, known by its momenta, only turns itself. What touches something is carried
    around by what is heavier; what is lighter disturbs it by its own energy at most.
    """
    def most(vectors: np.ndarray, others: np.ndarray) -> np.ndarray:
        return np.maximum(np.linalg.norm(vectors, axis=1), np.linalg.norm(others, axis=1))

    fallen = of.m[:, None] * np.asarray(spec['world']['gravity']) * time
    flies = ((np.abs(now.P - before.P - fallen).max(axis=1) <= 1e-9 * np.abs(now.P).max(axis=1))
             & (np.abs(now.L - before.L).max(axis=1) <= 1e-9 * np.abs(now.L).max(axis=1)))
    turns = most(now.w, before.w)
    sizes = np.array([extent(one['shape']) if one.get('inertial') else math.inf
                      for one in spec['bodies']])
    touched = np.where(flies, 0.0, np.maximum(turns, most(now.v, before.v) / sizes))
    heaviest = np.argsort(-of.m, kind='stable')
    carried = np.empty(len(of.m))
    carried[heaviest] = np.maximum.accumulate(touched[heaviest])
    return h * np.where(flies, turns, carried)


def draw_momentum(rng: Generator,
                  draw: Callable[[Generator, float], Solid] = draw_solid) -> Scene:
    """Draw bodies that meet in space, or fall together."""
    scales = draw_scales(rng)
    scene = swarm(rng, scales, draw_surface(rng), draw)
    if rng.random() < 0.5:
        scene.spec['world']['gravity'] = [0.0, 0.0, -G]
    return scene


def judge_momentum(scene: Scene, build: Build) -> Verdict:
    """
    Compare P and L of all bodies with those at the start and what gravity gave.

    Forces between bodies are equal and opposite and act at one point, so both are kept to
    rounding: 1e-16 of the largest term for each of some thousand steps and contacts, 1e-11;
    1e-9 leaves room for sums that cancel. Gravity turns nothing about the common centre of mass.
    """
    spec, of = scene.spec, masses(scene.spec)
    run = build(spec)
    start = now = look(of, run.motion())
    gravity = np.asarray(spec['world']['gravity'])

    def total(at):
        middle = of.m @ at.x / of.m.sum()
        return at.P.sum(axis=0), (at.L + np.cross(at.x - middle, at.P)).sum(axis=0)

    P, L = total(start)
    verdicts = []
    every = math.ceil(scene.steps / 20)
    for k in range(every, scene.steps + every, every):
        run.step(every)
        now = look(of, run.motion())
        P_now, L_now = total(now)
        fallen = of.m.sum() * gravity * k * scene.h
        size = np.abs(now.x).max() + scene.size
        scale = np.abs(now.P).max() + np.abs(start.P).max()
        verdicts += [
            Verdict(float(np.abs(P_now - P - fallen).max() / scale), 1e-9, 'P, share'),
            Verdict(float(np.abs(L_now - L).max() / (scale * size)), 1e-9, 'L, share')]
    return worst(verdicts)


def draw_rolling(rng: Generator) -> Scene:
    """Draw what rolls without slipping: a ball, its centre of mass off or not, a lying roller."""
    scales = draw_scales(rng, coarsest=0.1)
    r, rate = 0.5 * scales.size, 1.0 / scales.time
    mass = draw_masses(rng, 1)[0]
    kind = rng.choice(['ball', 'rocker', 'roller', 'disk'])
    if kind == 'disk':
        return _disk(rng, scales, r, mass)
    q, angle = np.array((0.0, 0.0, 0.0, 1.0)), rng.uniform(0, 2 * math.pi)
    along = np.array((math.cos(angle), math.sin(angle), 0.0))
    axis = np.array((-along[1], along[0], 0.0))
    solid, w = sphere(r), axis * rate * rng.uniform(0.1, 3.0)
    com = (0.0, 0.0, 0.0)
    if kind == 'rocker':
        # Starts at rest, tilted by up to 0.5 rad, its centre low by up to half a radius: it needs
        # friction of less than tan(0.5) and never lifts, w^2 low < g.
        low, w = rng.uniform(0.1, 0.5), np.zeros(3)
        tilt = rng.uniform(0.1, 0.5)
        q = np.append(axis * math.sin(tilt / 2), math.cos(tilt / 2))
        com = (0.0, 0.0, -low * r)
    if kind == 'roller':
        solid = cylinder(r, 2 * r * rng.uniform(0.5, 2.0))
        # z of the body along the axis of the roll.
        n = np.cross((0.0, 0.0, 1.0), axis)
        q = np.append(n * math.sin(math.pi / 4), math.cos(math.pi / 4))
    v = np.cross(w, (0, 0, r))
    surface = draw_surface(rng, friction=rng.uniform(1.0, 2.0))
    bodies = [body('b0', solid, mass, (0, 0, r), q, v, w, com), plane()]
    steps = min(scales.steps(60.0), 10_000)
    return Scene(world(bodies, scales.h, surface), scales.size, steps, {'kind': str(kind)})


def _disk(rng: Generator, scales: Scales, r: float, mass: float) -> Scene:
    """
    Return a thin disk that rolls on the rim around a point, its centre at rest (Euler's disk).

    With the inclination a of its plane and its axis e3 up, the body turns about the line through
    the centre and the point of contact with w, and the point runs around at W: W^2 sin a =
    4 g / r for a thin disk (Moffatt, "Euler's disk and its finite-time singularity", 2000), and
    w = -W sin a along the diameter through the contact. Friction is not needed: the centre rests.
    """
    a = rng.uniform(0.2, 1.0)
    rate = math.sqrt(4 * G / r / math.sin(a))
    # The disk has no thickness in that formula: the rim's lower edge touches at a thickness t,
    # whose lever changes the balance by t / r.
    t = 0.01 * r
    solid = cylinder(r, t)
    q = np.array((math.sin(a / 2), 0.0, 0.0, math.cos(a / 2)))
    R = matrix(q)
    # The lowest point of the rim is towards -y of the body (after a turn by a about x).
    down = R @ (0.0, -1.0, 0.0)
    height = solid.reach(R.T @ (0.0, 0.0, -1.0))
    w = down * rate * math.sin(a)
    # Half the thickness puts the contact beside that line: the centre moves so that it rests.
    v = -np.cross(w, r * down - 0.5 * t * R[:, 2])
    bodies = [body('b0', solid, mass, (0, 0, height), q, v, w), plane()]
    surface = draw_surface(rng, friction=rng.uniform(1.0, 2.0))
    steps = min(scales.steps(10.0), 4000)
    return Scene(world(bodies, scales.h, surface), scales.size, steps,
                 {'kind': 'disk', 'rate': rate})


def judge_rolling(scene: Scene, build: Build) -> Verdict:
    """
    Compare the energy at each look with that at the start, both ways.

    No slipping, no impact: the energy stays. A second order method errs by (w h)^3 of it in a step
    and by (w h)^2 within a swing; w is the rate at which the body turns or, if faster, that at
    which the point of contact runs around. Where a disk's thickness throws its balance off, it
    sways, and lawfully keeps its energy. The other allowances are those of judge_energy.
    """
    spec, of, h = scene.spec, masses(scene.spec), scene.h
    every = math.ceil(scene.steps / LOOKS)
    run = build(spec)
    now = look(of, run.motion())
    rest = _lowest(scene)
    start = float(now.kinetic.sum() + potential(spec, of, now)) - rest
    once = of.m.sum() * ((G * h) ** 2 + G * 1e-6 * scene.size) / start
    allowed, verdicts = 0.0, []
    rate = float(np.abs(now.w).max())
    for k in range(every, scene.steps + every, every):
        run.step(every)
        now = look(of, run.motion())
        rate = max(scene.facts.get('rate', 0.0), rate, float(np.linalg.norm(now.w, axis=1).max()))
        allowed = (rate * h) ** 2 + k * (rate * h) ** 3
        energy = float(now.kinetic.sum() + potential(spec, of, now)) - rest
        verdicts.append(Verdict(abs(energy / start - 1.0), allowed + once + 1e-9,
                                f"energy of a {scene.facts['kind']}, share"))
        if not np.isfinite(energy) or energy > 2 * start:
            break
    return worst(verdicts)


def _lowest(scene: Scene) -> float:
    """Return the potential energy [J] of a rolling body in the lowest place it can have."""
    one = scene.spec['bodies'][0]
    r = one['shape']['radius']
    height = 0.0 if scene.facts['kind'] == 'disk' else r + one['inertial']['com'][2]
    return float(one['inertial']['mass'] * G * height)
