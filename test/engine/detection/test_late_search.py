# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A world steps before the search for any two convex shapes is compiled, and waits if it must."""
from inside import arguments_of, memory_of, pack_of
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.detection.manifolds import current_manifolds
from rigid_sim_ros.engine.detection.pair_manifold import search
from rigid_sim_ros.engine.solver.partition import MANIFOLDS_TO_HALVE
from rigid_sim_ros.engine.steps import timestep
from rigid_sim_ros.kernels.separate import symbol_of
from rigid_sim_ros.kernels.symbols import declare

GROUND = {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}
BALL, BOX = {'type': 'sphere', 'radius': 0.2}, {'type': 'box', 'size': [0.4, 0.4, 0.4]}
ROD = {'type': 'capsule', 'radius': 0.1, 'length': 0.6}
# [m] Between the nearest corners of two boxes, along each axis: nearer than the margin.
NEAR = 0.002


def scene(*bodies):
    return {'format': 1, 'world': {'contact': 'timestep', 'gravity': [0, 0, -9.81]}, 'bodies': [
        GROUND, *({'name': f'b{k}', 'mass': 1.0, 'shape': shape, 'pose': {'position': place}}
                  for k, (shape, place) in enumerate(bodies))]}


def corner_to_corner():
    """
    Return two boxes that fall, one of them turning, with nothing but two corners near.

    And balls that reach the ground after the search was needed: more manifolds than there is room.
    """
    one = scene((BOX, (0, 0, 1)), (BOX, (0.4 + NEAR, 0.4 + NEAR, 1.4 + NEAR)),
                *((BALL, (k % 10, 2 + k // 10, 0.21)) for k in range(100)))
    one['bodies'][1]['twist'] = {'angular': [0.1, -0.1, 0]}
    return one


def crossed_rods():
    """Return balls on balls and rods across rods; the second of two threads has all rods."""
    turned = {'orientation': [np.sqrt(0.5), 0, 0, np.sqrt(0.5)]}
    across = {'orientation': [0, np.sqrt(0.5), 0, np.sqrt(0.5)]}
    one = scene(*((BALL, (x, y, 0.2 + 0.4 * up)) if x < 20 else (ROD, (x, y, 0.1 + 0.2 * up))
                  for x in range(40) for y in range(MANIFOLDS_TO_HALVE // 64) for up in range(2)))
    for k, body in enumerate(one['bodies'][1:]):
        if body['shape'] == ROD:
            body['pose'] |= across if k % 2 else turned
    return one


@pytest.fixture(name='asked')
def _asked(monkeypatch):
    """Let worlds begin without a search; return the list of what they ask for."""
    asked, link, link_late = [], timestep.link, timestep.link_late

    def without(caller, pack, pieces):
        link(caller, pack, pieces)
        take_away(pack)

    def counted(piece, pack):
        asked.append(piece.__name__)
        link_late(piece, pack)

    monkeypatch.setattr(timestep, 'link', without)
    monkeypatch.setattr(timestep, 'link_late', counted)
    return asked


def take_away(pack):
    """Let the search be as if it were not compiled yet."""
    declare(symbol_of(search, pack.type)).value = 0


@pytest.mark.parametrize(('bodies', 'searched'), [
    ([(BALL, (0, 0, 1)), (BALL, (1, 0, 1))], 'never'),
    ([(BALL, (0, 0, 1)), (BOX, (1, 0, 1))], 'hardly ever'),
    ([(BALL, (0, 0, 1)), (ROD, (1, 0, 1))], 'always'),
    ([(BALL, (0, 0, 1)), ({'type': 'cylinder', 'radius': 0.1, 'length': 0.2}, (1, 0, 1))],
     'always'),
])
def test_the_shapes_of_a_world_say_whether_it_searches(bodies, searched):
    world = World.from_dict(scene(*bodies))
    pieces = timestep.pieces_of(arguments_of(world), helped=False)
    where = {'never': pieces.unused, 'hardly ever': pieces.late, 'always': pieces.helped}
    assert [name for name, some in where.items() if search in some] == [searched]


def test_boxes_that_meet_with_corners_wait_for_the_search_and_come_to_the_same(asked, request):
    world = World.from_dict(corner_to_corner())
    world.step(20)
    assert set(asked) == {'search'}
    request.getfixturevalue('monkeypatch').undo()
    known = World.from_dict(corner_to_corner())
    known.step(20)
    assert world.state_hash() == known.state_hash()


@pytest.mark.parametrize('threads', [1, 2])
def test_a_step_that_waited_is_the_same_step_on_two_threads(threads, asked):
    known, other = (World.from_dict(crossed_rods()) for _ in range(2))
    for world in (known, other):
        world.threads = threads
        world.step(3)
    assert current_manifolds(memory_of(other)).count[0] >= MANIFOLDS_TO_HALVE
    known.step(5)
    asked.clear()
    take_away(pack_of(other))
    other.step(5)
    assert asked == ['search']
    assert other.state_hash() == known.state_hash()
