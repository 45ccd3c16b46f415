# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The momenta of an island for given radii of its disks: one round of direct_solve.py.

F(p) = p - G' (P(f_0 - a(p) / R) - f_0) is the gradient of a convex function, and linear between
the kinks of P, where a row begins to bear or to slide. Newton's method with a search along its
direction finds F = 0 from anywhere. But with R as small as it has to be, rates over it are many
times the impulses, and from p = 0 it takes a step or more for each row to find out what that
bears. So the first round goes there along the solutions p(R) for rows that give way by less and
less. Rows soft enough have p = 0, and from one R to the next a step along the tangent

    (M + G' E G) dp = -G' E a (1 - R_next / R),    E = P' / R_next,

and a few of Newton's method suffice (Allgower, Georg, Introduction to Numerical Continuation
Methods, SIAM 2003, chapter 2).
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.maths.elimination import solve_symmetric
from rigid_sim_ros.engine.maths.fixed_point import make_rounds, Rounds
from rigid_sim_ros.engine.solver.direct_islands import (
    Islands, make_islands, MOST_BODIES, MOST_MANIFOLDS)
from rigid_sim_ros.engine.solver.direct_rows import (
    DirectRows, disk_of, DISKS, make_direct_rows, rate_by, SLIDE, WIDTH)
from rigid_sim_ros.engine.solver.solver_bodies import most_slots
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# R in parts of the diagonal of A = W G'. Smaller: less is left for the next round, and rounding
# of p, 1e-16 / COMPLIANCE, for more steps of this one.
COMPLIANCE = 1e-8
# R from one solution to the next on the way there, and how near to each, as a part of the fastest
# rate, in at most how many steps. Of 300 problems of a wall of bricks that collapses 14 are not
# solved with these, 59 with 1e-4 and one step each; with 1e-2 and more easy ones take longer.
STIFFER, NEAR, FEW = 1e-3, 0.1, 5
# Momenta and impulses that differ by so many times the goal are those of a solution: rounding
# leaves up to 10.
SOLVED = 1e3
# What is so far below the goal is left.
SMALL = 1e-3
# Newton's method is at rounding where so many steps have not halved what is left.
NO_LESS = 3
# At most so many steps, and trials along the direction of one.
STEPS, TRIALS = 100, 60
# The slope at the end of a search, as a part of that at its begin.
FLAT = 0.1


class Direct(NamedTuple):
    """Scratch memory for one island, and the lists of islands."""

    islands: Islands
    rows: DirectRows
    base: Array  # (c, 9) [N s] f_0
    radius: Array  # (c, 3) [N s] of the disks
    pressed: Array  # (c, 3) [N s] what they should be for the normal impulses of a round
    stiff: Array  # (c, 3) [1/kg] of their rows
    rounds: Rounds  # what is known of the radii from the rounds before
    p: Array  # (6 b,) momenta that are added to those of the start
    rate: Array  # (c, 9) [m/s] a at p
    bend: Array  # (c, 9) [m/s] how a changes along a step of Newton's method
    best: Array  # (c, 9) [N s] impulses that were kept
    best_p: Array  # (6 b,) and their p
    F: Array  # (6 b,)
    pull: Array  # (6 b,) [N s] G' E a
    z: Array  # (6 b,) a step of Newton's method as velocities
    compliance: Array  # (1,) R now, in parts of the diagonal of A: COMPLIANCE but on the way
    K: Array  # (36 b b,)
    last: IntArray  # (6 b,)
    wish: Array  # (3,) f_0 - a / R of a disk
    along: Array  # (12,) a row of G times its part of the derivative of P / R


def make_direct(n: int, capacity: int) -> Direct:
    """Return room for the islands of n bodies and `capacity` manifolds."""
    c, b = MOST_MANIFOLDS, MOST_BODIES
    return Direct(make_islands(n, capacity), make_direct_rows(most_slots(n)),
                  np.zeros((c, WIDTH)), np.zeros((c, DISKS)), np.zeros((c, DISKS)),
                  np.zeros((c, DISKS)), make_rounds(c * DISKS), np.zeros(6 * b),
                  np.zeros((c, WIDTH)), np.zeros((c, WIDTH)), np.zeros((c, WIDTH)),
                  np.zeros(6 * b), np.zeros(6 * b), np.zeros(6 * b), np.zeros(6 * b),
                  np.full(1, COMPLIANCE), np.zeros(36 * b * b),
                  np.zeros(6 * b, dtype=np.int64), np.zeros(3), np.zeros(12))


