# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Grounds and buildings in files of models: heights, and meshes that are unlike their hulls."""

from pathlib import Path

from models.robots import write
import numpy as np
from PIL import Image
import pytest

from rigid_sim_ros import load_scene
from rigid_sim_ros.scene import read_scene, SceneError

# A bowl of 2 x 2 x 1 m without a lid, and a flat square: from inside, from above.
BOWL = """v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1
f 1 2 3 4\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n"""
SQUARE = 'v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n'
CUBE = """v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"""


def sdf_world(folder: Path, geometry: str, static: str = 'true', inertial: str = '') -> Path:
    """Write a world of a ground and a ball, and return its path."""
    solid = f'<geometry>{geometry}</geometry>'
    return write(folder, 'world.sdf', f"""<sdf version="1.9"><world name="w">
  <model name="ground"><static>{static}</static><link name="l">{inertial}
    <collision name="c">{solid}</collision><visual name="v">{solid}</visual></link></model>
  <model name="ball"><pose>0.5 0 0.6 0 0 0</pose><link name="l">
    <inertial><mass>1</mass><inertia><ixx>0.004</ixx><iyy>0.004</iyy><izz>0.004</izz></inertia>
    </inertial>
    <collision name="c"><geometry><sphere><radius>0.1</radius></sphere></geometry></collision>
  </link></model></world></sdf>""")


@pytest.mark.parametrize(('file', 'text'), [('bowl.obj', BOWL), ('square.obj', SQUARE)])
def test_what_is_static_and_not_like_its_hull_collides_as_it_is(tmp_path, file, text):
    write(tmp_path, file, text)
    path = sdf_world(tmp_path, f'<mesh><uri>{file}</uri></mesh>')
    assert not any('convex hull' in note for note in read_scene(path).notes)
    world = load_scene(path)
    world.step(1500)
    # On the bottom, 0.1 m below its middle; a hull of the bowl would have thrown it up to 1.1 m.
    assert world.position[1] == pytest.approx([0.5, 0.0, 0.1], abs=1e-5)


def test_what_is_like_its_hull_stays_one_shape(tmp_path):
    write(tmp_path, 'cube.obj', CUBE)
    part = read_scene(sdf_world(tmp_path, '<mesh><uri>cube.obj</uri></mesh>')).spec.bodies[0].shape
    assert part.convex


def test_what_moves_collides_as_its_hull_and_says_so(tmp_path):
    write(tmp_path, 'bowl.obj', BOWL)
    inertia = ('<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia>'
               '</inertial>')
    scene = read_scene(sdf_world(tmp_path, '<mesh><uri>bowl.obj</uri></mesh>', 'false', inertia))
    assert scene.spec.bodies[0].shape.convex
    assert any('convex hulls: bowl.obj' in note for note in scene.notes)


def test_a_heightmap_of_sdf_is_a_heightfield_with_its_place_and_lengths(tmp_path):
    shares = np.linspace(0, 255, 9).reshape(3, 3).astype(np.uint8)
    Image.fromarray(shares).save(tmp_path / 'hills.png')
    path = sdf_world(tmp_path, '<heightmap><uri>hills.png</uri><size>4 2 0.5</size>'
                     '<pos>1 0 -0.25</pos></heightmap>')
    body = read_scene(path).spec.bodies[0]
    for part in (body.shape, body.visuals[0].shape) if body.visuals else (body.shape,):
        assert part.size == (4.0, 2.0)
        assert part.pose.position == (1.0, 0.0, -0.25)
        assert np.array(part.heights) == pytest.approx(np.flipud(shares) / 255 * 0.5, abs=1e-12)
    world = load_scene(path)
    world.step(200)
    # It has begun to roll down where the ground is 0.25 m higher than its least.
    assert world.position[1, 2] > -0.1


def test_a_heightmap_that_moves_or_is_missing_is_named(tmp_path):
    Image.fromarray(np.zeros((3, 3), dtype=np.uint8)).save(tmp_path / 'hills.png')
    inertia = ('<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia>'
               '</inertial>')
    field = '<heightmap><uri>hills.png</uri></heightmap>'
    with pytest.raises(SceneError, match='is a heightfield on a link that moves'):
        read_scene(sdf_world(tmp_path, field, 'false', inertia))
    (tmp_path / 'hills.png').write_text('no picture')
    with pytest.raises(SceneError, match=r'world\.sdf:3.*cannot be read'):
        read_scene(sdf_world(tmp_path, field))


def test_an_hfield_of_mjcf_is_the_ground_that_mujoco_has(tmp_path):
    mujoco = pytest.importorskip('mujoco')
    text = """<mujoco><option timestep="0.002"/><asset>
      <hfield name="h" nrow="3" ncol="4" size="2 1 0.5 0.1" elevation="0 0 0 0 0 1 1 0 0 0 0 0"/>
    </asset><worldbody><geom type="hfield" hfield="h" pos="0 0 -0.1"/>
      <body name="ball" pos="0 0 1"><freejoint/><geom type="sphere" size="0.2" mass="1"/></body>
    </worldbody></mujoco>"""
    path = write(tmp_path, 'hills.xml', text)
    spec = read_scene(path).spec
    field = next(part for body in spec.bodies for _, part in body.parts()
                 if part.type == 'heightfield')
    assert field.size == (4.0, 2.0)
    model = mujoco.MjModel.from_xml_string(text)
    shares = model.hfield_data.reshape(3, 4)
    assert np.array(field.heights) == pytest.approx(0.5 * shares, abs=1e-7)     # of 32 bits
    assert field.pose.position == pytest.approx((0.0, 0.0, -0.1))
