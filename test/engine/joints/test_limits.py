# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parts of a step between which axes stop at their limits."""

from engine.jointed import hanging
from inside import joints_of, state_of
import numpy as np
import pytest

from rigid_sim_ros.engine.joints.limits import SHORTEST, way_until
from rigid_sim_ros.engine.joints.shake import leaves_active_set


@pytest.mark.parametrize('left', [1.0, 0.5, 2.0 * SHORTEST, 1.5 * SHORTEST, SHORTEST])
def test_neither_a_way_nor_what_is_left_of_the_step_is_too_short(left):
    h = 0.01
    for t in [*np.linspace(0.0, left, 41), left - 0.5 * SHORTEST, 2.0 * left, np.inf]:
        way = way_until(t * h, left * h, h)
        after = left * h - way
        # Rounding is far below 1e-9 of the shortest way.
        assert way >= (1.0 - 1e-9) * SHORTEST * h
        assert after == 0.0 or after >= (1.0 - 1e-9) * SHORTEST * h
        # As long as it may be, it is as long as is asked for.
        if SHORTEST <= t <= left - SHORTEST:
            assert way == t * h


@pytest.mark.parametrize('limits', [{}, {'limits': {'lower': -3.0, 'upper': 3.0}}])
def test_a_position_that_is_no_number_is_within_no_limits(limits):
    """Also of an axis that has none: then the step is taken in parts, and does not end as that."""
    one = hanging(1, friction=0.1, **limits)
    one.step()
    joints = joints_of(one)
    assert not leaves_active_set(joints.table, state_of(one), joints._scratch, 1e-3, False)
    state_of(one).q[:, joints.table.body[0]] = np.nan
    assert leaves_active_set(joints.table, state_of(one), joints._scratch, 1e-3, False)
