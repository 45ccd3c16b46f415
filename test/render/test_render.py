# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures and films of real bags, opened again: what is to be seen, and where."""
from functools import cache
from pathlib import Path
import subprocess
import sys
from unittest import SkipTest

from bag import sessions
import fresh
import numpy as np
from PIL import Image
import pytest

from rigid_sim_ros import cli
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.motion import read_motion
from rigid_sim_ros.render import window
from rigid_sim_ros.render.command import pose_at
from rigid_sim_ros.world import World

av = pytest.importorskip('av', reason="PyAV is not installed: pip install '.[render]'")
try:
    window.choose_window()
except BagError as error:
    raise SkipTest(str(error)) from None

RED, GREEN, BLUE = [0.9, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.2, 0.9]
V, RADIUS = 1.0, 0.25
EYE, TARGET = np.array([0.0, -6.0, 2.0]), np.array([0.0, 0.0, 1.0])
CAMERA = ['--camera', *EYE, '--look-at', *TARGET]
SIZE = (320, 240)
SCENE = {
    'format': 1,
    'world': {'contact': 'none', 'gravity': [0, 0, 0]},
    'bodies': [
        {'name': 'floor', 'shape': {'type': 'plane'}, 'fixed': True},
        {'name': 'ball', 'shape': {'type': 'sphere', 'radius': RADIUS}, 'mass': 1.0,
         'color': RED, 'pose': {'position': [-1, 0, 1]}, 'twist': {'linear': [V, 0, 0]}},
        {'name': 'rod', 'shape': {'type': 'box', 'size': [1.2, 0.1, 0.1]}, 'mass': 1.0,
         'color': GREEN, 'pose': {'position': [0, 0, 1.8]}, 'twist': {'angular': [0, -1, 0]}},
    ],
}


@cache
def bag():
    """Record two seconds in which a ball crosses the picture and a rod turns in its plane."""
    folder = sessions.lasting_folder() / 'crossing'
    batch = Batch(World.from_dict(SCENE), folder)
    batch.run(2000)
    batch.close()
    return folder


def run(*words):
    """Run the command line in this process; stdout and stderr go to pytest's capture."""
    with pytest.raises(SystemExit) as left:
        cli.main([str(word) for word in words])
    return left.value.code


def picture(tmp_path, *words, of=None):
    path = tmp_path / 'a.png'
    assert run('render', of or bag(), '--output', path, '--size', '320x240', *words) == 0
    with Image.open(path) as image:
        return np.asarray(image.convert('RGB')).astype(float)


def mask(pixels, color):
    """Return where a picture has about the hue of a colour, in the light or not."""
    chosen = int(np.argmax(color))
    others = np.delete(pixels, chosen, axis=2).max(axis=2)
    return pixels[:, :, chosen] > 1.8 * others


def middle(where):
    rows, columns = np.nonzero(where)
    return np.array([columns.mean(), rows.mean()])


def seen_at(point):
    """Return where a point appears: a pinhole of 30 degrees of height, in pixels."""
    forward = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    x, y, z = (np.asarray(point, dtype=float) - EYE) @ np.array([right, up, forward]).T
    scale = SIZE[1] / 2 / np.tan(np.radians(15))
    return np.array([SIZE[0] / 2 + scale * x / z, SIZE[1] / 2 - scale * y / z]) - 0.5


@pytest.mark.parametrize('at', [0.0, 0.5, 1.7])
def test_a_ball_appears_where_the_camera_sees_it(at, tmp_path):
    pixels = picture(tmp_path, '--at', at, *CAMERA)
    assert pixels.shape == (240, 320, 3)
    # The outline of a ball beside the axis is an ellipse a little farther out: 1 pixel.
    assert middle(mask(pixels, RED)) == pytest.approx(seen_at([-1 + V * at, 0, 1]), abs=1.5)


def test_a_ball_is_as_large_as_the_camera_sees_it(tmp_path):
    pixels = picture(tmp_path, '--at', 1, *CAMERA)
    scale = SIZE[1] / 2 / np.tan(np.radians(15))
    distance = np.linalg.norm(TARGET - EYE)
    radius = scale * np.tan(np.arcsin(RADIUS / distance))
    assert mask(pixels, RED).sum() == pytest.approx(np.pi * radius ** 2, rel=0.05)


@pytest.mark.parametrize('at', [0.3, 1.0])
def test_a_body_is_drawn_in_its_orientation(at, tmp_path):
    rows, columns = np.nonzero(mask(picture(tmp_path, '--at', at, *CAMERA), GREEN))
    slope = np.polyfit(columns, rows, 1)[0]
    # It turns with 1 rad/s about -y: from +x towards +z, upwards in the picture, whose plane is
    # inclined by atan(1 / 6).
    assert -slope == pytest.approx(np.tan(at) * np.cos(np.arctan(1 / 6)), rel=0.08)


def test_a_ball_throws_a_shadow_on_the_floor(tmp_path):
    pixels = picture(tmp_path, '--at', 1, *CAMERA)
    # The light goes along (0.45, 0.3, -1): the shadow lies as far aside as the ball is high.
    foot = np.array([0.45, 0.30, 0.0])
    column, row = np.round(seen_at(foot)).astype(int)
    beside, row_beside = np.round(seen_at([1.45, 0.30, 0.0])).astype(int)
    assert pixels[row, column].mean() < 0.9 * pixels[row_beside, beside].mean()


