# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Drops of every pair of shapes, many in one world, and measures that do not ask the engine.

Overlap is measured with support functions: a direction along which two convex shapes overlap by d
proves that they can be parted by d, wherever the direction came from. Whoever finds no direction
with a small d tries harder; so the figure is never too small, and hardly ever too large.
"""

from collections.abc import Mapping, Sequence
import math
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from rigid_sim_ros import World

G = 9.81
SPACING = 6.0  # [m] between the drops of a world: nobody rolls so far


def _hull_mesh() -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and outward triangles of an irregular convex body of about 0.35 m."""
    rng = np.random.default_rng(7)
    points = rng.normal(size=(14, 3))
    points *= (0.2 * np.array([1.0, 0.8, 0.6])) / np.linalg.norm(points, axis=1)[:, None]
    hull = ConvexHull(points)
    corners, faces = np.unique(hull.simplices, return_inverse=True)
    faces, vertices = faces.reshape(-1, 3), points[corners]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    inward = np.einsum('ti,ti->t', np.cross(b - a, c - a), a - vertices.mean(axis=0)) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces


VERTICES, FACES = _hull_mesh()

SHAPES: dict[str, dict[str, Any]] = {
    'sphere': {'type': 'sphere', 'radius': 0.15},
    'box': {'type': 'box', 'size': [0.3, 0.2, 0.24]},
    'capsule': {'type': 'capsule', 'radius': 0.1, 'length': 0.25},
    'cylinder': {'type': 'cylinder', 'radius': 0.14, 'length': 0.22},
    'cone': {'type': 'cone', 'radius': 0.16, 'length': 0.26},
    'ellipsoid': {'type': 'ellipsoid', 'radii': [0.1, 0.14, 0.19]},
    'mesh': {'type': 'mesh', 'vertices': VERTICES.tolist(), 'faces': FACES.tolist()},
    'compound': {'compound': [
        {'type': 'box', 'size': [0.3, 0.1, 0.1], 'pose': {'position': [0.0, 0.0, 0.18]}},
        {'type': 'cylinder', 'radius': 0.04, 'length': 0.3,
         'pose': {'position': [0.0, 0.0, 0.0]}},
        {'type': 'sphere', 'radius': 0.07, 'pose': {'position': [0.0, 0.0, -0.18]}}]},
}
REACH = 0.3  # [m] from the origin of the body frame: no shape reaches farther


class Solid(NamedTuple):
    """A convex shape: what it is the convex hull of, rounded by a ball or by a disc."""

    points: np.ndarray  # (k, 3) [m] in the body frame
    ball: float  # [m] radius of a ball around each point
    disc: float | np.ndarray  # [m] radius of a disc around each point, or these (k,), normal to z
    directions: np.ndarray  # (d, 3) in the body frame: normals of faces
    edges: np.ndarray  # (e, 3) directions of edges
    radii: np.ndarray = np.zeros(3)  # [m] of an ellipsoid around each point

    def support(self, e: np.ndarray) -> np.ndarray:
        """Return max e . p over the solid for unit vectors e (..., 3) in the body frame."""
        discs = self.disc * np.hypot(e[..., 0], e[..., 1])[..., None]
        return ((e @ self.points.T + discs).max(axis=-1) + self.ball
                + np.sqrt(np.square(e) @ np.square(self.radii)))


_AXES = np.eye(3)
_NONE = np.zeros((0, 3))
_ENDS = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]])


def _box_corners(size: Sequence[float]) -> np.ndarray:
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return 0.5 * signs * np.asarray(size)


def _mesh_edges() -> np.ndarray:
    pairs = {tuple(sorted(edge)) for a, b, c in FACES.tolist()
             for edge in ((a, b), (b, c), (c, a))}
    return np.array([VERTICES[b] - VERTICES[a] for a, b in sorted(pairs)])


def _mesh_normals() -> np.ndarray:
    a, b, c = np.moveaxis(VERTICES[FACES], 1, 0)
    n = np.cross(b - a, c - a)
    return n / np.linalg.norm(n, axis=1)[:, None]


def _solid(part: dict[str, Any]) -> Solid:
    offset = np.asarray(part.get('pose', {}).get('position', (0.0, 0.0, 0.0)))
    if part['type'] == 'sphere':
        return Solid(offset[None], part['radius'], 0.0, _NONE, _NONE)
    if part['type'] == 'box':
        return Solid(offset + _box_corners(part['size']), 0.0, 0.0, _AXES, _AXES)
    if part['type'] == 'ellipsoid':
        return Solid(offset[None], 0.0, 0.0, _NONE, _NONE, np.asarray(part['radii']))
    if part['type'] == 'mesh':
        return Solid(offset + VERTICES, 0.0, 0.0, _mesh_normals(), _mesh_edges())
    ends = offset + part['length'] * _ENDS
    if part['type'] == 'capsule':
        return Solid(ends, part['radius'], 0.0, _NONE, _AXES[2:])
    if part['type'] == 'cone':
        return Solid(ends, 0.0, np.array([part['radius'], 0.0]), _AXES[2:], _AXES[2:])
    return Solid(ends, 0.0, part['radius'], _AXES[2:], _AXES[2:])


