# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What joints hold sleeps when it is at rest, with what leans on it, until something happens."""

import math

from engine.jointed_trees import gaps
from inside import joints_of
import numpy as np
import pytest

from rigid_sim_ros import load_scene, World

G = 9.81
MASS = 15.3     # kg, of the example of a quadruped and a ball
INERTIAL = {'mass': 1.0, 'inertia': [0.01, 0.01, 0.01, 0.0, 0.0, 0.0]}
FLOOR = {'name': 'floor', 'fixed': True, 'shape': {'type': 'plane'}}
# A plate that a drive holds level at its edge, with a box on it; it sags by 2.6 mrad.
PLATE = {'name': 'plate', 'mass': 2.0, 'shape': {'type': 'box', 'size': [0.4, 0.3, 0.04]},
         'pose': {'position': [0.2, 0.0, 0.5]}}
BOX = {'name': 'box', 'mass': 0.5, 'shape': {'type': 'box', 'size': [0.1, 0.1, 0.1]},
       'pose': {'position': [0.25, 0.0, 0.57]}}
HINGE = {'name': 'hinge', 'type': 'revolute', 'parent': 'world', 'child': 'plate',
         'axis': [0.0, 1.0, 0.0], 'pose': {'position': [0.0, 0.0, 0.5]},
         'child_pose': {'position': [-0.2, 0.0, 0.0]},
         'drive': {'mode': 'position', 'stiffness': 2000.0, 'damping': 40.0, 'gain': 40.0,
                   'position': 0.0}}
# A rod that hangs, far away from these.
ROD = {'name': 'rod', 'mass': 1.0, 'shape': {'type': 'capsule', 'radius': 0.03, 'length': 0.3},
       'pose': {'position': [5.0, 0.0, 1.0]}}
PIVOT = {'name': 'pivot', 'type': 'revolute', 'parent': 'world', 'child': 'rod',
         'axis': [0.0, 1.0, 0.0], 'pose': {'position': [5.0, 0.0, 1.2]},
         'child_pose': {'position': [0.0, 0.0, 0.2]},
         'drive': {'mode': 'position', 'stiffness': 100.0, 'damping': 5.0, 'gain': 5.0,
                   'position': 0.3}}


def world_of(bodies, joints, sleep_after=0.1, **scene):
    return World.from_dict({
        'world': {'step': 0.001}, 'materials': {'default': {'friction': 0.6}},
        'bodies': [FLOOR, *bodies], 'joints': joints,
        'collision': {'sleep_after': sleep_after}, **scene})


def asleep(world):
    return world.contact_report().asleep


def motion(world, *names):
    rows = [world.names.index(name) for name in names]
    return np.hstack([quantity[rows] for quantity in (
        world.position, world.orientation, world.linear_momentum, world.angular_momentum)])


@pytest.fixture
def sleeping():
    """Return plate, box and rod at rest: three bodies in two islands."""
    world = world_of([PLATE, BOX, ROD], [HINGE, PIVOT])
    world.step(1000)
    assert asleep(world) == 3
    return world


def quadruped():
    """Return a quadruped that sleeps, and how the world was in its last step before."""
    scene = load_scene('quadruped').scene.spec.model_dump(exclude_none=True)
    world = World.from_dict(scene | {'collision': {'sleep_after': 0.2}})
    while asleep(world) == 0:
        before = felt(world)
        world.step(1)
        assert world.time_ns < 10 * 10 ** 9
    return world, before


def felt(world):
    """Return what is reported of forces."""
    return (world.joint_effort, world.contact_wrenches(),
            np.array([world.joint_wrench(name) for name in world.joint_names]))


def test_a_quadruped_that_stands_sleeps_and_a_push_wakes_it():
    world, _ = quadruped()
    assert asleep(world) == 13
    before = motion(world, *world.names)
    world.step(500)
    assert (motion(world, *world.names) == before).all()
    assert not world.joint_velocity.any()
    world.apply_wrench('trunk', force=[0.0, 40.0, 0.0], duration=0.05)
    world.step(50)
    assert asleep(world) == 0
    # An impulse of 2 N s for 15 kg on legs that give way.
    assert world.linear_velocity[world.names.index('trunk'), 1] > 0.02


