# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The points at which bodies touch, with what the laws of contact need to know of them.

Manifolds are a pair of shapes each. Impulses and contact forces look at pairs of bodies: the
points of one pair of bodies, whichever of their shapes they belong to, form a block, and lie side
by side here.

In the axes (n, t1, t2) of a contact, n from A to B, the motion of B relative to A is u = (u_n,
u_t1, u_t2), so that u_n is the rate of the gap, and a force or impulse acts on B as given and on A
with the other sign.

Where something resists rolling and spinning, three rows more belong to a point: the relative
angular velocity w in the same axes, (w_n, w_t1, w_t2), and a torque. They are made commensurable
with the others by a length l of the contact: rates l w [m/s], torques over l [N]. The levers over
l are then coefficients like that of friction: for a ball l is its radius, and rolling / l is what
tables call the coefficient of rolling resistance.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.detection.manifolds import Manifolds
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.maths.algebra import column, cross, norm, quaternion, row, scale
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes, smaller
from rigid_sim_ros.engine.state.rates import relative_velocity, spin_of
from rigid_sim_ros.engine.state.state import add_impulse_with_lever, State
from rigid_sim_ros.engine.state.world_inertia import world_inertia
from rigid_sim_ros.kernels.arrays import Array, IntArray, Quaternion, Vector
from rigid_sim_ros.kernels.kernel import kernel


class Contacts(NamedTuple):
    """Points of contact in blocks; capacity c."""

    count: IntArray  # type: ignore[assignment]  # (2,) points in use, blocks in use
    first: IntArray  # (c + 1,) the points of block k are first[k] to first[k + 1] - 1
    manifold: IntArray  # (c,) row of the manifold
    shape_a: IntArray  # (c,)
    shape_b: IntArray  # (c,)
    feature: IntArray  # (c,) what the manifold calls the point from step to step
    body_a: IntArray  # (c,)
    body_b: IntArray  # (c,)
    axes: Array  # n, t1, t2 as rows, (c, 3, 3), world axes
    r_A: Array  # the point from the centre of mass of A, (c, 3) [m], world axes
    r_B: Array  # the same point from the centre of mass of B, (c, 3) [m], world axes
    gap: Array  # (c,) [m], < 0 is overlap
    size: Array  # (c,) [m] of the smaller shape: tolerances are parts of it
    friction: Array  # (c,) coefficient
    restitution: Array  # (c,) coefficient
    spinning: Array  # (c,) [m] lever of the normal force against turning about the normal
    rolling: Array  # (c,) [m] lever against rolling
    alike: IntArray  # (c,) 1 for blocks that are to collide next, see `impulse`
    spare: IntArray  # (c,) 1 for points without which all is borne, see spare_points.py


class Bodies(NamedTuple):
    """What contacts need to know of n bodies at one instant, world axes."""

    velocity: Array  # v and w, (n, 6) [m/s, rad/s]
    inv_I_W: Array  # (n, 3, 3) [1/(kg m^2)]
    acceleration: Array  # under the loads, linear and angular, (n, 6) [m/s^2, rad/s^2]


def make_contacts(capacity: int) -> Contacts:
    """Return room for points of contact."""
    c = capacity

    def whole(size: int = c) -> IntArray:
        return np.zeros(size, dtype=np.int64)

    return Contacts(whole(2), whole(c + 1), whole(), whole(), whole(), whole(), whole(), whole(),
                    np.zeros((c, 3, 3)), np.zeros((c, 3)), np.zeros((c, 3)), np.zeros(c),
                    np.zeros(c), np.zeros(c), np.zeros(c), np.zeros(c), np.zeros(c), whole(),
                    whole())


def make_bodies(n: int) -> Bodies:
    """Return room for n bodies."""
    return Bodies(np.zeros((n, 6)), np.zeros((n, 3, 3)), np.zeros((n, 6)))


@kernel
def share_a_body(inv_m: Array, a: int, b: int, c: int, d: int) -> bool:
    """Return whether the pairs of bodies a, b and c, d have one in common that moves."""
    return bool((inv_m[a] > 0.0 and a in (c, d)) or (inv_m[b] > 0.0 and b in (c, d)))


@kernel
def tangents(n: Vector) -> tuple[Vector, Vector]:
    """Return t1, t2 that make a right-handed frame with n; the same for the same n."""
    # The axis least aligned with n, so that nothing cancels in the product.
    if abs(n[0]) <= abs(n[1]) and abs(n[0]) <= abs(n[2]):
        t = (0.0, n[2], -n[1])
    elif abs(n[1]) <= abs(n[2]):
        t = (-n[2], 0.0, n[0])
    else:
        t = (n[1], -n[0], 0.0)
    s = 1.0 / np.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
    t1 = (s * t[0], s * t[1], s * t[2])
    return t1, cross(n, t1)


