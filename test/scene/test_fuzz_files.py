# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever a name in a scene or a model leads to: one line, soon, and nothing waits."""

from pathlib import Path
import warnings

from bag.hostile import limited_time
from odd_files import KINDS
import pytest

from rigid_sim_ros import load_scene, SceneError
from rigid_sim_ros.cli.commands import main

URDF = '<robot name="r"><link name="l"/></robot>'
XACRO = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}<link name="l"/></robot>'
INERTIA = ('<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
           '</inertial>')


def body(shape: str) -> str:
    return f'format: 1\nbodies:\n- {{name: a, fixed: true, shape: {{{shape}}}}}\n'


# By the name of the odd file: the file that names it, and what stands in that. The last one is
# what is read, and may be the odd file itself.
PLACES: dict[str, tuple[str, str, str]] = {
    'a scene': ('x.yaml', '', ''),
    'a URDF file': ('x.urdf', '', ''),
    'an SDF file': ('x.sdf', '', ''),
    'an MJCF file': ('x.xml', '', ''),
    'a xacro file': ('x.xacro', '', ''),
    'a mesh': ('x.obj', 's.yaml', body('type: mesh, file: x.obj')),
    'heights as numbers': (
        'x.csv', 's.yaml', body('type: heightfield, file: x.csv, size: [1, 1]')),
    'heights as an array': (
        'x.npy', 's.yaml', body('type: heightfield, file: x.npy, size: [1, 1]')),
    'heights as a picture': (
        'x.png', 's.yaml', body('type: heightfield, file: x.png, size: [1, 1]')),
    'a model of a scene': (
        'x.urdf', 's.yaml', 'format: 1\nmodels:\n- {name: r, file: x.urdf}\n'),
    'an SRDF file': ('x.srdf', 's.urdf', URDF),
    'a mesh of a URDF file': ('x.stl', 's.urdf', URDF.replace('<link name="l"/>', (
        f'<link name="l">{INERTIA}<collision><geometry><mesh filename="x.stl"/></geometry>'
        '</collision></link>'))),
    'an included SDF file': ('x.sdf', 's.sdf', (
        '<sdf version="1.9"><world name="w"><include><uri>x.sdf</uri></include></world></sdf>')),
    'an included MJCF file': ('x.xml', 's.xml', '<mujoco><include file="x.xml"/></mujoco>'),
    'a mesh of an MJCF file': ('x.stl', 's.xml', (
        '<mujoco><asset><mesh name="m" file="x.stl"/></asset><worldbody><body><geom type="mesh" '
        'mesh="m"/></body></worldbody></mujoco>')),
    'an included xacro file': (
        'x.xacro', 's.xacro', XACRO.format('<xacro:include filename="x.xacro"/>')),
    'numbers that a xacro file reads': ('x.yaml', 's.xacro', XACRO.format(
        '<link name="a${xacro.load_yaml(\'x.yaml\')}"/>')),
}


def told_of(folder: Path, kind: str, place: str) -> Path:
    """Return the file to read in a folder with an odd file."""
    odd, name, content = PLACES[place]
    if place == 'an SRDF file':
        odd, name, content = 'x.srdf', 's.yaml', (
            'format: 1\nmodels:\n- {name: r, file: s.urdf, srdf: x.srdf}\n')
        (folder / 's.urdf').write_text(URDF)
    KINDS[kind](folder / odd)
    if name:
        (folder / name).write_text(content)
    return folder / (name or odd)


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('place', PLACES)
def test_what_is_no_file_to_read_is_refused_in_one_line_at_once(tmp_path, kind, place) -> None:
    path = told_of(tmp_path, kind, place)
    with (limited_time(), warnings.catch_warnings(),
          pytest.raises(SceneError) as error):
        warnings.simplefilter('error')
        load_scene(path)
    text = str(error.value)
    assert '\n' not in text
    assert str(tmp_path) in text
    assert ' object at 0x' not in text


@pytest.mark.parametrize('place', [place for place, (_, name, _) in PLACES.items() if not name])
@pytest.mark.parametrize('kind', KINDS)
def test_the_commands_refuse_it_in_one_line_too(tmp_path, kind, place, capsys) -> None:
    path = told_of(tmp_path, kind, place)
    for command in (['check'], ['batch', '--duration', '1', '--output', str(tmp_path / 'bag')],
                    ['convert', '--output', '-'], ['compile']):
        with limited_time(), pytest.raises(SystemExit) as ended:
            main([command[0], str(path), *command[1:]])
        assert ended.value.code == 2
        out, err = capsys.readouterr()
        assert (out, len(err.splitlines())) == ('', 1)
