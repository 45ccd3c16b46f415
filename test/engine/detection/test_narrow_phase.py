# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Signed distances against an independent search, and manifolds of shapes at rest."""

from itertools import product

from effort import either, examples
from engine.detecting import CONVEX, cube_mesh, PLANE_SHAPE, random_pose, Scene, UPRIGHT
from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros.engine.model.kinds.table import (
    BOX, CAPSULE, CONE, CYLINDER, ELLIPSOID, HULL, SPHERE)

PAIRS = list(product(CONVEX, CONVEX))
# Polyhedra, spheres and capsules are exact to rounding. For a cylinder or a cone the search ends
# when it gains less than 1e-10 of the size, 1 m here; a few dozen such gains may be left. That of
# an ellipsoid and what has edges ends at 1e-12.
EXACT, ROUND = 1e-13, 5e-9


def tolerance(names):
    return ROUND if set(names) & {'cylinder', 'cone', 'ellipsoid'} else EXACT


def reach(kind, size, vertices, R, x, d):
    """Return max d . p over a shape along d (..., 3), written down from what the shape is."""
    e = d @ R
    u, v, w = np.moveaxis(e, -1, 0)
    if kind == SPHERE:
        farthest = size[0] * np.linalg.norm(e, axis=-1)
    elif kind == BOX:
        farthest = np.abs(e) @ size
    elif kind == CAPSULE:
        farthest = size[1] * np.abs(w) + size[0] * np.linalg.norm(e, axis=-1)
    elif kind == CYLINDER:
        farthest = size[1] * np.abs(w) + size[0] * np.hypot(u, v)
    elif kind == CONE:
        farthest = np.maximum(size[1] * w, size[0] * np.hypot(u, v) - size[1] * w)
    elif kind == ELLIPSOID:
        farthest = np.linalg.norm(e * size, axis=-1)
    else:
        farthest = (e @ vertices.T).max(axis=-1)
    return farthest + d @ x


def rotation(q):
    x, y, z, w = q
    return np.eye(3) + 2 * np.array([[-y * y - z * z, x * y - w * z, x * z + w * y],
                                     [x * y + w * z, -x * x - z * z, y * z - w * x],
                                     [x * z - w * y, y * z + w * x, -x * x - y * y]])


def separation_along(scene, n):
    """Return how far n (..., 3) separates the first two shapes; below 0: the way to part them."""
    total = 0.0
    for i, d in ((0, n), (1, -n)):
        s = scene.shapes
        vertices = s.hulls.vertices[s.hulls.first[s.hull[i]]:][:s.hulls.count[s.hull[i]]]
        total += reach(s.kind[i], s.size[i], vertices, rotation(scene.state.q[:, i]),
                       scene.state.x[:, i], d)
    return -total


def slow_distance(scene, rng):
    """
    Return the largest separation along any direction, by random searches from many starts.

    Each goes to the best of 60 directions around it, or stays, and they get closer and closer.
    """
    def along(n):
        n /= np.linalg.norm(n, axis=-1)[..., None]
        return separation_along(scene, n)

    starts = rng.normal(size=(500, 3))
    best = starts[np.argsort(-along(starts))[:12]]
    for size in 0.7 ** np.arange(50):       # down to 2e-8
        steps = size * rng.normal(size=(len(best), 60, 3))
        steps[:, 0] = 0.0
        near = best[:, None] + steps
        best = near[np.arange(len(best)), along(near).argmax(axis=1)]
    return along(best).max()


def two(names, rng, reach_of=1.2):
    return Scene([CONVEX[name] for name in names],
                 [((0, 0, 0), rng.normal(size=4)), random_pose(rng, reach_of)])


@pytest.mark.long
@pytest.mark.parametrize('names', PAIRS, ids='-'.join)
def test_distance_is_that_of_a_slow_search(names):
    rng = np.random.default_rng(3)
    for _ in range(either(2, 4)):
        scene = two(names, rng)
        gap = scene.distance(0, 1)[0]
        # Whatever direction the search finds, none separates by more; it may itself stop short of
        # a kink of s(n), where the best direction often lies: by 3e-6 here.
        slow = slow_distance(scene, rng)
        assert gap - 1e-4 < slow < gap + 1e-9


