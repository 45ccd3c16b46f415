# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How bodies are shared out when they are written back changes nothing."""

from inside import model_of, solver_of, state_of
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.dynamics.force_and_torque import empty_loads
from rigid_sim_ros.engine.solver.solver_bodies import (
    FIRST_END, load_bodies, make_bodies, SECOND_BEGIN, SECOND_END, store_bodies, STRIDE)
from rigid_sim_ros.engine.state.state import State

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
    before = [field.copy() for field in state_of(world)]
    world.step()
    slots = solver_of(world).bodies.slot[:COUNT]
    assert np.flatnonzero(slots == 0).tolist() == list(request.param)
    return world, before


def written(world, before, halves):
    """Return what is written back of a world's last step, to the state before."""
    n, state, model = COUNT + 1, State._make(field.copy() for field in before), model_of(world)
    bodies = solver_of(world).bodies
    # As in a world of two halves: gravity stands in the slots that stand still.
    for still in (0, bodies.used[SECOND_BEGIN]):
        bodies.smooth[still * STRIDE:still * STRIDE + 3] = model.gravity
    for half in range(halves):
        store_bodies(half, half * n // halves, (half + 1) * n // halves, model.h, model.m,
                     model.inv_m, model.inv_I_C, state, bodies, 4)
    return state


@pytest.mark.parametrize('alike', [0, 1])
def test_a_slot_that_stands_still_has_no_trace_of_whom_it_had_before(world, alike):
    world, before = world
    model, bodies = model_of(world), make_bodies(COUNT + 1)
    loads = empty_loads(COUNT + 1)
    loads.F[:] = 7.0
    bodies.alike[0] = alike
    bodies.body[:COUNT + 3] = np.arange(-1, COUNT + 2)
    # The second half begins amid what was the first one before.
    bodies.used[[FIRST_END, SECOND_BEGIN, SECOND_END]] = 5, 5, COUNT
    for numbers in (bodies.motion, bodies.smooth, bodies.mass, bodies.drifted, bodies.total,
                    bodies.base):
        numbers[:] = np.nan
    for half, still in enumerate((0, 5)):
        load_bodies(half, model.h, model.gravity, model.inv_m, model.inv_I_C,
                    State._make(before), loads, bodies)
        line = slice(still * STRIDE, (still + 1) * STRIDE)
        for numbers in (bodies.motion, bodies.mass, bodies.drifted, bodies.total, bodies.base):
            assert (numbers[line] == 0.0).all()
        felt = model.gravity if alike else np.zeros(3)
        assert bodies.smooth[line].tolist() == [*felt, *np.zeros(5)]


def test_bodies_that_lie_otherwise_are_written_the_same(world):
    world, before = world
    one, two = written(world, before, 1), written(world, before, 2)
    touching = solver_of(world).bodies.slot > 0
    for name, whole, parts in zip(one._fields, one, two, strict=True):
        assert whole.tobytes() == parts.tobytes(), name
        # The last step wrote the same, with as many substeps.
        now = getattr(state_of(world), name)
        assert whole[..., touching].tobytes() == now[..., touching].tobytes(), name
