# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model `event` where bodies that nothing pushes close on one between them."""

from inside import arguments_of
import numpy as np
import pytest

from rigid_sim_ros.engine.steps.event import report
from rigid_sim_ros.world import World

EDGE = 0.05


def between(step, apart, speed=None):
    """Return a cube between two kinematic plates, which may close with some speed [m/s]."""
    def plate(name, side):
        told = {'name': name, 'shape': {'type': 'box', 'size': [0.02, 0.04, 0.04]},
                'kinematic': True,
                'pose': {'position': [side * (0.5 * EDGE + 0.01 + apart), 0.0, 0.5 * EDGE]}}
        if speed is not None:
            told['twist'] = {'linear': [-side * speed, 0.0, 0.0], 'angular': [0.0, 0.0, 0.0]}
        return told
    cube = {'name': 'cube', 'shape': {'type': 'box', 'size': [EDGE] * 3}, 'mass': 0.2,
            'pose': {'position': [0.0, 0.0, 0.5 * EDGE]}}
    ground = {'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True}
    return World.from_dict({
        'format': 1, 'world': {'step': step, 'contact': 'event'},
        'materials': {'default': {'friction': 0.8, 'restitution': 0.0}},
        'bodies': [cube, ground, plate('left', -1.0), plate('right', 1.0)]})


@pytest.mark.parametrize('step', [1e-3, 1 / 240])
def test_fingers_that_overlap_what_they_hold_lift_it(step):
    world = between(step, 0.001)
    for k in range(round(1.0 / step)):
        t = (k + 1) * step
        out = 0.5 * EDGE + 0.01 + max(0.001 - 0.01 * t, -1e-4)
        up = 0.5 * EDGE + 0.2 * max(t - 0.3, 0.0)
        world.set_pose('left', (-out, 0.0, up), (0.0, 0.0, 0.0, 1.0))
        world.set_pose('right', (out, 0.0, up), (0.0, 0.0, 0.0, 1.0))
        world.step()
    # It is held. In the step in which the fingers set off it may stay behind by their way, and it
    # may slip by what they overlap it by.
    assert world.position[0, 2] == pytest.approx(0.5 * EDGE + 0.2 * 0.7, abs=0.2 * step + 1e-4)


def test_an_impact_without_a_solution_ends_once_it_does_not_become_weaker():
    world = between(1e-3, 1e-3, 0.1)
    most = 0
    for _ in range(40):
        world.step()
        most = max(most, report(arguments_of(world)).collisions)
        # Between them it goes no faster than they do.
        assert np.abs(world.linear_velocity[0]).max() < 0.1 + 1e-6
    # Of three pairs, twice three are asked for whether they become weaker.
    assert 0 < most <= 3 * 2 * 3


def test_plates_that_close_on_a_ball_go_all_their_way_whatever_a_step_cannot_finish():
    def plate(name, x, v):
        return {'name': name, 'kinematic': True, 'shape': {'type': 'box', 'size': [0.1, 1, 1]},
                'pose': {'position': [x, 0, 0]}, 'twist': {'linear': [v, 0, 0]}}

    h, v = 0.02, 1.0
    world = World.from_dict({
        'format': 1, 'world': {'contact': 'event', 'step': h, 'gravity': [0, 0, 0]},
        'materials': {'default': {'friction': 0.0, 'restitution': 1.0}},
        'bodies': [plate('left', -0.165, v), plate('right', 0.165, -v), {
            'name': 'ball', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1},
            'twist': {'linear': [1.0, 0.1, 0.0]}}]})
    for k in (1, 2, 3):
        world.step()
        # Between them the ball bounces more and more often, without end once there is no gap.
        assert 'no impulses stop all points of what is squeezed' in world.contact_report().message
        place = 0.165 - k * h * v
        assert world.position[:2, 0] == pytest.approx([-place, place], abs=1e-14)
