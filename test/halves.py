# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds of rows of balls that are cut into halves."""

from typing import Any

from inside import solver_of
import numpy as np

from rigid_sim_ros import World

RADIUS = 0.1
ROWS, LENGTH = 80, 10
SPEED, GAP = 5.0, 0.05  # what comes is there in the third step


def row(name: str, middle: np.ndarray, along: np.ndarray, count: int, overlap: float,
        speed: float) -> list[dict[str, Any]]:
    """Return balls side by side; the first one, further away, comes at a speed."""
    bodies = []
    for k in range(count):
        place = (2.0 * RADIUS - overlap) * (k - 0.5 * (count - 1))
        if speed > 0.0 and k == 0:
            place -= GAP
        bodies.append({
            'name': f'{name}_{k}', 'shape': {'type': 'sphere', 'radius': RADIUS}, 'mass': 1.0,
            'pose': {'position': (middle + place * along).tolist()},
            'twist': {'linear': ((speed if k == 0 else 0.0) * along).tolist()}})
    return bodies


def rows_and(across: list[dict[str, Any]], speed: float) -> World:
    """Return rows of balls along x, beside each other along y, and something amid them."""
    x, y = np.eye(3)[:2]
    bodies = [body for k in range(ROWS)
              for body in row(f'r{k}', 0.3 * (k - 0.5 * (ROWS - 1)) * y, x, LENGTH, 0.0, speed)]
    return World.from_dict({
        'format': 1,
        'world': {'contact': 'timestep', 'step': 1 / 240, 'gravity': [0.0, 0.0, 0.0]},
        'materials': {'default': {'friction': 0.0, 'restitution': 0.0}},
        'bodies': [*bodies, *across]})


def members(world: World) -> np.ndarray:
    """Return how many contacts either half has, and how many are across."""
    found: np.ndarray = solver_of(world).coloring.members
    return found
