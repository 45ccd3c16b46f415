# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What of a scene can touch, and how it behaves when it does."""

import numpy as np
import pytest

from rigid_sim_ros.engine.maths.rotation import rotate
from rigid_sim_ros.engine.model.kinds.table import BOX, HULL, PLANE, SPHERE
from rigid_sim_ros.scene import scene_from_dict, scene_from_text, SceneError
from rigid_sim_ros.scene.collision import MAX_GROUPS

CUBE = ('0 0 0, 1 0 0, 1 1 0, 0 1 0, 0 0 1, 1 0 1, 1 1 1, 0 1 1',
        '0 3 2, 0 2 1, 4 5 6, 4 6 7, 0 1 5, 0 5 4, 1 2 6, 1 6 5, 2 3 7, 2 7 6, 3 0 4, 3 4 7')


def ball(name, **keys):
    return {'name': name, 'shape': {'type': 'sphere', 'radius': 0.5}, 'mass': 1.0, **keys}


def read(*bodies, **scene):
    return scene_from_dict({'format': 1, 'bodies': list(bodies), **scene})


def collide(scene, a, b):
    """Return whether the filters let two shapes touch."""
    s = scene.shapes
    return bool(s.mask[a] & s.group[b]) and bool(s.mask[b] & s.group[a])


def test_lengths_become_half_lengths():
    scene = read({'name': 'b', 'shape': {'type': 'box', 'size': [1, 2, 3]}, 'mass': 1.0})
    assert scene.shapes.kind.tolist() == [BOX]
    assert scene.shapes.size.tolist() == [[0.5, 1.0, 1.5]]


@pytest.mark.parametrize('normal', [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0.3, -2.0, 0.5]])
def test_a_plane_has_its_z_axis_along_the_normal_and_its_origin_at_the_offset(normal):
    scene = read({'name': 'g', 'fixed': True,
                  'shape': {'type': 'plane', 'normal': normal, 'offset': 0.7}})
    n = np.array(normal) / np.linalg.norm(normal)
    assert scene.shapes.kind.tolist() == [PLANE]
    assert np.allclose(rotate(tuple(scene.shapes.q_CS[0]), (0.0, 0.0, 1.0)), n, atol=1e-15)
    assert scene.shapes.p_CS[0] @ n == pytest.approx(0.7, abs=1e-15)


def test_the_parts_of_a_compound_are_shapes_of_one_body():
    scene = read(ball('a'), {'name': 'c', 'mass': 1.0, 'compound': [
        {'type': 'sphere', 'radius': 0.1}, {'type': 'box', 'size': [1, 1, 1]}]})
    assert scene.shapes.body.tolist() == [0, 1, 1]
    assert scene.shapes.kind.tolist() == [SPHERE, SPHERE, BOX]


def test_a_mesh_collides_as_its_convex_hull():
    vertices, faces = CUBE
    dented = vertices.replace('1 1 1', '0.4 0.4 0.4')  # a corner of the cube pushed in
    scene = read({'name': 'm', 'mass': 1.0,
                  'shape': {'type': 'mesh', 'vertices': dented, 'faces': faces}})
    assert scene.shapes.kind.tolist() == [HULL]
    assert scene.shapes.hulls.count.tolist() == [7]


def test_the_hull_of_a_cube_has_six_faces_that_look_outwards():
    vertices, faces = CUBE
    hulls = read({'name': 'm', 'mass': 1.0, 'shape': {
        'type': 'mesh', 'vertices': vertices, 'faces': faces}}).shapes.hulls
    assert hulls.face_count.tolist() == [6]
    assert (hulls.offsets > 0.0).all()


def test_points_collide_with_nothing():
    scene = read({'name': 'p', 'shape': {
        'type': 'points', 'positions': [[1, 0, 0], [-1, 0, 0], [0, 1, 0]], 'masses': [1, 1, 1]}})
    assert scene.shapes.body.shape == (0,)


def test_everything_collides_unless_told_otherwise():
    assert collide(read(ball('a'), ball('b')), 0, 1)


