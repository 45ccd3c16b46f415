# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speculative margins: how far from the surfaces of shapes detection finds contacts."""

from rigid_sim_ros.engine.detection.manifolds import Memory
from rigid_sim_ros.engine.maths.vector import column, norm
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import INDEX, kernel


@kernel
def set_margins(h: float, inv_m: Array, inv_I_C: Array, P: Array, L: Array, V: Array,
                part_of: float, radius: Array, thickness: Array, body: IntArray, memory: Memory,
                first: int, last: int) -> None:
    """
    Write the margins of some shapes [m]: what they have at rest, and as far as they move.

    So nothing passes what is thinner than its way in a step, or is met late. The margin at rest is
    `part_of` the thickness (s,) [m], half of the least that a shape measures across.
    """
    for s in range(first, last):
        i = body[s] & INDEX
        v = inv_m[i] * norm(column(P, i)) + norm((V[0, i], V[1, i], V[2, i]))
        # Not below |w|, which would need the attitude.
        w = max(inv_I_C[0, i], inv_I_C[1, i], inv_I_C[2, i]) * norm(column(L, i))
        w += norm((V[3, i], V[4, i], V[5, i]))
        way = (v + w * radius[i]) * h
        memory.rest_margin[s] = part_of * thickness[s] if inv_m[i] > 0.0 else 0.0
        memory.margin[s] = memory.rest_margin[s] + way
