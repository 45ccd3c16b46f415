# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is thrown is found again as if all had been found with its margins from the start."""

from effort import examples
from engine.detecting import CONVEX, Scene, twins
from engine.step_arguments import MARGIN, pack_of
from hypothesis import given, strategies as st
import numpy as np

from rigid_sim_ros.engine.detection.detect import detect_part, SEAMS, THROWN, WHOLE
from rigid_sim_ros.engine.detection.manifolds import CONTACTS, grown, lasting


def detect(scene: Scene, margins, thrown=None) -> None:
    """Detect; where some are `thrown` all at rest first, then these with their margins."""
    while True:
        pack = pack_of(scene, by_number=False)
        scene.memory.rest_margin[:] = MARGIN
        scene.memory.margin[:] = margins if thrown is None else MARGIN
        done = pack.run(detect_part, WHOLE)
        if done and thrown is not None:
            scene.memory.margin[:] = margins
            pack.arguments.work.thrown[:] = thrown
            done = pack.run(detect_part, THROWN)
        if done and pack.run(detect_part, SEAMS):
            return
        scene.memory = grown(scene.memory)


@examples(25)
@given(kinds=st.lists(st.sampled_from(sorted(CONVEX)), min_size=1, max_size=3),
       count=st.integers(1, 60), spacing=st.floats(0.45, 0.8), part=st.floats(0.0, 1.0),
       seed=st.integers(0, 2 ** 32 - 1))
def test_the_manifolds_are_those_of_one_search_with_the_wider_margins(kinds, count, spacing, part,
                                                                      seed):
    rng = np.random.default_rng(seed)
    again, once = twins(kinds, count, spacing, rng)
    for step in range(4):
        thrown = np.append(rng.uniform(size=count) < part, False)
        margins = MARGIN + thrown * rng.uniform(0.05, 0.3, size=count + 1)
        detect(again, margins, thrown)
        detect(once, margins)
        for a, b in zip(lasting(again.memory), lasting(once.memory), strict=True):
            assert a.tobytes() == b.tobytes()
        assert np.array_equal(again.memory.counters[CONTACTS],
                              once.memory.counters[CONTACTS])
        assert np.array_equal(again.memory.touching.any(axis=0), once.memory.touching.any(axis=0))
        move = 10.0 ** (step - 4) * rng.normal(size=(3, count))
        for scene in (again, once):
            scene.state.x[:, :count] += move
