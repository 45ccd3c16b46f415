# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A session with joints: what their drives were told is recorded, and simulated again."""
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.verify import verify

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
    """Give a session: a drive is told to move, a joint is put, a body comes and goes."""
    world = World.from_dict(ARM)
    batch = Batch(world, tmp_path / 'bag', segment_s=0.3)
    batch.run(200)
    world.set_joint_command('shoulder', mode='position', position=0.2, duration=0.25)
    batch.run(300)
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


def test_a_session_without_what_a_drive_was_told_does_not(bag, monkeypatch):
    monkeypatch.setattr(World, 'set_joint_command', lambda *_, **__: None)
    assert not verify(bag).holds


def test_a_body_that_a_joint_holds_cannot_go():
    world = World.from_dict(ARM)
    before = world.save()
    with pytest.raises(ValueError, match='joints'):
        world.remove('lower')
    assert world.save() == before
