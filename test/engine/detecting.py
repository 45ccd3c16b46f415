# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies for the tests of detection, without a scene file around them."""

from collections.abc import Sequence

import numpy as np

from rigid_sim_ros.engine.detection.detect import detect
from rigid_sim_ros.engine.detection.manifolds import current_manifolds, empty_memory, grown
from rigid_sim_ros.engine.detection.narrow_phase.signed_distance import signed_distance
from rigid_sim_ros.engine.detection.transform_update import place_bodies, place_shapes
from rigid_sim_ros.engine.dynamics.forces import WIDTH
from rigid_sim_ros.engine.model.hulls import Polyhedron
from rigid_sim_ros.engine.model.inertia import MassProperties
from rigid_sim_ros.engine.model.kinds.table import (
    BOX, CAPSULE, CONE, CYLINDER, ELLIPSOID, HULL, PLANE, SPHERE)
from rigid_sim_ros.engine.model.model import Body, build_model, ForceTable
from rigid_sim_ros.engine.model.shapes import build_shapes, Shape
from rigid_sim_ros.engine.state.state import empty_state

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
PLANE_SHAPE = (PLANE, (0.0, 0.0, 0.0), None)


def cube_mesh(half):
    """Return a cube as twelve triangles."""
    vertices = half * np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0)
                                for z in (-1.0, 1.0)])
    triangles = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                          [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
    return Polyhedron(vertices, triangles)


def octahedron(a, b, c):
    """Return an octahedron with corners at distances a, b, c along the axes."""
    vertices = np.array([[a, 0, 0], [-a, 0, 0], [0, b, 0], [0, -b, 0], [0, 0, c], [0, 0, -c]],
                        dtype=np.float64)
    triangles = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4],
                          [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    return Polyhedron(vertices, triangles)


# One of each convex kind, of about the same size.
CONVEX = {
    'sphere': (SPHERE, (0.3, 0.0, 0.0), None),
    'box': (BOX, (0.2, 0.3, 0.4), None),
    'capsule': (CAPSULE, (0.2, 0.3, 0.0), None),
    'cylinder': (CYLINDER, (0.3, 0.25, 0.0), None),
    'hull': (HULL, (0.0, 0.0, 0.0), octahedron(0.4, 0.35, 0.3)),
    'cone': (CONE, (0.3, 0.25, 0.0), None),
    'ellipsoid': (ELLIPSOID, (0.2, 0.3, 0.4), None),
}


class Scene:
    """One body for each shape, and the memory of detection."""

    def __init__(self, shapes: Sequence, poses: Sequence, fixed: Sequence[int] = (), ignored=(),
                 margin: float = 0.02, **fields: Sequence) -> None:
        """Put the shapes (kind, size, hull) at poses (position, orientation)."""
        mass = MassProperties(1.0, np.zeros(3), 0.1 * np.eye(3))
        nothing = np.zeros(0, dtype=np.int64)
        self.model = build_model([Body(mass, i in fixed) for i in range(len(shapes))], [],
                                 ForceTable(nothing, nothing, nothing, np.zeros((0, WIDTH))), 1e-3,
                                 (0.0, 0.0, -9.81))
        rows = [Shape(i, kind, size, hull=hull,
                      **{name: values[i] for name, values in fields.items()})
                for i, (kind, size, hull) in enumerate(shapes)]
        self.shapes = build_shapes(self.model, rows, ignored)
        self.state = empty_state(len(shapes))
        self.memory = empty_memory(len(shapes), len(rows), 4)
        self.margin = margin
        self._pose, self._turn = np.zeros((len(rows), 12)), np.zeros((len(shapes), 9))
        for i, (position, orientation) in enumerate(poses):
            self.put(i, position, orientation)

    def put(self, i, position, orientation=UPRIGHT):
        """Move a body."""
        self.state.x[:, i] = position
        self.state.q[:, i] = np.asarray(orientation) / np.linalg.norm(orientation)

    def detect(self):
        """Detect, with larger buffers when they are short; return the manifolds."""
        while not detect(self.model, self.state, self.shapes, self.memory, self.margin):
            self.memory = grown(self.memory)
        return current_manifolds(self.memory)

    def rows(self):
        """Detect; return a list of dicts, one for each manifold, of what was found."""
        manifolds = self.detect()
        return [{'pair': (int(manifolds.shape_a[r]), int(manifolds.shape_b[r])),
                 'normal': manifolds.normal[r].copy(),
                 **{name: getattr(manifolds, name)[:manifolds.points[r], r].copy()
                    for name in ('gap', 'feature', 'r_A', 'r_B', 'impulse')},
                 **{name: getattr(manifolds, name)[r, :manifolds.points[r]].copy()
                    for name in ('p_A_C', 'p_B_C')}}
                for r in range(manifolds.count[0])]

    def distance(self, a, b):
        """Return the signed distance of two shapes, the normal and the points on A and B."""
        pose, turn = self._pose, self._turn
        place_bodies(self.state, self.shapes.turning, turn, 0, len(turn))
        place_shapes(self.state, self.shapes, turn, pose, 0, len(pose))
        gap, n, p, q = signed_distance(pose, self.shapes, a, b, self.memory.scratch)
        return gap, np.array(n), np.array(p), np.array(q)


def random_pose(rng, reach):
    """Return a position within `reach` of the origin and any orientation."""
    direction = rng.normal(size=3)
    return (direction / np.linalg.norm(direction) * rng.uniform(0.05, reach), rng.normal(size=4))


def grid(kinds, spacing, rng, tilt=0.0):
    """Return poses of a cubic lattice, disturbed, above z = 0, for as many bodies."""
    side = int(np.ceil(len(kinds) ** (1 / 3)))
    poses = []
    for k in range(len(kinds)):
        place_in = np.array([k % side, k // side % side, k // side ** 2 + 0.5])
        q = np.append(tilt * rng.normal(size=3), 1.0)
        poses.append((spacing * place_in + 0.02 * spacing * rng.normal(size=3), q))
    return poses


def twins(kinds: Sequence[str], count: int, spacing: float,
          rng: np.random.Generator) -> tuple[Scene, Scene]:
    """Return two equal scenes: bodies of these kinds in turn, in a lattice on a plane."""
    shapes = [CONVEX[kinds[k % len(kinds)]] for k in range(count)]
    poses = grid(shapes, spacing, rng, tilt=0.2)
    one, other = (Scene([*shapes, PLANE_SHAPE], [*poses, ((0, 0, 0), UPRIGHT)], fixed=[count])
                  for _ in range(2))
    return one, other
