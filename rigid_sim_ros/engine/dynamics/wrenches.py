# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Wrenches that users apply: each in the axes of a frame, for a number of steps."""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.dynamics.force_and_torque import Loads, push_body
from rigid_sim_ros.engine.maths.rotation import rotate
from rigid_sim_ros.engine.maths.vector import add, add_to_column, column, row
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.frames import frame_pose
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel


class Wrenches(NamedTuple):
    """
    Wrenches in effect, a row each, in the order in which they were applied; then room for more.

    So a world that gets wrenches has the same arrays from step to step (see `argument_pack.py`).
    """

    body: IntArray  # (r,) the body they act on
    frame: IntArray  # (r,) whose axes they are given in, WORLD for the world
    at_point: IntArray  # (r,) 1: the force acts at `point`; 0: at the centre of mass
    force: Array  # (r, 3) [N], axes of `frame`
    torque: Array  # (r, 3) [N m], axes of `frame`
    point: Array  # (r, 3) [m], in `frame`
    steps_left: IntArray  # (r,) acts for this many more steps
    in_use: IntArray  # (1,) how many rows there are


def no_wrenches(room: int = 0) -> Wrenches:
    """Return no wrenches, and room for some."""
    return Wrenches(
        np.zeros(room, dtype=np.int64), np.zeros(room, dtype=np.int64),
        np.zeros(room, dtype=np.int64), np.zeros((room, 3)), np.zeros((room, 3)),
        np.zeros((room, 3)), np.zeros(room, dtype=np.int64), np.zeros(1, dtype=np.int64))


@kernel
def add_wrenches(model: Model, state: State, wrenches: Wrenches, loads: Loads) -> None:
    """
    Add the wrenches in effect to the loads.

    Their frames are looked up anew each time: a force in the axes of a body turns with it.
    """
    for r in range(wrenches.in_use[0]):
        if wrenches.steps_left[r] <= 0:
            continue
        body = wrenches.body[r]
        p_WF, q_WF = frame_pose(model, state, wrenches.frame[r])
        force = rotate(q_WF, row(wrenches.force, r))
        point = column(state.x, body)
        if wrenches.at_point[r] == 1:
            point = add(p_WF, rotate(q_WF, row(wrenches.point, r)))
        push_body(state, loads, body, point, force)
        add_to_column(loads.tau, body, rotate(q_WF, row(wrenches.torque, r)))


@kernel
def count_down(wrenches: Wrenches) -> None:
    """Let one step pass for the wrenches in effect."""
    for r in range(wrenches.in_use[0]):
        if wrenches.steps_left[r] > 0:
            wrenches.steps_left[r] -= 1
