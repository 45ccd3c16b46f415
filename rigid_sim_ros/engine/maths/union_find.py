# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sets of bodies that hang together (Tarjan, J. ACM 22 (1975)); each member leads to the first."""

from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def first_of(parent: IntArray, i: int) -> int:
    """Return the first member of the set of i, and shorten the way there."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def unite(parent: IntArray, a: int, b: int) -> None:
    """Make one set of those of a and b."""
    a, b = first_of(parent, a), first_of(parent, b)
    parent[max(a, b)] = min(a, b)
