# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Threads that bring messages to pages leave the list of those that wait alone."""
import asyncio
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
import threading
from unittest import SkipTest

if find_spec('viser') is None:
    raise SkipTest('viser is not installed: pip install .[view]')

from rigid_sim_ros.viewer.server import start, stop


def test_only_the_loop_wakes_who_waits_for_messages():
    server = start('127.0.0.1', 0)
    kind = type(server._websock_server.get_message_buffer())

    async def wait_for_another_thread() -> tuple[bool, bool]:
        # One like the server's, that the server does not know: its loop wakes it never.
        event = kind(asyncio.get_running_loop(), persistent_messages=False).message_event
        waiter = asyncio.ensure_future(event.wait())
        await asyncio.sleep(0)
        thread = threading.Thread(target=event.set)
        thread.start()
        thread.join()
        await asyncio.sleep(0)
        early = waiter.done()
        asyncio.get_running_loop().call_soon(event.set)
        return early, await asyncio.wait_for(waiter, 10.0)

    try:
        # The loop of a browser that other tests share may run in this thread.
        with ThreadPoolExecutor(1) as pool:
            answers = pool.submit(asyncio.run, wait_for_another_thread()).result()
        assert answers == (False, True)
    finally:
        stop(server)
