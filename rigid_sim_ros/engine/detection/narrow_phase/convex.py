# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Any two convex shapes: the distance of their cores, then their faces clipped against each other.

The search for the distance gives the normal and one pair of nearest points. Shapes that lie flat
on each other need more points: of the two faces that look at each other one is clipped to the
sides of the other, along the normal, and what is nearer than the margin is kept.
"""

import math

from rigid_sim_ros.engine.detection.manifolds import CANDIDATES, Scratch
from rigid_sim_ros.engine.detection.narrow_phase.balls import crossing_normal
from rigid_sim_ros.engine.detection.narrow_phase.boxes import ALIKE
from rigid_sim_ros.engine.detection.narrow_phase.epa import epa
from rigid_sim_ros.engine.detection.narrow_phase.gjk import gjk
from rigid_sim_ros.engine.detection.narrow_phase.polish import polish, ROOM, separation
from rigid_sim_ros.engine.detection.narrow_phase.reduce import reduce_to_four
from rigid_sim_ros.engine.detection.narrow_phase.surface import face_normal_along
from rigid_sim_ros.engine.detection.support import radius
from rigid_sim_ros.engine.maths.algebra import (
    add_scaled, cross, dot, norm, scale, subtract)
from rigid_sim_ros.engine.maths.pose import origin
from rigid_sim_ros.engine.model.kinds.points import put
from rigid_sim_ros.engine.model.kinds.table import is_curved, outline
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

# A face tilted from the contact plane by more than the angle with this cosine is not clipped.
TILTED = 0.2
# What stands out over a face by less than this fraction of the shapes' size counts as lying on it.
OVERHANG = 1e-5
# The nearest points are added when the clipped ones miss them by this fraction of the size. What
# the manifold misses can sink in unseen: 1e-3 let rims sink in by a tenth of a millimetre.
MISSED = 1e-7
# Of the size: where the search for a distance is less certain than this, the depth is looked for
# instead.
UNSURE = 1e-9
# Of the size: hardly apart, or hardly overlapping, the direction found is that of a difference of
# nearly equal numbers, and the normals of the faces that meet are tried beside it.
CLOSE = 1e-3
# Of the size: shapes that are nearer, or overlap less, touch. Below FILM of the model `event`, so
# that the gap is smooth where that looks for its root, and large enough for a direction between
# points that far apart to be known to 1e-7.
MEETS = 5e-9
# Of the size: how far shapes that touch are moved apart to see in which direction they part. The
# rounding of that direction is 1e-16 of it; what is smaller than it on a shape is not seen.
AWAY = 1e-3
SLIGHT = 1e-4  # of the size: an overlap of less than this leaves most of AWAY
LEAST_AWAY = 1e-3  # of it: a smaller distance says that the middles tell no way apart
ONE_NORMAL = 1e-9  # directions that differ by less are one, and the first is more exact
# [rad] a normal that is nearer to that of a face is that of the face: see `_on_face`.
LEANING = 1e-6
HERE = (0.0, 0.0, 0.0)
WITNESS = 1 << 40  # the feature of the nearest points


@kernel
def distance(pose: Array, shapes: Shapes, a: int, b: int, limit: float,
             scratch: Scratch) -> tuple[float, Vector, Vector]:
    """
    Return the gap [m], the unit normal from A to B and the nearest point on A, world axes.

    A gap above `limit` [m] is a lower bound only, and its point is the origin of A.
    """
    kind, size, hulls, hull = shapes.kind, shapes.size, shapes.hulls, shapes.hull
    r = radius(kind, size, a) + radius(kind, size, b)
    c, weight = scratch.corners, scratch.numbers
    count, v = gjk(pose, kind, size, hulls.first, hulls.count, hulls.vertices, hull, a, b,
                   HERE, limit + r, c, weight)
    d = norm(v)
    n = scale(-1.0 / d, v) if d > 0.0 else (0.0, 0.0, 1.0)
    p = (0.0, 0.0, 0.0)
    apart = count < 4 and d > 0.0
    if apart and d - r > limit:
        return d - r, n, origin(pose, a)
    small = min(shapes.bound[a], shapes.bound[b])
    round_one = is_curved(kind[a]) or is_curved(kind[b])
    if apart and (round_one or d < CLOSE * small):
        # Round shapes may leave the search in the middle, and hardly apart all have no direction.
        apart = d - separation(pose, shapes, a, b, n, c) < UNSURE * small
    if apart:
        for k in range(count):
            p = add_scaled(p, weight[k], (c[k, 3], c[k, 4], c[k, 5]))
    else:
        d, n, p = _overlap(pose, shapes, a, b, n, count, small, scratch)
        if d == math.inf:
            # Flat cores that cross, such as the segments of two capsules.
            d, p = 0.0, origin(pose, a)
            n = crossing_normal((pose[a, 5], pose[a, 8], pose[a, 11]),
                                (pose[b, 5], pose[b, 8], pose[b, 11]))
    if abs(d) < CLOSE * small:
        d, n, p = _try_faces(pose, shapes, a, b, d, n, p, c)
    if round_one:
        d, n, p = polish(pose, shapes, a, b, n, p, c)
    elif -SLIGHT * small < d < MEETS * small:
        d, n = _between_middles(pose, shapes, a, b, d, n, small, scratch)
    n = _on_face(pose, shapes, a, b, n)
    return d - r, n, add_scaled(p, radius(kind, size, a), n)


@kernel
def _on_face(pose: Array, shapes: Shapes, a: int, b: int, n: Vector) -> Vector:
    """
    Return the normal of a face that n is nearly that of, else n.

    What lies on a face is tilted by what the solver leaves, 1e-9 to 1e-7. Where it leaves the face
    across an edge the edge has a normal that is tilted as much, always to the same side; over a
    floor of tiles that would brake. The face of the larger shape comes first, as of boxes. The
    points along that normal are where they were, up to the square of the angle.
    """
    first_b = shapes.bound[b] > shapes.bound[a]
    for k in range(2):
        on_b = first_b == (k == 0)
        out = scale(-1.0, n) if on_b else n
        m = face_normal_along(pose, shapes, b if on_b else a, out)
        off = subtract(m, out)
        if dot(off, off) < LEANING * LEANING:
            return scale(-1.0, m) if on_b else m
    return n


@kernel
def _overlap(pose: Array, shapes: Shapes, a: int, b: int, last: Vector, count: int, small: float,
             scratch: Scratch) -> tuple[float, Vector, Vector]:
    """
    Return the signed distance of cores that overlap, the normal and the nearest point on A.

    The search starts from the simplex that the search for a distance ended with. At a slight
    overlap that is nearly flat, and rounding may then end the search anywhere: if the direction
    found does not separate by what the face says, it starts again from four corners far apart, and
    the direction `last` in which the cores looked apart is tried. A distance of inf says that the
    difference of the cores has no volume.
    """
    kind, size, hulls, hull = shapes.kind, shapes.size, shapes.hulls, shapes.hull
    c = scratch.corners
    depth, n, p = epa(pose, kind, size, hulls.first, hulls.count, hulls.vertices, hull, a, b,
                      count, c, scratch.faces, scratch.links, scratch.edges)
    if depth == -math.inf:
        return math.inf, n, p
    d = separation(pose, shapes, a, b, n, c)
    if abs(d + depth) > UNSURE * small:
        depth, m, q = epa(pose, kind, size, hulls.first, hulls.count, hulls.vertices, hull, a, b,
                          0, c, scratch.faces, scratch.links, scratch.edges)
        if depth > -math.inf:
            s = separation(pose, shapes, a, b, m, c)
            if s > d:
                d, n, p = s, m, q
        s = separation(pose, shapes, a, b, last, c)
        if s > d:
            d, n, p = s, last, (c[ROOM, 3], c[ROOM, 4], c[ROOM, 5])
    return d, n, p


@kernel
def _try_faces(pose: Array, shapes: Shapes, a: int, b: int, d: float, n: Vector, p: Vector,
               c: Array) -> tuple[float, Vector, Vector]:
    """
    Return distance, normal and point on A for the better of n and the faces that look along it.

    The distance is the largest s(m) of all directions m, so what separates more is nearer to it.
    """
    best = separation(pose, shapes, a, b, n, c)
    m = face_normal_along(pose, shapes, a, n)
    s = separation(pose, shapes, a, b, m, c)
    if s > best:
        # The corner of B is what touches A's face.
        best, n = s, m
        p = add_scaled((c[ROOM, 6], c[ROOM, 7], c[ROOM, 8]), -s, m)
        d = s
    m = scale(-1.0, face_normal_along(pose, shapes, b, scale(-1.0, n)))
    s = separation(pose, shapes, a, b, m, c)
    if s > best:
        d, n, p = s, m, (c[ROOM, 3], c[ROOM, 4], c[ROOM, 5])
    return d, n, p


@kernel
def _between_middles(pose: Array, shapes: Shapes, a: int, b: int, d: float, n: Vector,
                     small: float, scratch: Scratch) -> tuple[float, Vector]:
    """
    Return distance and normal of two polyhedra that touch, n where that is the only direction.

    Where a corner meets a corner or an edge, all directions of a cone separate as well, and which
    of them the search found follows from rounding, or from which shape is A. Of these the one is
    meant that is between what is nearest once B is moved away along the line of the middles. It
    turns and is mirrored with the shapes, and for the pair (B, A) it is the opposite. In a slight
    overlap it may be twice as deep as along the best direction: where corners of boxes that are
    mirror images overlap, that is a normal of a face, whose component along the normal of the
    mirror is at least 1 / sqrt(3).
    """
    hulls, apart = shapes.hulls, subtract(origin(pose, b), origin(pose, a))
    length = norm(apart)
    if length == 0.0:
        return d, n
    count, v = gjk(pose, shapes.kind, shapes.size, hulls.first, hulls.count, hulls.vertices,
                   shapes.hull, a, b, scale(AWAY * small / length, apart), math.inf,
                   scratch.corners, scratch.numbers)
    moved = norm(v)
    # Middles outside of their shapes may tell no way apart.
    if count == 4 or moved < LEAST_AWAY * AWAY * small:
        return d, n
    m = scale(-1.0 / moved, v)
    s = separation(pose, shapes, a, b, m, scratch.corners)
    other = subtract(m, n)
    if s < min(d, 2.0 * d) - MEETS * small or dot(other, other) < ONE_NORMAL * ONE_NORMAL:
        return d, n
    return s, m


@kernel
def convex_convex(pose: Array, shapes: Shapes, a: int, b: int, margin: float,
                  scratch: Scratch) -> tuple[int, Vector]:
    """Find the manifold: return the number of points, at most 4, and the normal from A to B."""
    gap, n, p = distance(pose, shapes, a, b, margin, scratch)
    if gap >= margin:
        return 0, n
    return manifold_along(pose, shapes, a, b, n, gap, p, margin, scratch), n


@kernel
def manifold_along(pose: Array, shapes: Shapes, a: int, b: int, n: Vector, gap: float, p: Vector,
                   margin: float, scratch: Scratch) -> int:
    """
    Find the points whose gap along the normal n, from A to B, is below the margin [m].

    p is a point on A with the least gap that is known, infinite for none. Returns the number of
    points, at most 4.
    """
    points, ids, faces = scratch.points, scratch.ids, scratch.outline
    kind, size, hulls, hull = shapes.kind, shapes.size, shapes.hulls, shapes.hull
    small = min(shapes.bound[a], shapes.bound[b])
    corners_a, name_a = outline(kind[a], pose, size, a, hulls, hull[a], n, faces[0])
    corners_b, name_b = outline(kind[b], pose, size, b, hulls, hull[b], (-n[0], -n[1], -n[2]),
                                faces[1])
    count = 0
    if corners_a >= 2 and corners_b >= 2:
        swapped = _is_reference(shapes, a, b, faces, corners_a, corners_b, n)
        one, other = (1, 0) if swapped else (0, 1)
        sides, corners = (corners_b, corners_a) if swapped else (corners_a, corners_b)
        if sides >= 3:
            count = _clip_faces(faces[one], sides, faces[other], corners, n, margin, small,
                                swapped, points, ids, scratch.polygon, scratch.labels)
        else:
            count = _side_by_side(faces[one], faces[other], n, margin, swapped, points, ids)
    name = (64 * name_a + name_b) * 4096
    deepest = math.inf
    for k in range(count):
        ids[k] += name
        deepest = min(deepest, points[k, 3])
    if deepest > gap + MISSED * small:
        put(points, ids, count, p, gap, WITNESS)
        count += 1
    return reduce_to_four(points, ids, count, n, small)


@kernel
def _is_reference(shapes: Shapes, a: int, b: int, faces: Array, corners_a: int, corners_b: int,
                  n: Vector) -> bool:
    """
    Return whether the face, or line, of B is the one to which that of A is clipped.

    What the points are called, and which four of many are kept, must not depend on which shape is
    A. So the choice is one of the faces: a face before a line, one that is not tilted before one
    that is, then the one with fewer sides, the longer line, the one of the larger shape. Of two
    shapes of one size it is the one that is tilted less.
    """
    if corners_a == 2 or corners_b == 2:
        if corners_a != corners_b:
            return corners_a == 2
        return _square_of_length(faces[1]) > _square_of_length(faces[0])
    along_a = abs(dot(_face_normal(faces[0], corners_a), n))
    along_b = abs(dot(_face_normal(faces[1], corners_b), n))
    if (along_a < TILTED) != (along_b < TILTED):
        return along_a < TILTED
    if corners_a != corners_b:
        return corners_b < corners_a
    if abs(shapes.bound[a] - shapes.bound[b]) > ALIKE * shapes.bound[a]:
        return bool(shapes.bound[b] > shapes.bound[a])
    return along_b > along_a


@kernel
def _square_of_length(line: Array) -> float:
    along = subtract((line[1, 0], line[1, 1], line[1, 2]), (line[0, 0], line[0, 1], line[0, 2]))
    return dot(along, along)


@kernel
def _face_normal(face: Array, corners: int) -> Vector:
    """Return the unit normal of a polygon (Newell): corners may nearly lie on a line."""
    n = (0.0, 0.0, 0.0)
    p = (face[0, 0], face[0, 1], face[0, 2])
    for k in range(1, corners - 1):
        n = add_scaled(n, 1.0, cross((face[k, 0] - p[0], face[k, 1] - p[1], face[k, 2] - p[2]),
                                     (face[k + 1, 0] - p[0], face[k + 1, 1] - p[1],
                                      face[k + 1, 2] - p[2])))
    return scale(1.0 / norm(n), n)


@kernel
def _clip_faces(reference: Array, sides: int, incident: Array, corners: int, n: Vector,
                margin: float,
                small: float, swapped: bool, points: Array, ids: IntArray, polygon: Array,
                labels: IntArray) -> int:
    """
    Clip the incident face, or line, to the sides of the reference face, seen along the normal.

    `swapped` says that the reference face is B's. Labels as for boxes: the edges before and after
    a corner, the incident face's own from 0, the sides of the reference face from 32.
    """
    m = _face_normal(reference, sides)
    slope = dot(m, n)
    if abs(slope) < TILTED:
        return 0
    page, left = 0, corners
    for k in range(corners):
        for i in range(3):
            polygon[0, k, i] = incident[k, i]
        labels[0, k, 0] = k - 1 if k > 0 else corners - 1
        labels[0, k, 1] = k
    for side in range(sides):
        e = side + 1 if side + 1 < sides else 0
        start = (reference[side, 0], reference[side, 1], reference[side, 2])
        along = subtract((reference[e, 0], reference[e, 1], reference[e, 2]), start)
        # Outwards, in the plane of contact.
        outward = cross(along, n)
        if slope < 0.0:
            outward = (-outward[0], -outward[1], -outward[2])
        length = norm(outward)
        if length > 0.0:
            page, left = _cut(polygon, labels, page, left, start, scale(1.0 / length, outward),
                              OVERHANG * small, 32 + side)
    count = 0
    p = (reference[0, 0], reference[0, 1], reference[0, 2])
    for k in range(left):
        q = (polygon[page, k, 0], polygon[page, k, 1], polygon[page, k, 2])
        # The gap along the normal: from A's plane up to the corner, or from the corner up to B's.
        gap = dot(subtract(q, p), m) / slope
        if swapped:
            gap = -gap
        if gap < margin and count < CANDIDATES - 1:
            put(points, ids, count, q if swapped else add_scaled(q, -gap, n), gap,
                64 * labels[page, k, 0] + labels[page, k, 1])
            count += 1
    return count


@kernel
def _cut(polygon: Array, labels: IntArray, page: int, corners: int, start: Vector, outward: Vector,
         overhang: float, label: int) -> tuple[int, int]:
    """Cut off what lies beyond a side; return the page of the result and its corners."""
    other, kept = 1 - page, 0
    last = corners if corners > 2 else corners - 1  # a line has no way back
    for k in range(corners):
        e = k + 1 if k + 1 < corners else 0
        here = _height(polygon, page, k, start, outward)
        there = _height(polygon, page, e, start, outward)
        inside = here <= overhang
        if inside and kept < CANDIDATES:
            for i in range(3):
                polygon[other, kept, i] = polygon[page, k, i]
            labels[other, kept, 0] = labels[page, k, 0]
            labels[other, kept, 1] = labels[page, k, 1]
            kept += 1
        if k < last and inside != (there <= overhang) and kept < CANDIDATES:
            part = min(max(here / (here - there), 0.0), 1.0)
            for i in range(3):
                polygon[other, kept, i] = (polygon[page, k, i]
                                           + part * (polygon[page, e, i] - polygon[page, k, i]))
            labels[other, kept, 0] = labels[page, k, 1] if inside else label
            labels[other, kept, 1] = label if inside else labels[page, k, 1]
            kept += 1
    return other, kept


@kernel
def _height(polygon: Array, page: int, k: int, start: Vector, outward: Vector) -> float:
    return ((polygon[page, k, 0] - start[0]) * outward[0]
            + (polygon[page, k, 1] - start[1]) * outward[1]
            + (polygon[page, k, 2] - start[2]) * outward[2])


@kernel
def _side_by_side(reference: Array, line: Array, n: Vector, margin: float, swapped: bool,
                  points: Array, ids: IntArray) -> int:
    """
    Find the two ends of what two nearly parallel lines have side by side; 0 if they cross.

    `swapped` says that the reference is B's.
    """
    p = (reference[0, 0], reference[0, 1], reference[0, 2])
    q = (line[0, 0], line[0, 1], line[0, 2])
    u = subtract((reference[1, 0], reference[1, 1], reference[1, 2]), p)
    v = subtract((line[1, 0], line[1, 1], line[1, 2]), q)
    uu, uv = dot(u, u), dot(u, v)
    # Beyond 0.05 rad the ends of the longer line are too far off to matter.
    w = cross(u, v)
    if dot(w, w) > 2.5e-3 * uu * dot(v, v):
        return 0
    at_start = dot(subtract(q, p), u) / uu
    at_end = at_start + uv / uu
    low, high = max(0.0, min(at_start, at_end)), min(1.0, max(at_start, at_end))
    if low >= high:
        return 0
    count = 0
    for k in range(2):
        x = low if k == 0 else high
        y = (x - at_start) / (at_end - at_start)
        on_a, on_b = add_scaled(p, x, u), add_scaled(q, y, v)
        if swapped:
            on_a, on_b = on_b, on_a
        gap = dot(subtract(on_b, on_a), n)
        if gap < margin:
            put(points, ids, count, on_a, gap, k)
            count += 1
    return count
