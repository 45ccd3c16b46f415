# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the files of a model are found, and where none is read."""

import tracemalloc
from urllib.parse import quote

from bag.hostile import limited_time
from models.robots import INERTIAL, URDF, write
import numpy as np
import pytest
import trimesh

from rigid_sim_ros.models.files import Folders
from rigid_sim_ros.models.findings import Findings
from rigid_sim_ros.models.xml_tree import parse
from rigid_sim_ros.scene import read_scene, SceneError

PLACE = parse(b'<robot/>', 'r.urdf')
CYLINDER = '<cylinder radius="0.02" length="1"/>'


def found(folders: Folders, uri: str) -> object:
    """Return the path that a URI names, or the message of its error."""
    findings = Findings()
    path = folders.find(uri, PLACE, findings)
    return path if path is not None else findings.errors[0].message


def test_a_path_lies_beside_the_model(tmp_path) -> None:
    mesh = write(tmp_path, 'a/meshes/x.stl', '')
    assert found(Folders(tmp_path / 'a'), 'meshes/x.stl') == mesh
    assert found(Folders(tmp_path / 'a'), f'file://{mesh}') == mesh


@pytest.mark.parametrize('uri', ['../x.stl', '{0}/x.stl', 'file://{0}/x.stl', 'link/x.stl',
                                 'package://p/../../x.stl', 'model://../x.stl', 'a\0b', ''])
def test_nothing_is_read_outside_of_the_folders(tmp_path, uri) -> None:
    write(tmp_path, 'x.stl', '')
    write(tmp_path, 'a/p/package.xml', '')
    (tmp_path / 'a/link').symlink_to(tmp_path)
    folders = Folders(tmp_path / 'a', {'p': tmp_path / 'a/p'})
    assert 'must' in str(found(folders, uri.format(tmp_path)))


def test_the_package_around_a_model_is_known_by_its_name(tmp_path) -> None:
    mesh = write(tmp_path, 'arm_description/meshes/x.stl', '')
    folders = Folders(tmp_path / 'arm_description/urdf')
    assert "package 'arm_description' is not found" in str(
        found(folders, 'package://arm_description/meshes/x.stl'))
    write(tmp_path, 'arm_description/package.xml', '')
    assert found(folders, 'package://arm_description/meshes/x.stl') == mesh
    assert found(folders, '../meshes/x.stl') == mesh


def test_a_clone_of_a_package_has_the_name_that_its_package_file_tells(tmp_path) -> None:
    mesh = write(tmp_path, 'arm-main/meshes/x.stl', '')
    folders = Folders(tmp_path / 'arm-main/urdf')
    write(tmp_path, 'arm-main/package.xml',
          '<package format="3">\n  <name> arm_description </name>\n'
          '  <author>x</author><export><name>other</name></export></package>')
    assert found(folders, 'package://arm_description/meshes/x.stl') == mesh
    assert found(folders, 'package://arm-main/meshes/x.stl') == mesh
    assert "package 'other' is not found" in str(found(folders, 'package://other/meshes/x.stl'))


def test_a_package_is_found_in_a_workspace_made_of_links(tmp_path, monkeypatch) -> None:
    write(tmp_path, 'src/arm/x.stl', '')
    share = tmp_path / 'install/share'
    share.mkdir(parents=True)
    (share / 'arm').mkdir()
    (share / 'arm/x.stl').symlink_to(tmp_path / 'src/arm/x.stl')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path / "install"}')
    assert found(Folders(tmp_path / 'a'), 'package://arm/x.stl') == share / 'arm/x.stl'


def test_packages_of_the_scene_are_relative_to_it(tmp_path) -> None:
    (tmp_path / 'shapes').mkdir()
    trimesh.creation.box((1, 1, 2)).export(tmp_path / 'shapes/x.stl')
    write(tmp_path, 'r.urdf', URDF.replace(CYLINDER, '<mesh filename="package://mine/x.stl"/>'))
    path = write(tmp_path, 'scene.yaml', 'world: {contact: none}\nmodels:\n'
                 '- {name: r, file: r.urdf, packages: {mine: shapes}}\n')
    assert len(read_scene(path).spec.bodies[1].shape.vertices) == 8


@pytest.mark.parametrize('kind', ['stl', 'obj', 'dae', 'glb'])
def test_meshes_of_each_format_collide_as_their_convex_hulls(tmp_path, kind) -> None:
    block = trimesh.creation.box((0.1, 0.2, 0.3))
    notch = trimesh.creation.box((0.1, 0.2, 0.3)).apply_translation((0.1, 0, 0.3))
    trimesh.util.concatenate([block, notch]).export(tmp_path / f'x.{kind}')
    path = write(tmp_path, 'r.urdf', URDF.replace(
        CYLINDER, f'<mesh filename="x.{kind}" scale="1 -2 1"/>'))
    scene = read_scene(path)
    shape = scene.spec.bodies[1].shape
    vertices = np.array(shape.vertices)
    np.testing.assert_allclose(vertices.min(axis=0), [-0.05, -0.2, -0.15], atol=1e-7)
    np.testing.assert_allclose(vertices.max(axis=0), [0.15, 0.2, 0.45], atol=1e-7)
    hull = trimesh.Trimesh(shape.vertices, shape.faces)
    assert hull.is_convex
    assert hull.volume > 0.0
    assert any(f'collide as their convex hulls: x.{kind}' in note for note in scene.notes)


