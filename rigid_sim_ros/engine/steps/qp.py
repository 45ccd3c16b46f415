# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The reference solver of the model `timestep`: all contacts of a step at once, for small scenes.

With the velocities v* that the forces alone would give the bodies, the impulses f of a step h make
the contacts move at u = A f + u*. They must not close more than their gaps, and obey Coulomb:

    u_n + max(gap, 0) / h >= 0,    f_n >= 0,    complementary;    |f_t| <= mu f_n against u_t.

That is the problem of resting_qp.py with velocities in place of accelerations, and is solved by
the means of contact_newton.py; OSQP helps where they do not do. Overlaps are pushed apart by
displacements of their own, as in the sequential solver, from the same problem without friction.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.basis import Basis
from rigid_sim_ros.engine.contact.collisions import collide_bodies
from rigid_sim_ros.engine.contact.contact_newton import FEW_STEPS, make_newton, number_bodies
from rigid_sim_ros.engine.contact.contact_rows import (
    make_rows, Rows, sweep_rows, violation, write_effects, write_rows)
from rigid_sim_ros.engine.contact.contact_solution import solve_contact_rows
from rigid_sim_ros.engine.contact.contacts import (
    Bodies, Contacts, gather_all, make_bodies, make_contacts, read_bodies, relative, to_contact,
    to_world)
from rigid_sim_ros.engine.contact.coulomb import COMPLIANCE, TOLERANCE
from rigid_sim_ros.engine.contact.impact_offsets import gap_now
from rigid_sim_ros.engine.contact.interior_point import make_interior
from rigid_sim_ros.engine.contact.resting_qp import effective_mass, Outcome, solve
from rigid_sim_ros.engine.detection.carried_impulses import clear_impulses
from rigid_sim_ros.engine.detection.detect import detect_within_margins
from rigid_sim_ros.engine.detection.manifolds import (
    current_manifolds, grown, latest_impulses, Manifolds, Memory, point_of_feature, StepImpulses)
from rigid_sim_ros.engine.detection.margins import set_margins
from rigid_sim_ros.engine.dynamics.free_flight import fly_free
from rigid_sim_ros.engine.dynamics.integrate import kick_by_change, sum_loads
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic, move_kinematic
from rigid_sim_ros.engine.dynamics.wrenches import count_down, Wrenches
from rigid_sim_ros.engine.maths.vector import cross, row
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.solver.arguments import (
    make_timestep_work, TimestepSettings, TimestepWork)
from rigid_sim_ros.engine.solver.partition import give_slots, mark_touching, take_sides
from rigid_sim_ros.engine.solver.solver_bodies import (
    begin_push, drift_bodies, INV_M, kick_bodies, load_bodies, SECOND_END, SolverBodies,
    store_bodies, STRIDE, TOUCHED)
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel


# For more points OSQP is not asked.
MOST_POINTS = 16
# Of the size of a shape: no overlap is displaced by more in a step.
MOST_PUSH = 0.03
PUSH_SWEEPS = 300  # for displacements: what they leave is for the next step


class QpReport(NamedTuple):
    """How the latest step was solved."""

    residual: float = 0.0  # violation of the conditions, relative to the largest |u*|
    iterations: int = 0  # of OSQP
    status: str = ''  # what OSQP said
    solved: bool = True


class QpWork:
    """Buffers, and the report of the latest step."""

    def __init__(self, model: Model, shapes: Shapes, memory: Memory) -> None:
        """Make room for a world whose manifolds live in `memory`."""
        self.shared: TimestepWork = make_timestep_work(model, shapes, memory)
        self.bodies: Bodies = make_bodies(len(model.m))
        self.prescribed: Array = np.zeros((6, len(model.m)))
        self.awake: IntArray = np.zeros(len(model.m), dtype=np.int64)  # no body sleeps
        self.contacts: Contacts = make_contacts(16)
        self.report = QpReport()


class QpArguments(NamedTuple):
    """What a step reads and writes."""

    model: Model
    state: State
    wrenches: Wrenches
    shapes: Shapes
    materials: Materials
    memory: Memory
    settings: TimestepSettings
    work: QpWork


def step(c: QpArguments) -> QpArguments:
    """Take a step; return the arguments, whose buffers may have grown."""
    begin_kinematic(c.model, c.state)
    c = find_contacts(c)
    sum_loads(c.model, c.state, c.wrenches, c.work.shared.loads)
    bounce(c)
    load_solver(c)
    chosen = choose_points(c)
    impulses, pushes = solve_contacts(c, chosen)
    move_bodies(c, chosen, impulses, pushes)
    apply_later_forces(c)
    end_kinematic(c.model, c.state)
    count_down(c.wrenches)
    return c


