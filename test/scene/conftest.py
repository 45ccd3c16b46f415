# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of scenes share."""

from collections.abc import Callable
from pathlib import Path

import pytest

from rigid_sim_ros.scene import read_scene, Scene, SceneError


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    """Return what writes a scene file and gives its path."""
    def write(text: str) -> Path:
        path = tmp_path / 'scene.yaml'
        path.write_text(text, encoding='utf-8')
        return path
    return write


@pytest.fixture
def read(write: Callable[[str], Path]) -> Callable[[str], Scene]:
    """Return what reads a scene from a file of this text."""
    return lambda text: read_scene(write(text))


@pytest.fixture
def problems(write: Callable[[str], Path]) -> Callable[[str], list[str]]:
    """Return what gives the lines of the error for a scene file, with its name as 'scene.yaml'."""
    def problems(text: str) -> list[str]:
        path = write(text)
        with pytest.raises(SceneError) as error:
            read_scene(path)
        return [line.replace(str(path), 'scene.yaml') for line in str(error.value).splitlines()]
    return problems
