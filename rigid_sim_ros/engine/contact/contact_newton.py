# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Newton's method for the rows of contact_rows.py, in the momenta of the bodies.

The conditions f = P(f - a / A_ii), in the case that holds at f (open, sticking, sliding: Alart,
Curnier, A mixed formulation for frictional contact problems, Comput. Methods Appl. Mech. Eng. 92
(1991)), are for each point

    C df + D G dz = x,    so df = y - E G dz    with E = C^-1 D, y = C^-1 x,

and with dz = M^-1 dp, dp = G' df, the change of the momenta dp of the bodies solves

    (1 + G' E W') dp = G' y.

E is of the size of 1 / compliance where a point presses, so one step leaves 1e-8 of the violation
that rounding of the whole would leave 1e-16 of; the next step takes that. While the division of
the points lasts, and none slides, E is the same in it, and so are the factors of the matrix.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.contact_rows import (
    all_rows, disk_stiffness, Rows, violation)
from rigid_sim_ros.engine.contact.contacts import Contacts
from rigid_sim_ros.engine.contact.coulomb import coefficients, disk
from rigid_sim_ros.engine.contact.scalar_rows import resolve
from rigid_sim_ros.engine.maths.elimination import factor_linear, solve_columns, solve_factored
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Steps of Newton's method: while the division of the points lasts 1 or 2 are enough.
FEW_STEPS, NEWTON_STEPS = 4, 10


class Newton(NamedTuple):
    """Scratch memory for s bodies that are touched."""

    slot: IntArray  # (n,) the place of a body, -1: not touched
    K: Array  # (36 s s,), or of the rows of a matrix
    p: Array  # (6 s,)
    local: Array  # (6, 13) C, D and x of one point
    E: Array  # (c, 6, 6)
    y: Array  # (r,) and the change of the forces
    last: IntArray  # as many as K has rows
    order: IntArray  # likewise, of its factors
    x: Array  # likewise, scratch
    effort: Array  # (1,) multiplications so far in this step, about


def make_newton(points: int, rows: int, touched: int, bodies: int, matrix: int = 0) -> Newton:
    """Return room for so many points, rows, bodies that are touched, bodies, and matrix rows."""
    size = max(6 * touched, matrix)
    return Newton(np.zeros(bodies, dtype=np.int64), np.zeros(size * size),
                  np.zeros(6 * touched), np.zeros((6, 13)), np.zeros((points, 6, 6)),
                  np.zeros(max(rows, matrix)), np.zeros(size, dtype=np.int64),
                  np.zeros(size, dtype=np.int64), np.zeros(size), np.zeros(1))


@kernel
def number_bodies(contacts: Contacts, chosen: IntArray, inv_m: Array, slot: IntArray) -> int:
    """Give the bodies of the chosen points that can move their places; return how many."""
    for k in chosen:
        slot[contacts.body_a[k]] = slot[contacts.body_b[k]] = -1
    count = 0
    for k in chosen:
        for side in range(2):
            body = contacts.body_a[k] if side == 0 else contacts.body_b[k]
            if slot[body] < 0 and inv_m[body] > 0.0:
                slot[body] = count
                count += 1
    return count


@kernel
def _write_case(rows: Rows, c: int, width: int, f: Array, s: Array) -> None:
    """Write C, D and x of point c to s[:, :w], s[:, w:2w], s[:, 2w]."""
    n, a, last = width * c, rows.a, 2 * width
    for p in range(width):
        for q in range(last + 1):
            s[p, q] = 0.0
    if f[n] - a[n] / rows.stiff[n] <= 0.0:
        for p in range(width):
            s[p, p], s[p, last] = 1.0, -f[n + p]
        return
    _write_stick(rows, n, 0, width, s)
    for d in range(coefficients(width)):
        first, size = disk(d)
        _write_disk(rows, n, first, size, rows.mu[c, d], width, f, s)


@kernel
def _write_stick(rows: Rows, n: int, p: int, width: int, s: Array) -> None:
    i = n + p
    s[p, p] = rows.compliance[i] / rows.stiff[i]
    s[p, width + p] = 1.0 / rows.stiff[i]
    s[p, 2 * width] = -rows.a[i] / rows.stiff[i]


