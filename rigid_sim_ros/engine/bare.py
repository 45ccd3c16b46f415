# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compile kernels that own nothing."""

from collections.abc import Callable
from typing import Any, TypeVar

from numba import types

from rigid_sim_ros.engine.kernel import _compiled

Function = TypeVar('Function', bound=Callable[..., Any])


def bare(function: Function) -> Function:
    """
    Compile like `kernel`, without counting references to arrays and without checks for division by zero.

    For functions that neither make nor return an array. Numba counts the references to every array that
    a call passes, atomically and one by one, also for those inside of a NamedTuple: 1.4 us for a call of the
    narrow phase that works for 0.1 us. A quotient by zero is infinite or not a number, as in NumPy.

    It is compiled once for numbers of a type, not once more for every constant that a caller writes, as
    Numba would: that was a third of the time to compile.
    """
    compiled: Any = _compiled(function, _nrt=False, error_model='numpy')
    template = compiled.get_call_template

    def without_literals(args: Any, kws: Any) -> Any:
        return template(tuple(types.unliteral(arg) for arg in args),
                        {name: types.unliteral(arg) for name, arg in kws.items()})

    compiled.get_call_template = without_literals
    return compiled  # type: ignore[no-any-return]
