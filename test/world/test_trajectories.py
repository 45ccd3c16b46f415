# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trajectories: the curves between points, and joints that drives lead along them."""
import math

import numpy as np
from numpy.polynomial import Polynomial
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.world.snapshot import pack, unpack
from rigid_sim_ros.world.trajectories import pieces, Waypoints

STEP = 0.001
STIFFNESS, DAMPING = 4000.0, 120.0
DRIVE = {'mode': 'position', 'stiffness': STIFFNESS, 'damping': DAMPING}
# Of a box of 1 kg and 0.1 x 0.1 x 0.5 m about an end of its long axis.
INERTIA = (0.1 ** 2 + 0.5 ** 2) / 12.0 + 0.25 ** 2


def link(name, x):
    return {'name': name, 'mass': 1.0, 'shape': {'type': 'box', 'size': [0.1, 0.1, 0.5]},
            'pose': {'position': [x, 0.0, -0.25]}}


def joint(name, child, x, kind='revolute', **more):
    return {'name': name, 'type': kind, 'parent': 'world', 'child': child, 'axis': [0, 1, 0],
            'pose': {'position': [x, 0, 0]}, 'drive': DRIVE, **more}


SCENE = {
    'format': 1, 'world': {'contact': 'none', 'gravity': [0, 0, 0], 'step': STEP},
    'bodies': [link('one', 0.0), link('two', 1.0), link('three', 2.0), link('four', 3.0)],
    'joints': [
        joint('arm/a', 'one', 0.0, limits={'lower': -2.0, 'upper': 2.0, 'velocity': 20.0}),
        joint('arm/b', 'two', 1.0, 'continuous'), joint('leg/c', 'three', 2.0),
        joint('free', 'four', 3.0, drive={'mode': 'velocity', 'gain': 5.0})]}


@pytest.fixture
def world():
    return World.from_dict(SCENE)


def curve(begin, end, T):
    """Return the piece between two points as a polynomial; a point is (p, v, a) or a part."""
    rows = [[*point, *[math.nan] * (3 - len(point))] for point in (begin, end)]
    points = Waypoints(['x'], [0.0, T], *([[row[k]] for row in rows] for k in range(3)))
    begins, found = pieces(points, 0, 0, 0, 0.0, 0.0, 0.0)
    assert begins == [0, round(T * 1e9)]
    return Polynomial(found[0])


@pytest.mark.parametrize('begin, end, order', [
    ((0.5,), (-1.0,), 1), ((0.5, 1.0), (-1.0,), 1), ((0.5, 1.0), (-1.0, -2.0), 3),
    ((0.5, 1.0, 3.0), (-1.0, -2.0), 3), ((0.5, 1.0, 3.0), (-1.0, -2.0, -4.0), 5)])
