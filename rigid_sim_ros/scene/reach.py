# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far away and how fast bodies are, compared with the bounds of a scene."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.rates import angular_velocity
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.kernel import in_python
from rigid_sim_ros.scene.schema import Bounds, FAR

_angular_velocity: Any = in_python(angular_velocity)

# By the key of the bound in `world: {bounds: {}}`: what it is of, and its unit.
QUANTITIES = {'position': ('position', 'm'), 'linear': ('linear velocity', 'm/s'),
              'angular': ('angular velocity', 'rad/s')}


def reached(model: Model, state: State) -> dict[str, Array]:
    """Return position, velocity and angular velocity of centres of mass, (3, n), as QUANTITIES."""
    with np.errstate(over='ignore', invalid='ignore'):
        w = np.array(_angular_velocity(state.q, state.L, model.inv_I_C))
        return {'position': state.x, 'linear': state.V[:3] + state.P * model.inv_m,
                'angular': state.V[3:] + w}


def far_beyond(bounds: Bounds, model: Model, state: State) -> Iterator[tuple[int, str]]:
    """Give each body that is so far beyond a bound that its state could not be restored."""
    for key, values in reached(model, state).items():
        what, unit = QUANTITIES[key]
        bound: float = FAR * getattr(bounds, key)
        most = np.abs(values).max(axis=0)
        # Not `> bound`: what is not a number is not within the bound either.
        for i in np.flatnonzero(~(most <= bound)).tolist():
            yield i, (f'begins with a {what} of {most[i]:g} {unit}, must be within {bound:g} '
                      f'{unit}, {FAR:g} times what `world: {{bounds: {{{key}: ...}}}}` says')
