# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Meshes: OBJ and STL files, closed or refused, with exact mass properties."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from rigid_sim_ros.scene import read_scene, scene_from_text, SceneError

# A box of 1 x 2 x 3 with a corner in the origin: eight corners and six squares, seen from outside.
CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)]
SQUARES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = [t for a, b, c, d in SQUARES for t in ((a, b, c), (a, c, d))]

Refusal = Callable[[str], str]


def obj(faces: list[tuple[int, ...]] = SQUARES) -> str:
    """Return the box as the text of an OBJ file."""
    lines = [f'v {x} {y} {z}' for x, y, z in CORNERS]
    return '\n'.join([*lines, *('f ' + ' '.join(str(i + 1) for i in face) for face in faces)])


def scene(tmp_path: Path, shape: str, mass: str = 'mass: 6') -> Path:
    """Write a scene with one mesh, and return its path."""
    path = tmp_path / 'scene.yaml'
    path.write_text(f'bodies:\n- name: a\n  {mass}\n  shape: {{type: mesh, {shape}}}\n')
    return path


@pytest.fixture
def refusal(tmp_path: Path) -> Refusal:
    """Return what gives the message for a mesh that is refused."""
    def refusal(shape: str) -> str:
        with pytest.raises(SceneError) as error:
            read_scene(scene(tmp_path, shape))
        place, message = str(error.value).split(': bodies[0].shape', 1)
        assert place.endswith('scene.yaml:4')
        return message
    return refusal


def test_an_obj_file_beside_the_scene_is_read(tmp_path: Path) -> None:
    (tmp_path / 'box.obj').write_text(obj())
    model = read_scene(scene(tmp_path, 'file: box.obj')).model
    # Box of 1 x 2 x 3 and 6 kg: m/12 (b^2 + c^2) = 6.5, 5, 2.5, about its middle.
    assert np.sort(model.I_C[:, 0]) == pytest.approx([2.5, 5.0, 6.5], rel=1e-14)
    assert model.p_CB[0] == pytest.approx([-0.5, -1.0, -1.5], rel=1e-14)


@pytest.mark.parametrize('kind', ['stl', 'stl_ascii'])
def test_an_stl_file_has_its_corners_joined(tmp_path: Path, kind: str) -> None:
    box = trimesh.Trimesh(CORNERS, TRIANGLES, process=False)
    (tmp_path / 'box.STL').write_bytes(trimesh.exchange.export.export_mesh(
        box, None, file_type=kind) if kind == 'stl' else box.export(file_type=kind).encode())
    read = read_scene(scene(tmp_path, 'file: box.STL', 'density: 2'))
    mesh, = (part for _, part in read.spec.bodies[0].parts())
    assert len(mesh.vertices) == 8
    assert read.model.m[0] == pytest.approx(12.0, rel=1e-14)


def test_an_obj_file_opens_no_other_file(tmp_path: Path) -> None:
    (tmp_path / 'box.obj').write_text('mtllib /dev/zero\nusemtl x\n' + obj())
    assert read_scene(scene(tmp_path, 'file: box.obj')).model.m[0] == 6.0


def test_a_mesh_may_stand_in_the_scene(tmp_path: Path) -> None:
    shape = f'vertices: {[list(c) for c in CORNERS]}, faces: {[list(t) for t in TRIANGLES]}'
    model = read_scene(scene(tmp_path, shape, 'density: 1')).model
    assert model.m[0] == pytest.approx(6.0, rel=1e-15)


@pytest.mark.parametrize(('scale', 'factors'), [('2', (2, 2, 2)), ('[1, 2, 0.5]', (1, 2, 0.5))])
def test_a_mesh_is_scaled(tmp_path: Path, scale: str, factors: tuple[float, ...]) -> None:
    (tmp_path / 'box.obj').write_text(obj())
    model = read_scene(scene(tmp_path, f'file: box.obj, scale: {scale}', 'density: 1')).model
    assert model.m[0] == pytest.approx(6.0 * np.prod(factors), rel=1e-15)
    assert -model.p_CB[0] == pytest.approx(np.multiply([0.5, 1, 1.5], factors), rel=1e-15)


def test_a_mesh_turned_inside_out_is_turned_back(tmp_path: Path) -> None:
    (tmp_path / 'box.obj').write_text(obj([face[::-1] for face in SQUARES]))
    assert read_scene(scene(tmp_path, 'file: box.obj', 'density: 1')).model.m[0] > 0


