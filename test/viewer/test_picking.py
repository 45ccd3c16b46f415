# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lines of sight, and what they meet."""
from importlib.util import find_spec
from types import SimpleNamespace
from unittest import SkipTest

if find_spec('viser') is None:
    raise SkipTest('viser is not installed: pip install .[view]')

import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.viewer.motion import Motion
from rigid_sim_ros.viewer.picking import first_hit, is_near, line_of_sight
from rigid_sim_ros.viewer.server import start, stop
from rigid_sim_ros.viewer.stage import Stage

TRIANGLE = np.array([[[0.0, 0, 2], [1, 0, 2], [0, 1, 2]]])
# Each a metre from its neighbour along x, and 0.2 m to 0.5 m high.
SHAPES = {
    'ball': ({'type': 'sphere', 'radius': 0.1}, 0.1),
    'crate': ({'type': 'box', 'size': [0.3, 0.2, 0.5]}, 0.25),
    'can': ({'type': 'cylinder', 'radius': 0.1, 'length': 0.4}, 0.2),
    'pill': ({'type': 'capsule', 'radius': 0.1, 'length': 0.2}, 0.2),
}


@pytest.fixture(scope='module')
def stage():
    """Give the stage of a row of shapes, and a crate that stands turned behind the ball."""
    bodies = [{'name': name, 'mass': 1.0, 'shape': shape, 'pose': {'position': [k, 0, 0]}}
              for k, (name, (shape, _)) in enumerate(SHAPES.items())]
    bodies.append({'name': 'behind', 'mass': 1.0, 'shape': {'type': 'box', 'size': [1, 1, 1]},
                   'pose': {'position': [0, 5, 0], 'orientation': [0, 0, 0.6, 0.8]}})
    w = World.from_dict({'format': 1, 'world': {'contact': 'none'}, 'bodies': bodies})
    server = start('127.0.0.1', 0)
    stage = Stage(server, w.scene)
    stage.move(Motion(0, w.position, w.orientation, w.linear_velocity, w.angular_velocity))
    yield stage
    stop(server)


@pytest.mark.parametrize(('x', 'y', 'distance'), [
    (0.2, 0.2, 2.0), (0.6, 0.6, np.inf), (-0.1, 0.2, np.inf), (0.2, -0.1, np.inf)])
def test_a_line_meets_a_triangle_within_its_sides(x, y, distance):
    start = np.array([x, y, 0.0])
    assert first_hit(start, np.array([0.0, 0, 1]), TRIANGLE) == pytest.approx(distance)
    assert first_hit(start, np.array([0.0, 0, -1]), TRIANGLE) == np.inf     # it lies behind
    assert first_hit(start, np.array([1.0, 0, 0]), TRIANGLE) == np.inf      # it is parallel


def test_a_line_that_leads_away_is_as_near_as_its_start():
    start, way = np.array([[3.0, 0, 0]]), np.array([[2.0, 0, 0]])
    assert is_near(start, way, 3.1).tolist() == [True]
    assert is_near(start, way, 2.9).tolist() == [False]
    assert is_near(start, -way, 0.1).tolist() == [True]


def test_the_middle_of_a_picture_is_straight_ahead_and_its_edge_half_the_angle_away():
    camera = SimpleNamespace(position=np.array([1.0, 2, 3]), wxyz=np.array([1.0, 0, 0, 0]),
                             fov=np.pi / 2, aspect=2.0)
    start, way = line_of_sight(camera, 0.5, 0.5)
    assert start.tolist() == [1, 2, 3]
    assert way == pytest.approx([0, 0, 1])
    assert line_of_sight(camera, 0.5, 0.0)[1] == pytest.approx([0, -1, 1])     # y points down
    assert line_of_sight(camera, 1.0, 0.5)[1] == pytest.approx([2, 0, 1])


@pytest.mark.parametrize('name', SHAPES)
def test_a_line_meets_a_shape_where_it_is_and_not_above(stage, name):
    k = list(SHAPES).index(name)
    top = SHAPES[name][1]
    way = np.array([0.0, 1.0, 0.0])
    at = stage.body_at(np.array([k, -3.0, 0.9 * top]), way)
    assert stage.scene.names[at] == name
    above = stage.body_at(np.array([k, -3.0, 1.01 * top]), way)
    assert above is None or stage.scene.names[above] == 'behind'


def test_the_nearer_of_two_is_met(stage):
    names = stage.scene.names
    way = np.array([0.0, 1.0, 0.0])
    assert names[stage.body_at(np.array([0.0, -3, 0]), way)] == 'ball'
    assert names[stage.body_at(np.array([0.0, 9, 0]), -way)] == 'behind'
    assert names[stage.body_at(np.array([0.3, -3, 0]), way)] == 'behind'


def test_a_page_that_is_gone_sees_nothing(stage):
    assert stage.name_at(12345, 0.5, 0.5) == ''


def first_sight(stage):
    """Return where a page looks from at first, and how far its sight reaches to each side."""
    camera = stage._server.initial_camera
    eye, target = np.array(camera.position), np.array(camera.look_at)
    # Of the height of the picture viser's camera sees 75 degrees, if nobody says otherwise.
    return eye, (target - eye) / np.linalg.norm(target - eye), np.radians(75.0) / 2


def test_the_first_picture_has_the_bodies_where_their_joints_put_them():
    rod = {'mass': 1.0, 'shape': {'type': 'capsule', 'radius': 0.02, 'length': 0.46}}
    w = World.from_dict({
        'format': 1, 'world': {'contact': 'none'},
        'bodies': [{'name': 'upper', **rod, 'pose': {'position': [0, 0, 0.75]}},
                   {'name': 'lower', **rod, 'pose': {'position': [0, 0, 0.25]}}],
        'joints': [{'name': 'shoulder', 'type': 'continuous', 'parent': 'world', 'child': 'upper',
                    'pose': {'position': [0, 0, 1]}, 'axis': [0, 1, 0], 'position': 3.0},
                   {'name': 'elbow', 'type': 'continuous', 'parent': 'upper', 'child': 'lower',
                    'pose': {'position': [0, 0, -0.25]}, 'axis': [0, 1, 0], 'position': 0.5}]})
    server = start('127.0.0.1', 0)
    try:
        eye, way, half = first_sight(Stage(server, w.scene))
    finally:
        stop(server)
    for place in w.position:
        along = (place - eye) @ way
        beside = np.linalg.norm(place - eye - along * way)
        # A ball of radius r at this place is in the cone if it is r / cos(half) within its side.
        assert beside + 0.25 / np.cos(half) < along * np.tan(half)


def test_of_many_bodies_the_first_picture_shows_the_heap():
    bodies = [{'name': f'b{k}', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1},
               'pose': {'position': [0.3 * (k % 5), 0.3 * (k // 5), 0]}} for k in range(20)]
    bodies.append({**bodies[0], 'name': 'far', 'pose': {'position': [100, 0, 0]}})
    w = World.from_dict({'format': 1, 'world': {'contact': 'none'}, 'bodies': bodies})
    server = start('127.0.0.1', 0)
    try:
        eye, _, _ = first_sight(Stage(server, w.scene))
    finally:
        stop(server)
    assert np.linalg.norm(eye - w.position[:20].mean(axis=0)) < 5.0
