# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Joints and springs of scenes that must move alike, and twins that only such scenes have."""

from collections.abc import Callable, Mapping
import copy
from typing import NamedTuple

from laws.scenes import any_attitude, matrix, product, Scene, Spec
from laws.solids import Generator
import numpy as np


class Twin(NamedTuple):
    """A scene that must move alike, and how to bring its motion back."""

    spec: Spec
    back: Callable[[np.ndarray], np.ndarray]  # motion (n, 13), in the order of the twin


def mirror_joint(joint: Spec, image: np.ndarray) -> Spec:
    """Mirror a joint; positions about an axis stay what they are if it is an axial vector."""
    found = copy.deepcopy(joint)
    for key in ('pose', 'child_pose'):
        if key in joint:
            found[key]['position'] = (image * joint[key]['position']).tolist()
    for key in {'axis', 'axis2'} & set(joint):
        along = joint['type'] == 'prismatic'
        found[key] = ((image if along else -image) * joint[key]).tolist()
    return found


def move_world(joint: Spec, R: np.ndarray, d: np.ndarray) -> Spec:
    """Turn a joint by R and shift it by d if it hangs on the world."""
    found = copy.deepcopy(joint)
    if joint['parent'] == 'world':
        found['pose']['position'] = (R @ joint['pose']['position'] + d).tolist()
        for key in {'axis', 'axis2'} & set(joint):
            found[key] = (R @ joint[key]).tolist()
    if joint['child'] == 'world' and 'child_pose' in joint:
        found['child_pose']['position'] = (R @ joint['child_pose']['position'] + d).tolist()
    return found


# Powers of the length's factor by key of a joint, for a translation; for forces, masses and what
# is made of these a rotation has another one for each of the two lengths.
_ALONG = {'damping': 2.5, 'gain': 2.5, 'friction': 3.0, 'effort': 3.0, 'armature': 3.0,
          'stiffness': 2.0, 'rest': 1.0, 'lower': 1.0, 'upper': 1.0, 'position': 1.0,
          'velocity': 0.5}
_ABOUT = {'damping': 4.5, 'gain': 4.5, 'friction': 4.0, 'effort': 4.0, 'armature': 5.0,
          'stiffness': 4.0, 'velocity': -0.5}


def scale_joint(joint: Spec, s: float, kinds: Mapping[str, str]) -> Spec:
    """Scale a joint; kinds are the types of all joints, by name."""
    def scaled(value: Spec, powers: Mapping[str, float]) -> Spec:
        return {key: one * s ** powers[key] if key in powers else
                scaled(one, powers) if isinstance(one, dict) else one
                for key, one in value.items()}

    powers = _ALONG if joint['type'] == 'prismatic' else _ABOUT
    found = scaled({key: one for key, one in joint.items()
                    if key not in ('pose', 'child_pose', 'axis', 'axis2')}, powers)
    for key in ('pose', 'child_pose'):
        if key in joint:
            found[key] = {'position': (s * np.asarray(joint[key]['position'])).tolist()}
    found |= {key: joint[key] for key in {'axis', 'axis2'} & set(joint)}
    if 'mimic' in joint:
        slides = [kind == 'prismatic' for kind in (joint['type'], kinds[joint['mimic']['joint']])]
        found['mimic']['multiplier'] *= s ** (slides[0] - slides[1])
    return found


def mirror_spring(force: Spec, image: np.ndarray) -> Spec:
    """Mirror a spring between origins of bodies, or one of these and a point of the world."""
    return force | {'anchor': (image * force['anchor']).tolist()}


def move_spring(force: Spec, R: np.ndarray, d: np.ndarray) -> Spec:
    """Turn a spring by R and shift it by d if it hangs on the world."""
    if force['b'] != 'world':
        return force
    return force | {'anchor': (R @ force['anchor'] + d).tolist()}


