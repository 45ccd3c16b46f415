# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which points of contact take part in half a step of bodies that joints hold.

In the first half those that touch. A point that is near says nothing yet: along its normal a body
that passes an edge would run into it. Where shapes overlap after the way of the step that were
apart before, the state goes back and their points take part too (`wake_met`), or the way ends
where they met (`meeting_within`).
"""

import math

from rigid_sim_ros.engine.constraints.articulated_buffers import ContactBuffers
from rigid_sim_ros.engine.contact.carried_forces import match_forces
from rigid_sim_ros.engine.contact.classify import resting_speed
from rigid_sim_ros.engine.contact.contacts import Contacts, relative, to_contact
from rigid_sim_ros.engine.maths.union_find import first_of, unite
from rigid_sim_ros.engine.maths.vector import norm, row
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Of the size of the smaller shape: points with a smaller gap touch; far above rounding, far below
# anything seen.
TOUCHING = 1e-7
# Points that are nearer take part in the first half of a step, and in the second.
CLOSE, NEAR = 1e-4, 1e-6
# Of the size of a shape: impulses that move a body by less in a step are rounding of others.
NOTHING = 1e-12
# Of what was noted: a body that is faster than that is noted again.
MORE = 1.1
# Times the speed that loads and joints give in half a step: slower approaches do not bounce.
REBOUNDS = 2.0


@kernel
def rate_of_gap(w: ContactBuffers, k: int) -> float:
    """Return how fast the gap of point k grows [m/s]."""
    return to_contact(w.contacts, k, relative(w.bodies.velocity, w.contacts, k))[0]


@kernel
def take_close(w: ContactBuffers) -> None:
    """Let take part what is close, and the pairs that were woken."""
    contacts = w.contacts
    match_forces(contacts, w.carried, w.counts.known[0], w.match)
    for k in range(contacts.count[0]):
        acts = contacts.gap[k] <= CLOSE * contacts.size[k] or _is_woken(
            w, contacts.shape_a[k], contacts.shape_b[k])
        w.active[k] = 1 if acts else 0


@kernel
def _is_woken(w: ContactBuffers, a: int, b: int) -> bool:
    for n in range(w.counts.woken[0]):
        if w.woken[n, 0] == a and w.woken[n, 1] == b:
            return True
    return False


@kernel
def wake(w: ContactBuffers, a: int, b: int) -> bool:
    """Let all points of two shapes take part in this part of a step; return whether it is new."""
    n = w.counts.woken[0]
    if n == w.woken.shape[0] or _is_woken(w, a, b):
        return False
    w.woken[n, 0], w.woken[n, 1] = a, b
    w.counts.woken[0] += 1
    return True


@kernel
def take_touching(h: float, soon: float, w: ContactBuffers) -> None:
    """
    Let take part what touches, and what is as near as a rebound that is too short to be one.

    And what is close, comes no nearer, and took part in the way before, which stopped it there.
    The loads of its bodies do not say how drives and joints push it: it may begin to come, ever
    faster, and the end of a way from where it rests does not tell when on it that met.

    What meets within a time `soon` [s] touches already. h [s] is the step; the bodies have been
    read.
    """
    contacts = w.contacts
    match_forces(contacts, w.carried, w.counts.known[0], w.match)
    for k in range(contacts.count[0]):
        slow, rate = resting_speed(contacts, w.bodies, k, h), rate_of_gap(w, k)
        touching, close = TOUCHING * contacts.size[k], CLOSE * contacts.size[k]
        gap = contacts.gap[k] - touching
        rests = gap <= 0.25 * h * slow and abs(rate) <= slow
        stopped = w.match[k] >= 0 and gap <= close and h * abs(rate) <= touching
        w.active[k] = 1 if gap + soon * min(rate, 0.0) <= 0.0 or rests or stopped else 0


@kernel
def has_restitution(w: ContactBuffers) -> bool:
    """Return whether any point may bounce."""
    for k in range(w.contacts.count[0]):
        if w.contacts.restitution[k] > 0.0:
            return True
    return False


@kernel
def any_bounces(h: float, soon: float, w: ContactBuffers) -> bool:
    """Return whether anything that touches, or does within `soon` [s], is to bounce now."""
    for k in range(w.contacts.count[0]):
        gap = w.contacts.gap[k] - TOUCHING * w.contacts.size[k]
        if _comes_to_bounce(h, w, k) and gap + soon * rate_of_gap(w, k) <= 0.0:
            return True
    return False


@kernel
def _comes_to_bounce(h: float, w: ContactBuffers, k: int) -> bool:
    """Return whether point k is to bounce if it meets, by its rate; h [s] is the step."""
    if w.contacts.restitution[k] == 0.0 or not w.contacts.gap[k] < math.inf:
        return False
    return rate_of_gap(w, k) < -REBOUNDS * resting_speed(w.contacts, w.bodies, k, h)


@kernel
def leave_bouncing(h: float, w: ContactBuffers) -> float:
    """Let wait what is to bounce; return when [s] the first such point meets, inf: none does."""
    contacts, first = w.contacts, math.inf
    for k in range(contacts.count[0]):
        gap = contacts.gap[k]
        if w.active[k] == 1 and gap > TOUCHING * contacts.size[k] and _comes_to_bounce(h, w, k):
            w.active[k] = 0
            first = min(first, -gap / rate_of_gap(w, k))
    return first


@kernel
def bouncing_within(way: float, h: float, w: ContactBuffers) -> float:
    """Return when [s] on a way of `way` [s] the first shapes met that are to bounce; inf: none."""
    first = math.inf
    for k in range(w.contacts.count[0]):
        if _comes_to_bounce(h, w, k):
            first = min(first, _has_met(way, w, k))
    return first


@kernel
def take_all(w: ContactBuffers) -> None:
    """Let all points take part."""
    match_forces(w.contacts, w.carried, w.counts.known[0], w.match)
    for k in range(w.contacts.count[0]):
        w.active[k] = 1


@kernel
def take_loaded(model: Model, w: ContactBuffers) -> None:
    """
    Let take part in the second half of a step what pressed in the first, or touches.

    w.match says which points took part in the first; others may take their places.
    """
    _match_moved(model, w)
    for k in range(w.contacts.count[0]):
        w.active[k] = 1 if _presses(model, w, k) else 0


@kernel
def leave_arriving(h: float, w: ContactBuffers) -> None:
    """
    Let what is to bounce, and comes near only at the end of a way of h [s], collide in the next.

    The bodies have been read. Nothing has stopped such a point: the second half would, and for
    good, since what comes back is noted where the first half stops it.
    """
    contacts = w.contacts
    for k in range(contacts.count[0]):
        if w.active[k] == 1 and contacts.restitution[k] > 0.0 and _is_unstopped(w, w.match[k]):
            slow = REBOUNDS * resting_speed(contacts, w.bodies, k, h)
            w.active[k] = 0 if rate_of_gap(w, k) < -slow else 1


@kernel
def _is_unstopped(w: ContactBuffers, i: int) -> bool:
    """Return whether a point of the first half, or NONE, neither pressed nor is to bounce."""
    return i < 0 or (w.half_bounce[i] == 0.0 and norm(row(w.half.force, i)) == 0.0)


@kernel
def _match_moved(model: Model, w: ContactBuffers) -> None:
    """
    Let what pressed in the first half where no point is any more go on at the nearest of its pair.

    What turns meets with other edges at the new poses, a little apart as the way is not straight:
    without that it would not bounce.
    """
    contacts, half = w.contacts, w.half
    for i in range(w.counts.half_known[0]):
        is_there, nearest, impulse = False, NONE, norm(row(half.force, i))
        for k in range(contacts.count[0]):
            if contacts.shape_a[k] == half.shape_a[i] and contacts.shape_b[k] == half.shape_b[i]:
                is_there = is_there or w.match[k] == i or not _is_felt(model, contacts, k, impulse)
                if w.match[k] < 0 and (nearest == NONE or contacts.gap[k] < contacts.gap[nearest]):
                    nearest = k
        if not is_there and nearest != NONE:
            w.match[nearest] = i


@kernel
def choose_points(model: Model, table: JointTable, w: ContactBuffers) -> int:
    """Sort the points that take part by islands; return the rows of the largest."""
    contacts, parent = w.contacts, w.parent
    _unite_bodies(model, table, w)
    _find_held(model, table, w)
    w.label[:] = -1
    islands, found = 0, 0
    for k in range(contacts.count[0]):
        root = _island(model, contacts, k, parent)
        if root < 0:
            w.active[k] = 0
        if w.active[k] == 0:
            continue
        if w.label[root] < 0:
            w.label[root] = islands
            w.first[islands] = 0
            islands += 1
        w.first[w.label[root]] += 1
        found += 1
    start, largest = 0, 0
    for n in range(islands):
        largest = max(largest, w.first[n])
        start, w.first[n] = start + w.first[n], start
    for k in range(contacts.count[0]):
        if w.active[k] == 1:
            n = w.label[_island(model, contacts, k, parent)]
            w.chosen[w.first[n]] = k
            w.first[n] += 1
    for n in range(islands, 0, -1):     # each is now where the next one begins
        w.first[n] = w.first[n - 1]
    w.first[0] = 0
    w.counts.islands[0], w.counts.points[0] = islands, found
    return w.counts.width[0] * largest


@kernel
def _find_held(model: Model, table: JointTable, w: ContactBuffers) -> None:
    """Note which sets of bodies hang on, or touch, what nothing pushes."""
    contacts = w.contacts
    w.held[:] = 0
    for j in range(table.kind.shape[0]):
        _note_held(model, table.body_a[j], table.body_b[j], w)
    for k in range(contacts.count[0]):
        if w.active[k] == 1:
            _note_held(model, contacts.body_a[k], contacts.body_b[k], w)


@kernel
def _note_held(model: Model, a: int, b: int, w: ContactBuffers) -> None:
    for one, other in ((a, b), (b, a)):
        if (other < 0 or model.inv_m[other] == 0.0) and one >= 0:
            w.held[first_of(w.parent, one)] = 1


@kernel
def _unite_bodies(model: Model, table: JointTable, w: ContactBuffers) -> None:
    """
    Write which bodies hang together by joints and by points that take part.

    What is only near is of no weight: how near that is depends on how fast all fly by together.
    """
    contacts, parent = w.contacts, w.parent
    for i in range(parent.shape[0]):
        parent[i] = i
    for g in range(table.first_row.shape[0] - 1):
        for r in range(table.first_row[g] + 1, table.first_row[g + 1]):
            unite(parent, table.body[table.first_row[g]], table.body[r])
    for k in range(contacts.count[0]):
        a, b = contacts.body_a[k], contacts.body_b[k]
        if w.active[k] == 1 and model.inv_m[a] > 0.0 and model.inv_m[b] > 0.0:
            unite(parent, a, b)


@kernel
def _island(model: Model, contacts: Contacts, k: int, parent: IntArray) -> int:
    """Return the first body of the set that point k belongs to, -1 if neither body can move."""
    for body in (contacts.body_a[k], contacts.body_b[k]):
        if model.inv_m[body] > 0.0:
            return first_of(parent, body)
    return -1


@kernel
def _presses(model: Model, w: ContactBuffers, k: int) -> bool:
    """Return whether a point takes part in the second half of a step."""
    contacts = w.contacts
    if contacts.gap[k] <= NEAR * contacts.size[k]:
        return True
    i = w.match[k]
    if i < 0:
        return False
    pressed = 0.0
    for j in range(3):
        pressed += w.half.force[i, j] * contacts.axes[k, 0, j]
    return _is_felt(model, contacts, k, pressed)


@kernel
def _is_felt(model: Model, contacts: Contacts, k: int, impulse: float) -> bool:
    """Return whether an impulse [N s] at a point is more than the rounding of other ones."""
    a, b = contacts.body_a[k], contacts.body_b[k]
    return bool(impulse * max(model.inv_m[a], model.inv_m[b]) * model.h
                > NOTHING * contacts.size[k])


@kernel
def _has_met(h: float, w: ContactBuffers, k: int) -> float:
    """
    Return when [s] on a way of h [s] the shapes at point k met that overlap now; inf: did not.

    The velocities are those of the way, and w.match says which points took part in it already:
    what these sank by is the curvature of their way. The gap of the others is followed back at its
    present rate. Where that leads to no gap at the start, and the shapes touched elsewhere, they
    turned into each other. But what can be seen of overlap, half of which or more came by that
    rate, was a gap so small that it seems to be none; and if none of their points took part, the
    way is so curved that its end tells nothing of its start. Half of it is to be tried then.
    """
    contacts = w.contacts
    gap, touching = contacts.gap[k], TOUCHING * contacts.size[k]
    if w.match[k] >= 0 or gap >= -touching:
        return math.inf
    before = gap - h * rate_of_gap(w, k)
    if before > touching:
        return h * before / (before - gap)
    has_come = before > 0.5 * gap and gap < -CLOSE * contacts.size[k]
    if has_come or not _took_part(w, contacts.shape_a[k], contacts.shape_b[k]):
        return 0.5 * h
    return math.inf


@kernel
def _took_part(w: ContactBuffers, a: int, b: int) -> bool:
    """Return whether any point of two shapes took part in the way that was tried."""
    for i in range(w.counts.half_known[0]):
        if w.half.shape_a[i] == a and w.half.shape_b[i] == b:
            return True
    return False


@kernel
def meeting_within(h: float, w: ContactBuffers) -> float:
    """Return when [s] the first shapes met on a way of h [s] that overlap now; inf: none did."""
    first = math.inf
    for k in range(w.contacts.count[0]):
        first = min(first, _has_met(h, w, k))
    return first


@kernel
def wake_met(h: float, w: ContactBuffers) -> bool:
    """
    Wake what met on a way of h [s]; return whether anything was not awake.

    Nor is what was not found at the start, as impulses on this way brought it nearer than its
    velocity there said: a foot whose heel is stopped comes down on its toes.
    """
    contacts, any_was = w.contacts, False
    for k in range(contacts.count[0]):
        if _has_met(h, w, k) < h:
            is_new = wake(w, contacts.shape_a[k], contacts.shape_b[k])
            any_was = is_new or _outran(w, contacts.body_a[k]) or _outran(
                w, contacts.body_b[k]) or any_was
    return any_was


@kernel
def _outran(w: ContactBuffers, i: int) -> bool:
    """Note how much faster body i went than its loads say; return whether that is news."""
    if w.gained[i] <= w.sudden[i]:
        return False
    w.sudden[i] = MORE * w.gained[i]
    return True
