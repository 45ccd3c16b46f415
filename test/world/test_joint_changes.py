# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Joints and models come and go between two steps; the others go on as if nothing had happened."""
from engine.jointed import body, hanging, joint, scene
from models.robots import URDF, write
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.resume import find
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.world.snapshot import pack, unpack

GROUND = {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}
BOX = {'type': 'box', 'size': [0.2, 0.2, 0.2]}
DRIVE = {'mode': 'position', 'stiffness': 40.0, 'damping': 4.0}
CONTACTS = ('none', 'timestep', 'qp', 'event', 'penalty')


def crate(name, x, z, **more):
    return {'name': name, 'shape': BOX, 'mass': 1.0, 'pose': {'position': [x, 0.0, z]}, **more}


def arm(contact='timestep'):
    """Return a scene with an arm of two links whose joints begin off 0, and crates beside it."""
    links = [crate('upper', 0, 2.0), crate('lower', 0, 1.6), crate('low', 3, 0.1),
             crate('high', 3, 0.35)]
    joints = [joint('shoulder', 'world', 'upper', position=(0, 0, 2.2), position_=0.7,
                    drive=DRIVE),
              joint('elbow', 'upper', 'lower', position=(0, 0, -0.2), position_=-0.3,
                    friction=0.05, drive=DRIVE)]
    for one in joints:
        one['pose'] = {'position': one['pose']['position']}
        one['position'] = one.pop('position_')
    # So soft that a step of 1 ms is stable in the model `penalty`, with the rod of the model too.
    return {'world': world_of(contact), 'materials': {'default': {'stiffness': 200.0}},
            'bodies': [GROUND, *links], 'joints': joints}


def world_of(contact):
    """Return what a scene says of a contact model, `qp` for the other solver of timestep."""
    if contact == 'qp':
        return {'contact': 'timestep', 'solver': 'qp'}
    return {'contact': contact}


@pytest.fixture(name='model')
def _model(tmp_path):
    """Give a model from a file, at some distance from all else."""
    path = write(tmp_path, 'pendulum.urdf', URDF)
    return {'name': 'r', 'file': str(path), 'pose': {'position': [40, 0, 3]},
            'joints': {'hinge': 0.5}}


def with_first(scene_, key, part):
    return {**scene_, key: [*scene_.get(key, ()), part]}


def run(*worlds, steps):
    for one in worlds:
        one.step(steps)


@pytest.mark.parametrize('contact', CONTACTS)
@pytest.mark.parametrize('part', [
    joint('hold', 'lower', 'low', 'fixed'),
    joint('slide', 'world', 'high', 'prismatic', axis=(1, 0, 0), position=(3, 0, 0.35),
          drive=DRIVE),
    joint('chain', 'low', 'high', 'spherical'),
], ids=lambda part: part['name'])
def test_a_joint_that_comes_before_the_first_step_was_there_from_the_start(contact, part):
    plain = arm(contact)
    if part['name'] == 'hold':
        # Where the joints begin at 0 a body is where it is written, and so is the joint.
        plain['joints'] = [{**one, 'position': 0.0} for one in plain['joints']]
    late = World.from_dict(plain)
    late.add(part)
    there = World.from_dict(with_first(plain, 'joints', part))
    assert late.state_hash() == there.state_hash()
    run(late, there, steps=40)
    assert late.state_hash() == there.state_hash()
    assert late.scene.text == there.scene.text


@pytest.mark.parametrize('contact', CONTACTS)
def test_a_model_that_comes_before_the_first_step_was_there_from_the_start(contact, model):
    late = World.from_dict(arm(contact))
    late.add(model)
    there = World.from_dict(with_first(arm(contact), 'models', model))
    assert late.names == there.names and late.joint_names == there.joint_names
    assert late.scene.descriptions == there.scene.descriptions != {}
    assert late.state_hash() == there.state_hash()
    run(late, there, steps=40)
    assert late.state_hash() == there.state_hash()
    np.testing.assert_array_equal(late.mass_matrix('r'), there.mass_matrix('r'))


