# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Bodies that move and are never pushed: kinematic ones, and fixed ones that are put elsewhere.

During a step such a body has the constant twist V of the state: contacts see its velocity, and it
moves exactly by it, whatever touches it. V comes from `set_twist`, or from a pose that is to be
reached (`approach`). `left` says for how many more steps V holds: LASTS until another one is set;
0 when it is over. V is cleared only when the next step begins, so after a step it still says how
the body moved in it.

Each step calls `begin_kinematic`, then `move_kinematic` for parts that add up to the step, then
`end_kinematic`. All go through `model.fixed` and touch nothing else.
"""

import math

import numpy as np

from rigid_sim_ros.engine.maths.rotation import (
    conjugate, exponential, logarithm, multiply, quaternion, set_quaternion, unit)
from rigid_sim_ros.engine.maths.vector import scale
from rigid_sim_ros.engine.model.kinds.table import KINDS
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.state import BodyMotion, State, write_motion
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.kernel import apart, in_python, inlined, kernel

LASTS = -1


@inlined
def prescribed_velocity(state: State, i: int) -> tuple[float, float, float]:
    """Return the prescribed velocity of the centre of body i [m/s]; 0 for what can be pushed."""
    return (state.V[0, i], state.V[1, i], state.V[2, i])


@inlined
def prescribed_spin(state: State, i: int) -> tuple[float, float, float]:
    """Return the prescribed angular velocity of body i [rad/s]; 0 for what can be pushed."""
    return (state.V[3, i], state.V[4, i], state.V[5, i])


@inlined
def is_carried(state: State, i: int) -> bool:
    """Return whether body i moves by a prescribed twist in this step."""
    return (abs(state.V[0, i]) + abs(state.V[1, i]) + abs(state.V[2, i]) + abs(state.V[3, i])
            + abs(state.V[4, i]) + abs(state.V[5, i])) > 0.0


@apart
def begin_kinematic(model: Model, state: State) -> bool:
    """End the twists whose time is over; return whether any body moves in this step."""
    moves = False
    for i in model.fixed:
        if state.twist_steps_left[i] == 0:
            for k in range(6):
                state.V[k, i] = 0.0
        moves = moves or is_carried(state, i)
    return moves


@apart
def move_kinematic(model: Model, state: State, t: float) -> None:
    """Move every body by its prescribed twist for t [s]: x += t v, q = exp(t w) q."""
    for i in model.fixed:
        carry(state, i, t)


@inlined
def carry(state: State, i: int, t: float) -> None:
    """Move a body by its prescribed twist, if it has one, for t [s]."""
    if is_carried(state, i):
        for k in range(3):
            state.x[k, i] += t * state.V[k, i]
        turn = exponential(scale(t, prescribed_spin(state, i)))
        set_quaternion(state.q, i, unit(multiply(turn, quaternion(state.q, i))))


@apart
def end_kinematic(model: Model, state: State) -> None:
    """Count the step down that is over."""
    for i in model.fixed:
        if state.twist_steps_left[i] > 0:
            state.twist_steps_left[i] -= 1


@kernel
def pose_ahead(state: State, i: int, t: float) -> tuple[
        tuple[float, float, float], tuple[float, float, float, float]]:
    """Return where frame C of a body that nothing pushes is after t [s] of its twist."""
    v = prescribed_velocity(state, i)
    q = quaternion(state.q, i)
    x = (state.x[0, i] + t * v[0], state.x[1, i] + t * v[1], state.x[2, i] + t * v[2])
    if not is_carried(state, i):
        return x, q
    return x, unit(multiply(exponential(scale(t, prescribed_spin(state, i))), q))


def sizes(model: Model, shapes: Shapes) -> Array:
    """
    Return how far each body reaches from its frame C, (n,) [m].

    One that ends nowhere, or has no shape, counts as large as the largest that it may carry;
    infinite where nothing moves.
    """
    n, body = len(model.m), shapes.body
    size, endless = np.zeros(n), np.ones(n, dtype=bool)
    np.maximum.at(size, body, np.linalg.norm(shapes.p_CS, axis=1) + shapes.bound)
    endless[body] = False
    endless[body[[KINDS[kind].is_unbounded for kind in shapes.kind.tolist()]]] = True
    carried = size[(model.inv_m > 0.0) & ~endless]
    size[endless] = carried.max() if len(carried) > 0 else np.inf
    return size


def approach(model: Model, state: State, motion: BodyMotion, i: int, steps: int, size: float,
             fastest: float) -> bool:
    """
    Let a body that nothing pushes reach its row of body-frame poses in some steps.

    Returns False, with the body as it was, if that is no motion but a jump: if a point `size` [m]
    from the frame C would move farther than that in a step, or faster than `fastest` [m/s].
    """
    x, q, V = state.x[:, i].copy(), state.q[:, i].copy(), state.V[:, i].copy()
    write_motion(model, state, motion, i)
    way = state.x[:, i] - x
    turn = in_python(logarithm)(in_python(multiply)(
        tuple(state.q[:, i].tolist()), in_python(conjugate)(tuple(q.tolist()))))
    state.x[:, i], state.q[:, i], state.V[:, i] = x, q, V
    t = steps * model.h
    turns = math.hypot(*turn)
    farthest = math.hypot(*way.tolist()) + (turns * size if turns > 0.0 else 0.0)
    if farthest > size * steps or farthest > fastest * t:
        return False
    state.V[:3, i], state.V[3:, i] = way / t, np.array(turn) / t
    state.twist_steps_left[i] = steps
    return True
