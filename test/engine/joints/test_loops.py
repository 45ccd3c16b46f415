# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loops and couplings."""

from engine.jointed import (
    body, COUPLER, energy, four_bar, four_bar_motion, joint, point_of, ROCKER, rod, wheels, world)
from engine.jointed_trees import gaps
import numpy as np
import pytest

from rigid_sim_ros import World

CLOSED = 1e-12


def test_a_four_bar_linkage_turns_as_lagrange_has_it():
    times = np.round(np.arange(0.0, 5.001, 0.05), 6)
    truth, world = four_bar_motion(times), four_bar()
    before, error, off = energy(world), 0.0, 0.0
    for crank in truth[1:]:
        world.step(50)
        error = max(error, abs(world.joint_position[0] - crank))
        off = max(off, abs(energy(world) - before))
    assert error < 2e-4
    # Of the largest kinetic energy, 1.16 J.
    assert off < 2e-5 * 1.16


@pytest.mark.parametrize('closing', ['revolute', 'spherical', 'universal'])
def test_a_loop_stays_closed_in_every_step(closing):
    # A revolute joint and two others say three times that the loop is in its plane.
    world = four_bar(closing=closing)
    for _ in range(500):
        world.step()
        gap = point_of(world, 'coupler', (0, 0, -COUPLER)) - point_of(world, 'rocker', (
            0, 0, -ROCKER))
        assert np.abs(gap).max() < CLOSED


def test_joints_of_all_types_close_the_same_loop():
    # All of these leave the only motion that the other joints of the linkage leave.
    found = []
    for closing in ('revolute', 'spherical', 'planar'):
        world = four_bar(closing=closing)
        world.step(400)
        found.append(world.joint_position[:3])
        if closing == 'planar':
            # It holds only the plane: the linkage falls apart, and moves otherwise.
            assert np.abs(found[-1] - found[0]).max() > 0.1
        else:
            np.testing.assert_allclose(found[-1], found[0], rtol=0, atol=1e-9)


def test_a_rod_without_mass_is_a_distance():
    # A mass point at 2 m from a point of the world swings like a pendulum of that length.
    ball = world([body('ball', 1.0, inertia=(1e-4,) * 3 + (0,) * 3, position=(2, 0, 0))],
                 [joint('rod', 'world', 'ball', 'distance', child_pose={'position': [0, 0, 0]})])
    bar = world([body('bar', 1.0, (2, 0, 0), (1e-4,) * 3 + (0,) * 3)],
                [joint('pin', 'world', 'bar')])
    for _ in range(1000):
        ball.step()
        assert abs(np.linalg.norm(ball.position[0]) - 2.0) < CLOSED
    bar.step(1000)
    # The bar turns about its own centre as well, with 1e-4 of 4 kg m^2: half of that in the
    # angular acceleration, and some 1 m of way.
    np.testing.assert_allclose(ball.position[0], point_of(bar, 'bar', (2, 0, 0)), atol=1e-4)
    assert ball.joint_position[0] == pytest.approx(2.0, abs=CLOSED)


@pytest.mark.parametrize('h', [1e-3, 4e-3])
def test_a_gear_is_felt_both_ways(h):
    world = wheels(h)
    for _ in range(round(2.0 / h)):
        world.step()
        first, second = world.joint_position
        assert abs(second + 2.0 * first) < 1e-12 * max(1.0, abs(second))
    # I_0 + 2^2 I_1: the driven wheel turns the other one, which holds it back.
    acceleration = 1.0 / (0.01 + 4.0 * 0.02)
    assert world.joint_velocity[0] == pytest.approx(2.0 * acceleration, rel=1e-12)
    # Constant forces: half before and half behind each drift is exact.
    assert world.joint_position[0] == pytest.approx(2.0 * acceleration, rel=1e-12)


def test_a_coupling_begins_at_its_offset():
    world = wheels(offset=0.5)
    assert world.joint_position[1] == pytest.approx(0.5, abs=1e-12)
    world.step(100)
    first, second = world.joint_position
    assert second + 2.0 * first == pytest.approx(0.5, abs=1e-12)


