# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What robots are drawn with: read from their files, made small, and no part of the motion."""
from models.robots import INERTIAL, ROD, write
import numpy as np
import pytest
import trimesh

from rigid_sim_ros import World
from rigid_sim_ros.scene import scene_from_text
from rigid_sim_ros.scene.visuals import MOST_FACES

RED, BLUE = (1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0)
URDF = """<robot name="r"><link name="base"/>
  <link name="rod">{inertia}
    <visual><origin xyz="0 0 -0.5"/><geometry><mesh filename="{file}" scale="{scale}"/></geometry>
      {material}</visual>
    <collision><origin xyz="0 0 -0.5"/><geometry><box size="0.1 0.1 1"/></geometry></collision>
  </link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="10" velocity="5"/></joint></robot>"""


def painted(mesh, color):
    mesh.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.PBRMaterial(baseColorFactor=color))
    return mesh


def two_colors(folder):
    """Write a file with a red box in the middle and a blue one of half the size 0.3 m above."""
    small = painted(trimesh.creation.box((0.1, 0.1, 0.1)), [0, 0, 255, 255])
    small.apply_translation((0.0, 0.0, 0.3))
    large = painted(trimesh.creation.box((0.2, 0.2, 0.2)), [255, 0, 0, 255])
    scene = trimesh.Scene([large, small])
    (folder / 'rod.glb').write_bytes(scene.export(file_type='glb'))
    return 'rod.glb'


def robot(folder, file, scale='1 1 1', material='', **more):
    path = write(folder, 'robot.urdf', URDF.format(
        inertia=ROD, file=file, scale=scale, material=material))
    return World.from_dict({'models': [{'name': 'r', 'file': str(path), **more}]})


def rod(world):
    return world.scene.spec.bodies[world.names.index('r/rod')]


def by_color(world):
    return {visual.color: visual for visual in rod(world).visuals}


def bounds(visual):
    points = np.array(visual.shape.vertices)
    return np.array([points.min(axis=0), points.max(axis=0)])


def test_each_colour_of_a_file_is_a_surface_at_its_place(tmp_path):
    found = by_color(robot(tmp_path, two_colors(tmp_path), '2 1 1'))
    assert found.keys() == {RED, BLUE}
    red, blue = found[RED], found[BLUE]
    np.testing.assert_allclose(bounds(red), [[-0.2, -0.1, -0.1], [0.2, 0.1, 0.1]], atol=1e-4)
    np.testing.assert_allclose(bounds(blue), [[-0.1, -0.05, 0.25], [0.1, 0.05, 0.35]], atol=1e-4)
    assert red.shape.pose.position == (0.0, 0.0, -0.5)
    assert len(red.shape.faces) == len(blue.shape.faces) == 12


def test_a_colour_in_the_description_covers_those_of_the_file(tmp_path):
    world = robot(tmp_path, two_colors(tmp_path),
                  material='<material name="m"><color rgba="0 1 0 1"/></material>')
    assert {visual.color for visual in rod(world).visuals} == {(0.0, 1.0, 0.0, 1.0)}


@pytest.mark.parametrize('scale', ['1 1 1', '-1 1 1', '-1 -1 -2'])
def test_a_mirrored_surface_is_not_turned_inside_out(tmp_path, scale):
    red = by_color(robot(tmp_path, two_colors(tmp_path), scale))[RED]
    mesh = trimesh.Trimesh(red.shape.vertices, red.shape.faces)
    assert mesh.volume == pytest.approx(0.2 ** 3 * abs(float(scale.split()[2])), rel=1e-3)


def test_what_is_only_drawn_has_no_part_in_the_motion(tmp_path):
    file = two_colors(tmp_path)
    seen, plain = robot(tmp_path, file), robot(tmp_path, file, visuals=False)
    assert rod(plain).visuals is None and rod(seen).visuals is not None
    assert seen.scene.text != plain.scene.text
    for one in (seen, plain):
        one.step(100)
    assert seen.state_hash() == plain.state_hash()
    np.testing.assert_array_equal(seen.mass, plain.mass)
    # A snapshot fits both: what is drawn does not tell scenes apart.
    plain.restore(seen.save())
    again = World(scene_from_text(seen.scene.text))
    again.restore(plain.save())
    assert again.scene.text == seen.scene.text and again.state_hash() == seen.state_hash()


