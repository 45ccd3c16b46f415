# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Times of meeting against formulas."""

import math

from engine.touching import ball, box, EventScene, G, ground, Thing
import numpy as np
import pytest

from rigid_sim_ros.engine.detection import first_event as first_events, motion_ahead, sphere_pairs
from rigid_sim_ros.engine.dynamics.force_and_torque import empty_loads
from rigid_sim_ros.engine.dynamics.integrate import sum_loads
from rigid_sim_ros.engine.model.kinds.table import BOX
from rigid_sim_ros.engine.model.shapes import Material
from rigid_sim_ros.kernels.kernel import in_python

# To compile them takes longer than they take in Python.
first_event = in_python(first_events.first_event)
pairs_near = in_python(sphere_pairs.pairs_near)
place_ahead, motion_bound = map(in_python, (motion_ahead.place_ahead, motion_ahead.motion_bound))


def next_event(things, until, gravity=(0, 0, -G), allowed=(), backwards=False):
    scene = EventScene(things, Material(), gravity=gravity)
    loads = empty_loads(len(things))
    sum_loads(scene.model, scene.state, scene.wrenches, loads)
    pose = np.zeros((len(things), 12))
    pairs = np.zeros((100, 2), dtype=np.int64)
    (radius, low), order = np.zeros((2, len(things))), np.zeros(len(things), dtype=np.int64)
    for s in range(len(things)):
        place_ahead(scene.model, scene.state, loads, scene.shapes, s, 0.0, pose)
        radius[s] = scene.shapes.bound[s] + motion_bound(
            scene.model, scene.state, loads, scene.shapes, s, until)
    count = pairs_near(scene.model, scene.shapes, pose, radius, low, order, pairs)
    deep = np.zeros(100)
    deep[:len(allowed)] = allowed
    if backwards:
        pairs[:count], deep[:count] = pairs[:count][::-1].copy(), deep[:count][::-1].copy()
    t, which = first_event(scene.model, scene.state, loads, scene.shapes, pairs, count, deep,
                           1e-7, until, pose, scene.memory.scratch)
    return t, (tuple(pairs[which]) if which >= 0 else None)


def test_a_ball_falls_for_the_square_root_of_twice_the_height_over_g():
    t, pair = next_event([ground(), ball(0.1, 1.0, position=(0, 0, 0.1 + 0.7))], 1.0)
    assert pair == (0, 1)
    assert t == pytest.approx(math.sqrt(2.0 * 0.7 / G), abs=2e-12)  # TIME, and rounding


def test_a_turning_bar_touches_when_its_corner_has_come_down():
    # The lowest corner is a = 0.5 m and b = 0.05 m from the middle: 0.3 = a sin + b cos.
    a, b, w = 0.5, 0.05, 2.0
    bar = box((2.0 * a, 0.4, 2.0 * b), 1.0, position=(0, 0, 0.3), spin=(0, w, 0))
    t, _ = next_event([ground(), bar], 1.0, gravity=(0, 0, 0))
    angle = math.asin(0.3 / math.hypot(a, b)) - math.atan2(b, a)
    assert t == pytest.approx(angle / w, abs=1e-11)


def test_the_earliest_of_all_pairs_counts():
    things = [ground(), ball(0.1, 1.0, position=(0, 0, 1.0)), ball(0.1, 1.0, position=(2, 0, 0.5)),
              ball(0.1, 1.0, position=(4, 0, 0.9))]
    assert next_event(things, 1.0) == (pytest.approx(math.sqrt(0.8 / G), abs=2e-12), (0, 2))


def test_a_thin_wall_is_met_however_fast_one_is():
    wall = Thing(BOX, (0.005, 1.0, 1.0))
    t, _ = next_event([wall, ball(0.01, 1.0, position=(-1.0, 0, 0), velocity=(2000.0, 0, 0))], 0.1,
                      gravity=(0, 0, 0))
    assert t == pytest.approx((1.0 - 0.015) / 2000.0, abs=2e-12)


def test_two_thin_spinning_plates_do_not_slip_through_each_other():
    one = box((1.0, 1.0, 0.002), 1.0, spin=(0, 0, 30.0))
    other = box((1.0, 1.0, 0.002), 1.0, position=(0, 0, 2.0), velocity=(0, 0, -100.0),
                spin=(0, 0, -50.0))
    t, _ = next_event([one, other], 0.05, gravity=(0, 0, 0))
    assert t == pytest.approx((2.0 - 0.002) / 100.0, abs=1e-11)


def test_who_passes_by_does_not_meet():
    still = ball(0.1, 1.0)
    by = ball(0.1, 1.0, position=(-1.0, 0, 0.2 + 1e-9), velocity=(10.0, 0, 0))
    assert next_event([still, by], 0.5, gravity=(0, 0, 0)) == (0.5, None)


@pytest.mark.parametrize('backwards', [False, True])
def test_which_pair_sinks_in_first_does_not_depend_on_their_order(backwards):
    # Half a turn of the bar takes the second: its end is below the level of -0.02 m from 0.37 s to
    # 0.63 s and comes back. The ball is below its own from 0.4 s on. Asked at the end of the
    # second the bar does not sink in, asked at 0.4 s it would, and before the ball.
    bar = box((2.0, 0.1, 1e-3), 1.0, position=(0, 0, 0.9), spin=(0, math.pi, 0))
    sinks = ball(0.5, 1.0, position=(5, 0, 0.5), velocity=(0, 0, -0.25))
    t, pair = next_event([ground(), bar, sinks], 1.0, gravity=(0, 0, 0), allowed=(-0.02, -0.1),
                         backwards=backwards)
    assert pair == (0, 2)
    assert t == pytest.approx(0.4, abs=2e-12)


def test_what_turns_fast_beside_a_wall_is_looked_at_few_times(monkeypatch):
    # Half a millimetre above the ground as it stands upright. Its tips have 20 m/s: the bound of
    # the speed tells of as little as 2.5e-5 s ahead, and it is looked at 240 times. Turning bends
    # their ways by 800 m/s^2: the normal tells of (8 gap / 800 m/s^2)^(1/2) = 2e-3 s, 64 times.
    looks, plain = [], first_event.__globals__['pair_gap']
    monkeypatch.setitem(first_event.__globals__['meeting'].__globals__, 'pair_gap',
                        lambda *given: looks.append(1) or plain(*given))
    r = math.hypot(0.5, 0.05)
    bar = box((1.0, 0.4, 0.1), 1.0, position=(0, 0, r + 5e-4), spin=(0, 40.0, 0))
    assert next_event([ground(), bar], 0.05, gravity=(0, 0, 0)) == (0.05, None)
    assert len(looks) < 120
