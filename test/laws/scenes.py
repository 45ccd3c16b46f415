# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Random scenes from a seed, in the format of a scene file.

What all of them share: size, step, masses and surfaces over the ranges that the package promises.
A law arranges bodies of these as it needs them; the same law and seed give the same scene.
"""

from collections.abc import Callable, Mapping, Sequence
import math
from types import MappingProxyType
from typing import Any, NamedTuple

from laws.solids import draw_solid, Generator, Solid
import numpy as np

G = 9.81
SIZES = 1e-3, 1e2  # [m]
STEPS = 1e-4, 1 / 60  # [s]
MASSES = 1e-3, 1e4  # [kg]
# Step over sqrt(size / g), the time in which a thing falls by half its size. At 0.4 it falls by
# 8 % of its size within a step from rest: coarse, but what a user of 1/60 s has with things
# of 2 cm. Below 0.004 a scene takes a thousand steps for four of these times and shows nothing
# that the scenes above do not.
COARSENESS = 0.004, 0.4

Spec = dict[str, Any]


class Scene(NamedTuple):
    """A scene and what a law has to know of it."""

    spec: Spec  # as in a scene file
    size: float  # [m] of its bodies
    steps: int
    facts: Mapping[str, Any] = MappingProxyType({})  # what the law that drew it remembers

    @property
    def h(self) -> float:
        """Return the step [s]."""
        return float(self.spec['world']['step'])


class Scales(NamedTuple):
    """Size and step of a scene."""

    size: float
    h: float

    @property
    def time(self) -> float:
        """Return sqrt(size / g) [s]."""
        return math.sqrt(self.size / G)

    @property
    def speed(self) -> float:
        """Return sqrt(size g) [m/s]."""
        return math.sqrt(self.size * G)

    def steps(self, times: float) -> int:
        """Return the steps of so many of its times."""
        return math.ceil(times * self.time / self.h)


def between(rng: Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def draw_scales(rng: Generator, coarsest: float = COARSENESS[1]) -> Scales:
    """Draw a size, and a step that neither skips what happens nor takes for ever."""
    while True:
        size, h = between(rng, *SIZES), between(rng, *STEPS)
        if COARSENESS[0] <= h / math.sqrt(size / G) <= coarsest:
            return Scales(size, h)


def draw_masses(rng: Generator, count: int) -> np.ndarray:
    """Draw masses [kg]: of one order in half of the scenes, of any in the others."""
    first = between(rng, *MASSES)
    if rng.random() < 0.5:
        return np.clip(first * 10 ** rng.uniform(-0.5, 0.5, count), *MASSES)
    return np.array([between(rng, *MASSES) for _ in range(count)])


def draw_surface(rng: Generator, restitution: float | None = None,
                 friction: float | None = None) -> dict[str, float]:
    """Draw friction 0 to 2 and restitution 0 to 1, their ends among them."""
    if friction is None:
        friction = float(rng.choice([0.0, rng.uniform(0, 2), rng.uniform(0.1, 1)]))
    if restitution is None:
        restitution = float(rng.choice([0.0, 1.0, rng.uniform(0, 1)]))
    return {'friction': friction, 'restitution': restitution}


# --- attitudes: quaternions x, y, z, w -----------------------------------------------------------


def product(p: Sequence[float], q: Sequence[float]) -> np.ndarray:
    """Return the product of quaternions: first turn by q, then by p."""
    a, b, c, w = p
    x, y, z, s = q
    return np.array([w * x + a * s + b * z - c * y, w * y - a * z + b * s + c * x,
                     w * z + a * y - b * x + c * s, w * s - a * x - b * y - c * z])


def matrix(q: Sequence[float]) -> np.ndarray:
    """Return the rotation matrix, body to world."""
    x, y, z, w = np.asarray(q) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def turn(axis: Sequence[float], angle: float) -> np.ndarray:
    """Return the quaternion of a turn about an axis."""
    n = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    return np.append(math.sin(angle / 2) * n, math.cos(angle / 2))


def any_attitude(rng: Generator) -> np.ndarray:
    """Draw an attitude, uniformly."""
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def draw_attitude(rng: Generator, kind: str) -> np.ndarray:
    """Draw an attitude: 'random', 'flat' and aligned with the axes, or 'yawed' and flat."""
    if kind == 'random':
        return any_attitude(rng)
    angle = 0.5 * math.pi * rng.integers(4) if kind == 'flat' else rng.uniform(0, 2 * math.pi)
    return turn((0, 0, 1), angle)


def direction(rng: Generator) -> np.ndarray:
    """Draw a unit vector, uniformly."""
    n = rng.normal(size=3)
    return n / np.linalg.norm(n)


# --- bodies and worlds ---------------------------------------------------------------------------


def body(name: str, solid: Solid, mass: float, position: Sequence[float],
         attitude: Sequence[float] = (0, 0, 0, 1), linear: Sequence[float] = (0, 0, 0),
         angular: Sequence[float] = (0, 0, 0), com: Sequence[float] | None = None) -> Spec:
    """Return a body that moves."""
    moments = mass * solid.inertia
    inertia = moments[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]
    return {'name': name, 'shape': solid.shape,
            'inertial': {'mass': float(mass), 'com': _floats(solid.com if com is None else com),
                         'inertia': _floats(inertia)},
            'pose': {'position': _floats(position), 'orientation': _floats(attitude)},
            'twist': {'linear': _floats(linear), 'angular': _floats(angular)}}


def fixed(name: str, solid: Solid, position: Sequence[float],
          attitude: Sequence[float] = (0, 0, 0, 1)) -> Spec:
    """Return a body that stays."""
    return {'name': name, 'shape': solid.shape, 'fixed': True,
            'pose': {'position': _floats(position), 'orientation': _floats(attitude)}}


def plane() -> Spec:
    """Return the ground, z = 0."""
    return {'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True}


def _floats(values: Sequence[float] | np.ndarray) -> list[float]:
    return [float(value) for value in values]


def world(bodies: list[Spec], h: float, surface: dict[str, float],
          gravity: Sequence[float] = (0.0, 0.0, -G)) -> Spec:
    """Return a scene of these bodies; with_model says which contact model runs it."""
    return {'format': 1, 'world': {'step': float(h), 'gravity': _floats(gravity)},
            'materials': {'default': surface | penalty_stiffness(bodies, h)}, 'bodies': bodies}


MODELS = {'timestep': {'contact': 'timestep'}, 'event': {'contact': 'event'},
          'qp': {'contact': 'timestep', 'solver': 'qp'}, 'penalty': {'contact': 'penalty'},
          'none': {'contact': 'none'}}


def with_model(spec: Spec, model: str, substeps: int = 4) -> Spec:
    """Return the scene for a contact model."""
    found = spec | {'world': spec['world'] | MODELS[model]}
    collision = dict(spec.get('collision', {}))
    if model == 'timestep':
        collision['substeps'] = substeps
    else:
        collision.pop('sleep_after', None)  # the others let nothing sleep
    return found | {'collision': collision}


def penalty_stiffness(bodies: list[Spec], h: float) -> dict[str, float]:
    """Return springs for the model `penalty` that the step can follow."""
    yields = 0.0  # [1/kg] the most that a point of a body yields
    for one in bodies:
        if 'inertial' in one:
            m, moments = one['inertial']['mass'], one['inertial']['inertia'][:3]
            yields = max(yields, 1 / m + extent(one['shape']) ** 2 / min(moments))
    # k h^2 / m is the square of the phase of the spring's oscillation in a step: 0.1 rad for a
    # point, of which up to eight may act at once.
    return {'stiffness': 0.01 / yields / h ** 2 / 4, 'damping': 0.0}


def extent(shape: Spec) -> float:
    """Return a bound of the distance of a shape's points from its origin [m]."""
    if shape['type'] == 'sphere':
        return float(shape['radius'])
    if shape['type'] == 'box':
        return 0.5 * float(np.linalg.norm(shape['size']))
    if shape['type'] == 'ellipsoid':
        return float(max(shape['radii']))
    if shape['type'] == 'cone':  # from its centre of mass
        return max(math.hypot(shape['radius'], 0.25 * shape['length']), 0.75 * shape['length'])
    if shape['type'] in ('cylinder', 'capsule'):
        return float(shape['radius'] + 0.5 * shape['length'])
    if shape['type'] == 'mesh':
        return float(np.linalg.norm(shape['vertices'], axis=1).max())
    return max(extent(part) + float(np.linalg.norm(part['pose']['position']))
               for part in shape['compound'])


