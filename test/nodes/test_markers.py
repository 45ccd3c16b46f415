# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Markers cover the shapes of the scene: read back from the bytes, in the world, shape by shape.

A convex body is known by its support: how far it reaches in each direction. That of the markers
follows from their type, scale and pose, that of the shape from the scene, by formulas of its own.
"""
from collections import Counter

import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores
from scipy.spatial.transform import Rotation

from rigid_sim_ros.nodes.contact_markers import ContactMarkers
from rigid_sim_ros.nodes.markers import SceneMarkers
from rigid_sim_ros.world import World

CUBE, SPHERE, CYLINDER, LINE_LIST, SPHERE_LIST, TRIANGLE_LIST = 1, 2, 3, 5, 7, 11
ADD, DELETE = 0, 2
STORE = get_typestore(Stores.ROS2_JAZZY)
DIRECTIONS = np.random.default_rng(1).normal(size=(200, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)

# Poses along no axis: scale, place and turn must all be right.
PART = {'position': [0.3, -0.2, 0.1], 'orientation': [0.5, 0.1, -0.7, 0.5]}
BODY = {'position': [1.0, 2.0, 3.0], 'orientation': [0.1, 0.7, 0.1, 0.7]}
CORNERS = [[0, 0, 0], [0.3, 0, 0], [0, 0.4, 0], [0, 0, 0.5]]
TETRAHEDRON = {'type': 'mesh', 'vertices': CORNERS, 'scale': [1, 2, 0.5],
               'faces': [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]}
SOLIDS = {
    'sphere': {'type': 'sphere', 'radius': 0.2},
    'box': {'type': 'box', 'size': [0.1, 0.2, 0.3]},
    'capsule': {'type': 'capsule', 'radius': 0.1, 'length': 0.5},
    'cylinder': {'type': 'cylinder', 'radius': 0.15, 'length': 0.4},
    'cone': {'type': 'cone', 'radius': 0.15, 'length': 0.4},
    'ellipsoid': {'type': 'ellipsoid', 'radii': [0.1, 0.2, 0.3]},
    'mesh': TETRAHEDRON,
}


# [m] Poses are doubles, and vertices as the scene holds them.
ROUNDING = 1e-9
# What no marker has is drawn as triangles: of 32 sides of a circle of 0.15 m the middle is
# 0.15 (1 - cos(pi / 32)) inside.
NEAR = {'cone': 8e-4}


def unit(q):
    return (np.array(q) / np.linalg.norm(q)).tolist()


def pose(of):
    return {'position': of['position'], 'orientation': unit(of['orientation'])}


def world_of(*bodies, **settings):
    return World.from_dict({'format': 1, 'bodies': list(bodies),
                            'world': {'contact': 'none', **settings}})


def solid(name, **shape):
    return {'name': name, 'shape': {**shape, 'pose': pose(PART)}, 'mass': 1.0, 'pose': pose(BODY)}


def decode(data):
    return STORE.deserialize_cdr(data, 'visualization_msgs/msg/MarkerArray').markers


def markers_of(world):
    return decode(SceneMarkers('map', world.scene).encode(
        world.time_ns, world.position, world.orientation))


def triple(v):
    return np.array([v.x, v.y, v.z])


def turn_of(marker):
    q = marker.pose.orientation
    return Rotation.from_quat([q.x, q.y, q.z, q.w])


def reach(marker):
    """Return the support of a marker in each direction, from its origin, in its own axes."""
    d, scale = turn_of(marker).inv().apply(DIRECTIONS), triple(marker.scale)
    if marker.type == CUBE:
        return np.abs(d) @ scale / 2
    if marker.type == SPHERE:
        return np.linalg.norm(d * scale / 2, axis=1)
    if marker.type == CYLINDER:
        return np.linalg.norm(d[:, :2] * scale[:2] / 2, axis=1) + np.abs(d[:, 2]) * scale[2] / 2
    points = np.array([triple(p) for p in marker.points])
    if marker.type == TRIANGLE_LIST:
        return (d @ (points * scale).T).max(axis=1)
    raise AssertionError(f'marker type {marker.type}')


def support_of_markers(markers):
    return np.max([DIRECTIONS @ triple(m.pose.position) + reach(m) for m in markers], axis=0)


def support_of_shape(shape):
    """Return the same of a shape with the pose PART in a body at BODY, as the scene says."""
    part, body = (Rotation.from_quat(unit(p['orientation'])) for p in (PART, BODY))
    origin = np.array(BODY['position']) + body.apply(PART['position'])
    d = (body * part).inv().apply(DIRECTIONS)
    beside = np.linalg.norm(d[:, :2], axis=1)
    own = {
        'sphere': lambda: shape['radius'] * np.ones(len(d)),
        'box': lambda: np.abs(d) @ shape['size'] / 2,
        'capsule': lambda: shape['radius'] + np.abs(d[:, 2]) * shape['length'] / 2,
        'cylinder': lambda: shape['radius'] * beside + np.abs(d[:, 2]) * shape['length'] / 2,
        'cone': lambda: np.maximum(d[:, 2] * shape['length'] / 2,
                                   shape['radius'] * beside - d[:, 2] * shape['length'] / 2),
        'ellipsoid': lambda: np.linalg.norm(d * shape['radii'], axis=1),
        'mesh': lambda: (d @ (np.array(shape['vertices']) * shape['scale']).T).max(axis=1),
    }[shape['type']]()
    return DIRECTIONS @ origin + own


@pytest.mark.parametrize('kind', SOLIDS)
def test_the_markers_of_a_shape_cover_it_and_no_more(kind):
    markers = markers_of(world_of(solid('thing', **SOLIDS[kind])))
    assert support_of_markers(markers) == pytest.approx(
        support_of_shape(SOLIDS[kind]), abs=NEAR.get(kind, ROUNDING))


@pytest.mark.parametrize('kind', SOLIDS)
def test_the_markers_of_a_compound_are_those_of_its_parts(kind):
    other = {'type': 'sphere', 'radius': 0.01, 'mass': 1.0}
    body = solid('thing', **SOLIDS[kind])
    parts = [other, {**body.pop('shape'), 'mass': 1.0}]
    del body['mass']
    markers = markers_of(world_of({**body, 'compound': parts}))
    assert support_of_markers(markers[1:]) == pytest.approx(
        support_of_shape(SOLIDS[kind]), abs=NEAR.get(kind, ROUNDING))
    assert triple(markers[0].pose.position) == pytest.approx(np.array(BODY['position']))


def test_a_capsule_is_a_cylinder_with_a_ball_at_each_end():
    assert Counter(m.type for m in markers_of(world_of(solid('c', **SOLIDS['capsule'])))) == {
        CYLINDER: 1, SPHERE: 2}


def test_an_ellipsoid_is_a_ball_with_three_diameters():
    marker, = markers_of(world_of(solid('e', **SOLIDS['ellipsoid'])))
    assert (marker.type, triple(marker.scale)) == (SPHERE, pytest.approx([0.2, 0.4, 0.6]))


@pytest.mark.parametrize('kind', ['mesh', 'cone'])
def test_the_triangles_of_a_solid_are_seen_from_outside(kind):
    marker, = markers_of(world_of(solid('thing', **SOLIDS[kind])))
    corners = np.array([triple(p) for p in marker.points]).reshape(-1, 3, 3)
    middle = corners.mean(axis=(0, 1))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum('ti,ti->t', normals, corners.mean(axis=1) - middle) > 0).all()


@pytest.mark.parametrize('normal', [[0, 0, 1], [0, 0, -1], [1, 0, 0], [1, -2, 3]])
def test_the_upper_face_of_a_plane_s_marker_lies_on_the_plane(normal):
    plane = {'type': 'plane', 'normal': normal, 'offset': 0.25, 'pose': pose(PART)}
    marker, = markers_of(world_of(
        {'name': 'floor', 'shape': plane, 'fixed': True, 'pose': pose(BODY)}))
    part, body = (Rotation.from_quat(unit(p['orientation'])) for p in (PART, BODY))
    n_P = np.array(normal) / np.linalg.norm(normal)
    foot = body.apply(part.apply(0.25 * n_P) + PART['position']) + BODY['position']
    x, y, z = triple(marker.scale) / 2
    face = triple(marker.pose.position) + turn_of(marker).apply(
        [[x, y, z], [-x, y, z], [x, -y, z], [-x, -y, z]])
    assert (face - foot) @ (body * part).apply(n_P) == pytest.approx(np.zeros(4), abs=1e-9)
    assert marker.type == CUBE


def test_particles_are_balls_at_their_positions():
    points = {'type': 'points', 'positions': CORNERS, 'masses': [1, 1, 1, 1]}
    body = solid('cloud', **points)
    del body['mass']
    marker, = markers_of(world_of(body))
    part, whole = (Rotation.from_quat(unit(p['orientation'])) for p in (PART, BODY))
    expected = whole.apply(part.apply(CORNERS) + PART['position']) + BODY['position']
    found = turn_of(marker).apply([triple(p) for p in marker.points]) + triple(
        marker.pose.position)
    assert marker.type == SPHERE_LIST
    assert found == pytest.approx(expected, abs=1e-9)


def test_markers_move_with_their_body_and_turn_with_it():
    world = world_of(solid('box', **SOLIDS['box']) | {'twist': {'angular': [1, 2, 3]}})
    before = support_of_markers(markers_of(world))
    world.step(500)
    after = support_of_markers(markers_of(world))
    turn = Rotation.from_quat(world.orientation[0]) * Rotation.from_quat(
        unit(BODY['orientation'])).inv()
    back = turn.inv().apply(DIRECTIONS)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    part, body = (Rotation.from_quat(unit(p['orientation'])) for p in (PART, BODY))
    box = body.apply(part.apply(corners * SOLIDS['box']['size'] / 2) + PART['position'])
    assert before == pytest.approx((DIRECTIONS @ (box + BODY['position']).T).max(axis=1))
    assert after == pytest.approx(
        (back @ box.T).max(axis=1) + DIRECTIONS @ world.position[0], abs=1e-9)


def test_a_body_has_the_colour_of_the_scene_and_its_markers_its_name():
    body = solid('thing', **SOLIDS['capsule']) | {'color': [0.25, 0.5, 0.75, 0.5]}
    for number, marker in enumerate(markers_of(world_of(body))):
        assert (marker.ns, marker.id, marker.action) == ('thing', number, ADD)
        assert [marker.color.r, marker.color.g, marker.color.b, marker.color.a] == [
            0.25, 0.5, 0.75, 0.5]


def test_the_end_deletes_each_marker_once():
    world = world_of(*(solid(kind, **shape) for kind, shape in SOLIDS.items()))
    shown = Counter((m.ns, m.id) for m in markers_of(world))
    end = decode(SceneMarkers('map', world.scene).encode_end(world.time_ns))
    assert Counter((m.ns, m.id) for m in end) == shown
    assert {m.action for m in end} == {DELETE}


def test_a_ground_of_many_triangles_is_sent_once_a_second_and_when_it_moved():
    world = World.from_dict({'format': 1, 'world': {'contact': 'none'}, 'bodies': [
        {'name': 'ground', 'fixed': True, 'shape': {
            'type': 'heightfield', 'heights': np.zeros((40, 40)).tolist(), 'size': [4, 4]}},
        solid('ball', type='sphere', radius=0.1)]})
    markers, second = SceneMarkers('map', world.scene), 10 ** 9
    moved = world.position + np.array([0.0, 0.0, 1.0])

    def names(t_ns, position=world.position):
        return [m.ns for m in decode(markers.encode(t_ns, position, world.orientation))]

    both = ['ground', 'ball']
    assert names(0) == both
    assert names(second // 2) == ['ball']
    assert names(second) == both
    assert names(3 * second // 2, moved) == both
    assert names(8 * second // 5, moved) == ['ball']
    assert names(8 * second // 5, moved) == ['ball']
    assert names(second, moved) == both     # the world was reset


# --- contacts -----------------------------------------------------------------------------------

MASS = 2.0


@pytest.fixture(scope='module')
def resting():
    """Return a cube of 1 m that has come to rest on a floor."""
    world = World.from_dict({'format': 1, 'bodies': [
        {'name': 'floor', 'shape': {'type': 'plane'}, 'fixed': True},
        {'name': 'cube', 'shape': {'type': 'box', 'size': [1, 1, 1]}, 'mass': MASS,
         'pose': {'position': [0, 0, 0.5]}}]})
    world.step(500)
    return world


def contact_markers(world):
    return {m.ns: m for m in decode(ContactMarkers('map', world).encode(world))}


def points_of(marker):
    return np.array([triple(p) for p in marker.points]).reshape(-1, 3)


def test_contacts_have_namespaces_of_their_own(resting):
    assert {ns: m.type for ns, m in contact_markers(resting).items()} == {
        'contact_points': SPHERE_LIST, 'contact_normals': LINE_LIST, 'contact_forces': LINE_LIST}


def test_a_contact_point_stands_where_the_bodies_touch(resting):
    points = points_of(contact_markers(resting)['contact_points'])
    corners = {(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)}
    assert {(round(x, 2), round(y, 2)) for x, y, _ in points} == corners
    assert points[:, 2] == pytest.approx(np.zeros(4), abs=2e-3)     # the depth of a soft contact


def test_a_normal_is_a_line_from_the_first_body_to_the_second(resting):
    lines = points_of(contact_markers(resting)['contact_normals']).reshape(-1, 2, 3)
    along = lines[:, 1] - lines[:, 0]
    assert along / np.linalg.norm(along, axis=1, keepdims=True) == pytest.approx(
        np.tile([0.0, 0.0, 1.0], (4, 1)))


def test_the_arrows_of_a_body_at_rest_add_up_to_its_weight(resting):
    lines = points_of(contact_markers(resting)['contact_forces']).reshape(-1, 2, 3)
    shafts = lines[:4, 1] - lines[:4, 0]
    # The force that carries a common body is drawn as long as one: the bound of this cube.
    size = np.sqrt(3) / 2
    assert shafts.sum(axis=0) == pytest.approx([0, 0, size], abs=1e-3 * size)


def test_the_barbs_of_an_arrow_begin_at_its_head_and_point_back(resting):
    lines = points_of(contact_markers(resting)['contact_forces']).reshape(-1, 2, 3)
    heads, shafts = lines[:4, 1], lines[:4, 1] - lines[:4, 0]
    barbs = lines[4:].reshape(4, 4, 2, 3)
    assert (barbs[:, :, 0] == heads).all()
    assert (np.einsum('bai,ai->ba', barbs[:, :, 1] - heads, shafts) < 0).all()


def test_contacts_that_are_gone_are_deleted(resting):
    saved = resting.save()
    resting.set_pose('cube', [0, 0, 5], [0, 0, 0, 1])
    resting.step(1)
    actions = {m.action for m in contact_markers(resting).values()}
    resting.restore(saved)
    assert actions == {DELETE}


def test_the_end_deletes_the_contacts_too(resting):
    end = decode(ContactMarkers('map', resting).encode_end(resting.time_ns))
    assert Counter((m.ns, m.id, m.action) for m in end) == Counter(
        (ns, 0, DELETE) for ns in contact_markers(resting))


def test_markers_show_what_touches_and_of_what_touches_nothing_the_simple_forms():
    box = {'shape': {'type': 'box', 'size': [1, 1, 1]}, 'color': [0, 1, 0]}
    seen = [box, {'shape': TETRAHEDRON}]
    world = World.from_dict({'format': 1, 'bodies': [
        {'name': 'solid', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 1}, 'visuals': seen},
        {'name': 'ghost', 'fixed': True, 'visuals': seen}]})
    markers = SceneMarkers('world', world.scene)
    data = markers.encode(0, world.position, world.orientation)
    found = STORE.deserialize_cdr(data, 'visualization_msgs/msg/MarkerArray').markers
    assert [(marker.ns, marker.type) for marker in found] == [('solid', SPHERE), ('ghost', CUBE)]
    assert (found[1].color.r, found[1].color.g, found[1].color.a) == (0.0, 1.0, 1.0)
