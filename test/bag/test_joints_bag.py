# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A session with joints: what their drives were told is recorded, and simulated again."""
import math

import numpy as np
import pytest

from rigid_sim_ros import load_scene, World
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.bag.resume import find
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.messages import decode
from rigid_sim_ros.messages.codec import JointStateEncoder
from rigid_sim_ros.world.commands import Command

DRIVE = {'mode': 'position', 'stiffness': 50.0, 'damping': 3.0}


def link(name, z):
    return {'name': name, 'mass': 1.0, 'shape': {'type': 'box', 'size': [0.1, 0.1, 0.5]},
            'pose': {'position': [0.0, 0.0, z]}}


ARM = {
    'format': 1, 'world': {'contact': 'none'},
    'bodies': [link('upper', -0.25), link('lower', -0.75)],
    'joints': [
        {'name': 'shoulder', 'type': 'revolute', 'parent': 'world', 'child': 'upper',
         'axis': [0, 1, 0], 'position': 1.0, 'drive': DRIVE},
        {'name': 'elbow', 'type': 'revolute', 'parent': 'upper', 'child': 'lower',
         'pose': {'position': [0, 0, -0.25]}, 'axis': [0, 1, 0], 'position': -0.5}]}


@pytest.fixture(name='bag')
def _bag(tmp_path):
    """
    Give a session of all that joints are told, with a body that comes and goes.

    A drive is told to move, a joint is put, and a trajectory is under way from 0.4 s on.
    """
    world = World.from_dict(ARM)
    batch = Batch(world, tmp_path / 'bag', segment_s=0.3)
    batch.run(200)
    world.set_joint_command('shoulder', mode='position', position=0.2, duration=0.25)
    batch.run(200)
    world.follow_trajectory(['shoulder'], [0.2, 0.4], [[0.3], [0.5]], [[math.nan], [0.0]])
    batch.run(100)
    world.set_joint_state('elbow', 0.7)
    batch.run(200)
    world.add(link('guest', 5.0))
    batch.run(100)
    world.remove('guest')
    batch.run(100)
    batch.close()
    return tmp_path / 'bag'


def test_a_session_with_joints_verifies(bag):
    verdict = verify(bag)
    assert verdict.holds, str(verdict.difference)
    assert verdict.steps == 900


@pytest.mark.parametrize('command', ['set_joint_command', 'follow_trajectory', 'set_joint_state'])
def test_a_session_without_what_a_joint_was_told_does_not(bag, monkeypatch, command):
    monkeypatch.setattr(World, command, lambda *_, **__: None)
    verdict = verify(bag)
    assert not verdict.holds
    assert verdict.difference.text


def test_a_joint_state_that_is_another_is_named(bag, monkeypatch):
    honest = JointStateEncoder.encode

    def encode(self, t_ns, position, velocity, effort):
        change = np.array([1.0, 0.0]) * (t_ns == 500_000_000)
        return honest(self, t_ns, position, velocity, effort + change)
    monkeypatch.setattr(JointStateEncoder, 'encode', encode)
    difference = verify(bag).difference
    assert (difference.step, difference.body) == (500, '')
    assert "/rigid_sim/joint_states differs at joint 'shoulder' by 1:" in str(difference)


def test_a_joint_state_of_a_model_is_not_told_of_a_body(tmp_path, monkeypatch):
    batch = Batch(World.from_dict({**ARM, 'joints': [
        {**joint, 'name': f'arm/{joint["name"]}'} for joint in ARM['joints']]}), tmp_path / 'bag')
    batch.run(50)
    batch.close()
    honest = JointStateEncoder.encode
    monkeypatch.setattr(JointStateEncoder, 'encode', lambda self, t_ns, position, *rest: honest(
        self, t_ns, position + 1.0, *rest))
    difference = verify(tmp_path / 'bag').difference
    assert difference.body == ''
    assert str(difference).startswith('step 0: /rigid_sim/arm/joint_states differs at joint')


def test_a_session_that_lists_no_joint_states_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr('rigid_sim_ros.bag.batch.joint_topics', lambda *_: [])
    batch = Batch(World.from_dict(ARM), tmp_path / 'bag')
    batch.run(10)
    batch.close()
    assert 'does not list the joint states' in str(verify(tmp_path / 'bag').difference)


def test_a_node_could_go_on_in_the_midst_of_a_trajectory(bag):
    moment, end = find(bag, 0.55), find(bag, 0.65)      # nothing is told in between
    world, whole = World(moment.scene), World(end.scene)
    moment.apply(world)
    end.apply(whole)
    assert not world._paths.are_empty
    world.step(100)
    assert world.state_hash() == whole.state_hash()


