# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Compile the physics kernels before the first deadline, and say so while it takes.

Numba compiles at the first call and keeps the result in a cache: the first start on a machine
takes some ten seconds, every other one a fraction of a second.
"""
import sys
import threading
from time import monotonic
from typing import TextIO

from rigid_sim_ros.world import World

_QUIET = 1.0            # s: what takes no longer than this is not worth a line
_PERIOD = 1.0           # s between two updates on a terminal
_LOOK = 0.1             # s between two looks at whether to stop
_LOG_PERIOD = 5.0       # s between two lines in a log file
_TEXT = 'compiling the physics kernels (first start only)'


def warm_up(world: World, stopped: threading.Event, stream: TextIO = sys.stderr) -> None:
    """
    Run everything that a node does with a world on a copy of it.

    Returns early when `stopped` is set; compiling then goes on in a thread that ends with the
    process. Whatever fails raises here as it would have later.
    """
    failure: list[BaseException] = []

    def compile_all() -> None:
        try:
            _use(World(world.scene))
        except BaseException as error:      # carried over to the thread that waits
            failure.append(error)

    thread = threading.Thread(target=compile_all, name='warm_up', daemon=True)
    thread.start()
    _announce(thread, stopped, stream)
    if failure:
        raise failure[0]


def _use(world: World) -> None:
    """Call each kernel once, in the ways the node calls them."""
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
    update, announced = start + _QUIET, False
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
