# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Witnesses: for each pair of convex shapes that were apart, the direction that showed it.

Shapes that are apart are separated by a plane, and it does so for many steps (Baraff, Dynamic
Simulation of Non-penetrating Rigid Bodies, 1992, "coherence"). The direction is kept in the axes
of shape A and tried first. It settles a pair only if it separates by clearly more than the margin,
so that the search it saves would have found nothing either: a witness saves time, and never
changes a manifold.
"""

from rigid_sim_ros.engine.detection.support import box_reach, separation
from rigid_sim_ros.engine.maths.algebra import dot, subtract
from rigid_sim_ros.engine.maths.pose import origin, to_shape, to_world
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel

# Of the size of the larger shape: what a witness has to separate above the margin. It covers what
# the narrow phase lets corners stand out over faces (1e-4); 0 could drop a point that it would
# keep.
CLEARLY = 2e-4


@kernel
def boxes_apart(pose: Array, size: Array, bound: Array, a: int, b: int, axis: Array, k: int,
                margin: float) -> bool:
    """Return whether the witness of pair k, two boxes, still separates them."""
    if axis[k, 3] == 0.0:
        return False
    n = to_world(pose, a, (axis[k, 0], axis[k, 1], axis[k, 2]))
    apart = (dot(subtract(origin(pose, b), origin(pose, a)), n)
             - box_reach(pose, size, a, n) - box_reach(pose, size, b, n))
    return apart > margin + CLEARLY * max(bound[a], bound[b])


@kernel
def separates(pose: Array, shapes: Shapes, a: int, b: int, axis: Array, k: int,
              margin: float) -> bool:
    """Return whether the witness of pair k still separates shapes a and b, of any kind."""
    if axis[k, 3] == 0.0:
        return False
    n = to_world(pose, a, (axis[k, 0], axis[k, 1], axis[k, 2]))
    apart = separation(pose, shapes, a, b, n)
    return apart > margin + CLEARLY * max(shapes.bound[a], shapes.bound[b])


@kernel
def remember(pose: Array, a: int, axis: Array, k: int, n: Vector) -> None:
    """Keep a direction that separated pair k; 0 for none."""
    d = to_shape(pose, a, n)
    axis[k, 0], axis[k, 1], axis[k, 2] = d
    axis[k, 3] = dot(n, n)
