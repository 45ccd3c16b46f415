# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MJCF files, read through MuJoCo, move as in MuJoCo."""

import os
import sys

from models.robots import world_of, write
import mujoco
import numpy as np
import pytest

from rigid_sim_ros import load_scene
from rigid_sim_ros.models.mjcf_compile import compiled
from rigid_sim_ros.scene import read_scene, SceneError

ARM = """<mujoco model="arm">
  <option timestep="0.0005" gravity="0 0 -9.8"/>
  <default><geom density="500" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="base" pos="0 0 1">
      <geom type="box" size=".1 .1 .1"/>
      <body name="upper" pos="0 0 -.1" euler="0 10 0">
        <joint name="shoulder" axis="0 1 0" range="-90 90" damping=".1" armature=".01"
               stiffness="1" springref="20"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".03"/>
        <site name="tip" pos="0 0 -.5"/>
        <body name="lower" pos="0 0 -.5"><joint name="elbow" axis="0 1 0" ref="10"/>
          <geom type="cylinder" size=".02 .2" pos="0 0 -.2"/></body>
      </body>
    </body>
    <body name="ball" pos="1 0 1"><freejoint/><geom type="sphere" size=".1" contype="1"/></body>
  </worldbody>
</mujoco>
"""


def test_an_arm_moves_as_in_mujoco(tmp_path) -> None:
    path = write(tmp_path, 'arm.xml', ARM)
    world = load_scene(path)
    assert list(world.names) == ['arm/base', 'arm/upper', 'arm/lower', 'arm/ball']
    assert world.scene.spec.world.step == 0.0005
    world.step(400)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = 1e-5
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=20000)
    # MuJoCo's Euler method is of first order: 0.2 s of 1e-5 s steps leave some 1e-5 rad.
    np.testing.assert_allclose(world.joint_position, data.qpos[:2] - model.qpos0[:2], atol=1e-5)
    np.testing.assert_allclose(world.position[3], data.qpos[2:5], atol=1e-4)


def test_masses_and_frames_are_those_of_mujoco(tmp_path) -> None:
    path = write(tmp_path, 'arm.xml', ARM)
    world = world_of(path, joints={'shoulder': 0.3, 'elbow': -0.4})
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[:2] = model.qpos0[:2] + np.array([0.3, -0.4])
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(world.position, data.xpos[1:], atol=1e-15)
    total = sum(body.inertial.mass for body in world.scene.spec.bodies)
    assert total == pytest.approx(model.body_mass.sum(), rel=1e-14)
    tip = dict(world.scene.spec.bodies[1].named_frames())['r/tip']
    assert tip.position == (0.0, 0.0, -0.5)


