# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Mass, centre of mass and inertia of bodies; those of each kind of shape are in its own file.

An inertia tensor here is I = integral of (|r|^2 1 - r r^T) dm (Parent, Rigid Body Dynamics,
"Inertia Tensor"), so its off-diagonal entries are I_xy = -integral of x y dm, the sign that URDF
and SDF use too.
"""

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.kernels.arrays import Array

# Moments that violate I_1 + I_2 >= I_3 by less than this fraction are rounding: a thin plate meets
# it with equality. Larger: unphysical tensors pass; smaller: real plates are refused.
TRIANGLE_TOLERANCE = 1e-9


class MassProperties(NamedTuple):
    """What the dynamics need to know of a body's mass distribution."""

    m: float  # mass [kg]
    p_BC: Array  # centre of mass C from the body origin, (3,) [m], body axes
    I_BC_B: Array  # inertia tensor about C, (3, 3) [kg m^2], body axes


def about_origin(m: float, moments: Sequence[float]) -> MassProperties:
    """Return the mass properties of what has its centre of mass and its axes in its frame."""
    return MassProperties(m, np.zeros(3), np.diag(np.asarray(moments, dtype=np.float64)))


def points(positions: Array, masses: Array) -> MassProperties:
    """
    Return the mass properties of particles at positions (k, 3) [m] with masses (k,) [kg].

    M = sum m_i, x = sum m_i q_i / M, I = sum m_i (|r_i|^2 1 - r_i r_i^T), r_i = q_i - x (Parent,
    Rigid Body Dynamics, "Center of Mass", "Inertia Tensor").
    """
    p = np.asarray(positions, dtype=np.float64)
    m_i = np.asarray(masses, dtype=np.float64)
    m = float(m_i.sum())
    p_BC = m_i @ p / m
    r = p - p_BC
    second_moment = (m_i[:, None] * r).T @ r
    return MassProperties(m, p_BC, np.trace(second_moment) * np.eye(3) - second_moment)


def inertial(m: float, com: Sequence[float], inertia: Sequence[float]) -> MassProperties:
    """
    Return explicit mass properties.

    com [m] is the centre of mass in B; inertia is ixx, iyy, izz, ixy, ixz, iyz [kg m^2] about it,
    in the axes of B.
    """
    xx, yy, zz, xy, xz, yz = inertia
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=np.float64)
    return MassProperties(m, np.asarray(com, dtype=np.float64), tensor)


def mesh(m: float, vertices: Array, triangles: Array) -> MassProperties:
    """
    Return the mass properties of the homogeneous solid inside a closed mesh.

    vertices (v, 3) [m]; triangles (t, 3) indices, counter-clockwise seen from outside. Exact: the
    solid is the signed sum of the tetrahedra from the origin to each triangle, and over a
    tetrahedron with the corners 0, a, b, c of volume V the second moment is V / 20 (s s^T + a a^T
    + b b^T + c c^T), s = a + b + c (Tonon, J. Math. and Stat. 1, 2004). ValueError when the
    enclosed volume is not positive.
    """
    corners = np.asarray(vertices, dtype=np.float64)
    # Measured from the middle of the mesh, a mesh far from its origin loses no digits to
    # cancellation.
    middle = corners.mean(axis=0)
    a, b, c = np.moveaxis((corners - middle)[np.asarray(triangles)], 1, 0)
    volumes = np.einsum('ti,ti->t', a, np.cross(b, c)) / 6.0
    volume = float(volumes.sum())
    if not volume > 0.0:
        raise ValueError(f'the mesh encloses a volume of {volume:.6g} m^3, must be > 0: '
                         'are its faces counter-clockwise seen from outside?')
    s = a + b + c
    first_moment = volumes @ s / 4.0
    second_moment = sum((volumes[:, None] * u).T @ u for u in (s, a, b, c)) / 20.0
    density = m / volume
    p = first_moment / volume
    central = density * second_moment - m * np.outer(p, p)
    return MassProperties(m, p + middle, np.trace(central) * np.eye(3) - central)


