# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Models beside bodies in a scene: checked, recorded, written out."""

from pathlib import Path
import subprocess

import fresh
from models.robots import URDF, write
import numpy as np
import pytest

from rigid_sim_ros import load_scene, World
from rigid_sim_ros.scene import read_scene, scene_from_text, SceneError

SCENE = """world: {contact: none}
bodies:
  - {name: ball, shape: {type: sphere, radius: 0.1}, mass: 1.0, pose: {position: [0, 0, -1]}}
models:
  - name: left
    file: pendulum.urdf
    pose: {position: [0, 1, 0]}
    joints: {hinge: 0.2}
    drives: {'hin*': {mode: position, stiffness: 40, damping: 4}}
  - {name: right, file: pendulum.urdf}
forces:
  - {type: spring, a: left/tool, b: right/tool, stiffness: 5, rest_length: 0.5}
collision: {ignore: [[ball, left/rod]]}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return a scene with two pendulums and a ball."""
    write(tmp_path, 'pendulum.urdf', URDF)
    return write(tmp_path, 'scene.yaml', SCENE)


def test_forces_and_filters_of_the_scene_name_parts_of_models(path) -> None:
    world = load_scene(path)
    assert list(world.names) == ['ball', 'left/base', 'left/rod', 'right/base', 'right/rod']
    np.testing.assert_allclose(world.position[2], [0, 1, 1], atol=1e-15)
    world.step(100)
    # The spring pulls both tools together; they swing in x and z only.
    assert world.joint_position[0] == pytest.approx(0.2, abs=0.1)
    assert world.joint_position[1] != 0.0


def test_drives_match_patterns_and_others_take_efforts(path) -> None:
    left, right = load_scene(path).scene.spec.joints
    assert (left.drive.mode, left.drive.stiffness) == ('position', 40.0)
    assert right.drive.mode == 'effort'


def test_the_text_needs_no_model_and_is_the_same_scene(path) -> None:
    world = load_scene(path)
    text = world.scene.text
    for name in ('pendulum.urdf', 'scene.yaml'):
        (path.parent / name).unlink()
    assert 'models' not in text
    again = World(scene_from_text(text))
    assert again.scene.text == text
    for one in (world, again):
        one.step(50)
    assert again.state_hash() == world.state_hash()


def test_removing_a_body_takes_the_forces_on_its_frames_along() -> None:
    world = World.from_dict({
        'world': {'contact': 'none'},
        'bodies': [{'name': name, 'shape': {'type': 'sphere', 'radius': 0.1}, 'mass': 1.0,
                    'pose': {'position': [i, 0, 0]}, 'frames': {f'm/{name}_tip': {}}}
                   for i, name in enumerate('ab')],
        'forces': [{'type': 'spring', 'a': 'm/a_tip', 'b': 'm/b_tip', 'stiffness': 1.0}]})
    world.remove('b')
    world.step()
    # The spring, 1 m long, would have pulled along x.
    np.testing.assert_allclose(world.linear_velocity, [[0, 0, -9.81e-3]], atol=1e-15)


@pytest.mark.parametrize(('old', 'new', 'words'), [
    ('file: pendulum.urdf\n    pose', 'file: nobody.urdf\n    pose', 'urdf: cannot be read'),
    ('file: pendulum.urdf\n    pose', 'file: pendulum.txt\n    pose', 'must end with .urdf'),
    ('{hinge: 0.2}', '{hing: 0.2}', "8: models[0].joints.hing: 'hing' is no joint of the model"),
    ('{hinge: 0.2}', '{hinge: 7}', 'pendulum.urdf:7: left/hinge: position: 7 is beyond'),
    ("'hin*'", "'knee*'", "'knee*' is no joint of the model"),
    ('name: left', 'name: ball', 'begins with the name of bodies[0]'),
    ('name: right', 'name: left', "'left/base' is the name of bodies[1] too"),
    ('a: left/tool', 'a: left/tol', "did you mean 'left/tool'?"),
    ('fil', 'fle', "unknown key 'fle")])
def test_a_mistake_is_named(path, old, new, words) -> None:
    text = SCENE.replace(old, new, 1)
    assert text != SCENE
    path.write_text(text)
    with pytest.raises(SceneError) as error:
        read_scene(path)
    assert words in str(error.value)


def test_a_scene_may_have_models_and_no_bodies(path) -> None:
    path.write_text('world: {contact: none}\nmodels: [{name: a, file: pendulum.urdf}]\n')
    assert read_scene(path).names == ('a/base', 'a/rod')
    path.write_text('world: {contact: none}\nbodies: []\n')
    with pytest.raises(SceneError, match='bodies: is empty'):
        read_scene(path)


