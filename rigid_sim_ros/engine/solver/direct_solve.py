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
cones): Newton's method with a search along its direction gets there from anywhere. Two things are
then brought up to date, and it begins again until nothing changes: f_0, so that nothing of the
compliance is left (the method of multipliers: Rockafellar, SIAM J. Control Optim. 12 (1974)); and
the radii r, the friction coefficients times the normal impulses (Haslinger, Math. Methods Appl.
Sci. 5 (1983)).
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.constraints.contact_rules import Sweep
from rigid_sim_ros.engine.maths.elimination import solve_linear
from rigid_sim_ros.engine.solver.coloring import Blocks
from rigid_sim_ros.engine.solver.direct_islands import (
    begin_island_impact, Islands, make_islands, MOST_BODIES, MOST_MANIFOLDS)
from rigid_sim_ros.engine.solver.direct_rows import (
    ABOUT, DirectRows, make_direct_rows, moved, read_island, ROLLS, SLIDE, WIDTH,
    write_island)
from rigid_sim_ros.engine.solver.impacts import Impacts
from rigid_sim_ros.engine.solver.island_sweeps import sweep_islands
from rigid_sim_ros.engine.solver.solver_bodies import most_slots, SolverBodies
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# R in parts of the diagonal of A = W G'. Smaller: less is left for the next round, and rounding
# of p, 1e-16 / COMPLIANCE, for more steps of this one.
COMPLIANCE = 1e-8
# A rate this near to its law is right, in sizes of a shape per substep: what SETTLED is to sweeps.
GOAL = 1e-9
# At most so many rounds, steps of Newton's method in one, and trials along the direction of one.
ROUNDS, STEPS, TRIALS = 15, 20, 60
# The slope at the end of a search, as a part of that at its begin.
FLAT = 0.1
# A violation that changes by less than this part of it in a round stays: four corners that are not
# quite in one plane, all of which press.
STUCK = 1e-3


class Direct(NamedTuple):
    """Scratch memory for one island, and the lists of islands."""

    islands: Islands
    rows: DirectRows
    base: Array  # (c, 9) [N s] f_0
    radius: Array  # (c, 3) [N s] of the disks
    p: Array  # (6 b,) momenta that are added to those of the start
    best: Array  # (c, 9) [N s] impulses that were kept
    best_p: Array  # (6 b,) and their p
    F: Array  # (6 b,)
    step: Array  # (6 b,)
    K: Array  # (36 b b,)
    last: IntArray  # (6 b,)
    E: Array  # (9, 9) the derivative of P / R of one manifold
    wish: Array  # (2,) f_0 - a / R of a disk
    effort: Array  # (1,)


def make_direct(n: int, capacity: int) -> Direct:
    """Return room for the islands of n bodies and `capacity` manifolds."""
    c, b = MOST_MANIFOLDS, MOST_BODIES
    return Direct(make_islands(n, capacity), make_direct_rows(most_slots(n)),
                  np.zeros((c, WIDTH)), np.zeros((c, 3)), np.zeros(6 * b), np.zeros((c, WIDTH)),
                  np.zeros(6 * b), np.zeros(6 * b),
                  np.zeros(6 * b), np.zeros(36 * b * b), np.zeros(6 * b, dtype=np.int64),
                  np.zeros((WIDTH, WIDTH)), np.zeros(2), np.zeros(1))


@kernel
def strike_islands(all_of_them: bool, blocks: Blocks, bodies: SolverBodies, what: Sweep,
                   impacts: Impacts, work: Direct) -> None:
    """Find the impulses of an impact in the islands that wait, all of them or the uneven ones."""
    islands = work.islands
    for island in range(islands.count[0]):
        if (all_of_them or islands.uneven[island] == 1) and (
                begin_island_impact(blocks, islands, island, impacts)):
            _solve_island(island, blocks, bodies, what, work)


@kernel
def bear_islands(blocks: Blocks, bodies: SolverBodies, what: Sweep, work: Direct) -> None:
    """Find the impulses that bear the forces of a substep in all small islands."""
    islands = work.islands
    sweep_islands(blocks, bodies.motion, what, islands)
    for island in range(islands.count[0]):
        if islands.moved[island] == 1:
            _solve_island(island, blocks, bodies, what, work)


@kernel
def _solve_island(island: int, blocks: Blocks, bodies: SolverBodies, what: Sweep,
                  work: Direct) -> None:
    islands = work.islands
    lanes = islands.lane[islands.begin[island]:islands.begin[island + 1]]
    count, moving = read_island(blocks, bodies, lanes, what, work.rows)
    if count > 0:
        _solve(count, moving, what.inv_h, work)
        write_island(blocks, bodies, lanes, count, moving, work.p, work.rows)


