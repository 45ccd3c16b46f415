# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What came into a session later, and what went from it, as plots and films show it."""
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.info import info
from rigid_sim_ros.bag.motion import read_motion
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.plots.contacts import simulate_contacts
from rigid_sim_ros.plots.energies import energies

BALL = {'type': 'sphere', 'radius': 0.1}
GROUND = {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}


def ball(name, x, mass=1.0):
    return {'name': name, 'mass': mass, 'shape': BALL, 'pose': {'position': [x, 0.0, 0.1]}}


@pytest.fixture(name='motion')
def _motion(tmp_path):
    """
    Give the motion of a session of 0.3 s: `second` and a slide come after 0.1 s.

    The first ball goes after 0.2 s, and one was there before the session began.
    """
    world = World.from_dict({'bodies': [GROUND, ball('first', 0.0)]})
    world.add(ball('early', 1.0))
    batch = Batch(world, tmp_path / 'bag')
    batch.run(100)
    world.add({'bodies': [ball('second', 2.0, mass=2.0)], 'joints': [
        {'name': 'slide', 'type': 'prismatic', 'parent': 'world', 'child': 'second',
         'axis': [1, 0, 0], 'pose': {'position': [2.0, 0.0, 0.1]}, 'velocity': 3.0}]})
    batch.run(100)
    world.remove('first')
    batch.run(100)
    batch.close()
    return read_motion(tmp_path / 'bag')


def test_all_that_was_ever_there_is_in_the_scene_and_in_the_motion(motion):
    assert motion.names == list(motion.scene.names) == ['ground', 'first', 'early', 'second']
    assert list(motion.origin.names) == ['ground', 'first']
    assert [joint.type for joint in motion.scene.spec.joints] == ['prismatic']
    assert motion.notes == []
    there = np.isfinite(motion.position).all(axis=2)
    time = motion.time
    np.testing.assert_array_equal(there[:, 2], np.ones(len(time), bool))
    # A state is recorded before what changes the world at its step.
    np.testing.assert_array_equal(there[:, 1], time <= 0.2 + 1e-9)
    np.testing.assert_array_equal(there[:, 3], time > 0.1 + 1e-9)


def test_energies_are_of_what_is_there(motion):
    bodies = np.arange(4)
    found = energies(motion, motion.scene, slice(0, len(motion.time)), bodies)
    came, went = motion.time > 0.1 + 1e-9, motion.time > 0.2 + 1e-9
    # 2 kg slide without friction at 3 m/s; the others rest, at 0.1 m each.
    np.testing.assert_allclose(found.linear, np.where(came, 0.5 * 2.0 * 3.0 ** 2, 0.0), atol=1e-6)
    height = np.where(came, 2.0, 0.0) + np.where(went, 0.0, 1.0) + 1.0
    np.testing.assert_allclose(found.potential, 9.81 * 0.1 * height, rtol=1e-3)


def test_contacts_are_told_of_the_bodies_that_have_them(motion, tmp_path):
    contacts = simulate_contacts(tmp_path / 'bag', motion.origin, np.inf, motion.names)
    assert contacts.note == ''
    # Resting balls press with their weights, of 1 kg each; the one on the slide is carried by it.
    for time, first, early in ((0.09, 9.81, 9.81), (0.19, 9.81, 9.81), (0.29, 0.0, 9.81)):
        row = int(np.argmin(np.abs(contacts.time - time)))
        assert contacts.force[row, 1:3] == pytest.approx([first, early], rel=1e-3)
    assert np.isnan(contacts.gap[contacts.time < 0.1, 3]).all()
    assert np.isfinite(contacts.gap[contacts.time > 0.11, 3]).all()


def test_a_batch_that_records_no_states_records_all_else_and_is_verified(tmp_path):
    batch = Batch(World.from_dict({'bodies': [GROUND, ball('first', 0.0)]}), tmp_path / 'bag',
                  publish_rate=0.0, hash_interval=10)
    batch.run(100)
    batch.close()
    topics = info(tmp_path / 'bag').topics
    assert topics['/rigid_sim/first/pose'][1] == 0
    assert topics['/rigid_sim/state_hash'][1] == 11
    assert verify(tmp_path / 'bag').holds


@pytest.mark.parametrize('option', [{'publish_rate': -1.0}, {'publish_rate': float('nan')},
                                    {'hash_interval': -1}])
def test_a_batch_refuses_what_is_no_rate(tmp_path, option):
    world = World.from_dict({'bodies': [ball('first', 0.0)]})
    (name, value), = option.items()
    with pytest.raises(ValueError, match=f'{name} {value}.*must be'):
        Batch(world, tmp_path / 'bag', **option)
    assert not (tmp_path / 'bag').exists()
