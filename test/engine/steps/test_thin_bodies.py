# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies that are long or thin, and that tumble by a good part of a turn in a step."""

import itertools

import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.maths.rotation import to_matrix

RODS = [(1, 0.05), (1, 0.01), (1, 0.001)]
STEPS = [1 / 60, 1 / 240, 0.001]


def thrown(shape, seed, step, spin=5.0, others=(), friction=0.3):
    """Return a world in which a body of 1 m tumbles down to the ground."""
    rng = np.random.default_rng(seed)
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    body = {'name': 'thin', 'shape': shape, 'mass': 1.0,
            'pose': {'position': [0, 0, 1], 'orientation': q.tolist()},
            'twist': {'linear': rng.normal(size=3).tolist(),
                      'angular': (spin * rng.normal(size=3)).tolist()}}
    ground = {'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True}
    return World.from_dict({
        'format': 1, 'world': {'step': step}, 'bodies': [body, ground, *others],
        'materials': {'default': {'friction': friction}}})


def energy(world):
    """Return the energy of a world [J]."""
    return world.kinetic_energy() + world.potential_energy()


@pytest.mark.parametrize('step', STEPS)
@pytest.mark.parametrize('length, radius', RODS)
def test_a_rod_that_lands_gains_no_energy(length, radius, step):
    shape = {'type': 'capsule', 'radius': radius, 'length': length}
    for seed in (0, 2, 4):
        world = thrown(shape, seed, step, spin=10.0)
        start = last = energy(world)
        for _ in range(round(1.5 / step)):
            world.step()
            now = energy(world)
            # A thousandth is what one body may gain by turning: the second order of the step.
            assert now - last < 1e-3 * start
            last = now


@pytest.mark.parametrize('step', STEPS)
@pytest.mark.parametrize('size', [(1, 1, 0.002), (1, 0.6, 0.01), (1, 0.01, 0.01)])
def test_what_is_thin_lands_on_the_ground_and_lies_there(size, step):
    corners = 0.5 * np.array(list(itertools.product((-1, 1), repeat=3))) * size
    for seed in range(4):
        world, deepest = thrown({'type': 'box', 'size': list(size)}, seed, step), 0.0
        for _ in range(round(2 / step)):
            world.step()
            z = corners @ np.array(to_matrix(tuple(world.orientation[0])))[2]
            deepest = max(deepest, -(z.min() + world.position[0, 2]))
        # A way ends at an eighth of the half thickness; a few may follow before the body is met.
        assert deepest < 0.5 * min(size)
        # Flat or on an edge, and at rest within two seconds.
        assert np.abs(world.linear_velocity[0]).max() < 1e-3


def rods_in_space(rng):
    """Return three rods of 1 m that fly towards each other."""
    for name, at in (('a', [-0.5, 0, 0]), ('b', [0.5, 0, 0]), ('c', [0, 0.6, 0.3])):
        q = rng.normal(size=4)
        yield {'name': name, 'mass': 1.0,
               'shape': {'type': 'capsule', 'radius': float(10 ** rng.uniform(-3, -1.5)),
                         'length': 1.0},
               'pose': {'position': at, 'orientation': (q / np.linalg.norm(q)).tolist()},
               'twist': {'linear': (rng.normal(size=3) - 2 * np.array(at)).tolist(),
                         'angular': (6 * rng.normal(size=3)).tolist()}}


def test_rods_that_meet_in_space_keep_their_momenta_and_gain_no_energy():
    world = World.from_dict({
        'format': 1, 'world': {'step': 1 / 60, 'gravity': [0, 0, 0]},
        'materials': {'default': {'friction': 0.3}},
        'bodies': list(rods_in_space(np.random.default_rng(0)))})
    last, L, P = world.kinetic_energy(), world.total_angular_momentum(), world.total_momentum()
    for _ in range(60):
        world.step()
        now = world.kinetic_energy()
        # Each of two that meet may gain a thousandth.
        assert now < (1.0 + 1e-3) * last
        last = now
    # To the tolerance of what is nearest, 1e-8 m or less, times the impulses.
    assert world.total_angular_momentum() == pytest.approx(L, abs=1e-9)
    assert world.total_momentum() == pytest.approx(P, abs=1e-12)
