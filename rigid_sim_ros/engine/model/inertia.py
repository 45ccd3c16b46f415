# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Mass, centre of mass and inertia of bodies.

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


def _about_origin(m: float, moments: Sequence[float]) -> MassProperties:
    return MassProperties(m, np.zeros(3), np.diag(np.asarray(moments, dtype=np.float64)))


def sphere_volume(radius: float) -> float:
    """Return the volume [m^3] of a ball of this radius [m]."""
    return 4.0 / 3.0 * math.pi * radius ** 3


def box_volume(size: Sequence[float]) -> float:
    """Return the volume [m^3] of a cuboid with these full edge lengths [m]."""
    return float(size[0] * size[1] * size[2])


def cylinder_volume(radius: float, length: float) -> float:
    """Return the volume [m^3] of a cylinder of this radius and length [m]."""
    return math.pi * radius ** 2 * length


def capsule_volume(radius: float, length: float) -> float:
    """Return the volume [m^3] of a capsule; length [m] without the caps."""
    return cylinder_volume(radius, length) + sphere_volume(radius)


def sphere(m: float, radius: float) -> MassProperties:
    """Return the mass properties of a homogeneous ball, I = 2/5 m r^2."""
    return _about_origin(m, [0.4 * m * radius ** 2] * 3)


def box(m: float, size: Sequence[float]) -> MassProperties:
    """
    Return the mass properties of a homogeneous cuboid with full edge lengths a, b, c [m].

    I = m / 12 diag(b^2 + c^2, a^2 + c^2, a^2 + b^2) (Parent, Rigid Body Dynamics, "Inertia Tensor
    for a Cuboid").
    """
    a, b, c = size
    return _about_origin(m, [
        m / 12.0 * (b * b + c * c), m / 12.0 * (a * a + c * c), m / 12.0 * (a * a + b * b)])


def cylinder(m: float, radius: float, length: float) -> MassProperties:
    """Return the mass properties of a homogeneous cylinder about the z axis."""
    across = m * (3.0 * radius ** 2 + length ** 2) / 12.0
    return _about_origin(m, [across, across, 0.5 * m * radius ** 2])


def capsule(m: float, radius: float, length: float) -> MassProperties:
    """
    Return the mass properties of a homogeneous capsule about the z axis.

    length [m] is that of the cylinder, without the caps. A half ball of mass m_h has its centre of
    mass 3/8 r from the flat face and the moment 2/5 m_h r^2 about any axis through the centre of
    that face; the parallel axes theorem moves it to the middle of the capsule.
    """
    volume = capsule_volume(radius, length)
    m_cylinder = m * cylinder_volume(radius, length) / volume
    m_caps = m * sphere_volume(radius) / volume
    across = (m_cylinder * (3.0 * radius ** 2 + length ** 2) / 12.0
              + m_caps * (0.4 * radius ** 2 + length ** 2 / 4.0 + 3.0 / 8.0 * radius * length))
    along = 0.5 * m_cylinder * radius ** 2 + 0.4 * m_caps * radius ** 2
    return _about_origin(m, [across, across, along])


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
    if not (np.isfinite(p_BC).all() and np.isfinite(tensor).all()):
        raise ValueError(f'centre of mass {p_BC.tolist()} or inertia {tensor.tolist()}, '
                         'must be finite')
    low, middle, high = np.linalg.eigvalsh(tensor)
    moments = f'principal moments {low:.9g}, {middle:.9g}, {high:.9g} kg m^2'
    # A moment below rounding of the largest one is a line of particles, which cannot be spun up
    # about itself.
    if not low > 1e-14 * high:
        raise ValueError(f'inertia is not positive definite: {moments}, must all be > 0')
    if low + middle < high * (1.0 - TRIANGLE_TOLERANCE):
        raise ValueError(f'inertia violates the triangle inequality: {moments}, the two smaller '
                         f'ones must add up to the largest or more, '
                         f'{low + middle:.9g} < {high:.9g}')


def principal_axes(tensor: Array) -> tuple[Array, Array]:
    """
    Return the principal moments (3,) [kg m^2] and R_BC (3, 3), whose columns are their axes.

    A tensor that is diagonal already keeps its axes and their order to the bit. Else the axes are
    ordered and signed so that they lie as near as possible to those of B, and right-handed.
    """
    if not np.any(tensor - np.diag(np.diag(tensor))):
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
