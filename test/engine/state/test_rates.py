# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How fast turning moves the points of a body: a bound that holds and that is near."""

import itertools

import numpy as np
import pytest

from rigid_sim_ros.engine.dynamics.forces import WIDTH
from rigid_sim_ros.engine.dynamics.free_rotation import turn_fast
from rigid_sim_ros.engine.maths.rotation import to_matrix
from rigid_sim_ros.engine.model.inertia import MassProperties
from rigid_sim_ros.engine.model.kinds.table import BOX, CAPSULE, CONE, CYLINDER, ELLIPSOID
from rigid_sim_ros.engine.model.model import Body, build_model, ForceTable
from rigid_sim_ros.engine.model.shapes import build_shapes, Shape
from rigid_sim_ros.engine.state.rates import angular_velocity, fastest_turning, velocity_at

# Kind, row of sizes, half lengths of a box around it.
THIN = {'needle': (CAPSULE, (0.001, 0.5, 0.0), (0.001, 0.001, 0.501)),
        'rod': (CYLINDER, (0.01, 0.5, 0.0), (0.01, 0.01, 0.5)),
        'thorn': (CONE, (0.01, 0.5, 0.0), (0.01, 0.01, 0.5)),
        'card': (BOX, (0.5, 0.3, 0.001), (0.5, 0.3, 0.001)),
        'slat': (BOX, (0.5, 0.02, 0.005), (0.5, 0.02, 0.005)),
        'lens': (ELLIPSOID, (0.5, 0.5, 0.01), (0.5, 0.5, 0.01))}


def build(kind, size, half, q=(0.0, 0.0, 0.0, 1.0), offset=(0.0, 0.0, 0.0)):
    """Return model and shapes of a body with the moments of a box, its shape put at a pose."""
    R, a = np.array(to_matrix(q)), np.array(half)
    moments = R @ np.diag((a @ a - a * a) / 3) @ R.T
    nothing = np.zeros(0, dtype=np.int64)
    model = build_model([Body(MassProperties(1.0, np.array(offset), moments), False)], [],
                        ForceTable(nothing, nothing, nothing, np.zeros((0, WIDTH))), 1e-3,
                        (0.0, 0.0, 0.0))
    return model, build_shapes(model, [Shape(0, kind, size, offset, q)])


def surface_points(kind, half):
    """Return points of a shape or of a box in it, (3, k) [m]; of what is round at its ends."""
    corners = half * np.array(list(itertools.product((-1, 1), repeat=3)))
    if kind != BOX:
        ends = np.concatenate([half * np.eye(3), -half * np.eye(3)])
        # On the axis of a capsule or an apex, and around the rims of discs.
        rims = half * np.array([(x, y, z) for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))
                                for z in (-1, 1)])
        corners = rims if kind == CYLINDER else ends
    return corners.T


def bound(model, shapes, attitude, L):
    """Return the bound for the shape [m/s]."""
    radius = float(shapes.bound[0] + np.linalg.norm(shapes.p_CS[0]))
    return fastest_turning(attitude, L, tuple(model.inv_I_C[:, 0]), radius, shapes.mobility[0])


def random_start(rng, model):
    """Return an attitude and an angular momentum [kg m^2/s], as of what tumbles or spins."""
    q = rng.normal(size=4)
    q = tuple(q / np.linalg.norm(q))
    return q, tuple(rng.normal(size=3) * 10 ** rng.uniform(-2, 1))


@pytest.mark.parametrize('name', THIN)
def test_no_point_is_faster_than_the_bound_while_the_body_flies(name):
    rng, (kind, size, half) = np.random.default_rng(0), THIN[name]
    corners = surface_points(kind, np.array(half))
    for _ in range(20):
        turned = rng.normal(size=4)
        model, shapes = build(kind, size, half, tuple(turned / np.linalg.norm(turned)),
                              tuple(rng.uniform(-1, 1, 3)))
        # Axes and origin of the shape from the centre of mass.
        points = (shapes.p_CS[0][:, None]
                  + np.array(to_matrix(tuple(shapes.q_CS[0]))) @ corners)
        attitude, L = random_start(rng, model)
        most, inv_I = bound(model, shapes, attitude, L), tuple(model.inv_I_C[:, 0])
        step = 0.1 / np.linalg.norm(angular_velocity(attitude, L, inv_I))
        for _ in range(50):
            w = angular_velocity(attitude, L, inv_I)
            arms = np.array(to_matrix(attitude)) @ points
            assert np.linalg.norm(np.cross(w, arms, axisb=0), axis=1).max() <= most * (1 + 1e-9)
            attitude = turn_fast(attitude, L, inv_I, step)


@pytest.mark.parametrize('name', ['needle', 'rod', 'slat'])
def test_of_what_is_long_the_bound_is_near_what_its_ends_do(name):
    model, shapes = build(*THIN[name])
    # About an axis across: its ends move by w l / 2. The bound is that times the root of
    # (sum d^2 / I) I / (l / 2)^2: 2 for the axes across, 1.5 at most for the axis along, whose
    # corners are sqrt(3) radii of gyration away.
    inv_I = model.inv_I_C[:, 0]
    across = int(np.argmin(inv_I))
    L = np.zeros(3)
    L[across] = 1.0
    upright = (0.0, 0.0, 0.0, 1.0)
    ends = inv_I[across] * max(THIN[name][2])
    assert bound(model, shapes, upright, tuple(L)) <= 2.0 * ends
    assert inv_I.max() * max(THIN[name][2]) > 100.0 * ends


def test_a_point_of_what_turns_to_the_left_goes_to_the_left():
    """Seen from above, with w along z, a point on the x axis goes along y; v comes on top."""
    v, w, r = (1.0, 0.0, 0.0), (0.0, 0.0, 2.0), (3.0, 0.0, 0.0)
    assert velocity_at.py_func(v, w, r) == (1.0, 6.0, 0.0)