WALKER = """<mujoco model="walker">
  <option timestep="0.0005" gravity="0 0 -9.8"/>
  <worldbody>
    <body name="torso" pos="0 0 1.5" euler="0 20 0">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
      <joint name="y" axis="0 1 0" damping=".1"/>
      <geom type="capsule" fromto="0 0 0 .1 0 .5" size=".07"/>
      <body name="thigh" pos="0 -.1 -.05">
        <joint name="hip_x" axis="1 0 0" armature=".01" range="-30 30"/>
        <joint name="hip_z" axis="0 0 1" pos="0 0 .02" stiffness="2" frictionloss=".01"/>
        <joint name="hip_y" axis="0 1 0" pos="0 0 -.01"/>
        <geom type="capsule" fromto="0 0 0 .05 .02 -.4" size=".05"/>
        <body name="shin" pos=".05 .02 -.4"><joint name="knee" axis="0 -1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 -.4" size=".04"/></body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_a_body_with_several_joints_moves_as_in_mujoco(tmp_path) -> None:
    path = write(tmp_path, 'walker.xml', WALKER)
    world = load_scene(path)
    assert [joint.rpartition('/')[2] for joint in world.joint_names] == [
        'x', 'z', 'y', 'hip_x', 'hip_z', 'hip_y', 'knee']
    world.step(400)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = 1e-5
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=20000)
    # As above; and the shares of the mass in between are 1e-6 of it.
    np.testing.assert_allclose(world.joint_position, data.qpos, atol=2e-5)
    total = sum(body.inertial.mass for body in world.scene.spec.bodies)
    assert total == pytest.approx(model.body_mass.sum(), rel=1e-14)
    # Torso and thigh do not touch, as parent and child, whatever is in between.
    assert ('walker/torso', 'walker/thigh') in world.scene.spec.collision.ignore
    assert any('torso' in note and 'has 3 joints' in note for note in world.scene.notes)


def test_a_flag_lets_nothing_fall(tmp_path) -> None:
    text = ARM.replace('<default>', '<option><flag gravity="disable"/></option><default>')
    assert load_scene(write(tmp_path, 'arm.xml', text)).scene.spec.world.gravity == (0, 0, 0)


def test_equalities_are_joints_that_close_loops_or_follow(tmp_path) -> None:
    text = ARM.replace('</mujoco>', '<equality><joint joint1="elbow" joint2="shoulder" '
                       'polycoef="0.1 -2 0 0 0"/><connect body1="lower" body2="ball" '
                       'anchor="0 0 -.4"/></equality></mujoco>')
    joints = read_scene(write(tmp_path, 'arm.xml', text)).spec.joints
    assert joints[1].mimic.joint == 'arm/shoulder'
    assert (joints[1].mimic.multiplier, joints[1].mimic.offset) == (-2.0, 0.1)
    assert joints[2].type == 'spherical'
    assert (joints[2].parent, joints[2].child) == ('arm/lower', 'arm/ball')
    assert joints[2].pose.position == pytest.approx((0, 0, -0.4), abs=1e-15)


def test_an_equality_of_one_joint_holds_it(tmp_path) -> None:
    text = ARM.replace('</mujoco>', '<equality><joint joint1="elbow" polycoef="0.2 0 0 0 0"/>'
                       '</equality></mujoco>')
    elbow = read_scene(write(tmp_path, 'arm.xml', text)).spec.joints[1]
    assert (elbow.type, elbow.limits.lower, elbow.limits.upper) == ('revolute', 0.2, 0.2)


@pytest.mark.parametrize(('old', 'new', 'words'), [
    ('contype="1"', 'contype="1" adhesion="1"', 'adhesion is ignored'),
    ('contype="1"', 'contype="1" surfacevel="1 0 0"', 'surfacevel is ignored: a kinematic body'),
    ('<default>', '<option><flag contact="disable"/></option><default>', 'the flag contact is'),
    ('</mujoco>', '<contact><pair geom1="g" geom2="h"/></contact></mujoco>', '<pair> is ignored')])
def test_what_touches_otherwise_in_mujoco_is_told(tmp_path, old, new, words) -> None:
    text = ARM.replace('type="box"', 'name="g" type="box"').replace(
        'type="sphere"', 'name="h" type="sphere"').replace(old, new)
    notes = read_scene(write(tmp_path, 'arm.xml', text)).notes
    assert any(words in note for note in notes)


def test_sites_are_held_together_as_bodies_are(tmp_path) -> None:
    text = ARM.replace('<freejoint/>', '<freejoint/><site name="eye" pos=".2 0 0"/>').replace(
        '<body name="ball" pos="1 0 1">', '<body name="ball" pos="-.2 0 .4">').replace(
        ' euler="0 10 0"', '').replace(
        '</mujoco>', '<equality>\n<connect site1="tip" site2="eye"/></equality></mujoco>')
    joint = read_scene(write(tmp_path, 'arm.xml', text)).spec.joints[2]
    assert (joint.type, joint.parent, joint.child) == ('spherical', 'arm/upper', 'arm/ball')
    assert joint.pose.position == pytest.approx((0, 0, -0.5), abs=1e-15)
    apart = write(tmp_path, 'apart.xml', text.replace('pos=".2 0 0"', 'pos=".3 0 0"'))
    with pytest.raises(SceneError) as error:
        read_scene(apart)
    assert 'elsewhere than they are written' in str(error.value)
    assert error.value.problems[0].line == text[:text.index('<connect')].count('\n') + 1


def test_a_site_may_have_the_name_of_a_body(tmp_path) -> None:
    path = write(tmp_path, 'arm.xml', ARM.replace('name="tip"', 'name="base"'))
    world = load_scene(path)
    assert 'arm/base_site' in world.frame_names
    assert any('is base_site here' in note for note in map(str, world.scene.notes))


def test_a_file_without_bodies_is_refused_by_its_name(tmp_path) -> None:
    path = write(tmp_path, 'sky.xml', '<mujoco model="sky"><worldbody/></mujoco>')
    with pytest.raises(SceneError) as error:
        read_scene(path)
    assert str(error.value).startswith(f'{path}:1: mujoco: has no bodies')


@pytest.mark.parametrize(('old', 'new', 'words'), [
    ('<worldbody>', '<wordbody>', 'not XML'),
    ('timestep="0.0005"', 'timestep="soon"', 'MuJoCo says: '),
    ('size=".02 .2"', 'size="nan"', "size 'nan', must be finite"),
    ('<freejoint/>', '<joint type="ball" range="0 30"/>', 'ball joint'),
    ('<worldbody>', '<option><flag spring="disable"/></option><worldbody>', 'disables spring'),
    ('</mujoco>', '<equality><weld body1="lower" body2="ball" relpose="0 0 -1 1 0 0 0"/>'
     '</equality></mujoco>', 'elsewhere than they are written'),
    ('</mujoco>', '<tendon><fixed frictionloss="1"><joint joint="elbow" coef="1"/></fixed>'
     '</tendon></mujoco>', 'tendons with forces'),
    ('stiffness="1"', 'stiffness="1 2 3"', "'shoulder': its stiffness has further terms"),
    ('damping=".1"', 'damping=".1 2 3"', "'shoulder': its damping has further terms"),
    ('stiffness="1"', 'stiffness="1" springyield="2"', "'shoulder': its spring yields"),
    ('<freejoint/>', '<joint type="ball" damping="1 2 3"/>', 'its damping has further terms'),
    ('</mujoco>', '<equality><joint joint1="elbow" joint2="shoulder" polycoef="0 1 2 0 0"/>'
     '</equality></mujoco>', 'its polycoef has terms beyond the first two'),
    ('<worldbody>', '<include file="../secret.xml"/><worldbody>', 'may lie outside'),
    ('<worldbody>', '<asset><mesh file="/etc/passwd"/></asset><worldbody>', 'may lie outside'),
    ('<worldbody>', '<extension><plugin plugin="x"/></extension><worldbody>', 'another library'),
    ('<body name="ball"', '<body gravcomp="1" name="ball"', 'has gravcomp')])
def test_a_mistake_is_named(tmp_path, old, new, words) -> None:
    path = write(tmp_path, 'arm.xml', ARM.replace(old, new))
    with pytest.raises(SceneError) as error:
        read_scene(path)
    assert words in str(error.value)
    assert error.value.problems[0].file == str(path)


@pytest.mark.parametrize(('old', 'new', 'words'), [
    ('<body name="lower"', '<body mas="1" name="lower"', "unrecognized attribute: 'mas'"),
    ('</worldbody>', '<body name="point"><joint/></body></worldbody>', 'larger than mjMINVAL'),
    ('<worldbody>', '<asset><mesh name="m" file="no.stl"/></asset><worldbody>', "no.stl'"),
    ('<worldbody>', '<worldbody><body name="x"><geom size=".1"/><joint range="2 -2"/></body>',
     'range 2 -2, its first number must be the smaller one: swap them')])
def test_what_mujoco_refuses_or_ignores_has_its_line(tmp_path, old, new, words) -> None:
    text = ARM.replace(old, f'\n\n{new}', 1)
    path = write(tmp_path, 'arm.xml', text.replace('<compiler ', '<compiler angle="radian" '))
    with pytest.raises(SceneError) as error:
        read_scene(path)
    problem = error.value.problems[0]
    assert words in problem.message
    assert (problem.file, problem.line) == (str(path), text[:text.index(new)].count('\n') + 1)


def test_a_line_of_an_included_file_is_none_of_the_first(tmp_path) -> None:
    write(tmp_path, 'part.xml', '<mujocoinclude>\n\n<body mas="1"/></mujocoinclude>')
    text = ARM.replace('<worldbody>', '<worldbody><include file="part.xml"/>')
    with pytest.raises(SceneError, match=r"MuJoCo says: .*'mas'") as error:
        read_scene(write(tmp_path, 'arm.xml', text))
    assert error.value.problems[0].line == 0


@pytest.mark.parametrize('word', ['friction=".5"', 'condim="4"'])
def test_materials_of_contact_are_told_once(tmp_path, word) -> None:
    path = write(tmp_path, 'arm.xml', ARM.replace('<geom ', f'<geom {word} '))
    notes = [str(note) for note in read_scene(path).notes if 'ignored: materials' in str(note)]
    assert len(notes) == 1
    assert f"{word.split('=')[0]} is ignored: materials are those of the scene" in notes[0]
    plain = read_scene(write(tmp_path, 'b.xml', ARM)).notes
    assert 'ignored: materials' not in ' '.join(map(str, plain))


def attaching(asset: str, beside: str = '') -> str:
    return (f'<mujoco model="m"><asset>{asset}</asset><worldbody><body name="a"><geom size=".1"/>'
            f'</body>{beside}</worldbody></mujoco>')


def pipe(folder) -> str:
    os.mkfifo(folder / 'x.stl')
    return attaching('<mesh name="x" file="x.stl"/>')


def link_in_a_folder(folder) -> str:
    (folder / 'sub').mkdir()
    (folder / 'sub/x.stl').symlink_to('/etc/passwd')
    return attaching('<mesh name="x" file="x.stl"/>').replace(
        '<asset>', '<compiler meshdir="sub"/><asset>')


def file_of_an_attached_model(folder) -> str:
    write(folder, 's.xml', attaching('<mesh name="y" file="/etc/passwd"/>'))
    return attaching('<model name="s" file="s.xml"/>')


def attaches_itself(folder) -> str:
    return attaching('<model name="s" file="m.xml"/>',
                     '<frame><attach model="s" body="a" prefix="p"/></frame>')


def ring(folder) -> str:
    write(folder, 'n.xml', attaches_itself(folder))
    return attaches_itself(folder).replace('m.xml', 'n.xml')


def memory(folder) -> str:
    return attaching('<hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/>')


def picture(folder) -> str:
    return attaching('<texture name="t" type="2d" builtin="flat" width="12000" height="12000"/>')


HOSTILE = {pipe: 'not a regular file', link_in_a_folder: 'lies outside',
           file_of_an_attached_model: 'may lie outside', attaches_itself: 'was ended by SIGSEGV',
           ring: 'was ended by SIGSEGV', memory: 'MuJoCo says', picture: 'the compiled model has'}


@pytest.mark.parametrize('make', HOSTILE)
def test_what_would_end_or_fill_the_process_is_refused(tmp_path, make) -> None:
    path = write(tmp_path, 'm.xml', '')
    path.write_text(make(tmp_path), encoding='utf-8')
    with pytest.raises(SceneError) as error:
        read_scene(path)
    assert HOSTILE[make] in str(error.value)
    assert len(error.value.problems) == 1


def test_a_model_of_ten_million_bodies_takes_no_longer_than_it_may(tmp_path) -> None:
    beside = '<replicate count="10000000" offset="1 0 0"><body><geom size="1"/></body></replicate>'
    path = write(tmp_path, 'm.xml', attaching('', beside))
    with pytest.raises(ValueError, match=r'was ended by SIG.*more than 1 s'):
        compiled(path, seconds=1)


def test_without_mujoco_an_error_says_what_to_install(tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    with pytest.raises(SceneError, match=r"needs MuJoCo, .*pip install '\.\[mjcf\]'"):
        read_scene(write(tmp_path, 'arm.xml', ARM))
