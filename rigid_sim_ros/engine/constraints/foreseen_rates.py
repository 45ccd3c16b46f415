# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether the points of contact went as their impulses were found for.

The impulses of the first half of a step are found with the relative motions that the joints are
foreseen to need (joints/shake.py), and a joint that needs others changes the rates of the points.
"""

from rigid_sim_ros.engine.constraints.articulated_buffers import ContactBuffers
from rigid_sim_ros.engine.contact.contact_rows import effect
from rigid_sim_ros.engine.contact.contacts import relative, to_contact
from rigid_sim_ros.engine.maths.rotation import quaternion
from rigid_sim_ros.engine.maths.vector import column, subtract
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.rates import spin_of
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Of the size of the smaller shape, in a step: joints close to 1e-13 of the longest lever.
SLOW = 1e-9


@kernel
def note_foreseen(chosen: IntArray, width: int, brisk: float, w: ContactBuffers) -> None:
    """Write the rates of the points of an island; the impulses have been found."""
    rows = w.system.rows
    for c in range(chosen.shape[0]):
        k = chosen[c]
        w.brisk[k] = brisk
        for i in range(3):
            n = width * c + i
            w.foreseen[k, i] = w.free[n] + effect(rows, c, n, rows.f)


@kernel
def astray(model: Model, start: State, now: State, h: float, w: ContactBuffers) -> float:
    """
    Return how far points went otherwise than foreseen on a way of h [s].

    The first half of the way is taken. It is a part of the largest rate without impulses. Of a
    point without an impulse it matters only by how much its gap would become negative.
    """
    worst = 0.0
    for k in w.chosen[:w.counts.points[0]]:
        _read(model, start, now, w.contacts.body_a[k], w)
        _read(model, start, now, w.contacts.body_b[k], w)
        u = to_contact(w.contacts, k, relative(w.bodies.velocity, w.contacts, k))
        off = min(w.foreseen[k, 0], -max(w.contacts.gap[k], 0.0) / h) - u[0]
        if w.impulse[k, 0] != 0.0:
            off = 0.0
            for i in range(3):
                off = max(off, abs(u[i] - w.foreseen[k, i]))
        # Slower, nothing moves but by what displaces, and by the rounding of what joints hold.
        if w.brisk[k] > SLOW * w.contacts.size[k] / h:
            worst = max(worst, off / w.brisk[k])
    return worst


@kernel
def _read(model: Model, start: State, now: State, i: int, w: ContactBuffers) -> None:
    """Write v and w of body i at its pose at the start, but for what only displaces."""
    if model.inv_m[i] == 0.0:
        for k in range(6):
            w.bodies.velocity[i, k] = start.V[k, i]
        return
    P = subtract(column(now.P, i), column(w.displacing.F, i))
    L = subtract(column(now.L, i), column(w.displacing.tau, i))
    spin = spin_of(quaternion(start.q, i), L, column(model.inv_I_C, i))
    for k in range(3):
        w.bodies.velocity[i, k] = model.inv_m[i] * P[k]
        w.bodies.velocity[i, 3 + k] = spin[k]
