# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every mistake in a scene file is named with file, line, key, value and mend."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from odd_files import KINDS
import pytest

from rigid_sim_ros.scene import read_scene, scene_from_dict, scene_from_text, SceneError, yaml_tree

Problems = Callable[[str], list[str]]

CRATE = {'name': 'crate', 'shape': {'type': 'box', 'size': [1, 1, 1]}, 'mass': 2.0}
BALL = 'shape: {type: sphere, radius: 1}'

# The lines below `bodies:`, and the one line of the error that they give; line 2 is the first.
BODIES = {
    'negative mass': (
        f'- name: a\n  {BALL}\n  mass: -2.0',
        '4: bodies[0].mass: -2.0 kg, must be > 0'),
    'unknown key': (
        f'- name: a\n  {BALL}\n  mass: 1\n  masss: 2',
        "5: bodies[0].masss: unknown key 'masss', did you mean 'mass'?"),
    'unknown key in a shape': (
        '- {name: a, mass: 1,\n   shape: {type: sphere, radius: 1, radus: 2}}',
        "3: bodies[0].shape.radus: unknown key 'radus', did you mean 'radius'?"),
    'missing key': (
        '- name: a\n  mass: 1\n  shape:\n    type: capsule\n    radius: 1',
        '4: bodies[0].shape.length: is missing, must be given'),
    'key twice': (
        f'- name: a\n  {BALL}\n  mass: 1\n  mass: 2',
        '5: bodies[0].mass: the key appears twice, first in line 4: remove one of them'),
    'not finite': (
        f'- name: a\n  {BALL}\n  mass: 1\n  pose:\n    position: [0, .inf, 0]',
        '6: bodies[0].pose.position[1]: inf m, must be finite'),
    'far away': (
        f'- name: a\n  {BALL}\n  mass: 1\n  pose:\n    position: [0, 2e15, 0]',
        '6: bodies[0].pose.position: [0.0, 2000000000000000.0, 0.0] m, must be within 1e+15 m, '
        '1e+06 times what `world: {bounds: {position: ...}}` says'),
    'too fast': (
        f'- name: a\n  {BALL}\n  mass: 1\n  twist: {{linear: [0, 0, -2e12]}}',
        '5: bodies[0].twist.linear: [0.0, 0.0, -2000000000000.0] m/s, must be within 1e+12 m/s, '
        '1e+06 times what `world: {bounds: {linear: ...}}` says'),
    'not a number': (
        f'- name: a\n  {BALL}\n  mass: heavy',
        "4: bodies[0].mass: 'heavy', must be a number in kg"),
    'number as text': (
        f"- name: a\n  {BALL}\n  mass: '2'",
        "4: bodies[0].mass: '2', must be a number in kg, written without quotes"),
    'too few numbers': (
        '- {name: a, mass: 1, shape: {type: box, size: [1, 1]}}',
        '2: bodies[0].shape.size: [1, 1], must be 3 numbers [x, y, z] m'),
    'no truth value': (
        f'- name: a\n  {BALL}\n  mass: 1\n  fixed: yes',
        "5: bodies[0].fixed: 'yes', must be true or false"),
    'two bodies in one': (
        f'- name: a\n  mass: 1\n  {BALL}\n  compound: [{{type: sphere, radius: 2}}]',
        '5: bodies[0].compound: stands beside shape, must be one of them: the parts of a compound '
        'are all that a body has'),
    'illegal name': (
        f'- name: 1 crate\n  {BALL}\n  mass: 1',
        "2: bodies[0].name: '1 crate', must be a ROS name: letters, digits and underscores, "
        "beginning with a letter, such as 'body_1_crate'"),
    'two underscores': (
        f'- name: a__b\n  {BALL}\n  mass: 1',
        "2: bodies[0].name: 'a__b', must not have two underscores in a row, such as 'a_b'"),
    'reserved name': (
        f'- name: world\n  {BALL}\n  mass: 1',
        "2: bodies[0].name: 'world' is the name of the fixed frame, must be another name"),
    'name too long for a topic': (
        f'- name: {"a" * 121}\n  {BALL}\n  mass: 1',
        f"2: bodies[0].name: '{'a' * 55}...' has 121 characters, must be at most 120"),
    'name twice': (
        f'- {{name: a, {BALL}, mass: 1}}\n- {{name: a, {BALL}, mass: 1}}',
        "3: bodies[1].name: 'a' is the name of bodies[0] too, must be unique"),
    'illegal frame name': (
        f'- name: a\n  {BALL}\n  mass: 1\n  frames:\n    top left: {{}}',
        "6: bodies[0].frames.top left: 'top left', must be a ROS name: letters, digits and "
        "underscores, beginning with a letter, such as 'top_left'"),
    'unknown shape': (
        '- {name: a, mass: 1, shape: {type: boxx, size: [1, 1, 1]}}',
        "2: bodies[0].shape.type: 'boxx', did you mean 'box'?"),
    'shape without a type': (
        '- {name: a, mass: 1, shape: {radius: 1}}',
        '2: bodies[0].shape: has no type, must be sphere, box, capsule, cylinder, cone, '
        'ellipsoid, plane, mesh, heightfield, points or compound'),
    'radii of an ellipsoid': (
        '- {name: a, mass: 1, shape: {type: ellipsoid, radii: [1, 0, 1]}}',
        '2: bodies[0].shape.radii[1]: 0 m, must be > 0'),
    'shape that is no mapping': (
        '- {name: a, mass: 1, shape: sphere}',
        "2: bodies[0].shape: 'sphere', must be a mapping with a type"),
    'empty compound': (
        '- {name: a, mass: 1, shape: {compound: []}}',
        '2: bodies[0].shape.compound: is empty, must have at least one entry'),
    'quaternion off': (
        f'- {{name: a, {BALL}, mass: 1, pose: {{orientation: [1, 0, 0, 1]}}}}',
        '2: bodies[0].pose.orientation: [1, 0, 0, 1] has length 1.41421, must be 1 within 0.001 '
        '(x, y, z, w: w is last)'),
    'quaternion a little off': (
        f'- {{name: a, {BALL}, mass: 1, pose: {{orientation: [0, 0, 0, 1.002]}}}}',
        '2: bodies[0].pose.orientation: [0, 0, 0, 1.002] has length 1.002, must be 1 within 0.001 '
        '(x, y, z, w: w is last)'),
    'no mass': (
        f'- name: a\n  {BALL}',
        '2: bodies[0]: has no mass, must have mass, density or inertial'),
    'mass twice': (
        f'- name: a\n  {BALL}\n  mass: 1\n  density: 2',
        '5: bodies[0].density: stands beside mass, must be one of mass, density or inertial'),
    'mass without a shape': (
        '- {name: a, mass: 1}',
        '2: bodies[0].mass: needs a shape to distribute it, must have one, or inertial instead'),
    'neither mass nor shape': (
        '- {name: a}',
        '2: bodies[0]: has neither shape nor mass, must have mass, density or inertial, or be '
        'fixed: true'),
    'mass beside particles': (
        '- name: a\n  shape: {type: points, positions: [[0, 0, 0]], masses: [1]}\n  mass: 1',
        '4: bodies[0].mass: stands beside the masses in shape, must be one or the other'),
    'mass of one part missing': (
        '- name: a\n  shape:\n    compound:\n'
        '    - {type: sphere, radius: 1, mass: 1}\n    - {type: sphere, radius: 1}',
        '6: bodies[0].shape.compound[1]: has no mass, must have mass or density'),
    'mass of a part twice': (
        '- {name: a, compound: [{type: sphere, radius: 1, mass: 1, density: 1}]}',
        '2: bodies[0].compound[0].density: stands beside mass, must be one of them'),
    'not positive definite': (
        '- name: a\n  inertial: {mass: 1, inertia: [1, 1, 1, 1, 0, 0]}',
        '3: bodies[0].inertial: inertia is not positive definite: principal moments 0, 1, 2 '
        'kg m^2, must all be > 0'),
    'triangle inequality': (
        '- name: a\n  inertial: {mass: 1, inertia: [1, 1, 3, 0, 0, 0]}',
        '3: bodies[0].inertial: inertia violates the triangle inequality: principal moments 1, 1, '
        '3 kg m^2, the two smaller ones must add up to the largest or more, 2 < 3'),
    'size beyond floats': (
        '- {name: a, density: 1, shape: {type: sphere, radius: 1.0e+200}}',
        '2: bodies[0].shape: mass, size or speed leave the range of numbers, must be less '
        'extreme'),
    'speed beyond floats': (
        f'- {{name: a, mass: 1.0e+304, {BALL}, twist: {{linear: [1.0e+6, 0, 0]}}}}',
        '2: bodies[0]: mass, size or speed leave the range of numbers, must be less extreme'),
    'as many masses': (
        '- {name: a,\n   shape: {type: points, positions: [[0, 0, 0]],\n   masses: [1, 2]}}',
        '4: bodies[0].shape.masses: 2 masses for 1 positions, must be as many'),
    'plane that moves': (
        '- {name: a, shape: {type: plane}}',
        "2: bodies[0].shape.type: 'plane' has no end and no mass, the body must be fixed: true "
        'or kinematic: true'),
    'plane without direction': (
        '- {name: a, fixed: true, shape: {type: plane, normal: [0, 0, 0]}}',
        '2: bodies[0].shape.normal: [0, 0, 0] has no direction, must be such as [0, 0, 1]'),
    'mesh without thickness': (
        '- {name: a, mass: 1, compound: [{type: sphere, radius: 1},\n'
        '   {type: mesh, vertices: "0 0 0, 1 0 0, 0 1 0, 0 0 1.0e-10",\n'
        '    faces: "0 2 1, 0 1 3, 0 3 2, 1 2 3"}]}',
        '3: bodies[0].compound[1]: the mesh is 1e-10 m thick and 1 m long, must be at least 1e-06 '
        'of its length thick, or collides: false'),
    'kinematic and fixed': (
        '- {name: a, fixed: true,\n   kinematic: true}',
        '3: bodies[0].kinematic: stands beside fixed: true, must be one of them: a kinematic body '
        'moves by its twist'),
    'fixed body with a twist': (
        '- {name: a, fixed: true, twist: {linear: [1, 0, 0]}}',
        '2: bodies[0].twist: of a fixed body, must be 0, or the body kinematic: true in place of '
        'fixed'),
    'unknown material': (
        f'- {{name: a, mass: 1, {BALL},\n   material: defualt}}',
        "3: bodies[0].material: 'defualt' is no material, did you mean 'default'?"),
    'colour': (
        f'- {{name: a, mass: 1, {BALL}, color: [0, 2, 0]}}',
        '2: bodies[0].color[1]: 2, must be in [0, 1]'),
    'body that is no mapping': (
        '- crate',
        "2: bodies[0]: 'crate', must be a mapping of keys to values"),
}

