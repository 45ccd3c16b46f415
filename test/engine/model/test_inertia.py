# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mass properties against closed forms, against each other and against sampled bodies."""

import math

from effort import examples
from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros.engine.model import inertia
from rigid_sim_ros.engine.model.inertia import MassProperties
from rigid_sim_ros.engine.model.kinds.box import box
from rigid_sim_ros.engine.model.kinds.capsule import capsule
from rigid_sim_ros.engine.model.kinds.cylinder import cylinder
from rigid_sim_ros.engine.model.kinds.sphere import sphere

LENGTH = st.floats(0.01, 10.0)


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def box_mesh(size: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return a cuboid as twelve triangles, counter-clockwise from outside."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    return corners * np.array(size) / 2.0, np.array(triangles)


def sampled_tensor(inside, half: np.ndarray, m: float, cells: int = 120) -> np.ndarray:
    """Return the inertia tensor by the midpoint rule on a grid of cells^3."""
    axes = [(np.arange(cells) + 0.5) / cells * 2 * h - h for h in half]
    x, y, z = (a.ravel() for a in np.meshgrid(*axes, indexing='ij'))
    keep = inside(x, y, z)
    r = np.stack([x, y, z], axis=1)[keep]
    second = r.T @ r * m / len(r)
    return np.trace(second) * np.eye(3) - second


def test_a_sphere_has_two_fifths_m_r_squared():
    solid = sphere(3.0, 0.5)
    assert np.allclose(solid.I_BC_B, 0.4 * 3.0 * 0.25 * np.eye(3), rtol=1e-15)


def test_a_cuboid_has_the_moments_of_the_lecture():
    solid = box(12.0, (1.0, 2.0, 3.0))
    assert np.allclose(np.diag(solid.I_BC_B), [13.0, 10.0, 5.0], rtol=1e-15)


@pytest.mark.parametrize(('length', 'radius'), [(2.0, 0.5), (0.3, 1.0)])
def test_cylinder_and_capsule_match_a_sampled_body(length, radius):
    def in_cylinder(x, y, z):
        return (x * x + y * y < radius ** 2) & (abs(z) < length / 2)

    def in_capsule(x, y, z):
        beyond = np.maximum(abs(z) - length / 2, 0.0)
        return x * x + y * y + beyond ** 2 < radius ** 2

    # The midpoint rule misjudges a layer of half a cell at the surface: a fraction of about
    # 1 / 120 of the radius, much of which cancels.
    half = np.array([radius, radius, length / 2])
    assert np.allclose(sampled_tensor(in_cylinder, half, 2.0),
                       cylinder(2.0, radius, length).I_BC_B, rtol=5e-3, atol=1e-3)
    half = np.array([radius, radius, length / 2 + radius])
    assert np.allclose(sampled_tensor(in_capsule, half, 2.0),
                       capsule(2.0, radius, length).I_BC_B, rtol=5e-3, atol=1e-3)


def test_a_pyramid_has_the_moments_of_the_tables():
    """Unlike a box or a tetrahedron it has its centre of mass elsewhere than amid its corners."""
    m, a, h = 2.0, 0.6, 1.5
    vertices = [(x * a / 2, y * a / 2, 0.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    triangles = [(0, 2, 1), (0, 3, 2), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
    solid = inertia.mesh(m, np.array([*vertices, (0.0, 0.0, h)]), np.array(triangles))
    across, along = m * (a * a / 20 + 3 * h * h / 80), m * a * a / 10
    assert np.allclose(solid.p_BC, [0.0, 0.0, h / 4], atol=1e-15)
    assert np.allclose(solid.I_BC_B, np.diag([across, across, along]), atol=1e-15)


def test_a_capsule_without_a_cylinder_is_a_sphere():
    assert np.allclose(capsule(2.0, 0.3, 0.0).I_BC_B, sphere(2.0, 0.3).I_BC_B,
                       rtol=1e-14)


@given(LENGTH, LENGTH, LENGTH, st.floats(-100.0, 100.0))
def test_a_mesh_of_a_cuboid_is_a_cuboid_wherever_it_lies(a, b, c, away):
    vertices, triangles = box_mesh((a, b, c))
    solid = inertia.mesh(7.0, vertices + away, triangles)
    # Vertices at 100 m lose their last 1e-14 m; a side of 1 cm is then known to 1e-12 of itself.
    assert np.allclose(solid.I_BC_B, box(7.0, (a, b, c)).I_BC_B, rtol=1e-9,
                       atol=1e-11 * 7.0 * max(a, b, c) ** 2)
    assert np.allclose(solid.p_BC, away, atol=1e-11)


def test_a_mesh_turned_inside_out_is_refused_with_its_volume():
    vertices, triangles = box_mesh((1.0, 2.0, 3.0))
    with pytest.raises(ValueError, match=r'-6 m\^3, must be > 0'):
        inertia.mesh(1.0, vertices, triangles[:, ::-1])


def test_particles_add_up_to_the_sums_of_the_lecture():
    solid = inertia.points(np.array([[1.0, 0, 0], [-1, 0, 0], [0, 2, 0]]), np.array([1.0, 1, 2]))
    # By hand: M = 4, com (0, 1, 0); I_xx = 1 + 1 + 2 = 4, I_yy = 2, I_zz = 2 + 2 + 2 = 6.
    assert solid.m == 4.0
    assert np.allclose(solid.p_BC, [0.0, 1.0, 0.0], rtol=1e-15)
    assert np.allclose(solid.I_BC_B, np.diag([4.0, 2.0, 6.0]), atol=1e-15)


def test_particles_give_products_of_inertia_their_sign():
    # Two particles on the diagonal x = y: I_xy = -sum m x y.
    solid = inertia.points(np.array([[1.0, 1, 0], [-1, -1, 0]]), np.array([0.5, 0.5]))
    assert solid.I_BC_B[0, 1] == -1.0


@given(st.integers(0, 2 ** 32 - 1), st.integers(1, 6))
def test_cut_up_particles_combine_to_the_whole(seed, parts):
    rng = np.random.default_rng(seed)
    positions, masses = rng.normal(size=(30, 3)), rng.uniform(0.1, 1.0, 30)
    whole = inertia.points(positions, masses)
    pieces = []
    for chosen in np.array_split(np.arange(30), parts):
        p, R = rng.normal(size=3), random_rotation(rng)  # each in a frame of its own
        piece = inertia.points((positions[chosen] - p) @ R, masses[chosen])
        pieces.append(inertia.placed(piece, p, R))
    together = inertia.combine(pieces)
    # A few dozen sums of numbers below 100: rounding of some 1e-14.
    assert np.allclose(together.p_BC, whole.p_BC, atol=1e-12)
    assert np.allclose(together.I_BC_B, whole.I_BC_B, atol=1e-11)


@given(st.integers(0, 2 ** 32 - 1))
def test_principal_axes_diagonalise_and_are_right_handed(seed):
    rng = np.random.default_rng(seed)
    R = random_rotation(rng)
    tensor = R @ np.diag(rng.uniform(1.0, 1.9, 3)) @ R.T
    tensor = (tensor + tensor.T) / 2
    moments, R_BC = inertia.principal_axes(tensor)
    assert np.allclose(R_BC @ np.diag(moments) @ R_BC.T, tensor, atol=1e-13)
    assert np.linalg.det(R_BC) == pytest.approx(1.0, abs=1e-13)


def test_a_diagonal_tensor_keeps_its_axes_to_the_bit():
    moments, R_BC = inertia.principal_axes(np.diag([3.0, 1.0, 2.5]))
    assert moments.tolist() == [3.0, 1.0, 2.5]
    assert R_BC.tolist() == np.eye(3).tolist()


def test_nearly_diagonal_axes_stay_near_their_own():
    tensor = np.diag([3.0, 1.0, 2.5])
    tensor[0, 1] = tensor[1, 0] = 1e-6
    _, R_BC = inertia.principal_axes(tensor)
    assert np.allclose(R_BC, np.eye(3), atol=1e-6)  # the angle is about 1e-6 / (3 - 1)


@pytest.mark.parametrize(('m', 'six', 'message'), [
    (0.0, (1, 1, 1, 0, 0, 0), r'mass 0 kg, must be > 0'),
    (-2.0, (1, 1, 1, 0, 0, 0), r'mass -2 kg, must be > 0'),
    (math.nan, (1, 1, 1, 0, 0, 0), r'mass nan kg, must be > 0'),
    (1.0, (1, 1, -1, 0, 0, 0), r'not positive definite: principal moments -1, 1, 1'),
    (1.0, (1, 1, 1, 2, 0, 0), r'not positive definite: principal moments -1, 1, 3'),
    (1.0, (1, 1, 3, 0, 0, 0), r'triangle inequality: principal moments 1, 1, 3 .* 2 < 3'),
    (1.0, (1, 1, math.inf, 0, 0, 0), r'must be finite'),
])
def test_unphysical_mass_properties_are_refused_with_the_numbers(m, six, message):
    with pytest.raises(ValueError, match=message):
        inertia.check(inertia.inertial(m, (0, 0, 0), six))


def test_a_flat_plate_is_physical():
    inertia.check(MassProperties(1.0, np.zeros(3), np.diag([1.0, 2.0, 3.0])))


@examples(50)
@given(LENGTH, LENGTH, LENGTH, st.floats(1e-3, 1e4))
def test_every_solid_passes_its_own_check(a, b, c, m):
    for solid in (sphere(m, a), box(m, (a, b, c)), cylinder(m, a, b),
                  capsule(m, a, b)):
        inertia.check(solid)
