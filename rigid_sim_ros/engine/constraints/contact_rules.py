# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a visit of the sequential solver demands of a point, whatever block it is in."""

from typing import NamedTuple

from rigid_sim_ros.engine.constraints.contact_blocks import (
    APPROACH, GAP, IMPULSE, MASS, SIZE, SPEED, TURN, Two)
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.eight import any_of, Eight, load, Mask, root, select
from rigid_sim_ros.kernels.kernel import inlined, part

# Lengths that are tolerances, in parts of the size of the smaller shape of a pair.
# Shapes this near to each other touch. Below it, velocities do not depend on the gap, nor does the
# push before there is an overlap: in between nothing can oscillate. 0: a stack of five rocks for
# ever by micrometres that grow; larger: contacts rest this far apart.
SKIN = 2e-5
# An overlap that is not pushed apart.
NEGLIGIBLE = 1e-6
# A visit that changes a velocity by less than what moves a shape by this part of its size in a
# substep has nothing left to do there. Nothing stands upright on a single point, so that a small
# error could tilt it; and a heap of thousands of balls never stops to roll a little.
SETTLED, SETTLED_POINT = 1e-9, 1e-8
# What is deeper than this is pushed apart as if it were so deep: more throws what starts inside
# another.
DEEPEST_PUSH = 0.1


# A contact that lasts approaches a little as long as its impulse does not bear all of the forces,
# and has to learn that by itself. Something else hit its bodies where it approaches so many times
# faster than what counts as an impact of what has just closed.
LASTING = 16.0


class Sweep(NamedTuple):
    """What a visit is for."""

    inv_h: float  # 1 / length of the substep [1/s]
    forces: bool  # of the forces of a substep; else of an impact, before they act
    # How far the end of the substep is from the middle of the step, as a part of the step:
    # contacts have the geometry of the middle of the step, and TURN is how fast it changes.
    when: float


@inlined
def settled(points: int) -> float:
    """Return SETTLED or SETTLED_POINT, as a manifold may have one or more points."""
    return SETTLED_POINT if points == 1 else SETTLED


@part
def gap_of(b: Array, point: int) -> Eight:
    """Return how far a point is from touching [m]."""
    return max(load(b, point + GAP) - SKIN * load(b, SIZE), 0.0)


@part
def least_speed(b: Array, point: int, what: Sweep) -> Eight:
    """
    Return the negative of the least normal velocity that is allowed at a point [m/s].

    By which the gap closes just within the substep, as the geometry will be at its end. What
    an impact has not stopped yet, forces do not stop either: the next substep would begin with
    that impulse. And an impact only stops: by speeds that it asked for it would make energy.
    """
    allowed, turn = gap_of(b, point) * what.inv_h, what.when * load(b, point + TURN)
    if what.forces:
        return max(allowed, load(b, point + APPROACH)) + turn
    return allowed + max(turn, 0.0)


@part
def approach_of(speed: Eight, was_open: Mask) -> Eight:
    """Return how fast a point approaches, as what has just closed would with the same effect."""
    return select(was_open, speed, (1.0 / LASTING) * speed)


@part
def is_open(b: Array, point: int) -> Mask:
    """Return whether a point does not touch."""
    return load(b, point + GAP) > SKIN * load(b, SIZE)


@part
def normal_impulse(b: Array, point: int, speed: Eight, what: Sweep, mask: Mask) -> Eight:
    """
    Return the impulse >= 0 with which a point moves no slower than `least_speed` allows [N s].

    `speed` is its normal velocity with the present one, which stays in lanes outside of the mask.
    """
    old = load(b, point + IMPULSE)
    new = max(old - load(b, point + MASS) * (speed + least_speed(b, point, what)), 0.0)
    return select(mask, new, old)


@part
def bounded_step(old: Two, step: Eight, rate: Two, limit: Eight) -> Two:
    """
    Return two impulses after a step against the velocity `rate`, at most `limit` long.

    What is longer is brought back to that circle, along the radius: Coulomb's law, and that of the
    resistance to rolling.
    """
    x, y = old[0] - step * rate[0], old[1] - step * rate[1]
    square = x * x + y * y
    outside = square > limit * limit
    if any_of(outside):
        back = select(outside, limit / root(square), 1.0)
        x, y = back * x, back * y
    return (x, y)


@part
def overlap_of(b: Array, point: int) -> Eight:
    """Return how deep a point overlaps, as far as it is pushed apart [m]."""
    size, gap = load(b, SIZE), load(b, point + GAP)
    return min(select(gap < -NEGLIGIBLE * size, -gap, 0.0), DEEPEST_PUSH * size)


@part
def wanted_of(b: Array, point: int, rate: float, mask: Mask) -> Eight:
    """
    Return the speed by which a point leaves its overlap too slowly, 0 without one [m/s].

    In the lanes of the mask; in others 0: what was not visited has no SPEED.
    """
    push = rate * overlap_of(b, point)
    return select(mask, max(push - max(load(b, point + SPEED), 0.0), 0.0), 0.0)
