# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compile the engine's kernels, and keep what was compiled."""

from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar

import numba

from rigid_sim_ros.kernels.cache import LateCache
from rigid_sim_ros.kernels.linking import Kernel, STAYS_APART, without_literals
from rigid_sim_ros.kernels.numba_target import SUPPORTED

Function = TypeVar('Function', bound=Callable[..., Any])

# Numba counts an index below 0 from the end, and tests for it at each access. A positive number
# stays what it is under this mask, and the tests go: without it a step of `tower` takes 4 % longer
# and one of `balls` 9 %.
INDEX = (1 << 40) - 1


def _compiled(function: Function, **options: Any) -> Any:
    _name_apart(function)
    options |= {'nogil': True, 'error_model': 'numpy', 'no_cfunc_wrapper': True}
    njit: Any = numba.njit
    compiled: Any = (Kernel(function, options={'nopython': True, **options}) if SUPPORTED
                     else njit(**options)(function))
    compiled._cache = LateCache(compiled)
    return compiled


def _name_apart(function: Any) -> None:
    """
    Let the names of functions that one line of source makes say what they were made of.

    Numba tells them apart by a number that each process counts from 1, and machine code of several
    processes, from the cache, meets in one: of two functions of a name the first is called.
    """
    for cell in function.__closure__ or ():
        content = cell.cell_contents
        module = getattr(content, '__module__', '').rpartition('.')[2]
        function.__qualname__ += f'_{module}_{getattr(content, "__qualname__", content)}'


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
    that was a third of the time to compile. Where a part calls it, Numba would put it in its place
    like the part: half of the machine code of a step was such copies.
    """
    return _for_kernels(_compiled(function, _nrt=False, forceinline=False))


def apart(function: Function) -> Function:
    """
    Compile like `kernel` what is called in many places, a few times in a step.

    LLVM would put it in each of these places, and take as long for each.
    """
    setattr(function, STAYS_APART, True)
    return kernel(function)


def part(function: Function) -> Function:
    """
    Compile like `kernel` a part of one longer kernel: it is put in its place, without a call.

    A call hands over every array as seven numbers or more. Of a NamedTuple with arrays it hands
    over where that lies, and what is called has to read there what it needs.
    """
    return _for_kernels(_compiled(function, _nrt=False, forceinline=True))


def inlined(function: Function) -> Function:
    """
    Compile like `part` a small function that a loop over bodies calls.

    Numba by itself has to paste the body into each caller before types are known: a real call,
    even one that LLVM inlines later, keeps that loop from becoming vector instructions.
    """
    return part(function) if SUPPORTED else pasted(function)


def pasted(function: Function) -> Function:
    """
    Paste the body into each caller before types are known.

    For what returns a piece of an array, which would be counted as a reference if a call did.
    """
    return _compiled(function, _nrt=False, inline='always')


def in_python(function: Function) -> Function:
    """
    Return a kernel, or what calls kernels, as Python runs it: none of them is compiled.

    For a few numbers, with the same results: they are there long before a kernel is compiled, 0.1
    s, or read from the cache, 5 ms.
    """
    own: Any = getattr(function, 'py_func', function)
    called = {name: in_python(value) for name, value in own.__globals__.items()
              if name in own.__code__.co_names and hasattr(value, 'py_func')}
    plain: Any = FunctionType(own.__code__, own.__globals__ | called, own.__name__,
                              own.__defaults__, own.__closure__)
    return plain


def _for_kernels(compiled: Any) -> Any:
    if not SUPPORTED:
        template = compiled.get_call_template
        compiled.get_call_template = lambda args, kws: template(*without_literals(args, kws))
    return compiled
