# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Rows of one number beside those of contact: an impulse that falls, piecewise straight, with a rate.

That is what acts along the axis of a joint, with its dry friction, limits and bounded drive. The
pieces end at kinks, where the impulse may fall at once: between two values there the rate is given
and the impulse follows. With the rate v = w + a f of a row, a > 0, each w has one solution.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

KINKS = 7   # of a row, at most


class ScalarRows(NamedTuple):
    """Room for q rows."""

    present: IntArray  # (1,) how many rows take part
    kinks: IntArray  # (q,) of a row, one at least
    kink: Array  # (q, KINKS) their rates, rising
    below: Array  # (q, KINKS) impulse at smaller rates; infinite: there are none
    above: Array  # (q, KINKS) impulse at larger rates; -infinite: there are none
    slope: Array  # (q,) by which the impulse falls before the first kink and behind the last one
    E: Array  # (q,) scratch of Newton's method


def make_scalar_rows(rows: int) -> ScalarRows:
    """Return room for so many rows, none of which takes part."""
    kink, below, above = (np.zeros((rows, KINKS)) for _ in range(3))
    return ScalarRows(np.zeros(1, dtype=np.int64), np.zeros(rows, dtype=np.int64), kink, below,
                      above, np.zeros(rows), np.zeros(rows))


@kernel
def resolve(s: ScalarRows, q: int, w: float, a: float) -> tuple[float, float, float]:
    """
    Return the impulse f of row q whose rate is w + a f, and the piece that it is on.

    That is how far the impulse falls with the rate, and the impulse that the piece would have at
    the rate 0. Where the rate is given the former is infinite, and the rate stands for the latter.
    """
    last = s.kinks[q] - 1
    for n in range(last + 1):
        v = s.kink[q, n]
        if v - w > a * s.below[q, n]:       # it is slower than that
            slope = s.slope[q]
            if n > 0:
                slope = (s.above[q, n - 1] - s.below[q, n]) / (v - s.kink[q, n - 1])
            return _on_piece(s.below[q, n] + slope * v, slope, w, a)
        if v - w >= a * s.above[q, n]:
            return (v - w) / a, np.inf, v
    return _on_piece(s.above[q, last] + s.slope[q] * s.kink[q, last], s.slope[q], w, a)


@kernel
def _on_piece(start: float, slope: float, w: float, a: float) -> tuple[float, float, float]:
    """Return f = start - slope (w + a f), and the piece."""
    return (start - slope * w) / (1.0 + slope * a), slope, start
