# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names for the types that the engine passes around."""

from math import prod
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
# Inside a kernel a vector and a quaternion (x, y, z, w) are tuples: they live in registers,
# allocate nothing and let the compiler vectorise over bodies.
Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

_LINE = 64  # bytes that the processor fetches at once


def aligned_zeros(count: int) -> Array:
    """Return a flat array that begins on a line of the cache: eight numbers then need one line."""
    room = np.zeros(count + _LINE // 8)
    first = -room.ctypes.data % _LINE // 8
    return room[first:first + count]


def integers(*shape: int) -> IntArray:
    """
    Return whole numbers that are 0, from the beginning of a line of the cache on.

    Two cores that write to one line wait for each other each time, even if not to the same number.
    """
    return aligned_zeros(prod(shape)).view(np.int64).reshape(shape)
