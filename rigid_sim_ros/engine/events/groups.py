# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Groups of bodies that may meet within a step, or pull at each other; each has events of its own.

What never touches moves as if the other were not there, to the last digit, only if nothing that
happens to the one cuts the way of the other: not its collisions, not the work that they take. So
each group goes through its own step, with its own times, forces and budgets.

Who may meet is found at the start of the step, from spheres around the shapes that are larger by
how far these may move in it. That is a guess: it knows of no impulses. Where a shape is about to
go farther, it may go twice that way, and if two groups may meet then, the step begins anew. What
stands still belongs to no group, as it carries nothing from one to the other.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.detection.motion_ahead import motion_bound, place_ahead
from rigid_sim_ros.engine.detection.sphere_pairs import near, pairs_near
from rigid_sim_ros.engine.detection.transform_update import is_at, keep_place
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.dynamics.kinematic import is_carried
from rigid_sim_ros.engine.maths.union_find import first_of, unite
from rigid_sim_ros.engine.model.model import Model, WORLD
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# How far shapes may move, as a multiple of what their speed and loads make of it at the start, and
# in parts of their size. More makes larger groups, less makes more steps begin anew.
FAR, SLACK = 2.0, 0.01
# A step that began anew so often goes on as one group.
MOST_TRIES = 8
# Why the rest of the step of a group goes on without backtracking: it had `max_events`; it used up
# its budget of work; no forces, or no impulses, stop all points of what is squeezed.
MANY_EVENTS, MUCH_WORK, NO_FORCES, NO_IMPULSES = 1, 2, 3, 4
# How the way of a group ends, in `Groups.met`: nothing met, a pair met, one sank in; or it does
# not begin, since its forces would do work.
NOTHING, MET, SANK, WORKS = -1, 0, 1, 2
# Of a step: no part in which forces stay constant is shorter, but for what events leave.
SHORTEST = 1.0 / 256.0


class Groups(NamedTuple):
    """Groups g of n bodies and s shapes with p pairs that may meet."""

    of: IntArray  # (n,) the group of a body, -1: it stands still
    first: IntArray  # (n + 1,) the bodies of g are body[first[g]] to body[first[g + 1] - 1]
    body: IntArray  # (n,)
    first_shape: IntArray  # (n + 1,)
    shape: IntArray  # (s,)
    first_pair: IntArray  # (n + 1,)
    pair: IntArray  # (p, 2) two shapes
    block: IntArray  # (n + 1,) the blocks of contacts of g are block[g] to block[g + 1] - 1
    left: Array  # (n,) [s] of the step
    span: Array  # (n,) [s] for which forces act
    way: Array  # (n,) [s] until the next event
    met: IntArray  # (n,) what ends its way: NOTHING, MET, SANK, WORKS
    effort: Array  # (n,) multiplications so far in this step, about
    residual: Array  # (n,) the largest in this step
    events: IntArray  # (n,)
    share: Array  # (n,) of the forces that were found, 1: all of them act
    short: IntArray  # (n,) why it goes on without backtracking, 0: it does not
    far: Array  # (s,) [m] how far a shape may move in this step
    moved: Array  # (s,) [m] how far it moved, at most
    radius: Array  # (s,) [m] of the spheres
    at: Array  # (n, 8) where the bodies were when the poses of their shapes were written
    scratch: Array  # (s,)
    order: IntArray  # (s,)
    root: IntArray  # (n,)


def make_groups(bodies: int, shapes: int, pairs: int) -> Groups:
    """Return room for so many bodies, shapes and pairs that may meet."""
    n, s = bodies, shapes

    def whole(*shape: int) -> IntArray:
        return np.zeros(shape, dtype=np.int64)

    return Groups(whole(n), whole(n + 1), whole(n), whole(n + 1), whole(s), whole(n + 1),
                  whole(pairs, 2), whole(n + 1), np.zeros(n), np.zeros(n), np.zeros(n), whole(n),
                  np.zeros(n), np.zeros(n), whole(n), np.zeros(n), whole(n), np.zeros(s),
                  np.zeros(s), np.zeros(s), np.full((n, 8), np.nan), np.zeros(s), whole(s),
                  whole(n))


