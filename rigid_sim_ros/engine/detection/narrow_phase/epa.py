# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Depth of two convex cores that overlap.

The set of all differences a - b then holds the origin, and the depth is its distance from the
surface. A polyhedron inside of the set grows where its surface is nearest to the origin, until
that face is one of the set's own (van den Bergen, Proximity Queries and Penetration Depth
Computation, GDC 2001). For polyhedra the result is exact; a round surface is approached to
`ROUND_GAIN`.
"""

import math

from rigid_sim_ros.engine.detection.manifolds import EPA_CORNERS, EPA_FACES
from rigid_sim_ros.engine.detection.narrow_phase.gjk import corner, find_corner
from rigid_sim_ros.engine.maths.algebra import cross, dot, norm, perpendicular, scale, subtract
from rigid_sim_ros.engine.model.kinds.table import is_curved, is_smooth
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

# Of the size of the shapes: what a further corner has to gain, between polyhedra and with a curved
# surface. On that the faces get smaller without end; below 1e-12 their normals are noise. An edge
# on a smooth surface, where the result is not improved afterwards, asks for the best there is.
FLAT_GAIN = 1e-13
ROUND_GAIN = 1e-10
SMOOTH_GAIN = 1e-12
ALIVE, SEEN = 1, 2  # states of a face; 0: removed
FLAT = 1e-9  # of the size: below it corners do not span a solid


@kernel
def _start(pose: Array, kind: IntArray, size: Array, first: IntArray, count: IntArray,
           vertices: Array, hull: IntArray, a: int, b: int, c: Array, n: int) -> bool:
    """Add corners to a simplex until it is a tetrahedron; return whether there is one."""
    if n == 0:
        find_corner(pose, kind, size, first, count, vertices, hull, a, b, (1.0, 0.0, 0.0), c, 0)
        n = 1
    scale_of = 1e-300
    for k in range(n):
        scale_of = max(scale_of, norm(corner(c, k)))
    for trial in range(12):
        if n == 4:
            break
        p = corner(c, 0)
        if n == 1:
            d = (1.0 if trial % 3 == 0 else 0.0, 1.0 if trial % 3 == 1 else 0.0,
                 1.0 if trial % 3 == 2 else 0.0)
        elif n == 2:
            e = subtract(corner(c, 1), p)
            e = scale(1.0 / norm(e), e)
            d = perpendicular(e)
            if trial % 3 == 1:
                d = cross(e, d)
        else:
            d = cross(subtract(corner(c, 1), p), subtract(corner(c, 2), p))
            d = scale(1.0 / norm(d), d)
        if (trial // 3) % 2 == 1 or (n == 3 and trial % 2 == 1):
            d = (-d[0], -d[1], -d[2])
        w = find_corner(pose, kind, size, first, count, vertices, hull, a, b, d, c, n)
        scale_of = max(scale_of, norm(w))
        if _spans(c, n, scale_of):
            n += 1
    return n == 4


@kernel
def _spans(c: Array, n: int, size: float) -> bool:
    """Return whether corner n lies outside of the point, line or plane of those before."""
    p, w = corner(c, 0), corner(c, n)
    d = subtract(w, p)
    if n == 1:
        return norm(d) > FLAT * size
    e = subtract(corner(c, 1), p)
    if n == 2:
        return norm(cross(e, d)) > FLAT * size * norm(e)
    f = cross(e, subtract(corner(c, 2), p))
    return abs(dot(f, d)) > FLAT * size * norm(f)


@kernel
def _face(c: Array, faces: Array, links: IntArray, f: int, i: int, j: int, k: int) -> None:
    """Write face f through three corners, seen anticlockwise from outside."""
    p, q, r = corner(c, i), corner(c, j), corner(c, k)
    pq, pr, qr = subtract(q, p), subtract(r, p), subtract(r, q)
    n = cross(pq, pr)
    length = norm(n)
    links[f, 0], links[f, 1], links[f, 2], links[f, 3] = i, j, k, ALIVE
    longest = max(dot(pq, pq), dot(pr, pr), dot(qr, qr))
    if length <= 1e-14 * longest:
        # Without a direction: it closes the surface, and is neither nearest nor seen from
        # anywhere.
        faces[f, 0], faces[f, 1], faces[f, 2], faces[f, 3] = 0.0, 0.0, 0.0, math.inf
        return
    n = scale(1.0 / length, n)
    faces[f, 0], faces[f, 1], faces[f, 2] = n
    faces[f, 3] = max(dot(n, p), dot(n, q), dot(n, r))


@kernel
def _horizon(c: Array, faces: Array, links: IntArray, edges: IntArray, used: int, new: int,
             size: float) -> int:
    """
    Remove the faces that corner `new` sees; return how many edges the hole has, 0 for none.

    Faces in one plane with the corner, to rounding, make a hole that does not hang together. Then
    only faces that it sees more clearly are removed.
    """
    w, clearly = corner(c, new), 1e-14 * size
    for _ in range(4):
        count = 0
        for f in range(used):
            if links[f, 3] == 0:
                continue
            height = faces[f, 0] * w[0] + faces[f, 1] * w[1] + faces[f, 2] * w[2] - faces[f, 3]
            links[f, 3] = SEEN if height > clearly else ALIVE
            for k in range(3 if height > clearly else 0):
                count = _add_edge(edges, count, links[f, k], links[f, (k + 1) % 3])
        if _is_loop(edges, count):
            for f in range(used):
                if links[f, 3] == SEEN:
                    links[f, 3] = 0
            return count
        clearly *= 30.0
    return 0


@kernel
def _add_edge(edges: IntArray, count: int, i: int, j: int) -> int:
    """Add an edge of a removed face, or strike out its reverse, between two removed faces."""
    for e in range(count):
        if edges[e, 0] == j and edges[e, 1] == i:
            edges[e, 0], edges[e, 1] = edges[count - 1, 0], edges[count - 1, 1]
            return count - 1
    if count < edges.shape[0]:
        edges[count, 0], edges[count, 1] = i, j
        return count + 1
    return count


@kernel
def _is_loop(edges: IntArray, count: int) -> bool:
    """Return whether the edges make one closed way around."""
    if count < 3:
        return False
    at, steps = edges[0, 1], 1
    while at != edges[0, 0] and steps < count:
        following = -1
        for e in range(count):
            if edges[e, 0] == at:
                following = edges[e, 1]
                break
        if following < 0:
            return False
        at = following
        steps += 1
    return at == edges[0, 0] and steps == count


@kernel
def epa(pose: Array, kind: IntArray, size: Array, first: IntArray, count: IntArray,
        vertices: Array, hull: IntArray, a: int, b: int, simplex: int, c: Array, faces: Array,
        links: IntArray, edges: IntArray) -> tuple[float, Vector, Vector]:
    """
    Return the depth [m], the normal from A to B and the nearest point on the core of A.

    `simplex` corners in c come from the search for a distance that ended in overlap. A depth of
    -inf says that the difference of the cores has no volume.
    """
    if not _start(pose, kind, size, first, count, vertices, hull, a, b, c, simplex):
        return -math.inf, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    largest = 0.0
    for k in range(4):
        largest = max(largest, norm(corner(c, k)))
    p = corner(c, 0)
    n = cross(subtract(corner(c, 1), p), subtract(corner(c, 2), p))
    i, j = (2, 1) if dot(n, subtract(corner(c, 3), p)) > 0.0 else (1, 2)
    _face(c, faces, links, 0, 0, i, j)
    _face(c, faces, links, 1, 0, 3, i)
    _face(c, faces, links, 2, i, 3, j)
    _face(c, faces, links, 3, 0, j, 3)
    used, corners, nearest = 4, 4, 0
    gain = ROUND_GAIN if is_curved(kind[a]) or is_curved(kind[b]) else FLAT_GAIN
    if is_smooth(kind[a]) or is_smooth(kind[b]):
        gain = SMOOTH_GAIN
    while True:
        nearest = -1
        for f in range(used):
            if links[f, 3] > 0 and (nearest < 0 or faces[f, 3] < faces[nearest, 3]):
                nearest = f
        if nearest < 0 or faces[nearest, 3] == math.inf:
            return -math.inf, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
        n = (faces[nearest, 0], faces[nearest, 1], faces[nearest, 2])
        if corners >= EPA_CORNERS:
            break
        w = find_corner(pose, kind, size, first, count, vertices, hull, a, b, n, c, corners)
        if dot(n, w) - faces[nearest, 3] <= gain * largest:
            break
        around = _horizon(c, faces, links, edges, used, corners, largest)
        if around == 0:
            break
        used, room = _patch(c, faces, links, edges, around, used, corners)
        corners += 1
        if not room:
            break
    return faces[nearest, 3], n, _point_on_a(c, links, nearest)


@kernel
def _patch(c: Array, faces: Array, links: IntArray, edges: IntArray, around: int, used: int,
           new: int) -> tuple[int, bool]:
    """Close the hole with faces to the new corner, in the places of removed ones."""
    free = 0
    for e in range(around):
        while free < used and links[free, 3] > 0:
            free += 1
        if free == EPA_FACES:
            return used, False
        _face(c, faces, links, free, edges[e, 0], edges[e, 1], new)
        if free == used:
            used += 1
        free += 1
    return used, True


@kernel
def _point_on_a(c: Array, links: IntArray, f: int) -> Vector:
    """Return the point of A that belongs to the foot of the origin on a face."""
    i, j, k = links[f, 0], links[f, 1], links[f, 2]
    p, q, r = corner(c, i), corner(c, j), corner(c, k)
    n = cross(subtract(q, p), subtract(r, p))
    total = dot(n, n)
    # Barycentric weights of the projection: areas of the triangles with the origin.
    u = dot(cross(q, r), n) / total
    v = dot(cross(r, p), n) / total
    w = 1.0 - u - v
    return (u * c[i, 3] + v * c[j, 3] + w * c[k, 3], u * c[i, 4] + v * c[j, 4] + w * c[k, 4],
            u * c[i, 5] + v * c[j, 5] + w * c[k, 5])
