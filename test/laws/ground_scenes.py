# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Random grounds of triangles, and bodies that fall on them.

A ground is a grid of lines along x and y, as a heightfield or as a mesh of which each cell is
divided along either diagonal. Its cells are a quarter of a body to ten bodies wide, or long and
narrow; it is flat, a slope, or hills as high as bodies at most.
"""

from collections.abc import Callable
import math
from typing import Any, NamedTuple

from laws.apart_laws import draw_flush
from laws.motion import Look
from laws.scenes import (
    between, body, draw_masses, draw_scales, draw_surface, heap, matrix, plane, Scales, Scene,
    Spec, world)
from laws.solids import (
    box, draw_polyhedron, draw_solid, draw_sphere, flat_solid, Generator, Solid)
import numpy as np

CELLS = 0.25, 10.0  # of the size of bodies
# Along each axis: enough for what falls in the middle, few enough to build hundreds of them.
FEWEST, MOST = 2, 20
WIDE = 8.0  # sizes that a ground is wide, if its cells are not too many then
# A sliver's width over the length of its cell; what is narrower than 1e-6 is none to the engine.
NARROW = 1e-3


class Ground(NamedTuple):
    """A surface z(x, y) of triangles."""

    shape: Spec
    vertices: np.ndarray  # (v, 3) [m]
    faces: np.ndarray  # (t, 3)
    slope: np.ndarray  # (2,) of what is flat

    @property
    def highest(self) -> float:
        """Return the greatest height [m]."""
        return float(self.vertices[:, 2].max())

    def spec(self) -> Spec:
        """Return the body that stays."""
        return {'name': 'ground', 'shape': self.shape, 'fixed': True,
                'pose': {'position': [0.0] * 3, 'orientation': [0.0, 0.0, 0.0, 1.0]}}

    def height(self, points: np.ndarray) -> np.ndarray:
        """Return z of the surface at points (n, 3) [m], not a number beside it."""
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        ab, ac = b - a, c - a
        area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
        found = np.full(len(points), np.nan)
        for k, p in enumerate(points):
            d = p - a
            u = (d[:, 0] * ac[:, 1] - d[:, 1] * ac[:, 0]) / area
            v = (ab[:, 0] * d[:, 1] - ab[:, 1] * d[:, 0]) / area
            inside = np.flatnonzero((u >= 0.0) & (v >= 0.0) & (u + v <= 1.0))
            if inside.size:
                at = inside[0]
                found[k] = a[at, 2] + u[at] * ab[at, 2] + v[at] * ac[at, 2]
        return found


def draw_ground(rng: Generator, size: float, forms: tuple[str, ...] = ('flat', 'slope', 'hills'),
                steep: float = math.inf, wide: float = WIDE) -> Ground:
    """
    Draw a ground for bodies of a size [m].

    `steep` bounds the slope of hills. A vertex lies below the middle in some, an edge in others.
    """
    form = str(rng.choice(forms))
    kind = str(rng.choice(['heightfield', 'mesh', 'slivers']))
    cell = size * between(rng, *CELLS)
    ratio = between(rng, 1.0, 30.0) if rng.random() < 0.3 else 1.0
    x = _lines(rng, cell, wide * size, kind)
    y = _lines(rng, cell * ratio, wide * size, 'mesh' if kind == 'slivers' and rng.random() < 0.5
               else kind)
    slope = np.zeros(2) if form != 'slope' else math.tan(rng.uniform(0.02, 0.5)) * _unit(rng)
    X, Y = np.meshgrid(x, y)
    z = slope[0] * X + slope[1] * Y
    if form == 'hills':
        z = size * between(rng, 0.01, 1.0) * _hills(rng, X, Y, size, kind)
        z *= min(1.0, steep / _steepest(x, y, z))
    if kind == 'heightfield':
        # About the middle, by its definition.
        X, Y = X - X.mean(), Y - Y.mean()
    vertices = np.stack([X, Y, z], axis=2).reshape(-1, 3)
    faces = _faces(rng, z.shape, kind)
    shape: dict[str, Any] = {'type': 'mesh', 'vertices': vertices.tolist(),
                             'faces': faces.tolist(), 'convex': False}
    if kind == 'heightfield':
        shape = {'type': 'heightfield', 'heights': z.tolist(),
                 'size': [float(np.ptp(x)), float(np.ptp(y))]}
    return Ground(shape, vertices, faces, slope)


def _unit(rng: Generator) -> np.ndarray:
    angle = rng.uniform(0, 2 * math.pi)
    return np.array((math.cos(angle), math.sin(angle)))


def _lines(rng: Generator, cell: float, wide: float, kind: str) -> np.ndarray:
    """Return the coordinates of lines, one of which or the middle of a cell is at 0 or not."""
    count = int(np.clip(math.ceil(wide / cell), FEWEST, MOST)) + int(rng.integers(2))
    steps = np.full(count, cell)
    if kind == 'slivers':
        steps *= 10 ** rng.uniform(math.log10(NARROW), 0.0, count)
        # The middle ones are the narrow ones, where bodies fall; the ground is as wide as others.
        steps[[0, -1]] = max(cell, 0.5 * wide)
    lines = np.append(0.0, np.cumsum(steps))
    middle = 0.5 * lines[-1] if kind == 'heightfield' else lines[len(lines) // 2]
    return lines - middle + (cell * rng.uniform(-0.5, 0.5) if rng.random() < 0.5 else 0.0)


def _hills(rng: Generator, X: np.ndarray, Y: np.ndarray, size: float, kind: str) -> np.ndarray:
    """
    Return heights from 0 to 1: of each vertex by itself, or of waves over narrow cells.

    Of slivers that were rough, all would be walls that are thinner than their sheets.
    """
    if kind != 'slivers':
        return rng.random(X.shape)
    long, phase = size * rng.uniform(2.0, 8.0, 2), rng.uniform(0, 2 * math.pi, 2)
    return 0.25 * (2.0 + np.sin(2 * math.pi * X / long[0] + phase[0])
                   + np.sin(2 * math.pi * Y / long[1] + phase[1]))


def _steepest(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> float:
    """Return a bound of the slope of the triangles."""
    return math.hypot(float(np.abs(np.diff(z, axis=1) / np.diff(x)).max()),
                      float(np.abs(np.diff(z, axis=0) / np.diff(y)[:, None]).max())) + 1e-12


def _faces(rng: Generator, shape: tuple[int, ...], kind: str) -> np.ndarray:
    """Return the triangles, (t, 3); a heightfield's cells are divided from the least corner."""
    rows, columns = shape
    k = (columns * np.arange(rows - 1)[:, None] + np.arange(columns - 1)).reshape(-1, 1, 1)
    other = np.zeros(len(k), dtype=bool) if kind == 'heightfield' else rng.random(len(k)) < 0.5
    straight = k + np.array([[0, 1, columns + 1], [0, columns + 1, columns]])
    crossed = k + np.array([[0, 1, columns], [1, columns + 1, columns]])
    return np.where(other[:, None, None], crossed, straight).reshape(-1, 3)