@kernel
def reach_out(model: Model, state: State, loads: Loads, shapes: Shapes, margin: Array, tries: int,
              pose: Array, g: Groups) -> None:
    """Choose how far shapes may move in this step; `margin`, (s,) [m]: how far they are seen."""
    first = 0
    while first < shapes.kind.shape[0]:
        i, after = shapes.body[first], shapes.after[first]
        stands = not _moves(model, state, i)
        # Of what stands still the poses are those of the last step.
        placed = stands and is_at(state, i, 0.0, g.at)
        keep_place(state, i, 0.0, g.at)
        for s in range(first, after):
            far = 0.0
            if not placed:
                place_ahead(model, state, loads, shapes, s, 0.0, pose)
            if not stands:
                far = motion_bound(model, state, loads, shapes, s, model.h)
                if shapes.bound[s] < np.inf:
                    far = FAR * far + SLACK * shapes.bound[s]
            g.far[s] = far + margin[s] if tries == 0 else max(g.far[s], far + margin[s])
            if tries > MOST_TRIES:
                g.far[s] = np.inf
            g.moved[s] = 0.0
            g.radius[s] = shapes.bound[s] + g.far[s]
        first = after


@kernel
def _moves(model: Model, state: State, i: int) -> bool:
    return model.inv_m[i] > 0.0 or is_carried(state, i)


@kernel
def find_groups(model: Model, state: State, shapes: Shapes, pose: Array, pairs: IntArray,
                g: Groups) -> tuple[int, int]:
    """
    Find who may meet whom: return how many groups there are, and pairs of shapes.

    Where there are more pairs than the room in `pairs`, (p, 2), nothing useful was written.
    """
    found = pairs_near(model, shapes, pose, g.radius, g.scratch, g.order, pairs)
    if found > pairs.shape[0]:
        return 0, found
    n, table = model.m.shape[0], model.forces
    for i in range(n):
        g.root[i] = i
    for k in range(found):
        _join(model, state, g.root, shapes.body[pairs[k, 0]], shapes.body[pairs[k, 1]])
    for k in range(table.kind.shape[0]):
        a, b = table.frame_a[k], table.frame_b[k]
        if a != WORLD and b != WORLD:
            _join(model, state, g.root, model.frame_body[a], model.frame_body[b])
    count = 0
    for i in range(n):
        g.of[i] = -1
        if _moves(model, state, i):
            if g.root[i] == i:
                g.of[i] = count
                count += 1
            else:
                g.of[i] = g.of[first_of(g.root, i)]
    _list(g, count, shapes, pairs, found)
    return count, found


@kernel
def keep_groups(model: Model, state: State, loads: Loads, shapes: Shapes, count: int, pose: Array,
                pairs: IntArray, g: Groups) -> bool:
    """
    List the pairs that may meet in what is left of the step, if all are within one group.

    From where the shapes are now, which may go as far as `far` says less what they moved. `count`:
    of groups. Returns False if two groups may meet, or there is no room in `pairs`.
    """
    for s in range(shapes.kind.shape[0]):
        if g.of[shapes.body[s]] >= 0:
            place_ahead(model, state, loads, shapes, s, 0.0, pose)
        g.radius[s] = shapes.bound[s] + g.far[s] - g.moved[s]
    found = pairs_near(model, shapes, pose, g.radius, g.scratch, g.order, pairs)
    if found > pairs.shape[0]:
        return False
    for k in range(found):
        of_a, of_b = g.of[shapes.body[pairs[k, 0]]], g.of[shapes.body[pairs[k, 1]]]
        if of_a != of_b and min(of_a, of_b) >= 0:
            return False
    _list(g, count, shapes, pairs, found)
    return True


@kernel
def _join(model: Model, state: State, root: IntArray, a: int, b: int) -> None:
    """Let two bodies that move be of one set."""
    if _moves(model, state, a) and _moves(model, state, b):
        unite(root, a, b)


