# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
When bodies meet.

Within a step the loads are constant, so the pose of a body at any time of the step follows from
its state at the start alone. How far and how fast shapes move until then has bounds, by which
first_event.py follows the gap of a pair. Where it changes its sign the time is found by the ITP
method, which has the worst case of bisection and converges faster than the secant rule (Oliveira,
Takahashi, An enhancement of the bisection method average performance, ACM Trans. Math. Softw. 47
(2021)).
"""

import math


from rigid_sim_ros.engine.detection.broad_phase import may_collide
from rigid_sim_ros.engine.detection.manifolds import Scratch
from rigid_sim_ros.engine.detection.narrow_phase.collide import BOXES, collide, CONVEX, FAMILY
from rigid_sim_ros.engine.detection.narrow_phase.signed_distance import signed_distance
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.dynamics.free_rotation import turn_fast
from rigid_sim_ros.engine.dynamics.kinematic import (
    is_carried, pose_ahead, prescribed_spin, prescribed_velocity)
from rigid_sim_ros.engine.maths.algebra import (
    add_scaled, column, norm, quaternion, rotate, row, scale)
from rigid_sim_ros.engine.maths.rotation import multiply, to_matrix
from rigid_sim_ros.engine.model.kinds.table import is_ball, is_unbounded
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes, smaller
from rigid_sim_ros.engine.state.rates import fastest_turning
from rigid_sim_ros.engine.state.state import body_velocity, State
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
def place_ahead(model: Model, state: State, loads: Loads, shapes: Shapes, s: int, t: float,
                pose: Array) -> None:
    """
    Write row s of the shape poses as it will be after a step of t [s] under constant loads.

    The pose part of kick, drift, kick: x + t (P + t F / 2) / M, and the free rotation with L + t
    tau / 2.
    """
    i = shapes.body[s]
    q = quaternion(state.q, i)
    x = column(state.x, i)
    if model.inv_m[i] > 0.0:
        P, L = column(state.P, i), column(state.L, i)
        F, tau = column(loads.F, i), column(loads.tau, i)
        ahead = t * model.inv_m[i]
        x = (x[0] + ahead * (P[0] + 0.5 * t * F[0]), x[1] + ahead * (P[1] + 0.5 * t * F[1]),
             x[2] + ahead * (P[2] + 0.5 * t * F[2]))
        L = (L[0] + 0.5 * t * tau[0], L[1] + 0.5 * t * tau[1], L[2] + 0.5 * t * tau[2])
        if t != 0.0:
            q = turn_fast(q, L, column(model.inv_I_C, i), t)
    else:
        x, q = pose_ahead(state, i, t)
    r = rotate(q, row(shapes.p_CS, s))
    R = to_matrix(multiply(q, (shapes.q_CS[s, 0], shapes.q_CS[s, 1], shapes.q_CS[s, 2],
                               shapes.q_CS[s, 3])))
    for k in range(3):
        pose[s, k] = x[k] + r[k]
        for j in range(3):
            pose[s, 3 + 3 * k + j] = R[k][j]


@kernel
def way_ahead(model: Model, state: State, loads: Loads, i: int, t: float) -> Vector:
    """Return how far the centre of mass of a body moves in t [s] under constant loads [m]."""
    return scale(t, add_scaled(body_velocity(model, state, i), 0.5 * t * model.inv_m[i],
                               column(loads.F, i)))


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
def reach_of_turning(shapes: Shapes, s: int) -> float:
    """Return how far [m] from the centre of mass turning moves the surface of shape s."""
    offset = norm(row(shapes.p_CS, s))
    # A sphere around the centre of mass looks the same however it turns.
    return offset if is_ball(shapes.kind[s]) else offset + shapes.bound[s]


@kernel
def _prescribed_turning(state: State, shapes: Shapes, s: int) -> float:
    """Return how fast [m/s] a prescribed spin moves the surface of shape s, at most."""
    spin = norm(prescribed_spin(state, shapes.body[s]))
    # A plane that stands still reaches infinitely far: 0 times that is no number.
    return spin * reach_of_turning(shapes, s) if spin > 0.0 else 0.0


@kernel
def approach_bound(model: Model, state: State, loads: Loads, shapes: Shapes, s: int, n: Vector,
                   t: float) -> float:
    """Return a bound on how fast a point of shape s moves along n [m/s] until t [s]."""
    i = shapes.body[s]
    if model.inv_m[i] == 0.0:
        v = prescribed_velocity(state, i)
        return n[0] * v[0] + n[1] * v[1] + n[2] * v[2] + _prescribed_turning(state, shapes, s)
    P, L = column(state.P, i), column(state.L, i)
    F, tau = column(loads.F, i), column(loads.tau, i)
    now = model.inv_m[i] * (n[0] * P[0] + n[1] * P[1] + n[2] * P[2])
    later = now + t * model.inv_m[i] * (n[0] * F[0] + n[1] * F[1] + n[2] * F[2])
    # The bound is convex in L: its larger end holds for all of the time.
    turning = max(_turning(model, state, shapes, s, L),
                  _turning(model, state, shapes, s, add_scaled(L, t, tau)))
    return max(now, later) + turning


@kernel
def _turning(model: Model, state: State, shapes: Shapes, s: int, L: Vector) -> float:
    """Return how fast [m/s] a body that turns with L moves the surface of shape s, at most."""
    i = shapes.body[s]
    return fastest_turning(quaternion(state.q, i), L, column(model.inv_I_C, i),
                           reach_of_turning(shapes, s), shapes.mobility[i])


@kernel
def motion_bound(model: Model, state: State, loads: Loads, shapes: Shapes, s: int,
                 t: float) -> float:
    """Return how far [m] any point of shape s can move within t [s], at most."""
    i = shapes.body[s]
    if model.inv_m[i] == 0.0:
        if not is_carried(state, i):
            return 0.0
        return t * (norm(prescribed_velocity(state, i)) + _prescribed_turning(state, shapes, s))
    speed = model.inv_m[i] * (norm(column(state.P, i)) + t * norm(column(loads.F, i)))
    L, tau = column(state.L, i), column(loads.tau, i)
    turning = _turning(model, state, shapes, s, L)
    if norm(tau) > 0.0:
        turning += _turning(model, state, shapes, s, scale(t, tau))
    return t * (speed + turning)


@kernel
def turning_bend(model: Model, state: State, loads: Loads, shapes: Shapes, s: int,
                 t: float) -> float:
    """
    Return how fast [m/s^2] turning bends the ways of the points of shape s until t [s], at most.

    |dw/dt x r + w x (w x r)|, where dw/dt = I^-1 (tau - w x L), and |w x L| is at most |L|^2 times
    the difference of the largest and the least 1 / I.
    """
    i, reach = shapes.body[s], reach_of_turning(shapes, s)
    if reach == 0.0:
        return 0.0
    if model.inv_m[i] == 0.0:
        spin = norm(prescribed_spin(state, i))
        return spin * _prescribed_turning(state, shapes, s) if spin > 0.0 else 0.0
    L, tau, inv_I = column(state.L, i), column(loads.tau, i), column(model.inv_I_C, i)
    most, least = max(inv_I[0], inv_I[1], inv_I[2]), min(inv_I[0], inv_I[1], inv_I[2])
    long = norm(L) + t * norm(tau)
    turning = _turning(model, state, shapes, s, L)
    if norm(tau) > 0.0:
        turning += _turning(model, state, shapes, s, scale(t, tau))
    return (most * long * turning
            + most * reach * (norm(tau) + (most - least) * long * long))


@kernel
def pairs_ahead(model: Model, state: State, loads: Loads, shapes: Shapes, t: float, pose: Array,
                radius: Array, low: Array, order: IntArray, pairs: IntArray) -> int:
    """
    Write the pairs of shapes (p, 2) that may meet within t [s], sorted; return how many there are.

    Where that is more than the room, only some were written. Spheres around the shapes, larger by
    their motion: those of shapes that move are sorted along x and swept, those of the others are
    looked up among them, so that a large ground costs little. radius, low and order, (s,), are
    scratch.
    """
    count = shapes.body.shape[0]
    for s in range(count):
        place_ahead(model, state, loads, shapes, s, 0.0, pose)
        radius[s] = shapes.bound[s] + motion_bound(model, state, loads, shapes, s, t)
    return pairs_near(model, shapes, pose, radius, low, order, pairs)


@kernel
def pairs_near(model: Model, shapes: Shapes, pose: Array, radius: Array, low: Array,
               order: IntArray, pairs: IntArray) -> int:
    """Write the pairs of shapes whose spheres of given radii [m] meet; low, order are scratch."""
    count, movers, widest, found = shapes.body.shape[0], 0, 0.0, 0
    for s in range(count):
        low[s] = pose[s, 0] - radius[s]
        if shapes.still[s] == 0:
            at = movers
            while at > 0 and low[order[at - 1]] > low[s]:
                order[at] = order[at - 1]
                at -= 1
            order[at] = s
            movers, widest = movers + 1, max(widest, 2.0 * radius[s])
    for s in range(count):
        # Of what moves, all that may reach back to the lower end begin after this.
        first = (_first_from(low, order, movers, low[s] - widest) if shapes.still[s] == 1
                 else movers)
        for j in range(first, movers):
            if low[order[j]] > pose[s, 0] + radius[s]:
                break
            found = _add_near(model, shapes, pose, radius, s, order[j], found, pairs)
    for i in range(movers):
        s = order[i]
        for j in range(i + 1, movers):
            if low[order[j]] > pose[s, 0] + radius[s]:
                break
            found = _add_near(model, shapes, pose, radius, s, order[j], found, pairs)
    if found <= pairs.shape[0]:
        _sort(pairs, found)
    return found


@kernel
def _first_from(low: Array, order: IntArray, count: int, x: float) -> int:
    """Return the first place in `order`, sorted by `low`, whose lower end is at least x [m]."""
    first, last = 0, count
    while first < last:
        middle = (first + last) // 2
        if low[order[middle]] < x:
            first = middle + 1
        else:
            last = middle
    return first


@kernel
def _add_near(model: Model, shapes: Shapes, pose: Array, radius: Array, s: int, other: int,
              found: int, pairs: IntArray) -> int:
    """Add a pair that may meet, if there is room; return how many there are."""
    a, b = min(s, other), max(s, other)
    if not (near(shapes, pose, radius, a, b) and may_collide(shapes, model.m.shape[0], a, b)):
        return found
    if found < pairs.shape[0]:
        pairs[found, 0], pairs[found, 1] = a, b
    return found + 1


@kernel
def _sort(pairs: IntArray, count: int) -> None:
    """Sort rows by their first, then their second number, by insertion."""
    for k in range(1, count):
        a, b = pairs[k, 0], pairs[k, 1]
        at = k
        while at > 0 and (pairs[at - 1, 0] > a or (pairs[at - 1, 0] == a and pairs[at - 1,
                                                                                   1] > b)):
            pairs[at, 0], pairs[at, 1] = pairs[at - 1, 0], pairs[at - 1, 1]
            at -= 1
        pairs[at, 0], pairs[at, 1] = a, b


@kernel
def near(shapes: Shapes, pose: Array, radius: Array, a: int, b: int) -> bool:
    """Return whether the spheres around two shapes, or a sphere and a half space, may meet."""
    return _near(shapes, pose, radius, a, b) and _near(shapes, pose, radius, b, a)


@kernel
def _near(shapes: Shapes, pose: Array, radius: Array, a: int, b: int) -> bool:
    """Return whether the sphere around b may reach the sphere or the half space of a."""
    d = (pose[b, 0] - pose[a, 0], pose[b, 1] - pose[a, 1], pose[b, 2] - pose[a, 2])
    if is_unbounded(shapes.kind[a]):
        return d[0] * pose[a, 5] + d[1] * pose[a, 8] + d[2] * pose[a, 11] <= radius[b]
    return norm(d) <= radius[a] + radius[b]


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
