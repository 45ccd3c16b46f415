# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Energy, momentum and closed joints, in scenes of bodies that joints hold."""

import math

from engine.jointed import tensor
from engine.jointed_trees import gaps
from laws.jointed_scenes import draw_jointed, FREE
from laws.motion import Build, Look, look, Masses, masses, Ours, potential, Verdict, worst
from laws.scenes import Scene, Spec
from laws.solids import Generator
import numpy as np

EVERY = 4  # steps between two looks
LEVER = 0.05  # [m]


def stored(spec: Spec, world) -> float:
    """
    Return the energy [J] in armatures and springs of joints, and in drives that hold.

    A drive of stiffness k that gives up to E stores k e^2 / 2 in an error e like a spring, and
    E |e| - E^2 / 2k where it gives all it can: its force at rest is the slope of that. Whatever
    damps, saturates or brakes it takes energy from the motion compared with this, as its force
    falls with the velocity.
    """
    total = 0.0
    for j, joint in enumerate(spec['joints']):
        q, v = world.joint_position[j], world.joint_velocity[j]
        total += 0.5 * joint.get('armature', 0.0) * v * v
        if 'spring' in joint:
            total += 0.5 * joint['spring']['stiffness'] * (q - joint['spring']['rest']) ** 2
        drive = joint.get('drive', {})
        if drive.get('mode') == 'position':
            k, e = drive['stiffness'], abs(q - drive['position'])
            most = joint.get('limits', {}).get('effort', math.inf)
            total += 0.5 * k * e * e if k * e < most else most * e - 0.5 * most * most / k
    for force in spec.get('forces', ()):
        stretch = math.dist(_end(world, force, 'a'), _end(world, force, 'b'))
        total += 0.5 * force['stiffness'] * (stretch - force['rest_length']) ** 2
    return total


def _end(world, force: Spec, end: str) -> np.ndarray:
    """Return where a spring of the scene ends: the origin of a body, or a point of the world."""
    if force[end] == 'world':
        return np.asarray(force['anchor'])
    return np.asarray(world.position[world.names.index(force[end])])


def fastest_spring(spec: Spec) -> float:
    """Return a bound of the rate [rad/s] at which a spring or a drive swings."""
    bodies, fastest = {one['name']: one.get('inertial') for one in spec['bodies']}, 0.0
    for joint in spec['joints']:
        k = (joint.get('spring', {}).get('stiffness', 0.0)
             + joint.get('drive', {}).get('stiffness', 0.0))
        # With the bodies free to give way an axis feels less than with all joints.
        yields = 0.0
        for end in (joint['parent'], joint['child']):
            if bodies.get(end):
                moments = np.linalg.eigvalsh(tensor(bodies[end]['inertia']))
                yields += 1.0 / (bodies[end]['mass'] if joint['type'] == 'prismatic'
                                 else moments[0])
        fastest = max(fastest, math.sqrt(k * yields))
    for force in spec.get('forces', ()):
        yields = sum(1.0 / bodies[force[end]]['mass'] for end in 'ab' if bodies.get(force[end]))
        fastest = max(fastest, math.sqrt(force['stiffness'] * yields))
    return fastest


class Carried:
    """The energy as one sees it who moves with the carrier; without one, who is at rest."""

    def __init__(self, spec: Spec, of: Masses) -> None:
        names = [one['name'] for one in spec['bodies']]
        self.spec, self.of = spec, of
        self.at = names.index('carrier') if 'carrier' in names else None
        twist = spec['bodies'][self.at]['twist'] if self.at is not None else {}
        self.u = np.array(twist.get('linear', (0.0, 0.0, 0.0)))
        self.w = np.array(twist.get('angular', (0.0, 0.0, 0.0)))

    def energy(self, motion: np.ndarray, now: Look) -> float:
        """
        Return T - W . L + V, which stays where a frame turns with a constant W.

        With T and L of the motions against a frame that only flies along; gravity must not change
        as it turns. (Jacobi's integral: Goldstein, Classical Mechanics, section 2.7.)
        """
        kinetic = now.kinetic.sum() - now.P.sum(axis=0) @ self.u + 0.5 * self.of.m.sum() * (
            self.u @ self.u)
        place = motion[self.at, :3] if self.at is not None else np.zeros(3)
        P = now.P - self.of.m[:, None] * self.u
        spin = (np.cross(now.x - place, P) + now.L).sum(axis=0)
        fall = self.of.m.sum() * (np.asarray(self.spec['world']['gravity']) @ place)
        return float(kinetic - self.w @ spin + potential(self.spec, self.of, now) + fall)


