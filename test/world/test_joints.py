# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a world tells of its joints and takes for them."""

import math

from engine.jointed import body, four_bar, hanging, joint, panda, rod, world
from engine.jointed_trees import gaps
import numpy as np
import pytest

from rigid_sim_ros import load_scene, World

DRIVEN = {'drive': {'mode': 'position', 'stiffness': 50.0, 'damping': 5.0, 'gain': 3.0},
          'friction': 0.02, 'damping': 0.1, 'limits': {'lower': -2.0, 'upper': 2.0, 'effort': 9.0}}


def test_joints_have_names_positions_velocities_and_efforts():
    one = hanging(2, angle=0.5, velocity=1.0)
    assert one.joint_names == ['joint0', 'joint1']
    np.testing.assert_allclose(one.joint_position, [0.5, 0.0], atol=1e-15)
    np.testing.assert_allclose(one.joint_velocity, [1.0, 1.0], atol=1e-14)
    np.testing.assert_array_equal(one.joint_effort, [0.0, 0.0])


def test_a_world_without_joints_has_none():
    one = World.from_dict({'world': {'contact': 'none'}, 'bodies': [body('ball')]})
    assert one.joint_names == []
    assert one.joint_position.shape == one.joint_velocity.shape == one.joint_effort.shape == (0,)
    with pytest.raises(ValueError, match=r"joint 'knee' does not exist, must be one of: none"):
        one.joint_wrench('knee')


@pytest.mark.parametrize('make', [
    lambda: hanging(3), lambda: hanging(2, **DRIVEN), four_bar, panda], ids=[
        'free', 'driven', 'loop', 'panda'])
def test_a_world_goes_on_bit_for_bit_from_what_it_saved(make):
    one, other = make(), make()
    one.step(150)
    saved, mark = one.save(), one.state_hash()
    one.step(100)
    end = one.state_hash()
    other.restore(saved)
    assert other.state_hash() == mark
    for count in (1, 36, 63):
        other.step(count)
    assert other.state_hash() == end != mark
    np.testing.assert_array_equal(other.joint_position, one.joint_position)
    np.testing.assert_array_equal(other.joint_wrench(one.joint_names[0]),
                                  one.joint_wrench(one.joint_names[0]))


def test_a_reset_goes_back_to_the_start():
    one = hanging(2, **DRIVEN)
    begin = one.state_hash()
    one.set_joint_command('joint0', position=1.0)
    one.step(100)
    one.reset()
    assert one.state_hash() == begin
    one.step(100)
    again = hanging(2, **DRIVEN)
    again.step(100)
    assert one.state_hash() == again.state_hash()


def test_a_damaged_snapshot_is_refused():
    one, other = hanging(2, **DRIVEN), hanging(3, **DRIVEN)
    with pytest.raises(ValueError, match='of another scene'):
        one.restore(other.save())


