# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What turns about a point at the border of a face is stopped by its other points in the step."""

import math
from typing import NamedTuple

from laws.motion import Build, Verdict
from laws.scenes import (
    any_attitude, between, body, draw_surface, matrix, product, Scene, turn, world)
from laws.solids import box, compound, cone, cylinder, Generator, polyhedron, Solid
import numpy as np

TURN = 0.02, 0.3    # [rad] in a step
SLIGHT = 5e-4   # sizes that bodies are apart or overlap
UP = np.array((0.0, 0.0, 1.0))


class Base(NamedTuple):
    """A solid that stands on a flat side, a rectangle or a disc."""

    solid: Solid
    below: float  # [m] of the side, under the origin
    half: np.ndarray  # (2,) [m]; of a disc its radius, twice
    is_disc: bool

    def border(self, rng: Generator) -> np.ndarray:
        """Draw a point of the border, of a rectangle a corner in half of all draws, (2,) [m]."""
        if self.is_disc:
            angle = rng.uniform(0, 2 * math.pi)
            return self.half * (math.cos(angle), math.sin(angle))
        place = rng.choice((-1.0, 1.0), 2)
        if rng.random() < 0.5:
            place[rng.integers(2)] = rng.uniform(-1, 1)
        return self.half * place


def draw_base(rng: Generator, size: float) -> Base:
    """Draw a box, one as a hull of triangles or of two halves, a cylinder or a cone."""
    kind = rng.choice(['box', 'mesh', 'halves', 'cylinder', 'cone'])
    a = size * 10 ** rng.uniform(-0.4, 0.0, 3)
    if kind == 'cylinder':
        return Base(cylinder(0.5 * a[0], a[2]), 0.5 * a[2], 0.5 * a[[0, 0]], True)
    if kind == 'cone':
        return Base(cone(0.5 * a[0], a[2]), 0.25 * a[2], 0.5 * a[[0, 0]], True)
    if rng.random() < 0.5:
        a[:] = size
    solid = box(a)
    if kind == 'mesh':
        corners = solid.corners
        faces = [[0, 2, 3], [0, 3, 1]], [[4, 5, 7], [4, 7, 6]], [[0, 1, 5], [0, 5, 4]], [
            [2, 6, 7], [2, 7, 3]], [[0, 4, 6], [0, 6, 2]], [[1, 3, 7], [1, 7, 5]]
        outward = []
        for face in np.concatenate(faces):
            p, q, r = corners[face]
            outward.append(face if np.cross(q - p, r - p) @ p > 0 else face[::-1])
        solid = polyhedron(corners, outward)
    if kind == 'halves':
        half = box(a * (0.5, 1.0, 1.0))
        solid = compound([(half, (-0.25 * a[0], 0, 0)), (half, (0.25 * a[0], 0, 0))])
    return Base(solid, 0.5 * a[2], 0.5 * a[:2], False)


def draw_pivot(rng: Generator) -> Scene:
    """
    Draw two bodies in free space, of which one turns about the point in which they touch.

    It is a point of the border of a flat side of both. By the end of the step the sides would
    overlap elsewhere. All of that flies and turns at an attitude.
    """
    h, size = float(rng.choice((1 / 60, 1 / 240))), between(rng, 0.01, 1.0)
    lower, upper = draw_base(rng, size), draw_base(rng, size * between(rng, 0.5, 1.0))
    angle = between(rng, *TURN)
    # The lower one upside down: what it stands on is above.
    flip = turn((1, 0, 0), math.pi)
    p = np.append(lower.border(rng), 0.0)
    foot, q = upper.border(rng), turn(UP, 0.0)
    inward = np.append(-foot, 0.0)
    if not upper.is_disc and rng.random() < 0.5:
        # On an edge, along y, up to where it stands over its middle.
        foot = upper.half * (rng.choice((-1.0, 1.0)), rng.uniform(-1, 1))
        inward = np.array((0.0, -foot[1], 0.0))
        q = turn((0, 1, 0), math.copysign(rng.uniform(0.0, 0.25 * math.pi), foot[0]))
    # Its inside is over the lower side, up to some direction.
    yaw = math.atan2(-p[1], -p[0]) - math.atan2(inward[1], inward[0]) + rng.uniform(-0.8, 0.8)
    axis = np.cross(matrix(turn(UP, yaw)) @ inward, UP)
    axis = matrix(turn(UP, rng.uniform(-0.6, 0.6))) @ axis / np.linalg.norm(axis)
    q = product(turn(UP, yaw), q)
    q = product(turn(axis, angle * rng.uniform(0.05, 0.95)), q)
    arm = matrix(q) @ np.append(-foot, upper.below) + size * rng.uniform(-SLIGHT, SLIGHT) * UP
    spin = -angle / h * axis
    common = any_attitude(rng)
    R = matrix(common)
    bodies = [
        body('a', lower.solid, between(rng, 0.1, 10.0), R @ (0, 0, -lower.below),
             product(common, flip)),
        body('b', upper.solid, between(rng, 0.1, 10.0), R @ (p + arm), product(common, q),
             R @ np.cross(spin, arm), R @ spin)]
    surface = draw_surface(rng, restitution=0.0)
    return Scene(world(bodies, h, surface, gravity=(0.0, 0.0, 0.0)), size, 2, {'angle': angle})


def judge_pivot(scene: Scene, build: Build) -> Verdict:
    """
    Compare the overlap with the square of the angle by which a body turns in the step.

    The contacts of a step have the points and the normal of its middle: a point that turns by an
    angle a leaves the line along which it was stopped by r a^2 / 8, and its normal turns by a / 2
    on a way of r a. What is not seen overlaps by r a.
    """
    run = build(scene.spec)
    # The second step reports the overlap with which it began.
    run.step(2)
    return Verdict(run.deepest() / scene.size, scene.facts['angle'] ** 2 + 2 * SLIGHT,
                   'sizes of overlap after a step')
