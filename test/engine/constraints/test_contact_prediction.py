# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Contacts with the geometry of the time in which they act."""

from engine.stepping import TimestepScene
from engine.touching import ball, box, G, ground
import numpy as np
import pytest

from rigid_sim_ros.engine.detection.manifolds import ACTS, DORMANT, slice_in_use
from rigid_sim_ros.engine.maths.rotation_in_python import rotate
from rigid_sim_ros.engine.model.inertia import MassProperties
from rigid_sim_ros.engine.model.shapes import Material

NO_GRAVITY = (0.0, 0.0, 0.0)


@pytest.mark.parametrize('beside, stops', [(0.002, False), (-0.004, True)],
                         ids=['passes', 'meets'])
def test_what_passes_an_edge_within_a_step_is_dormant(beside, stops):
    # The nearest way between the cubes is across their edges, and along it they close by 0.1 m.
    start = np.array((0.6 + beside, 0.0, 0.62))
    fixed = box((1.0, 1.0, 1.0), 1.0)._replace(mass=None)
    cube = box((0.2, 0.2, 0.2), 1.0, position=start, velocity=(0.0, 0.0, -10.0))
    scene = TimestepScene([fixed, cube], Material(), 0.01, NO_GRAVITY)
    scene.step()
    rows = slice_in_use(scene.manifolds())
    assert rows.stop - rows.start == 1
    assert scene.work.collision.activity[rows].tolist() == [ACTS if stops else DORMANT]
    if stops:
        assert scene.v[2, 1] > -9.9
    else:
        assert scene.v[:, 1].tolist() == [0.0, 0.0, -10.0]
        assert scene.state.x[:, 1] == pytest.approx(start - (0.0, 0.0, 0.1), abs=1e-15)
        assert (scene.state.L[:, 1] == 0.0).all()


def test_what_meets_within_a_step_has_the_normal_of_that_moment():
    big, small = ball(0.5, 1.0)._replace(mass=None), ball(0.1, 1.0)
    start, v, h = np.array((0.35, 0.1, 0.55)), np.array((0.0, 0.0, -10.0)), 0.02
    scene = TimestepScene([big, small._replace(position=start, velocity=v)],
                          Material(friction=0.0), h, NO_GRAVITY)
    scene.step()
    # |start + t v| = 0.6.
    t = (start @ v + np.sqrt((start @ v) ** 2 - 100.0 * (start @ start - 0.36))) / -100.0
    assert 0.0 < t < h
    n = (start + t * v) / 0.6
    assert start @ n / np.linalg.norm(start) < 0.999    # it is another one at the start
    # Found to 1e-4 of the smaller radius, over the speed at which they close; 10 m/s turn n.
    within = 1e-5 / -(v @ n) * 10.0 / 0.6
    assert scene.manifolds().normal[0] == pytest.approx(n, abs=within)
    # Without friction nothing else is changed, and what closes stops.
    assert np.cross(scene.state.P[:, 1] - v, n) == pytest.approx(np.zeros(3), abs=10.0 * within)
    assert scene.state.P[:, 1] @ n == pytest.approx(0.0, abs=10.0 * within)


def test_levers_of_what_falls_until_it_meets_are_those_of_that_moment():
    big, small = ball(0.5, 1.0)._replace(mass=None), ball(0.1, 1.0)
    # By 0.06 m in the step, 0.04 m of it by the load; some 0.012 m are free.
    start, v, g, h = 0.61 * np.array((0.6, 0.0, 0.8)), (0.0, 0.0, -1.0), 200.0, 0.02
    scene = TimestepScene([big, small._replace(position=start, velocity=v)],
                          Material(friction=0.0), h, (0.0, 0.0, -g))
    scene.step()
    manifolds = scene.manifolds()
    n = manifolds.normal[0]
    assert n[0] > 0.6 + 1e-3    # it is another one at the start
    # Found to 1e-4 of the smaller radius.
    assert manifolds.r_B[0, 0] == pytest.approx(-0.1 * n, abs=1e-5)
    assert manifolds.r_A[0, 0] == pytest.approx(0.5 * n, abs=2e-5)


def drift_of_energy(h):
    """Return by how much the energy of a ball that rolls unevenly is off at most in 1 s [J]."""
    r, m, offset = 0.1, 1.0, 0.04
    mass = MassProperties(m, np.array((offset, 0.0, 0.0)), 0.4 * m * r ** 2 * np.eye(3))
    thing = ball(r, m, position=(0.0, 0.0, r), velocity=(0.0, 1.0, 0.0), spin=(-10.0, 0.0, 0.0))
    # The centre of mass is beside the axis of rolling.
    scene = TimestepScene([ground(), thing._replace(
        mass=mass, orientation=(0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)))],
        Material(friction=2.0), h)

    def energy():
        return scene.energy() + m * G * scene.state.x[2, 1]

    first, off = energy(), 0.0
    for _ in range(round(1.0 / h)):
        scene.step()
        off = max(off, abs(energy() - first))
        # It touches, and rolls: the middle of the ball is offset back from the centre of mass.
        middle = scene.state.x[:, 1] - offset * np.array(rotate(
            tuple(scene.state.q[:, 1]), (1.0, 0.0, 0.0)))
        assert middle[2] == pytest.approx(r, abs=1e-3)
    return off


def test_what_rolls_unevenly_keeps_its_energy_to_second_order():
    errors = np.array([drift_of_energy(h) for h in (1 / 500, 1 / 1000, 1 / 2000)])
    # A quarter of the step, a sixteenth of the error, where a method of first order has a quarter:
    # nearer to the former, as what swings back and forth cancels in part. w h = 0.02, so that of
    # second order is some 1e-4 of 0.4 J.
    assert errors[0] < 4e-5
    assert errors[0] / errors[2] > 8.0


@pytest.mark.parametrize('turned, bends', [(0.9, True), (1.1, False)])
def test_what_turns_by_more_than_a_radian_a_step_has_no_rate_of_its_geometry(turned, bends):
    h, r, m = 0.01, 0.1, 1.0
    mass = MassProperties(m, np.array((0.04, 0.0, 0.0)), 0.4 * m * r ** 2 * np.eye(3))
    spin = np.array((0.0, turned / h, 0.0))
    thing = ball(r, m, position=(0.0, 0.0, r), velocity=np.cross(spin, (0.0, 0.0, r)), spin=spin)
    scene = TimestepScene([ground(), thing._replace(mass=mass)], Material(friction=2.0), h)
    scene.step()
    rows, prediction = slice_in_use(scene.manifolds()), scene.work.prediction
    assert prediction.given[rows].tolist() == [1]
    assert bool((prediction.turn_t[rows] != 0.0).any()) == bends
