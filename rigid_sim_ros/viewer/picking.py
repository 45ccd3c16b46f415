# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which body a line of sight meets first, by the triangles that the bodies are drawn with."""
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from rigid_sim_ros.viewer.motion import Array

_PARALLEL = 1e-12       # of the determinant: the line runs in the plane of the triangle


class Camera(Protocol):
    """Where a page looks from: axes are right, down and forward."""

    @property
    def position(self) -> Array:
        """Where it stands (3,) [m]."""

    @property
    def wxyz(self) -> Array:
        """Its orientation, camera to world."""

    @property
    def fov(self) -> float:
        """The angle from the upper to the lower edge of the picture [rad]."""

    @property
    def aspect(self) -> float:
        """The width of the picture over its height."""


def line_of_sight(camera: Camera, x: float, y: float) -> tuple[Array, Array]:
    """
    Return origin and direction (3,) of what is seen at a point of the picture.

    x and y go from 0 to 1, from the left and from the top.
    """
    half = np.tan(0.5 * camera.fov)
    towards = np.array([(2.0 * x - 1.0) * half * camera.aspect, (2.0 * y - 1.0) * half, 1.0])
    turn = Rotation.from_quat(np.asarray(camera.wxyz)[[1, 2, 3, 0]])
    return np.array(camera.position), np.asarray(turn.apply(towards))


def first_hit(origin: Array, direction: Array, triangles: Array) -> float:
    """
    Return where a half-line first meets triangles (t, 3, 3), in lengths of `direction`.

    inf if it meets none. Both sides of a triangle count. Möller and Trumbore, "Fast, minimum
    storage ray/triangle intersection", Journal of Graphics Tools 2 (1997).
    """
    corner = triangles[:, 0]
    side, other = triangles[:, 1] - corner, triangles[:, 2] - corner
    p = np.cross(direction, other)
    determinant = np.einsum('ij,ij->i', side, p)
    meets = np.abs(determinant) > _PARALLEL
    inverse = 1.0 / np.where(meets, determinant, 1.0)
    away = origin - corner
    q = np.cross(away, side)
    u = inverse * np.einsum('ij,ij->i', away, p)
    v = inverse * (q @ direction)
    t = inverse * np.einsum('ij,ij->i', other, q)
    meets &= (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0)
    return float(t[meets].min()) if meets.any() else float('inf')


def is_near(origin: Array, direction: Array, radius: float) -> Array:
    """
    Return which half-lines come nearer to their own zero point than a radius.

    origin and direction are (n, 3), the result is (n,).
    """
    t = -np.einsum('ij,ij->i', origin, direction) / np.einsum('ij,ij->i', direction, direction)
    nearest = origin + np.maximum(t, 0.0)[:, None] * direction
    return np.asarray(np.einsum('ij,ij->i', nearest, nearest) <= radius * radius)
