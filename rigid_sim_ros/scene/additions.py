# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Parts that come to a scene and parts that go from it, as data in the words of a scene.

A part that comes is a dict as in `bodies`, `joints` or `models`, or several of them under these
keys. What a model's file says is read once: afterwards the part is bodies and joints.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rigid_sim_ros.problems import Problem
from rigid_sim_ros.scene.errors import SceneError, shown
from rigid_sim_ros.scene.reader import read_parts
from rigid_sim_ros.scene.schema import Scene
from rigid_sim_ros.words import matching, nearest

# What a part of several may have. `collision` has the pairs of `ignore` alone.
LISTS = ('bodies', 'joints')
_KEYS = (*LISTS, 'models', 'collision', 'descriptions')


def parts_of(part: Any) -> dict[str, Any]:
    """
    Return a part that comes by the keys that a scene has for it.

    A dict with a `file` is a model, one with a `parent` or a `child` a joint, one with `bodies`,
    `joints` or `models` has several, any other is a body. SceneError for keys that parts cannot
    have.
    """
    kind = 'bodies'
    if isinstance(part, Mapping):
        if 'file' in part:      # with positions of its `joints`
            kind = 'models'
        elif 'parent' in part or 'child' in part:
            kind = 'joints'
        elif any(key in part for key in (*LISTS, 'models')):
            _check_keys(part)
            return dict(part)
    return {kind: [part]}


def read_part(part: Any) -> tuple[Scene, tuple[str, ...]]:
    """
    Return a part that comes, with models as bodies and joints, and notes on these.

    Files are looked for in the working directory. SceneError for what is wrong with it.
    """
    return read_parts(parts_of(part))


def _check_keys(parts: Mapping[str, Any]) -> None:
    """Raise SceneError for keys that make no part of a scene."""
    for key in parts:
        if key not in _KEYS:
            raise SceneError([Problem(f'unknown key {shown(key)} of parts that come, '
                                      f'{nearest(key, _KEYS)}')])
    collision = parts.get('collision', {})
    if not isinstance(collision, Mapping) or set(collision) - {'ignore'}:
        raise SceneError([Problem(f'{shown(collision)}, must be a mapping with nothing but '
                                  'ignore: the rest is of the whole scene', 'collision')])


def written(parts: Scene) -> dict[str, Any]:
    """
    Return parts as data that can be read anywhere, if their meshes are in them.

    They have all defaults. One body or one joint alone is just that.
    """
    own: dict[str, Any] = {key: found for key in LISTS if (found := [
        one.model_dump(mode='json', exclude_none=True) for one in getattr(parts, key) or ()])}
    if parts.collision.ignore:
        own['collision'] = {'ignore': [list(pair) for pair in parts.collision.ignore]}
    if parts.descriptions:
        own['descriptions'] = dict(parts.descriptions)
    if sum(len(found) for found in own.values()) == 1 and not set(own) - set(LISTS):
        (one,), = own.values()
        return dict(one)
    return own


def names_a_file(part: Any) -> bool:
    """Return whether a part needs a file beside it, which a stranger's must not name."""
    waiting = [part]
    while waiting:
        one = waiting.pop()
        if isinstance(one, Mapping):
            if one.get('file') is not None:
                return True
            waiting += one.values()
        elif isinstance(one, list | tuple):
            waiting += one
    return False


def with_parts(scene: Mapping[str, Any], part: Any) -> dict[str, Any]:
    """Return a scene, as data, with a part that came, of which `written` returned the data."""
    parts = parts_of(part)
    result = dict(scene)
    for key in LISTS:
        if parts.get(key):
            result[key] = [*(result.get(key) or ()), *_listed(key, parts[key])]
    if pairs := (parts.get('collision') or {}).get('ignore'):
        collision = dict(result.get('collision', {}))
        collision['ignore'] = [*collision.get('ignore', ()),
                               *_listed('collision.ignore', pairs)]
        result['collision'] = collision
    if texts := parts.get('descriptions'):
        result['descriptions'] = {**(result.get('descriptions') or {}), **texts}
    return result


