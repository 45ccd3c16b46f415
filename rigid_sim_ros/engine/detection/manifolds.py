# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What detection finds, and what it keeps from one step to the next.

A manifold is a pair of shapes that are near each other: one normal and up to four points. The
manifolds of this step and of the last take turns in two pages, so that impulses are carried over
by walking through both in order, without a search and without a copy. What nobody asks of the last
step both pages share. Its impulses nobody asks for once they are carried over: then the model
`timestep` writes there what acted in the whole step, collisions included, for those who ask what
pressed on what: `step_impulses`.

Most contacts are one point of a ball, and 10 000 bodies have 30 000. So the first points of all
manifolds lie side by side, then all second points, and what belongs to polyhedra is written for
them only: memory that is zero from the start and never written takes up addresses and no room.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.detection.grid import Grid, make_grid
from rigid_sim_ros.engine.detection.transform_update import Settled, unplaced, unsettled
from rigid_sim_ros.engine.model.hulls import MAX_CORNERS
from rigid_sim_ros.kernels.arrays import Array, IntArray, integers, room
from rigid_sim_ros.kernels.kernel import INDEX, kernel

POINTS = 4  # of a manifold, at most
# Whether a manifold takes part in a step: it does; it does not; or it begins to when an impact
# changes the velocity of one of its bodies.
ACTS, LEFT_OUT, DORMANT = range(3)


class Manifolds(NamedTuple):
    """
    Pairs of shapes that are near each other: c rows, of which those of `rows_in_use` are in use.

    The rows are in the order of (shape_a, shape_b), and shape_a < shape_b. The normal points from
    A to B, gap < 0 is overlap: point_B = point_A + gap * normal.
    """

    # (2,) number of rows in use, and the first of them: 0 but where two threads found them
    count: IntArray  # type: ignore[assignment]
    shape_a: IntArray  # (c,) of 32 bits, as the next three
    shape_b: IntArray  # (c,)
    body_a: IntArray  # (c,)
    body_b: IntArray  # (c,)
    points: IntArray  # (c,) of 8 bits, number of points, 1 .. 4
    normal: Array  # (c, 3) unit vector from A to B, world axes
    r_A: Array  # (4, c, 3) [m] contact points on A from the centre of mass of A, world axes
    r_B: Array  # (4, c, 3) [m] contact points on B from the centre of mass of B, world axes
    gap: Array  # (4, c) [m]
    feature: IntArray  # (4, c) which features of the shapes meet: the same number, the same point
    impulse: Array  # (4, c) [N s] normal impulses; those of the last step after detection
    friction: Array  # (c, 3) [N s] tangential impulse on B, world axes
    spin: Array  # (c,) [N m s] impulse about the normal on B
    roll: Array  # (c, 3) [N m s] impulse against rolling on B, world axes
    # Of polyhedra only, which may keep their points. (c, 5) when the features were found:
    # orientation of B in A, 0 for other shapes, and the first gap [m]
    found_at: Array
    normal_A: Array  # (c, 3) the normal in axes of C of body A
    p_A_C: Array  # (c, 4, 3) [m] points on A in axes of C of body A
    p_B_C: Array  # (c, 4, 3) [m] points on B in axes of C of body B


class StepImpulses(NamedTuple):
    """What acted on the latest manifolds in the whole step, collisions included; their rows."""

    normal: Array  # (4, c) [N s] at each point, along the normal
    friction: Array  # (c, 3) [N s] tangential impulse on B, world axes


class Scratch(NamedTuple):
    """Room in which one manifold is worked out."""

    points: Array  # (CANDIDATES, 4) point on A [m, world axes], gap [m]
    ids: IntArray  # (CANDIDATES,) features
    polygon: Array  # (2, CANDIDATES, 3)
    labels: IntArray  # (2, CANDIDATES, 2)
    numbers: Array  # (64,) small matrices
    normal: Array  # (3,) where it is not returned
    corners: Array  # (EPA_CORNERS, 9) of A - B, A and B
    faces: Array  # (EPA_FACES, 4) normal and distance
    links: IntArray  # (EPA_FACES, 4) three corners, and whether the face is alive
    outline: Array  # (2, MAX_CORNERS, 3) the faces of A and B that meet [m, world axes]
    edges: IntArray  # (EPA_FACES, 2) the horizon


class Seams(NamedTuple):
    """
    Which manifolds have a shape in common, chained in the order of the rows; see seams.py.

    A code 2 k + side is row k seen from one of its shapes: side 0 from B, side 1 from A.
    """

    head: IntArray  # (s,) first code of a shape, -1 for none
    link: IntArray  # (2, c) of a side and a row: the code that follows, -1 for none
    back: IntArray  # (2, c) the code before
    suspect: IntArray  # (2 c,) codes of manifolds with a point where a third shape is
    normal: Array  # (c, 3) from A to B, as the pair alone says, whatever seams make of it
    count: IntArray  # type: ignore[assignment]  # (1,) how many of these there are


