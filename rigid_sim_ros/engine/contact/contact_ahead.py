# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where contacts will be in the middle and at the end of a span of time [s].

The second derivative of a gap, d'' = N . (p_a'' - p_b'') + 2 N' . (p_a' - p_b') (Meyer, Rigid Body
Dynamics, "Resting Contact"), has a part from accelerations and a part from velocities: the normal
turns, the points are carried around by the rotations, and on round bodies other points come to
touch. Both parts are taken here from the points that detection finds on the way of the bodies
under no force, so they hold for every pair of shapes:

- Forces act with the levers and along the axes of the middle of the span. What is done by a force
  f there is f . G_m (v_0 + v_1) / 2 a second, with the rate G v of a point, and where
  G_0 v_0 = G_1 v_1 = 0 that is of second order in the span: what rolls keeps its energy to second
  order. With the levers of the start it would be of first order.
- What a force has to stop is the velocity of the point at the end of the span: G_1 v with the
  angular velocity that the free body will have there, which holds the gyroscopic part too.
"""

from rigid_sim_ros.engine.contact.contacts import (
    Bodies, Contacts, linear, read_rates, read_turning, tangents, to_contact, to_world)
from rigid_sim_ros.engine.detection.manifolds import Scratch
from rigid_sim_ros.engine.detection.motion_ahead import place_ahead
from rigid_sim_ros.engine.detection.narrow_phase.collide import collide
from rigid_sim_ros.engine.detection.narrow_phase.surface import meets_face
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.dynamics.free_rotation import turn_fast
from rigid_sim_ros.engine.maths.algebra import (
    add, add_scaled, column, cross, dot, norm, quaternion, row, scale, subtract)
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.rates import angular_velocity, relative_velocity
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

# cos 25 deg: a normal that turns farther in one step has jumped to another feature, and says
# nothing.
SAME_NORMAL = 0.9
# Of the size of the smaller shape: a point that gets farther on both bodies in the time has jumped
# too, as the lowest point of a rim does from one side to the other when a disk falls flat. 2 would
# take the jump for a motion, and a force that stops it throws the disk up.
JUMP = 0.5
# Of the moments of points about their middle: those on one line have none about it.
STIFFENED = 1e-6


@kernel
def turn_bodies(model: Model, state: State, tau: Array, t: float, some: IntArray, bodies: Bodies,
                then: Array) -> None:
    """
    Bring the inertia tensors of some bodies to the middle of a span t [s] of free rotation.

    And the angular accelerations under tau, (3, n) [N m]; `then`, (n, 6), becomes the velocities
    v and w of the free bodies at its end.
    """
    for i in some:
        q, L, inv_I = quaternion(state.q, i), column(state.L, i), column(model.inv_I_C, i)
        for k in range(6):
            then[i, k] = bodies.velocity[i, k]
        if model.inv_m[i] == 0.0:
            continue
        read_turning(model, turn_fast(q, L, inv_I, 0.5 * t), tau, i, bodies)
        w = angular_velocity(turn_fast(q, L, inv_I, t), L, inv_I)
        for k in range(3):
            then[i, 3 + k] = w[k]


@kernel
def carry_ahead(model: Model, state: State, no_loads: Loads, shapes: Shapes, contacts: Contacts,
                bodies: Bodies, then: Array, chosen: IntArray, width: int, t: float, pose: Array,
                scratch: Scratch, u: Array) -> None:
    """
    Bring the chosen points to the middle of a span t [s]; write their rates u, (wm,), at its end.

    no_loads: of 0; then, (n, 6): the velocities at the end. A point that is not found there is
    taken as it was before, an error of first order in t which the next step sees as a velocity and
    takes back.
    """
    first = 0
    while first < chosen.shape[0]:
        k = chosen[first]
        after = first + 1
        while after < chosen.shape[0] and contacts.manifold[chosen[after]] == contacts.manifold[k]:
            after += 1
        a, b = contacts.shape_a[k], contacts.shape_b[k]
        size = contacts.size[k]
        place_ahead(model, state, no_loads, shapes, a, 0.0, pose)
        place_ahead(model, state, no_loads, shapes, b, 0.0, pose)
        e = contacts.axes
        on_face = meets_face(pose, shapes, a, b, (e[k, 0, 0], e[k, 0, 1], e[k, 0, 2]))
        count, n = _meet(model, state, no_loads, shapes, a, b, 0.5 * t, size, on_face, pose,
                         scratch)
        for c in range(first, after):
            _to_middle(model, contacts, bodies, chosen[c], 0.5 * t)
            p = _same_point(contacts, chosen[c], count, n, scratch)
            if p >= 0:
                _move_point(state, contacts, bodies, chosen[c], 0.5 * t, n, scratch.points, p,
                            JUMP * size)
        count, n = _meet(model, state, no_loads, shapes, a, b, t, size, on_face, pose, scratch)
        for c in range(first, after):
            at = width * c
            read_rates(model, contacts, then, chosen[c], width, u, at)
            p = _same_point(contacts, chosen[c], count, n, scratch)
            if p >= 0:
                v, jump = _velocity(state, contacts, bodies, then, chosen[c], t, n,
                                    scratch.points, p)
                if jump < JUMP * size:
                    _, u[at + 1], u[at + 2] = to_contact(contacts, chosen[c], v)
                    u[at] = dot(n, v)
        first = after
    _make_rigid(contacts, chosen, width, u)


@kernel
def _make_rigid(contacts: Contacts, chosen: IntArray, width: int, u: Array) -> None:
    """
    Let the slip u of the points of each pair of bodies be that of a rigid motion, the nearest one.

    The rates are those at the end of a span, the levers those of its middle: of a body that turns
    by w the points seem to move apart by w x (w x r) / 2 a second. No forces at these levers stop
    that, so points that stick would pull at each other, up to where they slip: with what forces
    would depend on how the search begins.
    """
    first = 0
    while first < chosen.shape[0]:
        k, after = chosen[first], first + 1
        while (after < chosen.shape[0] and contacts.body_a[chosen[after]] == contacts.body_a[k]
               and contacts.body_b[chosen[after]] == contacts.body_b[k]):
            after += 1
        if after > first + 1:
            _fit_motion(contacts, chosen[first:after], width, u[width * first:])
        first = after


@kernel
def _fit_motion(contacts: Contacts, chosen: IntArray, width: int, u: Array) -> None:
    """Let the slip of one pair of bodies be that of a rigid motion, by least squares."""
    share = 1.0 / chosen.shape[0]
    middle, v, w = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for c in range(chosen.shape[0]):
        at = width * c
        middle = add_scaled(middle, share, row(contacts.r_A, chosen[c]))
        v = add_scaled(v, share, to_world(contacts, chosen[c], (u[at], u[at + 1], u[at + 2])))
    # Twice, so that STIFFENED, for points on one line, leaves no error.
    for _ in range(2):
        x, y, z, L = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for c in range(chosen.shape[0]):
            at = width * c
            d = subtract(row(contacts.r_A, chosen[c]), middle)
            left = to_world(contacts, chosen[c], (u[at], u[at + 1], u[at + 2]))
            left = subtract(left, add(v, cross(w, d)))
            L = add(L, cross(d, left))
            square = (1.0 + STIFFENED) * dot(d, d)
            x = add_scaled((x[0] + square, x[1], x[2]), -d[0], d)
            y = add_scaled((y[0], y[1] + square, y[2]), -d[1], d)
            z = add_scaled((z[0], z[1], z[2] + square), -d[2], d)
        yz, zx, xy = cross(y, z), cross(z, x), cross(x, y)
        determinant = dot(x, yz)
        if determinant <= 0.0:
            return
        turn = add_scaled(add_scaled(scale(L[0], yz), L[1], zx), L[2], xy)
        w = add_scaled(w, 1.0 / determinant, turn)
    for c in range(chosen.shape[0]):
        at = width * c
        d = subtract(row(contacts.r_A, chosen[c]), middle)
        _, u[at + 1], u[at + 2] = to_contact(contacts, chosen[c], add(v, cross(w, d)))


@kernel
def _meet(model: Model, state: State, no_loads: Loads, shapes: Shapes, a: int, b: int, t: float,
          margin: float, on_face: bool, pose: Array, scratch: Scratch) -> tuple[int, Vector]:
    """
    Return how many points two shapes have after t [s], and their normal.

    None where they met on a face, and do not any more: what is beside the face, another piece of
    the same floor or nothing, the next step sees.
    """
    place_ahead(model, state, no_loads, shapes, a, t, pose)
    place_ahead(model, state, no_loads, shapes, b, t, pose)
    count, n = collide(pose, shapes, a, b, margin, 0.0, scratch)
    return 0 if on_face and not meets_face(pose, shapes, a, b, n) else count, n


@kernel
def _same_point(contacts: Contacts, k: int, count: int, n: Vector, scratch: Scratch) -> int:
    """Return which of the points that were found is point k, or -1."""
    e = contacts.axes
    if dot(n, (e[k, 0, 0], e[k, 0, 1], e[k, 0, 2])) > SAME_NORMAL:
        for p in range(count):
            if scratch.ids[p] == contacts.feature[k]:
                return p
    return -1


@kernel
def _common(points: Array, p: int, n: Vector) -> Vector:
    """Return the place halfway between the surfaces."""
    half = 0.5 * points[p, 3]
    return (points[p, 0] + half * n[0], points[p, 1] + half * n[1], points[p, 2] + half * n[2])


@kernel
def _ahead(state: State, bodies: Bodies, i: int, t: float) -> Vector:
    """Return where the centre of mass of body i is after t [s]."""
    return (state.x[0, i] + t * bodies.velocity[i, 0], state.x[1, i] + t * bodies.velocity[i, 1],
            state.x[2, i] + t * bodies.velocity[i, 2])


@kernel
def _to_middle(model: Model, contacts: Contacts, bodies: Bodies, k: int, t: float) -> None:
    """
    Let point k go along with its two bodies for t [s].

    It moves by s = (w_A d_A + w_B d_B) / (w_A + w_B) with w = 1 / M where the centres move by d,
    so a body on a fixed one keeps its lever.
    """
    a, b = contacts.body_a[k], contacts.body_b[k]
    w_A, w_B = model.inv_m[a], model.inv_m[b]
    for i in range(3):
        apart = t * (bodies.velocity[b, i] - bodies.velocity[a, i])
        contacts.r_A[k, i] += w_B / (w_A + w_B) * apart
        contacts.r_B[k, i] -= w_A / (w_A + w_B) * apart


@kernel
def _move_point(state: State, contacts: Contacts, bodies: Bodies, k: int, t: float, n: Vector,
                points: Array, p: int, jump: float) -> None:
    """Write the axes and levers of point k after t [s], unless it jumped [m]."""
    at = _common(points, p, n)
    r_A = subtract(at, _ahead(state, bodies, contacts.body_a[k], t))
    r_B = subtract(at, _ahead(state, bodies, contacts.body_b[k], t))
    if min(norm(subtract(r_A, row(contacts.r_A, k))),
           norm(subtract(r_B, row(contacts.r_B, k)))) >= jump:
        return
    t1, t2 = tangents(n)
    for i in range(3):
        contacts.axes[k, 0, i], contacts.axes[k, 1, i], contacts.axes[k, 2, i] = n[i], t1[i], t2[i]
        contacts.r_A[k, i], contacts.r_B[k, i] = r_A[i], r_B[i]


@kernel
def _velocity(state: State, contacts: Contacts, bodies: Bodies, then: Array, k: int, t: float,
              n: Vector, points: Array, p: int) -> tuple[Vector, float]:
    """
    Return the velocity of B relative to A at point p after t [s], with the rates `then`.

    And how far [m] the point has moved from where it was, seen from the body on which it is less.
    """
    a, b = contacts.body_a[k], contacts.body_b[k]
    at = _common(points, p, n)
    r_A = subtract(at, _ahead(state, bodies, a, t))
    r_B = subtract(at, _ahead(state, bodies, b, t))
    on_A = norm(subtract(r_A, row(contacts.r_A, k)))
    on_B = norm(subtract(r_B, row(contacts.r_B, k)))
    v = relative_velocity(linear(then, a), (then[a, 3], then[a, 4], then[a, 5]), r_A,
                          linear(then, b), (then[b, 3], then[b, 4], then[b, 5]), r_B)
    return v, min(on_A, on_B)
