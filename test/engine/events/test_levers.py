# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Levers of forces that act for a while are those of the middle of the way."""

from types import SimpleNamespace

import numpy as np
import pytest

from rigid_sim_ros.engine.events.move import shift_levers
from rigid_sim_ros.kernels.kernel import in_python

SPAN = 0.01                         # s
MASS = np.array([2.0, 0.5])         # kg


def middle(acceleration):
    """Return how far (2, 3) [m] contact forces move two bodies until the middle of the span."""
    # With half a kick first, the velocity of the drift is the one of the middle.
    velocity = 0.5 * SPAN * acceleration
    return 0.5 * SPAN * velocity


def test_the_levers_of_both_bodies_meet_at_one_point_in_the_middle_of_the_way():
    rng = np.random.default_rng(7)
    model = SimpleNamespace(inv_m=1.0 / MASS)
    shapes = SimpleNamespace(still=np.zeros(2), half_width=np.ones(2))
    r = rng.normal(size=(2, 1, 3))
    contacts = SimpleNamespace(body_a=np.array([0]), body_b=np.array([1]),
                               shape_a=np.array([0]), shape_b=np.array([1]),
                               r_A=r[0].copy(), r_B=r[1].copy())
    bodies = SimpleNamespace(acceleration=rng.normal(size=(2, 3)))
    rows = SimpleNamespace(z=rng.normal(size=(2, 3)), stiff=np.ones(1), f=np.ones(1))
    chosen, assumed = np.array([0]), rng.normal(size=(2, 3))
    arguments = model, shapes, contacts, bodies, chosen, 1, rows, SPAN
    # The levers are right for the accelerations that were assumed: both end at x + r.
    x = np.array([-r[0, 0], -r[1, 0]]) - middle(assumed)
    now = bodies.acceleration + rows.z
    assert in_python(shift_levers)(*arguments, 1e-9, assumed)
    ends = x + middle(now) + np.array([contacts.r_A[0], contacts.r_B[0]])
    # Sums of some terms of 1 m.
    assert ends[0] == pytest.approx(ends[1], abs=1e-15)
    # The point goes along with the light body, in the ratio of the masses.
    moved = np.array([contacts.r_A[0] - r[0, 0], contacts.r_B[0] - r[1, 0]])
    assert moved[0] / MASS[0] + moved[1] / MASS[1] == pytest.approx(np.zeros(3), abs=1e-15)
    assert assumed == pytest.approx(now, abs=0.0)
    # What is right already stays.
    before = contacts.r_A.copy()
    assert not in_python(shift_levers)(*arguments, 1e-9, assumed)
    assert contacts.r_A == pytest.approx(before, abs=0.0)