def advance(c: QpArguments, count: int) -> QpArguments:
    """
    Advance the state by `count` steps; return the arguments, whose buffers may have grown.

    What could not be solved is applied as far as it came, and said in `work.report`.
    """
    for _ in range(count):
        c = step(c)
    return c


def make_arguments(basis: Basis, settings: TimestepSettings) -> QpArguments:
    """Return the arguments of a world with buffers of their own."""
    return QpArguments(*basis, settings, QpWork(basis.model, basis.shapes, basis.memory))


def find_contacts(c: QpArguments) -> QpArguments:
    """Find the manifolds of what may touch within the step; return arguments with room for all."""
    model, state, shapes, memory, work = c.model, c.state, c.shapes, c.memory, c.work
    set_margins(model, model.h, state, c.settings.margin, work.shared.radius,
                work.shared.thickness, shapes, memory, 0, shapes.body.shape[0])
    while not detect_within_margins(model, state, shapes, memory, None):
        memory = grown(memory)
    if len(memory.pages[0].shape_a) > len(work.shared.collision.rows):
        work.shared = make_timestep_work(model, shapes, memory)
    clear_impulses(current_manifolds(memory), latest_impulses(memory))
    return c._replace(memory=memory)


def bounce(c: QpArguments) -> None:
    """Give colliding bodies their impulses, at the time at which they meet."""
    model, shared = c.model, c.work.shared
    manifolds = current_manifolds(c.memory)
    shared.collision.activity[:] = 0
    if collide_bodies(model.h, model.inv_m, model.inv_I_C, c.state, shared.loads.F, c.shapes,
                      c.materials, manifolds, latest_impulses(c.memory), shared.collision) > 0:
        _move_gaps(manifolds, shared.collision.body)
    mark_touching(manifolds, shared.collision.activity, c.memory.touching)


def load_solver(c: QpArguments) -> None:
    """Give what touches its slot in the solver, with the velocities that the forces alone give."""
    model, state, work = c.model, c.state, c.work
    shared, bodies = work.shared, work.shared.solver.bodies
    # What moves by its twist has no slot: its velocity is in `work.bodies`.
    take_sides(model.inv_m, work.prescribed, state.x, work.awake, 0, len(model.m),
               shared.solver.sides, bodies.slot, bodies.flies)
    give_slots(0, shared.solver.sides, c.memory.touching, bodies)
    load_bodies(0, 0.0, model.gravity, model.inv_m, model.inv_I_C, state, shared.loads, bodies)
    read_bodies(model, state, shared.loads.F, shared.loads.tau, work.bodies)
    kick_bodies(0, bodies.used, bodies.motion, bodies.smooth, False, bodies.base, model.h)
    begin_push(0, bodies.used[SECOND_END], bodies.motion, bodies.drifted)


def move_bodies(c: QpArguments, chosen: IntArray, impulses: Array, pushes: Array) -> None:
    """Move all bodies by a step, with the impulses of the chosen points."""
    model, state, shared = c.model, c.state, c.work.shared
    bodies, contacts = shared.solver.bodies, c.work.contacts
    _drift_by_the_end(state, model.inv_m, model.h, contacts, chosen, impulses, bodies)
    drift_bodies(0, bodies.used, bodies.motion, bodies.drifted, bodies.total, bodies.smooth,
                 False, bodies.base, model.h, True)
    _give_back(contacts, chosen, impulses, pushes, model.h, bodies)
    store_bodies(0, 0, len(model.m), model.h, model.m, model.inv_m, model.inv_I_C, state, bodies,
                 1)
    fly_free(model, state, shared.loads, bodies.flies, model.h, shared.block)
    move_kinematic(model, state, model.h)


def apply_later_forces(c: QpArguments) -> None:
    """Kick by half of the change of the loads, as in the symplectic method: at the new poses."""
    shared = c.work.shared
    sum_loads(c.model, c.state, c.wrenches, shared.later)
    kick_by_change(c.state, shared.loads, shared.later, c.model.h)


@kernel
def _move_gaps(manifolds: Manifolds, moved: Array) -> None:
    """Bring the gaps to where collisions moved the bodies."""
    for r in range(manifolds.count[0]):
        for p in range(manifolds.points[r]):
            manifolds.gap[p, r] = gap_now(manifolds, moved, r, p)


def choose_points(c: QpArguments) -> IntArray:
    """Write the points to `work.contacts` and return those that the solver looks at."""
    model, work = c.model, c.work
    while True:
        found = gather_all(c.state, current_manifolds(c.memory), c.shapes, c.materials,
                           float('inf'), work.contacts)
        if found <= len(work.contacts.gap):
            break
        work.contacts = make_contacts(2 * found)
    contacts = work.contacts
    rows = contacts.manifold[:found]
    moves = model.inv_m[contacts.body_a[:found]] + model.inv_m[contacts.body_b[:found]] > 0.0
    return np.nonzero(moves & (work.shared.collision.activity[rows] == 0))[0]


