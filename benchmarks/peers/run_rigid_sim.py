# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Run a scene in this project's engine; the last argument is the contact model."""

import sys
from typing import Any

import numpy as np
from runner import main, Running

from rigid_sim_ros import World


def world(scene: dict[str, Any], contact: str = 'timestep', **collision: Any) -> World:
    """Return the world of a scene; the ground is its last body, if it has one."""
    bodies: list[dict[str, Any]] = []
    for i, body in enumerate(scene['bodies']):
        size = ({'radius': body['size'][0]} if body['shape'] == 'sphere'
                else {'size': body['size']})
        bodies.append({
            'name': f'b{i}', 'shape': {'type': body['shape'], **size},
            'inertial': {'mass': body['mass'], 'inertia': [*body['moments'], 0, 0, 0]},
            'pose': {'position': body['position'], 'orientation': body['orientation']},
            'twist': {'linear': body['linear'], 'angular': body['angular']},
            'fixed': body.get('fixed', False)})
    if scene['ground']:
        bodies.append({'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}})
    surface = {'friction': scene['friction'], 'restitution': scene['restitution']}
    # Ours alone has no collision where nothing can meet anything; the others are not asked either.
    return World.from_dict({
        'format': 1, 'materials': {'default': surface}, 'bodies': bodies,
        'collision': collision,
        'world': {'step': scene['step'], 'gravity': scene['gravity'],
                  'contact': contact if scene['ground'] or scene.get('collide') else 'none'}})


def build(scene: dict[str, Any]) -> Running:
    """Return the scene in a world whose kernels are compiled."""
    w, n = world(scene, sys.argv[4]), len(scene['bodies'])
    w.step(2)
    w.reset()

    def motion() -> np.ndarray:
        return np.hstack([w.position[:n], w.orientation[:n], w.linear_velocity[:n],
                          w.angular_velocity[:n]])

    def ground_force() -> float | None:
        return float(-w.contact_wrenches()[n, 2]) if scene['ground'] else None

    return Running(w.step, motion, ground_force)


if __name__ == '__main__':
    main(build)
