# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What nobody can mean, as it would end the simulation, is refused; the scene says from where."""
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.world.snapshot import pack, unpack

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


@pytest.mark.parametrize('kind', ['apply_wrench', 'apply_impulse'])
def test_the_lever_of_a_force_counts(kind):
    world = world_of(step=1.0, bounds={'angular': 30.0})
    # I = m a^2 / 6 = 1/3 kg m^2; 1 N s at a lever of 10 m gives 30 rad/s.
    getattr(world, kind)('crate', (0.0, 1.0, 0.0), point=(10.0, 0.0, 0.0))
    with pytest.raises(ValueError, match='must be within 30 rad/s'):
        getattr(world, kind)('crate', (0.0, 1.0, 0.0), point=(10.2, 0.0, 0.0))


@pytest.mark.parametrize('kind, position, velocity', [
    ('prismatic', 2.0, 3.0), ('continuous', 2.0, 4.0)])
def test_a_joint_is_put_and_driven_within_the_bounds_only(kind, position, velocity):
    body = {'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1}}
    world = World.from_dict({
        'world': {'bounds': {'position': 2.0, 'linear': 3.0, 'angular': 4.0}},
        'bodies': [{'name': 'rod', **body}],
        'joints': [{'name': 'joint', 'type': kind, 'parent': 'world', 'child': 'rod',
                    'axis': [0, 0, 1]}]})
    for sign in (1.0, -1.0):
        world.set_joint_state('joint', sign * position, sign * velocity)
        with pytest.raises(ValueError, match=rf'position {sign * 2.1:g}, must be within 2,'):
            world.set_joint_state('joint', sign * 2.1)
        with pytest.raises(ValueError, match=f'velocity .*, must be within {velocity:g},'):
            world.set_joint_state('joint', 0.0, 1.01 * sign * velocity)


@pytest.mark.parametrize('field, value', [
    ('x', 1e16), ('P', 1e14), ('L', 1e12), ('force', 1e17), ('torque', 1e15), ('point', 1e15)])
def test_a_snapshot_of_what_no_world_reaches_is_refused(field, value):
    world = world_of()
    world.apply_wrench('crate', (0.0, 1.0, 0.0), point=(0.1, 0.0, 0.0), duration=1.0)
    meta, arrays = unpack(world.save())
    world.restore(pack(meta, arrays))
    arrays[field] = np.full_like(arrays[field], value)
    with pytest.raises(ValueError, match='must be within'):
        world.restore(pack(meta, arrays))


def test_a_torque_counts_with_the_moment_of_the_force():
    # A moment of -0.5 N m in 0.5 s gives a cube of I = 1/3 kg m^2 0.75 rad/s.
    world = world_of(step=0.5, bounds={'angular': 0.76})
    push = {'force': (0.0, 0.0, 1.0), 'point': (0.5, 0.0, 0.0)}
    world.apply_wrench('crate', **push)
    world.apply_wrench('crate', **push, torque=(0.0, 1.0, 0.0))     # 0.5 N m in all
    with pytest.raises(ValueError, match=r'must be within 0.76 rad/s'):
        world.apply_wrench('crate', **push, torque=(0.0, -0.1, 0.0))


def test_a_thin_rod_that_turns_across_its_axis_may_be_saved() -> None:
    # 1 m long and 20 um thick: the moment across is 1.7e9 times that about the axis, so that |L|
    # over the least moment is far beyond 1e6 * 1e5 rad/s, and the angular velocity is not.
    rod = World.from_dict({'world': {'contact': 'none'}, 'bodies': [
        {'name': 'rod', 'mass': 1.0, 'twist': {'angular': [100.0, 0.0, 0.0]},
         'shape': {'type': 'cylinder', 'radius': 1e-5, 'length': 1.0}}]})
    rod.restore(rod.save())
    with pytest.raises(ValueError, match='angular velocity'):
        rod.set_twist('rod', (0, 0, 0), (1e6, 0, 0))
