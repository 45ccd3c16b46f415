# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Detection in the stages of two threads finds what detection by one finds."""

from engine.detecting import CONVEX, grid, PLANE_SHAPE, Scene
from hypothesis import given, settings, strategies as st
import numpy as np

from rigid_sim_ros.engine.manifolds import grown, lasting
from rigid_sim_ros.engine.shared_detection import (
    detect_stage, FIND, JOIN, MOVE, PAIRS, PLACE)
from rigid_sim_ros.engine.timestep import _cut


def detect_in_stages(scene: Scene) -> None:
    """Do what `Scene.detect` does, stage by stage, the second half of each one first."""
    cut = _cut(len(scene.model.m), scene.shapes.body)
    while True:
        memory = scene.memory
        memory.ahead[:], memory.calm[0] = 0.5 * scene.margin, scene.margin
        done = True
        for stage in (PLACE + 1, PLACE, PAIRS, FIND + 1, FIND, MOVE + 1, MOVE, JOIN):
            done = done and detect_stage(stage, scene.model, scene.state, scene.shapes, memory,
                                         cut)
        if done:
            return
        scene.memory = grown(memory)


@settings(max_examples=25)
@given(kinds=st.lists(st.sampled_from(sorted(CONVEX)), min_size=1, max_size=3),
       count=st.integers(0, 60), spacing=st.floats(0.45, 0.8), seed=st.integers(0, 2 ** 32 - 1))
def test_stages_find_the_same_manifolds_as_one_thread(kinds, count, spacing, seed):
    rng = np.random.default_rng(seed)
    shapes = [CONVEX[kinds[k % len(kinds)]] for k in range(count)]
    poses = grid(shapes, spacing, rng, tilt=0.2)
    one, other = (Scene([*shapes, PLANE_SHAPE], [*poses, ((0, 0, 0), (0, 0, 0, 1))],
                        fixed=[count]) for _ in range(2))
    for step in range(6):
        one.detect()
        detect_in_stages(other)
        for a, b in zip(lasting(one.memory), lasting(other.memory), strict=True):
            assert a.tobytes() == b.tobytes()
        assert np.array_equal(one.memory.counters[[0, 3]], other.memory.counters[[0, 3]])
        # From nearly at rest to a jump, which takes all pairs apart.
        move = 10.0 ** (step - 5) * rng.normal(size=(3, count))
        for scene in (one, other):
            scene.state.x[:, :count] += move
