# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names for the types that the engine passes around, and room for arrays."""

from contextlib import suppress
from itertools import count as counter
from math import prod
import mmap
import sys
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
# Inside a kernel a vector and a quaternion (x, y, z, w) are tuples: they live in registers,
# allocate nothing and let the compiler vectorise over bodies.
Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

_LINE = 64  # bytes that the processor fetches at once
_LARGE = 1 << 14    # bytes of an array that gets pages of its own
_rooms = counter()


def room(*shape: int, kind: Any = np.float64) -> Any:
    """
    Return an array of zeros that begins on a line of the cache: eight numbers then need one line.

    A large one takes memory only where it is written to, page by page. So room for all contacts
    that there might be takes what there are. NumPy would often have to write the zeros, and of
    much room it would get 2 MB at a time.
    """
    size = prod(shape) * np.dtype(kind).itemsize
    if size < _LARGE:
        near = np.zeros(size + _LINE, dtype=np.uint8)
        first = -near.ctypes.data % _LINE
    else:
        # Not all at the start of a page: they would want the same few lines of the cache.
        first = next(_rooms) * 5 * _LINE % mmap.PAGESIZE
        near = np.frombuffer(_pages(first + size), dtype=np.uint8)
    return near[first:first + size].view(kind).reshape(shape)


def _pages(size: int) -> mmap.mmap:
    """Return zeros from the system."""
    if sys.platform == 'win32':
        return mmap.mmap(-1, size)
    pages = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if sys.platform == 'linux':
        with suppress(OSError):     # of a system that has no large pages
            pages.madvise(mmap.MADV_NOHUGEPAGE)
    return pages


def integers(*shape: int) -> IntArray:
    """
    Return whole numbers that are 0, as `room` does.

    Two cores that write to one line wait for each other each time, even if not to the same number.
    """
    zeros: IntArray = room(*shape, kind=np.int64)
    return zeros
