# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Compare ways to find the pairs of bodies that may touch: `python benchmarks/broad_phase.py`.

The grid of the engine against a dynamic tree of bounding boxes and against sort and sweep, for
spheres at rest in a heap, moving, and of very different sizes. Each is given the same bounding
boxes at every step and keeps what it likes from step to step; all must find as many pairs of
overlapping boxes. Medians over steps of the time of the processor, one thread.

The tree is that of Box2D (E. Catto, Dynamic Bounding Volume Hierarchies, GDC 2019): leaves are put
where they enlarge the surfaces least, and rotations keep it balanced. It has the fat boxes of the
grid. Sort and sweep keeps the bodies sorted along the axis in which they are spread out most by
insertion (Baraff, 1992), has no fat boxes, and need not bring its pairs into an order.
"""

import argparse
from collections.abc import Iterator
from itertools import pairwise
import math
import os
import platform
from statistics import median
import time
from typing import NamedTuple

from numba import njit
import numpy as np

from rigid_sim_ros.engine.detection.broad_phase import balls_overlap, mark_moved, refresh
from rigid_sim_ros.engine.detection.grid import boxes_overlap, fill_grid
from rigid_sim_ros.engine.detection.manifolds import empty_memory
from rigid_sim_ros.engine.detection.pair_list import forget_parted, update_pairs
from rigid_sim_ros.engine.dynamics.forces import WIDTH
from rigid_sim_ros.engine.model.kinds.sphere import sphere
from rigid_sim_ros.engine.model.kinds.table import SPHERE
from rigid_sim_ros.engine.model.model import Body, build_model, ForceTable
from rigid_sim_ros.engine.model.shapes import build_shapes, Shape

H = 1 / 240
COUNTS = (100, 300, 1000, 3000, 10_000, 30_000)
NONE = -1
BITS = 20  # a pair of the tree is one number, a 2^BITS + b
LOW = (1 << BITS) - 1


class Spheres(NamedTuple):
    """What moves: all structures see the same."""

    x: np.ndarray  # (n, 3) [m]
    v: np.ndarray  # (n, 3) [m/s]
    radius: np.ndarray  # (n,) [m]


def heap(n: int) -> Spheres:
    """Return balls that touch in a block, and tremble as a solver lets them."""
    rng, side = np.random.default_rng(0), math.ceil(n ** (1 / 3))
    grid = np.array([(i % side, i // side % side, i // side ** 2) for i in range(n)])
    x = 0.2 * grid + rng.uniform(-0.005, 0.005, (n, 3))
    return Spheres(x, rng.normal(0, 1e-4, (n, 3)), np.full(n, 0.1))


def moving(n: int) -> Spheres:
    """Return the same balls at a metre a second, in all directions."""
    return heap(n)._replace(v=np.random.default_rng(1).normal(0, 1.0, (n, 3)))


def of_all_sizes(n: int) -> Spheres:
    """Return balls of 1 cm to 1 m radius, most of them small, as dense as gravel."""
    rng = np.random.default_rng(2)
    # As many per octave of volume would put all volume into the largest; this has them per size.
    radius = 0.01 * 100.0 ** (rng.uniform(0, 1, n) ** 3)
    side = (2.0 * (4 / 3 * math.pi * radius ** 3).sum()) ** (1 / 3)
    return Spheres(rng.uniform(0, side, (n, 3)), rng.normal(0, 0.5, (n, 3)), radius)


CASES = {'heap at rest': heap, 'moving': moving, 'sizes 1 to 100': of_all_sizes}


@njit(cache=True)
def _move(x, v, radius, step, box):
    """Move the spheres to and fro, so that they stay as dense, and write their boxes."""
    sign = 1.0 if step // 60 % 2 == 0 else -1.0
    for s in range(x.shape[0]):
        for k in range(3):
            x[s, k] += sign * H * v[s, k]
            box[s, k], box[s, 3 + k] = x[s, k] - radius[s], x[s, k] + radius[s]


# --- the grid of the engine -------------------------------------------------------------------

@njit(cache=True)
def _count(box, pair, count):
    found = 0
    for k in range(count):
        a, b = pair[k, 0], pair[k, 1]
        found += boxes_overlap(box, a, b) and balls_overlap(box, a, b)
    return found


class Grid:
    """The broad phase as detection calls it."""

    def __init__(self, spheres: Spheres) -> None:
        """Describe the spheres as the engine does."""
        n = len(spheres.radius)
        none = np.zeros(0, dtype=np.int64)
        bodies = [Body(sphere(1.0, 0.1), False)] * n
        self.model = build_model(bodies, [], ForceTable(none, none, none, np.zeros((0, WIDTH))), H,
                                 (0.0, 0.0, 0.0))
        self.shapes = build_shapes(self.model, [Shape(i, SPHERE, (r, 0.0, 0.0))
                                                for i, r in enumerate(spheres.radius.tolist())])
        self.memory = empty_memory(n, n, 64 * n)
        self.P = np.ascontiguousarray(spheres.v.T)
        self.memory.pair_count[0] = -1

    def _renew(self, box: np.ndarray, all_of_them: bool) -> int:
        kind, m = self.shapes.kind, self.memory
        if not mark_moved(kind, m.pose, box, all_of_them, m.grid, 0, len(kind)):
            return 0
        return int(refresh(self.shapes, m.pose, box, self.model.inv_m, self.P, H, all_of_them,
                           m.grid, 0, len(kind)))

    def find(self, box: np.ndarray) -> int:
        """Return the number of pairs that are near each other."""
        m, count = self.memory, int(self.memory.pair_count[0])
        left = self._renew(box, count < 0)
        if count >= 0:
            forget_parted(self.shapes.kind, self.shapes.size, m.grid.fat, m.margin, left, m.pair,
                          m.axis, m.pair_count)
        if left:
            fill_grid(m.grid)
            m.pair_count[0] = update_pairs(
                self.shapes, m.grid, m.fresh, m.pair, m.axis, max(m.pair_count[0], 0),
                len(self.model.m), m.margin, m.near[0])
            assert m.pair_count[0] <= len(m.pair)
        return int(_count(box, m.pair, m.pair_count[0]))


# --- a dynamic tree ---------------------------------------------------------------------------
# Leaves are the nodes 0 .. n - 1. A row of `link` is parent, left, right, height.

@njit(cache=True)
def _area(a, i, b, j):
    """Return half the surface of what holds both boxes."""
    x = max(a[i, 3], b[j, 3]) - min(a[i, 0], b[j, 0])
    y = max(a[i, 4], b[j, 4]) - min(a[i, 1], b[j, 1])
    z = max(a[i, 5], b[j, 5]) - min(a[i, 2], b[j, 2])
    return x * y + y * z + z * x


@njit(cache=True)
def _fit(node, link, i):
    left, right = link[i, 1], link[i, 2]
    for k in range(3):
        node[i, k] = min(node[left, k], node[right, k])
        node[i, 3 + k] = max(node[left, 3 + k], node[right, 3 + k])
    link[i, 3] = 1 + max(link[left, 3], link[right, 3])


@njit(cache=True)
def _replace_child(link, root, parent, old, new):
    if parent == NONE:
        root[0] = new
    elif link[parent, 1] == old:
        link[parent, 1] = new
    else:
        link[parent, 2] = new


@njit(cache=True)
def _lift(node, link, root, i):
    """Rotate a child up that is deeper than its sibling by two; return who stands in i's place."""
    if link[i, 3] < 2:
        return i
    deeper = link[link[i, 2], 3] - link[link[i, 1], 3]
    if -1 <= deeper <= 1:
        return i
    side = 2 if deeper > 1 else 1
    up = link[i, side]
    first, second = link[up, 1], link[up, 2]
    if link[first, 3] < link[second, 3]:
        first, second = second, first
    # `up` takes the place of i and keeps its deeper child; i gets the other one.
    link[up, 0] = link[i, 0]
    _replace_child(link, root, link[i, 0], i, up)
    link[i, 0], link[up, 1], link[up, 2] = up, i, first
    link[i, side], link[second, 0] = second, i
    _fit(node, link, i)
    _fit(node, link, up)
    return up