CANDIDATES = 96
PAIRS_LISTED = 64  # near pairs of one thread, at a time
EPA_CORNERS = 160
EPA_FACES = 512


class Memory(NamedTuple):
    """
    All arrays of detection.

    Only `pages` and `page` influence later results. The fat boxes, the pairs and their separating
    planes save time and change nothing: a world that was restored without them runs on bit for
    bit.
    """

    pages: tuple[Manifolds, Manifolds]  # with the same arrays in the fields SHARED
    page: IntArray  # (1,) the page of the latest step
    pose: Array  # (s, 12) shape poses in the world: origin, rotation matrix by rows
    turn: Array  # (n, 9) rotation matrices C to W of the bodies, by rows
    # (s,) [m] speculative margin: so far from a shape contacts are found; of a pair the sum of two
    margin: Array
    rest_margin: Array  # (s,) [m] what it would be if nothing moved
    box: Array  # (s, 6) bounding boxes with the margin, lower and upper corner
    settled: Settled  # whose poses and boxes are those of an earlier step
    grid: Grid
    pair_count: IntArray  # (3,) -1 before the first step; see `forget_parted`
    pair: IntArray  # (p, 2) of 32 bits, shapes whose fat boxes overlap, sorted
    # (4, >= s, 2) of 32 bits: pages 0 and 2 for the pairs that either thread found around what
    # moved, before they are taken in, and after each of them one to sort them in
    fresh: IntArray
    other_tally: IntArray  # (s + 1,) room to count for a second thread, beside that of the grid
    axis: Array  # (p, 4) witness: a direction in the axes of A that separated the pair; 0: none
    counters: IntArray  # (8,) see PAIRS .. NO_SEARCH
    scratch: Scratch
    other_scratch: Scratch  # for a second thread
    left: IntArray  # (2, 8) first of all how many shapes of either half left their fat boxes
    near: IntArray  # (2, PAIRS_LISTED) some pairs whose bounding boxes overlap, of either thread
    looked: IntArray  # (2,) new pairs that either thread has in `fresh`, -1 if it had no room
    shares: IntArray  # (2, 8) what either thread found, see parallel_detection.py
    ranges: IntArray  # (2, 6) the `Share` of either thread
    split: IntArray  # (1,) how many of the latest manifolds the first thread begins from
    touching: IntArray  # (2, n) of 8 bits, 1 for a body of a manifold that either thread found
    seams: Seams


# Rows of `Memory.counters`, of the latest step.
PAIRS = 0  # pairs whose bounding boxes overlap, and of spheres the balls in them
WITNESSED = 1  # of these, settled by the plane that separated them before
RECYCLED = 2  # manifolds that hardly moved and only had their gaps updated
CONTACTS = 3  # points of all manifolds
REBUILT = 4  # shapes that left their fat boxes
SHORT_PAIRS = 5  # capacity that was missing: pairs
SHORT_ROWS = 6  # and manifolds
NO_SEARCH = 7  # 1 where a pair needed `search_pair`, which was not there yet


# Fields that tell how things are in this step, and are not asked for those of the last one.
SHARED = ('normal', 'r_A', 'r_B', 'gap')
_OF_POINTS = ('r_A', 'r_B', 'gap', 'feature', 'impulse')


def empty_pages(capacity: int) -> tuple[Manifolds, Manifolds]:
    """Return room for `capacity` manifolds of two steps."""
    page = _empty_page(capacity)
    return page, _empty_page(capacity)._replace(**{name: getattr(page, name) for name in SHARED})


def _empty_page(capacity: int) -> Manifolds:
    c = capacity
    # Were the four points of a manifold a power of two apart, all would want the same few lines
    # of the cache.
    of_points = (POINTS, c + 13)

    return Manifolds(
        integers(2), _names(c), _names(c), _names(c), _names(c), room(c, kind=np.int8), room(c, 3),
        room(*of_points, 3), room(*of_points, 3), room(*of_points), integers(*of_points),
        room(*of_points), room(c, 3), room(c), room(c, 3), room(c, 5), room(c, 3),
        room(c, POINTS, 3), room(c, POINTS, 3))


def _names(*shape: int) -> Any:
    """Return room for numbers of shapes or bodies: 32 bits are enough, and there are many."""
    return room(*shape, kind=np.int32)


