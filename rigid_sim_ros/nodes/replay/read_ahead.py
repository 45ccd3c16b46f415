# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Read a bag in a thread of its own, a little ahead of what is played."""

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Sequence
import threading

from rigid_sim_ros.bag.playable_files import Message, TIME

# [bytes] What may be ready at most, besides one group. It has to outlast a disk that is slow for
# a moment: 100 bodies at 100 Hz make 3 MB/s.
_MOST = 16 << 20
_MESSAGE = 150      # bytes that a message takes besides its data


class ReadAhead:
    """Messages of a bag that are ready, or will be."""

    def __init__(
        self, groups: Iterator[tuple[int, list[Message]]], on_ready: Callable[[], None],
    ) -> None:
        """Begin to read; `on_ready` is called from the thread when a wait is over."""
        self._groups = groups
        self._on_ready = on_ready
        self._ready: deque[tuple[int, list[Message], int]] = deque()
        self._next = 0                  # index into the first group
        self._size = 0
        self._waits = False             # the player found nothing
        self._ended = False
        self._closed = False
        self._error: BaseException | None = None
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name='read ahead', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop reading."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join()

    def head(self) -> Message | None:
        """Return the next message, None if none is ready; BagError where reading failed."""
        with self._changed:
            if self._ready:
                return self._ready[0][1][self._next]
            if self._error is not None:
                raise self._error
            self._waits = not self._ended
            return None

    @property
    def is_at_end(self) -> bool:
        """Whether there is nothing more to come."""
        with self._changed:
            return self._ended and not self._ready and self._error is None

    def wait(self, seconds: float) -> None:
        """Wait until something is ready, or the end is reached, at most this long."""
        with self._changed:
            self._changed.wait_for(lambda: self._ready or self._ended, seconds)

    def take(self, until_ns: int, most: int) -> tuple[int, Sequence[Message]]:
        """Take out what is ready up to a time; return it with the number of its file."""
        with self._changed:
            if not self._ready:
                return 0, ()
            file, group, size = self._ready[0]
            begin = self._next
            end = bisect_right(
                group, until_ns, begin, min(begin + most, len(group)), key=TIME)
            self._next = end
            if end == len(group):
                self._ready.popleft()
                self._next = 0
                self._size -= size
                self._changed.notify_all()
        return file, group[begin:end]

    def _run(self) -> None:
        try:
            for file, group in self._groups:
                size = sum(len(data) for _, _, data in group) + _MESSAGE * len(group)
                with self._changed:
                    self._changed.wait_for(lambda: self._closed or self._size < _MOST)
                    if self._closed:
                        return
                    self._ready.append((file, group, size))
                    self._size += size
                self._tell()
        except BaseException as error:      # carried over to the thread that plays
            self._error = error
        finally:
            self._ended = True
            self._tell()

    def _tell(self) -> None:
        with self._changed:
            waits, self._waits = self._waits, False
            self._changed.notify_all()
        if waits:
            self._on_ready()