# The rest of a scene, appended after one good body; line 3 is the first.
SCENES = {
    'step': ('world: {step: 0}', '3: world.step: 0 s, must be > 0'),
    'step below a nanosecond': (
        'world: {step: 1.0e-10}', '3: world.step: 1e-10 s, must be in [1e-09, 1e+06]'),
    'integrator': (
        'world:\n  integrator: rk5', "4: world.integrator: 'rk5', did you mean 'rk4'?"),
    'orientation': (
        'world: {orientation: rpy}',
        "3: world.orientation: 'rpy', must be quaternion, matrix or axis_angle"),
    'solver': ('world: {solver: 1}', '3: world.solver: 1, must be sequential or qp'),
    'gravity': ('world: {gravity: 9.81}',
                '3: world.gravity: 9.81, must be 3 numbers [x, y, z] m/s^2'),
    'friction': ('materials:\n  ice: {friction: -1}',
                 '4: materials.ice.friction: -1, must be >= 0'),
    'restitution': ('materials: {ice: {restitution: 1.5}}',
                    '3: materials.ice.restitution: 1.5, must be in [0, 1]'),
    'format': ('format: 2', '3: format: 2, must be 1, the only format so far'),
    'section': ('force: []', "3: force: unknown key 'force', did you mean 'forces'?"),
    'forces that are no list': ('forces: 1', '3: forces: 1, must be a list'),
    'unknown force': ('forces:\n- {type: spirng}',
                      "4: forces[0].type: 'spirng', did you mean 'spring'?"),
    'unknown key of a force': (
        'forces:\n- {type: wind, drga: 1}',
        "4: forces[0].drga: unknown key 'drga', did you mean 'drag'?"),
    'missing key of a force': (
        'forces:\n- {type: spring, a: crate}',
        '4: forces[0].stiffness: is missing, must be given'),
    'negative parameter': (
        'forces:\n- {type: wind, drag: -1}', '4: forces[0].drag: -1 N s/m, must be >= 0'),
    'quaternion of a force': (
        'forces:\n- {type: hold_orientation, a: crate, stiffness: 1, orientation: [0, 0, 0, 2]}',
        '4: forces[0].orientation: [0, 0, 0, 2] has length 2, must be 1 within 0.001 '
        '(x, y, z, w: w is last)'),
    'unknown frame': (
        'forces:\n- {type: spring, stiffness: 1,\n   a: crate/handel}',
        "5: forces[0].a: 'crate/handel' is no frame, did you mean 'crate/handle'?"),
    'unknown body': (
        'forces:\n- {type: wind, bodies: [crates]}',
        "4: forces[0].bodies[0]: 'crates' matches no body, did you mean 'crate'?"),
    'force within a body': (
        'forces:\n- {type: spring, stiffness: 1, a: crate, b: crate/handle}',
        "4: forces[0].b: 'crate/handle' is on the same body as a: 'crate', must be on another"),
    'force on nothing that moves': (
        'forces:\n- {type: spring, stiffness: 1, a: world}',
        "4: forces[0].b: 'world' is on the same body as a: 'world', must be on another"),
    'pair of one': (
        'forces:\n- {type: avoidance, range: 1, stiffness: 1, bodies: [crate]}',
        "4: forces[0].bodies: ['crate'] chooses 1 bodies that move, must be 2 or more"),
}

