# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speculative margins: how far from the surfaces of shapes detection finds contacts."""

from rigid_sim_ros.engine.detection.manifolds import Memory
from rigid_sim_ros.engine.maths.rotation import quaternion
from rigid_sim_ros.engine.maths.vector import add, column, norm, scale
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.state.rates import fastest_turning
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import INDEX, kernel


@kernel
def set_margins(model: Model, h: float, state: State, part_of: float, radius: Array,
                thickness: Array, shapes: Shapes, memory: Memory, first: int, last: int) -> None:
    """
    Write the margins of some shapes [m]: what they have at rest, and as far as they move in h [s].

    So nothing passes what is thinner than its way in a step, or is met late. The margin at rest is
    `part_of` the thickness (s,) [m], half of the least that a shape measures across, and at least
    as far as gravity lets a body fall in the step. radius (n,) [m] is how far the points of a body
    are from its centre of mass.
    """
    rest = standard_of_rest(model, state, shapes.body)
    fall = 0.5 * h * h * norm((model.gravity[0], model.gravity[1], model.gravity[2]))
    s = first
    while s < last:
        i = shapes.body[s] & INDEX
        way = fastest_point(model, state, rest, radius, shapes, i) * h
        # All shapes of what nothing pushes have one margin, which hardly ever changes.
        pushed = model.inv_m[i] > 0.0
        if pushed or memory.margin[s] != way or memory.rest_margin[s] != 0.0:
            for k in range(s, shapes.after[s]):
                memory.rest_margin[k] = max(part_of * thickness[k], fall) if pushed else 0.0
                memory.margin[k] = memory.rest_margin[k] + way
        s = shapes.after[s]


@kernel
def fastest_point(model: Model, state: State, rest: Vector, radius: Array, shapes: Shapes,
                  i: int) -> float:
    """Return how fast [m/s] any point of body i goes, at most, where `rest` [m/s] is none."""
    inv_m, P, V = model.inv_m, state.P, state.V
    # V of what is pushed is 0, and so is inv_m of all else.
    v = norm((inv_m[i] * P[0, i] + V[0, i] - rest[0], inv_m[i] * P[1, i] + V[1, i] - rest[1],
              inv_m[i] * P[2, i] + V[2, i] - rest[2]))
    turning = fastest_turning(quaternion(state.q, i), column(state.L, i), column(model.inv_I_C, i),
                              radius[i], shapes.mobility[i])
    return v + turning + norm((V[3, i], V[4, i], V[5, i])) * radius[i]


@kernel
def standard_of_rest(model: Model, state: State, body: IntArray) -> Vector:
    """
    Return the velocity [m/s] that is taken for rest: of what nothing pushes and others may touch.

    In any frame two bodies come nearer by no more than both go. This is the frame of what stops
    others, so that margins are the same on a ship as on land: that of the world where something is
    at rest, or nothing kinematic is there, else the mean velocity of the kinematic shapes. body
    (s,) are the bodies of all shapes.
    """
    total, count = (0.0, 0.0, 0.0), 0
    for s in range(body.shape[0]):
        i = body[s] & INDEX
        v = (state.V[0, i], state.V[1, i], state.V[2, i])
        if v != (0.0, 0.0, 0.0):
            total, count = add(total, v), count + 1
        elif model.inv_m[i] == 0.0 and _is_fixed(model, i):
            return v
    return scale(1.0 / max(1, count), total)


@kernel
def _is_fixed(model: Model, i: int) -> bool:
    """Return whether nothing pushes body i, and not only because another solver moves it."""
    for k in model.fixed:
        if k == i:
            return True
    return False