@njit(cache=True)
def _mend(node, link, root, i):
    while i != NONE:
        i = _lift(node, link, root, i)
        _fit(node, link, i)
        i = link[i, 0]


@njit(cache=True)
def _insert(node, link, root, leaf, spare):
    """Put a leaf into the tree, with `spare` as its new parent."""
    if root[0] == NONE:
        root[0], link[leaf, 0] = leaf, NONE
        return
    i = root[0]
    while link[i, 3] > 0:
        together = _area(node, i, node, leaf)
        here, lower = 2.0 * together, 2.0 * (together - _area(node, i, node, i))
        best, to = here, NONE
        for side in (1, 2):
            child = link[i, side]
            cost = lower + _area(node, child, node, leaf)
            if link[child, 3] > 0:
                cost -= _area(node, child, node, child)
            if cost < best:
                best, to = cost, child
        if to == NONE:
            break
        i = to
    parent = link[i, 0]
    link[spare, 0], link[spare, 1], link[spare, 2] = parent, i, leaf
    _replace_child(link, root, parent, i, spare)
    link[i, 0], link[leaf, 0] = spare, spare
    _fit(node, link, spare)
    _mend(node, link, root, parent)


@njit(cache=True)
def _remove(node, link, root, leaf):
    """Take a leaf out of the tree; return the node that was its parent, or NONE."""
    parent = link[leaf, 0]
    if parent == NONE:
        root[0] = NONE
        return NONE
    sibling = link[parent, 1] if link[parent, 2] == leaf else link[parent, 2]
    above = link[parent, 0]
    link[sibling, 0] = above
    _replace_child(link, root, above, parent, sibling)
    _mend(node, link, root, above)
    return parent