def command(*args: object) -> subprocess.CompletedProcess[str]:
    return fresh.run('-m', 'rigid_sim_ros', *map(str, args))


def test_a_bag_of_a_model_is_verified_without_its_file(path, tmp_path) -> None:
    bag = tmp_path / 'bag'
    assert command('batch', path, '--duration', '0.2', '--output', bag).returncode == 0
    (path.parent / 'pendulum.urdf').unlink()
    path.unlink()
    result = command('verify', bag)
    assert (result.returncode, result.stderr) == (0, '')


def test_convert_writes_a_scene_that_needs_no_model(path, tmp_path) -> None:
    made = tmp_path / 'made.yaml'
    model = path.parent / 'pendulum.urdf'
    assert command('convert', model, '--output', made).returncode == 0
    original = load_scene(model)
    model.unlink()
    converted = load_scene(made)
    assert converted.scene.text == original.scene.text
    again = command('convert', made, '--output', made)
    assert (again.returncode, again.stderr.count('\n')) == (2, 1)
    assert 'exists already' in again.stderr


def test_check_shows_a_model(path) -> None:
    result = command('check', path.parent / 'pendulum.urdf')
    assert result.returncode == 0
    assert 'pendulum: 2 bodies, 1 joint, 0 forces' in result.stdout
    assert 'pendulum/base - pendulum/rod' in result.stdout


def test_a_xacro_file_is_expanded_with_its_arguments(path) -> None:
    text = URDF.replace('<robot name="pendulum">', '<robot name="pendulum" '
                        'xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="m" '
                        'default="2"/>').replace('value="1"', 'value="${$(arg m) * 2}"')
    model = write(path.parent, 'pendulum.urdf.xacro', text)
    assert load_scene(model).scene.spec.bodies[1].inertial.mass == 4.0
    path.write_text('world: {contact: none}\nmodels: [{name: a, file: pendulum.urdf.xacro, '
                    'arguments: {m: "5"}}]\n')
    assert load_scene(path).scene.spec.bodies[1].inertial.mass == 10.0
    write(path.parent, 'pendulum.urdf.xacro', text.replace('$(arg m)', 'nothing'))
    with pytest.raises(SceneError, match='xacro says: '):
        read_scene(model)


HEAD = '<robot name="pendulum" xmlns:xacro="http://www.ros.org/wiki/xacro">'


def test_xacro_finds_the_package_around_a_model(tmp_path) -> None:
    """As in a clone whose workspace is not built yet."""
    parts = URDF.replace('<robot name="pendulum">', HEAD.replace(' name="pendulum"', ''))
    write(tmp_path, 'clone/package.xml', '<package><name>pendulum_description</name></package>')
    write(tmp_path, 'clone/urdf/parts.xacro', parts)
    find = (f'{HEAD}<xacro:include filename="$(find pendulum_description)/urdf/parts.xacro"/>'
            '</robot>')
    model = write(tmp_path, 'clone/urdf/pendulum.urdf.xacro', find)
    assert read_scene(model).names == ('pendulum/base', 'pendulum/rod')
    write(tmp_path, 'clone/urdf/parts.xacro', parts.replace('"10"', '"${lost}"'))
    with pytest.raises(SceneError, match="xacro says: name 'lost' is not defined") as error:
        read_scene(model)
    assert error.value.problems[0].file == str(tmp_path / 'clone/urdf/parts.xacro')
    model.write_text(find.replace('find pendulum', 'find nobody'), encoding='utf-8')
    with pytest.raises(SceneError, match="package 'nobody_description' is not found, must be"):
        read_scene(model)


def test_lines_of_a_xacro_file_are_those_of_what_it_expands_to(tmp_path) -> None:
    text = URDF.replace('<robot name="pendulum">', f'{HEAD}<xacro:property name="m" value="-1"/>')
    text = text.replace('mass value="1"', 'mass value="${m}"')
    model = write(tmp_path, 'pendulum.urdf.xacro', text)
    shown = fresh.run('-c', f'import sys, xacro; sys.argv[1:] = [{str(model)!r}]; xacro.main()')
    expanded = shown.stdout.splitlines()
    with pytest.raises(SceneError, match="value '-1', must be >= 0") as error:
        read_scene(model)
    problem = error.value.problems[0]
    assert problem.file == f'{model} (expanded by xacro)'
    assert 'mass value="-1"' in expanded[problem.line - 1]


def test_the_description_of_a_robot_is_the_text_of_its_file(path) -> None:
    scene = read_scene(path)
    assert scene.descriptions == {'left': URDF, 'right': URDF}
    assert scene_from_text(scene.text).descriptions == scene.descriptions