@pytest.fixture(scope='module')
def asleep_on_box():
    """Return the scene of a quadruped and a ball on a box, and what it saves when both sleep."""
    scene = load_scene('quadruped').scene.spec.model_dump(exclude_none=True)
    ground = {'name': 'ground', 'fixed': True, 'shape': {'type': 'box', 'size': [12.0, 12.0, 0.2]},
              'material': 'rubber', 'pose': {'position': [0.0, 0.0, -0.1]}}
    ball = {'name': 'ball', 'mass': 0.3, 'shape': {'type': 'sphere', 'radius': 0.06},
            'material': 'bouncy', 'pose': {'position': [5.0, 0.0, 0.06]}}
    scene |= {'bodies': [ground, *scene['bodies'][1:], ball],
              'materials': {'rubber': {'friction': 0.8}, 'bouncy': {'restitution': 0.8}},
              'collision': {'sleep_after': 0.2}}
    world = World.from_dict(scene)
    world.step(3500)
    return scene, world.save()


@pytest.fixture
def guarded(asleep_on_box):
    """Return a world in which a quadruped sleeps, and a ball some metres away."""
    scene, saved = asleep_on_box
    world = World.from_dict(scene)
    world.restore(saved)
    assert asleep(world) == 14
    return world


@pytest.mark.parametrize('disturb', [
    lambda world: world.remove('ground'),
    lambda world: world.set_pose('ground', (0.0, 0.0, -0.11), (0.0, 0.0, 0.0, 1.0)),
    lambda world: world.set_pose('ground', (90.0, 0.0, -0.1), (0.0, 0.0, 0.0, 1.0)),
], ids=['goes', 'sinks', 'is put elsewhere'])
def test_a_quadruped_falls_when_what_it_sleeps_on_leaves_it(guarded, disturb):
    disturb(guarded)
    guarded.step(5)
    assert asleep(guarded) == 0
    # Nothing carries it: the knees push the feet down by far less than 1 cm in 5 ms, and the
    # weight of all is what changes their momentum.
    assert guarded.total_momentum() == pytest.approx([0.0, 0.0, -MASS * G * 0.005], abs=1e-12)
    assert gaps(guarded) < 1e-12


def test_a_wrench_on_the_last_link_of_a_leg_wakes_the_quadruped(guarded):
    guarded.apply_wrench('rear_left_shank', force=(0.0, 20.0, 0.0), duration=0.1)
    guarded.step(100)
    assert asleep(guarded) == 1
    # The drive of the hip gives 150 N m/rad against some 0.3 m of it.
    assert np.abs(guarded.joint_velocity[6]) > 1e-3
    assert gaps(guarded) < 1e-12


@pytest.mark.parametrize('velocity', [(0.0, 0.0, -3.0), (0.0, -30.0, 0.0)], ids=['falls', 'shot'])
def test_a_ball_that_hits_a_sleeping_quadruped_gives_it_its_momentum(guarded, velocity):
    """What all bodies have changes by the weight and by what the floor does, from then on."""
    v = np.array(velocity)
    away, speed = -v / np.linalg.norm(v), np.linalg.norm(v)
    # It comes in 50 ms to the middle of the top of the trunk, or of its side.
    place = guarded.position[guarded.names.index('trunk')] + away * (
        0.06 + np.abs(away) @ [0.2, 0.08, 0.05] + 0.05 * speed)
    guarded.set_pose('ball', place, (0.0, 0.0, 0.0, 1.0))
    guarded.set_twist('ball', velocity, (0.0, 0.0, 0.0))
    guarded.step(40)
    assert asleep(guarded) == 13
    ground, woke = guarded.names.index('ground'), False
    for _ in range(60):
        before = guarded.total_momentum()
        guarded.step(1)
        assert gaps(guarded) < 1e-12
        if asleep(guarded) == 0:
            expected = before - 0.001 * guarded.contact_wrenches()[ground, :3]
            expected[2] -= MASS * G * 0.001
            # A few hundred sums of impulses of up to 16 N s, each rounded to 1e-16 of that.
            assert guarded.total_momentum() == pytest.approx(expected, abs=3e-13)
            woke = True
    assert woke