@kernel
def find_momenta(count: int, moving: int, goal: float, fastest: float, work: Direct) -> int:
    """
    Find p with F = 0, up to a rate of `goal` [m/s]; return how many steps that took.

    From soft rows on where the `fastest` rate [m/s] is told, else from the p that there is.
    """
    steps = _stiffen(count, moving, fastest, work) if fastest > 0.0 else 0
    _write_F(count, moving, work)
    left, since = largest_rate(count, work), 0
    least, most = left, steps + STEPS
    while left > 0.0 and steps < most and _newton_step(count, moving, work):
        before, left, steps = left, largest_rate(count, work), steps + 1
        since = 0 if left < 0.5 * least else since + 1
        least = min(least, left)
        # Below the goal as long as it gains anything: what is left turns a light body under load.
        if left < SMALL * goal or goal > left > 0.5 * before:
            break
        if least < SOLVED * goal and since >= NO_LESS:
            break
    return steps


@kernel
def _stiffen(count: int, moving: int, fastest: float, work: Direct) -> int:
    """Come near to p from soft rows on; return how many steps that took."""
    steps = 0
    work.compliance[0] = softer = _softest(count, work)
    while softer > COMPLIANCE:
        steps += _come_near(count, moving, NEAR * fastest, work)
        stiffer = max(STIFFER * softer, COMPLIANCE)
        _assemble(count, moving, work)
        _multiply(softer / stiffer, moving, work)
        for k in range(6 * moving):
            work.z[k] = -work.F[k] - (1.0 - stiffer / softer) * work.pull[k]
        if _eliminate(moving, work):
            for b in range(moving):
                _add_momentum(b, 1.0, work)
        work.compliance[0] = softer = stiffer
        steps += 1
    return steps


@kernel
def _come_near(count: int, moving: int, goal: float, work: Direct) -> int:
    """Find p with F = 0 up to a rate of `goal` [m/s], in few steps; return how many."""
    _write_F(count, moving, work)
    for steps in range(FEW):
        if largest_rate(count, work) <= goal or not _newton_step(count, moving, work):
            return steps
    return FEW


@kernel
def _softest(count: int, work: Direct) -> float:
    """Return the compliance with which rates change impulses by as much as there is of them."""
    rows, most, change = work.rows, 0.0, 0.0
    for c in range(count):
        for r in range(WIDTH):
            if rows.there[c, r] != 0:
                most = max(most, abs(work.base[c, r]))
                change = max(change, abs(rows.rate[c, r]) / rows.stiff[c, r])
    return max(change / most, COMPLIANCE) if most > change else 1.0


@kernel
def _newton_step(count: int, moving: int, work: Direct) -> bool:
    """
    Take one step from p, and write f and F; return whether there was one.

    With E the derivative of P / R and z = M^-1 dp, (M + G' E G) z = -F, which is symmetric.
    """
    rows, z, F = work.rows, work.z[:6 * moving], work.F
    _assemble(count, moving, work)
    for k in range(6 * moving):
        z[k] = -F[k]
    if not (_eliminate(moving, work) and _product(z, F) < 0.0):
        return False
    for c in range(count):
        for r in range(WIDTH):
            work.bend[c, r] = rate_by(rows.G, c, r, z, rows) if rows.there[c, r] != 0 else 0.0
    far = _search(count, moving, work)
    for b in range(moving):
        _add_momentum(b, far, work)
    _write_F(count, moving, work)
    return True


@kernel
def _assemble(count: int, moving: int, work: Direct) -> None:
    """Write G' E G to K, on and above the diagonal, and G' E a."""
    size = 6 * moving
    K = work.K[:size * size].reshape((size, size))
    for i in range(size):
        work.pull[i] = 0.0
        for j in range(size):
            K[i, j] = 0.0
    for c in range(count):
        _add_manifold(c, K, work)


