# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The manifolds of what is thrown, found again within wider margins, among those that were found.

In a heap that falls a few bodies in a thousand are thrown in a step. All other manifolds are what
they were: a pair has the same points whenever it is looked at with the same margins.
"""

from typing import Any

from rigid_sim_ros.engine.detection.broad_phase import mark_moved, near_pairs
from rigid_sim_ros.engine.detection.manifold_rows import copy_row, pack_rows
from rigid_sim_ros.engine.detection.manifolds import (
    CONTACTS, current, earlier, Manifolds, Memory, NO_SEARCH, rows_in_use, SHORT_ROWS,
    turn_page_back)
from rigid_sim_ros.engine.detection.pair_list import find_pairs
from rigid_sim_ros.engine.detection.pair_manifold import find_manifold, key_of, seek, UNKNOWN
from rigid_sim_ros.engine.detection.transform_update import write_aabbs
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.kernel import INDEX, kernel

NOT_FOUND = -1  # in place of the number of new manifolds: `search` was needed


@kernel
def find_thrown(model: Model, state: State, shapes: Shapes, memory: Memory, thrown: IntArray,
                c: Any) -> bool:
    """
    Find the manifolds of the shapes with thrown (s,) = 1 again; return whether all was there.

    Where it was not, the page is turned back: the caller makes room, and detects from the start.
    """
    _widen_boxes(shapes, memory, thrown)
    if not find_pairs(model, state, shapes, memory):
        turn_page_back(memory)
        return False
    rows = current(memory)
    room = rows.shape_a.shape[0]
    new = _find_rows(state, shapes, memory, thrown, c)
    if rows.count[1] + rows.count[0] + 2 * new > room:
        # What two threads found begins anywhere.
        _move_to_front(rows)
        new = _find_rows(state, shapes, memory, thrown, c)
    needed = rows.count[0] + 2 * new
    if new == NOT_FOUND:
        memory.counters[NO_SEARCH] = 1
    elif needed > room:
        memory.counters[SHORT_ROWS] = needed
    else:
        _merge(rows, new)
        pack_rows(rows)
        memory.counters[CONTACTS] = _count_points(rows)
        return True
    turn_page_back(memory)
    return False


@kernel
def _count_points(rows: Manifolds) -> int:
    """Return how many points all manifolds have."""
    first, count = rows_in_use(rows)
    points = 0
    for row in range(first, first + count):
        points += rows.points[row]
    return points


@kernel
def _widen_boxes(shapes: Shapes, memory: Memory, thrown: IntArray) -> None:
    """Make the boxes of what is thrown anew, with its margins; mark what leaves its fat box."""
    memory.grid.moved[:] = 0
    left = 0
    for s in range(thrown.shape[0]):
        if thrown[s] == 1:
            write_aabbs(shapes.kind, shapes.size, memory.pose, memory.margin, memory.box, s, s + 1)
            left += mark_moved(shapes.kind, memory.pose, memory.box, False, memory.grid, s, s + 1)
    memory.left[0, 0], memory.left[1, 0] = left, 0


@kernel
def _find_rows(state: State, shapes: Shapes, memory: Memory, thrown: IntArray, c: Any) -> int:
    """
    Find what is thrown anew; return how many pairs have no row yet.

    A pair that has a row gets its manifold there, 0 points where it has none any more. Those of
    others are written from the last row on backwards, as long as there is room for `_merge`.
    """
    rows, before = current(memory), earlier(memory)
    (old_at, old_count), (at, count) = rows_in_use(before), rows_in_use(rows)
    old_end, end = old_at + old_count, at + count
    last, new, missing = rows.shape_a.shape[0] - 1, 0, False
    for k in range(memory.pair_count[0]):
        a, b = memory.pair[k, 0] & INDEX, memory.pair[k, 1] & INDEX
        if (thrown[a] | thrown[b]) == 0 or near_pairs(
                shapes.kind, memory.pair, memory.box, k, k + 1, memory.near[0]) == 0:
            continue
        key = key_of(a, b)
        old_at, at = seek(before, old_at, old_end, 0, key), seek(rows, at, end, 0, key)
        old = old_at if _is_of(before, old_at, old_end, a, b) else -1
        there = _is_of(rows, at, end, a, b)
        row = at if there else last - (new if end + 2 * (new + 1) <= last + 1 else 0)
        points, _ = find_manifold(state, shapes, memory, memory.scratch, rows, before,
                                  row & INDEX, old, k, 0, c)
        missing |= points == UNKNOWN
        if there:
            rows.points[row & INDEX] = max(points, 0)
        elif points > 0:
            i, j = rows.body_a[row & INDEX] & INDEX, rows.body_b[row & INDEX] & INDEX
            memory.touching[0, i] = memory.touching[0, j] = 1
            new += 1
    return NOT_FOUND if missing else new


@kernel
def _is_of(rows: Manifolds, row: int, end: int, a: int, b: int) -> bool:
    """Return whether there is such a row before `end`, and it is of the shapes a and b."""
    return bool(row != end and rows.shape_a[row & INDEX] == a and rows.shape_b[row & INDEX] == b)


@kernel
def _move_to_front(rows: Manifolds) -> None:
    """Let the first row in use be the first that there is."""
    first, count = rows_in_use(rows)
    for k in range(count if first > 0 else 0):
        copy_row(rows, (first + k) & INDEX, k)
    rows.count[1] = 0


@kernel
def _merge(rows: Manifolds, new: int) -> None:
    """Take in new rows, of which the first is the last that there is, in the order of pairs."""
    first, count = rows_in_use(rows)
    last = rows.shape_a.shape[0] - 1
    at, left, place = first + count - 1, new - 1, first + count + new - 1
    while left >= 0:
        row = (last - left) & INDEX
        old = at & INDEX
        if at >= first and (key_of(rows.shape_a[old], rows.shape_b[old])
                            > key_of(rows.shape_a[row], rows.shape_b[row])):
            copy_row(rows, old, place & INDEX)
            at -= 1
        else:
            copy_row(rows, row, place & INDEX)
            left -= 1
        place -= 1
    rows.count[0] = count + new
