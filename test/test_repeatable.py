# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds of bodies that touch repeat bit for bit, whatever the bodies and the contact model."""

from typing import Any

from dropping import SHAPES
from effort import examples
from hypothesis import example, given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros import World

MODELS: dict[str, dict[str, Any]] = {
    'timestep': {'contact': 'timestep'},
    'qp': {'contact': 'timestep', 'solver': 'qp'},
    'event': {'contact': 'event'},
    'penalty': {'contact': 'penalty', 'step': 2.5e-4},
}
SCENES = {'kinds': st.lists(st.sampled_from(sorted(SHAPES)), min_size=1, max_size=3),
          'seed': st.integers(0, 2 ** 32 - 1), 'friction': st.sampled_from([0.0, 0.4]),
          'restitution': st.sampled_from([0.0, 0.7])}
every_model = pytest.mark.parametrize('model', MODELS)


def heap(model: str, kinds: list[str], seed: int, friction: float, restitution: float) -> World:
    """Return bodies that overlap the ground and each other a little, and move."""
    rng = np.random.default_rng(seed)
    bodies = []
    for k, kind in enumerate(kinds):
        q, shape = rng.normal(size=4), SHAPES[kind]
        bodies.append({
            'name': f'b{k}', 'density': 500.0,
            **(shape if 'compound' in shape else {'shape': shape}),
            'pose': {'position': [*rng.uniform(-0.05, 0.05, 2).tolist(), 0.15 + 0.2 * k],
                     'orientation': (q / np.linalg.norm(q)).tolist()},
            'twist': {'linear': rng.normal(0, 0.5, 3).tolist(),
                      'angular': rng.normal(0, 2, 3).tolist()}})
    surface = {'friction': friction, 'restitution': restitution}
    return World.from_dict({
        'format': 1, 'world': MODELS[model], 'materials': {'default': surface},
        'bodies': [{'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}, *bodies]})


@every_model
@examples(10)
@given(**SCENES)
def test_the_same_scene_gives_the_same_hash_at_every_step(model, **scene):
    one, other = heap(model, **scene), heap(model, **scene)
    for _ in range(12):
        one.step()
        other.step()
        assert one.state_hash() == other.state_hash()


@every_model
@examples(10)
@given(**SCENES)
def test_steps_at_once_give_the_hash_of_single_steps(model, **scene):
    one, other = heap(model, **scene), heap(model, **scene)
    one.step(20)
    for _ in range(20):
        other.step()
    assert one.state_hash() == other.state_hash()


@every_model
@examples(10)
# A friction impulse of -0.0.
@example(kinds=['compound', 'box'], seed=0, friction=0.0, restitution=0.0, before=16)
@given(**SCENES, before=st.integers(0, 25))
def test_a_world_restored_in_the_middle_of_contact_goes_on_bit_for_bit(model, before, **scene):
    world = heap(model, **scene)
    world.step(before)
    saved, hashes = world.save(), []
    for _ in range(12):
        world.step()
        hashes.append(world.state_hash())
    restored = heap(model, **scene)
    restored.restore(saved)
    assert restored.save() == saved
    for expected in hashes:
        restored.step()
        assert restored.state_hash() == expected


@every_model
@examples(6)
@given(**SCENES)
def test_a_world_that_was_reset_runs_like_a_new_one(model, **scene):
    world, fresh = heap(model, **scene), heap(model, **scene)
    world.step(15)
    world.reset()
    world.step(10)
    fresh.step(10)
    assert world.state_hash() == fresh.state_hash()