YAML = {
    '': '1: the scene is empty, must have bodies',
    'bodies: [': '1: not YAML: while parsing a flow node, expected the node content, but found '
                 "'<stream end>'",
    'a: 1\n---\nb: 2': '2: not YAML: expected a single document in the stream, but found another '
                       'document',
    'bodies: !!python/object:os.system x':
        "1: bodies: tag 'python/object:os.system', must be plain data: remove the tag",
    '&a [*a]': '1: [0]: an alias that contains itself, must be written out',
    '[' * 100: '1: not YAML: while parsing a flow node, expected the node content, but found '
               "'<stream end>'",
    '[' * 100 + ']' * 100: f'1: {"[0]" * 8}: nested deeper than 40 levels, a scene needs no more '
                           'than 8',
    '[' * 5000: '1: nested deeper than 40 levels, a scene needs no more than 8',
    '1: 2': '1: key 1, must be text',
    '? [1, 2]\n: 2': '1: key of several values, must be text',
    'bodies: 0x_': "1: bodies: '0x_', cannot be read as int",
    '<<: 3': '1: <<: must name one mapping: <<: *name',
    'bodies': "1: 'bodies', must be a mapping of keys to values",
}


@pytest.mark.parametrize(('text', 'expected'), BODIES.values(), ids=BODIES)
def test_a_mistake_in_a_body_is_named(text: str, expected: str, problems: Problems) -> None:
    assert problems(f'bodies:\n{text}\n') == [f'scene.yaml:{expected}']


