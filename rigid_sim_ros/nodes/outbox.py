# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Messages that are sent between steps, as time allows.

To send on the two topics of each of a hundred bodies takes about as long as a step may take, so
done at once it would make the next step late.
"""
from collections import deque
from collections.abc import Iterable
from time import monotonic_ns
from typing import Any


class Outbox:
    """What is still to be sent, in the order in which it came; for one thread."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Any, bytes]] = deque()

    def put(self, handles: Iterable[Any], messages: Iterable[bytes]) -> None:
        """Take messages in, one for each handle of a publisher."""
        self._waiting.extend(zip(handles, messages, strict=True))

    def send(self, until_ns: float) -> bool:
        """Send until all is sent or that time of the steady clock; return whether any was sent."""
        waiting = self._waiting
        before = len(waiting)
        while waiting and monotonic_ns() < until_ns:
            handle, data = waiting.popleft()
            handle.publish_raw(data)
        return len(waiting) < before
