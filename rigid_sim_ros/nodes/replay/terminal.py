# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A person at the keyboard: keys where stdin is a terminal, a progress bar where stdout is."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
import os
import re
import select
import signal
import sys
import termios
import threading
import time
import tty
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn

from rigid_sim_ros.nodes.replay.player import Status
from rigid_sim_ros.times import SECOND

HELP = 'space pause · ← → 5 s back, on · ↑ ↓ faster, slower · s single step · q quit'

_PERIOD = 0.1           # s between two looks at the keyboard and the end, and two pictures

# Keys as terminals send them: arrows as ESC [ A, or ESC O A in the mode for applications.
_KEY = re.compile(rb'\x1b[\[O][0-9;]*[A-Za-z~]|\x1b.?|.', re.DOTALL)
_ARROW = re.compile(rb'\x1b[\[O]([ABCD])')
_ARROWS = {b'A': 'up', b'B': 'down', b'C': 'right', b'D': 'left'}


class Keyboard:
    """The keys that are pressed; without a terminal, or in the background, there are none."""

    def __init__(self) -> None:
        # Only the main thread may take the signals that this needs.
        is_main = threading.current_thread() is threading.main_thread()
        self._handle = (sys.stdin.fileno()
                        if is_main and sys.stdin and sys.stdin.isatty() else -1)

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Take keys at once and without echo; restore the terminal whatever happens."""
        if not self._is_ours():
            self._handle = -1
            yield
            return
        before = termios.tcgetattr(self._handle)
        # Who stops a process with Ctrl-Z and continues it gets back what the shell has set.
        continued = signal.signal(signal.SIGCONT, lambda *_: self._take_over())
        try:
            self._take_over()
            yield
        finally:
            signal.signal(signal.SIGCONT, continued)
            if self._is_ours():
                termios.tcsetattr(self._handle, termios.TCSADRAIN, before)

    def keys(self, seconds: float) -> list[str]:
        """Wait for keys, at most this long, and return them: left, right, up, down, or letters."""
        if not self._is_ours():
            time.sleep(seconds)
            return []
        if not select.select([self._handle], [], [], seconds)[0]:
            return []
        try:
            data = os.read(self._handle, 1024)
        except OSError:
            data = b''
        if not data:        # the terminal is gone
            self._handle = -1
        return [_name(match[0]) for match in _KEY.finditer(data)]

    @property
    def is_there(self) -> bool:
        """Whether there may be keys."""
        return self._handle >= 0

    def _is_ours(self) -> bool:
        # In the background to touch the terminal means to be stopped.
        try:
            return self._handle >= 0 and os.tcgetpgrp(self._handle) == os.getpgrp()
        except OSError:
            return False

    def _take_over(self) -> None:
        if self._is_ours():
            tty.setcbreak(self._handle)


class Bar:
    """A progress bar, where stdout is a terminal."""

    def __init__(self, name: str) -> None:
        self._progress: Progress | None = None
        self._task = TaskID(0)
        console = Console(highlight=False, markup=False, emoji=False)
        if console.is_terminal:
            self._progress = Progress(
                TextColumn('{task.description}', markup=False), BarColumn(bar_width=None),
                TextColumn('{task.fields[times]}'), console=console, auto_refresh=False,
                expand=True)
            self._task = self._progress.add_task(name, times='')

    @contextmanager
    def shown(self) -> Iterator[None]:
        """Show the bar for as long as this lasts."""
        if self._progress is None:
            yield
            return
        with self._progress:
            yield

    def update(self, status: Status) -> None:
        """Show where the replay is."""
        if self._progress is not None:
            # A bag that lasts no time is full from the start.
            self._progress.update(
                self._task, total=max(1, status.length_ns), completed=status.position_ns or 1,
                times=times_text(status), refresh=True)


def times_text(status: Status) -> str:
    """Return elapsed and total time and the rate."""
    total = f'{status.length_ns / SECOND:.2f}'
    state = 'paused' if status.is_paused else f'x{status.rate:g}'
    if not status.has_begun:
        state = 'waits for subscribers'
    return f'{status.position_ns / SECOND:{len(total)}.2f} / {total} s {state:>6}'


def attend(
    bar: Bar, keyboard: Keyboard, status: Callable[[], Status],
    actions: Mapping[str, Callable[[], Any]], stopped: threading.Event,
) -> None:
    """Show the progress and do what the keys say until the replay has stopped."""
    if keyboard.is_there:
        print(HELP, file=sys.stderr)
    with keyboard.listening(), bar.shown():
        while not stopped.is_set():
            bar.update(status())
            if keyboard.is_there:
                for key in keyboard.keys(_PERIOD):
                    actions.get(key, _nothing)()
            else:
                stopped.wait(_PERIOD)
        bar.update(status())


def _name(key: bytes) -> str:
    arrow = _ARROW.fullmatch(key)
    return _ARROWS[arrow[1]] if arrow else key.decode(errors='replace')


def _nothing() -> None:
    """Ignore a key."""
