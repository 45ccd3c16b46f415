# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where the shapes are: their poses in the world, and boxes around them.

A ground can have a hundred thousand shapes, of which a body touches a few. Of what does not move
nothing is found again: see `Settled`.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.maths.rotation import quaternion, to_matrix
from rigid_sim_ros.engine.model.kinds.table import reach_along
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray, room
from rigid_sim_ros.kernels.kernel import kernel


# How `Settled.since` goes on: the shapes are placed, and their boxes made; no shape is about to
# leave its fat box; nothing is to be done.
PLACED, STAYING, SETTLED = range(3)


class Settled(NamedTuple):
    """Which of n bodies that nothing pushes are where they were, with the same margins."""

    since: IntArray  # (n,) of 8 bits, see PLACED .. SETTLED
    at: Array  # (n, 8) position [m], attitude and margin [m] with which they were placed


def unsettled(n: int) -> Settled:
    """Return that of bodies of which nothing is known."""
    return Settled(room(n, kind=np.int8), room(n, 8))


@kernel
def note_settled(state: State, shapes: Shapes, margin: Array, anew: bool, settled: Settled,
                 moved: IntArray, first: int, last: int) -> None:
    """
    Note which bodies of some shapes are settled; with `anew` none is.

    moved (s,) becomes 0 for the shapes of those that stay.
    """
    s = first
    while s < last:
        i = shapes.body[s]
        stays = shapes.still[s] == 1 and not anew and is_at(state, i, margin[s], settled.at)
        settled.since[i] = min(settled.since[i] + 1, SETTLED) if stays else PLACED
        if settled.since[i] == STAYING:
            moved[s:shapes.after[s]] = 0
        elif not stays:
            keep_place(state, i, margin[s], settled.at)
        s = shapes.after[s]


@kernel
def is_at(state: State, i: int, margin: float, at: Array) -> bool:
    """Return whether body i, with this margin [m] of its first shape, is where `at` says."""
    same = at[i, 7] == margin
    for k in range(3):
        same &= at[i, k] == state.x[k, i]
    for k in range(4):
        same &= at[i, 3 + k] == state.q[k, i]
    return same


@kernel
def keep_place(state: State, i: int, margin: float, at: Array) -> None:
    """Write where body i is, and the margin [m] of its first shape."""
    at[i, 7] = margin
    for k in range(3):
        at[i, k] = state.x[k, i]
    for k in range(4):
        at[i, 3 + k] = state.q[k, i]


@kernel
def next_placed(shapes: Shapes, settled: Settled, first: int, last: int) -> tuple[int, int]:
    """Return the next shapes side by side, from `first` up to `last`, that are to be placed."""
    begin = first
    while begin < last and settled.since[shapes.body[begin]] != PLACED:
        begin = shapes.after[begin]
    end = begin
    while end < last and settled.since[shapes.body[end]] == PLACED:
        end = shapes.after[end]
    return begin, end


def unplaced(s: int) -> Array:
    """Return poses (s, 12) at the origin, in its axes."""
    pose = np.zeros((s, 12))
    pose[:, 3::4] = 1.0
    return pose


@kernel
def place_bodies(state: State, turning: IntArray, turn: Array, first: int, last: int) -> None:
    """Write the rotation matrices (n, 9) of some bodies, but for those that are only balls."""
    for i in range(first, last):
        if turning[i] == 0:
            continue
        x, y, z = to_matrix(quaternion(state.q, i))
        for k in range(3):
            turn[i, k] = x[k]
            turn[i, 3 + k] = y[k]
            turn[i, 6 + k] = z[k]


@kernel
def place_shapes(state: State, shapes: Shapes, turn: Array, pose: Array, first: int,
                 last: int) -> None:
    """
    Write the poses (s, 12) of some shapes, whose bodies are placed.

    Balls keep the axes that `unplaced` gave them.
    """
    for s in range(first, last):
        i = shapes.body[s]
        if shapes.ball[s] == 1:
            for k in range(3):
                pose[s, k] = state.x[k, i]
            continue
        for k in range(3):
            pose[s, k] = state.x[k, i] + (turn[i, 3 * k] * shapes.p_CS[s, 0]
                                          + turn[i, 3 * k + 1] * shapes.p_CS[s, 1]
                                          + turn[i, 3 * k + 2] * shapes.p_CS[s, 2])
        if shapes.aligned[s] == 1:
            for k in range(9):
                pose[s, 3 + k] = turn[i, k]
        else:
            R = to_matrix((shapes.q_CS[s, 0], shapes.q_CS[s, 1], shapes.q_CS[s, 2],
                           shapes.q_CS[s, 3]))
            for k in range(3):
                for j in range(3):
                    pose[s, 3 + 3 * k + j] = (turn[i, 3 * k] * R[0][j]
                                              + turn[i, 3 * k + 1] * R[1][j]
                                              + turn[i, 3 * k + 2] * R[2][j])


@kernel
def write_aabbs(kind: IntArray, size: Array, pose: Array, margin: Array, box: Array, first: int,
                last: int) -> None:
    """Write the AABBs of some shapes, larger by their margins; infinite for a plane."""
    for s in range(first, last):
        for k in range(3):
            x, y, z = pose[s, 3 + 3 * k], pose[s, 4 + 3 * k], pose[s, 5 + 3 * k]
            down, up = reach_along(kind[s], size, s, x, y, z)
            # One part in 1e12 more, so that rounding never makes the box too small.
            box[s, k] = pose[s, k] - (down * (1.0 + 1e-12) + margin[s])
            box[s, 3 + k] = pose[s, k] + (up * (1.0 + 1e-12) + margin[s])
