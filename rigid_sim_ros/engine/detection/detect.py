# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Detection: from the state to the manifolds of all shapes that are near each other.

Poses, bounding boxes, pairs of boxes that overlap, and for each pair its manifold. Whatever is
kept from the step before saves time only, with one exception that is part of the manifolds: a
manifold of polyhedra that hardly moved relative to each other keeps its points, and only their
gaps are found anew.
"""

from typing import Any, NamedTuple, Protocol

from rigid_sim_ros.engine.detection.broad_phase import mark_moved, near_pairs
from rigid_sim_ros.engine.detection.manifolds import (
    CONTACTS, current, earlier, Manifolds, Memory, NO_SEARCH, PAIRS, PAIRS_LISTED, RECYCLED,
    Scratch, SHORT_ROWS, turn_page_back, WITNESSED)
from rigid_sim_ros.engine.detection.pair_list import (
    find_pairs, look_for_share, note_moved, take_shares)
from rigid_sim_ros.engine.detection.pair_manifold import (
    ALL_SEAMS, AS_BEFORE, find_manifold, key_of, search, SearchArguments, seek, UNKNOWN)
from rigid_sim_ros.engine.detection.seams import find_seams, mend_seams
from rigid_sim_ros.engine.detection.thrown_rows import find_thrown
from rigid_sim_ros.engine.detection.transform_update import (
    next_placed, note_settled, place_bodies, place_shapes, write_aabbs)
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.kernel import INDEX, kernel, part
from rigid_sim_ros.kernels.separate import address_of, by_address

# What a thread counts besides what is in `Memory.counters`: pairs left out for want of `search`,
# and manifolds.
UNSEARCHED, ROWS = 6, 7
# The stages: everything but seams; what moved; the partners of what moved, by the first thread and
# by the second, and taken in; the manifolds, by the first thread and by the second, and by one
# thread alone; those of what is thrown again; and, once all are there, their seams.
(WHOLE, NOTE, LOOK_FIRST, LOOK_SECOND, TAKE, FIND_FIRST, FIND_SECOND, ALL, THROWN,
 SEAMS) = range(10)


class Share(NamedTuple):
    """
    What one thread looks through, and where it writes.

    Backwards it goes from the last pair to the first, and its rows end before `row`.
    """

    first: int  # of the pairs
    last: int  # and the one after
    row: int  # the first row to write
    room: int  # how many rows it may write, at least one; the last is for what comes after it too
    old: int  # the rows of the last step that are of these pairs begin here, or end before
    backwards: int  # 0 or 1


class DetectionArguments(SearchArguments, Protocol):
    """What the separate pieces of detection read of the arguments of a step."""

    @property
    def model(self) -> Model:
        """Return the masses."""

    @property
    def state(self) -> State:
        """Return the positions."""


@part
def get_share(memory: Memory, thread: int) -> Share:
    """Return what a thread was given."""
    of = memory.ranges[thread]
    return Share(of[0], of[1], of[2], of[3], of[4], of[5])


@part
def set_share(memory: Memory, thread: int, share: Share) -> None:
    """Give a thread its share."""
    for k, value in enumerate(share):
        memory.ranges[thread, k] = value


@kernel
def detect(model: Model, state: State, shapes: Shapes, memory: Memory, margin: float) -> bool:
    """
    Find the manifolds of all pairs with a gap below the margin [m].

    `current(memory)` then returns them; impulses of the last step are carried over, pair by pair
    and feature by feature. Returns False when a buffer is too small: all that is carried over from
    the last step is then untouched, and the caller detects again with `grown(memory)`.
    """
    memory.margin[:] = memory.rest_margin[:] = 0.5 * margin
    return detect_within_margins(model, state, shapes, memory, None)


@kernel
def detect_within_margins(model: Model, state: State, shapes: Shapes, memory: Memory,
                          c: Any) -> bool:
    """
    Find manifolds with margins that differ: of a pair the sum of two of `memory.margin`.

    What it exceeds that of `memory.rest_margin` by is how far the pair may move in the step. `c`
    are the arguments of the step, by which `search` is called, which may not be compiled yet; what
    has none, and None here, calls `search_pair`. Where one was needed that is not there the
    counter NO_SEARCH is 1 and the result False, as where a buffer is too small.
    """
    return (find_within_margins(model, state, shapes, memory, c)
            and settle_seams(shapes, memory, c))


@kernel
def find_within_margins(model: Model, state: State, shapes: Shapes, memory: Memory,
                        c: Any) -> bool:
    """Do the same, but leave the seams as they are: what is thrown may yet be found again."""
    memory.left[1, 0] = 0
    place_some(state, shapes, memory, 0, (0, shapes.kind.shape[0]), (0, state.x.shape[1]))
    return find_pairs(model, state, shapes, memory) and find_all_manifolds(
        state, shapes, memory, c)


@kernel
def place_some(state: State, shapes: Shapes, memory: Memory, half: int, some: tuple[int, int],
               bodies: tuple[int, int]) -> None:
    """Find where `some` shapes are, of these bodies, and which of them left their fat boxes."""
    anew, left, last = memory.pair_count[0] < 0, 0, some[1]
    note_settled(state, shapes, memory.margin, anew, memory.settled, memory.grid.moved, some[0],
                 last)
    place_bodies(state, shapes.turning, memory.turn, bodies[0], bodies[1])
    begin, end = next_placed(shapes, memory.settled, some[0], last)
    while begin < last:
        place_shapes(state, shapes, memory.turn, memory.pose, begin, end)
        write_aabbs(shapes.kind, shapes.size, memory.pose, memory.margin, memory.box, begin, end)
        left += mark_moved(shapes.kind, memory.pose, memory.box, anew, memory.grid, begin, end)
        begin, end = next_placed(shapes, memory.settled, end, last)
    memory.left[half, 0] = left


@kernel
def detect_stage(stage: int, model: Model, state: State, shapes: Shapes, memory: Memory,
                 c: Any) -> bool:
    """Detect within margins, or take a stage of that for one thread or for each."""
    if stage == WHOLE:
        return find_within_margins(model, state, shapes, memory, c)
    if stage == THROWN:
        return find_thrown(model, state, shapes, memory, c.work.thrown, c)
    if stage == ALL:
        return find_all_manifolds(state, shapes, memory, c)
    if stage == TAKE:
        return take_shares(model, shapes, memory)
    if stage == SEAMS:
        return settle_seams(shapes, memory, c)
    if stage == NOTE:
        note_moved(shapes, memory)
    elif stage in (LOOK_FIRST, LOOK_SECOND):
        look_for_share(model, shapes, memory, 0 if stage == LOOK_FIRST else 1)
    else:
        find_share(state, shapes, memory, 0 if stage == FIND_FIRST else 1, c)
    return True


@by_address
def detect_part(c: DetectionArguments, stage: int) -> int:
    """Do a stage of detection, see `detect_stage`; return 1 if all was there for it, else 0."""
    return int(detect_stage(stage, c.model, c.state, c.shapes, c.memory, c))


@kernel
def find_all_manifolds(state: State, shapes: Shapes, memory: Memory, c: Any) -> bool:
    """Find the manifolds of all pairs, and turn the page; return whether all was there for it."""
    before = current(memory)
    everything = Share(0, memory.pair_count[0], 0, before.shape_a.shape[0], before.count[1], 0)
    set_share(memory, 0, everything)
    find_share(state, shapes, memory, 0, c)
    memory.shares[1, :], memory.touching[1, :] = 0, 0
    memory.split[0] = memory.shares[0, ROWS] // 2
    return turn_page(memory, 0, memory.shares[0, ROWS])


@kernel
def settle_seams(shapes: Shapes, memory: Memory, c: Any) -> bool:
    """
    Take off the latest manifolds what is none beside other shapes; see seams.py.

    False where `search` was needed and is not there yet: the page is then turned back.
    """
    if not find_seams(shapes, memory):
        return True
    if c is None:
        mend_seams(shapes, memory, memory.scratch)
        return True
    if address_of(search, c) == 0:
        memory.counters[NO_SEARCH] = 1
        turn_page_back(memory)
        return False
    search(c, ALL_SEAMS)
    return True


@kernel
def find_share(state: State, shapes: Shapes, memory: Memory, thread: int, c: Any) -> None:
    """Find the manifolds of the pairs that one of two threads was given."""
    now, before, share = earlier(memory), current(memory), get_share(memory, thread)
    if thread == 0:
        find_manifolds(state, shapes, memory, memory.scratch, memory.near[0], now, before, share,
                       memory.touching[0], memory.shares[0], 0, c)
    else:
        find_manifolds(state, shapes, memory, memory.other_scratch, memory.near[1], now, before,
                       share, memory.touching[1], memory.shares[1], 1, c)


@kernel
def turn_page(memory: Memory, first: int, rows: int) -> bool:
    """Let the rows that were found be the current manifolds, if all are there and had room."""
    now = earlier(memory)
    if memory.shares[0, UNSEARCHED] + memory.shares[1, UNSEARCHED] > 0:
        memory.counters[NO_SEARCH] = 1
        return False
    # The last row stays free: what comes after a full page was tried out in it.
    if rows >= now.shape_a.shape[0]:
        memory.counters[SHORT_ROWS] = rows + 1
        return False
    for k in (PAIRS, WITNESSED, RECYCLED, CONTACTS):
        memory.counters[k] = memory.shares[0, k] + memory.shares[1, k]
    now.count[0], now.count[1] = rows, first
    memory.page[0] = 1 - memory.page[0]
    return True


@kernel
def find_manifolds(state: State, shapes: Shapes, memory: Memory, scratch: Scratch,
                   listing: IntArray, now: Manifolds, before: Manifolds, share: Share,
                   touching: IntArray, found_so: IntArray, thread: int, c: Any) -> None:
    """
    Go through the pairs and through the last step's rows, both sorted, side by side.

    Backwards a row is found by the place after it, so that every place is 0 or more. Which of the
    pairs are near is listed first, some pairs at a time, in `listing` (PAIRS_LISTED,).
    touching (n,) becomes 1 for the bodies of what is found, and 0 for others; found_so (8,) what
    `turn_page` counts, and in ROWS how many rows would have been needed.
    """
    back, step = share.backwards, 1 - 2 * share.backwards
    old_at, old_end = share.old, before.count[1] + (0 if back == 1 else before.count[0])
    rows, near, settled, recycled, contacts, left_out = 0, 0, 0, 0, 0, 0
    left, at, end, last = share.last - share.first, 0, 0, share.row + step * (share.room - 1)
    place = share.row
    touching[:] = 0
    while left > 0 or at != end:
        if at == end:
            some = min(left, PAIRS_LISTED)
            first = share.first + left - some if back == 1 else share.last - left
            listed = near_pairs(shapes.kind, memory.pair, memory.box, first,
                                first + some, listing)
            at, end = (listed, 0) if back == 1 else (0, listed)
            left, near = left - some, near + listed
            continue
        k = listing[(at - back) & INDEX] & INDEX
        at += step
        a, b = memory.pair[k, 0] & INDEX, memory.pair[k, 1] & INDEX
        old_at = seek(before, old_at, old_end, back, key_of(a, b))
        old = (old_at - back) & INDEX
        known = old_at != old_end and before.shape_a[old] == a and before.shape_b[old] == b
        row = (place - back) & INDEX
        count, kept = find_manifold(state, shapes, memory, scratch, now, before, row,
                                    old if known else -1, k, thread, c)
        recycled += kept
        settled += 1 if count == AS_BEFORE else 0
        left_out += 1 if count == UNKNOWN else 0
        if count <= 0:
            continue
        i, j = now.body_a[row] & INDEX, now.body_b[row] & INDEX
        touching[i] = touching[j] = 1
        contacts += count
        rows += 1
        if place != last:
            place += step
    found_so[PAIRS], found_so[WITNESSED] = near, settled
    found_so[RECYCLED], found_so[CONTACTS] = recycled, contacts
    found_so[ROWS], found_so[UNSEARCHED] = rows, left_out
