# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments in a pack are the same as arguments that are given anew."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from rigid_sim_ros.engine.dynamics.integrate import make_work
from rigid_sim_ros.engine.solver.arguments import TimestepSettings
from rigid_sim_ros.kernels import argument_pack
from rigid_sim_ros.kernels.argument_pack import ArgumentPack, packed
from rigid_sim_ros.kernels.kernel import kernel

SETTINGS = TimestepSettings(margin=2.5, sleep_steps=10)


class Arguments(NamedTuple):
    """What the kernels here are given."""

    scratch: Any
    settings: Any
    flags: Any
    total: Any


Arguments.__module__ = argument_pack.__name__   # it is passed like those of the engine


def work(n):
    """Return NamedTuples in a NamedTuple: the work of n bodies, with forces 0, 1, 2, ... [N]."""
    made = make_work(n)
    made.loads.F[...] = np.arange(3.0 * n).reshape(3, n)
    return made


def add_up(c, weight):
    c.total[0] = c.settings.margin * c.settings.sleep_steps
    for i in range(c.scratch.loads.F.shape[1]):
        c.total[0] += weight * c.scratch.loads.F[1, i] * c.flags[i]
    return c.total[0]


def double(c):
    return 2 * c.total[0]


# They get its place in the cache.
add_up.__module__ = double.__module__ = argument_pack.__name__
add_up, double = kernel(add_up), kernel(double)


def of_the_pack(function):
    function.__module__ = argument_pack.__name__
    return kernel(function)


def pair(n):
    return np.ones(n, dtype=np.int64), np.zeros(1)


def pack(n, settings=SETTINGS, flags=None, total=None):
    flags, total = pair(n) if flags is None else (flags, total)
    return ArgumentPack(Arguments(work(n), settings, flags, total))


def test_a_kernel_reads_numbers_arrays_and_tuples_as_attributes():
    flags, total = pair(3)
    assert add_up(pack(3, SETTINGS, flags, total), 2.0) == 25 + 2.0 * (3 + 4 + 5)
    assert total[0] == 49


def test_an_attribute_that_is_not_there_is_named():
    wrong = of_the_pack(lambda c: c.nowhere[0])
    with pytest.raises(Exception, match='nowhere'):
        wrong(pack(3))


def sleep_steps(c):
    if c is None:
        return c.missing    # no type has it: to compile this is an error
    return c.settings.sleep_steps


def test_what_is_for_no_arguments_is_not_compiled_for_a_pack():
    assert of_the_pack(sleep_steps)(pack(3)) == SETTINGS.sleep_steps


def test_what_python_writes_to_an_array_the_next_call_sees():
    arguments = Arguments(work(3), SETTINGS, *pair(3))
    once = ArgumentPack(arguments)
    add_up(once, 2.0)
    arguments.scratch.loads.F[1] = 1.0
    arguments.flags[0] = 0
    assert add_up(once, 2.0) == 25 + 2.0 * 2


def test_the_same_objects_are_taken_apart_once_and_others_anew():
    first, second, arrays = work(3), work(4), pair(4)
    before = packed(Arguments(first, SETTINGS, *arrays), None)
    assert packed(Arguments(first, SETTINGS, *arrays), before) is before
    assert add_up(packed(Arguments(second, SETTINGS, *arrays), before), 1.0) == 25 + (
        4 + 5 + 6 + 7)
    assert add_up(packed(Arguments(first, SETTINGS, *arrays), before), 1.0) == 25 + (3 + 4 + 5)
    faster = SETTINGS._replace(margin=3.0)
    assert add_up(packed(Arguments(first, faster, *arrays), before), 1.0) == 30 + (3 + 4 + 5)


def test_packs_of_other_types_are_told_apart():
    flags, total = pair(3)
    assert add_up(pack(3, SETTINGS, flags.astype(np.int32), total), 1.0) == 37
    assert add_up(pack(3, SETTINGS, flags, total), 1.0) == 37


@pytest.mark.parametrize('other', [np.float32(1.0), 1 + 2j])
def test_what_has_no_64_bits_of_its_own_is_refused(other):
    with pytest.raises(TypeError, match='cannot be packed, only arrays and numbers of 64 bits'):
        ArgumentPack(Arguments(work(3), (1, other), *pair(3)))


def test_arguments_of_one_type_are_each_taken_apart():
    """How is found out once for a type: with other lengths, strides and places it still holds."""
    for n in (3, 5, 4):
        flags, total = np.ones(2 * n, dtype=np.int64)[::2], np.zeros(1)
        assert not flags.flags.c_contiguous
        flags[0] = n
        assert add_up(pack(n, SETTINGS, flags, total), 1.0) == 25 + n * n + sum(
            range(n + 1, 2 * n))


def test_a_pack_runs_kernels_of_its_type_with_numbers():
    for kind, weight in ((np.int64, 2), (np.int32, 3), (np.int64, 4)):
        flags, total = pair(3)
        one = pack(3, SETTINGS, flags.astype(kind), total)
        for _ in range(2):
            assert one.run(add_up, weight) == 25 + weight * (3 + 4 + 5)
            assert one.run(double) == 2 * (25 + weight * (3 + 4 + 5))
