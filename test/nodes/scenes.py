# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scene that the tests with real nodes share, and worlds that move as the node's should."""
from pathlib import Path

from rigid_sim_ros.world import load_scene, World

# No axis of crate or handle lies along another's or the world's, and the centre of mass lies away
# from the body frame: a wrench in the wrong axes or at the wrong point shows.
CRATES = """
format: 1
world: {gravity: [0, 0, 0], step: 0.001, contact: none}
bodies:
  - name: crate
    shape: {type: box, size: [0.4, 0.3, 0.2]}
    inertial: {mass: 2.0, com: [0.05, -0.02, 0.01], inertia: [0.03, 0.04, 0.05, 0.001, 0, 0.002]}
    pose: {position: [1, 2, 3], orientation: [0.5, 0.1, -0.7, 0.5]}
    twist: {linear: [0.1, 0.2, -0.3], angular: [0.3, -0.2, 0.5]}
    frames: {handle: {position: [0.2, 0.1, 0.05], orientation: [0.1, 0.7, 0.1, 0.7]}}
  - name: ball
    shape: {type: sphere, radius: 0.1}
    mass: 1.5
    pose: {position: [-1, 0, 0.5]}
  - name: ground
    shape: {type: plane}
    fixed: true
"""


def crates(folder: Path) -> Path:
    """Write the scene to a file and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / 'crates.yaml'
    path.write_text(CRATES, encoding='utf-8')
    return path


def free_bodies(folder: Path, count: int) -> Path:
    """Write a scene of so many boxes that tumble in weightlessness, and return its path."""
    bodies = '\n'.join(
        f'  - {{name: body_{k}, shape: {{type: box, size: [0.1, 0.2, 0.3]}}, mass: 1.0, '
        f'pose: {{position: [{k}, 0, 0]}}, twist: {{angular: [0.01, 5, 0.01]}}}}'
        for k in range(count))
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / 'free_bodies.yaml'
    path.write_text(f'world: {{step: 0.001, gravity: [0, 0, 0], contact: none}}\n'
                    f'bodies:\n{bodies}\n', encoding='utf-8')
    return path


def world_of(scene: Path | str, step_index: int = 0) -> World:
    """Return a world of a scene, stepped so far."""
    world = load_scene(scene)
    world.step(step_index)
    return world
