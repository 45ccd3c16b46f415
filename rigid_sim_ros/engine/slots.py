# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which bodies a step solves, and in which half of the world each of them is.

Where contacts are many, a plane cuts the bodies into two halves with about as many contacts each.
What happens inside of one half concerns no body of the other, so two cores may work at both; the
few contacts across wait for both. The cut follows from the state alone: the same bodies are on the
same side for any number of threads.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray
from rigid_sim_ros.engine.kernel import INDEX, kernel
from rigid_sim_ros.engine.manifolds import Manifolds, rows_in_use
from rigid_sim_ros.engine.solver_bodies import SolverBodies

# Manifolds from which on a world is cut: with fewer, what is across is too large a share.
ENOUGH = 512
NEVER = 1 << 40     # as many manifolds as no world has
# Sides are bits: the sides of both bodies of a manifold make that of the manifold.
STILL, FIRST, SECOND, ACROSS = range(4)
_BINS = 64


class Sides(NamedTuple):
    """Where each body is."""

    of_body: IntArray  # (n,) of 8 bits, STILL for what does not move in this step
    bins: IntArray  # (_BINS,) scratch
    halved: IntArray  # (1,) 1 if there are two halves; without, all is on the first side


def make_sides(n: int) -> Sides:
    """Return room for n bodies."""
    of_body: Any = np.zeros(n, dtype=np.int8)
    return Sides(of_body, np.zeros(_BINS, dtype=np.int64), np.zeros(1, dtype=np.int64))


@kernel
def give_slots(inv_m: Array, x: Array, manifolds: Manifolds, waits: IntArray, asleep: IntArray,
               enough: int, sides: Sides, bodies: SolverBodies) -> None:
    """
    Give every moving body with a manifold to solve a slot, in order of the sides and bodies.

    x (3, n) [m] are the centres of mass. waits (c,) is 1 for a manifold that is left out, asleep
    (n,) for a body. The world is cut where it has `enough` manifolds.
    """
    first, count = rows_in_use(manifolds)
    bodies.slot[:] = 0
    for k in range(count):
        r = (first + k) & INDEX
        if waits[r] == 0:
            bodies.slot[manifolds.body_a[r] & INDEX] += 1
            bodies.slot[manifolds.body_b[r] & INDEX] += 1
    free = 0
    for i in range(inv_m.shape[0]):
        moves = inv_m[i] > 0.0 and asleep[i] == 0
        if not moves:
            bodies.slot[i] = 0
        elif bodies.slot[i] == 0:
            free += 1
        sides.of_body[i] = FIRST if bodies.slot[i] > 0 else STILL
    sides.halved[0] = 1 if count >= enough else 0
    if sides.halved[0] == 1:
        _cut(x, bodies.slot, sides)
    bodies.used[2] = bodies.used[0] = _fill(FIRST, 0, sides.of_body, bodies)
    if sides.halved[0] == 1:
        bodies.used[0] = _fill(SECOND, bodies.used[2], sides.of_body, bodies)
    bodies.used[1] = free


@kernel
def _fill(side: int, first: int, sides: IntArray, bodies: SolverBodies) -> int:
    """Give the slots from the first one on, which stands still; return the one after the last."""
    bodies.body[first] = -1
    slot = first + 1
    for i in range(sides.shape[0]):
        if sides[i] == side:
            bodies.slot[i], bodies.body[slot] = slot, i
            slot += 1
    return slot


@kernel
def _cut(x: Array, weight: IntArray, sides: Sides) -> None:
    """
    Move bodies to the second side, so that half of the weight is there.

    Across the axis along which they are spread most, at the median, to a 32nd of a standard
    deviation.
    """
    axis, mean, spread = 0, 0.0, -1.0
    count = 0
    for i in range(weight.shape[0]):
        count += 1 if weight[i] > 0 else 0
    for k in range(3):
        first, second = 0.0, 0.0
        for i in range(weight.shape[0]):
            if weight[i] > 0:
                # From some body: far from the origin the squares would cancel.
                place = x[k, i] - x[k, 0]
                first += place
                second += place * place
        first /= count
        variance = second / count - first * first
        if variance > spread:
            axis, mean, spread = k, x[k, 0] + first, variance
    lowest, width = mean - 2.0 * math.sqrt(max(spread, 0.0)), 4.0 * math.sqrt(max(spread, 0.0))
    per_bin = _BINS / width if width > 0.0 else 0.0
    sides.bins[:] = 0
    total = 0
    for i in range(weight.shape[0]):
        sides.bins[_bin(x[axis, i], lowest, per_bin)] += weight[i]
        total += weight[i]
    last, below = 0, sides.bins[0]
    while 2 * below < total:
        last += 1
        below += sides.bins[last]
    for i in range(weight.shape[0]):
        if weight[i] > 0 and x[axis, i] > lowest + (last + 1) * width / _BINS:
            sides.of_body[i] = SECOND


@kernel
def _bin(x: float, lowest: float, per_bin: float) -> int:
    place = (x - lowest) * per_bin
    # Not a number is not above 0 either.
    return int(min(place, _BINS - 1.0)) if place > 0.0 else 0
