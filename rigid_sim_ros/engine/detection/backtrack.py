# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
When bodies meet.

How far and how fast shapes move within a step has bounds (motion_ahead.py), by which
first_event.py follows the gap of a pair. Where it changes its sign the time is found by the ITP
method, which has the worst case of bisection and converges faster than the secant rule (Oliveira,
Takahashi, An enhancement of the bisection method average performance, ACM Trans. Math. Softw. 47
(2021)).
"""

import math

from rigid_sim_ros.engine.detection.manifolds import Scratch
from rigid_sim_ros.engine.detection.motion_ahead import approach_bound, place_ahead
from rigid_sim_ros.engine.detection.narrow_phase.collide import BOXES, collide, CONVEX, FAMILY
from rigid_sim_ros.engine.detection.narrow_phase.signed_distance import signed_distance
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes, smaller
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

# Of a step: the time of a meeting is known to this, or the gap at it to GAP, a part of the smaller
# shape, whichever comes first. Where an event is soon followed by the next, 1e-9 of a step was
# 1e-5 of the way to it.
TIME = 1e-14
GAP = 1e-12
# Shapes that graze advance by at least this part of a step: a dent of less than that duration may
# be missed.
LEAST_ADVANCE = 1.0 / 1024.0
# Stages in which a meeting within a step is looked for, of what is not thin: what touches for less
# than one, and not deeply, is missed.
STAGES = 16
# Of the smaller shape: those without a formula for their distance touch at this gap. At 0 the
# iteration that finds the distance has no direction left to take the normal from. 1e-11 would make
# the normal noisy; 1e-8 is unseen.
FILM = 1e-8
# Boxes nearer than this part of their size are measured along their separating axes.
NEAR = 1e-2
# Of half of the least that the thinner of two shapes measures across: by so much overlaps may grow
# where nothing stops them. With more they might be pushed out on the other side.
DEEPER = 0.25
MAX_STEPS = 80  # of ITP; bisection would halve a second to 1e-12 s with 40


@kernel
def pair_gap(model: Model, state: State, loads: Loads, shapes: Shapes, a: int, b: int, t: float,
             pose: Array, scratch: Scratch) -> tuple[float, Vector]:
    """Return the gap [m] of two shapes after t [s], and the normal from A to B."""
    place_ahead(model, state, loads, shapes, a, t, pose)
    place_ahead(model, state, loads, shapes, b, t, pose)
    gap, n, _, _ = signed_distance(pose, shapes, a, b, scratch)
    if FAMILY[shapes.kind[a], shapes.kind[b]] == BOXES and gap < NEAR * shapes.bound[a]:
        # The distance of thin boxes is 0 to rounding while the overlap is slight; separating axes
        # see it.
        count, axis = collide(pose, shapes, a, b, NEAR * shapes.bound[a], 0.0, scratch)
        for k in range(count):
            if scratch.points[k, 3] < gap:
                gap, n = scratch.points[k, 3], axis
    return gap, n


@kernel
def least_stage(shapes: Shapes, a: int, b: int, speed: float, left: float) -> float:
    """
    Return how long [s] two shapes go on at the least between two looks, `left` [s] in STAGES.

    At no more than `speed` [m/s] they go no farther than both are thick, or would be through each
    other, unseen; but not less than the part LEAST_ADVANCE of a stage.
    """
    most = left / STAGES
    thick = shapes.half_width[a] + shapes.half_width[b]
    return max(LEAST_ADVANCE * most, min(most, thick / speed if speed > 0.0 else most))


@kernel
def film(shapes: Shapes, a: int, b: int) -> float:
    """Return the gap [m] at which two shapes touch: FILM where an iteration finds it, else 0."""
    if FAMILY[shapes.kind[a], shapes.kind[b]] == CONVEX:
        return FILM * smaller(shapes, a, b)
    return 0.0


@kernel
def crossing(model: Model, state: State, loads: Loads, shapes: Shapes, a: int, b: int, low: float,
             high: float, gap_low: float, gap_high: float, level: float, pose: Array,
             scratch: Scratch) -> float:
    """
    Return the time in (low, high] [s] at which the gap of two shapes falls to `level` [m].

    gap_low > level >= gap_high are the gaps at the ends. The answer is the end of the last
    interval at which the gap is not above the level. ITP with kappa_1 = 0.2 / (high - low),
    kappa_2 = 2, n_0 = 1.
    """
    y_low, y_high = gap_low - level, gap_high - level
    width, brief, fine = high - low, TIME * model.h, GAP * smaller(shapes, a, b)
    steps = max(0.0, math.ceil(math.log2(max(width / brief, 1.0)))) + 1.0
    kappa = 0.2 / width
    for j in range(MAX_STEPS):
        if high - low <= brief or y_high >= -fine:
            break
        middle = 0.5 * (low + high)
        radius = max(0.0, 0.5 * brief * 2.0 ** (steps - j) - 0.5 * (high - low))
        # Interpolate, truncate towards the middle, project into the range that bisection
        # guarantees.
        falsi = (y_high * low - y_low * high) / (y_high - y_low)
        side = 1.0 if middle >= falsi else -1.0
        shift = kappa * (high - low) ** 2
        t = falsi + side * shift if shift <= abs(middle - falsi) else middle
        if abs(t - middle) > radius:
            t = middle - side * radius
        if not low < t < high:
            t = middle
        y = pair_gap(model, state, loads, shapes, a, b, t, pose, scratch)[0] - level
        if y > 0.0:
            low, y_low = t, y
        else:
            high, y_high = t, y
    return high


@kernel
def first_passage(model: Model, state: State, loads: Loads, shapes: Shapes, pairs: IntArray,
                  count: int, until: float, pose: Array,
                  scratch: Scratch) -> tuple[float, int]:
    """
    Return when [s] the first of `count` pairs gets so deep that it might get through, and which.

    That is (until, -1) if none does. Whether they touch yet or not: deeper than now by DEEPER.
    """
    best, which = until, -1
    for k in range(count):
        t = passage(model, state, loads, shapes, pairs[k, 0], pairs[k, 1], 0.0, until, pose,
                    scratch)
        if t < best:
            best, which = t, k
    return best, which


@kernel
def passage(model: Model, state: State, loads: Loads, shapes: Shapes, a: int, b: int,
            begin: float, until: float, pose: Array, scratch: Scratch) -> float:
    """
    Return when [s] two shapes get so deep that they might get through; inf: they do not.

    From `begin` to `until` [s] after the time of the state.
    """
    gap, n = pair_gap(model, state, loads, shapes, a, b, begin, pose, scratch)
    level = deepest(shapes, a, b, gap)
    return sinking(model, state, loads, shapes, a, b, gap, n, level, begin, until, pose, scratch)


@kernel
def deepest(shapes: Shapes, a: int, b: int, gap: float) -> float:
    """Return how deep [m, < 0] two shapes may get that are `gap` apart now, whatever pushes."""
    return min(gap, 0.0) - DEEPER * min(shapes.half_width[a], shapes.half_width[b])


@kernel
def sinking(model: Model, state: State, loads: Loads, shapes: Shapes, a: int, b: int, gap: float,
            n: Vector, level: float, begin: float, until: float, pose: Array,
            scratch: Scratch) -> float:
    """
    Return when [s] the gap of two shapes fell below a `level` [m, < 0]; inf: it did not.

    It is asked at the end: a pair may get deeper and come back. Where they may be through each
    other by then, which takes as long a way as both are thick, it is asked on the way as well.
    `until` is not the best time so far: what is seen must not depend on which pairs were asked
    before.
    """
    # Along the normal of `begin`: no overlap is deeper than that.
    back = (-n[0], -n[1], -n[2])
    left = until - begin
    way = left * (approach_bound(model, state, loads, shapes, a, n, until)
                  + approach_bound(model, state, loads, shapes, b, back, until))
    if gap - way >= level:
        return math.inf
    parts = max(1.0, min(math.ceil(way / (shapes.half_width[a] + shapes.half_width[b])),
                         1.0 / LEAST_ADVANCE))
    before, then = begin, gap
    for k in range(int(parts)):
        t = begin + left * (k + 1) / parts
        above, then = then, pair_gap(model, state, loads, shapes, a, b, t, pose, scratch)[0]
        if then < level:
            return crossing(model, state, loads, shapes, a, b, before, t, above, then, level,
                            pose, scratch)
        before = t
    return math.inf
