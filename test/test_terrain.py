# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Grounds that are not flat: heightfields, and meshes that collide as they are."""

from collections.abc import Callable
import math
from typing import Any

from carrying import G, MODELS
import numpy as np
import pytest

from rigid_sim_ros import World

Ground = dict[str, Any]
Form = Callable[[np.ndarray, np.ndarray], np.ndarray]
STEP = 0.002
# And how high [m] above the ground each rests.
SOLIDS: dict[str, tuple[dict[str, Any], float]] = {
    'box': ({'type': 'box', 'size': [0.3, 0.3, 0.3]}, 0.15),
    'sphere': ({'type': 'sphere', 'radius': 0.15}, 0.15),
    'cylinder': ({'type': 'cylinder', 'radius': 0.15, 'length': 0.3}, 0.15),
    'capsule': ({'type': 'capsule', 'radius': 0.1, 'length': 0.3}, 0.25),
    'cone': ({'type': 'cone', 'radius': 0.15, 'length': 0.3}, 0.15),
    'ellipsoid': ({'type': 'ellipsoid', 'radii': [0.2, 0.15, 0.1]}, 0.1)}


def heights_of(form: Form, count: int, size: float) -> np.ndarray:
    """Return z(x, y), (count, count) [m], on a square of this edge [m]."""
    x, y = np.meshgrid(*[np.linspace(-size / 2, size / 2, count)] * 2)
    return form(x, y)


def field(heights: np.ndarray, size: float) -> Ground:
    """Return a square heightfield."""
    return {'type': 'heightfield', 'heights': heights.tolist(), 'size': [size, size]}


def triangles(heights: np.ndarray, size: float) -> Ground:
    """Return the same surface as an open mesh, its cells divided along the other diagonal."""
    count = len(heights)
    x, y = np.meshgrid(*[np.linspace(-size / 2, size / 2, count)] * 2)
    corner = [i * count + j for i in range(count - 1) for j in range(count - 1)]
    faces = [face for k in corner for face in (
        (k, k + 1, k + count), (k + 1, k + count + 1, k + count))]
    return {'type': 'mesh', 'vertices': np.stack([x, y, heights], axis=2).reshape(-1, 3).tolist(),
            'faces': faces, 'convex': False}


GROUNDS = {'heightfield': field, 'mesh': triangles}
every_ground = pytest.mark.parametrize('make', GROUNDS.values(), ids=GROUNDS)


def world_on(ground: Ground, bodies: list[dict[str, Any]], model: str = 'timestep',
             friction: float = 0.5, step: float = STEP) -> World:
    """Return a world with bodies over a fixed ground."""
    return World.from_dict({
        'format': 1, 'world': {'step': step, 'gravity': [0, 0, -G], **MODELS[model]},
        'materials': {'default': {'friction': friction}},
        'bodies': [{'name': 'ground', 'fixed': True, 'shape': ground}, *bodies]})


def energy(world: World) -> float:
    """Return the energy of all bodies [J]."""
    return world.kinetic_energy() + world.potential_energy()


@every_ground
@pytest.mark.parametrize('model', [name for name in MODELS if name != 'penalty'])
def test_what_slides_over_a_flat_ground_does_not_notice_its_pieces(model, make):
    bodies = [{'name': name, 'shape': shape, 'mass': 1.0,
               'pose': {'position': [-0.8, -1.25 + 0.5 * k, z]},
               'twist': {'linear': [1.0, 0.1, 0.0]}}
              for k, (name, (shape, z)) in enumerate(SOLIDS.items())]
    world = world_on(make(np.zeros((11, 11)), 3.0), bodies, model, friction=0.0)
    start = world.position[1:].copy()
    world.step(500)
    # In 1 s it crosses three cells. Models let bodies touch within 1e-7, and sink in by 1e-6, of
    # their sizes: what stands straight may tip by that, and move to the side by as much.
    assert world.linear_velocity[1:] == pytest.approx(
        np.tile([1.0, 0.1, 0.0], (len(bodies), 1)), abs=1e-5)
    assert world.position[1:] == pytest.approx(
        start + np.array([1.0, 0.1, 0.0]), abs=2e-6)


@every_ground
@pytest.mark.parametrize('model', MODELS)
def test_a_ball_rolls_down_a_slope_of_cells_as_down_a_plane(model, make):
    slope, r, t = math.atan(0.2), 0.15, 0.6
    ball = {'name': 'ball', 'shape': {'type': 'sphere', 'radius': r}, 'mass': 1.0,
            'pose': {'position': [-1.0 + r * math.sin(slope), 0.1,
                                  0.2 + r * math.cos(slope)]}}
    ground = make(heights_of(lambda x, y: -0.2 * x, 11, 3.0), 3.0)
    world = world_on(ground, [ball], model)
    world.step(round(t / STEP))
    # Rolling without slipping: 5/7 g sin(slope). Springs are loaded at once, and let it swing by
    # twice m g / k, of a sphere's one point: 0.2 mm.
    way = 0.5 * 5.0 / 7.0 * G * math.sin(slope) * t * t
    assert world.position[1] - ball['pose']['position'] == pytest.approx(
        [way * math.cos(slope), 0.0, -way * math.sin(slope)],
        abs=1e-3 if model == 'penalty' else 1e-5)