def test_the_floor_lies_where_the_plane_is(tmp_path):
    pixels = picture(tmp_path, '--at', 1, *CAMERA)
    # Twice as high it would be in the plane of the camera, and all below it background.
    near, far = (np.round(seen_at([0.0, y, 0.0])).astype(int) for y in (-1.0, 1000.0))
    assert near[1] > far[1] > 0
    assert np.abs(pixels[near[1], near[0]] - pixels[2, near[0]]).max() > 20


def test_without_a_camera_all_that_moves_is_in_the_picture(tmp_path):
    pixels = picture(tmp_path, '--at', 0)
    for color in (RED, GREEN):
        found = mask(pixels, color)
        assert found.sum() > 300
        edge = np.concatenate([found[0], found[-1], found[:, 0], found[:, -1]])
        assert not edge.any()


def film(path, *words):
    assert run('render', bag(), '--output', path, '--size', '320x240', *words) == 0
    with av.open(str(path)) as file:
        stream, = file.streams
        frames = [frame.to_ndarray(format='rgb24').astype(float) for frame in file.decode(stream)]
        return frames, float(stream.average_rate), stream.codec_context.name


def test_a_film_has_its_pictures_and_they_move(tmp_path, capsys):
    frames, rate, codec = film(tmp_path / 'a.mp4', '--fps', 10, *CAMERA)
    assert (len(frames), rate, codec) == (21, 10.0, 'h264')
    assert '21 pictures' in ''.join(capsys.readouterr())
    assert frames[0].shape == (240, 320, 3)
    places = [middle(mask(frame, RED))[0] for frame in frames]
    expected = [seen_at([-1 + V * k / 10, 0, 1])[0] for k in range(21)]
    assert places == pytest.approx(expected, abs=2.0)       # H.264 halves the colours


def test_a_film_of_a_part_in_slow_motion(tmp_path):
    frames, _, _ = film(tmp_path / 'a.mp4', '--start', 1, '--duration', 0.5, '--speed', 0.25,
                        '--fps', 10, *CAMERA)
    assert len(frames) == 21        # 0.5 s at a quarter of the speed are 2 s
    last = middle(mask(frames[-1], RED))[0]
    assert last == pytest.approx(seen_at([-1 + 1.5 * V, 0, 1])[0], abs=2.0)


def test_between_two_states_bodies_are_in_between():
    motion = read_motion(bag())
    p, q = pose_at(motion, 0.5037)
    assert p[1] == pytest.approx([-1 + 0.5037 * V, 0, 1])
    # Half the angle; the chord of 0.01 rad differs from the arc by less than 1e-7.
    assert q[2] == pytest.approx([0, -np.sin(0.5037 / 2), 0, np.cos(0.5037 / 2)], abs=1e-7)


def test_across_a_reset_nothing_is_in_between():
    motion = read_motion(sessions.shared_session())
    row = motion.resets[0]
    just_before = motion.time[row - 1] + 1e-4 if motion.time[row] > motion.time[row - 1] else (
        motion.time[row - 1])
    before = pose_at(motion, just_before)[0]
    assert (before == motion.position[row - 1]).all() or (before == motion.position[row]).all()


# --- mistakes -----------------------------------------------------------------------------------


@pytest.mark.parametrize('words, mend', [
    (['--output', 'a.gif'], '--output a.gif, must end in .mp4 or .png'),
    (['--output', 'a.mp4', '--at', '1'], '--at is for one picture'),
    (['--output', 'no/a.png'], 'there is no folder no'),
    (['--output', 'a.png', '--at', '9'], '9 s: the bag is 2 s long'),
    (['--output', 'a.mp4', '--size', '321x240'], 'must be two even numbers from 16 to 8192'),
    (['--output', 'a.mp4', '--size', 'big'], "'big', must be WIDTHxHEIGHT"),
    (['--output', 'a.png', '--camera', '1', '1', '1', '--look-at', '1', '1', '1'],
     'is where it looks at'),
], ids=str)
def test_a_mistake_is_one_line_and_exit_code_2(words, mend, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = run('render', bag(), *words)
    captured = capsys.readouterr()
    assert (code, captured.out, captured.err.count('\n')) == (2, '', 1)
    assert mend in captured.err


def test_a_machine_that_cannot_draw_is_told_what_to_install(tmp_path, capsys, monkeypatch):
    monkeypatch.delenv('VTK_DEFAULT_OPENGL_WINDOW')
    monkeypatch.setattr(window, '_WINDOWS', dict.fromkeys(window._WINDOWS, lambda: False))
    assert run('render', bag(), '--output', tmp_path / 'a.png') == 2
    line = capsys.readouterr().err
    assert line.count('\n') == 1
    assert 'apt install libegl1' in line


@pytest.mark.parametrize('library', ['pyvista', 'av'])
def test_a_missing_library_is_named_with_what_brings_it(library, tmp_path):
    code = f"""
import sys
sys.modules['{library}'] = None
from rigid_sim_ros.cli import main
main(['render', '{bag()}', '--output', '{tmp_path / "a.png"}'])
"""
    result = fresh.run('-c', code)
    assert (result.returncode, result.stderr.count('\n')) == (2, 1)
    assert "`pip install 'rigid_sim_ros[render]'`" in result.stderr


def test_no_display_is_needed_and_nothing_is_said_but_what_was_drawn(tmp_path):
    environment = {'PATH': '/usr/bin:/bin', 'HOME': str(Path.home())}
    result = subprocess.run(
        [sys.executable, '-m', 'rigid_sim_ros', 'render', str(bag()), '--output',
         str(tmp_path / 'a.png'), '--at', '1'],
        env=environment, capture_output=True, text=True, check=False, timeout=300)
    assert (result.returncode, result.stderr) == (0, '')
    assert result.stdout == f'{tmp_path / "a.png"}: scene at 1 s\n'
