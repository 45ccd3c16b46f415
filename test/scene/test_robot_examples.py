# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The example scenes of robots that touch things do what their comments say."""

from effort import either
import numpy as np
import pytest

from rigid_sim_ros import load_scene


def at(world, name):
    return world.position[world.names.index(name)]


def test_the_quadruped_stands_and_swings_back_when_it_is_pushed():
    world = load_scene('quadruped')
    world.step(2000)
    before = at(world, 'trunk')
    world.step(3000)
    # Swings of the legs die out with d / 2 I, some 3 /s; what is left after 2 s is 1e-3 of 22 mm.
    np.testing.assert_allclose(at(world, 'trunk'), before, atol=1e-4)
    # A drive that gives tau stands off by tau / k: the knees of 15 kg, each with some 4 kg at
    # a lever of 0.1 m, by 0.01 to 0.06 rad.
    bent = world.joint_position[2::3] + 1.4
    assert (np.abs(bent) < 0.08).all()
    assert (np.abs(bent) > 0.005).all()
    weight = world.mass[world.mass < np.inf].sum() * 9.81
    force = world.contacts()['normal_force'].sum()
    assert force == pytest.approx(weight, rel=1e-4)
    before = at(world, 'trunk')
    world.apply_wrench('trunk', force=(0.0, 60.0, 0.0), duration=0.2)
    world.step(200)
    assert at(world, 'trunk')[1] - before[1] > 0.02
    world.step(4800)
    # The feet slip a little under the push.
    np.testing.assert_allclose(at(world, 'trunk'), before, atol=6e-3)


@pytest.mark.long
def test_the_gripper_lifts_the_cube_and_holds_it_by_friction():
    world = load_scene('gripper')
    world.step(500)
    world.set_joint_command('lift', position=0.1)
    world.step(2000)
    held = at(world, 'cube')
    # The cube is as far below the palm as it was: 0.12 m, but for the way in which the fingers
    # first take hold of it.
    assert at(world, 'palm')[2] - held[2] == pytest.approx(0.12, abs=1e-3)
    assert held[2] > 0.11
    forces = world.contacts()
    np.testing.assert_allclose(forces['normal_force'].sum(), 2 * 10.0, rtol=1e-9)
    world.step(either(10_000, 60_000))      # at length, for a minute
    # Points give way by 1e-10 of their rates in a step, 6e4 times: some nanometres.
    np.testing.assert_allclose(at(world, 'cube'), held, atol=1e-7)
    world.set_joint_command('finger', effort=20.0)
    world.step(1000)
    assert at(world, 'cube')[2] == pytest.approx(0.02, abs=1e-6)


def test_the_rover_rolls_as_its_wheels_turn_and_turns_where_they_turn_against_each_other():
    world = load_scene('rover')
    wheels = world.joint_names
    for name in wheels:
        world.set_joint_command(name, velocity=5.0)
    world.step(2000)
    chassis = world.names.index('chassis')
    # 5 rad/s at 0.1 m: nothing slips, and nothing holds it back.
    np.testing.assert_allclose(world.linear_velocity[chassis], [0.5, 0.0, 0.0], atol=1e-6)
    for name in wheels:
        world.set_joint_command(name, velocity=5.0 if 'right' in name else -5.0)
    world.step(2000)
    assert world.angular_velocity[chassis, 2] > 0.5
    assert np.abs(world.angular_velocity[chassis, :2]).max() < 1e-2
