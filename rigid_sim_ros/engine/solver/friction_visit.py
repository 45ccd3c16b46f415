# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Friction in a visit of the sequential solver to eight manifolds; see contact_sweep.py."""

from rigid_sim_ros.engine.constraints.contact_blocks import (
    INV_SPIN, INV_TT, K_SPIN, MU, PER_LEVER, SLIDE, SPIN_LEVER, SPIN_SLIDE, Three, Two)
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.eight import any_of, Eight, load, root, select
from rigid_sim_ros.kernels.kernel import part


@part
def coulomb(b: Array, twist: Three, pressure: Eight, d: Two, old: Three) -> Three:
    """
    Stop the sliding and the spinning, as far as the pressure allows.

    Returns the impulses f along t1, t2 and the one about n at c, L; `twist` is T with the old
    ones. The contact is a surface, each part of which rubs against its own velocity: what turns
    while it slides is held less. With d from c to the centre of pressure, all impulses that it can
    make are near to an ellipsoid,

        (|f| / mu N)^2 + (L_p / lever mu N)^2 <= 1,     L_p = L - n . (d x f)

    (Howe, Cutkosky, Practical force-motion models for sliding manipulation, Int. J. Robotics Res.
    15 (1996)). Inside of it the impulse that stops all three at once. On it the impulse must
    oppose the twist that is left, in units in which it is a ball, while K need not be isotropic:
    there the step is a multiple of the twist, short enough to converge.
    """
    limit, most = load(b, MU) * pressure, load(b, SPIN_LEVER) * pressure
    spin = old[2] - load(b, INV_SPIN) * twist[2]
    # Where there is only one of both.
    spin = select(limit * most > 0.0, spin, min(max(spin, -most), most))
    u1 = twist[0] + load(b, K_SPIN) * (spin - old[2])
    u2 = twist[1] + load(b, K_SPIN + 1) * (spin - old[2])
    inv00, inv01, inv11 = load(b, INV_TT), load(b, INV_TT + 1), load(b, INV_TT + 2)
    stick1, stick2 = old[0] - inv00 * u1 - inv01 * u2, old[1] - inv01 * u1 - inv11 * u2
    about = load(b, PER_LEVER) * (spin - (d[0] * stick2 - d[1] * stick1))
    sticks = stick1 * stick1 + stick2 * stick2 + about * about <= limit * limit
    # What nothing presses has no friction.
    new1, new2 = select(sticks, stick1, 0.0), select(sticks, stick2, 0.0)
    slides = select(sticks, 0.0, limit) > 0.0
    if any_of(slides):
        slid = _slide(b, twist, d, old, limit)
        new1, new2 = select(slides, slid[0], new1), select(slides, slid[1], new2)
        spin = select(slides, slid[2], spin)
    return (new1, new2, spin)


@part
def _slide(b: Array, twist: Three, d: Two, old: Three, limit: Eight) -> Three:
    """Return what friction is after a step against the twist: `limit` is mu N."""
    f1 = old[0] - load(b, SLIDE) * (twist[0] - d[1] * twist[2])
    f2 = old[1] - load(b, SLIDE) * (twist[1] + d[0] * twist[2])
    about = old[2] - (d[0] * old[1] - d[1] * old[0]) - load(b, SPIN_SLIDE) * twist[2]
    scaled = load(b, PER_LEVER) * about
    square = f1 * f1 + f2 * f2 + scaled * scaled
    back = select(square > limit * limit, limit / root(square), 1.0)
    f1, f2 = back * f1, back * f2
    return (f1, f2, d[0] * f2 - d[1] * f1 + back * about)
