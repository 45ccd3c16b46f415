# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The first event on the way of some bodies: which pair of shapes meets, or sinks in, and when.

The gap of a pair is followed by conservative advancement. Along the normal n shapes cannot
approach faster than a bound mu, so they are apart until gap / mu has passed (Mirtich,
Impulse-based Dynamic Simulation, PhD thesis, Berkeley 1996, section 2.3). What turns fast, or
leaves, has a large mu and hardly approaches. How far n parts it at a later time T is cheap to
find, and between two times no point is farther from its chord than its acceleration A bends it, A
t (T - t) / 2: so the gap along n is at least

    (1 - t / T) gap_0 + t / T gap_T - A t (T - t) / 2.

No speed and no thinness makes a pair slip through.
"""

import math

from rigid_sim_ros.engine.detection.backtrack import (
    crossing, film, LEAST_ADVANCE, least_stage, pair_gap, sinking, STAGES)
from rigid_sim_ros.engine.detection.manifolds import Scratch
from rigid_sim_ros.engine.detection.motion_ahead import (
    approach_bound, place_ahead, turning_bend)
from rigid_sim_ros.engine.detection.support import separation
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.maths.algebra import add_scaled, column, dot, scale
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes, smaller
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

# The next time that is tried, where a pair may meet before one, is this part of it.
SOONER = 0.25


@kernel
def meeting(model: Model, state: State, loads: Loads, shapes: Shapes, a: int, b: int, gap: float,
            n: Vector, until: float, pose: Array, scratch: Scratch) -> float:
    """
    Return when [s] two shapes apart with the normal n first touch; inf: not before `until`.

    `until` is also the time scale of the least advance.
    """
    t, level = 0.0, film(shapes, a, b)
    gap -= level
    while True:
        back = (-n[0], -n[1], -n[2])
        speed = (approach_bound(model, state, loads, shapes, a, n, until)
                 + approach_bound(model, state, loads, shapes, b, back, until))
        if speed * (until - t) < gap:
            return math.inf
        least = least_stage(shapes, a, b, speed, LEAST_ADVANCE * STAGES * until)
        far = _advance(model, state, loads, shapes, a, b, t, gap, n, level, gap / speed, least,
                       until, pose)
        if t + far >= until:
            return math.inf
        later = min(t + max(far, least), until)
        then, n = pair_gap(model, state, loads, shapes, a, b, later, pose, scratch)
        then -= level
        if then <= 0.0:
            return crossing(model, state, loads, shapes, a, b, t, later, gap + level, then + level,
                            level, pose, scratch)
        if later >= until:
            return math.inf
        t, gap = later, then


@kernel
def _advance(model: Model, state: State, loads: Loads, shapes: Shapes, a: int, b: int, t: float,
             gap: float, n: Vector, level: float, far: float, least: float, until: float,
             pose: Array) -> float:
    """
    Return how long [s] after t two shapes stay apart along n, which now parts them by a gap.

    The gap and what n parts are above a `level` [m]. `far` [s]: it is known already that they stay
    apart for so long. The poses are those of t.
    """
    gap = min(gap, separation(pose, shapes, a, b, n) - level)
    pull = dot(n, add_scaled(scale(model.inv_m[shapes.body[b]], column(loads.F, shapes.body[b])),
                             -model.inv_m[shapes.body[a]], column(loads.F, shapes.body[a])))
    bend = (max(pull, 0.0) + turning_bend(model, state, loads, shapes, a, until)
            + turning_bend(model, state, loads, shapes, b, until))
    span = until - t if gap > 0.0 and bend < math.inf else 0.0
    while span > max(far, least):
        place_ahead(model, state, loads, shapes, a, t + span, pose)
        place_ahead(model, state, loads, shapes, b, t + span, pose)
        rate = (separation(pose, shapes, a, b, n) - level - gap) / span - 0.5 * bend * span
        # The first zero of gap + rate s + bend s^2 / 2.
        square = rate * rate - 2.0 * bend * gap
        safe = 2.0 * gap / (math.sqrt(square) - rate) if rate < 0.0 <= square else span
        far = max(far, min(safe, span))
        if safe >= span:
            break
        span *= SOONER
    return far


@kernel
def first_event(model: Model, state: State, loads: Loads, shapes: Shapes, pairs: IntArray,
                count: int,
                allowed: Array, overlap: float, until: float, pose: Array,
                scratch: Scratch) -> tuple[float, int]:
    """
    Return when [s] the first of `count` pairs meets, and which; (until, -1) if none does.

    allowed, (p,), is 0 for pairs that are apart. A pair that touches already has how deep [m, < 0]
    it may get during the step; it counts as an event when it is deeper than that in the end, or
    where it could get through, and then from the time at which it got there. What is deeper
    already may not get deeper by more than `overlap` of the smaller shape. `allowed` then holds
    what was allowed.
    """
    best, which = until, -1
    for k in range(count):
        a, b = pairs[k, 0], pairs[k, 1]
        gap, n = pair_gap(model, state, loads, shapes, a, b, 0.0, pose, scratch)
        level = allowed[k]
        if level < 0.0 or gap <= film(shapes, a, b):
            # The points of a manifold may miss the deepest one by rounding, or by UNSEEN.
            most = overlap * smaller(shapes, a, b)
            level = min(level, gap - most, -most)
            allowed[k] = level
        if level == 0.0:
            t = meeting(model, state, loads, shapes, a, b, gap, n, best, pose, scratch)
            if t < best:
                best, which = t, k
            continue
        t = sinking(model, state, loads, shapes, a, b, gap, n, level, 0.0, until, pose, scratch)
        if t < best:
            best, which = t, k
    return best, which
