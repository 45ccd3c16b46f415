# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds in which bodies touch, through every contact model."""

import numpy as np
import pytest

from rigid_sim_ros import load_scene, World
from rigid_sim_ros.world.snapshot import pack, unpack

MODELS = ({'contact': 'timestep'}, {'contact': 'timestep', 'solver': 'qp'}, {'contact': 'event'},
          {'contact': 'penalty', 'step': 5e-4})
G = 9.81


def two_boxes(**world) -> World:
    """Return a box of 2 kg on a box of 3 kg on the ground, at rest."""
    return World.from_dict({
        # Of the penalty model: m g * 20 s/m = 980 N s/m on 5 kg and 2e5 N/m, half of critical.
        'format': 1, 'world': world, 'materials': {'default': {'damping': 20.0}},
        'bodies': [
            {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}},
            {'name': 'lower', 'mass': 3.0, 'shape': {'type': 'box', 'size': [1, 1, 1]},
             'pose': {'position': [0, 0, 0.5]}},
            {'name': 'upper', 'mass': 2.0, 'shape': {'type': 'box', 'size': [0.6, 0.6, 0.6]},
             'pose': {'position': [0, 0, 1.3]}}]})


@pytest.fixture(scope='module', params=MODELS,
                ids=lambda model: '-'.join(map(str, model.values())))
def settled(request) -> World:
    world = two_boxes(**request.param)
    world.step(round(1.0 / (world.step_ns * 1e-9)))
    return world


@pytest.fixture
def world(settled: World) -> World:
    """Return a world of its own in the settled state."""
    fresh = World(settled.scene)
    fresh.restore(settled.save())
    fresh.step(1)
    return fresh


def test_the_boxes_stay_where_they_are(world):
    # The penalty model sinks by m g / (4 k) with k = 5e4 N/m for a pair: 0.25 mm below both.
    assert np.allclose(world.position[:, 2], [0.0, 0.5, 1.3], atol=1e-3)
    assert np.allclose(world.position[:, :2], 0.0, atol=1e-6)


def test_contact_forces_carry_the_weights(world):
    rows = world.contacts()
    on_ground = rows['normal_force'][rows['body_a'] == 0].sum()
    between = rows['normal_force'][rows['body_a'] == 1].sum()
    assert on_ground == pytest.approx(5.0 * G, rel=1e-4)
    assert between == pytest.approx(2.0 * G, rel=1e-4)


def test_normals_point_from_a_to_b(world):
    rows = world.contacts()
    assert set(rows['body_a'].tolist()) == {0, 1}
    assert np.allclose(rows['normal'], [0, 0, 1], atol=1e-6)


def test_contact_points_lie_on_the_surfaces(world):
    rows = world.contacts()
    lower = rows[rows['body_a'] == 0]
    assert np.allclose(np.sort(np.abs(lower['point'][:, :2]).ravel()), 0.5, atol=1e-3)
    assert np.allclose(lower['point'][:, 2], 0.0, atol=1e-3)


def test_net_contact_wrenches_balance_the_weights(world):
    wrenches = world.contact_wrenches()
    assert np.allclose(wrenches[:, 2], [-5 * G, 3 * G, 2 * G], atol=5e-3)
    assert np.allclose(wrenches[:, 3:], 0.0, atol=5e-3)


def test_the_same_steps_give_the_same_hash(world, settled):
    other = World(settled.scene)
    other.restore(settled.save())
    other.step(1)
    assert other.state_hash() == world.state_hash()


def test_a_world_restored_in_the_middle_of_contact_goes_on_bit_for_bit(world):
    world.apply_wrench('upper', (3.0, 0.0, 0.0), duration=0.05)
    saved = world.save()
    world.step(30)
    expected = world.state_hash()
    world.restore(saved)
    world.step(30)
    assert world.state_hash() == expected


