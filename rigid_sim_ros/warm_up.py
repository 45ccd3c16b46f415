# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Compile the physics kernels before they are needed, and say so while it takes.

Numba compiles at the first call and keeps the result in a cache: the first start on a machine
takes half a minute or so, every other one a fraction of a second.
"""
from collections.abc import Callable
import sys
import threading
from time import monotonic
from typing import TextIO, TypeVar

from rigid_sim_ros.scene import Scene
from rigid_sim_ros.world import World

QUIET = 3.0            # s: to load what was compiled takes less, also on a busy machine
_PERIOD = 1.0           # s between two updates on a terminal
_LOOK = 0.1             # s between two looks at whether to stop
_LOG_PERIOD = 5.0       # s between two lines in a log file
_T = TypeVar('_T')

_TEXT = 'compiling the physics kernels (first start only)'


def warm_up(
    scene: Scene, stopped: threading.Event | None = None, stream: TextIO | None = None,
) -> None:
    """
    Run everything that is done with a world on another one of the same scene.

    Returns early when `stopped` is set; compiling then goes on in a thread that ends with the
    process. Whatever fails raises here as it would have later.
    """
    watched(lambda: use(World(scene)), stopped or threading.Event(), stream or sys.stderr)


def announced(work: Callable[[], _T], stream: TextIO | None = None) -> _T:
    """Do something that may have to compile kernels first, say so while it takes; return it."""
    return watched(work, threading.Event(), stream or sys.stderr)[0]


def watched(work: Callable[[], _T], stopped: threading.Event, stream: TextIO) -> list[_T]:
    """Do something as `announced` does; return a list of its result, empty if it was stopped."""
    results: list[_T] = []
    failures: list[BaseException] = []

    def guarded() -> None:
        try:
            results.append(work())
        except BaseException as error:      # carried over to the thread that waits
            failures.append(error)

    thread = threading.Thread(target=guarded, name='warm_up', daemon=True)
    thread.start()
    _announce(thread, stopped, stream)
    if failures:
        raise failures[0]
    return results


def use(world: World) -> None:
    """Call each kernel once, in the ways a node calls them."""
    name = world.names[0]
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
    world.set_pose(name, world.position[0], world.orientation[0])
    world.set_twist(name, world.linear_velocity[0], world.angular_velocity[0])
    world.state_hash()
    world.reset()


def _announce(thread: threading.Thread, stopped: threading.Event, stream: TextIO) -> None:
    start = monotonic()
    on_terminal = stream.isatty()
    period, end = (_PERIOD, '') if on_terminal else (_LOG_PERIOD, '\n')
    update, announced = start + QUIET, False
    while thread.is_alive() and not stopped.is_set():
        thread.join(_LOOK)
        if monotonic() >= update and thread.is_alive():
            line = f'{_TEXT} ... {monotonic() - start:.0f} s'
            print(f'\r{line}' if on_terminal else line, end=end, file=stream, flush=True)
            update, announced = monotonic() + period, True
    if announced and on_terminal:
        print(file=stream)
    if announced and not thread.is_alive():
        print(f'{_TEXT} took {monotonic() - start:.1f} s', file=stream, flush=True)
