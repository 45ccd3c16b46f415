# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The contact models `event`, `penalty` and `qp` of bodies that joints hold."""

import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.kernels.argument_pack import ArgumentPack

G = 9.81
BALL = {'type': 'sphere', 'radius': 0.1}


def pendulum(name, x, angle, limits=None, z=0.0):
    """Return a ball of 1 kg that hangs 1 m below (x, 0, z), and its joint."""
    body = {'name': name, 'mass': 1.0, 'shape': BALL, 'pose': {'position': [x, 0.0, z - 1.0]}}
    joint = {'name': f'hinge_{name}', 'type': 'revolute', 'parent': 'world', 'child': name,
             'axis': [0.0, 1.0, 0.0], 'position': angle, 'pose': {'position': [x, 0.0, z]},
             'child_pose': {'position': [0.0, 0.0, 1.0]}}
    return body, joint | ({'limits': limits} if limits else {})


def world_of(pendulums, others=(), contact='event', step=0.001, restitution=0.5):
    return World.from_dict({
        'world': {'contact': contact, 'step': step},
        'materials': {'default': {'restitution': restitution, 'friction': 0.0}},
        'bodies': [*(body for body, _ in pendulums), *others],
        'joints': [joint for _, joint in pendulums]})


def angles(world, steps):
    """Return the positions of all joints after each step."""
    found = []
    for _ in range(steps):
        world.step()
        found.append(world.joint_position.copy())
    return np.array(found)


def swing_back(start, met, restitution):
    """Return the angle to which a pendulum comes that fell from `start` and met something."""
    return np.arccos(np.cos(met) - restitution ** 2 * (np.cos(met) - np.cos(start)))


# The method keeps energies to (h omega)^2 / 24 of their size, below 1e-6 here, and the largest of
# the angles that are looked at is the turning point to omega^2 h^2 / 8 of it: 1e-6 too.
ANGLE = 4e-6


def test_a_pendulum_comes_back_from_a_wall_as_energy_says():
    wall = {'name': 'wall', 'fixed': True, 'shape': {'type': 'box', 'size': [0.5, 1.0, 1.0]},
            'pose': {'position': [-0.35, 0.0, -1.0]}}
    world = world_of([pendulum('bob', 0.0, -0.8)], [wall])
    # It falls for half a second, and is on its way back for as long.
    found = angles(world, 1300)[700:, 0]
    assert abs(found.min() + swing_back(0.8, 0.0, 0.5)) < ANGLE


@pytest.mark.parametrize('contact', ['timestep', 'event'])
@pytest.mark.parametrize('beyond', [-1e-6, -1e-8, 0.0, 1e-8, 1e-6, 1e-4])
@pytest.mark.parametrize('restitution', [0.0, 0.5, 1.0])
def test_a_ball_that_arrives_with_the_end_of_a_step_bounces(restitution, beyond, contact):
    """A door that a ball hits turns with m v d (1 + e) / (I + m d^2)."""
    door = {'name': 'door', 'shape': {'type': 'box', 'size': [1.0, 0.04, 1.0]}, 'mass': 5.0,
            'pose': {'position': [0.5, 0.0, 0.0]}}
    # 3 m/s are 0.05 m a step, and 0.2 m are four steps.
    ball = {'name': 'ball', 'shape': {'type': 'sphere', 'radius': 0.05}, 'mass': 0.5,
            'pose': {'position': [0.8, -0.27 + beyond, 0.0]}, 'twist': {'linear': [0.0, 3.0, 0.0]}}
    world = World.from_dict({
        'world': {'contact': contact, 'step': 1 / 60, 'gravity': [0, 0, 0]},
        'materials': {'default': {'restitution': restitution, 'friction': 0.0}},
        'bodies': [door, ball],
        'joints': [{'name': 'hinge', 'type': 'revolute', 'parent': 'world', 'child': 'door',
                    'axis': [0, 0, 1]}]})
    world.step(6)
    inertia = 5.0 * (1.0 + 0.04 ** 2) / 12 + 5.0 * 0.25
    wanted = 0.5 * 3.0 * 0.8 * (1.0 + restitution) / (inertia + 0.5 * 0.8 ** 2)
    # In `timestep` the normal may be that of the door a step later: (0.02 rad)^2 is lost.
    assert world.joint_velocity[0] == pytest.approx(wanted, rel=1e-3)


