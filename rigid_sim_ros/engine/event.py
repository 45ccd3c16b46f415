# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Contact model `event`: the classic algorithm, event by event.

"current state, compute new state, detect collisions and backtrack, collision state, compute and
apply impulses, post-collision state, compute and apply constraint forces, next state" (Meyer,
Rigid Body Dynamics, "Simulation Algorithm"). The contact forces of the present state act on the
way to the new one, so a step runs through that circle from the impulses on: impulses, forces, new
state, backtrack, and again from the collision until the step is over.

Points of contact by the rate u_n of their gap: colliding below -resting_speed (impulse.py),
separating above 0 where the force law leaves them alone, resting between. Rules that make bodies
come to rest:

- A rebound that would be over within a step is none: the impulse has e = 0 there.
- Two bodies that collided more than `max_bounces` times in one step do so with e = 0 for its rest.
- A point as high above the surface as such a rebound would rise rests too, once it is that slow:
  the
  force lets it sink to the surface.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.algebra import cross, norm
from rigid_sim_ros.engine.arrays import Array, IntArray
from rigid_sim_ros.engine.backtrack import film, first_event, pairs_ahead
from rigid_sim_ros.engine.contact_drift import contact_drift
from rigid_sim_ros.engine.contact_qp import Outcome, solve
from rigid_sim_ros.engine.contacts import (
    Bodies, Contacts, couple, gather, make_bodies, make_contacts, push, read_bodies, relative, row,
    to_contact, to_world)
from rigid_sim_ros.engine.detect import detect
from rigid_sim_ros.engine.free_flight import fly
from rigid_sim_ros.engine.impulse import collide, resting_speed, STILL
from rigid_sim_ros.engine.integrate import make_work, sum_loads, Work
from rigid_sim_ros.engine.kernel import kernel
from rigid_sim_ros.engine.loads import empty_loads, kick, Loads
from rigid_sim_ros.engine.manifolds import current_manifolds, grown, Manifolds, Memory
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.shapes import Materials, Shapes
from rigid_sim_ros.engine.state import State
from rigid_sim_ros.engine.wrenches import count_down, Wrenches


class EventSettings(NamedTuple):
    """What may be tuned; the defaults suit bodies of 1 cm to 10 m."""

    # [m] points with a smaller gap touch; far above rounding, far below anything seen
    touching: float = 1e-8
    # [m] by which touching pairs may sink in within a step before it is split
    overlap: float = 1e-7
    # [m/s] at most, with which bodies that overlap from the start come apart
    push_out: float = 0.5
    # In a step; the rest of the step then runs without backtracking, and says so
    max_events: int = 2000
    max_bounces: int = 32  # of two bodies in one step, before they collide with e = 0


# A gap left at rest is closed at this rate per step. The gap and its rate then shrink with the
# factors 0.6 and 0.25 a step without swinging; above 0.34 they would swing.
CLOSING = 0.3


class Carried(NamedTuple):
    """The forces of the last step, from which the next solution starts."""

    shape_a: IntArray  # (c,)
    shape_b: IntArray  # (c,)
    feature: IntArray  # (c,)
    force: Array  # (c, 3) [N] on B, world axes


class EventReport(NamedTuple):
    """What the latest step did."""

    contacts: int  # points of contact at the end
    events: int  # times at which the step was interrupted
    collisions: int  # of pairs of bodies
    deepest: float  # [m] the deepest overlap, >= 0
    residual: float  # the largest, relative to the accelerations (contact_qp.residual)
    iterations: int  # of OSQP
    unsolved: int  # problems of contact whose conditions could not be met to the tolerance
    status: str  # OSQP's word on the last of them, or ''
    cut_short: bool  # more than `max_events`: part of the step ran without backtracking


class EventWork:
    """Scratch memory, and the arrays that carry over from step to step."""

    def __init__(self, bodies: int, shapes: int) -> None:
        """Make room for a world without contacts."""
        self.work: Work = make_work(bodies)
        self.bodies: Bodies = make_bodies(bodies)
        self.contacts: Contacts = make_contacts(64)
        self.contact_loads: Loads = empty_loads(bodies)
        self.still: Loads = empty_loads(bodies)
        self.pose: Array = np.zeros((shapes, 12))
        self.pairs: IntArray = np.zeros((64, 2), dtype=np.int64)
        self.allowed: Array = np.zeros(64)
        self.carried: Carried = no_forces()
        self.report = EventReport(0, 0, 0, 0.0, 0.0, 0, 0, '', False)

    def lasting(self) -> Carried:
        """Return all that influences later steps, besides the state."""
        return self.carried


