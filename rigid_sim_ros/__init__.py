# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Rigid bodies that live in a ROS 2 node, or in your own Python program.

>>> from rigid_sim_ros import load_scene
>>> world = load_scene('tumbling_cubesat')
>>> world.step(1000)
"""
from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from rigid_sim_ros.scene.errors import SceneError
    from rigid_sim_ros.world import load_scene, World

__all__ = ['SceneError', 'World', '__version__', 'load_scene']

__version__ = '0.1.0'

# Imported when first asked for: the engine brings Numba, which takes longer to import than
# `rigid_sim --help` takes to run.
_HOME = {
    'SceneError': 'rigid_sim_ros.scene.errors',
    'World': 'rigid_sim_ros.world',
    'load_scene': 'rigid_sim_ros.world',
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