def _on(ground: Ground, bodies: list[Spec]) -> list[Spec]:
    """Return bodies that were above z = 0, above the ground."""
    for one in bodies:
        one['pose']['position'][2] += ground.highest
    return [*bodies, ground.spec()]


def draw_ground_scene(rng: Generator, forms: tuple[str, ...] = ('flat', 'slope', 'hills'),
                      draw: Callable[[Generator, float], Solid] = draw_solid,
                      most: int = 4) -> Scene:
    """Draw one to `most` bodies that fall on a ground and on each other."""
    scales = draw_scales(rng)
    ground = draw_ground(rng, scales.size, forms)
    spec = world(_on(ground, heap(rng, scales, most, draw)), scales.h, draw_surface(rng))
    return Scene(spec, scales.size, min(scales.steps(4.0), 800),
                 {'seed': int(rng.integers(1 << 31)), 'ground': ground})


def draw_falling_ball(rng: Generator) -> Scene:
    """
    Draw a ball that falls on a flat ground or a slope.

    Of other bodies the points of contact of a step are others where the ground has pieces, and
    with them what is known to a step only, as the way in which friction is shared. Of several
    balls, what touches the ground at 1e-8 of its size and what touches at 0 may collide in another
    order.
    """
    scene = draw_ground_scene(rng, ('flat', 'slope'), draw_sphere, 1)
    return scene._replace(facts=dict(scene.facts) | {'plane': True})


