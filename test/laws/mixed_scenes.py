# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Random articulations among loose bodies, in one world.

Loose bodies fall on an articulation, lie under it on the floor, lean on it, fly past or into it,
lie on each other, or hang on it by a spring. Steps are those of users, 0.1 ms to 1/60 s.
"""

from collections.abc import Callable, Sequence
import math
from typing import NamedTuple

from laws.jointed_scenes import (
    begins_apart, CARRIED, draw_articulations, FALLING, FREE, HUNG, HUNG_ABOVE_A_FLOOR, Way)
from laws.scenes import (
    any_attitude, between, body, direction, G, matrix, penalty_stiffness, Scene, Spec)
from laws.solids import box, capsule, cylinder, draw_solid, Generator, Solid, sphere
import numpy as np

STEPS = (1e-4, 5e-4, 1e-3, 2e-3, 4e-3, 1 / 60)  # [s]
TIME = 0.8  # [s] in which what falls from 3 m lands; at the shortest steps a part of it
MOST_STEPS = 400
# More of the scenes have a floor: most of what may happen happens there.
WAYS = (FALLING, FALLING, HUNG_ABOVE_A_FLOOR, HUNG_ABOVE_A_FLOOR, HUNG, FREE, CARRIED)
# Places that are tried for a body; in a crowd there may be none.
TRIES = 30


class Loose(NamedTuple):
    """A body at a place."""

    solid: Solid
    at: np.ndarray  # (3,) [m]
    attitude: np.ndarray  # (4,)
    v: np.ndarray  # (3,) [m/s]
    w: np.ndarray  # (3,) [rad/s]


class Standing(NamedTuple):
    """What stands already where a body is to be placed."""

    name: str
    solid: Solid
    at: np.ndarray
    attitude: np.ndarray
    v: np.ndarray
    w: np.ndarray


def draw_mixed(rng: Generator, ways: Sequence[Way] = WAYS, sleeps: bool = True) -> Scene:
    """Draw a scene of one of these ways, in which nothing overlaps at the start."""
    while True:
        way = ways[rng.integers(len(ways))]
        spec = draw_articulations(rng, way)
        h = float(rng.choice(STEPS))
        spec['world']['step'] = h
        add_loose(rng, spec, way)
        _add_springs(rng, spec)
        if sleeps and rng.random() < 0.3:
            spec['collision'] = {'sleep_after': float(rng.uniform(0.02, 0.3))}
        if way == FALLING and rng.random() < 0.2:
            _make_conveyor(rng, spec)
        for material in spec['materials'].values():
            material |= penalty_stiffness(spec['bodies'], h)
        loose = loose_bodies(spec)
        if loose and begins_apart(spec):
            steps = int(np.clip(math.ceil(TIME / h), 40, MOST_STEPS))
            return Scene(spec, 0.2, steps, {'seed': int(rng.integers(1 << 31)), 'way': way,
                                            'loose': loose})


def loose_bodies(spec: Spec) -> list[str]:
    """Return the names of the bodies that move and that no joint holds."""
    held = {joint[end] for joint in spec['joints'] for end in ('parent', 'child')}
    return [one['name'] for one in spec['bodies'] if 'inertial' in one
            and one['name'] not in held]


def add_loose(rng: Generator, spec: Spec, way: Way) -> None:
    """Add one to eight loose bodies, fewer where there is no room."""
    there = [_standing(one) for one in spec['bodies'] if one['shape']['type'] != 'plane']
    spec['materials']['other'] = {'friction': float(rng.choice([0, 0.5, 1.0])),
                                  'restitution': float(rng.choice([0, 0, 0.5, 1.0]))}
    dusty = rng.random() < 0.2
    for k in range(rng.integers(1, 9)):
        found = _draw_loose(rng, there, way)
        if found is None:
            continue
        name = f'loose{k}'
        one = body(name, found.solid, between(rng, 1e-2, 1e2), found.at, found.attitude, found.v,
                   found.w)
        if rng.random() < 0.5:
            one['material'] = 'other'
        if dusty and rng.random() < 0.5:
            # Such bodies touch all but each other, or nothing but each other.
            one |= {'groups': ['dust'], 'collides_with': [str(rng.choice(['default', 'dust']))]}
        spec['bodies'].append(one)
        there.append(Standing(name, *found))


def _draw_loose(rng: Generator, there: Sequence[Standing], way: Way) -> Loose | None:
    """Draw a body where nothing stands; None where there is no room."""
    arrange = _lie if way.floor and rng.random() < 0.4 else _ARRANGE[rng.integers(len(_ARRANGE))]
    for _ in range(TRIES):
        solid = draw_solid(rng, between(rng, 0.05, 0.4))
        one, beside = arrange(rng, solid, there)
        lowest = one.at[2] - (0.0 if beside == 'ground' else solid.radius)
        if way.floor and lowest < 0.0:
            continue
        if all(np.linalg.norm(one.at - other.at) > solid.radius + other.solid.radius
               for other in there if other.name != beside):
            return one
    return None


# --- arrangements: a body, and the name of what it may be near to --------------------------------


def _fall(rng: Generator, solid: Solid, there: Sequence[Standing]) -> tuple[Loose, str]:
    """Let a body fall from above."""
    at = np.append(rng.uniform(-0.6, 0.6, 2), rng.uniform(1.0, 4.0))
    v = rng.normal(size=3) - [0.0, 0.0, rng.choice([0.0, 2.0, 10.0])]
    return Loose(solid, at, any_attitude(rng), v, 3.0 * rng.normal(size=3)), ''


def _lean(rng: Generator, solid: Solid, there: Sequence[Standing]) -> tuple[Loose, str]:
    """Let a body move along with another that it touches, or nearly so."""
    other = there[rng.integers(len(there))]
    n = direction(rng) if rng.random() < 0.5 else np.array((0.0, 0.0, 1.0))
    q = any_attitude(rng)
    apart = (other.solid.reach(matrix(other.attitude).T @ n) + solid.reach(-(matrix(q).T @ n))
             + between(rng, 1e-7, 1e-2))
    v = other.v + np.cross(other.w, apart * n)
    return Loose(solid, other.at + apart * n, q, v, other.w.copy()), other.name


def _pass(rng: Generator, solid: Solid, there: Sequence[Standing]) -> tuple[Loose, str]:
    """Let a body fly at another, or past it."""
    other = there[rng.integers(len(there))]
    way = direction(rng)
    aim = other.at + rng.normal(0.0, 0.2, 3)
    at = aim - way * rng.uniform(0.5, 2.0)
    return Loose(solid, at, any_attitude(rng), between(rng, 0.5, 20.0) * way,
                 3.0 * rng.normal(size=3)), ''


def _lie(rng: Generator, solid: Solid, there: Sequence[Standing]) -> tuple[Loose, str]:
    """Let a body lie or stand on the floor, at rest."""
    q = any_attitude(rng) if rng.random() < 0.2 else np.array((0.0, 0.0, 0.0, 1.0))
    at = np.append(rng.uniform(-0.6, 0.6, 2), solid.reach(-(matrix(q).T @ (0.0, 0.0, 1.0))))
    return Loose(solid, at, q, np.zeros(3), np.zeros(3)), 'ground'


_ARRANGE: tuple[Callable[..., tuple[Loose, str]], ...] = (_fall, _lean, _lean, _pass)

_SOLIDS: dict[str, Callable[[Spec], Solid]] = {
    'box': lambda shape: box(shape['size']),
    'sphere': lambda shape: sphere(shape['radius']),
    'capsule': lambda shape: capsule(shape['radius'], shape['length']),
    'cylinder': lambda shape: cylinder(shape['radius'], shape['length'])}


def _standing(one: Spec) -> Standing:
    twist = one.get('twist', {'linear': (0, 0, 0), 'angular': (0, 0, 0)})
    return Standing(one['name'], _SOLIDS[one['shape']['type']](one['shape']),
                    *(np.array(value, dtype=float) for value in (
                        one['pose']['position'], one['pose']['orientation'], twist['linear'],
                        twist['angular'])))


# --- what acts on them ---------------------------------------------------------------------------


def _add_springs(rng: Generator, spec: Spec) -> None:
    """Add up to two springs between a loose body and anything."""
    loose = loose_bodies(spec)
    able = {one['name']: one for one in spec['bodies'] if 'inertial' in one}
    if not loose or rng.random() < 0.7:
        return
    spec['forces'] = []
    for _ in range(rng.integers(1, 3)):
        first = loose[rng.integers(len(loose))]
        others = [name for name in able if name != first]
        # One on the world does work where one looks at it from a carrier.
        to_world = rng.random() < 0.3 and 'carrier' not in {one['name'] for one in spec['bodies']}
        second = 'world' if to_world else others[rng.integers(len(others))]
        anchor = rng.uniform((-0.5, -0.5, 1.5), (0.5, 0.5, 2.5)) if to_world else np.zeros(3)
        end = anchor if to_world else np.array(able[second]['pose']['position'])
        apart = float(np.linalg.norm(end - able[first]['pose']['position']))
        m = min(able[name]['inertial']['mass'] for name in {first, second} & set(able))
        # A fifth of a radian in a step, a rate that both ends may double.
        rate = between(rng, 1.0, min(30.0, 0.1 / spec['world']['step']))
        spec['forces'].append({
            'type': 'spring', 'a': first, 'b': second, 'anchor': anchor.tolist(),
            'stiffness': m * rate ** 2, 'damping': float(rng.choice([0.0, 0.3 * m * rate])),
            'rest_length': apart * float(rng.uniform(0.3, 1.2))})


def _make_conveyor(rng: Generator, spec: Spec) -> None:
    """Let the floor move along itself; whoever moves with it sees no work."""
    if any(force['b'] == 'world' for force in spec.get('forces', ())):
        return
    floor = next(one for one in spec['bodies'] if one['name'] == 'ground')
    del floor['fixed']
    floor |= {'name': 'carrier', 'kinematic': True, 'pose': {
        'position': [0.0, 0.0, 0.0], 'orientation': [0.0, 0.0, 0.0, 1.0]}, 'twist': {
        'linear': [*rng.normal(0.0, 1.0, 2).tolist(), 0.0], 'angular': [0.0, 0.0, 0.0]}}


def draw_floating(rng: Generator) -> Scene:
    """Draw bodies that meet in space, or that fall together."""
    scene = draw_mixed(rng, (FREE,))
    for force in list(scene.spec.get('forces', ())):
        if force['b'] == 'world':
            scene.spec['forces'].remove(force)
    if rng.random() < 0.4:
        scene.spec['world']['gravity'] = [0.0, 0.0, -G]
    return scene


def draw_falling(rng: Generator) -> Scene:
    """Draw bodies that nothing holds but a floor."""
    while True:
        scene = draw_mixed(rng, (FALLING,))
        if all(force['b'] != 'world' for force in scene.spec.get('forces', ())):
            return scene


def draw_awake(rng: Generator) -> Scene:
    """Draw a scene in which nothing sleeps: twins of another size or speed would not."""
    return draw_mixed(rng, sleeps=False)
