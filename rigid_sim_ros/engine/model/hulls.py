# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Convex polyhedra: their vertices, and their faces as polygons.

A mesh comes as triangles. Triangles of one plane are merged into one polygon here, once, because a
contact on a flat face needs the outline of the whole face.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.kernels.arrays import Array, IntArray

# Two triangles belong to one face, and a vertex lies in a plane, within this fraction of the size.
FLATNESS = 1e-9
_FLAT = 1e3 * FLATNESS  # a triangle is a part of a face that is flat within this fraction
_DENT = 1e-6  # a mesh whose vertices rise over a face by a larger fraction is not convex
MAX_CORNERS = 32  # corners of a face that a contact takes up; more are left out evenly


class Polyhedron(NamedTuple):
    """A closed convex mesh; the triangles run anticlockwise seen from outside."""

    vertices: Array  # (v, 3) [m]
    triangles: IntArray  # (t, 3) rows of the vertices


class Prisms(NamedTuple):
    """
    Triangles with depth, t of them: each collides as one piece of a surface.

    The surface need not be convex.
    """

    vertices: Array  # (t, 6, 3) [m] the triangles, anticlockwise from outside, and below them
    normals: Array  # (t, 5, 3) outward, of unit length, of `PRISM_FACES`
    offsets: Array  # (t, 5) [m] normal . x on the face
    half_width: Array  # (t,) [m] half of the least that each measures across


# Upper side, lower side, and those below the edges of the triangle.
PRISM_FACES = ((0, 1, 2), (5, 4, 3), (3, 4, 1, 0), (4, 5, 2, 1), (5, 3, 0, 2))


class HullTable(NamedTuple):
    """Vertices and faces of all hulls, one after the other."""

    first: IntArray  # (k,) first vertex of a hull
    count: IntArray  # type: ignore[assignment]  # (k,) number of its vertices
    vertices: Array  # (v, 3) [m] in the frame S of the shape
    first_face: IntArray  # (k,)
    face_count: IntArray  # (k,)
    normals: Array  # (f, 3) outward, of unit length
    offsets: Array  # (f,) [m] normal . x on the face
    first_corner: IntArray  # (f,)
    corner_count: IntArray  # (f,)
    corners: IntArray  # rows of `vertices`, anticlockwise seen from outside


class HullError(ValueError):
    """What is wrong with a mesh, and which one it is."""

    def __init__(self, index: int, message: str) -> None:
        """Keep its place among the meshes."""
        super().__init__(message)
        self.index = index


def bare_hulls() -> HullTable:
    """Return the table of a world without hulls: one unused row, so that no array is empty."""
    one = np.zeros(1, dtype=np.int64)
    return HullTable(one, one.copy(), np.zeros((1, 3)), one.copy(), one.copy(), np.zeros((1, 3)),
                     np.zeros(1), one.copy(), one.copy(), one.copy())


class _Faces(NamedTuple):
    """Polyhedra one after the other, as `HullTable` has them."""

    vertex_counts: IntArray  # (k,)
    vertices: Array  # (v, 3) [m]
    face_counts: IntArray  # (k,)
    normals: Array  # (f, 3)
    offsets: Array  # (f,) [m]
    corner_counts: IntArray  # (f,)
    corners: IntArray  # of each face, as vertices of its polyhedron


def prisms(upper: Array, lower: Array) -> Prisms:
    """
    Return the prisms between triangles (t, 3, 3) and those with the corners below theirs [m].

    The two lie so that the quadrilaterals between them are flat: below is one direction, or all of
    `lower` is at one height.
    """
    edges = np.roll(upper, -1, axis=1) - upper
    crosses = np.stack([
        np.cross(edges[:, 0], edges[:, 1]),
        -np.cross(np.roll(lower, -1, axis=1)[:, 0] - lower[:, 0], lower[:, 2] - lower[:, 1]),
        *np.moveaxis(np.cross(lower - upper, edges), 1, 0)], axis=1)
    normals = crosses / np.linalg.norm(crosses, axis=2)[:, :, None]
    vertices = np.concatenate([upper, lower], axis=1)
    offsets = np.stack([np.einsum('tvi,ti->tv', vertices[:, face], normals[:, k]).max(axis=1)
                        for k, face in enumerate(PRISM_FACES)], axis=1)
    # A prism is thinnest across one of its faces or, what is no less than half of that, two edges.
    across = offsets - np.einsum('tvi,tki->tkv', vertices, normals).min(axis=2)
    return Prisms(vertices, normals, offsets, 0.5 * across.min(axis=1))


def count_pieces(hull: Polyhedron | Prisms | None) -> int:
    """Return how many convex pieces one shape of a body is."""
    return len(hull.vertices) if isinstance(hull, Prisms) else 1


