# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""xacro: macros that write a URDF, expanded by the package of that name."""

from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

from rigid_sim_ros.models.findings import ModelError
from rigid_sim_ros.problems import Problem

NEEDED = ("needs xacro, which is not installed: `pip install '.[xacro]'` in a clone of "
          'rigid_sim_ros, `pip install xacro`, or ROS 2 from apt')


def expanded(path: Path, arguments: Mapping[str, str]) -> bytes:
    """
    Return the URDF that a xacro file writes with these arguments; raises ModelError.

    xacro evaluates expressions and reads the files that they name: unlike the other formats it is
    a program, for files of those one trusts.
    """
    try:
        import xacro
    except ImportError:
        raise ModelError([Problem(NEEDED, '', str(path))]) from None
    told = StringIO()
    try:
        with redirect_stderr(told), redirect_stdout(told):
            document = xacro.process_file(str(path), mappings=dict(arguments))
            return bytes(document.toprettyxml(indent='  ', encoding='utf-8'))
    except (Exception, SystemExit) as error:  # whatever an expression in the file may raise
        words = ' '.join(str(error).split()) or type(error).__name__
        raise ModelError([Problem(f'xacro says: {words[:300]}', '', str(path))]) from None
