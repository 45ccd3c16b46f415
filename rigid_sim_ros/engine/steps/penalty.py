# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Contact model `penalty`: a spring and a damper at each point where bodies overlap.

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
    Bodies, Contacts, gather, make_bodies, make_contacts, read_velocity, relative, to_contact,
    to_world)
from rigid_sim_ros.engine.detection.detect import detect_ahead
from rigid_sim_ros.engine.detection.manifolds import current, grown, Manifolds, Memory
from rigid_sim_ros.engine.dynamics.free_flight import fly
from rigid_sim_ros.engine.dynamics.integrate import make_work, sum_loads, Work
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic, move_kinematic
from rigid_sim_ros.engine.dynamics.loads import empty_loads, kick, Loads
from rigid_sim_ros.engine.dynamics.wrenches import count_down, Wrenches
from rigid_sim_ros.engine.maths.algebra import cross, quaternion, rotate, row
from rigid_sim_ros.engine.model.kinds.table import KINDS
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

# Of a shape's size: so far detection looks ahead of its surface; only overlap gives a force, so it
# may be tiny.
MARGIN = 1e-9
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


class Bristles(NamedTuple):
    """The bristles of the points that touched last."""

    shape_a: IntArray  # (c,)
    shape_b: IntArray  # (c,)
    feature: IntArray  # (c,)
    stretch: Array  # (c, 3) [m] of B over A, axes of C of body A, with which they turn


class Buffers(NamedTuple):
    """Memory of the kernel, and where it stands; capacity c points."""

    count: IntArray  # type: ignore[assignment]  # (5,) see STEPS
    work: Work
    bodies: Bodies
    loads: Loads
    order: IntArray  # (2, rows of the memory) for `gather`
    contacts: Contacts
    impulses: Array  # (c, 3) [N, contact axes] on B
    stretch: Array  # (c, 3) [m, world axes]
    bristles: Bristles  # (c,) of the end of the last step, or of the middle of this one


# Places in `Buffers.count`.
STEPS, STAGE, KNOWN, NEEDED = range(4)
# Stages of a step, and why the kernel stops.
BEGIN, END = range(2)
DONE, MORE_MEMORY, MORE_MANIFOLDS, MORE_CONTACTS = range(4)


class PenaltyWork:
    """The buffers of the kernel, and the bristles, which carry over from step to step."""

    def __init__(self, bodies: int) -> None:
        """Make room for a world without contacts."""
        c = 64
        self.buffers = Buffers(np.zeros(5, dtype=np.int64), make_work(bodies), make_bodies(bodies),
                               empty_loads(bodies), np.zeros((2, c), dtype=np.int64),
                               make_contacts(c), np.zeros((c, 3)), np.zeros((c, 3)),
                               _longer(no_bristles(), c))

    @property
    def bristles(self) -> Bristles:
        """Return all that influences later steps, besides the state."""
        known = int(self.buffers.count[KNOWN])
        return Bristles._make(field[:known].copy() for field in self.buffers.bristles)

    @bristles.setter
    def bristles(self, kept: Bristles) -> None:
        room = len(self.buffers.bristles.feature)
        self.buffers = self.buffers._replace(bristles=_longer(kept, room))
        self.buffers.count[KNOWN] = len(kept.feature)

    def lasting(self) -> Bristles:
        """Return all that influences later steps, besides the state."""
        return self.bristles

    def give(self, why: int) -> None:
        """Make the room that the kernel stopped for."""
        w, c = self.buffers, 2 * int(self.buffers.count[NEEDED])
        if why == MORE_MANIFOLDS:
            self.buffers = w._replace(order=np.zeros((2, c), dtype=np.int64))
        else:
            self.buffers = w._replace(contacts=make_contacts(c), impulses=np.zeros((c, 3)),
                                      stretch=np.zeros((c, 3)), bristles=_longer(w.bristles, c))


def _longer(bristles: Bristles, rows: int) -> Bristles:
    """Return bristles with room for so many rows, or as many as there are."""
    found = []
    for field in bristles:
        room = np.zeros((max(rows, len(field)), *field.shape[1:]), dtype=field.dtype)
        room[:len(field)] = field
        found.append(room)
    return Bristles._make(found)


