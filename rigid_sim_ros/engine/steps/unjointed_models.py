# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The contact models of bodies that no joint holds."""

from collections.abc import Mapping
import math

import numpy as np

from rigid_sim_ros.engine.contact.carried_forces import Carried, no_forces
from rigid_sim_ros.engine.detection.manifolds import (
    current_manifolds, latest_impulses, Manifolds)
from rigid_sim_ros.engine.dynamics.integrate import make_work, ORIENTATIONS
from rigid_sim_ros.engine.dynamics.wrenches import Wrenches
from rigid_sim_ros.engine.events.groups import MANY_EVENTS, MUCH_WORK, NO_FORCES, NO_IMPULSES
from rigid_sim_ros.engine.solver.arguments import (
    Arguments, make_arguments, SequentialSettings, TimestepSettings, with_cut)
from rigid_sim_ros.engine.solver.partition import Cut
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.engine.steps import event, penalty, qp, timestep
from rigid_sim_ros.engine.steps.contact_model import (
    CONTACT, ContactReport, named, OneThread, rows_of, Setup, Touching, unnamed)
from rigid_sim_ros.engine.steps.free import FREE_MOTION, FreeArguments
from rigid_sim_ros.kernels.argument_pack import ArgumentPack, packed
from rigid_sim_ros.kernels.helper_process import cores
from rigid_sim_ros.kernels.second_core import Helper, make_job


class FreeMotion(OneThread):
    """No contacts: bodies pass through each other."""

    def __init__(self, setup: Setup) -> None:
        """Choose the integrator."""
        self._model = setup.model
        # Not its kernel: a process that was given a pickled world would compile that anew.
        self._integrator = setup.integrator
        self._orientation = ORIENTATIONS.index(setup.orientation)
        self._work = make_work(len(setup.model.m))
        self._pack: ArgumentPack | None = None

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state."""
        self._pack = packed(FreeArguments(self._model, state, wrenches, self._work), self._pack)
        self._pack.run(FREE_MOTION[self._integrator], self._orientation, count)

    def lasting(self) -> dict[str, np.ndarray]:
        """Return nothing: the state is all there is."""
        return {}

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Have nothing to go back to."""

    def report(self) -> ContactReport:
        """Return zeros."""
        return ContactReport()

    def contacts(self, state: State) -> np.ndarray:
        """Return no rows."""
        return np.zeros(0, dtype=CONTACT)


# Why a part of a step of `event` ran without backtracking, see events/groups.py.
_SHORT = {MANY_EVENTS: 'more than {} collisions in one step',
          MUCH_WORK: 'the collisions in one step took more work than they may',
          NO_FORCES: 'no forces stop all points of what is squeezed',
          NO_IMPULSES: 'no impulses stop all points of what is squeezed'}
# Of `Rest`, what influences later steps.
_REST = ('steps', 'asleep', 'pose', 'load')


class Timestep(Touching):
    """Velocity level, soft substeps: for real time and for many bodies."""

    def __init__(self, setup: Setup) -> None:
        """Make room for no contacts yet."""
        super().__init__(setup)
        self._settings = TimestepSettings(
            sequential=SequentialSettings(substeps=setup.substeps),
            sleep_steps=math.ceil(setup.sleep_after / setup.model.h))
        self._arguments = self._begin()
        self._pack: ArgumentPack | None = None
        self._helper: Helper | None = None
        self._has_stepped = False

    def _begin(self) -> Arguments:
        joints = self._setup.joints
        return make_arguments(self._basis(), self._settings,
                              None if joints is None else joints.table)

    def use_threads(self, count: int) -> None:
        """Let a second thread help where contacts are many, if there is a core for it."""
        helped = count > 1 and cores() > 1
        if helped != (self._helper is not None):
            self._helper = Helper() if helped else None
            job = make_job() if self._helper is None else self._helper.job
            self._arguments = self._arguments._replace(job=job)

    def lasting(self) -> dict[str, np.ndarray]:
        """Return the manifolds, the cut, and who rests where if bodies may sleep."""
        c = self._arguments
        arrays = super().lasting() | named('cut', c.work.solver.sides.cut)
        if self._settings.sleep_steps > 0:
            arrays |= {f'rest_{name}': getattr(c.rest, name).copy() for name in _REST}
        return arrays

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to manifolds that `lasting` returned."""
        super().recall(arrays)
        c = self._begin()._replace(job=self._arguments.job)
        if arrays:
            with_cut(c.work, unnamed('cut', Cut, arrays))
        for name in _REST if arrays and self._settings.sleep_steps > 0 else ():
            getattr(c.rest, name)[...] = arrays[f'rest_{name}']
        self._arguments, self._has_stepped = c, False

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state."""
        self._arguments, self._pack = timestep.advance(
            self.arguments_of(state, wrenches), count, self._pack, self._helper)
        self._memory = self._arguments.memory
        self._has_stepped = self._has_stepped or count > 0

    def arguments_of(self, state: State, wrenches: Wrenches) -> Arguments:
        """Return the arguments of a step of this state."""
        c = self._arguments
        if c.state is not state or c.wrenches is not wrenches:
            c = c._replace(state=state, wrenches=wrenches)
        return c

    def find(self, state: State, wrenches: Wrenches) -> Arguments:
        """Begin a step, with what is near each other; return the arguments of it."""
        self._arguments, self._pack = timestep.find(
            self.arguments_of(state, wrenches), self._pack)
        self._memory = self._arguments.memory
        return self._arguments

    def move(self) -> None:
        """End the step that `find` began, but for what falls asleep."""
        assert self._pack is not None
        self._pack.run(timestep.take_half, timestep.MOVE)
        self._has_stepped = True

    def manifolds(self) -> Manifolds:
        """Return the manifolds of the latest step."""
        return current_manifolds(self._memory)

    def contacts(self, state: State) -> np.ndarray:
        """Return the manifolds of the latest step with all its impulses, collisions included."""
        if not self._has_stepped:  # after `recall` the impulses of the last substep are known
            return super().contacts(state)
        acted = latest_impulses(self._memory)
        return rows_of(self._setup, state, current_manifolds(self._memory), acted.normal.T,
                       acted.friction)

    def report(self) -> ContactReport:
        """Return the counts, and the largest change of a contact's velocity in the last sweep."""
        c = self._arguments
        return self._counts()._replace(residual=float(c.work.solver.residual[0]),
                                       iterations=self._settings.sequential.substeps,
                                       asleep=int(c.rest.asleep.sum()))