@njit(cache=True)
def _ask(node, link, root, moved, s, fresh, found, stack):
    """Write the pairs of s; those of two that moved once only."""
    size = 1
    stack[0] = root[0]
    while size > 0:
        size -= 1
        i = stack[size]
        if not _overlap(node, i, s):
            continue
        if link[i, 3] == 0:
            if i != s and not (moved[i] == 1 and i < s):
                fresh[found] = min(i, s) << BITS | max(i, s)
                found += 1
        else:
            stack[size], stack[size + 1] = link[i, 1], link[i, 2]
            size += 2
    return found


@njit(cache=True)
def _overlap(node, i, j):
    """Return whether two nodes or boxes overlap."""
    return (node[i, 0] <= node[j, 3] and node[j, 0] <= node[i, 3]
            and node[i, 1] <= node[j, 4] and node[j, 1] <= node[i, 4]
            and node[i, 2] <= node[j, 5] and node[j, 2] <= node[i, 5])


@njit(cache=True)
def _update_tree(node, link, root, moved, fat, started, keys, count, fresh, stack, pair):
    """Put the moved leaves where they are now, and bring the sorted pairs up to date."""
    n = moved.shape[0]
    for s in range(n):
        if moved[s] == 1:
            spare = _remove(node, link, root, s) if started else n + s - 1
            node[s] = fat[s]
            _insert(node, link, root, s, spare)
    kept = 0
    for k in range(count):
        a, b = keys[k] >> BITS, keys[k] & LOW
        if moved[a] + moved[b] == 0:
            keys[kept] = keys[k]
            kept += 1
    # All pairs of those that moved are found again, so none has to be looked for in the list.
    found = 0
    for s in range(n):
        if moved[s] == 1:
            found = _ask(node, link, root, moved, s, fresh, found, stack)
    fresh[:found].sort()
    old, new, place = kept - 1, found - 1, kept + found - 1
    while new >= 0:
        if old >= 0 and keys[old] > fresh[new]:
            keys[place] = keys[old]
            old -= 1
        else:
            keys[place] = fresh[new]
            new -= 1
        place -= 1
    for k in range(kept + found):
        pair[k, 0], pair[k, 1] = keys[k] >> BITS, keys[k] & LOW
    return kept + found


class Tree(Grid):
    """A dynamic tree over the same fat boxes."""

    def __init__(self, spheres: Spheres) -> None:
        """Make room."""
        super().__init__(spheres)
        n = len(spheres.radius)
        self.node = np.zeros((2 * n, 6))
        self.link = np.zeros((2 * n, 4), dtype=np.int64)
        self.root = np.full(1, NONE)
        self.keys, self.fresh = np.zeros((2, 64 * n), dtype=np.int64)
        self.stack = np.zeros(256, dtype=np.int64)

    def find(self, box: np.ndarray) -> int:
        """Return the number of pairs that are near each other."""
        m, count = self.memory, int(self.memory.pair_count[0])
        left = self._renew(box, count < 0)
        if left:
            m.pair_count[0] = _update_tree(
                self.node, self.link, self.root, m.grid.moved, m.grid.fat, count >= 0, self.keys,
                max(count, 0), self.fresh, self.stack, m.pair)
        return int(_count(box, m.pair, m.pair_count[0]))


