# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model `timestep` against formulas: bounces, shocks, sliding, rolling, coming to rest."""

import math

from engine.stepping import TimestepScene
from engine.touching import about_y, ball, box, G, ground, same_bits, Thing
import numpy as np
import pytest

from rigid_sim_ros.engine.model.shapes import Material

SLOPE = math.radians(20.0)
DOWNHILL = np.array([math.cos(SLOPE), 0.0, -math.sin(SLOPE)])
UPWARDS = np.array([math.sin(SLOPE), 0.0, math.cos(SLOPE)])


def on_slope(thing: Thing, height, friction) -> TimestepScene:
    thing = thing._replace(position=height * UPWARDS, orientation=about_y(SLOPE))
    return TimestepScene([ground(about_y(SLOPE)), thing], Material(friction=friction))


def way_downhill(scene: TimestepScene, steps: int) -> float:
    start = scene.state.x[:, 1].copy()
    scene.step(steps)
    return float((scene.state.x[:, 1] - start) @ DOWNHILL)


def test_each_apex_is_e_squared_of_the_one_before():
    r, e = 0.1, 0.8
    scene = TimestepScene([ground(), ball(r, 1.0, position=(0, 0, r + 1.0))],
                          Material(restitution=e))
    apexes, before = [], 1.0
    while len(apexes) < 3:
        scene.step()
        apex = scene.state.x[2, 1] - r + scene.v[2, 1] ** 2 / (2.0 * G)
        if apex < before - 1e-3:
            apexes.append(apex)
            before = apex
    # A collision acts at its own time on a parabola: rounding of 1500 steps.
    assert apexes == pytest.approx([e ** 2, e ** 4, e ** 6], abs=1e-10)


def test_what_will_not_touch_in_a_step_flies_as_if_nothing_were_near():
    # Fast, so that it looks far ahead: at spins of 30 rad/s farther than its corners get down.
    thing = box((0.2, 0.3, 0.1), 1.0, position=(0, 0, 1.0), velocity=(0.5, 0, -2.0),
                spin=(30.0, 10.0, 20.0))
    scene = TimestepScene([ground(), thing], Material(restitution=0.5))
    # Too far away to be looked at.
    alone = TimestepScene([ground()._replace(position=(0, 0, -100.0)), thing],
                          Material(restitution=0.5))
    near = 0
    while True:
        scene.step()
        alone.step()
        if not np.array_equal(scene.v[:, 1], alone.v[:, 1]):
            break
        assert same_bits(scene.state.q[:, 1], alone.state.q[:, 1])
        assert same_bits(scene.state.x[:, 1], alone.state.x[:, 1])
        near += scene.manifolds().count[0]
    # The ground pushes, at a corner: by e = 0.5 the corner turns back, not all of the body.
    assert near > 0 and scene.v[2, 1] > alone.v[2, 1] + 1.0


def test_bounces_end_in_rest():
    scene = TimestepScene([ground(), ball(0.1, 1.0, position=(0, 0, 0.6))],
                          Material(restitution=0.5))
    scene.step(3000)
    assert abs(scene.v).max() < 1e-9
    # Contacts rest within SKIN, 0.02 mm, of each other.
    assert scene.state.x[2, 1] == pytest.approx(0.1, abs=2.1e-5)


def test_the_last_ball_leaves_a_cradle():
    r = 0.1
    balls = [ball(r, 1.0, position=(2 * r * i - (0.5 if i == 0 else 0.0), 0, 0),
                  velocity=(1.0 if i == 0 else 0.0, 0, 0)) for i in range(5)]
    scene = TimestepScene(balls, Material(restitution=1.0), gravity=(0, 0, 0))
    scene.step(1000)
    assert scene.v[0] == pytest.approx([0, 0, 0, 0, 1], abs=1e-12)  # rounding