@pytest.mark.parametrize(('text', 'expected'), SCENES.values(), ids=SCENES)
def test_a_mistake_beside_the_bodies_is_named(
        text: str, expected: str, problems: Problems) -> None:
    crate = '- {name: crate, shape: {type: box, size: [1, 1, 1]}, mass: 1, frames: {handle: {}}}'
    assert problems(f'bodies:\n{crate}\n{text}\n') == [f'scene.yaml:{expected}']


@pytest.mark.skipif(yaml_tree.CParser is None, reason='PyYAML has no libyaml')
def test_what_libyaml_finds_too_deep_is_not_read_again(monkeypatch, problems: Problems) -> None:
    monkeypatch.setattr(yaml_tree, 'YAML', None)
    assert problems('[' * 5000) == [f'scene.yaml:{YAML["[" * 5000]}']


@pytest.mark.parametrize(('text', 'expected'), YAML.items())
def test_what_is_not_yaml_or_not_plain_data_is_named(
        text: str, expected: str, problems: Problems) -> None:
    assert problems(text) == [f'scene.yaml:{expected}']


def test_all_mistakes_are_reported_in_the_order_of_the_file(problems: Problems) -> None:
    lines = problems('world: {step: -1}\nbodies:\n- {name: a b}\n- {nam: c}\nmaterial: {}\n')
    assert [line.split(': ')[:2] for line in lines] == [
        ['scene.yaml:1', 'world.step'], ['scene.yaml:3', 'bodies[0].name'],
        ['scene.yaml:4', 'bodies[1].name'], ['scene.yaml:4', 'bodies[1].nam'],
        ['scene.yaml:5', 'material']]


def test_the_summary_is_the_first_mistake_and_a_count() -> None:
    with pytest.raises(SceneError) as error:
        scene_from_text('world: {step: -1}\nbodies: [{name: 1}, {name: 2}]', 'file')
    assert error.value.summary == 'file:1: world.step: -1 s, must be > 0 (and 2 more problems)'


