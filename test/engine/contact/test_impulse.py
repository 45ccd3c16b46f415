# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Impulses at the points of one pair of bodies against formulas and conservation laws."""

from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros.engine.contact import impulse
from rigid_sim_ros.engine.contact.impulse import make_room
from rigid_sim_ros.kernels.kernel import in_python

# To compile it takes longer than it takes in Python.
solve_impact = in_python(impulse.solve_impact)


def impact(A, u0, mu, e, J):
    """Write the impulses J, (wm,), at m points with mu (m,), or (m, 3) with rows that turn."""
    m, rows = len(e), len(u0)
    room = make_room(m, rows // m)
    room.A[:], room.u0[:], room.e[:] = A, u0, e
    room.mu[:, :mu.reshape(m, -1).shape[1]] = mu.reshape(m, -1)
    solve_impact(room, m, rows // m)
    J[:] = room.J


def solve(A, u0, mu, e):
    m = len(A) // 3
    J = np.zeros(3 * m)
    impact(np.array(A, dtype=float), np.array(u0, dtype=float), np.full(m, float(mu)),
           np.full(m, float(e)), J)
    return J


def on_ground(points, mass, moments):
    """Return A for a body on fixed ground that touches at points seen from its centre of mass."""
    rows = [np.append(axis, np.cross(r, axis)) for r in points
            for axis in ((0, 0, 1.0), (1.0, 0, 0), (0, 1.0, 0))]
    J = np.array(rows)
    return J @ np.diag(1.0 / np.array([mass] * 3 + list(moments))) @ J.T


CORNERS = [(x, y, -0.5) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
BALL = on_ground([(0, 0, -0.1)], 2.0, [0.4 * 2.0 * 0.01] * 3)
CUBE = on_ground(CORNERS, 1.0, [1.0 / 6.0] * 3)


def test_the_normal_impulse_reverses_the_approach_times_e():
    J = solve(BALL, [-3.0, 0, 0], 0.5, 0.7)
    assert pytest.approx([2.0 * 1.7 * 3.0, 0, 0], rel=1e-14) == J  # M (1 + e) v


def test_a_rough_ball_leaves_rolling():
    # Sticking takes M u / (1 + M r^2 / I) = 2/7 M u along the surface.
    J = solve(BALL, [-3.0, 1.0, 0], 0.5, 0.0)
    assert J[1] == pytest.approx(-2.0 / 7.0 * 2.0, rel=1e-14)


def test_a_smooth_ball_slips_with_mu_times_the_normal_impulse_against_the_slip():
    J = solve(BALL, [-3.0, 3.0, 4.0], 0.1, 0.0)
    assert J[1:] == pytest.approx(-0.1 * 6.0 * np.array([0.6, 0.8]), rel=1e-12)


def test_a_box_that_lands_flat_leaves_flat():
    u0 = np.tile([-2.0, 0, 0], 4)
    u1 = u0 + CUBE @ solve(CUBE, u0, 0.5, 0.5)
    assert u1 == pytest.approx(np.tile([1.0, 0, 0], 4), abs=1e-13)


def test_a_point_that_separates_is_not_held():
    u0 = np.array([-1.0, 0, 0, 5.0, 0, 0, -1.0, 0, 0, 5.0, 0, 0])
    J = solve(CUBE, u0, 0.0, 0.0)
    assert (J[::3] >= 0.0).all()
    assert (u0 + CUBE @ J)[::3].min() > -1e-13


@given(st.integers(0, 2 ** 32 - 1), st.integers(1, 4), st.floats(0, 1.5), st.floats(0, 1))
def test_no_impact_makes_energy_or_leaves_the_cone(seed, points, mu, e):
    rng = np.random.default_rng(seed)
    A = on_ground(rng.normal(size=(points, 3)), 1.0, rng.uniform(0.1, 1.0, 3))
    # Velocities of a rigid body, so that they and A belong together.
    u0 = A @ rng.normal(size=3 * points)
    J = solve(A, u0, mu, e)
    work = J @ (u0 + 0.5 * A @ J)
    # The sweeps end when impulses move no more to 1e-16; slow ones leave 1e-9 of the largest.
    assert work <= 1e-9 * max(np.abs(J * u0).sum(), 1e-30)
    assert (J[::3] >= 0.0).all()
    assert (np.hypot(J[1::3], J[2::3]) <= mu * J[::3] * (1.0 + 1e-12) + 1e-300).all()


def test_restitution_with_friction_gives_up_rebound_rather_than_make_energy():
    # A slanting rod hits and its tip sticks: Newton's rule alone would add energy here (Kane,
    # Levinson).
    c, s = np.cos(1.0), np.sin(1.0)
    A = on_ground([(-0.5 * c, 0, -0.5 * s)], 1.0, [1.0 / 12.0] * 3)
    u0 = np.array([-1.0, 0.7, 0.0])
    newton = np.append(np.linalg.solve(A[:2, :2], [2.0, -0.7]), 0.0)
    assert abs(newton[1]) < 0.4 * newton[0]  # it does stick
    assert newton @ (u0 + 0.5 * A @ newton) > 0.1
    J = solve(A, u0, 0.4, 1.0)
    assert J @ (u0 + 0.5 * A @ J) <= 1e-15
    assert pytest.approx(2.0 * solve(A, u0, 0.4, 0.0), rel=1e-12) == J  # (1 + e) of the plastic


@pytest.mark.parametrize('seed', range(6))
@pytest.mark.parametrize('order', [(2, 0, 3, 1), (3, 2, 1, 0)])
def test_the_order_of_points_does_not_matter(seed, order):
    rng = np.random.default_rng(seed)
    v = np.append(-1.0, rng.normal(size=2))
    u0, at = np.tile(v, 4), np.concatenate([np.arange(3) + 3 * k for k in order])
    # A cube lands flat and slides with a friction that the corners share in many ways.
    J = solve(CUBE, u0, 0.3, 0.0)
    other = solve(CUBE[np.ix_(at, at)], u0[at], 0.3, 0.0)
    # What sweeps take of what the points give way, 1e-8, they do in the order of the points.
    assert other == pytest.approx(J[at], abs=1e-6 * np.abs(J).max())


def turning_ball(spinning, rolling, w):
    """Return rates before and after of a ball of 2 kg and 0.1 m that lands at 3 m/s, turning."""
    r, m, inertia = 0.1, 2.0, 0.4 * 2.0 * 0.01
    rows = np.zeros((6, 6))  # n, t1, t2, and l w_n, l w_t1, l w_t2 with l = r: (v, w) to rates
    for i, axis in enumerate(np.roll(np.eye(3), 1, axis=0)):
        rows[i, :3], rows[i, 3:] = axis, np.cross((0, 0, -r), axis)
        rows[3 + i, 3:] = r * axis
    A = rows @ np.diag(1.0 / np.array([m] * 3 + [inertia] * 3)) @ rows.T
    u0 = rows @ np.array([0, 0, -3.0, *w])
    J = np.zeros(6)
    impact(A, u0, np.array([[0.0, spinning / r, rolling / r]]), np.array([0.5]), J)
    return J, u0, u0 + A @ J, inertia


def test_an_impact_takes_spin_with_its_lever():
    J, u0, u1, inertia = turning_ball(0.002, 0.0, (0, 0, 10.0))
    assert J[0] == pytest.approx(2.0 * 1.5 * 3.0, rel=1e-14)
    # l dw = l lever J_n / I
    assert u1[3] - u0[3] == pytest.approx(-0.1 * 0.002 * J[0] / inertia, rel=1e-12)


def test_an_impact_takes_rolling_with_its_lever_against_its_direction():
    J, u0, u1, inertia = turning_ball(0.0, 0.003, (6.0, 8.0, 0))
    lost = 0.1 * 0.003 * J[0] / inertia * np.array([0.6, 0.8])
    assert u0[4:] - u1[4:] == pytest.approx(lost, rel=1e-9)


def test_an_impact_stops_what_turns_slower_than_its_lever_could():
    assert np.abs(turning_ball(0.01, 0.01, (0.1, 0.2, 0.3))[2][3:]).max() < 1e-12
