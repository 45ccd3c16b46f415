# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What happened to a world between two steps, as one line of JSON.

An event carries the step from which it acts, its number in the recording, so that one that is
missing is noticed, and a digest, so that one that was changed is noticed even where the change is
too small to move a body by a bit.
"""

from collections.abc import Callable, Mapping
import json
from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.bag.digests import digest_of
from rigid_sim_ros.bag.errors import BagError, Damaged
from rigid_sim_ros.scene.additions import names_a_file
from rigid_sim_ros.world import World
from rigid_sim_ros.world.commands import Command, KINDS

# Events that act on the world are commands, see world/commands.py.
INPUTS = KINDS
# Events that tell of the session and leave the world as it is.
PAUSE, RESUME, SINGLE_STEP, SPEED, END = 'pause', 'resume', 'step', 'speed', 'end'
PARAMETER = 'parameter'     # of the node, that was changed while it ran
# A gap says what is missing before it; the next snapshot tells how the world goes on.
GAP = 'gap'
# How many messages each topic had before it; the end of a recording tells that too.
WRITTEN = 'written'
NOTES = frozenset({PAUSE, RESUME, SINGLE_STEP, SPEED, PARAMETER, END, GAP, WRITTEN})


class Event(NamedTuple):
    """One event of a session."""

    number: int | None  # 0, 1, 2, ...; of a gap: of the event after it, None if unknown
    step: int           # World.step_index before it: it acts from the step that follows
    kind: str
    arguments: Mapping[str, Any]

    def encode(self) -> str:
        """Return the event as JSON."""
        fields = json.dumps(self._asdict(), default=_plain)
        return f'{fields[:-1]}, "digest": "{digest_of(fields)}"}}'


def decode(text: str) -> Event:
    """Return the event of some JSON; Damaged when it was changed, BagError when not known here."""
    fields, mark, end = text.rpartition(', "digest": "')
    if not mark or end != f'{digest_of(fields + "}")}"}}':
        raise Damaged('was changed after it was recorded: its digest does not fit')
    try:
        event = Event(**json.loads(fields + '}'))
    except (TypeError, ValueError, RecursionError) as error:
        raise BagError(f'is not of this version: {error}') from None
    if not isinstance(event.kind, str) or (event.kind not in INPUTS and event.kind not in NOTES):
        raise BagError(f'is of the unknown kind {event.kind!r}: verify with the version of '
                       'rigid_sim_ros that recorded it')
    needed = _NEEDED.get(event.kind, {})
    if not ((event.number is None or _is_count(event.number)) and _is_count(event.step)
            and isinstance(event.arguments, dict)
            and all(holds(event.arguments.get(name)) for name, holds in needed.items())):
        raise Damaged('makes no sense: its numbers or arguments are not such as are recorded')
    return event


def _is_count(value: object) -> bool:
    return type(value) is int and 0 <= value < 2 ** 63


def _is_count_or_unknown(value: object) -> bool:
    return value is None or _is_count(value)


def _are_counts(value: object) -> bool:
    return isinstance(value, dict) and all(_is_count(each) for each in value.values())


# Arguments that a note must have; those of inputs are for the world to look at.
_NEEDED: dict[str, dict[str, Callable[[object], bool]]] = {
    END: {'state_hash': lambda value: type(value) is int, 'messages': _are_counts},
    GAP: {'since_step': _is_count, 'messages': _is_count_or_unknown,
          'events': _is_count_or_unknown},
    WRITTEN: {'messages': _are_counts},
}


def apply(event: Event, world: World) -> None:
    """
    Do to a world again what an event says; nothing for a note.

    ValueError for what the world refuses, and for a part that names a file: a recorder writes
    none, and a stranger's bag says nothing of the files here.
    """
    if event.kind == 'add' and names_a_file(event.arguments.get('part')):
        raise ValueError('the part that comes names a file, must hold all that it is')
    if event.kind in INPUTS:
        world.apply(Command(event.kind, event.arguments))


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist()
