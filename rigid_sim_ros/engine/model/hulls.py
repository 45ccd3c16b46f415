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
MAX_CORNERS = 32  # corners of a face that a contact takes up; more are left out evenly


class Polyhedron(NamedTuple):
    """A closed convex mesh; the triangles run anticlockwise seen from outside."""

    vertices: Array  # (v, 3) [m]
    triangles: IntArray  # (t, 3) rows of the vertices


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


def make_hulls(hulls: Sequence[Polyhedron | None]) -> tuple[HullTable, IntArray, Array, Array]:
    """
    Return the table, the row of each hull (-1 for None), its centre and its half extents [m].

    The table's vertices are relative to the centre of the hull's bounding box. A mesh that occurs
    twice is kept once. HullError, with the number, for a mesh that is not convex, not closed or
    flat.
    """
    rows = np.full(len(hulls), -1, dtype=np.int64)
    centres, extents = np.zeros((len(hulls), 3)), np.zeros((len(hulls), 3))
    parts: list[tuple[Array, list[list[int]], Array, Array]] = []
    seen: dict[bytes, int] = {}
    for i, hull in enumerate(hulls):
        if hull is None:
            continue
        vertices = np.asarray(hull.vertices, dtype=np.float64)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        centres[i], extents[i] = 0.5 * (low + high), 0.5 * (high - low)
        local = np.ascontiguousarray(vertices - centres[i])
        triangles = np.ascontiguousarray(hull.triangles, dtype=np.int64)
        rows[i] = seen.setdefault(local.tobytes() + triangles.tobytes(), len(parts))
        if rows[i] == len(parts):
            try:
                parts.append((local, *polygons(local, triangles)))
            except ValueError as error:
                raise HullError(i, str(error)) from None
    return _table(parts), rows, centres, extents


def _table(parts: Sequence[tuple[Array, list[list[int]], Array, Array]]) -> HullTable:
    def starts(counts: Sequence[int]) -> IntArray:
        return np.array([sum(counts[:i]) for i in range(len(counts))], dtype=np.int64)

    vertex_counts = [len(part[0]) for part in parts]
    face_counts = [len(part[1]) for part in parts]
    first = starts(vertex_counts)
    faces = [[int(first[k]) + corner for corner in face]
             for k, part in enumerate(parts) for face in part[1]]
    sizes = [len(face) for face in faces]
    ends = np.cumsum([0, *sizes])
    return HullTable(first, np.array(vertex_counts, dtype=np.int64),
                     np.concatenate([np.zeros((0, 3)), *(part[0] for part in parts)]),
                     starts(face_counts), np.array(face_counts, dtype=np.int64),
                     np.concatenate([np.zeros((0, 3)), *(part[2] for part in parts)]),
                     np.concatenate([np.zeros(0), *(part[3] for part in parts)]),
                     ends[:-1].astype(np.int64), np.array(sizes, dtype=np.int64),
                     np.array([corner for face in faces for corner in face], dtype=np.int64))


def polygons(vertices: Array, triangles: IntArray) -> tuple[list[list[int]], Array, Array]:
    """
    Merge the triangles of a closed convex mesh into faces.

    Their corners, outward unit normals and offsets [m] are returned. ValueError when a vertex lies
    outside of a face by more than the flatness, an edge is not shared by two triangles, or all of
    them lie in one plane.
    """
    size = float(np.abs(vertices).max())
    legs = vertices[triangles[:, 1:]] - vertices[triangles[:, :1]]
    areas = np.cross(legs[:, 0], legs[:, 1])
    doubled = np.linalg.norm(areas, axis=1)
    corners = triangles.tolist()    # lists: NumPy takes a microsecond for each corner
    neighbour = _edges(corners)
    left = {int(t) for t in np.flatnonzero(doubled > (FLATNESS * size) ** 2)}
    if not left:
        raise ValueError('the mesh has no area')
    faces, normals, offsets = [], [], []
    # From the largest triangle on: its normal is the most certain one of its face.
    for seed in np.argsort(-doubled, kind='stable'):
        if int(seed) not in left:
            continue
        normal = areas[seed] / doubled[seed]
        height = vertices @ normal
        offset = float(height[triangles[seed]].max())
        if (excess := float(height.max()) - offset) > 1e-6 * size:
            raise ValueError(
                f'the mesh is not convex: a vertex lies {excess:.3g} m outside of a face')
        flat = offset - height < 1e3 * FLATNESS * size
        face = _grow(int(seed), corners, neighbour, flat[triangles].all(axis=1))
        if len(face) == len(triangles):
            raise ValueError(
                f'the mesh is {offset - float(height.min()):.3g} m thick and {2.0 * size:.3g} m '
                f'long, must be at least {1e3 * FLATNESS:g} of its length thick, or '
                'collides: false')
        left -= face
        faces.append(_outline(face, corners, neighbour))
        normals.append(normal)
        offsets.append(float(height.max()))
    return faces, np.array(normals), np.array(offsets)


def _edges(triangles: list[list[int]]) -> dict[tuple[int, int], int]:
    """Return the triangle on the left of each directed edge."""
    edges: dict[tuple[int, int], int] = {}
    for t, (a, b, c) in enumerate(triangles):
        for edge in ((a, b), (b, c), (c, a)):
            if edge in edges:
                raise ValueError(f'the mesh has two triangles on the same side of edge {edge}')
            edges[edge] = t
    for a, b in edges:
        if (b, a) not in edges:
            raise ValueError(f'the mesh is not closed at edge {(a, b)}')
    return edges


def _grow(seed: int, triangles: list[list[int]], neighbour: dict[tuple[int, int], int],
          flat: Array) -> set[int]:
    """Return the triangles that hang together with `seed` and are flat."""
    face, front = {seed}, [seed]
    while front:
        a, b, c = triangles[front.pop()]
        for edge in ((b, a), (c, b), (a, c)):
            t = neighbour[edge]
            if t not in face and flat[t]:
                face.add(t)
                front.append(t)
    return face


def _outline(face: set[int], triangles: list[list[int]],
             neighbour: dict[tuple[int, int], int]) -> list[int]:
    """Return the corners around a face: the edges whose other side is no part of it."""
    edges = [edge for t in sorted(face) for a, b, c in (triangles[t],)
             for edge in ((a, b), (b, c), (c, a))]
    following = {start: end for start, end in edges if neighbour[end, start] not in face}
    corners = [min(following)]
    while (corner := following[corners[-1]]) != corners[0]:
        corners.append(corner)
    step = -(-len(corners) // MAX_CORNERS)
    return corners[::step]
