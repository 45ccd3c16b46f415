# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Eight numbers at once against NumPy, which does the same one by one: to the last bit."""

from kernels.own_kernels import of_the_engine
import numpy as np
import pytest

from rigid_sim_ros.kernels import eight
from rigid_sim_ros.kernels.eight import (
    any_of, bits_of, both, gather, gather_integers, gather_rows_1, gather_rows_3, LANES,
    largest_of, load, root, scatter, scatter_rows_1, scatter_rows_3, select, spread, store,
    write_eight)

kernel = of_the_engine(module=eight)
ROWS = np.array([3, -1, 0, 7, -1, 2, 9, 5])


@kernel
def calculate(b):
    x, y = load(b, 0), load(b, 1)
    store(b, 2, x + y)
    store(b, 3, x - 2.0)
    store(b, 4, 3 * y)
    store(b, 5, x / y)
    store(b, 6, -x)
    store(b, 7, abs(x))
    store(b, 8, min(x, y))
    store(b, 9, max(x, 0.0))
    store(b, 10, root(abs(x)))
    store(b, 11, select(both(x > y, x <= 1.0), x, -1.0))
    store(b, 12, spread(0.5))
    store(b, 13, 7)
    for _ in range(3):
        x = x + y
    store(b, 14, x)


@kernel
def look(b, limit):
    x = load(b, 0)
    return any_of(x > limit), bits_of(x > limit), largest_of(x)


@pytest.fixture
def numbers():
    return np.random.default_rng(4).normal(size=15 * LANES)


def test_operators_do_what_they_do_to_numbers(numbers):
    rows = numbers.reshape(-1, LANES)
    x, y = rows[:2].copy()
    calculate(numbers)
    wanted = [x + y, x - 2.0, 3 * y, x / y, -x, abs(x), np.minimum(x, y), np.maximum(x, 0.0),
              np.sqrt(abs(x)), np.where((x > y) & (x <= 1.0), x, -1.0), np.full(LANES, 0.5),
              np.full(LANES, 7.0), x + y + y + y]
    for row, value in zip(rows[2:], wanted, strict=True):
        assert row.tobytes() == value.tobytes()


def test_lanes_hear_of_each_other_in_questions_only(numbers):
    x = numbers[:LANES]
    x[3] = 5.0
    assert look(numbers, 4.0) == (True, 8, 5.0)
    assert look(numbers, 6.0) == (False, 0, 5.0)
    assert look(numbers, -9.0)[1] == 255
    for lane in range(LANES):
        x[:] = -np.arange(LANES)
        x[lane] = 5.0
        assert look(numbers, 4.0) == (True, 1 << lane, 5.0)


@kernel
def put_eight(array, first, b):
    write_eight(array, first, load(b, 1))


@pytest.mark.parametrize('first', [0, 3, 9])
def test_eight_numbers_are_written_anywhere(numbers, first):
    matrix = np.zeros((2, 10))
    put_eight(matrix, first, numbers)
    wanted = np.zeros(20)
    wanted[first:first + LANES] = numbers[LANES:2 * LANES]
    assert matrix.tobytes() == wanted.tobytes()


@kernel
def turn_over(b, records, at):
    numbers = gather(records, at)
    for k in range(LANES):
        store(b, k, numbers[k])
    scatter(records, at, (numbers[1], numbers[0], numbers[5]))


def test_records_become_rows_and_back(numbers):
    records, at = np.random.default_rng(5).normal(size=160), np.arange(8) * 16 + 3
    before = records.copy()
    turn_over(numbers, records, at)
    for lane, start in enumerate(at):
        record = before[start:start + 8]
        assert numbers.reshape(-1, LANES)[:8, lane].tolist() == record.tolist()
        assert records[start:start + 8].tolist() == [record[1], record[0], record[5], *[0.0] * 5]
    untouched = np.setdiff1d(np.arange(160), (at[:, None] + np.arange(8)).ravel())
    assert records[untouched].tolist() == before[untouched].tolist()


@kernel
def pick(b, three, eight, integers, rows):
    x, y, z = gather_rows_3(three, rows, 3, 0)
    p, q, r = gather_rows_3(eight, rows, 8, 4)
    (one,) = gather_rows_1(eight, rows, 8, 2)
    for k, row in enumerate((x, y, z, p, q, r)):
        store(b, k, row)
    store(b, 6, gather_integers(integers, rows) + one)


def test_rows_of_tables_are_found_and_missing_ones_are_0(numbers):
    rng = np.random.default_rng(6)
    three, eight, integers = rng.normal(size=(10, 3)), rng.normal(size=(10, 8)), rng.integers(
        -9, 9, 10)
    pick(numbers, three, eight, integers, ROWS)
    wanted = [*three.T, *eight[:, 4:7].T, integers + eight[:, 2]]
    for row, column in zip(numbers.reshape(-1, LANES), wanted, strict=False):
        assert row.tolist() == [column[r] if r >= 0 else 0.0 for r in ROWS]


@kernel
def put(b, one, three, rows):
    x, y, z = load(b, 0), load(b, 1), load(b, 2)
    scatter_rows_1(one, rows, 1, 0, (x,))
    scatter_rows_3(three, rows, 3, 0, (x, y, z))


def test_rows_of_tables_are_written_and_no_others(numbers):
    one, three = np.zeros(10), np.zeros((10, 3))
    put(numbers, one, three, ROWS)
    columns = numbers.reshape(-1, LANES)[:3]
    for table, width in ((one[:, None], 1), (three, 3)):
        for r in range(10):
            lane = np.nonzero(r == ROWS)[0]
            wanted = columns[:width, lane[0]] if lane.size else np.zeros(width)
            assert table[r].tolist() == wanted.tolist()
