# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What every contact model is to the world: it advances, reports, and hands over what must be saved.

Each holds its buffers and what it remembers of the contacts; the state of the bodies is the
caller's. What is remembered and influences later steps is part of a world's dynamic state.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from rigid_sim_ros.engine.contact.basis import Basis
from rigid_sim_ros.engine.contact.recorded_impulses import Acted
from rigid_sim_ros.engine.detection.manifolds import (
    CONTACTS, current_manifolds, empty_memory, lasting, Manifolds, Memory, PAIRS, POINTS,
    slice_in_use, with_lasting, WITNESSED)
from rigid_sim_ros.engine.dynamics.wrenches import no_wrenches, Wrenches
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.state.state import empty_state, State
from rigid_sim_ros.engine.steps.jointed_motion import JointSetup
from rigid_sim_ros.kernels.arrays import Array

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
    iterations: int = 0  # of OSQP where it was asked; of the sequential solver its substeps
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


class OneThread:
    """A model that has no work for other threads."""

    def use_threads(self, count: int) -> None:
        """Go on with one: this model has no work for others."""


def named(prefix: str, fields: Any) -> dict[str, np.ndarray]:
    """Return copies of the arrays of a NamedTuple under names of their own in a saved world."""
    return {f'{prefix}_{name}': array.copy() for name, array in fields._asdict().items()}


def unnamed(prefix: str, kind: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """Return the NamedTuple of this kind whose arrays `named` returned."""
    return kind._make(arrays[f'{prefix}_{name}'].copy() for name in kind._fields)


class Touching(OneThread):
    """What the models with contacts share: the memory of detection."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._memory = self._fresh()

    def _fresh(self) -> Memory:
        return empty_memory(len(self._setup.model.m), len(self._setup.shapes.body))

    def _basis(self) -> Basis:
        """Return the world as contact models are built: any state, and the present memory."""
        s = self._setup
        return Basis(s.model, empty_state(len(s.model.m)), no_wrenches(), s.shapes, s.materials,
                     self._memory)

    def lasting(self) -> dict[str, np.ndarray]:
        """Return the manifolds in use."""
        return named('manifold', Manifolds._make(lasting(self._memory)))

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to manifolds that `lasting` returned."""
        memory = self._fresh()
        if arrays:
            memory = with_lasting(memory, unnamed('manifold', Manifolds, arrays))
        self._memory = memory

    def contacts(self, state: State) -> np.ndarray:
        """Return the manifolds of the latest step with its impulses as forces."""
        manifolds = current_manifolds(self._memory)
        return rows_of(self._setup, state, manifolds, manifolds.impulse.T, manifolds.friction)

    def _counts(self) -> ContactReport:
        manifolds = current_manifolds(self._memory)
        rows, counters = slice_in_use(manifolds), self._memory.counters
        used = np.arange(POINTS)[:, None] < manifolds.points[rows]
        gaps = manifolds.gap[:, rows][used]
        return ContactReport(int(counters[PAIRS]), int(counters[WITNESSED]),
                             int(counters[CONTACTS]), float(max(0.0, -gaps.min(initial=0.0))))


def rows_of(setup: Setup, state: State, manifolds: Manifolds, normal: Array,
            friction: Array) -> np.ndarray:
    """
    Return a row for each contact point, with the impulses (c, 4) and (c, 3) [N s] as forces.

    The friction of a manifold is shared out over its points as their normal forces are.
    """
    r, p = _points_in_use(manifolds)
    rows = np.zeros(len(r), dtype=CONTACT)
    a, b = manifolds.body_a[r], manifolds.body_b[r]
    x: Array = state.x.T
    rows['body_a'], rows['body_b'] = a, b
    rows['point'] = 0.5 * (x[a] + manifolds.r_A[p, r] + x[b] + manifolds.r_B[p, r])
    rows['normal'] = manifolds.normal[r]
    rows['gap'] = manifolds.gap[p, r]
    impulses = normal[r, p]
    totals = np.bincount(r, impulses, minlength=len(manifolds.points))[r]
    share = np.divide(impulses, totals, out=np.zeros(len(r)), where=totals > 0.0)
    rows['normal_force'] = impulses / setup.model.h
    rows['friction_force'] = friction[r] * share[:, None] / setup.model.h
    return rows


def _points_in_use(manifolds: Manifolds) -> tuple[np.ndarray, np.ndarray]:
    """Return row and number of each point, in their order."""
    in_use = slice_in_use(manifolds)
    r, p = np.nonzero(np.arange(POINTS) < manifolds.points[in_use, None])
    return r + in_use.start, p


def rows_of_acted(setup: Setup, manifolds: Manifolds, rows: np.ndarray,
                  acted: Acted) -> np.ndarray:
    """
    Return the rows of these manifolds with what acted in their place, and rows for what is gone.

    What acted at a point that its manifold does not have any more counts at the first point of
    that. Rows on which nothing acted have the forces that they had.
    """
    r, p = _points_in_use(manifolds)
    shapes = list(zip(manifolds.shape_a[r].tolist(), manifolds.shape_b[r].tolist(), strict=True))
    first = {pair: len(shapes) - n for n, pair in enumerate(reversed(shapes), 1)}
    places = dict(zip(zip(shapes, manifolds.feature[p, r].tolist(), strict=True),
                      range(len(shapes)), strict=True))
    count = int(acted.count[0])
    pairs = zip(acted.shape_a[:count].tolist(), acted.shape_b[:count].tolist(), strict=True)
    at = np.array([places.get((pair, feature), first.get(pair, -1)) for pair, feature in zip(
        pairs, acted.feature[:count].tolist(), strict=True)])
    gone = at < 0
    at[gone] = len(rows) + np.arange(np.count_nonzero(gone))
    found = np.concatenate([rows, np.zeros(np.count_nonzero(gone), dtype=CONTACT)])
    for name in ('body_a', 'body_b', 'point', 'normal', 'gap'):
        found[name][at[gone]] = getattr(acted, name)[:count][gone]
    force = np.zeros((len(found), 3))
    np.add.at(force, at, acted.impulse[:count] / setup.model.h)
    at = np.unique(at)
    n = found['normal'][at]
    # Not below 0 by the rounding of a point that pressed on nothing.
    normal_force = np.maximum((force[at] * n).sum(axis=1), 0.0)
    found['normal_force'][at] = normal_force
    found['friction_force'][at] = force[at] - normal_force[:, None] * n
    return found