def gas(friction=0.0) -> TimestepScene:
    rng = np.random.default_rng(5)
    places = np.array([(i % 4, i // 4 % 4, i // 16) for i in range(32)]) * 0.3
    places += rng.uniform(-0.02, 0.02, (32, 3))
    v = -2.0 * (places - places.mean(axis=0)) + rng.normal(0, 1, (32, 3))
    return TimestepScene(
        [ball(0.1, 1.0, position=p, velocity=u, spin=rng.normal(0, 20, 3))
         for p, u in zip(places, v, strict=True)],
        Material(friction=friction, restitution=1.0), gravity=(0, 0, 0))


@pytest.mark.parametrize('friction', [0.0, 0.5])
def test_a_gas_keeps_its_momenta(friction):
    scene = gas(friction)
    before = scene.momentum()
    scene.step(2000)
    # Equal and opposite impulses at one point: rounding of some hundred collisions of 1 N s.
    assert scene.momentum() == pytest.approx(before, abs=1e-11)


def test_a_smooth_elastic_gas_keeps_its_energy():
    scene = gas()
    before = scene.energy()
    scene.step(2000)
    # Each collision reflects the relative velocity; only those below 1 mm/s lose it.
    assert scene.energy() == pytest.approx(before, rel=1e-6)


def test_a_free_pair_of_boxes_keeps_its_momenta_while_it_tumbles():
    scene = TimestepScene(
        [box((1, 0.8, 0.6), 1.0, velocity=(1, 0, 0), spin=(0.1, 1, 0.3)),
         box((1, 0.8, 0.6), 2.0, position=(0.1, 0.1, 0.7), velocity=(0, 0.5, -1), spin=(0, 0, 2))],
        Material(friction=0.5), 1 / 240, (0, 0, 0))
    before = scene.momentum()
    scene.step(240)
    assert scene.momentum() == pytest.approx(before, abs=1e-13)  # rounding


def test_friction_2_percent_above_the_limit_holds_a_box():
    scene = on_slope(box((1, 1, 0.5), 1.0), 0.25, math.tan(SLOPE) * 1.02)
    # Pressure moves to where friction wants it before the first substep moves the box.
    assert abs(way_downhill(scene, 5000)) < 1e-9


def test_a_box_slides_with_g_sine_minus_mu_g_cosine():
    scene = on_slope(box((1, 1, 0.5), 1.0), 0.25, 0.2)
    exact = 0.5 * G * (math.sin(SLOPE) - 0.2 * math.cos(SLOPE)) * 5.0 ** 2
    # Constant acceleration is exact but for how friction sets in, in the first step.
    assert way_downhill(scene, 5000) == pytest.approx(exact, rel=1e-9)


def test_a_ball_rolls_with_5_sevenths_of_the_slope():
    scene = on_slope(ball(0.1, 1.0), 0.1, 0.5)
    exact = 0.5 * (5.0 / 7.0) * G * math.sin(SLOPE) * 2.0 ** 2
    assert way_downhill(scene, 2000) == pytest.approx(exact, rel=1e-9)


def test_rolling_resistance_stops_a_ball():
    r, lever, v = 0.1, 0.002, 1.0
    scene = TimestepScene([ground(), ball(r, 1.0, position=(0, 0, r), velocity=(v, 0, 0),
                                          spin=(0, v / r, 0))],
                          Material(friction=0.8, rolling=lever))
    scene.step(8000)
    # The torque m g lever against I + m r^2 decelerates by (5/7) g lever / r.
    way = v ** 2 / (2.0 * (5.0 / 7.0) * G * lever / r)
    assert scene.state.x[0, 1] == pytest.approx(way, rel=2e-3)
    assert abs(scene.v).max() < 1e-6


def test_spinning_friction_stops_a_ball():
    r, lever, w = 0.1, 0.002, 5.0
    scene = TimestepScene([ground(), ball(r, 1.0, position=(0, 0, r), spin=(0, 0, w))],
                          Material(friction=0.5, spinning=lever))
    time = 0.4 * r ** 2 * w / (G * lever)  # I w / (m g lever) = 1.02 s
    scene.step(round(0.5e3 * time))
    half = 0.5 * 0.4 * r ** 2 * w
    assert scene.state.L[2, 1] == pytest.approx(half, rel=2e-3)  # 1 of 500 steps
    scene.step(1000)
    assert abs(scene.state.L[2, 1]) < 1e-9


@pytest.mark.parametrize('h', [1e-3, 1 / 240])
def test_a_cube_that_falls_on_a_corner_comes_to_lie_flat(h):
    tilt = (0.424708, 0.17592, 0.339851, 0.820473)  # 45, 35 and 45 degrees about z, y, x
    tilt = tuple(np.array(tilt) / np.linalg.norm(tilt))
    scene = TimestepScene([ground(), box((1, 1, 1), 1.0, position=(0, 0, 1.5), orientation=tilt)],
                          Material(), h)
    scene.step(round(6.0 / h))
    assert np.abs(scene.v).max() < 1e-6
    assert np.abs(scene.state.L[:, 1]).max() < 1e-6
    assert scene.state.x[2, 1] == pytest.approx(0.5, abs=2.5e-5)  # within SKIN


@pytest.mark.parametrize('restitution', [0.0, 0.5])
@pytest.mark.parametrize('height', [0.0, 0.3])
def test_a_fast_ball_never_passes_a_thin_wall(restitution, height):
    wall = box((0.01, 4, 4), 1.0)._replace(mass=None)
    for start in np.linspace(-1.0, -0.8, 7):
        scene = TimestepScene(
            [wall, ball(0.01, 0.03, position=(start, 0.1, height), velocity=(200, 0, 10))],
            Material(restitution=restitution))
        scene.step(30)
        assert scene.state.x[0, 1] < -0.0149
        assert scene.v[0, 1] == pytest.approx(-200.0 * restitution, abs=1e-6)


def test_an_overlap_is_left_at_a_bounded_speed():
    boxes = [box((1, 1, 1), 1.0, position=(0.1 * k, 0, 0.2 + 0.4 * k)) for k in range(2)]
    scene = TimestepScene([ground(), *boxes], Material(), 1 / 240)
    for _ in range(480):
        scene.step()
        assert np.abs(scene.v).max() < 3.0  # it is pushed by displacements: only its fall counts
    assert scene.deepest() < 1e-4


@pytest.mark.parametrize('thing', [ball(0.1, 1.0), box((0.2, 0.2, 0.2), 1.0)],
                         ids=['ball', 'box'])
def test_an_overlap_that_is_left_by_itself_is_not_pushed(thing):
    # It would be pushed by 0.2 of 1 mm in a substep of 1 / 960 s, 0.19 m/s, but rises faster.
    start = np.array((0.0, 0.0, 0.099))
    scene = TimestepScene([ground(), thing._replace(position=start, velocity=(0.0, 0.0, 0.5))],
                          Material(), 1 / 240)
    scene.step()
    assert scene.manifolds().count[0] == 1
    assert scene.v[2, 1] == pytest.approx(0.5 - G / 240, abs=1e-14)     # rounding
    assert scene.state.x[2, 1] == pytest.approx(0.099 + 0.5 / 240 - 0.5 * G / 240 ** 2, abs=1e-14)


def test_what_touches_moves_as_if_nobody_flew_beside_it():
    # One falls along a wall, near enough to be looked at, one rolls, and one slides.
    touching = [ball(0.1, 1.0, position=(3.0, 0, 0.1005), velocity=(0, 0.2, 0.1)),
                ball(0.1, 2.0, position=(0, 0, 0.1), velocity=(0, 1.0, 0)),
                box((0.2, 0.2, 0.2), 3.0, position=(-3.0, 0, 0.1), velocity=(0, 1.0, 0))]
    flying = ball(0.1, 5.0, position=(0, 0, 9.0), spin=(3.0, 2.0, 1.0))
    beside = TimestepScene([ground(), *touching, flying], Material(friction=0.3))
    alone = TimestepScene([ground(), *touching], Material(friction=0.3))
    for _ in range(20):
        beside.step()
        alone.step()
        assert beside.work.solver.bodies.slot[4] == 0
        for one, other in zip(beside.state, alone.state, strict=True):
            assert same_bits(one[..., 1:4], other[..., 1:4])


def test_flight_beside_contacts_is_exact():
    scene = TimestepScene([ground(), box((1, 1, 1), 1.0, position=(5, 0, 0.5)),
                           ball(0.1, 1.0, position=(0, 0, 20), velocity=(1, 2, 3))], Material())
    scene.step(1000)
    assert scene.state.x[:, 2] == pytest.approx((1, 2, 20 + 3 - 0.5 * G), abs=1e-11)  # rounding


def test_a_run_repeats_bit_for_bit_from_state_and_manifolds():
    scene = TimestepScene(
        [ground(), *(box((0.4, 0.4, 0.4), 1.0, position=(0.05 * k, 0.03 * k, 0.3 + 0.45 * k),
                         spin=(1, 2, 3)) for k in range(5))], Material(restitution=0.3), 1 / 240)
    scene.step(100)
    twin = scene.twin()
    scene.step(100)
    for _ in range(100):
        twin.step()
    assert same_bits(scene.state, twin.state)
