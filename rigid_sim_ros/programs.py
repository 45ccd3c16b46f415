# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The programs of the package, as they are started from a shell, by `ros2 run` and by `python -m`.

To import what a program needs takes about a second. This module imports nearly nothing itself, so
that Ctrl-C during that second ends the program without a traceback.
"""
import gc
from importlib import import_module
import sys
from typing import NoReturn

from rigid_sim_ros.signals import ended_by_ctrl_c, INTERRUPTED

_MODULES = {
    'rigid_sim': 'rigid_sim_ros.cli',
    'replay': 'rigid_sim_ros.nodes.replay.node',
    'simulate': 'rigid_sim_ros.nodes.simulate',
    'view': 'rigid_sim_ros.nodes.view',
}


def start(name: str) -> NoReturn:
    """
    Run a program with the arguments of this process and leave with its exit code.

    Python ends with a search for cycles in all that was imported, which takes 0.15 of the 1 s of a
    short run. Nothing of it is left to be closed, so it is not looked through.
    """
    with ended_by_ctrl_c():
        module = import_module(_MODULES[name])
    try:
        sys.exit(module.main())
    except KeyboardInterrupt:       # before the program listens to signals itself, or after
        sys.exit(INTERRUPTED)
    finally:
        gc.freeze()


def rigid_sim() -> NoReturn:
    """Run the command `rigid_sim`."""
    start('rigid_sim')


def replay() -> NoReturn:
    """Run the ROS executable `replay`."""
    start('replay')


def simulate() -> NoReturn:
    """Run the ROS executable `simulate`."""
    start('simulate')


def view() -> NoReturn:
    """Run the ROS executable `view`."""
    start('view')


if __name__ == '__main__':      # python -m rigid_sim_ros.programs NAME ...
    start(sys.argv.pop(1))
