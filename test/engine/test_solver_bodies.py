# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How bodies are shared out when they are written back changes nothing."""

import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.solver_bodies import store_bodies
from rigid_sim_ros.engine.state import State

COUNT = 27      # three times eight next to each other, and some more


@pytest.fixture(params=[(), (4,), (0, 9, 10, 26)], ids=['all', 'one apart', 'some apart'])
def world(request):
    """Give balls that were thrown onto a plane, but for those that fly above it."""
    world = World.from_dict({'format': 1, 'bodies': [
        {'name': f'b{k}', 'mass': 1.0 + 0.1 * k, 'shape': {'type': 'sphere', 'radius': 0.1},
         'pose': {'position': [0.3 * k, 0.0, 5.0 if k in request.param else 0.1]},
         'twist': {'linear': [0.1 * k, 1.0, -0.5], 'angular': [3.0, 0.0, 900.0 * (k % 5 == 3)]}}
        for k in range(COUNT)] + [
            {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}]})
    before = [field.copy() for field in world._state]
    world.step()
    slots = world._contact._work.solver.bodies.slot[:COUNT]
    assert np.flatnonzero(slots == 0).tolist() == list(request.param)
    return world, before


def written(world, before, halves):
    """Return what is written back of a world's last step, to the state before."""
    n, state, model = COUNT + 1, State._make(field.copy() for field in before), world._model
    for half in range(halves):
        store_bodies(half, half * n // halves, (half + 1) * n // halves, model.h, model.m,
                     model.inv_m, model.inv_I_C, state, world._contact._work.solver.bodies, 4)
    return state


def test_bodies_that_lie_otherwise_are_written_the_same(world):
    world, before = world
    one, two = written(world, before, 1), written(world, before, 2)
    touching = world._contact._work.solver.bodies.slot > 0
    for name, whole, parts in zip(one._fields, one, two, strict=True):
        assert whole.tobytes() == parts.tobytes(), name
        # The last step wrote the same, with as many substeps.
        now = getattr(world._state, name)
        assert whole[:, touching].tobytes() == now[:, touching].tobytes(), name
