# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How bodies answer to impulses that fixed joints make one body of, if nothing else held them.

How much a row of contact yields is a share of what it moves without joints. A fixed joint has no
part in that: halves that it holds together are one body, however the whole is divided.
"""

from rigid_sim_ros.engine.contact.contact_rows import Rows
from rigid_sim_ros.engine.joints.buffers import JointWork
from rigid_sim_ros.engine.maths.spatial import Six
from rigid_sim_ros.engine.maths.vector import (
    add, add_scaled, cross, dot, row, scale, subtract, symmetric_cofactors, symmetric_times)
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.kernels.arrays import Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def weld(model: Model, table: JointTable, work: JointWork, width: int, m: int, rows: Rows) -> None:
    """Write to rows.stiff of m points what they move if fixed joints hold, and no others."""
    for c in range(m):
        for side in range(2):
            r = table.row_of_body[rows.body[c, side]]
            if r == NONE or table.welded_to[r] == 0:
                continue
            x, at = add(row(work.p, r), row(work.com, r)), 6 * side
            for i in range(width * c, width * c + width):
                f = (rows.G[i, at], rows.G[i, at + 1], rows.G[i, at + 2])
                n = (rows.G[i, at + 3], rows.G[i, at + 4], rows.G[i, at + 5])
                own = 0.0
                for k in range(at, at + 6):
                    own += rows.G[i, k] * rows.W[rows.at[i] + k]
                rows.stiff[i] += welded_answer(model, table, work, r, x, f, n) - own


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