@kernel
def _solve(count: int, moving: int, inv_h: float, work: Direct) -> None:
    """Find f and p from the impulses to begin with."""
    rows, goal = work.rows, np.inf
    for k in range(6 * moving):
        work.p[k] = 0.0
    for c in range(count):
        goal = min(goal, GOAL * inv_h * rows.size[c])
    best = last = np.inf
    for _ in range(ROUNDS):
        _begin_round(count, work)
        steps = _minimize(count, moving, 0.1 * goal, work)
        worst = _violation(count, work)
        # Of the first round in any case: else those of another island would be taken.
        if worst < best or best == np.inf:
            best = worst
            _keep(count, moving, work)
        stuck, last = abs(worst - last) < STUCK * worst, worst
        if best <= goal or steps == 0 or stuck:
            break
    _take(count, moving, work)


@kernel
def _begin_round(count: int, work: Direct) -> None:
    """Bring f_0 and the radii up to date."""
    rows = work.rows
    for c in range(count):
        for d in range(3):
            work.radius[c, d] = rows.limit[c, d] * _pressure(c, rows)
        for r in range(WIDTH):
            work.base[c, r] = rows.f[c, r]


@kernel
def _pressure(c: int, rows: DirectRows) -> float:
    """Return the sum of the normal impulses of a manifold [N s]."""
    return rows.f[c, 0] + rows.f[c, 1] + rows.f[c, 2] + rows.f[c, 3]


@kernel
def _keep(count: int, moving: int, work: Direct) -> None:
    for k in range(6 * moving):
        work.best_p[k] = work.p[k]
    for c in range(count):
        for r in range(WIDTH):
            work.best[c, r] = work.rows.f[c, r]


@kernel
def _take(count: int, moving: int, work: Direct) -> None:
    for k in range(6 * moving):
        work.p[k] = work.best_p[k]
    for c in range(count):
        for r in range(WIDTH):
            work.rows.f[c, r] = work.best[c, r]


@kernel
def _minimize(count: int, moving: int, goal: float, work: Direct) -> int:
    """Find p with F = 0, up to a rate of `goal` [m/s]; return how many steps that took."""
    _write_F(count, moving, work)
    left, steps = _largest_rate(count, work), 0
    while left > 0.0 and steps < STEPS and _newton_step(count, moving, work):
        before, left, steps = left, _largest_rate(count, work), steps + 1
        # Below the goal as long as it gains anything: what is left turns a light body under load.
        if left < goal and left > 0.5 * before:
            break
    return steps


@kernel
def _newton_step(count: int, moving: int, work: Direct) -> bool:
    """Take one step from p, and write f and F; return whether there was one."""
    size = 6 * moving
    p, step = work.p[:size], work.step[:size]
    K = work.K[:size * size].reshape((size, size))
    for i in range(size):
        step[i] = -work.F[i]
        for j in range(size):
            K[i, j] = 1.0 if i == j else 0.0
    for c in range(count):
        _add_manifold(c, K, work)
    if not solve_linear(K, step, work.last, work.effort):
        return False
    slope = _slope(moving, work)
    if not slope < 0.0:
        return False
    # The slope grows along the direction: its zero lies between `low` and `high`.
    low, high, at, done = 0.0, np.inf, 1.0, 0.0
    for _ in range(TRIALS):
        for k in range(size):
            p[k] += (at - done) * step[k]
        done = at
        _write_F(count, moving, work)
        now = _slope(moving, work)
        if abs(now) <= -FLAT * slope or (now < 0.0 and at == 1.0):
            break
        if now < 0.0:
            low = at
        else:
            high = at
        at = 0.5 * (low + high)
    return True


@kernel
def _write_F(count: int, moving: int, work: Direct) -> None:
    """Write f and F at p."""
    rows, p, F = work.rows, work.p, work.F
    for k in range(6 * moving):
        F[k] = p[k]
    for c in range(count):
        _write_impulses(c, work)
        for side in range(2):
            if rows.body[c, side] >= 0:
                at = 6 * rows.body[c, side]
                for r in range(WIDTH):
                    if rows.there[c, r] != 0:
                        change = rows.f[c, r] - rows.start[c, r]
                        for k in range(6):
                            F[at + k] -= rows.G[c, r, 6 * side + k] * change


@kernel
def _write_impulses(c: int, work: Direct) -> None:
    """Write the impulses of a manifold: P(f_0 - a / R)."""
    rows, f = work.rows, work.rows.f
    for r in range(WIDTH):
        if rows.there[c, r] != 0:
            rate = rows.rate[c, r] + moved(rows, c, r, work.p)
            f[c, r] = work.base[c, r] - rate / (COMPLIANCE * rows.stiff[c, r])
    for r in range(SLIDE):
        f[c, r] = max(f[c, r], 0.0)
    for d in range(3):
        first, size = _disk(d)
        if rows.there[c, first] != 0:
            long, radius = _length(c, d, f), work.radius[c, d]
            for k in range(size if long > radius else 0):
                f[c, first + k] *= radius / long


