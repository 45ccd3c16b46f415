# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the frames of a model are, and how they move."""

from rigid_sim_ros.engine.maths.rotation import multiply, quaternion, rotate
from rigid_sim_ros.engine.maths.vector import add, column, row, subtract
from rigid_sim_ros.engine.model.model import Model, WORLD
from rigid_sim_ros.engine.state.rates import velocity_at
from rigid_sim_ros.engine.state.state import body_spin, body_velocity, State
from rigid_sim_ros.kernels.arrays import Quaternion, Vector
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def frame_pose(model: Model, state: State, frame: int) -> tuple[Vector, Quaternion]:
    """Return p_WF [m] and q_WF of a frame (WORLD: the origin, unturned)."""
    if frame == WORLD:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    body = model.frame_body[frame]
    q_WC = quaternion(state.q, body)
    q_CF = (model.q_CF[frame, 0], model.q_CF[frame, 1], model.q_CF[frame, 2], model.q_CF[frame, 3])
    p = add(column(state.x, body), rotate(q_WC, row(model.p_CF, frame)))
    return p, multiply(q_WC, q_CF)


@kernel
def point_on_frame(model: Model, state: State, frame: int, p_F: Vector) -> tuple[Vector, Vector]:
    """
    Return position [m] and velocity [m/s], world axes, of the point p_F [m] fixed in a frame.

    r = R r_0 + x and v + w x (r - x) (Meyer, Rigid Body Dynamics, "Velocity of a Point").
    """
    p_WF, q_WF = frame_pose(model, state, frame)
    p = add(p_WF, rotate(q_WF, p_F))
    if frame == WORLD:
        return p, (0.0, 0.0, 0.0)
    body = model.frame_body[frame]
    r = subtract(p, column(state.x, body))
    return p, velocity_at(body_velocity(model, state, body),
                          body_spin(model, state, body), r)


@kernel
def frame_spin(model: Model, state: State, frame: int) -> Vector:
    """Return the angular velocity of a frame [rad/s], world axes."""
    if frame == WORLD:
        return (0.0, 0.0, 0.0)
    return body_spin(model, state, model.frame_body[frame])


@kernel
def vector_on_frame(model: Model, state: State, frame: int, u_F: Vector) -> Vector:
    """Return a vector u given in the axes of a frame, in world axes."""
    return rotate(frame_pose(model, state, frame)[1], u_F)
