# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Cases with joints whose motion is known, and what an engine makes of them.

An engine is a function that returns something like a `World` for a scene. What it cannot express
raises NotImplementedError, motions beyond all numbers an ArithmeticError. Figures are largest
values over all steps or looks unless their name says another.
"""

from collections.abc import Callable
from functools import cache
import math
from typing import Any, NamedTuple

from engine.jointed import (
    body, chain_tips, double_pendulum_tips, energy, four_bar, four_bar_motion, hanging, joint,
    panda, PANDA_TIP, panda_tips, pendulum_tips, point_of, rod, wheels, world)
from figures import rotations
from joint_scenes import DAMPING, humanoid, quadruped, STIFFNESS
import numpy as np
from scipy.spatial.transform import Rotation

from rigid_sim_ros import World
from rigid_sim_ros.scene import schema

Make = Callable[[Any], Any]
Figures = dict[str, float]


class Ours(World):
    """A world with the readings that the other engines have too."""

    def normal_force(self) -> float:
        """Return the sum of the normal forces of all contacts in the latest step [N]."""
        return float(self.contacts()['normal_force'].sum())

    def count_contacts(self) -> int:
        """Return how many points touch."""
        return int((self.contacts()['normal_force'] > 0.0).sum())


class Anchors:
    """The points of parent and child that joints hold together."""

    def __init__(self, spec: schema.Scene) -> None:
        """Find them; those of distance, prismatic, planar and free joints do not meet."""
        index = {one.name: i for i, one in enumerate(spec.bodies)} | {'world': len(spec.bodies)}
        joints = [one for one in spec.joints or () if one.type in (
            'fixed', 'revolute', 'continuous', 'spherical', 'universal')]
        self._parent = [index[one.parent] for one in joints]
        self._child = [index[one.child] for one in joints]
        poses = {one.name: one.pose for one in spec.bodies} | {'world': schema.Pose()}
        self._at = np.array([one.pose.position for one in joints])
        self._loops = len({one.child for one in joints}) < len(joints)
        self._in_child = np.array([self._of_child(one, poses) for one in joints])

    @staticmethod
    def _of_child(one: schema.Joint, poses: dict[str, schema.Pose]) -> np.ndarray:
        if one.child_pose is not None:
            return np.array(one.child_pose.position)
        parent, child = poses[one.parent], poses[one.child]
        there = np.array(parent.position) + Rotation.from_quat(parent.orientation).apply(
            one.pose.position)
        return Rotation.from_quat(child.orientation).inv().apply(there - child.position)

    def matter(self, engine: Any) -> bool:
        """Return whether they can part: with joint coordinates only those of loops do."""
        return isinstance(engine, World) or self._loops

    def separation(self, engine: Any) -> float:
        """Return how far the two points of a joint are apart, the largest of all joints [m]."""
        place = np.vstack([engine.position, np.zeros(3)])
        R = rotations(np.vstack([engine.orientation, (0.0, 0.0, 0.0, 1.0)]))
        apart = (place[self._parent] + np.einsum('nij,nj->ni', R[self._parent], self._at)
                 - place[self._child] - np.einsum('nij,nj->ni', R[self._child], self._in_child))
        return float(np.linalg.norm(apart, axis=1).max())


class Known(NamedTuple):
    """A motion that is known by other means."""

    scene: Callable[[float], Any]   # of a step
    truth: Callable[[np.ndarray], np.ndarray]
    read: Callable[[Any], Any]      # what the truth tells, of an engine
    end: float
    every: float    # s between looks
    unit: str


def _tip(name: str, z: float) -> Callable[[Any], np.ndarray]:
    return lambda engine: point_of(engine, name, (0.0, 0.0, z))


def _first(engine: Any) -> float:
    return float(engine.joint_position[0])


KNOWN = {
    'pendulum, 60 s': Known(lambda h: hanging(1, h=h), pendulum_tips, _tip('link0', -1.0), 60.0,
                            0.02, 'tip [m]'),
    'double pendulum, 2 s': Known(lambda h: hanging(2, h=h), double_pendulum_tips,
                                  _tip('link1', -1.0), 2.0, 0.02, 'tip [m]'),
    'Panda released, 0.5 s': Known(panda, panda_tips, _tip('link6', PANDA_TIP[2]), 0.5, 0.02,
                                   'flange [m]'),
    'chain of 50 and 100 : 1, 2 s': Known(
        lambda h: hanging(50, 0.1, 0.1, 0.01, end=10.0, h=h), chain_tips, _tip('link49', -0.1),
        2.0, 0.02, 'tip [m]'),
    'four-bar linkage, 5 s': Known(four_bar, four_bar_motion, _first, 5.0, 0.04, 'crank [rad]'),
}


@cache
def truth(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the times of the looks, and what is true then."""
    one = KNOWN[name]
    times = np.round(np.arange(0.0, one.end + 1e-9, one.every), 6)
    return times, one.truth(times)