def draw_sliding(rng: Generator) -> Scene:
    """Draw a body that slides or rolls over a flat ground, as `draw_flush` does over pieces."""
    scene = draw_flush(rng)
    ground = draw_ground(rng, scene.size, ('flat',), wide=12.0)
    slider = scene.spec['bodies'][0]
    spec = scene.spec | {'bodies': [slider, ground.spec()]}
    # As long as it is over the ground: from a size left of the middle to one before the edge, on
    # a way of which it is up to 0.5 rad off.
    wide = ground.vertices[:, :2].max(axis=0) - scene.size
    start = np.array(slider['pose']['position'][:2])
    v = np.array(slider['twist']['linear'][:2])
    with np.errstate(divide='ignore'):
        time = float(((wide - np.sign(v) * start) / np.abs(v)).min())
    steps = min(scene.steps, max(1, int(time / scene.h)))
    return scene._replace(spec=spec, steps=steps, facts=dict(scene.facts) | {'whole': plane()})


def draw_shots(rng: Generator,
               draw: Callable[[Generator, float], Solid] = draw_solid) -> Scene:
    """Draw bodies that hit a ground by up to three of their sizes a step."""
    scales = draw_scales(rng)
    ground = draw_ground(rng, scales.size)
    bodies = heap(rng, scales, 4, draw)
    for one in bodies:
        v = one['twist']['linear']
        v[2] = -scales.size / scales.h * between(rng, 1e-2, 3.0)
        v[:2] = (0.3 * v[2] * rng.normal(size=2)).tolist() if rng.random() < 0.5 else v[:2]
    spec = world(_on(ground, bodies), scales.h, draw_surface(rng))
    return Scene(spec, scales.size, min(scales.steps(2.0), 200), {'ground': ground})


def draw_resting(rng: Generator) -> Scene:
    """Draw a column that stands on a flat ground, or a body that comes to rest on hills."""
    scales = draw_scales(rng, coarsest=0.2)
    if rng.random() < 0.5:
        return _column(rng, scales)
    # It slides where tan(slope) is above the friction, and what is no ball does not roll there.
    friction = rng.uniform(0.3, 1.5)
    ground = draw_ground(rng, scales.size, steep=0.5 * friction)
    while np.linalg.norm(ground.slope) > 0.5 * friction:
        ground = draw_ground(rng, scales.size, steep=0.5 * friction)
    solid = (flat_solid if rng.random() < 0.7 else draw_polyhedron)(rng, scales.size)
    if solid.shape['type'] == 'cylinder':
        solid = box(scales.size * 10 ** rng.uniform(-0.3, 0.0, 3))
    z = solid.radius + scales.size * between(rng, 1e-3, 0.3)
    bodies = [body('b0', solid, draw_masses(rng, 1)[0], (*_near(rng, scales.size), z),
                   _attitude(rng))]
    surface = draw_surface(rng, restitution=0.0, friction=friction)
    return Scene(world(_on(ground, bodies), scales.h, surface), scales.size, scales.steps(20.0),
                 {'count': 1, 'comes': True})


def _near(rng: Generator, size: float) -> np.ndarray:
    return size * rng.uniform(-0.5, 0.5, 2)


def _attitude(rng: Generator) -> np.ndarray:
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def _column(rng: Generator, scales: Scales) -> Scene:
    """Return one to five bodies above each other on a flat ground, any masses."""
    ground = draw_ground(rng, scales.size, ('flat',))
    at, bodies, height = _near(rng, scales.size), [], 0.0
    for k, mass in enumerate(draw_masses(rng, int(rng.integers(1, 6)))):
        solid: Solid = flat_solid(rng, scales.size)
        up = solid.reach(np.array((0.0, 0.0, 1.0)))
        bodies.append(body(f'b{k}', solid, mass, (*at, height + up)))
        height += 2 * up
    spec = world([*bodies, ground.spec()], scales.h, draw_surface(rng))
    return Scene(spec, scales.size, 300, {'count': len(bodies)})


def inner_points(spec: Spec, now: Look, attitudes: np.ndarray) -> np.ndarray:
    """Return a point inside of each body that moves, (n, 3) [m]: an L has its centre outside."""
    found = []
    for k, one in enumerate(spec['bodies']):
        if 'inertial' in one:
            part = one['shape'].get('compound', [{}])[0].get('pose', {})
            inside = np.subtract(part.get('position', (0.0, 0.0, 0.0)), one['inertial']['com']
                                 if part else (0.0, 0.0, 0.0))
            found.append(now.x[k] + matrix(attitudes[k]) @ inside)
    return np.array(found)
