# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How much work a test takes: little in the suite, much with `pytest --long`.

docs/testing.md says when the long form is due.
"""

import os
from typing import Any, TypeVar

from hypothesis import settings

_T = TypeVar('_T')
# How many times as many examples of each property the long form tries.
_MORE = 20
# The workers of pytest-xdist and their processes inherit it.
_VARIABLE = 'RIGID_SIM_ROS_LONG_TESTS'


def choose(is_long: bool) -> None:
    """Choose the form of all tests; before their modules are imported."""
    if is_long:
        os.environ[_VARIABLE] = '1'


def is_long() -> bool:
    """Return whether tests are to be thorough, however long that takes."""
    return _VARIABLE in os.environ


def either(short: _T, long: _T) -> _T:
    """Return how much a test is to do: it bears the mark `long` then."""
    return long if is_long() else short


def examples(count: int, **options: Any) -> settings:
    """Return what lets a property be tried with so many examples in the suite; more settings."""
    return settings(max_examples=count * either(1, _MORE), **options)
