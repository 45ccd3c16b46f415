# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Forces of the interior point method against statics, Coulomb's law and another order."""

import numpy as np
import pytest

from rigid_sim_ros.engine.contact.contact_newton import make_newton
from rigid_sim_ros.engine.contact.contact_rows import make_rows, Rows
from rigid_sim_ros.engine.contact.coulomb import COMPLIANCE, TOLERANCE
from rigid_sim_ros.engine.contact.interior_point import approach_solution, make_interior

G = 9.81
CORNERS = [(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]


def column(masses, mu, pull, order=None, width=3):
    """Return the rows of a column of cubes of 1 m on the ground, and how many points it has."""
    points = [(k, corner) for k in range(len(masses)) for corner in CORNERS]
    points = [points[i] for i in (order if order is not None else range(len(points)))]
    m = len(points)
    rows = make_rows(m, width * m, len(masses) + 1)
    rows.at[:], rows.first[:] = 12 * np.arange(width * m), 2 * np.arange(m + 1)
    rows.mu[:, :mu.size] = mu
    for c, (k, corner) in enumerate(points):
        rows.body[c] = rows.moved[2 * c:2 * c + 2] = (k, k + 1)
        for p in range(width):
            _write_row(rows, c, width * c + p, p, masses, np.array(corner), pull, k)
    rows.compliance[:] = COMPLIANCE * rows.stiff
    return rows, m


def _write_row(rows: Rows, c, i, p, masses, corner, pull, k):
    e = [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)][p % 3]
    for side, (body, sign, height) in enumerate(((k, -1.0, 0.5), (k + 1, 1.0, -0.5))):
        at, turn = 6 * side, np.cross((*corner, height), e) if p < 3 else np.array(e)
        rows.G[i, at:at + 3] = sign * np.array(e) if p < 3 else 0.0
        rows.G[i, at + 3:at + 6] = sign * turn
        if body == 0:
            continue
        mass = masses[body - 1]
        rows.W[12 * i + at:12 * i + at + 3] = rows.G[i, at:at + 3] / mass
        rows.W[12 * i + at + 3:12 * i + at + 6] = rows.G[i, at + 3:at + 6] * 6.0 / mass
        rows.stiff[i] += rows.G[i, at:at + 6] @ rows.W[12 * i + at:12 * i + at + 6]
        acceleration = np.array((pull, 0.0, -G)) if p < 3 else np.zeros(3)
        rows.b[i] += rows.G[i, at:at + 3] @ acceleration


def solved(rows, m, masses, width=3):
    """Solve it; return the forces (m, w), and how many iterations that took."""
    bodies = len(masses)
    newton = make_newton(m, width * m, bodies, bodies + 1)
    newton.slot[:] = np.arange(-1, bodies)
    turns, left = approach_solution(rows, m, width, bodies, G, TOLERANCE * G, False,
                                    np.zeros(width * m), newton,
                                    make_interior(m, width * m, bodies))
    assert left <= TOLERANCE * G
    return rows.f.reshape(m, width), turns


def test_forces_bear_a_column_whatever_its_masses():
    rng = np.random.default_rng(1)
    for most in (0.0, 3.0, 7.0):
        masses = 10.0 ** rng.uniform(-0.5 * most, 0.5 * most, 10)
        f, turns = solved(*column(masses, np.array([0.5]), 0.0), masses)
        borne = f[:, 0].reshape(10, 4).sum(axis=1)
        above = G * np.cumsum(masses[::-1])[::-1]
        # Each cube may fall with TOLERANCE g, and rounding of a sum of 10 cubes be the largest's.
        assert np.abs(borne - above).max() <= 20.0 * TOLERANCE * G * masses.sum()
        assert turns <= 25


def test_a_pulled_column_slides_where_friction_ends_and_is_not_lifted():
    masses = np.array([1.0, 2.0, 3.0])
    rows, m = column(masses, np.array([0.6]), 0.5 * G)
    rows.mu[:4, 0] = 0.2
    f, _ = solved(rows, m, masses)
    rates = rows.a.reshape(m, 3)
    # The lowest gap slides as a whole, with 0.5 g - 0.2 g.
    assert rates[:4, 1] == pytest.approx(0.3 * G, abs=100.0 * TOLERANCE * G)
    assert np.abs(rates[:4, 0]).max() <= 100.0 * TOLERANCE * G
    assert f[:4, 1] == pytest.approx(-0.2 * f[:4, 0], rel=1e-5)


def test_the_order_of_the_points_does_not_matter():
    masses = np.array([1.0, 1e3, 1e-2, 10.0])
    order = np.random.default_rng(2).permutation(16)
    f, _ = solved(*column(masses, np.array([0.7]), 0.4 * G), masses)
    g, _ = solved(*column(masses, np.array([0.7]), 0.4 * G, order), masses)
    # Redundant forces too, to what rounding leaves of an iteration: 1e-16 / TOLERANCE and less.
    assert np.abs(g - f[order]).max() <= 1e-7 * np.abs(f).max()


def test_what_resists_rolling_and_spinning_is_within_its_limits():
    masses, mu = np.array([2.0]), np.array([0.5, 0.05, 0.02])
    rows, m = column(masses, mu, 0.3 * G, width=6)
    f, _ = solved(rows, m, masses, 6)
    assert f[:, 1].sum() == pytest.approx(-0.3 * G * 2.0, rel=1e-5)
    limit = 1.0 + 1e-9
    assert (np.hypot(f[:, 1], f[:, 2]) <= 0.5 * limit * f[:, 0]).all()
    assert (np.abs(f[:, 3]) <= 0.05 * limit * f[:, 0]).all()
    assert (np.hypot(f[:, 4], f[:, 5]) <= 0.02 * limit * f[:, 0]).all()


def test_without_friction_nothing_pulls_aside():
    masses = np.array([1.0, 5.0])
    f, _ = solved(*column(masses, np.array([0.0]), 0.3 * G), masses)
    assert (f[:, 1:] == 0.0).all()
    assert f[:4, 0].sum() == pytest.approx(6.0 * G, rel=1e-5)
