# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The force law of the model `penalty`: a spring and a damper at each point of contact.

"Soft body collision: force is applied to prevent interpenetration" (Meyer, Rigid Body Dynamics).
With the depth d of a point the normal force is that of Hunt and Crossley with a linear spring,

    f_n = max(0, k d (1 + c d'))

(Coefficient of restitution interpreted as damping in vibroimpact, J. Appl. Mech. 42 (1975)): it
begins and ends at 0, as a force proportional to d' alone would not, and never pulls. A body that
arrives with v0 leaves with v1 where

    c v0 - ln(1 + c v0) = -c v1 - ln(1 - c v1),    so v1 / v0 = 1 - 2 c v0 / 3 + O((c v0)^2).

No damper is stronger than what stops its point in one step, k c d <= m / (p h) with the mass m
that a pair on p points has along the normal. A fast body, which the damper lets in by
d = sqrt(2 m v / (p k c)), would else be thrown back; the bound takes effect where
h omega sqrt(2 c v) > 1 with omega^2 = p k / m, and the body then goes deeper.

Friction is a bristle: a spring and damper along the surface whose stretch is remembered from step
to step, for each point by its feature, and slips where its force would exceed mu f_n. It is
stretched, not creeping, while a body rests on a slope.

Against rolling and spinning a torque of the lever times the normal force opposes the relative
angular velocity, regularised: no larger than what would stop it in a few steps. A slow rotation so
fades instead of changing its sign, and a ball creeps where a torque would have to hold it.
"""

import math
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.contacts import (
    add_contact_load, Bodies, Contacts, relative, to_contact, to_world)
from rigid_sim_ros.engine.contact.coulomb import onto_disk
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.maths.algebra import cross, quaternion, rotate, row
from rigid_sim_ros.engine.model.kinds.table import KINDS
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel

# The bristle's stiffness over the spring's: 1 keeps one limit for the step; Mindlin's elastic
# spheres have 0.7 to 1.
TANGENTIAL = 1.0
# Damping of the bristle against its critical damping. 0 lets a body on a slope swing for ever.
BRISTLE_DAMPING = 0.5
# Step times angular frequency of the stiffest pair. Verlet is stable below 2; half of it leaves
# room for bodies that are touched from two sides, and puts 6 steps into one oscillation.
STEP_LIMIT = 1.0
# Steps in which the torques against rolling and spinning may stop a rotation, at least. Below 1 it
# would swing; 40 lets a ball creep ten times as fast where it should be held.
STOPPING = 4.0


class PenaltySettings(NamedTuple):
    """What may be tuned besides the stiffness and damping of the materials."""

    tangential: float = TANGENTIAL
    bristle_damping: float = BRISTLE_DAMPING


def stable_step(model: Model, shapes: Shapes, materials: Materials) -> tuple[float, int, int]:
    """
    Return the longest step [s] that is stable for every pair, and the two shapes that set it.

    A body on p points of stiffness k each moves against them with at most omega^2 = p k (1/M + r^2
    / I), with the farthest distance r of its surface from the centre of mass and its smallest
    moment I; for two bodies the brackets add up. The step is STEP_LIMIT / omega; infinite where
    nothing can touch.
    """
    moving = np.flatnonzero(shapes.still == 0)
    if len(moving) == 0 or len(shapes.body) < 2:
        return math.inf, -1, -1
    i = shapes.body
    reach = np.linalg.norm(shapes.p_CS, axis=1) + np.where(np.isfinite(shapes.bound),
                                                           shapes.bound, 0.0)
    give = model.inv_m[i] + reach ** 2 * model.inv_I_C[:, i].max(axis=0)
    points = np.array([KINDS[kind].most_points for kind in shapes.kind])
    best, pair = 0.0, (-1, -1)
    # The partner that gives way most, for each material: what is left is shapes times materials.
    for material in np.unique(shapes.material):
        of_it = np.flatnonzero(shapes.material == material)
        order = of_it[np.argsort(-give[of_it], kind='stable')]
        for s in moving:
            partner = next((int(p) for p in order if i[p] != i[s]), -1)
            if partner < 0:
                continue
            k = float(materials.stiffness[shapes.material[s], material])
            squared = points[s] * k * (give[s] + give[partner])
            if squared > best:
                best, pair = squared, (int(s), partner)
    return (STEP_LIMIT / math.sqrt(best) if best > 0.0 else math.inf), *pair


def check_step(model: Model, shapes: Shapes, materials: Materials) -> None:
    """Raise ValueError, with a step and a stiffness that work, if the step is too long."""
    longest, a, b = stable_step(model, shapes, materials)
    if model.h <= longest:
        return
    k = float(materials.stiffness[shapes.material[a], shapes.material[b]])
    raise ValueError(
        f'step {model.h:g} s is unstable for the contact stiffness {k:g} N/m between shape {a} '
        f'({KINDS[shapes.kind[a]].name}) of body {shapes.body[a]} and shape {b} '
        f'({KINDS[shapes.kind[b]].name}) of body {shapes.body[b]}: use a step of at most '
        f'{_rounded_down(longest):g} s, or a stiffness of at most '
        f'{_rounded_down(k * (longest / model.h) ** 2):g} N/m for the pair')


def _rounded_down(value: float) -> float:
    """Return the number with two digits that is not above the value."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.floor(value / unit) * unit


@kernel
def _turning(model: Model, state: State, body: int, r: Vector, n: Vector) -> float:
    """Return (r x n) . I^-1 (r x n) [1/kg]: how a force along n at r gives way by turning."""
    q = quaternion(state.q, body)
    arm = rotate((-q[0], -q[1], -q[2], q[3]), cross(r, n))
    return (model.inv_I_C[0, body] * arm[0] * arm[0] + model.inv_I_C[1, body] * arm[1] * arm[1]
            + model.inv_I_C[2, body] * arm[2] * arm[2])


@kernel
def _point_force(model: Model, state: State, shapes: Shapes, materials: Materials,
                 settings: PenaltySettings, contacts: Contacts, k: int, points: int, u: Vector,
                 s: Vector) -> tuple[Vector, float, float]:
    """Return the force on B [N, contact axes], and the stretch after slip [m, t1, t2]."""
    material_a = shapes.material[contacts.shape_a[k]]
    material_b = shapes.material[contacts.shape_b[k]]
    stiffness = materials.stiffness[material_a, material_b]
    depth = max(0.0, -contacts.gap[k])
    a, b = contacts.body_a[k], contacts.body_b[k]
    inv_m, n = model.inv_m[a] + model.inv_m[b], to_world(contacts, k, (1.0, 0.0, 0.0))
    give = (inv_m + _turning(model, state, a, row(contacts.r_A, k), n)
            + _turning(model, state, b, row(contacts.r_B, k), n))
    # The points of a pair share its mass: each damps its part.
    strongest = 1.0 / (give * points * model.h)
    damper = min(materials.damping[material_a, material_b] * stiffness * depth, strongest)
    normal = max(0.0, stiffness * depth - damper * u[0])
    along = settings.tangential * stiffness
    mass = 1.0 / (inv_m * points)
    damping = 2.0 * settings.bristle_damping * math.sqrt(along * mass)
    f_1, f_2 = -along * s[1] - damping * u[1], -along * s[2] - damping * u[2]
    wanted_1, wanted_2 = f_1, f_2
    f_1, f_2 = onto_disk(f_1, f_2, contacts.friction[k] * normal)
    left_1, left_2 = s[1], s[2]
    if f_1 != wanted_1 or f_2 != wanted_2:
        # While it slips the bristle alone holds the force.
        left_1, left_2 = -f_1 / along, -f_2 / along
    return (normal, f_1, f_2), left_1, left_2


@kernel
def _resistance(model: Model, shapes: Shapes, materials: Materials, contacts: Contacts,
                bodies: Bodies, k: int, points: int, normal: float) -> Vector:
    """Return the torque on B [N m, world axes] against spinning and rolling at point k."""
    material_a = shapes.material[contacts.shape_a[k]]
    material_b = shapes.material[contacts.shape_b[k]]
    spinning = materials.spinning[material_a, material_b]
    rolling = materials.rolling[material_a, material_b]
    if normal == 0.0 or (spinning == 0.0 and rolling == 0.0):
        return (0.0, 0.0, 0.0)
    a, b, v = contacts.body_a[k], contacts.body_b[k], bodies.velocity
    w = to_contact(contacts, k, (v[b, 3] - v[a, 3], v[b, 4] - v[a, 4], v[b, 5] - v[a, 5]))
    give = (max(model.inv_I_C[0, a], model.inv_I_C[1, a], model.inv_I_C[2, a])
            + max(model.inv_I_C[0, b], model.inv_I_C[1, b], model.inv_I_C[2, b]))
    # The torque per angular velocity that stops the smaller moment in that time, all points
    # together.
    most = 1.0 / (give * STOPPING * model.h * points)
    size = math.sqrt(w[1] * w[1] + w[2] * w[2])
    on_spin = min(most, spinning * normal / abs(w[0])) if w[0] != 0.0 else 0.0
    on_roll = min(most, rolling * normal / size) if size > 0.0 else 0.0
    return to_world(contacts, k, (-on_spin * w[0], -on_roll * w[1], -on_roll * w[2]))


@kernel
def penalty_forces(model: Model, state: State, shapes: Shapes, materials: Materials,
                   settings: PenaltySettings, contacts: Contacts, bodies: Bodies, stretch: Array,
                   t: float, loads: Loads, forces: Array) -> None:
    """
    Write the loads [N, N m] of all points, and their forces on B, (c, 3) [N, contact axes].

    The stretches, (c, 3) [m, world axes], first grow by what slid in t [s], and lose what slips.
    """
    loads.F[:] = 0.0
    loads.tau[:] = 0.0
    for block in range(contacts.count[1]):
        first, after = contacts.first[block], contacts.first[block + 1]
        for k in range(first, after):
            u = to_contact(contacts, k, relative(bodies.velocity, contacts, k))
            s = to_contact(contacts, k, row(stretch, k))
            s = (0.0, s[1] + t * u[1], s[2] + t * u[2])
            f, left_1, left_2 = _point_force(model, state, shapes, materials, settings, contacts,
                                             k, after - first, u, s)
            kept = to_world(contacts, k, (0.0, left_1, left_2))
            F = to_world(contacts, k, f)
            tau = _resistance(model, shapes, materials, contacts, bodies, k, after - first, f[0])
            for i in range(3):
                stretch[k, i] = kept[i]
                forces[k, i] = f[i]
            add_contact_load(model.inv_m, contacts, k, F, tau, loads)
