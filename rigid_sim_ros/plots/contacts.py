# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Contact forces and gaps, which a bag does not hold: the session is simulated again for them.

The world goes through the recorded inputs and is compared with the recorded states on the way. It
steps one by one, so that no blow between two states is missed.
"""

from collections.abc import Sequence
import contextlib
import os
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.bag import decode, events, session as sessions, topics as kinds
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.motion import Array, Clock
from rigid_sim_ros.bag.pace import Pace
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.scene import Scene
from rigid_sim_ros.world import World


class Contacts(NamedTuple):
    """Contacts of n bodies between each of t recorded states and the one before."""

    time: Array         # (t,) [s]
    force: Array        # (t, n) [N] size of the mean net contact force
    gap: Array          # (t, n) [m] smallest gap, below 0: overlap; nan: nothing is near
    note: str           # where the world came out other than recorded, or ''


def simulate_contacts(bag: str | os.PathLike[str], scene: Scene, end: float,
                      names: Sequence[str] | None = None) -> Contacts:
    """
    Return the contacts of a session up to a time [s], by simulating it again.

    `scene` is that with which it began, `names` are those of all bodies that were ever there;
    None: those of the scene.
    """
    run = _Again(World(scene), scene.names if names is None else names)
    handlers: dict[str, str] = {}
    for topic, stamp, data in BagReader(bag).messages():
        if topic in handlers:
            if not run.take(handlers[topic], stamp, data) or run.now > end:
                break
        elif not handlers and topic.endswith('/bag/session'):
            session = sessions.read(topic, data)
            handlers = {each.name: each.kind for each in session.topics if each.kind in _USED}
    return run.contacts()


_USED = frozenset({kinds.STEP, kinds.EVENT, kinds.SNAPSHOT, kinds.STATE})


class _Again:
    """A world on its way through a session."""

    def __init__(self, world: World, names: Sequence[str]) -> None:
        """Begin with a world; `names` are those of all bodies that it ever has."""
        n = len(names)
        self.now = 0.0
        self._world = world
        self._place = {name: k for k, name in enumerate(names)}
        self._find_places()
        self._clock = Clock()
        self._pace = Pace(world.step_ns)
        self._is_lost = True        # until the first snapshot
        self._impulse = np.zeros((n, 3))
        self._gap = np.full(n, np.inf)
        self._steps = 0
        self._rows: list[tuple[float, Array, Array]] = []
        self._note = ''

    def take(self, kind: str, stamp: int, data: bytes) -> bool:
        """Follow one message; False where the session cannot be followed any further."""
        if kind == kinds.SNAPSHOT:
            if self._is_lost:
                self._restore(decode.byte_array(data))
        elif kind == kinds.EVENT:
            self._take_event(events.decode(decode.string(data)), stamp)
        elif kind == kinds.STEP:
            self._go_to(decode.uint64(data), stamp)
            self._pace.note(stamp)
        else:
            return self._compare(data)
        return True

    def contacts(self) -> Contacts:
        n = len(self._place)
        times = np.array([row[0] for row in self._rows])
        force = np.array([row[1] for row in self._rows]).reshape(-1, n)
        gap = np.array([row[2] for row in self._rows]).reshape(-1, n)
        return Contacts(times, force, gap, self._note)

    def _restore(self, state: bytes) -> None:
        try:
            self._world.restore(state)
        except (ValueError, KeyError, TypeError) as error:
            raise BagError(f'a saved state in the bag cannot be used: {error}') from None
        self._is_lost = False
        self._find_places()

    def _find_places(self) -> None:
        """Note which bodies the world has now."""
        self._there = np.array([self._place[name] for name in self._world.names])

    def _take_event(self, event: events.Event, stamp: int) -> None:
        if event.kind == events.GAP and event.arguments['events'] != 0:
            self._is_lost = True
        elif not self._is_lost:
            self._go_to(event.step, stamp)
            try:
                events.apply(event, self._world)
            except (ValueError, TypeError) as error:
                raise BagError(f'the event {event.number}, {event.kind}, is refused: {error}'
                               ) from None
            self._find_places()

    def _go_to(self, step: int, stamp: int) -> None:
        if self._is_lost:
            return
        if wrong := self._pace.wrong(self._world.step_index, step, stamp):
            raise BagError(f'{wrong}: it was changed, see `rigid_sim verify`')
        for _ in range(step - self._world.step_index):
            # Motion beyond all numbers was recorded too, if it was.
            with contextlib.suppress(ArithmeticError):
                self._world.step()
            self._look()

    def _look(self) -> None:
        rows = self._world.contacts()
        self._steps += 1
        if not len(rows):
            return
        force = rows['normal_force'][:, None] * rows['normal'] + rows['friction_force']
        for sign, body in ((-1.0, rows['body_a']), (1.0, rows['body_b'])):
            np.add.at(self._impulse, self._there[body], sign * force)
            np.minimum.at(self._gap, self._there[body], rows['gap'])

    def _compare(self, data: bytes) -> bool:
        t_ns, _, _, numbers = decode.multi_dof_state(data)
        self.now, _ = self._clock.seconds(t_ns)
        if self._is_lost:
            return True
        world = self._world
        same = np.array_equal(numbers, np.hstack([
            world.position, world.orientation, world.linear_velocity, world.angular_velocity]),
            equal_nan=True)
        if not same:
            self._note = (f'contact forces and gaps end at {self.now:g} s: simulated again, the '
                          'motion is another than recorded, see `rigid_sim verify`')
            return False
        mean = self._impulse / max(1, self._steps)
        self._rows.append((self.now, np.linalg.norm(mean, axis=1),
                           np.where(np.isfinite(self._gap), self._gap, np.nan)))
        self._impulse[:] = 0.0
        self._gap[:] = np.inf
        self._steps = 0
        return True
