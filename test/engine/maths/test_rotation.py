# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Quaternions against rotation matrices."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros.engine.maths.rotation import (
    exponential, from_matrix, logarithm, multiply, rotate, rotate_back, to_matrix, unit)
from rigid_sim_ros.engine.state.rates import angular_momentum, angular_velocity
from rigid_sim_ros.kernels.kernel import in_python

COMPONENT = st.floats(-1.0, 1.0)
VECTOR = st.tuples(COMPONENT, COMPONENT, COMPONENT)
QUATERNION = st.tuples(COMPONENT, COMPONENT, COMPONENT, COMPONENT).filter(
    lambda q: sum(c * c for c in q) > 1e-4).map(lambda q: unit(q))

# All below is a handful of products of numbers of order 1: 1e-15 each, with room.
ROUNDING = 1e-14


@given(QUATERNION, VECTOR)
def test_rotate_is_the_matrix_product(q, v):
    assert np.allclose(rotate(q, v), np.array(to_matrix(q)) @ v, atol=ROUNDING)


@given(QUATERNION, VECTOR)
def test_rotate_back_undoes_rotate(q, v):
    assert np.allclose(rotate_back(q, rotate(q, v)), v, atol=ROUNDING)


@given(QUATERNION, QUATERNION)
def test_multiply_is_one_rotation_after_the_other(a, b):
    assert np.allclose(to_matrix(multiply(a, b)), np.array(to_matrix(a)) @ to_matrix(b),
                       atol=ROUNDING)


@given(QUATERNION)
def test_from_matrix_is_the_inverse_of_to_matrix(q):
    back = np.array(from_matrix(to_matrix(q)))
    assert min(abs(back - q).max(), abs(back + q).max()) < ROUNDING


@given(QUATERNION, QUATERNION, VECTOR)
def test_python_finds_the_same_bits_as_a_kernel(a, b, v):
    for function, arguments in ((multiply, (a, b)), (rotate, (a, v)), (to_matrix, (a,)),
                                (from_matrix, (to_matrix(a),)), (exponential, (v,))):
        plain = in_python(function)
        assert not hasattr(plain, 'py_func')
        assert np.array(plain(*arguments)).tobytes() == np.array(function(*arguments)).tobytes()


def test_quaternion_of_a_quarter_turn_about_z_turns_x_to_y():
    s = math.sqrt(0.5)
    assert np.allclose(rotate((0.0, 0.0, s, s), (1.0, 0.0, 0.0)), [0.0, 1.0, 0.0], atol=ROUNDING)


@given(st.tuples(*[st.floats(-1.8, 1.8)] * 3))
def test_logarithm_is_the_inverse_of_exponential_below_a_half_turn(r):
    # |r| <= 1.8 sqrt(3) = 3.118 < pi
    assert np.allclose(logarithm(exponential(r)), r, atol=1e-13)


def test_logarithm_takes_the_shorter_way():
    q = exponential((0.0, 0.0, 3.5))
    assert np.allclose(logarithm(q), [0.0, 0.0, 3.5 - 2 * math.pi], atol=ROUNDING)


def test_exponential_of_nothing_is_no_rotation():
    assert exponential((0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0, 1.0)


@given(QUATERNION, VECTOR)
def test_angular_velocity_and_momentum_are_inverse(q, w):
    L = angular_momentum(q, w, (1.0, 2.0, 3.0))
    assert np.allclose(angular_velocity(q, L, (1.0, 1 / 2, 1 / 3)), w, atol=ROUNDING)


@given(QUATERNION, VECTOR)
def test_angular_momentum_is_the_world_inertia_tensor_times_w(q, w):
    R = np.array(to_matrix(q))
    expected = R @ np.diag([1.0, 2.0, 3.0]) @ R.T @ w
    assert np.allclose(angular_momentum(q, w, (1.0, 2.0, 3.0)), expected, atol=ROUNDING)


def test_unit_has_length_one():
    assert np.linalg.norm(unit((3.0, -4.0, 12.0, 84.0))) == pytest.approx(1.0, abs=1e-15)
