# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Energy and momentum that follow from recorded poses and twists and the scene."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from rigid_sim_ros.bag.motion import Array, Motion
from rigid_sim_ros.engine.dynamics.force_and_torque import empty_loads
from rigid_sim_ros.engine.dynamics.forces import add_gravity, add_scene_forces
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import empty_state
from rigid_sim_ros.scene import Scene


class Energies(NamedTuple):
    """Sums over the chosen bodies at t times."""

    linear: Array               # (t,) [J] kinetic, of the centres of mass
    rotational: Array           # (t,) [J] kinetic, about the centres of mass
    potential: Array | None     # (t,) [J]; None: some bodies are left out, and forces join bodies
    momentum: Array             # (t, 3) [kg m/s]
    angular_momentum: Array     # (t, 3) [kg m^2/s] about the world origin


def energies(motion: Motion, scene: Scene, rows: slice, bodies: npt.NDArray[np.intp]) -> Energies:
    """Return the energies of chosen bodies at chosen rows of the motion."""
    model = scene.model
    bodies = bodies[bodies < len(scene.names)]
    x, q, P, L, w = _states(motion, model, rows)
    moving = bodies[model.inv_m[bodies] > 0.0]
    kinetic = 0.5 * model.inv_m * (P * P).sum(axis=2)
    rotational = 0.5 * (w * L).sum(axis=2)
    return Energies(
        kinetic[:, moving].sum(axis=1), rotational[:, moving].sum(axis=1),
        _potential(scene, x, q, P, L, moving),
        P[:, moving].sum(axis=1), (L + np.cross(x, P))[:, moving].sum(axis=1))


def _states(motion: Motion, model: Model, rows: slice) -> tuple[Array, ...]:
    """
    Return x, q_WC, P, L and w, (t, n, 3 or 4) each, in world axes.

    Undoes `engine.state.read_motion`: q_WC = q_WB q_BC, x = p_WB - R p_CB,
    v = v_B - w x (p_WB - x), P = M v, L = R I R^T w.
    """
    n = len(model.m)
    p_WB, q_WB, v_B, w = (array[rows, :n] for array in (
        motion.position, motion.orientation, motion.linear_velocity, motion.angular_velocity))
    t = len(p_WB)
    # What is not there has no momentum and no energy: as if it stood still at the origin.
    is_there = np.isfinite(q_WB).all(axis=2, keepdims=True)
    p_WB, v_B, w = (np.where(is_there, array, 0.0) for array in (p_WB, v_B, w))
    q_WB = np.where(is_there, q_WB, (0.0, 0.0, 0.0, 1.0))
    turn = Rotation.from_quat(q_WB.reshape(-1, 4)) * Rotation.from_quat(
        np.tile(model.q_CB, (t, 1))).inv()
    arm = turn.apply(np.tile(model.p_CB, (t, 1))).reshape(t, n, 3)
    moves = (model.inv_m > 0.0)[:, None]
    P = np.where(moves, model.m[:, None] * (v_B - np.cross(w, arm)), 0.0)
    spin = turn.inv().apply(w.reshape(-1, 3)) * np.tile(model.I_C.T, (t, 1))
    L = np.where(moves, turn.apply(spin).reshape(t, n, 3), 0.0)
    return np.where(is_there, p_WB - arm, 0.0), turn.as_quat().reshape(t, n, 4), P, L, w


def _potential(scene: Scene, x: Array, q: Array, P: Array, L: Array,
               moving: npt.NDArray[np.intp]) -> Array | None:
    model = scene.model
    if not scene.spec.forces:
        return -(model.m[moving] * (x[:, moving] @ model.gravity)).sum(axis=1)
    if len(moving) < np.count_nonzero(model.inv_m > 0.0):
        return None
    potential = np.empty(len(x))
    for k in range(len(x)):
        state = empty_state(x.shape[1])._replace(**{
            name: np.ascontiguousarray(array[k].T)
            for name, array in (('x', x), ('q', q), ('P', P), ('L', L))})
        loads = empty_loads(x.shape[1])
        potential[k] = (add_gravity(model, state, loads)
                        + add_scene_forces(model, state, loads))
    return potential
