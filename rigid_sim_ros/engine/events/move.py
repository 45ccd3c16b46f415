# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The way of the model `event` to the next state, under contact forces that stay constant."""

from rigid_sim_ros.engine.contact.contact_rows import Rows
from rigid_sim_ros.engine.contact.contacts import (
    add_contact_load, Bodies, Contacts, to_world, torque_in_world)
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.dynamics.free_flight import drift
from rigid_sim_ros.engine.dynamics.integrate import sum_loads
from rigid_sim_ros.engine.dynamics.kinematic import carry
from rigid_sim_ros.engine.events.buffers import EventArguments
from rigid_sim_ros.engine.maths.algebra import cross
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import least_lever, Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def load(model: Model, contacts: Contacts, chosen: IntArray, width: int, force: Array,
         loads: Loads) -> None:
    """Add the loads of the forces on the chosen points, (c, 6) [N, contact axes]."""
    for k in chosen:
        F = to_world(contacts, k, (force[k, 0], force[k, 1], force[k, 2]))
        tau = torque_in_world(model, contacts, k, width, force[k], 0)
        add_contact_load(model.inv_m, contacts, k, F, tau, loads)


@kernel
def move(c: EventArguments) -> None:
    """
    Kick, drift, kick like `integrate.symplectic`, each body for its time in `Buffers.times`.

    The loads hold the constant contact forces, with levers of the middle of the span of a group as
    bodies move with the accelerations `Buffers.assumed`; the momenta hold, for this way only, the
    impulses that displace.
    """
    model, state, work, times = c.model, c.state, c.buffers.work, c.buffers.times
    loads, pushed = c.buffers.loads, c.buffers.pushed
    _kick(state, work.loads, times, 0.5)
    drift(model, state, times, work.block)
    for i in model.fixed:
        if times[i] > 0.0:
            carry(state, i, times[i])
    for k in range(c.buffers.contacts.count[0]):
        _meet_again(c, k)
    _kick(state, work.loads, times, 0.5)
    for j in range(model.m.shape[0]):  # what is left are the loads without contacts
        for i in range(3):
            work.loads.F[i, j] -= loads.F[i, j]
            work.loads.tau[i, j] -= loads.tau[i, j]
    # As in `integrate.symplectic`: the momenta are known now to first order.
    sum_loads(model, state, c.wrenches, work.later)
    _kick(state, work.later, times, 0.5)
    _kick(state, work.loads, times, -0.5)
    for j in range(model.m.shape[0]):
        if times[j] > 0.0:
            for i in range(3):
                state.P[i, j] -= pushed.F[i, j]
                state.L[i, j] -= pushed.tau[i, j]


@kernel
def _kick(state: State, loads: Loads, times: Array, share: float) -> None:
    """Advance the momenta of each body for a share of its time."""
    for i in range(times.shape[0]):
        if times[i] > 0.0:
            for k in range(3):
                state.P[k, i] += share * times[i] * loads.F[k, i]
                state.L[k, i] += share * times[i] * loads.tau[k, i]


@kernel
def shift_levers(model: Model, shapes: Shapes, contacts: Contacts, bodies: Bodies,
                 chosen: IntArray, width: int, rows: Rows, span: float, goal: float,
                 assumed: Array) -> bool:
    """
    Bring levers to where the centres are in the middle of the span [s] under contact forces.

    rows.z are the accelerations by these alone; `assumed`, (n, 3), those for which the levers are
    right so far, and then those that bodies have. A body that begins with v is, with kick, drift,
    kick, at x + span / 2 (v + a span / 2) in the middle of its way. Returns whether a lever moved
    so far that the forces on it change a rate by more than `goal` [m/s^2].
    """
    shifted, z = False, rows.z
    for c in range(chosen.shape[0]):
        k, row_n = chosen[c], width * c
        a, b = contacts.body_a[k], contacts.body_b[k]
        w_A, w_B = model.inv_m[a], model.inv_m[b]
        if w_A == 0.0 or w_B == 0.0:
            continue
        lever = least_lever(shapes, contacts.shape_a[k], contacts.shape_b[k])
        strong = rows.stiff[row_n] * rows.f[row_n] / lever
        for i in range(3):
            now = bodies.acceleration[b, i] + z[b, i] - bodies.acceleration[a, i] - z[a, i]
            apart = 0.25 * span * span * (now - (assumed[b, i] - assumed[a, i]))
            contacts.r_A[k, i] += w_B / (w_A + w_B) * apart
            contacts.r_B[k, i] -= w_A / (w_A + w_B) * apart
            shifted = shifted or abs(apart) * strong > goal
    for k in chosen:
        for side in range(2):
            j = contacts.body_a[k] if side == 0 else contacts.body_b[k]
            for i in range(3):
                assumed[j, i] = bodies.acceleration[j, i] + z[j, i]
    return shifted


@kernel
def _meet_again(c: EventArguments, k: int) -> None:
    """
    Let -F on A and F on B of point k act at one place, after a drift of t [s].

    The change t F of the momenta keeps the angular momentum of both if it acts at one place p with
    the levers p - (x_0 + x_1) / 2. Those of `contacts` are from where the centres were expected to
    be in the middle; they are elsewhere where the way ends before the span. Where these are off by
    d_A and d_B, p becomes p + s, s = (w_A d_A + w_B d_B) / (w_A + w_B) with w = 1 / M. An impulse
    J that is removed at the end is then one at centres that went on by x_1 - x_0.
    """
    state, contacts, groups = c.state, c.buffers.contacts, c.buffers.groups
    force, push = c.buffers.force, c.buffers.push
    a, b = contacts.body_a[k], contacts.body_b[k]
    w_A, w_B, t = c.model.inv_m[a], c.model.inv_m[b], c.buffers.times[a]
    if w_A == 0.0 or w_B == 0.0 or t == 0.0 or force[k, 0] + push[k, 0] == 0.0:
        return
    g = groups.of[a]
    span = min(groups.span[g], groups.left[g])
    F = to_world(contacts, k, (force[k, 0], force[k, 1], force[k, 2]))
    J = to_world(contacts, k, (push[k, 0], push[k, 1], push[k, 2]))
    # d_B - d_A; the momenta are still those of the drift.
    off = (_off(c, a, b, 0, span, t), _off(c, a, b, 1, span, t), _off(c, a, b, 2, span, t))
    apart = (w_B * state.P[0, b] - w_A * state.P[0, a], w_B * state.P[1, b] - w_A * state.P[1, a],
             w_B * state.P[2, b] - w_A * state.P[2, a])
    turning, back = cross(off, F), cross(apart, J)
    for i in range(3):
        both = t * (turning[i] - back[i])
        state.L[i, a] -= w_B / (w_A + w_B) * both  # s - d_A
        state.L[i, b] -= w_A / (w_A + w_B) * both  # s - d_B, against `off`


@kernel
def _off(c: EventArguments, a: int, b: int, i: int, span: float, t: float) -> float:
    """Return how much farther [m] B is from A in the middle of the way than expected, axis i."""
    inv_m, P, bodies, assumed = c.model.inv_m, c.state.P, c.buffers.bodies, c.buffers.assumed
    moved = t * (inv_m[b] * P[i, b] - inv_m[a] * P[i, a])
    expected = span * (bodies.velocity[b, i] - bodies.velocity[a, i]
                       + 0.5 * span * (assumed[b, i] - assumed[a, i]))
    return 0.5 * (moved - expected)
