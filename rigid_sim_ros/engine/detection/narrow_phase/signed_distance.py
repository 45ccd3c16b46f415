# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The signed distance of any two shapes, as exact as their kinds allow."""

import math

from rigid_sim_ros.engine.detection.manifolds import Scratch
from rigid_sim_ros.engine.detection.narrow_phase.balls import ball_gap
from rigid_sim_ros.engine.detection.narrow_phase.collide import (
    BALL, FAMILY, nearest_point, NEVER, ONE_POINT, PLANE_FIRST, PLANE_SECOND)
from rigid_sim_ros.engine.detection.narrow_phase.convex import distance
from rigid_sim_ros.engine.detection.support import extreme, radius
from rigid_sim_ros.engine.maths.algebra import add_scaled, dot, scale, subtract
from rigid_sim_ros.engine.maths.pose import axis, origin
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def signed_distance(pose: Array, shapes: Shapes, a: int, b: int,
                    scratch: Scratch) -> tuple[float, Vector, Vector, Vector]:
    """
    Return the gap [m], the unit normal from A to B and the nearest points on A and on B.

    The distance where the shapes are apart; where they overlap minus the length of the shortest
    way to part them. All in world axes; `pose` as `place_shapes` writes it. Two planes never
    meet: infinite.
    """
    family = FAMILY[shapes.kind[a], shapes.kind[b]]
    if family in (PLANE_FIRST, PLANE_SECOND):
        gap, n, p = _plane(pose, shapes, a, b, family == PLANE_SECOND)
    elif family == BALL:
        gap, n, p = ball_gap(pose, shapes.size, shapes.kind[a], shapes.kind[b], a, b)
    elif family in ONE_POINT:
        gap, n, p = nearest_point(family, pose, shapes.size, a, b)
    elif family == NEVER:
        gap, n, p = math.inf, (0.0, 0.0, 1.0), origin(pose, a)
    else:
        gap, n, p = distance(pose, shapes, a, b, math.inf, scratch)
    return gap, n, p, add_scaled(p, gap, n)


@kernel
def _plane(pose: Array, shapes: Shapes, a: int, b: int,
           second: bool) -> tuple[float, Vector, Vector]:
    plane, s = (b, a) if second else (a, b)
    n, hulls = axis(pose, plane, 2), shapes.hulls
    down = scale(-1.0, n)
    q = extreme(pose, shapes.kind, shapes.size, hulls.first, hulls.count, hulls.vertices,
                shapes.hull,
                s, down)
    q = add_scaled(q, radius(shapes.kind, shapes.size, s), down)
    gap = dot(subtract(q, origin(pose, plane)), n)
    if second:
        return gap, down, q
    return gap, n, add_scaled(q, -gap, n)
