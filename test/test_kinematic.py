# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Kinematic bodies move by their twist, carry what lies on them, and are never entered."""

import math

from carrying import crate, floor, G, MODELS, REST, UPRIGHT, world_of
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_sim_ros import World
from rigid_sim_ros.scene import SceneError

# Where a body may be entered by this [m] under its load: springs sink by m g / (4 k) = 0.25 mm at
# rest and twice that when they are loaded at once, the others by what solves a step to 1 um.
SINK = {'penalty': 1e-3, 'event': 1e-6, 'timestep': 1e-5, 'qp': 1e-6}
every_model = pytest.mark.parametrize('model', MODELS)
stiff_models = pytest.mark.parametrize('model', [name for name in MODELS if name != 'penalty'])

ARM = {'name': 'arm', 'kinematic': True,
       'shape': {'type': 'box', 'size': [1, 0.1, 0.1], 'pose': {'position': [0.5, 0, 0]}},
       'pose': {'position': [1, 2, 3]},
       'twist': {'linear': [0.3, -0.2, 0.1], 'angular': [0.5, -1.0, 2.0]}}


@pytest.mark.parametrize('how', [
    *MODELS.values(), *({'contact': 'none', 'integrator': name}
                        for name in ('euler', 'semi_implicit', 'rk4', 'symplectic'))],
    ids=lambda how: '-'.join(how.values()))
@pytest.mark.parametrize('spring', [False, True])
def test_a_kinematic_body_moves_exactly_by_its_twist(how, spring):
    ball = {'name': 'ball', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1}}
    forces = [{'type': 'spring', 'a': 'arm', 'b': 'ball', 'stiffness': 10}] if spring else []
    world = World.from_dict({'world': {'step': 0.01, **how}, 'bodies': [ARM, ball],
                             'materials': {'default': {'stiffness': 100}}, 'forces': forces})
    world.step(100)
    # Rounding of 100 sums of numbers of size 1.
    assert world.position[0] == pytest.approx([1.3, 1.8, 3.1], abs=1e-13)
    turned = Rotation.from_quat(world.orientation[0]) * Rotation.from_rotvec([0.5, -1, 2]).inv()
    assert turned.magnitude() < 1e-13
    assert world.linear_velocity[0].tolist() == [0.3, -0.2, 0.1]
    assert world.angular_velocity[0].tolist() == [0.5, -1.0, 2.0]


@every_model
def test_a_belt_drags_a_crate_along_until_it_is_as_fast(model):
    world = world_of(model, floor(twist={'linear': [0.0, 1.0, 0.0]}), crate(), friction=0.3)
    world.step(200)
    # mu g t; springs lift the crate a little at first, so its weight presses only on average.
    assert world.linear_velocity[1, 1] == pytest.approx(
        0.3 * G * 0.2, rel=1e-3 if model != 'penalty' else 0.1)
    world.step(300)
    # Springs still let it swing up and down.
    assert world.linear_velocity[1, 1] == pytest.approx(1.0, abs=5e-3)
    # It slid back by v^2 / (2 mu g) on the belt.
    assert world.position[0, 1] - world.position[1, 1] == pytest.approx(
        1 / (0.6 * G), rel=1e-2 if model != 'penalty' else 0.1)


@stiff_models
@pytest.mark.parametrize('a', [3.0, -3.0])
def test_a_lift_that_speeds_up_presses_with_the_force_that_this_takes(model, a):
    world, pressed = world_of(model, floor(), crate()), 0.0
    world.step(50)
    for k in range(200):
        world.set_twist('floor', (0, 0, a * 1e-3 * (k + 1)), REST)
        world.step()
        pressed += world.contacts()['normal_force'].sum() * (1e-2 if k >= 100 else 0.0)
    # Contacts at velocity level may let go for a step or two, which makes g h each.
    assert world.linear_velocity[1, 2] == pytest.approx(0.2 * a, abs=2.5 * G * 1e-3)
    assert pressed == pytest.approx(2.0 * (G + a), rel=5e-2)
    # What is let go for n steps is apart by n^2 g h^2 / 2, and sinks in as little.
    assert abs(world.position[1, 2] - world.position[0, 2] - 0.7) < 5e-4


