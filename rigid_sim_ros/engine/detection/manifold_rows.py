# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rows of the manifolds: written, kept from the step before, found again, left out."""

import numpy as np

from rigid_sim_ros.engine.detection.manifolds import Manifolds, rows_in_use
from rigid_sim_ros.engine.maths.rotation import conjugate, multiply, quaternion
from rigid_sim_ros.engine.maths.vector import add, cross, dot, scale
from rigid_sim_ros.engine.model.kinds.table import is_flat, is_unbounded
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray, Quaternion, Vector
from rigid_sim_ros.kernels.kernel import INDEX, inlined, kernel, part

# A manifold keeps its points while these move by less than this part of the margin, or of the
# thickness where that is less. 0: never; 0.2:
# a box would slide on by 1 mm of 5 mm before its points follow. The gaps of kept points are exact
# to second order.
SLACK = 0.02


@inlined
def are_flat(kind: IntArray, a: int, b: int) -> bool:
    """
    Return whether both are polyhedra, whose points stay the same while they move.

    Of a plane the points are found as fast as they are kept, and its normal is exact.
    """
    return is_flat(kind[a]) and is_flat(kind[b]) and not (
        is_unbounded(kind[a]) or is_unbounded(kind[b]))


@kernel
def _turned(R: Array, i: int, v: Vector) -> Vector:
    return (R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2],
            R[i, 3] * v[0] + R[i, 4] * v[1] + R[i, 5] * v[2],
            R[i, 6] * v[0] + R[i, 7] * v[1] + R[i, 8] * v[2])


@kernel
def _turned_back(R: Array, i: int, v: Vector) -> Vector:
    return (R[i, 0] * v[0] + R[i, 3] * v[1] + R[i, 6] * v[2],
            R[i, 1] * v[0] + R[i, 4] * v[1] + R[i, 7] * v[2],
            R[i, 2] * v[0] + R[i, 5] * v[1] + R[i, 8] * v[2])


@kernel
def _half_turned(q_AB: Quaternion, before: Manifolds, old: int) -> Vector:
    """
    Return the normal of a manifold in axes of A, turned with B half as far as B has turned in A.

    The vector of the quaternion of a small rotation is half of it; a step of Newton's method for
    1 / sqrt(n . n) from 1 gives a unit vector to the fourth order of the angle.
    """
    n = (before.normal_A[old, 0], before.normal_A[old, 1], before.normal_A[old, 2])
    since = multiply(q_AB, conjugate((before.found_at[old, 0], before.found_at[old, 1],
                                      before.found_at[old, 2], before.found_at[old, 3])))
    n = add(n, cross((since[0], since[1], since[2]), n))
    return scale(1.5 - 0.5 * dot(n, n), n)


@part
def recycle(state: State, turn: Array, now: Manifolds, before: Manifolds, row: int, old: int,
            i: int, j: int, margin: float, reach: float, thickness: float) -> bool:
    """
    Take over the points of a manifold unless they moved too far; find their gaps anew.

    The points on A turn with A, those on B with B, and the normal half with either: with one of
    them it would matter which of two bodies is A. The gap along the turned normal differs from the
    true one by the square of the angle and of the slip since the points were found. The margin may
    have been larger then: what is farther away now is no manifold, or results would depend on how
    long a pair stays in the list. What is fast has a large margin, but points that moved by the
    `thickness` [m] of the thinner shape are those of another place.
    """
    slack, near = SLACK * min(margin, thickness), False
    q = multiply(conjugate(quaternion(state.q, i)), quaternion(state.q, j))
    turned = 0.0
    for k in range(4):
        turned += (q[k] - before.found_at[old, k]) ** 2
    # |q - q'| is half of the angle between two near orientations.
    if 4.0 * turned * reach * reach > slack * slack:
        return False
    n = _turned(turn, i, _half_turned(q, before, old))
    dx = state.x[0, j] - state.x[0, i]
    dy = state.x[1, j] - state.x[1, i]
    dz = state.x[2, j] - state.x[2, i]
    for p in range(before.points[old]):
        A = _turned(turn, i,
                    (before.p_A_C[old, p, 0], before.p_A_C[old, p, 1], before.p_A_C[old, p, 2]))
        B = _turned(turn, j,
                    (before.p_B_C[old, p, 0], before.p_B_C[old, p, 1], before.p_B_C[old, p, 2]))
        ex, ey, ez = dx + B[0] - A[0], dy + B[1] - A[1], dz + B[2] - A[2]
        gap = ex * n[0] + ey * n[1] + ez * n[2]
        slip = (ex - gap * n[0]) ** 2 + (ey - gap * n[1]) ** 2 + (ez - gap * n[2]) ** 2
        if slip > slack * slack or (p == 0 and abs(gap - before.found_at[old, 4]) > slack):
            return False
        near = near or gap < margin
        now.gap[p, row] = gap
        now.feature[p, row] = before.feature[p, old]
        for k in range(3):
            now.r_A[p, row, k] = A[k]
            now.r_B[p, row, k] = B[k]
            now.p_A_C[row, p, k] = before.p_A_C[old, p, k]
            now.p_B_C[row, p, k] = before.p_B_C[old, p, k]
    if not near:
        return False
    for k in range(3):
        now.normal[row, k] = n[k]
        now.normal_A[row, k] = before.normal_A[old, k]
    for k in range(5):
        now.found_at[row, k] = before.found_at[old, k]
    return True


