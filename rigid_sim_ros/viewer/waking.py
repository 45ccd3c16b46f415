# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Wake what sends messages to pages from the thread in which it waits.

viser keeps messages in a buffer that all threads may fill, and wakes who sends them twice: through
the event loop, as asyncio demands, and at once, from the thread that brings the message. The
latter goes through the list of those that wait while the loop may change it: now and then, with
several pages, a RuntimeError for whoever moved a body.
"""

import asyncio
from collections.abc import Callable
from typing import Any

import viser
from viser.infra import _infra

_Buffer: Any = getattr(_infra, 'AsyncMessageBuffer', None)
if _Buffer is None:
    raise ImportError(f'viser {viser.__version__} keeps its messages in another way than 1.1, '
                      "for which the page was written; pip install 'viser>=1.1,<1.2'")


def only_in_a_loop(act: Callable[[], None]) -> Callable[[], None]:
    """Return what does the same in a thread that runs an event loop, and nothing in others."""

    def checked() -> None:
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        act()

    return checked


class _SafeBuffer(_Buffer):

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        event: Any = self.message_event
        event.set = only_in_a_loop(event.set)


def wake_in_the_loop() -> None:
    """Let all servers that are started from now on wake their senders through the loop alone."""
    _infra.AsyncMessageBuffer = _SafeBuffer  # type: ignore[misc]