def no_forces() -> Carried:
    """Return what is carried over where nothing touched."""
    none = np.zeros(0, dtype=np.int64)
    return Carried(none, none, none, np.zeros((0, 3)))


@kernel
def _load(model: Model, contacts: Contacts, chosen: IntArray, f: Array, loads: Loads,
          work: Work) -> None:
    """Write the loads of the forces f, (3m,) [N, contact axes], and add them to the step's."""
    loads.F[:] = 0.0
    loads.tau[:] = 0.0
    for c in range(chosen.shape[0]):
        k = chosen[c]
        F = to_world(contacts, k, (f[3 * c], f[3 * c + 1], f[3 * c + 2]))
        a, b = contacts.body_a[k], contacts.body_b[k]
        on_A, on_B = cross(row(contacts.r_A, k), F), cross(row(contacts.r_B, k), F)
        for i in range(3):
            loads.F[i, a] -= F[i]
            loads.tau[i, a] -= on_A[i]
            loads.F[i, b] += F[i]
            loads.tau[i, b] += on_B[i]
    for j in range(model.m.shape[0]):
        for i in range(3):
            if model.inv_m[j] == 0.0:
                loads.F[i, j], loads.tau[i, j] = 0.0, 0.0
            work.loads.F[i, j] += loads.F[i, j]
            work.loads.tau[i, j] += loads.tau[i, j]


@kernel
def _move(model: Model, state: State, wrenches: Wrenches, loads: Loads, work: Work,
          t: float) -> None:
    """Kick, drift, kick for t [s] like `integrate.symplectic`, with constant contact loads."""
    kick(state, work.loads, 0.5 * t)
    fly(model, state, (0.0, 0.0, 0.0), t, np.int64(1), work.block)
    kick(state, work.loads, 0.5 * t)
    sum_loads(model, state, wrenches, work.later)
    kick(state, work.later, 0.5 * t)
    kick(state, loads, 0.5 * t)
    kick(state, work.loads, -0.5 * t)


@kernel
def _choose(contacts: Contacts, bodies: Bodies, h: float, touching: float,
            chosen: IntArray) -> int:
    """Write the points that get a force: those that touch, and slow ones that nearly do."""
    m = 0
    for k in range(contacts.count[0]):
        slow = resting_speed(contacts, bodies, k, h)
        if contacts.gap[k] > touching:
            u = to_contact(contacts, k, relative(bodies.velocity, contacts, k))
            # It rises to slow^2 / 2a = slow h / 4 with slow = a h / 2.
            if contacts.gap[k] > touching + 0.25 * slow * h or u[0] < -slow:
                continue
        chosen[m] = k
        m += 1
    return m


@kernel
def _rates(shapes: Shapes, contacts: Contacts, bodies: Bodies, chosen: IntArray, drift: Array,
           left: float, h: float,
           push_out: float, b: Array) -> None:
    """
    Write b of a = A f + b: accelerations without contact forces, and what stops points.

    a = 0 then means that the point has stopped when `left` [s] are over, so that neither a
    velocity nor a gap that rounding left behind can grow from step to step.
    """
    for c in range(chosen.shape[0]):
        k = chosen[c]
        u = to_contact(contacts, k, relative(bodies.velocity, contacts, k))
        free = to_contact(contacts, k, relative(bodies.acceleration, contacts, k))
        gap = contacts.gap[k] - film(shapes, contacts.shape_a[k], contacts.shape_b[k])
        wanted = min(-CLOSING * gap / h, push_out)
        b[3 * c] = free[0] + drift[3 * c] + (u[0] - wanted) / left
        b[3 * c + 1] = free[1] + drift[3 * c + 1] + u[1] / left
        b[3 * c + 2] = free[2] + drift[3 * c + 2] + u[2] / left


