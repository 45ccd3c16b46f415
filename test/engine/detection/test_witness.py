# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Witnesses settle pairs that are apart, and change nothing."""

from effort import examples
from engine.detecting import CONVEX, grid, Scene, UPRIGHT
from hypothesis import given, strategies as st
import numpy as np

from rigid_sim_ros.engine.detection.manifolds import lasting, PAIRS, WITNESSED
from rigid_sim_ros.engine.model.kinds.table import BOX

CUBE = (BOX, (0.5, 0.5, 0.5), None)


def test_a_pair_that_stays_apart_is_settled_by_its_witness():
    # Turned by 45 deg the bounding boxes overlap, though the cubes do not.
    q = (0.0, 0.0, np.sin(np.pi / 8), np.cos(np.pi / 8))
    scene = Scene([CUBE, CUBE], [((0, 0, 0), q), ((0.9, 0.9, 0), q)])
    scene.detect()
    assert scene.memory.counters[[PAIRS, WITNESSED]].tolist() == [1, 0]
    scene.state.x[0, 1] += 1e-3
    scene.detect()
    assert scene.memory.counters[[PAIRS, WITNESSED]].tolist() == [1, 1]


def test_a_witness_lets_go_when_the_shapes_meet():
    q = (0.0, 0.0, np.sin(np.pi / 8), np.cos(np.pi / 8))
    scene = Scene([CUBE, CUBE], [((0, 0, 0), q), ((0.9, 0.9, 0), UPRIGHT)])
    scene.detect()
    scene.put(1, (0.7, 0.7, 0.0), q)
    assert scene.detect().count[0] == 1


@examples(10)
@given(seed=st.integers(0, 2**32 - 1))
def test_manifolds_are_the_same_with_and_without_witnesses(seed):
    rng = np.random.default_rng(seed)
    kinds = [list(CONVEX.values())[k % len(CONVEX)] for k in range(27)]
    scene = Scene(kinds, grid(kinds, 0.75, rng, tilt=0.7))
    forgetful = Scene(kinds, [(scene.state.x[:, i], scene.state.q[:, i]) for i in range(27)])
    forgetful.state.q[:] = scene.state.q
    settled = 0
    for _ in range(10):
        scene.detect()
        forgetful.memory.axis[:] = 0.0
        forgetful.detect()
        settled += scene.memory.counters[WITNESSED]
        fields = zip(lasting(scene.memory), lasting(forgetful.memory), strict=True)
        assert all(np.array_equal(with_one, without) for with_one, without in fields)
        scene.state.x[:] += 0.01 * rng.normal(size=scene.state.x.shape)
        forgetful.state.x[:] = scene.state.x
    assert settled > 0
