# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Record a session: the very bytes that are published, and all that a world was told.

Whoever steps the world calls the methods of Recorder in the order in which things happen; each
only appends to a queue. A thread of its own encodes, writes and flushes, so the disk never stops a
step. How to call them:

    recorder = Recorder(path, world, topics)            # BagError: say so, and go on without
    recorder.snapshot(world)                            # begins the recording
    recorder.publish(world.step_index, channels, messages)          # what was published
    recorder.event(step, 'set_pose', name='crate', ...)  # what the world accepted; step is its
                                                         # step_index before that (see reset)
    if recorder.wants_snapshot:                         # once per turn of the loop
        recorder.snapshot(world)
    recorder.close(world)

An event is recorded after the world has taken it and before the next step or publication.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
import os
from pathlib import Path
import threading
import time
from typing import Any, NamedTuple, Protocol

from rigid_sim_ros.bag import events
from rigid_sim_ros.bag.events import Event
from rigid_sim_ros.bag.reader import free_space_error
from rigid_sim_ros.bag.session import new_session
from rigid_sim_ros.bag.topics import own_topics, Topic
from rigid_sim_ros.bag.writer import BagWriter
from rigid_sim_ros.messages.codec import encode_bytes, encode_string, encode_uint64

# [s] What was published longer ago than this, and the time a write takes, is out of the process.
# A kill may lose 1 s; four chunks a second compress and seek well enough.
FLUSH_S = 0.25

# [bytes] What may wait for the writer. In real time a disk that stands still for some 10 s (100
# bodies at 100 Hz make 3 MB/s) leaves no gap; who can wait is stopped sooner, so that at a kill
# only a fraction of a second of work is in the queue.
REAL_TIME_QUEUE = 64 << 20
WAITING_QUEUE = 4 << 20

# A new file, with scene and full state, after this much [s] or this many [bytes], not compressed:
# what has to be simulated again at most to reach a point in time.
SEGMENT_S = 60.0
SEGMENT_BYTES = 256 << 20

_IDLE_S = 0.01      # the writer looks this often whether there is something to write
_WAIT_S = 0.0005
# The writer gives the interpreter away for this long between two groups of messages: without it
# the step loop would wait for a turn up to 5 ms, sys.getswitchinterval().
_YIELD_S = 0.0001
_ITEM = 200         # bytes that an entry of the queue takes besides its messages


class RecordedWorld(Protocol):
    """What of a World a recorder looks at."""

    @property
    def origin(self) -> Any: ...
    @property
    def names(self) -> list[str]: ...
    @property
    def step_ns(self) -> int: ...
    @property
    def step_index(self) -> int: ...
    def save(self) -> bytes: ...
    def state_hash(self) -> int: ...


class Status(NamedTuple):
    """What a recorder has done so far, for diagnostics."""

    path: Path
    error: str              # why the recording has ended, '' if it has not
    messages: int           # written
    files: int
    size: int               # [bytes] of these
    gaps: int
    lost_messages: int      # in gaps
    lost_events: int
    queued_bytes: int


class _Gap:
    """What found no place in the queue since it was full."""

    def __init__(self, step: int) -> None:
        self.step = step
        self.messages = 0
        self.events = 0


