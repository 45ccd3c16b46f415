# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How kernels go through `range(stop)` and `range(start, stop)`.

Numba asks of each range whether its step is 0, which is an error, then divides by it; and whatever
calls a kernel with a loop asks that for errors. A step of 1 needs none of this.
"""

from typing import Any

from llvmlite import ir
from numba import extending, types
from numba.core import cgutils, imputils
from numba.cpython import rangeobj

_types: Any = types
_lower: Any = extending.lower_builtin
_known: Any = imputils.builtin_registry
assert rangeobj     # with it Numba says its own way, which is replaced below
_INTEGER = ir.IntType(64)
_ZERO, _ONE = ir.Constant(_INTEGER, 0), ir.Constant(_INTEGER, 1)
# The members of a range; and those of what goes through one: where the next number is written
# down, and where how many are left, which is 0 or less when none is.
_START, _STOP, _STEP = range(3)
_NEXT, _END, _BY, _LEFT = range(4)


def count_plainly() -> None:
    """Go through ranges of int64 so from now on."""
    state = _types.range_state64_type
    found = [general for general, name, kinds in _known.functions
             if (name, kinds) == ('getiter', (state,))]
    if found:
        _lower(range, types.int64)(_up_to)
        _lower(range, types.int64, types.int64)(_from_to)
        _lower('getiter', state)(_beginning(found[-1]))
        _lower('iternext', _types.range_iter64_type)(_next)


def _up_to(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return _together(context, builder, signature, _ZERO, arguments[0], _ONE)


def _from_to(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return _together(context, builder, signature, *arguments, _ONE)


def _together(context: Any, builder: Any, signature: Any, *members: Any) -> Any:
    whole: Any = ir.Constant(context.get_value_type(signature.return_type), ir.Undefined)
    for k, member in enumerate(members):
        whole = builder.insert_value(whole, member, k)
    return whole


def _beginning(general: Any) -> Any:
    def begin(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        start, stop, step = (builder.extract_value(arguments[0], k)
                             for k in (_START, _STOP, _STEP))
        if step is not _ONE:
            return general(context, builder, signature, arguments)
        at, left = (cgutils.alloca_once(builder, _INTEGER) for _ in range(2))
        builder.store(start, at)
        builder.store(builder.sub(stop, start), left)
        return _together(context, builder, signature, at, stop, step, left)

    return begin


def _next(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Return the next number and whether there was one."""
    at, step, of_left = (builder.extract_value(arguments[0], k) for k in (_NEXT, _BY, _LEFT))
    number, left = builder.load(at), builder.load(of_left)
    builder.store(builder.sub(left, _ONE), of_left)
    builder.store(builder.add(number, step), at)
    return _together(context, builder, signature, number,
                     builder.icmp_signed('>', left, _ZERO))