class VelocityQp(Touching):
    """
    Velocity level, all contacts at once: the reference for small scenes.

    By Newton's method, and by OSQP where that does not solve up to MOST_POINTS of them.
    """

    def __init__(self, setup: Setup) -> None:
        """Make room for no contacts yet."""
        super().__init__(setup)
        self._arguments = self._begin()

    def _begin(self) -> qp.QpArguments:
        return qp.make_arguments(self._basis(), TimestepSettings())

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state."""
        c = self._arguments._replace(state=state, wrenches=wrenches)
        self._arguments = qp.advance(c, count)
        self._memory = self._arguments.memory

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to manifolds that `lasting` returned."""
        super().recall(arrays)
        self._arguments = self._begin()

    def report(self) -> ContactReport:
        """Return the counts, and how well the contacts were solved."""
        done = self._arguments.work.report
        message = '' if done.solved else (
            f'a contact problem was left with a residual of {done.residual:.1e}'
            + (f' (OSQP: {done.status})' if done.status else ''))
        return self._counts()._replace(residual=done.residual, iterations=done.iterations,
                                       message=message)


class Event(Touching):
    """The classic algorithm: every collision at its own time, resting contact by a QP."""

    def __init__(self, setup: Setup) -> None:
        """Make room for no contacts yet."""
        super().__init__(setup)
        self._arguments = event.make_arguments(self._basis())
        self._pack: ArgumentPack | None = None

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state."""
        c = self._arguments._replace(state=state, wrenches=wrenches, memory=self._memory)
        self._arguments, self._pack = event.advance(c, count, self._pack)
        self._memory = self._arguments.memory

    def lasting(self) -> dict[str, np.ndarray]:
        """Return the manifolds and the forces of the last step."""
        return super().lasting() | named('carried', event.carried_over(self._arguments))

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to manifolds and forces that `lasting` returned."""
        super().recall(arrays)
        self._arguments = event.with_carried(
            self._arguments, unnamed('carried', Carried, arrays) if arrays else no_forces())

    def report(self) -> ContactReport:
        """Return the counts, and what could not be done."""
        done = event.report(self._arguments)
        message = ''
        if done.unsolved:
            message = (f'{done.unsolved} contact problems were left with a residual of '
                       f'{done.residual:.1e}')
        elif done.cut_short:
            message = (_SHORT[done.cut_short].format(self._arguments.settings.max_events)
                       + ': the rest of the step ran without backtracking')
        # Not only where the step began: the deepest of all times at which it was interrupted.
        return self._counts()._replace(deepest=done.deepest, residual=done.residual,
                                       message=message)


class Penalty(Touching):
    """Springs and dampers at every contact point."""

    def __init__(self, setup: Setup) -> None:
        """Make room for no contacts yet."""
        super().__init__(setup)
        self._arguments = penalty.make_arguments(self._basis())
        self._pack: ArgumentPack | None = None

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state."""
        c = self._arguments._replace(state=state, wrenches=wrenches, memory=self._memory)
        self._arguments, self._pack = penalty.advance(c, count, self._pack)
        self._memory = self._arguments.memory

    def lasting(self) -> dict[str, np.ndarray]:
        """Return the manifolds and the bristles of friction."""
        return super().lasting() | named('bristle', penalty.carried_over(self._arguments))

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to manifolds and bristles that `lasting` returned."""
        super().recall(arrays)
        self._arguments = penalty.with_carried(self._arguments, recalled_bristles(arrays))

    def report(self) -> ContactReport:
        """Return the counts; springs need no solver."""
        return self._counts()


def recalled_bristles(arrays: Mapping[str, np.ndarray]) -> penalty.Bristles:
    """Return the bristles among what `lasting` returned; nothing at all is the beginning."""
    if not arrays:
        return penalty.no_bristles()
    bristles: penalty.Bristles = unnamed('bristle', penalty.Bristles, arrays)
    return bristles