def test_the_unit_of_a_dae_file_counts(tmp_path) -> None:
    trimesh.creation.box((10, 20, 30)).export(tmp_path / 'x.dae')
    text = (tmp_path / 'x.dae').read_text()
    assert text.count('</asset>') == 1
    (tmp_path / 'x.dae').write_text(text.replace(
        '</asset>', '<unit name="centimetre" meter="0.01"/></asset>'))
    path = write(tmp_path, 'r.urdf', URDF.replace(CYLINDER, '<mesh filename="x.dae"/>'))
    vertices = np.array(read_scene(path).spec.bodies[1].shape.vertices)
    np.testing.assert_allclose(np.ptp(vertices, axis=0), [0.1, 0.2, 0.3], rtol=1e-6)


def test_a_dae_file_with_entities_is_refused(tmp_path) -> None:
    write(tmp_path, 'x.dae', '<!DOCTYPE a [<!ENTITY e "' + 'e' * 100 + '">]><a>&e;</a>')
    path = write(tmp_path, 'r.urdf', URDF.replace(CYLINDER, '<mesh filename="x.dae"/>'))
    with pytest.raises(SceneError, match='is not a mesh that can be read'):
        read_scene(path)


def test_a_hull_with_very_many_corners_gets_fewer(tmp_path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    ball.export(tmp_path / 'x.stl')
    path = write(tmp_path, 'r.urdf', URDF.replace(CYLINDER, '<mesh filename="x.stl"/>'))
    scene = read_scene(path)
    vertices = np.array(scene.spec.bodies[1].shape.vertices)
    assert len(vertices) < 0.5 * len(ball.vertices)
    hull = trimesh.convex.convex_hull(vertices)
    # 0.002 of the extent of 0.2 m; float32 in the file.
    outside = (ball.vertices @ hull.face_normals.T
               - np.einsum('fi,fi->f', hull.face_normals, hull.triangles[:, 0]))
    assert outside.max() < 4.01e-4
    assert any('are made simpler, by 0.4 mm' in note for note in scene.notes)


def test_a_document_without_end_is_refused(tmp_path) -> None:
    deep = write(tmp_path, 'deep.urdf', '<robot>' + '<a>' * 5000 + '</a>' * 5000 + '</robot>')
    with pytest.raises(SceneError, match='more than 100 levels'):
        read_scene(deep)
    laughs = ('<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
              '<robot name="&b;"/>')
    with pytest.raises(SceneError, match='document type or entities, must have none'):
        read_scene(write(tmp_path, 'laughs.urdf', laughs))


def test_what_grows_with_the_square_of_a_file_does_not_begin() -> None:
    """An element's text comes in thousands of pieces; a comment is mended where it stands."""
    text = '\n' * 30_000_000
    with limited_time():
        assert parse(f'<robot>{text}</robot>'.encode(), 'r.urdf').text == text


def test_comments_take_no_room_beside_the_file() -> None:
    comments = b'<!-- a--b --->' * 20_000
    tracemalloc.start()
    try:
        root = parse(b'<robot>' + comments + b'</robot>', 'r.urdf')
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert not root.children
    # The file once more as it is mended and as it is read, and the parser's 64 kB at a time;
    # pieces of some 40 bytes each, three a comment, were more than ten times as much.
    assert most < 4 * len(comments)


def test_a_name_with_a_line_break_stays_on_its_line(tmp_path) -> None:
    """What is told of a mesh is one line, whatever its file is called."""
    path = tmp_path / 'bowl\nnote: all is well.stl'
    bowl = trimesh.creation.annulus(0.5, 1.0, 0.2)
    bowl.export(path)
    urdf = write(tmp_path, 'robot.urdf', f"""<robot name="r">
      <link name="base">{INERTIAL.format(I=1, J=1)}</link>
      <link name="a">{INERTIAL.format(I=1, J=1)}<collision><geometry>
        <mesh filename="{quote(path.name)}"/></geometry></collision></link>
      <joint name="j" type="continuous"><parent link="base"/><child link="a"/></joint></robot>""")
    note, = read_scene(urdf).notes
    assert '\n' not in note and 'bowl\\nnote: all is well.stl' in note


@pytest.mark.parametrize('text', [
    '<!-- a --option\nof a tool -->{}', '<!-- ruler\n------>{}', '\n<?xml version="1.0"?>{}'])
def test_what_tinyxml_reads_is_read_with_the_same_lines(text) -> None:
    root = parse(text.format('<robot>\n<link/></robot>').encode(), 'r.urdf')
    assert [(one.tag, one.line) for one in root.every()] == [('robot', 2), ('link', 3)]


def test_where_others_see_an_element_there_is_one() -> None:
    text = '<a><?x <!-- ?><b c="d--e"/><?y --> ?><![CDATA[<!--]]><f c="g--h"/><![CDATA[-->]]></a>'
    root = parse(text.encode(), 'm.xml')
    assert [one.attributes.get('c') for one in root.every()] == [None, 'd--e', 'g--h']
    assert root.text == '<!---->'