def test_a_curve_has_what_both_points_have_and_no_higher_order(begin, end, order):
    T = 0.7
    found = curve(begin, end, T)
    assert found.trim().degree() == order
    for k in range((order + 1) // 2):
        rate = found.deriv(k)
        assert rate(0.0) == pytest.approx(begin[k], rel=1e-12)
        # Terms of size c T^5 ~ 10 are added up: rounding of 1e-15 each.
        assert rate(T) == pytest.approx(end[k], abs=1e-12)


def test_a_joint_is_led_along_a_curve_of_the_fifth_order(world):
    world.follow_trajectory(['arm/a'], [1.0], [[1.0]], [[0.0]], [[0.0]])
    want = curve((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0)
    # The drive exerts I a where it lags by I a / k, at most 5.8 rad/s^2 for this curve. It does
    # so a step late at most, which is 1.9 rad/s * 1 ms beside it.
    lag = INERTIA * 5.8 / STIFFNESS + 1.9 * STEP
    for _ in range(1000):
        world.step()
        assert abs(world.joint_position[0] - want(world.time_ns * 1e-9)) < lag
    assert world.joint_position[0] == pytest.approx(1.0, abs=lag)


def test_it_begins_where_the_joint_is_and_with_its_velocity(world):
    world.set_joint_state('arm/a', 0.3, 2.0)
    world.follow_trajectory(['arm/a'], [0.5], [[0.8]], [[0.0]])
    want = curve((0.3, 2.0), (0.8, 0.0), 0.5)
    for _ in range(500):
        world.step()
        # As above, with accelerations up to 8 rad/s^2 that begin at once: the drive overshoots
        # by as much again.
        assert abs(world.joint_position[0] - want(world.time_ns * 1e-9)) < (
            2.0 * INERTIA * 8.0 / STIFFNESS + 2.0 * STEP)


def test_the_last_point_is_held_and_costs_nothing_more(world):
    world.follow_trajectory(['arm/a'], [0.05], [[0.2]])
    world.step(50)
    assert not len(unpack(world.save())[1]['path_joint'])
    world.step(2000)
    assert world.joint_position[0] == pytest.approx(0.2, abs=1e-9)     # damped within 0.1 s


def test_a_continuous_joint_goes_the_short_way(world):
    world.set_joint_state('arm/b', 6.2)
    world.follow_trajectory(['arm/b'], [0.5, 1.0], [[0.1], [0.4]])
    world.step(3000)
    assert world.joint_position[1] == pytest.approx(0.4 + 2.0 * math.pi, abs=1e-9)


def test_a_start_in_the_past_leaves_the_rest_of_a_trajectory(world):
    world.step(150)
    world.follow_trajectory(['arm/a'], [0.1, 0.2], [[0.0], [1.0]], start=0.0)
    world.step(1)
    arrays = unpack(world.save())[1]
    assert len(arrays['path_joint']) == 2       # the second half, and the end
    drive = arrays['joint_drive_position'][0]
    assert drive == pytest.approx(0.51, abs=1e-12)     # at 0.151 s


def test_a_trajectory_of_a_model_replaces_that_of_its_joints_and_no_other(world):
    world.follow_trajectory(['arm/a', 'arm/b', 'leg/c'], [1.0], [[1.0, 1.0, 1.0]])
    world.step(500)
    before = world.joint_position
    world.follow_trajectory(['arm/a'], [0.5], [[0.0]])
    world.step(2000)
    assert world.joint_position[0] == pytest.approx(0.0, abs=1e-9)
    # It stays at the goal of then, which it followed with a lag of less than this.
    assert world.joint_position[1] == pytest.approx(0.5, abs=1e-9)
    assert abs(before[1] - 0.5) < 0.05
    assert world.joint_position[2] == pytest.approx(1.0, abs=1e-9)


def test_a_command_ends_a_trajectory_of_its_joint(world):
    world.follow_trajectory(['arm/a', 'arm/b'], [1.0], [[1.0, 1.0]])
    world.set_joint_command('arm/a', position=-0.5)
    world.step(3000)
    assert world.joint_position[0] == pytest.approx(-0.5, abs=1e-9)
    assert world.joint_position[1] == pytest.approx(1.0, abs=1e-9)


def test_a_reset_ends_it(world):
    world.follow_trajectory(['arm/a'], [1.0], [[1.0]])
    world.step(300)
    world.reset()
    world.step(3000)
    assert world.joint_position[0] == 0.0


def test_a_world_goes_on_in_the_midst_of_it(world):
    world.follow_trajectory(['arm/b', 'arm/a'], [0.1, 0.3], [[1.0, 0.5], [0.0, 0.1]],
                            [[0.0, math.nan], [0.0, 0.0]])
    world.step(123)
    other = World.from_dict(SCENE)
    other.restore(world.save())
    for _ in range(300):
        world.step()
        other.step()
        assert world.state_hash() == other.state_hash()


def test_bits_do_not_depend_on_how_many_steps_are_taken_at_once(world):
    other = World.from_dict(SCENE)
    for one in (world, other):
        one.follow_trajectory(['arm/a', 'leg/c'], [0.1, 0.15], [[1.0, 0.3], [0.2, 0.1]])
    world.step(400)
    for _ in range(400):
        other.step()
    assert world.state_hash() == other.state_hash()


@pytest.mark.parametrize('given, message', [
    ((['nobody'], [1.0], [[0.0]]), "joint 'nobody' does not exist"),
    (([], [1.0], [[]]), 'at least one joint'),
    ((['arm/a', 'arm/a'], [1.0], [[0.0, 0.0]]), 'named twice'),
    ((['free'], [1.0], [[0.0]]), 'has no drive that leads it'),
    ((['arm/a'], [], []), '0 times, must be one for each'),
    ((['arm/a'], [-1.0], [[0.0]]), 'from 0 to'),
    ((['arm/a'], [1.0, 1.0], [[0.0], [0.0]]), 'must be later'),
    ((['arm/a'], [1.0], [[0.0, 1.0]]), '1 points of 1 joints'),
    ((['arm/a'], [1.0], [['far']]), 'must be numbers'),
    ((['arm/a'], [1.0], [[math.nan]]), 'must be finite'),
    ((['arm/a'], [1.0], [[2.1]]), 'within its limits -2 .. 2'),
    ((['arm/a'], [1.0, 2.0], [[0.1], [0.2]], [[21.0], [0.0]]), 'within its limit 20'),
    ((['arm/a'], [1.0], [[1.0]], [[0.5]]), 'in the last point, must be 0'),
    ((['arm/b'], [1.0], [[1e10]]), 'must be within 1e'),
    ((['arm/b'], [1.0, 2.0], [[0.0], [0.0]], [[0.0], [0.0]], [[1e12], [0.0]]), 'in a step'),
    ((['arm/a'], [1.0], [[0.0]], None, None, math.nan), 'a time of the simulation'),
    ((['arm/a'], [0.01], [[0.0]], None, None, 0.0), 'must end in the future')])
def test_what_makes_no_trajectory_is_refused_and_changes_nothing(world, given, message):
    world.step(20)
    before = world.save()
    with pytest.raises(ValueError, match=message):
        world.follow_trajectory(*given)
    assert world.save() == before


def test_commands_of_several_joints_are_all_taken_or_none(world):
    before = world.save()
    with pytest.raises(ValueError, match='stiffness'):
        world.set_joint_commands({'arm/a': {'position': 1.0},
                                  'free': {'mode': 'position', 'position': 1.0}})
    assert world.save() == before


@pytest.mark.parametrize('change', [
    {'path_joint': np.array([3, 3])},       # without a drive that leads it to a position ...
    {'path_joint': np.array([4, 4])},       # ... and without being there
    {'path_begin': np.array([10, 5])}, {'path_begin': np.array([5, 5])},
    {'path_coefficient': np.full((2, 6), math.inf)}])
def test_a_snapshot_with_a_trajectory_that_cannot_be_is_refused(world, change):
    world.follow_trajectory(['arm/a'], [0.5], [[0.3]])
    meta, arrays = unpack(world.save())
    changed = pack(meta, {**arrays, **change})
    before = world.save()
    with pytest.raises(ValueError, match='snapshot'):
        world.restore(changed)
    assert world.save() == before


def test_a_trajectory_for_years_is_refused():
    world = World.from_dict(SCENE)
    with pytest.raises(ValueError, match='times'):
        world.follow_trajectory(['arm/a'], [2e9], [[0.1]])
