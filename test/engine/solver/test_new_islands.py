# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the impulses of islands begin that touch for the first time."""

from engine.stepping import TimestepScene
from engine.touching import ball, box, ground
import numpy as np
import pytest

from rigid_sim_ros.engine.model.shapes import Material
from rigid_sim_ros.engine.solver.new_islands import kick_new, make_new_islands
from rigid_sim_ros.engine.solver.solver_bodies import make_bodies, STRIDE

H, COUNT = 1 / 240, 20
TOWER = slice(1, 1 + COUNT)


def tower_and(others) -> TimestepScene:
    """Return a tower of cubes and what else there is, behind it in the order of bodies."""
    cubes = [box((1, 1, 1), 1.0, position=(0, 0, 0.5 + k)) for k in range(COUNT)]
    return TimestepScene([ground(), *cubes, *others], Material(friction=0.6), H)


def lying(count):
    """Return cubes that lie on the ground, far from each other and from the tower."""
    return [box((1, 1, 1), 1.0, position=(100 + 2 * k, 0, 0.5)) for k in range(count)]


def put_down_later(scene) -> None:
    """Put the tower where it stands, at rest, when all else has lain for some steps."""
    place = scene.state.x[:, TOWER].copy()
    scene.state.x[2, TOWER] += 1000.0
    scene.step(20)
    scene.state.x[:, TOWER], scene.state.P[:, TOWER] = place, 0.0


def assert_moved_alike(one, other) -> None:
    """Hold that the towers of two scenes are where they are and move as they do, bit for bit."""
    for part in ('x', 'q', 'P', 'L'):
        assert (getattr(one.state, part)[:, TOWER] == getattr(other.state, part)[:, TOWER]).all()


def test_a_tower_that_is_new_in_an_old_world_does_not_sink():
    scene = tower_and(lying(200))
    put_down_later(scene)
    scene.step()
    new = scene.work.solver.begin
    # All of its lanes took part: to the end, as so many sweeps do not settle them.
    assert sum(bin(bits).count('1') for bits in new.lanes & 255) == COUNT
    scene.step(240)
    # By then 0.45 mm; without the sweeps with which it begins 0.60 mm.
    assert 0.5 + COUNT - 1 - scene.state.x[2, COUNT] < 5e-4


def test_old_islands_take_no_part_where_another_is_new():
    alone, both = tower_and([]), tower_and(lying(30))
    alone.step(20)
    both.state.x[2, 1 + COUNT:] += 1000.0
    both.step(20)
    both.state.x[2, 1 + COUNT:], both.state.P[:, 1 + COUNT:] = 0.5, 0.0
    for scene in (alone, both):
        scene.step(100)
    assert both.work.solver.begin.begins.any()
    assert_moved_alike(alone, both)


def test_what_is_new_begins_as_it_would_without_the_rest_of_the_world():
    # Balls that fall onto others all the time: something is new in most steps, and shares blocks
    # with the tower.
    rng = np.random.default_rng(5)
    places = [np.array((50 + 0.21 * (k % 5), 0.21 * (k // 5 % 5), 0.1 + 0.22 * (k // 25)))
              for k in range(75)]
    balls = [ball(0.1, 1.0, position=place + rng.uniform(-0.005, 0.005, 3)) for place in places]
    alone, both = tower_and([]), tower_and(balls)
    for scene in (alone, both):
        put_down_later(scene)
        scene.step(100)
    assert_moved_alike(alone, both)


def test_islands_that_are_settled_are_left_alone():
    # Nothing presses balls that fall side by side: the first visit finds nothing to do. They are
    # so many that sweeps take them for no small island.
    row = [ball(0.5, 1.0, position=(100 + k, 0, 50)) for k in range(COUNT)]
    scene = tower_and(row)
    scene.step()
    new, slots = scene.work.solver.begin, scene.work.solver.bodies.slot
    assert new.begins[new.parent[slots[1 + COUNT]]] == 1
    assert sum(bin(bits).count('1') for bits in new.lanes & 255) == COUNT


@pytest.mark.parametrize('alike', [False, True])
def test_a_kick_is_taken_back_but_for_what_contacts_did(alike):
    rng, h = np.random.default_rng(2), 0.1
    bodies, new = make_bodies(5), make_new_islands(5, 8)
    slots = 6
    bodies.used[:], bodies.alike[0] = (slots, slots, slots), int(alike)
    # Islands of the slots 1 and 2; 3 and 4; 5. The first and the last take part.
    new.parent[:slots], new.begins[:slots] = (0, 1, 1, 3, 3, 5), (0, 1, 0, 0, 0, 1)
    part = np.repeat(np.isin(np.arange(slots), (1, 2, 5)), STRIDE)
    start, forces, contacts, found = rng.normal(0.0, 1.0, (4, slots * STRIDE))
    motion, base = bodies.motion[:slots * STRIDE], bodies.base[:slots * STRIDE]
    motion[:], base[:], bodies.smooth[:slots * STRIDE] = start, contacts, forces
    felt = np.tile(forces[:STRIDE], slots) if alike else forces
    kick_new(0, True, bodies, h, new)
    assert (motion == np.where(part, start + h * felt + contacts, start)).all()
    motion += np.where(part, found, 0.0)
    kick_new(0, False, bodies, h, new)
    # Roundings of numbers of about 1.
    assert motion == pytest.approx(start, abs=1e-14)
    assert base == pytest.approx(np.where(part, contacts + found, contacts), abs=1e-14)
    # And what takes no part stays as it was.
    assert (motion == start)[~part].all() and (base == contacts)[~part].all()