@kernel
def _recall(contacts: Contacts, chosen: IntArray, carried: Carried, f: Array) -> None:
    """Write the forces of the last step at the points that were there already, 0 at the others."""
    f[:] = 0.0
    at, size = 0, carried.feature.shape[0]
    for c in range(chosen.shape[0]):
        k = chosen[c]
        for tried in range(size):
            # Both are in the same order, so the search nearly always ends at once.
            i = (at + tried) % size
            if (carried.shape_a[i] == contacts.shape_a[k]
                    and carried.shape_b[i] == contacts.shape_b[k]
                    and carried.feature[i] == contacts.feature[k]):
                F = to_contact(contacts, k, row(carried.force, i))
                f[3 * c], f[3 * c + 1], f[3 * c + 2] = F
                at = i + 1
                break


@kernel
def _forces_in_world(contacts: Contacts, chosen: IntArray, f: Array, force: Array) -> None:
    for c in range(chosen.shape[0]):
        F = to_world(contacts, chosen[c], (f[3 * c], f[3 * c + 1], f[3 * c + 2]))
        for i in range(3):
            force[c, i] = F[i]


@kernel
def _velocities(contacts: Contacts, bodies: Bodies, chosen: IntArray, u: Array) -> None:
    for c in range(chosen.shape[0]):
        k = chosen[c]
        u[3 * c], u[3 * c + 1], u[3 * c + 2] = to_contact(
            contacts, k, relative(bodies.velocity, contacts, k))


@kernel
def _push_all(model: Model, state: State, contacts: Contacts, chosen: IntArray, J: Array,
              impulses: Array) -> None:
    for c in range(chosen.shape[0]):
        k = chosen[c]
        push(state, contacts, k, to_world(contacts, k, (J[3 * c], J[3 * c + 1], J[3 * c + 2])),
             model)
        for i in range(3):
            impulses[k, i] += J[3 * c + i]


@kernel
def _allow(pairs: IntArray, count: int, contacts: Contacts, bodies: Bodies, chosen: IntArray,
           left: float,
           overlap: float, allowed: Array) -> None:
    """Write how deep the pairs that get forces may go, 0 for the others; see `first_event`."""
    allowed[:count] = 0.0
    p = 0
    for c in range(chosen.shape[0]):
        k = chosen[c]
        u = to_contact(contacts, k, relative(bodies.velocity, contacts, k))
        # Stopped over the step, not at once, a slow approach u_n gets |u_n| t / 2 deeper.
        depth = min(contacts.gap[k], 0.0) + 0.5 * min(u[0], 0.0) * left - overlap
        for _ in range(count):
            if pairs[p, 0] == contacts.shape_a[k] and pairs[p, 1] == contacts.shape_b[k]:
                allowed[p] = min(allowed[p], depth)
                break
            p = (p + 1) % count


@kernel
def _record(manifolds: Manifolds, contacts: Contacts, impulses: Array) -> None:
    """Add impulses, (c, 3) [N s, contact axes], to those of the manifolds."""
    r = 0
    for k in range(contacts.count[0]):
        a, b = contacts.shape_a[k], contacts.shape_b[k]
        for _ in range(manifolds.count[0]):
            if manifolds.shape_a[r] == a and manifolds.shape_b[r] == b:
                break
            r = (r + 1) % manifolds.count[0]
        for j in range(manifolds.points[r]):
            if manifolds.feature[r, j] == contacts.feature[k]:
                manifolds.impulse[r, j] += impulses[k, 0]
        rubbing = to_world(contacts, k, (0.0, impulses[k, 1], impulses[k, 2]))
        for i in range(3):
            manifolds.friction[r, i] += rubbing[i]


@kernel
def _deepest(manifolds: Manifolds) -> float:
    deepest = 0.0
    for r in range(manifolds.count[0]):
        for j in range(manifolds.points[r]):
            deepest = max(deepest, -manifolds.gap[r, j])
    return deepest


@kernel
def _most_pull(model: Model, loads: Loads) -> float:
    """Return the largest acceleration [m/s^2] that a load gives a centre of mass."""
    most = 0.0
    for i in range(model.m.shape[0]):
        most = max(most, model.inv_m[i] * norm((loads.F[0, i], loads.F[1, i], loads.F[2, i])))
    return most


