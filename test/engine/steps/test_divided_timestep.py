# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds of the model `timestep` in which joints hold some bodies and others not."""

import numpy as np
import pytest

from rigid_sim_ros import World

G = 9.81
BOX = {'type': 'box', 'size': [0.2, 0.2, 0.2]}
FLOOR = {'name': 'floor', 'fixed': True, 'shape': {'type': 'plane'}}
HEAP = [{'name': f'box{k}', 'mass': 1.0, 'shape': BOX,
         'pose': {'position': [2.0 + 0.08 * (k % 3), 0.07 * (k % 2), 0.11 + 0.25 * k]}}
        for k in range(6)]
# It swings down on the floor, and comes to rest there.
ARM = [{'name': 'upper', 'mass': 2.0, 'shape': {'type': 'capsule', 'radius': 0.05, 'length': 0.4},
        'pose': {'position': [0.0, 0.0, 0.35]}},
       {'name': 'lower', 'mass': 1.0, 'shape': {'type': 'capsule', 'radius': 0.05, 'length': 0.4},
        'pose': {'position': [0.0, 0.0, -0.15]}}]
JOINTS = [{'name': 'shoulder', 'type': 'revolute', 'parent': 'world', 'child': 'upper',
           'axis': [0.0, 1.0, 0.0], 'position': 1.2, 'pose': {'position': [0.0, 0.0, 0.6]},
           'child_pose': {'position': [0.0, 0.0, 0.25]}},
          {'name': 'elbow', 'type': 'revolute', 'parent': 'upper', 'child': 'lower',
           'axis': [0.0, 1.0, 0.0], 'position': 0.4, 'pose': {'position': [0.0, 0.0, -0.25]}}]


def world_of(bodies, joints=(), **collision):
    spec = {'world': {'step': 0.001},
            'materials': {'default': {'friction': 0.5, 'restitution': 0.2}},
            'bodies': [FLOOR, *bodies], 'collision': collision}
    return World.from_dict(spec | ({'joints': list(joints)} if joints else {}))


def placed(bodies, x, z=0.0):
    """Return bodies moved by x and z [m], which do not hang on the world."""
    return [one | {'pose': {'position': [one['pose']['position'][0] + x,
                                         one['pose']['position'][1],
                                         one['pose']['position'][2] + z]}} for one in bodies]


def motion(world, names):
    rows = [world.names.index(name) for name in names]
    return np.hstack([quantity[rows] for quantity in (
        world.position, world.orientation, world.linear_momentum, world.angular_momentum)])


def test_what_is_far_from_each_other_moves_as_if_it_were_alone():
    both, arm, heap = world_of(HEAP + ARM, JOINTS), world_of(ARM, JOINTS), world_of(HEAP)
    for _ in range(60):
        for world in (both, arm, heap):
            world.step(25)
        for alone in (arm, heap):
            assert (motion(both, alone.names) == motion(alone, alone.names)).all()
    forces = [world.contacts()['normal_force'].sum() for world in (both, arm, heap)]
    assert min(forces) > 0.0
    # The same forces, added up in another order.
    assert forces[0] == pytest.approx(forces[1] + forces[2], rel=1e-14)


def flying(bodies, u):
    """Return bodies that fly with u [m/s] more than they are written."""
    return [one | {'twist': {'linear': np.add(one.get('twist', {}).get('linear', (0, 0, 0)),
                                              u).tolist()}} for one in bodies]


def in_space(bodies, joints=(), contact='timestep'):
    spec = {'world': {'gravity': [0.0, 0.0, 0.0], 'contact': contact}, 'bodies': bodies}
    return World.from_dict(spec | ({'joints': list(joints)} if joints else {}))


def test_what_only_flies_in_company_moves_as_if_it_were_alone():
    """Boxes meet 8 cm beside an arm, and all fly on by 6 cm in each step."""
    boxes = [{'name': f'box{k}', 'mass': 1.0, 'shape': BOX,
              'pose': {'position': [0.23, 0.01 * k, 0.1 + 0.21 * k]},
              'twist': {'linear': [0.0, 0.0, -1.0 * k]}} for k in range(2)]
    u = (30.0, 50.0, 10.0)
    arm, boxes = flying(placed(ARM, 0.0), u), flying(boxes, u)
    both, one, other = (in_space(boxes + arm, JOINTS[1:]), in_space(arm, JOINTS[1:]),
                        in_space(boxes))
    pressed = 0.0
    for _ in range(40):
        for world in (both, one, other):
            world.step(1)
        for alone in (one, other):
            assert (motion(both, alone.names) == motion(alone, alone.names)).all()
        pressed += both.contacts()['normal_force'].sum()
    assert pressed > 0.0


