# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What stays the same while a world moves.

Three frames belong to a body: B, the pose that its author wrote; C, with the origin in the centre
of mass and the principal axes of inertia, in which the dynamics run; and any number of named
frames F. W is the world.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.maths.rotation_in_python import (
    from_matrix, multiply_arrays, rotate_arrays)
from rigid_sim_ros.engine.model.inertia import check, is_diagonal, MassProperties, principal_axes
from rigid_sim_ros.kernels.arrays import Array, IntArray

WORLD = -1  # the frame index of W


class ForceTable(NamedTuple):
    """The forces of a scene, a row each; `forces.FORCES` gives the meaning of the columns."""

    kind: IntArray  # (r,) index into the kinds of `forces.FORCES`
    frame_a: IntArray  # (r,) frame index, WORLD for the world
    frame_b: IntArray  # (r,)
    parameters: Array  # (r, forces.WIDTH)


class Model(NamedTuple):
    """A world's constants: n bodies, k frames."""

    h: float  # the step [s]
    gravity: Array  # (3,) [m/s^2], world axes
    m: Array  # masses, (n,) [kg]; 0 where a body that nothing pushes has none
    inv_m: Array  # (n,) [1/kg]; 0 where nothing pushes the body
    I_C: Array  # principal moments, (3, n) [kg m^2]
    inv_I_C: Array  # (3, n) [1/(kg m^2)]; 0 where nothing pushes the body
    p_CB: Array  # origin of B from C, (n, 3) [m], axes of C
    q_CB: Array  # axes of B to axes of C, (n, 4) x, y, z, w
    fixed: IntArray  # indices of the bodies that nothing pushes, kinematic ones too
    # (k,) the body of a frame; the first n frames are the frames B, in the order of the scene
    frame_body: IntArray
    p_CF: Array  # origins of the frames from C of their body, (k, 3) [m], axes of C
    q_CF: Array  # axes of the frames to axes of C, (k, 4) x, y, z, w
    forces: ForceTable


class Body(NamedTuple):
    """How to make one body."""

    mass_properties: MassProperties | None  # None: no mass, and C is B
    fixed: bool  # or kinematic: nothing pushes it


class Frame(NamedTuple):
    """A frame F fixed in a body."""

    body: int
    p_BF: Array  # (3,) [m]
    q_BF: Array  # (4,) x, y, z, w


def _quaternion(R: Array) -> Array:
    x, y, z = R.tolist()
    return np.array(from_matrix((tuple(x), tuple(y), tuple(z))))


def build_model(bodies: Sequence[Body], frames: Sequence[Frame], forces: ForceTable, h: float,
                gravity: Sequence[float]) -> Model:
    """
    Return the constants of a world of these bodies, with `frames` after the n body frames.

    h is the step [s], gravity [m/s^2] in world axes. ValueError, with the numbers, for mass
    properties that no body has. Inertia tensors are diagonalised here, once.
    """
    n = len(bodies)
    m, inv_m = np.zeros(n), np.zeros(n)
    I_C, inv_I_C = np.zeros((3, n)), np.zeros((3, n))
    p_CB, q_CB = np.zeros((n, 3)), np.zeros((n, 4))
    q_CB[:, 3] = 1.0
    for i, body in enumerate(bodies):
        if body.mass_properties is None:
            if not body.fixed:
                raise ValueError(f'body {i} has no mass: give it one, or fix it')
            continue
        check(body.mass_properties)
        m[i], p_BC, tensor = body.mass_properties
        if is_diagonal(tensor):     # of most bodies: C has the axes of B
            moments, p_CB[i] = tensor.diagonal(), -p_BC
        else:
            moments, R_BC = principal_axes(tensor)
            p_CB[i] = -R_BC.T @ p_BC
            q_CB[i] = _quaternion(R_BC.T)
        I_C[:, i] = moments
        if not body.fixed:
            inv_m[i] = 1.0 / m[i]
            inv_I_C[:, i] = 1.0 / moments
    frame_body = np.array(list(range(n)) + [frame.body for frame in frames], dtype=np.int64)
    p_CF = np.concatenate([p_CB, np.zeros((len(frames), 3))])
    q_CF = np.concatenate([q_CB, np.zeros((len(frames), 4))])
    for k, frame in enumerate(frames, start=n):
        b = frame.body
        p_CF[k] = p_CB[b] + rotate_arrays(q_CB[b], np.asarray(frame.p_BF, dtype=np.float64))
        q_CF[k] = multiply_arrays(q_CB[b], np.asarray(frame.q_BF, dtype=np.float64))
    fixed = np.array([i for i, body in enumerate(bodies) if body.fixed], dtype=np.int64)
    return Model(float(h), np.array(gravity, dtype=np.float64), m, inv_m, I_C, inv_I_C, p_CB, q_CB,
                 fixed, frame_body, p_CF, q_CF, forces)
