# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The contact models of bodies that joints hold."""

from collections.abc import Mapping

import numpy as np

from rigid_sim_ros.engine.constraints.articulated_buffers import (
    carried_over, ContactBuffers, make_buffers, with_carried)
from rigid_sim_ros.engine.contact.carried_forces import Carried
from rigid_sim_ros.engine.contact.contacts import row_count
from rigid_sim_ros.engine.detection.manifolds import current_manifolds, Manifolds
from rigid_sim_ros.engine.dynamics.wrenches import Wrenches
from rigid_sim_ros.engine.solver.arguments import radii, thicknesses
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.engine.steps import (
    jointed_contact, jointed_event, jointed_penalty, jointed_steps, penalty)
from rigid_sim_ros.engine.steps.contact_model import (
    CONTACT, ContactReport, named, OneThread, rows_of_acted, Setup, Touching, unnamed)
from rigid_sim_ros.engine.steps.jointed_motion import JointedMotion, JointSetup, kept
from rigid_sim_ros.engine.steps.jointed_progress import no_progress
from rigid_sim_ros.engine.steps.unjointed_models import recalled_bristles


def unresolved(motion: JointedMotion) -> str:
    """Return what to say of steps that were too long, nothing if none was."""
    if motion.unresolved == 0:
        return ''
    return (f'{motion.unresolved} parts of steps were too long for the motion of joints: '
            'use a smaller step')


class Jointed(OneThread, JointedMotion):
    """No contacts, but joints between the bodies."""

    def report(self) -> ContactReport:
        """Return what could not be done."""
        return ContactReport(message=unresolved(self))

    def contacts(self, state: State) -> np.ndarray:
        """Return no rows."""
        return np.zeros(0, dtype=CONTACT)


class JointedTimestep(Touching, JointedMotion):
    """Velocity level, all impulses of an island at once; joints answer to them."""

    _run = staticmethod(jointed_steps.TIMESTEP)

    def __init__(self, setup: Setup, joints: JointSetup) -> None:
        """Make room for no contacts yet."""
        Touching.__init__(self, setup)
        JointedMotion.__init__(self, setup.model, joints)
        b, n = self._basis(), len(setup.model.m)
        thickness = thicknesses(b.shapes)
        self._arguments = jointed_contact.JointedContact(
            self.arguments(b.state, b.wrenches), b.shapes, b.materials, b.memory,
            radii(b.shapes, n), thickness, float(thickness[thickness > 0.0].min(initial=np.inf)),
            np.zeros(n, dtype=np.int64), np.zeros(len(b.shapes.body)), self._fresh_buffers(),
            no_progress())

    def _fresh_buffers(self) -> ContactBuffers:
        s = self._setup
        buffers = make_buffers(self.table, len(s.model.m), 64, 64, 48)
        buffers.counts.width[0] = row_count(s.materials)
        return buffers

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state, and count wrenches and commands down."""
        self.read(state)
        c = self._arguments._replace(joints=self.arguments(state, wrenches), memory=self._memory)
        self._arguments, self._pack = jointed_contact.advance(self._run, c, count, self._pack)
        self._memory = self._arguments.memory

    def lasting(self) -> dict[str, np.ndarray]:
        """Return the manifolds, the impulses from which the next step begins, and the joints."""
        carried = carried_over(self._arguments.buffers)
        return (Touching.lasting(self) | named('carried', carried)
                | JointedMotion.lasting(self))

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to what `lasting` returned; nothing at all is the beginning."""
        Touching.recall(self, arrays)
        JointedMotion.recall(self, arrays)
        buffers = self._fresh_buffers()
        if arrays:
            buffers = with_carried(buffers, self.table, unnamed('carried', Carried, arrays))
        self._arguments = self._arguments._replace(buffers=buffers)

    def contacts(self, state: State) -> np.ndarray:
        """Return what is near now, and what acted in the latest step."""
        return self.with_acted(current_manifolds(self._memory), super().contacts(state))

    def with_acted(self, manifolds: Manifolds, rows: np.ndarray) -> np.ndarray:
        """Return the rows of manifolds with what acted in the latest step, once one was taken."""
        acted = self._arguments.buffers.acted
        if acted.count[0] == 0:
            return rows
        return rows_of_acted(self._setup, manifolds, rows, acted)

    def report(self) -> ContactReport:
        """Return the counts, how well contact was solved, and what could not be done."""
        residual = float(self._arguments.buffers.system.residual[0])
        return self._counts()._replace(residual=residual, message=unresolved(self))


class JointedEvent(JointedTimestep):
    """Every collision at its own time; joints answer to it."""

    _run = staticmethod(jointed_steps.EVENT)

    def report(self) -> ContactReport:
        """Return the counts, and what could not be done."""
        done = super().report()
        if self._arguments.now.cut_short[0] == 0:
            return done
        message = (f'more than {jointed_event.MOST_EVENTS} collisions and hits of limits in one '
                   'step')
        return done._replace(message=f'{done.message}; {message}' if done.message else message)


class JointedPenalty(Touching, JointedMotion):
    """Springs and dampers at every contact point; joints answer to them."""

    def __init__(self, setup: Setup, joints: JointSetup) -> None:
        """Make room for no contacts yet."""
        Touching.__init__(self, setup)
        JointedMotion.__init__(self, setup.model, joints)
        basis = self._basis()
        self._arguments = jointed_penalty.JointedPenalty(
            self.arguments(basis.state, basis.wrenches), penalty.make_arguments(basis),
            *np.zeros((3, 1), dtype=np.int64))

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state, and count wrenches and commands down."""
        self.read(state)
        contact = self._arguments.contact
        contact = kept(contact._replace(state=state, wrenches=wrenches, memory=self._memory),
                       contact)
        c = self._arguments._replace(joints=self.arguments(state, wrenches), contact=contact)
        self._arguments, self._pack = jointed_penalty.advance(c, count, self._pack)
        self._memory = self._arguments.contact.memory

    def lasting(self) -> dict[str, np.ndarray]:
        """Return the manifolds, the bristles of friction, and the joints."""
        bristles = penalty.carried_over(self._arguments.contact)
        return (Touching.lasting(self) | named('bristle', bristles)
                | JointedMotion.lasting(self))

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to what `lasting` returned; nothing at all is the beginning."""
        Touching.recall(self, arrays)
        JointedMotion.recall(self, arrays)
        self._arguments = self._arguments._replace(contact=penalty.with_carried(
            self._arguments.contact, recalled_bristles(arrays)))

    def report(self) -> ContactReport:
        """Return the counts, and what could not be done."""
        return self._counts()._replace(message=unresolved(self))
