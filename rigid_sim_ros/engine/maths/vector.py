# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Vectors of three numbers inside a kernel."""

import math

from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import inlined


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inlined
def dot(a: Vector, b: Vector) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@inlined
def subtract(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inlined
def scale(s: float, a: Vector) -> Vector:
    """Return s a."""
    return (s * a[0], s * a[1], s * a[2])


@inlined
def add_scaled(a: Vector, s: float, b: Vector) -> Vector:
    """Return a + s b."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@inlined
def times(a: Vector, b: Vector) -> Vector:
    """Return the products of the components, diag(a) b."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


@inlined
def symmetric_times(first: Vector, second: Vector, v: Vector) -> Vector:
    """Return the product of a symmetric matrix (xx, xy, xz), (yy, yz, zz) with v."""
    xx, xy, xz = first
    yy, yz, zz = second
    return (xx * v[0] + xy * v[1] + xz * v[2], xy * v[0] + yy * v[1] + yz * v[2],
            xz * v[0] + yz * v[1] + zz * v[2])


@inlined
def symmetric_cofactors(first: Vector, second: Vector) -> tuple[Vector, Vector]:
    """
    Return the cofactors of a symmetric matrix (xx, xy, xz), (yy, yz, zz), which are as symmetric.

    The first three times (xx, xy, xz) are the determinant, and over that all are the inverse.
    """
    xx, xy, xz = first
    yy, yz, zz = second
    return ((yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy),
            (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy))


@inlined
def norm(a: Vector) -> float:
    """Return |a|."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@inlined
def column(a: Array, i: int) -> Vector:
    """Return column i of an array of shape (3, n)."""
    return (a[0, i], a[1, i], a[2, i])


@inlined
def row(a: Array, i: int) -> Vector:
    """Return row i of an array of shape (n, 3)."""
    return (a[i, 0], a[i, 1], a[i, 2])


@inlined
def add_to_column(a: Array, i: int, b: Vector) -> None:
    """Add b to column i of an array of shape (3, n)."""
    a[0, i] += b[0]
    a[1, i] += b[1]
    a[2, i] += b[2]


@inlined
def set_column(a: Array, i: int, b: Vector) -> None:
    """Write b to column i of an array of shape (3, n)."""
    a[0, i] = b[0]
    a[1, i] = b[1]
    a[2, i] = b[2]