def test_what_sleeps_feels_what_it_felt_before():
    world, before = quadruped()
    world.step(100)
    # In its last step it moved slower than 0.01 m/s; what its dampers did by that, 3 N m s/rad
    # times 0.01 m/s over legs of 0.1 m, is 0.3 N m of 15 kg g 0.2 m = 30 N m.
    for was, now, scale in zip(before, felt(world), (3.0, 150.0, 150.0), strict=True):
        assert np.abs(now - was).max() < 0.01 * scale
    weight = sum(body.mass for body in world.scene.spec.bodies if body.mass) * G
    force = world.contact_wrenches()[world.names.index('ground'), 2]
    assert force == pytest.approx(-weight, rel=1e-2)


def test_a_pendulum_does_not_sleep_where_it_turns_but_when_it_hangs():
    """Without a shape, so that nothing can meet anything."""
    bob = {'name': 'bob', 'inertial': INERTIAL,
           'pose': {'position': [0.0, 0.0, -1.0]}}
    pivot = {'name': 'pivot', 'type': 'revolute', 'parent': 'world', 'child': 'bob',
             'axis': [0.0, 1.0, 0.0], 'child_pose': {'position': [0.0, 0.0, 1.0]},
             'position': 0.5, 'damping': 0.5}
    world = world_of([bob], [pivot])
    # A swing by q has q w sin(w t) at t from its turn, w = 3.1/s; it is slower than 0.01 m/s for
    # 0.1 s about that, and sleeps there, once q is less than 0.01 / (w sin 0.05 w) = 21 mrad.
    # exp(-t d / 2 m l^2) of 0.5 rad is that after 12.7 s.
    world.step(12000)
    assert asleep(world) == 0
    world.step(12000)
    assert asleep(world) == 1
    assert abs(world.joint_position[0]) < 0.021


@pytest.mark.parametrize('disturb', [
    lambda world: world.apply_wrench('box', force=(1, 0, 0)),
    lambda world: world.apply_wrench('plate', force=(1, 0, 0)),
    lambda world: world.apply_impulse('plate', (0, 0, 1e-3)),
    lambda world: world.set_twist('box', (0, 0, 1e-3), (0, 0, 0)),
    lambda world: world.set_pose('box', (0.25, 0, 0.6), (0, 0, 0, 1)),
    lambda world: world.set_joint_state('hinge', 0.01),
    lambda world: world.set_joint_command('hinge', position=0.001),
    lambda world: world.set_joint_command('hinge', mode='effort', effort=1.0),
    lambda world: world.follow_trajectory(['hinge'], [1.0], [[0.1]]),
    lambda world: world.remove('box'),
    lambda world: world.remove('hinge'),
    lambda world: world.add(BOX | {'name': 'more', 'pose': {'position': [0.1, 0, 0.569]}}),
    lambda world: world.add({'name': 'glue', 'type': 'fixed', 'parent': 'plate', 'child': 'box'}),
], ids=['wrench on box', 'wrench on plate', 'impulse', 'twist', 'pose', 'joint state', 'goal',
        'effort', 'trajectory', 'box goes', 'hinge goes', 'box comes', 'joint comes'])
def test_a_disturbance_wakes_the_island_and_no_other(sleeping, disturb):
    rod = motion(sleeping, 'rod')
    disturb(sleeping)
    sleeping.step(5)
    assert asleep(sleeping) == 1
    assert (motion(sleeping, 'rod') == rod).all()


def test_what_changes_nothing_wakes_nobody(sleeping):
    sleeping.set_joint_command('hinge', mode='position', position=0.0)
    sleeping.step(5)
    assert asleep(sleeping) == 3


def test_a_whole_turn_of_a_joint_is_a_disturbance(sleeping):
    sleeping.set_joint_state('pivot', sleeping.joint_position[1] + 2.0 * math.pi)
    sleeping.step(5)
    assert asleep(sleeping) == 2
    # The drive turns it back, all the way.
    sleeping.step(3000)
    assert sleeping.joint_position[1] == pytest.approx(0.3, abs=0.02)


def test_a_turn_that_no_bit_of_the_pose_tells_is_a_disturbance(sleeping):
    """As `set_joint_state` may leave it where rounding takes what two turns change of a pose."""
    joints_of(sleeping).motion.position[1] += 4.0 * math.pi
    sleeping.step(1)
    assert asleep(sleeping) == 2


