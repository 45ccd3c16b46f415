# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The law of what pivots at the border of a face, on more scenes than other laws are asked."""

from laws.book import breaches, LAWS


def test_what_pivots_at_a_border_is_met_by_its_next_point_in_time():
    # A scene takes two steps; 5 of these broke the law while boxes had one point there.
    assert not breaches('pivot', 'timestep', range(300)), LAWS['pivot'].says
