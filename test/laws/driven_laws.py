# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What drives that start from rest must not do: pass a wall or a body, or make energy of it."""

import math

from laws.driven_scenes import HALF_WIDTH
from laws.jointed_laws import fastest_spring, Holding, stored
from laws.motion import Build, look, masses, Ours, potential, Verdict, worst
from laws.scenes import Scene, Spec
import numpy as np

EDGE = 1.8  # [m] how near to the edge of a wall a body counts as having left it
REBOUND = 0.02  # of the fastest approach: what may come back from what is inelastic
TOUCHES = 1e-6  # [m]


def judge_driven(scene: Scene, build: Build) -> Verdict:
    """
    Look for a body whose centre is beyond the wall, or behind the fist that it was before.

    A body may slip past a fist, or around the edge of a wall, once it has left the way: it lies to
    the side of the other by the balls that fit into both.
    """
    run, spec, way = build(scene.spec), scene.spec, scene.facts['way']
    assert isinstance(run, Ours)
    held, names, verdicts = Holding(spec, run.world), run.world.names, []
    fist, wall = names.index('fist'), scene.facts['wall'] and names.index('wall')
    inner = np.array([_inner(one['shape']) for one in spec['bodies']])
    ahead = [names.index(name) for name in scene.facts['ahead']]
    x = run.motion()[:, :3]
    side = np.sign((x - x[wall]) @ way) if wall else np.zeros(len(x))
    there, on_way, deepest = np.ones(len(x), dtype=bool), np.zeros(len(x), dtype=bool), 0.0
    on_way[ahead] = True
    for _ in range(scene.steps):
        run.step(1)
        x = run.motion()[:, :3]
        if not np.isfinite(x).all():
            return Verdict(np.inf, 0.0, 'of the scene itself: not finite')
        along, across = _parts(x - x[fist], way)
        on_way &= across < inner + inner[fist]
        deepest = max(deepest, -float(along[on_way].min(initial=0.0)))
        if wall:
            along, across = _parts(x - x[wall], way)
            there &= across < HALF_WIDTH - EDGE
            deepest = max(deepest, -float((along * side)[there].min(initial=0.0)))
        verdicts.append(held.verdict(resolved=False))
    return worst([*verdicts, Verdict(deepest / scene.size, 0.0, 'sizes that a body is beyond')])


def _inner(shape: Spec) -> float:
    """Return the radius [m] of a ball about the origin that fits into a shape."""
    if shape['type'] == 'box':
        return 0.5 * min(shape['size'])
    if shape['type'] == 'cylinder':
        return min(shape['radius'], 0.5 * shape['length'])
    return float(shape['radius'])


def _parts(arms: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far arms (n, 3) [m] reach along the way, and across it."""
    along = arms @ way
    return along, np.linalg.norm(arms - np.outer(along, way), axis=1)


class Driven:
    """The energy of a scene without what its drives gave to it."""

    def __init__(self, spec: Spec, world) -> None:
        self.spec, self.world, self.of, self.given = spec, world, masses(spec), 0.0
        self.goals = [joint['drive'].get('velocity', 0.0) if joint['drive']['mode'] == 'velocity'
                      else 0.0 for joint in spec['joints']]

    def note_step(self) -> None:
        """
        Note what the drives gave at most in a step.

        A drive of a velocity u gives the power E v = E (v - u) + E u. It brakes what is faster, so
        that the first is never positive, however E goes within the step; the second comes to u
        times the impulse, which is the mean of E times the step.
        """
        effort = np.asarray(self.world.joint_effort)
        self.given += float(effort @ self.goals) * self.spec['world']['step']

    def energy(self, now) -> float:
        """Return the energy [J] of motion and place, and that in drives that hold, less that."""
        return float(now.kinetic.sum() + potential(self.spec, self.of, now)
                     + stored(self.spec, self.world) - self.given)


def judge_driven_energy(scene: Scene, build: Build) -> Verdict:
    """
    Compare the energy in each step, less what drives gave, with the least before it.

    As in `judge_jointed_energy`: a second order method swings by (h W)^2 of what is in the drives,
    W their rate, never by more than a quarter; and when a drive begins to give all it can, or
    shapes meet, is known to a step, half of whose work may be missing; likewise h w of the kinetic
    energy of what turns with w.
    """
    run, spec, h = build(scene.spec), scene.spec, scene.h
    assert isinstance(run, Ours)
    seen, springs, verdicts = Driven(spec, run.world), fastest_spring(spec), []
    least = before = seen.energy(look(seen.of, run.motion()))
    inside_most = last = stored(spec, run.world)
    kinetic = work = turning = 0.0
    for _ in range(scene.steps):
        given = seen.given
        run.step(1)
        seen.note_step()
        now = look(seen.of, run.motion())
        energy, inside = seen.energy(now), stored(spec, run.world)
        turning = max(turning, float(np.linalg.norm(now.w, axis=1).max()))
        kinetic, inside_most = max(kinetic, now.kinetic.sum()), max(inside_most, inside)
        work = max(work, abs(inside - last) + abs(seen.given - given))
        last = inside
        allowed = (min(0.25, (h * springs) ** 2) * inside_most + 0.5 * work
                   + min(1.0, h * turning) * kinetic + 1e-9 * (kinetic + abs(before)))
        least = min(least, energy)
        verdicts.append(Verdict(energy - least, allowed, 'J gained'))
        if verdicts[-1].breach:
            break
    return worst(verdicts)


def judge_driven_momentum(scene: Scene, build: Build) -> Verdict:
    """
    Compare P and L of all bodies with those at the start: none.

    To rounding, some 1e-15 of the largest momenta in each step and each of its events.
    """
    run, of = build(scene.spec), masses(scene.spec)
    assert isinstance(run, Ours)
    scale, verdicts = 0.0, []
    for _ in range(scene.steps):
        run.step(1)
        now = look(of, run.motion())
        scale = max(scale, float(np.abs(now.P).sum()))
        far = max(1.0, float(np.abs(now.x).max()))
        spin = (now.L + np.cross(now.x, now.P)).sum(axis=0)
        lost = max(np.abs(now.P.sum(axis=0)).max(), np.abs(spin).max() / far)
        verdicts.append(Verdict(float(lost), 1e-11 * max(scale, 1e-300), 'momentum, SI units'))
    return worst(verdicts)


def judge_driven_at_a_wall(scene: Scene, build: Build) -> Verdict:
    """Look for a fist that comes back from an inelastic wall, against which its drive pushes."""
    run, way = build(scene.spec), scene.facts['way']
    assert isinstance(run, Ours)
    fist, fastest, back, before = run.world.names.index('fist'), 0.0, 0.0, math.inf
    place = run.motion()[fist, :3] @ way
    for _ in range(scene.steps):
        run.step(1)
        # It may have come, and stopped, within the step.
        there, place = place, run.motion()[fist, :3] @ way
        fastest = max(fastest, float(place - there) / scene.h)
        gap = float(run.world.contacts()['gap'].min(initial=math.inf))
        if before < TOUCHES and run.world.joint_effort[0] > 0.0:
            back = max(back, (gap - before) / scene.h)
        before = gap
    return Verdict(back, REBOUND * fastest, 'm/s that comes back')