def make_hulls(hulls: Sequence[Polyhedron | Prisms | None],
               ) -> tuple[HullTable, IntArray, Array, Array]:
    """
    Return the table, the row of each piece (-1 for None), its centre and its half extents [m].

    A hull has one piece, or each of its prisms is one. The table's vertices are relative to the
    centre of the bounding box of their piece. A mesh that occurs twice is kept once. HullError,
    with the number of the hull, for a mesh that is not convex, not closed or flat.
    """
    pieces = sum(map(count_pieces, hulls))
    rows = np.full(pieces, -1, dtype=np.int64)
    centres, extents = np.zeros((pieces, 3)), np.zeros((pieces, 3))
    parts: list[_Faces] = []
    seen: dict[bytes, int] = {}
    known = end = 0     # rows of the table, and pieces, so far
    for i, hull in enumerate(hulls):
        at, end = end, end + count_pieces(hull)
        if hull is None:
            continue
        vertices = np.asarray(hull.vertices, dtype=np.float64).reshape(end - at, -1, 3)
        low, high = vertices.min(axis=1), vertices.max(axis=1)
        centres[at:end], extents[at:end] = 0.5 * (low + high), 0.5 * (high - low)
        local = np.ascontiguousarray(vertices - centres[at:end, None])
        if isinstance(hull, Prisms):
            rows[at:end] = np.arange(known, known + end - at)
            parts.append(_faces_of_prisms(local, hull, centres[at:end]))
            known += end - at
            continue
        triangles = np.ascontiguousarray(hull.triangles, dtype=np.int64)
        rows[at] = seen.setdefault(local.tobytes() + triangles.tobytes(), known)
        if rows[at] == known:
            try:
                parts.append(_faces_of_mesh(local[0], triangles))
            except ValueError as error:
                raise HullError(i, str(error)) from None
            known += 1
    return _table(parts), rows, centres, extents


def _faces_of_prisms(local: Array, prism: Prisms, centres: Array) -> _Faces:
    """Return prisms whose vertices (t, 6, 3) are relative to their centres (t, 3) [m]."""
    t, sizes = len(local), [len(face) for face in PRISM_FACES]
    offsets = prism.offsets - (prism.normals @ centres[:, :, None])[:, :, 0]
    corners = np.array([corner for face in PRISM_FACES for corner in face], dtype=np.int64)
    return _Faces(np.full(t, local.shape[1]), local.reshape(-1, 3), np.full(t, len(sizes)),
                  prism.normals.reshape(-1, 3), offsets.reshape(-1), np.tile(sizes, t),
                  np.tile(corners, t))


def _faces_of_mesh(vertices: Array, triangles: IntArray) -> _Faces:
    faces, normals, offsets = polygons(vertices, triangles)
    return _Faces(np.array([len(vertices)]), vertices, np.array([len(faces)]), normals, offsets,
                  np.array([len(face) for face in faces]),
                  np.array([corner for face in faces for corner in face]))


def _table(parts: Sequence[_Faces]) -> HullTable:
    none = np.zeros(0, dtype=np.int64)
    empty = _Faces(none, np.zeros((0, 3)), none, np.zeros((0, 3)), np.zeros(0), none, none)
    all_of = _Faces(*map(np.concatenate, zip(empty, *parts, strict=True)))
    first, first_face, first_corner = (
        np.cumsum(counts) - counts
        for counts in (all_of.vertex_counts, all_of.face_counts, all_of.corner_counts))
    own = np.repeat(np.repeat(first, all_of.face_counts), all_of.corner_counts)
    return HullTable(first, all_of.vertex_counts, all_of.vertices, first_face, all_of.face_counts,
                     all_of.normals, all_of.offsets, first_corner, all_of.corner_counts,
                     own + all_of.corners)


