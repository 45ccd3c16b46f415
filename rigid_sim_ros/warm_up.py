# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Compile the physics kernels before they are needed, and say so while it takes.

Numba compiles at the first call and keeps the result in a cache: the first start on a machine
takes half a minute or so, every other one a fraction of a second.
"""
import atexit
from collections.abc import Callable
import contextlib
import os
import sys
import threading
from time import monotonic
from typing import Any, TextIO, TypeVar

from numba.core import event

from rigid_sim_ros.kernels import helper_process
from rigid_sim_ros.scene import Scene
from rigid_sim_ros.signals import INTERRUPTED, Stop
from rigid_sim_ros.world import World

QUIET = 3.0             # s: to load what was compiled takes less, also on a busy machine
_PERIOD = 1.0           # s between two updates on a terminal
_LOOK = 0.1             # s between two looks at whether to stop
_LOG_PERIOD = 5.0       # s between two lines in a log file
_T = TypeVar('_T')

_TEXT = 'compiling the physics kernels'
_HINT = ' (first start only)'


class Stopped(Exception):
    """What was asked for was not done, because the program is to end."""


def warm_up(scene: Scene, stopped: Stop | None = None, stream: TextIO | None = None) -> None:
    """
    Run everything that is done with a world on another one of the same scene.

    Stopped, and soon, when `stopped` is set. Whatever fails raises here as it would have later.
    """
    watched(lambda: use(World(scene)), stopped, stream)
    announce_later()


def announce_later() -> None:
    """
    Say so from now on whenever somebody waits for the compiler outside of `watched`.

    A world begins to step without the pieces that it hardly ever calls, and waits where it needs
    one that is not there yet.
    """
    if not _later:
        _later.append(_Later())
        _later[0].__enter__()


def announced(work: Callable[[], _T], stream: TextIO | None = None) -> _T:
    """Do something that may have to compile kernels first, say so while it takes; return it."""
    return watched(work, None, stream)


def watched(
    work: Callable[[], _T], stopped: Stop | None, stream: TextIO | None = None,
) -> _T:
    """
    Do something as `announced` does, until `stopped` is set; then raise Stopped.

    The compiler cannot be interrupted. It goes on in a thread that ends with the process, and what
    it has compiled until then is in the cache.
    """
    stopped = stopped or Stop()
    results: list[_T] = []
    failures: list[BaseException] = []
    # Not `is_alive`: of a thread that KeyboardInterrupt stops `join` waiting for, Python 3.11 says
    # that it has ended.
    done = threading.Event()

    def guarded() -> None:
        try:
            results.append(work())
        except BaseException as error:      # carried over to the thread that waits
            failures.append(error)
        finally:
            done.set()

    thread = threading.Thread(target=guarded, name='warm_up', daemon=True)
    with _Compiler() as compiler:
        thread.start()
        _watching.append(compiler)
        try:
            _announce(done, compiler, stopped, stream or sys.stderr)
        finally:
            _watching.remove(compiler)
            if not done.is_set():
                atexit.register(_end, stopped.exit_code or INTERRUPTED)
    if not done.is_set():
        raise Stopped
    if failures:
        raise failures[0]
    return results[0]


def _end(code: int) -> None:
    """End this process at once: LLVM aborts where it is taken down under a thread that uses it."""
    for stream in (sys.stdout, sys.stderr):
        # There may be none, or nobody who reads it.
        with contextlib.suppress(AttributeError, OSError, ValueError):
            stream.flush()
    os._exit(code)


def use(world: World) -> None:
    """Call each kernel once, in the ways in which a node or a program may call them later."""
    bodies = world.scene.spec.bodies
    name = next((body.name for body in bodies if body.is_pushed), bodies[0].name)
    for duration in (None, 1.0):
        world.apply_wrench(name, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 'world', duration=duration,
                           source='warm_up')
    world.step(1)
    world.step(2)
    for attribute in ('position', 'orientation', 'linear_velocity', 'angular_velocity'):
        getattr(world, attribute)
    world.kinetic_energy()
    world.potential_energy()
    world.total_momentum()
    world.total_angular_momentum()
    world.contact_wrenches()
    world.contact_report()
    with contextlib.suppress(ValueError):   # of a body that joints hold to the world
        world.set_pose(name, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    world.set_twist(name, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    world.apply_impulse(name, (0.0, 0.0, 0.0), point=(0.0, 0.0, 0.0), frame=name)
    for joint, position in zip(world.joint_names, world.joint_position, strict=True):
        world.joint_wrench(joint)
        with contextlib.suppress(ValueError):   # of one that follows another, or has no coordinate
            world.set_joint_state(joint, position)
            break
    world.state_hash()
    world.restore(world.save())
    world.reset()


class _Compiler(event.Listener):
    """Knows whether this process compiles, or waits for a helper that does, and for how long."""

    def __init__(self) -> None:
        self._depth = 0
        self._since = self._before = 0.0

    def __enter__(self) -> '_Compiler':
        """Listen until the end of the block."""
        register: Any = event.register
        register('numba:compile', self)
        helper_process.waiting.append(self._tell)
        return self

    def __exit__(self, *_: object) -> None:
        unregister: Any = event.unregister
        unregister('numba:compile', self)
        helper_process.waiting.remove(self._tell)

    @property
    def is_at_work(self) -> bool:
        """Whether it compiles now."""
        return self._depth > 0

    @property
    def seconds(self) -> float:
        """How long it has compiled."""
        return self._before + (monotonic() - self._since if self._depth else 0.0)

    def on_start(self, event: Any) -> None:
        """Note that something, or a part of it, is compiled."""
        self._tell(True)

    def on_end(self, event: Any) -> None:
        """Note that it is compiled."""
        self._tell(False)

    def _tell(self, begins: bool) -> None:
        if begins:
            self._depth += 1
            if self._depth == 1:
                self._since = monotonic()
                self._begin()
        elif self._depth > 0:   # else it began before somebody listened
            self._depth -= 1
            if self._depth == 0:
                self._before += monotonic() - self._since
                self._end()

    def _begin(self) -> None:
        """Do nothing: the compiler is at work from now on."""

    def _end(self) -> None:
        """Do nothing: it no longer is."""


class _Later(_Compiler):
    """Says by itself that somebody waits for the compiler, where `watched` does not."""

    def __init__(self) -> None:
        super().__init__()
        self._timer = threading.Timer(QUIET, self._say)
        self._has_said = False

    def _begin(self) -> None:
        self._timer = threading.Timer(QUIET, self._say)
        self._timer.daemon = True
        self._timer.start()

    def _say(self) -> None:
        if self.is_at_work and not _watching:
            self._has_said = True
            print(f'{_TEXT}: a step waits for one more', file=sys.stderr, flush=True)

    def _end(self) -> None:
        self._timer.cancel()
        if self._has_said:
            self._has_said = False
            print(f'{_TEXT} took {monotonic() - self._since:.1f} s', file=sys.stderr, flush=True)


_watching: list[_Compiler] = []     # within `watched`
_later: list[_Later] = []           # one at most, until the process ends


_hints = [_HINT]    # said once in a process


def _announce(
    done: threading.Event, compiler: _Compiler, stopped: threading.Event, stream: TextIO,
) -> None:
    on_terminal = stream.isatty()
    period, end = (_PERIOD, '') if on_terminal else (_LOG_PERIOD, '\n')
    update, text = QUIET, ''
    while not (done.is_set() or stopped.is_set()):
        done.wait(_LOOK)
        seconds = compiler.seconds
        if compiler.is_at_work and seconds >= update and not done.is_set():
            text = text or _TEXT + (_hints.pop() if _hints else '')
            line = f'{text} ... {seconds:.0f} s'
            print(f'\r{line}' if on_terminal else line, end=end, file=stream, flush=True)
            update = seconds + period
            text = text if on_terminal else _TEXT   # in a log each line stays
    if text and on_terminal:
        print(file=stream)
    if text and done.is_set():
        print(f'{_TEXT} took {compiler.seconds:.1f} s', file=stream, flush=True)
