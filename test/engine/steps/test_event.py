# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model `event` against formulas: bounces, shocks, sliding, rolling and coming to rest."""

import math

from engine.touching import about_y, ball, box, EventScene, G, ground, same_bits, Thing
import numpy as np
import pytest

from rigid_sim_ros.engine.model.kinds.table import BOX
from rigid_sim_ros.engine.model.shapes import Material

SLOPE = math.radians(20.0)
DOWNHILL = np.array([math.cos(SLOPE), 0.0, -math.sin(SLOPE)])
UPWARDS = np.array([math.sin(SLOPE), 0.0, math.cos(SLOPE)])


def on_slope(thing: Thing, height, friction) -> EventScene:
    thing = thing._replace(position=height * UPWARDS, orientation=about_y(SLOPE))
    return EventScene([ground(about_y(SLOPE)), thing], Material(friction=friction))


def way_downhill(scene: EventScene, steps: int) -> float:
    start = scene.state.x[:, 1].copy()
    scene.step(steps)
    return float((scene.state.x[:, 1] - start) @ DOWNHILL)


def test_each_apex_is_e_squared_of_the_one_before():
    r, e = 0.1, 0.8
    scene = EventScene([ground(), ball(r, 1.0, position=(0, 0, r + 1.0))], Material(restitution=e))
    apexes, before = [], 1.0
    while len(apexes) < 3:
        scene.step()
        # Where the ball would turn around: exact in flight, whatever the step.
        apex = scene.state.x[2, 1] - r + scene.v[2, 1] ** 2 / (2.0 * G)
        if apex < before - 1e-3:
            apexes.append(apex)
            before = apex
    # Time of impact to 1e-12 s at 4.4 m/s, and rounding of a thousand steps.
    assert apexes == pytest.approx([e ** 2, e ** 4, e ** 6], abs=1e-11)


@pytest.mark.parametrize('incoming', [1, 2, 3])
def test_as_many_balls_leave_a_cradle_as_come_in(incoming):
    r = 0.05
    balls = [ball(r, 1.0, position=(2.0 * r * i - (0.1 if i < incoming else 0.0), 0, 0),
                  velocity=(1.0 if i < incoming else 0.0, 0, 0)) for i in range(5)]
    scene = EventScene(balls, Material(restitution=1.0), gravity=(0, 0, 0))
    scene.step(200)
    expected = np.zeros((3, 5))
    expected[0, 5 - incoming:] = 1.0
    assert np.abs(scene.v - expected).max() < 1e-14  # a few roundings of 1 m/s


def gas() -> EventScene:
    rng = np.random.default_rng(7)
    grid = [np.array(p) * 0.3 for p in np.ndindex(4, 4, 2)]
    middle = np.mean(grid, axis=0)
    balls = [ball(0.12, 0.1 + 0.05 * (i % 3), position=p,
                  velocity=2.0 * (middle - p) + rng.normal(size=3), spin=rng.normal(size=3) * 5.0)
             for i, p in enumerate(grid)]
    return EventScene(balls, Material(friction=0.0, restitution=1.0), gravity=(0, 0, 0))


def test_an_elastic_gas_keeps_momentum_and_energy():
    scene = gas()
    energy, momentum = scene.energy(), scene.momentum()
    collisions = 0
    for _ in range(2000):
        scene.step()
        collisions += scene.work.report.collisions
    assert collisions > 50
    # 2000 steps round positions of 3 m, times momenta of 0.5 kg m/s: 32 x 45 steps at random,
    # 3e-13.
    assert np.abs(scene.momentum() - momentum).max() < 1e-12
    assert scene.energy() == pytest.approx(energy, rel=1e-12)


def test_a_box_holds_on_a_slope_just_below_the_angle_of_friction():
    scene = on_slope(box((1, 1, 1), 1.0), 0.5, 1.02 * math.tan(SLOPE))
    # The compliance lets four points yield with 1e-8 f_t / M: x = 1e-8 g sin / 4 * 4 * h * t.
    assert abs(way_downhill(scene, 5000)) < 1e-8 * G * math.sin(SLOPE) * 1e-3 * 5.0 * 4.0


