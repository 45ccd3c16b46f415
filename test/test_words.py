# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which names were chosen, and which one was meant."""

from rigid_sim_ros.words import either, matches, matching, nearest, similar

NAMES = ['arm_left', 'base', 'arm_right']


def test_patterns_choose_names_in_the_order_of_the_names() -> None:
    assert matching(NAMES, ['b*', 'arm_?*']) == NAMES
    assert matching(NAMES, iter(['*right', 'base'])) == ['base', 'arm_right']
    assert matching(NAMES, ['BASE']) == matching(NAMES, []) == []
    assert matches('base', ['b*'])


def test_the_most_similar_name_was_meant() -> None:
    asked = "did you mean 'arm_right'?"
    assert similar('arm_rigth', NAMES) == nearest('arm_rigth', NAMES) == asked
    assert similar('wheel', NAMES) == ''


def test_what_resembles_none_is_told_the_choice() -> None:
    assert nearest('wheel', ['base', 'base', 'arm']) == 'must be base or arm'
    assert nearest('wheel', []) == 'must go'
    many = [f'x{k}' for k in range(13)]
    assert nearest('wheel', many[:12]).endswith('x10 or x11')
    assert nearest('wheel', many).endswith('x10 or one of 2 more')


def test_a_choice_is_written_with_commas_and_or() -> None:
    assert either(['a']) == 'a'
    assert either(['a', 'b', 'c']) == 'a, b or c'
