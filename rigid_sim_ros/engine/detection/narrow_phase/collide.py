# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The manifold of any two shapes: a table says which family of pairs they belong to."""

import numpy as np

from rigid_sim_ros.engine.detection.manifolds import Scratch
from rigid_sim_ros.engine.detection.narrow_phase.balls import capsule_capsule, touching_ball
from rigid_sim_ros.engine.detection.narrow_phase.boxes import box_box, UNSETTLED
from rigid_sim_ros.engine.detection.narrow_phase.convex import convex_convex
from rigid_sim_ros.engine.detection.narrow_phase.ellipsoids import ellipsoid_ellipsoid
from rigid_sim_ros.engine.detection.narrow_phase.planes import plane_shape
from rigid_sim_ros.engine.maths.algebra import add_scaled
from rigid_sim_ros.engine.model.kinds.points import put
from rigid_sim_ros.engine.model.kinds.table import BOX, CAPSULE, ELLIPSOID, KINDS
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel

# The families of pairs.
BALL, CAPSULES, BOXES, PLANE_FIRST, PLANE_SECOND, CONVEX, NEVER, ELLIPSOIDS = range(8)

# Pairs of kinds with a method of their own.
_OWN = {(CAPSULE, CAPSULE): CAPSULES, (BOX, BOX): BOXES, (ELLIPSOID, ELLIPSOID): ELLIPSOIDS}

# Of these, the families that meet in one point and have a formula or an iteration for it.
ONE_POINT = (CAPSULES, ELLIPSOIDS)
# The families that `collide_by_search` is for.
SEARCHED = (*ONE_POINT, CONVEX)


def _family(a: int, b: int) -> int:
    """Return the family of a pair of kinds: the most exact method that both have."""
    first, second = KINDS[a], KINDS[b]
    if first.is_unbounded and second.is_unbounded:
        return NEVER
    if (first.is_ball and second.from_point) or (second.is_ball and first.from_point):
        return BALL
    if first.is_unbounded or second.is_unbounded:
        return PLANE_FIRST if first.is_unbounded else PLANE_SECOND
    return _OWN.get((a, b), CONVEX)


FAMILY = np.array([[_family(a, b) for b in range(len(KINDS))] for a in range(len(KINDS))])


@kernel
def collide(pose: Array, shapes: Shapes, a: int, b: int, margin: float, way: float,
            scratch: Scratch) -> tuple[int, Vector]:
    """
    Find the points of shapes a and b that are nearer than the margin [m].

    Returns their number, at most 4, and the unit normal from A to B, world axes. The points are
    left in `scratch.points` (on A, with the gap) and `scratch.ids`. `way` [m] is how far the pair
    still moves: what may touch with a face is seen as a face. With 0 points the normal is a
    direction that separates the shapes by more than the margin, or 0 where none is known.
    """
    family = FAMILY[shapes.kind[a], shapes.kind[b]]
    points, ids = scratch.points, scratch.ids
    if family == BOXES:
        count, n = box_box(pose, shapes.size, a, b, margin, way, points, ids, scratch.polygon,
                           scratch.labels, scratch.numbers)
        if count != UNSETTLED:
            return count, n
    if family in (PLANE_FIRST, PLANE_SECOND):
        return on_plane(pose, shapes, a, b, family == PLANE_SECOND, margin, scratch)
    if family == BALL:
        return touching_ball(pose, shapes.size, shapes.kind[a], shapes.kind[b], a, b, margin,
                             points, ids)
    if family == NEVER:
        return 0, (0.0, 0.0, 0.0)
    return collide_by_search(pose, shapes, a, b, margin, scratch)


@kernel
def nearest_point(family: int, pose: Array, size: Array, a: int,
                  b: int) -> tuple[float, Vector, Vector]:
    """Return the signed distance [m] of a pair of ONE_POINT, the normal and the point on A."""
    if family == CAPSULES:
        return capsule_capsule(pose, size, a, b)
    return ellipsoid_ellipsoid(pose, size, a, b)


@kernel
def collide_by_search(pose: Array, shapes: Shapes, a: int, b: int, margin: float,
                      scratch: Scratch) -> tuple[int, Vector]:
    """Write the points of two convex shapes by search: none is a plane, not both are boxes."""
    family = FAMILY[shapes.kind[a], shapes.kind[b]]
    if family not in ONE_POINT:
        return convex_convex(pose, shapes, a, b, margin, scratch)
    gap, n, p = nearest_point(family, pose, shapes.size, a, b)
    if gap >= margin:
        return 0, n
    put(scratch.points, scratch.ids, 0, p, gap, 0)
    return 1, n


@kernel
def on_plane(pose: Array, shapes: Shapes, a: int, b: int, second: bool, margin: float,
             scratch: Scratch) -> tuple[int, Vector]:
    """Write the points of a plane, which may be the second of both, and another shape."""
    plane, s = (b, a) if second else (a, b)
    points = scratch.points
    count = plane_shape(pose, shapes, plane, s, margin, points, scratch.ids)
    n = (pose[plane, 5], pose[plane, 8], pose[plane, 11])
    if not second:
        return count, n
    for k in range(count):
        gap = points[k, 3]
        p = add_scaled((points[k, 0], points[k, 1], points[k, 2]), gap, n)
        put(points, scratch.ids, k, p, gap, scratch.ids[k])
    return count, (-n[0], -n[1], -n[2])