@kernel
def _disk(d: int) -> tuple[int, int]:
    """Return the first row and the number of rows of a disk: friction, about n, rolling."""
    return (SLIDE, 2) if d == 0 else ((ABOUT, 1) if d == 1 else (ROLLS, 2))


@kernel
def _length(c: int, d: int, f: Array) -> float:
    first, size = _disk(d)
    y = f[c, first + 1] if size == 2 else 0.0
    return float(np.sqrt(f[c, first] * f[c, first] + y * y))


@kernel
def _largest_rate(count: int, work: Direct) -> float:
    """Return how far the rates of the rows are from those that F = 0 would have [m/s]."""
    largest = 0.0
    for c in range(count):
        for r in range(WIDTH):
            if work.rows.there[c, r] != 0:
                largest = max(largest, abs(moved(work.rows, c, r, work.F)))
    return largest


@kernel
def _slope(moving: int, work: Direct) -> float:
    """Return the derivative of the convex function along the step: step' M^-1 F."""
    total, inv = 0.0, work.rows.inverse
    for b in range(moving):
        for j in range(3):
            total += inv[b, 0] * work.step[6 * b + j] * work.F[6 * b + j]
        x, y, z = work.F[6 * b + 3], work.F[6 * b + 4], work.F[6 * b + 5]
        total += (work.step[6 * b + 3] * (inv[b, 1] * x + inv[b, 2] * y + inv[b, 3] * z)
                  + work.step[6 * b + 4] * (inv[b, 2] * x + inv[b, 4] * y + inv[b, 5] * z)
                  + work.step[6 * b + 5] * (inv[b, 3] * x + inv[b, 5] * y + inv[b, 6] * z))
    return total


@kernel
def _write_E(c: int, work: Direct) -> None:
    """Write the derivative of the impulses of a manifold by its rates, with the opposite sign."""
    rows, E, f = work.rows, work.E, work.rows.f
    for q in range(WIDTH):
        for r in range(WIDTH):
            E[q, r] = 0.0
    for r in range(SLIDE):
        if rows.there[c, r] != 0 and f[c, r] > 0.0:
            E[r, r] = 1.0 / (COMPLIANCE * rows.stiff[c, r])
    for d in range(3):
        first, size = _disk(d)
        if rows.there[c, first] == 0:
            continue
        stiff, radius = COMPLIANCE * rows.stiff[c, first], work.radius[c, d]
        wish = work.wish
        for k in range(size):
            rate = rows.rate[c, first + k] + moved(rows, c, first + k, work.p)
            wish[k] = work.base[c, first + k] - rate / stiff
        long = np.sqrt(wish[0] * wish[0] + (wish[1] * wish[1] if size == 2 else 0.0))
        for i in range(size):
            for j in range(size):
                along = 1.0 if i == j else 0.0
                if long > radius:
                    along = radius / long * (along - wish[i] * wish[j] / (long * long))
                E[first + i, first + j] = along / stiff


@kernel
def _add_manifold(c: int, K: Array, work: Direct) -> None:
    """Add G' E W of a manifold to K."""
    rows, E = work.rows, work.E
    _write_E(c, work)
    for side in range(2):
        to = rows.body[c, side]
        for j in range(6 if to >= 0 else 0):
            i = 6 * to + j
            for r in range(WIDTH):
                weight = 0.0
                for q in range(WIDTH):
                    if E[q, r] != 0.0:
                        weight += rows.G[c, q, 6 * side + j] * E[q, r]
                if weight != 0.0:
                    for other in range(2):
                        at = rows.body[c, other]
                        for k in range(6 if at >= 0 else 0):
                            K[i, 6 * at + k] += weight * rows.W[c, r, 6 * other + k]


@kernel
def _violation(count: int, work: Direct) -> float:
    """
    Return how far the rates are from their laws at most [m/s].

    What the compliance gave way, and what the radii would be for the normal impulses found.
    """
    rows, worst = work.rows, 0.0
    for c in range(count):
        pressure = _pressure(c, rows)
        for r in range(WIDTH):
            if rows.there[c, r] != 0:
                give = COMPLIANCE * rows.stiff[c, r] * abs(rows.f[c, r] - work.base[c, r])
                worst = max(worst, give)
        for d in range(3):
            first, _ = _disk(d)
            if rows.there[c, first] != 0:
                radius, long = rows.limit[c, d] * pressure, _length(c, d, rows.f)
                off = max(long - radius, 0.0)
                if long >= work.radius[c, d] * (1.0 - 1e-12):
                    off = abs(radius - work.radius[c, d])
                worst = max(worst, rows.stiff[c, first] * off)
    return worst