@pytest.mark.parametrize('contact', CONTACTS)
def test_a_model_that_comes_far_away_and_goes_again_leaves_no_trace(contact, model):
    """Hash for hash, with drives that are told something and a trajectory under way."""
    changing, alone = (World.from_dict(arm(contact)) for _ in range(2))
    for one in (changing, alone):
        one.step(60)
        one.follow_trajectory(['shoulder'], [0.2], [[0.4]], [[0.0]])
        one.set_joint_command('elbow', position=0.2, duration=0.3)
        one.step(20)
    changing.add(model)
    assert changing.joint_names == [*alone.joint_names, 'r/hinge']
    np.testing.assert_array_equal(changing.joint_position[:2], alone.joint_position)
    assert changing.joint_position[2] == pytest.approx(0.5, abs=1e-15)
    run(changing, alone, steps=50)
    np.testing.assert_array_equal(changing.position[:5], alone.position)
    np.testing.assert_array_equal(changing.joint_velocity[:2], alone.joint_velocity)
    assert changing.joint_velocity[2] != 0.0
    changing.remove('r')
    assert changing.joint_names == alone.joint_names and changing.scene.descriptions == {}
    assert changing.state_hash() == alone.state_hash()
    run(changing, alone, steps=50)
    assert changing.state_hash() == alone.state_hash()


def test_a_joint_that_comes_holds_bodies_where_they_are_and_keeps_their_momentum():
    """
    Two free bodies that are joined go on as one.

    The cube of 2 kg moves at 3 m/s along x, the other one of 1 kg at -1 m/s along y: together
    they have the velocity (2, -1/3, 0) m/s of their centre of mass, and the angular momentum
    about it that they had.
    """
    still = {'gravity': (0, 0, 0)}
    world = World.from_dict(scene(
        [body('a', 2.0, twist={'linear': [3, 0, 0]}),
         body('b', 1.0, position=(0.0, 1.0, 0.3), twist={'linear': [0, -1, 0]})], [], **still))
    world.step(100)
    P, L = world.total_momentum(), world.total_angular_momentum()
    apart = world.position[1] - world.position[0]
    world.add({'name': 'grasp', 'type': 'fixed', 'parent': 'a', 'child': 'b'})
    np.testing.assert_allclose(world.position[1] - world.position[0], apart, atol=1e-15)
    np.testing.assert_allclose(world.total_momentum(), P, atol=1e-14)
    np.testing.assert_allclose(world.total_angular_momentum(), L, atol=1e-14)
    v = np.average(world.linear_velocity, axis=0, weights=world.mass)
    np.testing.assert_allclose(v, [2.0, -1.0 / 3.0, 0.0], atol=1e-14)
    world.step(200)
    turned = world.position[1] - world.position[0]
    # The joints hold to 1e-13 m.
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(apart), abs=1e-12)
    np.testing.assert_allclose(world.total_angular_momentum(), L, atol=1e-12)
    before = world.linear_velocity, world.angular_velocity
    world.remove('grasp')
    np.testing.assert_array_equal(world.linear_velocity, before[0])
    np.testing.assert_array_equal(world.angular_velocity, before[1])
    assert world.joint_names == []


def test_a_joint_that_comes_late_stirs_nothing_that_it_does_not_hold():
    changing, alone = (World.from_dict(arm('none')) for _ in range(2))
    run(changing, alone, steps=80)
    changing.add(joint('grasp', 'low', 'high', 'fixed'))
    run(changing, alone, steps=80)
    np.testing.assert_array_equal(changing.position[:3], alone.position[:3])
    np.testing.assert_array_equal(changing.joint_velocity[:2], alone.joint_velocity)
    assert changing.joint_position[2] == 0.0


