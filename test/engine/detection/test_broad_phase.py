# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The broad phase finds what brute force finds, however shapes move, and applies the filters."""

from effort import examples
from engine.detecting import PLANE_SHAPE, Scene, UPRIGHT
from hypothesis import given, strategies as st
import numpy as np

from rigid_sim_ros.engine.detection.broad_phase import near_pairs
from rigid_sim_ros.engine.detection.manifolds import PAIRS, PAIRS_LISTED, REBUILT
from rigid_sim_ros.engine.model.kinds.table import BOX, SPHERE

BALL = (SPHERE, (0.5, 0.0, 0.0), None)
TOUCHING = [((0, 0, 0), UPRIGHT), ((0.9, 0, 0), UPRIGHT)]


def overlap(kind, box, a, b):
    """Return whether two bounding boxes overlap, and of spheres the balls in them."""
    if (box[a, :3] > box[b, 3:]).any() or (box[b, :3] > box[a, 3:]).any():
        return False
    if kind[a] != SPHERE or kind[b] != SPHERE:
        return True
    middle, reach = 0.5 * (box[:, :3] + box[:, 3:]), 0.5 * (box[:, 3] - box[:, 0])
    return np.linalg.norm(middle[b] - middle[a]) <= reach[a] + reach[b]


def brute_force(scene):
    """Return all pairs whose bounding boxes overlap, in order; fixed bodies make none."""
    kind, box, still = scene.shapes.kind, scene.memory.box, scene.shapes.still
    return [(a, b) for a in range(len(box)) for b in range(a + 1, len(box))
            if not (still[a] and still[b]) and overlap(kind, box, a, b)]


def pairs_with_overlapping_boxes(scene):
    listed = scene.memory.pair[:scene.memory.pair_count[0]].tolist()
    assert listed == sorted(listed)
    return [(a, b) for a, b in listed if overlap(scene.shapes.kind, scene.memory.box, a, b)]


@given(seed=st.integers(0, 2**32 - 1), first=st.integers(0, 90), count=st.integers(0, 60))
def test_near_pairs_are_those_whose_boxes_overlap(seed, first, count):
    rng = np.random.default_rng(seed)
    # On a coarse grid, so that boxes also touch without overlapping further.
    low = rng.integers(0, 6, (20, 3))
    box = np.hstack((low, low + rng.integers(0, 4, (20, 3)))).astype(float)
    kind = np.where(rng.random(20) < 0.5, SPHERE, BOX)
    # Of spheres cubes: some of 3, 4, 5 touch.
    box[kind == SPHERE, 3:] = box[kind == SPHERE, :3] + rng.integers(0, 6, (20, 1))[kind == SPHERE]
    pair = rng.integers(0, 20, (150, 2)).astype(np.int32)
    near = np.full(count + 1, -7)
    found = near_pairs(kind, pair, box, first, first + count, near)
    expected = [k for k in range(first, first + count) if overlap(kind, box, *pair[k])]
    assert near[:found].tolist() == expected
    assert near[-1] == -7


@examples(25)
@given(seed=st.integers(0, 2**32 - 1), spread=st.floats(0.0, 3.0), octaves=st.floats(0.0, 6.0))
def test_pairs_are_those_of_brute_force_while_everything_moves(seed, spread, octaves):
    rng = np.random.default_rng(seed)
    n = 60
    sizes = 0.1 * 2.0 ** rng.uniform(-octaves / 2, octaves / 2, n)
    shapes = [(BOX, (s, s, 2 * s), None) if k % 2 else (SPHERE, (s, 0.0, 0.0), None)
              for k, s in enumerate(sizes)]
    scene = Scene(shapes, [(rng.normal(0, spread, 3), rng.normal(size=4)) for _ in range(n)],
                  fixed=range(0, n, 7))
    for _ in range(8):
        scene.detect()
        assert pairs_with_overlapping_boxes(scene) == brute_force(scene)
        scene.state.x[:] += rng.normal(0, 0.1, (3, n)) * (rng.random(n) < 0.5)


def test_a_crowd_in_one_cell_is_gone_through_piece_by_piece():
    rng = np.random.default_rng(5)
    n = 2 * PAIRS_LISTED + 7
    scene = Scene([BALL] * n, [(rng.normal(0, 0.3, 3), UPRIGHT) for _ in range(n)])
    for _ in range(3):
        scene.detect()
        assert pairs_with_overlapping_boxes(scene) == brute_force(scene)
        scene.state.x[:, ::3] += rng.normal(0, 0.5, (3, len(scene.state.x[0, ::3])))


