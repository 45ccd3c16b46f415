# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The problem of resting_qp.py with the rows of contact in place of the matrix that they make.

At m points of w rows each, a = A f + b with A = G M^-1 G' + R: row i of G, (12,), turns the
velocities v, w of the two bodies of its point into the rate of that row, row i of W is what a unit
force there does to them, M^-1 G_i', and R is a small compliance (coulomb.COMPLIANCE). A has
(w m)^2 numbers, G and W 24 w m: a sweep over 250 points takes 50 us, and a step of Newton's method
a system with 6 equations for each body that is touched, not with w for each point. Where joints
hold bodies a point moves others than its two as well, see articulated_rows.py; of few points on
many bodies the matrix is smaller than the rows, and `write_matrix` makes it.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.contacts import Bodies, Contacts, length, read_coefficients
from rigid_sim_ros.engine.contact.coulomb import coefficients, disk, off_disk, onto_disk
from rigid_sim_ros.engine.contact.scalar_rows import make_scalar_rows, resolve, ScalarRows
from rigid_sim_ros.engine.maths.algebra import cross, row
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

SIDES = 12  # numbers in a row of G: v and w of A, v and w of B


class Rows(NamedTuple):
    """Room for c points, r rows and n bodies."""

    body: IntArray  # (c, 2) A and B of a point
    first: IntArray  # (c + 1,) of the bodies that a point moves, in `moved`
    moved: IntArray  # (p,) A, B, and others that joints hold to them and that are touched
    G: Array  # (r, 12)
    at: IntArray  # (r,) where W of a row begins
    W: Array  # six numbers of a row for each body that its point moves
    stiff: Array  # (r,) [1/kg] diagonal of A, with the compliance
    compliance: Array  # (r,) [1/kg] by which points yield, alone
    mu: Array  # (c, 3)
    b: Array  # (r,) what a is without forces
    a: Array  # (r,) rates
    z: Array  # (n, 6) M^-1 G' f, where there is no matrix
    in_matrix: IntArray  # (1,) how many rows the matrix has, 0: there is none
    A: Array  # (r r,) the matrix G M^-1 G', symmetric but for rounding
    f: Array  # (r,) the forces
    trial: Array  # (r,) scratch
    factored: IntArray  # (1,) 1: Newton's matrix is factored for these rows, and the last E
    scalar: ScalarRows  # rows beside those of the points, behind them; only with a matrix


def make_rows(points: int, rows: int, bodies: int, moved: int = 2, scalars: int = 0,
              matrix: int = 0) -> Rows:
    """
    Return room for so many points, rows of theirs, bodies, and bodies that a point moves.

    And for rows of one number beside them, and rows in a matrix.
    """
    r = rows + scalars
    return Rows(np.zeros((points, 2), dtype=np.int64), np.zeros(points + 1, dtype=np.int64),
                np.zeros(moved * points, dtype=np.int64), np.zeros((rows, SIDES)),
                np.zeros(rows, dtype=np.int64), np.zeros(6 * moved * rows), np.zeros(r),
                np.zeros(r), np.zeros((points, 3)), np.zeros(r), np.zeros(r),
                np.zeros((bodies, 6)), np.zeros(1, dtype=np.int64), np.zeros(matrix * matrix),
                np.zeros(r), np.zeros(r), np.zeros(1, dtype=np.int64), make_scalar_rows(scalars))


@kernel
def all_rows(rows: Rows, m: int, width: int) -> int:
    """Return how many rows m points have, and what stands behind them."""
    return width * m + rows.scalar.present[0]


@kernel
def write_rows(model: Model, contacts: Contacts, bodies: Bodies, chosen: IntArray, width: int,
               compliance: float, rows: Rows) -> None:
    """Write G, W and the coefficients of the chosen points, as if there were no joints."""
    rows.first[0], rows.in_matrix[0], rows.scalar.present[0] = 0, 0, 0
    rows.factored[0] = 0
    for c in range(chosen.shape[0]):
        k = chosen[c]
        rows.body[c, 0], rows.body[c, 1] = contacts.body_a[k], contacts.body_b[k]
        rows.moved[2 * c], rows.moved[2 * c + 1] = rows.body[c, 0], rows.body[c, 1]
        rows.first[c + 1] = 2 * c + 2
        read_coefficients(model, contacts, k, width, rows.mu, c)
        arm = length(model, contacts, k) if width == 6 else 0.0
        for p in range(width):
            i, axis = width * c + p, p % 3
            e = (contacts.axes[k, axis, 0], contacts.axes[k, axis, 1], contacts.axes[k, axis, 2])
            on_A, on_B = cross(row(contacts.r_A, k), e), cross(row(contacts.r_B, k), e)
            for j in range(3):
                linear = e[j] if p < 3 else 0.0
                rows.G[i, j], rows.G[i, 6 + j] = -linear, linear
                rows.G[i, 3 + j] = -on_A[j] if p < 3 else -arm * e[j]
                rows.G[i, 9 + j] = on_B[j] if p < 3 else arm * e[j]
            total, rows.at[i] = 0.0, SIDES * i
            for side in range(2):
                body, at = rows.body[c, side], 6 * side
                for j in range(3):
                    turned = 0.0
                    for q in range(3):
                        turned += bodies.inv_I_W[body, j, q] * rows.G[i, at + 3 + q]
                    moved = model.inv_m[body] * rows.G[i, at + j]
                    rows.W[SIDES * i + at + j] = moved
                    rows.W[SIDES * i + at + 3 + j] = turned
                    total += moved * rows.G[i, at + j] + turned * rows.G[i, at + 3 + j]
            rows.compliance[i] = compliance * total
            rows.stiff[i] = total + rows.compliance[i]


