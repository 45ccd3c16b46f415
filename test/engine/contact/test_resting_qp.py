# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Contact forces against statics, against their conditions, and with a solver that fails."""

from effort import examples
from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros.engine.contact import resting_qp
from rigid_sim_ros.engine.contact.coulomb import COMPLIANCE, TOLERANCE
from rigid_sim_ros.engine.contact.resting_qp import solve

G = 9.81
CORNERS = [(x, y, -0.5) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]


def cube_on_slope(angle, mu, slip=0.0):
    """Return A, b, mu for a cube of 1 kg and 1 m on a slope, sliding, at a step of 1 ms."""
    rows = [np.append(axis, np.cross(r, axis)) for r in CORNERS
            for axis in ((0, 0, 1.0), (1.0, 0, 0), (0, 1.0, 0))]
    J = np.array(rows)
    A = J @ np.diag([1.0] * 3 + [6.0] * 3) @ J.T
    gravity = np.array([G * np.sin(angle), 0, -G * np.cos(angle), 0, 0, 0])
    return A, J @ gravity + np.tile([0, 1e3 * slip, 0], 4), np.full(4, mu)


def test_the_ground_carries_the_weight_evenly():
    A, b, mu = cube_on_slope(0.0, 0.5)
    f, outcome = solve(A, b, mu, np.zeros(12))
    # Compliance makes the forces smaller by its own size.
    assert f == pytest.approx(np.tile([0.25 * G, 0, 0], 4), abs=2.0 * COMPLIANCE * G)
    assert outcome.solved


def test_friction_below_its_limit_holds():
    A, b, mu = cube_on_slope(0.3, 0.5)
    f, _ = solve(A, b, mu, np.zeros(12))
    assert f[1::3].sum() == pytest.approx(-G * np.sin(0.3), rel=1e-7)
    assert np.abs(A @ f + b).max() < 1e-6


@pytest.mark.parametrize('slip', [0.0, 0.01, 1.0])
def test_friction_at_its_limit_pulls_against_the_slip_without_lifting(slip):
    A, b, mu = cube_on_slope(0.6, 0.2, slip)
    f, _ = solve(A, b, mu, np.zeros(12))
    a = A @ f + b
    assert f[1::3] == pytest.approx(-0.2 * f[::3], rel=1e-12)
    assert np.abs(a[::3]).max() < 1e-6  # not mu |a_t|, which the convex problem alone would give


def residual(A, b, mu, f):
    """Return how far forces are from the conditions, relative to max |b|; see `Outcome`."""
    f, a, stiff = f.reshape(-1, 3), (A @ f + b).reshape(-1, 3), np.diag(A).reshape(-1, 3)
    along = np.abs(f[:, 0] - np.maximum(0.0, f[:, 0] - a[:, 0] / stiff[:, 0])) * stiff[:, 0]
    across = stiff[:, 1:].max(axis=1)
    w = f[:, 1:] - a[:, 1:] / across[:, None]
    limit, size = mu * np.maximum(0.0, f[:, 0]), np.hypot(*w.T)
    w *= np.where(size > limit, limit / np.maximum(size, 1e-300), 1.0)[:, None]
    off = np.abs(f[:, 1:] - w).max(axis=1) * across
    return max(along.max(), off.max()) / np.abs(b).max()


