# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies come and go between two steps; the others go on as if nothing had happened."""
from dropping import SHAPES
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.world.snapshot import pack, unpack

GROUND = {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}
BOX = {'type': 'box', 'size': [0.2, 0.2, 0.2]}
MODELS = [('timestep', None, 1e-3), ('timestep', 'qp', 1e-3), ('event', None, 1e-3),
          ('penalty', None, 2e-4), ('none', None, 1e-3)]


def body(name, x, z, shape=BOX, **more):
    solid = shape if 'compound' in shape else {'shape': shape}
    return {'name': name, **solid, 'mass': 1.0, 'pose': {'position': [x, 0.0, z]}, **more}


def scene(*bodies, model=MODELS[0], **more):
    contact, solver, step = model
    world = {'contact': contact, 'step': step} | ({'solver': solver} if solver else {})
    return {'format': 1, 'world': world, 'bodies': [GROUND, *bodies], **more}


def heap():
    """Return bodies of all shapes that fall on each other."""
    return [body(f'{name}', 0.02 * k, 0.3 + 0.4 * k, shape)
            for k, (name, shape) in enumerate(SHAPES.items())]


@pytest.mark.parametrize('model', MODELS, ids=str)
def test_what_comes_far_away_and_goes_again_leaves_no_trace(model):
    """Hash for hash: the sums of the others are formed in the same order as before."""
    changing, alone = (World.from_dict(scene(*heap(), model=model)) for _ in range(2))
    for world in (changing, alone):
        world.step(250)
    changing.add(body('guest', 50.0, 0.1))
    assert changing.names == [*alone.names, 'guest']
    for world in (changing, alone):
        world.step(60)
    assert np.array_equal(changing.position[:-1], alone.position)
    assert np.array_equal(changing.angular_momentum[:-1], alone.angular_momentum)
    changing.remove('guest')
    assert changing.state_hash() == alone.state_hash()
    for world in (changing, alone):
        world.step(60)
    assert changing.state_hash() == alone.state_hash()


@pytest.mark.parametrize('model', MODELS, ids=str)
def test_a_body_that_comes_before_the_first_step_was_there_from_the_start(model):
    bodies = heap()
    late = World.from_dict(scene(*bodies[:-1], model=model))
    late.add(bodies[-1])
    there = World.from_dict(scene(*bodies, model=model))
    for world in (late, there):
        world.step(150)
    assert late.state_hash() == there.state_hash()


def test_a_body_in_the_middle_goes_and_what_lay_on_it_falls():
    world = World.from_dict(scene(body('low', 0, 0.1), body('high', 0, 0.3), body('far', 3, 0.1)))
    world.step(300)
    far = world.position[3]
    world.remove('low')
    assert world.names == ['ground', 'high', 'far']
    world.step(100)
    # 0.1 s of free fall.
    assert world.position[1, 2] == pytest.approx(0.3 - 0.5 * 9.81 * 0.1 ** 2, abs=1e-3)
    assert np.abs(world.position[2] - far).max() < 1e-12


def test_what_slept_on_a_body_that_goes_wakes():
    world = World.from_dict(scene(body('low', 0, 0.1), body('high', 0, 0.3), body('top', 0, 0.5),
                                  body('far', 3, 0.1), collision={'sleep_after': 0.1}))
    world.step(400)
    assert world.contact_report().asleep == 4
    world.remove('low')
    world.step(1)
    assert world.contact_report().asleep == 1
    world.step(1000)
    assert world.position[1:3, 2] == pytest.approx([0.1, 0.3], abs=1e-3)


