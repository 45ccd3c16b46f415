# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How two bodies give back the angular momentum that their contact should not have given them.

The impulses of a contact act at one point of space, as it was when the manifold was found, while
the pair moves on; see `drift_together`. What angular momentum g the pair gained by that is taken
back as if both were one rigid body: a turn with the angular velocity

    w = -I^-1 g,    I = I_A + I_B + m (d . d - d d^T),    1 / m = 1 / m_A + 1 / m_B,

about the common centre of mass, d from the centre of A to that of B. No other change of the motion
that takes g has less kinetic energy, and none of it moves the bodies against each other at the
point of contact. Shared out by their masses instead, g may lie along the axis of a needle, about
which its energy is a million times as much as across.

Where g is no small part of what the pair has, E may grow still. Of all motions with the angular
momentum that is wanted the rigid one has the least energy, and in s (motion) + (1 - s) (rigid
motion) the energy beyond that goes with s^2: so the pair loses that part 1 - s of its relative
motion, as in an inelastic impact, that ends with no more energy than it had. A gain of less than
`MORE` stays: it is the order of the step, and comes with either sign.
"""

from rigid_sim_ros.engine.constraints.contact_blocks import inverse_of, Motion, Six, Three
from rigid_sim_ros.engine.maths.vector import (
    add, add_scaled, cross, dot, scale, subtract, symmetric_cofactors, symmetric_times)
from rigid_sim_ros.engine.solver.solver_bodies import INV_M
from rigid_sim_ros.engine.solver.turned_energy import MORE
from rigid_sim_ros.kernels.eight import any_of, Eight, Mask, root, select, spread
from rigid_sim_ros.kernels.kernel import part


@part
def without_gain(A: Motion, B: Motion, inv_I_A: Six, inv_I_B: Six, d: Three, gained: Three,
                 mask: Mask) -> tuple[Motion, Motion]:
    """
    Return the motions of pairs without the L [kg m^2/s] that they gained, in the lanes of a mask.

    inv_I_A and inv_I_B are the inverse inertia, world axes; d [m] from the centre of A to that of
    B as the step ends.
    """
    m = inverse_of(A[INV_M] + B[INV_M])
    I_A, I_B = _inverse(inv_I_A), _inverse(inv_I_B)
    inverse = _inverse(_of_both(I_A, I_B, m, d))
    L_A, L_B, v = (A[3], A[4], A[5]), (B[3], B[4], B[5]), (B[0] - A[0], B[1] - A[1], B[2] - A[2])
    L = add(add(L_A, L_B), scale(m, cross(d, v)))
    w = scale(-1.0, _times(inverse, gained))
    # Of the energy beyond that of the common centre of mass.
    before = 0.5 * (m * dot(v, v) + dot(L_A, _times(inv_I_A, L_A))
                    + dot(L_B, _times(inv_I_B, L_B)))
    after = before + dot(w, add_scaled(L, -0.5, gained))
    kept = spread(1.0)
    grows = after > (1.0 + MORE) * before
    if any_of(grows):
        left = subtract(L, gained)
        rigid = _times(inverse, left)
        least = 0.5 * dot(left, rigid)
        share = max((1.0 + MORE) * before - least, 0.0) * inverse_of(after - least)
        kept = select(grows, root(share), 1.0)
        w = add(scale(kept, w), scale(1.0 - kept, rigid))
    w = (select(mask, w[0], 0.0), select(mask, w[1], 0.0), select(mask, w[2], 0.0))
    kept = select(mask, kept, 1.0)
    more = scale(m, add_scaled(cross(w, d), kept - 1.0, v))
    return (_changed(A, kept, scale(-A[INV_M], more), _times(I_A, w)),
            _changed(B, kept, scale(B[INV_M], more), _times(I_B, w)))


@part
def _changed(A: Motion, kept: Eight, v: Three, L: Three) -> Motion:
    """Return a motion with v besides, and L besides the part of its own that is kept."""
    return (A[0] + v[0], A[1] + v[1], A[2] + v[2], kept * A[3] + L[0], kept * A[4] + L[1],
            kept * A[5] + L[2], A[6], A[7])


@part
def _of_both(I_A: Six, I_B: Six, m: Eight, d: Three) -> Six:
    """Return the inertia of a pair as one rigid body, about its centre of mass."""
    xx, yy, zz = m * d[0] * d[0], m * d[1] * d[1], m * d[2] * d[2]
    return (I_A[0] + I_B[0] + yy + zz, I_A[1] + I_B[1] - m * d[0] * d[1],
            I_A[2] + I_B[2] - m * d[0] * d[2], I_A[3] + I_B[3] + zz + xx,
            I_A[4] + I_B[4] - m * d[1] * d[2], I_A[5] + I_B[5] + xx + yy)


@part
def _times(S: Six, v: Three) -> Three:
    """Return the product of a symmetric matrix xx, xy, xz, yy, yz, zz with v."""
    return symmetric_times(S[:3], S[3:], v)


@part
def _inverse(S: Six) -> Six:
    """Return the inverse of a symmetric matrix with a determinant above 0, else 0."""
    (xx, xy, xz), (yy, yz, zz) = symmetric_cofactors(S[:3], S[3:])
    s = inverse_of(S[0] * xx + S[1] * xy + S[2] * xz)
    return (s * xx, s * xy, s * xz, s * yy, s * yz, s * zz)
