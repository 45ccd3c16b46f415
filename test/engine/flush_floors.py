# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Floors of flush pieces, the same floor in one piece, and a body on them, for `test_seams`."""

from engine.detecting import CONVEX, Scene
import numpy as np

from rigid_sim_ros.engine.maths.rotation_in_python import multiply
from rigid_sim_ros.engine.model.kinds.table import (
    BOX, CAPSULE, CONE, CYLINDER, ELLIPSOID, SPHERE)

UP = np.array([0.0, 0.0, 1.0])


def turned(q, v):
    """Return a vector turned by a quaternion x, y, z, w."""
    u = np.asarray(q[:3])
    return v + 2.0 * np.cross(u, np.cross(u, v) + q[3] * np.asarray(v))


def about(axis, angle):
    """Return the quaternion of a turn."""
    return (*(np.sin(0.5 * angle) * np.asarray(axis)), np.cos(0.5 * angle))


def random_turn(rng):
    """Return any orientation."""
    q = rng.normal(size=4)
    return tuple(q / np.linalg.norm(q))


def cuts(rng, reach, count):
    """Return where a length from -reach to reach is cut, with its ends."""
    return np.concatenate([[-reach], np.sort(rng.uniform(-reach, reach, count)), [reach]])


def tiles(rng, size, x, y):
    """Return boxes, in any order, whose tops are flush at z = 0: half extents and middles."""
    boxes = []
    for i in range(len(x) - 1):
        for j in range(len(y) - 1):
            depth = size * rng.uniform(0.2, 1.0)
            half = (0.5 * (x[i + 1] - x[i]), 0.5 * (y[j + 1] - y[j]), 0.5 * depth)
            boxes.append((half, (0.5 * (x[i] + x[i + 1]), 0.5 * (y[j] + y[j + 1]),
                                 -0.5 * depth)))
    rng.shuffle(boxes)
    return boxes


def lowest(shape, q):
    """Return how far a shape that is turned by q reaches below its origin [m]."""
    kind, size, hull = shape
    down = turned((-q[0], -q[1], -q[2], q[3]), -UP)
    if kind == SPHERE:
        return size[0]
    if kind == BOX:
        return float(np.abs(down) @ size)
    if kind == CAPSULE:
        return size[0] + abs(down[2]) * size[1]
    if kind == CYLINDER:
        return abs(down[2]) * size[1] + size[0] * np.hypot(down[0], down[1])
    if kind == CONE:
        return max(down[2] * size[1], size[0] * np.hypot(down[0], down[1]) - down[2] * size[1])
    if kind == ELLIPSOID:
        return float(np.linalg.norm(down * size))
    return float((hull.vertices @ down).max())


class Floor:
    """A random floor, and a random body that touches it somewhere, often over a seam."""

    def __init__(self, seed: int) -> None:
        """Choose all of it."""
        rng = np.random.default_rng(seed)
        self.size = size = 10.0 ** rng.uniform(-3.0, 2.0)
        kind, extents, hull = CONVEX[rng.choice(list(CONVEX))]
        if hull is not None:
            hull = hull._replace(vertices=size * hull.vertices)
        self.shape = (kind, tuple(size * np.array(extents)), hull)
        # A third lies flat, a third nearly so, a third anyhow.
        way = rng.integers(3)
        q = about(UP, rng.uniform(0.0, 6.0))
        if way == 1:
            q = multiply(q, about((1.0, 0.0, 0.0), 10.0 ** rng.uniform(-7.0, -2.0)))
        if way < 2 and kind in (CAPSULE, CYLINDER) and rng.random() < 0.6:
            q = multiply(q, about((0.0, 1.0, 0.0), 0.5 * np.pi))
        self.attitude = q if way < 2 else random_turn(rng)
        self.x, self.y = (cuts(rng, 2.0 * size, rng.integers(12)),
                          cuts(rng, 2.0 * size, rng.integers(5)))
        self.tiles = tiles(rng, size, self.x, self.y)
        self.whole = [((4.0 * size,) * 3, (0.0, 0.0, -4.0 * size))]
        self.turn = random_turn(rng) if rng.random() < 0.5 else (0.0, 0.0, 0.0, 1.0)
        self.offset = rng.normal(size=3) * size * rng.choice([0.0, 1.0, 30.0])
        overlap = size * rng.choice([0.0, 1e-9, 1e-6, 1e-4, 1e-3, -1e-6, -1e-4])
        self.place = np.append(rng.uniform(-size, size, 2),
                               lowest(self.shape, self.attitude) - overlap)
        inner = self.x[np.abs(self.x) < size]
        if len(inner) > 0 and rng.random() < 0.3:
            self.place[0] = rng.choice(inner) + size * rng.choice([0.0, 1e-9, 1e-6, -1e-6, 0.2])
        self.margin = size * 10.0 ** rng.uniform(-4.0, -2.0)
        self.body_first = rng.random() < 0.5

    def scene(self, boxes) -> Scene:
        """Return the body on a floor of boxes, each of them a fixed body."""
        shapes = [(BOX, half, None) for half, _ in boxes]
        poses = [(self.offset + turned(self.turn, middle), self.turn) for _, middle in boxes]
        at = 0 if self.body_first else len(boxes)
        shapes.insert(at, self.shape)
        poses.insert(at, (self.offset + turned(self.turn, self.place),
                          multiply(self.turn, self.attitude)))
        self.body = at
        return Scene(shapes, poses, [i for i in range(len(shapes)) if i != at],
                     margin=self.margin)

    def contacts(self, boxes) -> tuple[float, float]:
        """Return the largest tilt [rad] of a normal on the body, and the least gap [m]."""
        scene = self.scene(boxes)
        found, up = scene.rows(), turned(self.turn, UP)
        tilt, gap = 0.0, self.margin
        for row in found:
            n = row['normal'] if row['pair'][1] == self.body else -row['normal']
            tilt, gap = max(tilt, float(np.linalg.norm(n - up))), min(gap, row['gap'].min())
        return tilt, gap
