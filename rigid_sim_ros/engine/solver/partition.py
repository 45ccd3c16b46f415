# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which bodies a step solves, and in which half of the world each of them is.

Where contacts are many, the bodies are cut into two halves with about as many contacts each. What
happens inside of one half concerns no body of the other, so two cores may work at both; the few
contacts across wait for both. The halves are those of the bodies' numbers (see body_order.py), by
which detection and the state are shared out as well: so each core has the same bodies in all
stages, and hardly a line of its cache is asked for by the other. Bodies that have mixed until
their numbers say nothing about places are cut by a plane.

How they are cut follows from the positions and the manifolds of the step before, which are there
before detection begins: the same bodies are on the same side for any number of threads. It stays
for some steps, and is part of what a world saves: who chooses it reads what both cores write.
"""

import math
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.detection.manifolds import LEFT_OUT, Manifolds, rows_in_use
from rigid_sim_ros.engine.solver.solver_bodies import (
    FIRST_END, SECOND_BEGIN, SECOND_END, slots_between, SolverBodies)
from rigid_sim_ros.kernels.arrays import Array, IntArray, integers, room
from rigid_sim_ros.kernels.kernel import apart, INDEX, inlined, kernel, part

# Manifolds from which on a world is cut: with fewer, what is across is too large a share.
MANIFOLDS_TO_HALVE = 512
# Sides are bits: the sides of both bodies of a manifold make that of the manifold.
STILL, FIRST, SECOND, ACROSS = range(4)
_BINS = 1024
# For so many steps a cut stays.
_STEPS = 16
# Numbers cut while each half has so many of 100 manifolds, and at most one in _FEW is across.
_FAIR, _FEW = 40, 8


class Cut(NamedTuple):
    """How the bodies are cut."""

    halved: IntArray  # (1,) 1 if there are two halves; without, all is on the first side
    by_place: IntArray  # (1,) 1 if it is a plane that cuts them:
    axis: IntArray  # (1,) of the world, across which it stands
    end: Array  # (1,) [m] where on this axis the first half ends
    left: IntArray  # (1,) steps until it is chosen anew


class Sides(NamedTuple):
    """Where each body is."""

    of_body: IntArray  # (n,) of 8 bits, STILL for what does not move in this step
    weight: IntArray  # (n,) manifolds of the step before, each counted for one body that moves
    bins: IntArray  # (_BINS,) scratch
    middle: IntArray  # (2,) the first body of the second half by number, and its shape
    cut: Cut


def make_sides(n: int, middle: tuple[int, int]) -> Sides:
    """Return room for n bodies, all on one side; `middle` is where the second half begins."""
    cut = Cut(integers(1), integers(1), integers(1), np.zeros(1), integers(1))
    sides = Sides(room(n, kind=np.int8), integers(n), integers(_BINS), integers(2), cut)
    sides.middle[:] = middle
    return sides


@inlined
def is_by_number(cut: Cut) -> bool:
    """Return whether the halves are those of the bodies' numbers."""
    return cut.halved[0] == 1 and cut.by_place[0] == 0


@kernel
def shared_out(sides: Sides, half: int) -> tuple[int, int]:
    """Return the first body of a half by their numbers, and the one after its last."""
    n = sides.of_body.shape[0]
    middle = sides.middle[0] if sides.cut.halved[0] == 1 else n
    return (middle, n) if half == 1 else (0, middle)


@kernel
def take_sides(inv_m: Array, V: Array, x: Array, asleep: IntArray, first: int, last: int,
               sides: Sides, slot: IntArray, flies: IntArray) -> None:
    """
    Note on which side the bodies from `first` to `last` are; what does not move loses its slot.

    V (6, n) are the prescribed twists, x (3, n) [m] the centres of mass, asleep (n,) is 1 for what
    sleeps.
    """
    cut = sides.cut
    halved, by_place, end = cut.halved[0] == 1, cut.by_place[0] == 1, cut.end[0]
    axis, middle = cut.axis[0] & INDEX, sides.middle[0]
    for i in range(first, last):
        beyond = halved & (x[axis, i] > end if by_place else i >= middle)
        moves = (inv_m[i] > 0.0) & (asleep[i] == 0)
        if inv_m[i] == 0.0:
            for k in range(6):
                moves |= V[k, i] != 0.0
        sides.of_body[i] = (SECOND if beyond else FIRST) if moves else STILL
        if not moves:
            slot[i] = flies[i] = 0


@kernel
def mark_touching(manifolds: Manifolds, activity: IntArray, touching: IntArray) -> None:
    """Mark in touching (2, n) the bodies of all manifolds whose activity (c,) is not LEFT_OUT."""
    first, count = rows_in_use(manifolds)
    touching[:] = 0
    for k in range(count):
        r = (first + k) & INDEX
        if activity[r] != LEFT_OUT:
            touching[0, manifolds.body_a[r] & INDEX] = 1
            touching[0, manifolds.body_b[r] & INDEX] = 1


@kernel
def begin_slots(sides: Sides, touching: IntArray, bodies: SolverBodies) -> None:
    """Say where the slots of the second half begin; where a plane cuts, give all of them."""
    n = sides.of_body.shape[0]
    if sides.cut.halved[0] == 1 and not is_by_number(sides.cut):
        on_first = 0
        for i in range(n):
            touches = touching[0, i] | touching[1, i] == 1
            on_first += 1 if touches & (sides.of_body[i] == FIRST) else 0
        bodies.used[SECOND_BEGIN] = 1 + on_first + slots_between(n)
        for half in range(2):
            _give(half, 0, n, sides, touching, bodies)
    else:
        bodies.used[SECOND_BEGIN] = 1 + sides.middle[0] + slots_between(n)