def follow(name: str, make: Make, h: float) -> Figures:
    """Return the errors of a known motion, in steps of `h`."""
    one, scene = KNOWN[name], KNOWN[name].scene(h).scene
    engine, anchors = make(scene), Anchors(scene.spec)
    # Anchors are looked at in every step where they can part.
    steps, count = round(one.every / h), 1
    if not anchors.matter(engine):
        steps, count = count, steps
    before, off, kinetic, apart, errors = energy(engine), 0.0, 0.0, 0.0, []
    for true in truth(name)[1][1:]:
        for _ in range(steps):
            engine.step(count)
            apart = max(apart, anchors.separation(engine))
        errors.append(float(np.linalg.norm(one.read(engine) - true)))
        off = max(off, abs(energy(engine) - before))
        kinetic = max(kinetic, engine.kinetic_energy())
    return {one.unit: max(errors), f'{one.unit.split()[0]} at the end': errors[-1],
            'energy': off / kinetic, 'anchors [m]': apart}


def gear(make: Make, h: float) -> Figures:
    """Return the errors of two wheels coupled 1 : -2, one of which is driven for 2 s."""
    engine, ratio = make(wheels(h).scene), 0.0
    for _ in range(round(2.0 / h)):
        engine.step()
        first, second = engine.joint_position
        # 22 and 44 rad at the end; rounding of some 1e-14 rad.
        ratio = max(ratio, abs(second + 2.0 * first))
    exact = 1.0 / (0.01 + 4.0 * 0.02)
    return {'acceleration, relative': abs(engine.joint_velocity[0] / (2.0 * exact) - 1.0),
            'ratio [rad]': ratio}


def creep(make: Make, h: float) -> Figures:
    """Return how far a joint turns in 5 s under 0.95 of what its dry friction holds."""
    engine = make(world([body('wheel')], [joint(
        'axle', 'world', 'wheel', friction=1.0, drive={'mode': 'effort', 'effort': 0.95})], h,
        (0.0, 0.0, 0.0)).scene)
    engine.step(round(5.0 / h))
    return {'creep [rad]': abs(_first(engine))}


def limit(make: Make, h: float) -> Figures:
    """Return how far a bar that meets its limit at 6 rad/s goes beyond, and how fast it leaves."""
    engine = make(world([body('bar', 1.0, (0, 0, -0.5), rod(1, 1, 0.02))], [joint(
        'pin', 'world', 'bar', drive={'mode': 'effort', 'effort': -6.0},
        limits={'lower': -0.5, 'upper': 3.0}) | {'position': 1.0}], h).scene)
    beyond, rebound = 0.0, 0.0
    for _ in range(round(3.0 / h)):
        engine.step()
        beyond = max(beyond, -0.5 - _first(engine))
        rebound = max(rebound, float(engine.joint_velocity[0]))
    return {'beyond [rad]': beyond, 'rebound [rad/s]': rebound}


def _weight(scene: Any) -> float:
    world = World(scene)
    return float(world.mass[world.mass < math.inf].sum() * 9.81)


