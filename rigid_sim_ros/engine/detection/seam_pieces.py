# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Pieces of a surface: which shapes a shape M is near, and which of these are one surface for it.

S and T are pieces, M is what moves over them; see seams.py. A code 2 k + side is row k seen from
one of its shapes: with side 0 its shape A is S and B is M, with side 1 the other way round.
"""

from rigid_sim_ros.engine.detection.manifolds import Manifolds, Seams
from rigid_sim_ros.engine.detection.narrow_phase.boxes import FLAT
from rigid_sim_ros.engine.detection.narrow_phase.surface import are_same, face_normal_along
from rigid_sim_ros.engine.maths.algebra import dot, norm, scale, subtract
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import INDEX, kernel

# Of the smallest half extent of the three shapes that meet: a step between two pieces, or a gap,
# that is less is none.
FLUSH = 1e-3
# The cosine of 1e-4 rad: what rests within the skin of contacts, 2e-5 of its size, may be tilted
# by nearly as much. Of what lies on two faces with a smaller angle each bears its part.
ONE_DIRECTION = 1.0 - 0.5e-8
# cos 0.06 deg: axes that are parallel.
PARALLEL = 1.0 - 5e-7


@kernel
def first_code(shapes: Shapes, rows: Manifolds, seams: Seams, m: int, k: int, side: int) -> int:
    """
    Return the first code of shape M, which row k is one of, that may be of the same surface.

    Of a fixed M those of the same body, which lie side by side.
    """
    if shapes.still[m] == 0:
        return int(seams.head[m])
    s, _ = shapes_of(rows, k, side)
    at = 2 * k + side
    while True:
        before = seams.back[at & 1, at >> 1]
        if before < 0:
            return at
        t, _ = shapes_of(rows, before >> 1, before & 1)
        if shapes.body[t] != shapes.body[s]:
            return at
        at = before


@kernel
def shapes_of(rows: Manifolds, k: int, side: int) -> tuple[int, int]:
    """Return the shapes S and M of a manifold: A and B, the other way round with side 1."""
    a, b = rows.shape_a[k], rows.shape_b[k]
    return (a & INDEX, b & INDEX) if side == 0 else (b & INDEX, a & INDEX)


@kernel
def outward(normal: Array, k: int, side: int) -> Vector:
    """Return the normal from S to M of row k, of normals from A to B, (c, 3)."""
    sign = 1.0 if side == 0 else -1.0
    return (sign * normal[k, 0], sign * normal[k, 1], sign * normal[k, 2])


@kernel
def centre(pose: Array, turn: Array, shapes: Shapes, s: int) -> Vector:
    """Return the centre of mass of the body that carries shape s [m, world axes]."""
    p, R, i = (pose[s, 0], pose[s, 1], pose[s, 2]), turn, shapes.body[s]
    if shapes.ball[s] == 1:
        return p
    x, y, z = shapes.p_CS[s, 0], shapes.p_CS[s, 1], shapes.p_CS[s, 2]
    return (p[0] - (R[i, 0] * x + R[i, 1] * y + R[i, 2] * z),
            p[1] - (R[i, 3] * x + R[i, 4] * y + R[i, 5] * z),
            p[2] - (R[i, 6] * x + R[i, 7] * y + R[i, 8] * z))


@kernel
def one_surface(pose: Array, shapes: Shapes, s: int, t: int) -> bool:
    """
    Return whether M may move over both S and T as over one surface.

    Of two bodies of which one moves, only where they have a direction in common, as what lies
    flush has: in a heap that tumbles, pieces that meet M in one place hold it each for itself.
    """
    if shapes.body[s] == shapes.body[t]:
        return True
    if shapes.still[s] + shapes.still[t] == 2:
        return True
    for i in range(3):
        for j in range(3):
            together = (pose[s, 3 + i] * pose[t, 3 + j] + pose[s, 6 + i] * pose[t, 6 + j]
                        + pose[s, 9 + i] * pose[t, 9 + j])
            if abs(together) > PARALLEL:
                return True
    return False


@kernel
def tolerance(shapes: Shapes, m: int, s: int, t: int) -> float:
    """Return how far two pieces may stand out over each other and be flush [m]."""
    return FLUSH * min(shapes.half_width[m], shapes.half_width[s], shapes.half_width[t])


@kernel
def is_one_direction(shapes: Shapes, s: int, t: int, n: Vector, m: Vector) -> bool:
    """
    Return whether faces of S and T with these normals are one surface.

    Pieces of one body, and of what is fixed, lie as exactly as they were written; what rests on
    the same floor does so within the skin of contacts.
    """
    if shapes.body[s] == shapes.body[t] or shapes.still[s] + shapes.still[t] == 2:
        return are_same(n, m)
    return dot(n, m) > ONE_DIRECTION


@kernel
def of_face(pose: Array, shapes: Shapes, s: int, m: int, n: Vector) -> Vector:
    """
    Return the normal of the face of S where n is half way between those of faces of S and M.

    As of two boxes of one volume; else n.
    """
    n_S, n_M = face_normal_along(pose, shapes, s, n), face_normal_along(pose, shapes, m,
                                                                        scale(-1.0, n))
    both = subtract(n_S, n_M)
    length = norm(both)
    if length > 0.0 and dot(n, n_S) > FLAT and are_same(n, scale(1.0 / length, both)):
        return n_S
    return n


@kernel
def push(pose: Array, shapes: Shapes, rows: Manifolds, seams: Seams, j: int, side: int,
         n: Vector) -> Vector:
    """
    Return the direction in which T, of row j, pushes M.

    Where that is n, which other edges in a row may have as well, the normal of the face of T that
    looks along n. It is the normal that the pair alone has: what seams made of its manifold
    depends on which of them were mended before.
    """
    n_T = outward(seams.normal, j, side)
    if not are_same(n, n_T):
        return n_T
    t, _ = shapes_of(rows, j, side)
    return face_normal_along(pose, shapes, t, n)


@kernel
def reaches(box: Array, t: int, low: Vector, high: Vector, most: float) -> bool:
    """Return whether the bounding box of T comes as near as this to another one."""
    return bool((box[t, 0] <= high[0] + most) & (box[t, 3] >= low[0] - most)
                & (box[t, 1] <= high[1] + most) & (box[t, 4] >= low[1] - most)
                & (box[t, 2] <= high[2] + most) & (box[t, 5] >= low[2] - most))
