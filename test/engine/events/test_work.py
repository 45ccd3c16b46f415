# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model `event`: forces do no work where contacts leave, and all of a column is displaced."""

import numpy as np
import pytest

from rigid_sim_ros.world import World


def test_what_bounces_twice_in_a_step_keeps_its_energy():
    # A flat ellipsoid turns by 0.6 rad in a step. Its first collision makes it leave the wall, and
    # turning brings it back within the step: a force that held it off meanwhile would do work.
    wall = {'name': 'wall', 'shape': {'type': 'plane', 'normal': [0, -1, 0]}, 'fixed': True}
    body = {'name': 'body', 'mass': 3.325e8,
            'shape': {'type': 'ellipsoid', 'radii': [11.500172, 11.500172, 2.757526]},
            'pose': {'position': [0, -6.1754, 0],
                     'orientation': [-0.27757994, 0.44556491, 0.75719562, 0.38868507]},
            'twist': {'linear': [-14.238, 30.3297, 35.6099],
                      'angular': [-3.37464111, 3.09766541, -7.11275095]}}
    world = World.from_dict({
        'format': 1, 'world': {'contact': 'event', 'step': 0.07427, 'gravity': [0, 0, 0]},
        'materials': {'default': {'friction': 0.0, 'restitution': 1.0}}, 'bodies': [wall, body]})
    start = world.kinetic_energy()
    world.step()
    assert world.linear_velocity[world.names.index('body'), 1] < 0.0
    # Collisions without loss, and free rotation of fifth order whose error is 1e-7 of a turn.
    assert world.kinetic_energy() == pytest.approx(start, rel=1e-6)


def test_overlaps_of_a_column_end_at_the_same_rate_at_all_heights():
    # 12 cubes of 1 m that overlap by 0.1 m: each overlap is to become less by half a percent of
    # the radius, sqrt(3) / 2 m, in each step.
    count, steps = 12, 10
    bodies = [{'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True}]
    bodies += [{'name': f'b{k}', 'mass': 1.0, 'shape': {'type': 'box', 'size': [1, 1, 1]},
                'pose': {'position': [0.02 * (k % 3), 0.0, 0.5 + 0.9 * k]}} for k in range(count)]
    world = World.from_dict({'format': 1, 'world': {'contact': 'event', 'step': 1 / 240},
                             'bodies': bodies})
    world.step(steps)
    heights = np.diff(world.position[[world.names.index(f'b{k}') for k in range(count)], 2])
    # They are solved to 1e-7 of that, and tilt by less.
    assert heights == pytest.approx(0.9 + steps * 0.005 * np.sqrt(0.75), abs=1e-5)
    assert np.abs(world.linear_velocity).max() < 1e-6


@pytest.mark.parametrize('spin', [1e-3, 1e-1])
def test_needles_below_tons_gain_no_more_than_the_load_loses(spin):
    # Needles that begin to roll away below a load are elsewhere in the middle of a step than
    # their forces were found for. With the wrong levers these turned them by up to 1e8 times the
    # energy of all that could fall.
    h, g = 3.2e-3, 9.81
    boxes = [(3e-3, [8.8e-3, 7.7e-5, 4.5e-5]), (6.3e-2, [8.8e-3, 9.7e-5, 3.8e-5]),
             (1e4, [8.8e-3, 6.3e-3, 1e-3])]
    bodies, z = [{'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True}], 0.0
    for k, (mass, size) in enumerate(boxes):
        bodies.append({'name': f'b{k}', 'mass': mass, 'shape': {'type': 'box', 'size': size},
                       'pose': {'position': [0.0, 0.0, z + 0.5 * size[2]]},
                       'twist': {'linear': [0.0, 0.0, 0.0],
                                 'angular': [spin if k < 2 else 0.0, 0.0, 0.0]}})
        z += size[2]
    world = World.from_dict({
        'format': 1, 'world': {'contact': 'event', 'step': h}, 'bodies': bodies,
        'materials': {'default': {'friction': 0.0, 'restitution': 0.0}}})
    # A velocity is known to g h, and the load falls by the thickness of the needles at most.
    most = boxes[2][0] * (g * 8.3e-5 + 0.5 * (g * h) ** 2)
    for _ in range(60):
        world.step()
        assert world.kinetic_energy() < most
