# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""SDF files: frames relative to frames, models in models, includes, and what their joints say."""

import math
from pathlib import Path
import re

from models.robots import world_of, write
import numpy as np
import pytest

from rigid_sim_ros.scene import read_scene, SceneError

INERTIAL = ('<inertial><mass>2</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.1</izz>'
            '</inertia></inertial>')


def sdf(content: str, version: str = '1.9') -> str:
    return f'<sdf version="{version}"><model name="m">{content}</model></sdf>'


def link(name: str, pose: str = '', more: str = '') -> str:
    return f'<link name="{name}">{pose}{INERTIAL}{more}</link>'


ARM = sdf(f"""
  {link('base', '<pose>0 0 1 0 0 0</pose>')}
  {link('arm', '<pose relative_to="shoulder_place">0.5 0 0 0 0 0</pose>')}
  <frame name="shoulder_place" attached_to="base">
    <pose>0 0 0.25 0 0 1.5707963267948966</pose></frame>
  <frame name="tool" attached_to="arm"><pose>0.5 0 0 0 0 0</pose></frame>
  <joint name="shoulder" type="revolute">
    <parent>base</parent><child>arm</child><pose relative_to="shoulder_place"/>
    <axis><xyz expressed_in="__model__">0 0 1</xyz>
      <limit><lower>-1</lower><upper>inf</upper><effort>-1</effort><velocity>3</velocity></limit>
      <dynamics><damping>0.5</damping><spring_stiffness>2</spring_stiffness></dynamics></axis>
  </joint>""")


def test_poses_are_relative_to_frames(tmp_path) -> None:
    world = world_of(write(tmp_path, 'm.sdf', ARM), joints={'shoulder': math.pi / 2})
    # The shoulder stands at (0, 0, 1.25) and looks along y; a quarter of a turn more, and the arm
    # is half a metre along -x.
    np.testing.assert_allclose(world.position, [[0, 0, 1], [-0.5, 0, 1.25]], atol=1e-15)
    assert 'r/tool' in world.frame_names


def test_a_joint_has_the_laws_of_its_axis(tmp_path) -> None:
    joint = read_scene(write(tmp_path, 'm.sdf', ARM)).spec.joints[0]
    assert (joint.limits.lower, joint.limits.upper) == (-1.0, None)
    assert (joint.limits.effort, joint.limits.velocity) == (None, 3.0)
    assert (joint.damping, joint.spring.stiffness) == (0.5, 2.0)


def test_the_largest_number_is_no_bound_as_the_writer_of_sdf_gives_it(tmp_path) -> None:
    text = ARM.replace('<lower>-1<', '<lower>-1.79769e+308<').replace(
        '<upper>inf<', '<upper>1.79769e+308<').replace('<effort>-1<', '<effort>inf<')
    limits = read_scene(write(tmp_path, 'm.sdf', text)).spec.joints[0].limits
    assert (limits.lower, limits.upper, limits.effort) == (None, None, None)


def test_elements_with_a_prefix_are_for_others(tmp_path) -> None:
    text = ARM.replace('<parent>', '<gz:grease xmlns:gz="http://x">1</gz:grease><parent>')
    notes = read_scene(write(tmp_path, 'm.sdf', text)).notes
    assert any('<gz:grease> is ignored' in note for note in notes)


@pytest.mark.parametrize(('frame', 'axis'), [
    ('', (1, 0, 0)), ('__model__', (0, -1, 0)), ('tool', (1, 0, 0)), ('base', (0, -1, 0))])
def test_an_axis_is_expressed_in_a_frame(tmp_path, frame, axis) -> None:
    named = f' expressed_in="{frame}"' if frame else ''
    text = ARM.replace('<xyz expressed_in="__model__">0 0 1</xyz>', f'<xyz{named}>1 0 0</xyz>')
    # The joint frame is turned by a quarter about z, and the arm and its tool with it.
    joint = read_scene(write(tmp_path, 'm.sdf', text)).spec.joints[0]
    np.testing.assert_allclose(joint.axis, axis, atol=1e-15)


def test_a_model_is_free_unless_it_says_otherwise(tmp_path) -> None:
    path = write(tmp_path, 'm.sdf', ARM)
    assert not any(body.fixed for body in read_scene(path).spec.bodies)
    path.write_text(ARM.replace('<model name="m">', '<model name="m"><static>true</static>'))
    assert all(body.fixed for body in read_scene(path).spec.bodies)
    path.write_text(ARM.replace('</model>', '<joint name="ground" type="fixed"><parent>world'
                                '</parent><child>base</child></joint></model>'))
    assert [body.fixed for body in read_scene(path).spec.bodies] == [True, False]


