# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which bodies a step solves, and in which half of the world each of them is.

Where contacts are many, a plane cuts the bodies into two halves with about as many contacts each.
What happens inside of one half concerns no body of the other, so two cores may work at both; the
few contacts across wait for both. The cut follows from the positions and the manifolds of the step
before, which are there before detection begins: the same bodies are on the same side for any
number of threads.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray, integers
from rigid_sim_ros.engine.kernel import apart, INDEX, kernel
from rigid_sim_ros.engine.manifolds import Manifolds, rows_in_use
from rigid_sim_ros.engine.solver_bodies import SolverBodies

# Manifolds from which on a world is cut: with fewer, what is across is too large a share.
ENOUGH = 512
# Sides are bits: the sides of both bodies of a manifold make that of the manifold.
STILL, FIRST, SECOND, ACROSS = range(4)
_BINS = 1024
# [%] of the manifolds that the first half gets. Slots and what is across are the first core's, and
# the second one has to fetch them from there: with halves alike it was the last in every stage, by
# 3 to 15 %. More than 55 would make the first one the last.
_OF_FIRST = 52


class Sides(NamedTuple):
    """Where each body is."""

    of_body: IntArray  # (n,) of 8 bits, STILL for what does not move in this step
    weight: IntArray  # (n,) manifolds of the step before, each counted for one body that moves
    bins: IntArray  # (_BINS,) scratch
    halved: IntArray  # (1,) 1 if there are two halves; without, all is on the first side
    axis: IntArray  # (1,) of the world, across which it is cut
    end: Array  # (1,) [m] where on this axis the first half ends


def make_sides(n: int) -> Sides:
    """Return room for n bodies, all on one side."""
    of_body: Any = np.zeros(n, dtype=np.int8)
    return Sides(of_body, integers(n), integers(_BINS), integers(1), integers(1), np.zeros(1))


@kernel
def give_slots(inv_m: Array, x: Array, manifolds: Manifolds, waits: IntArray, asleep: IntArray,
               sides: Sides, bodies: SolverBodies) -> None:
    """
    Give every moving body with a manifold to solve a slot, in order of the sides and bodies.

    x (3, n) [m] are the centres of mass. waits (c,) is 1 for a manifold that is left out, asleep
    (n,) for a body.
    """
    first, count = rows_in_use(manifolds)
    bodies.slot[:] = 0
    for k in range(count):
        r = (first + k) & INDEX
        if waits[r] == 0:
            bodies.slot[manifolds.body_a[r] & INDEX] = 1
            bodies.slot[manifolds.body_b[r] & INDEX] = 1
    halved, axis, end = sides.halved[0] == 1, sides.axis[0] & INDEX, sides.end[0]
    free, on_first, on_second = 0, 0, 0
    for i in range(inv_m.shape[0]):
        moves = (inv_m[i] > 0.0) & (asleep[i] == 0)
        touches = moves & (bodies.slot[i] > 0)
        beyond = touches & halved & (x[axis, i] > end)
        sides.of_body[i] = SECOND if beyond else FIRST if touches else STILL
        free += 1 if moves & (not touches) else 0
        on_first += 1 if touches & (not beyond) else 0
        on_second += 1 if beyond else 0
    bodies.used[2] = 1 + on_first
    bodies.used[0] = bodies.used[2] + (1 + on_second if halved else 0)
    bodies.used[1] = free
    _fill(sides.of_body, bodies)


@kernel
def _fill(sides: IntArray, bodies: SolverBodies) -> None:
    """
    Give every body on a side the next slot there.

    Without a branch: which side comes next nobody could guess. What has no side is written to
    the next slot too, and then overwritten.
    """
    one, other = 1, bodies.used[2] + 1
    for i in range(sides.shape[0]):
        is_first, is_second = sides[i] == FIRST, sides[i] == SECOND
        slot = (other if is_second else one) & INDEX
        bodies.slot[i] = slot if is_first | is_second else 0
        bodies.body[slot] = i
        one += 1 if is_first else 0
        other += 1 if is_second else 0
    bodies.body[0] = bodies.body[bodies.used[2]] = -1