def no_bristles() -> Bristles:
    """Return the bristles of a world in which nothing touches."""
    none = np.zeros(0, dtype=np.int64)
    return Bristles(none, none, none, np.zeros((0, 3)))


def stiffness_for_depth(weight: float, depth: float, points: int = 1) -> float:
    """Return the stiffness [N/m] at which a weight [N] on some points sinks in by depth [m]."""
    return weight / (points * depth)


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
def _recall(contacts: Contacts, state: State, bristles: Bristles, size: int,
            stretch: Array) -> None:
    """Write the stretches of points that were there before, world axes, 0 for the others."""
    at = 0
    for k in range(contacts.count[0]):
        for i in range(3):
            stretch[k, i] = 0.0
        for tried in range(size):
            j = (at + tried) % size
            if (bristles.shape_a[j] == contacts.shape_a[k]
                    and bristles.shape_b[j] == contacts.shape_b[k]
                    and bristles.feature[j] == contacts.feature[k]):
                s = rotate(quaternion(state.q, contacts.body_a[k]), row(bristles.stretch, j))
                for i in range(3):
                    stretch[k, i] = s[i]
                at = j + 1
                break


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
    size, limit = math.sqrt(f_1 * f_1 + f_2 * f_2), contacts.friction[k] * normal
    left_1, left_2 = s[1], s[2]
    if size > limit:
        f_1, f_2 = f_1 * limit / size, f_2 * limit / size
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
def _forces(model: Model, state: State, shapes: Shapes, materials: Materials,
            settings: PenaltySettings,
            contacts: Contacts, bodies: Bodies, stretch: Array, t: float, loads: Loads,
            forces: Array) -> None:
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
            a, b = contacts.body_a[k], contacts.body_b[k]
            on_A, on_B = cross(row(contacts.r_A, k), F), cross(row(contacts.r_B, k), F)
            tau = _resistance(model, shapes, materials, contacts, bodies, k, after - first, f[0])
            for i in range(3):
                stretch[k, i] = kept[i]
                forces[k, i] = f[i]
                loads.F[i, a] -= F[i]
                loads.tau[i, a] -= on_A[i] + tau[i]
                loads.F[i, b] += F[i]
                loads.tau[i, b] += on_B[i] + tau[i]
    for i in model.fixed:
        loads.F[:, i] = 0.0
        loads.tau[:, i] = 0.0


@kernel
def _keep(contacts: Contacts, state: State, world: Array, bristles: Bristles) -> None:
    """Write the bristles of all points, turned into the axes of A."""
    for k in range(contacts.count[0]):
        bristles.shape_a[k], bristles.shape_b[k] = contacts.shape_a[k], contacts.shape_b[k]
        bristles.feature[k] = contacts.feature[k]
        q = quaternion(state.q, contacts.body_a[k])
        s = rotate((-q[0], -q[1], -q[2], q[3]), row(world, k))
        for i in range(3):
            bristles.stretch[k, i] = s[i]


@kernel
def _record(manifolds: Manifolds, contacts: Contacts, forces: Array, t: float) -> None:
    """Write the impulses of the step to the manifolds."""
    rows = manifolds.count[0]
    for r in range(rows):
        for j in range(manifolds.points[r]):
            manifolds.impulse[j, r] = 0.0
        for i in range(3):
            manifolds.friction[r, i] = 0.0
        manifolds.spin[r] = 0.0
    for k in range(contacts.count[0]):
        r = contacts.manifold[k]
        for j in range(manifolds.points[r]):
            if manifolds.feature[j, r] == contacts.feature[k]:
                manifolds.impulse[j, r] = t * forces[k, 0]
        rubbing = to_world(contacts, k, (0.0, t * forces[k, 1], t * forces[k, 2]))
        for i in range(3):
            manifolds.friction[r, i] += rubbing[i]


@kernel
def _velocities(model: Model, state: State, bodies: Bodies) -> None:
    # Whose twist is over stands still; in the second half of a step that is nobody.
    begin_kinematic(model, state)
    for i in range(model.m.shape[0]):
        read_velocity(model, state, i, bodies)