def solve_contacts(c: QpArguments, chosen: IntArray) -> tuple[Array, Array]:
    """
    Find the impulses of the chosen points, and let the bodies feel them.

    Returns them, and those that only displace, (3m,) triples in the axes n, t1, t2.
    """
    model, work, manifolds = c.model, c.work, current_manifolds(c.memory)
    contacts, m, count = work.contacts, len(chosen), int(manifolds.count[0])
    manifolds.friction[:count] = 0.0
    manifolds.spin[:count] = 0.0
    work.report = QpReport()
    if m == 0:
        manifolds.impulse[:, :count] = 0.0
        return np.zeros(0), np.zeros(0)
    rows = make_rows(m, 3 * m, len(model.m))
    write_rows(model, contacts, work.bodies, chosen, 3, COMPLIANCE, rows)
    _free_velocities(contacts, chosen, work.shared.solver.bodies, work.bodies, rows.b)
    rows.b[::3] += np.maximum(contacts.gap[chosen], 0.0) / model.h
    _read_impulses(manifolds, contacts, chosen, rows.f)
    f = _find_impulses(model, chosen, rows, work)
    _push(contacts, chosen, f, work.shared.solver.bodies, work.shared.solver.bodies.motion)
    manifolds.impulse[:, :count] = 0.0
    _write_impulses(manifolds, latest_impulses(c.memory), contacts, chosen, f)
    return f, _push_apart(c, chosen, rows, f)


def _find_impulses(model: Model, chosen: IntArray, rows: Rows, work: QpWork) -> Array:
    """Return the impulses by Newton's method, by OSQP where that does not do; report how."""
    contacts, m = work.contacts, len(chosen)
    newton = make_newton(m, 3 * m, len(model.m), len(model.m))
    interior = make_interior(m, 3 * m, len(model.m))
    touched = number_bodies(contacts, chosen, model.inv_m, newton.slot)
    worst = float(solve_contact_rows(rows, m, 3, touched, FEW_STEPS, False,
                                     np.zeros(3 * m), newton, interior))
    outcome = Outcome(worst, worst <= TOLERANCE, '', 0)
    if not outcome.solved and m <= MOST_POINTS:
        A = np.zeros((3 * m, 3 * m))
        effective_mass(model, contacts, work.bodies, chosen, m, 3, np.zeros((2, 3 * m, 3)), A)
        rows.f[:], outcome = solve(A, rows.b, contacts.friction[chosen], rows.f)
    work.report = QpReport(outcome.residual, outcome.osqp_iterations, outcome.status,
                           outcome.solved)
    return rows.f.copy()


def _push_apart(c: QpArguments, chosen: IntArray, rows: Rows, f: Array) -> Array:
    """Displace what overlaps in spite of the impulses f; return what does it, (3m,)."""
    contacts, bodies, m, h = c.work.contacts, c.work.shared.solver.bodies, len(chosen), c.model.h
    push = c.settings.sequential.push / h
    wanted = np.minimum(-push * np.minimum(contacts.gap[chosen], 0.0),
                        MOST_PUSH * contacts.size[chosen] / h)
    violation(rows, m, 3, f)
    # Not what leaves its overlap by itself.
    wanted -= np.maximum(rows.a[::3], 0.0)
    displaced = np.zeros(3 * m)
    if (wanted > 0.0).any():
        rows.mu[:] = 0.0
        rows.b[::3] = -wanted
        write_effects(rows, m, 3, displaced)
        sweep_rows(rows, m, 3, displaced, PUSH_SWEEPS, 1e-9 * float(wanted.max()))
        _push(contacts, chosen, displaced, bodies, bodies.drifted)
    return displaced


@kernel
def _drift_by_the_end(state: State, inv_m: Array, h: float, contacts: Contacts, chosen: IntArray,
                      f: Array, bodies: SolverBodies) -> None:
    """
    Let some bodies drift by the velocity at the end of the step, not by a mean.

    Those that an impact stopped: it changes a velocity by more than twice what the forces alone
    would in a step. And those that press against another one that moves: their impulses act at the
    start, so the pair keeps its angular momentum.
    """
    for slot in range(1, bodies.used[SECOND_END]):
        i, at = bodies.body[slot], slot * STRIDE
        changed, pulled = 0.0, 0.0
        for k in range(3):
            changed += (bodies.motion[at + k] - inv_m[i] * state.P[k, i]) ** 2
            pulled += (h * bodies.smooth[at + k]) ** 2
        if changed > 4.0 * pulled:
            _mark(slot, h, bodies)
    for c in range(chosen.shape[0]):
        slot_a = bodies.slot[contacts.body_a[chosen[c]]]
        slot_b = bodies.slot[contacts.body_b[chosen[c]]]
        if slot_a > 0 and slot_b > 0 and f[3 * c] > 0.0:
            _mark(slot_a, h, bodies)
            _mark(slot_b, h, bodies)


