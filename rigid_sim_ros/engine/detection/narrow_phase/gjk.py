# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Distance of two convex cores that are apart.

The distance of A and B is that of the origin from the set of all differences a - b. A simplex of
up to four of its points is moved towards the origin (Gilbert, Johnson, Keerthi, IEEE J. Robotics
and Automation 4, 1988; van den Bergen, Collision Detection in Interactive 3D Environments, 2003).
Row k of the simplex holds a - b, a and b.
"""

import math

from rigid_sim_ros.engine.detection.support import extreme
from rigid_sim_ros.engine.maths.algebra import add_scaled, cross, dot, scale, subtract
from rigid_sim_ros.engine.maths.pose import origin
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

# Rounds before the search gives up; polyhedra need 5 to 15, round shapes up to 40.
ROUNDS = 80
# v . (v - w) bounds how much nearer the origin could still come: below this part of v . v it is
# done.
NEAR = 1e-15


@kernel
def corner(c: Array, k: int) -> Vector:
    """Return the difference a - b of row k."""
    return (c[k, 0], c[k, 1], c[k, 2])


@kernel
def find_corner(pose: Array, kind: IntArray, size: Array, first: IntArray, count: IntArray,
                vertices: Array, hull: IntArray, a: int, b: int, d: Vector, c: Array,
                k: int) -> Vector:
    """Write row k: the difference a - b farthest in the direction d, and return it."""
    p = extreme(pose, kind, size, first, count, vertices, hull, a, d)
    q = extreme(pose, kind, size, first, count, vertices, hull, b, (-d[0], -d[1], -d[2]))
    for i in range(3):
        c[k, i] = p[i] - q[i]
        c[k, 3 + i] = p[i]
        c[k, 6 + i] = q[i]
    return subtract(p, q)


@kernel
def _copy(c: Array, source: int, target: int) -> None:
    for i in range(9):
        c[target, i] = c[source, i]


@kernel
def nearest_on_triangle(p: Vector, q: Vector, r: Vector) -> tuple[float, float, float]:
    """Return the weights of p, q, r in the point of a triangle nearest to the origin."""
    # Ericson, Real-Time Collision Detection, 5.1.5, for the point at the origin.
    pq, pr = subtract(q, p), subtract(r, p)
    d1, d2 = -dot(pq, p), -dot(pr, p)
    if d1 <= 0.0 and d2 <= 0.0:
        return 1.0, 0.0, 0.0
    d3, d4 = -dot(pq, q), -dot(pr, q)
    if d3 >= 0.0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t = d1 / (d1 - d3)
        return 1.0 - t, t, 0.0
    d5, d6 = -dot(pq, r), -dot(pr, r)
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
        return 1.0 - t, 0.0, t
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - t, t
    total = va + vb + vc
    return va / total, vb / total, vc / total


@kernel
def _nearest(c: Array, count: int, weight: Array) -> bool:
    """Write the weights of the point of a simplex nearest to the origin; False if it is inside."""
    for k in range(4):
        weight[k] = 0.0
    p = corner(c, 0)
    if count == 1:
        weight[0] = 1.0
        return True
    q = corner(c, 1)
    if count == 2:
        e = subtract(q, p)
        t = min(max(-dot(p, e) / dot(e, e), 0.0), 1.0)
        weight[0], weight[1] = 1.0 - t, t
        return True
    if count == 3:
        weight[0], weight[1], weight[2] = nearest_on_triangle(p, q, corner(c, 2))
        return True
    best, found = math.inf, False
    for opposite in range(4):
        i, j, k = (opposite + 1) % 4, (opposite + 2) % 4, (opposite + 3) % 4
        p, q, r = corner(c, i), corner(c, j), corner(c, k)
        n = cross(subtract(q, p), subtract(r, p))
        # The origin is not beyond this face if it lies on the side of the fourth corner.
        if dot(n, subtract(corner(c, opposite), p)) * -dot(n, p) > 0.0:
            continue
        u, v, w = nearest_on_triangle(p, q, r)
        x = add_scaled(add_scaled(scale(u, p), v, q), w, r)
        if dot(x, x) < best:
            best, found = dot(x, x), True
            weight[opposite] = 0.0
            weight[i], weight[j], weight[k] = u, v, w
    return found


@kernel
def _drop_unused(c: Array, count: int, weight: Array) -> int:
    kept = 0
    for k in range(count):
        if weight[k] > 0.0:
            if kept < k:
                _copy(c, k, kept)
            weight[kept] = weight[k]
            kept += 1
    return kept


@kernel
def _weighted(c: Array, count: int, weight: Array, offset: int) -> Vector:
    x = (0.0, 0.0, 0.0)
    for k in range(count):
        x = add_scaled(x, weight[k], (c[k, offset], c[k, offset + 1], c[k, offset + 2]))
    return x


@kernel
def gjk(pose: Array, kind: IntArray, size: Array, first: IntArray, count: IntArray,
        vertices: Array, hull: IntArray, a: int, b: int, away: Vector, limit: float, c: Array,
        weight: Array) -> tuple[int, Vector]:
    """
    Return the corners of the nearest simplex and the vector from B to A; 4 corners mean overlap.

    B is taken `away` [m, world axes] from where it is.

    The search ends early when the distance is certain to exceed `limit` [m]; the vector then gives
    a separating direction only. Rows and weights of the simplex are left in c and weight.
    """
    v = subtract(subtract(origin(pose, a), origin(pose, b)), away)
    if dot(v, v) == 0.0:
        v = (1.0, 0.0, 0.0)
    n, reached, largest = 0, math.inf, 0.0
    for _ in range(ROUNDS):
        w = find_corner(pose, kind, size, first, count, vertices, hull, a, b,
                        (-v[0], -v[1], -v[2]), c, n)
        w = subtract(w, away)
        for i in range(3):
            c[n, i] = w[i]
            c[n, 6 + i] += away[i]
        vv, vw = dot(v, v), dot(v, w)
        # The plane at right angles to v through w separates by v.w / |v|.
        if vw > 0.0 and vw * vw > limit * limit * vv:
            return max(min(n, 3), 1), scale(vw / vv, v)
        if n > 0 and vv - vw <= NEAR * vv:
            break
        largest = max(largest, dot(w, w))
        known = False
        for k in range(n):
            known = known or (c[k, 0] == w[0] and c[k, 1] == w[1] and c[k, 2] == w[2])
        if known:
            break
        n += 1
        if not _nearest(c, n, weight):
            return 4, v
        n = _drop_unused(c, n, weight)
        x = _weighted(c, n, weight, 0)
        xx = dot(x, x)
        # Nearer than rounding of the corners: touching counts as overlap.
        if xx <= 1e-28 * largest:
            return 4 if n == 4 else n, (0.0, 0.0, 0.0)
        if xx >= reached:
            break
        v, reached = x, xx
    return n, _exact(c, n, v)


@kernel
def _exact(c: Array, count: int, v: Vector) -> Vector:
    """Return v once more from the corners: its direction without the error of the weights."""
    if count == 3:
        p = corner(c, 0)
        n = cross(subtract(corner(c, 1), p), subtract(corner(c, 2), p))
        # The corner nearest to the origin has the least rounding.
        nn = dot(n, n)
        if nn > 0.0:
            x = scale(dot(n, p) / nn, n)
            if abs(dot(x, x) - dot(v, v)) < 1e-6 * dot(v, v):
                return x
    elif count == 2:
        p = corner(c, 0)
        e = subtract(corner(c, 1), p)
        x = add_scaled(p, -dot(p, e) / dot(e, e), e)
        if abs(dot(x, x) - dot(v, v)) < 1e-6 * dot(v, v):
            return x
    return v