def test_a_box_slides_down_with_what_friction_leaves_of_gravity():
    scene = on_slope(box((1, 1, 1), 1.0), 0.5, 0.2)
    a = G * (math.sin(SLOPE) - 0.2 * math.cos(SLOPE))
    # Constant acceleration is exact; the forces are right to 1e-8 (compliance).
    assert way_downhill(scene, 5000) == pytest.approx(0.5 * a * 5.0 ** 2, rel=1e-7)


def test_a_ball_rolls_down_with_five_sevenths_of_the_acceleration():
    scene = on_slope(ball(0.5, 1.0), 0.5, 0.5)
    a = 5.0 / 7.0 * G * math.sin(SLOPE)
    assert way_downhill(scene, 5000) == pytest.approx(0.5 * a * 5.0 ** 2, rel=1e-7)


def test_a_stack_of_twenty_stands():
    things = [ground()] + [box((1, 1, 1), 1.0, position=(0, 0, 0.5 + k)) for k in range(20)]
    scene = EventScene(things, Material(), h=1.0 / 240.0)
    start = scene.state.x.copy()
    scene.step(1)
    first = np.abs(scene.state.x - start).max()
    scene.step(2399)
    # It settles by what compliance asks for, 20 g 1e-8 h^2 / CLOSING a contact, and then stays.
    assert np.abs(scene.state.x - start).max() < max(20.0 * first, 1e-8)
    bottom = scene.manifolds().impulse[:, 0].sum() * 240.0
    assert bottom == pytest.approx(20.0 * G, rel=1e-9)


def test_a_cube_dropped_on_a_corner_comes_to_rest_on_a_face():
    q = np.array([0.34, -0.29, 0.05, 0.88])
    scene = EventScene([ground(), box((0.2, 0.2, 0.2), 1.0, position=(0, 0,
                                                                      1.5 + 0.1 * math.sqrt(3.0)),
                                      orientation=q / np.linalg.norm(q))], Material())
    deepest = 0.0
    for _ in range(3000):
        scene.step()
        deepest = max(deepest, scene.work.report.deepest)
        assert scene.work.report.unsolved == 0
    assert scene.state.x[2, 1] == pytest.approx(0.1, abs=1e-9)
    assert np.abs(scene.v).max() < 1e-9
    assert np.abs(scene.state.L[:, 1] * scene.model.inv_I_C[:, 1]).max() < 1e-9
    # A slow landing is stopped over a step: it sinks by a h^2 / 4 = 2.5e-6 m at most, as a rebound
    # rises.
    assert deepest < 3e-6


@pytest.mark.parametrize('h', [1e-3, 1.0 / 240.0, 1e-2])
def test_a_bullet_does_not_pass_a_thin_wall(h):
    wall = Thing(BOX, (0.005, 1.0, 1.0))
    bullet = ball(0.01, 0.03, position=(-0.513, 0, 0), velocity=(200.0, 0, 0))
    scene = EventScene([wall, bullet], Material(restitution=0.5), h=h, gravity=(0, 0, 0))
    scene.step(10)
    assert scene.state.x[0, 1] < -0.015
    assert scene.v[0, 1] == pytest.approx(-100.0, rel=1e-12)


def test_infinitely_many_bounces_end_after_the_time_that_they_add_up_to():
    r, e, drop = 0.1, 0.5, 1.0
    scene = EventScene([ground(), ball(r, 1.0, position=(0, 0, r + drop))],
                       Material(restitution=e))
    # sqrt(2 d / g) (1 + e) / (1 - e) for all bounces together.
    steps = round(math.sqrt(2.0 * drop / G) * (1.0 + e) / (1.0 - e) / 1e-3)
    # 60 steps: what closing the last gap by 0.6 a step down to rounding takes
    scene.step(steps + 60)
    assert scene.state.x[2, 1] == pytest.approx(r, abs=1e-11)
    assert abs(scene.v[2, 1]) < 1e-9


