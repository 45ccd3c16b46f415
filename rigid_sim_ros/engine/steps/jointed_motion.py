# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model of bodies that joints hold and that pass through each other."""

from collections.abc import Mapping
from operator import is_
from typing import Any, NamedTuple, TypeVar

import numpy as np

from rigid_sim_ros.engine.dynamics.integrate import make_work, STAGES
from rigid_sim_ros.engine.dynamics.wrenches import Wrenches
from rigid_sim_ros.engine.joints.assembly import assemble, project, set_rates
from rigid_sim_ros.engine.joints.buffers import (
    Drives, JointMotion, joints_at_rest, make_joint_work)
from rigid_sim_ros.engine.joints.forward_kinematics import read_positions, read_rates
from rigid_sim_ros.engine.joints.settle import prepare
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import empty_state, State
from rigid_sim_ros.engine.steps.articulated import advance, JointedArguments
from rigid_sim_ros.engine.steps.composed import advance_in_stages
from rigid_sim_ros.kernels.argument_pack import ArgumentPack, packed
from rigid_sim_ros.kernels.arrays import Array, IntArray


class JointSetup(NamedTuple):
    """The joints of a world, and what is theirs at its start."""

    table: JointTable
    position: Array     # (j,) [rad or m]
    drives: Drives


# By integrator: what takes the steps, and in how many stages each; 0: it has none.
_MOTIONS: dict[str, tuple[Any, int]] = {
    'symplectic': (advance, 0),
    'symplectic4': (advance_in_stages, len(STAGES)),
}

_Arguments = TypeVar('_Arguments', bound=tuple[Any, ...])


def kept(now: _Arguments, before: _Arguments | None) -> _Arguments:
    """
    Return arguments of a step as they were before if they hold the same objects.

    So the pack that holds them stays: to make one takes longer than a step of ten bodies.
    """
    return now if before is None or False in map(is_, before, now) else before


class JointedMotion:
    """Motion of bodies that joints hold; the dynamic state of the joints is here."""

    def __init__(self, model: Model, setup: JointSetup, integrator: str = 'symplectic') -> None:
        """Put the joints where they are at the start; their bodies are there already."""
        self._integrator = integrator
        self.table, self._model, self._joints = setup.table, model, setup
        n = len(model.m)
        self._scratch = make_joint_work(setup.table)
        self._integration, self._times, self._start = make_work(n), np.zeros(n), empty_state(n)
        self._pack: ArgumentPack | None = None
        self._latest: JointedArguments | None = None
        self.motion = self._at_rest()
        self._is_new = True

    def _at_rest(self) -> JointMotion:
        drives = Drives._make(array.copy() for array in self._joints.drives)
        motion = joints_at_rest(self.table, drives, _MOTIONS[self._integrator][1])
        motion.position[:] = self._joints.position
        return motion

    def read(self, state: State) -> JointMotion:
        """Return the motion of the joints; at the start it is that of the bodies."""
        if self._is_new:
            prepare(self._model, self.table, state, self._scratch)
            read_rates(self._model, self.table, state, self._scratch, self.motion.rate)
            read_positions(self.table, state, self.motion)
            self._is_new = False
        return self.motion

    def read_anew(self, state: State) -> JointMotion:
        """Return the motion of the joints, which is that of the bodies, whatever it was."""
        self._is_new = True
        return self.read(state)

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state by some steps, and count wrenches and commands down."""
        self.read(state)
        self._pack = packed(self.arguments(state, wrenches), self._pack)
        self._pack.run(_MOTIONS[self._integrator][0], count)

    def arguments(self, state: State, wrenches: Wrenches) -> JointedArguments:
        """Return what the kernels of a step read and write."""
        now = JointedArguments(
            self._model, state, wrenches, self._integration, self.table, self.motion,
            self._scratch, self._times, self._start)
        self._latest = kept(now, self._latest)
        return self._latest

    def assemble(self, state: State, position: Array, given: IntArray, rate: Array) -> float:
        """
        Put the bodies where coordinates (j,) and rates (k,) say; return the gap of loops.

        Axes with a 1 in given (k,) keep their coordinate; a rate that is not a number is that of
        the bodies as far as the joints allow it.
        """
        gap = float(assemble(self._model, self.table, state, self.motion, self._scratch, position,
                             given))
        set_rates(self._model, self.table, state, self.motion, self._scratch, rate)
        self._is_new = False
        return gap

    def project(self, state: State, rate: Array | None = None) -> None:
        """
        Let the joints answer to momenta that the bodies were given.

        rate (k,) are velocities that axes are to have, as far as they are numbers.
        """
        self.read(state)
        prepare(self._model, self.table, state, self._scratch)
        wanted = np.full(len(self.motion.rate), np.nan) if rate is None else rate
        project(self._model, self.table, state, self.motion, self._scratch, wanted)

    def join(self, state: State, position: Array, given: IntArray, rate: Array) -> float:
        """
        Put together what new joints hold, see `assemble`; return the gap of loops.

        The bodies keep their momenta but for what the joints take: what meets goes on as one.
        """
        gap = float(assemble(self._model, self.table, state, self.motion, self._scratch, position,
                             given))
        self.project(state, rate)
        return gap

    def lasting(self) -> dict[str, np.ndarray]:
        """Return all that influences later steps besides the state, and the latest wrenches."""
        fields = {name: array for name, array in self.motion._asdict().items()
                  if name != 'drives'}
        fields |= {f'drive_{name}': array for name, array in self.motion.drives._asdict().items()}
        return {f'joint_{name}': array.copy() for name, array in fields.items()}

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to what `lasting` returned; nothing at all is the beginning."""
        self.motion = self._at_rest()
        self._is_new = not arrays
        for name, array in self.motion._asdict().items() if arrays else ():
            if name != 'drives':
                array[...] = arrays[f'joint_{name}']
        for name, array in self.motion.drives._asdict().items() if arrays else ():
            array[...] = arrays[f'joint_drive_{name}']

    @property
    def unresolved(self) -> int:
        """How many parts of steps were too long for the motion, since the beginning."""
        return int(self._scratch.unresolved[0])