def test_what_joins_an_arm_under_way_is_put_to_the_position_that_is_asked_for():
    world = World.from_dict(arm('none'))
    world.step(80)
    before = world.joint_position
    world.add({'name': 'wrist', 'type': 'prismatic', 'parent': 'lower', 'child': 'low',
               'axis': [0, 0, 1], 'child_pose': {'position': [0, 0, 0.5]}, 'position': 0.25,
               'brings_child': True})
    np.testing.assert_allclose(world.joint_position, [*before, 0.25], atol=1e-12)
    position, orientation = world.frame_pose('lower')
    np.testing.assert_allclose(world.orientation[3], orientation, atol=1e-12)
    assert np.linalg.norm(world.position[3] - position) == pytest.approx(0.25, abs=1e-12)
    world.step(50)
    world.reset()
    # At the start the arm is where the scene has it, and what was joined hangs on it.
    np.testing.assert_allclose(world.joint_position, [0.7, -0.3, 0.25], atol=1e-12)


def test_a_body_takes_its_joints_along_and_a_joint_its_couplings():
    links = [crate(name, x, 1.0) for name, x in (('a', 0), ('b', 1), ('c', 2), ('d', 3))]
    world = World.from_dict({'world': {'contact': 'none'}, 'bodies': links, 'joints': [
        joint('one', 'world', 'a', position=(0, 0, 1)), joint('two', 'a', 'b'),
        {**joint('three', 'world', 'c', position=(2, 0, 1)),
         'mimic': {'joint': 'one', 'multiplier': 2.0, 'offset': 0.1}},
        joint('four', 'world', 'd', position=(3, 0, 1))]})
    world.step(10)
    world.remove('a')
    assert world.joint_names == ['three', 'four'] and world.names == ['b', 'c', 'd']
    assert world.scene.spec.joints[0].mimic is None
    assert world.scene.spec.joints[0].position == 0.1
    fall = world.linear_velocity[0, 2]
    world.step(100)
    # b falls freely now: the momentum of a step grows by h g to rounding.
    assert world.linear_velocity[0, 2] - fall == pytest.approx(-0.981, abs=1e-12)


def test_a_loop_that_loses_a_joint_opens():
    world = World.from_dict(arm('none'))
    world.step(50)
    world.add(joint('close', 'world', 'lower', 'spherical', axis=(0, 0, 1), position=tuple(
        world.frame_pose('lower')[0])))
    at = world.position[2]
    world.step(100)
    np.testing.assert_allclose(world.position[2], at, atol=1e-12)
    world.remove('elbow')
    world.step(100)
    np.testing.assert_allclose(world.position[2], at, atol=1e-12)
    world.remove('close')
    velocity = world.linear_velocity[2]
    world.step(100)
    np.testing.assert_allclose(world.linear_velocity[2] - velocity, [0, 0, -0.981], atol=1e-12)


@pytest.mark.parametrize('contact', CONTACTS)
def test_a_snapshot_brings_joints_and_models_along(contact, model):
    world = World.from_dict(arm(contact))
    world.step(30)
    world.add(model)
    world.add(joint('grasp', 'low', 'high', 'fixed'))
    world.set_joint_command('r/hinge', effort=1.0)
    world.step(30)
    world.remove('elbow')
    world.step(30)
    other = World.from_dict(arm(contact))
    other.restore(world.save())
    assert other.joint_names == world.joint_names == ['shoulder', 'r/hinge', 'grasp']
    assert other.state_hash() == world.state_hash()
    run(world, other, steps=100)
    assert other.state_hash() == world.state_hash()
    assert other.save() == world.save()


def test_a_snapshot_of_before_takes_joints_away_again(model):
    world = World.from_dict(arm())
    world.step(20)
    before = world.save()
    world.add(model)
    world.remove('shoulder')
    world.step(5)
    world.restore(before)
    assert world.save() == before and world.joint_names == ['shoulder', 'elbow']