def gather_all(state: State, manifolds: Manifolds, shapes: Shapes, materials: Materials,
               reach: float, contacts: Contacts) -> int:
    """Write the points as `gather` does, with scratch memory of its own."""
    order = np.empty((2, int(manifolds.count[0])), dtype=np.int64)
    return int(gather(state, manifolds, shapes, materials, reach, order[0], order[1], contacts))


@kernel
def gather(state: State, manifolds: Manifolds, shapes: Shapes, materials: Materials,
           reach: float, key: IntArray, order: IntArray, contacts: Contacts) -> int:
    """
    Write the points whose gap is at most `reach` [m], block after block.

    Returns how many there are. Where that is more than the capacity, nothing useful was written:
    call again with room. key, order: scratch, a number for each manifold in use.
    """
    n = state.x.shape[1]
    for k in range(manifolds.count[0]):
        a, b = manifolds.body_a[k], manifolds.body_b[k]
        key[k] = min(a, b) * n + max(a, b)
    return gather_by_key(state, manifolds, shapes, materials, reach, key, order, contacts)


@kernel
def gather_by_key(state: State, manifolds: Manifolds, shapes: Shapes, materials: Materials,
                  reach: float, key: IntArray, order: IntArray, contacts: Contacts) -> int:
    """Write points as `gather` does, by the keys of pairs; keys < 0 leave a pair out."""
    for k in range(manifolds.count[0]):
        # By insertion: the rows are nearly in order, and within a block their order remains.
        at = k
        while at > 0 and key[order[at - 1]] > key[k]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = k
    capacity = contacts.gap.shape[0]
    total, blocks, last = 0, 0, np.int64(-1)
    for k in order:
        for j in range(manifolds.points[k] if key[k] >= 0 else 0):
            if manifolds.gap[j, k] > reach:
                continue
            if total < capacity:
                if key[k] != last:
                    contacts.first[blocks] = total
                    blocks += 1
                    last = key[k]
                _write_point(state, manifolds, shapes, materials, k, j, contacts, total)
            total += 1
    contacts.count[0] = min(total, capacity)
    contacts.count[1] = blocks
    contacts.first[blocks] = contacts.count[0]
    return total


@kernel
def _write_point(state: State, manifolds: Manifolds, shapes: Shapes, materials: Materials, k: int,
                 j: int, contacts: Contacts, at: int) -> None:
    a, b = manifolds.body_a[k], manifolds.body_b[k]
    contacts.manifold[at] = k
    contacts.shape_a[at], contacts.shape_b[at] = manifolds.shape_a[k], manifolds.shape_b[k]
    contacts.feature[at] = manifolds.feature[j, k]
    contacts.body_a[at], contacts.body_b[at] = a, b
    normal = row(manifolds.normal, k)
    t1, t2 = tangents(normal)
    for i in range(3):
        contacts.axes[at, 0, i] = normal[i]
        contacts.axes[at, 1, i] = t1[i]
        contacts.axes[at, 2, i] = t2[i]
        # One point for both bodies, halfway: opposite impulses there keep P and L to the last
        # digit.
        apart = ((state.x[i, b] + manifolds.r_B[j, k, i])
                 - (state.x[i, a] + manifolds.r_A[j, k, i]))
        contacts.r_A[at, i] = manifolds.r_A[j, k, i] + 0.5 * apart
        contacts.r_B[at, i] = manifolds.r_B[j, k, i] - 0.5 * apart
    contacts.gap[at] = manifolds.gap[j, k]
    contacts.size[at] = smaller(shapes, manifolds.shape_a[k], manifolds.shape_b[k])
    material_a = shapes.material[manifolds.shape_a[k]]
    material_b = shapes.material[manifolds.shape_b[k]]
    contacts.friction[at] = materials.friction[material_a, material_b]
    contacts.restitution[at] = materials.restitution[material_a, material_b]
    contacts.spinning[at] = materials.spinning[material_a, material_b]
    contacts.rolling[at] = materials.rolling[material_a, material_b]


@kernel
def read_velocity(model: Model, state: State, i: int, bodies: Bodies) -> None:
    """Write v and w of body i, prescribed ones too."""
    w = spin_of(quaternion(state.q, i), column(state.L, i), column(model.inv_I_C, i))
    for k in range(3):
        bodies.velocity[i, k] = model.inv_m[i] * state.P[k, i] + state.V[k, i]
        bodies.velocity[i, 3 + k] = w[k] + state.V[3 + k, i]


