# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The contact models behind one interface: advance, report, and hand over what must be saved.

Each holds its buffers and what it remembers of the contacts; the state of the bodies is the
caller's. What is remembered and influences later steps is part of a world's dynamic state.
"""

from collections.abc import Callable, Mapping
import math
from typing import Any, NamedTuple, Protocol

import numpy as np

from rigid_sim_ros.engine.constraints.pressing import (
    carried_over, make_pressing, Pressing, WIDTH, with_carried)
from rigid_sim_ros.engine.contact.carried_forces import Carried, no_forces
from rigid_sim_ros.engine.contact.contacts import row_count
from rigid_sim_ros.engine.contact.penalty_force import PenaltySettings
from rigid_sim_ros.engine.detection.manifolds import (
    CONTACTS, current_manifolds, earlier_manifolds, empty_memory, lasting, Manifolds, Memory,
    PAIRS, POINTS, slice_in_use, with_lasting, WITNESSED)
from rigid_sim_ros.engine.dynamics.integrate import make_work, ORIENTATIONS
from rigid_sim_ros.engine.dynamics.wrenches import no_wrenches, Wrenches
from rigid_sim_ros.engine.events.buffers import EventSettings
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import can_meet, Materials, Shapes
from rigid_sim_ros.engine.solver.arguments import (
    Arguments, make_arguments, radii, SequentialSettings, thicknesses, TimestepSettings, with_cut)
from rigid_sim_ros.engine.solver.partition import Cut
from rigid_sim_ros.engine.state.state import empty_state, State
from rigid_sim_ros.engine.steps import event, jointed_contact, jointed_timestep, penalty, qp, timestep
from rigid_sim_ros.engine.steps.free import FREE_MOTION, FreeArguments
from rigid_sim_ros.engine.steps.jointed_motion import JointedMotion, JointSetup
from rigid_sim_ros.kernels.argument_pack import ArgumentPack, packed
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.helper_process import cores
from rigid_sim_ros.kernels.second_core import Helper, make_job

CONTACT = np.dtype([
    ('body_a', np.int64), ('body_b', np.int64), ('point', np.float64, 3),
    ('normal', np.float64, 3), ('gap', np.float64), ('normal_force', np.float64),
    ('friction_force', np.float64, 3)])


class Setup(NamedTuple):
    """What a contact model is made of."""

    model: Model
    shapes: Shapes
    materials: Materials
    integrator: str  # for bodies that nothing touches
    orientation: str
    solver: str  # of the model `timestep`
    substeps: int
    sleep_after: float  # [s] at rest, of the sequential solver; 0: nothing sleeps
    joints: JointSetup | None = None


class ContactReport(NamedTuple):
    """What the latest step did, for people and for diagnostics."""

    # pairs of shapes whose bounding boxes overlap, of spheres the balls in them
    pairs: int = 0
    witnessed: int = 0  # of these, found apart by the plane that separated them before
    contacts: int = 0  # points of all manifolds
    deepest: float = 0.0  # [m] overlap
    asleep: int = 0  # bodies that sleep
    residual: float = 0.0  # of the solver, in its own measure
    iterations: int = 0  # of the solver
    message: str = ''  # what the solver could not do


class ContactModel(Protocol):
    """One way to let bodies touch."""

    def use_threads(self, count: int) -> None:
        """Use up to so many threads from now on; results do not depend on it."""

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state by some steps, and count the wrenches down."""

    def lasting(self) -> dict[str, np.ndarray]:
        """Return copies of all that influences later steps besides the state, by name."""

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to what `lasting` returned; nothing at all is the beginning."""

    def report(self) -> ContactReport:
        """Return what the latest step did."""

    def contacts(self, state: State) -> np.ndarray:
        """Return the contacts of the latest step, a structured array of CONTACT."""


class _OneThread:

    def use_threads(self, count: int) -> None:
        """Go on with one: this model has no work for others."""


class FreeMotion(_OneThread):
    """No contacts: bodies pass through each other."""

    def __init__(self, setup: Setup) -> None:
        """Choose the integrator."""
        self._model = setup.model
        self._advance = FREE_MOTION[setup.integrator]
        self._orientation = ORIENTATIONS.index(setup.orientation)
        self._work = make_work(len(setup.model.m))
        self._pack: ArgumentPack | None = None

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state."""
        self._pack = packed(FreeArguments(self._model, state, wrenches, self._work), self._pack)
        self._pack.run(self._advance, self._orientation, count)

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


