# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What comes to the page's port and is no message of a page ends that connection, with one line.

viser takes every message for one of its own page, and what is none ends in a traceback.
"""

import asyncio
from collections.abc import Awaitable, Callable
import logging
import sys
from typing import Any

from websockets.exceptions import ConnectionClosed

Handler = Callable[[Any], Awaitable[None]]

_UNSUPPORTED = 1003     # of RFC 6455, 7.4.1: data of a kind that is not accepted
# What websockets logs with a traceback: of who does not speak HTTP, and of who is gone before the
# answer, among other things.
_FAILED_HANDSHAKE = 'opening handshake failed'
_UNEXPECTED = 'unexpected internal error'


def patient(handler: Handler) -> Handler:
    """Return a handler of connections that closes those on which it cannot go on."""

    async def handle(connection: Any) -> None:
        asyncio.get_running_loop().set_exception_handler(_on_failed_task)
        try:
            await handler(connection)
        except ConnectionClosed:
            raise
        except Exception as error:
            _say(error)
            await connection.close(_UNSUPPORTED)

    logging.getLogger('websockets.server').addFilter(_is_worth_a_traceback)
    return handle


def _is_worth_a_traceback(record: logging.LogRecord) -> bool:
    """Return whether a record of the log is not about what strangers do; say in a line what is."""
    error = record.exc_info[1] if record.exc_info else None
    if record.getMessage() == _UNEXPECTED and isinstance(error, Exception):
        _say(error)
        return False
    return record.getMessage() != _FAILED_HANDSHAKE


def _on_failed_task(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    if isinstance(error := context.get('exception'), Exception):
        _say(error)
    else:
        loop.default_exception_handler(context)


def _say(error: Exception) -> None:
    text = ascii(f'{type(error).__name__}: {error}'.rstrip(': '))[1:-1][:200]
    print(f'rigid_sim: refused what a page sent: {text}', file=sys.stderr, flush=True)
