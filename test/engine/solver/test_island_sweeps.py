# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is at rest on what can move stays at rest."""

import math

import numpy as np
import pytest

from rigid_sim_ros import World

STEP = 1 / 60
FIVE_MINUTES = 300 * 60  # steps


def ball_on_box(v: float) -> World:
    """Return a world with a ball that rolls at v [m/s] on a box on the ground."""
    yaw = [0.0, 0.0, math.sin(0.15), math.cos(0.15)]
    return World.from_dict({
        'format': 1, 'world': {'contact': 'timestep', 'step': STEP},
        'materials': {'default': {'friction': 0.5}},
        'bodies': [
            {'name': 'box', 'mass': 1.0, 'shape': {'type': 'box', 'size': [0.2, 0.2, 0.2]},
             'pose': {'position': [0.0, 0.0, 0.1], 'orientation': yaw}},
            {'name': 'ball', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1},
             'pose': {'position': [0.0, 0.0, 0.3]}, 'twist': {'linear': [v, 0.0, 0.0]}},
            {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}]})


@pytest.mark.parametrize('v', [0.0, 1e-7])
def test_ball_at_rest_on_a_box_does_not_creep(v: float) -> None:
    """The sweeps that let the box tilt towards the ball drove it on, faster by e in 11 s."""
    world = ball_on_box(v)
    world.step(FIVE_MINUTES)
    speed = float(np.abs(world.linear_velocity[1]).max())
    # Sweeps end at 1e-15 of the size a substep. If all of that tilted the box, it would be by
    # 2.4e-13 rad/s, 7e-11 rad in five minutes: 5/7 g of it, on the average half, is 7e-8 m/s.
    # What the first impact leaves, an overlap of 1e-10 m on one side, is 7e-9 m/s^2 and 2e-6 m/s.
    assert speed == pytest.approx(5 / 7 * v, abs=2e-6)