@part
def give_slots(half: int, sides: Sides, touching: IntArray, bodies: SolverBodies) -> None:
    """
    Give every moving body of a half that touches something the next slot there.

    touching (2, n): what either of two threads found to touch. Nobody needs the other half for it,
    unless a plane cuts them: then `begin_slots` has done it.
    """
    if sides.cut.halved[0] == 0 or is_by_number(sides.cut):
        first, last = shared_out(sides, half)
        _give(half, first, last, sides, touching, bodies)
    if sides.cut.halved[0] == 0:
        bodies.used[SECOND_BEGIN] = bodies.used[SECOND_END] = bodies.used[FIRST_END]


@kernel
def _give(half: int, first: int, last: int, sides: Sides, touching: IntArray,
          bodies: SolverBodies) -> None:
    """
    Give those from `first` to `last` that are on the side of a half its slots, in their order.

    Without a branch: who touches something nobody could guess. Who does not is written to the
    next slot too, and then overwritten.
    """
    begin, side = bodies.used[SECOND_BEGIN] if half == 1 else 0, SECOND if half == 1 else FIRST
    bodies.body[begin] = -1
    slot = begin + 1
    for i in range(first, last):
        is_here = sides.of_body[i] == side
        touches = is_here & (touching[0, i] | touching[1, i] == 1)
        bodies.slot[i] = slot if touches else 0 if is_here else bodies.slot[i]
        bodies.flies[i] = 1 if is_here & (not touches) else 0 if is_here else bodies.flies[i]
        bodies.body[slot & INDEX] = i
        slot += 1 if touches else 0
    bodies.used[SECOND_END if half == 1 else FIRST_END] = slot


@apart
def choose_cut(inv_m: Array, x: Array, asleep: IntArray, manifolds: Manifolds,
               sides: Sides) -> None:
    """
    Choose how the bodies are cut, from the manifolds of the step before, and for how long.

    By their numbers, if either half then has its share of the manifolds and few are across; else
    by a plane.
    """
    cut, weight = sides.cut, sides.weight
    total = _weigh(inv_m, asleep, manifolds, weight)
    below = 0
    for i in range(sides.middle[0]):
        below += weight[i]
    across = _across(inv_m, manifolds, sides.middle[0])
    fair = _FAIR * total <= 100 * below <= (100 - _FAIR) * total
    cut.halved[0], cut.left[0] = 1, _STEPS
    cut.by_place[0] = 0 if fair and across * _FEW <= manifolds.count[0] else 1
    if cut.by_place[0] == 1:
        cut.axis[0], cut.end[0] = _plane(x, weight, total, sides.bins)


@kernel
def _weigh(inv_m: Array, asleep: IntArray, manifolds: Manifolds, weight: IntArray) -> int:
    """Count each manifold for one of its bodies that move; return their sum."""
    first, count = rows_in_use(manifolds)
    weight[:] = 0
    total = 0
    for k in range(count):
        a = manifolds.body_a[(first + k) & INDEX] & INDEX
        b = manifolds.body_b[(first + k) & INDEX] & INDEX
        i = b if inv_m[b] > 0.0 else a
        if (inv_m[i] > 0.0) & (asleep[i] == 0):
            weight[i] += 1
            total += 1
    return total


@kernel
def _across(inv_m: Array, manifolds: Manifolds, body: int) -> int:
    """Return how many manifolds would be across if the second half began with this body."""
    first, count = rows_in_use(manifolds)
    across = 0
    for k in range(count):
        a = manifolds.body_a[(first + k) & INDEX] & INDEX
        b = manifolds.body_b[(first + k) & INDEX] & INDEX
        across += 1 if (min(a, b) < body) & (max(a, b) >= body) & (inv_m[b] > 0.0) else 0
    return across


@kernel
def _plane(x: Array, weight: IntArray, total: int, bins: IntArray) -> tuple[int, float]:
    """
    Return the axis along which bodies with a weight are spread most, and where half of it is [m].

    To a 256th of a standard deviation.
    """
    axis, mean, spread = _widest_axis(x, weight)
    lowest, width = mean - 2.0 * spread, 4.0 * spread
    per_bin = _BINS / width if width > 0.0 else 0.0
    bins[:] = 0
    for i in range(weight.shape[0]):
        bins[_bin(x[axis, i], lowest, per_bin)] += weight[i]
    last, below = 0, bins[0]
    while 2 * below < total:
        last += 1
        below += bins[last]
    return axis, lowest + (last + 1) * width / _BINS


@kernel
def _widest_axis(x: Array, weight: IntArray) -> tuple[int, float, float]:
    """Return the axis along which bodies with a weight are spread most, their mean and spread."""
    count, sums = 0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for i in range(weight.shape[0]):
        counts = weight[i] > 0
        one = 1.0 if counts else 0.0
        count += 1 if counts else 0
        # From some body: far from the origin the squares would cancel.
        a, b, c = (one * (x[0, i] - x[0, 0]), one * (x[1, i] - x[1, 0]), one * (x[2, i] - x[2, 0]))
        sums = (sums[0] + a, sums[1] + b, sums[2] + c,
                sums[3] + a * a, sums[4] + b * b, sums[5] + c * c)
    axis, mean, spread = 0, 0.0, -1.0
    for k in range(3):
        middle = sums[k] / max(count, 1)
        deviation = math.sqrt(max(sums[3 + k] / max(count, 1) - middle * middle, 0.0))
        if deviation > spread:
            axis, mean, spread = k, x[k, 0] + middle, deviation
    return axis, mean, spread


@kernel
def _bin(x: float, lowest: float, per_bin: float) -> int:
    place = (x - lowest) * per_bin
    # Not a number is not above 0 either.
    return int(min(place, _BINS - 1.0)) if place > 0.0 else 0