@kernel
def _drift(model: Model, state: State, wrenches: Wrenches, work: Work) -> None:
    """Half a kick of the loads other than contact, and the drift of a whole step."""
    sum_loads(model, state, wrenches, work.loads)
    kick(state, work.loads, 0.5 * model.h)
    fly(model, state, (0.0, 0.0, 0.0), model.h, np.int64(1), work.block)
    move_kinematic(model, state, model.h)


@kernel
def _last_kick(model: Model, state: State, wrenches: Wrenches, work: Work) -> None:
    """Kick by the other half, with the loads at the new pose; see `integrate.symplectic`."""
    kick(state, work.loads, 0.5 * model.h)
    sum_loads(model, state, wrenches, work.later)
    kick(state, work.later, 0.5 * model.h)
    kick(state, work.loads, -0.5 * model.h)
    end_kinematic(model, state)
    count_down(wrenches)


@kernel
def _overlaps(model: Model, state: State, shapes: Shapes, materials: Materials, memory: Memory,
              w: Buffers) -> int:
    """Find the points that overlap; return DONE, or what is needed first."""
    manifolds = current(memory)
    for r in range(manifolds.count[0]):
        # Polyhedra that hardly moved would keep points that are right to second order: results
        # would then depend on when these were found.
        manifolds.found_at[r, 0] = np.inf
    for s in range(shapes.bound.shape[0]):
        memory.ahead[s] = MARGIN * shapes.bound[s] if shapes.bound[s] < np.inf else 0.0
    memory.calm[0] = np.inf
    if not detect_ahead(model, state, shapes, memory, None):
        return MORE_MEMORY
    manifolds = current(memory)
    rows = manifolds.count[0]
    w.count[NEEDED] = rows
    if rows > w.order.shape[1]:
        return MORE_MANIFOLDS
    found = gather(state, manifolds, shapes, materials, 0.0, w.order[0, :rows], w.order[1, :rows],
                   w.contacts)
    w.count[NEEDED] = max(found, w.count[KNOWN])
    if w.count[NEEDED] > w.contacts.gap.shape[0]:
        return MORE_CONTACTS
    _velocities(model, state, w.bodies)
    return DONE


@kernel
def _push(model: Model, state: State, shapes: Shapes, materials: Materials,
          settings: PenaltySettings, t: float, w: Buffers) -> None:
    """Kick by half a step of the forces of all points, after a slip of t [s]; keep bristles."""
    _recall(w.contacts, state, w.bristles, w.count[KNOWN], w.stretch)
    _forces(model, state, shapes, materials, settings, w.contacts, w.bodies, w.stretch, t, w.loads,
            w.impulses)
    _keep(w.contacts, state, w.stretch, w.bristles)
    w.count[KNOWN] = w.contacts.count[0]
    kick(state, w.loads, 0.5 * model.h)


@kernel
def run(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, materials: Materials,
        memory: Memory, settings: PenaltySettings, w: Buffers) -> int:
    """Step until no steps are left; return DONE, or what is needed first."""
    while w.count[STEPS] > 0:
        why = _overlaps(model, state, shapes, materials, memory, w)
        if why != DONE:
            return why
        if w.count[STAGE] == BEGIN:
            _push(model, state, shapes, materials, settings, 0.0, w)
            _drift(model, state, wrenches, w.work)
            w.count[STAGE] = END
        else:
            _push(model, state, shapes, materials, settings, model.h, w)
            _last_kick(model, state, wrenches, w.work)
            _record(current(memory), w.contacts, w.impulses, model.h)
            w.count[STAGE] = BEGIN
            w.count[STEPS] -= 1
    return DONE


def advance(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, materials: Materials,
            memory: Memory, settings: PenaltySettings, work: PenaltyWork, count: int) -> Memory:
    """
    Advance all bodies by `count` steps, in place; return the memory, which may have grown.

    Kick, drift, kick: order 2 while the points stay the same. work.bristles together with the
    state is all that the next step depends on.
    """
    work.buffers.count[STEPS] = count
    while (why := run(model, state, wrenches, shapes, materials, memory, settings,
                      work.buffers)) != DONE:
        if why == MORE_MEMORY:
            memory = grown(memory)
        else:
            work.give(why)
    return memory
