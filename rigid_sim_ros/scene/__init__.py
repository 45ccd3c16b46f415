# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Scenes: a YAML file, checked, becomes the model and the first state of a world.

Text -> data with lines (document.py) -> description (schema.py, values.py) -> what fits together
(build.py, mass.py, mesh.py, forces.py) -> Scene.
"""

from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from rigid_sim_ros.scene.build import Scene
    from rigid_sim_ros.scene.catalogue import DEFAULT_SCENE, describe, example_names
    from rigid_sim_ros.scene.errors import SceneError
    from rigid_sim_ros.scene.reader import read_scene, scene_from_dict, scene_from_text

__all__ = ['DEFAULT_SCENE', 'Scene', 'SceneError', 'describe', 'example_names', 'read_scene',
           'scene_from_dict', 'scene_from_text']

# Imported when first asked for: a command that only needs the error or the list of examples does
# not wait for the engine.
_HOME = {
    'DEFAULT_SCENE': 'catalogue',
    'Scene': 'build',
    'SceneError': 'errors',
    'describe': 'catalogue',
    'example_names': 'catalogue',
    'read_scene': 'reader',
    'scene_from_dict': 'reader',
    'scene_from_text': 'reader',
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOME[name]}'), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
