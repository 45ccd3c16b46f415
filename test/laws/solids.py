# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Solids of random shape: how a scene file writes them, what they weigh, how far they reach."""

from collections.abc import Callable, Sequence
import math
from typing import Any, NamedTuple

import numpy as np

Generator = np.random.Generator


class Solid(NamedTuple):
    """A solid about the origin of its body frame."""

    shape: dict[str, Any]  # as in a scene file
    volume: float  # [m^3]
    com: np.ndarray  # (3,) [m]
    inertia: np.ndarray  # (3, 3) [m^2] about the centre of mass, of 1 kg
    corners: np.ndarray  # (k, 3) [m]: the solid is the hull of these ...
    rounding: float = 0.0  # ... with a ball of this radius [m] around each
    disc: float | np.ndarray = 0.0  # ... or a disc of this radius [m], or these (k,), normal to z
    radii: np.ndarray | None = None  # ... or it is an ellipsoid of these radii (3,) [m]

    def reach(self, n: np.ndarray) -> float:
        """Return max n . p over the solid for a unit vector n in the body frame."""
        if self.radii is not None:
            return float(np.linalg.norm(self.radii * n))
        discs = self.disc * math.hypot(n[0], n[1])
        return float((self.corners @ n + discs).max() + self.rounding)

    @property
    def radius(self) -> float:
        """Return a bound of the distance of its points from the origin."""
        if self.radii is not None:
            return float(self.radii.max())
        return float((np.linalg.norm(self.corners, axis=1) + self.disc).max() + self.rounding)


def sphere(radius: float) -> Solid:
    """Return a ball."""
    return Solid({'type': 'sphere', 'radius': radius}, 4 / 3 * math.pi * radius ** 3, np.zeros(3),
                 0.4 * radius ** 2 * np.eye(3), np.zeros((1, 3)), rounding=radius)


def box(size: Sequence[float]) -> Solid:
    """Return a box of these full lengths."""
    a = np.asarray(size, dtype=float)
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return Solid({'type': 'box', 'size': a.tolist()}, float(a.prod()), np.zeros(3),
                 np.diag((a @ a - a * a) / 12), 0.5 * signs * a)


def cylinder(radius: float, length: float) -> Solid:
    """Return a cylinder about z."""
    across = radius ** 2 / 4 + length ** 2 / 12
    return Solid({'type': 'cylinder', 'radius': radius, 'length': length},
                 math.pi * radius ** 2 * length, np.zeros(3),
                 np.diag([across, across, radius ** 2 / 2]), _ends(length), disc=radius)


def capsule(radius: float, length: float) -> Solid:
    """Return a capsule about z; the length is without its caps."""
    # Two half balls, whose centres of mass are 3/8 r beyond the ends, and the cylinder between.
    rod, ball = radius ** 2 * length, 4 / 3 * radius ** 3  # volumes over pi
    arm = 0.5 * length + 0.375 * radius
    across = (rod * (radius ** 2 / 4 + length ** 2 / 12)
              + ball * (radius ** 2 * (0.4 - 0.375 ** 2) + arm ** 2)) / (rod + ball)
    along = (rod * radius ** 2 / 2 + ball * 0.4 * radius ** 2) / (rod + ball)
    return Solid({'type': 'capsule', 'radius': radius, 'length': length}, math.pi * (rod + ball),
                 np.zeros(3), np.diag([across, across, along]), _ends(length), rounding=radius)


def cone(radius: float, length: float) -> Solid:
    """Return a cone about z, whose frame is in its centre of mass."""
    com = np.array((0.0, 0.0, -0.25 * length))  # from half height
    across = 0.15 * radius ** 2 + 0.0375 * length ** 2
    shape = {'type': 'cone', 'radius': radius, 'length': length,
             'pose': {'position': (-com).tolist()}}
    return Solid(shape, math.pi * radius ** 2 * length / 3, np.zeros(3),
                 np.diag([across, across, 0.3 * radius ** 2]), _ends(length) - com,
                 disc=np.array((radius, 0.0)))


def ellipsoid(radii: Sequence[float]) -> Solid:
    """Return an ellipsoid."""
    a = np.asarray(radii, dtype=float)
    return Solid({'type': 'ellipsoid', 'radii': a.tolist()}, float(4 / 3 * math.pi * a.prod()),
                 np.zeros(3), np.diag((a @ a - a * a) / 5), np.zeros((1, 3)), radii=a)


def _ends(length: float) -> np.ndarray:
    return np.array([[0.0, 0.0, -0.5 * length], [0.0, 0.0, 0.5 * length]])


# Convex polyhedra by their vertices and outward triangles.
_TETRAHEDRON = (((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)),
                ((0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)))
_OCTAHEDRON = (((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)),
               ((0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4),
                (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)))