@kernel
def _list(g: Groups, count: int, shapes: Shapes, pairs: IntArray, found: int) -> None:
    """List bodies, shapes and pairs by their groups, in order."""
    n = g.of.shape[0]
    for first in (g.first, g.first_shape, g.first_pair):
        first[:] = 0
    for i in range(n):
        if g.of[i] >= 0:
            g.first[g.of[i] + 1] += 1
    for s in range(shapes.kind.shape[0]):
        if g.of[shapes.body[s]] >= 0:
            g.first_shape[g.of[shapes.body[s]] + 1] += 1
    for k in range(found):
        if _group_of(g, shapes, pairs, k) >= 0:
            g.first_pair[_group_of(g, shapes, pairs, k) + 1] += 1
    for first in (g.first, g.first_shape, g.first_pair):
        for k in range(count):
            first[k + 1] += first[k]
        # Where the next one of each group is put; moved back by one group below.
    for i in range(n):
        k = g.of[i]
        if k >= 0:
            g.body[g.first[k]] = i
            g.first[k] += 1
    for s in range(shapes.kind.shape[0]):
        k = g.of[shapes.body[s]]
        if k >= 0:
            g.shape[g.first_shape[k]] = s
            g.first_shape[k] += 1
    for p in range(found):
        k = _group_of(g, shapes, pairs, p)
        if k >= 0:
            g.pair[g.first_pair[k], 0], g.pair[g.first_pair[k], 1] = pairs[p, 0], pairs[p, 1]
            g.first_pair[k] += 1
    for first in (g.first, g.first_shape, g.first_pair):
        for k in range(count, 0, -1):
            first[k] = first[k - 1]
        first[0] = 0


@kernel
def _group_of(g: Groups, shapes: Shapes, pairs: IntArray, k: int) -> int:
    return max(g.of[shapes.body[pairs[k, 0]]], g.of[shapes.body[pairs[k, 1]]])


@kernel
def may_go(model: Model, state: State, loads: Loads, shapes: Shapes, k: int, t: float,
           g: Groups) -> bool:
    """
    Enlarge the spheres of group k by how far its shapes may move within t [s] under the loads.

    Returns False if one of them may go farther than was thought; that is then more.
    """
    within = True
    for at in range(g.first_shape[k], g.first_shape[k + 1]):
        s = g.shape[at]
        way = motion_bound(model, state, loads, shapes, s, t)
        g.radius[s] = shapes.bound[s] + way
        if g.moved[s] + way > g.far[s]:
            g.far[s] = 2.0 * (g.moved[s] + way)
            within = False
    return within


@kernel
def near_pairs(shapes: Shapes, k: int, pose: Array, box: Array, g: Groups,
               pairs: IntArray) -> int:
    """
    Write the pairs of group k whose spheres meet, and their boxes on their ways.

    box, (s, 6) [m], are the bounding boxes of the shapes where they are now. Returns how many.
    """
    count = 0
    for at in range(g.first_pair[k], g.first_pair[k + 1]):
        a, b = g.pair[at, 0], g.pair[at, 1]
        if near(shapes, pose, g.radius, a, b) and _boxes_near(shapes, box, g.radius, a, b):
            pairs[count, 0], pairs[count, 1] = a, b
            count += 1
    return count


@kernel
def _boxes_near(shapes: Shapes, box: Array, radius: Array, a: int, b: int) -> bool:
    """Return whether two boxes may meet, each larger by what its shape's sphere is larger."""
    if shapes.bound[a] == np.inf or shapes.bound[b] == np.inf:
        return True
    way = radius[a] - shapes.bound[a] + radius[b] - shapes.bound[b]
    for i in range(3):
        if box[a, i] > box[b, 3 + i] + way or box[b, i] > box[a, 3 + i] + way:
            return False
    return True


@kernel
def note_way(model: Model, state: State, loads: Loads, shapes: Shapes, k: int, t: float,
             g: Groups) -> None:
    """Add up how far the shapes of group k move within t [s], at most."""
    for at in range(g.first_shape[k], g.first_shape[k + 1]):
        s = g.shape[at]
        g.moved[s] += motion_bound(model, state, loads, shapes, s, t)