def test_a_snapshot_brings_its_bodies_along():
    base = scene(body('low', 0, 0.1), body('high', 0, 0.3))
    world = World.from_dict(base)
    world.step(50)
    world.add(body('guest', 0.05, 0.6, SHAPES['cylinder']))
    world.step(50)
    world.remove('low')
    world.apply_wrench('guest', (1.0, 0.0, 0.0), duration=1.0)
    world.step(50)
    other = World.from_dict(base)
    other.restore(world.save())
    assert (other.names, other.step_index) == (world.names, 150)
    assert other.state_hash() == world.state_hash()
    for one in (world, other):
        one.step(300)
    assert other.state_hash() == world.state_hash()
    assert other.save() == world.save()


def test_a_snapshot_of_before_takes_bodies_away_again():
    world = World.from_dict(scene(body('low', 0, 0.1)))
    world.step(20)
    before, seen = world.save(), []
    world.observe(lambda step, command: seen.append(command.kind))
    world.add(body('guest', 1.0, 0.1))
    world.restore(before)
    assert world.names == ['ground', 'low'] and world.save() == before
    world.add(body('guest', 1.0, 0.1))
    assert seen == ['add', 'add']       # who observes goes on observing


@pytest.mark.parametrize('changes', [
    7, [['add']], [['add', 'low']], [['remove', {}]], [['rename', 'low']], [['remove', 'nobody']],
    [['add', {'name': 'low'}]], [['add', {'name': 'x', 'shape': {'type': 'box'}}]],
    [['add', {}]],
])
def test_a_snapshot_with_changes_that_cannot_be_is_refused_and_changes_nothing(changes):
    world = World.from_dict(scene(body('low', 0, 0.1)))
    world.step(10)
    meta, arrays = unpack(world.save())
    before = world.save()
    with pytest.raises(ValueError):
        world.restore(pack({**meta, 'changes': changes}, arrays))
    assert world.save() == before


def test_wrenches_forces_and_pairs_go_with_a_body():
    spring = {'type': 'spring', 'a': 'guest', 'b': 'low', 'stiffness': 10.0, 'rest_length': 1.0}
    wind = {'type': 'wind', 'bodies': ['guest', 'low'], 'drag': 0.1, 'velocity': [1, 0, 0]}
    world = World.from_dict(scene(body('low', 0, 0.1), body('guest', 1, 0.1), body('far', 5, 0.1),
                                  forces=[spring, wind],
                                  collision={'ignore': [['low', 'guest'], ['low', 'far']]}))
    world.apply_wrench('guest', (1.0, 0, 0), duration=1.0, source='push')
    world.apply_wrench('far', (1.0, 0, 0), frame='guest', duration=1.0, source='in its frame')
    world.apply_wrench('far', (10.0, 0, 0), frame='far', duration=1.0, source='own')
    world.step(5)
    world.remove('guest')
    assert world.wrench_sources == ['own']
    assert [force.type for force in world.scene.spec.forces] == ['wind']
    assert world.scene.spec.collision.ignore == (('low', 'far'),)
    world.step(5)
    assert world.linear_momentum[2, 0] > 0.0


@pytest.mark.parametrize(('part', 'text'), [
    (body('low', 1, 0.1), 'unique'),
    ({'name': 'new', 'shape': {'type': 'box', 'size': [1, 1]}, 'mass': 1.0}, 'size'),
    ({'name': 'new', 'shape': BOX}, 'mass'),
    ({'name': 'new', 'colour': 'red', 'shape': BOX, 'mass': 1.0}, 'colour'),
    ('new', 'bodies'),
])
def test_a_body_that_is_wrong_is_refused_and_changes_nothing(part, text):
    world = World.from_dict(scene(body('low', 0, 0.1)))
    world.step(10)
    before = world.save()
    with pytest.raises(ValueError, match=text):
        world.add(part)
    with pytest.raises(ValueError, match='nobody'):
        world.remove('nobody')
    assert world.save() == before