def test_fine_meshes_are_made_coarse_and_stay_where_they_are(tmp_path):
    """
    A ball of 327680 triangles keeps its shape.

    n triangles over a ball of radius r have edges of about e = r sqrt(16 pi / (sqrt(3) n)); their
    middles are e^2 / 6 r inside: 1.6e-4 r for 30000. Cells of a lattice make some twice as large.
    """
    ball = trimesh.creation.icosphere(subdivisions=7, radius=0.2)
    ball.export(tmp_path / 'ball.stl')
    visual, = rod(robot(tmp_path, 'ball.stl')).visuals
    assert MOST_FACES / 2 < len(visual.shape.faces) <= MOST_FACES
    mesh = trimesh.Trimesh(visual.shape.vertices, visual.shape.faces)
    radius = np.linalg.norm(mesh.vertices, axis=1)
    assert np.abs(radius - 0.2).max() < 0.2 * 1e-3
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.2 ** 3, rel=2e-3)


def test_the_edges_of_a_coarse_surface_stay_sharp(tmp_path):
    """Corners lie where the planes about them meet, not in the middle of their cells."""
    box = trimesh.creation.box((0.4, 0.2, 0.1)).subdivide_loop(0)
    for _ in range(7):
        box = box.subdivide()
    assert len(box.faces) > 5 * MOST_FACES
    box.export(tmp_path / 'box.stl')
    visual, = rod(robot(tmp_path, 'box.stl')).visuals
    np.testing.assert_allclose(bounds(visual), [[-0.2, -0.1, -0.05], [0.2, 0.1, 0.05]], atol=1e-4)
    mesh = trimesh.Trimesh(visual.shape.vertices, visual.shape.faces)
    assert mesh.volume == pytest.approx(0.4 * 0.2 * 0.1, rel=2e-3)


@pytest.mark.parametrize('file', ['missing.dae', '../outside.stl', 'broken.stl', 'text.dae'])
def test_a_surface_that_cannot_be_had_is_a_line_and_no_error(tmp_path, file):
    folder = tmp_path / 'robot'
    folder.mkdir()
    trimesh.creation.box((1, 1, 1)).export(tmp_path / 'outside.stl')
    (folder / 'broken.stl').write_bytes(b'solid nothing')
    (folder / 'text.dae').write_text('<!DOCTYPE a [<!ENTITY b "c">]><COLLADA>&b;</COLLADA>')
    world = robot(folder, file)
    assert rod(world).visuals is None
    assert any('<visual> is ignored' in note for note in world.scene.notes)


def test_a_link_that_is_a_part_of_another_is_drawn_with_it(tmp_path):
    """The base shows a box; the tool, a frame on it without a mass, has a solid and no visual."""
    path = write(tmp_path, 'robot.urdf', f"""<robot name="r">
      <link name="base">{INERTIAL.format(I=1, J=1)}<visual><geometry><box size="1 1 1"/></geometry>
        </visual></link>
      <link name="tool"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
      <joint name="hold" type="fixed"><parent link="base"/><child link="tool"/>
        <origin xyz="0 0 2"/></joint></robot>""")
    world = World.from_dict({'models': [{'name': 'r', 'file': str(path)}]})
    box, ball = world.scene.spec.bodies[0].visuals
    assert (box.shape.type, ball.shape.type) == ('box', 'sphere')
    assert ball.shape.pose.position == (0.0, 0.0, 2.0)


def body(**more):
    ball = {'type': 'sphere', 'radius': 1}
    return {'bodies': [{'name': 'it', 'mass': 1.0, 'shape': ball, **more}]}


@pytest.mark.parametrize(('visual', 'text'), [
    ({'shape': {'type': 'plane'}}, r"visuals\[0\].shape.type: 'plane', must be another one"),
    ({'shape': {'type': 'sphere', 'radius': 1, 'mass': 2}}, r'visuals\[0\].shape.mass'),
    ({'shape': {'type': 'mesh', 'file': 'nowhere.obj'}}, r'visuals\[0\].shape.file'),
    ({'shape': {'type': 'mesh', 'vertices': '0 0 0, 1 0 0, 0 1 0', 'faces': '0 1 3'}},
     'the vertex 3, must be below 3'),
    ({'color': [1, 0, 0]}, r'visuals\[0\].shape: is missing'),
])
def test_a_visual_that_makes_no_sense_is_named_with_its_place(visual, text):
    with pytest.raises(ValueError, match=text):
        World.from_dict(body(visuals=[visual]))


