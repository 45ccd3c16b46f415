# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The way of the model `event` to the next state, under contact forces that stay constant."""

import numpy as np

from rigid_sim_ros.engine.algebra import cross
from rigid_sim_ros.engine.arrays import Array, IntArray
from rigid_sim_ros.engine.contacts import Bodies, Contacts, row, to_world, torque_in_world
from rigid_sim_ros.engine.free_flight import fly
from rigid_sim_ros.engine.integrate import sum_loads, Work
from rigid_sim_ros.engine.kernel import kernel
from rigid_sim_ros.engine.kinematic import move_kinematic
from rigid_sim_ros.engine.loads import kick, Loads
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.state import State
from rigid_sim_ros.engine.wrenches import Wrenches


@kernel
def load(model: Model, contacts: Contacts, chosen: IntArray, width: int, f: Array, loads: Loads,
         work: Work) -> None:
    """Write the loads of the forces f, (wm,) [N, contact axes], and add them to the step's."""
    loads.F[:] = 0.0
    loads.tau[:] = 0.0
    for c in range(chosen.shape[0]):
        k, at = chosen[c], width * c
        F = to_world(contacts, k, (f[at], f[at + 1], f[at + 2]))
        tau = torque_in_world(model, contacts, k, width, f, at)
        a, b = contacts.body_a[k], contacts.body_b[k]
        on_A, on_B = cross(row(contacts.r_A, k), F), cross(row(contacts.r_B, k), F)
        for i in range(3):
            loads.F[i, a] -= F[i]
            loads.tau[i, a] -= on_A[i] + tau[i]
            loads.F[i, b] += F[i]
            loads.tau[i, b] += on_B[i] + tau[i]
    for j in range(model.m.shape[0]):
        for i in range(3):
            if model.inv_m[j] == 0.0:
                loads.F[i, j], loads.tau[i, j] = 0.0, 0.0
            work.loads.F[i, j] += loads.F[i, j]
            work.loads.tau[i, j] += loads.tau[i, j]


@kernel
def move(model: Model, state: State, wrenches: Wrenches, contacts: Contacts, bodies: Bodies,
         chosen: IntArray, width: int, f: Array, loads: Loads, work: Work, span: float,
         t: float) -> None:
    """
    Kick, drift, kick for t [s] like `integrate.symplectic`, with constant contact forces f.

    Takes the loads that `load` wrote, with levers of the middle of the span [s] as `bodies` would
    move without forces.
    """
    kick(state, work.loads, 0.5 * t)
    fly(model, state, (0.0, 0.0, 0.0), t, np.int64(1), work.block)
    move_kinematic(model, state, t)
    _meet_again(model, state, contacts, bodies, chosen, width, f, span, t)
    kick(state, work.loads, 0.5 * t)
    for j in range(model.m.shape[0]):  # what is left are the loads without contacts
        for i in range(3):
            work.loads.F[i, j] -= loads.F[i, j]
            work.loads.tau[i, j] -= loads.tau[i, j]
    # As in `integrate.symplectic`: the momenta are known now to first order.
    sum_loads(model, state, wrenches, work.later)
    kick(state, work.later, 0.5 * t)
    kick(state, work.loads, -0.5 * t)


@kernel
def _meet_again(model: Model, state: State, contacts: Contacts, bodies: Bodies, chosen: IntArray,
                width: int, f: Array, span: float, t: float) -> None:
    """
    Let -F on A and F on B act at one point, after a drift of t [s].

    The change t F of the momenta keeps the angular momentum of both if it acts at one place p with
    the levers p - (x_0 + x_1) / 2. Those of `contacts` are from where the centres were expected to
    be in the middle. Where these are off by d_A and d_B, p becomes p + s,
    s = (w_A d_A + w_B d_B) / (w_A + w_B) with w = 1 / M.
    """
    for c in range(chosen.shape[0]):
        k, at = chosen[c], width * c
        a, b = contacts.body_a[k], contacts.body_b[k]
        w_A, w_B = model.inv_m[a], model.inv_m[b]
        if w_A == 0.0 or w_B == 0.0:
            continue
        F = to_world(contacts, k, (f[at], f[at + 1], f[at + 2]))
        v = bodies.velocity
        # d_B - d_A; the momenta are still those of the drift.
        apart = (0.5 * (t * (w_B * state.P[0, b] - w_A * state.P[0, a])
                        - span * (v[b, 0] - v[a, 0])),
                 0.5 * (t * (w_B * state.P[1, b] - w_A * state.P[1, a])
                        - span * (v[b, 1] - v[a, 1])),
                 0.5 * (t * (w_B * state.P[2, b] - w_A * state.P[2, a])
                        - span * (v[b, 2] - v[a, 2])))
        turning = cross(apart, F)
        for i in range(3):
            state.L[i, a] -= t * (w_B / (w_A + w_B) * turning[i])  # s - d_A
            state.L[i, b] -= t * (w_A / (w_A + w_B) * turning[i])  # s - d_B, against `apart`