def _scratch() -> Scratch:
    return Scratch(np.zeros((CANDIDATES, 4)), integers(CANDIDATES),
                   np.zeros((2, CANDIDATES, 3)), integers(2, CANDIDATES, 2), np.zeros(64),
                   np.zeros(3), np.zeros((EPA_CORNERS, 9)),
                   np.zeros((EPA_FACES, 4)), integers(EPA_FACES, 4),
                   np.zeros((2, MAX_CORNERS, 3)), integers(EPA_FACES, 2))


def _seams(shapes: int, capacity: int) -> Seams:
    return Seams(integers(shapes), integers(2, capacity), integers(2, capacity),
                 integers(2 * capacity), room(capacity, 3), integers(1))


def empty_memory(bodies: int, shapes: int, capacity: int = 64) -> Memory:
    """Return the memory of a world before its first step."""
    s = shapes
    memory = Memory(
        empty_pages(capacity), integers(1), unplaced(s), room(bodies, 9), room(s), room(s),
        room(s, 6), unsettled(bodies), make_grid(s), integers(3), _names(2 * capacity, 2),
        _names(4, 4 * s, 2), integers(s + 1), room(2 * capacity, 4), integers(8), _scratch(),
        _scratch(), integers(2, 8), integers(2, PAIRS_LISTED), integers(2), integers(2, 8),
        integers(2, 6), integers(1), room(2, bodies, kind=np.int8), _seams(s, capacity))
    forget_pairs(memory)
    return memory


def forget_pairs(memory: Memory) -> None:
    """Empty all that only saves time, so that the next step finds it anew."""
    memory.pair_count[:] = -1, 0, 0


@kernel
def rows_in_use(manifolds: Manifolds) -> tuple[int, int]:
    """Return the first row in use, and how many there are."""
    return manifolds.count[1], manifolds.count[0]


@kernel
def first_row(manifolds: Manifolds, shape: int) -> int:
    """Return the first row in use whose shape A does not come before this one."""
    low, count = rows_in_use(manifolds)
    high = low + count
    while low < high:
        middle = (low + high) // 2 & INDEX
        if manifolds.shape_a[middle] < shape:
            low = middle + 1
        else:
            high = middle
    return low


def slice_in_use(manifolds: Manifolds) -> slice:
    """Return the rows in use, in Python."""
    count, first = manifolds.count.tolist()
    return slice(first, first + count)


@kernel
def current(memory: Memory) -> Manifolds:
    """Return the manifolds of the latest step."""
    return memory.pages[memory.page[0]]


@kernel
def earlier(memory: Memory) -> Manifolds:
    """Return the other page, that of the step before; once detection is over, `step_impulses`."""
    return memory.pages[1 - memory.page[0]]


@kernel
def step_impulses(memory: Memory) -> StepImpulses:
    """
    Return what acted on the latest manifolds, where a model writes that.

    It is in the impulses of the other page, which after detection nobody asks for.
    """
    page = memory.pages[1 - memory.page[0]]
    return StepImpulses(page.impulse, page.friction)


@kernel
def turn_page_back(memory: Memory) -> None:
    """Let the rows of the step before be the current manifolds again, to detect anew."""
    memory.page[0] = 1 - memory.page[0]


def latest_impulses(memory: Memory) -> StepImpulses:
    """Return what `step_impulses` does, in Python."""
    page = memory.pages[1 - int(memory.page[0])]
    return StepImpulses(page.impulse, page.friction)


def current_manifolds(memory: Memory) -> Manifolds:
    """Return the manifolds of the latest step, in Python."""
    return memory.pages[int(memory.page[0])]


def grown(memory: Memory) -> Memory:
    """Return the memory with the capacity that the last, unfinished detection asked for."""
    pages, pair, axis = memory.pages, memory.pair, memory.axis
    if (rows := int(memory.counters[SHORT_ROWS])) > pages[0].shape_a.shape[0]:
        pages = empty_pages(_doubled(pages[0].shape_a.shape[0], rows))
        _copy(current_manifolds(memory), pages[int(memory.page[0])])
        memory = memory._replace(seams=_seams(memory.seams.head.shape[0],
                                              pages[0].shape_a.shape[0]))
    if (pairs := int(memory.counters[SHORT_PAIRS])) > pair.shape[0]:
        # Those that were there are lost.
        capacity = _doubled(pair.shape[0], pairs)
        pair, axis = _names(capacity, 2), room(capacity, 4)
    memory.counters[SHORT_ROWS] = memory.counters[SHORT_PAIRS] = 0
    return memory._replace(pages=pages, pair=pair, axis=axis)


def _doubled(present: int, needed: int) -> int:
    # What is never used is never touched. To grow less would be to grow more often, and to begin
    # again with memory that the system has to hand out first.
    capacity = max(present, 1)
    while capacity < needed:
        capacity *= 2
    return capacity


