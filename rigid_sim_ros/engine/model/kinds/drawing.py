# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What shapes are drawn with.

A picture of many bodies draws a few forms of unit size, scaled and placed, however many bodies
there are. A form fits into the cube of edge 1 m about its origin.
"""

from collections.abc import Sequence
from itertools import pairwise
import math
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.kernels.arrays import Array, IntArray, Quaternion, Vector


class Surface(NamedTuple):
    """Triangles, anticlockwise seen from outside."""

    vertices: Array  # (v, 3) [m]
    faces: IntArray  # (f, 3) rows of the vertices


class Form(NamedTuple):
    """A form of unit size at its place in the frame S of a shape."""

    name: str
    scale: tuple[float, float, float]  # along the axes of the form
    position: Vector = (0.0, 0.0, 0.0)  # [m]
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)  # form to S, x, y, z, w


def revolved(profile: Sequence[tuple[float, float]], sides: int) -> Surface:
    """
    Turn a line of points (radius, height) [m], from below to above, about the z axis.

    A point on the axis becomes one vertex, any other a ring of `sides`.
    """
    angle = 2.0 * math.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings, vertices, count = [], [], 0
    for radius, height in profile:
        ring = circle[:1] * 0.0 if radius == 0.0 else radius * circle
        vertices.append(np.column_stack([ring, np.full(len(ring), height)]))
        rings.append(count + np.arange(sides) % len(ring))
        count += len(ring)
    faces = []
    for low, high in pairwise(rings):
        after = np.roll(low, -1), np.roll(high, -1)
        faces += [np.stack([low, after[0], after[1]], axis=1)] if low[0] != low[-1] else []
        faces += [np.stack([low, after[1], high], axis=1)] if high[0] != high[-1] else []
    return Surface(np.concatenate(vertices), np.concatenate(faces))


def arc(rings: int, radius: float, lowest: float, highest: float,
        middle: float = 0.0) -> list[tuple[float, float]]:
    """
    Return the profile of a piece of a ball with the centre at the height `middle` [m].

    It has `rings` segments between two latitudes [rad]; a pole is one point, also after rounding.
    """
    angles = np.linspace(lowest, highest, rings + 1)
    return [(0.0 if abs(abs(angle) - math.pi / 2) < 1e-9 else radius * math.cos(angle),
             middle + radius * math.sin(angle)) for angle in angles.tolist()]


def scaled(surface: Surface, scale: Sequence[float]) -> Surface:
    """Return a surface stretched along its axes."""
    return Surface(surface.vertices * np.asarray(scale), surface.faces)
