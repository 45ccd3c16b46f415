# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The four points that are kept of a manifold span it."""

import numpy as np
import pytest

from rigid_sim_ros.engine.detection.narrow_phase.reduce import reduce_to_four

UP = 0.0, 0.0, 1.0


def keep(corners):
    """Return the points (4, 2) that are kept of these corners (n, 2), all at one gap."""
    points, ids = np.zeros((len(corners), 4)), np.arange(len(corners))
    points[:, :2] = corners
    count = reduce_to_four(points, ids, len(corners), UP, 1.0)
    return points[:count, :2]


@pytest.mark.parametrize('wide', [1e-3, 0.02, 0.3])
@pytest.mark.parametrize('off', [-0.1, 0.0, 0.1])
def test_a_strip_with_pointed_ends_is_borne_at_its_four_corners(wide, off):
    # A box under a disk as long as it: its ends are in the rim, farther apart than the corners.
    corners = np.array(((1.0, off), (0.99, 1.0), (-0.99, 1.0), (-1.0, off), (-0.99, -1.0),
                        (0.99, -1.0))) * (1.0, wide)
    for begin in range(6):
        kept = keep(np.roll(corners, begin, axis=0))
        assert sorted(map(tuple, np.abs(kept))) == [(0.99, wide)] * 4


def test_of_a_rim_four_points_a_quarter_apart_stay():
    angles = 0.25 * np.pi * np.arange(8)
    kept = keep(np.array((np.cos(angles), np.sin(angles))).T)
    assert kept == pytest.approx(np.array(((1, 0), (0, 1), (-1, 0), (0, -1))), abs=1e-15)
