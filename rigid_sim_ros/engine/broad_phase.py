# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which pairs of shapes may touch: those whose fat boxes overlap.

A fat box is a bounding box with room to move in. While a shape stays inside of its fat box nothing
has to be done for it. Those that left theirs are looked up in a hierarchical grid: level k has
cells of 2^(k/2) m, and a shape lies on the first level whose cells are as large as its fat box, in
the cell of its middle. So few cells have to be visited on any level, and shapes of very different
size do not disturb each other. Planes and the like are wide: everything is tried against them.

The pairs that come out are sorted, and a superset of those whose bounding boxes overlap; who goes
through them tests the bounding boxes first, so that no result depends on when a fat box was made.
"""

import math

from rigid_sim_ros.engine.arrays import Array, IntArray, Vector
from rigid_sim_ros.engine.kernel import apart, INDEX, kernel, part
from rigid_sim_ros.engine.manifolds import LEVELS, NEAR
from rigid_sim_ros.engine.shapes import PLANE, Shapes, SPHERE

# Room around a bounding box, as a fraction of its largest side. A smaller one makes shapes leave
# their box more often, a larger one makes more pairs that do not touch.
ROOM = 0.1
# A fat box reaches as far ahead as the shape flies in so many steps, but no farther than its own
# size.
STEPS_AHEAD = 16.0
# Less room than that, and a shape gets a new box along with the others.
_USED = 0.05
# Pairs that have parted are forgotten after so many steps, or once there are an eighth more pairs.
_UNTIL_FORGOTTEN, _MANY_PARTED = 64, 8
WIDE = 1 << 20  # the level of what is too large for any cell
_LOWEST = -80  # the level of the smallest cells
_SQRT_HALF = math.sqrt(0.5)


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
    return ((box[a, 0] <= box[b, 3]) & (box[b, 0] <= box[a, 3])
            & (box[a, 1] <= box[b, 4]) & (box[b, 1] <= box[a, 4])
            & (box[a, 2] <= box[b, 5]) & (box[b, 2] <= box[a, 5]))


@kernel
def near_pairs(pair: IntArray, box: Array, first: int, last: int, near: IntArray) -> int:
    """
    List the pairs from `first` to `last` whose boxes overlap; return how many these are.

    Nothing here is a branch: the processor could only guess, and be wrong every third time.
    """
    count = 0
    for k in range(first, last):
        near[count] = k
        count += 1 if boxes_overlap(box, pair[k, 0] & INDEX, pair[k, 1] & INDEX) else 0
    return count


@kernel
def refresh(kind: IntArray, body: IntArray, pose: Array, box: Array, inv_m: Array, P: Array,
            h: float, all_of_them: bool, fat: Array, moved: IntArray) -> int:
    """
    Give the shapes that left their fat box a new one, mark them, and return their number.

    As soon as one did, so are those that are about to: to look up many costs little more than to
    look up one.
    """
    count = 0
    for s in range(kind.shape[0]):
        moved[s] = 0
        if all_of_them or not _fits(kind, pose, box, fat, s, 0.0):
            moved[s] = 1
            count += 1
    if count == 0:
        return 0
    for s in range(kind.shape[0]):
        if moved[s] == 0 and not _fits(kind, pose, box, fat, s, _USED):
            moved[s] = 1
            count += 1
        if moved[s] == 1:
            _fatten(kind, pose, box, h * inv_m[body[s] & INDEX], P, body[s] & INDEX, fat, s)
    return count


@part
def _fits(kind: IntArray, pose: Array, box: Array, fat: Array, s: int, room: float) -> bool:
    """Return whether a fat box has room around a shape, as a fraction of its largest side."""
    if kind[s] == PLANE:
        n, offset = _plane(pose, s)
        return fat[s, 0] == n[0] and fat[s, 1] == n[1] and fat[s, 2] == n[2] and (
            fat[s, 3] == offset)
    r = room * _side(box, s)
    return (fat[s, 0] + r <= box[s, 0] and box[s, 3] <= fat[s, 3] - r
            and fat[s, 1] + r <= box[s, 1] and box[s, 4] <= fat[s, 4] - r
            and fat[s, 2] + r <= box[s, 2] and box[s, 5] <= fat[s, 5] - r)


@part
def _fatten(kind: IntArray, pose: Array, box: Array, way: float, P: Array, i: int, fat: Array,
            s: int) -> None:
    """Make a fat box; `way` times P is how far body i flies in a step [m]."""
    if kind[s] == PLANE:
        n, offset = _plane(pose, s)
        fat[s, 0], fat[s, 1], fat[s, 2], fat[s, 3] = n[0], n[1], n[2], offset
        return
    side = _side(box, s)
    for k in range(3):
        ahead = min(max(STEPS_AHEAD * way * P[k, i], -side), side)
        fat[s, k] = box[s, k] - ROOM * side + min(ahead, 0.0)
        fat[s, 3 + k] = box[s, 3 + k] + ROOM * side + max(ahead, 0.0)


@part
def _side(box: Array, s: int) -> float:
    return max(box[s, 3] - box[s, 0], box[s, 4] - box[s, 1], box[s, 5] - box[s, 2])


@part
def _plane(pose: Array, s: int) -> tuple[Vector, float]:
    """Return the normal of a plane and how far it is from the origin along it [m]."""
    n = (pose[s, 5], pose[s, 8], pose[s, 11])
    return n, n[0] * pose[s, 0] + n[1] * pose[s, 1] + n[2] * pose[s, 2]


@kernel
def _fat_overlap(kind: IntArray, fat: Array, ahead: Array, a: int, b: int) -> bool:
    """Return whether fat boxes overlap; a plane takes up all below it and some above."""
    if kind[a] == PLANE or kind[b] == PLANE:
        p, s = (a, b) if kind[a] == PLANE else (b, a)
        lowest = -fat[p, 3]
        for k in range(3):
            n = fat[p, k]
            lowest += n * (fat[s, k] if n > 0.0 else fat[s, 3 + k])
        return lowest <= ahead[p]
    return boxes_overlap(fat, a, b)


@kernel
def _key(level: int, x: int, y: int) -> int:
    """
    Return the key of a column of cells; z more, its last bits are the bucket of a cell.

    So cells on top of each other have buckets side by side. Three large primes (Teschner et al.,
    Optimized Spatial Hashing, VMV 2003). Columns that share a key cost time only: who looks one up
    compares the cells themselves.
    """
    return x * 73856093 ^ y * 19349663 ^ level * 50331653


@kernel
def _inverse_size(level: int) -> float:
    """Return 1 / 2^(level / 2), the cells of a level to a metre."""
    half = level >> 1
    return math.ldexp(_SQRT_HALF if level & 1 else 1.0, -half)


@kernel
def _find_cell(fat: Array, cells: IntArray, s: int, bounded: bool) -> None:
    """Write level, cell and key of a shape."""
    level, key = WIDE, 0
    if bounded:
        side = max(fat[s, 3] - fat[s, 0], fat[s, 4] - fat[s, 1], fat[s, 5] - fat[s, 2])
        if side < math.inf:
            # side = m 2^e with m < 1.
            m, e = math.frexp(side)
            level = max(2 * e - (1 if m <= _SQRT_HALF else 0), _LOWEST)
        if level < LEVELS + _LOWEST:
            inverse = _inverse_size(level)
            for k in range(3):
                cells[s, 1 + k] = math.floor(0.5 * (fat[s, k] + fat[s, 3 + k]) * inverse)
            key = _key(level, cells[s, 1], cells[s, 2])
        else:
            level = WIDE
    cells[s, 0], cells[s, 4] = level, key


@kernel
def fill_grid(kind: IntArray, fat: Array, moved: IntArray, cells: IntArray, buckets: IntArray,
              members: IntArray, keys: IntArray, tally: IntArray, levels: IntArray) -> None:
    """Sort the shapes by the bucket of their cell: count, add up, distribute."""
    t = buckets.shape[0] - 2
    buckets[:] = 0
    levels[:] = 0
    for s in range(kind.shape[0]):
        if moved[s] == 1:
            _find_cell(fat, cells, s, kind[s] != PLANE)
        level = cells[s, 0]
        bucket = t if level == WIDE else (cells[s, 4] + cells[s, 3]) & (t - 1)
        if level != WIDE:
            levels[level - _LOWEST] += 1
        tally[s] = bucket
        buckets[(bucket + 1) & INDEX] += 1
    for k in range(t + 1):
        buckets[k + 1] += buckets[k]
    # Backwards, so that the shapes of a bucket end up in order, with its start in place.
    for s in range(kind.shape[0] - 1, -1, -1):
        bucket = (tally[s] + 1) & INDEX
        buckets[bucket] -= 1
        members[buckets[bucket] & INDEX] = s
        keys[buckets[bucket] & INDEX] = cells[s, 4]
    for k in range(t + 1):
        buckets[k] = buckets[k + 1]
    buckets[t + 1] = kind.shape[0]


@kernel
def _levels_in_use(levels: IntArray) -> tuple[int, int]:
    """Return the lowest and the highest level with shapes; with none, a higher and a lower one."""
    lowest, highest = LEVELS, -1
    for k in range(LEVELS):
        if levels[k] > 0:
            lowest, highest = min(lowest, k), k
    return lowest + _LOWEST, highest + _LOWEST


@kernel
def _offer(shapes: Shapes, fat: Array, moved: IntArray, fresh: IntArray, side: int, bodies: int,
           ahead: Array, count: int, s: int, other: int) -> int:
    """Note a pair if its fat boxes overlap and the filters let it; return the number of pairs."""
    # Two that both moved find each other twice.
    if other == s or (moved[other] == 1 and other < s):
        return count
    if not _fat_overlap(shapes.kind, fat, ahead, s, other):
        return count
    a, b = min(s, other), max(s, other)
    if not may_collide(shapes, bodies, a, b):
        return count
    if count < fresh.shape[1]:
        fresh[side, count, 0] = a
        fresh[side, count, 1] = b
    return count + 1


@kernel
def _near_members(fat: Array, keys: IntArray, members: IntArray, key: int, s: int, first: int,
                  last: int, near: IntArray) -> int:
    """
    List those members of a column whose fat boxes overlap that of shape s; return their number.

    Without a branch, as in `near_pairs`.
    """
    count = 0
    for k in range(first, last):
        other = members[k & INDEX] & INDEX
        near[count] = other
        count += 1 if (keys[k & INDEX] == key) & boxes_overlap(fat, s, other) else 0
    return count


@kernel
def _look_around(shapes: Shapes, fat: Array, moved: IntArray, cells: IntArray, buckets: IntArray,
                 members: IntArray, keys: IntArray, levels: IntArray, fresh: IntArray, side: int,
                 bodies: int, ahead: Array, near: IntArray, used: tuple[int, int],
                 count: int, s: int) -> int:
    """Find the partners of shape s, which moved; return the number of pairs so far."""
    t = buckets.shape[0] - 2
    if cells[s, 0] == WIDE:
        for other in range(shapes.kind.shape[0]):
            count = _offer(shapes, fat, moved, fresh, side, bodies, ahead, count, s, other)
        return count
    for k in range(buckets[t], buckets[t + 1]):
        count = _offer(shapes, fat, moved, fresh, side, bodies, ahead, count, s, members[k])
    for level in range(used[0], used[1] + 1):
        if levels[level - _LOWEST] == 0:
            continue
        inverse = _inverse_size(level)
        # The middle of a shape that reaches into the fat box lies at most half a cell outside.
        x0, x1 = math.floor(fat[s, 0] * inverse - 0.5), math.floor(fat[s, 3] * inverse + 0.5)
        y0, y1 = math.floor(fat[s, 1] * inverse - 0.5), math.floor(fat[s, 4] * inverse + 0.5)
        z0, z1 = math.floor(fat[s, 2] * inverse - 0.5), math.floor(fat[s, 5] * inverse + 0.5)
        visits = (float(x1 - x0) + 1.0) * (float(y1 - y0) + 1.0) * (float(z1 - z0) + 1.0)
        if visits > float(shapes.kind.shape[0]):
            for other in range(shapes.kind.shape[0]):
                if cells[other, 0] == level:
                    count = _offer(shapes, fat, moved, fresh, side, bodies, ahead, count, s,
                                   other)
            continue
        for x in range(x0, x1 + 1):
            for y in range(y0, y1 + 1):
                key = _key(level, x, y)
                first, last = (key + z0) & (t - 1), (key + z1) & (t - 1)
                # What lies beyond the last bucket is in the first ones.
                for begin, end in ((first, last), (0, -1)) if first <= last else (
                        (first, t - 1), (0, last)):
                    k, until = buckets[begin & INDEX], buckets[(end + 1) & INDEX]
                    while k < until:
                        some = min(k + NEAR, until)
                        for i in range(_near_members(fat, keys, members, key, s, k, some, near)):
                            other = near[i] & INDEX
                            if (cells[other, 1] == x and cells[other, 2] == y
                                    and cells[other, 0] == level):
                                count = _offer(shapes, fat, moved, fresh, side, bodies, ahead,
                                               count, s, other)
                        k = some
    return count


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
def forget_parted(kind: IntArray, fat: Array, ahead: Array, moved: int, pair: IntArray,
                  axis: Array, pair_count: IntArray) -> None:
    """
    Drop pairs whose fat boxes no longer overlap, when it is worth to go through all of them.

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
        if _fat_overlap(kind, fat, ahead, a, b):
            if kept < k:
                pair[kept, 0], pair[kept, 1] = a, b
                for i in range(4 if witnessed else 0):
                    axis[kept, i] = axis[k, i]
            kept += 1
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


