# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Detection does not depend on the order of shapes or on where the scene lies; filters hold."""

from itertools import combinations, combinations_with_replacement

from effort import examples
from engine.detecting import CONVEX, grid, PLANE_SHAPE, random_pose, Scene, UPRIGHT
from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.maths.rotation import multiply, rotate

SEEDS = st.integers(0, 2 ** 32 - 1)
PAIRS = list(combinations_with_replacement(CONVEX, 2))
BALL = CONVEX['sphere']
# Shapes are as large as 1 m, poses as far as 10 m: rounding of 1e-15 m. GJK ends when it gains
# less than 1e-10 of the size of a cylinder.
ROUNDING, SEARCH = 1e-12, 1e-9


def motion(rng):
    """Return a random rigid motion of poses."""
    shift, turn = rng.uniform(-5.0, 5.0, 3), rng.normal(size=4)
    turn = tuple((turn / np.linalg.norm(turn)).tolist())

    def moved(position, orientation):
        q = np.asarray(orientation, dtype=np.float64)
        q = tuple((q / np.linalg.norm(q)).tolist())
        return (np.array(rotate(turn, tuple(map(float, position)))) + shift,
                np.array(multiply(turn, q)))
    return moved, turn


def tolerance(names):
    return SEARCH if set(names) & {'cylinder', 'cone', 'ellipsoid'} else ROUNDING


def rows_by_pair(scene):
    return {row['pair']: row for row in scene.rows()}


@examples(150)
@given(names=st.sampled_from(PAIRS), seed=SEEDS)
def test_exchanged_shapes_have_the_opposite_normal_and_the_same_depth(names, seed):
    rng = np.random.default_rng(seed)
    kinds = [CONVEX[name] for name in names]
    poses = [((0, 0, 0), rng.normal(size=4)), random_pose(rng, 0.8)]
    scene = Scene(kinds, poses, margin=0.05)
    gap = scene.distance(0, 1)[0]
    one, other = scene.rows(), Scene(kinds[::-1], poses[::-1], margin=0.05).rows()
    if abs(gap - 0.05) < 1e-3:
        return
    assert len(one) == len(other)
    if not one:
        return
    # Of two faces that part the boxes almost equally well either order takes the one of its A:
    # they differ by 2e-3 of 0.2 m, as a rim that is cut into corners differs by 1e-3 of the size.
    depth = other[0]['gap'].min()
    assert one[0]['gap'].min() == pytest.approx(depth, abs=1e-3)
    if gap > -0.1:
        assert np.dot(one[0]['normal'], other[0]['normal']) < 0.0
    if gap > 0.0:
        return
    # Deep in each other they may be parted equally well to opposite sides. That the second is
    # pushed out of the first, along the other order's normal, holds for any of them.
    position, orientation = poses[1]
    parted = Scene(kinds, [poses[0], (position + depth * other[0]['normal'], orientation)])
    assert parted.distance(0, 1)[0] > -1e-3


@examples(150)
@given(names=st.sampled_from(PAIRS), seed=SEEDS)
def test_a_manifold_moves_with_its_shapes(names, seed):
    rng = np.random.default_rng(seed)
    kinds = [CONVEX[name] for name in names]
    poses = [((0, 0, 0), rng.normal(size=4)), random_pose(rng, 0.8)]
    moved, turn = motion(rng)
    here = Scene(kinds, poses).rows()
    there = Scene(kinds, [moved(*pose) for pose in poses]).rows()
    assert len(here) == len(there)
    for row, twin in zip(here, there, strict=True):
        # A search that stops 1e-10 short in the distance, a minimum, stops sqrt(1e-10) short in
        # the direction, and points at 1 m with it.
        near = np.sqrt(tolerance(names))
        assert np.array(rotate(turn, tuple(row['normal']))) == pytest.approx(
            twin['normal'], abs=near)
        assert row['gap'].min() == pytest.approx(twin['gap'].min(), abs=near)


@examples(40)
@given(seed=SEEDS)
def test_a_heap_on_a_plane_has_the_same_contacts_wherever_it_lies(seed):
    rng = np.random.default_rng(seed)
    # Without cylinders, so that everything is exact.
    kinds = [CONVEX[name] for name in ('sphere', 'box', 'capsule')] * 6
    poses = grid(kinds, 0.7, rng, tilt=0.5)
    moved, _ = motion(rng)
    plane = ((0, 0, 0), UPRIGHT)
    here = rows_by_pair(Scene([PLANE_SHAPE, *kinds], [plane, *poses], fixed=[0]))
    there = rows_by_pair(Scene([PLANE_SHAPE, *kinds], [moved(*pose) for pose in (plane, *poses)],
                               fixed=[0]))
    # A pair may be as near as the margin but for rounding; then it has one point with that gap.
    both = here.keys() & there.keys()
    for rows in (here, there):
        for pair in rows.keys() - both:
            assert rows[pair]['gap'] == pytest.approx(0.02, abs=ROUNDING)
    for pair in both:
        assert here[pair]['gap'].min() == pytest.approx(there[pair]['gap'].min(), abs=ROUNDING)


@examples(100)
@given(data=st.data(), n=st.integers(2, 6))
def test_two_shapes_meet_when_each_mask_has_a_group_of_the_other(data, n):
    bits = st.lists(st.integers(0, 7), min_size=n, max_size=n)
    group, mask = data.draw(bits, 'groups'), data.draw(bits, 'masks')
    fixed = data.draw(st.sets(st.integers(0, n - 1)), 'fixed')
    pairs = list(combinations(range(n), 2))
    ignored = data.draw(st.lists(st.sampled_from(pairs)), 'ignored')
    # All in one place: every pair overlaps.
    scene = Scene([BALL] * n, [((0.01 * i, 0, 0), UPRIGHT) for i in range(n)], fixed=fixed,
                  ignored=[(b, a) for a, b in ignored], group=group, mask=mask)
    expected = [(a, b) for a, b in pairs
                if mask[a] & group[b] and mask[b] & group[a] and not {a, b} <= fixed
                and (a, b) not in ignored]
    assert [row['pair'] for row in scene.rows()] == expected


@examples(60)
@given(data=st.data(), n=st.integers(2, 5))
def test_the_filters_of_a_scene_let_those_meet_that_they_name(data, n):
    names = st.sets(st.sampled_from(['red', 'green', 'blue']), min_size=1)
    groups = [data.draw(names, 'groups') for _ in range(n)]
    partners = [data.draw(st.none() | names.map(sorted), 'collides_with') for _ in range(n)]
    collides = [data.draw(st.booleans(), 'collides') for _ in range(n)]
    known = set().union(*groups)
    # The groups that exist; all of them where that leaves none.
    partners = [[name for name in p or () if name in known] or None for p in partners]
    bodies = [{'name': f'b{i}', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.5},
               'pose': {'position': [0.4 * i, 0, 0]}, 'groups': sorted(groups[i]),
               'collides': collides[i],
               **({} if partners[i] is None else {'collides_with': partners[i]})}
              for i in range(n)]
    world = World.from_dict({'format': 1, 'bodies': bodies})
    world.step()
    rows = world.contacts()
    found = sorted(set(zip(rows['body_a'].tolist(), rows['body_b'].tolist(), strict=True)))

    def wants(i, j):
        return partners[i] is None or bool(set(partners[i]) & groups[j])

    # Balls of 0.5 m, 0.4 m apart, touch the next and the next but one.
    assert found == [(a, b) for a, b in combinations(range(n), 2) if b - a <= 2
                     and collides[a] and collides[b] and wants(a, b) and wants(b, a)]
