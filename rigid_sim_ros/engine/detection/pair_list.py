# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The list of pairs whose manifolds detection looks for, from step to step.

What moved out of its fat box is looked up in the grid, by one thread or by two, and the pairs that
come out are sorted and merged with those that there are, whose witnesses move along.
"""

from rigid_sim_ros.engine.detection.broad_phase import can_meet, look_around, refresh
from rigid_sim_ros.engine.detection.grid import fill_grid, Grid
from rigid_sim_ros.engine.detection.manifolds import Memory, REBUILT, SHORT_PAIRS
from rigid_sim_ros.engine.model.kinds.table import is_ball, is_unbounded
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import apart, INDEX, inlined, kernel

# Pairs that have parted are forgotten after so many steps, or once there are an eighth more pairs.
_UNTIL_FORGOTTEN, _MANY_PARTED = 64, 8


@kernel
def find_pairs(model: Model, state: State, shapes: Shapes, memory: Memory) -> bool:
    """Keep the list of pairs up to date; return whether there was room for them."""
    if _have_left(memory):
        refresh_some(model, state, shapes, memory, 0, (0, shapes.kind.shape[0]))
        memory.left[1, 1] = 0
    note_moved(shapes, memory)
    return memory.counters[REBUILT] == 0 or update_alone(model, shapes, memory)


@kernel
def _have_left(memory: Memory) -> bool:
    """Return whether any shape has left its fat box."""
    return bool(memory.left[0, 0] + memory.left[1, 0] > 0)


@kernel
def refresh_some(model: Model, state: State, shapes: Shapes, memory: Memory, half: int,
                 some: tuple[int, int]) -> None:
    """Give those of `some` shapes that are marked a new fat box; count those that look around."""
    memory.left[half, 1] = refresh(shapes, memory.pose, memory.box, model.inv_m, state.P, model.h,
                                   memory.pair_count[0] < 0, memory.grid, some[0], some[1])


@kernel
def note_moved(shapes: Shapes, memory: Memory) -> None:
    """Note how many shapes got a new fat box, and let the grid know."""
    count = memory.pair_count[0]
    moved = memory.left[0, 1] + memory.left[1, 1] if _have_left(memory) else 0
    memory.counters[REBUILT] = moved
    if count >= 0:
        forget_parted(shapes.kind, shapes.size, memory.grid.fat, memory.margin, moved, memory.pair,
                      memory.axis, memory.pair_count)
    if moved > 0:
        fill_grid(memory.grid)


@kernel
def update_alone(model: Model, shapes: Shapes, memory: Memory) -> bool:
    """Find the pairs of what moved; return whether there was room for them."""
    return _keep_count(memory, update_pairs(
        shapes, memory.grid, memory.fresh, memory.pair, memory.axis, max(memory.pair_count[0], 0),
        model.m.shape[0], memory.margin, memory.near[0]))


@kernel
def look_for_share(model: Model, shapes: Shapes, memory: Memory, thread: int) -> None:
    """
    List the new partners, sorted, of half of the shapes that moved, for one of two threads.

    The first thread takes the first half by number: most of their partners are then of the same
    half of the world.
    """
    fresh, tally = memory.fresh[2 * thread:2 * thread + 2], memory.grid.tally
    if thread == 1:
        tally = memory.other_tally
    middle = _middle_of(memory.grid.moved, memory.counters[REBUILT])
    begin, end = (middle, shapes.kind.shape[0]) if thread == 1 else (0, middle)
    done, found = look_around(shapes, memory.grid, fresh[0], model.m.shape[0], memory.margin,
                              memory.near[thread], begin, end)
    memory.looked[thread] = -1
    if done == end:
        memory.looked[thread] = sort_new(fresh, found, tally, memory.pair,
                                         max(memory.pair_count[0], 0))


@kernel
def _middle_of(moved: IntArray, count: int) -> int:
    """Return the shape before which half of those are that moved."""
    s, before = 0, 0
    while 2 * before < count:
        before += moved[s]
        s += 1
    return s


@kernel
def take_shares(model: Model, shapes: Shapes, memory: Memory) -> bool:
    """Take in what both threads listed; return whether there was room for it."""
    first, second = memory.looked[0], memory.looked[1]
    if min(first, second) < 0:
        return update_alone(model, shapes, memory)
    return _keep_count(memory, take_in(shapes.kind, memory.fresh, first, second, memory.pair,
                                       memory.axis, max(memory.pair_count[0], 0)))


@kernel
def _keep_count(memory: Memory, count: int) -> bool:
    """Note how many pairs there are; return whether there was room for them."""
    short = count > memory.pair.shape[0]
    if short:
        memory.counters[SHORT_PAIRS] = count
    memory.pair_count[0] = -1 if short else count
    return not short


@apart
def sort_new(fresh: IntArray, found: int, tally: IntArray, pair: IntArray, count: int) -> int:
    """
    Sort the pairs that were found, and drop those that there are; return how many are left.

    fresh (2, f, 2) then has these in its first page, and in the first column of its second one
    before which of the pairs each of them belongs.
    """
    _sort(fresh, found, tally)
    new, old = 0, 0
    for k in range(found):
        a, b = fresh[0, k, 0], fresh[0, k, 1]
        while old < count and _is_before(pair[old, 0], pair[old, 1], a, b):
            old += 1
        fresh[0, new, 0], fresh[0, new, 1], fresh[1, new, 0] = a, b, old
        new += 0 if old < count and pair[old, 0] == a and pair[old, 1] == b else 1
    return new


@kernel
def _sort(fresh: IntArray, count: int, tally: IntArray) -> None:
    """Sort the fresh pairs by the second shape, then by the first; equals keep their order."""
    for column in range(1, -1, -1):
        source, target = 1 - column, column
        tally[:] = 0
        for k in range(count):
            tally[fresh[source, k, column] + 1] += 1
        for s in range(tally.shape[0] - 1):
            tally[s + 1] += tally[s]
        for k in range(count):
            s = fresh[source, k, column]
            fresh[target, tally[s], 0] = fresh[source, k, 0]
            fresh[target, tally[s], 1] = fresh[source, k, 1]
            tally[s] += 1


@inlined
def _is_before(a: int, b: int, c: int, d: int) -> bool:
    """Return whether the pair (a, b) comes before (c, d)."""
    return a < c or (a == c and b < d)


@kernel
def _have_witnesses(kind: IntArray) -> bool:
    """Return whether any pair of shapes may have a witness: balls and planes need none."""
    for s in range(kind.shape[0]):
        if not is_ball(kind[s]) and not is_unbounded(kind[s]):
            return True
    return False


@kernel
def forget_parted(kind: IntArray, size: Array, fat: Array, margin: Array, moved: int,
                  pair: IntArray, axis: Array, pair_count: IntArray) -> None:
    """
    Drop pairs that cannot meet in their fat boxes, when it is worth to go through all of them.

    pair_count (3,) is how many there are, how many were left the last time, and in how many steps
    those are forgotten that have parted since: 0 if no shape moved out of its fat box.
    """
    count = pair_count[0]
    if moved > 0 and pair_count[2] == 0:
        pair_count[2] = _UNTIL_FORGOTTEN
    elif pair_count[2] > 0:
        pair_count[2] -= 1
    else:
        return
    if pair_count[2] > 0 and count <= pair_count[1] + pair_count[1] // _MANY_PARTED:
        return
    kept, witnessed = 0, _have_witnesses(kind)
    for k in range(count):
        a, b = pair[k, 0] & INDEX, pair[k, 1] & INDEX
        pair[kept, 0], pair[kept, 1] = a, b
        for i in range(4 if witnessed else 0):
            axis[kept, i] = axis[k, i]
        kept += 1 if can_meet(kind, size, fat, margin, a, b) else 0
    pair_count[0], pair_count[1], pair_count[2] = kept, kept, 0


@kernel
def update_pairs(shapes: Shapes, grid: Grid, fresh: IntArray, pair: IntArray, axis: Array,
                 count: int, bodies: int, margin: Array, near: IntArray) -> int:
    """
    Bring the pairs up to date after some shapes moved and the grid was filled.

    Returns their number. One above the capacity of `pair` means that there was no room, and the
    pairs are lost.
    """
    s = 0
    while s < shapes.kind.shape[0]:
        s, found = look_around(shapes, grid, fresh[0], bodies, margin, near, s,
                               shapes.kind.shape[0])
        if count <= pair.shape[0]:
            found = sort_new(fresh[:2], found, grid.tally, pair, count)
        count = take_in(shapes.kind, fresh, found, 0, pair, axis, count)
    return count


@apart
def take_in(kind: IntArray, fresh: IntArray, first: int, second: int, pair: IntArray, axis: Array,
            count: int) -> int:
    """
    Take in what `sort_new` left of either thread's pairs; return how many pairs there are then.

    fresh (4, f, 2) has the `first` of these in its first two pages, the `second` in the others.
    Without room for them it only counts. From the end, so that nothing is overwritten that is
    still needed; all between two new ones moves on by as many places.
    """
    total = count + first + second
    if total > pair.shape[0]:
        return total
    witnessed, end = _have_witnesses(kind), count
    while first + second > 0:
        i, j = first - 1 & INDEX, second - 1 & INDEX
        if second == 0 or (first > 0 and _is_before(fresh[2, j, 0], fresh[2, j, 1],
                                                    fresh[0, i, 0], fresh[0, i, 1])):
            a, b, old, first = fresh[0, i, 0], fresh[0, i, 1], fresh[1, i, 0], first - 1
        else:
            a, b, old, second = fresh[2, j, 0], fresh[2, j, 1], fresh[3, j, 0], second - 1
        further = first + second
        for k in range(end - 1, old - 1, -1):
            pair[k + further + 1, 0], pair[k + further + 1, 1] = pair[k, 0], pair[k, 1]
            for x in range(4 if witnessed else 0):
                axis[k + further + 1, x] = axis[k, x]
        pair[old + further, 0], pair[old + further, 1] = a, b
        if witnessed:
            axis[old + further, 3] = 0.0
        end = old
    return total
