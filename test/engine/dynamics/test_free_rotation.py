# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rotation of a free body against exact solutions."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.dynamics.free_rotation import (
    MAX_ANGLE, small_exponential, turn, turn_fast)
from rigid_sim_ros.engine.maths.rotation import exponential, multiply, rotate, rotate_back
from rigid_sim_ros.engine.state.rates import angular_momentum, angular_velocity

# Attitude and angular velocity (body axes) after 100 s of a body with the principal moments 1, 2,
# 3 kg m^2 that starts at no rotation with w = (0.01, 5, 0.01) rad/s: Taylor series of order 24 in
# steps of 0.05 s with numbers of 34 digits, in which the energy stays to 1e-30. The axis of the
# middle moment is unstable: it flips on the way.
AFTER_100_S = (-0.00033532024701064178, 0.69467618661934152, 0.0065696244258204497,
               0.71929251583653713)


def angle_between(a, b) -> float:
    """Return the angle between two attitudes, exact for small ones, unlike an arccos."""
    ax, ay, az, aw = a
    difference = multiply((-ax, -ay, -az, aw), tuple(b))
    return 2.0 * float(np.linalg.norm(difference[:3]))


def free_body(w, moments=(1.0, 2.0, 3.0), step=1e-3) -> World:
    return World.from_dict({
        'format': 1, 'world': {'gravity': [0, 0, 0], 'step': step, 'contact': 'none'},
        'bodies': [{'name': 'body', 'shape': {'type': 'sphere', 'radius': 0.1},
                    'inertial': {'mass': 1.0, 'com': [0, 0, 0], 'inertia': [*moments, 0, 0, 0]},
                    'twist': {'angular': list(w)}}]})


def test_attitude_energy_and_momentum_over_100_s_of_flipping():
    world = free_body((0.01, 5.0, 0.01))
    L, E = world.angular_momentum[0], world.kinetic_energy()
    energy_drift = momentum_drift = 0.0
    for _ in range(1000):
        world.step(100)
        energy_drift = max(energy_drift, abs(world.kinetic_energy() / E - 1.0))
        change = np.linalg.norm(world.angular_momentum[0] - L)
        momentum_drift = max(momentum_drift, change / np.linalg.norm(L))
    assert angle_between(world.orientation[0], AFTER_100_S) <= 2e-6
    assert energy_drift <= 1e-12
    assert momentum_drift <= 1e-14


def test_a_symmetric_top_precesses_as_euler_says():
    # For moments (A, A, C) the body turns by w_z (1 - C / A) t against its own axis while that
    # axis precesses about L by |L| t / A: q(t) = exp(L t / A) q(0) exp(z w_z (1 - C / A) t).
    A, C, w = 1.0, 1.7, (0.8, 0.3, 4.0)
    world = free_body(w, (A, A, C))
    L = world.angular_momentum[0]
    world.step(20_000)
    t = 20.0
    about_L = exponential(tuple(L * t / A))
    spin = exponential((0.0, 0.0, w[2] * (1.0 - C / A) * t))
    # Order 5: a local error of the order (|w| h)^6 |w| / 1000, 2e-17 a step of 4e-3 rad; the rest
    # is rounding, 1e-16 sqrt(20 000) in w_z and so in the angle after 20 s.
    assert angle_between(world.orientation[0], multiply(about_L, spin)) < 1e-11


@given(st.floats(0.0, 3.0e4), st.integers(0, 2))
def test_a_rotation_about_a_principal_axis_is_exact_at_any_speed(speed, axis):
    w = [0.0, 0.0, 0.0]
    w[axis] = speed
    world = free_body(w, step=0.01)
    world.step(1)
    # cos and sin of an angle of up to 150 rad lose 150 * 1e-16, and as much in each of 1000
    # substeps.
    expected = exponential(tuple(0.01 * c for c in w))
    assert angle_between(world.orientation[0], expected) < 1e-12


def error_after_one_second(step: float) -> float:
    coarse, fine = free_body((1.0, 2.0, 0.5), step=step), free_body((1.0, 2.0, 0.5), step=1e-4)
    coarse.step(round(1.0 / step))
    fine.step(10_000)
    return angle_between(coarse.orientation[0], fine.orientation[0])


