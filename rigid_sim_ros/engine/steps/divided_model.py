# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model `timestep` of worlds in which joints hold some bodies and others not."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rigid_sim_ros.engine.dynamics.wrenches import no_wrenches, Wrenches
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.solver.arguments import Arguments
from rigid_sim_ros.engine.state.state import empty_state, State
from rigid_sim_ros.engine.steps import jointed_contact
from rigid_sim_ros.engine.steps.contact_model import ContactReport, Setup
from rigid_sim_ros.engine.steps.divided_timestep import divide, Division, merge
from rigid_sim_ros.engine.steps.free_models import Timestep
from rigid_sim_ros.engine.steps.jointed_models import JointedTimestep
from rigid_sim_ros.engine.steps.jointed_motion import JointSetup
from rigid_sim_ros.kernels.argument_pack import ArgumentPack, packed


def has_free_bodies(setup: Setup, joints: JointSetup) -> bool:
    """Return whether there are bodies that move and that no joint holds."""
    return bool((setup.model.inv_m > 0.0)[joints.table.row_of_body < 0].any())


class DividedTimestep(JointedTimestep):
    """Islands with joints by the solver that knows these, all others as in a world without."""

    def __init__(self, setup: Setup, joints: JointSetup) -> None:
        """Give either solver masses of its own, see `Division`."""
        n, shapes = len(setup.model.m), setup.shapes
        super().__init__(setup._replace(
            model=_with_own_masses(setup.model),
            shapes=shapes._replace(still=shapes.still.copy())), joints)
        self._free = Timestep(setup._replace(model=_with_own_masses(setup.model)))
        self._inv_m, self._inv_I_C = setup.model.inv_m, setup.model.inv_I_C
        self._has_joints = _of_no_step(n)
        self._parent, self._marked = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        self._copy, self._wrenches = empty_state(n), no_wrenches()
        self._division: ArgumentPack | None = None
        self._begin()

    def _begin(self) -> None:
        """Let the solver with joints have its copies."""
        self._arguments = self._arguments._replace(
            joints=self.arguments(self._copy, self._wrenches), memory=self._memory)

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state, and count wrenches and commands down."""
        self.read(state)
        if len(self._wrenches.body) != len(wrenches.body):
            self._wrenches = no_wrenches(len(wrenches.body))
            self._begin()
        for _ in range(count):
            free = self._free.find(state, wrenches)
            self._divide_or_merge(divide, free)
            self._arguments, self._pack = jointed_contact.advance(
                self._run, self._arguments, 1, self._pack)
            self._free.respond()
            self._divide_or_merge(merge, free)
        self._memory = self._arguments.memory

    def _divide_or_merge(self, kernel: Callable[..., Any], free: Arguments) -> None:
        self._division = packed(Division(
            free, self._arguments, self._inv_m, self._inv_I_C, self._has_joints,
            self._parent, self._marked), self._division)
        self._division.run(kernel)

    def lasting(self) -> dict[str, np.ndarray]:
        """Return what lasts of both solvers; the manifolds of one are those of the world."""
        return super().lasting() | self._free.lasting()

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to what `lasting` returned; nothing at all is the beginning."""
        super().recall(arrays)
        self._free.recall(arrays)
        self._memory, self._has_joints = self._fresh(), _of_no_step(len(self._has_joints))
        self._begin()

    def contacts(self, state: State) -> np.ndarray:
        """Return the manifolds of the latest step with what acted there in either solver."""
        return self.with_acted(self._free.manifolds(), self._free.contacts(state))

    def report(self) -> ContactReport:
        """Return the counts, the larger residual, and what could not be done."""
        free, jointed = self._free.report(), super().report()
        return free._replace(residual=max(free.residual, jointed.residual),
                             message=jointed.message)


def _with_own_masses(model: Model) -> Model:
    return model._replace(inv_m=model.inv_m.copy(), inv_I_C=model.inv_I_C.copy())


def _of_no_step(n: int) -> Any:
    """Return what differs from any division of n bodies."""
    return np.full(n, -1, dtype=np.int64)
