# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Random articulations that fall onto a floor, or fly towards each other."""

from typing import Any

import numpy as np

TYPES = ('revolute', 'revolute', 'prismatic', 'spherical', 'universal', 'fixed')
# [m] A scene in which bodies overlap by more at its start is of no use: they are pushed apart.
APART = -1e-3


def jointed_scene(seed: int, floor: bool) -> dict[str, Any]:
    """Return a scene of one to three trees of bodies, the same for the same seed."""
    rng = np.random.default_rng(seed)
    bodies: list[dict[str, Any]] = [
        {'name': 'floor', 'fixed': True, 'shape': {'type': 'plane', 'normal': [0, 0, 1]}}]
    joints: list[dict[str, Any]] = []
    while not joints:
        bodies[1:] = []
        for tree in range(rng.integers(1, 4)):
            _add_tree(rng, np.array([*rng.uniform(-0.5, 0.5, 2), 1.0 + 0.9 * tree]), floor, bodies,
                      joints)
    return {'world': {'gravity': [0, 0, -9.81 if floor else 0.0],
                      'step': float(rng.choice([0.001, 0.002, 0.004]))},
            'materials': {'default': {'friction': float(rng.choice([0, 0.3, 0.8])),
                                      'restitution': float(rng.choice([0, 0, 0.3, 0.7]))}},
            'bodies': bodies if floor else bodies[1:], 'joints': joints}


def _add_tree(rng: np.random.Generator, place: np.ndarray, floor: bool,
              bodies: list[dict[str, Any]], joints: list[dict[str, Any]]) -> None:
    """Add a body that moves, and some that hang on it."""
    # Without a floor they fly to where the middle one is.
    v = rng.normal(size=3) if floor else -2.0 * (place - [0.0, 0.0, 1.9])
    places, names = [place], [f'body{len(bodies)}']
    bodies.append(_body(rng, place) | {'twist': {
        'linear': v.tolist(), 'angular': (2.0 * rng.normal(size=3)).tolist()}, 'name': names[0]})
    for _ in range(rng.integers(0, 5)):
        parent = rng.integers(len(names))
        places.append(places[parent] + rng.uniform(-0.4, 0.4, 3))
        names.append(f'body{len(bodies)}')
        bodies.append(_body(rng, places[-1]) | {'name': names[-1]})
        joints.append(_joint(rng, names[parent], names[-1]))


def _body(rng: np.random.Generator, place: np.ndarray) -> dict[str, Any]:
    a, b, c = rng.uniform(0.05, 0.15, 3).tolist()
    shapes = [{'type': 'box', 'size': [2 * a, 2 * b, 2 * c]}, {'type': 'sphere', 'radius': a},
              {'type': 'capsule', 'radius': 0.5 * a, 'length': 2 * b},
              {'type': 'cylinder', 'radius': a, 'length': b}]
    q = rng.normal(size=4)
    return {'mass': float(10 ** rng.uniform(-1, 1)), 'shape': shapes[rng.integers(len(shapes))],
            'pose': {'position': place.tolist(),
                     'orientation': (q / np.linalg.norm(q)).tolist()}}


def _joint(rng: np.random.Generator, parent: str, child: str) -> dict[str, Any]:
    joint: dict[str, Any] = {
        'name': f'joint_of_{child}', 'type': str(rng.choice(TYPES)), 'parent': parent,
        'child': child, 'pose': {'position': rng.uniform(-0.2, 0.2, 3).tolist()}}
    if joint['type'] in ('revolute', 'prismatic'):
        joint['axis'] = rng.normal(size=3).tolist()
        if rng.random() < 0.4:
            joint['limits'] = {'lower': -0.3, 'upper': 0.3}
        if rng.random() < 0.3:
            joint['damping'] = float(rng.uniform(0.0, 0.5))
        if rng.random() < 0.3:
            joint['friction'] = float(rng.uniform(0.0, 0.5))
    return joint
