# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The inertia that each axis feels, with all that hangs on it and all that it hangs on.

It is 1 / (M^-1)_kk, M the mass matrix of the axes: less than s . A s of the subtree wherever the
parent gives way. From the root to the leaves goes the answer O of each body to a force on it, with
the motions of what it hangs on: O_i = T (X O_parent X^T) T^T + s s^T / D, T = 1 - s U^T / D (the
inverse of the operational space inertia; Kreutz-Delgado, Jain, Rodriguez, Recursive formulation of
operational space control, Int. J. Robotics Research 11 (1992)).
"""

from rigid_sim_ros.engine.joints.articulated import along
from rigid_sim_ros.engine.joints.buffers import JointMotion, JointWork
from rigid_sim_ros.engine.maths.cholesky import CUT_OFF, solve_semidefinite
from rigid_sim_ros.engine.maths.spatial import (
    about_other_point, Inertia, load, plus_products, product, Six, six, store, times_motion)
from rigid_sim_ros.engine.maths.vector import row
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.kernels.kernel import inlined, kernel


@inlined
def _swapped(V: Six) -> Six:
    """Return the angular part first: O stands with its angular block in the place of M."""
    return (V[3], V[4], V[5], V[0], V[1], V[2])


@kernel
def effective_inertias(table: JointTable, work: JointWork) -> None:
    """Write the inertias [kg m^2 or kg] of all axes; `factor` has been called with all free."""
    nothing: Inertia = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
                        0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for i in range(table.body.shape[0]):
        answer = nothing
        if table.parent[i] != NONE:
            r = row(work.arm, i)
            # X O X^T in swapped blocks is what X^T A X is with the arm the other way.
            answer = about_other_point(load(work.answer, table.parent[i]), (-r[0], -r[1], -r[2]))
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            s, U, inv_D = _swapped(along(table, work, k)), _swapped(six(work.U, k)), work.inv_D[k]
            a = times_motion(answer, U)
            own = inv_D * (1.0 + inv_D * product(U, a))
            work.felt[k] = 1.0 / own
            answer = plus_products(answer, s, a, -inv_D, own)
        store(work.answer, i, answer)


@kernel
def has_damped_loops(table: JointTable, motion: JointMotion, g: int) -> bool:
    """Return whether articulation g has loops or couplings, and axes that anything damps."""
    if table.first_condition[g + 1] == table.first_condition[g]:
        return False
    for i in range(table.first_row[g], table.first_row[g + 1]):
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            if table.laws.damping[k] > 0.0 or motion.drives.damping[k] > 0.0:
                return True
    return False


@kernel
def add_loops(table: JointTable, work: JointWork, g: int) -> None:
    """
    Change the inertias that the axes of articulation g feel to those with its loops closed.

    Else they would be those of whichever joints are taken for the tree. With the rates G_k of an
    axis that unit impulses of the conditions give, and S = C M~^-1 C^T, the answer of the axis
    falls from (M^-1)_kk by G_k . S^-1 G_k. `factor_conditions` has been called with all axes free.
    """
    loop, first, last = work.loop, table.first_condition[g], table.first_condition[g + 1]
    start = table.first_axis[table.first_row[g]]
    for k in range(start, table.first_axis[table.first_row[g + 1]]):
        for m in range(first, last):
            loop.missing[m] = loop.answer_rate[m, k - start]
        solve_semidefinite(loop.S[first:last], loop.rank[g], last - first, loop.scale[first:last],
                           loop.order[first:last], loop.missing[first:last],
                           loop.impulse[first:last])
        alone = 1.0 / work.felt[k]
        own = alone
        for m in range(first, last):
            own -= loop.answer_rate[m, k - start] * loop.impulse[m]
        # What the loops forbid altogether moves nowhere, and feels no more than can be told.
        work.felt[k] = 1.0 / max(own, CUT_OFF * alone)