def test_a_trajectory_of_joints_that_carry_by_contact_is_verified(tmp_path):
    world = load_scene('gripper')
    batch = Batch(world, tmp_path / 'bag')
    batch.run(50)
    before = world.joint_position[0]
    world.follow_trajectory(['lift'], [0.1], [[before + 0.01]], [[0.0]])
    batch.run(150)
    batch.close()
    assert world.joint_position[0] > before + 0.005
    assert verify(tmp_path / 'bag').holds


def test_the_description_of_a_model_is_recorded_once_and_verified(tmp_path):
    batch = Batch(World.from_dict({**ARM, 'descriptions': {'arm': '<robot/>'}}), tmp_path / 'bag')
    batch.run(200)
    batch.close()
    said = [decode.string(data) for topic, _, data in BagReader(tmp_path / 'bag').messages()
            if topic == '/rigid_sim/arm/robot_description']
    assert said == ['<robot/>']
    assert verify(tmp_path / 'bag').holds


@pytest.mark.parametrize('kind, arguments', [
    ('set_joint_commands', {'commands': 7}), ('set_joint_commands', {'commands': {'elbow': 7}}),
    ('set_joint_commands', {'commands': {'shoulder': {'speed': 1.0}}}),
    ('set_joint_states', {'states': 7}), ('set_joint_states', {'states': {'elbow': 7}}),
    ('follow_trajectory', {'names': 7, 'times': [1.0], 'positions': [[1.0]]}),
    ('follow_trajectory', {'names': [['shoulder']], 'times': [1.0], 'positions': [[1.0]]}),
    ('follow_trajectory', {'names': ['shoulder'], 'times': 'soon', 'positions': {}}),
    ('follow_trajectory', {'names': ['shoulder'], 'times': [1.0], 'positions': [[1.0]],
                           'start': 'now'})])
def test_an_event_that_tells_joints_nonsense_is_refused(kind, arguments):
    world = World.from_dict(ARM)
    before = world.save()
    with pytest.raises((ValueError, TypeError)):
        world.apply(Command(kind, arguments))
    assert world.save() == before


def test_a_body_that_goes_takes_its_joints_along():
    world = World.from_dict(ARM)
    world.remove('lower')
    assert (world.names, world.joint_names) == (['upper'], ['shoulder'])
    before = world.save()
    with pytest.raises(ValueError, match='bodies'):
        world.remove('upper')
    assert world.save() == before


def test_the_velocity_of_a_joint_that_closes_a_loop_is_told(tmp_path):
    bars = [{'name': name, 'mass': 1.0, 'shape': {'type': 'box', 'size': [0.1, 0.1, 0.5]},
             'pose': {'position': [x, 0.0, z], 'orientation': q}}
            for name, x, z, q in (('left', 0.0, 0.25, [0, 0, 0, 1]),
                                  ('top', 0.25, 0.5, [0, math.sqrt(0.5), 0, math.sqrt(0.5)]),
                                  ('right', 0.5, 0.25, [0, 0, 0, 1]))]

    def hinge(name, parent, child, x, z):
        return {'name': name, 'type': 'revolute', 'parent': parent, 'child': child,
                'axis': [0, 1, 0], 'pose': {'position': [x, 0, z]}}
    world = World.from_dict({
        'world': {'contact': 'none', 'gravity': [1.0, 0.0, -9.81]}, 'bodies': bars,
        'joints': [hinge('a', 'world', 'left', 0, 0), hinge('b', 'left', 'top', 0, 0.25),
                   hinge('d', 'world', 'right', 0.5, 0), hinge('c', 'right', 'top', 0, 0.25)]})
    batch = Batch(world, tmp_path / 'bag')
    batch.run(100)
    batch.close()
    data = [data for topic, _, data in BagReader(tmp_path / 'bag').messages()
            if topic == '/rigid_sim/joint_states'][-1]
    _, _, names, numbers = decode.joint_state(data)
    # A parallelogram: both cranks turn alike, and the bar between them not at all.
    velocity = dict(zip(names, numbers[:, 1], strict=True))
    assert abs(velocity['a']) > 0.05
    for name, sign in (('b', -1), ('c', -1), ('d', 1)):
        assert abs(velocity[name] - sign * velocity['a']) < 1e-12
    assert verify(tmp_path / 'bag').holds


def test_a_session_in_which_an_arm_sleeps_verifies(tmp_path):
    stiff = DRIVE | {'stiffness': 1000.0, 'damping': 100.0}
    world = World.from_dict({**ARM, 'world': {}, 'collision': {'sleep_after': 0.1}, 'joints': [
        joint | {'drive': stiff | {'position': joint['position']}} for joint in ARM['joints']]})
    batch = Batch(world, tmp_path / 'bag', segment_s=0.3)
    batch.run(1000)
    assert world.contact_report().asleep == 2
    world.set_joint_command('shoulder', mode='position', position=0.9)
    batch.run(20)
    assert world.contact_report().asleep == 0
    batch.run(1000)
    assert world.contact_report().asleep == 2
    batch.close()
    assert verify(tmp_path / 'bag').holds