@kernel
def _multiply(times: float, moving: int, work: Direct) -> None:
    """Let E be so many times as large in what was assembled."""
    size = 6 * moving
    for i in range(size):
        work.pull[i] *= times
    for i in range(size * size):
        work.K[i] *= times


@kernel
def _eliminate(moving: int, work: Direct) -> bool:
    """Solve (M + G' E G) z' = z for z', in the place of z; return False if that fails."""
    size = 6 * moving
    K = work.K[:size * size].reshape((size, size))
    for b in range(moving):
        _add_inertia(b, K, work)
    return solve_symmetric(K, work.z[:size], work.last)


@kernel
def _search(count: int, moving: int, work: Direct) -> float:
    """
    Return how far to go along the step, as a part of it.

    The convex function has a slope along it that grows: its zero lies between `low` and `high`.
    """
    first = _slope(0.0, count, moving, work)
    low, high, at = 0.0, np.inf, 1.0
    for _ in range(TRIALS):
        now = _slope(at, count, moving, work)
        if abs(now) <= -FLAT * first or (now < 0.0 and at == 1.0):
            break
        if now < 0.0:
            low = at
        else:
            high = at
        at = 0.5 * (low + high)
    return at


@kernel
def _slope(far: float, count: int, moving: int, work: Direct) -> float:
    """Return the slope of the convex function some way along the step: z . F there."""
    rows, z, p, total = work.rows, work.z, work.p, 0.0
    for k in range(6 * moving):
        total += z[k] * p[k]
    for b in range(moving):
        total += far * _twice_energy(b, work)
    for c in range(count):
        _write_impulses(c, far, work)
        for r in range(WIDTH):
            if rows.there[c, r] != 0:
                total -= work.bend[c, r] * (rows.f[c, r] - rows.start[c, r])
    return total


@kernel
def _twice_energy(b: int, work: Direct) -> float:
    """Return z . M z of a body."""
    inertia, at, z = work.rows.inertia[b], 6 * b, work.z
    x, y, s = z[at + 3], z[at + 4], z[at + 5]
    return float(inertia[0] * (z[at] * z[at] + z[at + 1] * z[at + 1] + z[at + 2] * z[at + 2])
                 + x * (inertia[1] * x + 2.0 * (inertia[2] * y + inertia[3] * s))
                 + y * (inertia[4] * y + 2.0 * inertia[5] * s) + inertia[6] * s * s)


@kernel
def _product(z: Array, F: Array) -> float:
    total = 0.0
    for k in range(z.shape[0]):
        total += z[k] * F[k]
    return total


@kernel
def _add_inertia(b: int, K: Array, work: Direct) -> None:
    """Add the mass and the inertia of a body to K, on and above the diagonal."""
    inertia, at, k = work.rows.inertia[b], 6 * b, 1
    for i in range(3):
        K[at + i, at + i] += inertia[0]
        for j in range(i, 3):
            K[at + 3 + i, at + 3 + j] += inertia[k]
            k += 1


@kernel
def _add_momentum(b: int, times: float, work: Direct) -> None:
    """Add what a body gains of momentum by a part of the step."""
    inertia, at, p, z = work.rows.inertia[b], 6 * b, work.p, work.z
    for k in range(3):
        p[at + k] += times * inertia[0] * z[at + k]
    x, y, z_z = z[at + 3], z[at + 4], z[at + 5]
    p[at + 3] += times * (inertia[1] * x + inertia[2] * y + inertia[3] * z_z)
    p[at + 4] += times * (inertia[2] * x + inertia[4] * y + inertia[5] * z_z)
    p[at + 5] += times * (inertia[3] * x + inertia[5] * y + inertia[6] * z_z)


@kernel
def _write_F(count: int, moving: int, work: Direct) -> None:
    """Write f and F at p."""
    rows, p, F = work.rows, work.p, work.F
    for k in range(6 * moving):
        F[k] = p[k]
    for c in range(count):
        for r in range(WIDTH):
            if rows.there[c, r] != 0:
                work.rate[c, r] = rows.rate[c, r] + rate_by(rows.W, c, r, p, rows)
        _write_impulses(c, 0.0, work)
        add_momenta(c, -1.0, F, rows)


