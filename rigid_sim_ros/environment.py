# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a process must be allowed before it begins: what is missing is said in one line."""

import os
from pathlib import Path
import resource

# [bytes] of address space, most of it never touched: LLVM, DDS and the stacks of their threads.
# With less they abort somewhere in the middle.
_LEAST_MEMORY = 1_200_000_000
# [bytes] the same with VTK, whose drawing in software needs 1.6e9 for a picture of usual size.
_LEAST_MEMORY_FOR_PICTURES = 2_000_000_000
_LEAST_FILES = 64       # that a node has open: sockets, libraries, a bag
_GOOD_FILES = 1024


class EnvironmentProblem(OSError):
    """Something that the system does not allow; the message says what and what to do."""


def check_engine() -> None:
    """Raise EnvironmentProblem where the engine cannot run."""
    if os.environ.get('NUMBA_DISABLE_JIT', '0').strip() not in ('', '0'):
        raise EnvironmentProblem('NUMBA_DISABLE_JIT is set, and the physics is compiled by Numba: '
                                 'unset it')
    _check_memory(_LEAST_MEMORY)


def check_pictures() -> None:
    """Raise EnvironmentProblem where pictures cannot be drawn."""
    _check_memory(_LEAST_MEMORY_FOR_PICTURES)


def _check_memory(least: int) -> None:
    allowed, _ = resource.getrlimit(resource.RLIMIT_AS)
    if allowed != resource.RLIM_INFINITY and allowed < least:
        raise EnvironmentProblem(
            f'the address space is limited to {allowed / 1e6:.0f} MB, must be '
            f'{least / 1e6:.0f} MB or more: `ulimit -v unlimited`')


def check_node() -> None:
    """Raise EnvironmentProblem where a node cannot run; open more files where that is allowed."""
    check_engine()
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY or soft >= _GOOD_FILES:
        return
    most = _GOOD_FILES if hard == resource.RLIM_INFINITY else min(hard, _GOOD_FILES)
    if most < _LEAST_FILES:
        raise EnvironmentProblem(f'only {most} files may be open at a time, must be '
                                 f'{_LEAST_FILES} or more: `ulimit -n {_GOOD_FILES}`')
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))


def has_place_for_logs() -> bool:
    """Return whether there is a folder for the log files of ROS, which else does not start."""
    folder = os.environ.get('ROS_LOG_DIR') or os.environ.get('ROS_HOME')
    if not folder:
        home = os.environ.get('HOME')
        if not home:
            return False
        folder = os.path.join(home, '.ros', 'log')
    path = Path(folder).expanduser()
    while not path.exists() and path != path.parent:    # ROS makes it where it may
        path = path.parent
    return path.is_dir() and os.access(path, os.W_OK | os.X_OK)