class Holding:
    """What joints have to keep: their frames, their limits and their couplings."""

    def __init__(self, spec: Spec, world) -> None:
        self.spec, self.world = spec, world
        self.index = {joint['name']: j for j, joint in enumerate(spec['joints'])}

    def verdict(self, resolved: bool = True) -> Verdict:
        """
        Return how far a joint is off; `resolved`: and whether a part of a step was too long.

        They close to 1e-13 m or rad (engine/joints/buffers.py, TOLERANCE), and rounding leaves
        1e-15 of each metre from the origin. A limit yields, to 1e-9, to what closes a loop.
        """
        world, far = self.world, max(1.0, float(np.abs(self.world.position).max()))
        found = [Verdict(gaps(world), 1e-12 * far, 'm or rad that a joint is open')]
        if resolved and world.contact_report().message:
            found.append(Verdict(math.inf, 0.0, world.contact_report().message))
        q = world.joint_position
        for j, joint in enumerate(self.spec['joints']):
            limits = joint.get('limits', {})
            beyond = max(limits.get('lower', -math.inf) - q[j],
                         q[j] - limits.get('upper', math.inf))
            found.append(Verdict(max(beyond, 0.0), 1.1e-9 * far, 'beyond a limit'))
            if 'mimic' in joint:
                other = q[self.index[joint['mimic']['joint']]]
                off = abs(q[j] - joint['mimic']['multiplier'] * other)
                found.append(Verdict(off, 1e-12 * max(far, abs(q[j])), 'between coupled joints'))
        return worst(found)


def judge_jointed_energy(scene: Scene, build: Build) -> Verdict:
    """
    Compare the energy at each look with the least before it; joints hold at each look.

    What a lawful method may add, and no more:
    - A second order method swings by (h W)^2 of the kinetic energy, W the largest rate of what
      turns or of what hangs on a lever of 0.05 m, and by as much of the energy in springs, W
      theirs, but never by more than a quarter of it: they are implicit.
    - When shapes meet, a joint meets its limit or a drive begins to give all it can is known to a
      step. In that forces do some work, and what turns by h W exchanges as much of its kinetic
      energy with the rest: half of both, as a meeting is half a step off in the mean.
    - What lies in an overlap of depth d may be lifted out of it: m g d for each body.
    """
    spec, of, h = scene.spec, masses(scene.spec), scene.h
    run = build(spec)
    assert isinstance(run, Ours)
    gravity = float(np.linalg.norm(spec['world']['gravity']))
    meets = run.world.scene.spec.world.contact != 'none' or any(
        'limits' in joint for joint in spec['joints'])
    seen, held = Carried(spec, of), Holding(spec, run.world)
    rate, kinetic, work, deepest = math.sqrt(gravity / LEVER), 0.0, 0.0, 0.0
    least, before, verdicts, inside_most = math.inf, None, [], 0.0
    springs = fastest_spring(spec)
    for _ in range(0, scene.steps, EVERY):
        motion = run.motion()
        now = look(of, motion)
        inside = stored(spec, run.world)
        energy, given = seen.energy(motion, now) + inside, inside + potential(spec, of, now)
        rate = max(rate, float(np.linalg.norm(now.w, axis=1).max()))
        inside_most = max(inside_most, inside)
        kinetic = max(kinetic, float(now.kinetic.sum()))
        work = work if before is None else max(work, abs(given - before) / EVERY)
        deepest = max(deepest, run.deepest())
        swings = (h * rate) ** 2 * kinetic + min(0.25, (h * springs) ** 2) * inside_most
        allowed = (swings + of.m.sum() * gravity * deepest
                   + (0.5 * (work + h * rate * kinetic) if meets else 0.0)
                   + 1e-9 * (kinetic + of.m.sum() * gravity))
        least, before = min(least, energy), given
        verdicts += [Verdict(energy - least, allowed, 'J gained'), held.verdict()]
        if verdicts[-1].breach or not math.isfinite(energy):
            break
        run.step(EVERY)
    return worst(verdicts)


def draw_meeting(rng: Generator) -> Scene:
    """Draw articulations that meet in space."""
    return draw_jointed(rng, (FREE,))


def judge_jointed_momentum(scene: Scene, build: Build) -> Verdict:
    """
    Compare P and L of all bodies with those at the start: forces between them keep both.

    Gravity gives P, and no L about the common centre of mass. To rounding: 400 steps with some
    1e-15 of the momenta in each, at places of some metres. An axis that is locked beside
    conditions is a million times as stiff as the rest (engine/joints/articulated.py, STIFFNESS),
    and so is the rounding of what it does.
    """
    of, run = masses(scene.spec), build(scene.spec)
    assert isinstance(run, Ours)
    now, weight = look(of, run.motion()), of.m.sum() * np.asarray(scene.spec['world']['gravity'])
    before = _momenta(of, now)
    scale = math.sqrt(2.0 * now.kinetic.sum() * of.m.sum())
    stiff = bool(len(run.world.scene.joints.table.condition_joint)) and any(
        {'limits', 'friction'} & set(joint) for joint in scene.spec['joints'])
    verdicts = []
    for done in range(20, scene.steps + 20, 20):
        run.step(20)
        now = look(of, run.motion())
        far = max(1.0, float(np.abs(now.x).max()))
        gained = _momenta(of, now) - before
        gained[0] -= weight * done * scene.h
        verdicts.append(Verdict(float(np.abs(gained).max()) / far,
                                (1e-7 if stiff else 1e-11) * scale, 'momentum, SI units'))
    return worst(verdicts)


def _momenta(of: Masses, now: Look) -> np.ndarray:
    """Return the linear momentum and the angular one about the common centre of mass, (2, 3)."""
    arm = now.x - of.m @ now.x / of.m.sum()
    return np.array([now.P.sum(axis=0), (now.L + np.cross(arm, now.P)).sum(axis=0)])