def test_an_open_surface_may_be_seen_though_it_could_not_collide():
    triangle = {'type': 'mesh', 'vertices': '0 0 0, 1 0 0, 0 1 0', 'faces': '0 1 2',
                'scale': [2, 1, 1]}
    world = World.from_dict(body(visuals=[{'shape': triangle, 'color': [1, 0, 0]}]))
    visual, = world.scene.spec.bodies[0].visuals
    assert visual.shape.vertices[1] == (2.0, 0.0, 0.0) and visual.color == RED
    assert scene_from_text(world.scene.text).text == world.scene.text


def test_the_geometries_that_mujoco_shows_are_drawn_in_their_colours(tmp_path):
    """Groups 0 to 2 are shown; a body of solids of one colour alone is drawn with these."""
    pytest.importorskip('mujoco')
    trimesh.creation.box((0.2, 0.2, 0.2)).export(tmp_path / 'shell.stl')
    path = write(tmp_path, 'robot.xml', """<mujoco>
      <asset><mesh name="shell" file="shell.stl"/><material name="blue" rgba="0 0 1 1"/></asset>
      <worldbody>
        <body name="seen"><freejoint/><geom type="sphere" size=".3" group="3"/>
          <geom type="mesh" mesh="shell" material="blue" contype="0" conaffinity="0"/>
          <geom type="box" size=".1 .1 .1" rgba="1 0 0 1" contype="0" conaffinity="0"/>
          <geom type="box" size=".4 .4 .4" rgba="1 0 0 0" contype="0" conaffinity="0"/></body>
        <body name="plain" pos="2 0 0"><freejoint/><geom type="sphere" size=".1"/></body>
      </worldbody></mujoco>""")
    world = World.from_dict({'models': [{'name': 'r', 'file': str(path)}]})
    seen, plain = world.scene.spec.bodies
    shell, box = seen.visuals
    assert (shell.shape.type, shell.color, len(shell.shape.faces)) == ('mesh', BLUE, 12)
    assert (box.shape.type, box.color) == ('box', RED)
    assert seen.shape.type == 'sphere'
    assert plain.visuals is None


def test_visuals_of_sdf_have_their_poses_and_colours(tmp_path):
    path = write(tmp_path, 'robot.sdf', """<sdf version="1.7"><model name="m"><link name="a">
      <inertial><mass>1</mass></inertial>
      <collision name="c"><geometry><sphere><radius>1</radius></sphere></geometry></collision>
      <visual name="v"><pose>0 0 2 0 0 0</pose><geometry><box><size>1 1 1</size></box></geometry>
        <material><diffuse>1 0 0 1</diffuse></material></visual></link></model></sdf>""")
    world = World.from_dict({'models': [{'name': 'r', 'file': str(path)}]})
    visual, = world.scene.spec.bodies[0].visuals
    assert (visual.shape.type, visual.color) == ('box', RED)
    assert visual.shape.pose.position == (0.0, 0.0, 2.0)


def test_of_textures_that_are_not_read_nothing_is_logged(tmp_path, caplog):
    trimesh.creation.box((0.2, 0.2, 0.2)).export(tmp_path / 'x.dae')
    text = (tmp_path / 'x.dae').read_text()
    bumpy = text.replace('</effect>', """<extra><technique profile="FCOLLADA"><bump>
        <texture texture="t" texcoord="c"/></bump></technique></extra></effect>""", 1).replace(
        '<profile_COMMON>', """<profile_COMMON>
        <newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
        <newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>""", 1).replace(
        '<library_effects>', """<library_images><image id="i"><init_from>bumps.png</init_from>
        </image></library_images><library_effects>""", 1)
    assert bumpy.count('FCOLLADA') == bumpy.count('sampler2D') / 2 == bumpy.count('bumps.png') == 1
    (tmp_path / 'x.dae').write_text(bumpy)
    assert len(rod(robot(tmp_path, 'x.dae')).visuals) == 1
    assert not caplog.records
