# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How long the arrows of forces are."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('viser') is None:
    raise SkipTest('viser is not installed: pip install .[view]')

import numpy as np
import pytest

from rigid_sim_ros.viewer.overlays import shortened


def test_only_arrows_that_are_too_long_are_shortened():
    vectors = np.array([[0.0, 0, 0], [0, 3, 4], [0, -30, 40]])
    assert shortened(vectors, 5.0) == pytest.approx(np.array([[0, 0, 0], [0, 3, 4], [0, -3, 4]]))
    assert shortened(np.zeros((0, 3)), 5.0).shape == (0, 3)
