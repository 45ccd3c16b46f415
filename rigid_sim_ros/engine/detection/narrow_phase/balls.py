# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Spheres against everything, and capsules against each other: distances in closed form.

A sphere is a point with a radius, a capsule a segment with a radius. The gap between a sphere and
a shape is the signed distance of its centre from the shape, less the radius.
"""

from rigid_sim_ros.engine.maths.algebra import (
    add_scaled, clamp, dot, norm, perpendicular, scale, subtract)
from rigid_sim_ros.engine.maths.pose import axis, origin, point_to_shape, point_to_world, to_world
from rigid_sim_ros.engine.model.kinds.points import put
from rigid_sim_ros.engine.model.kinds.table import from_point, is_ball
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel, part


@part
def point_from_shape(pose: Array, size: Array, kind: int, s: int,
                     p_W: Vector) -> tuple[float, Vector, Vector]:
    """Return the signed distance [m] of a point from shape s, its normal and foot, world axes."""
    result = from_point(kind, size, s, point_to_shape(pose, s, p_W))
    return result[0], to_world(pose, s, result[1]), point_to_world(pose, s, result[2])


@part
def sphere_shape(pose: Array, size: Array, kind: int, ball: int, other: int) -> tuple[float,
                                                                                      Vector,
                                                                                      Vector]:
    """Return the gap [m] from a sphere (A) to a shape (B), the normal and the point on A."""
    c = origin(pose, ball)
    d, n, _ = point_from_shape(pose, size, kind, other, c)
    r = size[ball, 0]
    return d - r, (-n[0], -n[1], -n[2]), (c[0] - r * n[0], c[1] - r * n[1], c[2] - r * n[2])


@kernel
def shape_sphere(pose: Array, size: Array, kind: int, other: int, ball: int) -> tuple[float,
                                                                                      Vector,
                                                                                      Vector]:
    """Return the same with the shape as A and the ball as B; the point is on the shape."""
    d, n, foot = point_from_shape(pose, size, kind, other, origin(pose, ball))
    return d - size[ball, 0], n, foot


@part
def sphere_sphere(pose: Array, size: Array, a: int, b: int) -> tuple[float, Vector, Vector]:
    """Return the gap [m] between two spheres, the normal and the point on A."""
    p = origin(pose, a)
    d = subtract(origin(pose, b), p)
    length = norm(d)
    # Spheres with one middle: up is as good as any direction, and the same each time.
    n = scale(1.0 / length, d) if length > 0.0 else (0.0, 0.0, 1.0)
    return length - size[a, 0] - size[b, 0], n, add_scaled(p, size[a, 0], n)


@part
def ball_gap(pose: Array, size: Array, kind_a: int, kind_b: int, a: int,
             b: int) -> tuple[float, Vector, Vector]:
    """Return the same for a sphere and a shape that has `from_point`, in either order."""
    if is_ball(kind_a) and is_ball(kind_b):
        gap, n, p = sphere_sphere(pose, size, a, b)
    elif is_ball(kind_a):
        gap, n, p = sphere_shape(pose, size, kind_b, a, b)
    else:
        gap, n, p = shape_sphere(pose, size, kind_a, a, b)
    return gap, n, p


@part
def touching_ball(pose: Array, size: Array, kind_a: int, kind_b: int, a: int, b: int,
                  margin: float, points: Array, ids: IntArray) -> tuple[int, Vector]:
    """Find the manifold of such a pair: return the number of points, 0 or 1, and the normal."""
    gap, n, p = ball_gap(pose, size, kind_a, kind_b, a, b)
    if gap >= margin:
        return 0, n
    put(points, ids, 0, p, gap, 0)
    return 1, n


@kernel
def nearest_on_segments(p: Vector, u: Vector, hu: float, q: Vector, v: Vector,
                        hv: float) -> tuple[float, float]:
    """
    Return x, y so that p + x u and q + y v are nearest, |x| <= hu, |y| <= hv.

    u and v have unit length. Ericson, Real-Time Collision Detection, 5.1.9. For parallel segments
    it is the middle of what lies opposite each other.
    """
    d = subtract(q, p)
    c, du, dv = dot(u, v), dot(d, u), dot(d, v)
    squared = 1.0 - c * c
    if squared > 1e-12:
        x = clamp((du - c * dv) / squared, -hu, hu)
    else:
        low, high = max(-hu, du - hv), min(hu, du + hv)
        x = clamp(0.5 * (low + high), -hu, hu)
    y = clamp(c * x - dv, -hv, hv)
    return clamp(du + c * y, -hu, hu), y


@kernel
def capsule_capsule(pose: Array, size: Array, a: int, b: int) -> tuple[float, Vector, Vector]:
    """Return the gap [m] between two capsules, the normal and the point on A."""
    p, q, u, v = origin(pose, a), origin(pose, b), axis(pose, a, 2), axis(pose, b, 2)
    x, y = nearest_on_segments(p, u, size[a, 1], q, v, size[b, 1])
    p, q = add_scaled(p, x, u), add_scaled(q, y, v)
    d = subtract(q, p)
    length = norm(d)
    n = scale(1.0 / length, d) if length > 0.0 else crossing_normal(u, v)
    return length - size[a, 0] - size[b, 0], n, add_scaled(p, size[a, 0], n)


@kernel
def crossing_normal(u: Vector, v: Vector) -> Vector:
    """Return a unit vector at right angles to u and v, for two axes that meet."""
    n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    length = norm(n)
    if length > 1e-9:
        return scale(1.0 / length, n)
    return perpendicular(u)