def test_groups_choose_who_collides():
    scene = read(ball('a', groups=['red'], collides_with=['red', 'blue']),
                 ball('b', groups=['blue'], collides_with=['red']),
                 ball('c', groups=['blue'], collides_with=['blue']))
    assert collide(scene, 0, 1)  # each is with a group of the other
    assert not collide(scene, 0, 2)  # c does not collide with red
    assert not collide(scene, 1, 2)


def test_a_body_may_collide_with_nothing():
    assert read(ball('a', collides=False), ball('b')).shapes.body.tolist() == [1]


def test_pairs_of_bodies_can_be_ignored():
    scene = read(ball('a'), ball('b'), ball('c'), collision={'ignore': [['c', 'a']]})
    assert scene.shapes.ignored.tolist() == [0 * 3 + 2]


def test_materials_combine_by_the_stated_rule():
    scene = read(ball('a', material='ice'), ball('b', material='rubber'), materials={
        'ice': {'friction': 0.04, 'restitution': 0.1, 'rolling': 0.001},
        'rubber': {'friction': 1.0, 'restitution': 0.8}})
    ice, rubber = scene.shapes.material
    assert scene.materials.friction[ice, rubber] == pytest.approx(0.2, rel=1e-15)
    assert scene.materials.restitution[ice, rubber] == 0.8
    assert scene.materials.rolling[rubber, ice] == 0.001


def test_a_pair_of_materials_can_have_values_of_its_own():
    scene = read(ball('a', material='ice'), materials={'ice': {'friction': 0.04}},
                 material_pairs=[{'a': 'ice', 'b': 'default', 'friction': 0.3}])
    names = list(scene.spec.all_materials)
    i, j = names.index('ice'), names.index('default')
    assert scene.materials.friction[i, j] == scene.materials.friction[j, i] == 0.3
    assert scene.materials.friction[i, i] == 0.04


@pytest.mark.parametrize(('keys', 'message'), [
    ({'materials': {'m': {'friction': -0.1}}}, r'materials\.m\.friction: -0\.1, must be >= 0'),
    ({'materials': {'m': {'restitution': 1.1}}},
     r'materials\.m\.restitution: 1\.1, must be in \[0, 1\]'),
    ({'collision': {'ignore': [['a', 'x']]}}, r"ignore\[0\]\[1\]: 'x' is no body, must be a or b"),
    ({'collision': {'ignore': [['a', 'a']]}}, 'must be two different names'),
    ({'collision': {'substeps': 2.5}}, 'substeps: 2.5, must be a whole number from 1 to 64'),
    ({'material_pairs': [{'a': 'defalt', 'b': 'default'}]}, "did you mean 'default'"),
])
def test_mistakes_name_their_place(keys, message):
    with pytest.raises(SceneError, match=message):
        read(ball('a'), ball('b'), **keys)


def test_an_unknown_group_is_a_mistake():
    with pytest.raises(SceneError, match=r"collides_with\[0\]: 'rde' is no group of any body"):
        read(ball('a', groups=['red'], collides_with=['rde']))


def test_all_of_it_is_in_the_text_of_the_scene():
    scene = read(ball('a', groups=['red'], collides_with=['red']), ball('b', collides=False),
                 collision={'ignore': [['a', 'b']], 'continuous': True, 'substeps': 8},
                 material_pairs=[{'a': 'default', 'b': 'default', 'friction': 0.7}])
    again = scene_from_text(scene.text)
    assert again.text == scene.text
    assert again.shapes.mask.tolist() == scene.shapes.mask.tolist()
    assert again.materials.friction.tolist() == scene.materials.friction.tolist()


def test_as_many_groups_as_a_number_has_bits_for_are_told_apart_and_not_one_more():
    # One of them is the default group, which all scenes have.
    bodies = [ball(f'ball_{k}', groups=[f'group {k}'], collides_with=[f'group {k - k % 2}'])
              for k in range(MAX_GROUPS - 1)]
    scene = read(*bodies)
    assert len(set(scene.shapes.group)) == MAX_GROUPS - 1
    last = MAX_GROUPS - 2
    assert collide(scene, last, last)
    assert not collide(scene, last, last - 2)
    assert scene.shapes.group.max() == 1 << (MAX_GROUPS - 1)
    with pytest.raises(SceneError, match=f'{MAX_GROUPS + 1} groups, must be {MAX_GROUPS} or'):
        read(*bodies, ball('more', groups=['one more']))