@pytest.mark.parametrize('contact', ['timestep', 'event'])
def test_what_overlaps_comes_apart_alike_however_fast_it_flies(contact):
    """A box overlaps a link by 2 cm, and both are displaced: neither turns for flying by."""
    arm = placed(ARM, 0.0)
    box = {'name': 'box', 'mass': 0.5, 'shape': BOX, 'pose': {'position': [0.13, 0.03, 0.25]}}
    rests, flies = (in_space(flying([*arm, box], u), JOINTS[1:], contact)
                    for u in (np.zeros(3), np.array((30.0, 50.0, 10.0))))
    for _ in range(50):
        rests.step(1)
        flies.step(1)
    moved = [world.position - world.position[2] for world in (rests, flies)]
    # To rounding of places of some metres over a step, 1e-12 m/s over 0.1 m in each.
    assert np.abs(moved[0] - moved[1]).max() < 1e-10
    assert np.abs(rests.angular_velocity - flies.angular_velocity).max() < 1e-8
    assert rests.position[2, 0] > 0.135


def test_a_world_goes_on_bit_for_bit_while_bodies_come_and_go():
    """The arm swings into a heap, and boxes roll off it: saved and restored at every stage."""
    spec = placed(HEAP, -2.5) + ARM
    one = world_of(spec, JOINTS, sleep_after=0.1)
    shared = set()
    for _ in range(20):
        saved, rows = one.save(), one.contacts()
        one.step(75)
        other = world_of(spec, JOINTS, sleep_after=0.1)
        other.restore(saved)
        for key in ('body_a', 'body_b', 'gap'):
            assert (other.contacts()[key] == rows[key]).all()
        for _ in range(15):
            other.step(5)
        assert one.state_hash() == other.state_hash()
        rows = one.contacts()
        names = np.array(one.names)
        shared |= {a for a, b in zip(names[rows['body_a']], names[rows['body_b']], strict=True)
                   if b in ('upper', 'lower') and a.startswith('box')}
    assert shared       # boxes that leaned on the arm at times


def test_a_spring_between_a_link_and_a_free_body_keeps_their_momentum():
    world = World.from_dict({
        'world': {'gravity': [0.0, 0.0, 0.0]},
        'bodies': [*placed(ARM, 0.0), *placed(HEAP[:1], -0.5, 1.0)],
        'joints': JOINTS[1:],
        'forces': [{'type': 'spring', 'a': 'lower', 'b': 'box0', 'stiffness': 200.0,
                    'rest_length': 0.5}]})
    for _ in range(20):
        world.step(50)
        assert np.abs(world.linear_momentum).max() > 0.1
        # Rounding of 1000 steps.
        assert np.abs(world.total_momentum()).max() < 1e-12
        assert np.abs(world.total_angular_momentum()).max() < 1e-11


def pair(x, z, y=0.0):
    """Return two boxes of 1 kg that a fixed joint holds together, side by side, and the joint."""
    bodies = [HEAP[0] | {'name': name, 'pose': {'position': [at, y, z]}}
              for name, at in (('front', x + 0.1), ('rear', x - 0.1))]
    return bodies, [{'name': 'hitch', 'type': 'fixed', 'parent': 'front', 'child': 'rear'}]


def test_a_wrench_lasts_as_long_as_it_says():
    bodies, joints = pair(0.0, 0.1)
    world = world_of(HEAP[:1] + bodies, joints)
    world.step(500)     # all lie on the floor
    rows = [world.names.index(name) for name in ('box0', 'front', 'rear')]
    for name in ('box0', 'front', 'rear'):
        world.apply_wrench(name, force=[0.0, 0.0, 3.0 * G], duration=0.1)
    world.step(100)
    # Up with 2 g for 0.1 s, from at most 4 um in the floor, which are displaced: no velocity.
    assert world.linear_velocity[rows, 2] == pytest.approx(2.0 * G * 0.1, rel=1e-9)
    world.step(100)
    assert world.linear_velocity[rows, 2] == pytest.approx(G * 0.1, rel=1e-9)


def test_bodies_on_top_of_each_other_bear_their_weights_with_joints_and_without():
    """A box under a pair that is held together, and another on top of it."""
    bodies, joints = pair(0.0, 0.3)
    world = world_of([HEAP[0] | {'pose': {'position': [0.0, 0.0, 0.1]}}, *bodies,
                      HEAP[1] | {'pose': {'position': [0.0, 0.0, 0.5]}}], joints)
    world.step(1000)
    heights = world.position[[world.names.index(name) for name in (
        'box0', 'front', 'rear', 'box1')], 2]
    # Nothing sinks in by more than a contact of the solver without joints does, some um.
    assert heights == pytest.approx([0.1, 0.3, 0.3, 0.5], abs=1e-5)
    rows = world.contacts()
    names = np.array(world.names)[np.array([rows['body_a'], rows['body_b']])]
    for above, bodies_below, weight in (({'box0'}, {'floor'}, 4.0),
                                        ({'front', 'rear'}, {'box0'}, 3.0),
                                        ({'box1'}, {'front', 'rear'}, 1.0)):
        between = [bool(above & set(ends)) and bool(bodies_below & set(ends)) for ends in names.T]
        assert rows['normal_force'][between].sum() == pytest.approx(weight * G, rel=1e-6)


