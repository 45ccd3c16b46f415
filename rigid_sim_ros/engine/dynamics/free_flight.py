# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Flight of bodies that feel a constant force and no torque: kick, drift, kick, for many steps.

Such bodies move independently of each other, so a block of them takes all its steps before the
next block takes its first: the block stays in the fastest memory, and vector instructions advance
its bodies together.
"""

import numpy as np

from rigid_sim_ros.engine.dynamics.force_and_torque import kick_some, Loads
from rigid_sim_ros.engine.dynamics.free_rotation import MAX_ANGLE, may_turn_by, turn, turn_fast
from rigid_sim_ros.engine.maths.rotation import quaternion, rotate_back, set_quaternion
from rigid_sim_ros.engine.maths.vector import column, norm, times
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray, Quaternion
from rigid_sim_ros.kernels.kernel import apart, inlined, kernel

# Bodies of a block: their numbers fill one vector register of 512 bits, or two of 256.
LANES = 8
# The block is one flat array of rows of LANES numbers.
_Q, _L, _INV_I, _X, _P, _KICK, _INV_M, _ROWS = 0, 4, 7, 10, 13, 16, 19, 20
BLOCK_SIZE = _ROWS * LANES


@kernel
def fly(model: Model, state: State, gravity: tuple[float, float, float], h: float,
        count: int | np.int64, block: Array) -> None:
    """
    Advance every body by `count` steps of h [s] under a uniform gravity [m/s^2, world axes].

    Each step is P += h/2 F, x += h P / M, the rotation of a free body, P += h/2 F. With gravity 0
    it is the drift of the symplectic integrator. `block` is scratch, (BLOCK_SIZE,). What becomes
    of a body does not depend on the bodies beside it, nor on how the steps are spread over calls.
    """
    n = model.m.shape[0]
    for first in range(0, n, LANES):
        lanes = min(LANES, n - first)
        _fly_some(model, state, gravity, h, count, first, lanes, block)
        for i in range(lanes):
            _store(model, state, h, count, i, first + i, block)


@kernel
def fly_free(model: Model, state: State, loads: Loads, flies: IntArray, h: float,
             block: Array) -> None:
    """
    Advance the bodies with a 1 in flies (n,) by a step of h [s].

    Kick, drift, kick, as in the method `symplectic`.
    """
    n = model.m.shape[0]
    for first in range(0, n, LANES):
        last, free = min(first + LANES, n), False
        for i in range(first, last):
            free = free or flies[i] == 1
        if free:
            _kick_free(state, loads, flies, 0.5 * h, first, last)
            _fly_some(model, state, (0.0, 0.0, 0.0), h, np.int64(1), first, last - first, block)
            for i in range(first, last):
                if flies[i] == 1:
                    _store(model, state, h, np.int64(1), i - first, i, block)
            _kick_free(state, loads, flies, 0.5 * h, first, last)


@kernel
def drift(model: Model, state: State, times: Array, block: Array) -> None:
    """Let each body fly without forces for a time of its own, (n,) [s]; 0: it stays."""
    n = model.m.shape[0]
    for first in range(0, n, LANES):
        last, alike = min(first + LANES, n), True
        for i in range(first, last):
            alike = alike and times[i] == times[first]
        lanes = last - first if alike else 1
        for i in range(first, last, lanes):
            if times[i] != 0.0:
                _fly_some(model, state, (0.0, 0.0, 0.0), times[i], np.int64(1), i, lanes, block)
                for lane in range(lanes):
                    _store(model, state, times[i], np.int64(1), lane, i + lane, block)


@kernel
def drift_from(model: Model, state: State, bodies: IntArray, begin: int, end: int, x: Array,
               q: Array, h: float, block: Array) -> None:
    """
    Put bodies (r,) to where they are h [s] of free flight after the poses x (r, 3), q (r, 4).

    Those from begin to end; their momenta are those of the state, and stay.
    """
    for first in range(begin, end, LANES):
        lanes = min(LANES, end - first)
        for i in range(lanes):
            body, r = bodies[first + i], first + i
            for k in range(4):
                block[(_Q + k) * LANES + i] = q[r, k]
            block[_INV_M * LANES + i] = model.inv_m[body]
            for k in range(3):
                block[(_L + k) * LANES + i] = state.L[k, body]
                block[(_INV_I + k) * LANES + i] = model.inv_I_C[k, body]
                block[(_X + k) * LANES + i] = x[r, k]
                block[(_P + k) * LANES + i] = state.P[k, body]
                block[(_KICK + k) * LANES + i] = 0.0
        _fly_block(block, h, np.int64(1))
        for i in range(lanes):
            body, r = bodies[first + i], first + i
            _put(model, state, h, i, body, (q[r, 0], q[r, 1], q[r, 2], q[r, 3]), block)


@inlined
def _put(model: Model, state: State, h: float, lane: int, body: int, q: Quaternion,
         block: Array) -> None:
    """Write where a body is that was at q; one that is too fast for `turn` is turned here."""
    for k in range(3):
        state.x[k, body] = block[(_X + k) * LANES + lane]
    L, inv_I = column(state.L, body), column(model.inv_I_C, body)
    if (may_turn_by(MAX_ANGLE, L, inv_I, h)
            and abs(h) * norm(times(inv_I, rotate_back(q, L))) > MAX_ANGLE):
        set_quaternion(state.q, body, turn_fast(q, L, inv_I, h))
        return
    for k in range(4):
        state.q[k, body] = block[(_Q + k) * LANES + lane]


@kernel
def _kick_free(state: State, loads: Loads, flies: IntArray, h: float, first: int,
               last: int) -> None:
    for i in range(first, last):
        if flies[i] == 1:
            kick_some(state, loads, h, i, i + 1)


@apart
def _fly_some(model: Model, state: State, gravity: tuple[float, float, float], h: float,
              count: int | np.int64, first: int, lanes: int, block: Array) -> None:
    """Advance a block of bodies that it reads, but not the state."""
    _load(model, state, gravity, h, first, lanes, block)
    _fly_block(block, h, count)


@kernel
def _load(model: Model, state: State, gravity: tuple[float, float, float], h: float, first: int,
          lanes: int, block: Array) -> None:
    for i in range(lanes):
        body = first + i
        for k in range(4):
            block[(_Q + k) * LANES + i] = state.q[k, body]
        block[_INV_M * LANES + i] = model.inv_m[body]
        for k in range(3):
            block[(_L + k) * LANES + i] = state.L[k, body]
            block[(_INV_I + k) * LANES + i] = model.inv_I_C[k, body]
            block[(_X + k) * LANES + i] = state.x[k, body]
            block[(_P + k) * LANES + i] = state.P[k, body]
            weight = model.m[body] * gravity[k] if model.inv_m[body] > 0.0 else 0.0
            block[(_KICK + k) * LANES + i] = 0.5 * h * weight


@kernel
def _fly_block(b: Array, h: float, count: int | np.int64) -> None:
    """
    Advance one block.

    The compiler turns the inner loop into vector instructions because it holds no branch, and its
    operands lie in one flat array at constant distances.
    """
    for _ in range(count):
        for i in range(LANES):
            for k in range(3):
                # Named rows of the block: x and P of one axis.
                x, p, j = (_X + k) * LANES + i, (_P + k) * LANES + i, (_KICK + k) * LANES + i
                half_way = b[p] + b[j]
                b[x] += h * (b[_INV_M * LANES + i] * half_way)
                b[p] = half_way + b[j]
            q = turn((b[i], b[LANES + i], b[2 * LANES + i], b[3 * LANES + i]),
                     (b[4 * LANES + i], b[5 * LANES + i], b[6 * LANES + i]),
                     (b[7 * LANES + i], b[8 * LANES + i], b[9 * LANES + i]), h)
            b[i] = q[0]
            b[LANES + i] = q[1]
            b[2 * LANES + i] = q[2]
            b[3 * LANES + i] = q[3]


@kernel
def _store(model: Model, state: State, h: float, count: int | np.int64, lane: int, body: int,
           block: Array) -> None:
    """Write a body back; one that is too fast for `turn` is turned here, and a fixed one stays."""
    if model.inv_m[body] == 0.0:
        return
    for k in range(3):
        state.x[k, body] = block[(_X + k) * LANES + lane]
        state.P[k, body] = block[(_P + k) * LANES + lane]
    L, inv_I = column(state.L, body), column(model.inv_I_C, body)
    if not may_turn_by(MAX_ANGLE, L, inv_I, h):
        for k in range(4):
            state.q[k, body] = block[(_Q + k) * LANES + lane]
    else:
        q = quaternion(state.q, body)
        for _ in range(count):
            q = turn_fast(q, L, inv_I, h)
        set_quaternion(state.q, body, q)
