# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rule of the sign: who separates, rests or collides."""

import pytest

from rigid_sim_ros.engine.contact.classify import classify, COLLIDING, RESTING, SEPARATING


@pytest.mark.parametrize('rate, expected', [
    (2.0, SEPARATING), (1.1, SEPARATING), (1.0, RESTING), (0.0, RESTING), (-1.0, RESTING),
    (-1.1, COLLIDING), (-2.0, COLLIDING)])
def test_a_rate_of_the_gap_beyond_what_counts_as_0_tells_by_its_sign(rate, expected):
    assert classify.py_func(rate, 1.0) == expected