@part
def write_row(state: State, turn: Array, now: Manifolds, row: int, i: int, j: int, count: int,
              n: Vector, points: Array, ids: IntArray, lasts: bool) -> None:
    """
    Write the points that the narrow phase found, as arms from both centres of mass.

    A manifold that `lasts` may keep its points in the next steps, and has them in axes that turn
    with the bodies too; one that does not has the orientation 0, and leaves no trace in memory
    that only the others use.
    """
    if lasts:
        q = multiply(conjugate(quaternion(state.q, i)), quaternion(state.q, j))
        n_A = _turned_back(turn, i, n)
        for k in range(3):
            now.normal_A[row, k] = n_A[k]
        for k in range(4):
            now.found_at[row, k] = q[k]
        now.found_at[row, 4] = points[0, 3]
    else:
        for k in range(5):
            if now.found_at[row, k] != 0.0:
                now.found_at[row, k] = 0.0
    for p in range(count):
        gap = points[p, 3]
        A = (points[p, 0] - state.x[0, i], points[p, 1] - state.x[1, i],
             points[p, 2] - state.x[2, i])
        B = (points[p, 0] + gap * n[0] - state.x[0, j], points[p, 1] + gap * n[1] - state.x[1, j],
             points[p, 2] + gap * n[2] - state.x[2, j])
        now.gap[p, row] = gap
        # That of a ball is 0.
        if now.feature[p, row] != ids[p]:
            now.feature[p, row] = ids[p]
        for k in range(3):
            now.r_A[p, row, k] = A[k]
            now.r_B[p, row, k] = B[k]
        if lasts:
            A_C, B_C = _turned_back(turn, i, A), _turned_back(turn, j, B)
            for k in range(3):
                now.p_A_C[row, p, k] = A_C[k]
                now.p_B_C[row, p, k] = B_C[k]
    for k in range(3):
        now.normal[row, k] = n[k]


@kernel
def mark_mended(manifolds: Manifolds, row: int) -> None:
    """Mark a manifold that is what it is for what lies beside: its pair alone says another."""
    for k in range(4):
        manifolds.found_at[row, k] = 0.0
    manifolds.found_at[row, 4] = -1.0


@kernel
def is_mended(manifolds: Manifolds, row: int) -> bool:
    """Return whether a manifold was marked; one without an orientation has no other mark."""
    return bool(manifolds.found_at[row, 4] == -1.0 and manifolds.found_at[row, 0] == 0.0
                and manifolds.found_at[row, 3] == 0.0)


@kernel
def find_row(manifolds: Manifolds, a: int, b: int) -> int:
    """Return the row of shapes a and b, -1 if there is none."""
    first, count = rows_in_use(manifolds)
    low, high = first, first + count
    while low < high:
        middle = (low + high) // 2 & INDEX
        before = (manifolds.shape_a[middle] < a
                  or (manifolds.shape_a[middle] == a and manifolds.shape_b[middle] < b))
        low, high = (middle + 1, high) if before else (low, middle)
    there = low < first + count and manifolds.shape_a[low] == a and manifolds.shape_b[low] == b
    return low if there else -1


@kernel
def take_point(manifolds: Manifolds, row: int, source: int, target: int) -> None:
    """Let a point of a row take the place of another one."""
    manifolds.gap[target, row] = manifolds.gap[source, row]
    manifolds.feature[target, row] = manifolds.feature[source, row]
    manifolds.impulse[target, row] = manifolds.impulse[source, row]
    for k in range(3):
        manifolds.r_A[target, row, k] = manifolds.r_A[source, row, k]
        manifolds.r_B[target, row, k] = manifolds.r_B[source, row, k]


@kernel
def pack_rows(manifolds: Manifolds) -> None:
    """Leave out the rows without points, and close the ranks."""
    first, count = rows_in_use(manifolds)
    kept = first
    for row in range(first, first + count):
        if manifolds.points[row] > 0:
            if kept < row:
                copy_row(manifolds, row & INDEX, kept & INDEX)
            kept += 1
    manifolds.count[0] = kept - first


@kernel
def copy_row(manifolds: Manifolds, source: int, target: int) -> None:
    """Write to a row what is in another."""
    for names in (manifolds.shape_a, manifolds.shape_b, manifolds.body_a, manifolds.body_b):
        names[target] = names[source]
    manifolds.points[target] = manifolds.points[source]
    manifolds.spin[target] = manifolds.spin[source]
    for k in range(3):
        manifolds.roll[target, k] = manifolds.roll[source, k]
    for k in range(3):
        manifolds.normal[target, k] = manifolds.normal[source, k]
        manifolds.friction[target, k] = manifolds.friction[source, k]
        manifolds.normal_A[target, k] = manifolds.normal_A[source, k]
    for k in range(5):
        manifolds.found_at[target, k] = manifolds.found_at[source, k]
    for p in range(manifolds.points[source]):
        manifolds.gap[p, target] = manifolds.gap[p, source]
        manifolds.feature[p, target] = manifolds.feature[p, source]
        manifolds.impulse[p, target] = manifolds.impulse[p, source]
        for k in range(3):
            manifolds.r_A[p, target, k] = manifolds.r_A[p, source, k]
            manifolds.r_B[p, target, k] = manifolds.r_B[p, source, k]
            manifolds.p_A_C[target, p, k] = manifolds.p_A_C[source, p, k]
            manifolds.p_B_C[target, p, k] = manifolds.p_B_C[source, p, k]


@kernel
def find_anew(manifolds: Manifolds) -> None:
    """
    Let detection find the points of all polyhedra anew.

    Those that hardly moved would keep points that are right to second order, and results would
    depend on when these were found.
    """
    for r in range(manifolds.count[0]):
        manifolds.found_at[r, 0] = np.inf