@every_model
@pytest.mark.parametrize('v', [1.0, -1.0])
@pytest.mark.parametrize('how', ['twist', 'poses', 'poses of a fixed body'])
def test_what_stands_on_a_lift_neither_flies_up_nor_falls_through(model, v, how):
    world = world_of(model, floor(**({'fixed': True} if 'fixed' in how else {})), crate())
    world.step(200)
    lowest = highest = fastest = 0.0
    for k in range(400):
        if how != 'twist':
            world.set_pose('floor', (0, 0, v * 1e-3 * (k + 1) - 0.5), UPRIGHT)
        elif k == 0:
            world.set_twist('floor', (0, 0, v), REST)
        world.step()
        assert world.position[0, 2] == pytest.approx(v * 1e-3 * (k + 1) - 0.5, abs=1e-12)
        height = world.position[1, 2] - world.position[0, 2] - 0.7
        lowest, highest = min(lowest, height), max(highest, height)
        fastest = max(fastest, world.linear_velocity[1, 2])
    # A floor that drops away is caught after v^2 / (2 g), by then twice as fast; one that hits the
    # crate from below gives it its own speed, and springs return some of that.
    soft = model == 'penalty'
    assert highest < (v * v / (2 * G) + 2e-3 if v < 0 or soft else 1e-5)
    assert lowest > (-0.02 if soft else -2e-3 - SINK[model])
    assert fastest < (2.0 if soft else 1.0 + 1e-6) * max(v, 0.0) + (0.3 if soft else 1e-6)
    if not soft:
        assert world.linear_velocity[1] == pytest.approx([0, 0, v], abs=1e-3)
        assert abs(height) < 1e-4


@stiff_models
def test_a_turntable_carries_what_friction_can_hold(model):
    w, mu = 2.0, 0.3

    def rides(name, r):
        return crate(name, (r, 0.0, 0.1), shape={'type': 'box', 'size': [0.1, 0.1, 0.2]},
                     twist={'linear': [0, w * r, 0], 'angular': [0, 0, w]})
    table = {'name': 'table', 'kinematic': True, 'twist': {'angular': [0, 0, w]},
             'shape': {'type': 'cylinder', 'radius': 2, 'length': 0.2},
             'pose': {'position': [0, 0, -0.1]}}
    held, slides = 0.9 * mu * G / w ** 2, 1.2 * mu * G / w ** 2
    world = world_of(model, table, rides('held', held), rides('slides', -slides), friction=mu)
    turn = round(2 * math.pi / w / 1e-3)
    world.step(turn)
    # The solver `qp` is of first order and goes along tangents: w^2 h^2 r / 2 farther out in a
    # step, pi w h r in a turn, and friction that acts at the end of them doubles that; with a
    # tenth for what depends on the radius. In the others what friction holds goes on in circles.
    outwards = 2.2 * math.pi * w * 1e-3 if model == 'qp' else 1e-5
    assert np.hypot(*world.position[1, :2]) == pytest.approx(held, abs=outwards * held)
    # Back where it was, but for the way of the last step, w h r = 1.3 mm.
    assert world.position[1] == pytest.approx([held, 0, 0.1], abs=2e-3 + outwards * held)
    assert np.hypot(*world.position[2, :2]) > 1.1 * slides
    # What friction holds moves at w x r: mu m g is not reached.
    assert np.hypot(*world.linear_velocity[1, :2]) == pytest.approx(
        w * np.hypot(*world.position[1, :2]), rel=5e-3)


@every_model
@pytest.mark.parametrize('shape', [
    {'type': 'box', 'size': [0.4, 0.4, 0.4]}, {'type': 'sphere', 'radius': 0.2}],
    ids=lambda shape: shape['type'])
def test_a_piston_is_never_entered_and_never_slows_down(model, shape):
    piston = {'name': 'piston', 'kinematic': True, 'twist': {'linear': [3, 0, 0]},
              'shape': {'type': 'box', 'size': [1, 1, 1]}, 'pose': {'position': [-1, 0, 0.5]}}
    world = world_of(model, floor(fixed=True), piston, crate('pushed', shape=shape),
                     crate('next', (0.5, 0, 0.2), shape=shape))
    deepest = 0.0
    for _ in range(500):
        world.step()
        assert world.linear_velocity[1].tolist() == [3.0, 0.0, 0.0]
        gap = world.position[2, 0] - 0.2 - (world.position[1, 0] + 0.5)
        deepest = min(deepest, gap)
    assert world.position[1] == pytest.approx([0.5, 0, 0.5], abs=1e-12)
    # v sqrt(m / k) is how far an impact of both, 4 kg, compresses a spring; a step's way is 3 mm.
    assert deepest > (-3.0 * math.sqrt(4.0 / 2e4) if model == 'penalty' else -3e-3)
    assert world.position[3, 0] > world.position[2, 0] > world.position[1, 0] + 0.65


@pytest.mark.parametrize('model', ['event', 'timestep'])
def test_a_ball_bounces_off_a_wall_that_comes(model):
    wall = {'name': 'wall', 'kinematic': True, 'twist': {'linear': [2, 0, 0]},
            'shape': {'type': 'box', 'size': [1, 9, 9]}}
    ball = {'name': 'ball', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.5},
            'pose': {'position': [2, 0, 0]}, 'twist': {'linear': [-3, 0, 0]}}
    world = world_of(model, wall, ball, friction=0.0, restitution=0.5)
    world.step(300)
    # Apart at e times the 5 m/s of their approach.
    assert world.linear_velocity[1, 0] == pytest.approx(2.0 + 0.5 * 5.0, abs=1e-6)