def test_a_conveyor_carries_what_has_joints_and_what_has_none():
    belt = {'name': 'belt', 'kinematic': True, 'shape': {'type': 'box', 'size': [8.0, 2.0, 0.2]},
            'pose': {'position': [0.0, 0.0, 0.1]}, 'twist': {'linear': [0.5, 0.0, 0.0]}}
    bodies, joints = pair(0.125, 0.3, 0.5)
    alone = HEAP[0] | {'pose': {'position': [0.0, -0.5, 0.3]}}
    world = world_of([belt, *bodies, alone], joints)
    world.step(1000)
    rows = [world.names.index(name) for name in ('belt', 'front', 'rear', 'box0')]
    assert world.position[rows[0], 0] == pytest.approx(0.5, abs=1e-12)
    # Friction of mu g lets them slip for 0.5 / (mu g) = 0.1 s, then they keep up.
    assert np.abs(world.linear_velocity[rows] - [0.5, 0.0, 0.0]).max() < 1e-6
    late = 0.5 ** 2 / (2.0 * 0.5 * G)
    # The step in which they stop slipping is known to v h / 2.
    expected = np.array([0.725, 0.525, 0.5]) - late
    assert np.abs(world.position[rows[1:], 0] - expected).max() < 3e-4


def test_a_free_body_sleeps_while_an_arm_moves_and_wakes_when_it_comes():
    world = world_of(placed(HEAP[:1], -2.5) + ARM, [
        JOINTS[0] | {'drive': {'mode': 'position', 'stiffness': 400.0, 'damping': 40.0,
                               'position': 1.2}},
        JOINTS[1] | {'drive': {'mode': 'position', 'stiffness': 200.0, 'damping': 20.0,
                               'position': 0.3}}], sleep_after=0.2)
    world.step(1000)
    assert world.contact_report().asleep == 3
    before = motion(world, ['box0'])
    world.set_joint_command('shoulder', mode='position', position=0.6)
    seen = set()
    for _ in range(600):
        world.step(1)
        rows = world.contacts()
        pushed = any({world.names[row['body_a']], world.names[row['body_b']]} == {'box0', 'lower'}
                     for row in rows[rows['normal_force'] > 0.0])
        seen.add((pushed, world.contact_report().asleep))
    # The box sleeps on until the arm pushes it; it may be that all come to rest then.
    assert {(False, 1), (True, 0)} <= seen <= {(False, 1), (True, 0), (False, 0), (True, 3)}
    assert np.abs(motion(world, ['box0']) - before).max() > 1e-3


@pytest.mark.parametrize('follows', [0.03, 0.06, 0.09])
def test_a_ball_that_bounces_off_a_door_meets_the_one_that_follows_it_in_the_same_step(follows):
    """As the step begins they fly in company, and only the first one is near the door."""
    speed, h, radius = 6.0, 1.0 / 60.0, 0.1
    door = {'name': 'door', 'mass': 20.0, 'shape': {'type': 'box', 'size': [0.8, 0.04, 2.0]},
            'pose': {'position': [0.4, 0.0, 0.0]}}
    hinge = {'name': 'hinge', 'type': 'revolute', 'parent': 'world', 'child': 'door',
             'axis': [0.0, 0.0, 1.0]}
    first = -0.02 - radius - 0.2 * speed * h    # it is at the door after a fifth of the step
    balls = [{'name': f'ball{k}', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': radius},
              'pose': {'position': [0.4, first - k * (2.0 * radius + follows), 0.0]},
              'twist': {'linear': [0.0, speed, 0.0]}} for k in range(2)]
    world = World.from_dict({
        'world': {'step': h, 'gravity': [0.0, 0.0, 0.0]},
        'materials': {'default': {'friction': 0.0, 'restitution': 1.0}},
        'bodies': [door, *balls], 'joints': [hinge]})
    energy = world.kinetic_energy()
    world.step(1)
    a, b = (world.position[world.names.index(f'ball{k}'), 1] for k in range(2))
    # The time of a meeting is known to 1e-7 of the step, and what has met stays where it did.
    assert a - b > 2.0 * radius - 1e-6
    # They met at 10 m/s, after follows / 10 m/s, and exchanged their velocities.
    assert world.linear_velocity[world.names.index('ball1'), 1] < -1.0
    assert world.kinetic_energy() == pytest.approx(energy, rel=1e-9)
