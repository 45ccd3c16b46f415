# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How far goes within a step what is hit in it: margins of what may be thrown.

A body at rest has a small margin, by which nothing is known of what lies a little farther. Once
another has hit it, it may reach that in the same step. So what may be met gets the margin of what
it may be thrown to, and pairs are sought anew; in a row of bodies one after the other.
"""

import math

from rigid_sim_ros.engine.detection.manifolds import current, Memory, rows_in_use, smallest_gap
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import INDEX, kernel

# So often pairs are sought anew in a step at most.
SEARCHES = 32
# What is thrown less far, as a part of half of the least that it measures across, is left to the
# next step: so deep an overlap may become.
WORTH = 0.05
# Ways of what is thrown that differ by less, in the same part: rounding ends there.
ALIKE = 1e-4


@kernel
def widen_margins(inv_m: Array, thickness: Array, shapes: Shapes, materials: Materials,
                  memory: Memory, thrown: IntArray) -> bool:
    """
    Widen the margins of what may be hit in this step; return whether any was.

    What was at rest leaves a head-on collision with a body of velocity v with

        (1 + e) v / (1 + m_B / m_A),

    and as far its points may go, for what they are near to now. Widening goes on until nothing
    changes among the pairs that are known, so that their order decides nothing. inv_m (n,) [1/kg],
    thickness (s,) [m] half of the least that shapes measure across; thrown (s,) becomes 1 for
    what was widened in this step.
    """
    rows = current(memory)
    first, count = rows_in_use(rows)
    widened, again = False, _is_any_fast(inv_m, thickness, shapes, memory)
    while again:
        again = False
        for k in range(count):
            r = (first + k) & INDEX
            a, b = rows.shape_a[r] & INDEX, rows.shape_b[r] & INDEX
            if smallest_gap(rows, r) <= _way(memory, a) + _way(memory, b):
                again |= _widen(inv_m, thickness, shapes, materials, memory, thrown, a, b)
                again |= _widen(inv_m, thickness, shapes, materials, memory, thrown, b, a)
        widened |= again
    return widened


@kernel
def _is_any_fast(inv_m: Array, thickness: Array, shapes: Shapes, memory: Memory) -> bool:
    """Return whether anything may be thrown as far as it is worth."""
    fastest, thinnest = 0.0, math.inf
    for s in range(thickness.shape[0]):
        fastest = max(fastest, _way(memory, s))
        if inv_m[shapes.body[s]] > 0.0:
            thinnest = min(thinnest, thickness[s])
    # What is hit by something heavy with e = 1 is twice as fast.
    return 2.0 * fastest > WORTH * thinnest


@kernel
def _way(memory: Memory, s: int) -> float:
    """Return how far a shape may go in this step, as is known by now [m]."""
    return memory.margin[s] - memory.rest_margin[s]


@kernel
def _widen(inv_m: Array, thickness: Array, shapes: Shapes, materials: Materials, memory: Memory,
           thrown: IntArray, a: int, b: int) -> bool:
    """Widen the margins of the body of shape b as shape a may throw it; return whether it did."""
    of_A, of_B = inv_m[shapes.body[a]], inv_m[shapes.body[b]]
    if of_B == 0.0:
        return False
    e = materials.restitution[shapes.material[a], shapes.material[b]]
    way = _way(memory, a) * (1.0 + e) * of_B / (of_A + of_B)
    least = ALIKE if thrown[b] == 1 else WORTH
    if way <= _way(memory, b) + least * thickness[b]:
        return False
    s = b
    while s > 0 and shapes.body[s - 1] == shapes.body[b]:
        s -= 1
    for k in range(s, shapes.after[s]):
        memory.margin[k], thrown[k] = memory.rest_margin[k] + way, 1
    return True
