# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""xacro: macros that write a URDF, expanded by the package of that name."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from functools import cache
from io import StringIO
import os
from pathlib import Path
import stat
import sys
import threading
from typing import Any

from rigid_sim_ros.models.findings import ModelError
from rigid_sim_ros.models.xml_tree import MAX_BYTES
from rigid_sim_ros.problems import Problem
from rigid_sim_ros.reading import check

NEEDED = ("needs xacro, which is not installed: `pip install '.[xacro]'` in a clone of "
          'rigid_sim_ros, `pip install xacro`, or ROS 2 from apt')


def expanded(path: Path, arguments: Mapping[str, str]) -> bytes:
    """
    Return the URDF that a xacro file writes with these arguments; raises ModelError.

    xacro evaluates expressions and reads the files that they name: unlike the other formats it is
    a program, for files of those one trusts. None of the files may be such as nothing ends.
    """
    try:
        import xacro
    except ImportError:
        raise ModelError([Problem(NEEDED, '', str(path))]) from None
    told = StringIO()
    try:
        with redirect_stderr(told), redirect_stdout(told), _regular_files_only():
            document = xacro.process_file(str(path), mappings=dict(arguments))
            return bytes(document.toprettyxml(indent='  ', encoding='utf-8'))
    except (Exception, SystemExit) as error:  # whatever an expression in the file may raise
        words = ' '.join(str(error).split()) or type(error).__name__
        raise ModelError([Problem(f'xacro says: {words[:300]}', '', str(path))]) from None


_watched = threading.local()     # has an attribute in a thread in which xacro runs


@contextmanager
def _regular_files_only() -> Iterator[None]:
    """Let this thread open no pipe, device or file of /proc, which xacro would wait for."""
    _add_watch()
    _watched.is_on = True
    try:
        yield
    finally:
        del _watched.is_on


@cache
def _add_watch() -> None:
    """See what Python opens from now on; such a hook stays, and is asked once for each event."""
    sys.addaudithook(_watch)


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    if event != 'open' or not hasattr(_watched, 'is_on') or isinstance(arguments[0], int):
        return
    try:
        facts = os.stat(arguments[0])
    except (OSError, ValueError):   # whoever opens it is told
        return
    if not stat.S_ISDIR(facts.st_mode):
        check(facts, arguments[0], MAX_BYTES)
