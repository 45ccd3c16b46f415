# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What `rigid_sim render` does and prints; returns the exit code."""

from collections.abc import Iterator, Sequence
from pathlib import Path
import time
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.progress import track

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.motion import Array, Motion, read_motion
from rigid_sim_ros.problems import counted
from rigid_sim_ros.render.window import choose_window
from rigid_sim_ros.scene import Scene

_FILM, _FRAME = '.mp4', '.png'
_MOST_VIEWS = 400       # rows of the motion that decide where the camera stands


def run_render(bag: str, output: str, *, at: float | None = None, start: float = 0.0,
               duration: float | None = None, fps: float = 30.0, speed: float = 1.0,
               size: tuple[int, int] = (960, 540), camera: Sequence[float] | None = None,
               look_at: Sequence[float] | None = None) -> int:
    """Draw a bag as a film, or one moment of it as a picture, and say what was drawn."""
    path = Path(output)
    if path.suffix.lower() not in (_FILM, _FRAME):
        raise BagError(f'--output {output}, must end in {_FILM} or {_FRAME}')
    is_film = path.suffix.lower() == _FILM
    if is_film and at is not None:
        raise BagError(f'--at is for one picture, {_FRAME}: a film takes --start and --duration')
    if not path.parent.is_dir():
        raise BagError(f'--output {output}: there is no folder {path.parent}')
    motion = read_motion(bag)
    if motion.scene is None:
        raise BagError(f'{bag} has no scene, only poses: render draws the shapes of a scene; '
                       '`rigid_sim plot` shows the poses')
    begin, end = _span(motion, start if at is None else at, duration if is_film else 0.0)
    _check_libraries()
    choose_window()
    from rigid_sim_ros.render.stage import Stage

    view = _view(motion, motion.scene, begin, end, size, camera, look_at)
    clock = time.monotonic()
    stage = Stage(motion.scene, view, size)
    try:
        if is_film:
            times = np.arange(begin, end + 1e-9, speed / fps)
            count = _write_film(path, stage, motion, times, fps, size)
        else:
            _write_picture(path, stage, motion, begin)
    except OSError as error:
        raise BagError(f'{error.filename or path}: {error.strerror or error}') from None
    finally:
        stage.close()
    seconds = time.monotonic() - clock
    what = (f'{counted(count, "picture")}, {begin:g} to {end:g} s, '
            f'{count / seconds:.1f} pictures a second'
            if is_film else f'{motion.scene.name} at {begin:g} s')
    click.echo(f'{path}: {what}')
    return 0


def _check_libraries() -> None:
    try:
        import av  # noqa: F401
        import pyvista  # noqa: F401
    except ImportError as error:
        raise BagError("render needs PyVista and PyAV: `pip install 'rigid_sim_ros[render]'`, or "
                       f'`pip install pyvista av` ({error})') from None


def _span(motion: Motion, start: float, duration: float | None) -> tuple[float, float]:
    """Return the times of the first picture and the last; `start` counts from the first state."""
    first, last = float(motion.time[0]), float(motion.time[-1])
    begin = first + start
    if begin > last + 1e-9:
        raise BagError(f'{start:g} s: the bag is {last - first:g} s long')
    return begin, last if duration is None else min(last, begin + duration)


def _view(motion: Motion, scene: Scene, begin: float, end: float, size: tuple[int, int],
          camera: Sequence[float] | None, look_at: Sequence[float] | None) -> Any:
    from rigid_sim_ros.render.solids import extents
    from rigid_sim_ros.render.stage import at_hand, automatic_view

    bodies = [k for k, body in enumerate(scene.spec.bodies) if not body.fixed]
    bodies = bodies or list(range(len(motion.names)))
    rows = np.flatnonzero((motion.time >= begin - 1e-9) & (motion.time <= end + 1e-9))
    rows = rows[::max(1, len(rows) // _MOST_VIEWS)]
    positions = motion.position[rows] if len(rows) else pose_at(motion, begin)[0][None]
    view = automatic_view(positions[:, bodies], extents(scene)[bodies], size[0] / size[1])
    if look_at is not None:
        target = np.array(look_at, dtype=np.float64)
        view = view._replace(target=target, eye=view.eye - view.target + target)
    if camera is not None:
        view = view._replace(eye=np.array(camera, dtype=np.float64))
        if not np.linalg.norm(view.eye - view.target) > 0.0:
            raise BagError(f'--camera {tuple(camera)} is where it looks at: choose another place')
        view = at_hand(view)
    return view


def _write_film(path: Path, stage: Any, motion: Motion, times: Array, fps: float,
                size: tuple[int, int]) -> int:
    from rigid_sim_ros.render.film import write_film

    def pictures() -> Iterator[Any]:
        console = Console(stderr=True)
        for at in track(times, str(path), console=console, transient=True,
                        disable=not console.is_terminal):
            yield stage.picture(*pose_at(motion, at))

    return write_film(path, pictures(), fps, size)


def _write_picture(path: Path, stage: Any, motion: Motion, at: float) -> None:
    from PIL import Image

    Image.fromarray(stage.picture(*pose_at(motion, at))).save(path, optimize=True)


def pose_at(motion: Motion, at: float) -> tuple[Array, Array]:
    """
    Return positions (n, 3) and orientations (n, 4) at a time [s], between two states if need be.

    Across a reset nothing is in between: the state before it holds until then.
    """
    after = int(np.clip(np.searchsorted(motion.time, at - 1e-9), 0, len(motion.time) - 1))
    before = max(0, after - 1)
    span = motion.time[after] - motion.time[before]
    if motion.time[after] <= at + 1e-9 or span <= 0.0:
        before = after
    elif after in motion.resets:
        after = before
    share = (at - motion.time[before]) / span if before != after else 0.0
    p = (1.0 - share) * motion.position[before] + share * motion.position[after]
    a, b = motion.orientation[before], motion.orientation[after]
    # The two are near each other: the chord differs from the arc by the cube of a small angle.
    b = np.where((a * b).sum(axis=1, keepdims=True) < 0.0, -b, b)
    q = (1.0 - share) * a + share * b
    return p, q / np.linalg.norm(q, axis=1, keepdims=True)
