# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What joints drive within a step farther than its velocity said passes nothing."""

import numpy as np
import pytest

from rigid_sim_ros import World

DRIVES = {'velocity': {'mode': 'velocity', 'gain': 1e6, 'velocity': 5.0},
          'position': {'mode': 'position', 'stiffness': 1e6, 'damping': 1e3, 'position': 0.2},
          'effort': {'mode': 'effort', 'effort': 100.0}}


def world_of(bodies, joints, contact, step):
    return World.from_dict({
        'world': {'contact': contact, 'step': step, 'gravity': [0, 0, 0]},
        'materials': {'default': {'friction': 0.0}}, 'bodies': bodies, 'joints': joints})


@pytest.mark.parametrize('contact', ['timestep', 'event'])
@pytest.mark.parametrize('step', [1 / 60, 1 / 240, 1e-3])
@pytest.mark.parametrize('drive', list(DRIVES))
@pytest.mark.parametrize('thickness, gap', [(0.01, 0.03), (0.002, 0.01), (0.01, 0.001)])
def test_what_a_drive_starts_from_rest_stops_at_a_thin_wall(thickness, gap, drive, step, contact):
    """A ball of 5 mm, driven by up to 20 cm in its first step, ends where it touches the wall."""
    r = 0.005
    ball = {'name': 'ball', 'mass': 0.1, 'shape': {'type': 'sphere', 'radius': r}}
    wall = {'name': 'wall', 'fixed': True, 'pose': {'position': [r + gap + thickness / 2, 0, 0]},
            'shape': {'type': 'box', 'size': [thickness, 1.0, 1.0]}}
    joint = {'name': 'slide', 'type': 'prismatic', 'parent': 'world', 'child': 'ball',
             'axis': [1, 0, 0], 'drive': DRIVES[drive]}
    world = world_of([ball, wall], [joint], contact, step)
    world.step(round(0.1 / step))
    # It gives way by the compliance of the points, far below a thousandth of its size.
    assert world.joint_position[0] == pytest.approx(gap, abs=1e-3 * r)


@pytest.mark.parametrize('gap', [0.2, 0.19, 0.1777])
def test_a_hammer_does_not_pass_a_nail_that_dry_friction_stops(gap):
    """
    The nail goes (M + m) V^2 / 2 F far, with V of both after the blow.

    Friction stops the nail alone within a step, before it has gone as far as the hammer would.
    """
    M, m, F, v = 2.0, 0.2, 300.0, 4.0
    hammer = {'name': 'hammer', 'mass': M, 'shape': {'type': 'box', 'size': [0.1, 0.1, 0.1]}}
    nail = {'name': 'nail', 'mass': m, 'shape': {'type': 'box', 'size': [0.2, 0.02, 0.02]},
            'pose': {'position': [0.15 + gap, 0, 0]}}
    rail = {'type': 'prismatic', 'parent': 'world', 'axis': [1, 0, 0]}
    world = world_of([hammer, nail], [
        rail | {'name': 'h', 'child': 'hammer', 'velocity': v},
        rail | {'name': 'n', 'child': 'nail', 'friction': F,
                'pose': {'position': [0.15 + gap, 0, 0]}}], 'event', 1 / 60)
    world.step(20)
    V = M * v / (M + m)
    # First order: the step in which friction stops it, at a deceleration of 136 m/s^2 here.
    assert world.joint_position[1] == pytest.approx((M + m) * V ** 2 / 2 / F, rel=0.02)
    assert world.joint_position[0] - gap == pytest.approx(world.joint_position[1], abs=1e-6)
    assert np.abs(world.joint_velocity).max() < 1e-9
