# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies that came to rest sleep until something happens to them."""

import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.scene.errors import SceneError

G = 9.81
ASLEEP_AT = 1.5  # s: a second of rest, and time to come to rest


def box(name, position, fixed=False):
    return {'name': name, 'shape': {'type': 'box', 'size': [1, 1, 1]}, 'mass': 2.0,
            'fixed': fixed, 'pose': {'position': position}}


def scene(*others, sleep_after=1.0, **world):
    """Return a tower of two boxes on a fixed one, another box far away, and what is added."""
    return {'format': 1, 'world': world, 'collision': {'sleep_after': sleep_after}, 'bodies': [
        {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}},
        {'name': 'base', 'fixed': True, 'shape': {'type': 'box', 'size': [2, 2, 1]},
         'pose': {'position': [0, 0, 0.5]}},
        box('lower', [0, 0, 1.5]), box('upper', [0, 0, 2.5]), box('far', [9, 0, 0.5]), *others]}


def asleep(world):
    return world.contact_report().asleep


@pytest.fixture
def sleeping():
    world = World.from_dict(scene())
    world.step(round(ASLEEP_AT / 1e-3))
    assert asleep(world) == 3
    return world


def test_nothing_sleeps_unless_the_scene_says_so():
    world = World.from_dict(scene(sleep_after=0.0))
    world.step(3000)
    assert asleep(world) == 0


def test_bodies_sleep_when_they_have_rested_for_the_time_and_not_before():
    world = World.from_dict(scene())
    world.step(999)
    assert asleep(world) == 0
    world.step(500)
    assert asleep(world) == 3


def test_what_sleeps_stays_to_the_bit(sleeping):
    before = sleeping.position, sleeping.orientation
    sleeping.step(5000)
    assert np.array_equal(sleeping.position, before[0])
    assert np.array_equal(sleeping.orientation, before[1])
    assert not sleeping.linear_velocity.any()


def test_contact_forces_still_carry_the_weight(sleeping):
    rows = sleeping.contacts()
    on_base = rows['normal_force'][rows['body_a'] == 1].sum()
    assert on_base == pytest.approx(2 * 2.0 * G, rel=1e-5)


@pytest.mark.parametrize('disturb', [
    lambda world: world.apply_wrench('lower', force=(1, 0, 0)),
    lambda world: world.apply_impulse('lower', (1e-3, 0, 0)),
    lambda world: world.set_twist('lower', (0, 0, 1e-3), (0, 0, 0)),
    lambda world: world.set_pose('lower', (1e-6, 0, 1.5), (0, 0, 0, 1)),
], ids=['wrench', 'impulse', 'twist', 'pose'])
def test_a_disturbance_wakes_the_island_and_no_other(sleeping, disturb):
    disturb(sleeping)
    sleeping.step(1)
    assert asleep(sleeping) == 1


def test_a_wrench_moves_what_slept(sleeping):
    sleeping.apply_wrench('upper', force=(100.0, 0, 0), duration=0.1)
    sleeping.step(100)
    # Friction of 0.5 m g resists: v = (100 / 2 - 0.5 g) 0.1 s.
    assert sleeping.linear_velocity[3, 0] == pytest.approx((50 - 0.5 * G) * 0.1, rel=1e-3)


def test_a_fixed_body_that_is_taken_away_lets_the_tower_fall(sleeping):
    sleeping.set_pose('base', (50, 0, 0.5), (0, 0, 0, 1))
    sleeping.step(100)
    # 0.1 s of free fall, by the velocity after half of the last step to 1e-3.
    assert sleeping.linear_velocity[2, 2] == pytest.approx(-G * 0.1, rel=1e-2)
    assert asleep(sleeping) == 1


def test_a_body_that_comes_wakes_what_it_hits():
    world = World.from_dict(scene({
        'name': 'ball', 'shape': {'type': 'sphere', 'radius': 0.2}, 'mass': 5.0,
        'pose': {'position': [-20, 0, 2.5]}, 'twist': {'linear': [10, 0, 9.81]}}))
    # Thrown up so that it comes back to the height of the upper box after 2 s and 20 m less 0.7 m.
    world.step(1900)
    assert asleep(world) == 3
    world.step(200)
    assert asleep(world) == 1
    assert world.linear_velocity[3, 0] > 1.0


