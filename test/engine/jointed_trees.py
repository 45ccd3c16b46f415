# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Random scenes of bodies that joints of all types hold, and what can be done to them."""

import copy

from engine.jointed import body, scene
from inside import state_of
import numpy as np
from scipy.spatial.transform import Rotation

from rigid_sim_ros.scene.joints import gap_of

TYPES = ('revolute', 'continuous', 'prismatic', 'spherical', 'universal', 'planar', 'fixed')


def random_tree(rng, count=6, types=TYPES, on_world=True, gravity=(0.3, -0.2, -9.81), h=1e-3,
                **more):
    """
    Return the scene of a tree of bodies with random poses, masses, joints and velocities.

    Every other joint is written from the child to the parent of the tree, as a file may do.
    """
    bodies, joints = [], []
    for i in range(count):
        bodies.append(_random_body(rng, i, on_world))
        parent = f'body{rng.integers(i)}' if i else 'world'
        if not i and not on_world:
            continue
        ends = (parent, f'body{i}') if rng.random() < 0.5 else (f'body{i}', parent)
        joints.append(_random_joint(rng, f'joint{i}', str(rng.choice(types)), ends, bodies))
    return scene(bodies, joints, h, gravity, **more)


def _random_body(rng, i, on_world):
    spread = rng.normal(0, 1, (3, 5))
    # The tensor of five points of random masses: one that a body can have.
    second = (spread * rng.uniform(0.1, 1, 5)) @ spread.T * 0.02
    inertia = np.trace(second) * np.eye(3) - second
    values = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    one = body(f'body{i}', rng.uniform(0.5, 3), rng.normal(0, 0.1, 3).tolist(), values.tolist(),
               rng.normal(0, 0.5, 3).tolist(), Rotation.random(rng=rng).as_quat().tolist())
    if not i and not on_world:
        one['twist'] = {'linear': rng.normal(0, 1, 3).tolist(),
                        'angular': rng.normal(0, 2, 3).tolist()}
    return one


def _random_joint(rng, name, kind, ends, bodies):
    one = {'name': name, 'type': kind, 'parent': ends[0], 'child': ends[1],
           'pose': {'position': rng.normal(0, 0.3, 3).tolist(),
                    'orientation': Rotation.random(rng=rng).as_quat().tolist()},
           'axis': rng.normal(0, 1, 3).tolist()}
    if kind in ('revolute', 'continuous', 'prismatic'):
        one |= {'position': rng.normal(0, 0.5), 'velocity': rng.normal(0, 1.5)}
    else:       # the velocity of these comes from the twist of the body
        bodies[-1]['twist'] = {'linear': rng.normal(0, 0.5, 3).tolist(),
                               'angular': rng.normal(0, 1.5, 3).tolist()}
    return one


def shuffled(rng, spec):
    """Return a scene with bodies and joints in another order."""
    other = copy.deepcopy(spec)
    for key in ('bodies', 'joints'):
        other[key] = [other[key][i] for i in rng.permutation(len(other[key]))]
    return other


def _mirror_vector(v):
    return [v[0], -v[1], v[2]]


def _mirror_turn(v):
    """Mirror an axis of rotation: it is a pseudovector."""
    return [-v[0], v[1], -v[2]]


def _mirror_pose(pose):
    out = {'position': _mirror_vector(pose.get('position', [0, 0, 0]))}
    x, y, z, w = pose.get('orientation', [0, 0, 0, 1])
    return out | {'orientation': [*_mirror_turn([x, y, z]), w]}


def mirrored(spec):
    """Return a scene as a mirror in the plane x, z shows it."""
    other = copy.deepcopy(spec)
    other['world']['gravity'] = _mirror_vector(other['world']['gravity'])
    for one in other['bodies']:
        one['pose'] = _mirror_pose(one['pose'])
        inertial = one['inertial']
        inertial['com'] = _mirror_vector(inertial['com'])
        xx, yy, zz, xy, xz, yz = inertial['inertia']
        inertial['inertia'] = [xx, yy, zz, -xy, xz, -yz]
        if 'twist' in one:
            one['twist'] = {'linear': _mirror_vector(one['twist']['linear']),
                            'angular': _mirror_turn(one['twist']['angular'])}
    for one in other['joints']:
        one['pose'] = _mirror_pose(one['pose'])
        turn = _mirror_vector if one['type'] == 'prismatic' else _mirror_turn
        one['axis'] = turn(one['axis'])
    return other


def scaled(spec, factor):
    """
    Return a scene with all lengths times a factor, times its root, masses its cube.

    Under the same gravity it moves in the same way.
    """
    other, root = copy.deepcopy(spec), factor ** 0.5
    other['world']['step'] *= root

    def lengths(pose):
        pose['position'] = [factor * x for x in pose.get('position', [0, 0, 0])]

    for one in other['bodies']:
        lengths(one['pose'])
        inertial = one['inertial']
        inertial['mass'] *= factor ** 3
        inertial['com'] = [factor * x for x in inertial['com']]
        inertial['inertia'] = [factor ** 5 * x for x in inertial['inertia']]
        if 'twist' in one:
            one['twist'] = {'linear': [root * x for x in one['twist']['linear']],
                            'angular': [x / root for x in one['twist']['angular']]}
    for one in other['joints']:
        lengths(one['pose'])
        slides = one['type'] == 'prismatic'
        if 'position' in one and slides:
            one['position'] *= factor
        if 'velocity' in one:
            one['velocity'] *= root if slides else 1.0 / root
    return other


def gaps(world):
    """Return the largest gap of a joint of a world [m or rad], by the engine's own measure."""
    table = world.scene.joints.table
    return max(gap_of(table, state_of(world), j) for j in range(len(table.kind)))
