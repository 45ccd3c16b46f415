# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Ctrl-C, SIGTERM and SIGHUP as an event.

Python runs the handler of a signal in the main thread, between two of its instructions. Two things
can go wrong there: a system that hands the signal to another thread does not wake a main thread
that waits, and an event that the main thread is just waiting for cannot be set by itself. So the
handlers do nothing, and a thread that hears of signals through a socket sets the event.
"""
from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
import signal
import socket
import threading

# A terminal that is closed sends SIGHUP; a system without terminals has none.
_SIGNALS = tuple(getattr(signal, name) for name in ('SIGINT', 'SIGTERM', 'SIGHUP')
                 if hasattr(signal, name))

INTERRUPTED = 128 + signal.SIGINT    # the exit code after Ctrl-C, as a shell reports it


class Stop(threading.Event):
    """Set when the program is to end; `signal` is the number of the signal that said so, or 0."""

    signal = 0

    @property
    def exit_code(self) -> int:
        """What a shell expects of a program that a signal ended before it was done."""
        return 128 + self.signal if self.signal else 0


def stop_on_signals(stopped: Stop) -> Callable[[], None]:
    """
    Let SIGINT, SIGTERM and SIGHUP set the event; return what restores the handlers.

    SIGHUP stays ignored where it was: `nohup` starts a program so.
    """
    if threading.current_thread() is not threading.main_thread():
        return lambda: None         # only the main thread may set handlers
    heard, told = socket.socketpair()
    told.setblocking(False)
    numbers = [number for number in _SIGNALS if not (
        number not in (signal.SIGINT, signal.SIGTERM)
        and signal.getsignal(number) == signal.SIG_IGN)]

    def watch() -> None:
        while number := heard.recv(1):      # nothing: the other end is closed
            if number[0] in numbers:
                stopped.signal = stopped.signal or number[0]
                stopped.set()

    watching = threading.Thread(target=watch, name='signals', daemon=True)
    watching.start()
    told_before = signal.set_wakeup_fd(told.fileno(), warn_on_full_buffer=False)
    before = [signal.signal(number, lambda *_: None) for number in numbers]

    def restore() -> None:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
        signal.set_wakeup_fd(told_before)
        told.close()
        watching.join()
        heard.close()

    return restore


@contextmanager
def ended_by_ctrl_c() -> Iterator[None]:
    """
    Let Ctrl-C end this process at once in the block, which does nothing but import.

    KeyboardInterrupt would not always come out of an import: Python calls functions of its own
    meanwhile whose exceptions it prints and ignores. A handler that somebody has set stays.
    """
    if threading.current_thread() is not threading.main_thread() or (
            signal.getsignal(signal.SIGINT) is not signal.default_int_handler):
        yield
        return
    signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
