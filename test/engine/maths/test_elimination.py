# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Linear systems against NumPy."""

import numpy as np
import pytest

from rigid_sim_ros.engine.maths.elimination import factor_linear, solve_factored


@pytest.mark.parametrize('band', [2, 20])
def test_factors_solve_for_several_right_sides(band):
    rng = np.random.default_rng(band)
    K = rng.normal(size=(20, 20))
    K[np.abs(np.subtract.outer(np.arange(20), np.arange(20))) > band] = 0.0
    factors, last, order = K.copy(), np.zeros(20, np.int64), np.zeros(20, np.int64)
    assert factor_linear(factors, last, order)
    for _ in range(2):
        b, x = rng.normal(size=20), np.zeros(20)
        solve_factored(factors, b, x, last, order)
        # Rounding times the condition, some 1e3 here.
        assert x == pytest.approx(np.linalg.solve(K, b), rel=1e-10, abs=1e-10)


def test_a_singular_matrix_has_no_factors():
    K = np.ones((3, 3))
    assert not factor_linear(K, np.zeros(3, np.int64), np.zeros(3, np.int64))
