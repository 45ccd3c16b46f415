# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Find a moment of a recorded session, so that a simulation can go on from there.

A bag holds the complete state at the start of each file and all inputs. The state at any step is
the last one that was saved before it, and the inputs since.
"""

from collections.abc import Mapping
import os
from typing import Any, NamedTuple

from rigid_sim_ros.bag import decode, events, session as sessions, topics as kinds
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.events import Event
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.bag.session import Session
from rigid_sim_ros.scene import Scene, scene_from_text, SceneError
from rigid_sim_ros.world import World

_NEVER = 2.0 ** 62      # a step that nobody reaches


class Moment(NamedTuple):
    """A step of a session, and what leads there."""

    scene: Scene
    session: Session
    step: int
    saved: bytes                # a state before it
    inputs: tuple[Event, ...]   # from there on, those at the step itself included

    @property
    def parameters(self) -> Mapping[str, Any]:
        """The parameters with which the session was recorded."""
        return self.session.parameters

    def apply(self, world: World) -> None:
        """Bring a world of the scene to this moment; BagError if the inputs do not lead there."""
        try:
            world.restore(self.saved)
            for event in self.inputs:
                world.step(event.step - world.step_index)
                events.apply(event, world)
            world.step(self.step - world.step_index)
        except (ValueError, TypeError, ArithmeticError) as error:
            raise BagError(f'the inputs in the bag do not lead to step {self.step} ({error}): '
                           '`rigid_sim verify` says where they go wrong') from None


def find(path: str | os.PathLike[str], seconds: float) -> Moment:
    """
    Return the moment of a bag at a simulation time [s], rounded to whole steps.

    It comes after all that the world was told at that step. Where a reset turned time back, the
    last moment of that time is meant. BagError if the recording does not go there.
    """
    reader = BagReader(path)
    search: _Search | None = None
    text = b''
    for topic, _, data in reader.messages():
        if search is not None:
            search.take(topic, data)
        elif sessions.is_session(topic):
            session = sessions.read(topic, data)
            search = _Search(session, round(min(seconds * 1e9 / session.step_ns, _NEVER)))
        elif topic.endswith('/scene'):
            text = data
    if search is None or not text:
        raise BagError(f'{path} is no recording of rigid_sim_ros: it holds no scene with its '
                       'state')
    if reader.faults:
        raise BagError(f'{path}: {reader.faults[0]}: `rigid_sim recover {path}` keeps what is '
                       'whole')
    saved, inputs = search.result(path, seconds)
    try:
        scene = scene_from_text(decode.string(text), search.session.scene)
    except SceneError as error:
        raise BagError(f'the scene in {path} cannot be used: {error.summary}') from None
    return Moment(scene, search.session, search.step, saved, inputs)


class _Search:
    """Goes through the messages and keeps what leads to a step."""

    def __init__(self, session: Session, step: int) -> None:
        self.session = session
        self.step = step
        self._kinds = {topic.name: topic.kind for topic in session.topics
                       if topic.kind in (kinds.STEP, kinds.EVENT, kinds.SNAPSHOT)}
        self._saved: bytes | None = None    # the last state, None where inputs are missing
        self._inputs: list[Event] = []      # since then
        self._now = 0                       # the step at which the world is
        self._first: int | None = None      # the least and the last step of the recording
        self._last = 0
        self._found: tuple[bytes, tuple[Event, ...]] | None = None

    def take(self, topic: str, data: bytes) -> None:
        """Take a message."""
        kind = self._kinds.get(topic)
        if kind == kinds.STEP:
            self._go_to(decode.uint64(data))
        elif kind == kinds.SNAPSHOT:
            self._saved, self._inputs = decode.byte_array(data), []
            self._first = self._now if self._first is None else min(self._first, self._now)
        elif kind == kinds.EVENT:
            self._take_event(events.decode(decode.string(data)))

    def result(self, path: str | os.PathLike[str],
               seconds: float) -> tuple[bytes, tuple[Event, ...]]:
        """Return a saved state and the inputs that lead from it to the step."""
        self._go_to(self._now)
        if self._found is not None:
            return self._found
        if self._first is None:
            raise BagError(f'{path} holds no complete state')
        if self._first <= self.step <= self._last:
            raise BagError(f'{seconds:g} s lies in a gap of {path}, where inputs are missing: '
                           'choose another time, see `rigid_sim info`')
        unit = self.session.step_ns / 1e9
        raise BagError(f'{seconds:g} s lies outside of {path}, must be from '
                       f'{self._first * unit:.9g} s to {self._last * unit:.9g} s')

    def _take_event(self, event: Event) -> None:
        if event.kind == events.GAP:
            # Nobody knows what happened, unless only messages were lost.
            if event.arguments['events'] != 0:
                self._saved = None
            return
        self._go_to(event.step)
        self._inputs.append(event)
        if event.kind == 'reset' and not event.arguments.get('keep_time'):
            self._now = 0
            self._first = 0

    def _go_to(self, step: int) -> None:
        if step < self._now and self._saved is not None:
            # Else inputs that lie beyond a moment, years maybe, would be among those before it.
            raise BagError(f'the recording goes back from step {self._now} to {step} without a '
                           'reset: `rigid_sim verify` says what else is wrong with it')
        if self._saved is not None and self._now <= self.step <= step:
            self._found = self._saved, tuple(self._inputs)
        self._now = step
        self._last = max(self._last, step)
