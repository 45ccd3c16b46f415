# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model `event` where loads are many times the weight of a body, and at edges of faces."""

from engine.touching import ball, box, EventScene, G, ground
import numpy as np
import pytest

from rigid_sim_ros.engine.model.shapes import Material

EDGE = 0.1


def column(masses, friction) -> EventScene:
    """Return cubes on the ground and on each other, each a bit smaller than the one below."""
    things, height = [ground()], 0.0
    for k, mass in enumerate(masses):
        edge = EDGE * 0.97 ** k
        things.append(box((edge, edge, edge), mass, position=(0, 0, height + 0.5 * edge)))
        height += edge
    return EventScene(things, Material(friction=friction))


@pytest.mark.parametrize(('masses', 'friction'), [
    ((1e-3, 1e4), 0.5), ((0.25, 0.16, 2.9, 1540.0, 1420.0), 0.0)])
def test_light_bodies_carry_heavy_ones(masses, friction):
    scene = column(masses, friction)
    start = scene.state.x.copy()
    scene.step(100)
    # Points give way by 1e-6 of g, YIELDS: what closes 0.3 of a gap in a step of 1 ms balances
    # that at 1e-6 g h^2 / 0.3 = 3e-11 m for each of ten surfaces. Sideways a light body that tilts
    # by t is pushed with R g t, R = 1e7 the ratio of the masses: rounding of places, 1e-16 m
    # over 0.1 m, gives 1e-8 g and in 0.1 s 5e-10 m.
    assert np.abs(scene.state.x - start).max() < 1e-8
    # A velocity is as well known as the accelerations, 1e-6 of g and 100 steps of it.
    assert np.abs(scene.v).max() < 1e-6 * G * 0.1
    weight = G * sum(masses)
    carried = scene.work.carried
    assert carried.force[carried.shape_a == 0, 2].sum() == pytest.approx(weight, rel=1e-5)


def test_bodies_that_are_moved_out_of_an_overlap_keep_their_angular_momentum():
    r = 0.1
    # They overlap by 1 % of the radius and slide along each other.
    things = [ball(r, 1.0, position=(0, 0, 0), velocity=(0, 1.0, 0)),
              ball(r, 2.0, position=(1.99 * r, 0, 0), velocity=(0, -1.0, 0.5))]
    scene = EventScene(things, Material(friction=0.0), gravity=(0, 0, 0))
    before = scene.momentum()
    scene.step(20)
    overlap = 2.0 * r - np.linalg.norm(scene.state.x[:, 1] - scene.state.x[:, 0])
    assert overlap < 0.5 * 0.01 * r
    # Terms of 2 kg m/s and 0.4 kg m^2/s, rounded some times in each of 20 steps.
    assert np.abs(scene.momentum() - before).max() < 1e-13


@pytest.mark.parametrize('speed', [0.3, 1.0])
def test_a_ball_slides_over_the_seam_of_two_boxes(speed):
    r = 0.1
    tile = box((1.0, 1.0, 0.2), 1.0)._replace(mass=None)
    # It passes the seam at x = 0 within a step, not at its end.
    slider = ball(r, 1.0, position=(-10.37 * speed * 1e-3, 0, r), velocity=(speed, 0, 0))
    scene = EventScene([slider, tile._replace(position=(-0.5, 0, -0.1)),
                        tile._replace(position=(0.5, 0, -0.1))], Material(friction=0.0))
    scene.step(20)
    # Nothing acts along a floor without friction: 20 roundings.
    assert scene.v[0, 0] == pytest.approx(speed, rel=1e-14)
    assert abs(scene.state.x[2, 0] - r) < 1e-9
