# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Moments of inertia that no body has: refused, or raised to what a body may have."""

from collections.abc import Sequence

import numpy as np

from rigid_sim_ros.engine.model.inertia import check, MassProperties

# [m] The least radius of gyration that a mended link has: that of a ball with a radius of 1.6 mm.
_GYRATION = 1e-3

_MEND = 'mend the numbers, or write mend_inertia: true beside the model in the scene'


def mended(mass: float, tensor: Sequence[float], *,
           is_allowed: bool) -> tuple[tuple[float, ...], str]:
    """
    Return moments xx, yy, zz, xy, xz, yz [kg m^2] that a body may have, and what was changed.

    Those that are right stay to the bit. Others raise ValueError unless mending is allowed: then
    each principal moment becomes at least that of a radius of gyration of 1 mm, and the two
    smaller ones grow by the same amount until they add up to the largest.
    """
    xx, yy, zz, xy, xz, yz = tensor
    I = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])  # noqa: E741
    with np.errstate(all='ignore'):
        try:
            check(MassProperties(mass, np.zeros(3), I))
        except (ValueError, np.linalg.LinAlgError) as error:
            if not is_allowed:
                raise ValueError(f'{error}: {_MEND}') from None
        else:
            return tuple(tensor), ''
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
    return (I[0, 0].item(), I[1, 1].item(), I[2, 2].item(), I[0, 1].item(), I[0, 2].item(),
            I[1, 2].item()), f'principal moments {how} kg m^2 are taken as {after}'
