# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The list of pairs whose manifolds detection looks for, from step to step.

What moved out of its fat box is looked up in the grid, by one thread or by two, and the pairs that
come out are sorted and merged with those that there are, whose witnesses move along.
"""

from rigid_sim_ros.engine.arrays import Array, IntArray
from rigid_sim_ros.engine.broad_phase import can_meet, look_around, refresh
from rigid_sim_ros.engine.grid import fill_grid, Grid
from rigid_sim_ros.engine.kernel import apart, INDEX, kernel
from rigid_sim_ros.engine.manifolds import Memory, REBUILT, SHORT_PAIRS
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.shapes import PLANE, Shapes, SPHERE
from rigid_sim_ros.engine.state import State

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
    """Give those of `some` shapes that are marked a new fat box, and count them."""
    memory.left[half, 1] = refresh(shapes.kind, shapes.body, memory.pose, memory.box, model.inv_m,
                                   state.P, model.h, memory.grid, some[0], some[1])


@kernel
def note_moved(shapes: Shapes, memory: Memory) -> None:
    """Note how many shapes got a new fat box, and let the grid know."""
    count = memory.pair_count[0]
    moved = memory.left[0, 1] + memory.left[1, 1] if _have_left(memory) else 0
    memory.counters[REBUILT] = moved
    if count >= 0:
        forget_parted(shapes.kind, shapes.size, memory.grid.fat, memory.ahead, moved, memory.pair,
                      memory.axis, memory.pair_count)
    if moved > 0:
        fill_grid(memory.grid)


@kernel
def update_alone(model: Model, shapes: Shapes, memory: Memory) -> bool:
    """Find the pairs of what moved; return whether there was room for them."""
    return _keep_count(memory, update_pairs(
        shapes, memory.grid, memory.fresh, memory.pair, memory.axis, max(memory.pair_count[0], 0),
        model.m.shape[0], memory.ahead, memory.near[0]))


@kernel
def look_for_share(model: Model, shapes: Shapes, memory: Memory, thread: int) -> None:
    """List the partners of every second shape that moved, for one of two threads."""
    end, found = look_around(shapes, memory.grid, memory.fresh[thread], model.m.shape[0],
                             memory.ahead, memory.near[thread], thread, 2, 0)
    memory.looked[thread] = found if end == shapes.kind.shape[0] else -1


@kernel
def take_shares(model: Model, shapes: Shapes, memory: Memory) -> bool:
    """Take in what both threads listed; return whether there was room for it."""
    first, second, fresh = memory.looked[0], memory.looked[1], memory.fresh
    if min(first, second) < 0 or first + second > fresh.shape[1]:
        return update_alone(model, shapes, memory)
    for k in range(second):
        fresh[0, first + k, 0], fresh[0, first + k, 1] = fresh[1, k, 0], fresh[1, k, 1]
    return _keep_count(memory, take_in(shapes.kind, fresh, first + second, memory.grid.tally,
                                       memory.pair, memory.axis, max(memory.pair_count[0], 0)))


@kernel
def _keep_count(memory: Memory, count: int) -> bool:
    """Note how many pairs there are; return whether there was room for them."""
    short = count > memory.pair.shape[0]
    if short:
        memory.counters[SHORT_PAIRS] = count
    memory.pair_count[0] = -1 if short else count
    return not short


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


@kernel
def _is_before(pair: IntArray, i: int, fresh: IntArray, j: int) -> bool:
    return (pair[i, 0] < fresh[0, j, 0]
            or (pair[i, 0] == fresh[0, j, 0] and pair[i, 1] < fresh[0, j, 1]))


@kernel
def _have_witnesses(kind: IntArray) -> bool:
    """Return whether any pair of shapes may have a witness: see `worth_it`."""
    for s in range(kind.shape[0]):
        if kind[s] != SPHERE and kind[s] != PLANE:
            return True
    return False


@kernel
def forget_parted(kind: IntArray, size: Array, fat: Array, ahead: Array, moved: int,
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
        kept += 1 if can_meet(kind, size, fat, ahead, a, b) else 0
    pair_count[0], pair_count[1], pair_count[2] = kept, kept, 0


@kernel
def _merge(pair: IntArray, axis: Array, witnessed: bool, count: int, fresh: IntArray,
           found: int) -> int:
    """Merge the sorted fresh pairs into the pairs; return their number, too large or not."""
    new, old = 0, 0
    for k in range(found):
        while old < count and _is_before(pair, old, fresh, k):
            old += 1
        if (old < count and pair[old, 0] == fresh[0, k, 0] and pair[old, 1] == fresh[0, k, 1]):
            continue
        fresh[0, new, 0], fresh[0, new, 1] = fresh[0, k, 0], fresh[0, k, 1]
        new += 1
    total = count + new
    if total > pair.shape[0]:
        return total
    # From the end, so that nothing is overwritten that is still needed.
    old, new, place = count - 1, new - 1, total - 1
    while new >= 0:
        if old >= 0 and not _is_before(pair, old, fresh, new):
            pair[place, 0], pair[place, 1] = pair[old, 0], pair[old, 1]
            for i in range(4 if witnessed else 0):
                axis[place, i] = axis[old, i]
            old -= 1
        else:
            pair[place, 0], pair[place, 1] = fresh[0, new, 0], fresh[0, new, 1]
            if witnessed:
                axis[place, 3] = 0.0
            new -= 1
        place -= 1
    return total


@kernel
def update_pairs(shapes: Shapes, grid: Grid, fresh: IntArray, pair: IntArray, axis: Array,
                 count: int, bodies: int, ahead: Array, near: IntArray) -> int:
    """
    Bring the pairs up to date after some shapes moved and the grid was filled.

    Returns their number. One above the capacity of `pair` means that there was no room, and the
    pairs are lost.
    """
    s = 0
    while s < shapes.kind.shape[0]:
        s, found = look_around(shapes, grid, fresh[0], bodies, ahead, near, 0, 1, s)
        count = take_in(shapes.kind, fresh, found, grid.tally, pair, axis, count)
    return count


@apart
def take_in(kind: IntArray, fresh: IntArray, found: int, tally: IntArray, pair: IntArray,
            axis: Array, count: int) -> int:
    """Sort the fresh pairs into the pairs; return their number. Without room it only counts."""
    if count > pair.shape[0]:
        return count + found
    _sort(fresh, found, tally)
    return _merge(pair, axis, _have_witnesses(kind), count, fresh, found)
