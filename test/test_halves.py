# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A world that is cut into halves: impacts and overlaps in either half, and across."""

from typing import Any

import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.coloring import BETWEEN

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
    found: np.ndarray = world._contact._work.solver.coloring.members
    return found


def test_an_impact_reaches_the_end_of_a_row_within_its_step():
    y, z = np.eye(3)[1:]
    world = rows_and(row('across', z, y, LENGTH, 0.0, SPEED), SPEED)
    world.step(2)
    assert np.count_nonzero(world.linear_velocity) == ROWS + 1
    world.step()
    assert members(world).min() > 0
    v = world.linear_velocity
    for along in [*v[:-LENGTH, 0].reshape(ROWS, LENGTH), v[-LENGTH:, 1]]:
        # All of them would go on alike if nothing were left to the next step; who has not heard
        # of the impact stands still. Momenta add up to that of the first one.
        assert along.min() > 0.4 * SPEED / LENGTH
        assert along.sum() == pytest.approx(SPEED, abs=1e-12)


def test_what_overlaps_across_is_pushed_apart():
    y, z = np.eye(3)[1:]
    world = rows_and(row('across', z, y, 2, 0.001, 0.0), 0.0)
    world.step(3)
    assert members(world)[BETWEEN] == 1
    overlap = 2.0 * RADIUS - np.ptp(world.position[-2:, 1])
    for _ in range(3):
        world.step()
        assert members(world)[BETWEEN] == 1
        now = 2.0 * RADIUS - np.ptp(world.position[-2:, 1])
        # Four substeps leave 0.8 of it each.
        assert now == pytest.approx(overlap * 0.8 ** 4, rel=1e-6)
        overlap = now
