# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Kernels read and write the entries of arrays that NumPy would."""

from hypothesis import given
from hypothesis import strategies as st
from kernels.own_kernels import of_the_engine
from numba.np import arrayobj
import numpy as np
import pytest

from rigid_sim_ros.kernels import kernel as kernels
from rigid_sim_ros.kernels.numba_target import SUPPORTED

kernel, INDEX = of_the_engine(kernels.kernel), kernels.INDEX
needs_entries = pytest.mark.skipif(not SUPPORTED, reason='this Numba finds entries by itself')


@kernel
def read(a, b, c, i, j, k):
    # The mask keeps what is 0 or more, and is for nothing else.
    m = abs(i) % 3
    return a[i], b[i, j], c[i, j, k], b[i, 1], c[0, j, -1], a[2], a[m & INDEX]


@kernel
def write(a, b, c, i, j, k, value):
    a[i] = value
    b[i, j] = value + 1
    c[i, j, k] = value + 2
    a[1] = value + 3
    b[0, j] += 1
    c[-1, 0, k & INDEX] = 7


SHAPE = 3, 4, 5
DTYPES = np.float64, np.float32, np.int64, np.int32, np.int8, np.uint64


def arrays(kind):
    numbers = np.arange(60)
    return [numbers[:SHAPE[0]].astype(kind), numbers[:12].reshape(SHAPE[:2]).astype(kind),
            numbers.reshape(SHAPE).astype(kind)]


def indices():
    return st.tuples(*(st.integers(-length, length - 1) for length in SHAPE))


@pytest.mark.parametrize('kind', DTYPES)
@given(at=indices())
def test_numbers_are_read_where_numpy_reads_them(kind, at):
    a, b, c = arrays(kind)
    i, j, k = at
    assert read(a, b, c, i, j, k) == (
        a[i], b[i, j], c[i, j, k], b[i, 1], c[0, j, -1], a[2], a[abs(i) % 3])


@pytest.mark.parametrize('kind', DTYPES)
@given(at=indices(), value=st.integers(0, 100))
def test_numbers_are_written_where_numpy_writes_them(kind, at, value):
    i, j, k = at[0], at[1], abs(at[2]) % SHAPE[2]
    ours, numpys = arrays(kind), arrays(kind)
    write(*ours, i, j, k, value)
    write.py_func(*numpys, i, j, k, value)
    for one, other in zip(ours, numpys, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize('kind', (np.int32, np.int8, np.uint8, np.uint64))
def test_an_index_may_be_of_any_integer_type(kind):
    a, b, c = arrays(np.float64)
    assert read(a, b, c, kind(1), kind(2), kind(3))[:3] == (a[1], b[1, 2], c[1, 2, 3])


@kernel
def parts_of(b):
    row, some = b[1], b[0, 1:3]
    b[2] = 5.0
    return row[2] + some[1] + b[:, 3].sum() + b[2, 0]


def test_rows_slices_and_columns_are_those_of_numpy():
    ours, numpys = (np.arange(12.0).reshape(3, 4) for _ in range(2))
    assert parts_of(ours) == parts_of.py_func(numpys)
    np.testing.assert_array_equal(ours, numpys)


@kernel
def two_of(b, i, j):
    b[i, j] += 1.0
    return b[i, j]


@pytest.mark.parametrize('layout', [
    lambda a: a[:, ::2], lambda a: np.asfortranarray(a), lambda a: a.T, lambda a: a[::-1]])
def test_arrays_with_gaps_or_turned_around_are_read_by_their_strides(layout):
    array = layout(np.arange(12.0).reshape(3, 4))
    before = array.copy()
    assert two_of(array, 1, -1) == before[1, -1] + 1.0
    before[1, -1] += 1.0
    np.testing.assert_array_equal(array, before)


@kernel
def flags(b, i):
    b[i] = not b[i]
    return b[i]


def test_what_is_no_number_goes_numbas_way():
    flag = np.array([True, False])
    assert flags(flag, 0) == 0
    assert flags(flag, -1) == 1
    assert flag.tolist() == [False, True]


@kernel
def untouched(a, b, i, j):
    a[i] = b[j, 1] + a[0]
    return a[i]


@needs_entries
def test_no_array_is_taken_to_pieces_for_a_number(monkeypatch):
    def not_wanted(*_, **__):
        raise AssertionError('an array was taken to pieces')

    monkeypatch.setattr(arrayobj, 'basic_indexing', not_wanted)
    assert untouched(np.zeros(3), np.ones((2, 2)), 1, 0) == 1.0
