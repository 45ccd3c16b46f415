# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A kernel with everything that kernels do in another way; it is compiled in each process."""

from typing import NamedTuple

from kernels.own_kernels import of_the_engine
from numba.core.caching import NullCache
import numpy as np

from rigid_sim_ros.kernels import kernel as kernels
from rigid_sim_ros.kernels.argument_pack import ArgumentPack
from rigid_sim_ros.kernels.bits import lowest_zero
from rigid_sim_ros.kernels.eight import load, store

kernel, part, apart = map(of_the_engine, (kernels.kernel, kernels.part, kernels.apart))


class Page(NamedTuple):
    weight: float
    table: np.ndarray


class Arguments(NamedTuple):
    page: Page
    rows: np.ndarray


Page.__module__ = Arguments.__module__ = kernels.__name__


@part
def half(page):
    return Page(page.weight / 2.0, page.table)


@apart
def low(x, y):
    return min(x, y, 3.0)


@kernel
def everything(c, count):
    page, rows = c.page, c.rows
    for i in range(count):
        now = half(page)
        page.table[i, 1] += now.weight * lowest_zero(i) + low(1.0, page.table[0, i])
    store(rows, 0, load(rows, 1) + 2.0)
    return len(page.table) + abs(count)


everything._cache = NullCache()


def run():
    """Compile it, and call it."""
    rows = np.ones(16)
    pack = ArgumentPack(Arguments(Page(2.0, np.zeros((4, 4))), rows))
    assert everything(pack, 3) == 4 + 3
    assert rows.tolist() == [3.0] * 8 + [1.0] * 8
