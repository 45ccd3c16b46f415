# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Heightfields and meshes that are not convex, as files and as text: read, or refused."""

import os
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
import pytest

from rigid_sim_ros.scene import read_scene, scene_from_text, SceneError

HEIGHTS = np.array([[0.0, 0.1, 0.2, 0.3], [1.0, 1.1, 1.2, 1.3], [2.0, 2.1, 2.2, 2.3]])
OPEN = 'vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces: [[0, 1, 2]]'


def scene(folder: Path, shape: str, body: str = 'fixed: true') -> Path:
    """Write a scene of one body, and return its path."""
    path = folder / 'scene.yaml'
    path.write_text(f'bodies:\n- name: ground\n  {body}\n  shape: {{{shape}}}\n')
    return path


def heights_in(path: Path) -> np.ndarray:
    """Return the heights that a scene has after it was read."""
    part: Any = read_scene(path).spec.bodies[0].shape
    return np.array(part.heights)


def refusal(path: Path) -> str:
    """Return the message with which a scene is refused."""
    with pytest.raises(SceneError) as error:
        read_scene(path)
    return str(error.value)


def test_heights_come_from_csv_and_npy_with_the_first_row_at_the_least_y(tmp_path):
    np.savetxt(tmp_path / 'a.csv', HEIGHTS, delimiter=',')
    np.save(tmp_path / 'a.npy', HEIGHTS)
    for name in ('a.csv', 'a.npy'):
        path = scene(tmp_path, f'type: heightfield, file: {name}, size: [3, 2]')
        assert heights_in(path) == pytest.approx(HEIGHTS, abs=1e-15)
        part: Any = read_scene(path).spec.bodies[0].shape
        vertices = {tuple(vertex) for vertex in np.round(part.vertices, 12).tolist()}
        assert {(-1.5, -1.0, 0.0), (1.5, -1.0, 0.3), (-1.5, 1.0, 2.0), (1.5, 1.0, 2.3)} <= vertices


@pytest.mark.parametrize(('mode', 'white'), [('L', 255), ('I;16', 65535)])
def test_a_picture_is_shares_of_the_third_length_with_its_top_at_the_greatest_y(
        tmp_path, mode, white):
    grey = np.array([[0, white], [white // 5, white // 3]])
    Image.fromarray(grey.astype(np.uint8 if mode == 'L' else np.uint16)).save(tmp_path / 'a.png')
    path = scene(tmp_path, 'type: heightfield, file: a.png, size: [1, 1, 6]')
    assert heights_in(path) == pytest.approx(np.array([[1.2, 2.0], [0.0, 6.0]]), abs=1e-12)


def test_a_scene_that_was_read_needs_no_file_and_is_the_same_from_its_text(tmp_path):
    np.save(tmp_path / 'a.npy', HEIGHTS)
    read = read_scene(scene(tmp_path, 'type: heightfield, file: a.npy, size: [3, 2, 0.5]'))
    assert 'a.npy' not in read.text
    again = scene_from_text(read.text)
    assert again.text == read.text
    assert np.array_equal(again.shapes.hulls.vertices, read.shapes.hulls.vertices)


@pytest.mark.parametrize('shape', [
    'type: heightfield, heights: [[0, 0], [0, 0]], size: [1, 1]',
    f'type: mesh, {OPEN}, convex: false'])
def test_only_what_nothing_pushes_has_a_ground(tmp_path, shape):
    assert 'must be fixed: true or kinematic: true' in refusal(scene(tmp_path, shape, 'mass: 1'))
    read_scene(scene(tmp_path, shape, 'kinematic: true'))


@pytest.mark.parametrize(('shape', 'says'), [
    ('heights: [[0, 0]], size: [1, 1]', 'must be two or more rows of two or more heights'),
    ('heights: [[0], [0]], size: [1, 1]', 'must be two or more rows of two or more heights'),
    ('heights: 3, size: [1, 1]', 'must be two or more rows of two or more heights'),
    ('heights: [[0, 0], [0, 0, 0]], size: [1, 1]', '3 heights, must be 2 as in the first row'),
    ('heights: [[0, 0], [0, .nan]], size: [1, 1]', 'must be finite'),
    ('heights: [[0, 0], [0, x]], size: [1, 1]', 'must be a number in m'),
    ('heights: 0 0 0 0, size: [1, 1]', 'must be two or more rows of two or more heights'),
    ('heights: [[0, 0], [0, 0]], size: [1, 0]', 'must be > 0'),
    ('heights: [[0, 0], [0, 0]], size: 1', 'must be 2 numbers [x, y] m'),
    ('heights: [[0, 0], [0, 0]]', 'size'),
    ('size: [1, 1]', 'must have a file, or heights'),
    ('heights: [[0, 0], [0, 0]], file: a.csv, size: [1, 1]', 'must have a file, or heights'),
    ('file: none.csv, size: [1, 1]', 'none.csv cannot be read: No such file'),
    ('file: a.tif, size: [1, 1]', 'must be a CSV, NPY or PNG file'),
    ('file: text.csv, size: [1, 1]', 'text.csv holds no heights that can be read'),
    ('file: text.npy, size: [1, 1]', 'text.npy holds no heights that can be read'),
    ('file: text.png, size: [1, 1]', 'text.png'),
    ('file: row.csv, size: [1, 1]', 'must be two rows of two or more'),
    ('file: nan.csv, size: [1, 1]', 'a height is not finite'),
    ('file: many.npy, size: [1, 1]', 'heights, must be 100000 or fewer'),
    ('file: many.png, size: [1, 1, 1]', 'heights, must be 100000 or fewer')])
def test_what_makes_no_heights_is_refused_with_its_mend(tmp_path, shape, says):
    for kind in ('csv', 'npy', 'png'):
        (tmp_path / f'text.{kind}').write_text('some words\n')
    (tmp_path / 'row.csv').write_text('1,2,3\n')
    (tmp_path / 'nan.csv').write_text('1,2\n3,nan\n')
    np.save(tmp_path / 'many.npy', np.zeros((400, 400)))
    Image.fromarray(np.zeros((400, 400), dtype=np.uint8)).save(tmp_path / 'many.png')
    message = refusal(scene(tmp_path, f'type: heightfield, {shape}'))
    assert says in message
    assert len(message.splitlines()) == 1


@pytest.mark.parametrize(('shape', 'says'), [
    ('vertices: [[0, 0, 0], [1, 0, 0], [2, 0, 0]], faces: [[0, 1, 2]]',
     'no triangle with an area'),
    ('vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces: [[0, 1, 3]]', 'must be below 3'),
    ('vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces: [[0, 1, 1]]',
     'no triangle with an area')])
def test_what_makes_no_surface_is_refused_with_its_mend(tmp_path, shape, says):
    assert says in refusal(scene(tmp_path, f'type: mesh, {shape}, convex: false'))


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / 'a.csv')
    assert 'not a regular file' in refusal(
        scene(tmp_path, 'type: heightfield, file: a.csv, size: [1, 1]'))


def test_a_pickle_in_a_file_of_heights_is_not_run(tmp_path):
    np.save(tmp_path / 'a.npy', np.array([[print, 1], [1, 1]], dtype=object), allow_pickle=True)
    assert 'holds no heights' in refusal(
        scene(tmp_path, 'type: heightfield, file: a.npy, size: [1, 1]'))


def test_what_has_no_place_may_name_no_file():
    shape = '{type: heightfield, file: a.csv, size: [1, 1]}'
    with pytest.raises(SceneError, match='not beside the scene, must be heights in it'):
        scene_from_text(f'bodies: [{{name: a, fixed: true, shape: {shape}}}]')
