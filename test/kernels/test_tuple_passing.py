# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An array in a NamedTuple is to a kernel called by a kernel what it is to Python."""

import numpy as np
import pytest

from rigid_sim_ros.engine.detection import manifolds as engine_manifolds
from rigid_sim_ros.engine.detection.manifolds import empty_pages
from rigid_sim_ros.engine.dynamics.integrate import make_work
from rigid_sim_ros.kernels.kernel import kernel

ROOM = 5    # manifolds


def of_the_engine(function):
    """Let a function of this file be compiled and cached as one of the engine."""
    function.__module__ = engine_manifolds.__name__
    return kernel(function)


@of_the_engine
def note_sizes(m, found):
    found[0, 0], found[0, 1], found[0, 2] = m.points.size, m.points.itemsize, m.points.strides[0]
    found[1, 0], found[1, 1], found[1, 2] = m.normal.size, m.normal.itemsize, m.normal.strides[0]
    found[2, 0], found[2, 1], found[2, 2] = m.r_A.size, m.r_A.itemsize, m.r_A.strides[0]
    found[3, 0], found[3, 1], found[3, 2] = m.r_A.shape[1], m.r_A.strides[1], m.r_A.strides[2]
    found[4, 0], found[4, 1], found[4, 2] = len(m.shape_a), m.shape_a.itemsize, m.normal.strides[1]


@of_the_engine
def add_up(m, sums):
    for value in m.gap.flat:
        sums[0] += value
    for k in range(m.r_B.shape[0]):
        for row in m.r_B[k]:
            sums[1] += row[0] + 10.0 * row[1] + 100.0 * row[2]
    for i in range(m.normal.shape[0]):
        sums[2] += m.normal[i, 0] - m.normal[i, 2]
    m.points[1:3] = 7


@of_the_engine
def look(pages, page, found, sums):
    note_sizes(pages[page], found)
    add_up(pages[page], sums)


def sizes_in_python(m):
    return [[m.points.size, m.points.itemsize, m.points.strides[0]],
            [m.normal.size, m.normal.itemsize, m.normal.strides[0]],
            [m.r_A.size, m.r_A.itemsize, m.r_A.strides[0]],
            [m.r_A.shape[1], m.r_A.strides[1], m.r_A.strides[2]],
            [len(m.shape_a), m.shape_a.itemsize, m.normal.strides[1]]]


def filled(seed):
    """Return two pages with numbers that sum up exactly."""
    rng = np.random.default_rng(seed)
    pages = empty_pages(ROOM)
    for page in pages:
        for name in ('gap', 'r_B', 'normal'):
            getattr(page, name)[...] = rng.integers(-100, 100, getattr(page, name).shape)
    return pages


def every_other(array):
    """Return an array with these values, and others between its entries."""
    wide = np.full((*array.shape[:-1], 2 * array.shape[-1]), np.nan)
    wide[..., ::2] = array
    return wide[..., ::2]


@pytest.mark.parametrize('gaps', [(), ('normal',), ('r_A', 'r_B', 'normal')])
@pytest.mark.parametrize('page', [0, 1])
def test_lengths_strides_and_entries_are_those_of_python(page, gaps):
    pages = tuple(one._replace(**{name: every_other(getattr(one, name)) for name in gaps})
                  for one in filled(page))
    found, sums = np.zeros((5, 3), dtype=np.int64), np.zeros(3)
    look(pages, page, found, sums)
    m = pages[page]
    assert found.tolist() == sizes_in_python(m)
    assert sums.tolist() == [m.gap.sum(), (m.r_B * [1.0, 10.0, 100.0]).sum(),
                             (m.normal[:, 0] - m.normal[:, 2]).sum()]
    assert m.points.tolist() == [0, 7, 7, 0, 0]
    assert pages[1 - page].points.tolist() == [0] * ROOM


@of_the_engine
def double(loads):
    for i in range(loads.F.shape[1]):
        loads.F[0, i] *= 2.0
        loads.tau[2, i] += loads.F.shape[0] + 10 * loads.tau.size


@of_the_engine
def double_all(work):
    double(work.loads)


def test_a_tuple_of_arrays_of_one_type_too():
    work = make_work(4)
    work.loads.F[...] = 3.0
    double_all(work)
    assert work.loads.F.tolist() == [[6.0] * 4, [3.0] * 4, [3.0] * 4]
    assert work.loads.tau[2].tolist() == [3.0 + 10 * 12] * 4
