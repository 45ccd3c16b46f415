# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The impulses of an island all at once, whatever the ratio of its masses.

The unknowns are the momenta p that the impulses add to the bodies, six for each. With the rates a
= a_0 + W p of the rows, a small compliance R of each, and impulses f_0 to begin with, the impulses
are the admissible ones that are nearest to f_0 - a / R: not negative along the normal, within a
disk of radius r across it. So p solves

    F(p) = p - G' (P(f_0 - a(p) / R) - f_0) = 0,

which is where the gradient of a convex function vanishes (Castro, Permenter, Han, An
unconstrained convex formulation of compliant contact, IEEE Trans. Robotics 39 (2023), with other
cones); direct_newton.py finds it. Two things are then brought up to date, and it begins again
until nothing changes: f_0, so that nothing of the compliance is left (the method of multipliers:
Rockafellar, SIAM J. Control Optim. 12 (1974)); and the radii r, the friction coefficients times
the normal impulses (Haslinger, Math. Methods Appl. Sci. 5 (1983)), by a method for fixed points:
repeating alone is slow where friction and pressure depend on each other, and where friction that
grows adds to the pressure it leads away.
"""

import numpy as np

from rigid_sim_ros.engine.maths.fixed_point import next_round
from rigid_sim_ros.engine.solver.direct_newton import (
    add_momenta, COMPLIANCE, Direct, find_momenta, largest_rate, length_of, SOLVED)
from rigid_sim_ros.engine.solver.direct_rows import (
    DirectRows, disk_of, DISKS, pressure_of, WIDTH)
from rigid_sim_ros.kernels.kernel import kernel

# A rate this near to its law is right, in sizes of a shape per substep: what SETTLED is to sweeps.
GOAL = 1e-9
# Rates are known to this part of the fastest one: f has the rounding of a over the compliance,
# 1e-16 / COMPLIANCE of it, and so have the momenta that the two are compared in.
ROUNDED = 1e-7
# One problem in a hundred takes more than fifteen rounds, one in five hundred is unsolved by then.
ROUNDS = 60
# After so many steps no round begins: of 31 000 problems of heaps, walls and dominoes five took
# more that were solved in the end. What is left then is used as far as it came.
MOST_STEPS = 200
# A violation that changes by less than this part of it in a round stays: four corners that are not
# quite in one plane, all of which press.
STUCK = 1e-3


@kernel
def solve_rows(count: int, moving: int, inv_h: float, anew: bool, work: Direct) -> bool:
    """
    Find f and p from the impulses to begin with, or from none; return whether any were found.

    Else f is what it was, and p 0.
    """
    rows, goal, fastest = work.rows, np.inf, 0.0
    for k in range(6 * moving):
        work.p[k] = 0.0
    for c in range(count):
        goal = min(goal, GOAL * inv_h * rows.size[c])
        for r in range(WIDTH):
            if rows.there[c, r] != 0:
                fastest = max(fastest, abs(rows.rate[c, r]))
    goal = max(goal, ROUNDED * fastest)
    _keep(count, moving, work)
    if anew:
        rows.f[:count] = 0.0
    best, last, first, taken = np.inf, np.inf, np.inf, 0
    for turn in range(ROUNDS):
        _begin_round(turn, count, work)
        steps = find_momenta(count, moving, 0.1 * goal, fastest if turn == 0 else 0.0, work)
        taken += steps
        # Away from F = 0 impulses are rates over the compliance: they would throw bodies about.
        off = largest_rate(count, work)
        if not off <= SOLVED * goal:
            break
        worst = max(_violation(count, work), off if off > goal else 0.0)
        if turn == 0:
            first = worst
        if worst < best:
            best = worst
            _keep(count, moving, work)
        stuck, last = abs(worst - last) < STUCK * worst, worst
        found = best <= goal and best * _reach(count, inv_h, rows) <= first
        if found or steps == 0 or stuck or taken >= MOST_STEPS:
            break
    _take(count, moving, goal, work)
    return bool(best < np.inf)


@kernel
def _begin_round(turn: int, count: int, work: Direct) -> None:
    """Bring f_0 and the radii up to date."""
    rows = work.rows
    for c in range(count):
        for d in range(DISKS):
            work.pressed[c, d] = rows.limit[c, d] * pressure_of(c, rows)
            work.stiff[c, d] = rows.stiff[c, disk_of(c, d, rows)[0]]
        for r in range(WIDTH):
            work.base[c, r] = rows.f[c, r]
    if turn > 0:
        next_round(turn - 1, DISKS * count, work.radius.reshape(-1), work.pressed.reshape(-1),
                   work.stiff.reshape(-1), work.rounds)
    for c in range(count):
        for d in range(DISKS):
            work.radius[c, d] = work.pressed[c, d] if turn == 0 else max(work.radius[c, d], 0.0)


@kernel
def _reach(count: int, inv_h: float, rows: DirectRows) -> float:
    """
    Return how far the impulses of one manifold alone would move its bodies in a substep, in sizes.

    Where that is far, a light body bears a load. What a round leaves of the compliance lets it
    tilt a little in proportion to what changed since the substep before, as when it slides by v h;
    tilted, it is driven aside by a part of the load, and slides faster. That feeds itself, by this
    factor in a substep, unless the rounds make what is left smaller by as much.
    """
    reach = 0.0
    for c in range(count):
        reach = max(reach, pressure_of(c, rows) * rows.stiff[c, 0] / (inv_h * rows.size[c]))
    return reach


@kernel
def _keep(count: int, moving: int, work: Direct) -> None:
    for k in range(6 * moving):
        work.best_p[k] = work.p[k]
    for c in range(count):
        for r in range(WIDTH):
            work.best[c, r] = work.rows.f[c, r]


@kernel
def _take(count: int, moving: int, goal: float, work: Direct) -> None:
    """Take the impulses that were kept; p is what they do, also where that is no solution."""
    for k in range(6 * moving):
        work.p[k] = work.F[k] = work.best_p[k]
    for c in range(count):
        for r in range(WIDTH):
            work.rows.f[c, r] = work.best[c, r]
        add_momenta(c, -1.0, work.F, work.rows)
    # Of a solution p is more accurate: in f there is rounding of rates over the compliance.
    if largest_rate(count, work) > goal:
        for k in range(6 * moving):
            work.p[k] -= work.F[k]


@kernel
def _violation(count: int, work: Direct) -> float:
    """
    Return how far the rates are from their laws at most [m/s].

    What the compliance gave way, and what the radii would be for the normal impulses found.
    """
    rows, worst = work.rows, 0.0
    for c in range(count):
        pressure = pressure_of(c, rows)
        for r in range(WIDTH):
            if rows.there[c, r] != 0:
                give = COMPLIANCE * rows.stiff[c, r] * abs(rows.f[c, r] - work.base[c, r])
                worst = max(worst, give)
        for d in range(DISKS):
            first, size = disk_of(c, d, rows)
            if size > 0:
                radius, long = rows.limit[c, d] * pressure, length_of(c, d, rows)
                off = max(long - radius, 0.0)
                if long >= work.radius[c, d] * (1.0 - 1e-12):
                    off = abs(radius - work.radius[c, d])
                worst = max(worst, rows.stiff[c, first] * off)
    return worst
