# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Read files that somebody else may have made.

A name may be that of a pipe, which waits for a writer, of a device or a file of /proc without an
end, of a ring of links, or of more bytes than there is memory.
"""

import errno
from functools import cache
import os
from pathlib import Path
import stat

# [bytes] of a file: what is scanned very finely has some ten millions.
MOST_BYTES = 2 ** 28


def bytes_of(path: str | os.PathLike[str], most: int = MOST_BYTES) -> bytes:
    """Return the bytes of a regular file; OSError where it is none, so that nothing waits."""
    # Without O_NONBLOCK a pipe would wait for somebody to write into it.
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), 'rb') as file:
        facts = os.fstat(file.fileno())
        check(facts, path, most)
        return file.read(facts.st_size)


def check(facts: os.stat_result, path: str | os.PathLike[str], most: int = MOST_BYTES) -> None:
    """Raise OSError for what is no regular file of a disk, or a larger one."""
    if not stat.S_ISREG(facts.st_mode):
        raise OSError(errno.EINVAL, 'not a regular file, must be one', str(path))
    if facts.st_dev == _device_of_proc():   # may have no end, and waits for what happens
        raise OSError(errno.EINVAL, 'a file of /proc, must be another one', str(path))
    if facts.st_size > most:
        raise OSError(errno.EFBIG, f'larger than {most / 1e6:g} MB, must be smaller', str(path))


@cache
def _device_of_proc() -> int | None:
    """Return what tells the files of /proc from others, None where it is not mounted."""
    return os.stat('/proc').st_dev if os.path.ismount('/proc') else None


def is_inside(path: Path, folder: Path) -> bool:
    """Return whether a path is in a folder when all links are followed; a ring leads nowhere."""
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))