def scale_spring(force: Spec, s: float) -> Spec:
    """Scale a spring: lengths by s, forces by s^3, times by sqrt(s)."""
    return force | {'anchor': (s * np.asarray(force['anchor'])).tolist(),
                    'rest_length': s * force['rest_length'],
                    'stiffness': s ** 2 * force['stiffness'],
                    'damping': s ** 2.5 * force['damping']}


def carried(rng: Generator, scene: Scene) -> Twin:
    """Let the whole scene fly on, the ground and what hangs on the world as well (Galilei)."""
    u = rng.normal(0.0, 3.0, 3)
    spec = copy.deepcopy(scene.spec)
    spec['bodies'].append({'name': 'train', 'kinematic': True, 'twist': {'linear': [0, 0, 0]}})
    for one in spec['bodies']:
        if one.pop('fixed', False):
            one['kinematic'] = True
        twist = one.setdefault('twist', {})
        twist['linear'] = (np.asarray(twist.get('linear', (0, 0, 0))) + u).tolist()
    for joint in spec['joints']:
        for end in ('parent', 'child'):
            joint[end] = 'train' if joint[end] == 'world' else joint[end]
    for force in spec.get('forces', ()):
        force['b'] = 'train' if force['b'] == 'world' else force['b']

    def back(m: np.ndarray) -> np.ndarray:
        found = m[:-1].copy()
        found[:, :3] -= m[-1, :3]
        found[:, 7:10] -= u
        # What is fixed is told apart by nothing else.
        return found

    return Twin(spec, back)


def split(rng: Generator, scene: Scene) -> Twin:
    """Make two bodies of one, which a fixed joint holds; some of its joints go to the other."""
    spec = copy.deepcopy(scene.spec)
    # A loose body would get joints, and with them another solver.
    able = [one for one in spec['bodies'] if 'inertial' in one
            and one['name'] not in scene.facts.get('loose', ())]
    one = able[rng.integers(len(able))]
    share = rng.uniform(0.2, 0.8)
    # Both have the same centre of mass; the frame of the second is somewhere else.
    inertial, pose, twist = one['inertial'], one['pose'], one['twist']
    p, q = rng.uniform(-0.2, 0.2, 3), any_attitude(rng)
    R_WB, R = matrix(pose['orientation']), matrix(q)
    xx, yy, zz, xy, xz, yz = inertial['inertia']
    turned = R.T @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R
    spec['bodies'].append({
        'name': 'half', 'inertial': {
            'mass': share * inertial['mass'],
            'com': (R.T @ (np.asarray(inertial['com']) - p)).tolist(),
            'inertia': (share * turned[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]).tolist()},
        'pose': {'position': (pose['position'] + R_WB @ p).tolist(),
                 'orientation': product(pose['orientation'], q).tolist()},
        'twist': {'linear': (twist['linear'] + np.cross(twist['angular'], R_WB @ p)).tolist(),
                  'angular': twist['angular']}})
    one['inertial'] = {'mass': (1 - share) * inertial['mass'], 'com': inertial['com'],
                       'inertia': [(1 - share) * value for value in inertial['inertia']]}
    ignored = []
    for joint in spec['joints']:
        if one['name'] not in (joint['parent'], joint['child']) or rng.random() < 0.5:
            continue
        # The other end still touches nothing of what was one body with this one.
        ignored += [[joint['parent'], joint['child']]] if 'world' not in (
            joint['parent'], joint['child']) else []
        end = 'parent' if joint['parent'] == one['name'] else 'child'
        joint[end] = 'half'
        key = 'pose' if end == 'parent' else 'child_pose'
        if key in joint:
            joint[key] = {'position': (R.T @ (np.asarray(joint[key]['position']) - p)).tolist()}
        for axis in {'axis', 'axis2'} & set(joint) if end == 'parent' else ():
            joint[axis] = (R.T @ joint[axis]).tolist()
    spec['joints'].append({'name': 'seam', 'type': 'fixed', 'parent': one['name'],
                           'child': 'half'})
    spec['collision'] = spec.get('collision', {}) | {'ignore': ignored}
    return Twin(spec, lambda m: m[:-1])
