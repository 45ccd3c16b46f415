# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fixed points: a linear map takes as many rounds as it has directions, wherever it leads."""

import numpy as np
import pytest

from rigid_sim_ros.engine.maths.fixed_point import DEPTH, make_rounds, next_round


def left(g, x, turns, w=None):
    """Return the largest |g(x) - x| after some rounds."""
    rounds = make_rounds(len(x))
    for turn in range(turns):
        next_round(turn, len(x), x, g(x), np.ones(len(x)) if w is None else w, rounds)
    return np.abs(g(x) - x).max()


@pytest.mark.parametrize('rates', [[0.9, 0.5, 0.3], [0.99, -3.0, 1.2], [5.0, 0.0, 0.0]])
def test_a_linear_map_of_three_directions_takes_four_rounds(rates):
    """What is added to the squares leaves at most some 1e-10 of the condition, here below 1e4."""
    Q, _ = np.linalg.qr(np.array([[1.0, 2, 3], [4, 5, 6], [7, 8, 10]]))
    A, b = Q @ np.diag(rates) @ Q.T, np.array([1.0, -2.0, 3.0])
    x = np.zeros(3)
    first = np.abs(b).max()
    assert left(lambda x: A @ x + b, x, 5) < 1e-5 * first
    assert x == pytest.approx(np.linalg.solve(np.eye(3) - A, b), rel=1e-3)


def test_more_directions_than_are_remembered_still_converge():
    rates = np.linspace(-0.9, 0.95, 2 * DEPTH)
    b = np.arange(1.0, 2 * DEPTH + 1)
    turns = 40
    plain = np.zeros(2 * DEPTH)
    for _ in range(turns):
        plain = rates * plain + b
    x = np.zeros(2 * DEPTH)
    assert left(lambda x: rates * x + b, x, turns) < 0.01 * np.abs(rates * plain + b - plain).max()


def test_units_of_single_numbers_do_not_matter_where_weights_make_them_alike():
    rates, unit = np.array([[0.5, 0.2], [0.1, 0.7]]), np.array([1.0, 1e6])
    A = rates * unit[:, None] / unit
    x = np.zeros(2)
    assert left(lambda x: A @ x + unit, x, 4, 1.0 / unit) < 1e-3
    assert x / unit == pytest.approx(np.linalg.solve(np.eye(2) - rates, np.ones(2)), rel=1e-6)


def test_what_does_not_change_stays():
    x = np.array([3.0])
    assert left(lambda x: x.copy(), x, 5) == 0.0
    assert x == [3.0]
