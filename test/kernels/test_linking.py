# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Kernels that kernels call get no machine code of their own, and everything still runs."""

import math

from kernels.own_kernels import of_the_engine
from llvmlite import binding
import numpy as np
import pytest

from rigid_sim_ros.kernels import kernel as kernels
from rigid_sim_ros.kernels.linking import _below, _names_in, _Part
from rigid_sim_ros.kernels.numba_target import SUPPORTED

needs_parts = pytest.mark.skipif(not SUPPORTED, reason='this Numba compiles kernels by itself')


apart, inlined, kernel, part = map(
    of_the_engine, (kernels.apart, kernels.inlined, kernels.kernel, kernels.part))


@inlined
def square(x):
    return x * x


@part
def length(x, y):
    return math.sqrt(square(x) + square(y))


@kernel
def shorter(x, y, factor):
    return length(x, y) / factor


@kernel
def fill(values, factor):
    for i in range(values.shape[0]):
        values[i] = shorter(values[i], 4, factor)
    return shorter(3.0, 4.0, 2)


@apart
def cube(x):
    return x * x * x


@part
def cubes(x):
    return cube(x) + square(x)


@kernel
def powers(x):
    return cubes(x) + cube(2.0 * x)


@needs_parts
def test_what_is_apart_stays_a_call_in_a_part_too():
    assert powers(2.0) == 8.0 + 4.0 + 64.0
    (compiled,) = powers.overloads.values()
    module = compiled.library._get_module_for_linking()
    names = [function.name for function in module.functions]
    assert any('cube' in name and 'cubes' not in name for name in names)
    assert not any('cubes' in name or 'square' in name for name in names)


@needs_parts
def test_only_what_python_calls_is_machine_code():
    values = np.array([3.0, 0.0])
    assert fill(values, 5.0) == 2.5
    assert values.tolist() == [1.0, 0.8]
    assert [len(f.signatures) for f in (fill, shorter, length, square)] == [1, 0, 0, 0]


@pytest.mark.parametrize('function, arguments, result', [
    (square, (3.0,), 9.0), (length, (3.0, 4.0), 5.0), (shorter, (3.0, 4.0, 5.0), 1.0)])
def test_a_kernel_that_kernels_call_may_be_called_from_python_too(function, arguments, result):
    fill(np.zeros(1), 1.0)
    assert function(*arguments) == result


@kernel
def at_once(x):
    return square(x) / 0.0


def test_a_quotient_by_zero_is_infinite_in_a_part_as_in_a_kernel():
    assert at_once(1.0) == math.inf


@kernel
def root(x):
    if x < 0.0:
        raise ValueError('a root of less than 0')
    return math.sqrt(x)


@part
def root_and_square(x):
    return root(x) + square(x)


@kernel
def third(values, i):
    triple = (values[0], values[1], values[2])
    return triple[i]


@kernel
def what_may_fail(x, i, values):
    before = square(x)
    values[0] = before
    return before + root_and_square(x) + third(values, i)


@needs_parts
@pytest.mark.parametrize('x, i, error', [
    (-1.0, 0, 'a root of less than 0'), (1.0, 3, 'tuple index out of range')])
def test_an_error_of_a_part_reaches_python(x, i, error):
    values = np.zeros(3)
    assert what_may_fail(4.0, 0, values) == 16.0 + 2.0 + 16.0 + 16.0
    with pytest.raises((ValueError, IndexError), match=error):
        what_may_fail(x, i, values)
    assert values[0] == 1.0     # what came before was done


def test_of_the_module_of_a_kernel_the_cache_keeps_the_names_alone():
    module = binding.parse_assembly("""
        @"d.0" = global i64 7
        declare void @elsewhere()
        define i64 @"a$b"(i64 %x) {
            ret i64 %x
        }""")
    names = binding.parse_bitcode(_names_in(module))
    assert [function.name for function in names.functions] == ['a$b']
    assert [variable.name for variable in names.global_variables] == ['d.0']
    assert 'ret ' not in str(names)


def made(*below):
    """Return a library that calls others."""
    library = object.__new__(_Part)
    library.below = below
    return library


def test_who_calls_is_linked_before_what_it_calls_and_each_once():
    numbas = object()
    low = made(numbas)
    middle, other = made(low), made(low, numbas)
    top = made(middle, other)
    for libraries in ([top], [numbas, low, middle, other, top], [top, other, middle, low, numbas],
                      [low, top], [other, numbas, top]):
        order = _below(libraries)
        assert sorted(map(id, order)) == sorted(map(id, (top, middle, other, low, numbas)))
        for library in (top, middle, other, low):
            assert all(order.index(library) < order.index(called) for called in library.below)


@inlined
def least(x, y, z):
    return min(x, y, z)


@part
def least_twice(x):
    return least(x, 2.0 * x, 3.0) + least(x, 1.0, 2.0)


@kernel
def least_of_all(x):
    return least(x, 1.0, 2.0) + least_twice(x) + least(x, 5.0, 7.0)


def test_what_several_parts_call_of_numbas_own_is_there():
    assert least_of_all(4.0) == 1.0 + (3.0 + 1.0) + 4.0