@every_model
def test_nothing_pushes_a_kinematic_body(model):
    world = world_of(model, floor(mass=1.0), crate())
    world.apply_wrench('floor', (0, 0, 1e6), (1e6, 0, 0), duration=1.0)
    world.apply_impulse('floor', (1e6, 0, 0))
    world.step(100)
    assert world.position[0].tolist() == [0, 0, -0.5]
    assert not world.linear_momentum[0].any()


@pytest.mark.parametrize(('keys', 'message'), [
    ({'fixed': True, 'kinematic': True}, 'kinematic: stands beside fixed: true'),
    ({'fixed': True, 'twist': {'linear': [0, 0, 1]}}, 'twist: of a fixed body, must be 0'),
    ({'kinematic': 1}, 'kinematic: 1, must be true or false')])
def test_a_body_is_fixed_or_kinematic(keys, message):
    with pytest.raises(SceneError, match=message):
        World.from_dict({'bodies': [{'name': 'a', **keys}]})


def test_a_fixed_body_refuses_a_twist_and_says_what_to_write():
    world = world_of('timestep', floor(fixed=True), crate())
    with pytest.raises(ValueError, match=r"body 'floor' is fixed .* `kinematic: true`"):
        world.set_twist('floor', (0, 0, 1), REST)


@every_model
def test_a_saved_world_goes_on_to_the_bit_amid_a_motion(model):
    one = world_of(model, floor(), crate('a'), crate('b', (1.0, 0, 0.2)))
    one.step(20)
    for k in range(5):
        one.set_pose('floor', (2e-4 * k, 0, -0.5), (0, 0, math.sin(1e-3 * k), math.cos(1e-3 * k)))
        one.step(7)
    one.set_pose('floor', (0.01, 0, -0.49), UPRIGHT)
    one.step(3)
    other = World(one.scene)
    other.restore(one.save())
    assert other.state_hash() == one.state_hash()
    for world in (one, other):
        # Not there yet, and the next pose follows on this one.
        world.step(3)
        world.set_pose('floor', (0.02, 0, -0.49), UPRIGHT)
        world.step(10)
        world.set_twist('floor', (0, 0.5, 0), (0, 0, 1))
        world.step(50)
    assert other.state_hash() == one.state_hash()
    assert one.linear_velocity[0].tolist() == [0, 0.5, 0]
    one.reset()
    assert one.state_hash() == World(one.scene).state_hash()


def test_a_twist_is_part_of_the_hash():
    one, other = (world_of('timestep', floor(), crate()) for _ in range(2))
    one.set_twist('floor', (1e-300, 0, 0), REST)
    assert one.state_hash() != other.state_hash()


@pytest.mark.parametrize('how', ['twist', 'poses'])
@pytest.mark.parametrize('v', [0.002, 0.5])
def test_what_sleeps_on_a_body_that_begins_to_move_wakes_and_stays_awake(how, v):
    world = world_of('timestep', floor(), crate(), sleep_after=0.05)
    world.step(200)
    assert world.contact_report().asleep == 1
    for k in range(300):
        if how == 'poses':
            world.set_pose('floor', (v * 1e-3 * (k + 1), 0, -0.5), UPRIGHT)
        elif k == 0:
            world.set_twist('floor', (v, 0, 0), REST)
        world.step()
        assert world.contact_report().asleep == 0
    assert world.linear_velocity[1, 0] == pytest.approx(v, rel=1e-3)
    world.set_twist('floor', REST, REST)
    world.step(300)
    assert world.contact_report().asleep == 1


def test_two_cores_carry_many_crates_to_the_same_bits():
    bodies = [crate(f'c{i}_{j}', (0.45 * i - 4, 0.45 * j - 4, 0.2)) for i in range(19)
              for j in range(19)]
    bodies += [crate(f'd{i}_{j}', (0.45 * i - 4, 0.45 * j - 4, 0.6)) for i in range(19)
               for j in range(19)]
    worlds = [world_of('timestep', floor(twist={'linear': [0.2, 0, 0]}), *bodies)
              for _ in range(2)]
    worlds[1].threads = 2
    for world in worlds:
        world.step(30)
    assert worlds[0].state_hash() == worlds[1].state_hash()
    # mu g t is more than the belt's speed.
    assert worlds[0].linear_velocity[1:362, 0] == pytest.approx(0.147, abs=2e-2)
