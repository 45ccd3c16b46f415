# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model `timestep` of worlds in which joints hold some bodies and others not, or may sleep."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rigid_sim_ros.engine.constraints.articulated_buffers import (
    carried_over, make_buffers, with_carried)
from rigid_sim_ros.engine.dynamics.wrenches import no_wrenches, Wrenches
from rigid_sim_ros.engine.joints.buffers import make_joint_work
from rigid_sim_ros.engine.joints.part import Part, part_of
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.solver.arguments import Arguments
from rigid_sim_ros.engine.solver.joint_rest import TOLD
from rigid_sim_ros.engine.state.state import empty_state, State
from rigid_sim_ros.engine.steps import jointed_contact
from rigid_sim_ros.engine.steps.contact_model import ContactReport, Setup
from rigid_sim_ros.engine.steps.divided_timestep import (
    BEGIN, COMMANDS, DIVIDE, Division, MERGE, run, StartedMotion, TAKE_CALLED)
from rigid_sim_ros.engine.steps.jointed_models import JointedTimestep
from rigid_sim_ros.engine.steps.jointed_motion import JointSetup
from rigid_sim_ros.engine.steps.unjointed_models import Timestep
from rigid_sim_ros.kernels.argument_pack import ArgumentPack


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
        self._may_sleep = setup.sleep_after > 0.0
        self._inv_m, self._inv_I_C = setup.model.inv_m, setup.model.inv_I_C
        self._parent, self._marked = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        self._copy, self._wrenches = empty_state(n), no_wrenches()
        self._begin()

    def _begin(self) -> None:
        """Begin with nothing known of who is awake, and of what drives were told."""
        self._has_joints = _of_no_step(len(self._inv_m))
        self._awake = _of_no_step(len(self.table.first_row) - 1)
        self._told = np.zeros((TOLD, len(self.motion.rate)))
        self._started = StartedMotion._make(
            getattr(self.motion, name).copy() for name in StartedMotion._fields)
        self._arguments = self._arguments._replace(
            joints=self.arguments(self._copy, self._wrenches), memory=self._memory)
        self._division: ArgumentPack | None = None
        # Of the whole nothing is copied: it has no rows of others.
        self._whole = Part(
            self.table, self.motion, *(np.zeros(0, dtype=np.int64) for _ in range(4)))
        self._let_act(np.ones(len(self._awake), dtype=bool))

    def _let_act(self, awake: np.ndarray) -> None:
        """Let the solver with joints have these articulations, (a,) of bool."""
        self._acts = bool(awake.any())
        self._is_part = self._acts and not bool(awake.all())
        self._part = part_of(self.table, self.motion, awake) if self._is_part else self._whole
        joints, w = self.arguments(self._copy, self._wrenches), self._arguments.buffers
        if self._is_part:
            joints = joints._replace(
                table=self._part.table, motion=self._part.motion,
                scratch=make_joint_work(self._part.table)._replace(
                    unresolved=self._scratch.unresolved))
        if not self._acts:
            w.counts.known[0] = w.acted.count[0] = 0
            w.system.residual[0] = 0.0
        if joints.table is not self._arguments.joints.table:
            buffers = make_buffers(joints.table, len(self._inv_m), len(w.chosen),
                                   w.order.shape[1], len(w.system.rows.at))
            buffers.counts.width[0] = w.counts.width[0]
            self._arguments = self._arguments._replace(
                joints=joints, buffers=with_carried(buffers, joints.table, carried_over(w)))

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state, and count wrenches and commands down."""
        self.read(state)
        if len(self._wrenches.body) != len(wrenches.body):
            self._wrenches = no_wrenches(len(wrenches.body))
            self._arguments = self._arguments._replace(joints=self._arguments.joints._replace(
                wrenches=self._wrenches))
            self._division = None
        if self._may_sleep:
            self._divide(self._free.arguments_of(state, wrenches), COMMANDS)
        for _ in range(count):
            free = self._free.find(state, wrenches)
            if self._divide(free, DIVIDE) == 1:
                self._let_act(self._awake == 1)
            if self._acts:
                self._take_joints(free)
            self._free.move()
            self._divide(free, MERGE)
        self._memory = self._arguments.memory

    def _take_joints(self, free: Arguments) -> None:
        """Let what joints hold, and what touches it, take the step."""
        if self._is_part:
            self._divide(free, BEGIN)
        while True:
            self._arguments, self._pack = jointed_contact.advance(
                self._run, self._arguments, 1, self._pack)
            if self._arguments.now.steps_left[0] == 0:
                break
            self._divide(free, TAKE_CALLED)

    def _divide(self, free: Arguments, what: int) -> Any:
        pack, c = self._division, self._arguments
        if pack is None or pack.arguments.free is not free or (
                pack.arguments.memory is not c.memory or pack.arguments.part is not self._part):
            pack = self._division = ArgumentPack(Division(
                free, c.joints.model, self._copy, self._wrenches, c.shapes, c.memory,
                c.elsewhere, c.looked, self._part,
                self.table, self.motion, self._started, self._told, self._inv_m, self._inv_I_C,
                self._has_joints, self._awake, self._parent, self._marked))
        return pack.run(run, what)

    def lasting(self) -> dict[str, np.ndarray]:
        """Return what lasts of both solvers; the manifolds of one are those of the world."""
        told = {'rest_told': self._told.copy()} if self._may_sleep else {}
        return super().lasting() | self._free.lasting() | told

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to what `lasting` returned; nothing at all is the beginning."""
        super().recall(arrays)
        self._free.recall(arrays)
        self._memory = self._fresh()
        self._begin()
        if arrays and self._may_sleep:
            self._told[...] = arrays['rest_told']

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
