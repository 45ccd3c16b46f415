# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Detection from step to step: what is carried over, and what must not matter."""

from effort import examples
from engine.detecting import CONVEX, grid, PLANE_SHAPE, Scene, UPRIGHT
from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros.engine.detection.manifolds import (
    CONTACTS, empty_memory, forget_pairs, lasting, RECYCLED, with_lasting)
from rigid_sim_ros.engine.model.hulls import Polyhedron
from rigid_sim_ros.engine.model.kinds.table import BOX, HULL

CUBE = (BOX, (0.5, 0.5, 0.5), None)


def on_a_plane(z=0.5 - 1e-4, q=UPRIGHT):
    return Scene([PLANE_SHAPE, CUBE], [((0, 0, 0), UPRIGHT), ((0, 0, z), q)], fixed=[0])


def mixed(seed, n=27, spacing=0.7):
    rng = np.random.default_rng(seed)
    kinds = [PLANE_SHAPE, *(list(CONVEX.values())[k % len(CONVEX)] for k in range(n))]
    poses = [((0, 0, 0), UPRIGHT), *grid(kinds[1:], spacing, rng, tilt=0.5)]
    return Scene(kinds, poses, fixed=[0]), rng


def move(scene, rng, length):
    scene.state.x[:, 1:] += length * rng.normal(size=scene.state.x[:, 1:].shape)
    scene.state.q[:, 1:] += length * rng.normal(size=scene.state.q[:, 1:].shape)
    scene.state.q[:] /= np.linalg.norm(scene.state.q, axis=0)


def same(first, second):
    return all(np.array_equal(a, b) for a, b in zip(lasting(first), lasting(second), strict=True))


def test_impulses_are_carried_over_to_the_same_features():
    scene = on_a_plane()
    manifolds = scene.detect()
    manifolds.impulse[:, 0] = [1.0, 2.0, 3.0, 4.0]
    manifolds.friction[0], manifolds.spin[0] = (5.0, 6.0, 7.0), 8.0
    before = dict(zip(manifolds.feature[:, 0].tolist(), manifolds.impulse[:, 0].tolist(),
                      strict=True))
    # Tilted by 0.1 rad about y the corners of one side leave the margin.
    scene.put(1, (0, 0, 0.545), (0, np.sin(0.05), 0, np.cos(0.05)))
    after = scene.detect()
    assert after.points[0] == 2
    assert {k: before[k] for k in after.feature[:2, 0].tolist()} == dict(
        zip(after.feature[:2, 0].tolist(), after.impulse[:2, 0].tolist(), strict=True))
    assert after.friction[0].tolist() == [5.0, 6.0, 7.0]
    assert after.spin[0] == 8.0


def test_a_new_manifold_starts_without_impulses():
    scene = on_a_plane()
    scene.detect().impulse[:, 0] = 1.0
    scene.put(1, (0, 0, 2))
    assert scene.detect().count[0] == 0
    scene.put(1, (0, 0, 0.5))
    assert scene.detect().impulse[:, 0].tolist() == [0.0] * 4


def test_manifolds_are_in_the_order_of_their_shapes():
    scene, _ = mixed(0)
    pairs = [row['pair'] for row in scene.rows()]
    assert len(pairs) > 20
    assert pairs == sorted(pairs)


def test_a_body_of_several_shapes_has_a_manifold_for_each():
    poses = [((0, 0, 0), UPRIGHT), ((0, 0, 0.5), UPRIGHT), ((0.3, 0, 0.5), UPRIGHT)]
    scene = Scene([PLANE_SHAPE, CUBE, CUBE], poses, fixed=[0])
    # The third shape now belongs to body 1: no pair with its sibling, one with the plane.
    scene.shapes.body[2] = 1
    assert [row['pair'] for row in scene.rows()] == [(0, 1), (0, 2)]


@examples(10)
@given(seed=st.integers(0, 2**32 - 1), length=st.sampled_from([1e-5, 1e-3, 3e-2]))
def test_forgetting_the_fat_boxes_and_pairs_changes_nothing(seed, length):
    scene, rng = mixed(seed)
    other, _ = mixed(seed)
    for _ in range(8):
        scene.detect()
        forget_pairs(other.memory)
        other.detect()
        assert same(scene.memory, other.memory)
        move(scene, rng, length)
        other.state.x[:], other.state.q[:] = scene.state.x, scene.state.q


def test_a_restored_memory_runs_on_the_same():
    scene, rng = mixed(4)
    other, _ = mixed(4)
    for _ in range(3):
        scene.detect().impulse[:] += 0.125
        move(scene, rng, 1e-5)
    other.memory = with_lasting(empty_memory(28, 28, 1), lasting(scene.memory))
    for _ in range(3):
        other.state.x[:], other.state.q[:] = scene.state.x, scene.state.q
        scene.detect()
        other.detect()
        assert same(scene.memory, other.memory)
        move(scene, rng, 1e-5)


def test_manifolds_of_another_layout_are_refused():
    scene = on_a_plane()
    scene.detect()
    arrays = lasting(scene.memory)
    gap = scene.memory.pages[0]._fields.index('gap')
    arrays[gap] = arrays[gap].reshape(1, 4)
    with pytest.raises(ValueError, match=r'gap of shape \(1, 4\), must be \(4,\): .*version'):
        with_lasting(empty_memory(2, 2), arrays)


def test_short_buffers_grow_and_lose_nothing():
    scene, _ = mixed(1)
    roomy, _ = mixed(1)
    roomy.memory = empty_memory(28, 28, 4096)
    scene.detect()
    roomy.detect()
    assert scene.memory.pages[0].shape_a.shape[0] < 4096
    assert same(scene.memory, roomy.memory)


