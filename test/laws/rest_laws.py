# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is known and what is decided: weight at rest, exact limits, what stands, what sticks."""

from collections.abc import Callable
import math

from laws.motion import Build, masses, Verdict, worst
from laws.scenes import (
    body, draw_masses, draw_scales, draw_surface, G, plane, Scene, turn, world)
from laws.solids import box, flat_solid, Generator, Solid, sphere
import numpy as np


def draw_weight(rng: Generator,
                draw: Callable[[Generator, float], Solid] = flat_solid) -> Scene:
    """Draw a column of one to ten bodies that stands on the ground, of any masses."""
    scales = draw_scales(rng, coarsest=0.2)
    count = int(rng.integers(1, 11))
    bodies, height = [], 0.0
    for k, mass in enumerate(draw_masses(rng, count)):
        solid = draw(rng, scales.size)
        up = solid.reach(np.array((0.0, 0.0, 1.0)))
        bodies.append(body(f'b{k}', solid, mass, (0, 0, height + up)))
        height += 2 * up
    surface = draw_surface(rng)
    spec = world([*bodies, plane()], scales.h, surface)
    return Scene(spec, scales.size, 300, {'count': count})


def judge_weight(scene: Scene, build: Build) -> Verdict:
    """
    Compare the force on the ground with the weight, and look for motion.

    The column starts at rest and touches: F = m g from the start, and nothing moves. What a soft
    contact needs to find that is over after 300 steps. In a step in which the speeds of the
    bodies change by dv the force is wrong by m dv / h: at rest dv is nothing. 1e-3 of the weight
    is what a good scale shows. Nothing sinks: a contact is as stiff as the step allows, g h^2 for
    each body, and a thousandth of a size is what no one sees.
    """
    run, of = build(scene.spec), masses(scene.spec)
    start = run.motion()
    run.step(scene.steps)
    now = run.motion()
    weight = G * of.m.sum()
    force = -run.force_on('ground')[2]
    moved = float(np.abs(now[:, :3] - start[:, :3]).max())
    fastest = float(np.abs(now[:, 7:10]).max())
    return worst([
        Verdict(abs(force / weight - 1.0), 1e-3, 'force on the ground, share of the weight'),
        Verdict(moved, scene.facts['count'] * (G * scene.h ** 2 + 1e-3 * scene.size),
                'm that a standing column moved'),
        Verdict(fastest, G * scene.h, 'm/s in a standing column')])


def draw_limit(rng: Generator) -> Scene:
    """Draw a motion with an exact solution: a fall, a slide, a ball that slides until it rolls."""
    scales = draw_scales(rng, coarsest=0.1)
    kind = str(rng.choice(['bounce', 'slide', 'roll', 'slope']))
    size, mass = scales.size, draw_masses(rng, 1)[0]
    t = scales.time * rng.uniform(1.5, 3.0)
    facts = {'kind': kind, 'mass': mass, 't': t}
    gravity = (0.0, 0.0, -G)
    if kind == 'bounce':
        surface = draw_surface(rng, restitution=rng.uniform(0.3, 1.0))
        facts |= {'drop': size * rng.uniform(0.1, 2.0), 'e': surface['restitution']}
        one = body('b', sphere(0.5 * size), mass, (0, 0, 0.5 * size + facts['drop']))
    elif kind == 'slide':
        surface = draw_surface(rng, restitution=0.0, friction=rng.uniform(0.05, 0.6))
        facts |= {'v': scales.speed * rng.uniform(0.5, 3.0), 'mu': surface['friction']}
        one = body('b', box((size, size, 0.3 * size)), mass, (0, 0, 0.15 * size),
                   linear=(facts['v'], 0, 0))
    elif kind == 'roll':
        surface = draw_surface(rng, restitution=0.0, friction=rng.uniform(0.05, 0.6))
        facts |= {'v': scales.speed * rng.uniform(0.5, 3.0), 'mu': surface['friction']}
        one = body('b', sphere(0.5 * size), mass, (0, 0, 0.5 * size), linear=(facts['v'], 0, 0))
    else:
        angle, mu = rng.uniform(0.1, 0.5), rng.uniform(0.0, 2.0)
        surface = draw_surface(rng, restitution=0.0, friction=mu)
        facts |= {'angle': angle, 'mu': mu}
        gravity = (G * math.sin(angle), 0.0, -G * math.cos(angle))
        one = body('b', sphere(0.5 * size), mass, (0, 0, 0.5 * size))
    spec = world([one, plane()], scales.h, surface, gravity)
    facts['start'] = one['pose']['position']
    return Scene(spec, size, math.ceil(t / scales.h), facts)


def exact(facts: dict, t: float) -> tuple[float, float]:
    """
    Return place and speed of the limit: along z for a bounce, else along x.

    A ball with I = 2/5 m r^2 that slides with mu slows by mu g and begins to roll at 5/7 of its
    speed; on a slope it rolls with 5/7 g sin a if mu >= 2/7 tan a, else it slides.
    """
    kind = facts['kind']
    if kind == 'bounce':
        fall = math.sqrt(2 * facts['drop'] / G)
        up, begin = facts['e'] * G * fall, fall
        if t < fall:
            return facts['drop'] - 0.5 * G * t * t, -G * t
        while t > begin + 2 * up / G:
            begin, up = begin + 2 * up / G, up * facts['e']
            if up < 1e-3 * G * fall:
                return 0.0, 0.0
        s = t - begin
        return up * s - 0.5 * G * s * s, up - G * s
    if kind == 'slope':
        a, mu = facts['angle'], facts['mu']
        pull = G * (math.sin(a) - mu * math.cos(a))
        if mu >= 2 / 7 * math.tan(a):
            pull = 5 / 7 * G * math.sin(a)
        return 0.5 * pull * t * t, pull * t
    v, slow = facts['v'], facts['mu'] * G
    last = 5 / 7 * v if kind == 'roll' else 0.0
    until = min(t, (v - last) / slow)
    way = v * until - 0.5 * slow * until * until
    return way + last * (t - until), v - slow * until