def test_a_rebound_that_would_be_over_within_a_step_is_none():
    r, drop = 0.1, 0.01
    scene = EventScene([ground(), ball(r, 1.0, position=(0, 0, r + drop))],
                       Material(restitution=0.5))
    most = 0
    for _ in range(200):
        scene.step()
        most = max(most, scene.work.report.collisions)
    # Otherwise the last bounces, infinitely many, would all fall into one step.
    assert most <= 2


def test_friction_turns_a_bouncing_ball_as_the_impulse_says():
    r, mu, v, u = 0.1, 0.1, 2.0, 3.0
    scene = EventScene([ground(), ball(r, 1.0, position=(0, 0, r + 1e-3), velocity=(u, 0, -v))],
                       Material(friction=mu, restitution=0.6), gravity=(0, 0, 0))
    scene.step(5)
    # It still slips, 3.5 mu (1 + e) v < u: the impulses are (1 + e) v and mu (1 + e) v.
    assert scene.v[2, 1] == pytest.approx(0.6 * v, rel=1e-12)
    assert scene.v[0, 1] == pytest.approx(u - mu * 1.6 * v, rel=1e-12)
    assert scene.state.L[1, 1] == pytest.approx(r * mu * 1.6 * v, rel=1e-12)


def test_a_ball_leaves_the_ball_that_it_rolls_over_where_the_normal_force_ends():
    R, r, start = 1.0, 0.1, 0.3
    top = ball(r, 1.0, position=((R + r) * math.sin(start), 0, (R + r) * math.cos(start)))
    scene = EventScene([ball(R, 1.0)._replace(mass=None), top], Material(friction=50.0))
    scene.step()
    while scene.work.carried.force.any():
        scene.step()
    x = scene.state.x[:, 1]
    # Energy: v^2 = 10/7 g (R + r) (cos start - cos angle); it leaves where v^2 = g (R + r) cos
    # angle. Two steps at 2.2 rad/s and sin = 0.83.
    assert x[2] / np.linalg.norm(x) == pytest.approx(10.0 / 17.0 * math.cos(start), abs=4e-3)


def test_overlap_at_the_start_is_pushed_out_slowly():
    scene = EventScene([ground(), box((1, 1, 1), 1.0, position=(0, 0, 0.4))], Material())
    fastest = 0.0
    for _ in range(1000):
        scene.step()
        fastest = max(fastest, np.abs(scene.v).max())
    assert scene.state.x[2, 1] == pytest.approx(0.5, abs=1e-9)
    assert fastest < scene.settings.push_out + 1e-6  # and no faster than it may


def test_the_same_bits_twice():
    one, other = gas(), gas()
    one.step(300)
    other.step(300)
    assert same_bits(one.state, other.state)


def tumbling() -> EventScene:
    q = np.array([0.3, -0.25, 0.1, 0.9])
    things = [ground(), box((0.2, 0.3, 0.1), 1.0, position=(0, 0, 0.4),
                            orientation=q / np.linalg.norm(q),
                            spin=(1, 2, 3)), ball(0.1, 1.0, position=(0.02, 0.01, 0.8))]
    return EventScene(things, Material(restitution=0.3), h=1.0 / 240.0)


@pytest.mark.parametrize('steps', [70, 110, 200])
def test_the_same_bits_after_a_restart_in_the_middle_of_contact(steps):
    scene = tumbling()
    scene.step(steps)
    twin = scene.twin()
    scene.step(100)
    twin.step(100)
    assert same_bits(scene.state, twin.state)


def test_a_shock_without_end_is_stopped_for_all_at_once():
    # Plastic shocks through a pile never end one by one: once they do not become weaker, all
    # stop at once.
    things = [ground()] + [box((1, 1, 1), 10.0 ** (k % 3), position=(0, 0,
                                                                     0.5 + k)) for k in range(8)]
    things[-1] = things[-1]._replace(velocity=(0, 0, -3.0))
    scene = EventScene(things, Material(), h=1.0 / 240.0)
    unsolved, most = 0, 0
    for _ in range(60):
        scene.step()
        unsolved += scene.work.report.unsolved
        most = max(most, scene.work.report.collisions)
    assert most >= 2 * 8  # so many collisions are asked for whether they become weaker
    assert np.abs(scene.v).max() < 1e-9
    assert unsolved == 0