def test_many_bodies_keep_their_numbers():
    """From 256 moving bodies on they are numbered by their places, which a guest must not stir."""
    many = [body(f'b{k}', 0.5 * (k % 20), 0.1 + 0.3 * (k // 20)) for k in range(300)]
    changing, alone = (World.from_dict(scene(*many)) for _ in range(2))
    for world in (changing, alone):
        world.step(30)
    changing.add(body('guest', 50.0, 0.1))
    changing.remove('guest')
    for world in (changing, alone):
        world.step(30)
    assert changing.state_hash() == alone.state_hash()
    other = World.from_dict(scene(*many))
    changing.remove('b7')
    changing.step(5)
    other.restore(changing.save())
    assert other.state_hash() == changing.state_hash()


def test_contacts_of_many_bodies_are_found_anew_when_a_joint_gives_them_other_numbers():
    """Tables of joints have the bodies in the order of the scene; without any, places count."""
    names = [f'b{k}' for k in range(0, 264, 2)] + [f'b{k}' for k in range(1, 264, 2)]
    start = scene(*(body(name, 0.5 * (int(name[1:]) // 2), 0.1 + 0.2 * (int(name[1:]) % 2))
                    for name in names), collision={'sleep_after': 0.02})
    world, other = World.from_dict(start), World.from_dict(start)
    world.step(60)
    assert world.contact_report().asleep == 264
    world.add({'name': 'hold', 'type': 'fixed', 'parent': 'b0', 'child': 'b1'})
    other.restore(world.save())
    for one in (world, other):
        one.step(1)
    assert other.state_hash() == world.state_hash()
    assert (world.contacts()['body_a'] < world.contacts()['body_b']).all()
    # The floor carries all, and each lower body its upper one, but for the one that is held.
    assert world.contacts()['normal_force'].sum() == pytest.approx((264 + 131) * 9.81, rel=1e-9)


def test_reset_puts_what_is_there_where_it_began():
    world = World.from_dict(scene(body('low', 0, 0.1), body('high', 0, 0.3)))
    world.step(10)
    world.add(body('guest', 2, 1.0))
    world.remove('low')
    world.step(10)
    world.reset()
    assert world.names == ['ground', 'high', 'guest'] and world.step_index == 0
    assert world.position[:, 2].tolist() == [0.0, 0.3, 1.0]


def test_a_session_in_which_bodies_come_and_go_verifies(tmp_path):
    world = World.from_dict(scene(body('low', 0, 0.1), body('high', 0, 0.3)))
    batch = Batch(world, tmp_path / 'bag', segment_s=0.2)
    batch.run(100)
    world.add(body('guest', 0.0, 0.7, SHAPES['mesh']))
    batch.run(150)
    world.remove('low')
    batch.run(150)
    batch.tell('add', part=body('low', 0.0, 2.0))
    batch.run(200)
    batch.close()
    verdict = verify(tmp_path / 'bag')
    assert verdict.holds, str(verdict.difference)
    assert verdict.steps == 600


def test_a_session_that_begins_with_a_changed_world_verifies(tmp_path):
    world = World.from_dict(scene(body('low', 0, 0.1), body('high', 0, 0.3)))
    world.step(50)
    world.add(body('guest', 0.0, 0.7))
    world.remove('low')
    batch = Batch(world, tmp_path / 'bag')
    batch.run(300)
    batch.close()
    file, = (tmp_path / 'bag').glob('*.mcap')
    for bag in (tmp_path / 'bag', file):
        verdict = verify(bag)
        assert verdict.holds, str(verdict.difference)


def test_a_file_of_a_session_in_which_a_body_came_again_holds_by_itself(tmp_path):
    """Before the session began it had gone, so it has no topic; later nothing tells that."""
    world = World.from_dict(scene(body('low', 0, 0.1), body('high', 0, 0.3)))
    world.remove('low')
    batch = Batch(world, tmp_path / 'bag')
    batch.run(100)
    world.add(body('low', 0, 0.1))
    batch.run(100)
    batch.close()
    file, = (tmp_path / 'bag').glob('*.mcap')
    assert verify(file).holds
    assert 'low' not in world.lasting_bodies
