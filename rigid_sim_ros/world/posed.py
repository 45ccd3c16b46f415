# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How bodies that nothing pushes get their motion: from a twist, or from poses one after another.

A kinematic body goes on with the twist that it was given. A pose is reached as follows:

- With a twist that is not 0 the body is put there at once and keeps the twist.
- Else, when another pose was set T steps before and that is no longer ago than SERIES, the body
  moves there in T steps, with one twist. So it is where poses that are set in every step say, at
  the end of the step, and poses that come 50 times a second join to a smooth motion.
- The first pose of such a series is reached at the end of the next step.
- A jump is no motion: farther than the body's own size in a step, and for the first pose also
  faster than a fall through that size ends, v = sqrt(2 g size). Then the body is put there at once
  and stands still, so that what lies on it is not thrown.
"""

from collections.abc import Mapping
import math

import numpy as np

from rigid_sim_ros.engine.dynamics.kinematic import approach, LASTS, sizes
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.state import BodyMotion, State, write_motion
from rigid_sim_ros.kernels.arrays import IntArray

SERIES = 0.1    # [s] poses that follow each other within this time are one motion
# What of this, and of the state, is saved for the bodies that nothing pushes.
FIELDS = ('V', 'left', 'posed_at', 'posed_after')
_NEVER = -1


class Posed:
    """When the poses of the bodies that nothing pushes were set."""

    def __init__(self, model: Model, shapes: Shapes) -> None:
        """Begin with none that was set."""
        n = len(model.m)
        self._model = model
        self._size = sizes(model, shapes)
        self._g = math.hypot(*model.gravity.tolist())
        self._at: IntArray = np.full(n, _NEVER)     # the step before which it was set last
        self._after: IntArray = np.zeros(n, dtype=np.int64)     # steps since the time before; 0

    def put(self, state: State, motion: BodyMotion, i: int, step: int) -> None:
        """Let body i reach its row of poses; `step` is the number of steps that are over."""
        since = step - int(self._at[i])
        if since > 0 or self._at[i] == _NEVER:
            in_series = self._at[i] != _NEVER and since * self._model.h <= SERIES
            self._at[i], self._after[i] = step, since if in_series else 0
        if state.twist_steps_left[i] == LASTS and state.V[:, i].any():
            write_motion(self._model, state, motion, i)
            return
        steps, size = int(self._after[i]), float(self._size[i])
        fastest = math.inf if steps > 0 else math.sqrt(2.0 * self._g * size)
        if not approach(self._model, state, motion, i, max(steps, 1), size, fastest):
            motion.linear[i], motion.angular[i] = 0.0, 0.0
            write_motion(self._model, state, motion, i)
            state.twist_steps_left[i] = 0

    def turn(self, state: State, motion: BodyMotion, i: int) -> None:
        """Let body i go on with its row of twists."""
        write_motion(self._model, state, motion, i)
        state.twist_steps_left[i] = LASTS
        self._at[i], self._after[i] = _NEVER, 0

    def clear(self) -> None:
        """Forget all."""
        self._at[:], self._after[:] = _NEVER, 0

    def rows(self, state: State) -> dict[str, np.ndarray]:
        """Return what the next steps depend on, of the bodies that nothing pushes, by FIELDS."""
        i = self._model.fixed
        return dict(zip(FIELDS, (state.V[:, i], state.twist_steps_left[i], self._at[i],
                                 self._after[i]), strict=True))

    def replace(self, state: State, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to what `rows` returned; what was saved before there was any of it stands."""
        i = self._model.fixed
        state.V[:], state.twist_steps_left[:] = 0.0, 0
        self.clear()
        if FIELDS[0] in arrays:
            state.V[:, i], state.twist_steps_left[i], self._at[i], self._after[i] = (
                arrays[name] for name in FIELDS)
