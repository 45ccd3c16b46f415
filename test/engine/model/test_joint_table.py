# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is made of the joints of a scene."""

from bag.hostile import limited_time
import numpy as np

from rigid_sim_ros.engine.model.joints import build_joints, Joint, Mimic, REVOLUTE
from rigid_sim_ros.engine.model.model import WORLD


def test_many_articulations_do_not_take_the_square_of_their_number() -> None:
    """Two hundred million looks at a joint would take longer than is allowed here."""
    count = 16_000
    origin, axes = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
    follows_the_first = Mimic(0, 1.0, 0.0)
    joints = [Joint(REVOLUTE, WORLD, j, origin, axes, origin, axes,
                    mimic=follows_the_first if j == count - 1 else None) for j in range(count)]
    with limited_time():
        table = build_joints(joints, np.ones(count).tolist())
    # What mimics the first joint belongs to its articulation.
    assert table.body.tolist() == [0, count - 1, *range(1, count - 1)]
    assert table.first_row.tolist() == [0, *range(2, count + 1)]
    assert table.condition_joint.tolist() == [count - 1]
    assert table.first_condition.tolist() == [0] + [1] * (count - 1)
