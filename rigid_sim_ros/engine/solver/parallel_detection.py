# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Detection by two threads; what it finds is what `detect_within_margins` finds.

Either places half of the shapes, and looks through those pairs that took half of the effort in
the last step. The first goes through its pairs from the last to the first, and writes its rows
from the middle of the page to its start; the second writes from there on. So the rows of both lie
side by side, however many each of them finds. Where the room was too small one thread begins anew.
"""

from rigid_sim_ros.engine.detection.detect import (
    ALL, detect_part, FIND_FIRST, FIND_SECOND, get_share, LOOK_FIRST, LOOK_SECOND, NOTE,
    place_some, ROWS, set_share, Share, TAKE, turn_page)
from rigid_sim_ros.engine.detection.manifolds import (
    current, first_row, Memory, PAIRS, REBUILT, RECYCLED, rows_in_use, WITNESSED)
from rigid_sim_ros.engine.detection.margins import set_margins
from rigid_sim_ros.engine.detection.pair_list import refresh_some
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.solver.arguments import Arguments
from rigid_sim_ros.engine.solver.partition import is_by_number, take_sides
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.kernel import INDEX, kernel, part
from rigid_sim_ros.kernels.second_core import side_by_side
from rigid_sim_ros.kernels.separate import address_of, by_address

# The stages that one thread alone does not have; two of them in halves.
SHARE_OUT, FIT, JOIN, PLACE_FIRST, PLACE_SECOND, REFRESH_FIRST, REFRESH_SECOND = range(7)
# What a manifold takes more than a pair that a witness settles.
_OF_RECYCLED, _OF_NEW = 2, 14


@part
def detect_in_parallel(c: Arguments) -> int:
    """Find manifolds by two threads, not their seams; return 1 if all was there, else 0."""
    memory, job = c.memory, c.job
    alone, shared = address_of(detect_part, c), address_of(share_part, c)
    side_by_side(job, shared, c, PLACE_FIRST, PLACE_SECOND)
    if memory.left[0, 0] + memory.left[1, 0] > 0:
        side_by_side(job, shared, c, REFRESH_FIRST, REFRESH_SECOND)
    detect_part(c, NOTE)
    if memory.counters[REBUILT] > 0:
        side_by_side(job, alone, c, LOOK_FIRST, LOOK_SECOND)
        if detect_part(c, TAKE) == 0:
            return 0
    share_part(c, SHARE_OUT)
    side_by_side(job, alone, c, FIND_FIRST, FIND_SECOND)
    if share_part(c, FIT) == 0:
        return detect_part(c, ALL)
    return share_part(c, JOIN)


@by_address
def share_part(c: Arguments, stage: int) -> int:
    """Do a stage that one thread alone does not have; return 1 if there was room, else 0."""
    sides = c.work.solver.sides
    first = sides.middle[0], sides.middle[1]
    if stage in (PLACE_FIRST, PLACE_SECOND):
        some, bodies = in_half(0 if stage == PLACE_FIRST else 1, first, c.state, c.shapes)
        set_margins_and_sides(c, some, bodies)
    return int(share_stage(stage, c.model, c.state, c.shapes, c.memory, first,
                           is_by_number(sides.cut)))


@kernel
def set_margins_and_sides(c: Arguments, shapes: tuple[int, int], bodies: tuple[int, int]) -> None:
    """Set the margins of some shapes, and find on which side of the cut some bodies are."""
    model, state = c.model, c.state
    take_sides_of(c, bodies)
    set_margins(model, model.h, state, c.settings.margin, c.work.radius, c.work.thickness,
                c.shapes, c.memory, shapes[0], shapes[1])


@kernel
def take_sides_of(c: Arguments, bodies: tuple[int, int]) -> None:
    """Find on which side of the cut some bodies are."""
    solver = c.work.solver
    take_sides(c.model.inv_m, c.state.V, c.state.x, c.rest.asleep, bodies[0], bodies[1],
               solver.sides, solver.bodies.slot, solver.bodies.flies)


@kernel
def share_stage(stage: int, model: Model, state: State, shapes: Shapes, memory: Memory,
                first: tuple[int, int], by_number: bool) -> bool:
    """
    Do a stage; `first` are the first body of the second half, and its first shape.

    Pairs are shared out in these halves as well, `by_number`, where the solver has them; else by
    what they took in the last step.
    """
    half = 1 if stage in (PLACE_SECOND, REFRESH_SECOND) else 0
    some, bodies = in_half(half, first, state, shapes)
    if stage == SHARE_OUT:
        _share_out(memory, by_number, first[1])
    elif stage == FIT:
        return _fit(memory)
    elif stage == JOIN:
        return _join(memory)
    elif stage in (PLACE_FIRST, PLACE_SECOND):
        place_some(state, shapes, memory, half, some, bodies)
    else:
        refresh_some(model, state, shapes, memory, half, some)
    return True


@kernel
def in_half(half: int, first: tuple[int, int], state: State,
            shapes: Shapes) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the first shape of a half and the one after its last, and the same of bodies."""
    body, shape = first
    if half == 1:
        return (shape, shapes.kind.shape[0]), (body, state.x.shape[1])
    return (0, shape), (0, body)


@kernel
def _share_out(memory: Memory, by_number: bool, shape: int) -> None:
    """Give either thread its pairs, and room for what it finds."""
    before, pairs, room = current(memory), memory.pair_count[0], memory.pages[0].shape_a.shape[0]
    first, count = rows_in_use(before)
    split = first_row(before, shape) - first if by_number else min(memory.split[0], count)
    cut, old = pairs, first + split
    if by_number:
        cut = _first_pair(memory.pair, pairs, shape, 0)
    elif split < count:
        cut = _first_pair(memory.pair, pairs, before.shape_a[old], before.shape_b[old])
    # To each the same part of the room as of the rows, and one at least.
    middle = min(max(room * split // max(count, 1), 1), room - 1)
    set_share(memory, 0, Share(0, cut, middle, middle, old, 1))
    set_share(memory, 1, Share(cut, pairs, middle, room - middle, old, 0))


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
    return bool(memory.shares[0, ROWS] < get_share(memory, 0).room
                and memory.shares[1, ROWS] < get_share(memory, 1).room)


@kernel
def _join(memory: Memory) -> bool:
    """Turn the page to the rows of both threads, which lie side by side."""
    found, more = memory.shares[0, ROWS], memory.shares[1, ROWS]
    memory.split[0] = _fair_split(memory.shares[0], memory.shares[1])
    return turn_page(memory, get_share(memory, 0).row - found, found + more)


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