def test_a_loop_hangs_on_the_forces_of_its_joints():
    # A beam on two posts that stand on hinges, closed by a fixed joint: each bears a half.
    bodies = [body('left', 1.0, (0, 0, 0.5), rod(1, 1, 0.02)),
              body('right', 1.0, (0, 0, 0.5), rod(1, 1, 0.02), (2, 0, 0)),
              body('beam', 2.0, (1, 0, 0), (0.01, 0.7, 0.7, 0, 0, 0), (0, 0, 1))]
    joints = [joint('foot_left', 'world', 'left'),
              joint('foot_right', 'world', 'right', position=(2, 0, 0)),
              joint('on_left', 'left', 'beam', 'fixed', (0, 0, 1)),
              joint('on_right', 'beam', 'right', 'fixed', (2, 0, 0))]
    frame = world(bodies, joints)
    frame.step(10)
    for name in ('foot_left', 'foot_right'):
        assert frame.joint_wrench(name)[2] == pytest.approx(2.0 * 9.81, rel=1e-9)
    assert frame.joint_wrench('on_left')[2] == pytest.approx(9.81, rel=1e-9)
    assert frame.joint_wrench('on_right')[2] == pytest.approx(-9.81, rel=1e-9)
    assert np.abs(frame.linear_velocity).max() < 1e-12


def test_hinges_of_a_loop_bear_no_torque_where_another_meets_its_limit():
    # In the step in which the driven hinge meets its limit, 0.14 s after the start, what acts
    # along its axis is found in several rounds, of which only the last one counts.
    bodies = [body('left', 1.0, (0, 0, 0.5), rod(1, 1, 0.02)),
              body('right', 1.0, (0, 0, 0.5), rod(1, 1, 0.02), (2, 0, 0)),
              body('beam', 2.0, (1, 0, 0), (0.01, 0.7, 0.7, 0, 0, 0), (0, 0, 1))]
    joints = [joint('driven', 'world', 'left', friction=2.0, limits={'upper': 0.3},
                    drive={'mode': 'position', 'stiffness': 200, 'damping': 5, 'position': 0.5}),
              joint('foot', 'world', 'right', position=(2, 0, 0)),
              joint('on_left', 'left', 'beam', position=(0, 0, 1)),
              joint('on_right', 'beam', 'right', position=(2, 0, 0))]
    linkage = world(bodies, joints)
    for _ in range(200):
        linkage.step()
        for name in ('foot', 'on_left', 'on_right'):
            # The torques of the others are up to 10 N m.
            assert linkage.joint_wrench(name)[4] == pytest.approx(0.0, abs=1e-9)
    assert linkage.joint_position[0] == pytest.approx(0.3, abs=1e-9)


@pytest.mark.parametrize('kind', ['prismatic', 'universal'])
def test_a_loop_that_asks_the_same_twice_holds_at_any_spin(kind):
    """Which row of the loop counts as the one that depends changes from step to step."""
    turning = {'linear': [1.0, 0.5, 0.0], 'angular': [200.0, 140.0, 60.0]}
    two = world([body('a', inertia=(0.1, 0.2, 0.3, 0, 0, 0), twist=turning),
                 body('b', position=(0.5, 0.2, 0.3))],
                [joint('first', 'a', 'b', kind, axis=(1.0, 0.3, 0.0)),
                 joint('second', 'a', 'b', 'spherical', position=(0.1, 0.2, 0.1))],
                gravity=(0.0, 0.0, 0.0))
    before, P = two.kinetic_energy(), two.total_momentum()
    for _ in range(500):
        two.step()
        assert gaps(two) < 1e-12
    # The two are one body; a step turns it by 0.25 rad, and energies swing by that squared / 12.
    assert abs(two.kinetic_energy() / before - 1.0) < 0.25 ** 2 / 12
    assert np.abs(two.total_momentum() - P).max() < 1e-10
    assert two.contact_report().message == ''