@kernel
def add_momenta(c: int, times: float, to: Array, rows: DirectRows) -> None:
    """Add, so many times, the momenta of what changed of the impulses of a manifold."""
    for side in range(2):
        if rows.body[c, side] >= 0:
            at = 6 * rows.body[c, side]
            for r in range(WIDTH):
                if rows.there[c, r] != 0:
                    change = times * (rows.f[c, r] - rows.start[c, r])
                    for k in range(6):
                        to[at + k] += rows.G[c, r, 6 * side + k] * change


@kernel
def _write_impulses(c: int, far: float, work: Direct) -> None:
    """Write the impulses of a manifold some way along the step: P(f_0 - a / R)."""
    rows, f = work.rows, work.rows.f
    for r in range(WIDTH):
        if rows.there[c, r] != 0:
            rate = work.rate[c, r] + far * work.bend[c, r]
            f[c, r] = work.base[c, r] - rate / (work.compliance[0] * rows.stiff[c, r])
    for r in range(SLIDE):
        f[c, r] = max(f[c, r], 0.0)
    for d in range(DISKS):
        first, size = disk_of(c, d, rows)
        long, radius = length_of(c, d, rows), work.radius[c, d]
        for k in range(size if long > radius else 0):
            f[c, first + k] *= radius / long


@kernel
def length_of(c: int, d: int, rows: DirectRows) -> float:
    first, size = disk_of(c, d, rows)
    square = 0.0
    for r in range(first, first + size):
        square += rows.f[c, r] * rows.f[c, r]
    return float(np.sqrt(square))


@kernel
def largest_rate(count: int, work: Direct) -> float:
    """Return how far the rates of the rows are from those that F = 0 would have [m/s]."""
    largest = 0.0
    for c in range(count):
        for r in range(WIDTH):
            if work.rows.there[c, r] != 0:
                largest = max(largest, abs(rate_by(work.rows.W, c, r, work.F, work.rows)))
    return largest


@kernel
def _add_manifold(c: int, K: Array, work: Direct) -> None:
    """Add G' E G of a manifold to K."""
    rows, f, along = work.rows, work.rows.f, work.along
    for r in range(SLIDE):
        if rows.there[c, r] != 0 and f[c, r] > 0.0:
            for k in range(12):
                along[k] = rows.G[c, r, k] / (work.compliance[0] * rows.stiff[c, r])
            _add_row(c, r, K, work)
    for d in range(DISKS):
        first, size = disk_of(c, d, rows)
        if size > 0:
            _add_disk(c, d, first, size, K, work)


@kernel
def _add_disk(c: int, d: int, first: int, size: int, K: Array, work: Direct) -> None:
    """Add that of the rows of a disk: inside of it as of others, on its edge across w alone."""
    rows, wish, along, radius = work.rows, work.wish, work.along, work.radius[c, d]
    stiff, square = work.compliance[0] * rows.stiff[c, first], 0.0
    for k in range(size):
        wish[k] = work.base[c, first + k] - work.rate[c, first + k] / stiff
        square += wish[k] * wish[k]
    slides = square > radius * radius
    part = (radius / np.sqrt(square) if slides else 1.0) / stiff
    for i in range(size if part > 0.0 else 0):
        for k in range(12):
            along[k] = 0.0
        for j in range(size):
            e = (1.0 if i == j else 0.0) - (wish[i] * wish[j] / square if slides else 0.0)
            for k in range(12):
                along[k] += part * e * rows.G[c, first + j, k]
        _add_row(c, first + i, K, work)


@kernel
def _add_row(c: int, r: int, K: Array, work: Direct) -> None:
    """Add the product of a row of G and `along` to K, where it is on or above the diagonal."""
    rows, along = work.rows, work.along
    for side in range(2):
        to, g = rows.body[c, side], rows.G[c, r]
        for k in range(6 if to >= 0 else 0):
            work.pull[6 * to + k] += along[6 * side + k] * work.rate[c, r]
        for other in range(2):
            at = rows.body[c, other]
            if to >= 0 and at >= to:
                of = along[6 * other:6 * other + 6]
                for i in range(6):
                    line, times = K[6 * to + i][6 * at:6 * at + 6], g[6 * side + i]
                    for k in range(6):
                        line[k] += times * of[k]