def _stand(make: Make, scene: Any, base: str, h: float, end: float) -> dict[str, np.ndarray]:
    """Return place, up axis, force and joint positions of every step of a robot that stands."""
    engine, anchors, apart = make(scene), Anchors(scene.spec), 0.0
    i, n = engine.names.index(base), round(end / h)
    found: dict[str, list[Any]] = {'place': [], 'up': [], 'force': [], 'speed': []}
    for _ in range(n):
        engine.step()
        if anchors.matter(engine):
            apart = max(apart, anchors.separation(engine))
        x, y, _, _ = engine.orientation[i]
        found['place'].append(engine.position[i])
        found['up'].append(1.0 - 2.0 * (x * x + y * y))
        found['force'].append(engine.normal_force())
        found['speed'].append(np.abs(engine.joint_velocity).max())
    return {key: np.array(values) for key, values in found.items()} | {
        'apart': np.array(apart), 'q': np.array(engine.joint_position)}


def stand_on_four(make: Make, h: float) -> Figures:
    """Return how a quadruped stands under its drives, for 15 s."""
    scene = World.from_dict(quadruped(h)).scene
    found = _stand(make, scene, 'trunk', h, 15.0)
    goals = np.array([one.position for one in scene.spec.joints])

    def between(begin: float, end: float) -> Figures:
        a, b = round(begin / h) - 1, round(end / h) - 1
        share = found['force'][a:b] / _weight(scene) - 1.0
        drift = np.linalg.norm((found['place'][b] - found['place'][a])[:2])
        when = f'{begin:.0f} to {end:.0f} s'
        return {f'drift {when} [mm]': 1e3 * float(drift), f'force / weight - 1, {when}: mean':
                abs(float(share.mean())), f'force / weight - 1, {when}: deviation':
                float(share.std())}

    return {**between(2.0, 5.0), **between(12.0, 15.0),
            'joints off their goals [rad]': float(np.abs(found['q'] - goals).max()),
            'joint speed after 15 s [rad/s]': float(found['speed'][-1]),
            'anchors [m]': float(found['apart'])}


def stand_on_two(make: Make, h: float) -> Figures:
    """Return how a humanoid stands under its drives, for 5 s."""
    found = _stand(make, World.from_dict(humanoid(h)).scene, 'pelvis', h, 5.0)
    z = found['place'][:, 2]
    return {'sinks [m]': float(z[0] - z.min()),
            'tilt [rad]': math.acos(max(-1.0, float(found['up'].min()))),
            'anchors [m]': float(found['apart'])}


class Case(NamedTuple):
    """A case, and what is wanted of this engine at steps of 1 ms."""

    run: Callable[[Make, float], Figures]
    wanted: Figures


def _known(name: str, **wanted: float) -> Case:
    keys = {'error': KNOWN[name].unit, 'end': f'{KNOWN[name].unit.split()[0]} at the end',
            'energy': 'energy'}
    return Case(lambda make, h: follow(name, make, h), {
        keys[key]: value for key, value in wanted.items()} | {'anchors [m]': 1e-12})


CASES = {
    'pendulum, 60 s': _known('pendulum, 60 s', error=6e-4, energy=1e-5),
    'double pendulum, 2 s': _known('double pendulum, 2 s', error=6e-5),
    'Panda released, 0.5 s': _known('Panda released, 0.5 s', error=1e-4),
    'chain of 50 and 100 : 1, 2 s': _known('chain of 50 and 100 : 1, 2 s', end=2e-5),
    'four-bar linkage, 5 s': _known('four-bar linkage, 5 s', error=2e-4),
    'gear 1 : -2': Case(gear, {'acceleration, relative': 1e-12, 'ratio [rad]': 1e-12}),
    'dry friction at 0.95 of its limit, 5 s': Case(creep, {'creep [rad]': 0.0}),
    'limit met at 6 rad/s': Case(limit, {'beyond [rad]': 1e-9, 'rebound [rad/s]': 0.0}),
    f'quadruped, {STIFFNESS:g} / {DAMPING:g}': Case(stand_on_four, {
        'drift 2 to 5 s [mm]': 0.01, 'force / weight - 1, 2 to 5 s: deviation': 1e-6,
        'anchors [m]': 1e-12}),
    'humanoid stands, 5 s': Case(stand_on_two, {
        'sinks [m]': 0.05, 'tilt [rad]': 0.1, 'anchors [m]': 1e-12}),
}
