# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The direction in which two convex shapes are farthest apart, from a guess near it.

s(n) = -max n . (a - b) over the shapes is how far a direction n separates them; their distance is
its maximum. The searches for it (gjk.py, epa.py) end with an error of s of about 1e-10 of the size
where a shape is round, which is one of the direction of 1e-5: what follows from the normal would
depend on how the scene is turned and on which shape is A.

s is smooth but for kinks: across an edge, or a line of a cylinder or a cone, the farthest point
jumps by a vector e, and n . e = 0 on the kink. The best direction is mostly on one, or on two. So
it is first seen whether the farthest point of each shape jumps near n. Two independent jumps leave
one direction, n ~ e_1 x e_2; one leaves an arc, on which Newton's method goes on; none leaves it
Newton's method in two dimensions. Jumps are looked for nearer and nearer: far from n there are
kinks that are only near, and the farthest point on a rim that is nearly flat runs as far as it
would jump.
"""

from rigid_sim_ros.engine.detection.manifolds import EPA_CORNERS
from rigid_sim_ros.engine.detection.narrow_phase.gjk import find_corner
from rigid_sim_ros.engine.maths.algebra import (
    add_scaled, cross, dot, norm, perpendicular, scale, subtract)
from rigid_sim_ros.engine.model.kinds.table import has_disc, is_smooth
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel

ROOM = EPA_CORNERS - 1  # a row of the corners that no simplex uses
# [rad] how far from n jumps are looked for, beyond the error of the guess at first: a tenth as far
# in each step, and at least as near before the search ends.
SPREAD, NEARER, NEAR = 2e-4, 0.1, 3e-6
NUDGE = 0.05  # of that, to find second derivatives by differences
# Of the size of a shape: its farthest point jumps by more than that, and moves on a surface with
# a radius of less than 50 sizes by less.
JUMP = 0.02
ALONG = 1e-2  # the sine of the angle between jumps that count as one
STEPS = 4
FAR = 1e-2  # [rad] no step is longer
DONE = 1e-10  # [rad] a step that is the last
# Of the size: by so much a step may separate less. It is the rounding of s far from the origin.
ROUNDING = 1e-13


@kernel
def separation(pose: Array, shapes: Shapes, a: int, b: int, n: Vector, c: Array) -> float:
    """Return s(n) [m]: how far the direction n separates the cores, -max n . (a - b)."""
    return -dot(n, _farthest(pose, shapes, a, b, n, c))


@kernel
def _farthest(pose: Array, shapes: Shapes, a: int, b: int, n: Vector, c: Array) -> Vector:
    """Return a - b of the points farthest along n, and leave them in row ROOM of c."""
    hulls = shapes.hulls
    return find_corner(pose, shapes.kind, shapes.size, hulls.first, hulls.count, hulls.vertices,
                       shapes.hull, a, b, n, c, ROOM)


@kernel
def _on_A(c: Array) -> Vector:
    return (c[ROOM, 3], c[ROOM, 4], c[ROOM, 5])


@kernel
def _on_B(c: Array) -> Vector:
    return (c[ROOM, 6], c[ROOM, 7], c[ROOM, 8])


@kernel
def _jump(pose: Array, shapes: Shapes, a: int, b: int, n: Vector, t: Vector, far: float,
          c: Array) -> tuple[Vector, Vector]:
    """Return how the farthest points of A and of B differ `far` on both sides of n along t."""
    _farthest(pose, shapes, a, b, add_scaled(n, -far, t), c)
    on_A, on_B = _on_A(c), _on_B(c)
    _farthest(pose, shapes, a, b, add_scaled(n, far, t), c)
    return subtract(_on_A(c), on_A), subtract(_on_B(c), on_B)


@kernel
def _in_plane(normal: Vector, v: Vector) -> Vector:
    """Return the direction of v in the plane with a unit normal."""
    v = add_scaled(v, -dot(v, normal), normal)
    return scale(1.0 / norm(v), v)


@kernel
def _kinks(along_t: Vector, along_u: Vector, least: float) -> tuple[int, Vector]:
    """Return on how many kinks of one shape n is, and e of one, or the normal of two."""
    t, u = norm(along_t), norm(along_u)
    if t < least and u < least:
        return 0, along_t
    if t >= least and u >= least:
        both = cross(along_t, along_u)
        area = norm(both)
        if area > ALONG * t * u:
            return 2, scale(1.0 / area, both)
    return 1, scale(1.0 / t, along_t) if t > u else scale(1.0 / u, along_u)


@kernel
def _slope(pose: Array, shapes: Shapes, a: int, b: int, n: Vector, t: Vector, u: Vector, x: float,
           y: float, c: Array) -> tuple[float, float]:
    """Return the gradient of -s(m / |m|) times |m| at m = n + x t + y u, along t and u."""
    m = add_scaled(add_scaled(n, x, t), y, u)
    w = _farthest(pose, shapes, a, b, m, c)
    # max m . w has the gradient w; the rest is that of 1 / |m|.
    level = dot(m, w) / dot(m, m)
    return dot(t, w) - level * x, dot(u, w) - level * y


@kernel
def _along_arc(pose: Array, shapes: Shapes, a: int, b: int, n: Vector, e: Vector, far: float,
               c: Array) -> Vector:
    """Return n after a step of Newton's method on the arc n . e = 0."""
    n = _in_plane(e, n)
    f = cross(n, e)
    here, _ = _slope(pose, shapes, a, b, n, f, f, 0.0, 0.0, c)
    d = NUDGE * far
    there, _ = _slope(pose, shapes, a, b, n, f, f, d, 0.0, c)
    # -s is convex; where it is flat the step is no number, or too long.
    x = -here * d / (there - here)
    return add_scaled(n, x, f) if abs(x) < FAR else n


