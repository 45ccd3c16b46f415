# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The triangles of each shape fill it: how far they reach in each direction."""
from importlib.util import find_spec
from unittest import SkipTest

import numpy as np
import pytest

if find_spec('pyvista') is None:
    raise SkipTest("pyvista is not installed: pip install '.[render]'")

from rigid_sim_ros.render.solids import Bodies, extents, planes
from rigid_sim_ros.render.stage import automatic_view
from rigid_sim_ros.scene import scene_from_dict
from rigid_sim_ros.scene.appearance import body_color, PALETTE
from rigid_sim_ros.world import World

DIRECTIONS = np.random.default_rng(2).normal(size=(200, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
BESIDE, ALONG = np.linalg.norm(DIRECTIONS[:, :2], axis=1), np.abs(DIRECTIONS[:, 2])
VERTICES = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.4, 0], [0, 0, 0.5]])
SOLIDS = {
    'sphere': ({'type': 'sphere', 'radius': 0.2}, np.full(200, 0.2)),
    'box': ({'type': 'box', 'size': [0.1, 0.2, 0.3]}, np.abs(DIRECTIONS) @ [0.05, 0.1, 0.15]),
    'capsule': ({'type': 'capsule', 'radius': 0.1, 'length': 0.5}, 0.1 + 0.25 * ALONG),
    'cylinder': ({'type': 'cylinder', 'radius': 0.15, 'length': 0.4},
                 0.15 * BESIDE + 0.2 * ALONG),
    'cone': ({'type': 'cone', 'radius': 0.15, 'length': 0.4},
             np.maximum(0.2 * DIRECTIONS[:, 2], 0.15 * BESIDE - 0.2 * DIRECTIONS[:, 2])),
    'ellipsoid': ({'type': 'ellipsoid', 'radii': [0.1, 0.2, 0.3]},
                  np.linalg.norm(DIRECTIONS * [0.1, 0.2, 0.3], axis=1)),
    'mesh': ({'type': 'mesh', 'vertices': VERTICES.tolist(), 'scale': [1, 1, 2],
              'faces': [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]},
             (DIRECTIONS @ (VERTICES * [1, 1, 2]).T).max(axis=1)),
}


def world_of(shape, **body):
    return World.from_dict({'format': 1, 'world': {'contact': 'none'}, 'bodies': [
        {'name': 'thing', 'shape': shape, 'mass': 1.0, **body}]})


def drawn(world):
    bodies = Bodies(world.scene)
    bodies.move(world.position, world.orientation)
    return bodies.mesh


@pytest.mark.parametrize('kind', SOLIDS)
def test_a_shape_reaches_as_far_as_the_scene_says(kind):
    shape, support = SOLIDS[kind]
    reach = (DIRECTIONS @ np.asarray(drawn(world_of(shape)).points, dtype=float).T).max(axis=1)
    # 40 corners around cut off 1 - cos(pi / 40) of a circle, in both directions of a ball; and the
    # corners are of single precision.
    assert (reach <= support * (1 + 1e-6)).all()
    assert (reach >= support * (1 - 2 * (1 - np.cos(np.pi / 40))) - 1e-6).all()


@pytest.mark.parametrize('kind', SOLIDS)
def test_normals_point_outwards(kind):
    mesh = drawn(world_of(SOLIDS[kind][0]))
    inside = np.asarray(mesh.points).mean(axis=0)
    outward = np.einsum('pi,pi->p', mesh.point_data['Normals'], mesh.points - inside)
    assert (outward > 0).all()


def test_a_body_is_drawn_at_its_pose_and_a_part_at_its_own():
    q, p = np.array([0.5, 0.5, 0.5, 0.5]), np.array([1.0, 2.0, 3.0])
    part = {'position': [0.3, 0, 0], 'orientation': [0, 0, 0, 1]}
    mesh = drawn(world_of({'type': 'box', 'size': [0.2, 0.4, 0.6], 'pose': part},
                          pose={'position': p.tolist(), 'orientation': q.tolist()}))
    # This turn takes x to y, y to z and z to x.
    assert np.array(mesh.bounds).reshape(3, 2).mean(axis=1) == pytest.approx([1.0, 2.3, 3.0])
    assert np.ptp(mesh.points, axis=0) == pytest.approx([0.6, 0.2, 0.4], rel=1e-6)


def test_a_body_has_its_colour():
    mesh = drawn(world_of({'type': 'box', 'size': [1, 1, 1]}, color=[0.2, 0.4, 0.6]))
    assert (mesh.cell_data['color'][:, :3] == [51, 102, 153]).all()


