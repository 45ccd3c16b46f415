# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever numbers a scene holds: it is read, and can be saved, or refused in a line each."""

import copy
import os
from typing import Any
import warnings

from bag.hostile import limited_time
from effort import examples
from hypothesis import given, strategies as st
import pytest
import yaml

from rigid_sim_ros import World
from rigid_sim_ros.scene import read_scene, scene_from_dict, SceneError
from rigid_sim_ros.scene.catalogue import find

SHAPES: list[dict[str, Any]] = [
    {'type': 'sphere', 'radius': 0.5}, {'type': 'box', 'size': [1, 1, 1]},
    {'type': 'capsule', 'radius': 0.3, 'length': 1.0},
    {'type': 'cylinder', 'radius': 0.3, 'length': 1.0},
    {'type': 'cone', 'radius': 0.3, 'length': 1.0},
    {'type': 'ellipsoid', 'radii': [0.3, 0.4, 0.5]},
    {'type': 'points', 'positions': [[0, 0, 0], [1, 0, 0], [0, 1, 0]], 'masses': [1, 2, 3]},
    {'type': 'mesh', 'vertices': [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
     'faces': [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]}]
EXTREMES = st.sampled_from([
    0.0, -0.0, 5e-324, 1e-300, -1e-300, 1e-200, 1e-150, 1e16, 1e30, 1e150, 1e200, 1e300, -1e300,
    1.7e308, 10 ** 400])


# What stands where something else is meant, beside numbers.
ODD: list[Any] = [
    None, [], {}, True, 'x', '', '\0', 'a\nb', '*', 'world', '../../etc/passwd', '/dev/zero',
    [[[]]], [0] * 1000, {1: 2}, {'type': 'mesh', 'file': '/dev/zero'}, float('nan'), float('inf'),
    300 * 'é', b'x', 1j, (1, 2), [1e200] * 3,
    {'type': 'heightfield', 'heights': [[0, 1], [0]], 'size': [1, 1]}]


def everything(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return all places in some data but the top."""
    items = data.items() if isinstance(data, dict) else (
        enumerate(data) if isinstance(data, list) else ())
    return [place for key, value in items
            for place in [(*path, key), *everything(value, (*path, key))]]


def places(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return where there are numbers in some data."""
    items = data.items() if isinstance(data, dict) else (
        enumerate(data) if isinstance(data, list) else ())
    found = [place for key, value in items for place in places(value, (*path, key))]
    return [path] if isinstance(data, (int, float)) else found


def put(data: Any, path: tuple[Any, ...], value: object) -> None:
    for key in path[:-1]:
        data = data[key]
    data[path[-1]] = value


@examples(200)
@given(data=st.data())
def test_fuzzed_numbers_are_read_or_refused(data) -> None:
    kinds = data.draw(st.lists(st.sampled_from(SHAPES), min_size=1, max_size=3))
    bodies = [{'name': f'b{i}', 'shape': copy.deepcopy(shape),
               'pose': {'position': [i, 0, 0], 'orientation': [0, 0, 0, 1]},
               'twist': {'linear': [0, 0, 0], 'angular': [0, 0, 1]},
               **({} if shape['type'] == 'points' else {
                   data.draw(st.sampled_from(['mass', 'density'])): 1.0})}
              for i, shape in enumerate(kinds)]
    scene = {
        'world': {'step': 0.001, 'gravity': [0, 0, -9.81], 'contact': data.draw(
            st.sampled_from(['none', 'penalty', 'event', 'timestep']))},
        'materials': {'default': {'friction': 0.5, 'restitution': 0.1, 'stiffness': 1e5}},
        'bodies': bodies,
        'forces': [{'type': 'wind', 'velocity': [3, 0, 0], 'drag': 0.5},
                   {'type': 'spring', 'a': 'b0', 'b': 'world', 'anchor': [0, 0, 3],
                    'stiffness': 50, 'damping': 1, 'rest_length': 1}]}
    for _ in range(data.draw(st.integers(1, 3))):
        put(scene, data.draw(st.sampled_from(places(scene))), data.draw(EXTREMES))
    read_or_refused({'format': 1, **scene})


def read_or_refused(scene: dict[str, Any]) -> None:
    with warnings.catch_warnings(), limited_time():
        warnings.simplefilter('error')
        try:
            world = World.from_dict(scene)
            world.restore(world.save())     # or a bag of it would count as changed
        except SceneError as error:
            assert all('\n' not in str(problem) for problem in error.problems)


# With joints of all kinds, drives, loops, heights, and bodies that are moved.
EXAMPLES = ('arm', 'drone_in_wind', 'four_bar', 'gripper', 'quadruped', 'ramp', 'rover',
            'spring_pendulum', 'turntable', 'valley')


@examples(60)
@given(name=st.sampled_from(EXAMPLES), data=st.data())
def test_fuzzed_numbers_of_examples_are_read_or_refused(name, data) -> None:
    scene = yaml.safe_load(find(name).read_text(encoding='utf-8'))
    for _ in range(data.draw(st.integers(1, 3))):
        put(scene, data.draw(st.sampled_from(places(scene))), data.draw(EXTREMES))
    read_or_refused(scene)


@pytest.mark.parametrize('name, place', [
    ('turntable', ('bodies', 2, 'shape', 'size', 1)),
    ('quadruped', ('joints', 0, 'pose', 'position', 0)), ('four_bar', ('joints', 0, 'velocity')),
    ('valley', ('bodies', 0, 'shape', 'size', 0)),
    ('arm', ('bodies', 0, 'shape', 'pose', 'position', 2))])
def test_every_size_of_a_number_is_read_or_refused(name, place) -> None:
    scene = yaml.safe_load(find(name).read_text(encoding='utf-8'))
    for power in range(-320, 309, 12):
        put(scene, place, 10.0 ** power)
        read_or_refused(scene)


@examples(60)
@given(name=st.sampled_from(EXAMPLES), data=st.data())
def test_fuzzed_values_of_any_kind_are_read_or_refused(name, data) -> None:
    scene = yaml.safe_load(find(name).read_text(encoding='utf-8'))
    put(scene, data.draw(st.sampled_from(everything(scene))),
        copy.deepcopy(data.draw(st.sampled_from(ODD))))
    with warnings.catch_warnings(), limited_time():
        warnings.simplefilter('error')
        try:
            scene_from_dict(scene)
        except SceneError as error:
            assert all('\n' not in str(problem) for problem in error.problems)


@pytest.mark.parametrize('kind', ['pipe', 'device', 'folder', 'endless'])
def test_a_mesh_that_is_no_regular_file_is_refused_at_once(tmp_path, kind) -> None:
    path = tmp_path / 'part.obj'
    if kind == 'pipe':
        os.mkfifo(path)
    elif kind == 'folder':
        path.mkdir()
    else:
        path.symlink_to('/dev/zero' if kind == 'device' else '/proc/self/pagemap')
    scene = tmp_path / 'scene.yaml'
    scene.write_text('format: 1\nbodies:\n  - {name: part, density: 1.0, shape: {type: mesh, '
                     'file: part.obj}}\n')
    with pytest.raises(SceneError, match=r'part\.obj|no triangles'):
        read_scene(scene)


def test_a_mesh_outside_of_the_folder_is_told_of(tmp_path, caplog) -> None:
    (tmp_path / 'inner').mkdir()
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    (tmp_path / 'part.obj').write_text(''.join(
        [f'v {x} {y} {z}\n' for x, y, z in corners]
        + ['f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n']))
    for place, told in (('../part.obj', True), ('part.obj', False)):
        caplog.clear()
        folder = tmp_path / 'inner' if told else tmp_path
        (folder / 'scene.yaml').write_text(
            'format: 1\nbodies:\n  - {name: part, density: 1.0, shape: {type: mesh, '
            f'file: {place}}}}}\n')
        read_scene(folder / 'scene.yaml')
        assert ('outside' in caplog.text) == told