SOLIDS = {name: [_solid(part) for part in shape.get('compound', [shape])]
          for name, shape in SHAPES.items()}


def rotations(q: np.ndarray) -> np.ndarray:
    """Return the matrices (n, 3, 3), body to world, of orientations (n, 4) x, y, z, w."""
    return Rotation.from_quat(q).as_matrix()


def lowest(name: str, x: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return the height (n,) of the lowest point of bodies at x (n, 3), R (n, 3, 3)."""
    down = -R[:, 2, :]
    return x[:, 2] - np.maximum.reduce([solid.support(down) for solid in SOLIDS[name]])


def _overlaps(a: Solid, b: Solid, x: np.ndarray, Ra: np.ndarray, Rb: np.ndarray,
              n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return n (d, 3) and -n as unit vectors, and by how much a pair overlaps along each."""
    length = np.linalg.norm(n, axis=1)
    n = n[length > 1e-9] / length[length > 1e-9, None]
    n = np.concatenate([n, -n])
    return n, a.support(n @ Ra) + b.support(-n @ Rb) - n @ x


def _depth(a: Solid, b: Solid, x: np.ndarray, Ra: np.ndarray, Rb: np.ndarray,
           hints: np.ndarray, enough: float) -> float:
    """Return the depth of B at x = x_B - x_A in A, or any bound of it below `enough`."""
    n, depths = _overlaps(a, b, x, Ra, Rb, np.append(hints, [x], axis=0))
    if depths.min() < enough:
        return float(depths.min())
    crossed = np.cross((a.edges @ Ra.T)[:, None], (b.edges @ Rb.T)[None]).reshape(-1, 3)
    centres = x + Rb @ b.points.mean(axis=0) - Ra @ a.points.mean(axis=0)
    # Between the segments and points that balls were put around, too.
    near = ((b.points @ Rb.T + x)[:, None] - (a.points @ Ra.T)[None]).reshape(-1, 3)
    n, depths = _overlaps(a, b, x, Ra, Rb, np.concatenate([
        n, a.directions @ Ra.T, b.directions @ Rb.T, crossed, near, centres[None]]))
    best, depth = n[depths.argmin()], float(depths.min())
    rng = np.random.default_rng(0)
    for size in 0.5 ** np.arange(1, 16):
        if depth < enough:
            break
        n, depths = _overlaps(a, b, x, Ra, Rb, best + size * rng.normal(size=(200, 3)))
        if depths.min() < depth:
            best, depth = n[depths.argmin()], float(depths.min())
    return depth


class Drops:
    """
    Many drops of one pair of shapes in one world, far apart, with a plane as ground.

    The second shape is thrown down on the first, which flies up to meet it in the air; or it is
    fixed, in the way of the first; or there is none, and the first falls on the ground alone.
    """

    def __init__(self, first: str, second: str | None, fixed: bool, count: int, *,
                 step: float = 1e-3, look: int = 10, density: float = 1000.0,
                 surface: Mapping[str, float] = MappingProxyType({}), **world: Any) -> None:
        """
        Put `count` drops on a square grid, which are looked at after every `look` steps.

        `world` is more of the scene's world.
        """
        rng = np.random.default_rng([count, *map(ord, f'{first}{second}')])
        self.kinds = [first] if second is None else [first, second]
        # Which of the pair are not fixed.
        self.moving = [0] if fixed else list(range(len(self.kinds)))
        self.fixed, self.count, self.h, self._look = fixed, count, step, look
        self._density = density
        side = math.isqrt(count - 1) + 1
        bodies = [body for i in range(count)
                  for body in self._drop(rng, i, SPACING * np.array([i % side, i // side, 0.0]))]
        self.world = World.from_dict({
            'format': 1, 'world': {'step': step, **world},
            'materials': {'default': {'friction': 0.5, **surface}},
            'bodies': [{'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}, *bodies]})
        # Rows of the first bodies of all drops, and of the second: (1 or 2, count).
        self.rows = 1 + np.arange(count * len(self.kinds)).reshape(count, -1).T
        self._movers = self.rows[self.moving]
        # m 1 m/s, and 0.1 m of it.
        self._scales = (self.world.mass[self._movers].sum(axis=0)[:, None]
                        * (1.0, 1.0, 1.0, 0.1, 0.1, 0.1))
        self._clear, self._kept = self._is_clear(), self.momentum()

    def _drop(self, rng: np.random.Generator, i: int, place: np.ndarray) -> list[dict[str, Any]]:
        """Return the bodies of one drop at random poses, clear of each other and the ground."""
        aside = np.append(rng.uniform(-0.12, 0.12, 2), 0.0)
        heights = (0.5 + 2 * REACH, 0.4) if self.fixed else (0.5, 0.52 + 2 * REACH)
        up = (0.8, -0.8) if len(self.kinds) == 2 and not self.fixed else (0.0, 0.0)
        bodies = []
        for k, name in enumerate(self.kinds):
            q, shape = rng.normal(size=4), SHAPES[name]
            body = {'name': 'ab'[k] + str(i), 'density': self._density,
                    **(shape if 'compound' in shape else {'shape': shape}),
                    'pose': {'position': (place + k * aside + (0, 0, heights[k])).tolist(),
                             'orientation': (q / np.linalg.norm(q)).tolist()}}
            linear, angular = rng.uniform(-0.2, 0.2, 3), rng.uniform(-3.0, 3.0, 3)
            if k in self.moving:
                body['twist'] = {'linear': np.add(linear, (0.0, 0.0, up[k])).tolist(),
                                 'angular': angular.tolist()}
            else:
                body['fixed'] = True
            bodies.append(body)
        return bodies

    def poses(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and rotations of the first or second bodies."""
        rows = self.rows[k]
        return self.world.position[rows], rotations(self.world.orientation[rows])

    def height(self) -> np.ndarray:
        """Return how far each drop is above the ground [m]; below 0: overlap."""
        return np.minimum.reduce([lowest(self.kinds[k], *self.poses(k)) for k in self.moving])

    def _is_clear(self) -> np.ndarray:
        """Return which drops cannot meet anything fixed until the next look, or since the last."""
        clear = self.height()
        if self.fixed:
            apart = self.world.position[self.rows[1]] - self.world.position[self.rows[0]]
            clear = np.minimum(clear, np.linalg.norm(apart, axis=1) - 2 * REACH)
        return clear > 4.0 * self._look * self.h  # no point is faster than 4 m/s

    def momentum(self) -> np.ndarray:
        """
        Return P without what gravity gave, and L about the joint centre of mass, (drops, 6).

        Gravity turns nothing about that centre, so both stay while only the pair touches.
        """
        w, rows = self.world, self._movers
        x, P, m = w.center_of_mass[rows], w.linear_momentum[rows], w.mass[rows, None]
        mass = m.sum(axis=0)
        arms = x - (m * x).sum(axis=0) / mass
        spin = (w.angular_momentum[rows] + np.cross(arms, P)).sum(axis=0)
        fallen = mass * (0.0, 0.0, G * w.step_index * self.h)
        return np.hstack([P.sum(axis=0) + fallen, spin])

    def change_of_momentum(self) -> np.ndarray:
        """
        Step; return the largest changes of P and L since a drop last met what is fixed, (2,).

        They are relative to those of 1 m/s, with an arm of 0.1 m. A drop counts while it is too
        far away to meet anything fixed in between.
        """
        was_clear = self._clear
        self.world.step(self._look)
        self._clear = self._is_clear()
        if not self._clear.any():
            return np.zeros(2)
        momentum, counts = self.momentum(), self._clear & was_clear
        change = (np.abs(momentum - self._kept) / self._scales)[counts]
        self._kept = np.where(counts[:, None], self._kept, momentum)
        return change.max(axis=0, initial=0.0).reshape(2, 3).max(axis=1)

    def energy(self) -> np.ndarray:
        """Return the energy of each drop [J], zero at the ground."""
        w, rows = self.world, self._movers
        P, m, z = w.linear_momentum[rows], w.mass[rows], w.center_of_mass[rows, 2]
        turning = (w.angular_momentum[rows] * w.angular_velocity[rows]).sum(axis=2)
        return (0.5 * np.square(P).sum(axis=2) / m + 0.5 * turning + m * G * z).sum(axis=0)

    def slow(self) -> np.ndarray:
        """Return which drops neither fall nor rise; they may roll."""
        rows = self._movers
        v = self.world.linear_momentum[rows, 2] / self.world.mass[rows]
        return np.abs(v).max(axis=0) < 0.05

    def overlap(self, enough: float) -> np.ndarray:
        """Return the depth of the overlap in each drop [m]; where below `enough`, a bound."""
        depth = -self.height()
        if len(self.kinds) == 1:
            return depth
        (xa, Ra), (xb, Rb) = self.poses(0), self.poses(1)
        contacts = self.world.contacts()
        for i in np.flatnonzero(np.linalg.norm(xb - xa, axis=1) < 2 * REACH):
            # The engine's normals are directions to try like any others.
            tried = contacts['normal'][(contacts['body_a'] == self.rows[0, i])
                                       & (contacts['body_b'] == self.rows[1, i])]
            depth[i] = max(depth[i], *(
                _depth(a, b, xb[i] - xa[i], Ra[i], Rb[i], tried, enough)
                for a in SOLIDS[self.kinds[0]] for b in SOLIDS[self.kinds[1]]))
        return depth
