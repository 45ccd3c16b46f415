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
Sci. 5 (1983)), by a method for fixed points: repeating alone is slow where friction and pressure
depend on each other, and where friction that grows adds to the pressure it leads away.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.maths.elimination import solve_symmetric
from rigid_sim_ros.engine.maths.fixed_point import make_rounds, next_round, Rounds
from rigid_sim_ros.engine.solver.direct_islands import (
    Islands, make_islands, MOST_BODIES, MOST_MANIFOLDS)
from rigid_sim_ros.engine.solver.direct_rows import (
    DirectRows, disk_of, DISKS, make_direct_rows, pressure_of, rate_by, SLIDE, WIDTH)
from rigid_sim_ros.engine.solver.solver_bodies import most_slots
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# R in parts of the diagonal of A = W G'. Smaller: less is left for the next round, and rounding
# of p, 1e-16 / COMPLIANCE, for more steps of this one.
COMPLIANCE = 1e-8
# A rate this near to its law is right, in sizes of a shape per substep: what SETTLED is to sweeps.
GOAL = 1e-9
# Rates are known to this part of the fastest one: f has the rounding of a over the compliance,
# 1e-16 / COMPLIANCE of it, and so have the momenta that the two are compared in.
ROUNDED = 1e-7
# Newton's method is at rounding where so many steps have not halved what is left.
NO_LESS = 3
# At most so many rounds, steps of Newton's method in one, and trials along the direction of one.
# One problem in a hundred takes more than fifteen rounds, one in five hundred is unsolved by then.
ROUNDS, STEPS, TRIALS = 60, 100, 60
# After so many steps no round begins: of 57 000 problems of heaps none took more that was solved
# in the end. What is left then is used as far as it came.
MOST_STEPS = 400
# Momenta and impulses that differ by so many times the goal are those of a solution: rounding
# leaves up to 10.
SOLVED = 1e3
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
    pressed: Array  # (c, 3) [N s] what they should be for the normal impulses of a round
    stiff: Array  # (c, 3) [1/kg] of their rows
    rounds: Rounds  # what is known of the radii from the rounds before
    p: Array  # (6 b,) momenta that are added to those of the start
    rate: Array  # (c, 9) [m/s] a at p
    bend: Array  # (c, 9) [m/s] how a changes along a step of Newton's method
    best: Array  # (c, 9) [N s] impulses that were kept
    best_p: Array  # (6 b,) and their p
    F: Array  # (6 b,)
    z: Array  # (6 b,) a step of Newton's method as velocities
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
                  np.zeros(6 * b), np.zeros(6 * b), np.zeros(6 * b), np.zeros(36 * b * b),
                  np.zeros(6 * b, dtype=np.int64), np.zeros(3), np.zeros(12))


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
        steps = _minimize(count, moving, 0.1 * goal, work)
        taken += steps
        # Away from F = 0 impulses are rates over the compliance: they would throw bodies about.
        off = _largest_rate(count, work)
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
        _add_momenta(c, -1.0, work.F, work.rows)
    # Of a solution p is more accurate: in f there is rounding of rates over the compliance.
    if _largest_rate(count, work) > goal:
        for k in range(6 * moving):
            work.p[k] -= work.F[k]


@kernel
def _add_momenta(c: int, times: float, to: Array, rows: DirectRows) -> None:
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
def _minimize(count: int, moving: int, goal: float, work: Direct) -> int:
    """Find p with F = 0, up to a rate of `goal` [m/s]; return how many steps that took."""
    _write_F(count, moving, work)
    left, steps, since = _largest_rate(count, work), 0, 0
    least = left
    while left > 0.0 and steps < STEPS and _newton_step(count, moving, work):
        before, left, steps = left, _largest_rate(count, work), steps + 1
        since = 0 if left < 0.5 * least else since + 1
        least = min(least, left)
        # Below the goal as long as it gains anything: what is left turns a light body under load.
        if (left < goal and left > 0.5 * before) or (least < SOLVED * goal and since >= NO_LESS):
            break
    return steps


@kernel
def _newton_step(count: int, moving: int, work: Direct) -> bool:
    """
    Take one step from p, and write f and F; return whether there was one.

    With E the derivative of P / R and z = M^-1 dp, (M + G' E G) z = -F, which is symmetric.
    """
    size, rows = 6 * moving, work.rows
    z, F = work.z[:size], work.F
    K = work.K[:size * size].reshape((size, size))
    for i in range(size):
        z[i] = -F[i]
        for j in range(size):
            K[i, j] = 0.0
    for b in range(moving):
        _add_inertia(b, K, work)
    for c in range(count):
        _add_manifold(c, K, work)
    if not solve_symmetric(K, z, work.last):
        return False
    if not _product(z, F) < 0.0:
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
        _add_momenta(c, -1.0, F, rows)


@kernel
def _write_impulses(c: int, far: float, work: Direct) -> None:
    """Write the impulses of a manifold some way along the step: P(f_0 - a / R)."""
    rows, f = work.rows, work.rows.f
    for r in range(WIDTH):
        if rows.there[c, r] != 0:
            rate = work.rate[c, r] + far * work.bend[c, r]
            f[c, r] = work.base[c, r] - rate / (COMPLIANCE * rows.stiff[c, r])
    for r in range(SLIDE):
        f[c, r] = max(f[c, r], 0.0)
    for d in range(DISKS):
        first, size = disk_of(c, d, rows)
        long, radius = _length(c, d, rows), work.radius[c, d]
        for k in range(size if long > radius else 0):
            f[c, first + k] *= radius / long


@kernel
def _length(c: int, d: int, rows: DirectRows) -> float:
    first, size = disk_of(c, d, rows)
    square = 0.0
    for r in range(first, first + size):
        square += rows.f[c, r] * rows.f[c, r]
    return float(np.sqrt(square))


@kernel
def _largest_rate(count: int, work: Direct) -> float:
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
                along[k] = rows.G[c, r, k] / (COMPLIANCE * rows.stiff[c, r])
            _add_row(c, r, K, work)
    for d in range(DISKS):
        first, size = disk_of(c, d, rows)
        if size > 0:
            _add_disk(c, d, first, size, K, work)


@kernel
def _add_disk(c: int, d: int, first: int, size: int, K: Array, work: Direct) -> None:
    """Add that of the rows of a disk: inside of it as of others, on its edge across w alone."""
    rows, wish, along, radius = work.rows, work.wish, work.along, work.radius[c, d]
    stiff, square = COMPLIANCE * rows.stiff[c, first], 0.0
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
        for other in range(2):
            at = rows.body[c, other]
            if to >= 0 and at >= to:
                of = along[6 * other:6 * other + 6]
                for i in range(6):
                    line, times = K[6 * to + i][6 * at:6 * at + 6], g[6 * side + i]
                    for k in range(6):
                        line[k] += times * of[k]


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
                radius, long = rows.limit[c, d] * pressure, _length(c, d, rows)
                off = max(long - radius, 0.0)
                if long >= work.radius[c, d] * (1.0 - 1e-12):
                    off = abs(radius - work.radius[c, d])
                worst = max(worst, rows.stiff[c, first] * off)
    return worst