def test_a_body_without_a_colour_has_that_of_its_material():
    spec = scene_from_dict({
        'format': 1, 'materials': {'rubber': {'color': [0.1, 0.2, 0.3]}, 'steel': {}},
        'bodies': [{'name': f'b{k}', 'shape': {'type': 'sphere', 'radius': 1}, 'mass': 1, **more}
                   for k, more in enumerate(({'material': 'rubber'}, {'material': 'steel'}, {},
                                             {'material': 'rubber', 'color': [1, 0, 0, 0.5]}))],
    }).spec
    assert body_color(spec, 0) == (0.1, 0.2, 0.3, 1.0)
    assert body_color(spec, 1) == (*PALETTE[1], 1.0)
    assert body_color(spec, 2) == (*PALETTE[2], 1.0)
    assert body_color(spec, 3) == (1, 0, 0, 0.5)


def test_extents_reach_the_farthest_corner_from_the_frame():
    part = {'position': [1.0, 0, 0]}
    assert extents(world_of({'type': 'sphere', 'radius': 0.5, 'pose': part}).scene) == (
        pytest.approx([1.5], rel=1e-3))


def test_a_plane_is_what_the_scene_says():
    world = World.from_dict({'format': 1, 'bodies': [{
        'name': 'ramp', 'fixed': True, 'color': [0.1, 0.2, 0.3],
        'shape': {'type': 'plane', 'normal': [0, 3, 4], 'offset': 0.5}}]})
    plane, = planes(world.scene)
    assert plane.normal == pytest.approx([0, 0.6, 0.8])
    assert (plane.body, plane.offset, plane.color) == (0, 0.5, (0.1, 0.2, 0.3))


def test_each_of_several_bodies_keeps_its_own_triangles():
    world = World.from_dict({'format': 1, 'world': {'contact': 'none'}, 'bodies': [
        {'name': f'ball_{k}', 'shape': {'type': 'sphere', 'radius': 0.1 * (k + 1)}, 'mass': 1.0,
         'pose': {'position': [10.0 * k, 0, 0]}, 'color': [0.2 * k, 0, 0]} for k in range(3)]})
    mesh = drawn(world)
    centers = np.asarray(mesh.cell_centers().points)
    for k in range(3):
        near = np.linalg.norm(centers - [10.0 * k, 0, 0], axis=1) < 1.0
        assert np.linalg.norm(centers[near] - [10.0 * k, 0, 0], axis=1) == pytest.approx(
            np.full(near.sum(), 0.1 * (k + 1)), rel=0.02)
        assert mesh.cell_data['color'][near, 0].max() == round(255 * 0.2 * k)


def test_particles_are_drawn_where_they_are():
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    world = World.from_dict({'format': 1, 'world': {'contact': 'none'}, 'bodies': [
        {'name': 'cloud', 'shape': {'type': 'points', 'positions': corners,
                                    'masses': [1, 1, 1, 1]}}]})
    far = np.linalg.norm(np.asarray(drawn(world).points)[:, None] - corners, axis=2).min(axis=1)
    # Balls of a twentieth of the cloud's extent.
    assert far == pytest.approx(np.full(len(far), 0.025), rel=1e-3)


def test_what_a_body_is_drawn_with_takes_the_place_of_its_solids():
    box = {'type': 'box', 'size': [0.2, 0.4, 0.6], 'pose': {'position': [0, 0, 1]}}
    world = world_of({'type': 'sphere', 'radius': 2.0}, color=[1, 0, 0], visuals=[
        {'shape': box, 'color': [0, 1, 0]}, {'shape': {'type': 'sphere', 'radius': 0.1}}])
    mesh = drawn(world)
    assert mesh.bounds == pytest.approx((-0.1, 0.1, -0.2, 0.2, -0.1, 1.3), abs=1e-6)
    colors = np.unique(np.asarray(mesh.cell_data['color']), axis=0).tolist()
    # The ball has the colour of the body, every other octant of it in shade.
    assert [0, 255, 0, 255] in colors and [255, 0, 0, 255] in colors
    assert extents(world.scene) == pytest.approx([np.hypot(np.hypot(0.1, 0.2), 1.3)], abs=1e-6)


def test_a_body_without_a_pose_is_not_drawn():
    world = World.from_dict({'world': {'contact': 'none'}, 'bodies': [
        {'name': name, 'mass': 1.0, 'shape': {'type': 'box', 'size': [1, 1, 1]},
         'pose': {'position': [x, 0, 0]}} for name, x in (('here', 3), ('gone', 9))]})
    bodies, p, q = Bodies(world.scene), world.position, world.orientation
    p[1], q[1] = np.nan, np.nan
    bodies.move(p, q)
    assert bodies.mesh.bounds == pytest.approx((2.5, 3.5, -0.5, 0.5, -0.5, 0.5), abs=1e-6)
    assert bodies.mesh.area == pytest.approx(6.0, abs=1e-6)     # of one cube
    view = automatic_view(np.stack([p, p]), extents(world.scene), 1.5)
    alone = automatic_view(np.stack([p, p])[:, :1], extents(world.scene)[:1], 1.5)
    assert view.radius == pytest.approx(alone.radius)
    assert view.target == pytest.approx(alone.target)
