# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pairs that are found are sorted into those that there are, whose witnesses move along."""

from engine.detecting import Scene, UPRIGHT
from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros.engine.detection import pair_list
from rigid_sim_ros.engine.detection.manifolds import REBUILT
from rigid_sim_ros.engine.detection.pair_list import sort_new, take_in
from rigid_sim_ros.engine.model.kinds.table import BOX, SPHERE
from rigid_sim_ros.kernels.kernel import in_python

# To compile these takes longer than they take in Python.
look_for_share, note_moved, update_alone = map(
    in_python, (pair_list.look_for_share, pair_list.note_moved, pair_list.update_alone))
SHAPES = 12
BALL, CUBE = (SPHERE, (0.5, 0.0, 0.0), None), (BOX, (0.5, 0.5, 0.5), None)
ALL = [(a, b) for a in range(SHAPES) for b in range(a + 1, SHAPES)]


def numbered(pairs):
    """Return witnesses that tell of which pair they are."""
    return np.array([(a, b, a * SHAPES + b, 1.0) for a, b in pairs]).reshape(-1, 4)


@pytest.mark.parametrize('kind', [SPHERE, BOX])
@given(seed=st.integers(0, 2**32 - 1))
def test_what_two_threads_found_is_sorted_in_and_witnesses_move_along(kind, seed):
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(ALL))
    there, _, first, second = (
        sorted(ALL[k] for k in part)
        for part in np.split(order, np.sort(rng.integers(0, len(ALL) + 1, 3))))
    count, room = len(there), int(rng.integers(len(there), len(ALL) + 3))
    # Behind those that there are is what was there before.
    pair = rng.choice(ALL, room).astype(np.int32)
    axis = np.full((room, 4), 7.0)
    pair[:count], axis[:count] = np.reshape(there, (-1, 2)), numbered(there)
    fresh = np.zeros((4, len(ALL), 2), dtype=np.int32)
    new = []
    for thread, found in enumerate((first, second)):
        # Each finds some of those that there are besides.
        known = [there[k] for k in rng.permutation(count)[:rng.integers(0, count + 1)]]
        listed = np.reshape(found + known, (-1, 2)).astype(np.int32)
        fresh[2 * thread, :len(listed)] = rng.permutation(listed)
        new.append(sort_new(fresh[2 * thread:][:2], len(listed), np.ones(SHAPES + 1, dtype=int),
                            pair, count))
        assert fresh[2 * thread, :new[thread]].tolist() == [list(p) for p in found]
    total = take_in(np.full(SHAPES, kind), fresh, *new, pair, axis, count)
    assert total == len(there) + len(first) + len(second)
    if total > room:
        # Nothing has been moved.
        assert pair[:count].tolist() == [list(p) for p in there]
        return
    expected = sorted(there + first + second)
    assert pair[:total].tolist() == [list(p) for p in expected]
    if kind == BOX:
        old = [k for k, p in enumerate(expected) if p in set(there)]
        assert np.array_equal(axis[old], numbered(there))
        assert not axis[[k for k in range(total) if k not in old], 3].any()


@given(seed=st.integers(0, 2**32 - 1), moved=st.integers(0, 24))
def test_two_threads_look_around_every_shape_that_moved_and_share_them(seed, moved):
    rng = np.random.default_rng(seed)
    n = 24
    scene = Scene([BALL, CUBE] * (n // 2), [(rng.normal(0, 3.0, 3), UPRIGHT) for _ in range(n)])
    scene.detect()
    memory = scene.memory
    memory.pair_count[0] = 0
    memory.grid.moved[:] = 0
    memory.grid.moved[rng.permutation(n)[:moved]] = 1
    memory.left[0, 0], memory.left[:, 1] = moved, (moved, 0)
    note_moved(scene.shapes, memory)
    assert memory.counters[REBUILT] == moved
    found = []
    for thread in rng.permutation(2):
        # Of what the other one counts with nothing is touched.
        tally = (memory.other_tally, memory.grid.tally)[thread]
        tally[:] = -1
        look_for_share(scene.model, scene.shapes, memory, thread)
        assert (tally == -1).all()
        assert memory.looked[thread] >= 0   # there was room
        found += memory.fresh[2 * thread, :memory.looked[thread]].tolist()
    assert update_alone(scene.model, scene.shapes, memory)
    assert sorted(found) == memory.pair[:memory.pair_count[0]].tolist()
    assert all(memory.grid.moved[p].any() for p in found)
