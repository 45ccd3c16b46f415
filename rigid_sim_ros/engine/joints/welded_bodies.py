# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What fixed joints make one body of: its mass, its answer to an impulse, its levers.

How large an articulation is, and what a body of it would move if no joint held it, are measures
for others. A fixed joint has no part in them: halves that it holds together are one body, however
the whole is divided.
"""

import math

from rigid_sim_ros.engine.joints.buffers import JointWork
from rigid_sim_ros.engine.maths.spatial import Six
from rigid_sim_ros.engine.maths.vector import (
    add, add_scaled, cross, dot, row, scale, subtract, symmetric_cofactors, symmetric_times)
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.kernels.arrays import Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def welded_mass(model: Model, table: JointTable, r: int) -> float:
    """Return the mass [kg] of the body that fixed joints make of row r and others."""
    total, left, n = 0.0, table.welded_to[r] + 1, table.welded[r]
    while left > 0:
        if table.welded[n] == table.welded[r]:
            total, left = total + model.m[table.body[n]], left - 1
        n += 1
    return total


@kernel
def welded_answer(model: Model, table: JointTable, work: JointWork, r: int, x: Vector, f: Vector,
                  n: Vector) -> float:
    """
    Return f . v + n . w: what an impulse f, with the moment n about a point x [m], moves there.

    v [m/s] of that point and w [rad/s] are those of the one body that fixed joints make of row r.
    """
    m, center, I_W = _welded_inertia(model, table, work, r)
    about = add(n, cross(subtract(x, center), f))
    first, second = symmetric_cofactors((I_W[0], I_W[1], I_W[2]), (I_W[3], I_W[4], I_W[5]))
    determinant = dot((I_W[0], I_W[1], I_W[2]), first)
    return dot(f, f) / m + dot(about, symmetric_times(first, second, about)) / determinant


@kernel
def _welded_inertia(model: Model, table: JointTable, work: JointWork, r: int) -> tuple[
        float, Vector, Six]:
    """Return mass [kg], centre [m] and, about that, inertia [kg m^2] (xx xy xz yy yz zz)."""
    m, center = welded_mass(model, table, r), (0.0, 0.0, 0.0)
    left, n = table.welded_to[r] + 1, table.welded[r]
    while left > 0:
        if table.welded[n] == table.welded[r]:
            at = add(row(work.p, n), row(work.com, n))
            center, left = add_scaled(center, model.m[table.body[n]], at), left - 1
        n += 1
    center = scale(1.0 / m, center)
    I_W: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    left, n = table.welded_to[r] + 1, table.welded[r]
    while left > 0:
        if table.welded[n] == table.welded[r]:
            # The parallel axis theorem: I + m (d . d 1 - d d^T).
            x, y, z = subtract(add(row(work.p, n), row(work.com, n)), center)
            part, own = model.m[table.body[n]], work.I_W[n]
            I_W = (I_W[0] + own[0] + part * (y * y + z * z), I_W[1] + own[1] - part * x * y,
                   I_W[2] + own[2] - part * x * z, I_W[3] + own[3] + part * (x * x + z * z),
                   I_W[4] + own[4] - part * y * z, I_W[5] + own[5] + part * (x * x + y * y))
            left -= 1
        n += 1
    return m, center, I_W


@kernel
def longest_lever(model: Model, table: JointTable, work: JointWork, g: int) -> float:
    """
    Return the length [m] of articulation g: its longest lever, or radius of gyration of a body.

    A lever goes from the joint on which a body hangs to its centre, or to a joint on it.
    """
    square = 0.0
    for i in range(table.first_row[g], table.first_row[g + 1]):
        if table.welded_to[i] == 0:
            body, com = table.body[i], row(work.com, i)
            square = max(square, dot(com, com))
            for n in range(3):
                square = max(square, model.I_C[n, body] / model.m[body])
        elif table.welded[i] == i:
            m, center, I_W = _welded_inertia(model, table, work, i)
            com = subtract(center, row(work.p, i))
            square = max(square, dot(com, com), _largest_moment(I_W) / m)
        if table.welded[i] == i and table.parent[i] != NONE:
            # The rows of a welded body begin with the one that hangs on another body.
            arm = row(work.arm, i)
            if table.welded_to[table.parent[i]] > 0:
                arm = subtract(row(work.p, i), row(work.p, table.welded[table.parent[i]]))
            square = max(square, dot(arm, arm))
    return math.sqrt(square)


@kernel
def _largest_moment(I_W: Six) -> float:
    """
    Return the largest principal moment of an inertia tensor (xx xy xz yy yz zz).

    Smith, Eigenvalues of a symmetric 3 x 3 matrix, Communications of the ACM 4 (1961).
    """
    mean = (I_W[0] + I_W[3] + I_W[5]) / 3.0
    x, y, z = I_W[0] - mean, I_W[3] - mean, I_W[5] - mean
    off = (I_W[1], I_W[2], I_W[4])
    spread = math.sqrt((x * x + y * y + z * z + 2.0 * dot(off, off)) / 6.0)
    if spread == 0.0:
        return mean
    determinant = (x * (y * z - off[2] * off[2]) - off[0] * (off[0] * z - off[2] * off[1])
                   + off[1] * (off[0] * off[2] - y * off[1]))
    share = min(max(0.5 * determinant / (spread * spread * spread), -1.0), 1.0)
    return mean + 2.0 * spread * math.cos(math.acos(share) / 3.0)