# --- sort and sweep ---------------------------------------------------------------------------

@njit(cache=True)
def _sweep(box, order, axis, first):
    n = order.shape[0]
    if first:
        order[:] = np.argsort(box[:, axis])
    for i in range(1, n):
        s, j = order[i], i
        while j > 0 and box[order[j - 1], axis] > box[s, axis]:
            order[j] = order[j - 1]
            j -= 1
        order[j] = s
    y, z = (axis + 1) % 3, (axis + 2) % 3
    found = 0
    for i in range(n):
        a = order[i]
        for j in range(i + 1, n):
            b = order[j]
            if box[b, axis] > box[a, 3 + axis]:
                break
            if (box[a, y] <= box[b, 3 + y] and box[b, y] <= box[a, 3 + y]
                    and box[a, z] <= box[b, 3 + z] and box[b, z] <= box[a, 3 + z]
                    and balls_overlap(box, a, b)):
                found += 1
    return found


class Sweep:
    """Sort along one axis, and compare neighbours."""

    def __init__(self, spheres: Spheres) -> None:
        """Choose the axis along which the spheres are spread out most."""
        self.axis = int(spheres.x.var(axis=0).argmax())
        self.order = np.arange(len(spheres.x))
        self.first = True

    def find(self, box: np.ndarray) -> int:
        """Return the number of pairs that are near each other."""
        found = int(_sweep(box, self.order, self.axis, self.first))
        self.first = False
        return found


WAYS = {'grid': Grid, 'tree': Tree, 'sweep': Sweep}


def measure(spheres: Spheres, steps: int) -> Iterator[tuple[str, float, int]]:
    """Yield the way, the median seconds a step and the pairs at the end, for each way."""
    for name, make in WAYS.items():
        way, x, box = make(spheres), spheres.x.copy(), np.zeros((len(spheres.x), 6))
        times, found = [], 0
        for step in range(steps):
            _move(x, spheres.v, spheres.radius, step, box)
            start = time.thread_time()
            found = way.find(box)
            times.append(time.thread_time() - start)
        # The first step makes everything from nothing.
        yield name, median(times[1:]), found


def main() -> None:
    """Print a table for each case."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--most', type=int, default=COUNTS[-1], help='spheres at most')
    parser.add_argument('--steps', type=int, default=120, help='steps of each run')
    arguments = parser.parse_args()
    for spheres in (make(100) for make in CASES.values()):
        list(measure(spheres, 3))  # compiles
    print(f'{time.strftime("%Y-%m-%d")}, {platform.processor() or platform.machine()}, load '
          f'{os.getloadavg()[0]:.1f}, us a step, median of {arguments.steps - 1}')
    for case, make in CASES.items():
        print(f'\n| {case} | pairs | {" | ".join(WAYS)} |', '| ---: ' * (2 + len(WAYS)) + '|',
              sep='\n')
        rows: list[tuple[int, list[float]]] = []
        for n in [n for n in COUNTS if n <= arguments.most]:
            results = list(measure(make(n), arguments.steps))
            pairs = {found for _, _, found in results}
            assert len(pairs) == 1, f'{case}, {n} spheres: the ways disagree: {results}'
            rows.append((n, [seconds for _, seconds, _ in results]))
            print(f'| {n} | {pairs.pop()} | '
                  + ' | '.join(f'{1e6 * seconds:.0f}' for seconds in rows[-1][1]) + ' |',
                  flush=True)
        growth = [f'{_growth(rows, way):.2f}' for way in range(len(WAYS))]
        print(f'| growth | | {" | ".join(growth)} |')


def _growth(rows: list[tuple[int, list[float]]], way: int) -> float:
    """Return the exponent of n over the upper half of the counts."""
    upper = rows[len(rows) // 2 - 1:]
    slopes = [math.log(b[1][way] / a[1][way]) / math.log(b[0] / a[0]) for a, b in pairwise(upper)]
    return sum(slopes) / len(slopes)


if __name__ == '__main__':
    main()