def test_a_fine_mesh_of_a_ball_weighs_as_trimesh_says(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    ball.apply_translation([10, -20, 30])
    ball.export(tmp_path / 'ball.stl')
    model = read_scene(scene(tmp_path, 'file: ball.stl', 'density: 1000')).model
    loaded = trimesh.load(tmp_path / 'ball.stl')
    # STL holds float32: both read the same rounded corners. 1280 signed volumes of 1e-4 m^3 lose
    # little; trimesh integrates about the far origin, where r^2 is 1400 and cancels to 0.1.
    assert model.m[0] == pytest.approx(1000 * loaded.volume, rel=1e-9)
    assert np.sort(model.I_C[:, 0]) == pytest.approx(
        np.sort(1000 * loaded.principal_inertia_components), rel=1e-7)


def test_an_open_mesh_is_refused_with_numbers(tmp_path: Path, refusal: Refusal) -> None:
    (tmp_path / 'box.obj').write_text(obj(TRIANGLES[:-1]))
    assert refusal('file: box.obj') == ('.file: the mesh is open: 3 of 18 edges have a triangle '
                                        'on one side only, must be a closed surface')


def test_a_mesh_wound_inconsistently_is_refused_with_numbers(
        tmp_path: Path, refusal: Refusal) -> None:
    (tmp_path / 'box.obj').write_text(obj([TRIANGLES[0][::-1], *TRIANGLES[1:]]))
    assert refusal('file: box.obj') == (
        '.file: the mesh is wound inconsistently: at 3 of 18 edges the triangles disagree about '
        'the outside, must have all corners counterclockwise')


def test_a_flat_mesh_is_refused_with_its_volume(refusal: Refusal) -> None:
    shape = 'vertices: "0 0 0, 1 0 0, 0 1 0", faces: "0 1 2, 0 2 1"'
    assert refusal(shape) == ': the mesh encloses 0 m^3, must be a volume'


@pytest.mark.parametrize('height', [1e-7, 1e-9, 1e-12])
def test_a_mesh_too_thin_for_a_contact_is_refused_with_its_size(
        height: float, refusal: Refusal) -> None:
    corners = ', '.join(f'{x} {y} {z}' for x in (0, 1) for y in (0, 1) for z in (0, height))
    faces = '0 2 6, 0 6 4, 1 5 7, 1 7 3, 0 4 5, 0 5 1, 2 3 7, 2 7 6, 0 1 3, 0 3 2, 4 6 7, 4 7 5'
    assert refusal(f'vertices: "{corners}", faces: "{faces}"') == (
        f': the mesh is {height:.3g} m thick and 1 m long, must be at least 1e-06 of its length '
        'thick, or collides: false')


def test_a_face_without_its_vertex_is_refused(refusal: Refusal) -> None:
    shape = 'vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces: [[0, 1, 3]]'
    assert refusal(shape) == ': a face has the vertex 3, must be below 3'


def test_a_missing_mesh_file_is_named(tmp_path: Path, refusal: Refusal) -> None:
    assert refusal('file: none.obj') == (
        f'.file: {tmp_path / "none.obj"} cannot be read: No such file or directory')


def test_a_mesh_file_of_another_kind_is_refused(tmp_path: Path, refusal: Refusal) -> None:
    for name in ('part.step', '../part', 'folder/part.obj.gz'):
        assert refusal(f'file: {name}') == (
            f'.file: {tmp_path / name}, must be an OBJ, STL, DAE or GLB file')


@pytest.mark.parametrize(
    'content', [b'', b'\x00' * 83, b'solid x\nfacet', b'f 1 2 3', b'\xff' * 200])
@pytest.mark.parametrize('name', ['bad.obj', 'bad.stl'])
def test_a_damaged_mesh_file_is_refused(
        tmp_path: Path, refusal: Refusal, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    assert refusal(f'file: {name}').startswith('.file: ')


@pytest.mark.parametrize(('shape', 'message'), [
    ('file: a.obj, faces: "0 1 2"', ': must have a file, or vertices and faces'),
    ('vertices: "0 0 0"', ': must have a file, or vertices and faces'),
    ('file: a.obj, scale: 0', '.scale: 0, must be > 0'),
    ('file: a.obj, scale: [1, 1, -1]', '.scale[2]: -1, must be > 0'),
    ('vertices: "0 0 nan", faces: "0 1 2"', '.vertices[0]: nan m, must be finite'),
    ('vertices: "0 0", faces: "0 1 2"', '.vertices[0]: [0, 0], must be [x y z]'),
    ('vertices: "0 0 0", faces: "0 1 -2"',
     '.faces[0]: -2, must be the index of a vertex, counted from 0'),
])
def test_a_mesh_that_is_written_wrongly_is_refused(
        refusal: Refusal, shape: str, message: str) -> None:
    assert refusal(shape) == message


def test_a_scene_without_a_folder_must_hold_its_meshes() -> None:
    with pytest.raises(SceneError) as error:
        scene_from_text('bodies: [{name: a, mass: 1, shape: {type: mesh, file: box.obj}}]', 'text')
    assert str(error.value) == ("text:1: bodies[0].shape.file: 'box.obj' is not beside the scene, "
                                'must be vertices and faces in it')


def test_the_text_of_a_scene_holds_its_meshes(tmp_path: Path) -> None:
    (tmp_path / 'box.obj').write_text(obj())
    read = read_scene(scene(tmp_path, 'file: box.obj, scale: 0.1'))
    again = scene_from_text(read.text, read.name)
    assert again.text == read.text
    assert again.model.I_C.tobytes() == read.model.I_C.tobytes()
