# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Contacts as they will be in the middle of the time in which they act.

Detection finds contacts at the start of a step. There the lever of what rolls or rocks is of first
order: a step that holds the velocity there to 0 leaves the surface by w^2 r h^2 / 2, and closing
that gap would lift the body for nothing. So contacts that touch and move get the normal and the
points of the middle of the step, and the rate at which the geometry alone changes their velocity,

    u(t) = u(h / 2) + (t - h / 2) du/dt,    h du/dt = 2 (u(h / 2) - u(0)) at unchanged P and L,

(the second part of d'' in Meyer, Rigid Body Dynamics, "Resting Contact"), which makes the step of
second order. Contacts that do not touch yet act in this step only if the pair meets within it on
its way; then they get the normal and the points of that moment. That is found by conservative
advancement; see backtrack.py. What does not meet is dormant: the distance along the normal of the
start would tell a body that passes an edge that it runs into it. It wakes when an impact in this
step changes the way of one of its bodies; see impacts.py.

So it is with what is within the skin in which contacts rest, as long as no contact pressed either
body in the step before: then the way is known, and a body that passes within a hundred thousandth
of its size is not touched. What contacts press may go elsewhere, and rests or not.
"""

import math
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.classify import classify, COLLIDING
from rigid_sim_ros.engine.contact.collisions import bounces, slowest_bounce
from rigid_sim_ros.engine.detection.backtrack import least_stage, pair_gap
from rigid_sim_ros.engine.detection.manifold_rows import is_mended
from rigid_sim_ros.engine.detection.manifolds import (
    ACTS, DORMANT, forget_impulses, Manifolds, POINTS, rows_in_use, Scratch,
    smallest_gap)
from rigid_sim_ros.engine.detection.motion_ahead import approach_bound, place_ahead, way_ahead
from rigid_sim_ros.engine.detection.narrow_phase.collide import collide
from rigid_sim_ros.engine.detection.narrow_phase.surface import meets_face
from rigid_sim_ros.engine.dynamics.force_and_torque import empty_loads, Loads
from rigid_sim_ros.engine.dynamics.free_rotation import are_alike, turn_fast
from rigid_sim_ros.engine.dynamics.kinematic import prescribed_spin
from rigid_sim_ros.engine.maths.rotation import quaternion
from rigid_sim_ros.engine.maths.vector import (
    add, add_scaled, column, cross, dot, norm, row, scale, subtract)
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes, smaller
from rigid_sim_ros.engine.state.rates import angular_velocity
from rigid_sim_ros.engine.state.state import body_velocity, State
from rigid_sim_ros.kernels.arrays import Array, IntArray, room, Vector
from rigid_sim_ros.kernels.kernel import INDEX, kernel

# Parts of the size of the smaller shape of a pair: what moves less in a step meets nothing; what
# moves less has the geometry of its start, which for a turn by a in a step is right to a^2 / 8;
# what is nearer than twice the skin touches; what comes nearer has met.
STILL, SLOW, TOUCHING, MET = 1e-6, 1e-4, 4e-5, 1e-6
# [rad] What turns less in half of a step has the angular velocity of its start: the surface comes
# nearer by the square of that, in sizes.
TURNED = 1e-3
# [rad] What turns farther in a step may meet with a side that is near to nothing as it begins.
FAR = 0.05
# [rad] What turns farther in a step moves its points along more than a bow: their mean velocity is
# not that of the middle, and the rate at which it changes there says nothing of the whole.
MOST_TURNED = 1.0
# So often the time of a meeting is put earlier at most, until nothing overlaps: what overlaps
# has no direction between what is nearest.
EARLIER = 12
TINY = 1e-300
# Of the least speed that bounces: an impulse that makes less presses nothing.
PRESSES = 1e-6
# cos 25 deg: a normal that turns farther in half of a step belongs to another feature.
SAME_NORMAL = 0.9
AHEAD, AFTERWARDS = 1, 2  # a manifold got other points before, or after, bodies collided; 0: none
# Columns of `Prediction.old`: of the points that detection found.
_GAP, _IMPULSE, _ALONG, _U, _OLD = 0, 1, 2, 3, 6


class Prediction(NamedTuple):
    """Buffers for c manifolds, s shapes; rows are those of the manifolds."""

    given: IntArray  # (c,) of 8 bits, AHEAD or AFTERWARDS where the next ones hold something
    turn: Array  # (POINTS, c) [m/s] what geometry adds to the normal velocity of a point in a step
    turn_t: Array  # (c, 3) [m/s] and to the sliding velocity, world axes
    # (c, 3) [m] from the start of the step to where a manifold was found, how far the centre of
    # mass of B moved relative to that of A
    moved: Array
    shift: Array  # (c, 3) [m] and how far collisions had moved that of A, of AFTERWARDS
    gap: Array  # (POINTS, c) [m] of each point where a manifold was found
    pose: Array  # (s, 12) scratch, as in `Memory.pose`
    # (s, 12) poses in the middle of the step, of bodies that go on without a force; (n, 3) [rad/s]
    # the angular velocities then; of 8 bits, 1 where they are known in this step
    middle: Array
    middle_spin: Array
    is_placed: IntArray  # (s,)
    is_turned: IntArray  # (n,)
    old: Array  # (POINTS, 6) scratch
    pressed: IntArray  # (n,) of 8 bits, 1: a contact pressed the body in the step before
    no_loads: Loads  # of 0


def make_prediction(n: int, shapes: int, capacity: int) -> Prediction:
    """Return buffers for n bodies."""
    return Prediction(room(capacity, kind=np.int8), room(POINTS, capacity), room(capacity, 3),
                      room(capacity, 3), room(capacity, 3), room(POINTS, capacity),
                      room(shapes, 12), room(shapes, 12), room(n, 3), room(shapes, kind=np.int8),
                      room(n, kind=np.int8), np.zeros((POINTS, _OLD)), room(n, kind=np.int8),
                      empty_loads(n))


@kernel
def predict_contacts(model: Model, state: State, loads: Loads, shapes: Shapes,
                     materials: Materials, manifolds: Manifolds, pose: Array, margin: Array,
                     rest_margin: Array, activity: IntArray, prediction: Prediction,
                     scratch: Scratch) -> None:
    """
    Bring the manifolds to the time in which they act.

    activity (c,) becomes DORMANT where a pair does not meet as it moves, elsewhere ACTS; pose
    (s, 12), margin and rest_margin (s,) [m] are those of `Memory`.
    """
    first, count = rows_in_use(manifolds)
    known = False
    prediction.is_placed[:] = 0
    prediction.is_turned[:] = 0
    for k in range(count):
        r = (first + k) & INDEX
        activity[r], prediction.given[r] = ACTS, 0
        a, b = manifolds.shape_a[r] & INDEX, manifolds.shape_b[r] & INDEX
        size = min(shapes.bound[a], shapes.bound[b])
        moved = margin[a] + margin[b] - rest_margin[a] - rest_margin[b]
        if moved < STILL * size:
            continue
        # What is mended for what lies beside would, as a pair alone, be as it was before.
        gap, mended = smallest_gap(manifolds, r), is_mended(manifolds, r)
        near, may_pass = gap <= TOUCHING * size, False
        if near and gap > MET * size and not _presses(model, loads, shapes, manifolds, r):
            if not known:
                _mark_pressed(model, loads, shapes, manifolds, prediction.pressed)
                known = True
            may_pass = (prediction.pressed[manifolds.body_a[r] & INDEX]
                        + prediction.pressed[manifolds.body_b[r] & INDEX] == 0)
        if near and not may_pass:
            if moved > SLOW * size and not mended and not _bounces_at_once(
                    model, state, loads, shapes, materials, manifolds, r):
                _move_to_middle(model, state, shapes, manifolds, r, pose, margin[a] + margin[b],
                                moved, prediction, scratch)
        elif _closes(model, state, loads, manifolds, r, (MET if near else TOUCHING) * size):
            n = row(manifolds.normal, r)
            if mended:
                gap, n = pair_gap(model, state, loads, shapes, a, b, 0.0, prediction.pose, scratch)
            t = _meeting(model, state, loads, shapes, a, b, gap, n, MET * size, prediction.pose,
                         scratch)
            if t > model.h:
                activity[r] = DORMANT
                forget_impulses(manifolds, r)
            elif not mended:
                _move_to_meeting(model, state, loads, shapes, manifolds, r, t,
                                 margin[a] + margin[b], moved, prediction, scratch)
        elif near:
            activity[r] = DORMANT
            forget_impulses(manifolds, r)


@kernel
def _mark_pressed(model: Model, loads: Loads, shapes: Shapes, manifolds: Manifolds,
                  pressed: IntArray) -> None:
    """Mark the bodies that move and that a contact pressed in the step before."""
    first, count = rows_in_use(manifolds)
    pressed[:] = 0
    for k in range(count):
        r = (first + k) & INDEX
        if _presses(model, loads, shapes, manifolds, r):
            for i in (manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX):
                pressed[i] = 1 if model.inv_m[i] > 0.0 else 0


@kernel
def _presses(model: Model, loads: Loads, shapes: Shapes, manifolds: Manifolds, r: int) -> bool:
    """Return whether a manifold has an impulse of the step before, and not of rounding alone."""
    total = 0.0
    for p in range(manifolds.points[r]):
        total += manifolds.impulse[p, r]
    if total == 0.0:
        return False
    speed = total * (model.inv_m[manifolds.body_a[r]] + model.inv_m[manifolds.body_b[r]])
    n = row(manifolds.normal, r)
    return speed > PRESSES * slowest_of_pair(model, loads, shapes, manifolds, r, n)


@kernel
def _meeting(model: Model, state: State, loads: Loads, shapes: Shapes, a: int, b: int, gap: float,
             n: Vector, met: float, pose: Array, scratch: Scratch) -> float:
    """
    Return when [s] in the step two shapes first touch; inf: not at all.

    By conservative advancement in few stages, at the least a stage further, until no more than
    `met` [m] is left between them; from there back along a straight line.
    """
    t = 0.0
    while True:
        back = (-n[0], -n[1], -n[2])
        speed = (approach_bound(model, state, loads, shapes, a, n, model.h)
                 + approach_bound(model, state, loads, shapes, b, back, model.h))
        if not speed * (model.h - t) >= gap:
            return math.inf
        stage = least_stage(shapes, a, b, speed, model.h)
        later = min(t + max(gap / speed, stage), model.h)
        then, n = pair_gap(model, state, loads, shapes, a, b, later, pose, scratch)
        if then <= met:
            # A little before, the direction between what is nearest is still the normal.
            return t + (later - t) * max(gap - met, 0.0) / max(gap - then, TINY)
        if later >= model.h:
            return math.inf
        t, gap = later, then


@kernel
def _closes(model: Model, state: State, loads: Loads, manifolds: Manifolds, r: int,
            skin: float) -> bool:
    """
    Return whether any gap would close within the step if the normal and the lever stayed.

    Up to a `skin` [m], with the speed of its end, and with the turning of its start or its middle:
    what collisions or the solver would stop is among it.
    """
    a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    if _may_turn(model, state, a, model.h, FAR) or _may_turn(model, state, b, model.h, FAR):
        return True     # another side may be nearest by the end of the step
    n = row(manifolds.normal, r)
    pull = model.h * (model.inv_m[b] * dot(n, column(loads.F, b))
                      - model.inv_m[a] * dot(n, column(loads.F, a)))
    for k in range(2 if _wobbles(model, state, a) or _wobbles(model, state, b) else 1):
        t = 0.5 * k * model.h
        w_A, w_B = _spin_after(model, state, a, t), _spin_after(model, state, b, t)
        for p in range(manifolds.points[r]):
            u = _velocity(model, state, a, b, w_A, w_B, row(manifolds.r_A[p], r),
                          row(manifolds.r_B[p], r))
            if manifolds.gap[p, r] + model.h * (dot(n, u) + min(pull, 0.0)) <= skin:
                return True
    return False


@kernel
def _wobbles(model: Model, state: State, i: int) -> bool:
    """Return whether the angular velocity of a body without torque changes within the step."""
    if are_alike(column(model.inv_I_C, i)):
        return False
    return _may_turn(model, state, i, 0.5 * model.h, TURNED)


@kernel
def _may_turn(model: Model, state: State, i: int, t: float, angle: float) -> bool:
    """Return whether a body without torque may turn by more than an angle [rad] in t [s]."""
    inv_I, L = column(model.inv_I_C, i), column(state.L, i)
    most = t * max(inv_I[0], max(inv_I[1], inv_I[2]))
    return bool(most * most * dot(L, L) > angle * angle)


@kernel
def _spin_after(model: Model, state: State, i: int, t: float) -> Vector:
    """Return the angular velocity of a body [rad/s] after t [s] without torque, world axes."""
    q, L, inv_I = quaternion(state.q, i), column(state.L, i), column(model.inv_I_C, i)
    if t > 0.0 and not are_alike(inv_I):
        q = turn_fast(q, L, inv_I, t)
    return add(prescribed_spin(state, i), angular_velocity(q, L, inv_I))


@kernel
def _velocity(model: Model, state: State, a: int, b: int, w_A: Vector, w_B: Vector, r_A: Vector,
              r_B: Vector) -> Vector:
    """Return the velocity of B relative to A at a point [m/s]."""
    v = subtract(body_velocity(model, state, b), body_velocity(model, state, a))
    return add(v, subtract(cross(w_B, r_B), cross(w_A, r_A)))


@kernel
def _bounces_at_once(model: Model, state: State, loads: Loads, shapes: Shapes,
                     materials: Materials, manifolds: Manifolds, r: int) -> bool:
    """
    Return whether a pair that touches approaches so fast that it bounces.

    It does so where it is, not in the middle of the step.
    """
    if not bounces(shapes, materials, manifolds, r):
        return False
    a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    n = row(manifolds.normal, r)
    slowest = slowest_of_pair(model, loads, shapes, manifolds, r, n)
    w_A, w_B = _spin_after(model, state, a, 0.0), _spin_after(model, state, b, 0.0)
    for p in range(manifolds.points[r]):
        u = _velocity(model, state, a, b, w_A, w_B, row(manifolds.r_A[p], r),
                      row(manifolds.r_B[p], r))
        if classify(dot(n, u), slowest) == COLLIDING:
            return True
    return False


@kernel
def slowest_of_pair(model: Model, loads: Loads, shapes: Shapes, manifolds: Manifolds, r: int,
                    n: Vector) -> float:
    """Return how fast a pair approaches along n [m/s], at the least, that bounces."""
    a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    of_A = scale(model.inv_m[a], column(loads.F, a))
    of_B = scale(model.inv_m[b], column(loads.F, b))
    return slowest_bounce(model.h, dot(n, subtract(of_B, of_A)), max(norm(of_A), norm(of_B)),
                          smaller(shapes, manifolds.shape_a[r], manifolds.shape_b[r]))


@kernel
def _place_in_middle(model: Model, state: State, shapes: Shapes, s: int,
                     prediction: Prediction) -> None:
    """Place a shape where it is in the middle of the step, unless that is done already."""
    if prediction.is_placed[s] == 0:
        place_ahead(model, state, prediction.no_loads, shapes, s, 0.5 * model.h, prediction.middle)
        prediction.is_placed[s] = 1


@kernel
def _spin_in_middle(model: Model, state: State, i: int, prediction: Prediction) -> Vector:
    """Return the angular velocity of a body [rad/s] in the middle of the step, without torque."""
    if prediction.is_turned[i] == 0:
        w = _spin_after(model, state, i, 0.5 * model.h)
        for k in range(3):
            prediction.middle_spin[i, k] = w[k]
        prediction.is_turned[i] = 1
    return row(prediction.middle_spin, i)


@kernel
def _move_to_middle(model: Model, state: State, shapes: Shapes, manifolds: Manifolds, r: int,
                    pose: Array, margin: float, way: float, prediction: Prediction,
                    scratch: Scratch) -> None:
    """
    Give a manifold that touches the normal and the points of the middle of the step.

    It stays as it is where the points would be of other features: these would begin without the
    impulses that bear the load.
    """
    a, b = manifolds.shape_a[r] & INDEX, manifolds.shape_b[r] & INDEX
    for s in (a, b):
        _place_in_middle(model, state, shapes, s, prediction)
    count, n = collide(prediction.middle, shapes, a, b, margin, way, scratch)
    before = row(manifolds.normal, r)
    if count == 0 or dot(n, before) < SAME_NORMAL:
        return
    if meets_face(pose, shapes, a, b, before) and not meets_face(prediction.middle, shapes, a, b,
                                                                 n):
        return      # what is beside the face comes next: more of the floor, or nothing
    if not _same_features(manifolds, r, count, scratch.ids):
        return
    i, j = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    w_A = _spin_in_middle(model, state, i, prediction)
    w_B = _spin_in_middle(model, state, j, prediction)
    _rewrite(model, state, prediction.no_loads, manifolds, r, 0.5 * model.h, count, n, w_A, w_B,
             True, prediction, scratch)


@kernel
def _move_to_meeting(model: Model, state: State, loads: Loads, shapes: Shapes,
                     manifolds: Manifolds, r: int, t: float, margin: float,
                     way: float, prediction: Prediction, scratch: Scratch) -> None:
    """
    Give a manifold the normal and the points of the time t [s] at which its pair meets.

    Or of a time a little earlier, so that nothing overlaps.
    """
    a, b = manifolds.shape_a[r] & INDEX, manifolds.shape_b[r] & INDEX
    first_gap, met = smallest_gap(manifolds, r), MET * min(shapes.bound[a], shapes.bound[b])
    for _ in range(EARLIER):
        for s in (a, b):
            place_ahead(model, state, loads, shapes, s, t, prediction.pose)
        count, n = collide(prediction.pose, shapes, a, b, margin, way, scratch)
        deepest = 0.0
        for p in range(count):
            deepest = min(deepest, scratch.points[p, 3])
        if deepest == 0.0:
            break
        # Corners overlap by less than they went on: from the axis that overlaps least.
        t *= max(first_gap - met, 0.0) / max(first_gap - deepest, TINY)
    if count == 0 or dot(n, row(manifolds.normal, r)) < 0.0:
        return
    i, j = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    w_A, w_B = _spin_after(model, state, i, t), _spin_after(model, state, j, t)
    _rewrite(model, state, loads, manifolds, r, t, count, n, w_A, w_B, False, prediction, scratch)


@kernel
def _rewrite(model: Model, state: State, loads: Loads, manifolds: Manifolds, r: int, t: float,
             count: int, n: Vector, w_A: Vector, w_B: Vector, touches: bool,
             prediction: Prediction, scratch: Scratch) -> None:
    """
    Give a manifold the `count` points in `scratch` and the normal n of t [s] after the start.

    w_A, w_B are the angular velocities then. Its gaps stay those of the start: of points that
    touch already as they were found there, of others by going back along the path.
    """
    i, j = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    old_A, old_B = _spin_after(model, state, i, 0.0), _spin_after(model, state, j, 0.0)
    old_count = _note_old(model, state, manifolds, r, old_A, old_B, prediction.old)
    way_A, way_B = way_ahead(model, state, loads, i, t), way_ahead(model, state, loads, j, t)
    x_A, x_B = add(column(state.x, i), way_A), add(column(state.x, j), way_B)
    slide, known = (0.0, 0.0, 0.0), 0
    slow = _turns_little(model.h, old_A, w_A) and _turns_little(model.h, old_B, w_B)
    features = (manifolds.feature[0, r], manifolds.feature[1, r], manifolds.feature[2, r],
                manifolds.feature[3, r])
    for p in range(count):
        gap, old = scratch.points[p, 3], -1
        r_A, r_B = levers(scratch, p, n, x_A, x_B)
        u = _velocity(model, state, i, j, w_A, w_B, r_A, r_B)
        for q in range(old_count):
            if features[q] == scratch.ids[p]:
                old = q
        turn = 0.0
        if touches and old >= 0:
            gap = prediction.old[old, _GAP]
        if touches and old >= 0 and slow:
            turn = 2.0 * (dot(n, u) - prediction.old[old, _ALONG])
            slide = add(slide, subtract(u, row_from(prediction.old, old, _U)))
            known += 1
        if not touches or old < 0:
            gap -= dot(n, add(subtract(way_B, way_A), scale(
                t, subtract(cross(w_B, r_B), cross(w_A, r_A)))))
        manifolds.impulse[p, r] = prediction.old[old, _IMPULSE] if old >= 0 else 0.0
        write_point(manifolds, r, p, gap, r_A, r_B, turn, prediction, scratch)
    for k in range(3):
        prediction.turn_t[r, k] = 2.0 * slide[k] / known if known > 0 else 0.0
    write_frame(manifolds, r, count, n, subtract(way_B, way_A), prediction)


@kernel
def levers(scratch: Scratch, p: int, n: Vector, x_A: Vector, x_B: Vector) -> tuple[Vector, Vector]:
    """Return where point p of a search is on A and on B, from their centres of mass [m]."""
    at = (scratch.points[p, 0], scratch.points[p, 1], scratch.points[p, 2])
    return subtract(at, x_A), subtract(add_scaled(at, scratch.points[p, 3], n), x_B)


@kernel
def write_point(manifolds: Manifolds, r: int, p: int, gap: float, r_A: Vector, r_B: Vector,
                turn: float, prediction: Prediction, scratch: Scratch) -> None:
    """Give a manifold point p of a search; `gap` [m] is that at the start of the step."""
    manifolds.gap[p, r], prediction.gap[p, r] = gap, scratch.points[p, 3]
    manifolds.feature[p, r] = scratch.ids[p]
    prediction.turn[p, r] = turn
    for k in range(3):
        manifolds.r_A[p, r, k], manifolds.r_B[p, r, k] = r_A[k], r_B[k]


@kernel
def write_frame(manifolds: Manifolds, r: int, count: int, n: Vector, moved: Vector,
                prediction: Prediction) -> None:
    """Give a manifold the normal and number of the points that it was given, of a later time."""
    for k in range(3):
        manifolds.normal[r, k], prediction.moved[r, k] = n[k], moved[k]
    manifolds.points[r], prediction.given[r] = count, AHEAD
    # Those that were found are no longer there, to be taken over by the next step.
    for k in range(5):
        manifolds.found_at[r, k] = 0.0


@kernel
def _turns_little(h: float, w: Vector, later: Vector) -> bool:
    """Return whether a body, with w [rad/s] = `later` by then, turns by so little in a step h."""
    most = MOST_TURNED / h
    return bool(max(dot(w, w), dot(later, later)) <= most * most)


@kernel
def _same_features(manifolds: Manifolds, r: int, count: int, ids: IntArray) -> bool:
    """Return whether the points that were found are those of a manifold."""
    if count != manifolds.points[r]:
        return False
    for p in range(count):
        found = False
        for q in range(count):
            found |= manifolds.feature[q, r] == ids[p]
        if not found:
            return False
    return True


@kernel
def row_from(values: Array, i: int, k: int) -> Vector:
    """Return three numbers of a row, from column k on."""
    return (values[i, k], values[i, k + 1], values[i, k + 2])


@kernel
def _note_old(model: Model, state: State, manifolds: Manifolds, r: int, w_A: Vector, w_B: Vector,
              old: Array) -> int:
    """Write what `_rewrite` asks for of the points that were found; return how many these are."""
    a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    for p in range(manifolds.points[r]):
        u = _velocity(model, state, a, b, w_A, w_B, row(manifolds.r_A[p], r),
                      row(manifolds.r_B[p], r))
        old[p, _GAP], old[p, _IMPULSE] = manifolds.gap[p, r], manifolds.impulse[p, r]
        old[p, _ALONG] = dot(row(manifolds.normal, r), u)
        for k in range(3):
            old[p, _U + k] = u[k]
    return manifolds.points[r]