@kernel
def read_bodies(model: Model, state: State, F: Array, tau: Array, bodies: Bodies) -> None:
    """
    Write velocities, inverse inertia tensors, and what loads (3, n) [N, N m] do to them.

    The angular acceleration is I^-1 tau: without the part -I^-1 (w x L), which a body without
    loads has too.
    """
    for i in range(model.m.shape[0]):
        read_body(model, state, F, tau, i, bodies)


@kernel
def read_touched(model: Model, state: State, F: Array, tau: Array, contacts: Contacts,
                 bodies: Bodies) -> None:
    """Write what `read_bodies` writes for the bodies of the points alone, pair after pair."""
    for n in range(contacts.count[1]):
        k = contacts.first[n]
        read_body(model, state, F, tau, contacts.body_a[k], bodies)
        read_body(model, state, F, tau, contacts.body_b[k], bodies)


@kernel
def read_body(model: Model, state: State, F: Array, tau: Array, i: int, bodies: Bodies) -> None:
    """Write velocity, inverse inertia and free acceleration of body i under F [N], tau [N m]."""
    if model.inv_m[i] == 0.0:
        _read_unmoved(state, i, bodies)
        return
    read_velocity(model, state, i, bodies)
    for k in range(3):
        bodies.acceleration[i, k] = model.inv_m[i] * F[k, i]
    read_turning(model, quaternion(state.q, i), tau, i, bodies)


@kernel
def _read_unmoved(state: State, i: int, bodies: Bodies) -> None:
    """Write the prescribed twist of body i, which no load moves: inverse inertia 0."""
    for k in range(3):
        bodies.velocity[i, k], bodies.velocity[i, 3 + k] = state.V[k, i], state.V[3 + k, i]
        bodies.acceleration[i, k] = bodies.acceleration[i, 3 + k] = 0.0
        for j in range(3):
            bodies.inv_I_W[i, k, j] = 0.0


@kernel
def read_turning(model: Model, q: Quaternion, tau: Array, i: int, bodies: Bodies) -> None:
    """Write the inverse inertia tensor of body i at the attitude q, and I^-1 tau."""
    inv_I = world_inertia(q, column(model.inv_I_C, i))
    for j in range(3):
        for k in range(3):
            bodies.inv_I_W[i, j, k] = inv_I[j][k]
    for k in range(3):
        angular = 0.0
        for j in range(3):
            angular += bodies.inv_I_W[i, k, j] * tau[j, i]
        bodies.acceleration[i, 3 + k] = angular


@kernel
def linear(rates: Array, i: int) -> Vector:
    """Return the linear part of row i of rates (linear, angular)."""
    return (rates[i, 0], rates[i, 1], rates[i, 2])


@kernel
def relative(rates: Array, contacts: Contacts, k: int) -> Vector:
    """Return the rate of B minus that of A at point k, world axes, from rows (linear, angular)."""
    a, b = contacts.body_a[k], contacts.body_b[k]
    r_A, r_B = row(contacts.r_A, k), row(contacts.r_B, k)
    return relative_velocity(linear(rates, a), (rates[a, 3], rates[a, 4], rates[a, 5]), r_A,
                             linear(rates, b), (rates[b, 3], rates[b, 4], rates[b, 5]), r_B)


@kernel
def to_contact(contacts: Contacts, k: int, v: Vector) -> Vector:
    """Return a world vector in the axes n, t1, t2 of point k."""
    e = contacts.axes
    return (e[k, 0, 0] * v[0] + e[k, 0, 1] * v[1] + e[k, 0, 2] * v[2],
            e[k, 1, 0] * v[0] + e[k, 1, 1] * v[1] + e[k, 1, 2] * v[2],
            e[k, 2, 0] * v[0] + e[k, 2, 1] * v[1] + e[k, 2, 2] * v[2])


@kernel
def to_world(contacts: Contacts, k: int, f: Vector) -> Vector:
    """Return a vector given in the axes n, t1, t2 of point k in world axes."""
    e = contacts.axes
    return (e[k, 0, 0] * f[0] + e[k, 1, 0] * f[1] + e[k, 2, 0] * f[2],
            e[k, 0, 1] * f[0] + e[k, 1, 1] * f[1] + e[k, 2, 1] * f[2],
            e[k, 0, 2] * f[0] + e[k, 1, 2] * f[1] + e[k, 2, 2] * f[2])


