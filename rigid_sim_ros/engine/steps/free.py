# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model `none`: bodies move as if they were alone, by one of five integrators."""

from collections.abc import Callable
from typing import Any, NamedTuple

from rigid_sim_ros.engine.dynamics.free_flight import fly
from rigid_sim_ros.engine.dynamics.integrate import (
    euler, rk4, semi_implicit, symplectic, symplectic4, Work)
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic, move_kinematic
from rigid_sim_ros.engine.dynamics.wrenches import count_down, Wrenches
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.kernel import kernel


class FreeArguments(NamedTuple):
    """What the kernels of a step read and write."""

    model: Model
    state: State
    wrenches: Wrenches
    work: Work


def _free_motion(integrate: Callable[..., None]) -> Any:
    """Return the kernel that steps bodies which do not touch, with one of the integrators."""

    @kernel
    def advance(c: FreeArguments, orientation: int, count: int) -> None:
        model, state, wrenches = c.model, c.state, c.wrenches
        for _ in range(count):
            begin_kinematic(model, state)
            integrate(model, state, wrenches, orientation, c.work)
            end_kinematic(model, state)
            count_down(wrenches)

    return advance


@kernel
def _free_motion_symplectic(c: FreeArguments, orientation: int, count: int) -> None:
    model, state, wrenches = c.model, c.state, c.wrenches
    if model.forces.kind.shape[0] + wrenches.in_use[0] == 0:
        g = model.gravity
        fly(model, state, (g[0], g[1], g[2]), model.h, count, c.work.block)
        for _ in range(count if model.fixed.shape[0] > 0 else 0):
            begin_kinematic(model, state)
            move_kinematic(model, state, model.h)
            end_kinematic(model, state)
        return
    for _ in range(count):
        begin_kinematic(model, state)
        symplectic(model, state, wrenches, orientation, c.work)
        end_kinematic(model, state)
        count_down(wrenches)


# Each takes a pack of the arguments, how to turn, and how many steps.
FREE_MOTION: dict[str, Any] = {
    'euler': _free_motion(euler),
    'semi_implicit': _free_motion(semi_implicit),
    'rk4': _free_motion(rk4),
    'symplectic': _free_motion_symplectic,
    'symplectic4': _free_motion(symplectic4),
}