def polygons(vertices: Array, triangles: IntArray) -> tuple[list[list[int]], Array, Array]:
    """
    Merge the triangles of a closed convex mesh into faces.

    Their corners, outward unit normals and offsets [m] are returned. ValueError when the surface
    rises beside a face by more than the flatness, an edge is not shared by two triangles, or all
    of them lie in one plane.
    """
    size = float(np.abs(vertices).max())
    legs = vertices[triangles[:, 1:]] - vertices[triangles[:, :1]]
    areas = np.cross(legs[:, 0], legs[:, 1])
    doubled = np.linalg.norm(areas, axis=1)
    has_area = doubled > (FLATNESS * size) ** 2
    if not has_area.any():
        raise ValueError('the mesh has no area')
    unit = areas / np.where(has_area, doubled, 1.0)[:, None]
    neighbour = _neighbours(triangles, len(vertices))
    lone = has_area & _stands_alone(vertices, triangles, unit, neighbour, size)
    first = np.argmin(triangles, axis=1)[:, None]
    alone = np.take_along_axis(triangles, (first + np.arange(3)) % 3, axis=1).tolist()
    surface = _Surface(vertices.tolist(), triangles.tolist(), neighbour.tolist(), size)
    heights = np.einsum('tci,ti->tc', vertices[triangles], unit).max(axis=1).tolist()
    is_taken = (~has_area).tolist()
    faces, seeds, offsets = [], [], []
    # From the largest triangle on: its normal is the most certain one of its face.
    for seed in np.argsort(-doubled, kind='stable').tolist():
        if is_taken[seed]:
            continue
        seeds.append(seed)
        if lone[seed]:
            faces.append(alone[seed])
            offsets.append(heights[seed])
            continue
        face, highest = _grow(seed, unit[seed].tolist(), heights[seed], surface)
        if len(face) == len(triangles):
            thick = highest - float((vertices @ unit[seed]).min())
            raise ValueError(
                f'the mesh is {thick:.3g} m thick and {2.0 * size:.3g} m long, must be at least '
                f'{_FLAT:g} of its length thick, or collides: false')
        for t in face:
            is_taken[t] = True
        faces.append(_outline(face, surface))
        offsets.append(highest)
    return faces, unit[seeds], np.array(offsets)


class _Surface(NamedTuple):
    """A mesh as lists: NumPy takes a microsecond for each corner."""

    points: list[list[float]]
    triangles: list[list[int]]
    neighbour: list[list[int]]  # of each triangle, across its edges (0, 1), (1, 2) and (2, 0)
    size: float  # [m]


def _neighbours(triangles: IntArray, count: int) -> IntArray:
    """Return (t, 3): the triangle beyond each edge, from corner k to the next, of `count` ones."""
    tail, head = triangles.reshape(-1), np.roll(triangles, -1, axis=1).reshape(-1)
    edges = tail * count + head     # one number for each direction
    order = np.argsort(edges, kind='stable')
    ranked = edges[order]
    if (twice := np.flatnonzero(ranked[1:] == ranked[:-1])).size:
        raise ValueError('the mesh has two triangles on the same side of edge '
                         f'{divmod(int(ranked[twice[0]]), count)}')
    place = np.minimum(np.searchsorted(ranked, head * count + tail), len(ranked) - 1)
    if (alone := np.flatnonzero(ranked[place] != head * count + tail)).size:
        edge = int(tail[alone[0]]), int(head[alone[0]])
        raise ValueError(f'the mesh is not closed at edge {edge}')
    return (order[place] // 3).reshape(-1, 3)


def _stands_alone(vertices: Array, triangles: IntArray, unit: Array, neighbour: IntArray,
                  size: float) -> Array:
    """Return (t,) whether the surface bends down at all edges of a triangle: it is a face."""
    bends = np.ones(len(triangles), dtype=bool)
    for k in range(3):
        # Seen from either side, for the normal of a small triangle is none to go by.
        for a, b in ((np.arange(len(triangles)), neighbour[:, k]),
                     (neighbour[:, k], np.arange(len(triangles)))):
            height = np.einsum('tci,ti->tc', vertices[triangles[b]], unit[a])
            own = np.einsum('tci,ti->tc', vertices[triangles[a]], unit[a]).max(axis=1)
            bends &= own - height.min(axis=1) >= _FLAT * size
            bends &= height.max(axis=1) - own <= _DENT * size
    return bends


def _grow(seed: int, normal: list[float], offset: float,
          surface: _Surface) -> tuple[set[int], float]:
    """
    Return the triangles that hang together with `seed` and are flat, and how high one reaches [m].

    ValueError where the surface goes up beside them.
    """
    x, y, z = normal
    points, triangles, neighbour, size = surface
    lowest, highest = offset - _FLAT * size, offset
    face, front = {seed}, [seed]
    while front:
        for t in neighbour[front.pop()]:
            if t in face:
                continue
            heights = [x * p + y * q + z * r
                       for p, q, r in map(points.__getitem__, triangles[t])]
            highest = max(highest, *heights)
            if min(heights) > lowest:
                face.add(t)
                front.append(t)
    if highest - offset > _DENT * size:
        raise ValueError(f'the mesh is not convex: a vertex lies {highest - offset:.3g} m outside '
                         'of a face')
    return face, highest


def _outline(face: set[int], surface: _Surface) -> list[int]:
    """Return the corners around a face: the edges whose other side is no part of it."""
    following = {}
    for t in face:
        a, b, c = surface.triangles[t]
        for (start, end), other in zip(((a, b), (b, c), (c, a)), surface.neighbour[t],
                                       strict=True):
            if other not in face:
                following[start] = end
    corners = [min(following)]
    while (corner := following[corners[-1]]) != corners[0]:
        corners.append(corner)
    step = -(-len(corners) // MAX_CORNERS)
    return corners[::step]
