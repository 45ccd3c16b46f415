# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A scene with joints for the tests with real nodes: a model with drives, and a pendulum."""
from pathlib import Path

import yaml

PERIOD = 0.001      # s

# The elbow turns without end, so its position is unwrapped; the slide has a gain only.
POSITION = {'mode': 'position', 'stiffness': 2000.0, 'damping': 100.0}
DESCRIPTION = '<robot name="arm"><link name="upper"/></robot>'


def link(name: str, z: float) -> dict:
    return {'name': name, 'mass': 1.0, 'shape': {'type': 'box', 'size': [0.1, 0.1, 0.5]},
            'pose': {'position': [0.0, 0.0, z]}}


def joint(name: str, kind: str, parent: str, child: str, **more) -> dict:
    return {'name': name, 'type': kind, 'parent': parent, 'child': child, **more}


SCENE = {
    'format': 1, 'world': {'contact': 'none', 'step': PERIOD},
    'bodies': [link('arm/upper', -0.25), link('arm/lower', -0.75), link('arm/sled', -0.75),
               {**link('bob', -0.25), 'pose': {'position': [2.0, 0.0, -0.25]}}],
    'joints': [
        joint('arm/shoulder', 'revolute', 'world', 'arm/upper', axis=[0, 1, 0], position=0.2,
              drive=POSITION, limits={'lower': -1.5, 'upper': 1.5, 'velocity': 10.0,
                                      'effort': 300.0}),
        joint('arm/elbow', 'continuous', 'arm/upper', 'arm/lower', axis=[0, 1, 0],
              pose={'position': [0, 0, -0.25]}, drive=POSITION),
        joint('arm/slide', 'prismatic', 'arm/lower', 'arm/sled', axis=[0, 0, 1],
              drive={'mode': 'velocity', 'gain': 200.0}),
        joint('pivot', 'revolute', 'world', 'bob', pose={'position': [2, 0, 0]}, axis=[0, 1, 0],
              position=1.0)],
    'descriptions': {'arm': DESCRIPTION},
}


def jointed(folder: Path) -> Path:
    """Write the scene to a file and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / 'jointed.yaml'
    path.write_text(yaml.safe_dump(SCENE), encoding='utf-8')
    return path