@examples(150)
@given(names=st.sampled_from(PAIRS), seed=st.integers(0, 2**32 - 1))
def test_the_normal_separates_by_the_distance(names, seed):
    scene = two(names, np.random.default_rng(seed))
    gap, n, p, q = scene.distance(0, 1)
    close = tolerance(names)
    assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-15)
    assert separation_along(scene, n) == pytest.approx(gap, abs=close)
    assert (q - p) @ n == pytest.approx(gap, abs=1e-15)
    # From A to B: B moved along n by -gap just touches.
    scene.state.x[:, 1] -= gap * n
    assert abs(scene.distance(0, 1)[0]) < max(close, 1e-12)


@examples(150)
@given(names=st.sampled_from(PAIRS), seed=st.integers(0, 2**32 - 1))
def test_distance_is_the_same_with_the_shapes_exchanged(names, seed):
    scene = two(names, np.random.default_rng(seed))
    gap, back = scene.distance(0, 1)[0], scene.distance(1, 0)[0]
    assert gap == pytest.approx(back, abs=tolerance(names))


@examples(100)
@given(names=st.sampled_from(PAIRS), seed=st.integers(0, 2**32 - 1))
def test_distance_is_the_same_after_a_rigid_motion_of_both(names, seed):
    rng = np.random.default_rng(seed)
    scene = two(names, rng)
    gap = scene.distance(0, 1)[0]
    shift, turn = rng.normal(size=3), rng.normal(size=4)
    turn /= np.linalg.norm(turn)
    for i in range(2):
        x, q = scene.state.x[:, i].copy(), scene.state.q[:, i].copy()
        vector = turn[3] * q[:3] + q[3] * turn[:3] + np.cross(turn[:3], q[:3])
        q = np.append(vector, turn[3] * q[3] - turn[:3] @ q[:3])
        scene.put(i, rotation(turn) @ x + shift, q)
    # The poses themselves are rounded: 1e-16 of a few metres.
    assert scene.distance(0, 1)[0] == pytest.approx(gap, abs=max(tolerance(names), 1e-12))


ROUND_PAIRS = [names for names in PAIRS if set(names) & {'cylinder', 'cone', 'ellipsoid'}]


@pytest.mark.parametrize('names', ROUND_PAIRS, ids='-'.join)
def test_the_normal_of_round_shapes_apart_is_that_of_the_shapes_exchanged_and_turned(names):
    rng = np.random.default_rng(5)
    apart = []
    for _ in range(40):
        scene = two(names, rng, reach_of=3.0)
        gap, n, _, _ = scene.distance(0, 1)
        if gap < 0.01:
            continue
        apart.append(np.linalg.norm(n + scene.distance(1, 0)[1]))
        turn = rng.normal(size=4)
        turn /= np.linalg.norm(turn)
        for i in range(2):
            x, q = scene.state.x[:, i].copy(), scene.state.q[:, i].copy()
            vector = turn[3] * q[:3] + q[3] * turn[:3] + np.cross(turn[:3], q[:3])
            scene.put(i, rotation(turn) @ x, np.append(vector, turn[3] * q[3] - turn[:3] @ q[:3]))
        apart.append(np.linalg.norm(rotation(turn) @ n - scene.distance(0, 1)[1]))
    # s(n) is known to 1e-16 and its maximum is flat to second order: 1e-8. Searches alone end with
    # 1e-5. One in ten may be where two edges are nearly parallel, and is left as the search ended.
    assert len(apart) > 20
    assert np.quantile(apart, 0.9) < 2e-7


@pytest.mark.parametrize('name', CONVEX)
def test_distance_from_a_plane_is_the_height_of_the_lowest_point(name):
    rng = np.random.default_rng(1)
    for _ in range(20):
        scene = Scene([CONVEX[name], PLANE_SHAPE],
                      [random_pose(rng, 2.0), ((0.1, 0.2, -1.0), rng.normal(size=4))], fixed=[1])
        n = rotation(scene.state.q[:, 1])[:, 2]
        s, x = scene.shapes, scene.state.x
        vertices = s.hulls.vertices
        lowest = -reach(s.kind[0], s.size[0], vertices, rotation(scene.state.q[:, 0]), x[:, 0], -n)
        gap, normal, _, _ = scene.distance(0, 1)
        assert gap == pytest.approx(lowest - n @ x[:, 1], abs=1e-14)
        assert normal == pytest.approx(-n, abs=1e-15)


