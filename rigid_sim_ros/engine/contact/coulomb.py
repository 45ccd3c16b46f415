# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The law of contact at points whose rates are a = A f + b: violation, sweeps and Newton's method.

Along the normal a_n >= 0, f_n >= 0, f_n a_n = 0, and in the tangential plane Coulomb's law. See
resting_qp.py for what A and b are. Torques against spinning and rolling obey the same law with
coefficients of their own: three disks in place of one, and three more rows to a point.
"""

import numpy as np

from rigid_sim_ros.engine.maths.elimination import solve_linear
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# A is singular where points are redundant (the four corners of a box): the forces are not unique,
# A f is, and rounding in b can make sticking everywhere impossible. Each A_ii grows by this
# fraction, a compliance of the points: redundant points share the load evenly, and a
# contact under the force f yields with the acceleration 1e-8 A_ii f, 1e-10 m/s for a body under
# its weight at a step of 1 ms. Smaller: forces feel rounding more.
COMPLIANCE = 1e-8
NEWTON_STEPS = 40
FEW_STEPS = 4  # while the division of the points lasts, 1 or 2 are enough
# Newton's method ends at a violation this small against |b|; rounding leaves 1e-16 to 1e-13.
GOAL = 1e-12
# Less than ENOUGH ends the search: 1e-9 of g moves a body at rest with 1e-11 m/s after a step of 1
# ms. Redundant points on the verge of slipping may stay above it; more than TOLERANCE after ROUNDS
# is not solved.
ENOUGH = 1e-9
TOLERANCE = 1e-7


@kernel
def coefficients(width: int) -> int:
    """Return how many coefficients, and disks, a point with so many rows has: 1 or 3."""
    return width // 3 * 2 - 1


@kernel
def disk(d: int) -> tuple[int, int]:
    """Return the first row of disk d of a point and how many it has: slip, spin, roll."""
    if d == 0:
        return 1, 2
    if d == 1:
        return 3, 1
    return 4, 2


@kernel
def onto_disk(x: float, y: float, radius: float) -> tuple[float, float]:
    """Return the point of a disk about 0 that is nearest to (x, y)."""
    length = np.sqrt(x * x + y * y)
    if length > radius:
        return x * radius / length, y * radius / length
    return x, y


@kernel
def off_disk(f_x: float, f_y: float, w_x: float, w_y: float, radius: float, size: int) -> float:
    """Return how far the forces of a disk of 1 or 2 rows are from the nearest of it to w."""
    w_x, w_y = onto_disk(w_x, w_y, radius)
    return max(abs(f_x - w_x), abs(f_y - w_y) if size == 2 else 0.0)


@kernel
def _stiffness(A: Array, x: int, rows: int) -> float:
    """Return the larger diagonal entry of the rows of a disk [1/kg]."""
    return max(A[x, x], A[x + rows - 1, x + rows - 1])


@kernel
def _violation(A: Array, b: Array, mu: Array, f: Array, a: Array) -> float:
    """Write a = A f + b and return by how much the conditions are violated [unit of b]."""
    rows = b.shape[0]
    for i in range(rows):
        total = b[i]
        for j in range(rows):
            total += A[i, j] * f[j]
        a[i] = total
    worst, width = 0.0, rows // mu.shape[0]
    for k in range(mu.shape[0]):
        n = width * k
        stiff = A[n, n]
        pressed = max(0.0, f[n] - a[n] / stiff)
        worst = max(worst, abs(f[n] - pressed) * stiff)
        for d in range(coefficients(width)):
            first, size = disk(d)
            x, y = n + first, n + first + size - 1
            stiff = _stiffness(A, x, size)
            w_x = f[x] - a[x] / stiff
            w_y = f[y] - a[y] / stiff if size == 2 else 0.0
            limit = mu[k, d] * max(0.0, f[n])
            worst = max(worst, off_disk(f[x], f[y], w_x, w_y, limit, size) * stiff)
    return worst


def coefficient_table(mu: Array, rows: int) -> Array:
    """Return the coefficients as (m, 1) or, with rows for spinning and rolling, (m, 3)."""
    m = len(mu)
    return np.ascontiguousarray(mu.reshape(m, -1)[:, :coefficients(rows // m)])


def residual(A: Array, b: Array, mu: Array, f: Array) -> float:
    """
    Return how far forces are from the conditions at the top of this file, relative to max |b|.

    It is the largest |f - P(f - a / A_ii)| A_ii over the points, P the projection onto f_n >= 0
    and onto the disk |f_t| <= mu f_n: an acceleration, and 0 exactly for a solution.
    """
    worst = float(_violation(A, b, coefficient_table(mu, len(b)), f, np.empty_like(b)))
    return worst / max(float(np.abs(b).max()), 1e-300)


@kernel
def _newton_rows(A: Array, a: Array, mu: Array, f: Array, k: int, M: Array, x: Array) -> None:
    """
    Write the equations of point k for the change of f: M df = x.

    They are the derivatives of f = P(f - a / A_ii) in the case that holds at f: open, sticking,
    sliding (Alart, Curnier, A mixed formulation for frictional contact problems, Comput. Methods
    Appl. Mech. Eng. 92 (1991)).
    """
    rows = x.shape[0]
    width = rows // mu.shape[0]
    n = width * k
    for i in range(n, n + width):
        for j in range(rows):
            M[i, j] = 0.0
    if f[n] - a[n] / A[n, n] <= 0.0:
        for i in range(n, n + width):
            M[i, i] = 1.0
            x[i] = -f[i]
        return
    for j in range(rows):
        M[n, j] = A[n, j] / A[n, n]
    x[n] = -a[n] / A[n, n]
    for d in range(coefficients(width)):
        first, size = disk(d)
        _newton_disk(A, a, mu[k, d], f, n, n + first, size, M, x)


@kernel
def _newton_disk(A: Array, a: Array, mu: float, f: Array, n: int, p: int, size: int, M: Array,
                 x: Array) -> None:
    """Write the equations of one disk: `size` rows from p on, of the point with the normal n."""
    rows, q = x.shape[0], p + size - 1
    stiff = _stiffness(A, p, size)
    w_x = f[p] - a[p] / stiff
    w_y = f[q] - a[q] / stiff if size == 2 else 0.0
    length, limit = np.sqrt(w_x * w_x + w_y * w_y), mu * max(0.0, f[n])
    if length <= limit:
        for i in range(p, q + 1):
            for j in range(rows):
                M[i, j] = A[i, j] / stiff
            x[i] = -a[i] / stiff
        return
    e_x, e_y = w_x / length, w_y / length
    bend = limit / length
    # d(limit e) = mu e df_n + limit / |w| (1 - e e') (df_t - da_t / stiff)
    for i in range(size):
        e_i = e_x if i == 0 else e_y
        along_x = bend * ((1.0 if i == 0 else 0.0) - e_i * e_x)
        along_y = bend * ((1.0 if i == 1 else 0.0) - e_i * e_y)
        if size == 1:
            along_x, along_y = 0.0, 0.0
        for j in range(rows):
            M[p + i, j] = (along_x * A[p, j] + along_y * A[q, j]) / stiff
        M[p + i, n] -= mu * e_i
        M[p + i, p] -= along_x
        M[p + i, q] -= along_y
        M[p + i, p + i] += 1.0
        x[p + i] = limit * e_i - f[p + i]


def improve(A: Array, b: Array, mu: Array, f: Array, goal: float, steps: int) -> float:
    """Improve f as `refine` does, with scratch memory of its own."""
    rows = len(b)
    return float(refine(A, b, mu, f, goal, steps, np.empty(rows), np.empty(rows),
                        np.empty((rows, rows)), np.empty(rows), np.empty(rows, dtype=np.int64)))


@kernel
def refine(A: Array, b: Array, mu: Array, f: Array, goal: float, steps: int, a: Array,
           trial: Array, M: Array, x: Array, last: IntArray) -> float:
    """
    Improve f, in place, by Newton's method; return its violation [unit of b].

    It ends at a violation of `goal` [unit of b], after `steps`, or when it gains nothing any more.
    a, trial, x, (rows,), M, (rows, rows), and last, (rows,), are scratch.
    """
    rows = b.shape[0]
    for i in range(rows):
        trial[i] = f[i]
    best = _violation(A, b, mu, f, a)
    idle = 0
    if best <= goal:
        return best
    for _ in range(steps):
        if best <= goal or idle > 6:
            return best
        for k in range(mu.shape[0]):
            _newton_rows(A, a, mu, trial, k, M, x)
        if not solve_linear(M, x, last):
            return best
        for i in range(rows):
            trial[i] += x[i]
        now = _violation(A, b, mu, trial, a)
        if not now < np.inf:
            return best
        idle += 1
        if now < best:
            # A gain worth another try; small ones, at rounding, let the counter run.
            if now < 0.5 * best:
                idle = 0
            best = now
            for i in range(rows):
                f[i] = trial[i]
    return best


def sweep(A: Array, b: Array, mu: Array, f: Array, count: int) -> None:
    """
    Bring f nearer to a solution, in place, by `count` sweeps of projected Gauss-Seidel.

    It cannot end in a cycle as Newton's method can, but only creeps where points are redundant.
    """
    sweep_in_place(A, b, mu, f, count, np.empty_like(b))


@kernel
def sweep_in_place(A: Array, b: Array, mu: Array, f: Array, count: int, a: Array) -> None:
    """Do the same as `sweep`; a, (rows,), is scratch."""
    _violation(A, b, mu, f, a)
    rows = b.shape[0]
    width = rows // mu.shape[0]
    for _ in range(count):
        for k in range(mu.shape[0]):
            n = width * k
            before = f[n]
            f[n] = max(0.0, before - a[n] / A[n, n])
            for i in range(rows):
                a[i] += A[i, n] * (f[n] - before)
            for d in range(coefficients(width)):
                first, size = disk(d)
                _sweep_disk(A, mu[k, d] * f[n], f, n + first, size, a)


@kernel
def _sweep_disk(A: Array, limit: float, f: Array, p: int, size: int, a: Array) -> None:
    """Project the forces of one disk after a step against its rates."""
    q = p + size - 1
    x, y = f[p], f[q]
    # The largest eigenvalue of the 2 x 2 block bounds the step, so that the projection converges.
    stiff = _stiffness(A, p, size) + (abs(A[p, q]) if size == 2 else 0.0)
    w_x = x - a[p] / stiff
    w_y = y - a[q] / stiff if size == 2 else 0.0
    w_x, w_y = onto_disk(w_x, w_y, limit)
    f[p] = w_x
    for i in range(a.shape[0]):
        a[i] += A[i, p] * (w_x - x)
    if size == 2:
        f[q] = w_y
        for i in range(a.shape[0]):
            a[i] += A[i, q] * (w_y - y)
