# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What stands below the marks of a bag's timeline."""

from itertools import pairwise

from rigid_sim_ros.viewer.recording import Happening
from rigid_sim_ros.viewer.timeline import named_marks

MANY = [Happening(0.1 * k, 'reset', '') for k in range(101)]


def named(marks):
    return {at: text for at, text in marks.items() if text}


def test_every_happening_has_a_mark_and_no_text_hides_another():
    marks = named_marks(MANY, 0.0, 10.0)
    assert len(marks) == len(MANY)
    times = sorted(named(marks))
    assert len(times) > 3
    # Five letters of 5 px on 140 px are 0.18 of 10 s.
    assert all(b - a >= 1.8 for a, b in pairwise(times))


def test_the_first_difference_is_named_among_many():
    marks = named_marks([*MANY, Happening(4.05, 'difference', '')], 0.0, 10.0)
    assert marks[4.05] == 'difference'
    assert all(abs(at - 4.05) >= 2.7 for at in named(marks) if at != 4.05)  # (5 + 10) / 2 letters


def test_a_bag_of_one_moment_has_one_text():
    happenings = [Happening(1.0, 'reset', ''), Happening(1.0, 'end', '')]
    assert list(named_marks(happenings, 1.0, 1.0).values()) == ['reset']
