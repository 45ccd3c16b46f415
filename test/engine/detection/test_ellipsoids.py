# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Ellipsoids that are apart, touch and overlap, of any proportions, against dense samples.

The signed distance is the largest separation s(n) along any direction n. Of many directions the
best ones are improved by ever nearer ones; none may separate by more than what detection found.
"""

from engine.detecting import CONVEX, Scene
from engine.detection.test_narrow_phase import reach, rotation
import numpy as np
import pytest

from rigid_sim_ros.engine.model.kinds.table import ELLIPSOID, HULL

# Of the size, which is 1 m here.
ACCURATE = 1e-10
ASPECT = 20.0


def some(name, rng):
    """Return a shape of random proportions."""
    kind, size, hull = CONVEX[name]
    return (kind, size, hull) if kind == HULL else (kind, tuple(ASPECT ** rng.uniform(-1, 0, 3)),
                                                    None)


def separations(scene, shapes, directions):
    """Return s(n) for directions (k, 3)."""
    total = directions @ (scene.state.x[:, 1] - scene.state.x[:, 0])
    for i, sign in ((0, 1.0), (1, -1.0)):
        kind, size, hull = shapes[i]
        vertices = None if hull is None else hull.vertices
        R = rotation(scene.state.q[:, i])
        total -= [reach(kind, np.asarray(size), vertices, R, np.zeros(3), sign * n)
                  for n in directions]
    return total


def best_of(scene, shapes, rng):
    """Return the largest separation that a search at random finds."""
    def units(v):
        return v / np.linalg.norm(v, axis=1)[:, None]

    n = units(rng.normal(size=(1500, 3)))
    s = separations(scene, shapes, n)
    best, most = n[s.argmax()], s.max()
    for near in 0.5 ** np.arange(3, 20):
        n = units(best + near * rng.normal(size=(30, 3)))
        s = separations(scene, shapes, n)
        if s.max() > most:
            best, most = n[s.argmax()], s.max()
    return most


@pytest.mark.parametrize('other', CONVEX)
@pytest.mark.parametrize('where', ['apart', 'touching', 'overlapping'])
def test_no_direction_separates_by_more_than_the_distance(other, where):
    rng = np.random.default_rng([len(other), len(where)])
    for _ in range(6):
        shapes = [some('ellipsoid', rng), some(other, rng)]
        far = {'apart': 2.0, 'touching': 1.0, 'overlapping': 0.3}[where]
        scene = Scene(shapes, [((0, 0, 0), rng.normal(size=4)),
                               (far * rng.normal(size=3), rng.normal(size=4))])
        if where == 'touching':
            for _ in range(20):
                gap, n, _, _ = scene.distance(0, 1)
                scene.state.x[:, 1] -= gap * n
        gap, n, p, q = scene.distance(0, 1)
        # What detection found is a separation, and the points show it.
        own = separations(scene, shapes, n[None])[0]
        assert own == pytest.approx(gap, abs=ACCURATE)
        assert q - p == pytest.approx(gap * n, abs=1e-14)
        assert best_of(scene, shapes, rng) < gap + ACCURATE


def test_the_points_of_two_ellipsoids_lie_on_them_with_the_normal_of_their_surfaces():
    rng = np.random.default_rng(1)
    for _ in range(100):
        shapes = [some('ellipsoid', rng), some('ellipsoid', rng)]
        scene = Scene(shapes, [((0, 0, 0), rng.normal(size=4)),
                               (rng.normal(size=3), rng.normal(size=4))])
        _, n, p, q = scene.distance(0, 1)
        for i, (point, out) in enumerate(((p, n), (q, -n))):
            a = np.array(shapes[i][1])
            x = rotation(scene.state.q[:, i]).T @ (point - scene.state.x[:, i])
            assert np.sum((x / a) ** 2) == pytest.approx(1.0, abs=1e-12)
            gradient = rotation(scene.state.q[:, i]) @ (x / a ** 2)
            # The direction of a sharp tip changes by 1e3 rad for each part of the size.
            assert gradient / np.linalg.norm(gradient) == pytest.approx(out, abs=1e-10)


def test_concentric_ellipsoids_part_along_their_shortest_axes():
    scene = Scene([(ELLIPSOID, (0.2, 0.3, 0.4), None)] * 2, [((0, 0, 0), (0, 0, 0, 1))] * 2)
    gap, n, _, _ = scene.distance(0, 1)
    assert gap == pytest.approx(-0.4, abs=1e-12)
    assert np.abs(n) == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)


def test_balls_written_as_ellipsoids_are_balls():
    shapes = [(ELLIPSOID, (0.3, 0.3, 0.3), None), (ELLIPSOID, (0.5, 0.5, 0.5), None)]
    for x in ((1.0, 0.0, 0.0), (0.3, 0.4, 0.0), (0.1, 0.0, 0.0)):
        scene = Scene(shapes, [((0, 0, 0), (0, 0, 0, 1)), (x, (0, 0, 1, 1))])
        assert scene.distance(0, 1)[0] == pytest.approx(np.linalg.norm(x) - 0.8, abs=1e-14)
