# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds in which a kinematic body carries a crate."""

from typing import Any

from rigid_sim_ros.world import World

G = 9.81
# How contacts are found and solved, by the name that a test gives it.
MODELS = {'event': {'contact': 'event'}, 'penalty': {'contact': 'penalty'},
          'timestep': {'contact': 'timestep'}, 'qp': {'contact': 'timestep', 'solver': 'qp'}}
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
REST = (0.0, 0.0, 0.0)


def floor(**keys: Any) -> dict[str, Any]:
    """Return a slab with its surface at z = 0; kinematic unless the keys say that it is fixed."""
    return {'name': 'floor', 'shape': {'type': 'box', 'size': [20, 20, 1]},
            'pose': {'position': [0, 0, -0.5]}, 'kinematic': 'fixed' not in keys, **keys}


def crate(name: str = 'crate', position: tuple[float, float, float] = (0.0, 0.0, 0.2),
          **keys: Any) -> dict[str, Any]:
    """Return a cube of 0.4 m and 2 kg, on the floor if not told otherwise."""
    return {'name': name, 'shape': {'type': 'box', 'size': [0.4, 0.4, 0.4]}, 'mass': 2.0,
            'pose': {'position': list(position)}, **keys}


def world_of(model: str, *bodies: dict[str, Any], friction: float = 0.5, restitution: float = 0.0,
             step: float = 1e-3, **collision: Any) -> World:
    """Return a world of bodies; springs of the model `penalty` are stable at its step."""
    return World.from_dict({
        'format': 1, 'world': {'step': step, **MODELS[model]}, 'bodies': list(bodies),
        'collision': collision,
        'materials': {'default': {'friction': friction, 'restitution': restitution,
                                  'stiffness': 2e4}}})
