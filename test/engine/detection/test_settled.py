# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What stays where it is is not placed again, however many shapes it has, and nobody notices."""

from engine.detecting import Scene
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.detection.transform_update import PLACED, SETTLED, STAYING
from rigid_sim_ros.engine.model.kinds.table import BOX, SPHERE
from rigid_sim_ros.engine.model.shapes import build_shapes, Shape

CUBE = (BOX, (0.5, 0.5, 0.5), None)
HILLS = (0.2 * np.sin(np.arange(12.0))[:, None] * np.cos(np.arange(12.0))).tolist()


def world_with_ground(model: str, kinematic: bool) -> World:
    """Return a world of three bodies on hills of 242 triangles, which a table stands beside."""
    ground = {'kinematic': True} if kinematic else {'fixed': True}
    return World.from_dict({
        'format': 1, 'world': {'step': 0.002, 'contact': model},
        'bodies': [
            {'name': 'box', 'mass': 1.0, 'shape': {'type': 'box', 'size': [0.3, 0.3, 0.3]},
             'pose': {'position': [0.0, 0.0, 0.5]}},
            {'name': 'hills', **ground,
             'shape': {'type': 'heightfield', 'heights': HILLS, 'size': [4.0, 4.0]}},
            {'name': 'ball', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.2},
             'pose': {'position': [0.8, 0.3, 0.6]}},
            {'name': 'table', 'fixed': True, 'compound': [
                {'type': 'box', 'size': [1.0, 1.0, 0.1], 'pose': {'position': [3.0, 0.0, 0.5]}},
                {'type': 'box', 'size': [0.1, 0.1, 1.0], 'pose': {'position': [3.0, 0.0, 0.0]}}]},
            {'name': 'capsule', 'mass': 1.0,
             'shape': {'type': 'capsule', 'radius': 0.1, 'length': 0.3},
             'pose': {'position': [3.0, 0.2, 0.8]}}]})


# Steps before which a body is put elsewhere: by a jump, since it is farther than its size, and
# back; by a way that one step takes; and where it is already.
MOVES = {20: ('hills', (0.0, 0.0, -9.0)), 24: ('hills', (0.0, 0.0, 0.0)),
         60: ('hills', (0.01, 0.0, 0.002)), 90: ('table', (0.0, 0.02, 0.001)),
         120: ('table', (0.0, 0.02, 0.001)), 150: ('hills', (0.0, 0.0, 0.0))}


@pytest.mark.parametrize('kinematic', [False, True])
@pytest.mark.parametrize('model', ['timestep', 'event'])
def test_a_world_that_remembers_its_grounds_goes_on_as_one_that_does_not(model, kinematic):
    world, forgetful = (world_with_ground(model, kinematic) for _ in range(2))
    for step in range(200):
        if step in MOVES:
            name, position = MOVES[step]
            for one in (world, forgetful):
                one.set_pose(name, position=position, orientation=(0.0, 0.0, 0.0, 1.0))
        if kinematic and step in (40, 55):
            for one in (world, forgetful):
                one.set_twist('hills', linear=(0.5 if step == 40 else 0.0, 0.0, 0.0),
                              angular=(0.0, 0.0, 0.1 if step == 40 else 0.0))
        # What saves time only is not saved: after this everything is placed anew.
        forgetful.restore(world.save())
        world.step()
        forgetful.step()
        assert world.state_hash() == forgetful.state_hash(), step
    assert world.contact_report().contacts > 0


def ground_and_ball() -> Scene:
    """Return a fixed body in two pieces, and a ball over it."""
    return Scene([CUBE, CUBE, (SPHERE, (0.5, 0.0, 0.0), None)],
                 [((0.0, 0.0, 0.0), (0, 0, 0, 1)), ((9.0, 0.0, 0.0), (0, 0, 0, 1)),
                  ((0.0, 0.0, 1.01), (0, 0, 0, 1))], fixed=(0, 1))


def test_of_what_stays_nothing_is_found_again():
    scene = ground_and_ball()
    since = scene.memory.settled.since
    found = []
    for _ in range(4):
        assert len(scene.rows()) == 1
        found.append(since.tolist())
    assert found == [[k, k, PLACED] for k in (PLACED, STAYING, SETTLED, SETTLED)]
    # Whoever placed them again would overwrite this.
    scene.memory.box[:2, 0] = scene.memory.box[:2, 0] - 0.25
    kept = scene.memory.box[:2].copy()
    assert len(scene.rows()) == 1
    assert np.array_equal(scene.memory.box[:2], kept)
    scene.put(0, (0.0, 0.0, -5.0))
    assert scene.rows() == []
    assert since.tolist() == [PLACED, SETTLED, PLACED]
    assert scene.memory.box[0, 5] == pytest.approx(-4.5 + 0.5 * scene.margin)
    assert np.array_equal(scene.memory.box[1], kept[1])


def test_the_shapes_of_a_body_must_stand_side_by_side():
    scene = ground_and_ball()
    rows = [Shape(body, SPHERE, (0.5, 0.0, 0.0)) for body in (0, 2, 0)]
    with pytest.raises(ValueError, match='the shapes of body 0 are apart, must be side by side'):
        build_shapes(scene.model, rows)
