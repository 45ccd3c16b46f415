# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cholesky's factor of a matrix that is only semidefinite, with pivots and a rank cut-off."""

import math

from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Of the largest diagonal entry, which is 1 after scaling: what is left of a row that depends on
# others is rounding, some 1e-15. Rows that are nearer to dependent than this count as such.
CUT_OFF = 1e-11
# Of the terms of a diagonal entry: some 1e-15 of them is rounding, and what an axis that is STIFF
# (engine/joints/articulated.py) answers is 1e-9 of them and more.
ROUNDING = 1e-12


@kernel
def factor_semidefinite(S: Array, size: int, terms: Array, scale: Array, order: IntArray) -> int:
    """
    Replace the leading block of S, (size, size), by its factor; return its rank.

    The rows are scaled to a diagonal of 1, S = D P L L^T P^T D with L in the lower triangle.
    scale (n,) and order (n,) are D and P. Rows beyond the rank depend on the others (Higham,
    Analysis of the Cholesky decomposition of a semi-definite matrix, in Reliable Numerical
    Computation, 1990). Of rows that depend on each other the one with the largest pivot before
    the scaling comes first: what the others show of its error is no larger than it is. terms (n,)
    is how large what the diagonal is a sum of may be, which says what of it is rounding.
    """
    for i in range(size):
        order[i] = i
        scale[i] = math.sqrt(S[i, i]) if S[i, i] > 0.0 else 0.0
    for i in range(size):
        for j in range(size):
            product = scale[i] * scale[j]
            S[i, j] = S[i, j] / product if product > 0.0 else 0.0
    for k in range(size):
        p, largest = -1, 0.0
        for i in range(k, size):
            pivot = S[i, i] * scale[order[i]] ** 2
            if S[i, i] > CUT_OFF and pivot > max(largest, ROUNDING * terms[order[i]]):
                p, largest = i, pivot
        if p < 0:
            return k
        _swap(S, size, order, k, p)
        pivot = math.sqrt(S[k, k])
        S[k, k] = pivot
        for i in range(k + 1, size):
            S[i, k] /= pivot
        # What has nothing to do with k stays: of a chain of rows all but the next.
        for i in range(k + 1, size):
            if S[i, k] != 0.0:
                for j in range(k + 1, i + 1):
                    S[i, j] -= S[i, k] * S[j, k]
    return size


@kernel
def _swap(S: Array, size: int, order: IntArray, k: int, p: int) -> None:
    """Exchange rows and columns k and p > k, of which the lower triangle is in use."""
    if p == k:
        return
    order[k], order[p] = order[p], order[k]
    S[k, k], S[p, p] = S[p, p], S[k, k]
    for j in range(k):
        S[k, j], S[p, j] = S[p, j], S[k, j]
    for i in range(k + 1, p):
        S[i, k], S[p, i] = S[p, i], S[i, k]
    for i in range(p + 1, size):
        S[i, k], S[i, p] = S[i, p], S[i, k]


@kernel
def solve_semidefinite(S: Array, rank: int, size: int, scale: Array, order: IntArray, b: Array,
                       x: Array) -> None:
    """
    Write a solution of S x = b for a factor of `factor_semidefinite`; b becomes scratch.

    Rows that depend on others get 0, so b has to be in the range of S.
    """
    for k in range(rank):
        total = b[order[k]] / scale[order[k]]
        for j in range(k):
            total -= S[k, j] * x[order[j]]
        x[order[k]] = total / S[k, k]
    for back in range(rank):
        k = rank - 1 - back
        total = x[order[k]]
        for i in range(k + 1, rank):
            total -= S[i, k] * x[order[i]]
        x[order[k]] = total / S[k, k]
    for k in range(rank):
        x[order[k]] /= scale[order[k]]
    for k in range(rank, size):
        x[order[k]] = 0.0
