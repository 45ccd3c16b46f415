# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Seams: pieces that lie flush are one surface, and what moves over it meets no edges in between.

A pair of convex shapes knows nothing of what lies beside either. Of the union of several shapes a
point p on the surface of S has the normal n only if n is a proximal normal of every one of them
that holds p: the cone of proximal normals of a union is the intersection of the cones of its
pieces (Clarke et al., Nonsmooth Analysis and Control Theory, 1998, chapter 1). Of a convex piece
T that holds p this means n . x <= n . p for all x in T. A floor of tiles has only the normals of
the floor in its seams; a roof has those between its slopes; the face of a tile that another tile
covers has none.

For each shape M that moves, the points of its manifolds are tested against the other shapes that
M is near. Where S and T make an inner corner, or S is a wall on T, p is a corner of both, and the
point that is meant lies a little beside it: p slides on the face of S, out of what covers it, in
the direction in which T pushes M. If there is still surface of S, the contact stands. If it ends
within the tolerance, S and T are flush there, and the contact is none. Then the pair gets points
along that face of S through which M leaves it on the shortest way and where the contact stands, or
has none: what is nearest of the union always stands.
"""

import math

from rigid_sim_ros.engine.detection.carried_impulses import carry_over
from rigid_sim_ros.engine.detection.manifold_rows import (
    find_row, mark_mended, pack_rows, take_point)
from rigid_sim_ros.engine.detection.manifolds import (
    CONTACTS, current, earlier, Manifolds, Memory, rows_in_use, Scratch, Seams, smallest_gap)
from rigid_sim_ros.engine.detection.narrow_phase.boxes import face_manifold
from rigid_sim_ros.engine.detection.narrow_phase.collide import BOXES, FAMILY
from rigid_sim_ros.engine.detection.narrow_phase.convex import manifold_along
from rigid_sim_ros.engine.detection.narrow_phase.surface import (
    are_same, face, face_count, face_normal_along, height, nearest_face, way_out)
from rigid_sim_ros.engine.detection.seam_pieces import (
    centre, first_code, FLUSH, is_one_direction, of_face, one_surface, outward, push, reaches,
    shapes_of, tolerance)
from rigid_sim_ros.engine.detection.support import extreme, radius, reach
from rigid_sim_ros.engine.maths.algebra import add, add_scaled, dot, norm, scale, subtract
from rigid_sim_ros.engine.model.kinds.points import put
from rigid_sim_ros.engine.model.kinds.table import has_disc, is_faceted, is_unbounded
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import INDEX, kernel

# Of the tolerance: how exactly a point lies on a face. It tells an edge from a face at angles
# above 1e-6 rad; rounding is far below.
ON_FACE = 1e-6
# How often a point slides out of what covers it: once for each wall of a corner, and once to see.
SLIDES = 4
# How many faces are tried.
TRIALS = 4
# How many times the overlap that was found may be that through another face.
DEEPER = 16.0


@kernel
def find_seams(shapes: Shapes, memory: Memory) -> bool:
    """
    List the manifolds that have a point where a third shape is; return whether there are any.

    A code in `suspect` is 2 k + side for row k; side 0: its shape A may be a piece of a surface
    that shape B moves over, side 1: the other way round.
    """
    rows, seams = current(memory), memory.seams
    first, count = rows_in_use(rows)
    if not _link(shapes, rows, first, count, seams):
        return False
    found = 0
    for k in range(first, first + count):
        for side in range(2):
            s, m = shapes_of(rows, k & INDEX, side)
            # A half space has one normal, whatever the surface that it meets looks like.
            if (is_faceted(shapes.kind[s]) and not is_unbounded(shapes.kind[m])
                    and _is_suspect(shapes, memory, rows, k & INDEX, s, m)):
                seams.suspect[found] = 2 * k + side
                found += 1
    seams.count[0] = found
    return found > 0


@kernel
def _link(shapes: Shapes, rows: Manifolds, first: int, count: int, seams: Seams) -> bool:
    """Chain the manifolds of each shape, in order; return whether there is anything to look at."""
    faceted = False
    for k in range(first, first + count):
        a, b = shapes_of(rows, k, 0)
        seams.head[a] = seams.head[b] = -1
        faceted = faceted or is_faceted(shapes.kind[a]) or is_faceted(shapes.kind[b])
    if not faceted:
        return False
    for k in range(first + count - 1, first - 1, -1):
        for c in range(3):
            seams.normal[k, c] = rows.normal[k, c]
        for side in range(2):
            _, m = shapes_of(rows, k, side)
            after = seams.head[m]
            seams.link[side, k], seams.back[side, k] = after, -1
            if after >= 0:
                seams.back[after & 1, after >> 1] = 2 * k + side
            seams.head[m] = 2 * k + side
    return True


@kernel
def _point(pose: Array, turn: Array, shapes: Shapes, rows: Manifolds, k: int, side: int,
           p: int) -> Vector:
    """Return point p of manifold k on S [m, world axes]."""
    s, _ = shapes_of(rows, k, side)
    c = centre(pose, turn, shapes, s)
    r = rows.r_A if side == 0 else rows.r_B
    return (c[0] + r[p, k, 0], c[1] + r[p, k, 1], c[2] + r[p, k, 2])


@kernel
def _is_suspect(shapes: Shapes, memory: Memory, rows: Manifolds, k: int, s: int, m: int) -> bool:
    """Return whether a third shape with another normal may hold a point of manifold k."""
    seams, pose, turn = memory.seams, memory.pose, memory.turn
    side = 0 if rows.shape_a[k] == s else 1
    at = first_code(shapes, rows, seams, m, k, side)
    low, high = _bounds(pose, turn, shapes, rows, k, side)
    if not _is_any_near(shapes, memory, rows, at, s, m, low, high):
        return False
    n = of_face(pose, shapes, s, m, outward(rows.normal, k, side))
    most, count = FLUSH * shapes.half_width[s], rows.points[k]
    # A part of a face of S whose middle nothing covers goes on from all of its corners.
    area = count > 2 and are_same(n, face_normal_along(pose, shapes, s, n))
    middle = _middle(pose, turn, shapes, rows, k, side)
    if area:
        low, high = middle, middle
    while at >= 0:
        j, other = (at >> 1) & INDEX, at & 1
        t, _ = shapes_of(rows, j, other)
        if shapes.still[m] == 1 and shapes.body[t] != shapes.body[s]:
            break       # a fixed M is met by each body for itself, whose pieces lie side by side
        if (s != t and reaches(memory.box, t, low, high, most)
                and one_surface(pose, shapes, s, t)):
            flush = tolerance(shapes, m, s, t)
            alike = is_one_direction(shapes, s, t, n, push(pose, shapes, rows, seams, j, other, n))
            for p in range(1 if area else count):
                x = middle if area else _point(pose, turn, shapes, rows, k, side, p)
                if (height(pose, shapes, t, x) <= flush
                        and not (alike and _has_normal(pose, shapes, t, x, n, flush, 0.0))):
                    return True
        at = seams.link[other, j]
    return False


@kernel
def _bounds(pose: Array, turn: Array, shapes: Shapes, rows: Manifolds, k: int,
            side: int) -> tuple[Vector, Vector]:
    """Return the lower and the upper corner of the box around the points of manifold k on S."""
    s, _ = shapes_of(rows, k, side)
    r = rows.r_A if side == 0 else rows.r_B
    low = (r[0, k, 0], r[0, k, 1], r[0, k, 2])
    high = low
    for p in range(1, rows.points[k]):
        low = (min(low[0], r[p, k, 0]), min(low[1], r[p, k, 1]), min(low[2], r[p, k, 2]))
        high = (max(high[0], r[p, k, 0]), max(high[1], r[p, k, 1]), max(high[2], r[p, k, 2]))
    c = centre(pose, turn, shapes, s)
    return add(c, low), add(c, high)


@kernel
def _middle(pose: Array, turn: Array, shapes: Shapes, rows: Manifolds, k: int,
            side: int) -> Vector:
    """Return the middle of the points of manifold k on S [m, world axes]."""
    s, _ = shapes_of(rows, k, side)
    r, middle = rows.r_A if side == 0 else rows.r_B, (0.0, 0.0, 0.0)
    for p in range(rows.points[k]):
        middle = add_scaled(middle, 1.0 / rows.points[k], (r[p, k, 0], r[p, k, 1], r[p, k, 2]))
    return add(centre(pose, turn, shapes, s), middle)


@kernel
def _is_any_near(shapes: Shapes, memory: Memory, rows: Manifolds, at: int, s: int, m: int,
                 low: Vector, high: Vector) -> bool:
    """Return whether a third shape, of the codes from `at` on, comes near that box."""
    most = FLUSH * shapes.half_width[s]
    while at >= 0:
        j, other = (at >> 1) & INDEX, at & 1
        t, _ = shapes_of(rows, j, other)
        if shapes.still[m] == 1 and shapes.body[t] != shapes.body[s]:
            break
        if s != t and reaches(memory.box, t, low, high, most):
            return True
        at = memory.seams.link[other, j]
    return False


@kernel
def mend_seams(shapes: Shapes, memory: Memory, scratch: Scratch) -> None:
    """
    Take contacts that are none off the manifolds that `find_seams` listed, and mend these.

    A shape that the others do not hold keeps its nearest manifold: see `_lacking`.
    """
    rows, seams, before = current(memory), memory.seams, earlier(memory)
    lost = 0
    for i in range(seams.count[0]):
        code = seams.suspect[i]
        k, side = (code >> 1) & INDEX, code & 1
        s, m = shapes_of(rows, k, side)
        if rows.points[k] <= 0:
            continue
        points, standing = rows.points[k], 0
        n = of_face(memory.pose, shapes, s, m, outward(rows.normal, k, side))
        off = off_since_found(memory.turn, rows, k)
        for p in range(points):
            x = _point(memory.pose, memory.turn, shapes, rows, k, side, p)
            if stands(shapes, memory, rows, m, k, side, x, n, off):
                standing |= 1 << p
        if standing == (1 << points) - 1:
            continue
        kept = _along_a_face(shapes, memory, scratch, rows, k, side, smallest_gap(rows, k))
        if kept > 0:
            old = find_row(before, rows.shape_a[k], rows.shape_b[k])
            carry_over(rows, before, k, old, kept)
        else:
            for p in range(points):
                if standing >> p & 1 == 1:
                    take_point(rows, k, p, kept)
                    kept += 1
        lost += points - kept
        # Its points are found anew in the next step, whatever becomes of them.
        mark_mended(rows, k)
        rows.points[k] = kept if kept > 0 else -points
    for i in range(seams.count[0]):
        seams.suspect[i] = _lacking(shapes, rows, seams, seams.suspect[i])
    for i in range(seams.count[0]):
        k = seams.suspect[i]
        if k >= 0 and rows.points[k] < 0:
            rows.points[k] = -rows.points[k]
            lost -= rows.points[k]
    memory.counters[CONTACTS] -= lost
    pack_rows(rows)


@kernel
def _lacking(shapes: Shapes, rows: Manifolds, seams: Seams, code: int) -> int:
    """
    Return the row that shape M of a code needs back, if all points were taken of it; else -1.

    It is its nearest manifold, and needed if the others do not hold the shape.

    They do not if there are none. Nor if what was taken overlaps by more than the tolerance, and
    they by less than half of that: M overlaps the union of its pieces at least as far as any of
    them, and would sink into this one.
    """
    k, side = (code >> 1) & INDEX, code & 1
    if rows.points[k] >= 0:
        return -1
    s, m = shapes_of(rows, k, side)
    at, best = first_code(shapes, rows, seams, m, k, side), -1
    nearest, held = math.inf, math.inf
    while at >= 0:
        j, other = (at >> 1) & INDEX, at & 1
        t, _ = shapes_of(rows, j, other)
        if shapes.still[m] == 1 and shapes.body[t] != shapes.body[s]:
            break
        for p in range(abs(rows.points[j])):
            if rows.points[j] > 0:
                held = min(held, rows.gap[p, j])
            elif rows.gap[p, j] < nearest:
                best, nearest = j, rows.gap[p, j]
        at = seams.link[other, j]
    sinks = nearest < -tolerance(shapes, m, s, s) and held > 0.5 * nearest
    return -1 if held < math.inf and not sinks else best


@kernel
def stands(shapes: Shapes, memory: Memory, rows: Manifolds, m: int, k: int, side: int, p: Vector,
           n: Vector, off: float) -> bool:
    """
    Return whether S, of row k, has the normal n at p as a piece of all that M is near.

    n may be `off` [rad] from where the narrow phase would find it.
    """
    s, _ = shapes_of(rows, k, side)
    pose, seams, near = memory.pose, memory.seams, FLUSH * shapes.half_width[s]
    above = height(pose, shapes, s, p)
    if above > 0.0:
        # A corner that stands out over a face, by what the narrow phase allows, is held by what
        # holds the face below it.
        p = add_scaled(p, -above, nearest_face(pose, shapes, s, p))
        above = height(pose, shapes, s, p)
    x = p
    n_S = face_normal_along(pose, shapes, s, n)
    for _ in range(SLIDES):
        covered, at = False, first_code(shapes, rows, seams, m, k, side)
        while at >= 0:
            j, other = (at >> 1) & INDEX, at & 1
            t, _ = shapes_of(rows, j, other)
            if shapes.still[m] == 1 and shapes.body[t] != shapes.body[s]:
                break
            at = seams.link[other, j]
            if (s == t or not reaches(memory.box, t, x, x, near)
                    or not one_surface(pose, shapes, s, t)):
                continue
            n_T, flush = push(pose, shapes, rows, seams, j, other, n), tolerance(shapes, m, s, t)
            alike = is_one_direction(shapes, s, t, n, n_T)
            most = flush if alike else ON_FACE * flush
            if (height(pose, shapes, t, x) > flush
                    or _has_normal(pose, shapes, t, x, n, most, off)):
                continue
            if alike:
                # T stands out over S: p is beside it or inside, whatever else of T looks along n.
                n_T = nearest_face(pose, shapes, t, x)
            # The way along the face of S in which T pushes M.
            along = add_scaled(n_T, -dot(n, n_T), n)
            length = norm(along)
            if length < ON_FACE:
                if alike or dot(n, n_T) > 0.0:
                    continue
                return False
            along = scale(1.0 / length, along)
            way = way_out(pose, shapes, t, x, along) + 2.0 * flush
            x, covered = add_scaled(x, way, along), True
            # A tangent leaves a circle by half of the square of its length over the radius.
            bend = way * way / shapes.size[s, 0] if has_disc(shapes.kind[s]) else 0.0
            # The surface that goes on is the face that p is on: what comes inside of S may be on
            # another one, as on the top of a tile of which p is at the upper edge.
            if not (max(abs(height(pose, shapes, s, x) - above), abs(dot(n_S, subtract(x, p))))
                    <= ON_FACE * flush + bend):
                return False
        if not covered:
            return True
    return False


@kernel
def _has_normal(pose: Array, shapes: Shapes, t: int, p: Vector, n: Vector, most: float,
                off: float) -> bool:
    """
    Return whether no point of T is farther in the direction n than p, which it holds.

    Up to `most` [m], and to `off` [rad] by which n may be another.
    """
    hulls = shapes.hulls
    if is_unbounded(shapes.kind[t]):
        # It has one normal, +z of its frame.
        return are_same(n, (pose[t, 5], pose[t, 8], pose[t, 11]))
    farther = subtract(add_scaled(extreme(
        pose, shapes.kind, shapes.size, hulls.first, hulls.count, hulls.vertices, shapes.hull, t,
        n), radius(shapes.kind, shapes.size, t), n), p)
    return dot(farther, n) <= most + off * norm(farther)


@kernel
def off_since_found(turn: Array, rows: Manifolds, k: int) -> float:
    """
    Return by how much [rad] the normal of a manifold turned in its shapes since it was found.

    Points of polyhedra that hardly move are kept, and their normal turns half with either shape.
    It is no longer normal to an edge that it was normal to.
    """
    found_at, i = rows.found_at[k], rows.body_a[k]
    if found_at[0] == 0.0 and found_at[1] == 0.0 and found_at[2] == 0.0 and found_at[3] == 0.0:
        return 0.0      # it is not kept
    x, y, z = rows.normal_A[k, 0], rows.normal_A[k, 1], rows.normal_A[k, 2]
    kept = (turn[i, 0] * x + turn[i, 1] * y + turn[i, 2] * z,
            turn[i, 3] * x + turn[i, 4] * y + turn[i, 5] * z,
            turn[i, 6] * x + turn[i, 7] * y + turn[i, 8] * z)
    return norm(subtract(kept, (rows.normal[k, 0], rows.normal[k, 1], rows.normal[k, 2])))


@kernel
def _along_a_face(shapes: Shapes, memory: Memory, scratch: Scratch, rows: Manifolds, k: int,
                  side: int, gap: float) -> int:
    """
    Find the points of manifold k along the flat face of S that M leaves on the shortest way.

    Of the faces that M reaches beyond the first one where the contact stands, for S among what M
    is near and for M among what S is near, and none that makes much more of an overlap than there
    is: `gap` is the least one of the manifold [m]. Returns how many points there are.
    """
    pose = memory.pose
    s, m = shapes_of(rows, k, side)
    flush, last, done = tolerance(shapes, m, s, s), math.inf, -1
    margin, limit = memory.margin[s] + memory.margin[m], DEEPER * min(gap, -flush)
    for _ in range(TRIALS):
        best, deepest = -1, -math.inf
        for f in range(face_count(shapes, s)):
            n, offset = face(pose, shapes, s, f)
            d = -_reach(pose, shapes, m, scale(-1.0, n)) - offset
            # After the last one: less separation, or the same and a later number.
            if ((d < last or (d == last and f > done)) and d > deepest
                    and _reach(pose, shapes, m, n) > offset):
                best, deepest = f, d
        if best < 0 or deepest < limit:
            return 0
        last, done = deepest, best
        n, _ = face(pose, shapes, s, best)
        count, back = 0, scale(-1.0, n)
        if deepest < margin:
            count = _points_along(pose, shapes, s, m, side, best, n, deepest, margin, flush,
                                  scratch)
        if count == 0 and deepest >= -flush:
            # M lies above that face, and not over it.
            return 0
        kept = 0
        for p in range(count):
            x = (scratch.points[p, 0], scratch.points[p, 1], scratch.points[p, 2])
            d = scratch.points[p, 3]
            # The point is on A, and so on M where that is A.
            on_S = x if side == 0 else add_scaled(x, -d, n)
            on_M = x if side == 1 else add_scaled(x, d, n)
            if (stands(shapes, memory, rows, m, k, side, on_S, n, 0.0)
                    and stands(shapes, memory, rows, s, k, 1 - side, on_M, back, 0.0)):
                put(scratch.points, scratch.ids, kept, x, d, scratch.ids[p])
                kept += 1
        if kept > 0:
            _write(memory, shapes, rows, k, n if side == 0 else back, kept, scratch)
            return kept
    return 0


@kernel
def _reach(pose: Array, shapes: Shapes, s: int, n: Vector) -> float:
    hulls = shapes.hulls
    return reach(pose, shapes.kind, shapes.size, hulls.first, hulls.count, hulls.vertices,
                 shapes.hull, s, n)


@kernel
def _points_along(pose: Array, shapes: Shapes, s: int, m: int, side: int, f: int, n: Vector,
                  gap: float, margin: float, flush: float, scratch: Scratch) -> int:
    """Find the points of S and M along the normal n of face f of S; return their number."""
    a, b = (s, m) if side == 0 else (m, s)
    n_AB = n if side == 0 else scale(-1.0, n)
    if FAMILY[shapes.kind[a], shapes.kind[b]] == BOXES:
        return face_manifold(pose, shapes.size, a, b, f // 2 if side == 0 else 3 + f // 2, n_AB,
                             margin, scratch.points, scratch.ids, scratch.polygon, scratch.labels,
                             scratch.numbers)
    hulls, down = shapes.hulls, scale(-1.0, n)
    q = add_scaled(extreme(pose, shapes.kind, shapes.size, hulls.first, hulls.count,
                           hulls.vertices, shapes.hull, m, down),
                   radius(shapes.kind, shapes.size, m), down)
    on_S = add_scaled(q, -gap, n)
    nearest = gap if height(pose, shapes, s, on_S) <= flush else math.inf
    return manifold_along(pose, shapes, a, b, n_AB, nearest, on_S if side == 0 else q, margin,
                          scratch)


@kernel
def _write(memory: Memory, shapes: Shapes, rows: Manifolds, k: int, n: Vector, count: int,
           scratch: Scratch) -> None:
    """Write the points in `scratch` to row k, with the normal n from A to B."""
    A = centre(memory.pose, memory.turn, shapes, rows.shape_a[k] & INDEX)
    B = centre(memory.pose, memory.turn, shapes, rows.shape_b[k] & INDEX)
    for p in range(count):
        gap = scratch.points[p, 3]
        rows.gap[p, k], rows.feature[p, k] = gap, scratch.ids[p]
        for c in range(3):
            rows.r_A[p, k, c] = scratch.points[p, c] - A[c]
            rows.r_B[p, k, c] = scratch.points[p, c] + gap * n[c] - B[c]
    for c in range(3):
        rows.normal[k, c] = n[c]
