# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The example scenes that ship with the package, by name."""

from importlib.resources import files
import os
from pathlib import Path
import stat

from rigid_sim_ros.problems import Problem
from rigid_sim_ros.scene.errors import SceneError
from rigid_sim_ros.words import nearest

# What `rigid_sim run` shows without a scene, as msg_config/default.yaml says too.
DEFAULT_SCENE = 'tower'

_KINDS = {stat.S_IFDIR: 'a folder', stat.S_IFIFO: 'a pipe', stat.S_IFCHR: 'a device',
          stat.S_IFBLK: 'a device', stat.S_IFSOCK: 'a socket'}

_FOLDER = Path(str(files('rigid_sim_ros'))) / 'example_scenes'


def example_names() -> list[str]:
    """Return the names of the example scenes, in order of the alphabet."""
    return sorted(path.stem for path in _FOLDER.glob('*.yaml'))


def describe(name: str) -> str:
    """Return the first line of an example's header comment: what one sees."""
    first, *_ = find(name).read_text(encoding='utf-8').splitlines()
    return first.lstrip('# ')


def find(path_or_name: str | os.PathLike[str]) -> Path:
    """
    Return the file of a scene given by its path or, for an example, by its name.

    A file in the working directory comes before an example of the same name. Raises SceneError,
    with the nearest name, when there is neither.
    """
    path = Path(path_or_name)
    names = example_names()
    # os.path, since a path with a NUL character is an error to pathlib before Python 3.12.
    if os.path.isfile(path):
        return path
    if str(path) in names:
        return _FOLDER / f'{path}.yaml'
    message = f'is neither a scene file nor an example, {nearest(path, names)}'
    if os.path.lexists(path):
        message = f'is {_kind(path)}, must be the file of a scene or a model'
    raise SceneError([Problem(message, '', str(path))])


def _kind(path: Path) -> str:
    """Return what there is in the place of a file."""
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return 'a link to nothing'
    return _KINDS.get(stat.S_IFMT(mode), 'no regular file')