def mesh_volume(vertices: Array, triangles: Array) -> float:
    """Return the signed volume [m^3] that a closed mesh encloses."""
    a, b, c = np.moveaxis(np.asarray(vertices, dtype=np.float64)[np.asarray(triangles)], 1, 0)
    return float(np.einsum('ti,ti->', a, np.cross(b, c)) / 6.0)


def placed(part: MassProperties, p_BS: Array, R_BS: Array) -> MassProperties:
    """Return the mass properties of a part, given in its own frame S, in the frame B."""
    return MassProperties(part.m, p_BS + R_BS @ part.p_BC, R_BS @ part.I_BC_B @ R_BS.T)


def combine(parts: Sequence[MassProperties]) -> MassProperties:
    """
    Return the mass properties of several parts, all given in one frame.

    The inertia of each is moved to the common centre of mass by the parallel axes theorem.
    """
    m = sum(part.m for part in parts)
    p_BC = np.sum([part.m * part.p_BC for part in parts], axis=0) / m
    tensor = np.zeros((3, 3))
    for part in parts:
        r = part.p_BC - p_BC
        tensor += part.I_BC_B + part.m * ((r @ r) * np.eye(3) - np.outer(r, r))
    return MassProperties(m, p_BC, tensor)


def check(properties: MassProperties) -> None:
    """Raise ValueError, with the numbers, for mass properties that no real body has."""
    m, p_BC, tensor = properties
    if not (math.isfinite(m) and m > 0.0):
        raise ValueError(f'mass {m:g} kg, must be > 0')
    x, y, z = rows = tensor.tolist()
    if not all(map(math.isfinite, (*p_BC.tolist(), *x, *y, *z))):
        raise ValueError(f'centre of mass {p_BC.tolist()} or inertia {rows}, must be finite')
    low, middle, high = sorted((x[0], y[1], z[2])) if is_diagonal(tensor) else (
        np.linalg.eigvalsh(tensor).tolist())
    moments = f'principal moments {low:.9g}, {middle:.9g}, {high:.9g} kg m^2'
    # A moment below rounding of the largest one is a line of particles, which cannot be spun up
    # about itself.
    if not low > 1e-14 * high:
        raise ValueError(f'inertia is not positive definite: {moments}, must all be > 0')
    if low + middle < high * (1.0 - TRIANGLE_TOLERANCE):
        raise ValueError(f'inertia violates the triangle inequality: {moments}, the two smaller '
                         f'ones must add up to the largest or more, '
                         f'{low + middle:.9g} < {high:.9g}')


def is_diagonal(tensor: Array) -> bool:
    """Return whether the axes are principal ones; in Python, ten times as fast for so little."""
    (_, b, c), (d, _, f), (g, h, _) = tensor.tolist()
    return not (b or c or d or f or g or h)


def principal_axes(tensor: Array) -> tuple[Array, Array]:
    """
    Return the principal moments (3,) [kg m^2] and R_BC (3, 3), whose columns are their axes.

    A tensor that is diagonal already keeps its axes and their order to the bit. Else the axes are
    ordered and signed so that they lie as near as possible to those of B, and right-handed.
    """
    if is_diagonal(tensor):
        return np.diag(tensor).copy(), np.eye(3)
    moments, axes = np.linalg.eigh(tensor)
    order = [-1, -1, -1]
    for _ in range(3):  # match the most similar pair of axes, then the next
        similar = np.abs(axes)
        similar[[k for k in range(3) if order[k] >= 0], :] = -1.0
        similar[:, [k for k in order if k >= 0]] = -1.0
        row, column = divmod(int(np.argmax(similar)), 3)
        order[row] = column
    moments, axes = moments[order], axes[:, order]
    axes = axes * np.where(np.diag(axes) < 0.0, -1.0, 1.0)
    if np.linalg.det(axes) < 0.0:
        weakest = int(np.argmin(np.diag(axes)))
        axes[:, weakest] *= -1.0
    return moments, axes