@pytest.mark.parametrize('sleep_after', [0.0, 100.0])
def test_a_wrench_that_is_over_leaves_nothing(sleep_after):
    world = World.from_dict({
        'format': 1, 'materials': {'default': {'friction': 0.0}},
        'world': {'contact': 'timestep', 'step': 0.001},
        'collision': {'sleep_after': sleep_after},
        'bodies': [{'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}},
                   {'name': 'puck', 'mass': 2.0, 'shape': {'type': 'sphere', 'radius': 0.1},
                    'pose': {'position': [0, 0, 0.1]}}]})
    world.step(5)
    for pushes in range(1, 4):
        world.apply_wrench('puck', (4.0, 0.0, 0.0), duration=0.002)
        for _ in range(3):
            world.step(2)
            # 4 N for 2 ms on 2 kg; without friction nothing else acts along x.
            assert world.linear_velocity[1, 0] == pytest.approx(0.004 * pushes, rel=1e-12)


def test_a_snapshot_of_another_layout_is_refused_and_changes_nothing(world):
    meta, arrays = unpack(world.save())
    # As it was laid out once: four places for each manifold, whether there are points or not.
    other = arrays | {'manifold_gap': np.zeros((len(arrays['manifold_points']), 4))}
    world.step(10)
    before = world.state_hash()
    with pytest.raises(ValueError, match='manifold_gap in the snapshot'):
        world.restore(pack(meta, other))
    assert world.state_hash() == before
    world.step(10)
    assert world.state_hash() != before


def test_a_world_restored_goes_on_bit_for_bit_whatever_was_near_before():
    # The fast ball makes the world look far ahead at first: what was near then is not any more.
    world = load_scene('tower')
    for _ in range(8):
        world.step(91)
        other = World(world.scene)
        other.restore(world.save())
        for each in (world, other):
            each.step(10)
        assert other.state_hash() == world.state_hash()


def test_a_tower_that_is_knocked_over_gains_no_energy():
    world = load_scene('tower')

    def energy():
        return world.kinetic_energy() + world.potential_energy()

    least = energy()
    for _ in range(60):
        world.step(10)
        # What is pushed out of an overlap of 1e-4 sizes is lifted: 1e-3 of what there is.
        assert energy() < least + 1e-3 * abs(least)
        least = min(least, energy())


def test_reset_forgets_the_contacts(world):
    world.reset()
    world.step(5)
    fresh = World(world.scene)
    fresh.step(5)
    assert world.state_hash() == fresh.state_hash()


def test_the_report_counts_pairs_and_contacts(world):
    report = world.contact_report()
    assert (report.pairs, report.contacts) == (2, 8)
    assert 0.0 <= report.deepest < 1e-3
    assert report.message == ''


def test_a_world_alone_with_itself_has_no_contacts():
    world = World.from_dict({'format': 1, 'bodies': [
        {'name': 'b', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 1.0}}]})
    world.step(3)
    assert len(world.contacts()) == 0
    assert not world.contact_wrenches().any()


@pytest.mark.parametrize('model', ['timestep', 'event'])
def test_a_bounce_is_in_the_contact_force_of_its_step(model):
    world = World.from_dict({
        'format': 1, 'world': {'contact': model, 'gravity': [0, 0, 0]},
        'materials': {'default': {'restitution': 1.0, 'friction': 0.0}}, 'bodies': [
            {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}},
            {'name': 'ball', 'mass': 2.0, 'shape': {'type': 'sphere', 'radius': 0.1},
             'pose': {'position': [0, 0, 0.1505]}, 'twist': {'linear': [0, 0, -5.0]}}]})
    pushed = 0.0
    for _ in range(20):
        world.step()
        pushed += world.contacts()['normal_force'].sum() * 1e-3
    assert world.linear_velocity[1, 2] == pytest.approx(5.0, rel=1e-9)
    assert pushed == pytest.approx(2.0 * 10.0, rel=1e-9)  # m times the change of velocity