def test_the_summary_of_one_mistake_is_that_mistake() -> None:
    with pytest.raises(SceneError) as error:
        scene_from_text('world: {step: -1}\nbodies: [{name: a, fixed: true}]', 'file')
    assert error.value.summary == str(error.value) == 'file:1: world.step: -1 s, must be > 0'


def test_a_scene_error_is_a_value_error() -> None:
    with pytest.raises(ValueError, match='bodies'):
        scene_from_dict({})


def test_a_message_is_one_line_whatever_the_value() -> None:
    with pytest.raises(SceneError) as error:
        scene_from_text(r'{bodies: [{name: "a\nb", fixed: true}], "k\n\e[2J": 1}', 'a\nb')
    assert len(str(error.value).splitlines()) == len(error.value.problems) == 2
    assert str(error.value).replace('\n', '').isprintable()


def test_the_line_within_an_alias_is_that_of_the_anchor(problems: Problems) -> None:
    text = 'bodies:\n- name: a\n  shape: &s\n    type: sphere\n    radius: 0\n  mass: 1\n'
    assert problems(text + '- {name: b, shape: *s, mass: 1}\n') == [
        'scene.yaml:5: bodies[0].shape.radius: 0 m, must be > 0',
        'scene.yaml:5: bodies[1].shape.radius: 0 m, must be > 0']


def test_the_line_of_a_merged_key_is_where_it_is_written(problems: Problems) -> None:
    text = 'bodies:\n- &a\n  name: a\n  mass: -1\n  shape: {type: sphere, radius: 1}\n'
    lines = problems(text + '- {<<: *a, name: b}\n')
    assert lines[1] == 'scene.yaml:4: bodies[1].mass: -1 kg, must be > 0'


def test_a_mistake_in_a_dict_has_neither_file_nor_line() -> None:
    with pytest.raises(SceneError) as error:
        scene_from_dict({'bodies': [{**CRATE, 'mass': -2.0}]})
    assert str(error.value) == 'bodies[0].mass: -2.0 kg, must be > 0'


@pytest.mark.parametrize('data', [None, 3, [], 'bodies', {1: 2}, {'bodies': {1, 2}},
                                  {'bodies': [{**CRATE, 'mass': 10**5000}]},
                                  {'bodies': [{**CRATE, 'mass': np.nan}]},
                                  {'bodies': [{**CRATE, 'mass': np.array([1.0])}]}])
def test_a_dict_that_is_no_scene_is_a_scene_error(data: object) -> None:
    with pytest.raises(SceneError):
        scene_from_dict(data)  # type: ignore[arg-type]


def test_a_dict_that_contains_itself_is_a_scene_error() -> None:
    data: dict[str, object] = {}
    data['bodies'] = data
    with pytest.raises(SceneError, match='nested deeper'):
        scene_from_dict(data)


def test_a_missing_file_names_the_nearest_example() -> None:
    with pytest.raises(SceneError) as error:
        read_scene('t_handel')
    assert str(error.value) == ('t_handel: is neither a scene file nor an example, did you mean '
                                "'t_handle'?")


@pytest.mark.parametrize('kind, said', [
    ('folder', 'a folder'), ('pipe', 'a pipe'), ('device', 'a device'),
    ('ring of links', 'a link to nothing')])
@pytest.mark.parametrize('name', ['scene.yaml', 'robot.urdf'])
def test_what_is_no_file_is_called_what_it_is(tmp_path: Path, name: str, kind: str,
                                              said: str) -> None:
    path = tmp_path / name
    KINDS[kind](path)
    with pytest.raises(SceneError) as error:
        read_scene(path)
    assert str(error.value) == f'{path}: is {said}, must be the file of a scene or a model'


def test_a_file_that_is_not_text_is_not_a_scene(tmp_path: Path) -> None:
    path = tmp_path / 'scene.yaml'
    path.write_bytes(b'bodies: \xff\xfe')
    with pytest.raises(SceneError) as error:
        read_scene(path)
    assert str(error.value) == f'{path}: byte 8 is not UTF-8, must be a text file'


def test_aliases_that_multiply_are_refused_before_they_fill_the_memory(problems: Problems) -> None:
    lines = [f'a{i}: &a{i} [{", ".join([f"*a{i - 1}"] * 10)}]' for i in range(1, 30)]
    text = 'a0: &a0 [lol]\n' + '\n'.join(lines)  # 10**29 values, written out
    assert problems(text) == ['scene.yaml:7: a6: more than 500000 values with all aliases '
                              'written out, must be fewer']