@kernel
def _write_disk(rows: Rows, n: int, p: int, size: int, mu: float, width: int, f: Array,
                s: Array) -> None:
    """Write the equations of one disk: `size` rows from p on, of the point with the normal n."""
    q, stiff = p + size - 1, disk_stiffness(rows, n + p, size)
    w_x = f[n + p] - rows.a[n + p] / stiff
    w_y = f[n + q] - rows.a[n + q] / stiff if size == 2 else 0.0
    long, limit = np.sqrt(w_x * w_x + w_y * w_y), mu * max(0.0, f[n])
    if long <= limit:
        _write_stick(rows, n, p, width, s)
        if size == 2:
            _write_stick(rows, n, q, width, s)
        return
    # d(limit e) = mu e df_n + limit / |w| (1 - e e') (df_t - da_t / stiff)
    bend = limit / long
    for i in range(size):
        e_i = (w_x if i == 0 else w_y) / long
        s[p + i, 0] -= mu * e_i
        s[p + i, p + i] += 1.0
        s[p + i, 2 * width] = limit * e_i - f[n + p + i]
        for j in range(size):
            e_j = (w_x if j == 0 else w_y) / long
            along = bend * ((1.0 if i == j else 0.0) - e_i * e_j) if size == 2 else 0.0
            s[p + i, p + j] -= along * (1.0 - rows.compliance[n + p + j] / stiff)
            s[p + i, width + p + j] += along / stiff


@kernel
def _write_scalar_case(rows: Rows, n: int, q: int, f: Array, w: Newton) -> None:
    """Write E and y of row q behind the n rows of points: (1 + slope R) df = y - slope A df."""
    i = n + q
    rate, stiff, yields = rows.a[i], rows.stiff[i], rows.compliance[i]
    _, slope, start = resolve(rows.scalar, q, rate - stiff * f[i], stiff)
    if slope == np.inf:     # A df + R df = start - rate
        rows.scalar.E[q], w.y[i] = 1.0 / yields, (start - rate) / yields
    else:
        share = 1.0 / (1.0 + slope * yields)
        rows.scalar.E[q], w.y[i] = share * slope, share * (start - slope * rate - f[i])


@kernel
def add_point(rows: Rows, c: int, width: int, slot: IntArray, E: Array, K: Array) -> None:
    """Add G' E W' of point c to K."""
    n = width * c
    for side in range(2):
        to = slot[rows.body[c, side]]
        if to < 0:
            continue
        for j in range(6):
            i = 6 * to + j
            for r in range(width):
                weight = 0.0
                for q in range(width):
                    weight += rows.G[n + q, 6 * side + j] * E[c, q, r]
                if weight == 0.0:
                    continue
                begin = rows.at[n + r]
                for e in range(rows.first[c], rows.first[c + 1]):
                    at = slot[rows.moved[e]]
                    if at >= 0:
                        line, moves = K[i][6 * at:6 * at + 6], rows.W[begin:begin + 6]
                        for k in range(6):
                            line[k] += weight * moves[k]
                    begin += 6


@kernel
def _add_push(rows: Rows, c: int, width: int, slot: IntArray, y: Array, p: Array) -> None:
    """Add G' y of point c to p."""
    for side in range(2):
        to = slot[rows.body[c, side]]
        for j in range(6 if to >= 0 else 0):
            for q in range(width * c, width * c + width):
                p[6 * to + j] += rows.G[q, 6 * side + j] * y[q]


@kernel
def newton_step(rows: Rows, m: int, width: int, touched: int, f: Array, w: Newton) -> bool:
    """Take one step from f, in place; rows.a has to be that of f. False: it is not possible."""
    is_factored = rows.factored[0] == 1 and rows.scalar.present[0] == 0
    for c in range(m):
        _write_case(rows, c, width, f, w.local)
        if not solve_columns(w.local, width, 2 * width + 1):
            return False
        for q in range(width):
            w.y[width * c + q] = w.local[q, 2 * width]
            for r in range(width):
                is_factored = is_factored and w.E[c, q, r] == w.local[q, width + r]
                w.E[c, q, r] = w.local[q, width + r]
    for q in range(rows.scalar.present[0]):
        _write_scalar_case(rows, width * m, q, f, w)
    rows.factored[0] = 1 if is_factored else 0
    if not solve_step(rows, m, width, touched, w):
        return False
    for i in range(all_rows(rows, m, width)):
        f[i] += w.y[i]
    return True


