# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Read a scene from a file, an example's name, text or a dictionary."""

from collections.abc import Mapping
import os
from pathlib import Path
import re
from typing import Any

import numpy as np
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from rigid_sim_ros.models.read import ending
from rigid_sim_ros.problems import Problem
from rigid_sim_ros.reading import bytes_of
from rigid_sim_ros.scene import catalogue, schema
from rigid_sim_ros.scene.build import build, Scene
from rigid_sim_ros.scene.document import DictSource, Source, YamlSource
from rigid_sim_ros.scene.errors import Path as Place, SceneError, shown
from rigid_sim_ros.scene.models import alone, Expansion
from rigid_sim_ros.scene.values import place
from rigid_sim_ros.scene.yaml_tree import collector_paused
from rigid_sim_ros.words import either, nearest


def read_scene(path_or_name: str | os.PathLike[str]) -> Scene:
    """
    Read a scene file, an example by its name, or the file of a model, which is alone then.

    Files that the scene refers to are looked for beside it. Raises SceneError, with file and line,
    for what cannot be used.
    """
    path = catalogue.find(path_or_name)
    if ending(path):
        with collector_paused():
            return _read(DictSource(alone(path)), path.stem, path.parent, is_alone=True)
    try:
        text = bytes_of(path).decode('utf-8-sig')
    except OSError as error:
        raise SceneError([Problem(f'cannot be read: {error.strerror}', '', str(path))]) from None
    except UnicodeDecodeError as error:
        message = f'byte {error.start} is not UTF-8, must be a text file'
        raise SceneError([Problem(message, '', str(path))]) from None
    with collector_paused():
        return _read(YamlSource(text, str(path)), path.stem, path.parent)


def scene_from_text(text: str, name: str = 'scene') -> Scene:
    """
    Read a scene from YAML that needs no file beside it, such as `Scene.text`.

    Raises SceneError, with `name` in the place of the file.
    """
    with collector_paused():
        return _read(YamlSource(text, name), name, None)


def scene_from_dict(data: Mapping[str, Any], name: str = 'scene', *,
                    may_read_files: bool = True) -> Scene:
    """
    Read a scene from Python data of the form that the YAML has.

    Mesh files are looked for in the working directory, unless a stranger says which. Raises
    SceneError without file and line.
    """
    with collector_paused():
        return _read(DictSource(data), name, Path() if may_read_files else None)


def read_parts(data: Mapping[str, Any]) -> tuple[schema.Scene, tuple[str, ...]]:
    """
    Return parts of a scene, with models as bodies and joints, and notes on these.

    Files are looked for in the working directory. Raises SceneError for what is wrong in a part or
    a model; how the parts fit together with a scene is not looked at.
    """
    # A scene has something in it, joints that come need not bring bodies.
    stand_in = [] if data.get('bodies') or data.get('models') else [{'name': 'a', 'fixed': True}]
    source = DictSource({**data, 'bodies': stand_in} if stand_in else data)
    with collector_paused(), np.errstate(all='ignore'):
        spec, notes = _validated(source), tuple[str, ...]()
        if spec.models is not None:
            expansion = Expansion(spec, Path(), source, is_alone=False)
            spec, notes = expansion.merged(spec, _validated(expansion)), tuple(expansion.notes)
    return spec.model_copy(update={'bodies': ()}) if stand_in else spec, notes


def _read(source: Source, name: str, folder: Path | None, *, is_alone: bool = False) -> Scene:
    # What leaves the range of numbers is reported as a problem of the scene, with its place.
    with np.errstate(all='ignore'):
        spec = _validated(source)
        if spec.models is None:
            return build(spec, name, folder, source)
        expansion = Expansion(spec, folder, source, is_alone=is_alone)
        spec = expansion.merged(spec, _validated(expansion))
        return build(spec, name, folder, expansion.in_scene(), tuple(expansion.notes))


def _validated(source: Source) -> schema.Scene:
    classes: dict[int, type[schema.Spec]] = {}
    try:
        return schema.Scene.model_validate(source.data, context=classes)
    except ValidationError as error:
        details = error.errors(include_url=False)
    # A list whose entries are all wrong is not also empty, though pydantic says so.
    raise SceneError(_problem(detail, source, classes) for detail in details
                     if not (detail['type'] == 'too_short' and detail['input']))


def _problem(detail: ErrorDetails, source: Source,
             classes: dict[int, type[schema.Spec]]) -> Problem:
    """Say in our words what pydantic found, where the user wrote it."""
    # pydantic marks the choice of a class and the check of a key by steps that are not in the
    # file.
    path: Place = tuple(step for step in detail['loc'] if not _is_mark(step))
    value, context = detail['input'], detail.get('ctx', {})
    match detail['type']:
        case 'scene':
            return source.problem((*path, *place(context)), context['text'])
        case 'missing':
            message = 'is missing, must be given'
        case 'extra_forbidden':
            keys = classes[id(_at(source.data, path[:-1]))].model_fields
            message = f'unknown key {shown(path[-1])}, {nearest(path[-1], keys)}'
        case 'union_tag_invalid':
            kinds = re.findall('<(.*?)>', context['expected_tags'])
            return _kind_problem(source, path, value, kinds)
        case 'model_type' | 'dict_type':
            message = f'{shown(value)}, must be a mapping of keys to values'
        case 'tuple_type':
            message = f'{shown(value)}, must be a list'
        case _:
            message = f'{shown(value)}: {detail["msg"]}'
    return source.problem(path, message)


def _kind_problem(source: Source, path: Place, value: Any, kinds: list[str]) -> Problem:
    """Say what is wrong with the key `type` of a shape or a force."""
    if not isinstance(value, dict):
        return source.problem(path, f'{shown(value)}, must be a mapping with a type')
    if 'type' not in value:
        return source.problem(path, f'has no type, must be {either(kinds)}')
    kind = value['type']
    return source.problem((*path, 'type'), f'{shown(kind)}, {nearest(kind, kinds)}')


def _is_mark(step: str | int) -> bool:
    return isinstance(step, str) and (step == '[key]' or (step[:1] + step[-1:]) == '<>')


def _at(data: Any, path: Place) -> Any:
    for step in path:
        data = data[step]
    return data
