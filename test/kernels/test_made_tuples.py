# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tuples that kernels return and make, held by their place in memory, are like values."""

from typing import NamedTuple

from kernels.own_kernels import of_the_engine
from numba import errors
import numpy as np
import pytest

from rigid_sim_ros.kernels import kernel as kernels
from rigid_sim_ros.kernels.numba_target import SUPPORTED

pytestmark = pytest.mark.skipif(not SUPPORTED, reason='this Numba holds tuples as values')


apart, kernel = map(of_the_engine, (kernels.apart, kernels.kernel))


class Page(NamedTuple):
    weight: float
    values: np.ndarray
    table: np.ndarray
    flags: np.ndarray   # of no kind that is held by address and lengths
    small: np.ndarray   # of 32 bits


class Book(NamedTuple):
    pages: tuple[Page, Page]
    mark: tuple[bool, int]
    last: Page
    every_second: np.ndarray    # with gaps


for ours in Page, Book:
    ours.__module__ = kernels.__name__


def page(first):
    return Page(first, first + np.arange(3.0), first + np.arange(8.0).reshape(2, 4),
                np.array([first > 5.0, True]), np.array([7, int(first)], dtype=np.int32))


def book():
    return Book((page(1.0), page(10.0)), (True, 3), page(100.0), np.arange(10.0)[::2])


@kernel
def entries(of):
    """Return something of everything in a page."""
    return (of.weight, of.values[1], of.table[1, 2], of.table.shape[0] * 10 + of.table.shape[1],
            of.table.size, of.flags[0], of.small[1])


@apart
def chosen(whole, number):
    return whole.pages[number]


@apart
def turned(whole):
    return whole.pages[1], whole.pages[0]


@apart
def made(of, weight):
    return Page(weight, of.table[0], of.table[:1], of.flags, of.small)


@kernel
def read_from(whole, number):
    return entries(whole.pages[number]), entries(whole.last), whole.every_second[2], whole.mark


@kernel
def read_chosen(whole, number):
    return entries(chosen(whole, number)), entries(turned(whole)[number])


@kernel
def read_made(whole):
    one, other = made(whole.last, 2.0), made(whole.pages[0], 3.0)
    both = Book((one, other), (False, 4), one, whole.every_second)
    return ((both.pages[0].weight, both.pages[0].values[3], both.pages[0].table.shape),
            (both.pages[1].weight, both.pages[1].values[3], both.pages[1].table.shape),
            both[2].weight, both[-1][1], both.mark)


def expected(of):
    return (of.weight, of.values[1], of.table[1, 2], 24, 8, of.flags[0], of.small[1])


@pytest.mark.parametrize('number', [0, 1])
def test_a_kernel_reads_all_that_is_in_a_tuple_of_tuples(number):
    whole = book()
    assert read_from(whole, number) == (
        expected(whole.pages[number]), expected(whole.last), 4.0, (True, 3))


@pytest.mark.parametrize('number', [0, 1])
def test_what_a_kernel_returns_to_another_is_the_tuple(number):
    whole = book()
    assert read_chosen(whole, number) == (
        expected(whole.pages[number]), expected(whole.pages[1 - number]))


def test_kernels_make_tuples_of_arrays_and_of_tuples():
    assert read_made(book()) == (
        (2.0, 103.0, (1, 4)), (3.0, 4.0, (1, 4)), 2.0, 2.0, (False, 4))


@kernel
def sum_of_made(whole, count):
    total = 0.0
    for k in range(count):
        now = made(whole.pages[k % 2], float(k))
        total += now.weight * now.values[0]
    return total


def test_each_time_around_a_loop_may_make_its_own():
    assert sum_of_made(book(), 4) == 0.0 * 1 + 1.0 * 10 + 2.0 * 1 + 3.0 * 10


@kernel
def keeps_one(whole, count):
    total, before = 0.0, whole.last
    for k in range(count):
        now = made(whole.pages[k % 2], float(k))
        total += before.weight * now.weight
        before = now
    return total


def test_a_loop_that_keeps_a_tuple_for_the_next_time_is_refused():
    with pytest.raises(errors.UnsupportedError, match=r'before.* kept for the next time around'):
        keeps_one(book(), 3)
