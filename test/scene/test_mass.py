# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The mass properties that a scene gives to its bodies."""

import math
from typing import Any

import numpy as np
import pytest

from rigid_sim_ros.engine.model.inertia import MassProperties
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.scene import mass, schema


def properties(**body: Any) -> MassProperties:
    """Return the mass properties of a body with these keys."""
    spec = schema.Body.model_validate({'name': 'a', **body})
    assert list(mass.mistakes(spec)) == []
    result = mass.properties(spec)
    assert result is not None
    return result


def moments(**body: Any) -> list[float]:
    """Return the diagonal of the inertia tensor."""
    return np.diag(properties(**body).I_BC_B).tolist()


SPHERE = {'type': 'sphere', 'radius': 2.0}
BOX = {'type': 'box', 'size': [1.0, 2.0, 3.0]}
ROD = {'type': 'cylinder', 'radius': 0.1, 'length': 1.0}

CONE = {'type': 'cone', 'radius': 1.0, 'length': 2.0}
EGG = {'type': 'ellipsoid', 'radii': [1.0, 2.0, 3.0]}

# Kind of shape: its keys, its volume and its moments at mass 1, all from the textbook.
SOLIDS = {
    'sphere': (SPHERE, 32 / 3 * math.pi, [1.6, 1.6, 1.6]),
    'box': (BOX, 6.0, [13 / 12, 10 / 12, 5 / 12]),
    'cone': (CONE, 2 / 3 * math.pi, [0.3, 0.3, 0.3]),
    'ellipsoid': (EGG, 8 * math.pi, [2.6, 2.0, 1.0]),
    'cylinder': (ROD, 0.01 * math.pi, [1.03 / 12, 1.03 / 12, 0.005]),
}


@pytest.mark.parametrize(('shape', 'volume', 'expected'), SOLIDS.values(), ids=SOLIDS)
def test_a_mass_gives_the_moments_of_the_textbook(
        shape: dict[str, Any], volume: float, expected: list[float]) -> None:
    assert moments(shape=shape, mass=1.0) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(('shape', 'volume', 'expected'), SOLIDS.values(), ids=SOLIDS)
def test_a_density_gives_mass_by_volume(
        shape: dict[str, Any], volume: float, expected: list[float]) -> None:
    assert properties(shape=shape, density=5.0).m == pytest.approx(5.0 * volume, rel=1e-15)


@pytest.mark.parametrize('shape', [SPHERE, BOX, ROD,
                                   {'type': 'capsule', 'radius': 0.3, 'length': 0.7}])
def test_a_given_mass_is_kept_to_the_bit(shape: dict[str, Any]) -> None:
    assert properties(shape=shape, mass=0.1).m == 0.1


def test_a_capsule_is_a_cylinder_and_two_halves_of_a_ball() -> None:
    # Density 1, r = 1, l = 2: cylinder 2 pi, ball 4/3 pi. Along the axis 1/2 m r^2 and 2/5 m r^2.
    got = properties(shape={'type': 'capsule', 'radius': 1, 'length': 2}, density=1.0)
    assert got.m == pytest.approx(10 / 3 * math.pi, rel=1e-15)
    assert got.I_BC_B[2, 2] == pytest.approx(math.pi + 8 / 15 * math.pi, rel=1e-15)


def test_the_centre_of_a_cone_is_a_quarter_of_its_height_above_the_base() -> None:
    turned = {**CONE, 'pose': {'position': [1, 2, 3], 'orientation': [1, 0, 0, 0]}}
    # Turned over, its apex is at z = 2 and its base at z = 4.
    assert properties(shape=turned, mass=1.0).p_BC == pytest.approx([1.0, 2.0, 3.5], abs=1e-15)


def test_explicit_properties_keep_their_order_and_place() -> None:
    got = properties(inertial={'mass': 2, 'com': [1, 2, 3], 'inertia': [4, 5, 6, 0.1, 0.2, 0.3]})
    assert (got.m, got.p_BC.tolist()) == (2.0, [1.0, 2.0, 3.0])
    assert got.I_BC_B.tolist() == [[4, 0.1, 0.2], [0.1, 5, 0.3], [0.2, 0.3, 6]]


def test_particles_are_summed() -> None:
    # Two of 1 kg at x = +-1 and one of 2 kg at y = 3: centre at y = 1.5.
    got = properties(shape={'type': 'points', 'positions': [[1, 0, 0], [-1, 0, 0], [0, 3, 0]],
                            'masses': [1, 1, 2]})
    assert (got.m, got.p_BC.tolist()) == (4.0, [0.0, 1.5, 0.0])
    # Ixx = sum m y^2 = 2 * 1.5^2 + 2 * 1.5^2, Iyy = sum m x^2, Izz = their sum
    assert np.diag(got.I_BC_B).tolist() == [9.0, 2.0, 11.0]


