# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where bodies meet within a step once collisions have changed their ways.

Manifolds are those of the ways with which the step began. Two rods that hit each other with one
end bounce, turn, and may meet with the other ends in the same step; and who would have passed by
may be sent into another. So after collisions the pairs of which one has collided, and that do not
touch by what is known of them, are followed along their new ways, from the last collision on. A
manifold of a pair that meets gets the normal and the points of that moment; then collisions are
found anew. What touches meets as soon as one of the two is sent into the other: a blow goes back
and forth in a row within the step. A pair that bounced and parts for the rest of the step is left
out: the levers of its manifold are those of its collision, and by them a body that turns would
seem to come back.
"""

import math

from rigid_sim_ros.engine.constraints.contact_prediction import (
    AFTERWARDS, levers, Prediction, slowest_of_pair, write_frame, write_point)
from rigid_sim_ros.engine.contact.colliding_body import CollisionWork, get, NEVER, SPIN
from rigid_sim_ros.engine.contact.collisions import AT_ONCE, bounces, collisions_of
from rigid_sim_ros.engine.contact.impact_offsets import displacement, shifted
from rigid_sim_ros.engine.detection.backtrack import crossing, least_stage, pair_gap
from rigid_sim_ros.engine.detection.manifolds import (
    ACTS, DORMANT, forget_impulses, has_impulse, LEFT_OUT, Manifolds, rows_in_use, Scratch,
    StepImpulses)
from rigid_sim_ros.engine.detection.motion_ahead import approach_bound, place_ahead, way_ahead
from rigid_sim_ros.engine.detection.narrow_phase.collide import collide
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.maths.vector import (
    add, add_scaled, column, cross, dot, row, scale, subtract)
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes, smaller
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import INDEX, kernel

# So many times a pair meets anew in a step at most; with friction bodies may rattle for longer.
TIMES = 4
# So often the first stage is halved, at most, until what collided is seen apart.
SOONER = 8
# Of the smaller shape: the gap at which a pair meets. There is still a direction between what is
# nearest.
MET = 1e-4


@kernel
def find_next_touches(model: Model, state: State, loads: Loads, shapes: Shapes,
                      materials: Materials, manifolds: Manifolds, margin: Array,
                      acted: StepImpulses, prediction: Prediction, scratch: Scratch,
                      work: CollisionWork) -> int:
    """
    Bring the manifolds of pairs that meet on new ways to where they do; return how many do.

    margin (s,) [m] is that of `Memory`; `acted` is that of `collide_bodies`. A pair that
    was dormant becomes one of the pairs that may collide. `work.met` counts how often a pair met.
    """
    first, count = rows_in_use(manifolds)
    found = 0
    for k in range(count):
        r = (first + k) & INDEX
        i, j = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
        rests = work.activity[r] == ACTS and not has_impulse(acted.normal, manifolds.points[r], r)
        now = collisions_of(manifolds, r, work)
        if (rests or now == 0 or now == work.followed_at[r] or work.met[r] == TIMES
                or not bounces(shapes, materials, manifolds, r)):
            continue
        work.followed_at[r] = now
        # Neither has collided with anything since they did with each other.
        bounced = work.collided_at[r] == now
        t = _next_touch(model, state, loads, shapes, manifolds, r, max(work.last[i], work.last[j]),
                        bounced, prediction.pose, scratch)
        if t == math.inf and work.activity[r] == ACTS:
            work.activity[r] = LEFT_OUT
        if t <= model.h and _rewrite(model, state, loads, shapes, manifolds, r, t, margin,
                                     acted, prediction, scratch, work):
            found += 1
            if work.activity[r] == DORMANT:
                work.rows[work.candidates[0]] = r
                work.candidates[0] += 1
            work.activity[r] = LEFT_OUT
            work.met[r] += 1
            work.timed_at[r] = -1
    return found


@kernel
def _next_touch(model: Model, state: State, loads: Loads, shapes: Shapes, manifolds: Manifolds,
                r: int, begin: float, bounced: bool, pose: Array, scratch: Scratch) -> float:
    """
    Return when [s] in the step, after `begin`, the shapes of a manifold meet; inf: not at all.

    By conservative advancement in few stages. What touches at `begin` and has just `bounced` has
    to part first: NEVER if it does not soon. Else it meets if it approaches fast enough to bounce;
    NEVER if it touches at the end of the step without that.
    """
    a, b, h = manifolds.shape_a[r] & INDEX, manifolds.shape_b[r] & INDEX, model.h
    met, t, looks = MET * smaller(shapes, a, b), begin, 0
    gap, n = pair_gap(model, state, loads, shapes, a, b, t, pose, scratch)
    while True:
        back = (-n[0], -n[1], -n[2])
        speed = (approach_bound(model, state, loads, shapes, a, n, h)
                 + approach_bound(model, state, loads, shapes, b, back, h))
        if not gap - speed * (h - t) <= met:
            return math.inf
        stage = least_stage(shapes, a, b, speed, h - begin) * 0.5 ** looks
        later = t + max((gap - met) / speed, stage)
        # What rounding would leave of the step is no time from which a speed can be told.
        later = later if h - later > AT_ONCE * h else h
        then, n_then = pair_gap(model, state, loads, shapes, a, b, later, pose, scratch)
        if then <= met and gap > met:
            return crossing(model, state, loads, shapes, a, b, t, later, gap, then, met, pose,
                            scratch)
        if then <= met and not bounced:
            slowest = slowest_of_pair(model, loads, shapes, manifolds, r, n)
            if gap - then > slowest * (later - t):
                return t
        if then <= met and bounced:
            # It has not parted yet, or met again already: that is seen only by looking sooner.
            looks += 1
            if looks > SOONER:
                return NEVER
        elif later >= h:
            return math.inf if then > met else NEVER
        else:
            t, gap, n, looks = later, then, n_then, 0


@kernel
def _rewrite(model: Model, state: State, loads: Loads, shapes: Shapes, manifolds: Manifolds,
             r: int, t: float, margin: Array, acted: StepImpulses, prediction: Prediction,
             scratch: Scratch, work: CollisionWork) -> bool:
    """
    Give a manifold the normal and the points of t [s] after the start; return whether it has any.

    Gaps are those of the start, going back along the way, before collisions shifted the bodies:
    `gap_now` adds that. What acted so far is kept along the new normal and across it.
    """
    a, b = manifolds.shape_a[r] & INDEX, manifolds.shape_b[r] & INDEX
    for s in (a, b):
        place_ahead(model, state, loads, shapes, s, t, prediction.pose)
    count, n = collide(prediction.pose, shapes, a, b, margin[a] + margin[b], 0.0, scratch)
    if count == 0:
        return False
    _turn_impulses(manifolds, r, n, acted)
    forget_impulses(manifolds, r)
    i, j = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
    A, B = work.body[i], work.body[j]
    way_A, way_B = way_ahead(model, state, loads, i, t), way_ahead(model, state, loads, j, t)
    x_A, x_B = add(column(state.x, i), way_A), add(column(state.x, j), way_B)
    for p in range(count):
        r_A, r_B = levers(scratch, p, n, x_A, x_B)
        way = add(subtract(way_B, way_A), scale(
            t, subtract(cross(get(B, SPIN), r_B), cross(get(A, SPIN), r_A))))
        way = add(way, subtract(shifted(B, r_B), shifted(A, r_A)))
        gap = scratch.points[p, 3] - dot(n, way)
        write_point(manifolds, r, p, gap, r_A, r_B, 0.0, prediction, scratch)
    for k in range(3):
        prediction.turn_t[r, k] = 0.0
    write_frame(manifolds, r, count, n, subtract(way_B, way_A), prediction)
    prediction.given[r] = AFTERWARDS
    for k in range(3):
        prediction.shift[r, k] = displacement(A)[k]
    return True


@kernel
def _turn_impulses(manifolds: Manifolds, r: int, n: Vector, acted: StepImpulses) -> None:
    """Write what acted on a pair so far as an impulse along a new normal and one across it."""
    J = row(acted.friction, r)
    for p in range(manifolds.points[r]):
        J = add_scaled(J, acted.normal[p, r], row(manifolds.normal, r))
        acted.normal[p, r] = 0.0
    along = dot(J, n)
    acted.normal[0, r] = along
    J = add_scaled(J, -along, n)
    for k in range(3):
        acted.friction[r, k] = J[k]
