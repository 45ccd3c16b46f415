# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""In large worlds the engine numbers bodies by their place, and nobody sees it."""

from typing import Any

from dropping import REACH, SHAPES
from inside import order_of
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.body_order import _spread, MANY, order_by_place
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.scene import scene_from_dict
from rigid_sim_ros.world.snapshot import pack, unpack

COUNT = MANY + 40
OF_BODIES = ('position', 'orientation', 'linear_velocity', 'angular_velocity', 'linear_momentum',
             'angular_momentum', 'center_of_mass', 'mass')


def crowd(seed: int | None, count: int = COUNT, stiffness: float = 40.0, **world: Any) -> World:
    """Return bodies of all shapes above the ground, in an order of this seed."""
    rng = np.random.default_rng(3)
    bodies: list[dict[str, Any]] = [
        {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}]
    for k in range(count):
        q, shape = rng.normal(size=4), SHAPES[sorted(SHAPES)[k % len(SHAPES)]]
        place = 0.2 * np.array([k % 8 - 3.5, k // 8 % 8 - 3.5, k // 64 + 0.6])
        bodies.append({
            'name': f'b{k}', 'density': 400.0 + k,
            **(shape if 'compound' in shape else {'shape': shape}),
            'frames': {'handle': {'position': [0.03, 0.0, 0.01 * (k % 3)]}},
            'pose': {'position': (place + rng.uniform(-0.02, 0.02, 3)).tolist(),
                     'orientation': (q / np.linalg.norm(q)).tolist()},
            'twist': {'linear': rng.normal(0, 0.3, 3).tolist()}})
    if seed is not None:
        bodies = [bodies[k] for k in np.random.default_rng(seed).permutation(len(bodies))]
    spring = {'type': 'spring', 'a': 'b7', 'b': 'b250', 'stiffness': stiffness,
              'rest_length': 0.3}
    return World.from_dict({
        'format': 1, 'world': {'contact': 'timestep', 'step': 1 / 240, **world},
        'bodies': bodies, 'forces': [spring],
        'collision': {'ignore': [['b3', 'b4'], ['b100', 'b101']]}})


def drive(world: World) -> None:
    """Let somebody use all ways in, and let bodies fall."""
    world.set_twist('b20', (0.5, 0.0, 1.0), (0.0, 3.0, 0.0))
    world.set_pose('b21', (0.0, 0.0, 3.0), (0.0, 0.0, 0.0, 1.0))
    for k in range(8):
        world.apply_wrench('b9', (0.0, 0.1, 0.3), (0.01, 0.0, 0.0), duration=0.02, source='arm')
        world.apply_wrench('b30', (0.1, 0.0, 0.0), frame='b31/handle')
        world.apply_impulse('b40', (0.001, 0.0, 0.002), point=(0.0, 0.01, 0.0), frame='b40')
        world.step(4 if k % 2 else 5)


def test_the_order_of_the_bodies_in_a_large_scene_changes_no_bit():
    worlds = [crowd(seed) for seed in (None, 1)]
    for world in worlds:
        drive(world)
    one, other = worlds
    where = [other.names.index(name) for name in one.names]
    assert one.names != other.names and len(one.contacts()) > 100
    for name in OF_BODIES:
        assert getattr(one, name).tobytes() == getattr(other, name)[where].tobytes(), name
    a, b = one.contacts(), other.contacts()
    assert one.contact_report() == other.contact_report()
    # The engine's order, and so that of the contacts, is the same.
    for body in ('body_a', 'body_b'):
        assert [one.names[k] for k in a[body]] == [other.names[k] for k in b[body]]
        b[body] = a[body]
    assert a.tobytes() == b.tobytes()
    # Sums, in another order.
    assert np.allclose(one.contact_wrenches(), other.contact_wrenches()[where], rtol=0, atol=1e-9)
    assert one.potential_energy() == other.potential_energy()


def test_each_body_is_told_apart_from_its_neighbours():
    world = crowd(2)
    start = {body.name: body.pose.position for body in world.scene.spec.bodies}
    for name, p in zip(world.names, world.position, strict=True):
        assert np.allclose(p, start[name], rtol=0, atol=1e-12)
    assert np.array_equal(world.mass, world.scene.model.m)
    for k in (5, 60, 200):
        name = f'b{k}'
        body, before = world.names.index(name), world.linear_momentum
        world.apply_impulse(name, (0.0, 0.0, 2.0))
        change = world.linear_momentum - before
        assert change[body] == pytest.approx((0.0, 0.0, 2.0)) and np.count_nonzero(change) == 1
    world.step(20)
    world.reset()
    assert np.allclose(world.position[body], start[name], rtol=0, atol=1e-12)


def test_contacts_name_the_bodies_that_touch():
    world = crowd(5)
    world.step(50)      # by then many lie on the ground, and on each other
    rows, x, ground = world.contacts(), world.center_of_mass, world.names.index('ground')
    assert len(rows) > COUNT
    # No shape reaches farther from the origin of its frame than REACH.
    for body in ('body_a', 'body_b'):
        free = rows[rows[body] != ground]
        assert (np.linalg.norm(free['point'] - x[free[body]], axis=1) < 2.0 * REACH).all()
    # Gravity, the spring between two of them apart, is what the ground carries.
    forces = world.contact_wrenches()[:, :3].sum(axis=0)
    assert np.allclose(forces, 0.0, atol=1e-9)


def test_a_large_world_is_saved_and_restored():
    one, other = crowd(4), crowd(4)
    drive(one)
    saved = one.save()
    other.restore(saved)
    one.step(20)
    other.step(20)
    assert one.state_hash() == other.state_hash()
    meta, arrays = unpack(saved)
    # As it was before bodies were numbered by their place.
    del meta['order']
    before = other.state_hash()
    with pytest.raises(ValueError, match='numbers the bodies in another way'):
        other.restore(pack(meta, arrays))
    assert other.state_hash() == before


@pytest.mark.parametrize('count, model, order', [
    (MANY - 1, {}, 'as in the scene'), (MANY, {}, 'by place'),
    (MANY, {'contact': 'event'}, 'as in the scene'),
    (MANY, {'solver': 'qp'}, 'as in the scene')])
def test_few_bodies_and_other_models_keep_the_order_of_the_scene(count, model, order):
    world = crowd(None, count, **model)
    kept = order_of(world) == list(range(count + 1))
    assert kept == (order == 'as in the scene')
    assert sorted(order_of(world)) == list(range(count + 1))
    if not kept:
        # What does not move comes last.
        assert world.names[order_of(world)[-1]] == 'ground'


def test_a_body_of_a_large_world_that_flies_off_is_named():
    # A force of 1e208 N in the first step, of 1e200 N/m times a way of 1e203 m in the second.
    world = crowd(6, stiffness=1e200, bounds={'position': 1e9})
    for name, height in (('b7', 1e4), ('b250', 1e8)):
        world.set_pose(name, (0.0, 0.0, height), (0.0, 0.0, 0.0, 1.0))
    with pytest.raises(ArithmeticError, match=r"body 'b(7|250)'"):
        world.step(2)


def test_pairs_that_the_scene_ignores_pass_through_each_other():
    world = crowd(7)
    for still, moved in (('b3', 'b4'), ('b100', 'b101'), ('b200', 'b201')):
        world.set_pose(moved, world.position[world.names.index(still)], (0.0, 0.0, 0.0, 1.0))
    world.step()
    rows = world.contacts()
    met = {frozenset((world.names[a], world.names[b]))
           for a, b in zip(rows['body_a'], rows['body_b'], strict=True)}
    assert {'b200', 'b201'} in met
    assert {'b3', 'b4'} not in met and {'b100', 'b101'} not in met


def test_the_spread_is_the_same_however_it_is_summed_up():
    # So the axis is, of a regular heap too, whose spreads differ by rounding alone.
    rng = np.random.default_rng(8)
    x = rng.normal(size=1000) * 10.0 ** rng.integers(-3, 4, 1000)
    assert {_spread(rng.permutation(x)) for _ in range(50)} == {_spread(x)}
    assert _spread(x) == pytest.approx(x.std(), rel=1e-12)


def heap(order: np.ndarray) -> tuple[Model, State]:
    """Return balls in layers and rows, a little off, and the ground, in this order."""
    rng = np.random.default_rng(8)
    k = np.arange(9 * 8 * 7)
    grid = 0.2 * np.stack([k % 9, k // 9 % 8, k // 72], axis=1)
    grid += rng.uniform(-0.01, 0.01, grid.shape)
    bodies: list[dict[str, Any]] = [
        {'name': f'b{i}', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1},
         'pose': {'position': grid[i].tolist()}} for i in order]
    ground = {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}
    scene = scene_from_dict({'format': 1, 'bodies': [ground, *bodies]})
    return scene.model, scene.state


def test_bodies_are_numbered_by_halves_layers_and_rows():
    count = 9 * 8 * 7
    for seed in (1, 2):
        order = np.random.default_rng(seed).permutation(count)
        numbers = order_by_place(*heap(order))
        assert numbers[-1] == 0     # the ground
        place = order[numbers[:-1] - 1]
        x, y, z = place % 9, place // 9 % 8, place // 72
        # x is the widest: four columns of it and half of the fifth on either side.
        assert (x[:count // 2] <= 4).all() and (x[count // 2:] >= 4).all()
        for half in (slice(0, count // 2), slice(count // 2, count)):
            # Layers follow each other, in a layer rows, in a row places.
            assert (np.diff(z[half]) >= 0).all()
            assert (np.diff(8 * z[half] + y[half]) >= 0).all()
            row = np.diff(8 * z[half] + y[half]) == 0
            assert (np.diff(x[half])[row] > 0).all()


def test_bodies_in_a_plane_or_a_line_or_a_point_are_numbered_too():
    rng = np.random.default_rng(9)
    for axes in ((0, 1), (2,), ()):
        model, state = heap(np.arange(9 * 8 * 7))
        for k in range(3):
            state.x[k, 1:] = rng.uniform(0, 5, 9 * 8 * 7) if k in axes else 0.25
        numbers = order_by_place(model, state)
        assert sorted(numbers.tolist()) == list(range(9 * 8 * 7 + 1)) and numbers[-1] == 0
        if axes == (2,):
            assert (np.diff(state.x[2, numbers[:-1]]) >= 0).all()