def test_a_pose_moves_and_turns_a_shape() -> None:
    turned = {**ROD, 'pose': {'position': [0, 0, 4], 'orientation': [0.5, 0.5, 0.5, 0.5]}}
    got = properties(shape=turned, mass=1.0)  # z to x: the rod lies along x
    assert got.p_BC.tolist() == [0.0, 0.0, 4.0]
    assert np.diag(got.I_BC_B) == pytest.approx([0.005, 1.03 / 12, 1.03 / 12], abs=1e-16)


def test_the_centre_of_a_single_shape_is_its_position_to_the_bit() -> None:
    got = properties(shape={**BOX, 'pose': {'position': [0.1, 0.2, 0.3]}}, mass=3.0)
    assert got.p_BC.tolist() == [0.1, 0.2, 0.3]
    assert not (got.I_BC_B - np.diag(np.diag(got.I_BC_B))).any()  # so its axes stay those of B


def dumbbell(**own: Any) -> list[dict[str, Any]]:
    """Return two balls, the second with twice the radius of the first."""
    return [{'type': 'sphere', 'radius': 1.0, 'pose': {'position': [0, 0, 9]}, **own},
            {'type': 'sphere', 'radius': 2.0, **own}]


def test_the_mass_of_a_compound_is_shared_by_volume() -> None:
    got = properties(shape={'compound': dumbbell()}, mass=9.0)  # 1 kg and 8 kg
    assert got.m == pytest.approx(9.0, rel=1e-15)
    assert got.p_BC == pytest.approx([0, 0, 1], abs=1e-15)
    # 2/5 m r^2 of each, and by parallel axes 1 * 8^2 + 8 * 1^2
    assert np.diag(got.I_BC_B) == pytest.approx([85.2, 85.2, 13.2], rel=1e-15)


@pytest.mark.parametrize('body', [
    {'shape': {'compound': dumbbell()}, 'density': 3.0},
    {'shape': {'type': 'compound', 'compound': dumbbell()}, 'density': 3.0},
    {'compound': dumbbell(), 'density': 3.0},
    {'compound': dumbbell(density=3.0)},
    {'compound': [{**dumbbell()[0], 'mass': 4 * math.pi},
                  {**dumbbell()[1], 'mass': 32 * math.pi}]},
], ids=['density', 'with type', 'on the body', 'density of each part', 'mass of each part'])
def test_all_ways_to_write_a_compound_weigh_the_same(body: dict[str, Any]) -> None:
    got = properties(**body)
    assert got.m == pytest.approx(36 * math.pi, rel=1e-14)
    assert got.p_BC == pytest.approx([0, 0, 1], abs=1e-14)


def test_the_density_of_a_body_is_that_of_parts_without_one() -> None:
    parts = [{**BOX, 'density': 5.0}, BOX, {'type': 'points', 'positions': [[0, 0, 0]],
                                            'masses': [7]}]
    assert properties(compound=parts, density=1.0).m == pytest.approx(30 + 6 + 7, rel=1e-15)


def tensor_by_sampling(parts: list[tuple[Array, float]]) -> Array:
    """Return the inertia about the origin of clouds of points with a mass each."""
    total = np.zeros((3, 3))
    for points, m in parts:
        second = m * points.T @ points / len(points)
        total += np.trace(second) * np.eye(3) - second
    return total


def test_a_compound_agrees_with_a_sum_over_small_pieces() -> None:
    # A box of 1 x 2 x 3 turned by 90 degrees about x, at (1, 0, 0), cut into 60^3 cells.
    cells = (np.arange(60) + 0.5) / 60 - 0.5
    grid = np.stack(np.meshgrid(cells, cells, cells), axis=-1).reshape(-1, 3) * [1, 3, 2]
    grid[:, 0] += 1.0
    got = properties(compound=[{**BOX, 'pose': {'position': [1, 0, 0], 'orientation': [
        math.sqrt(0.5), 0, 0, math.sqrt(0.5)]}}, {**SPHERE, 'mass': 1e-9}], density=1.0)
    about_origin = got.I_BC_B + got.m * (got.p_BC @ got.p_BC * np.eye(3)
                                         - np.outer(got.p_BC, got.p_BC))
    # Midpoint rule: the second moment of a length is off by 1/60^2 of itself.
    assert about_origin == pytest.approx(tensor_by_sampling([(grid, 6.0)]), rel=1e-3)


def test_a_second_mass_is_one_mistake():
    spec = schema.Body.model_validate({
        'name': 'a', 'mass': 1.0, 'density': 2.0, 'shape': {**BOX, 'mass': 1.0}})
    assert [path for path, _ in mass.mistakes(spec)] == [('density',)]
