# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All that was ever in a session, as one scene: for pictures, which show what came later too."""

from collections.abc import Iterable, Mapping
import contextlib
from dataclasses import replace
from typing import Any

from rigid_sim_ros.bag import decode
from rigid_sim_ros.bag.events import Event
from rigid_sim_ros.scene import Scene, scene_from_dict, SceneError
from rigid_sim_ros.scene.additions import names_a_file, parts_of
from rigid_sim_ros.scene.reader import read_parts
from rigid_sim_ros.world.snapshot import unpack


class Arrivals:
    """Gathers the parts that came, from the messages of a bag."""

    def __init__(self) -> None:
        """Begin without any."""
        self.parts: list[Any] = []
        self._is_new = True     # no state as a whole yet

    def take_event(self, event: Event) -> None:
        """Take an event, whatever it tells."""
        if event.kind == 'add':
            self.parts.append(event.arguments.get('part'))

    def take_snapshot(self, data: bytes) -> None:
        """Take a message with a state as a whole: the first tells what came before the session."""
        if not self._is_new:
            return
        self._is_new = False
        with contextlib.suppress(ValueError, TypeError):
            changes = unpack(decode.byte_array(data))[0].get('changes', [])
            self.parts += [what for kind, what in changes if kind == 'add']


def with_arrivals(scene: Scene, parts: Iterable[Any], notes: list[str]) -> Scene:
    """
    Return the scene that a session began with, and the bodies of the parts that came later.

    Of several bodies that had a name one after another it has the first. Their joints are told of
    in `spec` alone: those that held something at different times need not fit together. What
    cannot be used is left out, with a note.
    """
    spec, parts = scene.spec, list(parts)
    bodies = _new(parts, 'bodies', scene.names)
    joints = _new(parts, 'joints', [joint.name for joint in spec.joints or ()])
    if not bodies and not joints:
        return scene
    data = spec.model_dump(exclude_none=True)
    try:
        whole = scene_from_dict({**data, 'bodies': [*data['bodies'], *bodies]}, scene.name,
                                may_read_files=False)
        came = read_parts({'joints': joints})[0].joints if joints else ()
    except SceneError as error:
        notes.append(f'what came later is left out, it cannot be used: {error.summary}')
        return scene
    return replace(whole, text=scene.text, spec=whole.spec.model_copy(update={
        'joints': (*(spec.joints or ()), *(came or ()))}))


def names_in(part: Any) -> list[str]:
    """Return what a part is called: its model, or its bodies and joints."""
    names = [str(one['name']) for key in ('bodies', 'joints') for one in _new([part], key, ())]
    return list(dict.fromkeys(name.partition('/')[0] for name in names))


def _new(parts: Iterable[Any], key: str, known: Iterable[str]) -> list[Mapping[str, Any]]:
    """Return what stands under a key in the parts and has a new name, but for what needs files."""
    names, new = set(known), []
    for part in parts:
        try:
            found = parts_of(part).get(key) or ()
        except SceneError:
            continue
        for one in found:
            if isinstance(one, Mapping) and isinstance(one.get('name'), str) and (
                    one['name'] not in names and not names_a_file(one)):
                names.add(one['name'])
                new.append(one)
    return new
