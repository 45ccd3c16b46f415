# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The number of threads changes no bit of what a world does."""

import time
from typing import Any

from dropping import SHAPES
import numpy as np
import pytest

from rigid_sim_ros import load_scene, World

LONGEST = 60.0      # s until the helper must have done something


def crowd(kinds: list[str], restitution: float, **collision: Any) -> World:
    """Return 480 bodies that fall onto the ground and each other."""
    rng = np.random.default_rng(5)
    bodies = []
    for k in range(480):
        q, shape = rng.normal(size=4), SHAPES[kinds[k % len(kinds)]]
        place = 0.2 * np.array([k % 8 - 3.5, k // 8 % 8 - 3.5, k // 64 + 0.6])
        bodies.append({
            'name': f'b{k}', 'density': 500.0,
            **(shape if 'compound' in shape else {'shape': shape}),
            'pose': {'position': (place + rng.uniform(-0.01, 0.01, 3)).tolist(),
                     'orientation': (q / np.linalg.norm(q)).tolist()},
            'twist': {'linear': rng.normal(0, 0.3, 3).tolist()}})
    surface = {'friction': 0.4, 'restitution': restitution}
    return World.from_dict({
        'format': 1, 'world': {'contact': 'timestep', 'step': 1 / 240},
        'collision': collision, 'materials': {'default': surface},
        'bodies': [{'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}, *bodies]})


@pytest.mark.parametrize('kinds, restitution, collision', [
    (['sphere'], 0.0, {}), (['box'], 0.0, {}), (sorted(SHAPES), 0.0, {'sleep_after': 0.1}),
    (['sphere', 'box', 'capsule'], 0.1, {'continuous': True})])
def test_two_threads_give_the_hash_of_one_at_every_step(kinds, restitution, collision):
    one, two = crowd(kinds, restitution, **collision), crowd(kinds, restitution, **collision)
    two.threads = 2
    helper, begun, steps = two._contact._helper, time.monotonic(), 0
    # The helper compiles its part first.
    while steps < 80 or (helper.done < 500 and time.monotonic() - begun < LONGEST):
        one.step()
        two.step()
        steps += 1
        assert one.state_hash() == two.state_hash(), f'step {steps}'
    assert helper.done >= 500


def test_a_world_may_change_its_mind_about_threads():
    one, other = crowd(['sphere'], 0.0), crowd(['sphere'], 0.0)
    for threads in (1, 2, 2, 1, 2):
        other.threads = threads
        one.step(20)
        other.step(20)
        assert other.threads == threads
        assert one.state_hash() == other.state_hash()


@pytest.mark.parametrize('threads', [0, -1, 1.5, True, '2', None])
def test_wrong_numbers_of_threads_are_refused(threads):
    world = load_scene('tower')
    with pytest.raises(ValueError, match='must be a whole number > 0'):
        world.threads = threads
    assert world.threads == 1