def test_a_model_in_a_model_has_names_and_frames_of_its_own(tmp_path) -> None:
    inner = (f'<model name="hand"><pose relative_to="wrist">1 0 0 0 0 0</pose>{link("palm")}'
             '</model>')
    joint = ('<joint name="hold" type="continuous"><parent>base</parent><child>hand::palm</child>'
             '<axis/></joint>')
    frame = '<frame name="wrist"><pose>0 2 0 0 0 0</pose></frame>'
    world = world_of(write(tmp_path, 'm.sdf', sdf(link('base') + inner + joint + frame)))
    assert list(world.names) == ['r/base', 'r/hand/palm']
    np.testing.assert_allclose(world.position[1], [1, 2, 0], atol=1e-15)


def test_a_placement_frame_is_put_where_the_pose_says(tmp_path) -> None:
    inner = (f'<model name="hand" placement_frame="grip"><pose>1 0 0 0 0 0</pose>{link("palm")}'
             '<frame name="grip"><pose>0 0 0.25 0 0 0</pose></frame></model>')
    world = world_of(write(tmp_path, 'm.sdf', sdf(link('base') + inner)))
    np.testing.assert_allclose(world.position[1], [1, 0, -0.25], atol=1e-15)


def test_a_model_of_a_local_file_is_included(tmp_path) -> None:
    write(tmp_path, 'hand/model.sdf', sdf(link('palm', '<pose>0 0 1 0 0 0</pose>')))
    write(tmp_path, 'hand/model.config', '<model><sdf version="1.9">model.sdf</sdf></model>')
    include = '<include><uri>model://hand</uri><name>left</name><pose>1 0 0 0 0 0</pose></include>'
    world = world_of(write(tmp_path, 'm.sdf', sdf(link('base') + include)))
    assert list(world.names) == ['r/base', 'r/left/palm']
    np.testing.assert_allclose(world.position[1], [1, 0, 1], atol=1e-15)


HAND = sdf(f"""
  {link('palm', '<pose>0 0 1 0 0 0</pose>')}
  {link('finger', '<pose relative_to="palm">0 0 1 0 0 0</pose>')}
  <frame name="grip"><pose>0 0 0.25 0 0 0</pose></frame>
  <joint name="knuckle" type="revolute"><parent>palm</parent><child>finger</child>
    <axis><xyz expressed_in="__model__">1 0 0</xyz></axis></joint>""")


def merged(tmp_path, hand: str, include: str, around: str = '') -> str:
    """Write a model into which another one is merged; return its file."""
    write(tmp_path, 'hand/model.sdf', hand)
    return write(tmp_path, 'm.sdf', sdf(
        f'{link("base")}{around}<include merge="true"><uri>hand/model.sdf</uri>{include}</include>'
        '<joint name="wrist" type="revolute"><parent>base</parent><child>palm</child>'
        '<axis><xyz>0 0 1</xyz></axis></joint>'))


def test_what_is_in_a_merged_model_is_of_the_model_around_it(tmp_path) -> None:
    path = merged(tmp_path, HAND, '<pose>1 0 0 0 0 1.5707963267948966</pose>')
    world = world_of(path)
    assert list(world.names) == ['r/base', 'r/palm', 'r/finger']
    assert set(world.joint_names) == {'r/wrist', 'r/knuckle'}
    np.testing.assert_allclose(world.position[1:], [[1, 0, 1], [1, 0, 2]], atol=1e-15)
    assert 'r/grip' in world.frame_names
    # Its own frame is turned as it is placed, and so is what is said in that frame.
    knuckle = next(one for one in read_scene(path).spec.joints if 'knuckle' in one.name)
    np.testing.assert_allclose(knuckle.axis, [1, 0, 0], atol=1e-15)


def test_a_merged_model_is_placed_by_a_frame_of_its_own(tmp_path) -> None:
    include = '<pose>1 0 0 0 0 0</pose><placement_frame>grip</placement_frame>'
    world = world_of(merged(tmp_path, HAND, include))
    np.testing.assert_allclose(world.position[1], [1, 0, 0.75], atol=1e-15)


def test_poses_may_be_relative_to_the_frame_that_a_merged_model_had(tmp_path) -> None:
    frame = ('<frame name="f" attached_to="_merged__m__model__">'
             '<pose>0 0 0.5 0 0 0</pose></frame>')
    world = world_of(merged(tmp_path, HAND, '<pose>1 0 0 0 0 0</pose>', frame))
    assert 'r/f' in world.frame_names


@pytest.mark.parametrize(('hand', 'include', 'says'), [
    (HAND.replace('palm', 'base'), '', 'is there twice'),
    (HAND.replace('<frame', '<static>true</static><frame'), '', '<static> must be false'),
    (HAND, '<static>true</static>', '<static> must be false'),
    (HAND.replace('<frame', '<self_collide>1</self_collide><frame'), '', '<self_collide> must be'),
    (sdf('<include merge="true"><uri>model.sdf</uri></include>'), '', 'include itself')])
