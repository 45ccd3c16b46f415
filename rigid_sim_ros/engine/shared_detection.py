# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Detection by two threads; what it finds is what `detect_ahead` finds.

Either places half of the shapes, and looks through those pairs that took half of the effort in the
last step. The second does not know how many manifolds the first will find, so it leaves as much
room as there were then and some more; afterwards its rows move up. Where the room was too small
one thread begins anew.
"""

from typing import Any

from rigid_sim_ros.engine.arrays import IntArray
from rigid_sim_ros.engine.detect import (
    ALL, FIND, get_share, LIST, ROWS, set_share, Share, turn_page)
from rigid_sim_ros.engine.kept import call
from rigid_sim_ros.engine.kernel import INDEX, kernel, part
from rigid_sim_ros.engine.manifolds import (
    current, earlier, Manifolds, Memory, PAIRS, RECYCLED, WITNESSED)
from rigid_sim_ros.engine.placing import bound, place_bodies, place_shapes
from rigid_sim_ros.engine.shapes import Shapes
from rigid_sim_ros.engine.state import State
from rigid_sim_ros.engine.two_cores import side_by_side

# The stages that one thread alone does not have, by their numbers; of those in halves the number
# of the first half.
SHARE_OUT, FIT, JOIN, PLACE, MOVE = 0, 1, 2, 3, 5
# What a manifold takes more than a pair that a witness settles.
_OF_RECYCLED, _OF_NEW = 2, 14
_SPARE = 64     # rows of room for manifolds that the first half did not have in the last step


@part
def detect_side_by_side(to: int, to_share: int, box: Any, desk: IntArray) -> int:
    """
    Do what `detect_ahead` does.

    `to` and `to_share` are the addresses of kernels that call `detect_stage` and `share_stage`.
    """
    side_by_side(desk, to_share, box, PLACE, PLACE + 1)
    if call(to, box, LIST) == 0:
        return 0
    call(to_share, box, SHARE_OUT)
    side_by_side(desk, to, box, FIND, FIND + 1)
    if call(to_share, box, FIT) == 0:
        return call(to, box, ALL)
    side_by_side(desk, to_share, box, MOVE, MOVE + 1)
    return call(to_share, box, JOIN)


@kernel
def share_stage(stage: int, state: State, shapes: Shapes, memory: Memory, cut: IntArray) -> bool:
    """Do a stage; cut (2,) are the first shape of the second half, and its body."""
    if stage == SHARE_OUT:
        _share_out(memory)
    elif stage == FIT:
        return _fit(memory)
    elif stage == JOIN:
        return _join(memory)
    elif stage == PLACE:
        _place(state, shapes, memory, 0, cut[0], 0, cut[1])
    elif stage == PLACE + 1:
        _place(state, shapes, memory, cut[0], shapes.kind.shape[0], cut[1], state.x.shape[1])
    else:
        rows, source = earlier(memory), get_share(memory, 1).row
        found, more = memory.shares[0, ROWS], memory.shares[1, ROWS]
        if stage == MOVE:
            _move_points(rows, source, found, more)
        else:
            _move_rows(rows, source, found, more)
    return True


@kernel
def _place(state: State, shapes: Shapes, memory: Memory, first: int, last: int, first_body: int,
           last_body: int) -> None:
    place_bodies(state, memory.turn, first_body, last_body)
    place_shapes(state, shapes, memory.turn, memory.pose, first, last)
    bound(shapes.kind, shapes.size, memory.pose, memory.ahead, memory.box, first, last)


@kernel
def _share_out(memory: Memory) -> None:
    """Give either thread its pairs, and room for what it finds."""
    before, pairs = current(memory), memory.pair_count[0]
    old, room = min(memory.split[0], before.count[0]), before.shape_a.shape[0]
    cut = _first_pair(memory.pair, pairs, before.shape_a[old], before.shape_b[old])
    start = old + min(old // 8 + _SPARE, (room - before.count[0]) // 2)
    set_share(memory, 0, Share(0, cut, 0, start, 0))
    set_share(memory, 1, Share(cut, pairs, start, room, old))


@kernel
def _first_pair(pair: IntArray, pairs: int, a: int, b: int) -> int:
    """Return the first pair that does not come before (a, b)."""
    low, high = 0, pairs
    while low < high:
        middle = (low + high) // 2 & INDEX
        if pair[middle, 0] < a or (pair[middle, 0] == a and pair[middle, 1] < b):
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def _fit(memory: Memory) -> bool:
    """Return whether both threads had enough room, and a row to spare (see `turn_page`)."""
    first, second = get_share(memory, 0), get_share(memory, 1)
    return bool(memory.shares[0, ROWS] < first.end
                and memory.shares[1, ROWS] < second.end - second.row)


@kernel
def _join(memory: Memory) -> bool:
    """Turn the page to the rows of both threads, which lie together by now."""
    rows, source, target = earlier(memory), get_share(memory, 1).row, memory.shares[0, ROWS]
    for k in range(memory.shares[1, ROWS]):
        rows.points[(target + k) & INDEX] = rows.points[(source + k) & INDEX]
    memory.split[0] = _fair_split(memory.shares[0], memory.shares[1])
    return turn_page(memory, target + memory.shares[1, ROWS])


@kernel
def _fair_split(first: IntArray, second: IntArray) -> int:
    """Return how many manifolds of this step took half of its effort, as far as one can tell."""
    one, other = _effort(first), _effort(second)
    if one > other:
        return first[ROWS] - first[ROWS] * (one - other) // (2 * one)
    return first[ROWS] + second[ROWS] * (other - one) // max(2 * other, 1)


@kernel
def _effort(found: IntArray) -> int:
    """Return how long a thread was busy, about, in units of a pair that a witness settles."""
    anew = found[PAIRS] - found[WITNESSED] - found[RECYCLED]
    return found[PAIRS] + _OF_RECYCLED * found[RECYCLED] + _OF_NEW * anew


@kernel
def _move_points(rows: Manifolds, source: int, target: int, count: int) -> None:
    """Move the places of the points of some rows up; of most rows these are half of all."""
    i, j = source & INDEX, target & INDEX
    for p in range(rows.gap.shape[0]):
        for k in range(count):
            if p < rows.points[i + k]:
                rows.gap[p, j + k] = rows.gap[p, i + k]
                for x in range(3):
                    rows.r_A[p, j + k, x] = rows.r_A[p, i + k, x]
                    rows.r_B[p, j + k, x] = rows.r_B[p, i + k, x]


@kernel
def _move_rows(rows: Manifolds, source: int, target: int, count: int) -> None:
    """
    Move the rest of some rows up, but for the numbers of points: both threads go by these.

    What most shapes do not need is written only where it changes: see `Manifolds`.
    """
    for k in range(count):
        i, j = (source + k) & INDEX, (target + k) & INDEX
        rows.shape_a[j], rows.shape_b[j] = rows.shape_a[i], rows.shape_b[i]
        rows.body_a[j], rows.body_b[j] = rows.body_a[i], rows.body_b[i]
        for x in range(3):
            rows.normal[j, x], rows.friction[j, x] = rows.normal[i, x], rows.friction[i, x]
        if rows.spin[j] != rows.spin[i]:
            rows.spin[j] = rows.spin[i]
        for p in range(rows.points[i]):
            rows.impulse[p, j] = rows.impulse[p, i]
            if rows.feature[p, j] != rows.feature[p, i]:
                rows.feature[p, j] = rows.feature[p, i]
    for k in range(count):
        i, j = (source + k) & INDEX, (target + k) & INDEX
        lasts = False
        for x in range(4):
            lasts = lasts or rows.found_at[i, x] != 0.0
        for x in range(5):
            # Of what lasts also -0.0.
            if lasts or rows.found_at[j, x] != rows.found_at[i, x]:
                rows.found_at[j, x] = rows.found_at[i, x]
        for x in range(3 if lasts else 0):
            rows.normal_A[j, x] = rows.normal_A[i, x]
        for p in range(rows.points[i] if lasts else 0):
            for x in range(3):
                rows.p_A_C[j, p, x] = rows.p_A_C[i, p, x]
                rows.p_B_C[j, p, x] = rows.p_B_C[i, p, x]
