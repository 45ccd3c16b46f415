# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Detection in the stages of two threads finds what detection by one finds."""

from effort import examples
from engine.detecting import CONVEX, Scene, twins
from engine.step_arguments import pack_of
from hypothesis import given, strategies as st
import numpy as np

from rigid_sim_ros.engine.detection.detect import (
    ALL, detect_part, FIND_FIRST, FIND_SECOND, LOOK_FIRST, LOOK_SECOND, NOTE, ROWS, TAKE, WHOLE)
from rigid_sim_ros.engine.detection.manifolds import grown, lasting, PAIRS, RECYCLED, WITNESSED
from rigid_sim_ros.engine.solver.parallel_detection import (
    _effort, _fair_split, FIT, JOIN, PLACE_FIRST, PLACE_SECOND, REFRESH_FIRST, REFRESH_SECOND,
    SHARE_OUT, share_part)


def detect_in_stages(scene: Scene, by_number: bool) -> None:
    """Do what `detect_alone` does, stage by stage, the second half of each one first."""
    while True:
        pack = pack_of(scene, by_number)

        def detect(*stages, pack=pack):
            return all(pack.run(detect_part, stage) for stage in stages)

        def share(*stages, pack=pack):
            return all(pack.run(share_part, stage) for stage in stages)

        share(PLACE_SECOND, PLACE_FIRST, REFRESH_SECOND, REFRESH_FIRST)
        if (detect(NOTE, LOOK_SECOND, LOOK_FIRST, TAKE) and share(SHARE_OUT)
                and detect(FIND_SECOND, FIND_FIRST)
                and (share(JOIN) if share(FIT) else detect(ALL))):
            return
        scene.memory = grown(scene.memory)


def detect_alone(scene: Scene, other: Scene) -> None:
    """Detect by one thread, within the margins of another scene."""
    while True:
        scene.memory.margin[:] = other.memory.margin
        scene.memory.rest_margin[:] = other.memory.rest_margin
        if pack_of(scene, by_number=False).run(detect_part, WHOLE):
            return
        scene.memory = grown(scene.memory)


@examples(25)
@given(kinds=st.lists(st.sampled_from(sorted(CONVEX)), min_size=1, max_size=3),
       count=st.integers(0, 60), spacing=st.floats(0.45, 0.8), seed=st.integers(0, 2 ** 32 - 1),
       by_number=st.booleans())
def test_stages_find_the_same_manifolds_as_one_thread(kinds, count, spacing, seed, by_number):
    rng = np.random.default_rng(seed)
    one, other = twins(kinds, count, spacing, rng)
    for step in range(6):
        detect_in_stages(other, by_number)
        detect_alone(one, other)
        for a, b in zip(lasting(one.memory), lasting(other.memory), strict=True):
            assert a.tobytes() == b.tobytes()
        assert np.array_equal(one.memory.counters[[0, 3]], other.memory.counters[[0, 3]])
        # Who touches something is the same, whichever thread found it.
        assert np.array_equal(one.memory.touching.any(axis=0), other.memory.touching.any(axis=0))
        # From nearly at rest to a jump, which takes all pairs apart.
        move = 10.0 ** (step - 5) * rng.normal(size=(3, count))
        for scene in (one, other):
            scene.state.x[:, :count] += move


def found(pairs, witnessed, recycled, rows):
    counts = np.zeros(8, dtype=np.int64)
    counts[[PAIRS, WITNESSED, RECYCLED, ROWS]] = pairs, witnessed, recycled, rows
    return counts


@given(pairs=st.lists(st.integers(0, 10_000), min_size=2, max_size=2),
       parts=st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6))
def test_the_split_parts_the_effort_where_the_rows_of_a_half_take_the_same(pairs, parts):
    halves = [found(n, int(n * w * r), int(n * (1.0 - w) * r), int(n * rows))
              for n, (w, r, rows) in zip(pairs, (parts[:3], parts[3:]), strict=True)]
    split, (first, second) = _fair_split(*halves), (half[ROWS] for half in halves)
    assert 0 <= split <= first + second
    effort = [_effort(half) for half in halves]
    # Effort up to the split, were it spread evenly in each half; a row more or less is rounding.
    before = (effort[0] * split / first if split < first else
              effort[0] + (effort[1] * (split - first) / second if second else 0))
    if first and second:
        a_row = max(effort[0] / first, effort[1] / second)
        assert abs(before - sum(effort) / 2) <= a_row + 1
