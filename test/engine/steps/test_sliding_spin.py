# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What turns while it slides is held less by friction, and slides farther."""

import numpy as np
import pytest

from rigid_sim_ros import World

G, MU = 9.81, 0.4
RADIUS = 0.25


def slide(contact, speed, spin, shape=None):
    """Return when and where a puck comes to rest, and its last speeds: s, m, [m/s, rad/s]."""
    world = World.from_dict({
        'format': 1, 'world': {'contact': contact},
        'materials': {'default': {'friction': MU}},
        'bodies': [{'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True},
                   {'name': 'puck', 'mass': 2.0, 'pose': {'position': [0, 0, 0.05]},
                    'shape': shape or {'type': 'cylinder', 'radius': RADIUS, 'length': 0.1},
                    'twist': {'linear': [speed, 0, 0], 'angular': [0, 0, spin]}}]})
    speeds = []
    while not speeds or max(speeds[-1]) > 1e-6:
        world.step()
        speeds.append([np.linalg.norm(world.linear_velocity[1]),
                       abs(world.angular_velocity[1, 2])])
    return 1e-3 * len(speeds), world.position[1, 0], speeds


def by_the_ellipsoid(speed, spin):
    """
    Integrate m v' = -mu N v / s, I w' = -mu N r^2 w / s, s = sqrt(v^2 + r^2 w^2), to rest.

    For the rim of the disk r is its radius, and I = m r^2 / 2.
    """
    v, rw, x, t, h = speed, RADIUS * spin, 0.0, 0.0, 1e-5
    while v * v + rw * rw > 1e-8:
        s = np.hypot(v, rw)
        v, rw = v - h * MU * G * v / s, rw - h * 2.0 * MU * G * rw / s
        x, t = x + h * v, t + h
    return t, x


@pytest.mark.parametrize('spin', [0.0, 5.0, 20.0])
def test_a_puck_that_spins_slides_as_far_as_the_ellipsoid_of_its_friction_says(spin):
    """The model is of first order in the step where both end: v changes by mu g h in one."""
    t, x, _ = slide('timestep', 2.0, spin)
    expected = by_the_ellipsoid(2.0, spin)
    assert (t, x) == (pytest.approx(expected[0], abs=4e-3), pytest.approx(expected[1], abs=4e-3))


@pytest.mark.parametrize('shape', [None, {'type': 'box', 'size': [0.4, 0.4, 0.1]},
                                   {'type': 'box', 'size': [0.8, 0.2, 0.1]}])
def test_both_models_agree_on_how_far(shape):
    """The ellipsoid is inside of what single points can make: by up to a third of the effect."""
    far = [slide(contact, 2.0, 20.0, shape)[1] for contact in ('timestep', 'event')]
    alone = 2.0 ** 2 / (2.0 * MU * G)
    assert far[0] - alone == pytest.approx(far[1] - alone, rel=0.35)


def test_sliding_and_spinning_end_together():
    """As of every body that rubs with a surface, up to the step in which both end."""
    _, _, speeds = slide('timestep', 1.0, 3.0)
    assert min(speeds[-4]) > 0.0
    assert max(speeds[-1]) < 1e-6


def between_belts(contact):
    """Return the velocity and the spin of a box across two belts that run two ways."""
    world = World.from_dict({
        'format': 1, 'world': {'contact': contact},
        'bodies': [{'name': 'box', 'shape': {'type': 'box', 'size': [0.4, 0.4, 0.1]},
                    'mass': 1.0, 'pose': {'position': [0, 0, 0.05]}},
                   *({'name': f'belt{k}', 'kinematic': True,
                      'shape': {'type': 'box', 'size': [4, 1, 0.1]},
                      'pose': {'position': [0, 0.5 * side, -0.05]},
                      'twist': {'linear': [0.3 * side, 0, 0]}}
                     for k, side in enumerate((1, -1)))]})
    world.step(150)
    return world.linear_velocity[0], world.angular_velocity[0, 2]


def test_belts_that_run_two_ways_turn_what_lies_across_them():
    """And none of them wins: 1 % is what sweeps leave of the order in which they come to them."""
    (v, spin), (_, expected) = between_belts('timestep'), between_belts('event')
    assert np.abs(v).max() < 3e-3
    assert spin == pytest.approx(expected, rel=0.15)
    assert expected < -0.3
