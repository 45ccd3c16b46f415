# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sum of the forces and torques on each body."""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.maths.vector import add_to_column, column, cross, subtract
from rigid_sim_ros.engine.model.model import Model, WORLD
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel


class Loads(NamedTuple):
    """Force and torque on each of n bodies."""

    F: Array  # forces, (3, n) [N], world axes
    tau: Array  # torques about the centres of mass, (3, n) [N m], world axes


def empty_loads(n: int) -> Loads:
    """Return room for the loads on n bodies."""
    return Loads(np.zeros((3, n)), np.zeros((3, n)))


@kernel
def push_body(state: State, loads: Loads, body: int, p_W: Vector, F_W: Vector) -> None:
    """
    Let the force F [N] act at the point p [m] of a body, both in world axes.

    tau = (p - x) x F (Parent, Rigid Body Dynamics, "Force and Torque").
    """
    add_to_column(loads.F, body, F_W)
    add_to_column(loads.tau, body, cross(subtract(p_W, column(state.x, body)), F_W))


@kernel
def add_force(model: Model, state: State, loads: Loads, frame: int, p_W: Vector,
              F_W: Vector) -> None:
    """Let a force act in the same way on the body of a frame; on WORLD nothing happens."""
    if frame != WORLD:
        push_body(state, loads, model.frame_body[frame], p_W, F_W)


@kernel
def add_torque(model: Model, loads: Loads, frame: int, tau_W: Vector) -> None:
    """Let a torque [N m, world axes] act on the body of a frame; on WORLD nothing happens."""
    if frame != WORLD:
        add_to_column(loads.tau, model.frame_body[frame], tau_W)


@kernel
def kick(state: State, loads: Loads, h: float) -> None:
    """Advance the momenta under constant loads: P += h F, L += h tau."""
    kick_some(state, loads, h, 0, state.P.shape[1])


@kernel
def kick_some(state: State, loads: Loads, h: float, first: int, last: int) -> None:
    """Advance the momenta of some bodies."""
    for k in range(3):
        for i in range(first, last):
            state.P[k, i] += h * loads.F[k, i]
        for i in range(first, last):
            state.L[k, i] += h * loads.tau[k, i]
