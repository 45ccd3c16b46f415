# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The manifold of one pair: kept from the step before, or found by the narrow phase."""

from typing import Any, Protocol

from rigid_sim_ros.engine.detection.carried_impulses import carry_over
from rigid_sim_ros.engine.detection.manifold_rows import are_flat, recycle, write_row
from rigid_sim_ros.engine.detection.manifolds import Manifolds, Memory, Scratch
from rigid_sim_ros.engine.detection.narrow_phase.balls import touching_ball
from rigid_sim_ros.engine.detection.narrow_phase.boxes import box_box, UNSETTLED
from rigid_sim_ros.engine.detection.narrow_phase.collide import (
    BALL, BOXES, collide_by_search, FAMILY, on_plane, PLANE_FIRST, PLANE_SECOND)
from rigid_sim_ros.engine.detection.seams import mend_seams
from rigid_sim_ros.engine.detection.witness import boxes_apart, remember, separates
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Vector
from rigid_sim_ros.kernels.kernel import INDEX, inlined, kernel, part
from rigid_sim_ros.kernels.separate import address_of, by_address

NONE = (0.0, 0.0, 0.0)
# In place of the number of points: the pair is apart, and a witness says so; nobody knows, for
# what would find out is not compiled.
AS_BEFORE, UNKNOWN = -2, -3
ALL_SEAMS = -1  # in place of a pair


class SearchArguments(Protocol):
    """What the search for a pair reads of the arguments of a step."""

    @property
    def shapes(self) -> Shapes:
        """Return the shapes."""

    @property
    def memory(self) -> Memory:
        """Return what is detected, and what is kept from the last step."""


@part
def find_manifold(state: State, shapes: Shapes, memory: Memory, scratch: Scratch, now: Manifolds,
                  before: Manifolds, row: int, old: int, k: int, thread: int,
                  c: Any) -> tuple[int, int]:
    """
    Write the manifold of pair k to a row; return the number of its points, and 1 if it was kept.

    `old` is the pair's row in `before`, the manifolds of the last step, or -1. Without points no
    row is written, and the number is 0, AS_BEFORE or UNKNOWN.
    """
    a, b = memory.pair[k, 0] & INDEX, memory.pair[k, 1] & INDEX
    i, j = shapes.body[a] & INDEX, shapes.body[b] & INDEX
    margin, kept = memory.margin[a] + memory.margin[b], 0
    if old >= 0 and are_flat(shapes.kind, a, b) and recycle(
            state, memory.turn, now, before, row, old, i, j, margin,
            min(shapes.bound[a], shapes.bound[b]),
            min(shapes.half_width[a], shapes.half_width[b])):
        count, kept = before.points[old], 1
    else:
        count, n = _points_of(shapes, memory, scratch, k, a, b, margin, thread, c)
        if count <= 0:
            return count, 0
        write_row(state, memory.turn, now, row, i, j, count, n, scratch.points, scratch.ids,
                  are_flat(shapes.kind, a, b))
    carry_over(now, before, row, old, count)
    _name_row(now, row, a, b, i, j, count)
    return count, kept


@part
def _name_row(rows: Manifolds, row: int, a: int, b: int, i: int, j: int, count: int) -> None:
    """Write whose row it is: of the shapes a and b of the bodies i and j, with `count` points."""
    rows.shape_a[row], rows.shape_b[row] = a, b
    rows.body_a[row], rows.body_b[row] = i, j
    rows.points[row] = count


@part
def _points_of(shapes: Shapes, memory: Memory, scratch: Scratch, k: int, a: int, b: int,
               margin: float, thread: int, c: Any) -> tuple[int, Vector]:
    """
    Find the points of pair k, of shapes a and b: return their number and the normal.

    AS_BEFORE for a pair that the plane which separated it before still separates. The two most
    frequent families get just the arrays they need: to hand over all tables takes as long as their
    work.
    """
    kind_a, kind_b = shapes.kind[a] & INDEX, shapes.kind[b] & INDEX
    family = FAMILY[kind_a, kind_b]
    if family == BALL:
        return touching_ball(memory.pose, shapes.size, kind_a, kind_b, a, b, margin,
                             scratch.points, scratch.ids)
    if family in (PLANE_FIRST, PLANE_SECOND):
        return on_plane(memory.pose, shapes, a, b, family == PLANE_SECOND, margin, scratch)
    count, n = UNSETTLED, NONE
    if family == BOXES:
        if boxes_apart(memory.pose, shapes.size, shapes.bound, a, b, memory.axis, k, margin):
            return AS_BEFORE, NONE
        # What may touch with a face is seen as a face: where its border touches, by the search,
        # or the next corner of what pivots there would be met a step late.
        way = max(0.0, margin - memory.rest_margin[a] - memory.rest_margin[b])
        count, n = box_box(memory.pose, shapes.size, a, b, margin, way, scratch.points,
                           scratch.ids, scratch.polygon, scratch.labels, scratch.numbers)
    if count == UNSETTLED:
        count = _search(shapes, memory, k, thread, c)
        if count in (AS_BEFORE, UNKNOWN):
            return count, NONE
        n = scratch.normal[0], scratch.normal[1], scratch.normal[2]
    if count == 0 or memory.axis[k, 3] != 0.0:
        remember(memory.pose, a, memory.axis, k, n if count == 0 else NONE)
    return count, n


@part
def _search(shapes: Shapes, memory: Memory, k: int, thread: int, c: Any) -> int:
    """Search for the nearest points of pair k; UNKNOWN if `search` is not compiled yet."""
    if c is None:
        return search_pair(2 * k + thread, shapes, memory)
    return UNKNOWN if address_of(search, c) == 0 else search(c, 2 * k + thread)


@kernel
def search_pair(number: int, shapes: Shapes, memory: Memory) -> int:
    """
    Find the points of two convex shapes by the searches that do so for any kinds.

    2 k + thread is for pair k in the scratch of a thread, where the normal is left too. Returns
    the number of points, or AS_BEFORE. ALL_SEAMS, in place of such a number, mends the seams of
    all manifolds: it needs the same searches.
    """
    if number == ALL_SEAMS:
        mend_seams(shapes, memory, memory.scratch)
        return 0
    k = (number >> 1) & INDEX
    scratch = memory.other_scratch if number & 1 == 1 else memory.scratch
    a, b = memory.pair[k, 0] & INDEX, memory.pair[k, 1] & INDEX
    margin = memory.margin[a] + memory.margin[b]
    if separates(memory.pose, shapes, a, b, memory.axis, k, margin):
        return AS_BEFORE
    count, n = collide_by_search(memory.pose, shapes, a, b, margin, scratch)
    scratch.normal[0], scratch.normal[1], scratch.normal[2] = n
    return count


@by_address
def search(c: SearchArguments, number: int) -> int:
    """Search for the nearest points of the pair with this number; see `search_pair`."""
    return search_pair(number, c.shapes, c.memory)


@inlined
def key_of(a: int, b: int) -> int:
    """Return a number by which pairs are in order."""
    return (a << 32) | b


@part
def seek(before: Manifolds, old: int, end: int, back: int, key: int) -> int:
    """
    Return the first row from `old` on that does not come before a pair.

    With `back`, 1 and not 0, in the other direction, and then it is the row before what is
    returned.
    """
    # The bits of -1 turn the order around.
    turn, step = -back, 1 - 2 * back
    while old != end:
        row = (old - back) & INDEX
        if key_of(before.shape_a[row], before.shape_b[row]) ^ turn >= key ^ turn:
            break
        old += step
    return old
