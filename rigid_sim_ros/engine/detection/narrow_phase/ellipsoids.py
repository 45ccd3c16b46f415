# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Two ellipsoids: their common normal, by Newton's method on their support functions.

A direction n separates A and B by s(n) = n . d - h_A(n) - h_B(n), with d from the middle of A to
that of B and h the support functions. The signed distance is the largest s: apart it is the
distance, in an overlap minus the depth. The gradient of -s is w = p_A + p_B - d, with the support
points p of n and the middles as their origins; at the common normal it is parallel to n. On the
sphere of directions -s has the second derivatives

    t . (H_A + H_B) t + s,    t . H t = ((t . M t) - (t . p)^2) / h,    M = R diag(a^2) R^T.
"""

import math

from rigid_sim_ros.engine.maths.algebra import (
    add, add_scaled, cross, dot, norm, perpendicular, scale, subtract)
from rigid_sim_ros.engine.maths.pose import axis, origin, to_shape, to_world
from rigid_sim_ros.engine.model.kinds.ellipsoid import support
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel

ROUNDS = 50  # of Newton's method; 4 to 8 are usual
HALVINGS = 30  # of a step that does not improve
FARTHEST = 0.5  # [rad] the longest step
BISECTIONS = 10  # for the first direction
# Of the size: below it s does not grow any more, but the gradient may still fall.
ROUNDING = 1e-15


@kernel
def _support(pose: Array, size: Array, s: int, n: Vector) -> tuple[float, Vector]:
    """Return h(n) and the support point from the middle of ellipsoid s, world axes."""
    h, p = support(size, s, to_shape(pose, s, n))
    return h, to_world(pose, s, p)


@kernel
def _squared(pose: Array, size: Array, s: int, v: Vector, u: Vector) -> float:
    """Return v . M u."""
    v, u = to_shape(pose, s, v), to_shape(pose, s, u)
    total = 0.0
    for k in range(3):
        total += size[s, k] * size[s, k] * v[k] * u[k]
    return total


@kernel
def _separation(pose: Array, size: Array, a: int, b: int,
                n: Vector) -> tuple[float, Vector, Vector]:
    """Return s(n) [m], w, and the support point of A from its middle."""
    h_A, p_A = _support(pose, size, a, n)
    h_B, p_B = _support(pose, size, b, n)
    d = subtract(origin(pose, b), origin(pose, a))
    return dot(n, d) - h_A - h_B, subtract(add(p_A, p_B), d), p_A


@kernel
def _curvature(pose: Array, size: Array, s: int, n: Vector, t: Vector,
               u: Vector) -> tuple[float, float, float]:
    """Return t . H t, t . H u and u . H u of ellipsoid s."""
    h, p = _support(pose, size, s, n)
    tp, up = dot(t, p), dot(u, p)
    return ((_squared(pose, size, s, t, t) - tp * tp) / h,
            (_squared(pose, size, s, t, u) - tp * up) / h,
            (_squared(pose, size, s, u, u) - up * up) / h)


@kernel
def _newton_step(xx: float, xy: float, yy: float, s: float, gx: float,
                 gy: float) -> tuple[float, float]:
    """
    Return the step to the minimum of a quadratic form, made convex where it is none.

    At a saddle it leads along the direction in which the form falls.
    """
    middle, apart = 0.5 * (xx + yy), math.sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy)
    if middle + s - apart > 1e-6 * middle:
        determinant = (xx + s) * (yy + s) - xy * xy
        return (xy * gy - (yy + s) * gx) / determinant, (xy * gx - (xx + s) * gy) / determinant
    # A direction of the smaller second derivative, downhill.
    x, y = (xy, middle - apart - xx) if xx < yy else (middle - apart - yy, xy)
    length = math.sqrt(x * x + y * y)
    x, y = (x / length, y / length) if length > 0.0 else (1.0, 0.0)
    turn = -FARTHEST if x * gx + y * gy > 0.0 else FARTHEST
    return turn * x, turn * y


@kernel
def _climb(pose: Array, size: Array, a: int, b: int,
           n: Vector) -> tuple[float, Vector, Vector]:
    """Climb from the direction n to a maximum of s; return s, n and the support point of A."""
    s, w, p = _separation(pose, size, a, b, n)
    least = ROUNDING * (abs(s) + norm(w) + norm(p))
    for _ in range(ROUNDS):
        t = perpendicular(n)
        u = cross(n, t)
        gx, gy = dot(t, w), dot(u, w)
        ax, ay, az = _curvature(pose, size, a, n, t, u)
        bx, by, bz = _curvature(pose, size, b, n, t, u)
        x, y = _newton_step(ax + bx, ay + by, az + bz, s, gx, gy)
        length = math.sqrt(x * x + y * y)
        part = min(1.0, FARTHEST / length) if length > 0.0 else 0.0
        found = False
        for _ in range(HALVINGS):
            m = add_scaled(add_scaled(n, part * x, t), part * y, u)
            m = scale(1.0 / norm(m), m)
            s_m, w_m, p_m = _separation(pose, size, a, b, m)
            slip = subtract(w_m, scale(dot(w_m, m), m))
            if s_m > s + least or (s_m > s - least and dot(slip, slip) < 0.25 * (
                    gx * gx + gy * gy)):
                found = True
                break
            part *= 0.5
        if not found:
            break
        s, n, w, p = s_m, m, w_m, p_m
    return s, n, p


@kernel
def _solve(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float, d: Vector) -> Vector:
    """Return v with C v = d times a positive number, for a positive definite matrix C."""
    x = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy)
    y = (x[1], xx * zz - xz * xz, xy * xz - xx * yz)
    z = (x[2], y[2], xx * yy - xy * xy)
    return (dot(x, d), dot(y, d), dot(z, d))


@kernel
def _first_direction(pose: Array, size: Array, a: int, b: int, d: Vector) -> Vector:
    """
    Return a direction that separates two ellipsoids if they are apart, and is near it if not.

    v = C^-1 d, C = (1 - x) M_A + x M_B. Where x (1 - x) d . v exceeds 1 the ellipsoids are apart
    (Perram and Wertheim, J. Computational Physics 58, 1985), and v separates them, since
    (h_A + h_B)^2 <= (d . v) / (x (1 - x)) at v. The largest value is at (1 - x) h_A(v) = x h_B(v).
    """
    low, high, x, v = 0.0, 1.0, 0.5, d
    ex, ey, ez = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    for _ in range(BISECTIONS):
        y = 1.0 - x
        v = _solve(y * _squared(pose, size, a, ex, ex) + x * _squared(pose, size, b, ex, ex),
                   y * _squared(pose, size, a, ex, ey) + x * _squared(pose, size, b, ex, ey),
                   y * _squared(pose, size, a, ex, ez) + x * _squared(pose, size, b, ex, ez),
                   y * _squared(pose, size, a, ey, ey) + x * _squared(pose, size, b, ey, ey),
                   y * _squared(pose, size, a, ey, ez) + x * _squared(pose, size, b, ey, ez),
                   y * _squared(pose, size, a, ez, ez) + x * _squared(pose, size, b, ez, ez), d)
        h_A, h_B = math.sqrt(_squared(pose, size, a, v, v)), math.sqrt(
            _squared(pose, size, b, v, v))
        if y * h_A > x * h_B:
            low = x
        else:
            high = x
        x = h_A / (h_A + h_B)
        if not low < x < high:
            x = 0.5 * (low + high)
    return scale(1.0 / norm(v), v)


@kernel
def ellipsoid_ellipsoid(pose: Array, size: Array, a: int,
                        b: int) -> tuple[float, Vector, Vector]:
    """
    Return the signed distance [m] of two ellipsoids, the normal from A to B, the point on A.

    A ball of the radius r = least^2 / largest rolls inside of an ellipsoid, so the two are the
    sums of smaller convex bodies and balls. As long as those are apart, which is at depths below
    r_A + r_B, s has one maximum above -(r_A + r_B), and Newton's method finds it from a direction
    that separates by more. Deeper, the best of several maxima is taken.
    """
    d = subtract(origin(pose, b), origin(pose, a))
    if dot(d, d) > 0.0:
        s, n, p = _climb(pose, size, a, b, _first_direction(pose, size, a, b, d))
    else:
        s, n, p = _climb(pose, size, a, b, axis(pose, a, 0))
    unique = 0.0
    for i in (a, b):
        least = min(size[i, 0], size[i, 1], size[i, 2])
        unique += least * least / max(size[i, 0], size[i, 1], size[i, 2])
    for k in range(7 if s < -unique else 0):
        if k < 6:
            m = axis(pose, a if k < 3 else b, k % 3)
        else:
            m = scale(1.0 / norm(d), d) if dot(d, d) > 0.0 else (0.0, 0.0, 1.0)
        if dot(m, d) < 0.0:
            m = scale(-1.0, m)
        s_m, n_m, p_m = _climb(pose, size, a, b, m)
        if s_m > s:
            s, n, p = s_m, n_m, p_m
    return s, n, add(origin(pose, a), p)
