# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What fixed joints make one body of, against the sums of its masses and moments."""

from types import SimpleNamespace

import numpy as np
import pytest

from rigid_sim_ros.engine.joints.buffers import make_joint_work
from rigid_sim_ros.engine.joints.welded_bodies import longest_lever, welded_answer, welded_mass
from rigid_sim_ros.engine.model.joints import build_joints, FIXED, Joint, REVOLUTE
from rigid_sim_ros.kernels.kernel import in_python

# Three bodies that fixed joints hold in a row, and one that hangs on the last of these by a hinge.
MASS = np.array([1.0, 0.4, 2.5, 0.7])
CENTER = np.array([[0.1, 0.2, 0.3], [0.5, -0.2, 0.1], [-0.3, 0.4, 0.2], [0.2, 0.9, 0.6]])  # [m]
HINGE = np.array([0.0, 0.6, 0.4])  # [m]
WELDED = [0, 1, 2]


def joint(kind, a, b):
    """Return a joint between two bodies; where it is does not matter for the table."""
    none, q = np.zeros(3), np.array((0.0, 0.0, 0.0, 1.0))
    return Joint(kind, a, b, none, q, none, q)


def moments():
    """Return an inertia tensor [kg m^2] about the centre of each body, (4, 3, 3)."""
    turns = np.random.default_rng(3).normal(size=(4, 3, 3))
    return 0.01 * (turns @ turns.transpose(0, 2, 1) + np.eye(3))


def whole():
    """Return mass, centre and inertia of what is welded."""
    m = MASS[WELDED].sum()
    center = MASS[WELDED] @ CENTER[WELDED] / m
    arms = CENTER[WELDED] - center
    parts = zip(moments()[WELDED], MASS[WELDED], arms, strict=True)
    return m, center, sum(own + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
                          for own, mass, arm in parts)


def bodies():
    """Return the masses, the table and the places of the bodies, which hang on nothing."""
    table = build_joints([joint(FIXED, 0, 1), joint(FIXED, 1, 2), joint(REVOLUTE, 2, 3)], MASS)
    work = make_joint_work(table)
    I_C = np.array([np.linalg.eigvalsh(own) for own in moments()]).T
    for r, body in enumerate(table.body):
        # The joint on which the body hangs; of the first one the centre itself.
        p = CENTER[0] if r == 0 else HINGE if body == 3 else CENTER[body] - (0.1, 0.0, 0.2)
        work.p[r], work.com[r] = p, CENTER[body] - p
        work.I_W[r] = moments()[body][np.triu_indices(3)]
        if table.parent[r] >= 0:
            work.arm[r] = p - work.p[table.parent[r]]
    return SimpleNamespace(m=MASS, I_C=I_C), table, work


def test_their_mass_is_that_of_all():
    model, table, _ = bodies()
    found = [in_python(welded_mass)(model, table, r) for r in range(4)]
    assert found == pytest.approx([whole()[0]] * 3 + [0.7], rel=1e-15)


@pytest.mark.parametrize('r', WELDED)
def test_they_answer_to_an_impulse_as_one_body(r):
    model, table, work = bodies()
    m, center, inertia = whole()
    x, f, n = np.array([0.3, -0.1, 0.8]), np.array([1.0, 2.0, -0.5]), np.array([0.2, 0.0, 0.7])
    about = n + np.cross(x - center, f)
    expected = f @ f / m + about @ np.linalg.solve(inertia, about)
    found = in_python(welded_answer)(model, table, work, r, tuple(x), tuple(f), tuple(n))
    assert found == pytest.approx(expected, rel=1e-13)


def test_the_joints_between_them_are_no_levers():
    model, table, work = bodies()
    m, center, inertia = whole()
    # From the first body to the common centre and to the hinge, from that to the last body.
    levers = [np.linalg.norm(center - CENTER[0]), np.linalg.norm(HINGE - CENTER[0]),
              np.linalg.norm(CENTER[3] - HINGE)]
    gyration = [np.linalg.eigvalsh(inertia)[2] / m, np.linalg.eigvalsh(moments()[3])[2] / MASS[3]]
    expected = max(*levers, *np.sqrt(gyration))
    assert in_python(longest_lever)(model, table, work, 0) == pytest.approx(expected, rel=1e-14)