def test_they_fall_asleep_again(sleeping):
    sleeping.apply_impulse('upper', (0.1, 0, 0))
    sleeping.step(3000)
    assert asleep(sleeping) == 3


def test_a_saved_sleep_goes_on_bit_for_bit(sleeping):
    twin = World(sleeping.scene)
    twin.restore(sleeping.save())
    for world in (sleeping, twin):
        world.step(10)
        world.apply_impulse('upper', (0.5, 0.1, 0))
        world.step(700)
    assert twin.state_hash() == sleeping.state_hash()
    assert asleep(twin) == asleep(sleeping)


def test_a_reset_wakes_everything(sleeping):
    sleeping.reset()
    sleeping.step(1)
    assert asleep(sleeping) == 0


def test_other_models_say_that_they_know_no_sleep():
    with pytest.raises(SceneError, match=r'collision\.sleep_after: 1 s, must be 0'):
        World.from_dict(scene(contact='event'))


def test_what_hangs_on_a_spring_sleeps_on():
    """Its load is none, not its weight, and differs by rounding from that of its last step."""
    world = World.from_dict(scene(box('hung', [20, 0, 3]), sleep_after=0.1) | {'forces': [
        {'type': 'spring', 'a': 'hung', 'b': 'world', 'anchor': [20, 0, 5], 'stiffness': 100.0,
         'damping': 20.0, 'rest_length': 1.9}]})
    # k (5 - z - 1.9) = m g at z = 2.9, and exp(-t d / 2 m) of 0.1 m is 1e-6 m after 2.3 s.
    world.step(4000)
    assert asleep(world) == 4
    before = world.position
    world.step(1000)
    assert (world.position == before).all()
    assert world.position[-1, 2] == pytest.approx(5 - 1.9 - 2.0 * G / 100.0, abs=1e-3)


def test_a_body_without_a_shape_that_turns_is_not_at_rest():
    world = World.from_dict(scene({
        'name': 'rotor', 'inertial': {'mass': 1.0, 'inertia': [0.01, 0.01, 0.01, 0.0, 0.0, 0.0]},
        'twist': {'angular': [0.0, 0.0, 1.0]}}, sleep_after=0.1, gravity=[0, 0, 0]))
    world.step(1000)
    assert world.angular_velocity[-1, 2] == pytest.approx(1.0, rel=1e-12)


def test_bodies_that_a_spring_ties_sleep_and_wake_together():
    ends = [box('left', [20, 0, 0.5]), box('right', [23, 0, 0.5])]
    world = World.from_dict(scene(*ends, sleep_after=0.1) | {'forces': [
        {'type': 'spring', 'a': 'left', 'b': 'right', 'stiffness': 1.0, 'rest_length': 2.0}]})
    world.step(500)
    assert asleep(world) == 5
    world.apply_impulse('left', (0.0, 0.1, 0.0))
    world.step(1)
    assert asleep(world) == 3


@pytest.mark.parametrize('restitution', [0.0, 0.9])
def test_a_blow_goes_on_into_what_sleeps(restitution):
    # At 8 m/s a ball goes more than its radius in a step: who is hit in it meets the next one. One
    # that slept on would be a wall.
    cubes = [{'name': f'b{k}', 'mass': 0.2, 'shape': {'type': 'box', 'size': [0.06] * 3},
              'pose': {'position': [0.063 * k, 0.0, 0.03]}} for k in range(5)]
    ball = {'name': 'ball', 'mass': 0.2, 'shape': {'type': 'sphere', 'radius': 0.03},
            'pose': {'position': [-2.0, 0.0, 0.0301]}, 'twist': {'linear': [8.0, 0.0, 0.0]}}
    world = World.from_dict({
        'format': 1, 'world': {'step': 1 / 240}, 'collision': {'sleep_after': 0.05},
        'materials': {'default': {'friction': 0.0, 'restitution': restitution}},
        'bodies': [{'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}, *cubes, ball]})
    world.step(90)
    # Rounding of 1.6 N s in each of some ten collisions.
    assert world.total_momentum()[0] == pytest.approx(1.6, abs=1e-12)