_WEDGE = (((-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (-1, 1, 1)),
          ((0, 2, 1), (0, 3, 2), (0, 1, 4), (2, 3, 5), (0, 4, 5), (0, 5, 3), (1, 2, 5), (1, 5, 4)))
POLYHEDRA = (_TETRAHEDRON, _OCTAHEDRON, _WEDGE)


def polyhedron(vertices: Sequence[Sequence[float]], faces: Sequence[Sequence[int]]) -> Solid:
    """Return a convex mesh, moved so that its centre of mass is the origin."""
    p = np.asarray(vertices, dtype=float)
    a, b, c = np.moveaxis(p[np.asarray(faces)], 1, 0)
    # Tetrahedra from the origin (Tonon, "Explicit exact formulas for the 3-D tetrahedron inertia
    # tensor", 2005): volume, first and second moments.
    volume = np.einsum('ti,ti->t', a, np.cross(b, c)) / 6
    total, com = volume.sum(), (volume[:, None] * (a + b + c)).sum(axis=0) / 4 / volume.sum()
    corners = np.stack([a, b, c]) - com
    origin = -com
    # The same again about the centre of mass: the apex of the tetrahedra is where it was.
    points = np.concatenate([corners, np.broadcast_to(origin, corners[:1].shape)])
    mean = points.sum(axis=0)
    second = np.einsum('t,kti,ktj->ij', volume, points, points)
    second = (second + np.einsum('t,ti,tj->ij', volume, mean, mean)) / 20 / total
    inertia = np.trace(second) * np.eye(3) - second
    shape = {'type': 'mesh', 'vertices': (p - com).tolist(),
             'faces': [list(map(int, face)) for face in faces]}
    return Solid(shape, float(total), np.zeros(3), inertia, p - com)


def compound(parts: Sequence[tuple[Solid, Sequence[float]]]) -> Solid:
    """Return solids at places of one body, side by side, moved so that the origin is its com."""
    volume = np.array([part.volume for part, _ in parts])
    places = np.array([place for _, place in parts], dtype=float)
    places -= volume @ places / volume.sum()
    inertia = np.zeros((3, 3))
    shapes, corners = [], []
    for share, (part, _), p in zip(volume / volume.sum(), parts, places, strict=True):
        inertia += share * (part.inertia + p @ p * np.eye(3) - np.outer(p, p))
        shapes.append(part.shape | {'pose': {'position': p.tolist()}})
        # A bound, not the shape itself: the box around the part.
        half = np.array([part.reach(e) for e in np.eye(3)])
        corners.append(box(2 * half).corners + p)
    return Solid({'type': 'compound', 'compound': shapes}, float(volume.sum()), np.zeros(3),
                 inertia, np.concatenate(corners))


def draw_sphere(rng: Generator, size: float) -> Solid:
    """Draw a ball."""
    return sphere(0.5 * size)


def draw_box(rng: Generator, size: float) -> Solid:
    """Draw a cube, a plate, a beam or whatever."""
    return box(size * (np.ones(3) if rng.random() < 0.3 else 10 ** rng.uniform(-0.7, 0.0, 3)))


def draw_cylinder(rng: Generator, size: float) -> Solid:
    """Draw a rod or a disk."""
    return cylinder(0.5 * size * 10 ** rng.uniform(-0.7, 0.0), size * 10 ** rng.uniform(-0.7, 0.0))


def draw_capsule(rng: Generator, size: float) -> Solid:
    """Draw a capsule."""
    return capsule(0.5 * size * 10 ** rng.uniform(-0.7, -0.1), size * 10 ** rng.uniform(-0.7, 0.0))


def draw_cone(rng: Generator, size: float) -> Solid:
    """Draw a flat or a pointed cone."""
    return cone(0.5 * size * 10 ** rng.uniform(-0.7, 0.0), size * 10 ** rng.uniform(-0.7, 0.0))


def draw_ellipsoid(rng: Generator, size: float) -> Solid:
    """Draw an ellipsoid, one of two of them with an axis of symmetry."""
    radii = 0.5 * size * 10 ** rng.uniform(-0.7, 0.0, 3)
    return ellipsoid(radii[[0, 0, 2]] if rng.random() < 0.5 else radii)


def draw_polyhedron(rng: Generator, size: float) -> Solid:
    """Draw a stretched tetrahedron, octahedron or wedge."""
    vertices, faces = POLYHEDRA[rng.integers(len(POLYHEDRA))]
    return polyhedron(0.5 * size * np.array(vertices) * 10 ** rng.uniform(-0.4, 0.0, 3), faces)


def draw_compound(rng: Generator, size: float) -> Solid:
    """Draw an L of two boxes, a dumb-bell or a hammer."""
    a, kind = size / 3, rng.integers(3)
    if kind == 0:
        return compound([(box((3 * a, a, a)), (0, 0, 0)), (box((a, a, 2 * a)), (a, 0, 1.5 * a))])
    rod = cylinder(0.2 * a, 2 * a)
    head = sphere(0.5 * a) if kind == 1 else box((a, 2 * a, a))
    return compound([(rod, (0, 0, 0)), (head, (0, 0, 1.5 * a)), (sphere(0.4 * a), (0, 0, -a))])


DRAW: dict[str, Callable[[Generator, float], Solid]] = {
    'sphere': draw_sphere, 'box': draw_box, 'cylinder': draw_cylinder, 'capsule': draw_capsule,
    'mesh': draw_polyhedron, 'compound': draw_compound, 'cone': draw_cone,
    'ellipsoid': draw_ellipsoid}
# Those with a flat side below and above.
FLAT = ('box', 'cylinder')


def draw_solid(rng: Generator, size: float, kinds: Sequence[str] = tuple(DRAW)) -> Solid:
    """Draw a solid of about this size [m]."""
    return DRAW[kinds[rng.integers(len(kinds))]](rng, size)


def flat_solid(rng: Generator, size: float) -> Solid:
    """Draw a box or a cylinder about as high as wide."""
    if rng.random() < 0.6:
        return box(size * 10 ** rng.uniform(-0.3, 0.0, 3))
    return cylinder(0.5 * size * 10 ** rng.uniform(-0.3, 0.0), size * 10 ** rng.uniform(-0.3, 0.0))
