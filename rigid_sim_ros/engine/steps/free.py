# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sequence of the stages of a step, and nothing else."""

from collections.abc import Callable
from typing import Any

from rigid_sim_ros.engine.dynamics.free_flight import fly
from rigid_sim_ros.engine.dynamics.integrate import euler, rk4, semi_implicit, symplectic
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic, move_kinematic
from rigid_sim_ros.engine.dynamics.wrenches import count_down
from rigid_sim_ros.kernels.argument_pack import contents
from rigid_sim_ros.kernels.kernel import kernel


def _free_motion(integrate: Callable[..., None]) -> Any:
    """Return the kernel that steps bodies which do not touch, with one of the integrators."""

    @kernel
    def advance(box: Any, orientation: int, count: int) -> None:
        model, state, wrenches, work = contents(box)
        for _ in range(count):
            begin_kinematic(model, state)
            integrate(model, state, wrenches, orientation, work)
            end_kinematic(model, state)
            count_down(wrenches)

    return advance


@kernel
def _free_motion_symplectic(box: Any, orientation: int, count: int) -> None:
    model, state, wrenches, work = contents(box)
    if model.forces.kind.shape[0] + wrenches.in_use[0] == 0:
        g = model.gravity
        fly(model, state, (g[0], g[1], g[2]), model.h, count, work.block)
        for _ in range(count if model.fixed.shape[0] > 0 else 0):
            begin_kinematic(model, state)
            move_kinematic(model, state, model.h)
            end_kinematic(model, state)
        return
    for _ in range(count):
        begin_kinematic(model, state)
        symplectic(model, state, wrenches, orientation, work)
        end_kinematic(model, state)
        count_down(wrenches)


# Each takes a box of model, state, wrenches and `Work`, how to turn, and how many steps.
FREE_MOTION: dict[str, Any] = {
    'euler': _free_motion(euler),
    'semi_implicit': _free_motion(semi_implicit),
    'rk4': _free_motion(rk4),
    'symplectic': _free_motion_symplectic,
}
