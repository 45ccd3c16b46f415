# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A bag as the page shows it: all states in memory, and what happened at which time.

The time axis is that of the simulation. It goes on where a reset sets the clock back, and stands
still in a pause. A session too long for the memory is thinned out, evenly.
"""
from bisect import bisect_right
import os
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rigid_sim_ros.bag import decode, events, session as sessions
from rigid_sim_ros.bag.arrivals import Arrivals, names_in, with_arrivals
from rigid_sim_ros.bag.errors import BagError, Damaged
from rigid_sim_ros.bag.motion import Clock
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.bag.session import Session
from rigid_sim_ros.scene import Scene, scene_from_text, SceneError
from rigid_sim_ros.viewer.motion import among, Motion, MotionDecoder, without_absent
from rigid_sim_ros.viewer.simulation import Applied

# [bytes] States, and contacts, beyond this are thinned out: every other one goes.
_MOST_BYTES = 400_000_000
_STATE, _SCENE, _SESSION, _EVENT = '/state', '/scene', '/bag/session', '/bag/event'
_SNAPSHOT = '/bag/snapshot'
# Sets of bodies that are known at a time; more come and go, one after another.
_MOST_DECODERS = 8
_WRENCH, _MARKERS = '/applied_wrench', '/markers'
_CONTACTS = b'contact_'
_HEAD = 200     # bytes in which the namespace of the first marker stands


class Happening(NamedTuple):
    """Something that happened in a session."""

    time: float     # [s] on the axis of the recording
    what: str
    text: str


class Recording:
    """The states of a bag, with the scene that they are of."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Read a bag; BagError if it cannot be read, or holds no scene with its states."""
        self.path = path
        self.session: Session | None = None
        self.scene: Scene
        self.happenings: list[Happening] = []
        self.thinning = 1                       # one of so many states is kept
        self._scene_text = ''
        self._node = ''
        self._clock = Clock()
        self._times: list[float] = []           # [s] of each state that is kept
        self._stamps: list[int] = []            # [ns] of the same in the bag
        self._motions: list[Motion] = []
        self._whose: list[tuple[str, ...]] = []     # the bodies of the same states
        self._decoders: list[MotionDecoder] = []    # the latest first
        self._arrivals = Arrivals()
        self._contacts: list[tuple[float, bytes]] = []
        self._contact_bytes = 0
        self._wrenches: dict[str, list[tuple[float, Applied]]] = {}
        self._seen = 0
        self._now = 0.0
        self._read(BagReader(path))
        self._know_all()
        if not self._motions:
            raise BagError(f'{path} holds no states with their scene on the topics ~/state and '
                           '~/scene: nothing can be shown')
        self.times = np.array(self._times)
        self.stamps = np.array(self._stamps)

    def __len__(self) -> int:
        return len(self._motions)

    @property
    def duration(self) -> float:
        """The time from the first state to the last [s]."""
        return float(self.times[-1] - self.times[0])

    def row(self, time: float) -> int:
        """Return the last state at a time on the axis, or the first."""
        return max(0, int(np.searchsorted(self.times, time, side='right')) - 1)

    def motion(self, row: int) -> Motion:
        """Return a state; bodies that were not there are nowhere near."""
        return without_absent(self._whole(row))

    def _whole(self, row: int) -> Motion:
        """Return a state of all bodies that there ever were."""
        names, all_names = self._whose[row], self.scene.names
        if names == all_names:
            return self._motions[row]
        place = np.array([self._index[name] for name in names], dtype=np.intp)
        return among(self._motions[row], place, len(all_names))

    def contacts(self, time: float) -> bytes:
        """Return the last MarkerArray of contacts at a time, b'' for none."""
        k = bisect_right(self._contacts, time, key=lambda pair: pair[0])
        return self._contacts[k - 1][1] if k else b''

    def applied(self, time: float) -> dict[str, Applied]:
        """Return the last wrench on each body at a time."""
        found = {}
        for body, wrenches in self._wrenches.items():
            k = bisect_right(wrenches, time, key=lambda pair: pair[0])
            if k:
                found[body] = wrenches[k - 1][1]
        return found

    def time_of_stamp(self, stamp: int) -> float:
        """Return the time on the axis of a stamp in the bag [ns]."""
        return float(self.times[max(0, int(np.searchsorted(self.stamps, stamp)) - 1)])

    def table(self, rows: npt.NDArray[np.intp]) -> npt.NDArray[np.float64]:
        """Return poses and twists at some rows, (rows, n, 13), nan of what was not there."""
        return np.stack([np.hstack(self._whole(row)[1:]) for row in rows])

    def _know_all(self) -> None:
        """Let the scene have what came later too, and leave states of other bodies out."""
        if self._scene_text:
            self.scene = with_arrivals(self.scene, self._arrivals.parts, [])
            self._index = {name: k for k, name in enumerate(self.scene.names)}
            strange = [k for k, names in enumerate(self._whose)
                       if not self._index.keys() >= set(names)]
            for k in reversed(strange):
                del self._times[k], self._stamps[k], self._motions[k], self._whose[k]

    def _read(self, reader: BagReader) -> None:
        for topic, stamp, data in reader.messages():
            if topic.endswith(_STATE) and topic == f'{self._node}{_STATE}':
                self._take_state(stamp, data)
            elif topic.endswith(_SCENE) and not self._scene_text:
                self._take_scene(topic, data)
            elif topic.endswith(_SESSION) and self.session is None:
                self.session = sessions.read(topic, data)
            elif topic.endswith(_EVENT):
                self._take_event(data)
            elif topic.endswith(_SNAPSHOT):
                self._arrivals.take_snapshot(data)
            elif topic.endswith(_WRENCH):
                self._take_wrench(topic, data)
            elif topic.endswith(_MARKERS) and _CONTACTS in data[:_HEAD]:
                self._take_contacts(data)

    def _take_scene(self, topic: str, data: bytes) -> None:
        self._node = topic.removesuffix(_SCENE)
        self._scene_text = decode.string(data)
        try:
            self.scene = scene_from_text(self._scene_text, 'scene')
        except SceneError as error:
            raise BagError(f'the scene in {self.path} cannot be shown: {error.summary}') from None
        self._decoders = [MotionDecoder(self.scene.names)]

    def _take_state(self, stamp: int, data: bytes) -> None:
        motion = self._decoded(data)
        if motion is None:
            return
        self._now, is_back = self._clock.seconds(motion.t_ns)
        if is_back and self.session is None:
            self._happened('reset', 'the clock was set back')
        self._seen += 1
        if self._seen % self.thinning:
            return
        self._times.append(self._now)
        self._stamps.append(stamp)
        self._motions.append(motion)
        self._whose.append(self._decoders[0].names)
        if len(self._motions) * len(data) > _MOST_BYTES:
            self.thinning *= 2
            for kept in (self._times, self._stamps, self._motions, self._whose):
                del kept[1::2]

    def _decoded(self, data: bytes) -> Motion | None:
        """Return the motion in a message; the decoder of its bodies is the first then."""
        for k, decoder in enumerate(self._decoders):
            motion = decoder.read(data)
            if motion is not None:
                self._decoders.insert(0, self._decoders.pop(k))
                return motion
        if not self._decoders:
            return None     # no scene yet
        try:
            names = decode.multi_dof_state(data)[2]
        except Damaged:
            return None
        decoder = MotionDecoder(tuple(names))
        motion = decoder.read(data)
        if motion is not None:
            self._decoders = [decoder, *self._decoders[:_MOST_DECODERS]]
        return motion

    def _take_contacts(self, data: bytes) -> None:
        self._contacts.append((self._now, data))
        self._contact_bytes += len(data)
        if self._contact_bytes > _MOST_BYTES:
            del self._contacts[1::2]
            self._contact_bytes = sum(len(kept) for _, kept in self._contacts)

    def _take_event(self, data: bytes) -> None:
        event = events.decode(decode.string(data))
        self._arrivals.take_event(event)
        if event.kind in _TOLD:
            given = ', '.join(str(value) for key, value in event.arguments.items()
                              if key in ('name', 'factor', 'messages'))
            if event.kind == 'add':
                given = ', '.join(names_in(event.arguments.get('part')))
            self._happened(event.kind, f'{event.kind.replace("_", " ")} {given}'.strip())

    def _take_wrench(self, topic: str, data: bytes) -> None:
        t_ns, frame, numbers = decode.wrench(data)
        fx, fy, fz, tx, ty, tz = numbers[0].tolist()
        body = topic.removesuffix(_WRENCH).removeprefix(f'{self._node}/')
        self._wrenches.setdefault(body, []).append(
            (self._now, Applied(t_ns, frame, (fx, fy, fz), (tx, ty, tz))))

    def _happened(self, what: str, text: str) -> None:
        self.happenings.append(Happening(self._now, what, text))


# Wrenches are too many to be told of one by one; their arrows show them.
_TOLD = frozenset({'reset', 'add', 'remove', 'set_pose', 'set_twist', 'apply_impulse',
                   events.PAUSE, events.RESUME, events.SPEED, events.GAP, events.END})
