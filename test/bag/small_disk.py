# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A real file system that is full soon."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import subprocess

import pytest

SIZE = 6 << 20      # bytes


@contextmanager
def mounted(folder: Path) -> Iterator[Path]:
    """Mount a file system of 6 MB, where that is permitted; skip the test where it is not."""
    folder.mkdir()
    done = subprocess.run(['mount', '-t', 'tmpfs', '-o', f'size={SIZE}', 'tmpfs', str(folder)],
                          capture_output=True, text=True, check=False)
    if done.returncode:
        reason = f'a small file system cannot be mounted here: {done.stderr.strip()}'
        print(reason)
        pytest.skip(reason)
    try:
        yield folder
    finally:
        subprocess.run(['umount', '-l', str(folder)], check=True)


def make_read_only(folder: Path) -> None:
    """Let nobody write to a mounted file system any more, not even root."""
    subprocess.run(['mount', '-o', 'remount,ro', str(folder)], check=True)
