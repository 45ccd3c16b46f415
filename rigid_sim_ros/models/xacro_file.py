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

from rigid_sim_ros.models.files import Folders
from rigid_sim_ros.models.findings import ModelError
from rigid_sim_ros.models.xml_tree import MAX_BYTES
from rigid_sim_ros.problems import Problem
from rigid_sim_ros.reading import check

NEEDED = ("needs xacro, which is not installed: `pip install '.[xacro]'` in a clone of "
          'rigid_sim_ros, `pip install xacro`, or ROS 2 from apt')


def expanded(path: Path, arguments: Mapping[str, str], folders: Folders) -> bytes:
    """
    Return the URDF that a xacro file writes with these arguments; raises ModelError.

    `$(find PACKAGE)` is the folder that package:// has. xacro evaluates expressions and reads the
    files that they name: unlike the other formats it is a program, for files of those one trusts.
    None of the files may be such as nothing ends.
    """
    try:
        import xacro
    except ImportError:
        raise ModelError([Problem(NEEDED, '', str(path))]) from None
    told = StringIO()
    try:
        with (redirect_stderr(told), redirect_stdout(told), _regular_files_only(),
              _packages_of(folders)):
            document = xacro.process_file(str(path), mappings=dict(arguments))
            return bytes(document.toprettyxml(indent='  ', encoding='utf-8'))
    except (Exception, SystemExit) as error:  # whatever an expression in the file may raise
        words = ' '.join(str(error).split()) or type(error).__name__
        place = _file_at_work(path)
        raise ModelError([Problem(f'xacro says: {words[:300]}', '', place)]) from None


def _file_at_work(path: Path) -> str:
    """Return the file in which xacro stopped, which is that of the model or an included one."""
    import xacro

    return str((getattr(xacro, 'filestack', None) or [path])[-1] or path)


_expanding = threading.Lock()


@contextmanager
def _packages_of(folders: Folders) -> Iterator[None]:
    """
    Let xacro find packages where models find theirs, also those of no sourced workspace.

    xacro has no argument for that: within this block its own function is another one, for the
    whole process. So one file is expanded at a time.
    """
    from xacro import substitution_args

    def find(name: str) -> str:
        folder = folders.package(name)
        if folder is None:
            raise ValueError(f'package {name[:60]!r} is not found, must be named by `packages: '
                             '{NAME: FOLDER}`, or be in AMENT_PREFIX_PATH, or around the model')
        return str(folder)

    with _expanding:
        original = substitution_args._eval_find
        substitution_args._eval_find = substitution_args._eval_dict['find'] = find
        try:
            yield
        finally:
            substitution_args._eval_find = substitution_args._eval_dict['find'] = original


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