@examples(40)
@given(st.integers(0, 2 ** 32 - 1), st.integers(1, 6))
def test_random_problems_meet_the_conditions(seed, points):
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(3 * points, 6 * max(1, points // 2)))
    # Accelerations of rigid bodies, so that b and A belong together.
    A, b, mu = J @ J.T, 5.0 * J @ rng.normal(size=J.shape[1]), rng.uniform(0.0, 1.0, points)
    f, outcome = solve(A, b, mu, np.zeros(3 * points))
    # Of the problem as it is, without the compliance that the solver adds.
    assert residual(A, b, mu, f) < 1e-5
    assert outcome.solved == (outcome.residual <= TOLERANCE)
    assert outcome.solved


def test_osqp_is_not_needed_while_the_same_points_press():
    A, b, mu = cube_on_slope(0.6, 0.2)
    f, _ = solve(A, b, mu, np.zeros(12))
    again, outcome = solve(A, 1.001 * b, mu, f)
    assert outcome.osqp_iterations == 0
    assert again == pytest.approx(1.001 * f, rel=1e-7)  # forces of redundant points: compliance


def test_the_same_bits_twice():
    A, b, mu = cube_on_slope(0.6, 0.2)
    assert solve(A, b, mu, np.zeros(12))[0].tobytes() == solve(A, b, mu, np.zeros(12))[0].tobytes()


def test_osqp_alone_finds_how_a_cube_slides(monkeypatch):
    # Without the term s of the program it would lift the cube by mu |a_t|: 0.2 * 4 m/s^2.
    monkeypatch.setattr(resting_qp, 'NEWTON_STEPS', 0)
    monkeypatch.setattr(resting_qp, 'SWEEPS', 0)
    monkeypatch.setattr(resting_qp, 'LAST_SWEEPS', (0,))
    A, b, mu = cube_on_slope(0.6, 0.2)
    f, _ = solve(A, b, mu, np.zeros(12))
    assert np.abs((A @ f + b)[::3]).max() < 1e-3


def test_osqp_alone_keeps_a_torque_within_its_cone(monkeypatch):
    monkeypatch.setattr(resting_qp, 'NEWTON_STEPS', 0)
    monkeypatch.setattr(resting_qp, 'SWEEPS', 0)
    monkeypatch.setattr(resting_qp, 'LAST_SWEEPS', (0,))
    A = np.diag([1.0, 3.5, 3.5, 2.5, 2.5, 2.5])
    f, _ = solve(A, np.array([-G, 0, 0, 50.0, 30.0, 40.0]), np.array([[0.3, 0.02, 0.05]]),
                 np.zeros(6))
    assert f[3] == pytest.approx(-0.02 * f[0], rel=1e-6)
    assert np.hypot(*f[4:]) == pytest.approx(0.05 * f[0], rel=1e-6)  # along an edge of the pyramid


def test_what_osqp_could_not_solve_is_said(monkeypatch):
    monkeypatch.setattr(resting_qp, 'ROUNDS', 1)
    monkeypatch.setattr(resting_qp, 'NEWTON_STEPS', 0)
    monkeypatch.setattr(resting_qp, 'SWEEPS', 0)
    monkeypatch.setattr(resting_qp, 'LAST_SWEEPS', (0,))
    monkeypatch.setitem(resting_qp.OSQP_SETTINGS, 'max_iter', 1)
    A, b, mu = cube_on_slope(0.6, 0.2)
    _, outcome = solve(A, b, mu, np.zeros(12))
    assert not outcome.solved
    assert outcome.status == 'maximum iterations reached'
    assert outcome.residual > TOLERANCE


def test_torques_against_rolling_and_spinning_obey_their_cones():
    # A ball on the ground that slides, rolls and spins: six rows, l = r.
    r, mu = 0.1, np.array([[0.3, 0.02, 0.05]])
    rows = np.zeros((6, 6))
    for i, axis in enumerate(np.roll(np.eye(3), 1, axis=0)):
        rows[i, :3], rows[i, 3:] = axis, np.cross((0, 0, -r), axis)
        rows[3 + i, 3:] = r * axis
    A = rows @ np.diag(1.0 / np.array([1.0] * 3 + [0.004] * 3)) @ rows.T
    b = rows @ np.array([50.0, 0, -G, 300.0, -400.0, 900.0])
    f, outcome = solve(A, b, mu, np.zeros(6))
    a = A @ f + b
    assert outcome.solved
    assert f[0] == pytest.approx(G, rel=1e-7)
    assert np.hypot(*f[1:3]) == pytest.approx(0.3 * f[0], rel=1e-9)
    assert f[3] == pytest.approx(-0.02 * f[0] * np.sign(a[3]), rel=1e-9)
    assert f[4:] == pytest.approx(-0.05 * f[0] * a[4:] / np.hypot(*a[4:]), rel=1e-9)


def test_points_on_the_verge_of_slipping_are_solved():
    # Six redundant points that carry almost all that friction allows.
    points = [(0.1 * np.cos(x), 0.1 * np.sin(x), -0.02) for x in np.linspace(0, 5, 6)]
    rows = np.array([np.append(axis, np.cross(p, axis)) for p in points
                     for axis in ((0, 0, 1.0), (1.0, 0, 0), (0, 1.0, 0))])
    A = rows @ np.diag([1.0] * 3 + [200.0] * 3) @ rows.T
    b = rows @ np.array([0.49999 * G, 0, -G, 0, 0, 0])
    f, outcome = solve(A, b, np.full(6, 0.5), np.zeros(18))
    assert outcome.solved
    assert f[1::3].sum() == pytest.approx(-0.49999 * G, rel=1e-6)
