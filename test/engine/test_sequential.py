# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parts of the sequential solver: blocks, colours, sweeps."""

from engine.stepping import pyramid, tower
import numpy as np
import pytest

from rigid_sim_ros.engine.coloring import color_manifolds, COLORS, make_coloring
from rigid_sim_ros.engine.contact_blocks import (
    BLOCK_SIZE, K_NN, K_TN, K_TT, MOTION_A, MOTION_B, TWIST, WRENCH)
from rigid_sim_ros.engine.contact_sweep import _read_twist, Sweep, visit
from rigid_sim_ros.engine.solver_bodies import LANES, STRIDE


def colored(pairs, points=4, n=200):
    """Return the colouring of manifolds between bodies, whose slots are their numbers."""
    a, b = np.array(pairs, dtype=np.int64).T
    work = make_coloring(n, len(pairs))
    nothing = np.zeros(len(pairs), dtype=np.int64)
    color_manifolds(len(pairs), a, b, np.full(len(pairs), points, dtype=np.int64),
                    np.arange(n, dtype=np.int64), n, nothing, nothing, work)
    return work


def shared_bodies(pairs, work) -> int:
    """Return how many blocks hold a moving body twice; body 0 does not move."""
    bad = 0
    for block in range(work.blocks[0]):
        rows = [r for r in range(len(pairs)) if work.lane[r] // LANES == block]
        bodies = [body for r in rows for body in pairs[r] if body != 0]
        bad += len(bodies) != len(set(bodies))
    return bad


def test_no_block_holds_a_moving_body_twice():
    rng = np.random.default_rng(3)
    pairs = [tuple(sorted(rng.choice(100, 2, replace=False))) for _ in range(400)]
    assert shared_bodies(pairs, colored(pairs)) == 0


def test_manifolds_with_the_ground_share_blocks():
    pairs = [(0, k) for k in range(1, 65)]
    assert colored(pairs).blocks[0] == 8


def test_a_body_with_more_contacts_than_colours_is_solved_one_by_one():
    pairs = [(1, k) for k in range(2, 2 + COLORS + 20)]
    work = colored(pairs)
    assert shared_bodies(pairs, work) == 0
    assert len(set(work.lane.tolist())) == len(pairs)


def read_twist(block, solver, bodies):
    """Return the twists of a block as the bodies have them now."""
    for lane in range(LANES):
        for k in range(6):
            at_A, at_B = solver.at_A[lane] + k, solver.at_B[lane] + k
            block[(MOTION_A + k) * LANES + lane] = bodies.motion[at_A]
            block[(MOTION_B + k) * LANES + lane] = bodies.motion[at_B]
    _read_twist(block)
    return block.reshape(-1, LANES)[TWIST:TWIST + 6].copy()


def response(rows, lane):
    """Return the 6 x 6 matrix K of a lane, N before T."""
    upper = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
    K = np.zeros((6, 6))
    for first, at in ((K_NN, 0), (K_TT, 3)):
        for k, (i, j) in enumerate(upper):
            K[at + i, at + j] = K[at + j, at + i] = rows[first + k, lane]
    K[3:, :3] = rows[K_TN:K_TN + 9, lane].reshape(3, 3)
    K[:3, 3:] = K[3:, :3].T
    return K


def test_the_response_of_a_manifold_is_that_of_its_bodies():
    scene = pyramid(5, 1 / 240)
    scene.step(30)
    solver, bodies = scene.work.solver, scene.work.solver.bodies
    rng = np.random.default_rng(0)
    for slot in range(1, bodies.used[0]):
        for k in range(6):
            bodies.motion[slot * STRIDE + k] = rng.normal(0, 1e-2)
    block = solver.blocks[:BLOCK_SIZE]
    before = read_twist(block, solver, bodies)
    visit(block, bodies.motion, bodies.drifted, solver.at_A[:LANES], solver.at_B[:LANES], 3, False,
          Sweep(960.0, 0.0, False))
    wrench = block.reshape(-1, LANES)[WRENCH:WRENCH + 6].copy()
    after = read_twist(block, solver, bodies)
    for lane in np.nonzero(solver.lane_row[:LANES] >= 0)[0]:
        foreseen = before[:, lane] + response(block.reshape(-1, LANES), lane) @ wrench[:, lane]
        assert after[:, lane] == pytest.approx(foreseen, abs=1e-14)  # rounding of 0.1 m/s


def test_the_residual_goes_to_rounding_at_rest():
    scene = tower(5, 1 / 240)
    scene.step(600)
    assert scene.work.solver.residual[0] < 1e-12
