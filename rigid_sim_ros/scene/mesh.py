# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Triangle meshes: read from a file, and refused unless they enclose a volume."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
import logging
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from rigid_sim_ros.engine.model.inertia import mesh_volume
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.reading import bytes_of
from rigid_sim_ros.scene.mesh_bounds import bounded, MOST_FACES

# What is read; the file says which by its name.
FORMATS = ('.obj', '.stl', '.dae', '.glb')

# A mesh that encloses less than this part of its bounding box is flat but for rounding: its volume
# is the difference of numbers 1e12 times as large, and no digit of the inertia would be right.
_FLAT = 1e-12


class Mesh(NamedTuple):
    """A surface of triangles, counterclockwise when seen from outside."""

    vertices: Array  # [m], shape (v, 3), in the frame of the shape
    faces: IntArray  # indices into vertices, shape (f, 3)


def read(path: Path) -> Mesh:
    """
    Read an OBJ, STL, DAE or GLB file.

    Corners at the same place become one vertex, as an STL file repeats them for each triangle;
    polygons become triangles. The unit of a DAE file counts, the axis that it calls the upper one
    does not: robots are written as RViz shows them. Raises ValueError if the file is missing or is
    not such a file.
    """
    return _read(path, _whole)


def read_colored(path: Path) -> list[tuple[Mesh, tuple[float, ...] | None]]:
    """
    Read such a file as pieces, each with red, green, blue and alpha of its material, or None.

    Raises ValueError as `read` does. Textures lie in other files, and are left out.
    """
    return _read(path, _pieces)


def _whole(trimesh: Any, data: bytes, kind: str) -> Mesh:
    """Return all triangles of a file."""
    mesh = trimesh.load(BytesIO(data), file_type=kind, force='mesh', skip_materials=True)
    vertices = np.asarray(getattr(mesh, 'vertices', ()), dtype=np.float64).reshape(-1, 3)
    if kind == 'dae':
        vertices = vertices * _unit(mesh.units)
    return Mesh(vertices, np.asarray(getattr(mesh, 'faces', ()), dtype=np.int64).reshape(-1, 3))


def _pieces(trimesh: Any, data: bytes, kind: str,
            ) -> list[tuple[Mesh, tuple[float, ...] | None]]:
    """Return the triangles of each part of a file, with its colour."""
    scene = trimesh.load(BytesIO(data), file_type=kind, force='scene')
    unit, found, count = _unit(scene.units) if kind == 'dae' else 1.0, [], 0
    for node in sorted(scene.graph.nodes_geometry):     # in the same order each time
        turn, name = scene.graph[node]
        part = scene.geometry[name]
        if isinstance(part, trimesh.Trimesh):
            vertices = trimesh.transform_points(part.vertices, turn) * unit
            # A part that is mirrored is turned inside out by it.
            faces = part.faces if np.linalg.det(turn[:3, :3]) > 0.0 else part.faces[:, ::-1]
            found.append((Mesh(vertices, np.asarray(faces, dtype=np.int64)), _color(part)))
            # A few lines may ask for the same part a million times.
            count += len(faces)
            if count > MOST_FACES:
                break
    return found


def _color(part: Any) -> tuple[float, ...] | None:
    """Return what most of a part looks like, None if it does not say."""
    visual = part.visual
    if not visual.defined:
        return None
    color = visual.material.main_color if visual.kind == 'texture' else visual.main_color
    return tuple(round(float(value) / 255.0, 3) for value in color)


_Found = TypeVar('_Found', Mesh, list[tuple[Mesh, tuple[float, ...] | None]])


def _read(path: Path, take: Callable[[Any, bytes, str], _Found]) -> _Found:
    """Return what is taken out of a file; ValueError if it is no mesh."""
    # SciPy comes with trimesh: 0.6 s that a scene without a mesh does not wait for.
    import trimesh

    if path.suffix.lower() not in FORMATS:
        raise ValueError(f'{path}, must be an OBJ, STL, DAE or GLB file')
    kind = path.suffix[1:].lower()
    try:
        data = bounded(bytes_of(path), kind)
        # From bytes, so that a file cannot make trimesh open the files it refers to.
        with _unlogged(trimesh.util.log):
            found = take(trimesh, data, kind)
    except OSError as error:
        raise ValueError(f'{path} cannot be read: {error.strerror}') from None
    except Exception as error:  # Whatever a parser meets in a damaged file.
        raise ValueError(f'{path} is not a mesh that can be read '
                         f'({type(error).__name__})') from None
    count = len(found.faces) if isinstance(found, Mesh) else sum(
        len(piece.faces) for piece, _ in found)
    if count == 0:
        raise ValueError(f'{path} has no triangles, must be a closed surface')
    if count > MOST_FACES:
        raise ValueError(f'{path} has {count} triangles, must have {MOST_FACES} or fewer')
    return found


@contextmanager
def _unlogged(log: logging.Logger) -> Iterator[None]:
    """
    Log nothing of a library meanwhile: what matters is raised, or missing in what it returns.

    Of textures, which are not read, trimesh logs the traceback.
    """
    before, log.disabled = log.disabled, True
    try:
        yield
    finally:
        log.disabled = before


def _unit(words: str | None) -> float:
    """Return the unit of length [m] that trimesh tells as `meters` or `0.01 * meters`."""
    factor, star, _ = (words or '').partition(' * ')
    return float(factor) if star else 1.0


def check(mesh: Mesh) -> None:
    """Raise ValueError for vertices that are no numbers, and faces of vertices that are not."""
    vertices, faces = mesh
    if not np.isfinite(vertices).all():
        raise ValueError('a vertex is not finite, must be numbers')
    if faces.max(initial=0) >= len(vertices):
        raise ValueError(f'a face has the vertex {faces.max()}, must be below {len(vertices)}')


def closed(mesh: Mesh) -> Mesh:
    """
    Return the mesh, turned outside out if need be; raises ValueError unless it encloses a volume.

    The triangles at an edge run along it in one direction or the other. On a closed and
    consistently wound surface both directions are as frequent, so an odd number of triangles means
    a hole.
    """
    check(mesh)
    vertices, faces = mesh
    # A triangle with a corner twice has no area; without it the edges match as before.
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    if len(faces) == 0:
        raise ValueError('the mesh has no triangles, must be a closed surface')
    tail, head = np.concatenate((faces[:, (0, 1)], faces[:, (1, 2)], faces[:, (2, 0)])).T
    edge = np.minimum(tail, head) * len(vertices) + np.maximum(tail, head)
    _, edge, triangles = np.unique(edge, return_inverse=True, return_counts=True)
    both_ways = np.bincount(edge, np.sign(head - tail)) == 0
    holes = np.count_nonzero(triangles % 2)
    if holes:
        raise ValueError(f'the mesh is open: {holes} of {len(triangles)} edges have a triangle '
                         'on one side only, must be a closed surface')
    if not both_ways.all():
        raise ValueError('the mesh is wound inconsistently: at '
                         f'{np.count_nonzero(~both_ways)} of {len(triangles)} edges the triangles '
                         'disagree about the outside, must have all corners counterclockwise')
    volume = mesh_volume(vertices, faces)
    box = float(np.prod(np.ptp(vertices[np.unique(faces)], axis=0)))
    if not abs(volume) > _FLAT * box:
        raise ValueError(f'the mesh encloses {volume:g} m^3, must be a volume')
    return Mesh(vertices, faces if volume > 0 else faces[:, ::-1])
