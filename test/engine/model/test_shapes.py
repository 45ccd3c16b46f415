# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shapes and materials: what is stored, combined and refused."""

import math

from engine.detecting import cube_mesh, octahedron, Scene, UPRIGHT
import numpy as np
import pytest

from rigid_sim_ros.engine.model.hulls import polygons, Polyhedron
from rigid_sim_ros.engine.model.kinds.table import BOX, CYLINDER, HULL, PLANE, SPHERE
from rigid_sim_ros.engine.model.shapes import build_materials, build_shapes, Material, Shape
from rigid_sim_ros.scene.collision import convex_hull


def test_friction_combines_as_the_geometric_mean_and_restitution_as_the_larger():
    table = build_materials([Material(0.2, 0.1), Material(0.8, 0.7)])
    assert table.friction[0, 1] == pytest.approx(math.sqrt(0.2 * 0.8), rel=1e-15)
    assert table.restitution[1, 0] == 0.7


def test_stiffnesses_act_as_springs_in_series():
    table = build_materials([Material(stiffness=3e4), Material(stiffness=6e4)])
    assert table.stiffness[0, 1] == pytest.approx(2e4, rel=1e-15)


def test_an_override_holds_for_both_orders_of_its_pair_only():
    table = build_materials([Material(0.2), Material(0.8)], [(0, 1, Material(0.0))])
    assert table.friction.tolist() == [[0.2, 0.0], [0.0, 0.8]]


@pytest.mark.parametrize(('material', 'told'), [
    (Material(friction=-0.1), 'friction -0.1'), (Material(restitution=1.5), 'restitution 1.5'),
    (Material(rolling=math.nan), 'rolling nan'), (Material(stiffness=0.0), 'stiffness 0.0')])
def test_a_material_that_no_surface_has_is_refused_with_its_value(material, told):
    with pytest.raises(ValueError, match=told):
        build_materials([material])


def test_triangles_of_one_plane_become_one_face():
    mesh = cube_mesh(0.5)
    faces, normals, offsets = polygons(*mesh)
    assert sorted(len(face) for face in faces) == [4] * 6
    assert np.abs(normals).sum() == pytest.approx(6.0)
    assert offsets == pytest.approx(0.5)


def test_corners_of_a_face_run_anticlockwise_seen_from_outside():
    vertices, triangles = octahedron(1.0, 2.0, 3.0)
    faces, normals, _ = polygons(vertices, triangles)
    for face, normal in zip(faces, normals, strict=True):
        p, q, r = vertices[face]
        assert np.cross(q - p, r - p) @ normal > 0.0


def test_a_mesh_with_a_dent_is_refused():
    vertices, triangles = cube_mesh(0.5)
    vertices = np.append(vertices, [[0.0, 0.0, 0.2]], axis=0)
    # The top face, 1 3 7 5, now falls in towards the new vertex.
    triangles = [t for t in triangles.tolist() if set(t) not in ({1, 5, 7}, {1, 7, 3})]
    triangles += [[1, 5, 8], [5, 7, 8], [7, 3, 8], [3, 1, 8]]
    with pytest.raises(ValueError, match='not convex'):
        polygons(vertices, np.array(triangles))


def test_a_mesh_with_a_hole_is_refused():
    vertices, triangles = cube_mesh(0.5)
    with pytest.raises(ValueError, match='not closed'):
        polygons(vertices, triangles[:-1])


@pytest.mark.parametrize(('shape', 'told'), [
    (Shape(0, SPHERE, (0.0, 0.0, 0.0)), 'size 0.0 m'),
    (Shape(0, CYLINDER, (1.0, -1.0, 0.0)), 'size -1.0 m'),
    (Shape(0, BOX, (1.0, 1.0, math.inf)), 'size inf m'),
    (Shape(0, HULL, (0.0, 0.0, 0.0)), 'no vertices'),
    (Shape(0, PLANE, (0.0, 0.0, 0.0)), 'only a fixed body')])
def test_a_shape_that_cannot_be_is_refused(shape, told):
    scene = Scene([(SPHERE, (1.0, 0.0, 0.0), None)], [((0, 0, 0), UPRIGHT)])
    with pytest.raises(ValueError, match=told):
        build_shapes(scene.model, [shape])


def test_a_hull_off_its_frame_collides_where_its_vertices_are():
    mesh = cube_mesh(0.5)
    moved = Polyhedron(mesh.vertices + np.array([0.0, 0.0, 2.0]), mesh.triangles)
    scene = Scene([(HULL, (0.0, 0.0, 0.0), moved), (SPHERE, (0.25, 0.0, 0.0), None)],
                  [((0, 0, 0), UPRIGHT), ((0, 0, 3), UPRIGHT)])
    assert scene.distance(0, 1)[0] == pytest.approx(3.0 - 2.5 - 0.25, abs=1e-15)


def test_faces_of_a_round_hull_hold_all_vertices_and_close_it():
    rng = np.random.default_rng(7)
    points = rng.normal(size=(500, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    points[:200, 2] = 0.0       # a flat side, of many triangles, and a rim
    vertices, triangles = convex_hull(points[points[:, 2] >= 0.0])
    faces, normals, offsets = polygons(vertices, triangles)
    assert sorted(map(len, faces))[-2:][0] == 3 < max(map(len, faces))
    # 1e-14: coordinates of size 1, a few roundings of 1.1e-16 each.
    assert (vertices @ normals.T).max(axis=0) == pytest.approx(offsets, abs=1e-14)
    edges = [edge for face in faces for edge in zip(face, face[1:] + face[:1], strict=True)]
    assert len(set(edges)) == len(edges)


def test_a_mesh_with_an_edge_that_is_there_twice_is_refused():
    vertices, triangles = cube_mesh(0.5)
    with pytest.raises(ValueError, match='two triangles on the same side of edge'):
        polygons(vertices, np.append(triangles, triangles[:1], axis=0))