def judge_limit(scene: Scene, build: Build) -> Verdict:
    """
    Compare the distance to the exact solution with a line through 0: half the step, half of it.

    Impact, and change from sliding to rolling, are known to a step. Each such moment leaves
    a speed wrong by its change of acceleration times h, at most 2 g h, and a place by that times
    the time left, and by the speed times h: per impact of a bounce e^k v h, in all v h / (1 - e)
    at most, of the time that is run no more than its count. The law is asked at h, h / 2 and
    h / 4: a method that does not converge cannot keep below a line that falls with the step.
    """
    facts, verdicts = scene.facts, []
    for halvings in (0, 1, 2):
        h = scene.h / 2 ** halvings
        spec = scene.spec | {'world': scene.spec['world'] | {'step': h}}
        run = build(spec)
        steps = scene.steps * 2 ** halvings
        run.step(steps)
        motion, t = run.motion()[0], steps * h
        way, speed = exact(facts, t)
        moments, fast = 1, facts.get('v', G * t)
        if facts['kind'] == 'bounce':
            v = math.sqrt(2 * G * facts['drop'])
            moments, fast = _bounces(facts, t), v
        axis = 2 if facts['kind'] == 'bounce' else 0
        place = motion[axis] - facts['start'][axis] + facts.get('drop', 0.0)
        wrong = 2 * G * h * moments
        verdicts.append(Verdict(abs(float(place - way)), wrong * t + fast * h * moments
                                + 1e-9 * scene.size, f"m off the limit, {facts['kind']}"))
        # A bounce within a step of the end has either sign of the speed.
        if facts['kind'] != 'bounce' or way > 2 * fast * h * moments:
            verdicts.append(Verdict(abs(float(motion[7 + axis] - speed)), wrong
                                    + 1e-9 * fast, f"m/s off the limit, {facts['kind']}"))
    return worst(verdicts)


def _bounces(facts: dict, t: float) -> int:
    """Return how often a ball hits the ground until t, at most 20."""
    fall = math.sqrt(2 * facts['drop'] / G)
    begin, up, count = fall, facts['e'] * G * fall, 1
    while begin + 2 * up / G < t and count < 20:
        begin, up, count = begin + 2 * up / G, up * facts['e'], count + 1
    return count


def draw_decided(rng: Generator) -> Scene:
    """Draw a box or a column of boxes on a slope: sticks or slides, stands or falls."""
    scales = draw_scales(rng, coarsest=0.1)
    size = scales.size
    angle = rng.uniform(0.05, 0.9)
    # How far from the limits: 5 % at least, so that a solver's rounding decides nothing.
    ratio = float(rng.choice([rng.uniform(0.3, 0.95), rng.uniform(1.05, 2.5)]))
    yaw = turn((0, 0, 1), rng.uniform(0, math.pi) * rng.integers(2))
    mass = draw_masses(rng, 1)[0]
    if rng.random() < 0.5:
        # Low: it never topples. mu over tan(angle) is `ratio`.
        low = size * np.array((1.0, rng.uniform(0.5, 1.0), 0.25 / max(1.0, math.tan(angle))))
        mu, what = ratio * math.tan(angle), 'slides'
        happens = ratio < 1.0
    else:
        # Friction enough: it topples where tan(angle) is above width over height.
        wide = size * rng.uniform(0.2, 0.6)
        low = np.array((wide, size * rng.uniform(0.3, 1.0), wide * ratio / math.tan(angle)))
        if low[2] > 5 * size:
            low *= 5 * size / low[2]
        mu, what = min(2.0, 1.3 * math.tan(angle) + 0.3), 'falls'
        happens = ratio > 1.0
        yaw = turn((0, 0, 1), math.pi * rng.integers(2))
    one = body('b', box(low), mass, (0, 0, 0.5 * low[2]), yaw)
    gravity = (G * math.sin(angle), 0.0, -G * math.cos(angle))
    # A body with an excess of 5 % leaves by x = a t^2 / 2, a = 0.05 g sin(angle): after 12 of its
    # times by 3.6 sin(angle) sizes, if slow at first.
    steps = min(scales.steps(12.0 * math.sqrt(float(low.max()) / size)), 6000)
    surface = draw_surface(rng, restitution=0.0, friction=mu)
    spec = world([one, plane()], scales.h, surface, gravity)
    return Scene(spec, size, steps, {'what': what, 'happens': bool(happens)})


def judge_decided(scene: Scene, build: Build) -> Verdict:
    """
    Compare what happened with what must happen; all models then agree.

    What sticks or stands stays where it is, but for what a contact gives while it finds its
    force, g h^2 and a thousandth of the size. What slides or falls has gone by a tenth.
    """
    run = build(scene.spec)
    start = run.motion()[0]
    run.step(scene.steps)
    now = run.motion()[0]
    turned = 2 * math.acos(min(1.0, abs(float(start[3:7] @ now[3:7]))))
    if scene.facts['what'] == 'slides':
        moved = float(np.abs(now[:3] - start[:3]).max()) / scene.size
    else:
        moved = turned
    if not scene.facts['happens']:
        return Verdict(moved, 1e-3 + 2 * G * scene.h ** 2 / scene.size,
                       f"{scene.facts['what']} that must not: sizes or rad")
    return Verdict(0.1 / max(moved, 1e-12), 1.0,
                   f"0.1 over the sizes or rad by which it {scene.facts['what']}")
