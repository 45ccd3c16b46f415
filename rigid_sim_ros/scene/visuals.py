# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What bodies are drawn with that is no solid of theirs: surfaces from files, made small.

Nothing of it takes part in the motion. A scene holds it, so that a page or a film needs no file
beside the scene; so it must not be much larger than the rest.
"""

from collections.abc import Iterator, Sequence
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.scene import mesh, schema

# Triangles of all surfaces of a model together. Robots come with ten times as many; without a
# graphics card a thousand take a millisecond of each picture.
MOST_FACES = 30_000
# What each file may have of these at least, or a small part beside a large one would have none.
_LEAST_FACES = 100
# Colours that a file may bring; what has another one takes that of the last.
_MOST_COLORS = 16
# From one attempt to the next the cells of the lattice grow by this.
_COARSER = 1.2
# Eigenvalues below this part of the largest say nothing of where a corner is.
_FLAT = 1e-2
# Digits after the first of the extent: a hundredth of a millimetre of a link of half a metre.
_DIGITS = 4


class Drawn(NamedTuple):
    """A surface of one colour, open or closed."""

    vertices: Array     # (v, 3) [m]
    faces: IntArray     # (f, 3)
    color: tuple[float, ...] | None     # red, green, blue, alpha, 0 to 1; None: that of the body


class Source(NamedTuple):
    """What a file shows, as it is."""

    vertices: Array     # (v, 3) [m]
    faces: IntArray     # (f, 3)
    group: IntArray     # (f,) which colour
    colors: Sequence[tuple[float, ...] | None]


def read(path: Path, scale: Sequence[float]) -> Source:
    """Return what a file shows; ValueError if it is no mesh, or not one of finite numbers."""
    pieces = mesh.read_colored(path)
    colors = list(dict.fromkeys(color for _, color in pieces))
    place = {color: min(k, _MOST_COLORS - 1) for k, color in enumerate(colors)}
    first = np.cumsum([0, *(len(piece.vertices) for piece, _ in pieces)])
    vertices = np.concatenate([piece.vertices for piece, _ in pieces]) * np.asarray(scale)
    faces = np.concatenate([piece.faces + start for (piece, _), start in zip(
        pieces, first[:-1], strict=True)])
    group = np.repeat([place[color] for _, color in pieces],
                      [len(piece.faces) for piece, _ in pieces])
    if np.prod(scale) < 0.0:
        faces = faces[:, ::-1]      # mirrored: what was outside stays outside
    if not np.isfinite(vertices).all():
        raise ValueError(f'{path} has a vertex that is not finite, must be numbers')
    return Source(vertices, faces, group, colors)


def shares(sources: Sequence[Source], uses: Sequence[int], most: int = MOST_FACES) -> list[int]:
    """
    Return how many triangles each of some surfaces may have, each of which is used some times.

    Large ones get more of them, and what a surface does not need is left to the others.
    """
    size = np.array([np.ptp(source.vertices, axis=0).max() for source in sources])
    wanted, times = np.array([len(source.faces) for source in sources]), np.array(uses)
    share, waits, left = wanted.copy(), np.ones(len(sources), bool), float(most)
    while waits.any():
        offered = left * size / max(float((size * times)[waits].sum()), 1e-300)
        fits = waits & (wanted <= offered)
        if not fits.any():
            share[waits] = np.minimum(wanted, np.maximum(offered, _LEAST_FACES))[waits]
            break
        left -= float((wanted * times)[fits].sum())
        waits &= ~fits
    return [int(one) for one in share]


def drawn(source: Source, most: int) -> list[Drawn]:
    """Return what is drawn of a surface, with no more than about `most` triangles."""
    small = few(source.vertices, source.faces, source.group, most)
    return [Drawn(*piece, source.colors[k]) for k, piece in _split(*small)]


def few(vertices: Array, faces: IntArray, group: IntArray, most: int,
        ) -> tuple[Array, IntArray, IntArray]:
    """
    Return a surface with no more than `most` triangles, or few more; groups (f,) stay apart.

    Corners in one cell of a lattice become one, where the planes of the triangles about them meet
    as well as they can (Lindstrom, Out-of-core simplification of large polygonal models, SIGGRAPH
    2000). Numbers are rounded to what can be seen.
    """
    low, extent = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max())
    # So small that nothing but what is at the same place falls together.
    cell = max(extent, 1e-9) * 1e-5
    corner = _corners(vertices, faces, group, low, cell)
    if len(kept := _real(corner)) > most:
        cell = extent / math.sqrt(most)
        while len(kept := _real(corner := _corners(vertices, faces, group, low, cell))) > most:
            cell *= _COARSER
    _, first = np.unique(np.sort(corner[kept], axis=1), axis=0, return_index=True)
    kept = kept[np.sort(first)]     # each triangle once
    points = _places(vertices, faces, corner, cell)
    digits = _DIGITS - math.floor(math.log10(max(extent, 1e-9)))
    used, corners = np.unique(corner[kept], return_inverse=True)
    return np.round(points[used], digits), corners.reshape(-1, 3), group[kept]


def _corners(vertices: Array, faces: IntArray, group: IntArray, low: Array,
             cell: float) -> IntArray:
    """Return the number (f, 3) of the place in which each corner of a triangle falls."""
    x, y, z = np.floor((vertices - low) / cell).astype(np.int64).T
    # No more than 1e5 cells along an axis: this is one number, below 2^63.
    number = (x << 34) + (y << 17) + z
    _, corner = np.unique(number[faces] + (group[:, None] << 51), return_inverse=True)
    return np.asarray(corner.reshape(-1, 3))


def _real(corner: IntArray) -> IntArray:
    """Return the triangles that keep three different corners."""
    a, b, c = corner.T
    return np.flatnonzero((a != b) & (b != c) & (c != a))


def _places(vertices: Array, faces: IntArray, corner: IntArray, cell: float) -> Array:
    """
    Return where the corners are, (p, 3): least squares of the distances from their planes.

    With unit normals n of triangles of area a through points r the sum of a (n . (x - m) - n . (r
    - m))^2 is least where A (x - m) = b, A = sum of a n n^T, b = sum of a n n . (r - m). Where the
    planes leave it open, x stays at m, the mean of what falls together.
    """
    count, flat = int(corner.max()) + 1, corner.ravel()
    weight = np.bincount(flat, minlength=count)
    mean = np.column_stack([np.bincount(flat, x, count) / np.maximum(weight, 1)
                            for x in vertices[faces.ravel()].T])
    p, q, r = np.moveaxis(vertices[faces], 1, 0)
    normal = np.cross(q - p, r - p)
    area = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(area, 1e-300)[:, None]
    n, a = np.repeat(normal, 3, axis=0), np.repeat(area, 3)
    off = np.einsum('ci,ci->c', n, np.repeat(p, 3, axis=0) - mean[flat])
    A = np.stack([np.bincount(flat, a * n[:, i] * n[:, j], count)
                  for i in range(3) for j in range(3)], axis=1).reshape(-1, 3, 3)
    b = np.column_stack([np.bincount(flat, a * off * n[:, i], count) for i in range(3)])
    size, way = np.linalg.eigh(A)
    is_sure = size > _FLAT * np.maximum(size[:, -1:], 1e-300)
    along = np.einsum('cij,ci->cj', way, b) / np.where(is_sure, size, 1.0)
    step = np.einsum('cij,cj->ci', way, np.where(is_sure, along, 0.0))
    step[np.abs(step).max(axis=1) > cell] = 0.0
    return np.asarray(mean + step)


def _split(vertices: Array, faces: IntArray, group: IntArray,
           ) -> Iterator[tuple[int, tuple[Array, IntArray]]]:
    """Yield each group of triangles with the corners that it has."""
    for k in np.unique(group).tolist():
        used, own = np.unique(faces[group == k], return_inverse=True)
        yield k, (vertices[used], own.reshape(-1, 3))


def words(drawn: Drawn, pose: Any, color: tuple[float, ...] | None) -> dict[str, Any]:
    """Return a surface in the words of a scene; `color` takes the place of its own."""
    own = color or drawn.color
    shape = {'type': 'mesh', 'vertices': drawn.vertices.tolist(), 'faces': drawn.faces.tolist(),
             'pose': pose}
    return {'shape': shape, **({} if own is None else {'color': list(own)})}


def without_visuals(spec: schema.Scene) -> schema.Scene:
    """Return a scene with nothing that is only drawn: two with the same rest move alike."""
    if all(body.visuals is None for body in spec.bodies):
        return spec
    return spec.model_copy(update={'bodies': tuple(
        body.model_copy(update={'visuals': None}) for body in spec.bodies)})
