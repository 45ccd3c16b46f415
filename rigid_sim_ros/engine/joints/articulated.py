# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The articulated-body method, as a solver of the linear equations of a tree of joints.

Wanted are the motions V of the bodies and the impulses at the joints, such that

    M V = F + J^T l,    V_i = X V_parent + sum s rate + c,    s . (impulse through the joint) = tau
    - extra * rate,

for impulses (or momenta) F on the bodies. From the leaves to the root every body takes over what
hangs on it: a subtree answers like one body of inertia A, from which the motion along its free
axes has been taken; then the motions follow from the root to the leaves. The cost is proportional
to the number of bodies. All is written in world axes about a reference point of each body, the
place of its joint, so that X only moves the point.

Sources: Featherstone, Rigid Body Dynamics Algorithms (2008), chapter 7; that the same elimination
solves the equations of the multipliers: Baraff, Linear-Time Dynamics using Lagrange Multipliers
(SIGGRAPH 1996). A joint with several axes is passed axis by axis, as if bodies without mass lay
between them.
"""

from rigid_sim_ros.engine.joints.buffers import JointWork, LOCKED, STIFF, UNLOCKED
from rigid_sim_ros.engine.maths.spatial import (
    about_other_point, accumulate, add_six, body_inertia, force_about, load, minus, motion_at,
    product, set_six, Six, six, store, times_motion, times_rotation, times_translation, without)
from rigid_sim_ros.engine.maths.vector import add, add_to_column, column, cross, row, set_column
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Vector
from rigid_sim_ros.kernels.kernel import inlined, kernel

# As many times its inertia an axis feels that is STIFF: what it yields to the forces on it is a
# millionth of what it would yield without its lock. Conditions that only it can satisfy have as
# small a part of the answer of others, which is far above the cut-off of 1e-11 below which they
# would count as such that nothing can satisfy.
STIFFNESS = 1e6


@inlined
def along(table: JointTable, work: JointWork, k: int) -> Six:
    """Return axis k as a motion vector."""
    s = row(work.s, k)
    if table.translates[k] == 1:
        return (s[0], s[1], s[2], 0.0, 0.0, 0.0)
    return (0.0, 0.0, 0.0, s[0], s[1], s[2])


@inlined
def axis_part(table: JointTable, work: JointWork, k: int, F: Six) -> float:
    """Return s . F for axis k."""
    s = row(work.s, k)
    if table.translates[k] == 1:
        return s[0] * F[0] + s[1] * F[1] + s[2] * F[2]
    return s[0] * F[3] + s[1] * F[4] + s[2] * F[5]


@kernel
def factor(model: Model, table: JointTable, work: JointWork, first: int, last: int) -> None:
    """Write A, U and 1 / D of the rows from first to last, which are whole trees."""
    for i in range(first, last):
        store(work.A, i, body_inertia(model.m[table.body[i]], six(work.I_W, i),
                                      row(work.com, i)))
    for back in range(last - first):
        i = last - 1 - back
        A = load(work.A, i)
        for n in range(table.first_axis[i + 1] - table.first_axis[i]):
            k = table.first_axis[i + 1] - 1 - n
            if work.locked[k] == LOCKED:
                work.inv_D[k] = 0.0
                continue
            s = row(work.s, k)
            U = times_translation(A, s) if table.translates[k] == 1 else times_rotation(A, s)
            D = axis_part(table, work, k, U)
            inv_D = 1.0 / (D * STIFFNESS if work.locked[k] == STIFF else D + work.extra[k])
            set_six(work.U, k, U)
            work.inv_D[k] = inv_D
            A = without(A, U, inv_D)
        if table.parent[i] != NONE:
            accumulate(work.A, table.parent[i], about_other_point(A, row(work.arm, i)))


@kernel
def solve(table: JointTable, work: JointWork, first: int, last: int, whole: bool,
          asked: bool) -> None:
    """
    Write the motions V and the rates of the rows from first to last, which are whole trees.

    F, c, tau and the rates of locked axes are given; F becomes what the bodies bear with all that
    hangs on them. `whole`: V are motions, on a base that may move; else changes of motions.
    `asked`: c is not 0.
    """
    for back in range(last - first):
        i = last - 1 - back
        h = six(work.F, i)
        if asked:
            h = minus(h, 1.0, times_motion(load(work.A, i), six(work.c, i)))
        for n in range(table.first_axis[i + 1] - table.first_axis[i]):
            k = table.first_axis[i + 1] - 1 - n
            if work.locked[k] == LOCKED:
                continue
            t = (work.tau[k] + axis_part(table, work, k, h)) * work.inv_D[k]
            work.rate[k] = t
            h = minus(h, t, six(work.U, k))
        if table.parent[i] != NONE:
            add_six(work.F, table.parent[i], force_about(h, row(work.arm, i)))
    for i in range(first, last):
        parent = table.parent[i]
        V = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        if parent == NONE:
            if whole:
                V = six(work.base, i)
        else:
            V = motion_at(six(work.V, parent), row(work.arm, i))
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            rate = 0.0
            if work.locked[k] != LOCKED:
                rate = work.rate[k] - work.inv_D[k] * product(six(work.U, k), V)
                V = minus(V, -rate, along(table, work, k))
            work.rate[k] = rate + (0.0 if work.locked[k] == UNLOCKED else work.given[k])
        if asked:
            V = minus(V, -1.0, six(work.c, i))
        set_six(work.V, i, V)


@kernel
def lock(table: JointTable, work: JointWork, first: int, last: int) -> None:
    """Add the given rates of locked axes to the relative motions c."""
    for i in range(first, last):
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            if work.locked[k] != UNLOCKED:
                set_six(work.c, i, minus(six(work.c, i), -work.given[k], along(table, work, k)))


@kernel
def gather_momenta(table: JointTable, state: State, work: JointWork) -> None:
    """Write the momenta of the bodies about their reference points to F."""
    for i in range(table.body.shape[0]):
        body = table.body[i]
        P, L = column(state.P, body), column(state.L, body)
        n = add(L, cross(row(work.com, i), P))
        set_six(work.F, i, (P[0], P[1], P[2], n[0], n[1], n[2]))


@inlined
def velocity_of_center(work: JointWork, i: int, V: Six) -> Vector:
    """Return the velocity of the centre of mass of row i that moves as V."""
    turned = cross((V[3], V[4], V[5]), row(work.com, i))
    return (V[0] + turned[0], V[1] + turned[1], V[2] + turned[2])


@inlined
def momenta_of(model: Model, table: JointTable, work: JointWork, i: int) -> tuple[
        tuple[float, float, float], tuple[float, float, float]]:
    """Return P = m v and L = I w of a row about its centre of mass."""
    V, I_W = six(work.V, i), six(work.I_W, i)
    m, w = model.m[table.body[i]], (V[3], V[4], V[5])
    v = velocity_of_center(work, i, V)
    P = (m * v[0], m * v[1], m * v[2])
    L = (I_W[0] * w[0] + I_W[1] * w[1] + I_W[2] * w[2],
         I_W[1] * w[0] + I_W[3] * w[1] + I_W[4] * w[2],
         I_W[2] * w[0] + I_W[4] * w[1] + I_W[5] * w[2])
    return P, L


@kernel
def write_momenta(model: Model, table: JointTable, state: State, work: JointWork) -> None:
    """Give the bodies the momenta of the motions V."""
    for i in range(table.body.shape[0]):
        P, L = momenta_of(model, table, work, i)
        set_column(state.P, table.body[i], P)
        set_column(state.L, table.body[i], L)


@kernel
def add_momenta(model: Model, table: JointTable, state: State, work: JointWork, first: int,
                last: int) -> None:
    """Add the momenta of the motions V, which are changes, to the bodies of some rows."""
    for i in range(first, last):
        P, L = momenta_of(model, table, work, i)
        add_to_column(state.P, table.body[i], P)
        add_to_column(state.L, table.body[i], L)