class Jointed(_OneThread, JointedMotion):
    """No contacts, but joints between the bodies."""

    def report(self) -> ContactReport:
        """Return what could not be done."""
        message = ''
        if self.unresolved:
            message = (f'{self.unresolved} parts of steps were too long for the motion of joints: '
                       'use a smaller step')
        return ContactReport(message=message)

    def contacts(self, state: State) -> np.ndarray:
        """Return no rows."""
        return np.zeros(0, dtype=CONTACT)


def _named(prefix: str, fields: Any) -> dict[str, np.ndarray]:
    """Return copies of the arrays of a NamedTuple under names of their own in a saved world."""
    return {f'{prefix}_{name}': array.copy() for name, array in fields._asdict().items()}


def _unnamed(prefix: str, kind: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """Return the NamedTuple of this kind whose arrays `_named` returned."""
    return kind._make(arrays[f'{prefix}_{name}'].copy() for name in kind._fields)


class _Touching(_OneThread):
    """What the models with contacts share: the memory of detection."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._memory = self._fresh()

    def _fresh(self) -> Memory:
        return empty_memory(len(self._setup.model.m), len(self._setup.shapes.body))

    def lasting(self) -> dict[str, np.ndarray]:
        """Return the manifolds in use."""
        return _named('manifold', Manifolds._make(lasting(self._memory)))

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to manifolds that `lasting` returned."""
        memory = self._fresh()
        if arrays:
            memory = with_lasting(memory, _unnamed('manifold', Manifolds, arrays))
        self._memory = memory

    def contacts(self, state: State) -> np.ndarray:
        """Return the manifolds of the latest step with its impulses as forces."""
        manifolds = current_manifolds(self._memory)
        return _rows(self._setup, state, manifolds, manifolds.impulse.T, manifolds.friction)

    def _counts(self) -> ContactReport:
        manifolds = current_manifolds(self._memory)
        rows, counters = slice_in_use(manifolds), self._memory.counters
        used = np.arange(POINTS)[:, None] < manifolds.points[rows]
        gaps = manifolds.gap[:, rows][used]
        return ContactReport(int(counters[PAIRS]), int(counters[WITNESSED]),
                             int(counters[CONTACTS]), float(max(0.0, -gaps.min(initial=0.0))))


# Of `Rest`, what influences later steps.
_REST = ('steps', 'asleep', 'pose', 'load')


class Timestep(_Touching):
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
        s = self._setup
        n = len(s.model.m)
        return make_arguments(s.model, empty_state(n), no_wrenches(), s.shapes, s.materials,
                              self._memory, self._settings)

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
        arrays = super().lasting() | _named('cut', c.work.solver.sides.cut)
        if self._settings.sleep_steps > 0:
            arrays |= {f'rest_{name}': getattr(c.rest, name).copy() for name in _REST}
        return arrays

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to manifolds that `lasting` returned."""
        super().recall(arrays)
        c = self._begin()._replace(job=self._arguments.job)
        if arrays:
            with_cut(c.work, _unnamed('cut', Cut, arrays))
        for name in _REST if arrays and self._settings.sleep_steps > 0 else ():
            getattr(c.rest, name)[...] = arrays[f'rest_{name}']
        self._arguments, self._has_stepped = c, False

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state."""
        c = self._arguments
        if c.state is not state or c.wrenches is not wrenches:
            c = c._replace(state=state, wrenches=wrenches)
        self._arguments, self._pack = timestep.advance(c, count, self._pack, self._helper)
        self._memory = self._arguments.memory
        self._has_stepped = self._has_stepped or count > 0

    def contacts(self, state: State) -> np.ndarray:
        """Return the manifolds of the latest step with all its impulses, collisions included."""
        if not self._has_stepped:  # after `recall` the impulses of the last substep are known
            return super().contacts(state)
        acted = earlier_manifolds(self._memory)
        return _rows(self._setup, state, current_manifolds(self._memory), acted.impulse.T,
                     acted.friction)

    def report(self) -> ContactReport:
        """Return the counts, and the largest change of a contact's velocity in the last sweep."""
        c = self._arguments
        return self._counts()._replace(residual=float(c.work.solver.residual[0]),
                                       iterations=self._settings.sequential.substeps,
                                       asleep=int(c.rest.asleep.sum()))


class VelocityQp(_Touching):
    """Velocity level, all contacts at once by OSQP: the reference for small scenes."""

    def __init__(self, setup: Setup) -> None:
        """Make room for no contacts yet."""
        super().__init__(setup)
        self._settings = TimestepSettings()
        self._work = qp.QpWork(setup.model, setup.shapes, self._memory)

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state."""
        s = self._setup
        self._memory = qp.advance(
            s.model, state, wrenches, s.shapes, s.materials, self._memory, self._settings,
            self._work, count)

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to manifolds that `lasting` returned."""
        super().recall(arrays)
        self._work = qp.QpWork(self._setup.model, self._setup.shapes, self._memory)

    def report(self) -> ContactReport:
        """Return the counts and what OSQP said."""
        done = self._work.report
        message = '' if done.solved else f'OSQP left a contact problem unsolved: {done.status}'
        return self._counts()._replace(residual=done.residual, iterations=done.iterations,
                                       message=message)


class Event(_Touching):
    """The classic algorithm: every collision at its own time, resting contact by a QP."""

    def __init__(self, setup: Setup) -> None:
        """Make room for no contacts yet."""
        super().__init__(setup)
        self._settings = EventSettings()
        self._work = event.EventWork(len(setup.model.m), len(setup.shapes.body))

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state."""
        s = self._setup
        self._memory = event.advance(s.model, state, wrenches, s.shapes, s.materials,
                                     self._memory, self._settings, self._work, count)

    def lasting(self) -> dict[str, np.ndarray]:
        """Return the manifolds and the forces of the last step."""
        return super().lasting() | _named('carried', self._work.carried)

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to manifolds and forces that `lasting` returned."""
        super().recall(arrays)
        self._work.carried = (_unnamed('carried', Carried, arrays) if arrays
                              else no_forces())

    def report(self) -> ContactReport:
        """Return the counts and what OSQP said."""
        done = self._work.report
        message = ''
        if done.unsolved:
            message = (f'{done.unsolved} contact problems were left with a residual of '
                       f'{done.residual:.1e}')
        elif done.cut_short:
            message = f'more than {self._settings.max_events} collisions in one step'
        # Not only where the step began: the deepest of all times at which it was interrupted.
        return self._counts()._replace(deepest=done.deepest, residual=done.residual,
                                       message=message)


class Penalty(_Touching):
    """Springs and dampers at every contact point."""

    def __init__(self, setup: Setup) -> None:
        """Make room for no contacts yet."""
        super().__init__(setup)
        self._settings = PenaltySettings()
        self._work = penalty.PenaltyWork(len(setup.model.m))

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state."""
        s = self._setup
        self._memory = penalty.advance(s.model, state, wrenches, s.shapes, s.materials,
                                       self._memory, self._settings, self._work, count)

    def lasting(self) -> dict[str, np.ndarray]:
        """Return the manifolds and the bristles of friction."""
        return super().lasting() | _named('bristle', self._work.lasting())

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to manifolds and bristles that `lasting` returned."""
        super().recall(arrays)
        self._work.bristles = (_unnamed('bristle', penalty.Bristles, arrays) if arrays
                               else penalty.no_bristles())

    def report(self) -> ContactReport:
        """Return the counts; springs need no solver."""
        return self._counts()


class JointedTouching(_Touching, JointedMotion):
    """Velocity level, all impulses of an island at once; joints answer to them."""

    _run = staticmethod(jointed_timestep.run)

    def __init__(self, setup: Setup, joints: JointSetup) -> None:
        """Make room for no contacts yet."""
        _Touching.__init__(self, setup)
        JointedMotion.__init__(self, setup.model, joints)
        shapes, n = setup.shapes, len(setup.model.m)
        self._arguments = jointed_contact.JointedContact(
            self.arguments(empty_state(n), no_wrenches()), shapes, setup.materials, self._memory,
            radii(shapes, n), thicknesses(shapes), self._no_pressing(),
            np.zeros(8, dtype=np.int64), np.zeros(3))

    def _no_pressing(self) -> Pressing:
        s = self._setup
        pressing = make_pressing(self.table, len(s.model.m), 64, 64, 48)
        pressing.count[WIDTH] = row_count(s.materials)
        return pressing

    def advance(self, state: State, wrenches: Wrenches, count: int) -> None:
        """Advance the state, and count wrenches and commands down."""
        self.read(state)
        c = self._arguments._replace(joints=self.arguments(state, wrenches), memory=self._memory)
        self._arguments, self._pack = jointed_contact.advance(self._run, c, count, self._pack)
        self._memory = self._arguments.memory

    def lasting(self) -> dict[str, np.ndarray]:
        """Return the manifolds, the impulses from which the next step begins, and the joints."""
        carried = carried_over(self._arguments.pressing)
        return (_Touching.lasting(self) | _named('carried', carried)
                | JointedMotion.lasting(self))

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to what `lasting` returned; nothing at all is the beginning."""
        _Touching.recall(self, arrays)
        JointedMotion.recall(self, arrays)
        pressing = self._no_pressing()
        if arrays:
            pressing = with_carried(pressing, self.table, _unnamed('carried', Carried, arrays))
        self._arguments = self._arguments._replace(pressing=pressing)

    def report(self) -> ContactReport:
        """Return the counts, how well contact was solved, and what could not be done."""
        message = Jointed.report(self).message  # type: ignore[arg-type]
        return self._counts()._replace(
            residual=float(self._arguments.pressing.system.residual[0]), message=message)


def _rows(setup: Setup, state: State, manifolds: Manifolds, normal: Array,
          friction: Array) -> np.ndarray:
    """
    Return a row for each contact point, with the impulses (c, 4) and (c, 3) [N s] as forces.

    The friction of a manifold is shared out over its points as their normal forces are.
    """
    in_use = slice_in_use(manifolds)
    used = np.arange(POINTS) < manifolds.points[in_use, None]
    r, p = np.nonzero(used)
    r += in_use.start
    rows = np.zeros(len(r), dtype=CONTACT)
    a, b = manifolds.body_a[r], manifolds.body_b[r]
    x: Array = state.x.T
    rows['body_a'], rows['body_b'] = a, b
    rows['point'] = 0.5 * (x[a] + manifolds.r_A[p, r] + x[b] + manifolds.r_B[p, r])
    rows['normal'] = manifolds.normal[r]
    rows['gap'] = manifolds.gap[p, r]
    impulses = normal[r, p]
    totals = np.bincount(r, impulses, minlength=in_use.stop)[r]
    share = np.divide(impulses, totals, out=np.zeros(len(r)), where=totals > 0.0)
    rows['normal_force'] = impulses / setup.model.h
    rows['friction_force'] = friction[r] * share[:, None] / setup.model.h
    return rows


# By contact and solver; the others have but one way to solve, whatever the solver is called.
CONTACT_MODELS: dict[tuple[str, str], Callable[[Setup], Any]] = {
    ('none', ''): FreeMotion,
    ('event', ''): Event,
    ('penalty', ''): Penalty,
    ('timestep', 'sequential'): Timestep,
    ('timestep', 'qp'): VelocityQp,
}


def make_contact_model(name: str, setup: Setup) -> ContactModel:
    """
    Return the contact model of this name.

    Where nothing can meet anything every model moves bodies by the method `symplectic`; another
    integrator, which only free motion has, is a choice of that.
    """
    if setup.joints is not None:
        touches = name != 'none' and can_meet(setup.shapes)
        return (JointedTouching(setup, setup.joints) if touches
                else Jointed(setup.model, setup.joints))
    if setup.integrator != 'symplectic' and not can_meet(setup.shapes):
        name = 'none'
    solver = setup.solver if name == 'timestep' else ''
    contact_model: ContactModel = CONTACT_MODELS[name, solver](setup)
    return contact_model
