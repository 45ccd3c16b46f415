# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Linear systems of few bodies."""

from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def factor_linear(K: Array, last: IntArray, order: IntArray) -> bool:
    """
    Replace K by its factors, for `solve_factored`; return False if K is singular.

    By Gaussian elimination with partial pivoting. last and order, (n,): the last entry of a row
    that is not 0, and which row came to each place. Bodies of which only neighbours touch make a
    band.
    """
    size = last.shape[0]
    _find_last(K, last, size)
    for i in range(size):
        order[i] = i
    p = _pivot(K, 0, size)
    for k in range(size):
        if K[p, k] == 0.0:
            return False
        order[k], order[p] = order[p], order[k]
        p = _eliminate(K, k, p, last, size)
    return True


@kernel
def _eliminate(K: Array, k: int, p: int, last: IntArray, size: int) -> int:
    """
    Take column k out of the rows below that of its pivot, which comes from place p to k.

    The factors stay in that column. Returns the row of the next pivot, which is known when the
    rows are: columns are not contiguous, and going through one more takes long.
    """
    if p != k:
        for j in range(max(last[k], last[p]) + 1):
            K[k, j], K[p, j] = K[p, j], K[k, j]
        last[k], last[p] = last[p], last[k]
    end, pivot, largest, best = last[k] + 1, K[k, k], -1.0, k + 1
    for i in range(k + 1, size):
        line = K[i]
        if line[k] != 0.0:
            factor = line[k] / pivot
            line[k] = factor
            last[i] = max(last[i], last[k])
            source, target = K[k][k + 1:end], line[k + 1:end]
            for j in range(target.shape[0]):
                target[j] -= factor * source[j]
        if k + 1 < size and abs(line[k + 1]) > largest:
            best, largest = i, abs(line[k + 1])
    return best


@kernel
def solve_factored(K: Array, b: Array, x: Array, last: IntArray, order: IntArray) -> None:
    """Write to x the solution for the right side b, by the factors of `factor_linear`."""
    for i in range(x.shape[0]):
        total = b[order[i]]
        for j in range(i):
            if K[i, j] != 0.0:
                total -= K[i, j] * x[j]
        x[i] = total
    _substitute_back(K, x, last)


@kernel
def _find_last(K: Array, last: IntArray, size: int) -> None:
    """Write the last entry that is not 0 of each of `size` rows, 0 where there is none."""
    for i in range(size):
        last[i] = size - 1
        while last[i] > 0 and K[i, last[i]] == 0.0:
            last[i] -= 1


@kernel
def _pivot(K: Array, k: int, size: int) -> int:
    """Return the row from k on whose entry in column k is the largest."""
    p = k
    for i in range(k + 1, size):
        if abs(K[i, k]) > abs(K[p, k]):
            p = i
    return p


@kernel
def solve_columns(K: Array, size: int, columns: int) -> bool:
    """
    Replace D by C^-1 D, where K is [C D]; return False if C is singular.

    C has `size` rows and columns, K so many `columns` in all; C is destroyed. By Gauss-Jordan
    elimination with partial pivoting: for many right-hand sides of a small matrix.
    """
    for k in range(size):
        p = _pivot(K, k, size)
        if K[p, k] == 0.0:
            return False
        for j in range(k, columns):
            K[k, j], K[p, j] = K[p, j], K[k, j]
        for i in range(size):
            if i != k and K[i, k] != 0.0:
                factor = K[i, k] / K[k, k]
                for j in range(k, columns):
                    K[i, j] -= factor * K[k, j]
    for k in range(size):
        for j in range(size, columns):
            K[k, j] /= K[k, k]
    return True


@kernel
def solve_symmetric(K: Array, x: Array, last: IntArray) -> bool:
    """
    Replace x (n,) by K^-1 x, destroying K; return False if K (n, n) is not positive definite.

    Of K, which is symmetric, what stands on and above the diagonal is read. By elimination without
    pivoting, which is stable then (Golub, Van Loan, Matrix Computations, section 4.2). last (n,)
    is scratch: the last entry of a row that is not 0.
    """
    size = x.shape[0]
    for i in range(size):
        last[i] = size - 1
        while last[i] > i and K[i, last[i]] == 0.0:
            last[i] -= 1
    for k in range(size):
        pivot, end = K[k, k], last[k] + 1
        if not pivot > 0.0:
            return False
        for i in range(k + 1, end):
            factor = K[k, i] / pivot
            if factor != 0.0:
                source, target = K[k][i:end], K[i][i:end]
                for j in range(target.shape[0]):
                    target[j] -= factor * source[j]
                x[i] -= factor * x[k]
                last[i] = max(last[i], last[k])
    _substitute_back(K, x, last)
    return True


@kernel
def _substitute_back(K: Array, x: Array, last: IntArray) -> None:
    """Solve for x by what elimination left on and above the diagonal of K."""
    for k in range(x.shape[0] - 1, -1, -1):
        total = x[k]
        for j in range(k + 1, last[k] + 1):
            total -= K[k, j] * x[j]
        x[k] = total / K[k, k]