@kernel
def write_matrix(rows: Rows, m: int, width: int, inv_m: Array) -> None:
    """
    Write A of the rows of m points, by which the effects of forces are found from now on.

    The entries of rows behind them are given.
    """
    size = all_rows(rows, m, width)
    for d in range(m):
        for c in range(d, m):
            on_A = _place_of(rows, d, rows.body[c, 0], inv_m)
            on_B = _place_of(rows, d, rows.body[c, 1], inv_m)
            for j in range(width * d, width * d + width):
                for i in range(width * c, width * c + width):
                    total, at = 0.0, rows.at[j] + on_A
                    for k in range(6 if on_A >= 0 else 0):
                        total += rows.G[i, k] * rows.W[at + k]
                    at = rows.at[j] + on_B
                    for k in range(6 if on_B >= 0 else 0):
                        total += rows.G[i, 6 + k] * rows.W[at + k]
                    # A is symmetric.
                    rows.A[size * j + i] = rows.A[size * i + j] = total
    rows.in_matrix[0] = size


@kernel
def _place_of(rows: Rows, d: int, body: int, inv_m: Array) -> int:
    """Return where a body stands in W of a row of point d; -1: the point does not move it."""
    if inv_m[body] > 0.0:
        for e in range(rows.first[d], rows.first[d + 1]):
            if rows.moved[e] == body:
                return 6 * (e - rows.first[d])
    return -1


@kernel
def read_matrix(rows: Rows, m: int, width: int, A: Array, mu: Array, softer: float) -> None:
    """
    Take A, (wm, wm) [1/kg], and the coefficients of m points, whose bodies need not be known.

    A_ii grows by its part `softer`. How much of it counts as compliance changes no solution; with
    half of it E of contact_newton.py stays of the size of 1 / A_ii.
    """
    size = width * m
    rows.in_matrix[0], rows.scalar.present[0], rows.factored[0] = size, 0, 0
    for i in range(size):
        for j in range(size):
            rows.A[size * i + j] = A[i, j]
        rows.stiff[i] = (1.0 + softer) * A[i, i]
        rows.compliance[i] = 0.5 * rows.stiff[i]
        rows.A[size * i + i] = rows.stiff[i] - rows.compliance[i]
    for c in range(m):
        for d in range(coefficients(width)):
            rows.mu[c, d] = mu[c, d]


@kernel
def write_rates(rows: Rows, m: int, width: int, f: Array) -> None:
    """Write the rates of all rows under the forces f, which have been applied."""
    size = rows.in_matrix[0]
    if size == 0:
        for c in range(m):
            for i in range(width * c, width * c + width):
                rows.a[i] = rate(rows, c, i, f)
        return
    a = rows.a[:size]
    for i in range(size):
        a[i] = rows.b[i] + rows.compliance[i] * f[i]
    for j in range(size):
        column, force = rows.A[size * j:size * j + size], f[j]
        for i in range(size):
            a[i] += column[i] * force


@kernel
def effect(rows: Rows, c: int, i: int, f: Array) -> float:
    """Return what the forces f do to the rate of row i, of point c; they have been applied."""
    size = rows.in_matrix[0]
    if size == 0:
        return _effect_of_bodies(rows, c, i)
    total, begin = 0.0, size * i
    for j in range(size):
        total += rows.A[begin + j] * f[j]
    return total


@kernel
def _effect_of_bodies(rows: Rows, c: int, i: int) -> float:
    """Return what the motions z do to the rate of row i, of point c."""
    A, B = rows.body[c, 0], rows.body[c, 1]
    total = 0.0
    for j in range(6):
        total += rows.G[i, j] * rows.z[A, j] + rows.G[i, 6 + j] * rows.z[B, j]
    return total


@kernel
def rate(rows: Rows, c: int, i: int, f: Array) -> float:
    """Return the rate of row i, of point c, under the forces f, which have been applied."""
    return rows.b[i] + rows.compliance[i] * f[i] + effect(rows, c, i, f)


@kernel
def add_force(rows: Rows, c: int, i: int, change: float) -> None:
    """Bring z to a change of the force of row i, of point c."""
    if rows.in_matrix[0] > 0:
        return
    at = rows.at[i]
    for e in range(rows.first[c], rows.first[c + 1]):
        body = rows.moved[e]
        for j in range(6):
            rows.z[body, j] += rows.W[at + j] * change
        at += 6


