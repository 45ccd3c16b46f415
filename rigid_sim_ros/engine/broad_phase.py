# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which pairs of shapes may touch: those whose bounding boxes overlap."""

from rigid_sim_ros.engine.arrays import Array
from rigid_sim_ros.engine.kernel import kernel
from rigid_sim_ros.engine.manifolds import Memory, SHORT_PAIRS
from rigid_sim_ros.engine.shapes import PLANE, Shapes


@kernel
def may_collide(shapes: Shapes, bodies: int, a: int, b: int) -> bool:
    """Apply the filters: not both still, not one body, groups against masks, pairs to ignore."""
    i, j = shapes.body[a], shapes.body[b]
    if i == j or shapes.still[a] + shapes.still[b] == 2:
        return False
    if shapes.mask[a] & shapes.group[b] == 0 or shapes.mask[b] & shapes.group[a] == 0:
        return False
    key = min(i, j) * bodies + max(i, j)
    low, high = 0, shapes.ignored.shape[0]
    while low < high:
        middle = (low + high) // 2
        if shapes.ignored[middle] < key:
            low = middle + 1
        else:
            high = middle
    return not (low < shapes.ignored.shape[0] and shapes.ignored[low] == key)


@kernel
def boxes_overlap(box: Array, a: int, b: int) -> bool:
    """Return whether two boxes have a point in common."""
    return (box[a, 0] <= box[b, 3] and box[b, 0] <= box[a, 3] and box[a, 1] <= box[b, 4]
            and box[b, 1] <= box[a, 4] and box[a, 2] <= box[b, 5] and box[b, 2] <= box[a, 5])


@kernel
def find_pairs(shapes: Shapes, memory: Memory, bodies: int) -> bool:
    """List the pairs in order; return whether there was room for them."""
    count, room = 0, memory.pair.shape[0]
    for a in range(shapes.kind.shape[0]):
        for b in range(a + 1, shapes.kind.shape[0]):
            if boxes_overlap(memory.box, a, b) and may_collide(shapes, bodies, a, b):
                if count < room:
                    memory.pair[count, 0] = a
                    memory.pair[count, 1] = b
                count += 1
    memory.pair_count[0] = count
    if count > room:
        memory.counters[SHORT_PAIRS] = count
        return False
    return True
