# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a name may lead to besides a file that can be read."""

from collections.abc import Callable
import os
from pathlib import Path


def sparse(path: Path) -> None:
    """Make a file of 3 GB that takes no room."""
    with path.open('wb') as file:
        file.truncate(3 << 30)


KINDS: dict[str, Callable[[Path], None]] = {
    'pipe': lambda path: os.mkfifo(path),
    'device': lambda path: path.symlink_to('/dev/zero'),
    'folder': lambda path: path.mkdir(),
    'ring of links': lambda path: path.symlink_to(path.name),
    'file of /proc without an end': lambda path: path.symlink_to('/proc/self/pagemap'),
    'file of /proc that waits': lambda path: path.symlink_to('/proc/kmsg'),
    'sparse file': sparse,
}
