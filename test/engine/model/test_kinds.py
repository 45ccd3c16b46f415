# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Each kind of shape against its own triangles, and against directions and points at random."""

from types import SimpleNamespace

import numpy as np
import pytest

from rigid_sim_ros.engine.model import inertia
from rigid_sim_ros.engine.model.hulls import bare_hulls
from rigid_sim_ros.engine.model.kinds.cone import cone
from rigid_sim_ros.engine.model.kinds.ellipsoid import ellipsoid
from rigid_sim_ros.engine.model.kinds.table import (
    BY_TYPE, extreme, from_point, height, KINDS, reach_along, way_out)

# As a scene has them; the hull and the plane have tests of their own.
PARTS = {
    'sphere': {'radius': 0.3}, 'box': {'size': (0.2, 0.5, 0.3)},
    'capsule': {'radius': 0.2, 'length': 0.5}, 'cylinder': {'radius': 0.3, 'length': 0.2},
    'cone': {'radius': 0.3, 'length': 0.5}, 'ellipsoid': {'radii': (0.2, 0.5, 0.3)}}
SIDES = 400
# Triangles miss areas and moments by second order in the angle of a side.
COARSE = (2.0 * np.pi / SIDES) ** 2


class Shape:
    """A shape of a kind as the only row of a table."""

    def __init__(self, name):
        self.number = BY_TYPE[name]
        self.kind = KINDS[self.number]
        self.part = SimpleNamespace(**PARTS[name])
        self.size = np.array([self.kind.size(self.part)])
        self.surface = self.kind.surface(self.part, SIDES)
        self.radius = self.size[0, 0] if self.kind.is_rounded else 0.0

    def reach(self, n):
        """Return max n . x over the shape, by its support point."""
        none = np.zeros(1, dtype=np.int64)
        p = extreme(self.number, self.size, none, none, np.zeros((1, 3)), 0, 0, tuple(n))
        return float(np.dot(p, n)) + self.radius

    def from_point(self, p):
        d, n, foot = from_point(self.number, self.size, 0, tuple(p))
        return d, np.array(n), np.array(foot)


@pytest.fixture(params=PARTS)
def shape(request):
    return Shape(request.param)


def directions(count, seed=0):
    n = np.random.default_rng(seed).normal(size=(count, 3))
    return n / np.linalg.norm(n, axis=1)[:, None]


def test_mass_properties_are_those_of_the_triangles(shape):
    volume = inertia.mesh_volume(*shape.surface)
    assert shape.kind.volume(shape.part) == pytest.approx(volume, rel=COARSE)
    own, mesh = shape.kind.mass_properties(2.0, shape.part), inertia.mesh(2.0, *shape.surface)
    assert own.p_BC == pytest.approx(mesh.p_BC, abs=COARSE)
    close = COARSE * np.abs(mesh.I_BC_B).max()
    assert np.allclose(own.I_BC_B, mesh.I_BC_B, rtol=0.0, atol=close)


def test_a_shape_reaches_as_far_as_its_triangles_and_no_farther(shape):
    for n in directions(100):
        drawn = float((shape.surface.vertices @ n).max())
        # A corner of the polygon lies on the surface, the middle of a side 0.5 (pi / sides)^2 in.
        missed = shape.reach(n) - drawn
        assert -1e-12 < missed < (np.pi / SIDES) ** 2
        down, up = reach_along(shape.number, shape.size, 0, *n)
        assert (up, down) == pytest.approx((shape.reach(n), shape.reach(-n)), abs=1e-15)


def test_the_bounding_radius_holds_the_triangles(shape):
    farthest = np.linalg.norm(shape.surface.vertices, axis=1).max()
    assert shape.kind.bounding_radius(shape.size[0]) == pytest.approx(farthest, abs=1e-12)


def test_the_half_width_is_half_of_the_least_width(shape):
    least = min(shape.reach(n) + shape.reach(-n) for n in directions(20_000)) / 2
    half = shape.kind.half_width(shape.size[0])
    if shape.kind.name == 'cylinder':   # along z, or across
        assert half == min(shape.size[0, :2])
    # The nearest of the directions is some 0.02 rad off, which is of first order at an edge.
    assert half - 1e-12 < least < half + 0.02


def test_the_signed_distance_of_a_point_is_the_largest_separation(shape):
    rng, n_all = np.random.default_rng(1), directions(2000)
    reaches = np.array([shape.reach(n) for n in n_all])
    for p in rng.uniform(-0.7, 0.7, (200, 3)):
        d, n, foot = shape.from_point(p)
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-14)
        assert n @ p - shape.reach(n) == pytest.approx(d, abs=1e-13)
        assert p - foot == pytest.approx(d * n, abs=1e-13)
        # No direction separates the point by more.
        assert (n_all @ p - reaches).max() < d + 1e-13
        # Of a polyhedron the height beside an edge is too small; inside nothing is.
        outside = height(shape.number, shape.size, bare_hulls(), 0, 0, tuple(p))
        assert outside < d + 1e-13
        assert outside == pytest.approx(d, abs=1e-13) or d > 0.0


@pytest.mark.parametrize('name', ['box', 'cylinder', 'cone'])
def test_the_way_out_ends_on_the_surface(name):
    shape, rng = Shape(name), np.random.default_rng(2)
    for p in rng.uniform(-0.3, 0.3, (300, 3)):
        if height(shape.number, shape.size, bare_hulls(), 0, 0, tuple(p)) >= 0.0:
            continue
        for d in directions(5, int(1e6 * abs(p[0]))):
            way = way_out(shape.number, shape.size, bare_hulls(), 0, 0, tuple(p), tuple(d))
            at = tuple(p + way * d)
            assert height(shape.number, shape.size, bare_hulls(), 0, 0, at) == pytest.approx(
                0.0, abs=1e-12)


@pytest.mark.parametrize('p', [(0, 0, 0), (0, 0, 0.1), (0.1, 0, 0), (0, 0.2, 0.05), (0, 0.25, 0),
                               (1e-12, 0.1, 0), (1e-300, 0, 0), (0, 0.5, 0), (0.2, 0, 0)])
@pytest.mark.parametrize('radii', [(0.2, 0.5, 0.3), (0.2, 0.2, 0.5), (0.5, 0.5, 0.2),
                                   (0.3, 0.3, 0.3)])
def test_points_on_the_axes_of_an_ellipsoid_have_a_foot(radii, p):
    size = np.array([radii])
    d, n, foot = from_point(BY_TYPE['ellipsoid'], size, 0, tuple(map(float, p)))
    assert np.sum((np.array(foot) / radii) ** 2) == pytest.approx(1.0, abs=1e-14)
    assert np.array(p) - foot == pytest.approx(d * np.array(n), abs=1e-15)
    n_all = directions(4000)
    assert (n_all @ np.array(p) - np.linalg.norm(n_all * radii, axis=1)).max() < d + 1e-14


def test_a_cone_has_the_moments_of_the_textbook():
    solid = cone(80.0, 1.0, 2.0)
    assert solid.p_BC.tolist() == [0.0, 0.0, -0.5]  # a quarter of the height above the base
    assert np.diag(solid.I_BC_B) == pytest.approx([24.0, 24.0, 24.0], rel=1e-15)


def test_an_ellipsoid_has_the_moments_of_the_textbook():
    solid = ellipsoid(5.0, (1.0, 2.0, 3.0))
    assert np.diag(solid.I_BC_B) == pytest.approx([13.0, 10.0, 5.0], rel=1e-15)
