# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What an impact turns ends with the energy that the impact left.

The solver takes the inertia that a body has in the middle of the step on its way without contacts.
That way keeps the energy of rotation, and impulses only take from it, so with this inertia I_m

    E = L . I_m^-1 L / 2,    L the angular momentum after all impulses,

is no more than what was there. But an impulse changes the way, and where the body ends, with
another inertia, the same L may have another energy. Of a cube it has not; of a rod as thin as a
pencil it differs by the square of its length over its width between the axis and across, and where
L lies along the axis by some degrees that is a hundred times the energy.

The impulse of the ground had another lever then, so what it gave to L is not known better than by
that part: L loses it. Where bodies that can be pushed touch each other, and nothing else, their
common L is conserved, and the attitude gives way: it turns by the least angle that brings the
energy back,

    dE = a . (w x L),    w = inv_I L,    for a turn by the vector a,

along w x L, by Newton's method. What touches something that nothing pushes must not turn: it
might get through that. What gains less than `MORE` stays: that is the order of the step.
"""

import math

from rigid_sim_ros.engine.detection.manifolds import (
    current, has_impulse, rows_in_use, step_impulses)
from rigid_sim_ros.engine.maths.rotation import (
    exponential, multiply, quaternion, set_quaternion, unit)
from rigid_sim_ros.engine.maths.vector import (
    add_scaled, column, cross, dot, scale, set_column, symmetric_times)
from rigid_sim_ros.engine.solver.arguments import Arguments
from rigid_sim_ros.engine.solver.solver_bodies import INV_I_W, STRIDE, TOUCHED
from rigid_sim_ros.engine.state.rates import spin_of
from rigid_sim_ros.kernels.kernel import INDEX, kernel

# Share of the energy of rotation. Smaller: the attitude of what rolls is moved by what is only the
# error of the step. Larger: thin things gain that much in an impact.
MORE = 1e-3
# Newton's method comes to the level from above; it halves the way to a least energy.
ROUNDS = 12
TINY = 1e-300


@kernel
def gains_any_by_turning(c: Arguments) -> bool:
    """Return whether any body that was touched has more energy at its end than `MORE` allows."""
    for i in range(c.model.m.shape[0]):
        if _gain(c, i) > 0.0:
            return True
    return False


@kernel
def take_back_gains(c: Arguments) -> None:
    """Let bodies have the energy that their impulses left."""
    for i in range(c.model.m.shape[0]):
        if _gain(c, i) > 0.0:
            if _keeps_momentum(c, i):
                _turn_back(c, i)
            else:
                _slow_down(c, i)


@kernel
def _keeps_momentum(c: Arguments, i: int) -> bool:
    """Return whether a body is among such that nothing fixed or kinematic touched or stopped."""
    manifolds, acted = current(c.memory), step_impulses(c.memory)
    first, count = rows_in_use(manifolds)
    meets = False
    for k in range(count):
        r = (first + k) & INDEX
        a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
        if i in (a, b):
            moves = min(c.model.inv_m[a], c.model.inv_m[b]) > 0.0
            if not moves and has_impulse(acted.normal, manifolds.points[r], r):
                return False
            meets = meets or moves
    return meets and c.work.ways.met[i, 0] < 0


@kernel
def _slow_down(c: Arguments, i: int) -> None:
    """
    Take the gain from L, along w: E(s) = E - s w . w + s^2 w . inv_I w / 2 of L - s w.

    Along w a little of L has the most energy.
    """
    q, d, L = quaternion(c.state.q, i), column(c.model.inv_I_C, i), column(c.state.L, i)
    w = spin_of(q, L, d)
    square, curve = dot(w, w), max(dot(w, spin_of(q, w, d)), TINY)
    # The root without cancellation, or where the energy is least.
    root = max(square * square - 2.0 * curve * _gain(c, i), 0.0)
    s = 2.0 * _gain(c, i) / max(square + math.sqrt(root), TINY)
    set_column(c.state.L, i, add_scaled(L, -min(s, square / curve), w))


@kernel
def _turn_back(c: Arguments, i: int) -> None:
    """Turn a body to where it has the energy that its impulses left."""
    gain = _gain(c, i)
    for _ in range(ROUNDS):
        L, q = column(c.state.L, i), quaternion(c.state.q, i)
        slope = cross(spin_of(q, L, column(c.model.inv_I_C, i)), L)
        turn = scale(-gain / max(dot(slope, slope), TINY), slope)
        set_quaternion(c.state.q, i, unit(multiply(exponential(turn), q)))
        gain = _gain(c, i)
        if gain == 0.0:
            break


@kernel
def _gain(c: Arguments, i: int) -> float:
    """Return what a body has gained by turning [J] beyond the share `MORE`; else 0."""
    bodies, d, most = c.work.solver.bodies, column(c.model.inv_I_C, i), 1.0 + MORE
    at = (bodies.slot[i] & INDEX) * STRIDE
    if (at == 0 or c.model.inv_m[i] == 0.0 or bodies.drifted[at + TOUCHED] == 0.0
            # Moments that differ by less cannot gain as much.
            or max(d[0], d[1], d[2]) <= most * min(d[0], d[1], d[2])):
        return 0.0
    L, mass = column(c.state.L, i), bodies.mass
    at += INV_I_W
    left = dot(L, symmetric_times((mass[at], mass[at + 1], mass[at + 2]),
                                  (mass[at + 3], mass[at + 4], mass[at + 5]), L))
    now = dot(L, spin_of(quaternion(c.state.q, i), L, d))
    # Not all of it: what is near the limit must not jump.
    return max(0.5 * (now - most * left), 0.0)