def test_a_world_without_joints_gets_one_and_loses_it():
    """Also where the bodies are numbered by their places, which those of joints are not."""
    many = [GROUND, *(crate(f'b{k}', 0.5 * (k % 20), 0.1 + 0.3 * (k // 20)) for k in range(260))]
    world = World.from_dict({'bodies': many})
    world.step(5)
    before = world.position
    world.add(joint('grasp', 'b3', 'b7', 'fixed'))
    np.testing.assert_allclose(world.position, before, atol=1e-12)
    world.remove('grasp')
    np.testing.assert_allclose(world.position, before, atol=1e-12)
    world.step(5)
    other = World.from_dict({'bodies': many})
    other.restore(world.save())
    run(world, other, steps=5)
    assert world.state_hash() == other.state_hash()


@pytest.mark.parametrize(('part', 'text'), [
    (joint('shoulder', 'low', 'high', 'fixed'), 'unique'),
    (joint('grasp', 'low', 'nobody', 'fixed'), "'nobody' is no body"),
    (joint('grasp', 'low', 'high', 'glued'), 'glued'),
    ({**joint('grasp', 'low', 'high', 'fixed'), 'child_pose': {'position': [1, 0, 0]}}, 'apart'),
    ({'name': 'r', 'file': 'nowhere.urdf'}, 'nowhere.urdf'),
    ({'joints': [], 'bodys': []}, "did you mean 'bodies'"),
    ({'joints': [], 'bodies': 3}, 'bodies'),
    ({'bodies': [crate('new', 9, 9)], 'collision': {'substeps': 3}}, 'ignore'),
])
def test_a_part_that_is_wrong_is_refused_and_changes_nothing(part, text):
    world = World.from_dict(arm())
    world.step(10)
    before, position = world.save(), world.position
    with pytest.raises(ValueError, match=text):
        world.add(part)
    with pytest.raises(ValueError, match='nobody'):
        world.remove('nobody')
    assert world.save() == before
    np.testing.assert_array_equal(world.position, position)


def test_a_joint_whose_loop_cannot_close_is_refused():
    world = hanging(2, angle=0.3)
    world.step(10)
    before = world.save()
    with pytest.raises(ValueError, match=r'stay .* m or rad apart'):
        world.add(joint('far', 'world', 'link1', 'spherical', position=(0, 0, 9),
                        child_pose={'position': [0, 0, 0]}))
    with pytest.raises(ValueError, match=r'stay .* m or rad apart'):
        world.add(joint('far', 'world', 'link1', 'spherical', position=(0, 0, 9),
                        child_pose={'position': [0, 0, 0]}, brings_child=True))
    assert world.save() == before


def test_a_snapshot_of_a_stranger_names_no_files(tmp_path, model):
    world = World.from_dict(arm())
    meta, arrays = unpack(world.save())
    for part in (model, {'models': [model]}, {'name': 'x', 'mass': 1.0, 'shape': {
            'type': 'mesh', 'file': str(tmp_path / 'x.stl')}}):
        with pytest.raises(ValueError, match='makes no sense'):
            world.restore(pack({**meta, 'changes': [['add', part]]}, arrays))


@pytest.mark.parametrize('contact', CONTACTS)
def test_a_session_in_which_joints_and_models_come_and_go_verifies(contact, model, tmp_path):
    world = World.from_dict(arm(contact))
    batch = Batch(world, tmp_path / 'bag', segment_s=0.1)
    batch.run(60)
    world.add(model)
    world.add(joint('grasp', 'low', 'high', 'fixed'))
    batch.run(60)
    world.set_joint_command('r/hinge', effort=2.0)
    batch.tell('remove', name='elbow')
    batch.run(50)
    hash_then = world.state_hash()
    batch.run(10)
    world.remove('r')
    batch.run(60)
    batch.close()
    verdict = verify(tmp_path / 'bag')
    assert verdict.holds, str(verdict.difference)
    assert verdict.steps == 240
    again = World.from_dict(arm(contact))
    find(tmp_path / 'bag', 0.17).apply(again)
    assert again.joint_names == ['shoulder', 'r/hinge', 'grasp']
    assert again.state_hash() == hash_then


def test_a_bag_of_a_robot_that_goes_falls_silent_about_it(model, tmp_path):
    world = World.from_dict({'world': {'contact': 'none'}, 'bodies': [crate('low', 0, 0)],
                             'models': [model]})
    batch = Batch(world, tmp_path / 'bag')
    batch.run(50)
    world.remove('r')
    batch.run(50)
    batch.close()
    verdict = verify(tmp_path / 'bag')
    assert verdict.holds, str(verdict.difference)
