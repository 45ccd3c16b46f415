# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""URDF files become bodies and joints that move as the file says."""

import math

from models.robots import INERTIAL, URDF, world_of, write
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_sim_ros import load_scene
from rigid_sim_ros.models.inertia import mended
from rigid_sim_ros.scene import read_scene, SceneError

HALF = math.sqrt(0.5)


@pytest.mark.parametrize('moments, expected', [
    # Half of what the two smaller ones lack goes to each.
    ((1.0, 2.0, 9.0), (4.0, 5.0, 9.0)), ((9.0, 1.0, 1.0), (9.0, 4.5, 4.5)),
    # The radius of gyration of 2 kg is 1 mm at least.
    ((0.0, 0.0, 0.0), (2e-6, 2e-6, 2e-6)), ((-3.0, 1.0, 1.0), (2e-6, 1.0, 1.0))])
def test_moments_that_no_body_has_are_mended_as_little_as_needed(moments, expected) -> None:
    mended_, how = mended(2.0, (*moments, 0.0, 0.0, 0.0), is_allowed=True)
    # And by a little more than that, 1e-12 of the largest.
    assert mended_ == pytest.approx((*expected, 0.0, 0.0, 0.0), abs=1e-10)
    assert 'are taken as' in how


def test_a_rod_on_a_hinge_swings_as_a_physical_pendulum(tmp_path) -> None:
    world = world_of(write(tmp_path, 'pendulum.urdf', URDF), joints={'hinge': 0.01})
    # I'' a = -m g l a with I = 1/12 + 1/4 about the hinge; after a period it is where it was. The
    # amplitude lengthens the period by a^2 / 16 = 6e-6 of it, which turns the angle by second
    # order only; the step is off by (w h)^2 / 24 = 6e-7.
    period = 2 * math.pi * math.sqrt((1 / 3) / (9.81 * 0.5))
    world.step(round(period / 1e-3))
    assert world.joint_position == pytest.approx([0.01], abs=1e-7)
    world.step(round(period / 4 / 1e-3))
    # The rounding of a quarter of the period to a step leaves w h / 2 of the amplitude.
    assert world.joint_position == pytest.approx([0.0], abs=0.01 * 4e-3)


def test_links_joints_and_frames_have_the_names_of_the_model_before_theirs(tmp_path) -> None:
    world = world_of(write(tmp_path, 'pendulum.urdf', URDF))
    assert list(world.names) == ['r/base', 'r/rod']
    assert world.joint_names == ['r/hinge']
    assert list(world.frame_names) == ['r/base', 'r/rod', 'r/tool']


