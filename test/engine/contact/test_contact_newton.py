# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Newton's method for rows of contact: what it keeps from step to step."""

import numpy as np
import pytest

from rigid_sim_ros.engine.contact import contact_newton, contact_rows
from rigid_sim_ros.engine.contact.contact_newton import make_newton
from rigid_sim_ros.engine.contact.contact_rows import make_rows
from rigid_sim_ros.kernels.kernel import in_python

# To compile these takes longer than they take in Python.
newton_step = in_python(contact_newton.newton_step)
violation = in_python(contact_rows.violation)
write_matrix = in_python(contact_rows.write_matrix)
CORNERS = ((0.3, 0.2), (-0.3, 0.2), (0.3, -0.2), (-0.3, -0.2))


def standing():
    """Return the rows of a block of 2 kg that is pulled, with four corners on the ground."""
    rows, inv_m, inv_I = make_rows(4, 12, 2, matrix=12), 0.5, 3.0
    rows.first[:] = 2 * np.arange(5)
    for c, (x, y) in enumerate(CORNERS):
        rows.body[c] = rows.moved[2 * c:2 * c + 2] = 0, 1
        rows.mu[c, 0] = 0.6
        for p, e in enumerate(((0, 0, 1), (1, 0, 0), (0, 1, 0))):
            i = 3 * c + p
            rows.G[i, :3], rows.G[i, 6:9] = np.negative(e), e
            rows.G[i, 9:] = np.cross((x, y, -0.1), e)
            rows.at[i] = 12 * i
            moved = np.r_[inv_m * rows.G[i, 6:9], inv_I * rows.G[i, 9:]]
            rows.W[12 * i + 6:12 * i + 12] = moved
            rows.compliance[i] = 1e-5 * rows.G[i, 6:] @ moved
            rows.stiff[i] = rows.G[i, 6:] @ moved + rows.compliance[i]
            rows.b[i] = np.dot(e, (3.0, 0.5, -9.81))
            rows.f[i] = 0.25 * 2.0 * 9.81 if p == 0 else 0.0
    return rows


def steps(rows, keeps, by_forces):
    """
    Take steps from rows.f; return all forces on the way, and how often the factors stood.

    The friction gets less on the way, so that what stuck slides. keeps: factors are kept as they
    are, else they are forgotten before each step.
    """
    newton, found, kept = make_newton(4, 12, 1, 2, 12), [], 0
    newton.slot[:] = -1, 0
    if by_forces:
        write_matrix(rows, 4, 3, np.array((0.0, 0.5)))
    for n in range(8):
        rows.mu[:4, 0] = 0.6 if n < 4 else 0.2
        violation(rows, 4, 3, rows.f)
        rows.factored[0] = rows.factored[0] if keeps else 0
        before = newton.K.copy()
        assert newton_step(rows, 4, 3, 1, rows.f, newton)
        kept += np.array_equal(before, newton.K)
        found.append(rows.f.copy())
    return np.array(found), kept


@pytest.mark.parametrize('by_forces', [False, True])
def test_a_step_by_the_factors_of_the_one_before_has_the_bits_of_one_by_its_own(by_forces):
    found, kept = steps(standing(), True, by_forces)
    fresh, _ = steps(standing(), False, by_forces)
    assert (found == fresh).all()
    assert kept >= 2    # once all points stick, and until they slide


def test_the_matrix_of_two_bodies_that_move_is_that_of_their_rows():
    rows, inv_m = standing(), np.array((1.0, 0.5))
    for i in range(12):     # the ground gives way too
        rows.W[12 * i:12 * i + 6] = inv_m[0] * rows.G[i, :6]
    G, W = rows.G[:12], rows.W[:144].reshape(12, 12)
    write_matrix(rows, 4, 3, inv_m)
    # Sums of twelve products, in another order.
    assert rows.A.reshape(12, 12) == pytest.approx(G @ W.T, rel=0, abs=12 * 2.0 ** -52 * 10.0)
