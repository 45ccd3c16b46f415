# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Two boxes: separating axes, then the faces clipped against each other.

Of two boxes the separation along a direction n is s(n) = t.n - sum a_i |n.A_i| - sum b_j |n.B_j|,
t from the middle of A to that of B. Boxes are apart when s(n) > 0 for a normal of a face or a
cross product of two edges; if they overlap the largest of these 15 numbers is minus the depth
(Gottschalk, OBBTree, SIGGRAPH 1996).
"""

import math

from rigid_sim_ros.engine.detection.narrow_phase.reduce import reduce_to_four
from rigid_sim_ros.engine.maths.algebra import add, add_scaled, dot, scale, subtract
from rigid_sim_ros.engine.maths.pose import axis, origin
from rigid_sim_ros.engine.model.kinds.points import put
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

# An axis has to separate better by this fraction of the smallest half extent to be preferred: the
# faces of the larger box come before those of the smaller one and those before edges. The gap is
# wrong by as much at most (0.2 mm for a box of 20 cm), and only where both axes are near.
PREFERENCE = 2e-3
# Of two boxes of one volume none comes first, or it would matter which of them is A: where faces
# of both are as near as that to be preferred, the normal is half way between theirs. A difference
# of less than this fraction is rounding.
ALIKE = 1e-9
# How near to 1 the cosine of the angle between faces is that are said to lie on each other.
FLAT = 0.9999
# And edges, a single point, by this fraction of an overlap of faces, which several points bear: at
# a small tilt either may be the shallower axis, and impulses are not handed from one to the other.
PREFERENCE_IN_OVERLAP = 0.1
# Corners that stand out over the other box's face by less than this fraction of its half extent
# count as lying on it: boxes of equal size on top of each other meet corner to corner.
OVERHANG = 1e-4
# The deepest points, if all of them are within this part of its half extents of one side of the
# face, are where a corner or an edge meets an edge: none of the axes is the direction between what
# is nearest, and which one separates best would depend on which box is A. So it is with edges that
# cross at their ends. Larger: the general method is asked where it finds the same.
CORNER = 1e-3
# Of the half extents: points that are less deep by more are not among the deepest. Less: corners
# are told from faces by what else is looked at ahead. More: a face that is tilted by less is taken
# for an edge.
LEVEL = 1e-3
# The square of the sine between two edges below which their cross product has no direction.
PARALLEL = 1e-8
# Places in `numbers`: A_i . B_j, their magnitudes, t in axes of A; 1 where faces of both are as
# good.
_C, _ABS, _T, _EVEN = 0, 9, 18, 21
UNSETTLED = -1
# Features: two edges that cross have numbers from here on. Points of two faces have lower ones,
# fewer than 36 * 12 * 12.
EDGES = 8192


@kernel
def _volume(size: Array, s: int) -> float:
    return size[s, 0] * size[s, 1] * size[s, 2]


@kernel
def _leaning(volume_a: float, volume_b: float) -> float:
    """Return 1 where the faces of A come first, -1 for those of B, 0 if neither do."""
    if abs(volume_a - volume_b) <= ALIKE * volume_a:
        return 0.0
    return 1.0 if volume_a > volume_b else -1.0


@kernel
def separation(pose: Array, size: Array, a: int, b: int, limit: float, way: float,
               m: Array) -> tuple[float, int]:
    """
    Return s and the axis that separates two boxes best.

    The axis is i for face i of A, 3 + j for face j of B and 6 + 3 i + j for the edges A_i x B_j.
    The first axis found with s > limit ends the search. The matrices are left in m for the
    clipping. Edges that meet are a single point, and other features may come into play before the
    pair has moved by `way` [m]: if a face is as near as that, its corners say more.
    """
    t = subtract(origin(pose, b), origin(pose, a))
    for i in range(3):
        A = axis(pose, a, i)
        m[_T + i] = dot(t, A)
        for j in range(3):
            c = dot(A, axis(pose, b, j))
            m[_C + 3 * i + j] = c
            m[_ABS + 3 * i + j] = abs(c)
    face_a, best_a = 0, -math.inf
    for i in range(3):
        s = abs(m[_T + i]) - (size[a, i] + size[b, 0] * m[_ABS + 3 * i]
                              + size[b, 1] * m[_ABS + 3 * i + 1] + size[b,
                                                                        2] * m[_ABS + 3 * i + 2])
        if s > best_a:
            face_a, best_a = i, s
    if best_a > limit:
        return best_a, face_a
    face_b, best_b = 3, -math.inf
    for j in range(3):
        d = abs(m[_T] * m[_C + j] + m[_T + 1] * m[_C + 3 + j] + m[_T + 2] * m[_C + 6 + j])
        s = d - (size[b, j] + size[a, 0] * m[_ABS + j]
                 + size[a, 1] * m[_ABS + 3 + j] + size[a, 2] * m[_ABS + 6 + j])
        if s > best_b:
            face_b, best_b = 3 + j, s
    if best_b > limit:
        return best_b, face_b
    edge, best_edge = _edge_separation(size, a, b, limit, m)
    preference = PREFERENCE * min(min(size[a, 0], size[a, 1], size[a, 2]),
                                  min(size[b, 0], size[b, 1], size[b, 2]))
    leaning = _leaning(_volume(size, a), _volume(size, b))
    even = (leaning == 0.0 and abs(best_b - best_a) <= preference
            and m[_ABS + 3 * face_a + face_b - 3] > FLAT)
    m[_EVEN] = 1.0 if even else 0.0
    chosen_b = best_b > best_a + preference * leaning
    face, best = (face_b, best_b) if chosen_b else (face_a, best_a)
    largest = max(best_a, best_b)
    better = largest + preference + way + PREFERENCE_IN_OVERLAP * max(-largest, 0.0)
    if best_edge > better or best_edge > limit:
        return best_edge, edge
    return best, face


@kernel
def _edge_separation(size: Array, a: int, b: int, limit: float, m: Array) -> tuple[int, float]:
    edge, best = UNSETTLED, -math.inf
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            c = m[_C + 3 * i + j]
            squared = 1.0 - c * c
            if squared < PARALLEL:
                continue
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            # In axes of A the direction A_i x B_j has the components 0, -C(i2, j), C(i1, j).
            s = abs(m[_T + i2] * m[_C + 3 * i1 + j] - m[_T + i1] * m[_C + 3 * i2 + j])
            s -= (size[a, i1] * m[_ABS + 3 * i2 + j] + size[a, i2] * m[_ABS + 3 * i1 + j]
                  + size[b, j1] * m[_ABS + 3 * i + j2] + size[b, j2] * m[_ABS + 3 * i + j1])
            # Only a candidate that can win is worth a root: s / sqrt(squared) > best.
            if s > 0.0 or best == -math.inf or s * s < best * best * squared:
                s /= math.sqrt(squared)
                if s > best:
                    edge, best = 6 + 3 * i + j, s
                    if best > limit:
                        return edge, best
    return edge, best


@kernel
def direction(pose: Array, a: int, b: int, which: int) -> Vector:
    """Return the unit vector of an axis of `separation`, from A to B."""
    t = subtract(origin(pose, b), origin(pose, a))
    if which < 3:
        n = axis(pose, a, which)
    elif which < 6:
        n = axis(pose, b, which - 3)
    else:
        A, B = axis(pose, a, (which - 6) // 3), axis(pose, b, (which - 6) % 3)
        n = (A[1] * B[2] - A[2] * B[1], A[2] * B[0] - A[0] * B[2], A[0] * B[1] - A[1] * B[0])
        n = scale(1.0 / math.sqrt(dot(n, n)), n)
    return scale(1.0 if dot(t, n) >= 0.0 else -1.0, n)


@kernel
def box_box(pose: Array, size: Array, a: int, b: int, margin: float, way: float, points: Array,
            ids: IntArray, polygon: Array, labels: IntArray, m: Array) -> tuple[int, Vector]:
    """
    Find the manifold of two boxes: return the number of points and the normal.

    0 points: the normal is a direction that separates them by more than the margin. UNSETTLED:
    they are near, but their nearest features are not a face or two crossing edges; the general
    method finds them.
    """
    s, which = separation(pose, size, a, b, margin, way, m)
    n = direction(pose, a, b, which)
    if s > margin:
        return 0, n
    if which >= 6:
        return _edges(pose, size, a, b, which, s, n, points, ids)
    if m[_EVEN] == 1.0:
        n = _between_faces(pose, a, b, which, n, m)
    if which < 3:
        count = _faces(pose, size, a, b, which, n, margin, False, points, ids, polygon, labels, m)
    else:
        count = _faces(pose, size, b, a, which - 3, n, margin, True, points, ids, polygon, labels,
                       m)
    r, k = (a, which) if which < 3 else (b, which - 3)
    if count == 0 or _is_border(pose, size, r, k, count, points):
        return UNSETTLED, n
    return _reduced(size, a, b, n, count, points, ids), n


@kernel
def _between_faces(pose: Array, a: int, b: int, which: int, n: Vector, m: Array) -> Vector:
    """Return the direction between n, of a face of one box, and that of the face it looks at."""
    other = (axis(pose, b, _facing(which, 3, 1, m)) if which < 3
             else axis(pose, a, _facing(which - 3, 1, 3, m)))
    both = add_scaled(n, 1.0 if dot(n, other) > 0.0 else -1.0, other)
    return scale(1.0 / math.sqrt(dot(both, both)), both)


@kernel
def _facing(k: int, row: int, column: int, m: Array) -> int:
    """Return the axis of the other box whose faces are most opposed to those of axis k."""
    f = 0
    for j in range(1, 3):
        if m[_ABS + row * k + column * j] > m[_ABS + row * k + column * f] + 1e-6:
            f = j
    return f


@kernel
def _is_border(pose: Array, size: Array, r: int, k: int, count: int, points: Array) -> bool:
    """Return whether the deepest points on face k of box r are all on one side of its border."""
    deepest = math.inf
    for c in range(count):
        deepest = min(deepest, points[c, 3])
    for i in range(1, 3):
        d = (k + i) % 3
        level = deepest + LEVEL * max(size[r, (k + 1) % 3], size[r, (k + 2) % 3])
        low, high = math.inf, -math.inf
        for c in range(count):
            if points[c, 3] <= level:
                p = (points[c, 0], points[c, 1], points[c, 2])
                at = dot(subtract(p, origin(pose, r)), axis(pose, r, d))
                low, high = min(low, at), max(high, at)
        if max(low, -high) > (1.0 - CORNER) * size[r, d]:
            return True
    return False


@kernel
def face_manifold(pose: Array, size: Array, a: int, b: int, which: int, n: Vector, margin: float,
                  points: Array, ids: IntArray, polygon: Array, labels: IntArray,
                  m: Array) -> int:
    """
    Find the manifold of two boxes along face `which` of one of them, whatever separates them best.

    `which` as of `separation`, but for edges; n is its unit normal from A to B. Returns the number
    of points.
    """
    separation(pose, size, a, b, math.inf, 0.0, m)
    if which < 3:
        count = _faces(pose, size, a, b, which, n, margin, False, points, ids, polygon, labels, m)
    else:
        count = _faces(pose, size, b, a, which - 3, n, margin, True, points, ids, polygon, labels,
                       m)
    return _reduced(size, a, b, n, count, points, ids)


@kernel
def _reduced(size: Array, a: int, b: int, n: Vector, count: int, points: Array,
             ids: IntArray) -> int:
    """Keep four of the points at most; return how many."""
    small = min(min(size[a, 0], size[a, 1], size[a, 2]), min(size[b, 0], size[b, 1], size[b, 2]))
    return reduce_to_four(points, ids, count, n, small)


@kernel
def _edges(pose: Array, size: Array, a: int, b: int, which: int, s: float, n: Vector,
           points: Array,
           ids: IntArray) -> tuple[int, Vector]:
    """Find the point where two edges cross: the nearest points of the two lines."""
    i, j = (which - 6) // 3, (which - 6) % 3
    p, q, signs = origin(pose, a), origin(pose, b), 0
    for k in range(3):
        A, B = axis(pose, a, k), axis(pose, b, k)
        if k != i:
            up = dot(A, n) > 0.0
            p = add_scaled(p, size[a, k] if up else -size[a, k], A)
            signs = 2 * signs + (1 if up else 0)
        if k != j:
            up = dot(B, n) < 0.0
            q = add_scaled(q, size[b, k] if up else -size[b, k], B)
            signs = 2 * signs + (1 if up else 0)
    u, v, d = axis(pose, a, i), axis(pose, b, j), subtract(q, p)
    # (p + x u - q - y v) is at right angles to u and v.
    c, du, dv = dot(u, v), dot(d, u), dot(d, v)
    x = (du - c * dv) / (1.0 - c * c)
    y = (c * du - dv) / (1.0 - c * c)
    if abs(x) > size[a, i] * (1.0 + OVERHANG) or abs(y) > size[b, j] * (1.0 + OVERHANG):
        return UNSETTLED, n
    if abs(x) > size[a, i] * (1.0 - CORNER) and abs(y) > size[b, j] * (1.0 - CORNER):
        return UNSETTLED, n
    put(points, ids, 0, add_scaled(p, x, u), s, EDGES + 16 * (which - 6) + signs)
    return 1, n


@kernel
def _faces(pose: Array, size: Array, r: int, o: int, k: int, n: Vector, margin: float,
           swapped: bool,
           points: Array, ids: IntArray, polygon: Array, labels: IntArray, m: Array) -> int:
    """
    Clip the face of box o that faces axis k of box r against r's face, and keep what is near.

    `swapped` says that r is B: the outward normal of its face is -n, and the matrix in m
    transposed.
    """
    outward = -1.0 if swapped else 1.0
    sign = 1.0 if outward * dot(n, axis(pose, r, k)) > 0.0 else -1.0
    u, v = (k + 1) % 3, (k + 2) % 3
    row, column = (1, 3) if swapped else (3, 1)
    f = _facing(k, row, column, m)
    facing = -size[o, f] if sign * m[_C + row * k + column * f] > 0.0 else size[o, f]
    l1, l2 = (f + 1) % 3, (f + 2) % 3
    for c in range(3):
        # Component of the middle of the face, and its half edges, along axes u, v, k of r.
        x = u if c == 0 else (v if c == 1 else k)
        if swapped:
            middle = -(m[_T] * m[_C + x] + m[_T + 1] * m[_C + 3 + x] + m[_T + 2] * m[_C + 6 + x])
        else:
            middle = m[_T + x]
        middle += facing * m[_C + row * x + column * f]
        e1 = size[o, l1] * m[_C + row * x + column * l1]
        e2 = size[o, l2] * m[_C + row * x + column * l2]
        if c == 2:
            middle, e1, e2 = sign * middle - size[r, k], sign * e1, sign * e2
        polygon[0, 0, c] = middle - e1 - e2
        polygon[0, 1, c] = middle + e1 - e2
        polygon[0, 2, c] = middle + e1 + e2
        polygon[0, 3, c] = middle - e1 + e2
    page, corners = _clip(size[r, u], size[r, v], polygon, labels)
    own, other = 2 * k + (1 if sign > 0.0 else 0), 2 * f + (1 if facing > 0.0 else 0)
    base = 144 * (6 * other + own if swapped else 6 * own + other)
    U, V, N = axis(pose, r, u), axis(pose, r, v), axis(pose, r, k)
    face = add_scaled(origin(pose, r), sign * size[r, k], N)
    count = 0
    for c in range(corners):
        gap = polygon[page, c, 2]
        if gap < margin:
            p = add(face, add(scale(polygon[page, c, 0], U), scale(polygon[page, c, 1], V)))
            if swapped:
                p = add_scaled(p, -gap, n)
            one = _edge_name(labels[page, c, 0], k, f, swapped)
            next_one = _edge_name(labels[page, c, 1], k, f, swapped)
            put(points, ids, count, p, gap,
                base + 12 * min(one, next_one) + max(one, next_one))
            count += 1
    return count


@kernel
def _edge_name(label: int, k: int, f: int, swapped: bool) -> int:
    """
    Return by which face of which box an edge is bounded: 0 .. 5 of A, 6 .. 11 of B.

    A label as `_clip` leaves it, of faces of axis k of the reference and f of the incident box.
    So a corner has one name, whichever of the two faces was clipped to the other.
    """
    if label < 4:
        # The edges of the incident face, anticlockwise from that at its second axis' lower end.
        along = (f + 2) % 3 if label % 2 == 0 else (f + 1) % 3
        name = 2 * along + (1 if label in (1, 2) else 0)
        return name if swapped else 6 + name
    along = (k + 1) % 3 if label < 6 else (k + 2) % 3
    name = 2 * along + (1 if label % 2 == 0 else 0)
    return 6 + name if swapped else name


@kernel
def _clip(hu: float, hv: float, polygon: Array, labels: IntArray) -> tuple[int, int]:
    """
    Clip the quadrangle of page 0 to |u| <= hu, |v| <= hv; return page and number of corners.

    Sutherland and Hodgman, CACM 17 (1974). A corner carries the labels of the edges before and
    after it: 0 .. 3 for the quadrangle's own, 4 .. 7 for the sides that cut it, so that it keeps
    its name while it moves.
    """
    page, corners = 0, 4
    for c in range(4):
        labels[0, c, 0] = (c + 3) % 4
        labels[0, c, 1] = c
    for side in range(4):
        d = side // 2
        limit, sign = (hu if d == 0 else hv), (1.0 if side % 2 == 0 else -1.0)
        reach = limit * (1.0 + OVERHANG)
        outside = False
        for c in range(corners):
            outside = outside or sign * polygon[page, c, d] > reach
        if not outside:
            continue
        kept, other = 0, 1 - page
        for c in range(corners):
            e = c + 1 if c + 1 < corners else 0
            here, there = sign * polygon[page, c, d], sign * polygon[page, e, d]
            if here <= reach:
                for i in range(3):
                    polygon[other, kept, i] = polygon[page, c, i]
                labels[other, kept, 0] = labels[page, c, 0]
                labels[other, kept, 1] = labels[page, c, 1]
                kept += 1
            if (here <= reach) != (there <= reach):
                part = min(max((limit - here) / (there - here), 0.0), 1.0)
                for i in range(3):
                    polygon[other, kept, i] = (polygon[page, c, i]
                                               + part * (polygon[page, e, i] - polygon[page, c,
                                                                                       i]))
                out = here <= reach
                labels[other, kept, 0] = labels[page, c, 1] if out else 4 + side
                labels[other, kept, 1] = 4 + side if out else labels[page, c, 1]
                kept += 1
        page, corners = other, kept
    return page, corners