def test_the_child_turns_about_the_axis_with_urdf_signs(tmp_path) -> None:
    world = world_of(write(tmp_path, 'pendulum.urdf', URDF), joints={'hinge': math.pi / 2})
    # A positive turn about y takes the rod, along -z, to -x.
    np.testing.assert_allclose(world.position[1], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(world.orientation[1], [0, HALF, 0, HALF], atol=1e-15)


def test_a_wrench_acts_at_a_frame_without_a_mass(tmp_path) -> None:
    world = world_of(write(tmp_path, 'pendulum.urdf', URDF))
    # 1 N along z of the tool, which is x of the rod, at 1 m from the hinge: -1 N m about y.
    world.apply_wrench('r/rod', force=(0, 0, 1), frame='r/tool')
    world.step()
    # L = I w = M h in one step.
    assert world.joint_velocity[0] == pytest.approx(-1e-3 * 3.0, rel=1e-4)


def test_a_base_may_be_free(tmp_path) -> None:
    text = URDF.replace('<link name="base"/>', f'<link name="base">{INERTIAL}</link>'.format(
        I=1.0, J=1.0))
    world = world_of(write(tmp_path, 'pendulum.urdf', text), fixed_base=False)
    world.step(100)
    # Both fall together: the centre of mass by g t^2 / 2, nothing turns.
    assert world.position[:, 2] == pytest.approx([-0.5 * 9.81 * 0.01, 1 - 0.5 * 9.81 * 0.01],
                                                 abs=1e-9)


def test_what_a_floating_joint_holds_to_a_massless_world_falls(tmp_path) -> None:
    """As exporters write a free robot: the world is a link of its own."""
    world = world_of(write(tmp_path, 'pendulum.urdf', URDF.replace('"revolute"', '"floating"')))
    world.step(100)
    assert world.position[1, 2] == pytest.approx(1 - 0.5 * 9.81 * 0.01, abs=1e-9)
    assert 'a free joint has none here' in world.scene.notes[0]


def test_a_planar_joint_has_the_damping_of_its_file(tmp_path) -> None:
    text = URDF.replace('"revolute"', '"planar"').replace(
        '<axis', '<dynamics damping="2"/><axis')
    scene = read_scene(write(tmp_path, 'pendulum.urdf', text))
    assert (scene.spec.joints[0].type, scene.spec.joints[0].damping) == ('planar', 2.0)
    assert '<limit> is ignored: a planar joint has none here' in scene.notes[0]
    with pytest.raises(SceneError, match='has dry friction, which a planar joint has not'):
        read_scene(write(tmp_path, 'pendulum.urdf', text.replace('damping="2"', 'friction="2"')))


def test_bounds_of_a_continuous_joint_are_told(tmp_path) -> None:
    text = URDF.replace('"revolute"', '"continuous"')
    note, = read_scene(write(tmp_path, 'pendulum.urdf', text)).notes
    assert 'lower and upper is ignored: a continuous joint has no bounds' in note


def test_a_mass_of_nothing_is_no_mass(tmp_path) -> None:
    nothing = '<mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'
    text = URDF.replace('<link name="tool"/>',
                        f'<link name="tool"><inertial>{nothing}</inertial></link>')
    assert text != URDF
    assert len(read_scene(write(tmp_path, 'pendulum.urdf', text)).spec.bodies) == 2
    text = text.replace('type="fixed"', 'type="continuous"')
    with pytest.raises(SceneError, match="no mass and hangs on the continuous joint 'hold'"):
        read_scene(write(tmp_path, 'pendulum.urdf', text))


def test_a_massless_base_belongs_to_what_a_fixed_joint_hangs_on_it(tmp_path) -> None:
    text = URDF.replace('type="revolute"', 'type="fixed"')
    world = world_of(write(tmp_path, 'pendulum.urdf', text), fixed_base=False,
                     pose={'position': [0, 0, 5]})
    assert list(world.names) == ['r/rod']
    assert set(world.frame_names) == {'r/rod', 'r/base', 'r/tool'}
    frame = dict(world.scene.spec.bodies[0].named_frames())['r/base']
    assert frame.position == (0.0, 0.0, -1.0)
    np.testing.assert_allclose(world.position, [[0, 0, 6]])


def test_a_model_alone_is_a_scene(tmp_path) -> None:
    world = load_scene(write(tmp_path, 'pendulum.urdf', URDF))
    assert list(world.names) == ['pendulum/base', 'pendulum/rod']
    assert world.scene.contact == 'none'


MIMIC = URDF.replace('</robot>', f"""
  <link name="other">{INERTIAL.format(I=1 / 12, J=2e-4)}</link>
  <joint name="second" type="revolute"><parent link="base"/><child link="other"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="1" effort="1" velocity="1"/>
    <mimic joint="hinge" multiplier="-2" offset="0.1"/></joint></robot>""")


def test_a_joint_that_mimics_follows_and_bounds_the_other(tmp_path) -> None:
    world = world_of(write(tmp_path, 'mimic.urdf', MIMIC), joints={'hinge': 0.3})
    assert world.joint_position == pytest.approx([0.3, -0.5], abs=1e-14)
    world.step(200)
    assert world.joint_position[1] == pytest.approx(0.1 - 2 * world.joint_position[0], abs=1e-12)
    # -2 <= 0.1 - 2 q <= 1
    hinge = world.scene.spec.joints[0]
    assert (hinge.limits.lower, hinge.limits.upper) == (-0.45, 1.05)


def test_position_0_beyond_the_limits_is_replaced_by_the_nearer_bound(tmp_path) -> None:
    path = write(tmp_path, 'pendulum.urdf', URDF.replace('lower="-3"', 'lower="0.5"'))
    scene = read_scene(path)
    assert scene.spec.joints[0].position == 0.5
    assert any('starts at the nearer one' in note for note in scene.notes)


def test_bounds_of_joints_are_left_out_where_the_scene_says_so(tmp_path) -> None:
    path = write(tmp_path, 'pendulum.urdf', URDF.replace('lower="-3"', 'lower="0.5"'))
    limits = world_of(path, unlimited=['hin*']).scene.spec.joints[0].limits
    assert (limits.lower, limits.upper, limits.effort) == (None, None, 10.0)
    with pytest.raises(SceneError, match=r"unlimited\[0\]: 'knee' is no joint of the model"):
        world_of(path, unlimited=['knee'])


def test_what_has_no_effect_is_told_in_one_line_for_each_kind(tmp_path) -> None:
    text = URDF.replace('</robot>', '<gazebo/>\n<gazebo reference="rod"/>\n'
                        '<transmission name="t"/></robot>')
    path = write(tmp_path, 'pendulum.urdf', text)
    assert list(read_scene(path).notes) == [
        f'{path}:12: <gazebo> is ignored: it is for Gazebo (here and at 1 more place)',
        f'{path}:14: <transmission> is ignored: drives are written in the scene']


def test_a_follower_has_a_drive_where_it_is_named_itself(tmp_path) -> None:
    path = write(tmp_path, 'mimic.urdf', MIMIC)
    drive = {'mode': 'velocity', 'gain': 3}
    drives = [joint.drive for joint in world_of(path, drives={'*': drive}).scene.spec.joints]
    assert [one and one.gain for one in drives] == [3, None]
    drives = [joint.drive for joint in world_of(path, drives={'second': drive}).scene.spec.joints]
    assert [one.mode for one in drives] == ['effort', 'velocity']


def test_who_tells_a_follower_learns_whom_to_tell(tmp_path) -> None:
    world = world_of(write(tmp_path, 'mimic.urdf', MIMIC))
    with pytest.raises(ValueError, match="has no drive: it follows 'r/hinge', which is"):
        world.set_joint_command('r/second', effort=1.0)


@pytest.mark.parametrize(('old', 'new', 'words'), [
    ('lower="-3" upper="3"', '', 'has no lower and no upper, which are 0 then'),
    ('lower="-3" upper="3"', 'lower="-180" upper="180"', 'lower -180 and upper 180 are radians'),
    ('rpy="0 1.5707963267948966 0"', 'rpy="0 90 0"', "rpy '0 90 0' is more than a turn"),
    ('effort="10"', 'effort="0"', 'with the effort limit 0 is ignored')])
def test_what_is_hardly_meant_is_told(tmp_path, old, new, words) -> None:
    assert not read_scene(write(tmp_path, 'pendulum.urdf', URDF)).notes
    notes = read_scene(write(tmp_path, 'pendulum.urdf', URDF.replace(old, new))).notes
    assert len(notes) == 1 and words in notes[0]


@pytest.mark.parametrize(('old', 'new', 'line', 'words'), [
    ('type="revolute"', 'type="hinge"', 7, "type 'hinge', must be revolute, "),
    ('lower="-3" upper="3"', 'lower="3" upper="-3"', 9, 'lower 3 is above upper -3'),
    ('<mass value="1"/>', '<mass value="-1"/>', 3, "value '-1', must be >= 0"),
    ('<mass value="1"/>', '<mass value="heavy"/>', 3, "value 'heavy', must be a number"),
    ('</inertial>', '</inertial><inertial/>', 3, 'is there twice, must be there once'),
    ('<mass value="1"/>', '<mas value="1"/>', 3, "not known in <inertial>, did you mean 'mass'"),
    ('effort="10"', 'efort="10"', 9, "'efort' is not known, did you mean 'effort'?"),
    ('radius="0.02"', 'radius="0"', 4, "radius '0', must be > 0"),
    ('<cylinder radius="0.02" length="1"/>', '<mesh filename="no.stl"/>', 4,
     "file 'no.stl' is not there, must be at"),
    ('<cylinder radius="0.02" length="1"/>', '<prism size="1"/>', 4, 'is no solid, must be box'),
    ('<parent link="base"/>', '<parent link="bass"/>', 7,
     "'bass' is no link, did you mean 'base'?"),
    ('<parent link="rod"/>', '<parent link="tool"/>', 6, 'hangs on itself by a ring of joints'),
    ('name="hold"', 'name="hinge"', 10, 'is there twice, must have a name of its own'),
    ('xyz="0 1 0"', 'xyz="0 0 0"', 8, 'has no direction, must have one'),
    ('<origin xyz="0 0 1"/>', '<origin quat_xyzw="0 0 0 2"/>', 8, 'has length 2, must be 1'),
    ('xyz="0 1 0"', 'xyz="0 1"', 8, 'must be 3 numbers with spaces'),
    ('xyz="0 1 0"', 'xyz="0 nan 0"', 8, "xyz 'nan', must be finite"),
    (f'ixx="{1 / 12}"', 'ixx="9"', 3, 'inertia violates the triangle inequality'),
    ('type="fixed"', 'type="continuous"', 6, "no mass and hangs on the continuous joint 'hold'"),
    ('<link name="base"/>', '<xacro:x/><link name="base"/>', 2, 'must go through xacro'),
    ('<robot name="pendulum">', '<!DOCTYPE x [<!ENTITY e "e">]><robot>', 1, 'must have none'),
    ('</robot>', '', 13, 'not XML: no element found')])
def test_a_mistake_is_named_with_its_line_and_mend(tmp_path, old, new, line, words) -> None:
    assert old in URDF
    path = write(tmp_path, 'pendulum.urdf', URDF.replace(old, new, 1))
    with pytest.raises(SceneError) as error:
        read_scene(path)
    first = error.value.problems[0]
    assert (first.file, first.line) == (str(path), line)
    assert words in first.message


def test_a_mass_of_0_is_not_said_to_be_mended(tmp_path) -> None:
    text = URDF.replace('<mass value="1"/>', '<mass value="0"/>')
    with pytest.raises(SceneError, match=r'mass 0 kg, must be > 0: mend the numbers$'):
        read_scene(write(tmp_path, 'pendulum.urdf', text))


def test_a_ring_without_a_base_is_told(tmp_path) -> None:
    text = URDF.replace('  <link name="base"/>\n', '').replace('link="base"', 'link="tool"')
    with pytest.raises(SceneError, match='its joints form a ring: each link is the child of one'):
        read_scene(write(tmp_path, 'pendulum.urdf', text))


def test_all_mistakes_are_told_at_once(tmp_path) -> None:
    path = write(tmp_path, 'pendulum.urdf', URDF.replace('value="1"', 'value="x"').replace(
        'upper="3"', 'upper="y"'))
    with pytest.raises(SceneError) as error:
        read_scene(path)
    assert len(error.value.problems) == 2


CAMERA = URDF.replace(
    '<link name="tool"/>', '<link name="tool"><inertial><mass value="0.5"/>'
    '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>')


def test_a_point_with_a_mass_is_a_part_of_the_body_that_it_is_fixed_to(tmp_path) -> None:
    scene = read_scene(write(tmp_path, 'pendulum.urdf', CAMERA))
    rod = scene.spec.bodies[1].inertial
    # 1 kg at -0.5 m and 0.5 kg at -1 m: together at -2/3 m, Steiner's terms 1/36 + 1/18.
    assert rod.mass == 1.5
    assert rod.com == pytest.approx((0, 0, -2 / 3), abs=1e-15)
    assert rod.inertia[0] == pytest.approx(1 / 12 + 1 / 36 + 1 / 18, rel=1e-14)
    assert "taken as a part of 'rod'" in scene.notes[0]


def test_moments_are_those_of_axes_that_are_turned_in_the_link(tmp_path) -> None:
    text = URDF.replace('-0.5"/><mass', '-0.5" rpy="0.2 0.5 -0.3"/><mass').replace(
        f'ixx="{1 / 12}" ixy="0"', 'ixx="0.1" ixy="0.01"').replace('izz="0.0002"', 'izz="0.03"')
    inertia = read_scene(write(tmp_path, 'pendulum.urdf', text)).spec.bodies[1].inertial.inertia
    R = Rotation.from_euler('xyz', [0.2, 0.5, -0.3]).as_matrix()
    expected = R @ np.array([[0.1, 0.01, 0], [0.01, 1 / 12, 0], [0, 0, 0.03]]) @ R.T
    xx, yy, zz, xy, xz, yz = inertia
    np.testing.assert_allclose([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], expected, atol=1e-16)


def test_a_pose_turns_the_whole_model(tmp_path) -> None:
    world = world_of(write(tmp_path, 'pendulum.urdf', URDF),
                     pose={'position': [1, 0, 0], 'orientation': [HALF, 0, 0, HALF]})
    # A quarter of a turn about x takes the hinge, 1 m up, to -y, and its axis y to z.
    np.testing.assert_allclose(world.position[1], [1, -1, 0], atol=1e-15)
    world.set_joint_state('r/hinge', 0.0, 1.0)
    np.testing.assert_allclose(world.angular_velocity[1], [0, 0, 1], atol=1e-15)


def test_impossible_moments_are_mended_where_the_scene_says_so(tmp_path) -> None:
    path = write(tmp_path, 'pendulum.urdf', URDF.replace(f'ixx="{1 / 12}"', 'ixx="1"'))
    inertia = world_of(path, mend_inertia=True).scene.spec.bodies[1].inertial.inertia
    # 1/12 and 2e-4 grow by the same amount until they add up to 1.
    lacking = 1 - 1 / 12 - 2e-4
    assert inertia[:3] == pytest.approx((1, 1 / 12 + lacking / 2, 2e-4 + lacking / 2), rel=1e-11)


def test_links_that_fixed_joints_hold_are_one_part_that_does_not_touch_itself(tmp_path) -> None:
    solid = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    text = URDF.replace('<link name="base"/>', f'<link name="base">{solid}</link>').replace(
        '<link name="tool"/>', f'<link name="tool">{INERTIAL.format(I=1, J=1)}{solid}</link>')
    scene = read_scene(write(tmp_path, 'pendulum.urdf', text))
    # base and rod are parent and child of the hinge, and the tool is a part of the rod.
    assert scene.spec.collision.ignore == (
        ('pendulum/base', 'pendulum/rod'), ('pendulum/base', 'pendulum/tool'),
        ('pendulum/rod', 'pendulum/tool'))


def test_an_srdf_file_beside_the_model_names_pairs_that_do_not_touch(tmp_path) -> None:
    solid = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    body = f'{INERTIAL.format(I=1, J=1)}{solid}'
    joint = ('<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{0}"/>'
             '<origin xyz="1 0 0"/></joint>')
    links = ''.join(f'<link name="{name}">{body}</link>' for name in 'abc')
    path = write(tmp_path, 'chain.urdf', f'<robot name="c">{links}{joint.format("b", "a")}'
                 f'{joint.format("c", "b")}</robot>')
    assert len(read_scene(path).spec.collision.ignore) == 2
    srdf = write(tmp_path, 'chain.srdf',
                 '<robot><disable_collisions link1="a" link2="c"/></robot>')
    assert ('chain/a', 'chain/c') in read_scene(path).spec.collision.ignore
    srdf.write_text('<robot><disable_collisions link1="a" link2="d"/></robot>')
    with pytest.raises(SceneError, match=r"chain.srdf:1: .*'d' is no link"):
        read_scene(path)


def test_names_that_ros_does_not_allow_are_changed_and_told(tmp_path) -> None:
    scene = read_scene(write(tmp_path, 'pendulum.urdf', URDF.replace('"rod"', '"1-rod"')))
    assert scene.names == ('pendulum/base', 'pendulum/_1_rod')
    assert "'1-rod' is _1_rod" in scene.notes[0]


@pytest.mark.parametrize('name', ['the-hinge', 'the_hinge', 'the*'])
def test_a_scene_names_joints_as_the_file_or_as_ros_does(tmp_path, name) -> None:
    path = write(tmp_path, 'pendulum.urdf', URDF.replace('"hinge"', '"the-hinge"'))
    world = world_of(path, joints={name: 0.5}, drives={name: {'mode': 'velocity', 'gain': 1.0}})
    assert world.joint_position == pytest.approx([0.5])
    assert world.scene.spec.joints[0].drive.mode == 'velocity'
