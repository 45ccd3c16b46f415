# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How fast the forces of a scene may change a velocity, which bounds the step for them."""

from collections.abc import Mapping
import math
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.model.model import Model, WORLD
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array


class Rates(NamedTuple):
    """How fast a force acts on the bodies at its ends, as upper bounds."""

    oscillation: float = 0.0  # [rad/s]
    damping: float = 0.0  # [1/s]


class ForceRow(NamedTuple):
    """One row of the force table, with what its ends weigh."""

    model: Model
    state: State
    a: int  # frames
    b: int
    values: Mapping[str, Array]  # of its parameters, by name

    def scalar(self, name: str) -> float:
        """Return the number of a parameter."""
        return float(self.values[name][0])

    def inv_m(self, frame: int) -> float:
        """Return 1 / mass [1/kg] of the body of a frame, 0 for what cannot move."""
        return 0.0 if frame == WORLD else float(self.model.inv_m[self.model.frame_body[frame]])

    def inv_I(self, frame: int) -> float:
        """Return 1 / moment of inertia [1/(kg m^2)] about the axis that turns most easily."""
        if frame == WORLD:
            return 0.0
        return float(self.model.inv_I_C[:, self.model.frame_body[frame]].max())

    def inv_m_at(self, frame: int, offset: float = 0.0) -> float:
        """Return the most that a point of a frame, `offset` [m] from its origin, yields [1/kg]."""
        if frame == WORLD:
            return 0.0
        arm = float(np.linalg.norm(self.model.p_CF[frame])) + offset
        return self.inv_m(frame) + arm * arm * self.inv_I(frame)


def at_points(row: ForceRow) -> Rates:
    """Return the rates of a spring and damper between two points."""
    anchor = float(np.linalg.norm(row.values['anchor']))
    inv = row.inv_m_at(row.a) + row.inv_m_at(row.b, anchor)
    return Rates(math.sqrt(row.scalar('stiffness') * inv), row.scalar('damping') * inv)


def between_centres(row: ForceRow) -> Rates:
    """Return the rate of a spring between two centres of mass."""
    return Rates(math.sqrt(row.scalar('stiffness') * (row.inv_m(row.a) + row.inv_m(row.b))))


def between_axes(row: ForceRow) -> Rates:
    """Return the rates of a torsion spring and damper between two bodies."""
    inv = row.inv_I(row.a) + row.inv_I(row.b)
    return Rates(math.sqrt(row.scalar('stiffness') * inv), row.scalar('damping') * inv)


def in_air(row: ForceRow) -> Rates:
    """Return the rates of drag, which grow with the speed: those of the speed of the state."""
    inv_m, inv_I = row.inv_m(row.a), row.inv_I(row.a)
    body = row.model.frame_body[row.a]
    v = inv_m * row.state.P[:, body] - row.values['velocity']
    w = inv_I * np.linalg.norm(row.state.L[:, body])
    return Rates(damping=max(
        inv_m * (row.scalar('drag') + row.scalar('quadratic_drag') * float(np.linalg.norm(v))),
        inv_I * (row.scalar('angular_drag') + row.scalar('quadratic_angular_drag') * float(w))))
