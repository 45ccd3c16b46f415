# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which points of a face that lies on many pieces of one body bear it, and which are spare.

A box on a ground of fine triangles has points along the edges of each. All in one plane, they bear
it as four of them do, as of a pair of shapes four are kept: a force or an impulse on the others is
a sum of those on these. A problem of hundreds of points takes seconds. That holds between the four
only: a disk that wobbles gets deeper at points of its rim beside them, and these bear it as well.
"""

from rigid_sim_ros.engine.contact.contacts import Contacts
from rigid_sim_ros.engine.detection.narrow_phase.reduce import reduce_to_four
from rigid_sim_ros.engine.detection.narrow_phase.surface import are_same
from rigid_sim_ros.engine.maths.vector import cross, dot, norm, row, subtract
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

ENOUGH = 4  # points of a plane
BESIDE = 1e-3  # of the half width: a point no farther beside those that bear is spare
_UNKNOWN = -1


@kernel
def mark_spare(shapes: Shapes, contacts: Contacts, touching: float, points: Array,
               ids: IntArray) -> None:
    """
    Write to contacts.spare which points are; points, (c, 4 or more), and ids are scratch.

    None is whose gap is more than `touching` of its size: such ones bear nothing for others.
    """
    for k in range(contacts.count[1]):
        first, last = contacts.first[k], contacts.first[k + 1]
        for i in range(first, last):
            touches = contacts.gap[i] <= touching * contacts.size[i]
            contacts.spare[i] = _UNKNOWN if touches and last - first > ENOUGH else 0
        for i in range(first, last):
            if contacts.spare[i] == _UNKNOWN:
                _mark_plane(shapes, contacts, i, last, points, ids)


@kernel
def _mark_plane(shapes: Shapes, contacts: Contacts, i: int, last: int, points: Array,
                ids: IntArray) -> None:
    """Mark the points up to `last` that are of the same shape and plane as point i."""
    moving = _moving(shapes, contacts, i)
    if moving < 0:
        contacts.spare[i] = 0
        return
    count, several, n = 0, False, row(contacts.axes[i], 0)
    for j in range(i, last):
        if contacts.spare[j] != _UNKNOWN or not _is_in_plane(shapes, contacts, j, moving, n):
            continue
        contacts.spare[j] = 1
        several = several or contacts.manifold[j] != contacts.manifold[i]
        at = _lever(contacts, j, moving)
        for c in range(3):
            points[count, c] = at[c]
        points[count, 3], ids[count] = contacts.gap[j], j
        count += 1
    kept = count
    if several:
        kept = reduce_to_four(points, ids, count, n, shapes.half_width[moving])
    for j in ids[:kept]:
        contacts.spare[j] = 0
    if kept == count or kept < ENOUGH - 1:
        return
    most = BESIDE * shapes.half_width[moving]
    for j in range(i, last):
        if contacts.spare[j] == 1 and _is_in_plane(shapes, contacts, j, moving, n):
            at = _lever(contacts, j, moving)
            contacts.spare[j] = 1 if _is_between(points, kept, at, n, most) else 0


@kernel
def _is_in_plane(shapes: Shapes, contacts: Contacts, j: int, moving: int, n: Vector) -> bool:
    """Return whether a point is of the shape `moving`, and has the normal n."""
    return _moving(shapes, contacts, j) == moving and are_same(n, row(contacts.axes[j], 0))


@kernel
def _lever(contacts: Contacts, j: int, moving: int) -> Vector:
    """Return where a point is from the centre of mass of what carries the shape `moving` [m]."""
    return row(contacts.r_A if contacts.shape_a[j] == moving else contacts.r_B, j)


@kernel
def _is_between(points: Array, kept: int, p: Vector, n: Vector, most: float) -> bool:
    """Return whether p is between three of the points, or no farther [m] beside them."""
    for a in range(kept):
        for b in range(a + 1, kept):
            for c in range(b + 1, kept):
                if _is_in_triangle(row(points, a), row(points, b), row(points, c), p, n, most):
                    return True
    return False


@kernel
def _is_in_triangle(a: Vector, b: Vector, c: Vector, p: Vector, n: Vector, most: float) -> bool:
    sign = 1.0 if dot(n, cross(subtract(b, a), subtract(c, a))) > 0.0 else -1.0
    for begin, end in ((a, b), (b, c), (c, a)):
        along = subtract(end, begin)
        if sign * dot(n, cross(along, subtract(p, begin))) < -most * norm(along):
            return False
    return True


@kernel
def _moving(shapes: Shapes, contacts: Contacts, k: int) -> int:
    """Return the shape of a point that moves over one that does not, -1 if there is none."""
    a, b = contacts.shape_a[k], contacts.shape_b[k]
    if shapes.still[a] == shapes.still[b]:
        return -1
    return int(b if shapes.still[a] == 1 else a)
