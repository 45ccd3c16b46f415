# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers and names that users give to a world, checked."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.scene.values import UNIT_TOLERANCE


def step_count(count: Any) -> int:
    """Return a number of steps, or raise ValueError."""
    if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 0:
        raise ValueError(f'step count {count!r}, must be a whole number >= 0')
    return int(count)


def some(names: Sequence[str]) -> str:
    """Return the names for a message, the first few if they are many."""
    return ', '.join(names[:8]) + (f', ... ({len(names)} in all)' if len(names) > 8 else '')


def source_name(value: Any) -> str:
    """Return the name of who applies a wrench, '' for None, or raise ValueError."""
    if value is not None and not isinstance(value, str):
        raise ValueError(f'source {value!r}, must be text, or None for nobody in particular')
    return value or ''


def duration_in_steps(duration: Any, h: float) -> int:
    """Return a duration [s] in whole steps of h [s], or raise ValueError."""
    try:
        seconds = float(duration)
    except (TypeError, ValueError, OverflowError):
        seconds = float('nan')
    if not 0.0 <= seconds < float('inf'):
        raise ValueError(f'duration {duration!r} s, must be finite and >= 0')
    return round(min(seconds / h, 2.0 ** 62))


def finite(what: str, value: Any, default: float) -> float:
    """Return a finite number, the default for None, or raise ValueError."""
    if value is None:
        return default
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f'{what} {value!r}, must be a number') from None
    if not np.isfinite(number):
        raise ValueError(f'{what} {value!r}, must be finite')
    return number


def vector(what: str, value: ArrayLike) -> Array:
    """Return three finite numbers, or raise ValueError."""
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f'{what} {value!r}, must be three numbers') from None
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f'{what} {vector.tolist()!r}, must be three finite numbers')
    return vector


def unit_quaternion(value: ArrayLike) -> Array:
    """Return a unit quaternion, or raise ValueError if the value is not near one."""
    try:
        q = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f'orientation {value!r}, must be four numbers x, y, z, w') from None
    with np.errstate(over='ignore', invalid='ignore'):      # then it is far from a unit
        length = float(np.sqrt((q * q).sum())) if q.shape == (4,) else float('nan')
    if not abs(length - 1.0) <= UNIT_TOLERANCE:
        raise ValueError(f'orientation {q.tolist()!r}, must be x, y, z, w of length 1')
    return q / length
