# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The moving bodies that may touch something, as the sequential solver sees them.

A body has a slot here for one step. Velocity v and angular momentum L are all that contacts
change; the inverse inertia in world axes stays what it is in the middle of the step, so that a
step is a linear problem, and the pose moves once, at its end. The first slot of a half (see
partition.py) stands for every body that does not move: nothing that is added to it is ever
different from 0.
"""

from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.constraints.contact_blocks import load_three
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.dynamics.free_rotation import (
    are_alike, MAX_ANGLE, may_turn_by, SAME_ATTITUDE, turn, turn_fast)
from rigid_sim_ros.engine.maths.rotation import quaternion
from rigid_sim_ros.engine.maths.vector import column
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.engine.state.world_inertia import write_world_inertia
from rigid_sim_ros.kernels.arrays import Array, IntArray, integers, Quaternion, room, Vector
from rigid_sim_ros.kernels.eight import (
    any_of, gather, LANES, load, read_eight, select, store, write_eight)
from rigid_sim_ros.kernels.kernel import INDEX, inlined, kernel, part, pasted

# Numbers of a body in `motion`: v [m/s], L [kg m^2/s], world axes, and two that stay as they are:
# what a contact of balls needs besides. So a body fills one line of the cache, and whatever all
# bodies do alike is one loop over a flat array.
STRIDE = 8
INV_I = 7  # the first of INV_I_W, which is that about all axes of a ball [1/(kg m^2)]
INV_M = 6  # in `mass` as well, after the inverse inertia, world axes
INV_I_W = 0  # xx, xy, xz, yy, yz, zz
# In `drifted` at the end of a step: whether a contact acted on a body.
TOUCHED = 7
# Rows of the scratch block in which eight bodies are moved: the state before and afterwards, what
# is needed of the body, and the mean of L of those that are too fast for `turn`.
_X, _Q, _P, _L, _INV_I, _M, _INV_M, _MEAN_L, _FAST, _ROWS = 0, 3, 7, 10, 13, 16, 17, 18, 21, 22


# Of `used`: where the slots of the first half end; where those of the second one begin and end.
FIRST_END, SECOND_BEGIN, SECOND_END, _USED = range(4)
# Empty slots between the halves. A core that reads slot after slot prefetches some thirty cache
# lines beyond the last one that it asked for. Where the other core writes these, each of them
# travels from core to core in each substep.
_BETWEEN_HALVES = 64


class SolverBodies(NamedTuple):
    """Slots for up to n bodies and, in each half, the one that stands still."""

    slot: IntArray  # (n,) of a body, 0 if it does not take part
    flies: IntArray  # (n,) of 8 bits, 1 for what moves and is touched by nothing
    body: IntArray  # (slots,) in a slot; -1 in those that stand still
    used: IntArray  # (3,), see FIRST_END
    astride: IntArray  # (slots,) of 8 bits, 1 for who has a contact with the other half
    motion: Array  # flat, STRIDE for each slot, as all but the last two
    # With what the bodies moved in the last substep: `motion` and the motion that only displaces,
    # out of overlaps. Before the first substep it is `motion`. While the push is found it stands
    # here alone, from `begin_push` on, and with it the inverse mass.
    drifted: Array
    # F / m [m/s^2] and torque [N m] of all that is no contact, and 0, 0. Where gravity is all
    # there is, `alike` is 1, and only the slots of what stands still hold it: all read it there
    smooth: Array
    alike: IntArray  # (1,)
    # `motion` of this substep without contacts; between two substeps what contacts added in the
    # one before, which they add to the next one to begin with
    base: Array
    total: Array  # sums of `drifted` over the substeps
    mass: Array  # see INV_I_W and INV_M
    lanes: Array  # flat scratch for each half, as the next one
    at: IntArray


def most_slots(n: int) -> int:
    """Return how many slots there are for n bodies, with those that stand still."""
    plain: Any = slots_between  # as a kernel it would be compiled for this alone
    return n + 2 + int(plain.py_func(n))


@inlined
def slots_between(n: int) -> int:
    """Return how many slots are left empty between the halves; of a small world few."""
    return min(_BETWEEN_HALVES, n // 8)


def make_bodies(n: int) -> SolverBodies:
    """Return room for n bodies."""
    slots = most_slots(n)

    def numbers() -> Any:
        return room(slots * STRIDE)

    return SolverBodies(room(n, kind=np.int32), room(n, kind=np.int8),
                        room(slots, kind=np.int32), integers(_USED),
                        room(slots, kind=np.int8), numbers(), numbers(), numbers(), integers(1),
                        numbers(), numbers(), numbers(), room(2 * _ROWS * LANES),
                        integers(2 * LANES))


@inlined
def slots_of(used: IntArray, half: int) -> tuple[int, int]:
    """Return the first slot of a half, 0 or 1, the still one, and the slot after its last."""
    first = used[SECOND_BEGIN] if half == 1 else 0
    last = used[SECOND_END] if half == 1 else used[FIRST_END]
    return first & INDEX, last & INDEX


@pasted
def _of_half(numbers: Array, used: IntArray, half: int) -> Array:
    """Return the numbers of the slots of a half."""
    first, last = slots_of(used, half)
    return numbers[first * STRIDE:last * STRIDE]


@inlined
def still_slot(used: IntArray, region: int) -> int:
    """Return the slot that stands still in a half; across are none but moving bodies."""
    return used[SECOND_BEGIN] if region == 1 else 0


@inlined
def moves_by_twist(bodies: SolverBodies, i: int) -> bool:
    """Return whether body i has a slot and yet cannot be pushed: it moves by its twist."""
    slot = bodies.slot[i & INDEX] & INDEX
    return (slot > 0) & (bodies.motion[slot * STRIDE + INV_M] == 0.0)


@part
def load_bodies(half: int, h: float, gravity: Array, inv_m: Array, inv_I_C: Array, state: State,
                loads: Loads, bodies: SolverBodies) -> None:
    """
    Write the rows and the motion of the bodies that have a slot in a half.

    Their inertia is that of the middle of a step of h [s].
    """
    (first, last), mass, alike = slots_of(bodies.used, half), bodies.mass, bodies.alike[0] == 1
    for numbers in (bodies.motion, bodies.smooth, mass, bodies.drifted):
        _of_half(numbers, bodies.used, half)[:STRIDE] = 0.0
    _of_half(bodies.base, bodies.used, half)[:] = 0.0
    _of_half(bodies.total, bodies.used, half)[:] = 0.0
    bodies.astride[first:last] = 0
    for k in range(3 if alike else 0):
        bodies.smooth[first * STRIDE + k] = gravity[k]
    for slot in range(first + 1, last):
        i = bodies.body[slot] & INDEX
        motion = slot * STRIDE
        for k in range(3):
            bodies.motion[motion + k] = inv_m[i] * state.P[k, i] + state.V[k, i]
            bodies.motion[motion + 3 + k] = state.L[k, i] + state.V[3 + k, i]
            bodies.drifted[motion + k] = bodies.motion[motion + k]
            bodies.drifted[motion + 3 + k] = bodies.motion[motion + 3 + k]
        mass[motion + INV_M] = inv_m[i]
        # What moves by its twist has w in the place of L, and the matrix 1 in that of the inverse
        # inertia: it turns, and no impulse changes that, see `_response`.
        moments = column(inv_I_C, i) if inv_m[i] > 0.0 else (1.0, 1.0, 1.0)
        _turn_inertia(mass, motion + INV_I_W, moments, quaternion(state.q, i), column(state.L, i),
                      0.5 * h)
        bodies.motion[motion + INV_M] = inv_m[i]
        bodies.motion[motion + INV_I] = mass[motion + INV_I_W]
        if not alike:
            _load_forces(bodies.smooth, motion, inv_m[i], column(loads.F, i),
                         column(loads.tau, i))


@part
def _load_forces(smooth: Array, line: int, inv_m: float, F: Vector, tau: Vector) -> None:
    for k in range(3):
        smooth[line + k], smooth[line + 3 + k] = inv_m * F[k], tau[k]
    smooth[line + INV_M], smooth[line + INV_I] = 0.0, 0.0


@part
def _turn_inertia(mass: Array, line: int, d: Vector, q: Quaternion, L: Vector, t: float) -> None:
    """
    Write the inverse inertia after t [s], world axes.

    d along those of the body, and of a ball in all.
    """
    if are_alike(d):
        for k in range(6):
            mass[line + k] = 0.0
        mass[line] = mass[line + 3] = mass[line + 5] = d[0]
        return
    if may_turn_by(SAME_ATTITUDE, L, d, t):
        q = turn_fast(q, L, d, t)
    write_world_inertia(q, d, mass, line)


@kernel
def kick_bodies(half: int, used: IntArray, motion: Array, smooth: Array, alike: bool, base: Array,
                h: float) -> None:
    """
    Begin a substep: forces act for h [s], and contacts as they did in the substep before.

    That is a warm start of every contact at once, without a pass over contacts: what they added is
    in `base`, and afterwards `motion` without it.
    """
    first, last = slots_of(used, half)
    for slot in range(first + 1, last):
        kick(slot, motion, smooth, first if alike else slot, base, h)


@part
def kick(slot: int, motion: Array, smooth: Array, forces: int, base: Array, h: float) -> None:
    """Add to the motion of a slot what forces, which stand in the slot `forces`, do in h [s]."""
    kicked = load(motion, slot) + h * load(smooth, forces)
    store(motion, slot, kicked + load(base, slot))
    store(base, slot, kicked)


@part
def unkick(slot: int, motion: Array, smooth: Array, forces: int, base: Array, h: float) -> None:
    """Take back what `kick` did, but for what contacts do, which is in `base` again."""
    kicked = load(base, slot)
    store(base, slot, load(motion, slot) - kicked)
    store(motion, slot, kicked - h * load(smooth, forces))


@kernel
def begin_push(first: int, last: int, motion: Array, drifted: Array) -> None:
    """Let nobody be pushed yet in these slots, in place of the drift of the last substep."""
    for slot in range(first, last):
        for k in range(STRIDE):
            drifted[slot * STRIDE + k] = 0.0
        drifted[slot * STRIDE + INV_M] = motion[slot * STRIDE + INV_M]


@kernel
def mark_astride(begin: int, end: int, at_A: IntArray, at_B: IntArray, astride: IntArray) -> None:
    """Mark the slots of the lanes from `begin` to `end`, which are those across."""
    for lane in range(begin, end):
        astride[(at_A[lane] & INDEX) // STRIDE] = astride[(at_B[lane] & INDEX) // STRIDE] = 1


@kernel
def begin_push_astride(begin: int, end: int, at_A: IntArray, at_B: IntArray, motion: Array,
                       drifted: Array) -> None:
    """Let nobody be pushed yet in the slots of these lanes."""
    for lane in range(begin, end):
        for at in (at_A[lane] & INDEX, at_B[lane] & INDEX):
            begin_push(at // STRIDE, at // STRIDE + 1, motion, drifted)


@kernel
def begin_push_inside(first: int, last: int, astride: IntArray, motion: Array,
                      drifted: Array) -> None:
    """Let nobody be pushed yet in these slots, but for bodies astride, some of which are."""
    for slot in range(first, last):
        if astride[slot] == 0:
            begin_push(slot, slot + 1, motion, drifted)


@kernel
def drift_bodies(half: int, used: IntArray, motion: Array, drifted: Array, total: Array,
                 smooth: Array, alike: bool, base: Array, h: float, pushed: bool) -> None:
    """
    End a substep: drift the bodies of a half; nobody is touched yet.

    By the mean of the velocities before and after what forces and contacts did in the substep of
    h [s], which is of second order, and by the push. Where nobody was `pushed`, nobody asked for
    the push: what stands there is from before. What contacts added is in `base` afterwards.
    """
    first, last = slots_of(used, half)
    for slot in range(first + 1, last):
        now = load(motion, slot)
        added = now - load(base, slot)
        moved = now - 0.5 * (h * load(smooth, first if alike else slot) + added)
        if pushed:
            moved = moved + load(drifted, slot)
        store(drifted, slot, moved)
        store(total, slot, load(total, slot) + moved)
        store(base, slot, added)
        drifted[slot * STRIDE + TOUCHED] = 0.0


@part
def store_bodies(half: int, first: int, last: int, h: float, m: Array, inv_m: Array,
                 inv_I_C: Array, state: State, bodies: SolverBodies, substeps: int) -> None:
    """
    Move bodies, eight at a time, from `first` to `last`, and write momenta and poses back.

    By number, as they lie in the state: two cores that write to the same lines of it would wait
    for each other most of the time. `half` says whose scratch is used. Who was not touched is
    left to fly.
    """
    i, b, at = first, _scratch_of(bodies, half), _places_of(bodies, half)
    while True:
        lanes = 0
        while lanes < LANES and i < last:
            slot = bodies.slot[i] if inv_m[i] > 0.0 else 0
            if slot > 0 and bodies.drifted[slot * STRIDE + TOUCHED] == 0.0:
                bodies.flies[i] = 1
            elif slot > 0:
                at[lanes] = slot * STRIDE
                lanes += 1
            i += 1
        if lanes == 0:
            break
        if lanes == LANES and _body_at(bodies, at[LANES - 1]) == i - 1 == (
                _body_at(bodies, at[0]) + LANES - 1):
            _read_eight(m, inv_m, inv_I_C, state, b, i - LANES)
            _move(bodies, at, b, h, 1.0 / substeps)
            _write_eight(state, b, i - LANES)
        else:
            for lane in range(LANES):
                at[lane] = at[min(lane, lanes - 1)]
                _read_one(m, inv_m, inv_I_C, state, b, lane, _body_at(bodies, at[lane]))
            _move(bodies, at, b, h, 1.0 / substeps)
            for lane in range(lanes):
                _write_one(state, b, lane, _body_at(bodies, at[lane]))


@part
def _read_eight(m: Array, inv_m: Array, inv_I_C: Array, state: State, b: Array,
                first: int) -> None:
    """Read the state and the masses of eight bodies, from the first on."""
    n = state.x.shape[1]
    for k in range(3):
        store(b, _X + k, read_eight(state.x, k * n + first))
        store(b, _P + k, read_eight(state.P, k * n + first))
        store(b, _L + k, read_eight(state.L, k * n + first))
        store(b, _INV_I + k, read_eight(inv_I_C, k * n + first))
    for k in range(4):
        store(b, _Q + k, read_eight(state.q, k * n + first))
    store(b, _M, read_eight(m, first))
    store(b, _INV_M, read_eight(inv_m, first))


@part
def _read_one(m: Array, inv_m: Array, inv_I_C: Array, state: State, b: Array, lane: int,
              body: int) -> None:
    for k in range(3):
        b[(_X + k) * LANES + lane] = state.x[k, body]
        b[(_P + k) * LANES + lane] = state.P[k, body]
        b[(_L + k) * LANES + lane] = state.L[k, body]
        b[(_INV_I + k) * LANES + lane] = inv_I_C[k, body]
    for k in range(4):
        b[(_Q + k) * LANES + lane] = state.q[k, body]
    b[_M * LANES + lane], b[_INV_M * LANES + lane] = m[body], inv_m[body]


@part
def _write_eight(state: State, b: Array, first: int) -> None:
    """Write bodies from the first on: a line of the cache is asked for once, not eight times."""
    n = state.x.shape[1]
    for k in range(3):
        write_eight(state.x, k * n + first, load(b, _X + k))
        write_eight(state.P, k * n + first, load(b, _P + k))
        write_eight(state.L, k * n + first, load(b, _L + k))
    for k in range(4):
        write_eight(state.q, k * n + first, load(b, _Q + k))


@part
def _write_one(state: State, b: Array, lane: int, body: int) -> None:
    for k in range(3):
        state.x[k, body] = b[(_X + k) * LANES + lane]
        state.P[k, body] = b[(_P + k) * LANES + lane]
        state.L[k, body] = b[(_L + k) * LANES + lane]
    for k in range(4):
        state.q[k, body] = b[(_Q + k) * LANES + lane]


@inlined
def _body_at(bodies: SolverBodies, at: int) -> int:
    """Return the body whose motion stands there."""
    return bodies.body[(at & INDEX) // STRIDE] & INDEX


@pasted
def _scratch_of(bodies: SolverBodies, half: int) -> Array:
    return bodies.lanes[half * _ROWS * LANES:(half + 1) * _ROWS * LANES]


@pasted
def _places_of(bodies: SolverBodies, half: int) -> IntArray:
    return bodies.at[half * LANES:(half + 1) * LANES]


@part
def _move(bodies: SolverBodies, at: IntArray, b: Array, h: float, share: float) -> None:
    """Move eight bodies by the sum of their drifts, `share` of a step each."""
    v, now = gather(bodies.total, at), gather(bodies.motion, at)
    x = load_three(b, _X)
    for k in range(3):
        store(b, _X + k, x[k] + (h * share) * v[k])
        store(b, _P + k, load(b, _M) * now[k])
        store(b, _L + k, now[3 + k])
    L = (share * v[3], share * v[4], share * v[5])
    inv_I = load_three(b, _INV_I)
    # Too fast for `turn`: below, one by one.
    fast = may_turn_by(MAX_ANGLE, L, inv_I, h)
    q = (load(b, _Q), load(b, _Q + 1), load(b, _Q + 2), load(b, _Q + 3))
    turned = turn(q, L, inv_I, h)
    for k in range(4):
        store(b, _Q + k, select(fast, q[k], turned[k]))
    if any_of(fast):
        for k in range(3):
            store(b, _MEAN_L + k, L[k])
        store(b, _FAST, select(fast, 1.0, 0.0))
        _turn_fast_ones(b, h)


@kernel
def _turn_fast_ones(b: Array, h: float) -> None:
    """Turn the bodies that are too fast for `turn`."""
    for i in range(LANES):
        if b[_FAST * LANES + i] > 0.0:
            o = _Q * LANES + i
            q = (b[o], b[o + LANES], b[o + 2 * LANES], b[o + 3 * LANES])
            q = turn_fast(q, _three(b, _MEAN_L, i), _three(b, _INV_I, i), h)
            for k in range(4):
                b[(_Q + k) * LANES + i] = q[k]


@inlined
def _three(b: Array, first: int, i: int) -> Vector:
    """Return three rows of lane i."""
    return (b[first * LANES + i], b[(first + 1) * LANES + i], b[(first + 2) * LANES + i])
