# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What contact forces did on the way of a group, and what no way may gain.

The forces of a span are right for the levers that bodies have in the middle of it. Where bodies go
elsewhere, because their way ends sooner, turn by much, or go on with forces that are no solution,
these levers are wrong; below a load of R times its weight a light body then turns R times as much.
So what the forces did is measured once the way is taken, by the energy that it changed:

    W = dK - sum t F . (v_0 + v_1) / 2 - sum t tau . (w_0 + w_1) / 2 over both kicks,

K the kinetic energies of the bodies that contacts push, F and tau their other loads, and less what
kinematic bodies did. A rigid contact does no work that is positive, but for what lifts an overlap.
What is more than the errors of the method is not accepted: the way is taken back, and taken again
with forces that are found for a shorter one, or in the end without them.
"""

from rigid_sim_ros.engine.contact.classify import resting_speed, STILL
from rigid_sim_ros.engine.contact.contacts import to_world, torque_in_world
from rigid_sim_ros.engine.contact.resting_qp import CLOSING, LIFTING
from rigid_sim_ros.engine.events.buffers import EventArguments, HELD
from rigid_sim_ros.engine.events.groups import Groups, WORKS
from rigid_sim_ros.engine.events.resting_forces import CUT
from rigid_sim_ros.engine.maths.algebra import (
    add, add_scaled, column, cross, dot, norm, quaternion, row, subtract)
from rigid_sim_ros.engine.state.rates import spin_of
from rigid_sim_ros.engine.state.state import copy_body
from rigid_sim_ros.kernels.arrays import Vector
from rigid_sim_ros.kernels.kernel import kernel

# What a way may gain: this part of what the loads alone give to bodies at rest in it, and this
# part of the kinetic energies. A column at rest gains 2e-4 of the first, what tumbles mostly less
# than 2e-2 of the second; with less than that spans become shorter than they need be.
OF_LOADS, OF_MOTION = 1e-2, 5e-2
# Of the forces, each time that no shorter span helps: so much is left.
LESS, LEAST = 0.25, 0.1


@kernel
def take_back(c: EventArguments) -> None:
    """Let the groups go back to where they were whose contacts gave them energy on the way."""
    w, groups = c.buffers, c.buffers.groups
    for g in range(w.now.groups[0]):
        t = groups.way[g]
        if t == 0.0:
            continue
        if groups.share[g] == 0.0 or not _gains(c, g, t):
            groups.share[g] = 1.0
            continue
        for at in range(groups.first[g], groups.first[g + 1]):
            j = groups.body[at]
            copy_body(c.state, w.here, j)
            w.times[j] = 0.0
            for i in range(3):
                c.state.P[i, j] -= w.pushed.F[i, j]
                c.state.L[i, j] -= w.pushed.tau[i, j]
        for k in range(w.contacts.first[groups.block[g]], w.contacts.first[groups.block[g + 1]]):
            w.held[k] = 0
        _go_less(groups, g, t, CUT * c.model.h)
        groups.way[g], groups.met[g] = 0.0, WORKS


@kernel
def _go_less(groups: Groups, g: int, t: float, least: float) -> None:
    """Let the next forces of a group act for less than the t [s] of these, or let them be weak."""
    until = min(groups.span[g], groups.left[g])
    if groups.short[g] == 0 and until > least:
        groups.span[g] = max(min(0.5 * until, t), 0.5 * least)
    else:
        groups.share[g] = LESS * groups.share[g] if groups.share[g] > LEAST else 0.0


@kernel
def _gains(c: EventArguments, g: int, t: float) -> bool:
    """Return whether the contacts of a group gave it more energy in t [s] than they may."""
    w, groups = c.buffers, c.buffers.groups
    work, allowed, most, lifted = 0.0, 0.0, 0.0, 0.0
    for at in range(groups.first[g], groups.first[g + 1]):
        j = groups.body[at]
        if c.model.inv_m[j] > 0.0 and _is_pushed(c, j):
            gain, before, at_rest = _gain(c, j, t)
            work += gain
            allowed += OF_LOADS * t * at_rest + OF_MOTION * before
            most += LIFTING * c.model.h / t * at_rest
    if work <= allowed:
        return False
    for k in range(w.contacts.first[groups.block[g]], w.contacts.first[groups.block[g + 1]]):
        if w.held[k] == HELD:
            work -= t * _prescribed_power(c, k)
            slow = LIFTING * resting_speed(w.contacts, w.bodies, k, c.model.h)
            speed = max(-CLOSING * w.contacts.gap[k] / c.model.h, 0.0)
            lifted += min(speed, slow) * w.force[k, 0]
            # What moves as slowly is rounding.
            allowed += t * STILL * w.contacts.size[k] / c.model.h * w.force[k, 0]
    # Not more than the weight of what is lifted, however much it is squeezed.
    return work > allowed + t * min(lifted, most)


@kernel
def _is_pushed(c: EventArguments, j: int) -> bool:
    """Return whether contacts push or turn a body."""
    loads = c.buffers.loads
    return norm(column(loads.F, j)) > 0.0 or norm(column(loads.tau, j)) > 0.0


@kernel
def _gain(c: EventArguments, j: int, t: float) -> tuple[float, float, float]:
    """
    Return what contacts gave to body j in t [s], and the kinetic energy that it had, both [J].

    And the power [W] that its loads have at the end of that time from rest.
    """
    w, model, state = c.buffers, c.model, c.state
    inv_m, inv_I = model.inv_m[j], column(model.inv_I_C, j)
    q_0, q_1 = quaternion(w.here.q, j), quaternion(state.q, j)
    # Without what only displaces.
    P_0 = subtract(column(w.here.P, j), column(w.pushed.F, j))
    L_0 = subtract(column(w.here.L, j), column(w.pushed.tau, j))
    P_1, L_1 = column(state.P, j), column(state.L, j)
    F, tau = column(w.work.loads.F, j), column(w.work.loads.tau, j)
    P_m = add_scaled(P_0, 0.5 * t, add(F, column(w.loads.F, j)))
    L_m = add_scaled(L_0, 0.5 * t, add(tau, column(w.loads.tau, j)))
    later, tau_1 = column(w.work.later.F, j), column(w.work.later.tau, j)
    before = 0.5 * (inv_m * dot(P_0, P_0) + dot(L_0, spin_of(q_0, L_0, inv_I)))
    gain = 0.5 * (inv_m * dot(P_1, P_1) + dot(L_1, spin_of(q_1, L_1, inv_I))) - before
    by_loads = inv_m * (dot(F, add(P_0, P_m)) + dot(later, add(P_m, P_1)))
    by_loads += dot(tau, spin_of(q_0, add(L_0, L_m), inv_I))
    by_loads += dot(tau_1, spin_of(q_1, add(L_m, L_1), inv_I))
    return gain - 0.25 * t * by_loads, before, t * inv_m * dot(F, F)


@kernel
def _prescribed_power(c: EventArguments, k: int) -> float:
    """Return the power [W] of a kinematic body at point k."""
    w, contacts = c.buffers, c.buffers.contacts
    power = 0.0
    for side in range(2):
        j = contacts.body_a[k] if side == 0 else contacts.body_b[k]
        if c.model.inv_m[j] == 0.0:
            # The force on the other body is that on B, or against it.
            sign = 1.0 if side == 0 else -1.0
            F = to_world(contacts, k, (w.force[k, 0], w.force[k, 1], w.force[k, 2]))
            tau = torque_in_world(c.model, contacts, k, w.now.width[0], w.force[k], 0)
            turning = cross(row(contacts.r_A if side == 0 else contacts.r_B, k), F)
            power += sign * (dot(F, _prescribed(c, j, 0))
                             + dot(add(turning, tau), _prescribed(c, j, 3)))
    return power


@kernel
def _prescribed(c: EventArguments, j: int, at: int) -> Vector:
    """Return the velocity, or from 3 on the angular velocity, of a body that nothing pushes."""
    velocity = c.buffers.bodies.velocity
    return (velocity[j, at], velocity[j, at + 1], velocity[j, at + 2])