class Recorder:
    """
    Records one session into a new bag.

    All methods but `status`, `wait` and `wait_for_room` belong to the thread that steps the world.
    None raises an error once the recording has begun: it ends, `error` says why, `on_error` is
    called with that text from the writer's thread, and later calls do nothing.
    """

    def __init__(
        self, path: str | os.PathLike[str], world: RecordedWorld, topics: Sequence[Topic], *,
        node: str = '/rigid_sim', frame_id: str = 'world',
        parameters: Mapping[str, Any] | None = None, storage: str = 'mcap',
        compression: str = 'none', waits: bool = False, clock: Callable[[], int] | None = None,
        on_error: Callable[[str], None] | None = None, segment_s: float = SEGMENT_S,
        segment_bytes: int = SEGMENT_BYTES,
    ) -> None:
        """
        Create the bag; BagError if that cannot be done.

        `topics` are those that will be published, without ~/scene, which is recorded by itself.
        `waits`: a full queue stops the caller (as fast as possible) instead of making a gap (real
        time); it may be set at any time. `clock` gives the time of a message [ns] since 1970,
        default: the wall clock as it was at the start, and steadily on from there.
        """
        own = own_topics(node)
        self.path = Path(path)
        self.topics = (*own, *topics)
        self.waits = waits
        self.wants_snapshot = True      # at the start, after a gap, and for each new file
        self.error = ''
        self._channels = {topic.name: k + 1 for k, topic in enumerate(self.topics)}
        self._scene, self._session, self._snapshot, self._step, self._event = range(1, 6)
        session = new_session(node, world.origin.name, world.origin.names, world.step_ns, frame_id,
                              parameters or {}, self.topics)
        self._head = encode_string(world.origin.text), encode_string(session.encode())
        self._clock = clock or _steady_clock()
        self._on_error = on_error
        self._queue: deque[tuple[Any, ...]] = deque()
        self._put = 0           # [bytes] ever put into the queue, by the step thread
        self._taken = 0         # [bytes] ever written, by the writer's
        self._gap: _Gap | None = None
        self._gaps = self._lost_messages = self._lost_events = 0
        self._number = 0        # of the next event
        self._closing = False
        self._written_step: int | None = None
        self._messages = 0
        self._segment_ns, self._segment_bytes = round(segment_s * 1e9), segment_bytes
        self._segment_is_full = True
        self._segment_end_ns = 0    # on the clock of the messages
        self._segment_end_put = 0   # [bytes], as _put counts them
        self._writer = BagWriter(self.path, self.topics, storage, compression)
        # What is waited for: Python 3.11 takes a thread for ended when Ctrl-C comes in `join`.
        self._ended = threading.Event()
        threading.Thread(target=self._run, name='bag writer', daemon=True).start()

    def channel(self, name: str) -> int:
        """Return the number that `publish` takes for a topic; KeyError if it is not recorded."""
        return self._channels[name]

    def publish(self, step: int, channels: Sequence[int], messages: Sequence[bytes]) -> None:
        """Record messages that were published, one a channel, at a step of the world."""
        size = _ITEM + sum(map(len, messages))
        if self._admits(size, step, 1):
            stamp = self._clock()
            self._enter(size, (self._write_messages, stamp, step, channels, messages))
            if stamp >= self._segment_end_ns or self._put >= self._segment_end_put:
                self._segment_is_full = self.wants_snapshot = True
        elif self._gap is not None:
            self._gap.messages += len(messages)
            self._lost_messages += len(messages)

    def event(self, step: int, kind: str, **arguments: Any) -> None:
        """
        Record what the world was told when it was at `step`, its step_index before the call.

        The kinds are those of events.py, `arguments` those of the method of World of that name,
        as they were given, and never changed later. A wrench may add `frame_id`, the name its
        echo gives the frame.
        """
        number = self._number
        self._number += 1
        # Twice the room: what the world was told outlasts what it said.
        if self._admits(_ITEM, step, 2):
            self._enter(_ITEM, (self._write_event, self._clock(),
                                Event(number, step, kind, arguments)))
        elif self._gap is not None:
            self._gap.events += 1
            self._lost_events += 1

    def speed(self, step: int, factor: float) -> None:
        """Record a real-time factor that holds from now on; 0, as fast as possible, may wait."""
        self.event(step, events.SPEED, factor=factor)
        self.waits = factor == 0.0

    def snapshot(self, world: RecordedWorld) -> None:
        """Record the complete state of the world."""
        if self._gap is not None and self._has_room():
            self._end_gap(world.step_index)
        if not self._admits(_ITEM, world.step_index, 1):
            return      # later: there is no room now
        self._enter_snapshot(world)

    def _enter_snapshot(self, world: RecordedWorld) -> None:
        data, stamp = world.save(), self._clock()
        self._enter(_ITEM + len(data), (
            self._write_snapshot, stamp, world.step_index, data, self._segment_is_full))
        self.wants_snapshot = False
        if self._segment_is_full:
            self._segment_is_full = False
            self._segment_end_ns = stamp + self._segment_ns
            self._segment_end_put = self._put + self._segment_bytes

    def close(self, world: RecordedWorld) -> None:
        """End the recording with the last state, and wait until it is written."""
        self.end(world)
        self.wait()

    def end(self, world: RecordedWorld) -> None:
        """End the recording with the last state, and do not wait; later calls do nothing."""
        if self._closing or self.error:
            return
        step = world.step_index
        # Whether there is room or not: it is the last of all.
        if self._gap is not None:
            self._end_gap(step)
            self._enter_snapshot(world)
        self._enter(_ITEM, (self._write_event, self._clock(), Event(
            self._number, step, events.END, {'state_hash': world.state_hash()})))
        self._closing = True

    def wait(self, seconds: float | None = None) -> bool:
        """Wait, after `end` or an error, until all is written; return whether it is."""
        return self._ended.wait(seconds)

    @property
    def is_in_gap(self) -> bool:
        """Whether the queue was full, and has no room yet."""
        return self._gap is not None

    def wait_for_room(self) -> None:
        """Wait until the queue is half empty, or the recording has ended."""
        while not self.error and self._put - self._taken > self._limit(1) // 2:
            time.sleep(_WAIT_S)

    def status(self) -> Status:
        """Return what was done so far; any thread may ask."""
        return Status(self.path, self.error, self._messages, self._writer.files,
                      self._writer.size, self._gaps, self._lost_messages, self._lost_events,
                      self._put - self._taken)

    # --- the step thread: the queue ---------------------------------------------------------

    def _limit(self, share: int) -> int:
        return share * (WAITING_QUEUE if self.waits else REAL_TIME_QUEUE)

    def _admits(self, size: int, step: int, share: int) -> bool:
        """Return whether something may enter the queue; wait for that, or begin a gap."""
        if self.error or self._closing:
            return False
        if self._gap is not None:
            # All is lost until a snapshot says what came of it: so nothing is in the bag that
            # nobody could simulate again.
            self.wants_snapshot = self._has_room()
            return False
        queued = self._put - self._taken
        if queued + size <= self._limit(share) or not queued:
            return True
        if self.waits:
            self.wait_for_room()
        else:
            self._gap = _Gap(step)
        return self._gap is None and not self.error

    def _has_room(self) -> bool:
        """Return whether the queue is half empty, so that a gap may end."""
        if self.waits:
            self.wait_for_room()
        return self._put - self._taken <= self._limit(1) // 2 and not self.error

    def _end_gap(self, step: int) -> None:
        gap, self._gap = self._gap, None
        assert gap is not None
        self._gaps += 1
        self.wants_snapshot = True
        self._enter(_ITEM, (self._write_event, self._clock(), Event(
            self._number, step, events.GAP,
            {'since_step': gap.step, 'messages': gap.messages, 'events': gap.events})))

    def _enter(self, size: int, item: tuple[Any, ...]) -> None:
        self._put += size
        self._queue.append((size, *item))

    # --- the writer's thread ----------------------------------------------------------------

    def _run(self) -> None:
        try:
            flush_at = time.monotonic() + FLUSH_S
            while not (self._closing and not self._queue):
                self._write_some(flush_at)
                if time.monotonic() >= flush_at:
                    self._writer.flush()
                    flush_at = time.monotonic() + FLUSH_S
            self._writer.close()
        except OSError as error:
            self._fail(free_space_error(error, self.path))
        except Exception as error:      # a mistake of ours must not stop the simulation either
            self._fail(f'{self.path}: {type(error).__name__}: {error}')
        finally:
            self._ended.set()

    def _write_some(self, until: float) -> None:
        queue = self._queue
        while queue and time.monotonic() < until:
            size, write, *arguments = queue[0]
            write(*arguments)
            queue.popleft()
            self._taken += size
            if not self.waits and not self._closing:
                time.sleep(_YIELD_S)
        if not queue and not self._closing:
            time.sleep(min(_IDLE_S, max(0.0, until - time.monotonic())))

    def _fail(self, reason: str) -> None:
        readable = self._writer.stop()
        how = 'what was written can be read' if readable else (
            f'`rigid_sim recover {self.path}` restores what was written')
        self.error = f'recording has ended: {reason}; {how}'
        self._queue.clear()
        if self._on_error is not None:
            self._on_error(self.error)

    def _written(self) -> dict[str, int]:
        """Return how many messages each topic has so far."""
        return {topic.name: count for topic, count in zip(
            self.topics, self._writer.counts, strict=True) if count}

    def _write(self, stamp: int, channels: Sequence[int], messages: Sequence[bytes]) -> None:
        self._writer.write(channels, stamp, messages)
        self._messages += len(messages)

    def _write_step(self, stamp: int, step: int) -> None:
        if step != self._written_step:
            self._write(stamp, (self._step,), (encode_uint64(step),))
            self._written_step = step

    def _write_messages(self, stamp: int, step: int, channels: Sequence[int],
                        messages: Sequence[bytes]) -> None:
        self._write_step(stamp, step)
        self._write(stamp, channels, messages)

    def _write_event(self, stamp: int, event: Event) -> None:
        if event.kind == events.END:
            event = event._replace(arguments={**event.arguments, 'messages': self._written()})
        self._write(stamp, (self._event,), (encode_string(event.encode()),))
        if event.kind == 'reset':
            # It may have turned time back: the same number is then another step.
            self._written_step = None

    def _write_snapshot(self, stamp: int, step: int, data: bytes, begins_file: bool) -> None:
        if begins_file:
            if self._messages:
                self._writer.next_file()
            self._written_step = None
            self._write(stamp, (self._scene, self._session), self._head)
            if self._messages > len(self._head):
                self._write_event(stamp, Event(
                    None, step, events.WRITTEN, {'messages': self._written()}))
        self._write_step(stamp, step)
        self._write(stamp, (self._snapshot,), (encode_bytes(data),))


def _steady_clock() -> Callable[[], int]:
    """Return a clock that shows the time since 1970 and cannot be set."""
    offset = time.time_ns() - time.monotonic_ns()
    return lambda: time.monotonic_ns() + offset