@kernel
def solve_step(rows: Rows, m: int, width: int, touched: int, w: Newton) -> bool:
    """
    Put the change df = y - E G M^-1 G' df of the forces in the place of y; False: there is none.

    By the momenta of the bodies, or by the forces themselves if there is a matrix.
    """
    if rows.in_matrix[0] > 0:
        return _solve_for_forces(rows, m, width, w)
    size = 6 * touched
    K, p, dp = w.K[:size * size].reshape((size, size)), w.p[:size], w.x[:size]
    for i in range(size):
        p[i] = 0.0
    for c in range(m):
        _add_push(rows, c, width, w.slot, w.y, p)
    if rows.factored[0] == 0:
        for i in range(size):
            for j in range(size):
                K[i, j] = 0.0
            K[i, i] = 1.0
        for c in range(m):
            add_point(rows, c, width, w.slot, w.E, K)
        if not factor_linear(K, w.last[:size], w.order[:size]):
            return False
        rows.factored[0] = 1
    solve_factored(K, p, dp, w.last[:size], w.order[:size])
    for c in range(m):
        n = width * c
        for r in range(width):
            moved, begin = 0.0, rows.at[n + r]
            for e in range(rows.first[c], rows.first[c + 1]):
                at = w.slot[rows.moved[e]]
                if at >= 0:
                    for k in range(6):
                        moved += rows.W[begin + k] * dp[6 * at + k]
                begin += 6
            for q in range(width):
                w.y[n + q] -= w.E[c, q, r] * moved
    return True


@kernel
def _solve_for_forces(rows: Rows, m: int, width: int, w: Newton) -> bool:
    """Put the change of the forces in the place of y, by (1 + E G M^-1 G') df = y."""
    size = all_rows(rows, m, width)
    K, df = w.K[:size * size].reshape((size, size)), w.x[:size]
    if rows.factored[0] == 0:
        _write_force_matrix(rows, m, width, w.E, K)
        if not factor_linear(K, w.last[:size], w.order[:size]):
            return False
        rows.factored[0] = 1
    solve_factored(K, w.y, df, w.last[:size], w.order[:size])
    for i in range(size):
        w.y[i] = df[i]
    return True


@kernel
def _write_force_matrix(rows: Rows, m: int, width: int, E: Array, K: Array) -> None:
    """Write 1 + E G M^-1 G' to K."""
    size = K.shape[0]
    A = rows.A[:size * size].reshape((size, size))
    for i in range(width * m, size):
        for j in range(size):
            K[i, j] = rows.scalar.E[i - width * m] * A[i, j]
        K[i, i] += 1.0
    for c in range(m):
        n = width * c
        for q in range(n, n + width):
            for j in range(size):
                K[q, j] = 0.0
            for r in range(width):
                part = E[c, q - n, r]
                for j in range(size if part != 0.0 else 0):
                    K[q, j] += part * A[n + r, j]
            K[q, q] += 1.0


@kernel
def refine_rows(rows: Rows, m: int, width: int, touched: int, goal: float, steps: int,
                w: Newton) -> float:
    """
    Improve rows.f, in place, by Newton's method; return its violation [unit of b].

    It ends at a violation of `goal`, after `steps`, or when it gains nothing any more.
    """
    count = all_rows(rows, m, width)
    f, trial = rows.f, rows.trial
    best = violation(rows, m, width, f)
    for i in range(count):
        trial[i] = f[i]
    idle = 0
    for _ in range(steps):
        if best <= goal or idle > 5 or not newton_step(rows, m, width, touched, trial, w):
            break
        now = violation(rows, m, width, trial)
        if not now < np.inf:
            break
        idle += 1
        if now < best:
            # A gain worth another try; small ones, at rounding, let the counter run.
            if now < 0.5 * best:
                idle = 0
            best = now
            for i in range(count):
                f[i] = trial[i]
    return best
