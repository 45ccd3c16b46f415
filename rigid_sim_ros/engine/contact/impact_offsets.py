# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where collisions inside a step moved the bodies, as if to the start of the step.

A line of `CollisionWork.body` ends with them: six columns, displacement of the centre of mass [m]
and rotation [rad], world axes, and one that is 1 where the body has collided. Solvers that run
after the collisions start from there.
"""

from rigid_sim_ros.engine.detection.manifolds import Manifolds
from rigid_sim_ros.engine.maths.vector import add, cross, dot, row, subtract
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel

SHIFT = 22  # the first of the six columns
COLLIDED = 28


@kernel
def displacement(line: Array) -> Vector:
    """Return how far collisions moved the centre of mass of a body [m]."""
    return (line[SHIFT], line[SHIFT + 1], line[SHIFT + 2])


@kernel
def has_collided(line: Array) -> bool:
    """Return whether a body has collided in this step; at its start that moves it nowhere."""
    return bool(line[COLLIDED] != 0.0)


@kernel
def shifted(line: Array, r: Vector) -> Vector:
    """Return how far collisions displaced a point of a body, r from its centre of mass."""
    angle = (line[SHIFT + 3], line[SHIFT + 4], line[SHIFT + 5])
    return add(displacement(line), cross(angle, r))


@kernel
def gap_now(manifolds: Manifolds, body: Array, r: int, p: int) -> float:
    """Return the gap at the start of the step, after earlier collisions moved it."""
    moved = subtract(shifted(body[manifolds.body_b[r]], row(manifolds.r_B[p], r)),
                     shifted(body[manifolds.body_a[r]], row(manifolds.r_A[p], r)))
    return manifolds.gap[p, r] + dot(row(manifolds.normal, r), moved)
