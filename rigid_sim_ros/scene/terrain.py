# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Surfaces that need not be convex, of bodies that nothing pushes: heightfields, and meshes as such.

Each of their triangles collides as a prism, a convex shape of its own. Of a heightfield that is a
column down to below the lowest place, so that it is solid; of a mesh a thin sheet behind the
triangle.
"""

from io import BytesIO
from pathlib import Path
from typing import Any
import warnings

import numpy as np

from rigid_sim_ros.engine.model.hulls import Prisms, prisms
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.reading import bytes_of
from rigid_sim_ros.scene.mesh import check, Mesh

FORMATS = ('.csv', '.npy', '.png')
# Of a heightfield: each is the corner of up to six triangles.
MOST_HEIGHTS = 100_000
# [bytes] Of a file of heights: 32 for each.
_MOST_BYTES = 32 * MOST_HEIGHTS
# Triangles of a mesh that is not convex.
MOST_TRIANGLES = 200_000
# How thick the sheet behind a triangle is, a part of its longest edge: far above what a body sinks
# in, and so thin that it does not come out on the other side of a wall.
_THICKNESS = 1e-2
# A triangle that is narrower than this part of its longest edge carries nothing and has no normal.
_NARROW = 1e-6


def read_heights(path: Path) -> Array:
    """
    Return the heights (rows along y, columns along x) of a file.

    Numbers between commas (.csv) or a NumPy array (.npy), their first row at the least y; or a
    grey picture (.png) of shares from 0, black, to 1, its top row at the greatest y. Raises
    ValueError if the file is missing or is none of these.
    """
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise ValueError(f'{path}, must be a CSV, NPY or PNG file')
    try:
        data = BytesIO(bytes_of(path, _MOST_BYTES))
        if kind == '.png':
            return _picture(data)
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')     # NumPy's, of a file without a number
            found: Any = (np.load(data, allow_pickle=False) if kind == '.npy'
                          else np.loadtxt(data, delimiter=',', ndmin=2))
        return np.asarray(found, dtype=np.float64)
    except ImportError:
        raise ValueError(f'{path.name} needs Pillow, which is not installed: '
                         '`pip install pillow`, or write the heights as CSV') from None
    except OSError as error:
        raise ValueError(f'{path} cannot be read: {error.strerror or error}') from None
    except Exception as error:  # Whatever a parser meets in a damaged file.
        raise ValueError(f'{path} holds no heights that can be read '
                         f'({type(error).__name__})') from None


def _picture(data: BytesIO) -> Array:
    from PIL import Image, UnidentifiedImageError

    try:
        opened = Image.open(data, formats=['PNG'])
    except UnidentifiedImageError:
        raise OSError('not a PNG picture, must be one') from None
    with opened as picture:
        width, height = picture.size
        if width * height > MOST_HEIGHTS:   # before the picture is unpacked
            raise OSError(f'{width} x {height} heights, must be {MOST_HEIGHTS} or fewer')
        deep = picture.mode.startswith('I')
        grey = np.asarray(picture if deep else picture.convert('L'), dtype=np.float64)
    return np.flipud(grey) / (65535.0 if deep else 255.0)


def check_heights(heights: Array) -> None:
    """Raise ValueError for heights that make no surface."""
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise ValueError(f'heights of the shape {heights.shape}, must be two rows of two or more')
    if heights.size > MOST_HEIGHTS:
        raise ValueError(f'{heights.size} heights, must be {MOST_HEIGHTS} or fewer')
    if not np.isfinite(heights).all():
        raise ValueError('a height is not finite, must be numbers')


def grid_surface(heights: Array, size: tuple[float, float]) -> tuple[Array, IntArray]:
    """
    Return vertices (v, 3) [m] and triangles (t, 3) of a heightfield of a size (x, y) [m].

    The rectangle lies about the origin; each of its cells is two triangles, divided from the
    corner with the least x and y.
    """
    rows, columns = heights.shape
    y, x = np.meshgrid(np.linspace(-0.5, 0.5, rows) * size[1],
                       np.linspace(-0.5, 0.5, columns) * size[0], indexing='ij')
    vertices = np.stack([x, y, heights], axis=2).reshape(-1, 3)
    corner = (columns * np.arange(rows - 1)[:, None] + np.arange(columns - 1)).reshape(-1, 1)
    near = corner + np.array([0, 1, columns + 1])
    far = corner + np.array([0, columns + 1, columns])
    return vertices, np.stack([near, far], axis=1).reshape(-1, 3)


def columns(heights: Array, size: tuple[float, float]) -> Prisms:
    """
    Return what a heightfield collides as: columns from its triangles down.

    They end below the lowest place, by the longest edge of a cell, so that no column is flat.
    """
    vertices, faces = grid_surface(heights, size)
    cell = max(size[0] / (heights.shape[1] - 1), size[1] / (heights.shape[0] - 1))
    upper = vertices[faces]
    lower = upper.copy()
    lower[:, :, 2] = heights.min() - cell
    return prisms(upper, lower)


def sheets(vertices: Array, faces: IntArray) -> Prisms:
    """Return what triangles collide as: sheets behind them. What has no area is left out."""
    corners, normals, longest = _with_area(vertices, faces)
    depth = _THICKNESS * longest / np.linalg.norm(normals, axis=1)
    return prisms(corners, corners - (depth[:, None] * normals)[:, None, :])


def _with_area(vertices: Array, faces: IntArray) -> tuple[Array, Array, Array]:
    """Return corners (t, 3, 3), doubled areas as vectors, and longest edges of triangles."""
    corners = vertices[faces]
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    normals = np.cross(edges[:, 0], edges[:, 1])
    wide = np.linalg.norm(normals, axis=1) > _NARROW * longest * longest
    return corners[wide], normals[wide], longest[wide]


def check_triangles(surface: Mesh) -> None:
    """Raise ValueError for triangles that make no surface, open or closed."""
    check(surface)
    vertices, faces = surface
    if len(faces) == 0 or len(_with_area(vertices, faces[:MOST_TRIANGLES])[0]) == 0:
        raise ValueError('the mesh has no triangle with an area, must have one')
    if len(faces) > MOST_TRIANGLES:
        raise ValueError(f'the mesh has {len(faces)} triangles, must have {MOST_TRIANGLES} or '
                         'fewer where it is not convex')
