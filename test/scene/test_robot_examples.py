# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The example scenes of robots that touch things do what their comments say."""

import math

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


# Of the car: from the front axle to the rear one, between the wheels of one, their radius, and how
# far the rear axle is behind the middle of the chassis [m].
WHEELBASE, TRACK, RADIUS, BEHIND = 0.3302, 0.265, 0.05, 0.17145


def drive_car(world, v, curvature):
    """Tell a car to go with v [m/s] about the point where all its axles meet, at 1 / curvature."""
    for end, ahead in (('front', WHEELBASE), ('rear', 0.0)):
        for side, left in (('left', 0.5 * TRACK), ('right', -0.5 * TRACK)):
            along, across = 1.0 - curvature * left, curvature * ahead
            world.set_joint_command(f'{end}_{side}_wheel',
                                    velocity=v * math.hypot(along, across) / RADIUS)
            if ahead:
                world.set_joint_command(f'{end}_{side}_steering',
                                        position=math.atan2(across, along))


def rear_axle(world):
    """Return where the middle of the rear axle of the car is [m], from above."""
    x, y, z, w = world.orientation[world.names.index('chassis')]
    ahead = np.array([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)])
    return at(world, 'chassis')[:2] - BEHIND * ahead


def test_the_car_goes_straight_over_the_kerb():
    world = load_scene('car')
    chassis, height = world.names.index('chassis'), at(world, 'chassis')[2]
    # The springs are written so that each carries a quarter of the chassis, whose middle is 6 mm
    # ahead of that of the axles: those give way by 12 / 330 of 15.5 mm more or less, 0.6 mm.
    world.step(1000)
    assert at(world, 'chassis')[2] == pytest.approx(height, abs=6e-4)
    drive_car(world, 1.0, 0.0)
    world.step(1500)
    # 4 wheels with 0.3 N m need 0.16 s for 1 m/s, and from 6 rad/s to it the gain is what is left:
    # 3.74 kg (0.05 m)^2 / (4 0.05 N m s) = 47 ms.
    assert world.linear_velocity[chassis] == pytest.approx([1.0, 0.0, 0.0], abs=1e-4)
    heights = []
    for _ in range(150):
        world.step(10)
        heights.append(at(world, 'chassis')[2])
    # It was on the kerb, 12 mm high, and has left it; both sides did the same.
    assert max(heights) - height == pytest.approx(0.012, abs=0.006)
    assert at(world, 'chassis')[0] > 2.3 + BEHIND
    world.step(500)
    assert world.linear_velocity[chassis] == pytest.approx([1.0, 0.0, 0.0], abs=5e-3)
    assert at(world, 'chassis')[1] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize('curvature', [1.0, -0.7])
def test_the_car_turns_about_where_its_axles_meet(curvature):
    world = load_scene('car')
    drive_car(world, 0.7, curvature)
    world.step(1000)
    places = []
    for _ in range(50):
        world.step(40)
        places.append(rear_axle(world))
    places = np.array(places)
    # |p|^2 = 2 c p + r^2 - |c|^2 is linear in what is sought.
    rows = np.hstack([2.0 * places, np.ones((len(places), 1))])
    (x, y, rest), *_ = np.linalg.lstsq(rows, (places ** 2).sum(axis=1), rcond=None)
    # It leans by 0.01 rad, and its wheels with it: they touch the ground 0.01 times
    # (0.05 - 0.0225^2 / 0.05) m, 0.4 mm, beside where they would upright; of 1 to 1.4 m.
    assert math.sqrt(rest + x * x + y * y) * abs(curvature) == pytest.approx(1.0, abs=1e-3)
    rate = world.angular_velocity[world.names.index('chassis'), 2]
    assert rate == pytest.approx(0.7 * curvature, rel=1e-3)


def test_the_car_stops_and_stays():
    world = load_scene('car')
    drive_car(world, 0.7, 0.8)
    world.step(1000)
    drive_car(world, 0.0, 0.8)
    # It nods on its springs, which die out with 0.4 2 pi 4 Hz = 10 /s: e^-20 is 2e-9.
    world.step(2000)
    before = world.position
    world.step(1000)
    # Friction keeps a little of its lean, and drives that hold a velocity of 0 are dampers: a
    # force F moves it by F (0.05 m)^2 / (4 0.05 N m s) a second, 1.3 um where that is 1e-4 N.
    assert np.abs(world.position - before).max() < 1.3e-6
