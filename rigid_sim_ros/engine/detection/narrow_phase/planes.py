# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Shapes on a plane: the corners, ends and rim points that lie lowest.

The plane is A of the manifold here; who calls turns the result over where it is B.
"""

import math

from rigid_sim_ros.engine.detection.manifolds import CANDIDATES
from rigid_sim_ros.engine.detection.narrow_phase.reduce import put, reduce_to_four
from rigid_sim_ros.engine.maths.algebra import add_scaled, dot, scale, subtract
from rigid_sim_ros.engine.maths.pose import axis, origin, point_to_world
from rigid_sim_ros.engine.model.hulls import HullTable
from rigid_sim_ros.engine.model.shapes import BOX, CAPSULE, CYLINDER
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

# A cylinder that stands within this angle [rad] of upright touches with four points fixed in its
# rim, beyond it one of them is the rim point that is lowest: 0 would let the points of a cylinder
# at rest wander around, 1e-2 would let a tilted rim sink in, between points, by 0.3 % of its
# radius.
UPRIGHT = 1e-5


@kernel
def plane_shape(pose: Array, size: Array, kind: int, plane: int, s: int, hulls: HullTable,
                hull: int,
                margin: float, points: Array, ids: IntArray) -> int:
    """Find the points of shape s, no sphere, within the margin of a plane; return their number."""
    n, p = axis(pose, plane, 2), origin(pose, plane)
    if kind == BOX:
        count = _box(pose, size, s, n, p, margin, points, ids)
        small = min(size[s, 0], size[s, 1], size[s, 2])
    elif kind == CAPSULE:
        count, small = 0, size[s, 0]
        for end in range(2):
            middle = add_scaled(origin(pose, s), size[s, 1] if end == 1 else -size[s, 1],
                                axis(pose, s, 2))
            count = _add(points, ids, count, n, p, add_scaled(middle, -size[s, 0], n), end, margin)
    elif kind == CYLINDER:
        count = _cylinder(pose, size, s, n, p, margin, points, ids)
        small = min(size[s, 0], size[s, 1])
    else:
        count = _hull(pose, s, hulls, hull, n, p, margin, points, ids)
        small = min(size[s, 0], size[s, 1], size[s, 2])
    return reduce_to_four(points, ids, count, n, small)


@kernel
def _add(points: Array, ids: IntArray, count: int, n: Vector, p: Vector, q: Vector, feature: int,
         margin: float) -> int:
    """Add the point q of a shape if it is near the plane; return the new number of points."""
    gap = dot(n, subtract(q, p))
    if gap >= margin:
        return count
    put(points, ids, count, add_scaled(q, -gap, n), gap, feature)
    return count + 1


@kernel
def _box(pose: Array, size: Array, s: int, n: Vector, p: Vector, margin: float, points: Array,
         ids: IntArray) -> int:
    X, Y, Z = scale(size[s, 0], axis(pose, s, 0)), scale(size[s, 1], axis(pose, s, 1)), scale(
        size[s, 2], axis(pose, s, 2))
    c, count = origin(pose, s), 0
    nx, ny, nz = dot(n, X), dot(n, Y), dot(n, Z)
    height = dot(n, subtract(c, p))
    if height - abs(nx) - abs(ny) - abs(nz) >= margin:
        return 0
    for corner in range(8):
        sx = 1.0 if corner & 1 else -1.0
        sy = 1.0 if corner & 2 else -1.0
        sz = 1.0 if corner & 4 else -1.0
        gap = height + sx * nx + sy * ny + sz * nz
        if gap < margin:
            q = (c[0] + sx * X[0] + sy * Y[0] + sz * Z[0] - gap * n[0],
                 c[1] + sx * X[1] + sy * Y[1] + sz * Z[1] - gap * n[1],
                 c[2] + sx * X[2] + sy * Y[2] + sz * Z[2] - gap * n[2])
            put(points, ids, count, q, gap, corner)
            count += 1
    return count


@kernel
def _cylinder(pose: Array, size: Array, s: int, n: Vector, p: Vector, margin: float, points: Array,
              ids: IntArray) -> int:
    """Take four points around the rim that is lower and the lowest point of the other rim."""
    Z, r = axis(pose, s, 2), size[s, 0]
    rising = dot(n, Z)
    lower = -1.0 if rising > 0.0 else 1.0
    down = add_scaled(scale(rising, Z), -1.0, n)
    sine = math.sqrt(dot(down, down))
    first = 0
    if sine > UPRIGHT:
        X = scale(1.0 / sine, down)
        first = 8
    else:
        X = axis(pose, s, 0)
    Y = (Z[1] * X[2] - Z[2] * X[1], Z[2] * X[0] - Z[0] * X[2], Z[0] * X[1] - Z[1] * X[0])
    cap = add_scaled(origin(pose, s), lower * size[s, 1], Z)
    count = _add(points, ids, 0, n, p, add_scaled(cap, r, X), first, margin)
    count = _add(points, ids, count, n, p, add_scaled(cap, r, Y), first + 1, margin)
    count = _add(points, ids, count, n, p, add_scaled(cap, -r, X), first + 2, margin)
    count = _add(points, ids, count, n, p, add_scaled(cap, -r, Y), first + 3, margin)
    if first > 0:
        far = add_scaled(add_scaled(cap, -2.0 * lower * size[s, 1], Z), r, X)
        count = _add(points, ids, count, n, p, far, 16, margin)
    return count


@kernel
def _hull(pose: Array, s: int, hulls: HullTable, hull: int, n: Vector, p: Vector, margin: float,
          points: Array, ids: IntArray) -> int:
    count, first = 0, hulls.first[hull]
    for v in range(hulls.count[hull]):
        if count < CANDIDATES:
            k = first + v
            q = point_to_world(pose, s, (hulls.vertices[k, 0], hulls.vertices[k, 1],
                                         hulls.vertices[k, 2]))
            count = _add(points, ids, count, n, p, q, v, margin)
    return count
