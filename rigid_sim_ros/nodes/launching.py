# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the launch files have in common, with nothing imported that only ROS from apt has."""
from itertools import pairwise
import os
import sys


def ends_launch(given: str, file: str) -> bool:
    """
    Return whether a launch ends with the node of a launch file.

    `given` is the argument of that name; without one a launch ends that was started with this
    file, and not with another one that includes it.
    """
    return given.lower() in ('true', '1') if given else _is_launched(sys.argv, file)


def _is_launched(words: list[str], file: str) -> bool:
    """Return whether a command line names a launch file, not another one of its name."""
    return any(
        (package, word) == ('rigid_sim_ros', os.path.basename(file))
        or (os.path.exists(word) and os.path.samefile(word, file))
        for package, word in pairwise(words))