@kernel
def write_effects(rows: Rows, m: int, width: int, f: Array) -> None:
    """Write z of the forces f at the first m points."""
    if rows.in_matrix[0] > 0:
        return
    forget_effects(rows, 0, m)
    for c in range(m):
        for i in range(width * c, width * c + width):
            if f[i] != 0.0:
                add_force(rows, c, i, f[i])


@kernel
def forget_effects(rows: Rows, first: int, last: int) -> None:
    """Write z of no forces for what the points from `first` to `last` move."""
    for e in range(rows.first[first], rows.first[last]):
        for j in range(6):
            rows.z[rows.moved[e], j] = 0.0


@kernel
def coupling(rows: Rows, i: int, j: int) -> float:
    """Return A_ij [1/kg] of two different rows of one point."""
    if rows.in_matrix[0] > 0:
        return rows.A[rows.in_matrix[0] * i + j]
    total = 0.0
    for k in range(SIDES):
        total += rows.G[i, k] * rows.W[rows.at[j] + k]
    return total


@kernel
def disk_stiffness(rows: Rows, x: int, size: int) -> float:
    """Return the larger diagonal entry of the rows of a disk [1/kg]."""
    return max(rows.stiff[x], rows.stiff[x + size - 1])


@kernel
def violation(rows: Rows, m: int, width: int, f: Array) -> float:
    """Write z and the rates of the forces f, and return by how much they violate the laws."""
    write_effects(rows, m, width, f)
    write_rates(rows, m, width, f)
    worst = 0.0
    for c in range(m):
        n = width * c
        pressed = max(0.0, f[n] - rows.a[n] / rows.stiff[n])
        worst = max(worst, abs(f[n] - pressed) * rows.stiff[n])
        for d in range(coefficients(width)):
            first, size = disk(d)
            x, y = n + first, n + first + size - 1
            stiff = disk_stiffness(rows, x, size)
            w_x = f[x] - rows.a[x] / stiff
            w_y = f[y] - rows.a[y] / stiff if size == 2 else 0.0
            limit = rows.mu[c, d] * max(0.0, f[n])
            worst = max(worst, off_disk(f[x], f[y], w_x, w_y, limit, size) * stiff)
    for q in range(rows.scalar.present[0]):
        i = width * m + q
        wanted, _, _ = resolve(rows.scalar, q, rows.a[i] - rows.stiff[i] * f[i], rows.stiff[i])
        worst = max(worst, abs(f[i] - wanted) * rows.stiff[i])
    return worst


@kernel
def sweep_rows(rows: Rows, m: int, width: int, f: Array, count: int, goal: float) -> None:
    """
    Bring f nearer to a solution, in place, by at most `count` sweeps of projected Gauss-Seidel.

    z has to be that of f, as `violation` leaves it. It ends when no row moves by more than `goal`.
    """
    for _ in range(count):
        moved = 0.0
        for c in range(m):
            n = width * c
            before = f[n]
            f[n] = max(0.0, before - rate(rows, c, n, f) / rows.stiff[n])
            if f[n] != before:
                add_force(rows, c, n, f[n] - before)
                moved = max(moved, abs(f[n] - before) * rows.stiff[n])
            for d in range(coefficients(width)):
                first, size = disk(d)
                moved = max(moved, _sweep_disk(rows, c, rows.mu[c, d] * f[n], f, n + first, size))
        for q in range(rows.scalar.present[0]):
            i, before = width * m + q, f[width * m + q]
            f[i], _, _ = resolve(
                rows.scalar, q, rate(rows, m, i, f) - rows.stiff[i] * before, rows.stiff[i])
            moved = max(moved, abs(f[i] - before) * rows.stiff[i])
        if moved <= goal:
            return


@kernel
def _sweep_disk(rows: Rows, c: int, limit: float, f: Array, p: int, size: int) -> float:
    """Project the forces of one disk after a step against its rates; return how far it moved."""
    q = p + size - 1
    x, y = f[p], f[q]
    if limit == 0.0 and x == 0.0 and y == 0.0:
        return 0.0
    # The largest eigenvalue of the 2 x 2 block bounds the step, so that the projection converges.
    stiff = disk_stiffness(rows, p, size) + (abs(coupling(rows, p, q)) if size == 2 else 0.0)
    w_x = x - rate(rows, c, p, f) / stiff
    w_y = y - rate(rows, c, q, f) / stiff if size == 2 else 0.0
    w_x, w_y = onto_disk(w_x, w_y, limit)
    f[p] = w_x
    add_force(rows, c, p, w_x - x)
    if size == 2:
        f[q] = w_y
        add_force(rows, c, q, w_y - y)
    return max(abs(w_x - x), abs(w_y - y) if size == 2 else 0.0) * stiff