def test_what_cannot_be_merged_is_named(tmp_path, hand, include, says) -> None:
    with pytest.raises(SceneError, match=says):
        read_scene(merged(tmp_path, hand, include))


WORLD = f"""<sdf version="1.8"><world name="w">
  <gravity>0 0 -3.7</gravity><light name="sun" type="directional"/>
  <physics name="slow" type="ode"><max_step_size>0.01</max_step_size></physics>
  <physics name="used" type="ode" default="true"><max_step_size>0.002</max_step_size></physics>
  <frame name="dock"><pose>1 0 0 0 0 1.5707963267948966</pose></frame>
  <model name="ground"><static>true</static><link name="l"><collision name="c"><geometry><plane>
    <normal>0 0 1</normal></plane></geometry></collision></link></model>
  <model name="one"><pose>0 0 0.5 0 0 0</pose>{link('body')}{link('wheel')}
    <joint name="axle" type="revolute"><parent>body</parent><child>wheel</child>
      <axis><xyz>0 1 0</xyz></axis></joint></model>
  <model name="two"><pose relative_to="dock">2 0 0.5 0 0 0</pose>{link('body')}</model>
  <joint name="tow" type="fixed"><parent>one::body</parent><child>two::body</child></joint>
</world></sdf>"""
BALL = '<collision name="c"><geometry><sphere><radius>0.1</radius></sphere></geometry></collision>'


def test_a_world_brings_all_its_models_and_what_holds_them(tmp_path) -> None:
    spec = read_scene(write(tmp_path, 'w.sdf', WORLD)).spec
    assert [body.name for body in spec.bodies] == [
        'w/ground/l', 'w/one/body', 'w/one/wheel', 'w/two/body']
    assert [body.fixed for body in spec.bodies] == [True, False, False, False]
    assert spec.bodies[3].pose.position == pytest.approx((1.0, 2.0, 0.5), abs=1e-15)
    assert [joint.name for joint in spec.joints] == ['w/one/axle', 'w/tow']
    assert (spec.world.gravity, spec.world.step) == ((0.0, 0.0, -3.7), 0.002)
    assert spec.world.contact == 'timestep'


def test_models_of_a_world_touch_each_other(tmp_path) -> None:
    """In a model its links do not, unless it says so."""
    text = WORLD.replace('</inertial>', f'</inertial>{BALL}')
    text = re.sub('<joint name="tow".*', '', text)      # with it they would be one part
    ignored = read_scene(write(tmp_path, 'w.sdf', text)).spec.collision.ignore
    assert ('w/one/body', 'w/one/wheel') in ignored
    assert not any({'w/two/body', 'w/one/wheel'} == set(pair) for pair in ignored)


def test_the_axis_of_a_ball_joint_damps_all_its_axes(tmp_path) -> None:
    text = ARM.replace('"revolute"', '"ball"').replace(
        '<spring_stiffness>2</spring_stiffness>', '')
    limits = text[text.index('<limit>'):text.index('</limit>') + 8]
    joint, = read_scene(write(tmp_path, 'm.sdf', text.replace(limits, ''))).spec.joints
    assert (joint.type, joint.damping) == ('spherical', 0.5)
    with pytest.raises(SceneError, match='has limits, friction or a spring'):
        read_scene(write(tmp_path, 'm.sdf', text))


def test_a_file_of_two_models_is_refused(tmp_path) -> None:
    models = ''.join(f'<model name="{name}">{link("a")}</model>' for name in 'mn')
    path = write(tmp_path, 'm.sdf', f'<sdf version="1.9">{models}</sdf>')
    with pytest.raises(SceneError, match='has 2 models, must have one model'):
        read_scene(path)


def test_a_file_that_includes_itself_ends_in_an_error(tmp_path) -> None:
    path = write(tmp_path, 'm.sdf', sdf('<include><uri>m.sdf</uri></include>'))
    with pytest.raises(SceneError, match='must not include itself'):
        read_scene(path)


def test_links_of_a_model_touch_each_other_only_if_it_says_so(tmp_path) -> None:
    ball = ('<collision name="c"><geometry><sphere><radius>0.1</radius></sphere></geometry>'
            '</collision>')
    links = ''.join(link(name, more=ball) for name in 'abc')
    path = write(tmp_path, 'm.sdf', sdf(links))
    assert len(read_scene(path).spec.collision.ignore) == 3
    path.write_text(sdf(f'<self_collide>true</self_collide>{links}'))
    assert read_scene(path).spec.collision.ignore == ()