def test_impulses_survive_that_buffers_grow():
    ground = ((0, 0, 0), UPRIGHT)
    scene = Scene([PLANE_SHAPE, *[CUBE] * 8],
                  [ground, *[((2 * k, 0, 0.5 if k < 2 else 9), UPRIGHT) for k in range(8)]],
                  fixed=[0])
    first = scene.detect()
    first.impulse[:, :2], first.friction[:2] = [[1, 5], [2, 6], [3, 7], [4, 8]], [[9], [10]]
    room = len(first.shape_a)
    for k in range(2, 8):
        scene.put(1 + k, (2 * k, 0, 0.5))
    after = scene.detect()
    assert len(after.shape_a) > room
    assert after.impulse[:, :3].tolist() == [[1, 5, 0], [2, 6, 0], [3, 7, 0], [4, 8, 0]]
    assert after.friction[:3].tolist() == [[9] * 3, [10] * 3, [0] * 3]


def test_balls_leave_untouched_what_only_others_need():
    rng = np.random.default_rng(6)
    balls = [CONVEX['sphere']] * 40
    scene = Scene([PLANE_SHAPE, *balls], [((0, 0, 0), UPRIGHT), *grid(balls, 0.55, rng)],
                  fixed=[0])
    for _ in range(4):
        assert scene.detect().count[0] > 40
        move(scene, rng, 2e-2)
    for page in scene.memory.pages:
        rest = (page.r_A[1:], page.gap[1:], page.feature, page.impulse[1:], page.spin,
                page.found_at, page.normal_A, page.p_A_C, page.p_B_C, scene.memory.axis)
        assert not any(field.any() for field in rest)


def test_a_box_at_rest_keeps_its_points_and_updates_their_gaps():
    scene = Scene([CUBE, CUBE], [((0, 0, 0), UPRIGHT), ((0, 0, 1 - 1e-4), UPRIGHT)], fixed=[0])
    scene.detect()
    scene.put(1, (1e-6, 0, 1 - 1.05e-4))
    (row,) = scene.rows()
    assert scene.memory.counters[RECYCLED] == 1
    assert row['gap'] == pytest.approx(-1.05e-4, abs=1e-15)


@examples(30)
@given(angle=st.floats(0, 1e-4), direction=st.integers(0, 2**32 - 1))
def test_gaps_of_kept_points_are_exact_to_second_order(angle, direction):
    axis = np.random.default_rng(direction).normal(size=3)
    axis *= np.sin(angle / 2) / np.linalg.norm(axis)
    scene = Scene([CUBE, CUBE], [((0, 0, 0), UPRIGHT), ((0.1, 0.2, 0.999), UPRIGHT)])
    scene.detect()
    turned = (*axis, np.cos(angle / 2))
    scene.put(1, (0.1, 0.2, 0.999), turned)
    kept = _by_feature(scene.rows()[0])
    assert scene.memory.counters[RECYCLED] == 1
    fresh = Scene([CUBE, CUBE], [((0, 0, 0), UPRIGHT), ((0.1, 0.2, 0.999), turned)])
    # A corner 0.9 m from the middle, turned by 1e-4 rad; the face may tilt with A or with B.
    assert kept == pytest.approx(_by_feature(fresh.rows()[0]), abs=2 * angle ** 2 + 1e-15)


def _by_feature(row):
    """Return the gaps of a manifold: which face is clipped decides in which order they come."""
    return row['gap'][np.argsort(row['feature'])]


def test_the_counters_say_how_many_points_there_are():
    scene = on_a_plane()
    scene.detect()
    assert scene.memory.counters[CONTACTS] == 4


def disk(corners, radius=0.5, height=0.1):
    """Return a disk of many corners as a mesh about z."""
    angle = 2 * np.pi * np.arange(corners) / corners
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices = np.vstack([np.insert(ring, 2, z, axis=1) for z in (-0.5 * height, 0.5 * height)])
    k = np.arange(corners)
    after = (k + 1) % corners
    sides = np.concatenate([np.stack([k, after, corners + after], axis=1),
                            np.stack([k, corners + after, corners + k], axis=1)])
    fan = np.stack([0 * k[1:-1], k[2:], k[1:-1]], axis=1)
    return Polyhedron(vertices, np.concatenate([sides, fan, corners + fan[:, ::-1]]))


@pytest.mark.parametrize('tilt', [0.0, 1e-3])
@pytest.mark.parametrize('corners', [64, 128, 300])
def test_of_more_corners_on_a_plane_than_there_is_room_for_all_sides_are_met(corners, tilt):
    # Tilted about x by so little that all corners are within the margin: the lowest is at -y.
    q = (np.sin(0.5 * tilt), 0.0, 0.0, np.cos(0.5 * tilt))
    scene = Scene([PLANE_SHAPE, (HULL, (0.0, 0.0, 0.0), disk(corners))],
                  [((0.0, 0.0, 0.0), UPRIGHT), ((0.0, 0.0, 0.05), q)], fixed=[0])
    row, = scene.rows()
    angles = np.sort(np.arctan2(row['r_B'][:, 1], row['r_B'][:, 0]))
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    # They stand around the middle: at right angles where all lie as low, and where the lowest is
    # preferred the next one is the farthest from it.
    assert np.degrees(gaps.max()) < 150
    # The lowest is among them, to the part of the size from which it matters.
    lowest = 0.05 - (0.5 * np.sin(tilt) + 0.05 * np.cos(tilt))
    assert row['gap'].min() < lowest + 1e-6