@examples(200)
@given(names=st.sampled_from(PAIRS), seed=st.integers(0, 2**32 - 1))
def test_a_manifold_exists_exactly_when_shapes_are_nearer_than_the_margin(names, seed):
    rng = np.random.default_rng(seed)
    scene = two(names, rng, 1.0)
    scene.margin = 0.05
    gap = scene.distance(0, 1)[0]
    rows = scene.rows()
    if abs(gap - scene.margin) > 1e-4:
        assert len(rows) == (1 if gap < scene.margin else 0)
    for row in rows:
        assert np.linalg.norm(row['normal']) == pytest.approx(1.0, abs=1e-14)
        # The deepest point shows the depth: to the preference for faces of a box, 2e-3 of 0.2 m,
        # and what a corner may stand out or a rim be cut, 1e-3 of the size. Edges of two boxes
        # have to be better by a tenth of the depth of their faces.
        if gap < 0.0:
            deepest = gap / 0.9 if names == ('box', 'box') else gap
            assert deepest - 1e-3 < row['gap'].min() < gap + 1e-3


@examples(200)
@given(names=st.sampled_from(PAIRS), seed=st.integers(0, 2**32 - 1))
def test_points_on_a_and_b_differ_by_the_gap_along_the_normal(names, seed):
    scene = two(names, np.random.default_rng(seed), 0.8)
    x = scene.state.x
    for row in scene.rows():
        for k, gap in enumerate(row['gap']):
            apart = x[:, 1] + row['r_B'][k] - x[:, 0] - row['r_A'][k]
            assert apart == pytest.approx(gap * row['normal'], abs=1e-14)
            # Only what may keep its points has them in axes that turn with the bodies too.
            for i, name in enumerate(('A', 'B') if row['p_A_C'].any() else ()):
                in_C = rotation(scene.state.q[:, i]) @ row[f'p_{name}_C'][k]
                assert in_C == pytest.approx(row[f'r_{name}'][k], abs=1e-14)


CLOSE_PAIRS = [(CONVEX[a], CONVEX[b]) for a, b in PAIRS] + [
    ((BOX, (0.3, 0.3, 0.002), None), (CYLINDER, (0.3, 0.03, 0.0), None)),
    (CONVEX['box'], (CYLINDER, (0.3, 0.03, 0.0), None)),
    ((BOX, (0.3, 0.3, 0.002), None), CONVEX['hull']),
    ((CYLINDER, (0.3, 0.03, 0.0), None), (CYLINDER, (0.3, 0.03, 0.0), None))]


def touching(scene, rng, how):
    """Turn A; return a position and orientation of B where it touches A, and the normal there."""
    scene.put(0, (0, 0, 0))
    direction, turn = np.append(0.05 * rng.normal(size=2), 1.0), rng.normal(size=4)
    if how == 0:
        scene.put(0, (0, 0, 0), rng.normal(size=4))
        direction = rng.normal(size=3)
    elif how == 1:  # nearly flat on each other
        turn = np.append(rng.normal(size=3) * 10.0 ** rng.uniform(-8, -1), 1.0)
    x = 2.0 * direction / np.linalg.norm(direction)
    for _ in range(21):
        scene.put(1, x, turn)
        gap, n, _, _ = scene.distance(0, 1)
        touches = x - gap * n
        if abs(gap - 1e-2) < 1e-12:
            break
        x = touches + 1e-2 * n
    return touches, turn, n


@pytest.mark.parametrize('how', [0, 1])
@pytest.mark.parametrize('shapes', CLOSE_PAIRS)
def test_the_gap_of_shapes_that_hardly_touch_is_how_far_they_were_moved(shapes, how):
    rng = np.random.default_rng(3)
    scene = Scene(shapes, 2 * [((0, 0, 0), UPRIGHT)])
    for _ in range(40):
        x, turn, n = touching(scene, rng, how)
        for moved in (-1e-3, -1e-5, -1e-7, -1e-9, 0.0, 1e-12, 1e-9, 1e-7):
            scene.put(1, x + moved * n, turn)
            gap = scene.distance(0, 1)[0]
            # The shortest way out may be another than back, and corners that met may pass each
            # other. 2e-8: thin boxes at nearly no distance, 1e-7 of their size.
            assert moved - 2e-8 < gap < abs(moved) + 2e-8


