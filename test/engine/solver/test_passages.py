# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an impact throws within a step ends its way before it gets through anything."""

import math

from engine.stepping import TimestepScene
from engine.touching import ball, box, G, same_bits, Thing
import numpy as np
import pytest

from rigid_sim_ros.engine.detection.backtrack import DEEPER
from rigid_sim_ros.engine.dynamics.kinematic import LASTS
from rigid_sim_ros.engine.model.shapes import Material
from rigid_sim_ros.engine.solver.passages import _without_work

H, RADIUS, SHEET, PLACE, GAP = 0.01, 0.05, 2e-3, -0.26, 0.01
LIGHT, HEAVY, OTHER = range(3)


def thrown(things=(), restitution=1.0, speed=10.0) -> TimestepScene:
    """
    Return a ball that rises and that a heavy one from above throws down.

    That gets nearly twice the speed of the heavy one and its own in the first tenth of a step, and
    flies 23 cm in the rest of it. Contacts are sought as far as the heavy one would throw it from
    rest, 20 cm: what lies 21 cm below it is not near anything as the step begins.
    """
    return TimestepScene(
        [ball(RADIUS, 0.01, velocity=(0, 0, 0.5 * speed)),
         ball(0.1, 100.0, position=(0, 0, RADIUS + 0.1 + GAP), velocity=(0, 0, -speed)), *things],
        Material(friction=0.0, restitution=restitution), H)


def sheet() -> Thing:
    return box((1, 1, SHEET), 1.0, position=(0, 0, PLACE))._replace(mass=None)


@pytest.mark.parametrize('restitution', [0.0, 1.0])
def test_what_is_thrown_farther_than_its_pairs_were_sought_gets_through_nothing(restitution):
    scene = thrown([sheet()], restitution)
    for _ in range(50):
        scene.step()
        assert scene.state.x[2, LIGHT] > PLACE


def test_it_stops_where_it_is_deeper_by_an_eighth_of_the_thinner_one():
    scene = thrown([sheet()])
    scene.step()
    surface = PLACE + 0.5 * SHEET
    assert scene.state.x[2, LIGHT] == pytest.approx(
        surface + RADIUS - DEEPER * 0.5 * SHEET, abs=1e-12)
    assert scene.v[2, LIGHT] < -24.0    # known to the solver, and what the next step begins with


def test_forces_act_for_as_long_as_it_goes():
    free, stopped = thrown(), thrown([sheet()])
    free.step()
    stopped.step()
    lost = stopped.state.x[2, LIGHT] - free.state.x[2, LIGHT]
    assert lost > 0.01
    # v^2 / 2 + g z is that of the free fall; rounding of 25 m/s.
    assert stopped.v[2, LIGHT] == pytest.approx(
        -math.sqrt(free.v[2, LIGHT] ** 2 - 2.0 * G * lost), abs=1e-12)


def test_what_a_contact_stopped_is_not_thrown_up():
    F, work, at_rest = (0.0, 0.0, -20.0), 0.3, (0.0, 0.0, 0.0)
    for speed in (0.0, -1e-3):      # it lies on the ground, and nearly so
        assert _without_work((1.0, 0.0, speed), F, 0.5, work, at_rest) == (1.0, 0.0, 0.0)
    # What bounced goes up with that much less energy: m v^2 / 2 of 2 kg.
    v = _without_work((0.0, 0.0, 3.0), F, 0.5, work, at_rest)
    assert v[2] == pytest.approx(np.sqrt(9.0 - work), rel=1e-15)


def test_what_is_slow_is_not_asked():
    asked = {}
    for speed in (10.0, 1e-3):
        scene = thrown([sheet()], speed=speed)
        scene.work.ways.part[:] = 7.0
        scene.step()
        asked[speed] = (scene.work.ways.part != 7.0).any()
    assert asked == {10.0: True, 1e-3: False}


def test_what_stops_moves_nothing_else():
    other = ball(RADIUS, 1.0, position=(2, 0, 0), velocity=(30, 0, 0))
    with_sheet, without = thrown([other, sheet()]), thrown([other])
    for scene in (with_sheet, without):
        scene.step()
    for field in ('x', 'q', 'P', 'L'):
        assert same_bits(getattr(with_sheet.state, field)[:, OTHER],
                         getattr(without.state, field)[:, OTHER])


SHIP = (7.0, -3.0, 11.0)    # [m/s]


def on_a_ship(scene: TimestepScene) -> TimestepScene:
    """Let everything of a scene fly on, what nothing pushes as well."""
    state, model = scene.state, scene.model
    for i in range(len(model.m)):
        for k in range(3):
            if model.inv_m[i] > 0.0:
                state.P[k, i] += model.m[i] * SHIP[k]
            else:
                state.V[k, i], state.twist_steps_left[i] = SHIP[k], LASTS
    return scene


def test_on_a_ship_it_stops_at_the_same_place_of_the_sheet():
    land, ship = thrown([sheet()]), on_a_ship(thrown([sheet()]))
    for scene in (land, ship):
        scene.step()
    for k in range(3):
        # Rounding of 20 m/s in 10 ms. It would be 10 cm behind the ship if it waited for it.
        assert ship.state.x[k] - H * SHIP[k] == pytest.approx(land.state.x[k], abs=1e-13)


def test_what_rests_on_a_ship_has_the_margins_of_what_rests_on_land():
    land, ship = thrown([sheet()]), on_a_ship(thrown([sheet()]))
    for scene in (land, ship):
        scene.step()
    assert ship.memory.margin[:3] == pytest.approx(land.memory.margin[:3], abs=1e-14)


def test_ways_are_as_long_on_a_ship_as_on_land():
    scene = on_a_ship(thrown([sheet()], speed=1e-3))
    scene.step()
    # What falls for a step has g h / 2 in the mean, the heavy one 1 mm/s more, the other less.
    wanted = H * (0.5 * G * H + np.array([-0.5e-3, 1e-3]))
    assert scene.work.ways.length[:2] == pytest.approx(wanted, abs=1e-15)
