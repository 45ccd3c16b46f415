# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Scenes that must move alike: turned, shifted, mirrored, scaled, in another order, with other names.

What moves alike and what is chaos cannot be told from a difference alone: bodies that tumble over
each other enlarge every difference. So each scene also runs with its start changed by as much as a
solver's tolerance; a twin may differ from the scene by ten times what such neighbours do.
"""

from collections.abc import Callable
import copy
import math
from typing import Any

from laws.jointed_twins import (
    mirror_joint, mirror_spring, move_spring, move_world, scale_joint, scale_spring, Twin)
from laws.motion import Build, Verdict
from laws.scenes import (
    any_attitude, draw_scales, draw_surface, heap, matrix, plane, product, Scene, Spec, turn,
    world)
from laws.solids import draw_solid, Generator, Solid
import numpy as np

# What a solver that stops at a tolerance leaves of an impact's speed, and what a bracketing or a
# GJK that does leaves of a length, relative to speeds of sqrt(g size) and sizes. Rounding, 1e-16
# of numbers up to a hundred times as large, is far below.
NEAR = 1e-8
# The sum of that over the impacts and steps of a scene, a hundred and more.
SOLVED = 1e-6


def _each(spec: Spec, change: Callable[[Spec], None]) -> Spec:
    """Return a copy whose bodies are changed."""
    found = copy.deepcopy(spec)
    for one in found['bodies']:
        one.setdefault('pose', {}).setdefault('position', [0.0, 0.0, 0.0])
        one['pose'].setdefault('orientation', [0.0, 0.0, 0.0, 1.0])
        change(one)
    return found


def _move_what_acts(spec: Spec, R: np.ndarray, d: np.ndarray) -> None:
    """Turn joints and springs on the world by R and shift them by d."""
    spec['joints'] = [move_world(joint, R, d) for joint in spec.get('joints', ())]
    spec['forces'] = [move_spring(force, R, d) for force in spec.get('forces', ())]


def shifted(rng: Generator, scene: Scene) -> Twin:
    """Move the scene by up to fifty sizes."""
    d = scene.size * rng.uniform(-30, 30, 3)

    def change(one: Spec) -> None:
        one['pose']['position'] = (np.add(one['pose']['position'], d)).tolist()

    spec = _each(scene.spec, change)
    _move_what_acts(spec, np.eye(3), d)
    return Twin(spec, lambda m: m - np.append(d, np.zeros(10)))


def turned(rng: Generator, scene: Scene) -> Twin:
    """Turn the scene, gravity and ground with it."""
    q = any_attitude(rng)
    R = matrix(q)

    def change(one: Spec) -> None:
        pose = one['pose']
        pose['position'] = (R @ pose['position']).tolist()
        pose['orientation'] = product(q, pose['orientation']).tolist()
        for key, vector in one.get('twist', {}).items():
            one['twist'][key] = (R @ vector).tolist()

    spec = _each(scene.spec, change)
    spec['world']['gravity'] = (R @ spec['world']['gravity']).tolist()
    _move_what_acts(spec, R, np.zeros(3))
    undo = q * (-1.0, -1.0, -1.0, 1.0)

    def back(m: np.ndarray) -> np.ndarray:
        attitudes = np.array([product(undo, row) for row in m[:, 3:7]])
        return np.hstack([m[:, :3] @ R, attitudes, m[:, 7:10] @ R, m[:, 10:] @ R])

    return Twin(spec, back)


_IMAGE = np.array((-1.0, 1.0, 1.0))  # of a vector, at x = 0
_ATTITUDE = np.array((1.0, -1.0, -1.0, 1.0))  # of a quaternion; that of an axial vector is -_IMAGE
_MOTION = np.concatenate([_IMAGE, _ATTITUDE, _IMAGE, -_IMAGE])


def _mirror_shape(shape: Spec) -> None:
    if 'pose' in shape:
        shape['pose']['position'] = (_IMAGE * shape['pose']['position']).tolist()
    if shape['type'] == 'mesh':
        shape['vertices'] = (_IMAGE * shape['vertices']).tolist()
        shape['faces'] = [[c, b, a] for a, b, c in shape['faces']]
    if shape['type'] == 'heightfield':
        # Its cells are divided from the corner with the least x and y: x and y change places, and
        # a quarter of a turn brings the new y to -x.
        shape['heights'] = np.transpose(shape['heights']).tolist()
        shape['size'] = shape['size'][::-1]
        shape['pose'] = {'orientation': turn((0, 0, 1), 0.5 * math.pi).tolist()}
    for part in shape.get('compound', ()):
        _mirror_shape(part)


def mirrored(rng: Generator, scene: Scene) -> Twin:
    """Mirror the scene at the plane x = 0."""
    def change(one: Spec) -> None:
        _mirror_shape(one['shape'])
        pose = one['pose']
        pose['position'] = (_IMAGE * pose['position']).tolist()
        pose['orientation'] = (_ATTITUDE * pose['orientation']).tolist()
        if 'twist' in one:
            one['twist'] = {'linear': (_IMAGE * one['twist']['linear']).tolist(),
                            'angular': (-_IMAGE * one['twist']['angular']).tolist()}
        if 'inertial' in one:
            inertial = one['inertial']
            inertial['com'] = (_IMAGE * inertial['com']).tolist()
            inertial['inertia'] = (np.array((1, 1, 1, -1, -1, 1.0)) * inertial['inertia']).tolist()

    spec = _each(scene.spec, change)
    spec['world']['gravity'] = (_IMAGE * spec['world']['gravity']).tolist()
    spec['joints'] = [mirror_joint(joint, _IMAGE) for joint in spec.get('joints', ())]
    spec['forces'] = [mirror_spring(force, _IMAGE) for force in spec.get('forces', ())]
    return Twin(spec, lambda m: m * _MOTION)


# Powers of the length's factor by key of a scene.
_POWERS = {'position': 1.0, 'radius': 1.0, 'length': 1.0, 'size': 1.0, 'radii': 1.0,
           'vertices': 1.0, 'heights': 1.0, 'com': 1.0, 'mass': 3.0, 'inertia': 5.0, 'linear': 0.5,
           'angular': -0.5, 'step': 0.5, 'stiffness': 3.0, 'damping': -0.5}


def _scaled(value: Any, factor: float, key: str = '') -> Any:
    if isinstance(value, dict):
        return {name: _scaled(entry, factor, name) for name, entry in value.items()}
    if key in _POWERS:
        return (np.asarray(value) * factor ** _POWERS[key]).tolist()
    if isinstance(value, list):
        return [_scaled(entry, factor) for entry in value]
    return value


def scaled(rng: Generator, scene: Scene) -> Twin:
    """Scale by a power of 4 with which sizes and steps are those that users have."""
    factors = [4.0 ** k for k in (-3, -2, -1, 1, 2, 3)
               if 1e-3 <= scene.size * 4.0 ** k <= 1e2 and 1e-4 <= scene.h * 2.0 ** k <= 1 / 60]
    return scaled_by(scene, float(rng.choice(factors)) if factors else 1.0)


def scaled_by(scene: Scene, s: float) -> Twin:
    """
    Scale lengths by s, masses by s^3, times by sqrt(s); gravity stays.

    With a power of 4 all of it is exact in binary: the sums are the same to the bit.
    """
    # The stiffness of a spring k goes with m g / size: s^2 for masses s^3.
    powers = np.repeat([1.0, 0.0, 0.5, -0.5], [3, 4, 3, 3])
    spec = _scaled({key: part for key, part in scene.spec.items()
                    if key not in ('joints', 'forces')}, s)
    kinds = {joint['name']: joint['type'] for joint in scene.spec.get('joints', ())}
    spec['joints'] = [scale_joint(joint, s, kinds) for joint in scene.spec.get('joints', ())]
    spec['forces'] = [scale_spring(force, s) for force in scene.spec.get('forces', ())]
    return Twin(spec, lambda m: m / s ** powers)


def reordered(rng: Generator, scene: Scene) -> Twin:
    """Write bodies and joints in another order, the bodies under other names."""
    spec = copy.deepcopy(scene.spec)
    order = rng.permutation(len(spec['bodies']))
    names = [f'n{rng.integers(1 << 40)}_{k}' for k in order]
    pairs = list(zip(order.tolist(), names, strict=True))
    spec['bodies'] = [spec['bodies'][k] | {'name': name} for k, name in pairs]
    joints = spec.get('joints', [])
    new = {scene.spec['bodies'][k]['name']: name for k, name in pairs} | {'world': 'world'}
    spec['joints'] = [joints[k] | {end: new[joints[k][end]] for end in ('parent', 'child')}
                      for k in rng.permutation(len(joints))]
    spec['forces'] = [force | {end: new[force[end]] for end in 'ab'}
                      for force in spec.get('forces', ())]
    return Twin(spec, lambda m: m[np.argsort(order)])


_POWERS['stiffness'] = 2.0


def draw_pair(rng: Generator,
              draw: Callable[[Generator, float], Solid] = draw_solid) -> Scene:
    """Draw up to four bodies that fall on a plane and on each other."""
    scales = draw_scales(rng)
    bodies = [*heap(rng, scales, 4, draw), plane()]
    spec = world(bodies, scales.h, draw_surface(rng))
    return Scene(spec, scales.size, min(scales.steps(4.0), 800),
                 {'seed': int(rng.integers(1 << 31))})


def _neighbour(rng: Generator, scene: Scene) -> Spec:
    """Return the scene with its start changed by little."""
    found = copy.deepcopy(scene.spec)
    speed = math.sqrt(9.81 * scene.size)
    for one in found['bodies']:
        if not one.get('fixed'):
            pose = one['pose']
            twist = one.setdefault('twist', {'linear': [0.0] * 3, 'angular': [0.0] * 3})
            pose['position'] = (pose['position'] + NEAR * scene.size * rng.normal(size=3)).tolist()
            little = np.append(0.5 * NEAR * rng.normal(size=3), 1.0)
            pose['orientation'] = product(little, pose['orientation']).tolist()
            twist['linear'] = (twist['linear'] + NEAR * speed * rng.normal(size=3)).tolist()
            twist['angular'] = (twist['angular'] + NEAR * speed / scene.size
                                * rng.normal(size=3)).tolist()
    return found


def alike(transform: Callable[[Generator, Scene], Twin]) -> Callable[[Scene, Build], Verdict]:
    """Return the judge of a transformation."""
    def judge(scene: Scene, build: Build) -> Verdict:
        rng = np.random.default_rng(scene.facts['seed'])
        twin = transform(rng, scene)
        runs = [build(scene.spec), build(twin.spec),
                *(build(_neighbour(rng, scene)) for _ in range(2))]
        # Lengths in sizes and speeds in sqrt(g size): the twin's time scale, not its own.
        speed = math.sqrt(9.81 * scene.size)
        unit = np.repeat([1 / scene.size, 1.0, 1 / speed, scene.size / speed], [3, 4, 3, 3])
        spread = 0.0
        found = Verdict(0.0, SOLVED, 'difference of twins, sizes')
        # Each step: an impact that comes one step later is far off for that step only.
        for _ in range(scene.steps):
            for run in runs:
                run.step(1)
            base, other, *near = (run.motion() for run in runs)
            if not np.isfinite(base).all():
                return Verdict(math.inf, SOLVED, 'of the scene itself: not finite')
            if 'plane' in scene.facts and _beside(scene, base):
                break       # where the plane goes on
            other = twin.back(other)
            spread = max(spread, *(_apart(base, one, unit) for one in near))
            # Where neighbours part by a thousandth, nothing is decided any more.
            if spread > 1e-3:
                break
            verdict = Verdict(_apart(base, other, unit), SOLVED + 10 * spread, found.what)
            if verdict.breach:
                return verdict
            found = max(found, verdict)
        return found
    judge.__doc__ = transform.__doc__
    return judge


def _beside(scene: Scene, motion: np.ndarray) -> bool:
    """Return whether a body is near the edge of a ground of triangles."""
    edge = scene.facts['ground'].vertices[:, :2]
    inner = np.stack([edge.min(axis=0) + scene.size, edge.max(axis=0) - scene.size])
    return bool((motion[:-1, :2] < inner[0]).any() or (motion[:-1, :2] > inner[1]).any())


def _apart(a: np.ndarray, b: np.ndarray, unit: np.ndarray) -> float:
    # A quaternion and its negative are one attitude.
    sign = np.where((a[:, 3:7] * b[:, 3:7]).sum(axis=1) < 0.0, -1.0, 1.0)
    b = b.copy()
    b[:, 3:7] *= sign[:, None]
    apart = float(np.abs((a - b) * unit).max())
    return apart if apart == apart else math.inf