def test_a_joint_is_put_at_a_state_and_what_hangs_on_it_goes_along():
    one = hanging(2, angle=0.0)
    one.set_joint_state('joint0', 0.5, 2.0)
    np.testing.assert_allclose(one.joint_position, [0.5, 0.0], atol=1e-15)
    np.testing.assert_allclose(one.joint_velocity, [2.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(one.position[1], [-math.sin(0.5), 0, -math.cos(0.5)], atol=1e-15)
    # 2 rad/s about y at 1 m below.
    np.testing.assert_allclose(one.linear_velocity[1], np.cross(
        [0, 2.0, 0], one.position[1]), atol=1e-14)


def test_joints_that_are_put_at_once_are_where_one_after_the_other_puts_them():
    one, other = hanging(3, angle=0.1), hanging(3, angle=0.1)
    one.set_joint_states({'joint0': {'position': 0.5, 'velocity': 2.0},
                          'joint2': {'position': -0.3}})
    other.set_joint_state('joint0', 0.5, 2.0)
    other.set_joint_state('joint2', -0.3)
    np.testing.assert_allclose(one.position, other.position, atol=1e-15)
    np.testing.assert_allclose(one.linear_velocity, other.linear_velocity, atol=1e-14)


def test_a_joint_in_a_loop_takes_the_others_along():
    one = four_bar()
    one.set_joint_state('a', -1.0, 0.5)
    assert one.joint_position[0] == pytest.approx(-1.0, abs=1e-12)
    assert one.joint_velocity[0] == pytest.approx(0.5, abs=1e-12)
    assert gaps(one) < 1e-12
    one.step(10)
    assert gaps(one) < 1e-12


def gripping(base, **of_finger):
    """Return a world with an arm of two joints, on a base, whose fingers are coupled."""
    bodies = [body('base', 5.0, position=(0.2, 0.1, 0.3), **base), body('upper', 2.0),
              body('lower', 1.0, position=(0.0, 0.0, 1.0)),
              *(body(name, 0.2, position=(0.0, 0.0, 2.0)) for name in ('left', 'right'))]
    right = {'mimic': {'joint': 'left', 'multiplier': -1.0}}
    return world(bodies, [
        joint('shoulder', 'base', 'upper', 'spherical', child_pose={}, brings_child=True),
        joint('elbow', 'upper', 'lower', position=(0, 0, 1)),
        *(joint(name, 'lower', name, 'prismatic', (0, 0, 1)) | more
          for name, more in (('left', of_finger), ('right', right)))])


@pytest.mark.parametrize('base', [{}, {'fixed': True}], ids=['floating', 'fixed'])
def test_only_joints_that_are_coupled_follow_one_that_is_put_somewhere(base):
    one = gripping(base)
    one.set_joint_state('elbow', 0.7, 0.3)
    shoulder = one.joint_coordinates('shoulder')
    place, twist = one.position[0].copy(), one.linear_velocity[0].copy()
    one.set_joint_state('left', 0.05, 0.02)
    np.testing.assert_allclose(one.joint_position[1:], [0.7, 0.05, -0.05], atol=1e-15)
    # To the rounding of the momenta of a few kg and m/s.
    np.testing.assert_allclose(one.joint_velocity[1:], [0.3, 0.02, -0.02], atol=1e-14)
    np.testing.assert_allclose(one.joint_coordinates('shoulder'), shoulder, atol=1e-15)
    np.testing.assert_array_equal(one.position[0], place)
    np.testing.assert_allclose(one.linear_velocity[0], twist, atol=1e-15)


def test_only_joints_that_are_coupled_follow_one_that_begins_somewhere():
    one = gripping({}, position=0.05, velocity=0.02)
    np.testing.assert_allclose(one.joint_position[1:], [0.0, 0.05, -0.05], atol=1e-15)
    np.testing.assert_allclose(one.joint_velocity[1:], [0.0, 0.02, -0.02], atol=1e-15)
    np.testing.assert_array_equal(one.position[0], [0.2, 0.1, 0.3])
    np.testing.assert_allclose(one.linear_velocity[0], 0.0, atol=1e-15)


@pytest.mark.parametrize('closing', ['revolute', 'spherical'])
def test_velocities_are_those_of_positions_in_a_loop_too(closing):
    one = four_bar(closing=closing)
    one.step(200)
    for _ in range(20):
        before = one.joint_position
        one.step()
        middle = one.joint_velocity
        one.step()
        # Central differences err by h^2 / 6 of the third derivative, some 1e3 rad/s^3.
        np.testing.assert_allclose((one.joint_position - before) / 2e-3, middle, atol=1e-3)
    assert abs(one.joint_velocity[:3]).min() > 0.1
    assert abs(one.joint_velocity[3]) > 0.1 or closing == 'spherical'


def test_a_slide_that_closes_a_loop_has_a_velocity_on_a_base_that_turns_too():
    """Two slides in a row, one of them on a table that turns, say the same, however they lie."""
    table = {'name': 'table', 'kinematic': True, 'twist': {'angular': [0.0, 0.0, 2.0]}}
    cart = body('cart', 1.0, (0, 0, 0), (0.1, 0.1, 0.1, 0, 0, 0), (1.0, 0.0, 0.0))
    slides = [joint(name, 'table', 'cart', 'prismatic', (1.0, y, 0), (1, 0, 0))
              for name, y in (('one', 0.0), ('other', 0.3))]
    one = world([table, cart], slides)
    one.step(300)
    # r'' = w^2 r, from 1 m at rest in the turning frame: r' = w sinh(w t), to (w h)^2 w t / 24.
    np.testing.assert_allclose(one.joint_velocity, 2 * math.sinh(0.6), rtol=1e-5)


def test_a_state_that_a_loop_cannot_reach_changes_nothing():
    # Where the rocker points away from the crank its tip is 1.8 m off: the others reach 1.3 m.
    one = four_bar()
    before = one.state_hash()
    with pytest.raises(ValueError, match=r"position -1.57 of joint 'c': its loop cannot close"):
        one.set_joint_state('c', -1.57)
    assert one.state_hash() == before


@pytest.mark.parametrize(('call', 'message'), [
    (lambda one: one.set_joint_state('knee', 1.0), "joint 'knee' does not exist, must be one of: "
     'joint0, joint1'),
    (lambda one: one.set_joint_state('joint0', math.nan), 'position nan, must be finite'),
    (lambda one: one.set_joint_state('joint0', 2.5),
     r"position 2.5 of joint 'joint0', must be within its limits -2 \.\. 2"),
    (lambda one: one.set_joint_states({'joint1': {'position': 0.1}, 'joint0': {'position': 2.5}}),
     r"position 2.5 of joint 'joint0', must be within its limits -2 \.\. 2"),
    (lambda one: one.set_joint_states({'joint1': {'velocity': 0.1}}), 'must be a mapping of'),
    (lambda one: one.set_joint_command('joint0', 'force'), "mode 'force', must be one of: effort, "
     'velocity, position'),
    (lambda one: one.set_joint_command('joint0', effort='much'), "effort 'much', must be a "
     'number'),
    (lambda one: one.set_joint_command('joint0', effort=1.0, duration=-1.0),
     'duration -1.0 s, must be finite and >= 0'),
    (lambda one: one.set_pose('link0', [0, 0, 0], [0, 0, 0, 1]),
     "body 'link0' is held to the world by joints: use set_joint_state"),
])
def test_a_wrong_call_says_what_is_wrong_and_changes_nothing(call, message):
    one = hanging(2, angle=0.5, **DRIVEN)
    before = one.state_hash()
    with pytest.raises(ValueError, match=message):
        call(one)
    assert one.state_hash() == before


def test_a_drive_that_the_scene_does_not_have_cannot_be_told_anything():
    with pytest.raises(ValueError, match="joint 'joint0' has no drive"):
        hanging(1).set_joint_command('joint0', effort=1.0)


def wheel(**more):
    return world([body('wheel', 1.0, inertia=(0.1,) * 3 + (0,) * 3)],
                 [joint('axle', 'world', 'wheel', **more)], gravity=(0, 0, 0))


def test_a_command_acts_for_its_duration():
    one = wheel(drive={'mode': 'effort'})
    one.set_joint_command('axle', effort=2.0, duration=0.25)
    one.step(1000)
    assert one.joint_velocity[0] == pytest.approx(2.0 * 0.25 / 0.1, rel=1e-12)


def test_a_command_changes_the_mode_of_a_drive():
    one = wheel(drive={'mode': 'effort', 'stiffness': 40.0, 'damping': 4.0, 'gain': 2.0})
    one.set_joint_command('axle', 'velocity', velocity=3.0)
    one.step(2000)
    assert one.joint_velocity[0] == pytest.approx(3.0, rel=1e-9)
    one.set_joint_command('axle', 'position', position=7.0)
    one.step(4000)
    assert one.joint_position[0] == pytest.approx(7.0, abs=1e-9)


def test_an_impulse_on_one_body_is_felt_by_all_that_hang_together():
    one = hanging(3, angle=0.0)
    one.apply_impulse('link2', [1.0, 0, 0], point=[0, 0, -1])
    assert np.abs(one.joint_velocity).min() > 0.1
    assert gaps(one) < 1e-12
    # What the joints then say of the velocities is what the bodies have.
    rates = one.joint_velocity
    np.testing.assert_allclose(np.cumsum(rates), one.angular_velocity[:, 1], atol=1e-12)


def test_a_wrench_on_a_body_and_the_wind_act_through_the_joints():
    # A bar on a hinge that a force of its tip holds up against its weight.
    one = world([body('bar', 2.0, (0.5, 0, 0), (1e-3, 0.2, 0.2, 0, 0, 0))],
                [joint('pin', 'world', 'bar')])
    one.apply_wrench('bar', force=[0, 0, 9.81], point=[1, 0, 0], frame='world', duration=1.0)
    one.step(100)
    assert abs(one.joint_velocity[0]) < 1e-12
    np.testing.assert_allclose(one.joint_wrench('pin'), [0, 0, 9.81, 0, 0, 0], atol=1e-9)


def test_a_joint_wrench_is_that_of_a_cantilever_in_the_axes_of_its_frame():
    # 2 kg at 1 m from the wall, in a frame that is turned by a quarter about z.
    turned = {'position': [0, 0, 0], 'orientation': [0, 0, math.sqrt(0.5), math.sqrt(0.5)]}
    one = world([body('arm', 2.0, position=(1, 0, 0))],
                [joint('wall', 'world', 'arm', 'fixed') | {'pose': turned}])
    one.step(5)
    # Upward force, and a moment about -y of the world, which is -x of the frame.
    np.testing.assert_allclose(one.joint_wrench('wall'), [0, 0, 19.62, -19.62, 0, 0], atol=1e-9)


def test_the_wrench_of_a_swing_bears_weight_and_centrifugal_force():
    one = world([body('bob', 1.0, (0, 0, -2), (1e-9,) * 3 + (0,) * 3)],
                [joint('pin', 'world', 'bob', velocity=1.5)])
    one.step(1)
    # m (g + w^2 l) along the bar, up to what changes in a step.
    assert one.joint_wrench('pin')[2] == pytest.approx(9.81 + 1.5 ** 2 * 2, rel=1e-5)


def test_a_kinematic_base_carries_what_hangs_on_it():
    bodies = [{'name': 'base', 'kinematic': True, 'twist': {'linear': [0.5, 0, 0],
                                                            'angular': [0, 0, 2.0]}},
              body('bar', 1.0, (0, 0, -0.5), rod(1, 1, 0.02), (0.3, 0, 0), twist={
                  'linear': [0.5, 0.6, 0], 'angular': [0, 0, 2.0]})]
    one = world(bodies, [joint('pin', 'base', 'bar', position=(0.3, 0, 0))])
    for _ in range(500):
        one.step()
        assert gaps(one) < 1e-12
    np.testing.assert_allclose(one.position[0], [0.25, 0, 0], atol=1e-12)


def test_a_base_that_is_put_elsewhere_takes_its_joints_along():
    bodies = [{'name': 'base', 'fixed': True}, body('bar', 1.0, (0, 0, -0.5), rod(1, 1, 0.02))]
    one = world(bodies, [joint('pin', 'base', 'bar') | {'position': 0.4}])
    one.set_pose('base', [5.0, 0, 1.0], [0, 0, 0, 1])
    assert gaps(one) < 1e-12
    assert one.joint_position[0] == pytest.approx(0.4, abs=1e-12)
    one.step(100)
    assert gaps(one) < 1e-12


def test_coordinates_of_a_joint_with_several_axes_are_told_by_its_name():
    one = world([body('ball', 1.0, (0, 0, -0.5), rod(1, 1, 0.1), twist={
        'linear': [0, 0, 0], 'angular': [0.2, 0.3, 1.0]})],
        [joint('socket', 'world', 'ball', 'spherical', axis=(0, 0, 1))], gravity=(0, 0, 0))
    one.step(1)
    assert one.joint_position[0] == 0.0
    np.testing.assert_allclose(one.joint_coordinates('socket'),
                               [0, 0, 0, 2e-4, 3e-4, 1e-3], rtol=0, atol=2e-6)


def robot():
    """Return a body with two arms that hang on nothing."""
    arm = rod(0.3, 0.5, 0.02)
    return world(
        [body('trunk', 2.0, position=(0, 0, 1), twist={
            'linear': [0.3, 0, 0.1], 'angular': [0, 0.5, 0]}),
         body('left', 0.3, (0, 0, -0.25), arm, (0, 0.2, 1)),
         body('right', 0.3, (0, 0, -0.25), arm, (0, -0.2, 1))],
        [joint(name, 'trunk', name, position=(0, y, 0), axis=(0, 1, 0), velocity=v)
         for name, y, v in (('left', 0.2, 1.0), ('right', -0.2, -2.0))])


def test_what_hangs_on_nothing_moves_as_one_when_a_body_of_it_is_put_elsewhere():
    one = robot()
    rates, velocity = one.joint_velocity, one.linear_velocity[1]
    turned = [math.sin(0.4), 0, 0, math.cos(0.4)]
    one.set_pose('left', [3.0, 2.0, 1.0], turned)
    assert gaps(one) < 1e-12
    np.testing.assert_allclose(one.position[1], [3, 2, 1], atol=1e-14)
    np.testing.assert_allclose(one.orientation[1], turned, atol=1e-14)
    # It keeps its twist, and the joints their velocities.
    np.testing.assert_allclose(one.linear_velocity[1], velocity, atol=1e-12)
    np.testing.assert_allclose(one.joint_velocity, rates, atol=1e-12)


def test_a_twist_of_one_body_is_what_joints_leave_of_it():
    one = robot()
    one.set_twist('trunk', [1.0, 0, 0], [0, 0, 0])
    assert np.abs(one.joint_velocity).max() > 0.0
    one.step(50)
    assert gaps(one) < 1e-12


def test_a_free_joint_holds_nothing_and_tells_where_its_child_is():
    bodies = [body('ball', position=(1, 0, 0), twist={'linear': [0, 1.0, 0],
                                                      'angular': [0, 0, 0]})]
    free = world(bodies, [joint('view', 'world', 'ball', 'free', axis=(0, 0, 1))],
                 gravity=(0, 0, 0))
    free.step(500)
    # The frame of the child is where that of the parent is at the start: at the origin.
    np.testing.assert_allclose(free.joint_coordinates('view')[:3], [0, 0.5, 0], atol=1e-12)
    np.testing.assert_allclose(free.position[0], [1, 0.5, 0], atol=1e-12)
    assert free.joint_position[0] == 0.0


def test_the_wrench_on_a_child_that_holds_its_parent_is_the_weight_of_that():
    # The file has the joint from the arm to the wall, and the arm hangs on the wall.
    wall = {'name': 'wall', 'fixed': True}
    one = world([wall, body('arm', 2.0, position=(1, 0, 0))], [
        {'name': 'bolt', 'type': 'fixed', 'parent': 'arm', 'child': 'wall',
         'pose': {'position': [-1, 0, 0]}}])
    one.step(5)
    np.testing.assert_allclose(one.joint_wrench('bolt'), [0, 0, -19.62, 0, 19.62, 0], atol=1e-9)


def test_a_body_comes_and_goes_beside_a_robot_that_touches_things():
    """The gripper goes on with the bits of a world that never had the guest: it is far away."""
    one, other = load_scene('gripper'), load_scene('gripper')
    one.step(100)
    other.step(100)
    one.add({'name': 'guest', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1},
             'pose': {'position': [5.0, 0.0, 2.0]}})
    saved = one.save()
    for gripper in (one, other):
        gripper.set_joint_command('lift', position=0.1)
        gripper.step(400)
    kept = [one.names.index(name) for name in other.names]
    np.testing.assert_array_equal(one.position[kept], other.position)
    np.testing.assert_array_equal(one.joint_position, other.joint_position)
    one.remove('guest')
    one.step(100)
    other.step(100)
    assert one.position.tobytes() == other.position.tobytes()
    one.restore(saved)
    assert 'guest' in one.names


def test_joints_hold_their_own_bodies_where_there_are_many():
    """
    From 256 moving bodies on a world without joints numbers its bodies by their places.

    Pendulums that hang straight down stay where they are to the last bit.
    """
    places = [[0.3 * (k % 20) * (-1) ** k, 0.3 * (k // 20), 1.0] for k in range(260)]
    many = World.from_dict({
        'bodies': [body(f'b{k}', position=place) for k, place in enumerate(places)],
        'joints': [joint(f'j{k}', 'world', f'b{k}', position=(x, y, z + 0.2))
                   for k, (x, y, z) in enumerate(places)]})
    many.step(5)
    np.testing.assert_array_equal(many.position, places)
