# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model `penalty` against the formulas of its springs and dampers."""

import math

from engine.touching import about_y, ball, box, G, ground, PenaltyScene, same_bits
import numpy as np
import pytest

from rigid_sim_ros.engine.contact.penalty_force import check_step, stable_step
from rigid_sim_ros.engine.model.shapes import Material

SLOPE = math.radians(20.0)
DOWNHILL = np.array([math.cos(SLOPE), 0.0, -math.sin(SLOPE)])


def soft(pair_stiffness, *, damping=0.5, friction=0.5) -> Material:
    """Return a material two of which, as springs in series, have that stiffness [N/m]."""
    return Material(friction=friction, stiffness=2.0 * pair_stiffness, damping=damping)


def collision(damping, h):
    """Return duration [s] and speed of rebound [m/s] of 1 kg at 1 m/s against 1e5 N/m."""
    thing = ball(0.1, 1.0, position=(0, 0, 0.1), velocity=(0, 0, -1.0))
    scene = PenaltyScene([ground(), thing], soft(1e5, damping=damping), h=h, gravity=(0, 0, 0))
    steps = 0
    while scene.state.x[2, 1] <= 0.1:
        scene.step()
        steps += 1
    return steps * h, scene.v[2, 1]


def test_a_body_sinks_in_by_its_weight_over_the_stiffness_of_its_points():
    scene = PenaltyScene([ground(), box((1, 1, 1), 1.0, position=(0, 0, 0.5))], soft(1e4,
                                                                                     damping=5.0))
    scene.step(4000)
    # Near rest the damper is weak, k d c: what is left of the fall swings with less than 1e-8 m.
    assert 0.5 - scene.state.x[2, 1] == pytest.approx(G / 4e4, abs=1e-8)


def test_an_undamped_contact_lasts_half_a_period():
    h = 2e-5
    duration, _ = collision(0.0, h)
    assert duration == pytest.approx(math.pi * math.sqrt(1.0 / 1e5), abs=h)


def test_an_undamped_contact_gives_the_speed_back():
    # Verlet keeps a neighbouring energy: off by (omega h)^2 / 8 where the contact ends within a
    # step.
    h = 2e-5
    assert collision(0.0, h)[1] == pytest.approx(1.0, abs=1e5 * h * h / 8.0)


def test_the_damper_takes_what_hunt_and_crossley_say():
    c = 0.5
    low, high = 0.0, 1.0
    for _ in range(60):  # c v0 - ln(1 + c v0) = -c v1 - ln(1 - c v1), by bisection
        middle = 0.5 * (low + high)
        if -c * middle - math.log(1.0 - c * middle) < c - math.log(1.0 + c):
            low = middle
        else:
            high = middle
    h = 2e-5
    # As above, and the damper is taken at the velocities of half and full steps: (omega h)^2.
    assert collision(c, h)[1] == pytest.approx(low, abs=1e5 * h * h)


def test_a_damper_stops_a_fast_body_and_does_not_throw_it_back():
    # In the first overlap of 5 mm the damper would be ten times what stops the ball in a step.
    h, k, start = 1e-3, 1e5, 10.0
    thing = ball(0.1, 1.0, position=(0, 0, 0.1 + 0.5 * h * start), velocity=(0, 0, -start))
    scene = PenaltyScene([ground(), thing], soft(k, damping=20.0), h=h, gravity=(0, 0, 0))
    energy = 0.5 * start ** 2
    for _ in range(60):
        scene.step()
        before, depth = energy, max(0.0, 0.1 - scene.state.x[2, 1])
        energy = scene.energy() + 0.5 * k * depth ** 2
        assert energy <= before
    assert 0.0 < scene.v[2, 1] < 0.2 * start


def resting_on_slope(friction) -> PenaltyScene:
    up = np.array([math.sin(SLOPE), 0.0, math.cos(SLOPE)])
    depth = G * math.cos(SLOPE) / 4e4
    thing = box((1, 1, 1), 1.0, position=(0.5 - depth) * up, orientation=about_y(SLOPE))
    return PenaltyScene([ground(about_y(SLOPE)), thing], soft(1e4, damping=5.0, friction=friction))


def test_a_box_on_a_slope_does_not_creep():
    scene = resting_on_slope(1.1 * math.tan(SLOPE))
    scene.step(2000)
    settled = scene.state.x[:, 1].copy()
    scene.step(2000)
    # The bristles are stretched by g sin / 4 k = 8e-5 m, and stay so; the swing fades.
    assert abs((scene.state.x[:, 1] - settled) @ DOWNHILL) < 1e-8


def test_a_box_slides_down_with_what_friction_leaves_of_gravity():
    scene = resting_on_slope(0.2)
    scene.step(1000)
    before = scene.v[:, 1] @ DOWNHILL
    scene.step(1000)
    # Of the first second's swing 1e-12 m/s is left; while the bristles stretched it won 4 mm/s.
    a = G * (math.sin(SLOPE) - 0.2 * math.cos(SLOPE))
    assert scene.v[:, 1] @ DOWNHILL - before == pytest.approx(a * 1.0, rel=1e-9)


def test_a_contact_never_pulls():
    thing = ball(0.1, 1.0, position=(0, 0, 0.0999), velocity=(0, 0, 10.0))
    scene = PenaltyScene([ground(), thing], soft(1e5, damping=5.0), h=1e-5, gravity=(0, 0, 0))
    scene.step(10)
    assert scene.v[2, 1] == pytest.approx(10.0, rel=1e-15)