# --- arrangements --------------------------------------------------------------------------------


def column(rng: Generator, solids: Sequence[Solid], masses: Sequence[float], scales: Scales,
           attitudes: str, spread: float, spin: float) -> list[Spec]:
    """
    Return bodies above the ground, each higher than the one before, none touching another.

    They are `spread` of their size to the side at most, and turn and fly with up to `spin` of
    the speeds that gravity gives.
    """
    bodies, height = [], 0.0
    for k, (solid, mass) in enumerate(zip(solids, masses, strict=True)):
        q = draw_attitude(rng, attitudes)
        down = matrix(q).T @ (0.0, 0.0, 1.0)
        height += solid.reach(-down) + scales.size * between(rng, 1e-3, 1.0)
        place = np.append(spread * scales.size * rng.uniform(-1, 1, 2), height)
        height += solid.reach(down)
        v = spin * scales.speed * rng.normal(size=3) * (0.5, 0.5, 0.2)
        w = spin / scales.time * rng.normal(size=3)
        bodies.append(body(f'b{k}', solid, mass, place, q, v, w))
    return bodies


def heap(rng: Generator, scales: Scales, most: int = 10,
         draw: Callable[[Generator, float], Solid] = draw_solid) -> list[Spec]:
    """Return one to ten bodies that fall on the ground and on each other."""
    count = int(rng.integers(1, most + 1))
    sizes = scales.size * 10 ** rng.uniform(-0.5, 0.0, count)
    solids = [draw(rng, size) for size in sizes]
    attitudes = str(rng.choice(['random', 'flat', 'yawed']))
    still = rng.random() < 0.5
    return column(rng, solids, draw_masses(rng, count), scales, attitudes,
                  0.0 if rng.random() < 0.3 else 0.4, 0.0 if still else 1.0)
