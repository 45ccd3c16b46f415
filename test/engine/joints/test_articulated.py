# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The articulated-body method against the same equations as one dense matrix."""

from engine.jointed_trees import random_tree
from inside import model_of, state_of
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_sim_ros import World
from rigid_sim_ros.engine.constraints import articulated_rows
from rigid_sim_ros.engine.dynamics.force_and_torque import empty_loads
from rigid_sim_ros.engine.joints import effective_inertia
from rigid_sim_ros.engine.joints.buffers import make_joint_work
from rigid_sim_ros.engine.joints.settle import prepare
from rigid_sim_ros.engine.model.joints import NONE
from rigid_sim_ros.kernels.kernel import in_python

# To compile these takes longer than they take in Python.
answer_to_impulses = in_python(articulated_rows.answer_to_impulses)
effective_inertias = in_python(effective_inertia.effective_inertias)


def cross_matrix(r):
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


def answer(model, table, work, i, F):
    """Return how all rows answer to the impulse F on row i, (r, 6), about reference points."""
    loads, body = empty_loads(len(model.m)), table.body[i]
    loads.F[:, body] = F[:3]
    loads.tau[:, body] = F[3:] - np.cross(work.com[i], F[:3])
    answer_to_impulses(model, table, work, 0, loads)
    return work.V.copy()


def inertia_at_points(model, state, table, work):
    """Return the mass matrix of all rows about their reference points, (6 r, 6 r)."""
    size = 6 * len(table.body)
    M = np.zeros((size, size))
    for i, body in enumerate(table.body):
        R = Rotation.from_quat(state.q[:, body]).as_matrix()
        T = np.eye(6)
        T[:3, 3:] = -cross_matrix(state.x[:, body] - work.p[i])
        at_com = np.zeros((6, 6))
        at_com[:3, :3] = model.m[body] * np.eye(3)
        at_com[3:, 3:] = R @ np.diag(model.I_C[:, body]) @ R.T
        M[6 * i:6 * i + 6, 6 * i:6 * i + 6] = T.T @ at_com @ T
    return M


def motions_of_axes(table, work):
    """Return the motions of all rows for a unit rate of each axis, (6 r, k)."""
    S = np.zeros((6 * len(table.body), len(table.translates)))
    for i in range(len(table.body)):
        parent = table.parent[i]
        if parent != NONE:
            X = np.eye(6)
            X[:3, 3:] = -cross_matrix(work.p[i] - work.p[parent])
            S[6 * i:6 * i + 6] = X @ S[6 * parent:6 * parent + 6]
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            first = 6 * i if table.translates[k] else 6 * i + 3
            S[first:first + 3, k] += work.s[k]
    return S


@pytest.mark.parametrize('on_world', [True, False])
@pytest.mark.parametrize('seed', range(6))
def test_an_articulation_answers_to_an_impulse_as_the_dense_equations_do(seed, on_world):
    rng = np.random.default_rng(seed)
    world = World.from_dict(random_tree(rng, 8, on_world=on_world))
    model, state, table = model_of(world), state_of(world), world.scene.joints.table
    work = make_joint_work(table)
    prepare(model, table, state, work)
    M, S = inertia_at_points(model, state, table, work), motions_of_axes(table, work)
    inverse = S @ np.linalg.solve(S.T @ M @ S, S.T)
    rows = len(table.body)
    for i in range(rows):
        F = np.zeros(6 * rows)
        F[6 * i:6 * i + 6] = rng.normal(0, 1, 6)
        V = answer(model, table, work, i, F[6 * i:6 * i + 6])
        wanted = inverse @ F
        # Both lose digits by the condition of S^T M S, some 1e4.
        np.testing.assert_allclose(V.ravel(), wanted, rtol=0,
                                   atol=1e-10 * np.abs(wanted).max())


def test_responses_are_reciprocal():
    # What an impulse here does there, one there does here: M~^-1 is symmetric.
    world = World.from_dict(random_tree(np.random.default_rng(3), 8))
    model, state, table = model_of(world), state_of(world), world.scene.joints.table
    work = make_joint_work(table)
    prepare(model, table, state, work)
    F = np.random.default_rng(4).normal(0, 1, (2, 6))
    there = F[1] @ answer(model, table, work, 2, F[0])[6]
    here = F[0] @ answer(model, table, work, 6, F[1])[2]
    assert here == pytest.approx(there, rel=1e-10)


@pytest.mark.parametrize('on_world', [True, False])
def test_an_axis_feels_the_inertia_of_the_inverse_mass_matrix(on_world):
    world = World.from_dict(random_tree(np.random.default_rng(5), 8, on_world=on_world))
    model, state, table = model_of(world), state_of(world), world.scene.joints.table
    work = make_joint_work(table)
    prepare(model, table, state, work)
    effective_inertias(table, work)
    S = motions_of_axes(table, work)
    mass_matrix = S.T @ inertia_at_points(model, state, table, work) @ S
    wanted = 1.0 / np.diag(np.linalg.inv(mass_matrix))
    np.testing.assert_allclose(work.felt, wanted, rtol=1e-9)