@kernel
def row_count(materials: Materials) -> int:
    """Return how many rows a point has: 6 where anything resists rolling or spinning, else 3."""
    for i in range(materials.rolling.shape[0]):
        for j in range(materials.rolling.shape[0]):
            if materials.rolling[i, j] > 0.0 or materials.spinning[i, j] > 0.0:
                return 6
    return 3


@kernel
def length(model: Model, contacts: Contacts, k: int) -> float:
    """Return the length l [m] of point k: its larger distance from the centre of a moving body."""
    a, b = contacts.body_a[k], contacts.body_b[k]
    on_A = norm(row(contacts.r_A, k)) if model.inv_m[a] > 0.0 else 0.0
    on_B = norm(row(contacts.r_B, k)) if model.inv_m[b] > 0.0 else 0.0
    longest = max(on_A, on_B)
    return longest if longest > 0.0 else 1.0


@kernel
def read_rates(model: Model, contacts: Contacts, rates: Array, k: int, width: int, u: Array,
               at: int) -> None:
    """Write the rates of point k, from rows (linear, angular) of the bodies, to u[at:]."""
    u[at], u[at + 1], u[at + 2] = to_contact(contacts, k, relative(rates, contacts, k))
    if width == 6:
        a, b = contacts.body_a[k], contacts.body_b[k]
        w = (rates[b, 3] - rates[a, 3], rates[b, 4] - rates[a, 4], rates[b, 5] - rates[a, 5])
        turning, arm = to_contact(contacts, k, w), length(model, contacts, k)
        u[at + 3], u[at + 4], u[at + 5] = arm * turning[0], arm * turning[1], arm * turning[2]


@kernel
def read_coefficients(model: Model, contacts: Contacts, k: int, width: int, mu: Array,
                      c: int) -> None:
    """Write the coefficients of friction, and of spinning and rolling, of point k to mu[c]."""
    mu[c, 0] = contacts.friction[k]
    if width == 6:
        arm = length(model, contacts, k)
        mu[c, 1], mu[c, 2] = contacts.spinning[k] / arm, contacts.rolling[k] / arm


@kernel
def torque_in_world(model: Model, contacts: Contacts, k: int, width: int, f: Array,
                    at: int) -> Vector:
    """Return the torque on B [N m, world axes] of the rows of point k that begin at f[at]."""
    if width == 3:
        return (0.0, 0.0, 0.0)
    arm = length(model, contacts, k)
    return to_world(contacts, k, (arm * f[at + 3], arm * f[at + 4], arm * f[at + 5]))


@kernel
def add_contact_load(inv_m: Array, contacts: Contacts, k: int, F: Vector, tau: Vector,
                     loads: Loads) -> None:
    """
    Add what a force F [N] at point k and a torque tau [N m] on B do to both bodies.

    World axes; on A they act with the other sign (Meyer, "Resting Contact").
    """
    a, b = contacts.body_a[k], contacts.body_b[k]
    on_A, on_B = cross(row(contacts.r_A, k), F), cross(row(contacts.r_B, k), F)
    for i in range(3):
        if inv_m[a] > 0.0:
            loads.F[i, a] -= F[i]
            loads.tau[i, a] -= on_A[i] + tau[i]
        if inv_m[b] > 0.0:
            loads.F[i, b] += F[i]
            loads.tau[i, b] += on_B[i] + tau[i]


@kernel
def push_rows(model: Model, state: State, contacts: Contacts, k: int, width: int, J: Array,
              at: int) -> None:
    """Apply the impulses of all rows of point k, J[at:] [N s, contact axes]."""
    push(state, contacts, k, to_world(contacts, k, (J[at], J[at + 1], J[at + 2])), model)
    turning = torque_in_world(model, contacts, k, width, J, at)
    a, b = contacts.body_a[k], contacts.body_b[k]
    for i in range(3):
        if model.inv_m[a] > 0.0:
            state.L[i, a] -= turning[i]
        if model.inv_m[b] > 0.0:
            state.L[i, b] += turning[i]


@kernel
def push(state: State, contacts: Contacts, k: int, J: Vector, model: Model) -> None:
    """Apply an impulse [N s, world axes] at point k: J to B, -J to A (Meyer, "Impulse")."""
    a, b = contacts.body_a[k], contacts.body_b[k]
    add_impulse_with_lever(model.inv_m, state, a, row(contacts.r_A, k), scale(-1.0, J))
    add_impulse_with_lever(model.inv_m, state, b, row(contacts.r_B, k), J)