@apart
def choose_cut(inv_m: Array, x: Array, asleep: IntArray, manifolds: Manifolds,
               sides: Sides) -> None:
    """
    Choose where the bodies are cut, from the manifolds of the step before, if these are ENOUGH.

    About half of the manifolds shall be on either side, _OF_FIRST % on the first one, to a 256th
    of a standard deviation, across the axis that `_best_axis` chooses.
    """
    first, count = rows_in_use(manifolds)
    sides.halved[0] = 1 if count >= ENOUGH else 0
    if count < ENOUGH:
        return
    weight = sides.weight
    weight[:] = 0
    for k in range(count):
        a = manifolds.body_a[(first + k) & INDEX] & INDEX
        b = manifolds.body_b[(first + k) & INDEX] & INDEX
        weight[b if inv_m[b] > 0.0 else a] += 1
    axis, mean, spread = _best_axis(inv_m, x, asleep, weight)
    lowest, width = mean - 2.0 * spread, 4.0 * spread
    per_bin = _BINS / width if width > 0.0 else 0.0
    sides.bins[:] = 0
    total = 0
    for i in range(weight.shape[0]):
        sides.bins[_bin(x[axis, i], lowest, per_bin)] += weight[i]
        total += weight[i]
    last, below = 0, sides.bins[0]
    while 100 * below < _OF_FIRST * total:
        last += 1
        below += sides.bins[last]
    sides.axis[0], sides.end[0] = axis, lowest + (last + 1) * width / _BINS


@kernel
def _best_axis(inv_m: Array, x: Array, asleep: IntArray,
               weight: IntArray) -> tuple[int, float, float]:
    """
    Return across which axis to cut the moving bodies with a weight, their mean and spread [m].

    That along which they are spread most, where their numbers say nothing about their places. But
    two cores share out by number what they do not share out by place (see numbering.py), so that
    each works on its own bodies only as long as the cut has the numbers of either half on a side:
    the distance between the middles of both halves, by number, counts as well. In a heap as wide
    as long the widest axis would be now the one and now the other. What does not move loses its
    weight.
    """
    count, sums = 0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    early, half = (0.0, 0.0, 0.0, 0.0), weight.shape[0] // 2
    for i in range(weight.shape[0]):
        counts = (inv_m[i] > 0.0) & (asleep[i] == 0) & (weight[i] > 0)
        weight[i] = weight[i] if counts else 0
        one = 1.0 if counts else 0.0
        count += 1 if counts else 0
        # From some body: far from the origin the squares would cancel.
        a, b, c = (one * (x[0, i] - x[0, 0]), one * (x[1, i] - x[1, 0]), one * (x[2, i] - x[2, 0]))
        sums = (sums[0] + a, sums[1] + b, sums[2] + c,
                sums[3] + a * a, sums[4] + b * b, sums[5] + c * c)
        if i < half:
            early = (early[0] + a, early[1] + b, early[2] + c, early[3] + one)
    axis, mean, spread, best = 0, 0.0, 0.0, -1.0
    for k in range(3):
        middle = sums[k] / count
        deviation = math.sqrt(max(sums[3 + k] / count - middle * middle, 0.0))
        apart = abs(early[k] / max(early[3], 1.0)
                    - (sums[k] - early[k]) / max(count - early[3], 1.0))
        if deviation + apart > best:
            axis, mean, spread, best = k, x[k, 0] + middle, deviation, deviation + apart
    return axis, mean, spread


@kernel
def _bin(x: float, lowest: float, per_bin: float) -> int:
    place = (x - lowest) * per_bin
    # Not a number is not above 0 either.
    return int(min(place, _BINS - 1.0)) if place > 0.0 else 0
