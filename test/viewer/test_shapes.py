# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What bodies are drawn with, and how their states are read."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('viser') is None:
    raise SkipTest('viser is not installed: pip install .[view]')

from hypothesis import given
from hypothesis.strategies import integers
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
import trimesh

from rigid_sim_ros.messages.codec import StateEncoder
from rigid_sim_ros.scene import read_scene, scene_from_dict
from rigid_sim_ros.viewer.motion import among, Motion, MotionDecoder, without_absent
from rigid_sim_ros.viewer.shapes import Shapes

TETRAHEDRON = {'vertices': '0 0 0, 1 0 0, 0 1 0, 0 0 1', 'faces': '0 2 1, 0 1 3, 0 3 2, 1 2 3'}


def drawn(shape, **body):
    """Return the triangles that a body with a shape is drawn with, in its frame."""
    scene = scene_from_dict({'format': 1, 'bodies': [
        {'name': 'it', 'shape': shape, 'mass': 1.0, **body}]})
    shapes = Shapes(scene)
    parts = []
    for solid in shapes.solids:
        surface = shapes.surfaces[solid.form]
        points = Rotation.from_quat(solid.orientation).apply(surface.vertices * solid.scale)
        parts.append(trimesh.Trimesh(points + solid.position, surface.faces))
    return trimesh.util.concatenate(parts)


@pytest.mark.parametrize(('shape', 'low', 'high'), [
    ({'type': 'sphere', 'radius': 0.3}, [-0.3] * 3, [0.3] * 3),
    ({'type': 'box', 'size': [1, 2, 3]}, [-0.5, -1, -1.5], [0.5, 1, 1.5]),
    ({'type': 'cylinder', 'radius': 0.5, 'length': 2}, [-0.5, -0.5, -1], [0.5, 0.5, 1]),
    ({'type': 'capsule', 'radius': 0.5, 'length': 2}, [-0.5, -0.5, -1.5], [0.5, 0.5, 1.5]),
    ({'type': 'cone', 'radius': 0.5, 'length': 2}, [-0.5, -0.5, -1], [0.5, 0.5, 1]),
    ({'type': 'ellipsoid', 'radii': [1, 2, 3]}, [-1, -2, -3], [1, 2, 3]),
    ({'type': 'mesh', **TETRAHEDRON, 'scale': [2, 1, 1]}, [0, 0, 0], [2, 1, 1]),
], ids=lambda value: value.get('type') if isinstance(value, dict) else '')
def test_a_shape_is_as_large_as_the_scene_says(shape, low, high):
    mesh = drawn(shape)
    assert mesh.bounds == pytest.approx(np.array([low, high]), abs=1e-9)


@pytest.mark.parametrize(('shape', 'volume'), [
    ({'type': 'sphere', 'radius': 0.5}, 4 / 3 * np.pi * 0.5 ** 3),
    ({'type': 'cylinder', 'radius': 0.5, 'length': 2}, np.pi * 0.5 ** 2 * 2),
    ({'type': 'capsule', 'radius': 0.5, 'length': 2}, np.pi * 0.5 ** 2 * (2 + 4 / 3 * 0.5)),
    ({'type': 'cone', 'radius': 0.5, 'length': 2}, np.pi * 0.5 ** 2 * 2 / 3),
    ({'type': 'ellipsoid', 'radii': [1, 2, 3]}, 8 * np.pi),
    ({'type': 'mesh', **TETRAHEDRON}, 1 / 6),
    ({'type': 'mesh', **TETRAHEDRON, 'scale': [1, 1, 3]}, 1 / 2),
], ids=lambda value: value.get('type') if isinstance(value, dict) else '')
def test_surfaces_are_seen_from_outside(shape, volume):
    # A surface that is turned inside out has the opposite volume. 24 sides of a circle: 1.2 %
    # less; the rings of a ball take as much again.
    assert drawn(shape).volume == pytest.approx(volume, rel=0.03)


def test_a_part_of_a_compound_stands_where_its_pose_says():
    mesh = drawn({'compound': [{
        'type': 'box', 'size': [2, 1, 1], 'mass': 1.0,
        'pose': {'position': [5, 0, 0], 'orientation': [0, 0, np.sqrt(0.5), np.sqrt(0.5)]}}]},
        mass=None)
    assert mesh.bounds == pytest.approx(np.array([[4.5, -1, -0.5], [5.5, 1, 0.5]]), abs=1e-9)