def test_pairs_that_have_parted_are_forgotten_in_the_end():
    n = 40
    scene = Scene([BALL] * n, [((0.9 * k, 0, 0), UPRIGHT) for k in range(n)])
    scene.detect()
    assert scene.memory.pair_count[0] >= n - 1
    # Away from each other, and one of them to and fro: fat boxes are made anew, and nothing else.
    scene.state.x[0] *= 10.0
    for _ in range(3):
        scene.state.x[2, 0] += 5.0
        scene.detect()
    assert scene.memory.pair_count[0] == 0


def test_spheres_that_only_the_corners_of_their_boxes_share_are_no_pair_for_long():
    # Two on a diagonal, 1.5 m from middle to middle, with 0.1 m of room to each side; and a pair.
    across = 1.5 / np.sqrt(3)
    scene = Scene([BALL] * 4, [((0, 0, 0), UPRIGHT), ((across, across, across), UPRIGHT),
                               ((9, 0, 0), UPRIGHT), ((9.9, 0, 0), UPRIGHT)])
    scene.detect()
    assert scene.memory.counters[PAIRS] == 1
    for _ in range(70):
        scene.detect()
    assert scene.memory.pair[:scene.memory.pair_count[0]].tolist() == [[2, 3]]
    # Out of its fat box, towards the other.
    scene.state.x[:, 1] -= 0.3
    scene.detect()
    assert scene.memory.counters[PAIRS] == 2


def test_the_pairs_tested_are_those_of_overlapping_boxes_not_of_fat_ones():
    scene = Scene([BALL, BALL], [((0, 0, 0), UPRIGHT), ((1.03, 0, 0), UPRIGHT)])
    scene.detect()
    assert scene.memory.pair_count[0] == 1
    assert scene.memory.counters[PAIRS] == 0


def test_shapes_within_their_fat_boxes_are_left_alone():
    scene = Scene([BALL, BALL], TOUCHING)
    scene.detect()
    scene.state.x[0] += 1e-3
    scene.detect()
    assert scene.memory.counters[REBUILT] == 0


def test_a_plane_pairs_with_what_is_near_or_below_it_only():
    scene = Scene([PLANE_SHAPE, BALL, BALL, BALL],
                  [((0, 0, 0), UPRIGHT), ((0, 0, 0.5), UPRIGHT), ((5, 0, 3), UPRIGHT),
                   ((9, 0, -2), UPRIGHT)], fixed=[0])
    scene.detect()
    assert scene.memory.pair[:scene.memory.pair_count[0]].tolist() == [[0, 1], [0, 3]]


def test_a_plane_that_is_moved_finds_its_new_partners():
    scene = Scene([PLANE_SHAPE, BALL], [((0, 0, 0), UPRIGHT), ((0, 0, 3), UPRIGHT)], fixed=[0])
    assert scene.detect().count[0] == 0
    scene.put(0, (0, 0, 2.5))
    assert scene.detect().count[0] == 1


def test_a_huge_box_meets_small_ones_wherever_they_are():
    small = (BOX, (1e-3, 1e-3, 1e-3), None)
    scene = Scene([(BOX, (1e4, 1e4, 1.0), None), small, small],
                  [((0, 0, -1), UPRIGHT), ((9e3, 9e3, 1e-3), UPRIGHT), ((-5, 7, 0.0), UPRIGHT)])
    assert [row['pair'] for row in scene.rows()] == [(0, 1), (0, 2)]


def test_fixed_bodies_make_no_pair():
    assert Scene([BALL, BALL], TOUCHING, fixed=[0, 1]).detect().count[0] == 0


def test_groups_and_masks_must_agree_on_both_sides():
    def touch(group, mask):
        return Scene([BALL, BALL], TOUCHING, group=group, mask=mask).detect().count[0] == 1

    assert touch((1, 2), (2, 1))
    assert not touch((1, 2), (2, 2))
    assert not touch((1, 2), (1, 1))


def test_a_mask_of_0_opts_out():
    assert Scene([BALL, BALL], TOUCHING, mask=(0, -1)).detect().count[0] == 0


def test_an_ignored_pair_of_bodies_never_collides_and_others_do():
    third = [*TOUCHING, ((0, 0.9, 0), UPRIGHT)]
    scene = Scene([BALL] * 3, third, ignored=[(1, 0)])
    assert [row['pair'] for row in scene.rows()] == [(0, 2)]
