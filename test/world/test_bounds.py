# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What nobody can mean, as it would end the simulation, is refused; the scene says from where."""
import numpy as np
import pytest

from rigid_sim_ros import World

HUGE, NOTHING, UPRIGHT = (1e308, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)


def world_of(**world):
    return World.from_dict({
        'world': {'gravity': [0, 0, 0], 'contact': 'none', **world},
        'bodies': [{'name': 'crate', 'mass': 2.0, 'shape': {'type': 'box', 'size': [1, 1, 1]}}]})


@pytest.mark.parametrize('kind, arguments, key', [
    ('set_pose', (HUGE, UPRIGHT), 'position'),
    ('set_twist', (HUGE, NOTHING), 'linear'),
    ('set_twist', (NOTHING, HUGE), 'angular'),
    ('apply_wrench', (HUGE, NOTHING), 'linear'),
    ('apply_wrench', (NOTHING, HUGE), 'angular'),
    ('apply_impulse', (HUGE,), 'linear'),
])
def test_numbers_beyond_all_bounds_are_refused_and_change_nothing(kind, arguments, key):
    world = world_of()
    before = world.state_hash()
    with pytest.raises(ValueError, match=rf"^body 'crate' .*bounds: {{{key}: "):
        getattr(world, kind)('crate', *arguments)
    assert world.state_hash() == before


def test_the_scene_moves_its_bounds():
    world = world_of(bounds={'position': 2e9, 'linear': 3.0})
    world.set_pose('crate', (2e9, 0.0, 0.0), UPRIGHT)
    world.set_twist('crate', (3.0, 0.0, 0.0), NOTHING)
    with pytest.raises(ValueError, match='must be within 3 m/s'):
        world.set_twist('crate', (0.0, np.nextafter(-3.0, -4.0), 0.0), NOTHING)


def test_a_wrench_is_measured_by_what_it_does_in_a_step():
    world = world_of(step=0.5, bounds={'linear': 3.0})
    world.apply_wrench('crate', (12.0, 0.0, 0.0))       # 12 N * 0.5 s / 2 kg = 3 m/s
    with pytest.raises(ValueError, match='must be within 3 m/s'):
        world.apply_wrench('crate', (12.1, 0.0, 0.0))
