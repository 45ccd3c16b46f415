# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Pairs of shapes whose spheres meet: a broad phase of its own, for a few shapes at any time.

The spheres are those around the shapes, larger by what the caller adds for their motion. Those of
shapes that move are sorted along x and swept, those of the others are looked up among them, so
that a large ground costs little.
"""

from rigid_sim_ros.engine.detection.broad_phase import may_collide
from rigid_sim_ros.engine.maths.algebra import norm
from rigid_sim_ros.engine.model.kinds.table import is_unbounded
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def pairs_near(model: Model, shapes: Shapes, pose: Array, radius: Array, low: Array,
               order: IntArray, pairs: IntArray) -> int:
    """Write the pairs of shapes whose spheres of given radii [m] meet; low, order are scratch."""
    count, movers, widest, found = shapes.body.shape[0], 0, 0.0, 0
    for s in range(count):
        low[s] = pose[s, 0] - radius[s]
        if shapes.still[s] == 0:
            at = movers
            while at > 0 and low[order[at - 1]] > low[s]:
                order[at] = order[at - 1]
                at -= 1
            order[at] = s
            movers, widest = movers + 1, max(widest, 2.0 * radius[s])
    for s in range(count):
        # Of what moves, all that may reach back to the lower end begin after this.
        first = (_first_from(low, order, movers, low[s] - widest) if shapes.still[s] == 1
                 else movers)
        for j in range(first, movers):
            if low[order[j]] > pose[s, 0] + radius[s]:
                break
            found = _add_near(model, shapes, pose, radius, s, order[j], found, pairs)
    for i in range(movers):
        s = order[i]
        for j in range(i + 1, movers):
            if low[order[j]] > pose[s, 0] + radius[s]:
                break
            found = _add_near(model, shapes, pose, radius, s, order[j], found, pairs)
    if found <= pairs.shape[0]:
        _sort(pairs, found)
    return found


@kernel
def _first_from(low: Array, order: IntArray, count: int, x: float) -> int:
    """Return the first place in `order`, sorted by `low`, whose lower end is at least x [m]."""
    first, last = 0, count
    while first < last:
        middle = (first + last) // 2
        if low[order[middle]] < x:
            first = middle + 1
        else:
            last = middle
    return first


@kernel
def _add_near(model: Model, shapes: Shapes, pose: Array, radius: Array, s: int, other: int,
              found: int, pairs: IntArray) -> int:
    """Add a pair that may meet, if there is room; return how many there are."""
    a, b = min(s, other), max(s, other)
    if not (near(shapes, pose, radius, a, b) and may_collide(shapes, model.m.shape[0], a, b)):
        return found
    if found < pairs.shape[0]:
        pairs[found, 0], pairs[found, 1] = a, b
    return found + 1


@kernel
def _sort(pairs: IntArray, count: int) -> None:
    """Sort rows by their first, then their second number, by insertion."""
    for k in range(1, count):
        a, b = pairs[k, 0], pairs[k, 1]
        at = k
        while at > 0 and (pairs[at - 1, 0] > a or (pairs[at - 1, 0] == a and pairs[at - 1,
                                                                                   1] > b)):
            pairs[at, 0], pairs[at, 1] = pairs[at - 1, 0], pairs[at - 1, 1]
            at -= 1
        pairs[at, 0], pairs[at, 1] = a, b


@kernel
def near(shapes: Shapes, pose: Array, radius: Array, a: int, b: int) -> bool:
    """Return whether the spheres around two shapes, or a sphere and a half space, may meet."""
    return _near(shapes, pose, radius, a, b) and _near(shapes, pose, radius, b, a)


@kernel
def _near(shapes: Shapes, pose: Array, radius: Array, a: int, b: int) -> bool:
    """Return whether the sphere around b may reach the sphere or the half space of a."""
    d = (pose[b, 0] - pose[a, 0], pose[b, 1] - pose[a, 1], pose[b, 2] - pose[a, 2])
    if is_unbounded(shapes.kind[a]):
        return d[0] * pose[a, 5] + d[1] * pose[a, 8] + d[2] * pose[a, 11] <= radius[b]
    return norm(d) <= radius[a] + radius[b]
