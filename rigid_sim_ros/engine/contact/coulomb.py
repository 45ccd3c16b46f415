# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The law of contact at points whose rates are a = A f + b: its rows, its disks and its tolerances.

Along the normal a_n >= 0, f_n >= 0, f_n a_n = 0, and in the tangential plane Coulomb's law. See
resting_qp.py for what A and b are, contact_rows.py for sweeps and contact_newton.py for Newton's
method. Torques against spinning and rolling obey the same law with
coefficients of their own: three disks in place of one, and three more rows to a point.
"""

import numpy as np

from rigid_sim_ros.kernels.kernel import kernel

# A is singular where points are redundant (the four corners of a box): the forces are not unique,
# A f is, and rounding in b can make sticking everywhere impossible. Each A_ii grows by this
# fraction, a compliance of the points: redundant points share the load evenly, and a
# contact under the force f yields with the acceleration 1e-8 A_ii f, 1e-10 m/s for a body under
# its weight at a step of 1 ms. Smaller: forces feel rounding more.
COMPLIANCE = 1e-8
# Newton's method ends at a violation this small against |b|; rounding leaves 1e-16 to 1e-13.
GOAL = 1e-12
# Less than EARLY_TOLERANCE ends the search: 1e-9 of g moves a body at rest with 1e-11 m/s after a
# step of 1 ms. Redundant points on the verge of slipping may stay above it; more than TOLERANCE
# after ROUNDS is not solved.
EARLY_TOLERANCE = 1e-9
TOLERANCE = 1e-7


@kernel
def coefficients(width: int) -> int:
    """Return how many coefficients, and disks, a point with so many rows has: 1 or 3."""
    return width // 3 * 2 - 1


@kernel
def disk(d: int) -> tuple[int, int]:
    """Return the first row of disk d of a point and how many it has: slip, spin, roll."""
    if d == 0:
        return 1, 2
    if d == 1:
        return 3, 1
    return 4, 2


@kernel
def onto_disk(x: float, y: float, radius: float) -> tuple[float, float]:
    """Return the point of a disk about 0 that is nearest to (x, y)."""
    length = np.sqrt(x * x + y * y)
    if length > radius:
        return x * radius / length, y * radius / length
    return x, y


@kernel
def off_disk(f_x: float, f_y: float, w_x: float, w_y: float, radius: float, size: int) -> float:
    """Return how far the forces of a disk of 1 or 2 rows are from the nearest of it to w."""
    w_x, w_y = onto_disk(w_x, w_y, radius)
    return max(abs(f_x - w_x), abs(f_y - w_y) if size == 2 else 0.0)
