# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the shapes are: their poses in the world, and boxes around them."""

import numpy as np

from rigid_sim_ros.engine.maths.rotation import quaternion, to_matrix
from rigid_sim_ros.engine.model.kinds.table import reach_along
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel


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
def bound(kind: IntArray, size: Array, pose: Array, margin: Array, box: Array, first: int,
          last: int) -> None:
    """Write the bounding boxes of some shapes and of what is ahead; infinite for a plane."""
    for s in range(first, last):
        for k in range(3):
            x, y, z = pose[s, 3 + 3 * k], pose[s, 4 + 3 * k], pose[s, 5 + 3 * k]
            down, up = reach_along(kind[s], size, s, x, y, z)
            # One part in 1e12 more, so that rounding never makes the box too small.
            box[s, k] = pose[s, k] - (down * (1.0 + 1e-12) + margin[s])
            box[s, 3 + k] = pose[s, k] + (up * (1.0 + 1e-12) + margin[s])
