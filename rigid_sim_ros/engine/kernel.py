# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compile the engine's kernels, and keep what was compiled."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba import types

from rigid_sim_ros.engine.kernel_cache import cache_folder

Function = TypeVar('Function', bound=Callable[..., Any])

# Numba counts an index below 0 from the end, and tests for it at each access. A positive number
# stays what it is under this mask, and the tests go.
INDEX = (1 << 40) - 1


def _compiled(function: Function, **options: Any) -> Any:
    config: Any = numba.config
    njit: Any = numba.njit
    elsewhere = config.CACHE_DIR
    config.CACHE_DIR = str(cache_folder(function.__module__))
    try:
        return njit(cache=True, nogil=True, error_model='numpy', no_cfunc_wrapper=True,
                    **options)(function)
    finally:
        config.CACHE_DIR = elsewhere


def kernel(function: Function) -> Function:
    """
    Compile a function of numbers and arrays, on its first call, and cache the result.

    The compiled code holds no lock of the interpreter (other threads run meanwhile) and keeps the
    order of every floating-point operation: fastmath stays off, so that runs repeat bit for bit. A
    quotient by zero is infinite or not a number, as in NumPy.

    A kernel makes no array, only writes to those that it is given. So references need not be
    counted, which Numba would do for every array that a call passes, atomically and one by one,
    also inside of a NamedTuple: 1.4 us for a call that works for 0.1 us. And it is compiled once
    for numbers of a type, not once more for every constant that a caller writes, as Numba would:
    that was a third of the time to compile.
    """
    return _without_literals(_compiled(function, _nrt=False))


def part(function: Function) -> Function:
    """
    Compile like `kernel` a part of one longer kernel: it is put in its place, without a call.

    A call hands over every array of a NamedTuple as seven numbers, which takes as long as a
    hundred operations.
    """
    return _without_literals(_compiled(function, _nrt=False, forceinline=True))


def allocating(function: Function) -> Function:
    """Compile like `kernel` a function that makes arrays: for where memory is not the time."""
    return _without_literals(_compiled(function))


def _without_literals(compiled: Any) -> Any:
    template = compiled.get_call_template
    unliteral: Any = types.unliteral

    def without_literals(args: Any, kws: Any) -> Any:
        return template(tuple(unliteral(arg) for arg in args),
                        {name: unliteral(arg) for name, arg in kws.items()})

    compiled.get_call_template = without_literals
    return compiled


def inlined(function: Function) -> Function:
    """
    Compile like `kernel`, but paste the body into each caller before types are known.

    For small functions that a loop over bodies calls: a real call, even one that LLVM inlines
    later, keeps that loop from becoming vector instructions.
    """
    return _compiled(function, _nrt=False, inline='always')
