# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The forces at the rows of contact_rows.py, by the methods that find them."""

from rigid_sim_ros.engine.contact.contact_newton import Newton, NEWTON_STEPS, refine_rows
from rigid_sim_ros.engine.contact.contact_rows import Rows, sweep_rows, violation
from rigid_sim_ros.engine.contact.coulomb import EARLY_TOLERANCE, GOAL, TOLERANCE
from rigid_sim_ros.engine.contact.interior_point import approach_solution, Interior
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.kernel import kernel

# Sweeps of Gauss-Seidel where Newton's method does not get on from where the interior point method
# ends, and how often, each time three times as many: they find which of several redundant points
# on the verge of slipping do slip.
SWEEPS, ROUNDS = 20, 3
# No round begins after so many multiplications: what is left after them of a heap of a hundred
# points is 1e-5 of the accelerations, and two more rounds, 4 ms, halve that once each.
MOST_EFFORT = 1.5e6
# What the interior point method counts as, in steps of Newton's method, however many iterations it
# takes: that may depend on rounding, and what is cut short should not. Where there is no solution
# it ends after a few, which do not count.
COUNTED = 18.0


@kernel
def effort_of(m: int, width: int, touched: int) -> float:
    """
    Return how many multiplications a step of Newton's method takes, about.

    Not counted one by one: how many an elimination takes depends on the order of the bodies. They
    touch few others, so it is far from (6 s)^3 / 3.
    """
    by_forces = width * width * width * m * m * m / 3.0
    return 1000.0 * m + min(by_forces, 216.0 * touched * touched)


@kernel
def solve_contact_rows(rows: Rows, m: int, width: int, touched: int, steps: int, again: bool,
                       proximal: Array, w: Newton, interior: Interior) -> float:
    """
    Find rows.f from what stands there; return the violation of the laws against max |b|.

    Newton's method, `steps` of it, and where that does not do the interior point method, as if the
    points did not yield, and Newton's method from there. They then yield by what is more than the
    forces found so far: of these it is subtracted from rows.b, and kept in proximal, (r,).
    `again`: a problem like the one before, of the same points.
    """
    size, count = _size(rows, width * m), width * m
    worst = refine_rows(rows, m, width, touched, GOAL * size, steps, w)
    if worst <= (TOLERANCE if again else EARLY_TOLERANCE) * size:
        return worst / size
    for k in range(count):
        interior.start[k] = rows.f[k]
    _, left = approach_solution(rows, m, width, touched, size, TOLERANCE * size, again,
                                proximal, w, interior)
    if left < worst:
        w.effort[0] += COUNTED * effort_of(m, width, touched)
    if left < worst:
        move_proximal(rows, count, proximal)
    else:
        for k in range(count):
            rows.f[k] = interior.start[k]
    return continue_rows(rows, m, width, touched, w)


@kernel
def move_proximal(rows: Rows, count: int, proximal: Array) -> None:
    """Let `count` rows yield by what is more than the forces of now, which proximal (r,) holds."""
    for k in range(count):
        now = rows.compliance[k] * rows.f[k]
        rows.b[k] -= now - proximal[k]
        proximal[k] = now


@kernel
def continue_rows(rows: Rows, m: int, width: int, touched: int, w: Newton) -> float:
    """
    Improve rows.f; return the violation of the laws against max |b|.

    Newton's method, and where that does not do sweeps of Gauss-Seidel and Newton's method by
    turns.
    """
    size, sweeps, begun = _size(rows, width * m), SWEEPS, w.effort[0]
    worst = refine_rows(rows, m, width, touched, GOAL * size, NEWTON_STEPS, w)
    for _ in range(ROUNDS):
        if worst <= TOLERANCE * size or w.effort[0] - begun > MOST_EFFORT:
            break
        violation(rows, m, width, rows.f)
        sweep_rows(rows, m, width, rows.f, sweeps, 0.1 * EARLY_TOLERANCE * size)
        worst = refine_rows(rows, m, width, touched, GOAL * size, NEWTON_STEPS, w)
        w.effort[0] += NEWTON_STEPS * effort_of(m, width, touched) + 50.0 * width * m * sweeps
        sweeps *= 3
    return worst / size


@kernel
def _size(rows: Rows, count: int) -> float:
    """Return max |b|, more than 0."""
    size = 1e-300
    for k in range(count):
        size = max(size, abs(rows.b[k]))
    return size
