# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A world that is cut into halves: impacts and overlaps in either half, and across."""

from halves import LENGTH, members, RADIUS, row, ROWS, rows_and, SPEED
import numpy as np
import pytest

from rigid_sim_ros.engine.solver.coloring import BETWEEN


def test_an_impact_reaches_the_end_of_a_row_within_its_step():
    y, z = np.eye(3)[1:]
    world = rows_and(row('across', z, y, LENGTH, 0.0, SPEED), SPEED)
    world.step(2)
    assert np.count_nonzero(world.linear_velocity) == ROWS + 1
    world.step()
    assert members(world).min() > 0
    v = world.linear_velocity
    for along in [*v[:-LENGTH, 0].reshape(ROWS, LENGTH), v[-LENGTH:, 1]]:
        # All of them would go on alike if nothing were left to the next step; who has not heard
        # of the impact stands still. Momenta add up to that of the first one.
        assert along.min() > 0.4 * SPEED / LENGTH
        assert along.sum() == pytest.approx(SPEED, abs=1e-12)


def test_what_overlaps_across_is_pushed_apart():
    y, z = np.eye(3)[1:]
    world = rows_and(row('across', z, y, 2, 0.001, 0.0), 0.0)
    world.step(3)
    assert members(world)[BETWEEN] == 1
    overlap = 2.0 * RADIUS - np.ptp(world.position[-2:, 1])
    for _ in range(3):
        world.step()
        assert members(world)[BETWEEN] == 1
        now = 2.0 * RADIUS - np.ptp(world.position[-2:, 1])
        # Four substeps leave 0.8 of it each.
        assert now == pytest.approx(overlap * 0.8 ** 4, rel=1e-6)
        overlap = now