def four_bar(folder) -> Path:
    """Write a parallelogram of bars that are 1 m long, in the plane y = 0."""
    def bar(name: str, pose: str) -> str:
        return link(name, f'<pose>{pose} 0 0 0</pose>')

    def hinge(parent: str, child: str, pose: str, kind: str = 'revolute') -> str:
        axis = '<axis><xyz>0 1 0</xyz></axis>' if kind == 'revolute' else ''
        return (f'<joint name="{parent}_{child}" type="{kind}"><parent>{parent}</parent><child>'
                f'{child}</child><pose relative_to="__model__">{pose} 0 0 0</pose>{axis}</joint>')

    content = (bar('a', '0 0 0') + bar('b', '0 0 1') + bar('c', '1 0 0')
               + hinge('world', 'a', '0 0 0') + hinge('a', 'b', '0 0 1')
               + hinge('world', 'c', '1 0 0') + hinge('b', 'c', '1 0 1', 'ball'))
    return write(folder, 'm.sdf', sdf(content))


def test_a_joint_of_a_loop_starts_where_the_scene_says(tmp_path) -> None:
    world = world_of(four_bar(tmp_path), joints={'world_a': 0.4})
    # Opposite sides of a parallelogram turn alike, and the others stay parallel to each other.
    assert world.joint_position[:3] == pytest.approx([0.4, -0.4, 0.4], abs=1e-11)


def test_positions_that_a_loop_cannot_have_together_all_give_way(tmp_path) -> None:
    world = world_of(four_bar(tmp_path), joints={'world_a': 0.4, 'world_c': 0.3})
    first, _, last = world.joint_position[:3]
    assert 0.3 < first < 0.4
    assert last == pytest.approx(first, abs=1e-11)


def test_a_four_bar_linkage_closes_and_moves(tmp_path) -> None:
    world = world_of(four_bar(tmp_path))
    world.apply_impulse('r/b', (0.5, 0, 0))
    world.step(200)
    first, last = world.joint_position[0], world.joint_position[2]
    # Opposite sides of a parallelogram turn alike.
    assert abs(first) > 0.01
    assert last == pytest.approx(first, abs=1e-11)


@pytest.mark.parametrize(('content', 'words'), [
    ('<link name="a"><gravity>false</gravity></link>', 'must be true'),
    (link('a') + '<joint name="j" type="screw"><parent>world</parent><child>a</child></joint>',
     "type 'screw', must be revolute"),
    (link('a') + '<joint name="j" type="ball"><parent>world</parent><child>b</child></joint>',
     "'b' is neither a link nor a frame"),
    (link('a', '<pose relative_to="f"/>') + '<frame name="f"><pose relative_to="a"/></frame>',
     'its pose leads back to itself'),
    (link('a', '<pose relative_to="mont"/>') + '<frame name="mount"/>',
     "'mont' is no frame, did you mean 'mount'?"),
    (link('arm') + '<joint name="j" type="ball"><parent>world</parent><child>amr</child></joint>',
     "a model here, did you mean 'arm'?"),
    (link('a', '<pose>1 2 3</pose>'), 'must be 6 numbers'),
    (link('a') + link('a'), 'is there twice'),
    (link('a') + '<include><uri>model://nobody</uri></include>', "package 'nobody' is not found"),
    (link('a') + '<include><uri>https://x.org/a</uri></include>', 'nothing is downloaded'),
    (link('a') + '<include><uri>../other.sdf</uri></include>', 'lies outside of the folders'),
    ('', 'has no links'),
    ('<lnk name="a"/>', "is not known in <model>, did you mean 'link'?")])
def test_a_mistake_is_named_with_its_line_and_mend(tmp_path, content, words) -> None:
    path = write(tmp_path, 'sub/m.sdf', sdf(content))
    write(tmp_path, 'other.sdf', sdf(link('x')))
    with pytest.raises(SceneError) as error:
        read_scene(path)
    first = error.value.problems[0]
    assert words in first.message
    assert (first.file, first.line) == (str(path), 1)


def test_a_frame_that_is_missing_is_told_once(tmp_path) -> None:
    rest = ''.join(link(name, f'<pose relative_to="{on}"/>') for on, name in ('ab', 'bc', 'cd'))
    path = write(tmp_path, 'm.sdf', sdf(f'{rest}\n{link("a", """<pose relative_to="x"/>""")}'))
    with pytest.raises(SceneError) as error:
        read_scene(path)
    first, = error.value.problems
    assert first.message == "'x' is no frame, must be one"
    assert (first.line, first.key) == (2, "model 'm'/link 'a'")


def test_an_old_version_is_refused_with_the_way_to_a_new_one(tmp_path) -> None:
    path = write(tmp_path, 'm.sdf', sdf(link('a'), '1.4'))
    with pytest.raises(SceneError, match=r"version '1\.4' of SDF, must be 1\.6 or later"):
        read_scene(path)