@apart
def look_around(shapes: Shapes, fat: Array, moved: IntArray, cells: IntArray, buckets: IntArray,
                members: IntArray, keys: IntArray, levels: IntArray, fresh: IntArray,
                bodies: int, ahead: Array, near: IntArray, side: int, sides: int,
                begin: int) -> tuple[int, int]:
    """
    List the partners of what moved, from shape `begin` on, until there may be no room for more.

    Of two `sides`, 0 and 1, each looks around from every second one, and lists what it finds in
    fresh[side]. Returns the shape from which to go on, and the number of pairs.
    """
    found, most, turn = 0, shapes.kind.shape[0] - 1, 0  # partners of one shape, at most
    used = _levels_in_use(levels)
    for s in range(begin, shapes.kind.shape[0]):
        if moved[s] == 0:
            continue
        turn += 1
        if turn % sides != side:
            continue
        if found + most > fresh.shape[1]:
            return s, found
        found = _look_around(shapes, fat, moved, cells, buckets, members, keys, levels, fresh,
                             side, bodies, ahead, near, used, found, s)
    return shapes.kind.shape[0], found


@kernel
def update_pairs(shapes: Shapes, fat: Array, moved: IntArray, cells: IntArray, buckets: IntArray,
                 members: IntArray, keys: IntArray, tally: IntArray, levels: IntArray,
                 fresh: IntArray, pair: IntArray, axis: Array, count: int, bodies: int,
                 ahead: Array, near: IntArray) -> int:
    """
    Bring the pairs up to date after some shapes moved and the grid was filled.

    Returns their number. One above the capacity of `pair` means that there was no room, and the
    pairs are lost.
    """
    s = 0
    while s < shapes.kind.shape[0]:
        s, found = look_around(shapes, fat, moved, cells, buckets, members, keys, levels, fresh,
                               bodies, ahead, near, 0, 1, s)
        count = take_in(shapes.kind, fresh, found, tally, pair, axis, count)
    return count


@apart
def take_in(kind: IntArray, fresh: IntArray, found: int, tally: IntArray, pair: IntArray,
            axis: Array, count: int) -> int:
    """Sort the fresh pairs into the pairs; return their number. Without room it only counts."""
    if count > pair.shape[0]:
        return count + found
    _sort(fresh, found, tally)
    return _merge(pair, axis, _have_witnesses(kind), count, fresh, found)