@pytest.mark.parametrize('how', [0, 1])
@pytest.mark.parametrize('shapes', CLOSE_PAIRS)
def test_the_deepest_point_of_a_manifold_is_as_deep_as_the_shapes(shapes, how):
    rng = np.random.default_rng(4)
    scene = Scene(shapes, 2 * [((0, 0, 0), UPRIGHT)])
    for _ in range(40):
        x, turn, n = touching(scene, rng, how)
        for moved in (-1e-7, 0.0, 1e-7):
            scene.put(1, x + moved * n, turn)
            rows = scene.rows()
            assert len(rows) == 1
            # OVERHANG, 1e-5 of shapes of 0.5 m that lean on an edge.
            assert rows[0]['gap'].min() == pytest.approx(scene.distance(0, 1)[0], abs=4e-6)


LYING = (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))  # the axis z turned to x
# Of a cone of the radius 0.3 m and the height 0.5 m the sine of the angle between axis and mantle.
# On its mantle the axis falls towards the apex by that angle, and the middle of the axis is 0.25 m
# from the apex, so 0.25 m times the sine above the ground.
MANTLE = 0.3 / np.hypot(0.3, 0.5)
_TURN = 0.5 * (np.pi / 2 + np.arcsin(MANTLE))
CONE_LYING = (0.0, np.sin(_TURN), 0.0, np.cos(_TURN))
# How a shape rests: its height and orientation, and how many points carry it.
RESTING = {
    'box': (CONVEX['box'], 0.4, UPRIGHT, 4),
    'cylinder upright': (CONVEX['cylinder'], 0.25, UPRIGHT, 4),
    'cylinder lying': (CONVEX['cylinder'], 0.3, LYING, 2),
    'cone upright': (CONVEX['cone'], 0.25, UPRIGHT, 4),
    'cone lying': (CONVEX['cone'], 0.25 * MANTLE, CONE_LYING, 2),
    'ellipsoid': (CONVEX['ellipsoid'], 0.4, UPRIGHT, 1),
    'capsule lying': (CONVEX['capsule'], 0.2, LYING, 2),
    'hull': ((HULL, (0.0, 0.0, 0.0), cube_mesh(0.3)), 0.3, UPRIGHT, 4),
    'sphere': (CONVEX['sphere'], 0.3, UPRIGHT, 1),
}
GROUNDS = {
    'plane': (PLANE_SHAPE, 0.0), 'box': ((BOX, (5.0, 5.0, 0.5), None), 0.5),
    'cylinder': ((CYLINDER, (3.0, 0.5, 0.0), None), 0.5),
    'hull': ((HULL, (0.0, 0.0, 0.0), cube_mesh(2.0)), 2.0),
}


@pytest.mark.parametrize('ground', GROUNDS)
@pytest.mark.parametrize('name', RESTING)
def test_a_shape_at_rest_is_carried_around_its_centre_and_keeps_its_features(name, ground):
    shape, height, orientation, points = RESTING[name]
    floor, top = GROUNDS[ground]
    scene = Scene([floor, shape], [((0, 0, 0), UPRIGHT), ((0.1, 0.2, top + height), orientation)],
                  fixed=[0])
    rng = np.random.default_rng(0)
    features = None
    for _ in range(20):
        # As a body at rest moves: a micrometre, and 1e-6 rad.
        scene.put(1, (0.1, 0.2, top + height - 1e-5) + 1e-6 * rng.normal(size=3),
                  np.asarray(orientation) + 1e-6 * rng.normal(size=4))
        (row,) = scene.rows()
        assert row['normal'] == pytest.approx([0, 0, 1], abs=1e-5)
        assert len(row['gap']) == points
        assert row['gap'] == pytest.approx(-1e-5, abs=2e-5)
        if points >= 3:
            flat = row['r_B'][:, :2]
            assert (flat.min(axis=0) < 0).all() and (flat.max(axis=0) > 0).all()
        assert features is None or np.array_equal(features, row['feature'])
        features = row['feature']


def test_boxes_of_one_size_meet_corner_to_corner_with_four_features():
    cube = (BOX, (0.5, 0.5, 0.5), None)
    scene = Scene([cube, cube], [((0, 0, 0), UPRIGHT), ((0, 0, 1), UPRIGHT)])
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(20):
        scene.put(1, (0, 0, 0.9999) + 1e-6 * rng.normal(size=3), (0, 0, 1e-6 * rng.normal(), 1))
        (row,) = scene.rows()
        seen.add(tuple(row['feature']))
        assert len(row['gap']) == 4
    assert len(seen) == 1