@kernel
def _in_the_open(pose: Array, shapes: Shapes, a: int, b: int, n: Vector, far: float,
                 c: Array) -> Vector:
    """Return n after a step of Newton's method in two dimensions."""
    t, d = perpendicular(n), NUDGE * far
    u = cross(n, t)
    g, h = _slope(pose, shapes, a, b, n, t, u, 0.0, 0.0, c)
    gx, hx = _slope(pose, shapes, a, b, n, t, u, d, 0.0, c)
    gy, hy = _slope(pose, shapes, a, b, n, t, u, 0.0, d, c)
    gx, hx, gy, hy = (gx - g) / d, (hx - h) / d, (gy - g) / d, (hy - h) / d
    determinant = gx * hy - gy * hx
    x, y = (gy * h - hy * g) / determinant, (hx * g - gx * h) / determinant
    return add_scaled(add_scaled(n, x, t), y, u) if x * x + y * y < FAR * FAR else n


@kernel
def _find_kinks(pose: Array, shapes: Shapes, a: int, b: int, n: Vector, far: float,
                c: Array) -> tuple[int, Vector, int, Vector]:
    """Return on how many kinks of A n is, with e or their normal, and the same of B."""
    t = perpendicular(n)
    A_t, B_t = _jump(pose, shapes, a, b, n, t, far, c)
    A_u, B_u = _jump(pose, shapes, a, b, n, cross(n, t), far, c)
    on_A, e_A = _kinks(A_t, A_u, JUMP * shapes.bound[a])
    on_B, e_B = _kinks(B_t, B_u, JUMP * shapes.bound[b])
    if is_smooth(shapes.kind[a]):
        on_A = 0
    if is_smooth(shapes.kind[b]):
        on_B = 0
    # The farthest points on a rim also run along it, but not where they jump straight across.
    if on_A == 1 and has_disc(shapes.kind[a]):
        A_t, _ = _jump(pose, shapes, a, b, n, _in_plane(n, e_A), far, c)
        e_A = scale(1.0 / norm(A_t), A_t)
    if on_B == 1 and has_disc(shapes.kind[b]):
        _, B_t = _jump(pose, shapes, a, b, n, _in_plane(n, e_B), far, c)
        e_B = scale(1.0 / norm(B_t), B_t)
    return on_A, e_A, on_B, e_B


@kernel
def polish(pose: Array, shapes: Shapes, a: int, b: int, n: Vector, p: Vector,
           c: Array) -> tuple[float, Vector, Vector]:
    """
    Return the signed distance of the cores, its direction n and the nearest point p on A.

    A step counts only if it separates more, up to rounding; else what was found before is left.
    """
    small = min(shapes.bound[a], shapes.bound[b])
    best, least = separation(pose, shapes, a, b, n, c), ROUNDING * small
    far = SPREAD / NEARER
    for _ in range(STEPS):
        far *= NEARER
        on_A, e_A, on_B, e_B = _find_kinks(pose, shapes, a, b, n, far, c)
        crossed = cross(e_A, e_B)
        m = n
        if on_A == 2 or on_B == 2:
            m = e_A if on_A == 2 else e_B
        elif on_A == 1 and on_B == 1 and norm(crossed) > ALONG:
            m = scale(1.0 / norm(crossed), crossed)
        elif on_A == 1 or on_B == 1:
            m = _along_arc(pose, shapes, a, b, n, e_A if on_A == 1 else e_B, far, c)
        else:
            m = _in_the_open(pose, shapes, a, b, n, far, c)
        m = scale((1.0 if dot(m, n) > 0.0 else -1.0) / norm(m), m)
        s = separation(pose, shapes, a, b, m, c)
        if not s >= best - least:
            continue
        step = subtract(m, n)
        best, n = max(s, best), m
        if on_B == 0:
            p = add_scaled(_on_B(c), -s, m)
        elif on_A == 0:
            p = _on_A(c)
        elif on_A == 1 and on_B == 1 and norm(crossed) > ALONG:
            between = subtract(_on_B(c), _on_A(c))
            p = add_scaled(_on_A(c), dot(cross(between, e_B), m) / dot(crossed, m), e_A)
        if far < NEAR and dot(step, step) < DONE * DONE:
            break
    return separation(pose, shapes, a, b, n, c), n, p