def test_a_pendulum_comes_back_from_its_limit_as_energy_says():
    limits = {'lower': -2.0, 'upper': 0.0123, 'restitution': 0.5}
    wall = {'name': 'wall', 'fixed': True, 'shape': {'type': 'box', 'size': [0.1, 0.1, 0.1]},
            'pose': {'position': [9.0, 0.0, 0.0]}}
    # With something that it could meet the model is `event`, which ends its way at the limit.
    world = world_of([pendulum('bob', 0.0, -0.8, limits)], [wall])
    found = angles(world, 1300)[700:, 0]
    assert abs(found.min() + swing_back(0.8, 0.0123, 0.5)) < ANGLE


def test_a_shock_goes_through_a_row_of_pendulums():
    """Newton's cradle: the last ball leaves as the first one came, the others stay."""
    world = world_of([pendulum(f'ball{i}', 0.2 * i, 0.5 if i == 0 else 0.0) for i in range(4)],
                     restitution=1.0)
    found = angles(world, 1100)
    assert abs(found[:, 3].min() + 0.5) < ANGLE
    # What the row leaves to the others is of the overlap and the gaps within which balls touch.
    assert np.abs(found[:, 1:3]).max() < 1e-4


def test_after_many_collisions_in_a_step_the_rest_of_it_is_not_backtracked():
    drops = [{'name': f'drop{i}', 'mass': 1.0, 'shape': BALL, 'twist': {'linear': [0, 0, -2.0]},
              'pose': {'position': [0.5 * (i % 20), 0.5 * (i // 20), 0.1 + 3e-4 * i]}}
             for i in range(320)]
    floor = {'name': 'floor', 'fixed': True, 'shape': {'type': 'plane'}}
    world = world_of([pendulum('bob', -3.0, 0.2, z=5.0)], [*drops, floor], step=0.05)
    before = world.kinetic_energy() + world.potential_energy()
    world.step()
    said = world.contact_report().message
    assert 'more than 300 collisions and hits of limits in one step' in said
    assert world.kinetic_energy() + world.potential_energy() < before
    assert world.contacts()['gap'].min() > -1e-6


def on_a_lift(contact, **world):
    """Return the world of a box that a lift guides down onto a floor, and its weight [N]."""
    return World.from_dict({
        'world': {'contact': contact, 'step': 0.0005} | world,
        'materials': {'default': {'stiffness': 2e4, 'damping': 0.5}},
        'bodies': [{'name': 'floor', 'fixed': True, 'shape': {'type': 'plane'}},
                   {'name': 'box', 'mass': 2.0, 'shape': {'type': 'box', 'size': [0.2, 0.2, 0.2]},
                    'pose': {'position': [0.0, 0.0, 0.1]}}],
        'joints': [{'name': 'lift', 'type': 'prismatic', 'parent': 'world', 'child': 'box',
                    'axis': [0.0, 0.0, 1.0], 'damping': 200.0}]}), 2.0 * G


def test_springs_carry_what_a_joint_guides():
    world, weight = on_a_lift('penalty')
    world.step(4000)
    contacts = world.contacts()
    # Two materials of 2e4 N/m in series are one of 1e4 N/m. At rest up to rounding: the swing of
    # 140 rad/s has died out by 50 a second for 2 s.
    assert contacts['normal_force'].sum() == pytest.approx(weight, rel=1e-9)
    assert contacts['gap'] == pytest.approx(-weight / (4 * 1e4), rel=1e-9)
    assert np.abs(world.position[1, :2]).max() < 1e-12


def test_springs_go_on_bit_for_bit_from_what_was_saved():
    one, other = on_a_lift('penalty')[0], on_a_lift('penalty')[0]
    one.step(40)
    other.restore(one.save())
    one.step(40)
    other.step(40)
    assert one.state_hash() == other.state_hash()


def test_with_joints_the_solver_qp_is_what_sequential_is():
    """All impulses of an island are found at once by both."""
    one, other = (on_a_lift('timestep', solver=solver)[0] for solver in ('sequential', 'qp'))
    one.step(100)
    other.step(100)
    assert np.array_equal(one.position, other.position)


@pytest.mark.parametrize('contact', ['none', 'timestep', 'event', 'penalty'])
def test_what_no_part_of_a_step_resolves_is_slowed_down(contact):
    """At 3e5 rad/s a 64th of a step is 4.7 rad: joints cannot be found closed after it."""
    pair = [pendulum('one', 0.0, 0.0), pendulum('two', 0.0, 0.0, z=-1.0)]
    pair[1][1]['parent'] = 'one'
    pair[1][1]['pose'] = {'position': [0.0, 0.0, 0.0]}
    pair[1][1]['velocity'] = 3e5
    wall = {'name': 'wall', 'fixed': True, 'shape': BALL, 'pose': {'position': [9.0, 0.0, 0.0]}}
    world = world_of(pair, [wall], contact)
    energy = world.kinetic_energy() + world.potential_energy()
    for _ in range(20):
        world.step()
        # A part that is resolved turns them by 0.7 rad at most: (h w)^2 / 24 of the energy is 2 %.
        assert world.kinetic_energy() + world.potential_energy() < 1.02 * energy
        # Of the joint's length of 1 m.
        assert abs(np.linalg.norm(world.position[0]) - 1.0) < 1e-11
    assert 'use a smaller step' in world.contact_report().message


@pytest.mark.parametrize('contact', ['timestep', 'event'])
def test_a_light_foot_that_a_drive_presses_on_the_floor_rests_there(contact):
    trunk, foot = ({'name': name, 'mass': m, 'shape': BALL, 'pose': {'position': [0.0, 0.0, z]}}
                   for name, m, z in (('trunk', 10.0, 0.6), ('foot', 0.01, 0.11)))
    along = {'type': 'prismatic', 'axis': [0.0, 0.0, 1.0]}
    leg = along | {'name': 'leg', 'parent': 'trunk', 'child': 'foot',
                   'pose': {'position': [0.0, 0.0, -0.49]},
                   'drive': {'mode': 'position', 'stiffness': 1e4, 'damping': 200.0}}
    guide = along | {'name': 'guide', 'parent': 'world', 'child': 'trunk',
                     'pose': {'position': [0.0, 0.0, 0.6]}}
    floor = {'name': 'floor', 'fixed': True, 'shape': {'type': 'plane'}}
    world = world_of([(trunk, guide), (foot, leg)], [floor], contact, 0.002)
    world.step(1500)
    # It swings with exp(-10 t), d / (2 m) = 10/s, for 3 s: 1e-13 of what it was. In half a step
    # the drive would give the foot 10 m/s, of which nothing is an approach.
    assert np.abs(world.linear_velocity).max() < 1e-9


@pytest.mark.parametrize('contact', ['timestep', 'event'])
def test_a_heavy_load_on_a_light_chain_keeps_its_energy(contact):
    """A step does not resolve how the links swing between each other, and is taken in parts."""
    links = [{'name': f'link{k}', 'mass': 0.01,
              'shape': {'type': 'capsule', 'radius': 0.01, 'length': 0.06},
              'pose': {'position': [0.0, 0.0, -0.1 * k]}} for k in range(20)]
    load = {'name': 'load', 'mass': 100.0, 'shape': {'type': 'box', 'size': [0.2, 0.3, 0.14]},
            'pose': {'position': [0.0, 0.0, -2.0]}}
    names = ['world', *(link['name'] for link in links), 'load']
    joints = [{'name': f'joint{k}', 'type': 'spherical', 'parent': names[k], 'child': names[k + 1],
               'pose': {'position': [0.0, 0.0, -0.05 if k else 0.05]}} for k in range(21)]
    world = World.from_dict({'world': {'contact': contact}, 'bodies': [*links, load],
                             'joints': joints})
    world.apply_impulse('load', (50.0, 0.0, 0.0))
    before = world.kinetic_energy() + world.potential_energy()
    world.step(1000)
    # Of 12.5 J that go to and fro, (h w)^2 with w = 30 rad/s of a link about its pendulum's.
    assert abs(world.kinetic_energy() + world.potential_energy() - before) < 1e-2


WALL = {'name': 'wall', 'fixed': True, 'shape': {'type': 'box', 'size': [0.2, 1.0, 1.0]},
        'pose': {'position': [0.25, 0.0, 0.0]}}     # its face is at 0.15 m, a ball's at 0.1 m


def sliding(contact, parent, laws, *others):
    """Return the world of a ball on a rail along x towards a wall, 5 cm away."""
    ball = {'name': 'ball', 'mass': 1.0, 'shape': BALL}
    rail = {'name': 'rail', 'type': 'prismatic', 'parent': parent, 'child': 'ball',
            'axis': [1.0, 0.0, 0.0], **laws}
    return World.from_dict({'world': {'contact': contact}, 'bodies': [ball, WALL, *others],
                            'joints': [rail]})


@pytest.mark.parametrize('contact', ['timestep', 'event'])
@pytest.mark.parametrize('drive', [
    {'mode': 'effort', 'effort': 5.0},
    {'mode': 'position', 'stiffness': 1e3, 'damping': 1e2, 'position': 1.0}])
def test_a_drive_at_the_bound_of_its_speed_is_stopped_by_a_wall(contact, drive):
    world = sliding(contact, 'world', {
        'drive': drive, 'limits': {'velocity': 0.2, 'effort': 5.0}})
    world.step(1000)
    # As deep as the solvers let anything be, 1e-6 of its size.
    assert world.joint_position[0] == pytest.approx(0.05, abs=1e-7)
    assert abs(world.joint_velocity[0]) < 1e-9
    assert world.contacts()['normal_force'].sum() == pytest.approx(5.0, rel=1e-6)


@pytest.mark.parametrize('contact', ['timestep', 'event'])
def test_dry_friction_yields_where_its_base_carries_a_body_into_a_wall(contact):
    base = {'name': 'base', 'kinematic': True, 'twist': {'linear': [0.5, 0.0, 0.0]}}
    world = sliding(contact, 'base', {'friction': 3.0}, base)
    world.step(300)
    assert world.position[0, 0] == pytest.approx(0.05, abs=1e-7)
    assert world.joint_velocity[0] == pytest.approx(-0.5, abs=1e-6)
    assert world.contacts()['normal_force'].sum() == pytest.approx(3.0, rel=1e-6)


@pytest.mark.parametrize('contact', ['timestep', 'event', 'penalty'])
def test_the_arguments_of_steps_one_by_one_are_taken_apart_once(contact, monkeypatch):
    # That takes a hundred times as long as such a step.
    wall = {'name': 'wall', 'fixed': True, 'shape': {'type': 'box', 'size': [0.5, 1.0, 1.0]},
            'pose': {'position': [-0.5, 0.0, -1.0]}}
    world, twin = (world_of([pendulum('bob', 0.0, 0.5)], [wall], contact, 1e-4) for _ in range(2))
    world.step()
    made = []
    monkeypatch.setattr(ArgumentPack, '__init__', lambda pack, arguments: made.append(arguments))
    for _ in range(20):
        world.step()
    monkeypatch.undo()
    twin.step(21)
    assert made == []
    assert world.state_hash() == twin.state_hash()


@pytest.mark.parametrize(('limits', 'side'), [
    ({'lower': 0.0, 'upper': 2.0}, -1.0), ({'lower': -2.0, 'upper': 0.0}, 1.0)])
def test_what_is_at_its_limit_is_a_wall_for_what_hits_it_from_the_other_side(limits, side):
    ball = {'name': 'ball', 'mass': 1.0, 'shape': BALL,
            'pose': {'position': [0.25 * side, 0.0, -1.0]},
            'twist': {'linear': [-5.0 * side, 0.0, 0.0]}}
    world = world_of([pendulum('bob', 0.0, 0.0, limits)], [ball])
    world.step(20)
    # In 0.01 s the ball falls by 0.5 mm to 0.1 m/s: on a normal that is tilted by 2.5e-3 that is
    # 4e-4 m/s, times 1 + 0.5, and of its 5 m/s the square of the tilt.
    v = world.linear_velocity[world.names.index('ball')]
    assert v[0] == pytest.approx(0.5 * 5.0 * side, abs=1e-3)
    assert abs(world.joint_velocity[0]) < 1e-9


def overlapping(rattles, tilt=0.0, limits=None, depth=1e-4):
    """Return an arm on a base that is in the floor, beside a ball between walls, or without."""
    base = {'name': 'base', 'mass': 0.2, 'shape': {'type': 'box', 'size': [0.1, 0.1, 0.06]},
            'pose': {'position': [0.0, 0.0, 0.03 - depth + 0.05 * tilt],
                     'orientation': [0.0, np.sin(0.5 * tilt), 0.0, np.cos(0.5 * tilt)]}}
    arm = {'name': 'arm', 'mass': 0.2, 'shape': {'type': 'box', 'size': [0.3, 0.02, 0.02]},
           'pose': {'position': [0.2, 0.0, 0.12]}}
    hinge = {'name': 'hinge', 'type': 'revolute', 'parent': 'base', 'child': 'arm',
             'pose': {'position': [0.0, 0.0, 0.09]}, 'axis': [0.0, 1.0, 0.0], 'limits': limits}
    # From wall to wall, 1.1 mm, in 55 us.
    ball = {'name': 'ball', 'mass': 1e-6, 'shape': {'type': 'sphere', 'radius': 0.01},
            'pose': {'position': [5.0, 0.0, 1.0]}, 'twist': {'linear': [20.0, 0.0, 0.0]},
            'material': 'bouncy'}
    walls = [{'name': f'wall{n}', 'fixed': True, 'shape': {'type': 'box', 'size': [0.1, 1.0, 1.0]},
              'pose': {'position': [x, 0.0, 1.0]}, 'material': 'bouncy'}
             for n, x in enumerate((4.93945, 5.06055))]
    return World.from_dict({
        'world': {'contact': 'event', 'step': 0.001},
        'materials': {'default': {'restitution': 0.0, 'friction': 0.5},
                      'bouncy': {'restitution': 1.0}},
        'bodies': [{'name': 'floor', 'fixed': True, 'shape': {'type': 'plane'}}, base, arm,
                   *([ball, *walls] if rattles else [])],
        'joints': [hinge]})


def test_what_overlaps_is_displaced_as_far_in_a_step_of_many_ways():
    depths = []
    for rattles in (False, True):
        world = overlapping(rattles, limits={'lower': -0.5, 'upper': 0.0})
        world.step(5)
        depths.append(0.03 - world.position[world.names.index('base'), 2])
    # Less by PUSH = 0.2 at most in a step: (1 - 0.2)^5 in whole steps, e^-1 in very small parts.
    assert 0.8 ** 5 / np.exp(-1.0) - 1e-6 <= depths[0] / depths[1] <= 1.0 + 1e-6
    assert depths[1] > 0.8 ** 5 * 1e-4


@pytest.mark.parametrize('upper', [1e-6, 1e-5, 1e-4])
def test_what_displaces_gives_no_energy_at_a_limit_of_a_joint(upper):
    world = overlapping(True, 1e-3, {'lower': -upper, 'upper': upper})
    begun = world.kinetic_energy() + world.potential_energy()
    # By the lift out of the floor, 1e-4 m, and what rounding leaves of the ball's energy.
    allowed = 0.4 * G * 1e-4 + 1e-9
    for _ in range(40):
        world.step()
        assert world.kinetic_energy() + world.potential_energy() <= begun + allowed
