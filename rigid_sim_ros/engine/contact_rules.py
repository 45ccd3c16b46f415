# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a visit of the sequential solver demands of a point, whatever block it is in."""

from typing import NamedTuple

from rigid_sim_ros.engine.arrays import Array
from rigid_sim_ros.engine.contact_blocks import GAP, SPEED
from rigid_sim_ros.engine.kernel import part
from rigid_sim_ros.engine.lanes import Eight, load, root, select

# Bodies this near to each other touch [m]. Below it, velocities do not depend on the gap, nor does
# the push before there is an overlap: in between nothing can oscillate. 0: a stack of five rocks
# for ever by micrometres that grow; larger: contacts rest this far apart.
SKIN = 2e-5
# An overlap that is not pushed apart [m].
NEGLIGIBLE = 1e-6


class Sweep(NamedTuple):
    """What a visit is for."""

    inv_h: float  # 1 / length of the substep [1/s]
    drift: float  # [s] the bodies moved for this long since the last visit; 0: they did not
    begins: bool  # whether they did so for the first time in this step


@part
def gap_of(b: Array, point: int) -> Eight:
    """Return how far a point is from touching [m]."""
    return max(load(b, point + GAP) - SKIN, 0.0)


@part
def wanted_of(b: Array, point: int, rate: float, speed: float) -> Eight:
    """Return the speed by which a point leaves its overlap too slowly, 0 without one [m/s]."""
    push = min(-rate * min(load(b, point + GAP), 0.0), speed)
    return max(push - max(load(b, point + SPEED), 0.0), 0.0)


@part
def onto_circle(x: Eight, y: Eight, radius: Eight) -> Eight:
    """Return the factor that brings (x, y) back to a circle from outside."""
    square = x * x + y * y
    return select(square > radius * radius, radius / root(square), 1.0)