def test_free_bodies_that_meet_keep_their_momentum():
    things = [ball(0.1, 1.0, velocity=(1, 0, 0), spin=(0, 3, 1)),
              ball(0.1, 2.0, position=(0.22, 0.05, 0))]
    scene = PenaltyScene(things, soft(1e4), h=1e-4, gravity=(0, 0, 0))
    before = scene.momentum()
    scene.step(2000)
    assert scene.v[0, 1] > 0.1
    # Forces are equal and opposite at one point; the torque about the origin sees it move during a
    # step: impulses of 1 N s, half a step of 1 m/s.
    assert np.abs(scene.momentum() - before)[:3].max() < 1e-14
    assert np.abs(scene.momentum() - before)[3:].max() < 1e-4


def resting_ball(material, **motion) -> PenaltyScene:
    """Return a ball of 1 kg and 0.1 m that has sunk in by its weight."""
    depth = G / (0.5 * material.stiffness)
    return PenaltyScene([ground(), ball(0.1, 1.0, position=(0, 0, 0.1 - depth), **motion)],
                        material)


def test_a_rolling_ball_slows_by_its_lever_and_stops():
    lever = 0.005
    scene = resting_ball(soft(1e5)._replace(rolling=lever), velocity=(1.0, 0, 0),
                         spin=(0, 10.0, 0))
    a = 5.0 / 7.0 * G * lever / 0.1
    scene.step(200)
    before = scene.v[0, 1]
    scene.step(1000)
    # The ball has sunk in by 1e-4 m of its radius, and the bristle swings.
    assert before - scene.v[0, 1] == pytest.approx(a, rel=2e-3)
    scene.step(2000)
    assert abs(scene.v[0, 1]) < 1e-9


def test_a_spinning_ball_slows_by_its_lever_and_stops():
    lever, moment = 0.002, 0.4 * 0.01
    scene = resting_ball(soft(1e5)._replace(spinning=lever), spin=(0, 0, 5.0))
    scene.step(500)
    assert scene.state.L[2, 1] == pytest.approx(5.0 * moment - 0.5 * lever * G, rel=1e-6)
    scene.step(700)
    assert abs(scene.state.L[2, 1]) < 1e-12


@pytest.mark.parametrize('mass', [1e-6, 1e-3, 1.0])
def test_the_step_that_the_refusal_names_is_stable(mass):
    # Light bodies and the default stiffness, as a scene would have them: a thin plate, tumbling.
    q = np.array([0.3, -0.25, 0.1, 0.9])
    x, y, z, w = q = q / np.linalg.norm(q)
    up = np.array([2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)])
    height = np.abs(up) @ [0.01, 0.015, 0.002]  # a corner is about to touch
    thing = box((0.02, 0.03, 0.004), mass, position=(0, 0, height), orientation=q,
                velocity=(0, 0, -1.0), spin=(5, 10, 15))
    scene = PenaltyScene([ground(), thing], Material(), h=1.0)
    with pytest.raises(ValueError, match='use a step of at most') as refusal:
        check_step(scene.model, scene.shapes, scene.materials)
    named = float(str(refusal.value).split('at most ')[1].split(' s')[0])
    scene = PenaltyScene([ground(), thing], Material(), h=named)
    check_step(scene.model, scene.shapes, scene.materials)
    highest, touched = scene.energy() + mass * G * height, False
    for _ in range(3000):
        scene.step()
        touched = touched or bool(scene.manifolds().count[0])
        # An unstable contact would throw the plate up.
        assert scene.energy() + mass * G * scene.state.x[2, 1] < 1.01 * highest
    assert touched


def test_the_stiffness_that_the_refusal_names_is_taken():
    light = ball(0.01, 0.001, position=(0, 0, 0.5))
    scene = PenaltyScene([ground(), light], Material())
    with pytest.raises(ValueError, match='N/m for the pair') as refusal:
        check_step(scene.model, scene.shapes, scene.materials)
    named = float(str(refusal.value).split('at most ')[-1].split(' N/m')[0])
    scene = PenaltyScene([ground(), light], soft(named))
    check_step(scene.model, scene.shapes, scene.materials)


def test_the_longest_stable_step_is_that_of_the_stiffest_pair():
    light = ball(0.01, 0.01, position=(0, 0, 0.5))
    scene = PenaltyScene([ground(), ball(0.1, 1.0, position=(0, 0, 0.2)), light], soft(5e4))
    # p k (1/M + r^2 / I) with one point, and I = 2/5 M r^2; the light one against the other.
    squared = 5e4 * 3.5 * (1.0 / 0.01 + 1.0)
    longest, a, b = stable_step(scene.model, scene.shapes, scene.materials)
    assert longest == pytest.approx(1.0 / math.sqrt(squared), rel=1e-12)
    assert {a, b} == {1, 2}


def test_an_unstable_step_is_refused_with_one_that_works():
    light = ball(0.01, 0.01, position=(0, 0, 0.5))
    scene = PenaltyScene([ground(), light], soft(5e4))
    message = (r'step 0\.001 s is unstable .* 50000 N/m .* '
               r'at most 0\.00023 s, or a stiffness of at most 2800 N/m')
    with pytest.raises(ValueError, match=message):
        check_step(scene.model, scene.shapes, scene.materials)
    check_step(scene.model._replace(h=0.00023), scene.shapes, scene.materials)


def test_the_same_bits_after_a_restart_in_the_middle_of_contact():
    q = np.array([0.3, -0.25, 0.1, 0.9])
    thing = box((0.2, 0.3, 0.1), 1.0, position=(0, 0, 0.25), orientation=q / np.linalg.norm(q),
                spin=(1, 2, 3))
    scene = PenaltyScene([ground(), thing], soft(2e4))
    while len(scene.bristles.feature) == 0:
        scene.step()
    scene.step(2)
    assert len(scene.bristles.feature) > 0
    twin = scene.twin()
    scene.step(300)
    twin.step(300)
    assert same_bits(scene.state, twin.state)
