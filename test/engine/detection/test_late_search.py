# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A world steps before the search for any two convex shapes is compiled, and waits if it must."""
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.detection.manifolds import current_manifolds
from rigid_sim_ros.engine.solver.partition import ENOUGH
from rigid_sim_ros.engine.steps import timestep

GROUND = {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}
BALL, BOX = {'type': 'sphere', 'radius': 0.2}, {'type': 'box', 'size': [0.4, 0.4, 0.4]}
ROD = {'type': 'capsule', 'radius': 0.1, 'length': 0.6}
# [m] Between the nearest corners of two boxes, along each axis: nearer than the margin.
NEAR = 0.002
# Where a box is beside and above another one [m], and half of both one's angles, about: edges are
# nearest, and none of the faces is as near as it comes in a step.
PLACE, TURNED = (0.357, -0.357), ((-0.085, -0.032, 0.032), (0.087, -0.083, -0.01))


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


def fast_boxes():
    """Return a box that comes near another one so fast that first a face is looked for."""
    one = scene((BOX, (0, 0, 1)), (BOX, (PLACE[0], PLACE[1], 1.44)))
    for body, turned in zip(one['bodies'][1:], TURNED, strict=True):
        body['pose']['orientation'] = (np.append(turned, 1.0)
                                       / np.linalg.norm([*turned, 1.0])).tolist()
    one['bodies'][2]['twist'] = {'linear': [0, 0, -5.0]}
    return one


def crossed_rods():
    """Return balls on balls and rods across rods; the second of two threads has all rods."""
    turned = {'orientation': [np.sqrt(0.5), 0, 0, np.sqrt(0.5)]}
    across = {'orientation': [0, np.sqrt(0.5), 0, np.sqrt(0.5)]}
    one = scene(*((BALL, (x, y, 0.2 + 0.4 * up)) if x < 20 else (ROD, (x, y, 0.1 + 0.2 * up))
                  for x in range(40) for y in range(ENOUGH // 64) for up in range(2)))
    for k, body in enumerate(one['bodies'][1:]):
        if body['shape'] == ROD:
            body['pose'] |= across if k % 2 else turned
    return one


@pytest.fixture(name='asked')
def _asked(monkeypatch):
    """Let worlds begin without a search; return the list of what they ask for."""
    asked, compile_late = [], timestep.compile_late
    compile_together = timestep.compile_together

    def without(*arguments):
        found = compile_together(*arguments)
        found[timestep._TO_SEARCH] = 0
        return found

    def counted(piece, box):
        asked.append(piece.__name__)
        return compile_late(piece, box)

    monkeypatch.setattr(timestep, 'compile_together', without)
    monkeypatch.setattr(timestep, 'compile_late', counted)
    return asked


@pytest.mark.parametrize(('bodies', 'searched'), [
    ([(BALL, (0, 0, 1)), (BALL, (1, 0, 1))], 'never'),
    ([(BALL, (0, 0, 1)), (BOX, (1, 0, 1))], 'hardly ever'),
    ([(BALL, (0, 0, 1)), (ROD, (1, 0, 1))], 'always'),
    ([(BALL, (0, 0, 1)), ({'type': 'cylinder', 'radius': 0.1, 'length': 0.2}, (1, 0, 1))],
     'always'),
])
def test_the_shapes_of_a_world_say_whether_it_searches(bodies, searched):
    world = World.from_dict(scene(*bodies))
    s, settings = world._contact._setup, world._contact._settings
    pieces, may_wait = timestep._pieces(s.model, s.shapes, s.materials, settings, False)
    assert pieces[timestep._TO_SEARCH] == (None if searched == 'never' else timestep._search)
    assert may_wait == (set() if searched == 'always' else {timestep._TO_SEARCH})


def test_boxes_that_meet_with_corners_wait_for_the_search_and_come_to_the_same(asked, request):
    world = World.from_dict(corner_to_corner())
    world.step(20)
    assert set(asked) == {'_search'}
    request.getfixturevalue('monkeypatch').undo()
    known = World.from_dict(corner_to_corner())
    known.step(20)
    assert world.state_hash() == known.state_hash()


def test_fast_boxes_need_no_search_where_edges_tell_what_is_nearest(asked):
    world = World.from_dict(fast_boxes())
    world.step(1)
    assert world.contact_report().contacts == 1
    assert asked == []


@pytest.mark.parametrize('threads', [1, 2])
def test_a_step_that_waited_is_the_same_step_on_two_threads(threads, asked):
    known, other = (World.from_dict(crossed_rods()) for _ in range(2))
    for world in (known, other):
        world.threads = threads
        world.step(3)
    assert current_manifolds(other._contact._memory).count[0] >= ENOUGH
    known.step(5)
    asked.clear()
    other._contact._kept.addresses[timestep._TO_SEARCH] = 0
    other.step(5)
    assert asked == ['_search']
    assert other.state_hash() == known.state_hash()
