# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What Numba remembers of calls stays true when definitions come later."""

from numba import njit, types
from numba.core.errors import TypingError
from numba.core.registry import cpu_target
from numba.extending import overload
import pytest

from rigid_sim_ros.engine import kernel

assert kernel   # with it Numba begins to remember


def twice(x):
    raise NotImplementedError


@overload(twice)
def _twice_of_numbers(x):
    return (lambda x: x + x) if isinstance(x, types.Number) else None


@njit
def four_times(x):
    return twice(twice(x))


def test_a_call_is_resolved_once_for_each_type():
    context = cpu_target.typing_context
    context.refresh()
    kind = context.resolve_value_type(abs)
    one, again, other = (kind.get_call_type(context, (argument,), {})
                         for argument in (types.float64, types.float64, types.int64))
    assert one is again
    assert (one.return_type, other.return_type) == (types.float64, types.int64)


def test_a_definition_that_comes_later_is_found():
    assert four_times(2) == 8
    assert four_times(2.5) == 10.0
    with pytest.raises(TypingError):
        four_times('ab')

    @overload(twice)
    def _twice_of_texts(x):
        return (lambda x: x + '+' + x) if x == types.unicode_type else None

    # Numba remembers itself what a function could not be compiled for.
    assert njit(four_times.py_func)('ab') == 'ab+ab+ab+ab'