def _copy(source: Manifolds, target: Manifolds) -> None:
    """Copy the rows in use to a page that is all zeros; what stays zero is not even touched."""
    rows = slice_in_use(source)
    target.count[:] = source.count[0], 0
    for name, old, new in zip(source._fields[1:], source[1:], target[1:], strict=True):
        # Few manifolds have all points: each by itself.
        single = name not in _OF_POINTS
        for values, place in [(old, new)] if single else zip(old, new, strict=True):
            if _any_bit(values[rows]):
                place[:source.count[0]] = values[rows]


def _any_bit(values: Any) -> bool:
    """Return whether any bit is set: -0.0 is 0.0, but not the same bits."""
    return bool(np.ascontiguousarray(values).view(np.uint8).any())


def _rows(name: str, field: Any, rows: slice) -> Any:
    """Return rows of a field."""
    return field[:, rows] if name in _OF_POINTS else field[rows]


def _used(name: str, points: IntArray, found_at: Array) -> Any:
    """
    Return a mask of what `_rows` returns: what is there, and means something.

    What stands in the places of points that a manifold does not have, and for shapes that are no
    polyhedra in the fields that only these need, is left from earlier steps.
    """
    there = np.arange(POINTS)[:, None] < points
    polyhedra = found_at[:, :4].any(axis=1)
    if name in _OF_POINTS:
        return there
    if name in ('p_A_C', 'p_B_C'):
        return (there & polyhedra).T
    return polyhedra if name == 'normal_A' else np.ones(len(points), dtype=bool)


def lasting(memory: Memory) -> list[Array | IntArray]:
    """
    Return copies of what influences later steps: the rows in use of the latest manifolds.

    Of the points those that there are, the first ones of all manifolds first.
    """
    manifolds = current_manifolds(memory)
    rows = slice_in_use(manifolds)
    points, found_at = manifolds.points[rows], manifolds.found_at[rows].copy()
    found_at[~found_at[:, :4].any(axis=1)] = 0.0
    fields: list[Array | IntArray] = [manifolds.count[:1].copy()]
    for name, field in zip(manifolds._fields[1:], manifolds[1:], strict=True):
        there = found_at if name == 'found_at' else _rows(name, field, rows)
        values = there[_used(name, points, found_at)]
        # Saved worlds have them in 64 bits.
        fields.append(values.astype(np.int64) if name == 'points' else values)
    return fields


def with_lasting(memory: Memory, arrays: Sequence[Array | IntArray]) -> Memory:
    """
    Return a memory, new until now, whose latest manifolds are those that `lasting` returned.

    ValueError where the arrays are not laid out like that.
    """
    kept = Manifolds._make(arrays)
    count = int(kept.count[0])
    memory.counters[SHORT_ROWS] = count
    memory = grown(memory)
    manifolds = current_manifolds(memory)
    manifolds.count[:] = count, 0
    for name, field, values in zip(kept._fields[1:], manifolds[1:], kept[1:], strict=True):
        rows, used = _rows(name, field, slice(count)), _used(name, kept.points, kept.found_at)
        if (shape := rows[used].shape) != values.shape:
            raise ValueError(f'manifolds: {name} of shape {values.shape}, must be {shape}: it was '
                             f'saved by another version; run the scene from its start')
        if _any_bit(values):
            rows[used] = values
    forget_pairs(memory)
    return memory


@kernel
def has_impulse(impulse: Array, points: int, r: int) -> bool:
    """Return whether any of the points of manifold r has one of the normal impulses (4, c)."""
    for p in range(points):
        if impulse[p, r] != 0.0:
            return True
    return False


@kernel
def point_of_feature(manifolds: Manifolds, r: int, feature: int) -> int:
    """Return which point of manifold r has a feature, -1: none."""
    for p in range(manifolds.points[r]):
        if manifolds.feature[p, r] == feature:
            return p
    return -1


@kernel
def smallest_gap(manifolds: Manifolds, r: int) -> float:
    """Return the gap [m] of that point of manifold r which is nearest."""
    gap = manifolds.gap[0, r]
    for p in range(1, manifolds.points[r]):
        gap = min(gap, manifolds.gap[p, r])
    return gap


@kernel
def forget_impulses(manifolds: Manifolds, r: int) -> None:
    """Let a manifold begin with no impulses, of points that it may be given yet as well."""
    manifolds.spin[r] = 0.0
    for p in range(POINTS):
        manifolds.impulse[p, r] = 0.0
    for k in range(3):
        manifolds.friction[r, k] = manifolds.roll[r, k] = 0.0