def test_a_command_ends_in_time_while_all_sleep():
    world = world_of([PLATE, ROD], [HINGE, PIVOT])
    world.set_joint_command('hinge', mode='position', position=0.0, duration=2.0)
    world.step(1999)
    assert asleep(world) == 2
    world.step(11)
    assert asleep(world) == 1
    # 10 ms without the drive: m g r / I about the hinge.
    inertia = 2.0 * (0.4 ** 2 / 12 + 0.04 ** 2 / 12 + 0.2 ** 2)
    assert world.joint_velocity[0] == pytest.approx(2.0 * 0.2 * G / inertia * 0.01, rel=1e-4)


def test_a_slow_trajectory_is_no_rest():
    world = world_of([PLATE, ROD], [HINGE, PIVOT], sleep_after=0.02)
    world.step(1000)
    assert asleep(world) == 2
    # The edge of the plate moves with 4 mm/s, 0.4 mm behind, and sags by m g r / k = 1.96 mrad.
    world.follow_trajectory(['hinge'], [2.0], [[-0.02]])
    for _ in range(19):
        world.step(100)
        assert asleep(world) == 1
    assert world.joint_position[0] == pytest.approx(-0.019 + 0.00196, abs=5e-4)
    world.step(500)
    assert asleep(world) == 2


def test_a_drive_that_turns_slowly_lets_nothing_rest():
    world = world_of([ROD], [PIVOT | {'drive': {'mode': 'velocity', 'gain': 200.0,
                                                'velocity': 1e-4}}], sleep_after=0.02)
    world.step(1000)
    assert asleep(world) == 0
    # Gravity takes m g r q / gain of the velocity, at most 1 percent.
    assert world.joint_position[0] == pytest.approx(1e-4, rel=0.01)
    world.set_joint_command('pivot', mode='velocity', velocity=0.0)
    world.step(50)
    assert asleep(world) == 1


def test_a_rotor_without_a_shape_that_turns_is_not_at_rest():
    rotor = {'name': 'rotor', 'inertial': INERTIAL}
    world = world_of([rotor], [{'name': 'shaft', 'type': 'continuous', 'parent': 'world',
                                'child': 'rotor', 'velocity': 1.0}])
    world.step(1000)
    assert asleep(world) == 0
    assert world.joint_position[0] == pytest.approx(1.0, rel=1e-9)


def test_a_base_that_begins_to_move_wakes_what_hangs_on_it():
    base = {'name': 'base', 'kinematic': True, 'pose': {'position': [0.0, 0.0, 0.5]},
            'shape': {'type': 'sphere', 'radius': 0.01}}
    world = world_of([base, PLATE, BOX], [HINGE | {'parent': 'base', 'pose': {}}])
    world.step(1000)
    assert asleep(world) == 2
    world.set_twist('base', (0.0, 0.005, 0.0), (0.0, 0.0, 0.0))
    world.step(1000)
    assert asleep(world) == 0
    assert world.position[world.names.index('box'), 1] == pytest.approx(0.005, abs=1e-4)


def test_a_body_that_comes_wakes_the_whole_island():
    ball = {'name': 'ball', 'mass': 0.2, 'shape': {'type': 'sphere', 'radius': 0.05},
            'pose': {'position': [0.25, 0.0, 5.5]}}
    world = world_of([PLATE, BOX, ROD, ball], [HINGE, PIVOT])
    # It falls by 4.83 m in 0.99 s.
    world.step(980)
    assert asleep(world) == 3
    world.step(20)
    assert asleep(world) == 1
    assert world.joint_velocity[0] > 0.1


def test_a_spring_to_a_body_that_moves_lets_nothing_sleep():
    ball = {'name': 'ball', 'mass': 0.2, 'shape': {'type': 'sphere', 'radius': 0.05},
            'pose': {'position': [0.4, 0.0, 2.0]}}
    world = world_of([PLATE, ROD, ball], [HINGE, PIVOT], world={'step': 0.001}, forces=[
        {'type': 'spring', 'a': 'ball', 'b': 'plate', 'stiffness': 20.0, 'rest_length': 1.0}])
    for _ in range(20):
        world.step(100)
        assert asleep(world) == (1 if world.time_ns > 5 * 10 ** 8 else asleep(world))