@kernel
def _mark(slot: int, h: float, bodies: SolverBodies) -> None:
    at = slot * STRIDE
    for k in range(INV_M):
        bodies.base[at + k] = bodies.motion[at + k] + h * bodies.smooth[at + k]


@kernel
def _give_back(contacts: Contacts, chosen: IntArray, f: Array, pushes: Array, h: float,
               solver: SolverBodies) -> None:
    """
    Take half of the L that a pair gained when a push displaced its momenta from each body.

    Bodies that press against each other are marked as held.
    """
    for c in range(chosen.shape[0]):
        k = chosen[c]
        slot_a, slot_b = solver.slot[contacts.body_a[k]], solver.slot[contacts.body_b[k]]
        at_a, at_b = slot_a * STRIDE, slot_b * STRIDE
        if max(f[3 * c], pushes[3 * c]) > 0.0:
            solver.drifted[at_a + TOUCHED] = solver.drifted[at_b + TOUCHED] = 1.0
        if slot_a == 0 or slot_b == 0:
            continue
        if pushes[3 * c] > 0.0:
            v = (solver.drifted[at_b] - solver.drifted[at_a],
                 solver.drifted[at_b + 1] - solver.drifted[at_a + 1],
                 solver.drifted[at_b + 2] - solver.drifted[at_a + 2])
            gained = cross(to_world(contacts, k, (h * pushes[3 * c], 0.0, 0.0)), v)
            for i in range(3):
                solver.motion[at_a + 3 + i] -= 0.5 * gained[i]
                solver.motion[at_b + 3 + i] -= 0.5 * gained[i]


@kernel
def _free_velocities(contacts: Contacts, chosen: IntArray, solver: SolverBodies, bodies: Bodies,
                     b: Array) -> None:
    """Write u* of the chosen points in the axes n, t1, t2; changes `bodies.velocity` to v*."""
    for slot in range(1, solver.used[SECOND_END]):
        i, at = solver.body[slot], slot * STRIDE
        for k in range(3):
            bodies.velocity[i, k] = solver.motion[at + k]
            w = 0.0
            for j in range(3):
                w += bodies.inv_I_W[i, k, j] * solver.motion[at + 3 + j]
            bodies.velocity[i, 3 + k] = w
    for c in range(chosen.shape[0]):
        u = to_contact(contacts, chosen[c], relative(bodies.velocity, contacts, chosen[c]))
        b[3 * c], b[3 * c + 1], b[3 * c + 2] = u


@kernel
def _push(contacts: Contacts, chosen: IntArray, f: Array, solver: SolverBodies,
          motion: Array) -> None:
    """Add the impulses, triples in the axes n, t1, t2, to the motion of the bodies."""
    for c in range(chosen.shape[0]):
        k = chosen[c]
        J = to_world(contacts, k, (f[3 * c], f[3 * c + 1], f[3 * c + 2]))
        slot_a, slot_b = solver.slot[contacts.body_a[k]], solver.slot[contacts.body_b[k]]
        _push_slot(slot_a, -1.0, row(contacts.r_A, k), J, solver.mass, motion)
        _push_slot(slot_b, 1.0, row(contacts.r_B, k), J, solver.mass, motion)


@kernel
def _push_slot(slot: int, sign: float, r: Vector, J: Vector, mass: Array, motion: Array) -> None:
    if slot > 0:
        turn, at = cross(r, J), slot * STRIDE
        inv_m = mass[at + INV_M]
        for i in range(3):
            motion[at + i] += sign * inv_m * J[i]
            motion[at + 3 + i] += sign * turn[i]


@kernel
def _read_impulses(manifolds: Manifolds, contacts: Contacts, chosen: IntArray, f: Array) -> None:
    """Write the normal impulses of the last step, to begin with."""
    for c in range(chosen.shape[0]):
        r = contacts.manifold[chosen[c]]
        p = point_of_feature(manifolds, r, contacts.feature[chosen[c]])
        f[3 * c] = manifolds.impulse[p, r]


@kernel
def _write_impulses(manifolds: Manifolds, acted: StepImpulses, contacts: Contacts,
                    chosen: IntArray, f: Array) -> None:
    """Keep the impulses of this step, and add them to those of its collisions."""
    for c in range(chosen.shape[0]):
        r = contacts.manifold[chosen[c]]
        p = point_of_feature(manifolds, r, contacts.feature[chosen[c]])
        manifolds.impulse[p, r] = f[3 * c]
        acted.normal[p, r] += f[3 * c]
        tangential = to_world(contacts, chosen[c], (0.0, f[3 * c + 1], f[3 * c + 2]))
        for k in range(3):
            manifolds.friction[r, k] += tangential[k]
            acted.friction[r, k] += tangential[k]