def test_forces_between_cubes_that_overlap_are_found():
    # 32 points, most of them redundant, slide and stick while the cubes are pushed apart. Where
    # friction presses on itself there need not be a solution; without the interior point method
    # 7 of these steps have none.
    things = [ground()] + [box((0.2, 0.2, 0.2), 1.0, position=(0, 0, 0.1 + 0.18 * k))
                           for k in range(8)]
    scene = EventScene(things, Material(friction=0.5), h=4e-3)
    unsolved = 0
    for _ in range(40):
        scene.step()
        unsolved += scene.work.report.unsolved
    assert unsolved <= 2


def rolling_ball(friction, **levers) -> EventScene:
    """Return a ball of 1 kg and 0.1 m that rolls along x at 1 m/s."""
    thing = ball(0.1, 1.0, position=(0, 0, 0.1), velocity=(1.0, 0, 0), spin=(0, 10.0, 0))
    return EventScene([ground(), thing], Material(friction=friction, **levers))


def test_a_rolling_ball_stops_where_its_lever_says():
    lever = 0.005
    scene = rolling_ball(0.5, rolling=lever)
    a = 5.0 / 7.0 * G * lever / 0.1  # (I + M r^2) w' = -lever M g
    scene.step(1000)
    assert scene.v[0, 1] == pytest.approx(1.0 - a, rel=1e-7)
    scene.step(2000)
    # In the last step it stops at its end rather than within: a h^2 / 2 = 2e-7 m.
    assert scene.state.x[0, 1] == pytest.approx(0.5 / a, abs=2e-7)
    assert np.abs(scene.v).max() < 1e-9


def test_a_ball_with_a_lever_against_rolling_lies_still_on_a_gentle_slope():
    angle = 0.02  # tan 0.02 < lever / r = 0.05
    thing = ball(0.1, 1.0, position=0.1 * np.array([math.sin(angle), 0, math.cos(angle)]))
    scene = EventScene([ground(about_y(angle)), thing], Material(rolling=0.005))
    start = scene.state.x[:, 1].copy()
    scene.step(2000)
    assert np.abs(scene.state.x[:, 1] - start).max() < 1e-8


def test_a_ball_rolls_down_with_what_its_lever_leaves():
    lever = 0.02
    scene = EventScene([ground(about_y(SLOPE)), ball(0.5, 1.0, position=0.5 * UPWARDS)],
                       Material(friction=0.5, rolling=lever))
    a = 5.0 / 7.0 * G * (math.sin(SLOPE) - lever / 0.5 * math.cos(SLOPE))
    assert way_downhill(scene, 1000) == pytest.approx(0.5 * a, rel=1e-6)


def test_a_spinning_ball_slows_by_its_lever_and_stops():
    lever, moment = 0.002, 0.4 * 0.01
    thing = ball(0.1, 1.0, position=(0, 0, 0.1), spin=(0, 0, 5.0))
    scene = EventScene([ground(), thing], Material(spinning=lever))
    scene.step(500)
    assert scene.state.L[2, 1] == pytest.approx(5.0 * moment - 0.5 * lever * G, rel=1e-7)
    scene.step(600)
    assert abs(scene.state.L[2, 1]) < 1e-12


def test_the_points_of_a_face_share_the_torque_against_spinning():
    # Without friction only the levers act: together lever N, however many points share N.
    lever, moment = 0.01, 1.0 / 6.0
    thing = box((1, 1, 1), 1.0, position=(0, 0, 0.5), spin=(0, 0, 1.0))
    scene = EventScene([ground(), thing], Material(friction=0.0, spinning=lever))
    scene.step(500)
    assert scene.state.L[2, 1] == pytest.approx(moment - 0.5 * lever * G, rel=1e-6)
