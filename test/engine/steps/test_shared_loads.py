# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What redundant supports bear: the smallest forces, which are symmetric where the scene is."""

from hypothesis import assume, given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros import World


def loads(world):
    """Return the normal force on each fixed body, as a part of the weight of all that moves."""
    total = np.zeros(len(world.names))
    for point in world.contacts():
        total[point['body_a']] += point['normal_force']
        total[point['body_b']] += point['normal_force']
    fixed = np.array([body.fixed for body in world.scene.spec.bodies])
    return total[fixed] / (9.81 * np.nansum(np.where(fixed, 0.0, world.mass)))


def on_pads(contact, board, pads, mu, h):
    """Return the loads of pads, each x, y and width [m], below a board of 0.1 m in height."""
    world = World.from_dict({
        'format': 1, 'world': {'contact': contact, 'step': h},
        'materials': {'default': {'friction': mu}},
        'bodies': [{'name': 'board', 'shape': board, 'mass': 3.0,
                    'pose': {'position': [0, 0, 0.05]}},
                   *({'name': f'pad{k}', 'fixed': True, 'pose': {'position': [x, y, -0.05]},
                      'shape': {'type': 'box', 'size': [width, width, 0.1]}}
                     for k, (x, y, width) in enumerate(pads))]})
    world.step(20)
    return loads(world)


@pytest.mark.parametrize('board', [{'type': 'box', 'size': [0.4, 0.4, 0.1]},
                                   {'type': 'cylinder', 'radius': 0.2, 'length': 0.1}])
def test_tiles_share_what_lies_on_their_corner(board):
    tiles = [(x, y, 1.0) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    # What is left of the approach, 1e-9 sizes in a substep, and of impulses per compliance.
    assert on_pads('timestep', board, tiles, 0.5, 0.001) == pytest.approx([0.25] * 4, abs=1e-3)


@given(st.lists(st.floats(0.1, 0.4), min_size=2, max_size=5), st.floats(0.0, 1.0),
       st.sampled_from([0.001, 1 / 240]))
def test_redundant_supports_bear_as_much_in_both_models(gaps, mu, h):
    """The smallest forces that hold a board are one solution, whoever looks for it."""
    x = np.cumsum(gaps) - np.mean(np.cumsum(gaps))
    pads = [(at, 0.02 * k, 0.09) for k, at in enumerate(x)]
    board = {'type': 'box', 'size': [2.0, 0.5, 0.1]}
    assume(x[-1] < 0.9)
    one, other = (on_pads(contact, board, pads, mu, h) for contact in ('timestep', 'event'))
    assert one == pytest.approx(other, abs=1e-3)
