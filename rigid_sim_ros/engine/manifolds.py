# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What detection finds, and what it keeps from one step to the next.

A manifold is a pair of shapes that are near each other: one normal and up to four points. The
manifolds of this step and of the last take turns in two pages, so that impulses are carried over
by walking through both in order, without a search and without a copy.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray
from rigid_sim_ros.engine.hulls import MAX_CORNERS
from rigid_sim_ros.engine.kernel import kernel

POINTS = 4  # of a manifold, at most


class Manifolds(NamedTuple):
    """
    Pairs of shapes that are near each other, c rows of which the first `count` are in use.

    The rows are in the order of (shape_a, shape_b), and shape_a < shape_b. The normal points from
    A to B, gap < 0 is overlap: point_B = point_A + gap * normal.
    """

    count: IntArray  # type: ignore[assignment]  # (1,) number of rows in use
    shape_a: IntArray  # (c,)
    shape_b: IntArray  # (c,)
    body_a: IntArray  # (c,)
    body_b: IntArray  # (c,)
    points: IntArray  # (c,) number of points, 1 .. 4
    normal: Array  # (c, 3) unit vector from A to B, world axes
    normal_A: Array  # (c, 3) the same in axes of C of body A; as p_A_C, p_B_C: of polyhedra only
    r_A: Array  # (c, 4, 3) [m] contact points on A from the centre of mass of A, world axes
    r_B: Array  # (c, 4, 3) [m] contact points on B from the centre of mass of B, world axes
    p_A_C: Array  # (c, 4, 3) [m] those on A in axes of C of body A
    p_B_C: Array  # (c, 4, 3) [m] those on B in axes of C of body B
    gap: Array  # (c, 4) [m]
    feature: IntArray  # (c, 4) which features of the shapes meet: the same number, the same point
    impulse: Array  # (c, 4) [N s] normal impulses; those of the last step after detection
    friction: Array  # (c, 3) [N s] tangential impulse on B, world axes
    spin: Array  # (c,) [N m s] impulse about the normal on B
    # (c, 5) when the features were found: orientation of B in A (0 but for polyhedra), first gap
    found_at: Array


class Scratch(NamedTuple):
    """Room in which one manifold is worked out."""

    points: Array  # (CANDIDATES, 4) point on A [m, world axes], gap [m]
    ids: IntArray  # (CANDIDATES,) features
    polygon: Array  # (2, CANDIDATES, 3)
    labels: IntArray  # (2, CANDIDATES, 2)
    numbers: Array  # (64,) small matrices
    corners: Array  # (EPA_CORNERS, 9) of A - B, A and B
    faces: Array  # (EPA_FACES, 4) normal and distance
    links: IntArray  # (EPA_FACES, 4) three corners, and whether the face is alive
    outline: Array  # (2, MAX_CORNERS, 3) the faces of A and B that meet [m, world axes]
    edges: IntArray  # (EPA_FACES, 2) the horizon


CANDIDATES = 96
LEVELS = 163  # of the grid of the broad phase: cells of 2^-40 m to 2^41 m, in steps of sqrt 2
EPA_CORNERS = 160
EPA_FACES = 512


class Memory(NamedTuple):
    """
    All arrays of detection.

    Only `pages` and `page` influence later results. The fat boxes, the pairs and their separating
    planes save time and change nothing: a world that was restored without them runs on bit for
    bit.
    """

    pages: tuple[Manifolds, Manifolds]
    page: IntArray  # (1,) the page of the latest step
    pose: Array  # (s, 12) shape poses in the world: origin, rotation matrix by rows
    turn: Array  # (n, 9) rotation matrices C to W of the bodies, by rows
    ahead: Array  # (s,) how far ahead a shape looks [m]; the margin of a pair is the sum of two
    calm: Array  # (1,) the margin of a pair at rest [m]
    box: Array  # (s, 6) bounding boxes, lower and upper corner, as far ahead as the shape looks
    fat: Array  # (s, 6) fat boxes; a plane: normal and offset
    cells: IntArray  # (s, 5) level, cell of the middle of the fat box, key of the cell
    moved: IntArray  # (s,) 1 for shapes that left their fat box
    buckets: IntArray  # (t + 2,) where each bucket of the grid starts, then the wide shapes
    members: IntArray  # (s,) the shapes in the order of their buckets
    keys: IntArray  # (s,) of their cells, in that order
    tally: IntArray  # (s + 1,) room to count
    levels: IntArray  # (LEVELS,) number of shapes on each level of the grid
    pair_count: IntArray  # (1,) -1 before the first step
    pair: IntArray  # (p, 2) shapes whose fat boxes overlap, sorted
    fresh: IntArray  # (2, p, 2) newly found pairs, before they are sorted in
    axis: Array  # (p, 4) witness: a direction in the axes of A that separated the pair; 0: none
    counters: IntArray  # (8,) see PAIRS .. SHORT_ROWS
    scratch: Scratch


# Rows of `Memory.counters`, of the latest step.
PAIRS = 0  # pairs whose bounding boxes overlap
WITNESSED = 1  # of these, settled by the plane that separated them before
RECYCLED = 2  # manifolds that hardly moved and only had their gaps updated
CONTACTS = 3  # points of all manifolds
REBUILT = 4  # shapes that left their fat boxes
SHORT_PAIRS = 5  # capacity that was missing: pairs
SHORT_ROWS = 6  # and manifolds