def test_a_plane_faces_along_its_normal():
    scene = scene_from_dict({'format': 1, 'bodies': [{'name': 'wall', 'fixed': True, 'shape': {
        'type': 'plane', 'normal': [-2, 0, 0], 'offset': 3}}]})
    plane, = Shapes(scene).planes
    turn = Rotation.from_quat(plane.orientation)
    assert turn.apply([0, 0, 1]) == pytest.approx([-1, 0, 0], abs=1e-12)
    assert plane.position == pytest.approx([-3, 0, 0])


def test_bodies_with_the_same_mesh_share_its_triangles():
    scene = scene_from_dict({'format': 1, 'bodies': [
        {'name': name, 'mass': 1.0, 'shape': {'type': 'mesh', **TETRAHEDRON}}
        for name in ('one', 'two')]})
    assert len(Shapes(scene).surfaces) == 1


def test_two_hundred_bodies_are_drawn_with_few_triangles_and_few_forms():
    shapes = Shapes(read_scene('pile_of_shapes'))
    triangles = sum(len(shapes.surfaces[solid.form].faces) for solid in shapes.solids)
    assert triangles < 40_000
    assert len(shapes.surfaces) == 5


NAMES = ('crate', 'a_ball_with_a_longer_name', 'x')


def numbers(seed):
    random = np.random.default_rng(seed)
    n = len(NAMES)
    return [random.normal(size=(n, k)) for k in (3, 4, 3, 3)]


@given(integers(0, 2 ** 62), integers(0, 2 ** 32))
def test_a_state_is_read_as_it_was_written(t_ns, seed):
    encoder, decoder = StateEncoder('world', NAMES), MotionDecoder(NAMES)
    for offset in (0, 1):       # the first is read in full, the second where numbers are known
        arrays = numbers(seed + offset)
        motion = decoder.read(encoder.encode(t_ns % (2 ** 31 * 10 ** 9), *arrays))
        assert motion is not None
        assert motion.t_ns == t_ns % (2 ** 31 * 10 ** 9)
        for read, written in zip(motion[1:], arrays, strict=True):
            assert np.array_equal(read, written)


def test_a_state_of_other_bodies_is_not_read():
    data = StateEncoder('world', ('other', 'bodies', 'here')).encode(0, *numbers(0))
    assert MotionDecoder(NAMES).read(data) is None


def test_a_cut_state_is_not_read():
    data = StateEncoder('world', NAMES).encode(0, *numbers(0))
    decoder = MotionDecoder(NAMES)
    assert decoder.read(data) is not None
    assert decoder.read(data[:-20]) is None
    assert MotionDecoder(NAMES).read(data[:50]) is None


def test_bodies_that_are_not_there_have_numbers_and_change_nothing_of_the_others():
    there = Motion(5, *numbers(3))
    shown = without_absent(among(there, np.arange(len(NAMES)), len(NAMES) + 1))
    assert shown.t_ns == 5
    for array, written in zip(shown[1:], there[1:], strict=True):
        assert np.array_equal(array[:-1], written)
        assert np.isfinite(array[-1]).all()


def looks(*visuals, **more):
    """Return what a page shows for a body with visuals, and for the same one again."""
    solid = {'shape': {'type': 'sphere', 'radius': 0.5}, 'mass': 1.0, **more}
    return Shapes(scene_from_dict({'format': 1, 'bodies': [
        {'name': name, **solid, 'visuals': list(visuals)} for name in ('one', 'other')]}))


def test_what_a_body_shows_is_one_form_with_colours_that_others_share():
    box = {'type': 'box', 'size': [1, 2, 3], 'pose': {'position': [0, 0, 5]}}
    shapes = looks({'shape': box, 'color': [0, 1, 0]},
                   {'shape': {'type': 'mesh', **TETRAHEDRON}}, color=[1, 0, 0])
    one, other = shapes.solids
    assert one.form == other.form and (one.body, other.body) == (0, 1)
    surface, colors = shapes.surfaces[one.form], shapes.vertex_colors[one.form]
    assert len(shapes.surfaces) == 1 and len(surface.vertices) == len(colors)
    green, red = ((colors == color).all(axis=1) for color in ([0, 255, 0], [255, 0, 0]))
    assert (green ^ red).all()      # the tetrahedron has the colour of the body
    assert np.ptp(surface.vertices[green], axis=0) == pytest.approx([1, 2, 3], abs=1e-12)
    assert surface.vertices[green].mean(axis=0) == pytest.approx([0, 0, 5], abs=1e-12)
    assert np.ptp(surface.vertices[red], axis=0) == pytest.approx([1, 1, 1], abs=1e-12)


def test_a_body_that_shows_nothing_has_nothing_in_the_page():
    assert looks().solids == []
