# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mass properties of links: of several that are one body, and such as no body has."""

from collections.abc import Sequence

import numpy as np

from rigid_sim_ros.engine.maths.rotation_in_python import to_matrix
from rigid_sim_ros.engine.model.inertia import check, combine, MassProperties, placed
from rigid_sim_ros.models.description import Inertia
from rigid_sim_ros.models.poses import Pose

# [m] The least radius of gyration that a mended link has: that of a ball with a radius of 1.6 mm.
_GYRATION = 1e-3

_MEND = 'mend the numbers, or write mend_inertia: true beside the model in the scene'


def mistake(mass: float, tensor: Sequence[float]) -> str:
    """Return why no body has these moments xx, yy, zz, xy, xz, yz [kg m^2], '' if one may."""
    with np.errstate(all='ignore'):
        try:
            check(MassProperties(mass, np.zeros(3), _matrix(tensor)))
        except (ValueError, np.linalg.LinAlgError) as error:
            return str(error)
    return ''


def together(parts: Sequence[tuple[Pose, Inertia]]) -> Inertia:
    """
    Return the mass properties of links that are one body, in whose frame their poses are given.

    No part needs to be possible by itself: a camera may be written as a point with a mass.
    """
    with np.errstate(all='ignore'):
        sum_ = combine([placed(
            MassProperties(one.mass, np.array(one.com), _matrix(one.tensor)),
            np.array(pose.position), np.array(to_matrix(pose.orientation)))
            for pose, one in parts])
    x, y, z = sum_.p_BC.tolist()
    return Inertia(float(sum_.m), (x, y, z), _components(sum_.I_BC_B), parts[0][1].place)


def mended(mass: float, tensor: Sequence[float], *,
           is_allowed: bool) -> tuple[tuple[float, ...], str]:
    """
    Return moments xx, yy, zz, xy, xz, yz [kg m^2] that a body may have, and what was changed.

    Those that are right stay to the bit. Others raise ValueError unless mending is allowed: then
    each principal moment becomes at least that of a radius of gyration of 1 mm, and the two
    smaller ones grow by the same amount until they add up to the largest.
    """
    error = mistake(mass, tensor)
    if not error:
        return tuple(tensor), ''
    if not is_allowed or not np.isfinite(tensor).all():
        raise ValueError(f"{error}: {_MEND if mass > 0.0 else 'mend the numbers'}")
    with np.errstate(all='ignore'):
        I = _matrix(tensor)  # noqa: E741
        moments, axes = np.linalg.eigh(I)
        before = moments.copy()
        moments = np.maximum(moments, mass * _GYRATION**2)
        # A little more than equality, which rounding could break again.
        lacking = moments.max() * (1.0 + 1e-12) - (moments.sum() - moments.max())
        if lacking > 0.0:
            moments[:2] += 0.5 * lacking
        I = (axes * moments) @ axes.T  # noqa: E741
    how = ', '.join(f'{moment:.4g}' for moment in before)
    after = ', '.join(f'{moment:.4g}' for moment in moments)
    if error := mistake(mass, _components(I)):
        raise ValueError(f'{error}: mend the numbers')
    return _components(I), f'principal moments {how} kg m^2 are taken as {after}'


def _matrix(tensor: Sequence[float]) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = tensor
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _components(I: np.ndarray) -> tuple[float, float, float, float, float, float]:  # noqa: E741
    return (float(I[0, 0]), float(I[1, 1]), float(I[2, 2]), float(I[0, 1]), float(I[0, 2]),
            float(I[1, 2]))
