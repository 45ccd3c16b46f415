# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The recording of a node: begun and ended between two steps, while the node runs.

Making a bag and waiting for its last bytes take a disk, so they happen in the executor's thread;
the step thread only hands over. Whatever goes wrong ends the recording and nothing else.
"""
from collections.abc import Mapping
from pathlib import Path
import time
from typing import Any

from rclpy.node import Node

from rigid_sim_ros.bag import events
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.recorder import Recorder, Status
from rigid_sim_ros.nodes.publishers import Publishers
from rigid_sim_ros.problems import counted
from rigid_sim_ros.world import World

NOT_RECORDING = 'not recording'
_MEGABYTE = 1_000_000
_PATIENCE_S = 60.0      # with a disk that does not answer, when a recording ends
_NEVER_S, _NEVER_BYTES = 1e9, 1 << 62      # no new file by this measure
_LEAST_SEGMENT_S = 0.1  # shorter files would hold hardly more than their own description


class Recording:
    """What the node records into, if it does."""

    def __init__(
        self, node: Node, world: World, publishers: Publishers, parameters: Mapping[str, Any],
    ) -> None:
        self.has_failed = False     # a recording was asked for, and is not whole
        self._name = node.get_fully_qualified_name()
        self._log = node.get_logger()
        self._world = world
        self._publishers = publishers
        self._parameters = dict(parameters)
        self._next: Recorder | None = None      # made, and not begun
        self._recorder: Recorder | None = None  # begun, and not ended
        self._latest: Recorder | None = None    # the last that was begun
        self._was_in_gap = False
        self._begun_s = self._ended_s = 0.0     # on the steady clock
        world.observe(lambda step, command: self.note(step, command.kind, **command.arguments))

    # --- the executor's thread, or the main one before the others begin ----------------------

    def set_parameter(self, name: str, value: Any) -> None:
        """Take over a parameter that was changed."""
        self._parameters[name] = value

    def create(self) -> None:
        """Make a new bag; BagError if that cannot be done."""
        if self._recorder is not None and not self._recorder.error:
            raise BagError(f'already recording into {self._recorder.path}: call '
                           '~/stop_recording first')
        given = self._parameters
        seconds, megabytes = given['bag_segment_duration'], given['bag_segment_size']
        self._next = Recorder(
            self._path(), self._world, self._publishers.topics, node=self._name,
            frame_id=given['frame_id'], parameters=given, storage=given['bag_storage'],
            compression=given['bag_compression'], waits=given['real_time_factor'] == 0.0,
            on_error=self._fail, segment_s=max(seconds, _LEAST_SEGMENT_S) if seconds else _NEVER_S,
            segment_bytes=megabytes * _MEGABYTE or _NEVER_BYTES)

    def finish(self) -> tuple[bool, str]:
        """Wait until the bag that was ended is written; return whether it is whole, and a text."""
        recorder = self._latest
        assert recorder is not None
        if not recorder.wait(_PATIENCE_S):
            text = (f'the disk of {recorder.path} does not answer: `rigid_sim recover '
                    f'{recorder.path}` restores what was written')
            self._fail(text)
            return False, text
        status = recorder.status()
        if status.error:
            return False, status.error
        text = (f'recorded {counted(status.messages, "message")}, {status.size / 1e6:.2f} MB, '
                f'into {status.path}')
        self._log.info(f'{text}: `rigid_sim verify {status.path}` simulates it again')
        return True, text

    # --- the step thread ---------------------------------------------------------------------

    def begin(self) -> tuple[bool, str]:
        """Record from the present state on, into the bag that was made."""
        recorder, self._next = self._next, None
        assert recorder is not None
        self._recorder = self._latest = recorder
        self._begun_s, self._was_in_gap = time.monotonic(), False
        recorder.snapshot(self._world)
        self._publishers.record(recorder)
        text = f'recording into {recorder.path}'
        self._log.info(text)
        return True, text

    def end(self) -> tuple[bool, str]:
        """End the recording; `finish` waits for the rest."""
        recorder, self._recorder = self._recorder, None
        self._publishers.record(None)
        if recorder is None or recorder.error:
            return False, (self._latest.error if self._latest else '') or NOT_RECORDING
        recorder.end(self._world)
        self._ended_s = time.monotonic()
        return True, f'recorded into {recorder.path}'

    def close(self) -> None:
        """End whatever there is, and wait until it is written: the simulation has ended."""
        made, self._next = self._next, None
        if made is not None:
            made.close(self._world)
        if self.end()[0]:
            self.finish()

    def turn(self) -> None:
        """Do what is due once per turn of the loop."""
        recorder = self._recorder
        if recorder is None:
            return
        if recorder.error:
            self._recorder, self._ended_s = None, time.monotonic()
            self._publishers.record(None)
            return
        if recorder.wants_snapshot:
            recorder.snapshot(self._world)
        if recorder.is_in_gap != self._was_in_gap:
            self._was_in_gap = recorder.is_in_gap
            self._log_gap(recorder.status())

    def note(self, step: int, kind: str, **arguments: Any) -> None:
        """Record what leaves the world as it is, or was done to it at a step."""
        if self._recorder is not None:
            self._recorder.event(step, kind, **arguments)

    def note_parameter(self, name: str, value: Any) -> None:
        """Record that a parameter was changed."""
        if self._recorder is None:
            return
        if name == 'real_time_factor':
            self._recorder.speed(self._world.step_index, value)
        else:
            self.note(self._world.step_index, events.PARAMETER, name=name, value=value)

    def status(self) -> Status | None:
        """Return what the latest recording has done; None if there was none."""
        return self._latest.status() if self._latest is not None else None

    def elapsed(self) -> float:
        """Return the wall time that the latest recording has lasted [s]."""
        return (time.monotonic() if self.is_active else self._ended_s) - self._begun_s

    @property
    def is_made(self) -> bool:
        """Whether there is a bag that waits for `begin`."""
        return self._next is not None

    @property
    def is_active(self) -> bool:
        """Whether the node records now."""
        return self._recorder is not None and not self._recorder.error

    def _log_gap(self, status: Status) -> None:
        if self._was_in_gap:
            self._log.warning(
                f'the disk does not keep up: {status.path} has a gap from '
                f'{self._world.time_ns / 1e9:.3f} s on; a faster disk, fewer bodies with topics '
                'of their own or a lower publish_rate avoid it')
        else:
            self._log.warning(
                f'the gap in {status.path} ends at {self._world.time_ns / 1e9:.3f} s; '
                f'{counted(status.lost_messages, "message")} and '
                f'{counted(status.lost_events, "input")} are missing '
                'so far')

    # --- any thread --------------------------------------------------------------------------

    def _fail(self, text: str) -> None:
        self.has_failed = True
        self._log.error(text)

    def _path(self) -> Path:
        given = self._parameters['bag_path']
        if given:
            return Path(given).expanduser()
        return Path(time.strftime(f'{self._name.rpartition("/")[2]}_%Y_%m_%d-%H_%M_%S'))
