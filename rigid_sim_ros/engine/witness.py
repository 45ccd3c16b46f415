# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Witnesses: for each pair of convex shapes that were apart, the direction that showed it.

Shapes that are apart are separated by a plane, and it does so for many steps (Baraff, Dynamic Simulation of
Non-penetrating Rigid Bodies, 1992, "coherence"). The direction is kept in the axes of shape A and tried
first. It settles a pair only if it separates by clearly more than the margin, so that the search it saves
would have found nothing either: a witness saves time, and never changes a manifold.
"""

from rigid_sim_ros.engine.arrays import Array, Vector
from rigid_sim_ros.engine.bare import bare
from rigid_sim_ros.engine.narrow_phase.algebra import dot, origin, subtract, to_shape, to_world
from rigid_sim_ros.engine.narrow_phase.support import box_reach, reach
from rigid_sim_ros.engine.shapes import BOX, PLANE, Shapes, SPHERE

# Of the size of the larger shape: what a witness has to separate above the margin. It covers what the
# narrow phase lets corners stand out over faces (1e-4); 0 could drop a point that it would keep.
CLEARLY = 2e-4


@bare
def separates(pose: Array, shapes: Shapes, a: int, b: int, axis: Array, k: int,
              margin: float) -> bool:
    """Return whether the witness of pair k still separates shapes a and b."""
    if axis[k, 3] == 0.0:
        return False
    n = to_world(pose, a, (axis[k, 0], axis[k, 1], axis[k, 2]))
    size, hulls = shapes.size, shapes.hulls
    if shapes.kind[a] == BOX and shapes.kind[b] == BOX:
        apart = (dot(subtract(origin(pose, b), origin(pose, a)), n)
                 - box_reach(pose, size, a, n) - box_reach(pose, size, b, n))
    else:
        apart = -(reach(pose, shapes.kind, size, hulls.first, hulls.count, hulls.vertices,
                        shapes.hull, a, n)
                  + reach(pose, shapes.kind, size, hulls.first, hulls.count, hulls.vertices,
                          shapes.hull, b, (-n[0], -n[1], -n[2])))
    return apart > margin + CLEARLY * max(shapes.bound[a], shapes.bound[b])


@bare
def remember(pose: Array, shapes: Shapes, a: int, axis: Array, k: int, n: Vector) -> None:
    """Keep a direction that separated pair k; 0 for none."""
    d = to_shape(pose, a, n)
    axis[k, 0], axis[k, 1], axis[k, 2] = d
    axis[k, 3] = dot(n, n)


@bare
def worth_it(shapes: Shapes, a: int, b: int) -> bool:
    """Return whether a witness is faster than the narrow phase: not for spheres and planes."""
    return not (shapes.kind[a] == PLANE or shapes.kind[b] == PLANE
                or (shapes.kind[a] == SPHERE and shapes.kind[b] <= BOX)
                or (shapes.kind[b] == SPHERE and shapes.kind[a] <= BOX))