def test_an_articulation_moves_beside_one_that_sleeps_as_if_alone():
    both = world_of([PLATE, BOX, ROD], [HINGE, PIVOT])
    alone = world_of([ROD], [PIVOT])
    slept = []
    for k in range(40):
        if k % 8 == 0:
            for world in (both, alone):
                world.set_joint_command('pivot', mode='position', position=0.1 * (k % 3))
        for world in (both, alone):
            world.step(25)
        assert (motion(both, 'rod') == motion(alone, 'rod')).all()
        assert both.joint_velocity[1] == alone.joint_velocity[0]
        slept.append((asleep(both), asleep(alone)))
    assert {(2, 0), (3, 1)} <= set(slept)


def test_a_world_that_sleeps_goes_on_bit_for_bit_from_what_it_saved(sleeping):
    twin = world_of([PLATE, BOX, ROD], [HINGE, PIVOT])
    twin.restore(sleeping.save())
    assert (twin.contacts() == sleeping.contacts()).all()
    for k in range(6):
        for world in (sleeping, twin):
            world.step(50)
            if k % 2:
                world.apply_impulse('rod' if k == 1 else 'box', (0.02, 0.01, 0))
        assert twin.state_hash() == sleeping.state_hash()
        assert asleep(twin) == asleep(sleeping)


def test_what_wakes_goes_on_as_if_it_had_been_put_there(sleeping):
    """Asleep or just put there, at rest: the same motion follows."""
    fresh = world_of([PLATE, BOX, ROD], [HINGE, PIVOT], sleep_after=0.0)
    position, orientation = sleeping.position, sleeping.orientation
    for name in ('hinge', 'pivot'):
        fresh.set_joint_state(name, float(
            sleeping.joint_position[sleeping.joint_names.index(name)]))
    k = sleeping.names.index('box')
    fresh.set_pose('box', position[k], orientation[k])
    for world in (sleeping, fresh):
        world.apply_wrench('plate', force=(0, 0, 5.0), duration=0.2)
        world.apply_wrench('rod', force=(5.0, 0, 0), duration=0.2)
        world.step(200)
    # What was put there is there to rounding, and what is solved for the contacts from no
    # impulses is the same to the tolerance of its solver, 1e-10 of the rates.
    for name in ('plate', 'box', 'rod'):
        assert motion(sleeping, name) == pytest.approx(motion(fresh, name), abs=1e-8)


def test_what_hangs_on_a_spring_sleeps_with_what_it_hangs_on():
    ball = {'name': 'ball', 'mass': 0.2, 'shape': {'type': 'sphere', 'radius': 0.05},
            'pose': {'position': [0.4, 0.0, 0.3]}}
    world = world_of([PLATE, ROD, ball], [HINGE, PIVOT], forces=[
        {'type': 'spring', 'a': 'ball', 'b': 'plate', 'anchor': [0.2, 0.0, 0.0],
         'stiffness': 50.0, 'damping': 1.0, 'rest_length': 0.15}])
    # exp(-t d / 2 m) of 0.1 m/s is 1e-5 m/s after 3.7 s.
    world.step(5000)
    assert asleep(world) == 3
    before = motion(world, 'plate', 'ball')
    world.step(1000)
    assert (motion(world, 'plate', 'ball') == before).all()
    world.apply_impulse('ball', (0.0, 0.01, 0.0))
    world.step(1)
    assert asleep(world) == 1


def test_a_drawer_that_lies_at_its_limit_sleeps_until_it_is_pulled():
    drawer = {'name': 'drawer', 'mass': 2.0, 'shape': {'type': 'box', 'size': [0.3, 0.2, 0.1]},
              'pose': {'position': [0.1, 0.0, 1.0]}}
    rail = {'name': 'rail', 'type': 'prismatic', 'parent': 'world', 'child': 'drawer',
            'axis': [math.cos(0.2), 0.0, math.sin(0.2)], 'pose': {'position': [0.1, 0.0, 1.0]},
            'position': 0.1, 'friction': 1.0, 'limits': {'lower': 0.0, 'upper': 0.3}}
    world = world_of([drawer], [rail])
    world.step(1000)
    assert (asleep(world), world.joint_position[0]) == (1, pytest.approx(0.0, abs=1e-9))
    world.apply_wrench('drawer', force=[20.0, 0.0, 0.0], duration=0.1)
    world.step(100)
    # Against its weight along the rail, and dry friction.
    expected = (20.0 * math.cos(0.2) - 2.0 * G * math.sin(0.2) - 1.0) / 2.0 * 0.1
    assert world.joint_velocity[0] == pytest.approx(expected, rel=1e-6)