@pytest.mark.parametrize('friction', [0.5, 5.0, 50.0])
@pytest.mark.parametrize('multiplier', [1.8, -0.4])
def test_a_joint_that_sticks_holds_another_that_mimics_it(friction, multiplier):
    """Bodies tumble in free space; friction slows the first joint, until it sticks or not."""
    box = {'type': 'box', 'size': [0.2, 0.3, 0.4]}
    three = World.from_dict({
        'world': {'step': 0.002, 'contact': 'none', 'gravity': [0.0, 0.0, 0.0]},
        'bodies': [{'name': f'body{i}', 'mass': mass, 'shape': box,
                    'pose': {'position': [0.6 * i, 0.1 * i, -0.2 * i]},
                    'twist': {'angular': [3.0 - 2.0 * i, 1.0 + 2.0 * i, -2.0]}}
                   for i, mass in enumerate((1.0, 0.3, 2.0))],
        'joints': [{'name': 'one', 'type': 'revolute', 'parent': 'body0', 'child': 'body1',
                    'axis': [0.3, 0.5, 1.0], 'friction': friction},
                   {'name': 'other', 'type': 'continuous', 'parent': 'body1', 'child': 'body2',
                    'axis': [1.0, -0.4, 0.2],
                    'mimic': {'joint': 'one', 'multiplier': multiplier}}]})
    energy = three.kinetic_energy()
    for _ in range(60):
        three.step(20)
        # Of second order: (h w)^2 / 24 of it with 5 rad/s is 4e-6, here and back.
        assert three.kinetic_energy() < energy * (1.0 + 1e-4)
        energy = three.kinetic_energy()
        one, other = three.joint_position
        assert abs(other - multiplier * one) < 1e-12
    assert three.contact_report().message == ''


SPINS = {'linear': [1.0, -0.5, 0.3], 'angular': [2.0, 3.0, -4.0]}
LIMITS = {'lower': 0.0, 'upper': 0.5, 'restitution': 0.5}


def ring(count, *joints):
    """Return bodies in a ring on hinges along n, with more at each joint; it flies and tumbles."""
    n = np.array([0.3, -0.8, 0.5])
    bodies, hinges = [], []
    for i in range(count):
        a = 2.0 * np.pi * i / count
        # At right angles to n.
        place = 0.3 * np.cos(a) * np.cross(n, [1, 0, 0]) + 0.3 * np.sin(a) * np.cross(n, [0, 0, 1])
        bodies.append(body(f'body{i}', 1.0 + i, inertia=(0.01, 0.02, 0.025, 0, 0, 0),
                           position=place.tolist(), twist=SPINS))
        ends = (f'body{i}', f'body{(i + 1) % count}')
        hinges.append(joint(f'joint{i}', *ends, position=(0.05, 0.1 * i, 0.02), axis=n)
                      | (joints[i] if i < len(joints) else {}))
    return world(bodies, hinges, 4e-3, (0.0, 0.0, 0.0))


def assert_moves_as_one_body(frame, steps=400):
    """Step a frame that cannot move in itself: it keeps its energy, and its joints."""
    before, rest = frame.kinetic_energy(), frame.joint_position
    for _ in range(steps):
        frame.step()
        assert gaps(frame) < CLOSED
        # An axis that is locked where the frame holds it already yields to this.
        assert np.abs(frame.joint_position - rest).max() < 1e-9
    # A step turns it by h w = 0.02 rad, and energies swing by that squared / 12.
    assert abs(frame.kinetic_energy() / before - 1.0) < 0.02 ** 2 / 12
    assert frame.contact_report().message == ''


def test_a_frame_needs_no_axis_that_is_locked():
    """Limits lock axes that a triangle of hinges holds anyway."""
    assert_moves_as_one_body(ring(3, {'limits': LIMITS}, {'limits': LIMITS}))


@pytest.mark.parametrize(('first', 'second'), [({'friction': 0.05}, {}), ({}, {'limits': LIMITS})])
def test_a_linkage_that_a_coupling_makes_a_frame_needs_no_axis_that_is_locked(first, second):
    """Four hinges leave one motion, which the coupling takes."""
    assert_moves_as_one_body(ring(4, first, second | {
        'mimic': {'joint': 'joint0', 'multiplier': -1.04}}))


def test_a_frame_of_joints_that_say_the_same_in_other_words():
    """A hinge, a universal and a ball joint at three bodies, one of them at its limit."""
    bodies = [body(f'body{i}', 6.0, inertia=(0.02, 0.03, 0.04, 0, 0, 0), position=at, twist=SPINS)
              for i, at in enumerate(((0, 0, 0), (0.3, 0.1, 0), (0.1, 0.3, 0.2)))]
    assert_moves_as_one_body(world(bodies, [
        joint('a', 'body0', 'body1', position=(0.1, 0.1, 0.0), axis=(1.0, 0.2, 0.3)),
        joint('b', 'body1', 'body2', axis=(0.1, 1.0, -0.4), limits=LIMITS),
        joint('c', 'body2', 'body0', 'universal', axis=(0.3, -0.2, 1.0)),
        joint('d', 'body2', 'body1', 'spherical', (0.1, 0.0, 0.1))], 2e-3, (0.0, 0.0, 0.0)), 800)