def test_the_attitude_converges_with_order_five():
    # A method of order p makes errors that fall by 2^p when the step is halved; 2^4.5 keeps order
    # 4 out.
    assert error_after_one_second(0.04) / error_after_one_second(0.02) > 2 ** 4.5


@given(st.tuples(*[st.floats(-0.28, 0.28)] * 3))
def test_small_exponential_is_the_exponential(r):
    # |r| <= 0.28 sqrt(3) < 2 MAX_ANGLE
    assert np.allclose(small_exponential(r), exponential(r), rtol=0.0, atol=2.3e-16)


@given(st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_the_fast_and_the_slow_way_to_turn_agree(L):
    q, inv_I = (0.5, 0.5, 0.5, 0.5), (1.0, 1 / 2, 1 / 3)
    h = 0.1  # |w| h <= sqrt(3) * 0.1 < MAX_ANGLE: one substep
    assert np.allclose(turn(q, L, inv_I, h), turn_fast(q, L, inv_I, h), rtol=0.0, atol=1e-15)


def test_a_fast_asymmetric_body_keeps_its_energy():
    # 500 rad/s at 10 ms are 5 rad a step, far beyond one call of `turn`.
    q, L, inv_I = (0.0, 0.0, 0.0, 1.0), (300.0, 900.0, 500.0), (1.0, 1 / 2, 1 / 3)

    def energy(q):
        in_body = rotate_back(q, L)
        return 0.5 * sum(a * c * c for a, c in zip(inv_I, in_body, strict=True))

    start = energy(q)
    for _ in range(100):
        q = turn_fast(q, L, inv_I, 0.01)
    # 100 steps of 20 substeps of MAX_ANGLE, each off by some MAX_ANGLE^6 / 1000 = 2e-7 rad.
    assert abs(energy(q) / start - 1.0) < 2000 * MAX_ANGLE ** 6 / 1000


def test_a_body_too_fast_to_follow_stays_a_rotation():
    world = free_body((1e10, 1e9, 1e8))
    world.step(10)
    assert math.isclose(float(np.linalg.norm(world.orientation[0])), 1.0, abs_tol=1e-12)


def test_a_body_turns_the_same_whatever_is_beside_it():
    def bodies(count, speed_of_last):
        rng = np.random.default_rng(5)
        spins = rng.normal(size=(count, 3))
        spins[-1] *= speed_of_last
        return World.from_dict({
            'format': 1, 'world': {'contact': 'none'},
            'bodies': [{'name': f'b{i}', 'shape': {'type': 'box', 'size': [0.1, 0.2, 0.3]},
                        'mass': 1.0, 'twist': {'angular': spins[i].tolist()}}
                       for i in range(count)]})

    slow, fast = bodies(11, 1.0), bodies(11, 1e4)
    slow.step(50)
    fast.step(50)
    assert np.array_equal(slow.orientation[:10], fast.orientation[:10])


@pytest.mark.parametrize('batches', [[60], [1] * 60, [7, 23, 30]])
def test_how_the_steps_are_spread_over_calls_changes_nothing(batches):
    world = free_body((1.0, 2.0, 3.0))
    expected = free_body((1.0, 2.0, 3.0))
    expected.step(60)
    for count in batches:
        world.step(count)
    assert world.state_hash() == expected.state_hash()


@pytest.mark.parametrize('moments', [(1.0, 1.0, 1e-6), (1.0, 1.001, 1e-3), (1e-5, 1.0, 1.0)])
def test_what_spins_faster_than_a_step_resolves_keeps_its_energy(moments):
    # A needle that spins about its axis and tumbles, by 100 to 1e7 rad.
    q, inv_I = (0.5, 0.5, -0.5, 0.5), tuple(1.0 / np.array(moments))
    along = int(np.argmin(moments))
    for spin in (1e2, 1e4, 1e7):
        w = np.array((0.3, 0.2, 0.4))
        w[along] = spin
        L = angular_momentum(q, tuple(rotate(q, tuple(w))), moments)
        q_later = turn_fast(q, L, inv_I, 1.0)
        before, after = (np.dot(L, angular_velocity(at, L, inv_I)) for at in (q, q_later))
        # By the mean of two moments that differ by 1e-3 that part of the tumbling energy, which
        # is less than a hundredth of that of the spin; else to the rounding of spin * eps, by
        # which the axis is off, times a ratio of moments of 1e6.
        assert after == pytest.approx(before, rel=1e-5)