def _listed(key: str, value: Any) -> list[Any]:
    if not isinstance(value, list | tuple):
        raise SceneError([Problem(f'{shown(value)}, must be a list', key)])
    return list(value)


def without(scene: Mapping[str, Any], name: str) -> dict[str, Any]:
    """
    Return a scene, as data, without a body, a joint or all of a model, whichever has the name.

    With a body go joints that hold it, forces that act on it by name, and the pairs that it is in;
    with a joint the couplings of joints that mimic it. ValueError for what is not there.
    """
    bodies, joints = scene['bodies'], list(scene.get('joints') or ())
    of_model = f'{name}/'
    gone = {body['name'] for body in bodies if body['name'] == name}
    lost = set() if gone else {joint['name'] for joint in joints if joint['name'] == name}
    if not gone and not lost:
        gone = {body['name'] for body in bodies if body['name'].startswith(of_model)}
        lost = {joint['name'] for joint in joints if joint['name'].startswith(of_model)}
    if not gone and not lost:
        raise ValueError(f'{name!r} cannot go: no body, joint or model has this name')
    lost |= {joint['name'] for joint in joints
             if joint['parent'] in gone or joint['child'] in gone}
    result = dict(scene)
    result['bodies'] = [body for body in bodies if body['name'] not in gone]
    if 'joints' in result:
        result['joints'] = _joints_without(joints, lost)
    frames = {frame if '/' in frame else f'{body["name"]}/{frame}' for body in bodies
              if body['name'] in gone for frame in body.get('frames', ())} | gone
    left = [body['name'] for body in result['bodies']]
    result['forces'] = [rest for force in scene.get('forces', ())
                        if (rest := _force_without(force, frames, left)) is not None]
    collision = dict(scene.get('collision', {}))
    collision['ignore'] = [pair for pair in collision.get('ignore', ())
                           if not gone.intersection(pair)]
    result['collision'] = collision
    _drop_descriptions(result, [*gone, *lost])
    return {key: value for key, value in result.items() if value or key not in (
        'joints', 'descriptions')}


def _joints_without(joints: Sequence[Mapping[str, Any]], lost: set[str],
                    ) -> list[Mapping[str, Any]]:
    """Return the joints that are left; one that mimicked another begins where that had it."""
    by_name = {joint['name']: joint for joint in joints}
    left = []
    for joint in joints:
        if joint['name'] in lost:
            continue
        if joint.get('mimic') and joint['mimic']['joint'] in lost:
            begin = _start(joint, by_name)
            joint = {key: value for key, value in joint.items() if key != 'mimic'}
            joint['position'] = begin
        left.append(joint)
    return left


def _start(joint: Mapping[str, Any], by_name: Mapping[str, Mapping[str, Any]]) -> float:
    """Return the position of a joint at the start."""
    if joint.get('position') is None and joint.get('mimic'):
        mimic = joint['mimic']
        return float(mimic.get('multiplier', 1.0) * _start(by_name[mimic['joint']], by_name)
                     + mimic.get('offset', 0.0))
    return float(joint.get('position') or 0.0)


def _force_without(force: Mapping[str, Any], frames: set[str], left: Iterable[str],
                   ) -> Mapping[str, Any] | None:
    """Return what is left of a force without bodies and their frames, None for nothing."""
    if any(str(force.get(end, '')) in frames for end in ('a', 'b')):
        return None
    if 'bodies' not in force:
        return force
    bodies = [pattern for pattern in force['bodies']
              if pattern == '*' or matching(left, [pattern])]
    return {**force, 'bodies': bodies} if bodies else None


def _drop_descriptions(scene: dict[str, Any], gone: Iterable[str]) -> None:
    """Drop the URDF of models of which nothing is left."""
    texts = scene.get('descriptions')
    if not texts:
        return
    left = {part['name'].partition('/')[0] for key in LISTS for part in scene.get(key, ())}
    were = {name.partition('/')[0] for name in gone}
    scene['descriptions'] = {name: text for name, text in texts.items()
                             if name in left or name not in were}
