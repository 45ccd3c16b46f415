# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The impulses of manifolds, carried over to the next step by the features that meet: a warm start.

What `event` carries over are forces: contact/carried_forces.py.
"""

from rigid_sim_ros.engine.detection.manifolds import Manifolds, rows_in_use, StepImpulses
from rigid_sim_ros.kernels.kernel import kernel, part


@part
def carry_over(now: Manifolds, before: Manifolds, row: int, old: int, count: int) -> None:
    """Start from the impulses of the last step where the same features touch, from 0 elsewhere."""
    for p in range(count):
        now.impulse[p, row] = 0.0
        if old >= 0:
            for r in range(before.points[old]):
                if before.feature[r, old] == now.feature[p, row]:
                    now.impulse[p, row] = before.impulse[r, old]
    for k in range(3):
        now.friction[row, k] = before.friction[old, k] if old >= 0 else 0.0
    # Most have no resistance to spinning: theirs stays 0, in memory that nobody writes to.
    spin = before.spin[old] if old >= 0 else 0.0
    if now.spin[row] != spin:
        now.spin[row] = spin
    for k in range(3):
        roll = before.roll[old, k] if old >= 0 else 0.0
        if now.roll[row, k] != roll:
            now.roll[row, k] = roll


@kernel
def clear_impulses(manifolds: Manifolds, acted: StepImpulses) -> None:
    """Let nothing have acted in this step yet: at all points, for a prediction may add some."""
    first, count = rows_in_use(manifolds)
    acted.friction[first:first + count] = 0.0
    acted.normal[:, first:first + count] = 0.0