def empty_manifolds(capacity: int) -> Manifolds:
    """Return room for `capacity` manifolds."""
    c = capacity

    def numbers(*shape: int) -> Array:
        return np.zeros((c, *shape))

    def integers(*shape: int) -> IntArray:
        return np.zeros((c, *shape), dtype=np.int64)

    return Manifolds(np.zeros(1, dtype=np.int64), integers(), integers(), integers(), integers(),
                     integers(), numbers(3), numbers(3), numbers(POINTS, 3), numbers(POINTS, 3),
                     numbers(POINTS, 3), numbers(POINTS, 3), numbers(POINTS), integers(POINTS),
                     numbers(POINTS), numbers(3), numbers(), numbers(5))


def empty_memory(bodies: int, shapes: int, capacity: int = 64) -> Memory:
    """Return the memory of a world before its first step."""
    s = shapes

    def integers(*shape: int) -> IntArray:
        return np.zeros(shape, dtype=np.int64)

    scratch = Scratch(np.zeros((CANDIDATES, 4)), integers(CANDIDATES),
                      np.zeros((2, CANDIDATES, 3)), integers(2, CANDIDATES, 2), np.zeros(64),
                      np.zeros((EPA_CORNERS, 9)),
                      np.zeros((EPA_FACES, 4)), integers(EPA_FACES, 4),
                      np.zeros((2, MAX_CORNERS, 3)), integers(EPA_FACES, 2))
    buckets = 1 << max(4, (2 * s - 1).bit_length())
    pages = (empty_manifolds(capacity), empty_manifolds(capacity))
    memory = Memory(pages, integers(1), np.zeros((s, 12)), np.zeros((bodies, 9)), np.zeros(s),
                    np.zeros(1), np.zeros((s, 6)), np.zeros((s, 6)), integers(s, 5), integers(s),
                    integers(buckets + 2), integers(s), integers(s), integers(s + 1),
                    integers(LEVELS), integers(1), integers(2 * capacity, 2),
                    integers(2, 2 * capacity, 2),
                    np.zeros((2 * capacity, 4)), integers(8), scratch)
    forget_pairs(memory)
    return memory


def forget_pairs(memory: Memory) -> None:
    """Empty all that only saves time, so that the next step finds it anew."""
    memory.pair_count[0] = -1


@kernel
def current(memory: Memory) -> Manifolds:
    """Return the manifolds of the latest step."""
    return memory.pages[memory.page[0]]


def current_manifolds(memory: Memory) -> Manifolds:
    """Return the manifolds of the latest step, in Python."""
    return memory.pages[int(memory.page[0])]


def grown(memory: Memory) -> Memory:
    """Return the memory with the capacity that the last, unfinished detection asked for."""
    pages, pair, fresh, axis = memory.pages, memory.pair, memory.fresh, memory.axis
    if (rows := int(memory.counters[SHORT_ROWS])) > 0:
        capacity = _doubled(pages[0].shape_a.shape[0], rows)
        pages = (_longer(pages[0], capacity), _longer(pages[1], capacity))
    if (pairs := int(memory.counters[SHORT_PAIRS])) > 0:
        capacity = _doubled(pair.shape[0], pairs)
        pair = _enlarged(pair, capacity)  # type: ignore[assignment]
        axis = _enlarged(axis, capacity)  # type: ignore[assignment]
        fresh = np.zeros((2, capacity, 2), dtype=np.int64)
    memory.counters[SHORT_ROWS] = memory.counters[SHORT_PAIRS] = 0
    return memory._replace(pages=pages, pair=pair, fresh=fresh, axis=axis)


def _doubled(present: int, needed: int) -> int:
    capacity = max(present, 1)
    while capacity < needed:
        capacity *= 2
    return capacity


def _enlarged(array: Array | IntArray, capacity: int) -> Array | IntArray:
    larger = np.zeros((capacity, *array.shape[1:]), dtype=array.dtype)
    larger[:len(array)] = array
    return larger


def _longer(manifolds: Manifolds, capacity: int) -> Manifolds:
    fields: Any = [_enlarged(field, capacity) for field in manifolds[1:]]
    return Manifolds(manifolds.count, *fields)


def lasting(memory: Memory) -> list[Array | IntArray]:
    """Return copies of what influences later steps: the rows in use of the latest manifolds."""
    manifolds = current_manifolds(memory)
    count = int(manifolds.count[0])
    unused = np.arange(POINTS) >= manifolds.points[:count, None]
    # Those that are found anew in every step have nothing in axes that turn with the bodies.
    fleeting = (manifolds.found_at[:count, :4] == 0.0).all(axis=1)
    fields: list[Array | IntArray] = [manifolds.count.copy()]
    for name, field in zip(manifolds._fields[1:], manifolds[1:], strict=True):
        used: Any = field[:count].copy()
        if name in ('normal_A', 'p_A_C', 'p_B_C'):
            used[fleeting] = 0
        # What stands in the places of points that a manifold does not have is left from earlier
        # steps.
        if used.ndim > 1 and used.shape[1] == POINTS:
            used[unused] = 0
        fields.append(used)
    return fields


def with_lasting(memory: Memory, arrays: Sequence[Array | IntArray]) -> Memory:
    """Return a memory whose latest manifolds are those that `lasting` returned."""
    count = int(arrays[0][0])
    memory.counters[SHORT_ROWS] = count
    memory = grown(memory)
    manifolds = current_manifolds(memory)
    manifolds.count[0] = count
    for field, values in zip(manifolds[1:], arrays[1:], strict=True):
        field[:count] = values
    forget_pairs(memory)
    return memory
