# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model `timestep` with many bodies: towers, pyramids and piles, at 240 steps a second."""

from engine.stepping import falling_balls, falling_boxes, pyramid, tower
from engine.touching import G
import numpy as np
import pytest

H = 1 / 240


def test_a_tower_of_20_stays_where_it_is():
    scene = tower(20, H)
    scene.step(2400)
    x = scene.state.x[:, 1:]
    # What sank before the impulses had grown is pushed out again by 0.2 a substep.
    assert x[2] == pytest.approx(0.5 + np.arange(20), abs=1e-4)
    # All is symmetric, and the solver keeps it so: rounding.
    assert np.abs(x[:2]).max() < 1e-9


def test_the_ground_carries_the_weight_of_a_tower():
    scene = tower(20, H)
    scene.step(2400)
    assert scene.ground_force() == pytest.approx(20 * G, rel=1e-9)


def test_a_tower_set_down_askew_stands():
    scene = tower(10, H)
    scene.state.x[0, 1:] += 0.05 * (-1.0) ** np.arange(10)
    start = scene.state.x.copy()
    scene.step(1200)
    # A swaying tower keeps its boxes where friction holds them: within a few millimetres.
    assert np.abs(scene.state.x - start).max() < 5e-3


def test_a_pyramid_of_210_stands():
    scene = pyramid(20, H)
    start = scene.state.x.copy()
    scene.step(1200)
    assert np.abs(scene.state.x - start).max() < 1e-3


def deepest_of_all_steps(scene, steps: int) -> float:
    """Return the deepest overlap at the start of any step [m]."""
    deepest = 0.0
    for _ in range(steps):
        scene.step(1)
        deepest = max(deepest, scene.deepest())
    return deepest


def test_666_balls_overlap_by_no_more_than_a_hundredth_of_their_radius():
    # While they fall on each other, too: what an impact changes is solved before a substep ends.
    assert deepest_of_all_steps(falling_balls(H), 1200) < 1.2e-3


def test_a_pile_of_1000_boxes_is_rigid():
    scene = falling_boxes(H)
    # Boxes that fall on top of each other at 8 m/s move by 33 mm a step.
    assert deepest_of_all_steps(scene, 1200) < 0.015
    assert scene.deepest() < 1e-3