def test_crossed_edges_meet_in_one_point():
    cube = (BOX, (0.5, 0.5, 0.5), None)
    up = (0.0, 0.0, 1.0)
    # Each stands on an edge; the upper one is turned by 90 deg about the vertical.
    lower = (np.sin(np.pi / 8), 0.0, 0.0, np.cos(np.pi / 8))
    upper = (0.0, np.sin(np.pi / 8), 0.0, np.cos(np.pi / 8))
    scene = Scene([cube, cube], [((0, 0, 0), lower), ((0, 0, np.sqrt(2.0) - 0.01), upper)])
    (row,) = scene.rows()
    assert row['normal'] == pytest.approx(up, abs=1e-12)
    assert row['gap'] == pytest.approx([-0.01], abs=1e-12)
    assert row['r_A'][0] == pytest.approx([0, 0, np.sqrt(0.5)], abs=1e-12)


@pytest.mark.parametrize('tilt', [0.02, 0.1, 0.5])
def test_a_tilted_cylinder_touches_with_the_lowest_point_of_its_rim(tilt):
    height = 0.25 * np.cos(tilt) + 0.3 * np.sin(tilt)
    for ground, (floor, top) in GROUNDS.items():
        scene = Scene([floor, CONVEX['cylinder']],
                      [((0, 0, 0), UPRIGHT),
                       ((0, 0, top + height - 1e-4), (np.sin(tilt / 2), 0, 0, np.cos(tilt / 2)))],
                      fixed=[0])
        (row,) = scene.rows()
        assert row['gap'].min() == pytest.approx(-1e-4, abs=1e-9), ground


# From the diagonal of a cube to the x axis: that of (1, 1, 1) / sqrt(3) with (1, 0, 0).
ANGLE = np.arccos(1 / np.sqrt(3))


@pytest.mark.parametrize('solid', [(BOX, (0.5, 0.5, 0.5), None),
                                   (HULL, (0.0, 0.0, 0.0), cube_mesh(0.5))])
def test_corners_that_meet_have_the_normal_between_them_whichever_shape_is_first(solid):
    # A cube that stands on a corner and its image in the plane x = 0, which the corner touches.
    sine, cosine = np.sin(0.5 * ANGLE), np.cos(0.5 * ANGLE)
    q = np.array([0.0, -sine, sine, np.sqrt(2) * cosine])
    image = q * (1.0, -1.0, -1.0, 1.0)
    x = np.sqrt(0.75)
    for side in (1.0, -1.0):
        poses = [((side * x, 0, 0), q if side > 0 else image),
                 ((-side * x, 0, 0), image if side > 0 else q)]
        (row,) = Scene([solid, solid], poses, margin=1e-9).rows()
        # Rounding of 1e-16, over the thousandth of the size by which they are moved apart.
        assert row['normal'] == pytest.approx([-side, 0, 0], abs=1e-12)


# In 8 two of the points from which four are chosen are as good: the first by its name is taken.
@pytest.mark.parametrize('seed', sorted(set(range(40)) - {8}))
def test_boxes_of_one_size_have_the_same_points_whichever_is_first(seed):
    """They meet with nearly parallel edges: what is clipped is tilted, and neither is larger."""
    rng = np.random.default_rng(seed)
    boxes = [(BOX, tuple(rng.uniform(0.2, 0.4, 3)), None)] * 2
    turns = 0.01 * rng.normal(size=(2, 3)) + np.outer((0.0, rng.uniform(0.3, 1.2)), (1, 0, 0))
    place = np.append(0.0, rng.normal(size=2))
    one, other = [(x, np.append(np.tan(0.5 * angle), 1.0))
                  for x, angle in zip((np.zeros(3), place), turns, strict=True)]
    gap, n, _, _ = Scene(boxes, [one, other]).distance(0, 1)
    other = (other[0] - (gap - rng.uniform(-0.001, 0.1)) * n, other[1])
    (ahead,), (back,) = (Scene(boxes, poses, margin=0.3).rows()
                         for poses in ([one, other], [other, one]))
    # A search ends within 1e-9 of the size, and a point goes by that over the least slope, 0.2.
    assert ahead['normal'] == pytest.approx(-back['normal'], abs=1e-7)
    assert np.sort(ahead['gap']) == pytest.approx(np.sort(back['gap']), abs=1e-7)