class _Step:
    """One step of the world; everything that its stages share."""

    def __init__(self, model: Model, state: State, wrenches: Wrenches, shapes: Shapes,
                 materials: Materials, memory: Memory, settings: EventSettings,
                 work: EventWork) -> None:
        self.model, self.state, self.wrenches = model, state, wrenches
        self.shapes, self.materials, self.memory = shapes, materials, memory
        self.settings, self.work = settings, work
        self.bounced: dict[tuple[int, int], int] = {}
        self.events = self.collisions = self.iterations = self.unsolved = 0
        self.residual, self.status, self.cut_short = 0.0, '', False

    def run(self) -> Memory:
        """Go from event to event until the step is over; return the memory, perhaps grown."""
        w, left, first = self.work, self.model.h, True
        while left > 0.0:
            self._free_loads()
            self._detect()
            if first:
                _forget_impulses(current_manifolds(self.memory))
                first = False
            impulses = np.zeros((self.work.contacts.gap.shape[0], 3))
            self._collide(impulses)
            chosen = self._resting_forces(left)
            t, which = self._next_event(chosen, left)
            self._keep(chosen, t, impulses)
            _move(self.model, self.state, self.wrenches, w.contact_loads, w.work, t)
            left = left - t if which >= 0 else 0.0
            self.events += which >= 0
        count_down(self.wrenches)
        w.report = EventReport(int(w.contacts.count[0]), self.events, self.collisions,
                               float(_deepest(current_manifolds(self.memory))), self.residual,
                               self.iterations, self.unsolved, self.status, self.cut_short)
        return self.memory

    def _free_loads(self) -> None:
        w = self.work
        sum_loads(self.model, self.state, self.wrenches, w.work.loads)
        read_bodies(self.model, self.state, w.work.loads.F, w.work.loads.tau, w.bodies)

    def _detect(self) -> None:
        """Find the points that touch, or are as near as a rebound that is too short to be one."""
        w = self.work
        slow = 0.5 * self.model.h * float(_most_pull(self.model, w.work.loads)) + STILL
        reach = self.settings.touching + 0.25 * self.model.h * slow
        # Polyhedra that hardly moved would keep points that are right to second order: not enough
        # here.
        current_manifolds(self.memory).found_at[:, 0] = np.inf
        while not detect(self.model, self.state, self.shapes, self.memory, 1.01 * reach):
            self.memory = grown(self.memory)
        while True:
            needed = gather(self.state, current_manifolds(self.memory), self.shapes,
                            self.materials,
                            reach, w.contacts)
            if needed <= w.contacts.gap.shape[0]:
                return
            w.contacts = make_contacts(2 * needed)

    def _collide(self, impulses: Array) -> None:
        """Apply the impulses of all that collides now."""
        w, h, touching = self.work, self.model.h, self.settings.touching
        points, blocks = (int(count) for count in w.contacts.count)
        if points == 0:
            return
        elastic = np.ones(points, dtype=np.int64)
        pairs = [(int(w.contacts.body_a[i]),
                  int(w.contacts.body_b[i])) for i in w.contacts.first[:blocks]]
        for block, pair in enumerate(pairs):
            if self.bounced.get(pair, 0) >= self.settings.max_bounces:
                elastic[w.contacts.first[block]:w.contacts.first[block + 1]] = 0
        limit = 200 + 50 * blocks
        done = collide(self.model, self.state, w.contacts, w.bodies, h, touching, elastic, limit,
                       impulses)
        if done == 0:
            return
        self.collisions += limit if done < 0 else done
        for block, pair in enumerate(pairs):
            rows = slice(w.contacts.first[block], w.contacts.first[block + 1])
            if impulses[rows].any():
                self.bounced[pair] = self.bounced.get(pair, 0) + 1
        if done < 0:
            self._stop_together(impulses)
        read_bodies(self.model, self.state, w.work.loads.F, w.work.loads.tau, w.bodies)

    def _stop_together(self, impulses: Array) -> None:
        """End a shock that goes to and fro for ever: all points at once, with e = 0."""
        w = self.work
        chosen = np.flatnonzero(
            w.contacts.gap[:w.contacts.count[0]] <= self.settings.touching).astype(np.int64)
        A, u = self._coupling(chosen), np.empty(3 * len(chosen))
        _velocities(w.contacts, w.bodies, chosen, u)
        J = self._solve(A, u, chosen, np.zeros_like(u))
        _push_all(self.model, self.state, w.contacts, chosen, J, impulses)

    def _coupling(self, chosen: IntArray) -> Array:
        A = np.empty((3 * len(chosen), 3 * len(chosen)))
        couple(self.model, self.work.contacts, self.work.bodies, chosen, len(chosen),
               np.empty((2, 3 * len(chosen), 3)), A)
        return A

    def _solve(self, A: Array, b: Array, chosen: IntArray, start: Array) -> Array:
        outcome: Outcome
        found, outcome = solve(A, b, self.work.contacts.friction[chosen], start)
        self.residual = max(self.residual, outcome.residual)
        self.iterations += outcome.osqp_iterations
        if not outcome.solved:
            self.unsolved += 1
            self.status = outcome.status
        return found

    def _resting_forces(self, left: float) -> IntArray:
        """Find the forces at the resting points, and add them to the loads; return the points."""
        w, h = self.work, self.model.h
        chosen = np.empty(w.contacts.count[0], dtype=np.int64)
        chosen = chosen[:_choose(w.contacts, w.bodies, h, self.settings.touching, chosen)]
        f = np.zeros(3 * len(chosen))
        if len(chosen):
            drift, b = np.zeros(3 * len(chosen)), np.empty(3 * len(chosen))
            contact_drift(self.model, self.state, w.still, self.shapes, w.contacts, w.bodies,
                          chosen,
                          max(left, 1e-3 * h), w.pose, self.memory.scratch, drift)
            _rates(self.shapes, w.contacts, w.bodies, chosen, drift, left, h,
                   self.settings.push_out, b)
            _recall(w.contacts, chosen, w.carried, f)
            f = self._solve(self._coupling(chosen), b, chosen, f)
        _load(self.model, w.contacts, chosen, f, w.contact_loads, w.work)
        force = np.zeros((len(chosen), 3))
        _forces_in_world(w.contacts, chosen, f, force)
        w.carried = Carried(w.contacts.shape_a[chosen], w.contacts.shape_b[chosen],
                            w.contacts.feature[chosen], force)
        self.force = f
        return chosen

    def _next_event(self, chosen: IntArray, left: float) -> tuple[float, int]:
        """Return when the next pair meets, within `left` [s], and which; -1 for none."""
        w = self.work
        if self.events >= self.settings.max_events:
            self.cut_short = True
            return left, -1
        while True:
            count = pairs_ahead(self.model, self.state, w.work.loads, self.shapes, left, w.pose,
                                w.pairs)
            if count <= len(w.pairs):
                break
            w.pairs = np.zeros((2 * count, 2), dtype=np.int64)
            w.allowed = np.zeros(2 * count)
        _allow(w.pairs, count, w.contacts, w.bodies, chosen, left, self.settings.overlap,
               w.allowed)
        t, which = first_event(self.model, self.state, w.work.loads, self.shapes, w.pairs, count,
                               w.allowed, self.settings.overlap, left, w.pose, self.memory.scratch)
        return float(t), int(which)

    def _keep(self, chosen: IntArray, t: float, impulses: Array) -> None:
        """Write what acted at the contacts to the manifolds."""
        w = self.work
        impulses[chosen] += t * self.force.reshape(-1, 3)
        _record(current_manifolds(self.memory), w.contacts, impulses)


def _forget_impulses(manifolds: Manifolds) -> None:
    rows = int(manifolds.count[0])
    manifolds.impulse[:rows] = 0.0
    manifolds.friction[:rows] = 0.0
    manifolds.spin[:rows] = 0.0


def advance(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, materials: Materials,
            memory: Memory, settings: EventSettings, work: EventWork, count: int) -> Memory:
    """
    Advance all bodies by `count` steps, in place; return the memory, which may have grown.

    work.report says how the last step went, and `work.carried` together with the state is all that
    the next step depends on.
    """
    for _ in range(count):
        memory = _Step(model, state, wrenches, shapes, materials, memory, settings, work).run()
    return memory
