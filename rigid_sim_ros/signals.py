# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Ctrl-C and SIGTERM as an event.

Python runs the handler of a signal in the main thread, between two of its instructions. Two things
can go wrong there: a system that hands the signal to another thread does not wake a main thread
that waits, and an event that the main thread is just waiting for cannot be set by itself. So the
handlers do nothing, and a thread that hears of signals through a socket sets the event.
"""
from collections.abc import Callable
import signal
import socket
import threading

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def stop_on_signals(stopped: threading.Event) -> Callable[[], None]:
    """Let SIGINT and SIGTERM set the event; return what restores the handlers."""
    if threading.current_thread() is not threading.main_thread():
        return lambda: None         # only the main thread may set handlers
    heard, told = socket.socketpair()
    told.setblocking(False)

    def watch() -> None:
        while number := heard.recv(1):      # nothing: the other end is closed
            if number[0] in _SIGNALS:
                stopped.set()

    watching = threading.Thread(target=watch, name='signals', daemon=True)
    watching.start()
    told_before = signal.set_wakeup_fd(told.fileno(), warn_on_full_buffer=False)
    before = [signal.signal(number, lambda *_: None) for number in _SIGNALS]

    def restore() -> None:
        for number, handler in zip(_SIGNALS, before, strict=True):
            signal.signal(number, handler)
        signal.set_wakeup_fd(told_before)
        told.close()
        watching.join()
        heard.close()

    return restore
