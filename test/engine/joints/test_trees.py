# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Trees of joints against the same motion in minimal coordinates, at steps of 1 ms.

The method is of second order, so the bounds are what it leaves there; four times the step has 16
times the error.
"""

from functools import cache
import math

from engine.jointed import (
    body, chain_tips, double_pendulum_tips, energy, G, hanging, joint, panda, PANDA_TIP,
    panda_tips, pendulum_tips, point_of, rod, world)
from engine.jointed_trees import gaps
from inside import joints_of
import numpy as np
import pytest
from scipy.integrate import solve_ivp

# Rounding of some 1e-15 a metre, and the 1e-13 to which joints are closed.
CLOSED = 1e-12


def times(end, every=0.02):
    return np.round(np.arange(0.0, end + 1e-9, every), 6)


def largest_error(world, truth, tip, every=0.02):
    """Return the largest error of the tip at the times of the truth, and of the energy."""
    steps = round(every / (world.step_ns * 1e-9))
    error, off, before = 0.0, 0.0, energy(world)
    for point in truth[1:]:
        world.step(steps)
        error = max(error, float(np.linalg.norm(tip(world) - point)))
        off = max(off, abs(energy(world) - before))
    return error, off


def test_a_pendulum_keeps_time_and_energy_for_a_minute():
    error, off = largest_error(hanging(1), pendulum_tips(times(60.0)),
                               lambda world: point_of(world, 'link0', (0, 0, -1)))
    assert error < 6e-4
    # Of the largest kinetic energy, m g l / 2.
    assert off < 1e-5 * G / 2


def test_a_pendulum_errs_16_times_as_much_at_four_times_the_step():
    truth = pendulum_tips(times(2.0))
    fine, coarse = (largest_error(hanging(1, h=h), truth,
                                  lambda world: point_of(world, 'link0', (0, 0, -1)))[0]
                    for h in (1e-3, 4e-3))
    # Terms of the fourth order are 1e-4 of those of the second at most here.
    assert coarse / fine == pytest.approx(16.0, rel=1e-2)


def double_pendulum(h):
    return largest_error(hanging(2, h=h), double_pendulum_tips(times(2.0)),
                         lambda world: point_of(world, 'link1', (0, 0, -1)))


def test_a_double_pendulum_is_where_lagrange_has_it():
    error, _ = double_pendulum(1e-3)
    assert error < 6e-5


def test_a_released_panda_is_where_its_mass_matrix_has_it():
    error, _ = largest_error(panda(), panda_tips(times(0.5)),
                             lambda world: point_of(world, 'link6', PANDA_TIP))
    assert error < 1e-4


@cache
def chain_truth():
    """Return where the tip of the chain below is in 2 s."""
    return chain_tips(times(2.0))


def chain(h):
    """Return the largest error of the tip of 50 rods of 0.1 kg with 10 kg at their end."""
    return largest_error(hanging(50, 0.1, 0.1, 0.01, end=10.0, h=h), chain_truth(),
                         lambda world: point_of(world, 'link49', (0, 0, -0.1)))


def test_a_chain_carries_a_hundred_times_its_links():
    error, off = chain(1e-3)
    # At the end 1.8e-5 m, 2.3e-5 m as the weight passes below.
    assert error < 2.5e-5
    # Of 10 kg and half of 5 kg that fall from 0 to 5 m: 613 J.
    assert off < 4e-6 * 613


def test_a_chain_stands_at_a_step_that_does_not_resolve_its_whip():
    error, _ = chain(4e-3)
    # 16 times that of 1 ms, less where a step was taken in halves.
    assert error < 16 * 2.5e-5


@pytest.mark.parametrize('make', [lambda: hanging(3), panda, lambda: hanging(
    20, 0.1, 0.1, 0.01, end=10.0)], ids=['pendulum', 'panda', 'chain'])
def test_anchors_stay_together_in_every_step(make):
    world = make()
    spec = world.scene.spec
    for _ in range(300):
        world.step()
        for held in spec.joints:
            here = point_of(world, held.child)
            there = np.array(held.pose.position)
            if held.parent != 'world':
                there = point_of(world, held.parent, held.pose.position)
            assert np.abs(here - there).max() < CLOSED


def test_forces_that_depend_on_velocities_are_of_second_order_too():
    # A pendulum in air that resists its centre of mass with c v, to an accuracy of 1e-12.
    inertia, drag = 1 / 3 + 0.02 ** 2 / 4, 0.8

    def rates(t, y):
        return [y[1], (-0.5 * G * math.sin(y[0]) - drag * 0.25 * y[1]) / inertia]

    end = solve_ivp(rates, (0, 1), [1.2, 0.0], method='DOP853', rtol=1e-12, atol=1e-13).y[0, -1]
    off = []
    for h in (2e-3, 1e-3):
        one = world([body('bar', 1.0, (0, 0, -0.5), rod(1, 1, 0.02))],
                    [joint('pin', 'world', 'bar') | {'position': 1.2}], h,
                    forces=[{'type': 'wind', 'drag': drag}])
        one.step(round(1.0 / h))
        off.append(one.joint_position[0] - end)
    assert abs(off[1]) < 1e-5
    assert off[0] / off[1] == pytest.approx(4.0, rel=2e-2)


def test_turns_are_counted():
    world = hanging(1, angle=0.0, velocity=10.0)
    world.step(3000)
    # Enough energy to go over the top, w^2 > 4 g / L: it goes round.
    assert world.joint_position[0] > 4 * math.pi
    before = world.joint_position[0]
    world.step(1)
    assert world.joint_position[0] - before == pytest.approx(
        1e-3 * world.joint_velocity[0], rel=1e-2)


def falling_chain(far):
    """Return a world of three rods that fall from horizontal, so many metres from the origin."""
    bodies = [body(f'link{i}', 1.0, (0, 0, -0.5), rod(1.0, 1.0, 0.02), (far, 0, -i))
              for i in range(3)]
    limits = {'lower': -9.0, 'upper': 0.0}
    joints = [joint(f'joint{i}', f'link{i - 1}' if i else 'world', f'link{i}',
                    position=(0, 0, -1) if i else (far, 0, 0), limits=limits) for i in range(3)]
    return world(bodies, [joints[0] | {'axis': [0, -1, 0], 'position': -math.pi / 2}, *joints[1:]])


def test_far_from_the_origin_joints_close_as_well_as_positions_are_written():
    near, far = falling_chain(0.0), falling_chain(1e5)
    # Positions are rounded to 2^-53 of 1e5 m, a joint is a difference of two, and is closed to
    # four times that: 9e-11 m.
    for _ in range(300):
        near.step()
        far.step()
        assert gaps(far) <= 1e-10
        # It takes as little time: what cannot be closed better is no motion that a step is too
        # long for.
        assert joints_of(far).motion.parts[0] == 1
    # In a step of 1 ms, so open a joint gives 1e-7 m/s; all of one sign, in 300 of them, 5e-6 m.
    np.testing.assert_allclose(far.position - (1e5, 0, 0), near.position, atol=5e-6)


def test_an_articulation_moves_bit_for_bit_as_if_others_were_not_there():
    """Whatever these need: the one beside it is 30 times as fast, and closes in more rounds."""
    def pendulum(name, y, speed):
        bodies = [body(f'{name}{i}', 1.0, (0, 0, -0.5), rod(1.0, 1.0, 0.02), (0, y, -i))
                  for i in range(2)]
        joints = [joint(f'{name}_top', 'world', f'{name}0', position=(0, y, 0)) | {
                      'position': 1.0, 'velocity': speed},
                  joint(f'{name}_knee', f'{name}0', f'{name}1', position=(0, 0, -1))]
        return bodies, joints

    slow, fast = pendulum('slow', 0.0, 0.5), pendulum('fast', 3.0, 15.0)
    alone, beside = world(*slow), world(slow[0] + fast[0], slow[1] + fast[1])
    for one in (alone, beside):
        one.step(200)
    np.testing.assert_array_equal(beside.position[:2], alone.position)
    np.testing.assert_array_equal(beside.orientation[:2], alone.orientation)
    np.testing.assert_array_equal(beside.joint_velocity[:2], alone.joint_velocity)


def test_a_thin_rod_on_an_axle_along_it_turns_by_more_than_a_radian_a_step():
    axle = world([body('rod', 1.0, (0, 0, 0), rod(1.0, 1.0, 0.01), (0, 0, 0))],
                 [joint('axle', 'world', 'rod', axis=(0, 0, 1)) | {'velocity': 1500.0}])
    axle.step(100)
    # The rounding of 100 steps, a few 1e-16 of 150 rad in each.
    assert axle.joint_position[0] == pytest.approx(150.0, abs=1e-11)