@pytest.mark.parametrize('model', ['timestep', 'event'])
@pytest.mark.parametrize('seed', range(4))
def test_what_tumbles_over_hills_gains_no_energy_and_stays_above(seed, model):
    rng = np.random.default_rng(seed)
    relief = float(rng.choice([0.02, 0.1, 0.3]))
    heights = relief * rng.standard_normal((9, 9))
    bodies = []
    for k, name in enumerate(rng.permutation(list(SOLIDS))[:4]):
        q = rng.standard_normal(4)
        middle = np.array([(-0.8, -0.8), (0.8, -0.8), (-0.8, 0.8), (0.8, 0.8)][k])
        bodies.append({
            'name': str(name), 'shape': SOLIDS[name][0], 'mass': float(10 ** rng.uniform(-1, 1)),
            'pose': {'position': [*(middle + rng.uniform(-0.5, 0.5, 2)).tolist(),
                                  float(heights.max() + 0.3)],
                     'orientation': (q / np.linalg.norm(q)).tolist()},
            'twist': {'linear': rng.uniform(-0.3, 0.3, 3).tolist(),
                      'angular': rng.uniform(-3, 3, 3).tolist()}})
    make = field if seed % 2 else triangles
    world = world_on(make(heights, 4.0), bodies, model, float(rng.uniform(0, 1.2)))
    start = lowest = energy(world)
    for _ in range(500):
        world.step()
        # A step of free rotation is of second order: (w h)^2 / 12 of what turns, with 30 rad/s.
        assert energy(world) - lowest < 3e-4 * start
        lowest = min(lowest, energy(world))
    above = np.abs(world.position[1:, :2]).max(axis=1) < 1.8
    assert above.any()
    assert (world.position[1:, 2][above] > heights.min()).all()


@every_ground
@pytest.mark.parametrize(('model', 'speed'), [('timestep', 60.0), ('event', 15.0)])
def test_what_goes_farther_in_a_step_than_a_sheet_is_thick_does_not_fall_through(
        model, speed, make):
    heights = 0.05 * np.random.default_rng(0).standard_normal((9, 9))
    for k, (name, (shape, _)) in enumerate(SOLIDS.items()):
        body = {'name': name, 'shape': shape, 'mass': 1.0,
                'pose': {'position': [-1.0 + 0.4 * k, 0.1 * k, 2.0]},
                'twist': {'linear': [0.0, 0.0, -speed]}}    # 1 m and 0.25 m in a step
        world = world_on(make(heights, 4.0), [body], model, step=1 / 60)
        world.step(20)
        assert world.position[1, 2] > heights.min()


@pytest.mark.parametrize('model', ['timestep', 'event'])
def test_a_room_holds_what_its_convex_hull_would_throw_out(model):
    corners = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 1)]
    # Four walls and a floor, seen from inside; no ceiling.
    quads = [(0, 4, 6, 2), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    room = {'type': 'mesh', 'vertices': corners, 'faces': faces, 'convex': False}
    world = world_on(room, [
        {'name': 'ball', 'shape': {'type': 'sphere', 'radius': 0.1}, 'mass': 1.0,
         'pose': {'position': [0, 0, 0.1]}, 'twist': {'linear': [3.0, 1.0, 0.0]}},
        {'name': 'crate', 'shape': {'type': 'box', 'size': [0.2, 0.2, 0.2]}, 'mass': 1.0,
         'pose': {'position': [0.5, -0.5, 0.1]}, 'twist': {'linear': [0.0, -4.0, 0.0]}}],
        model, friction=0.2)
    for _ in range(300):
        world.step()
        # Both are 0.1 m from their middles to a wall that they lie on; a crate that turns, up to
        # 0.173 m. They sink in by a millionth.
        assert (np.abs(world.position[1:, :2]) < 0.9 + 1e-5).all()
    assert world.position[1:, 2] == pytest.approx([0.1, 0.1], abs=1e-5)


def test_a_ground_of_many_pieces_is_the_same_from_its_text_and_after_a_snapshot():
    heights = 0.05 * np.random.default_rng(1).standard_normal((9, 9))
    ball = {'name': 'ball', 'shape': {'type': 'sphere', 'radius': 0.15}, 'mass': 1.0,
            'pose': {'position': [0.1, 0.2, 0.5]}, 'twist': {'linear': [0.5, 0.0, 0.0]}}
    world = world_on(field(heights, 4.0), [ball])
    world.step(150)
    saved = world.save()
    world.step(150)
    other = world_on(field(heights, 4.0), [ball])
    other.restore(saved)
    other.step(150)
    assert other.state_hash() == world.state_hash()


def test_a_ground_can_come_and_go():
    ball = {'name': 'ball', 'shape': {'type': 'sphere', 'radius': 0.15}, 'mass': 1.0,
            'pose': {'position': [0.1, 0.2, 0.15]}}
    world = world_on(field(np.zeros((5, 5)), 2.0), [ball])
    world.add({'name': 'step', 'fixed': True, 'shape': triangles(np.zeros((3, 3)), 1.0),
               'pose': {'position': [3.0, 0.0, 0.5]}})
    world.add({'name': 'other', 'mass': 1.0, 'shape': {'type': 'box', 'size': [0.2, 0.2, 0.2]},
               'pose': {'position': [3.0, 0.0, 0.6]}})
    world.step(100)
    assert world.position[[1, 3], 2] == pytest.approx([0.15, 0.6], abs=1e-5)
    world.remove('step')
    world.step(100)
    assert world.position[2, 2] < 0.5
