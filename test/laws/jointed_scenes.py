# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Random articulations: trees and loops, coupled joints, and all that acts along their axes.

A scene has up to three parts, each a tree of bodies that floats, or hangs on the world or on a
carrier, a kinematic body with a constant twist. Joints that close loops and joints that mimic
others are added to these. Bodies begin with velocities that the joints allow.
"""

from collections.abc import Sequence
from typing import NamedTuple

from laws.motion import Ours
from laws.scenes import any_attitude, between, body, direction, G, plane, Scene, Spec, with_model
from laws.solids import draw_solid, Generator
import numpy as np
from scipy.spatial.transform import Rotation

ONE_AXIS = ('revolute', 'continuous', 'prismatic')
TREE_TYPES = ('revolute', 'revolute', 'continuous', 'prismatic', 'prismatic', 'spherical',
              'universal', 'planar', 'fixed')
# A joint with few conditions leaves a loop its motions; one with many says some of them twice.
LOOP_TYPES = ('spherical', 'spherical', 'distance', 'distance', 'universal', 'planar', 'revolute',
              'continuous', 'prismatic', 'fixed')
SIZES = 0.1, 0.3  # [m]
# [m] A scene in which bodies overlap by more at its start is drawn again: they are pushed apart.
APART = -1e-3
NAMES_OF_SHAPES = ('box', 'sphere', 'capsule', 'cylinder')


class Way(NamedTuple):
    """Where a scene plays."""

    anchor: str | None  # what its parts may hang on: 'world', 'carrier', or nothing
    floor: bool
    gravity: bool


FREE = Way(None, floor=False, gravity=False)
FALLING = Way(None, floor=True, gravity=True)
HUNG = Way('world', floor=False, gravity=True)
HUNG_ABOVE_A_FLOOR = Way('world', floor=True, gravity=True)
CARRIED = Way('carrier', floor=False, gravity=True)
WAYS = (FREE, FALLING, HUNG, HUNG_ABOVE_A_FLOOR, CARRIED)


def draw_jointed(rng: Generator, ways: Sequence[Way] = WAYS, steps: int = 400) -> Scene:
    """Draw a scene of one of these ways, in which nothing overlaps at the start."""
    while True:
        way = ways[rng.integers(len(ways))]
        spec = draw_articulations(rng, way)
        if begins_apart(spec):
            return Scene(spec, 0.2, steps, {'seed': int(rng.integers(1 << 31)), 'way': way})


def draw_articulations(rng: Generator, way: Way) -> Spec:
    """Draw bodies and joints; bodies may overlap and fly as their joints do not let them."""
    return _Draw(rng, way).spec()


def begins_apart(spec: Spec) -> bool:
    """
    Return whether nothing overlaps at the start; write the velocities that the joints allow.

    What joints take of others depends on the tree, and so on the order of the bodies.
    """
    world = Ours(with_model(spec, 'timestep')).world
    for k, one in enumerate(spec['bodies']):
        if 'inertial' in one:
            one['twist'] = {'linear': world.linear_velocity[k].tolist(),
                            'angular': world.angular_velocity[k].tolist()}
    world.step(1)
    return bool(world.contacts()['gap'].min(initial=0.0) > APART)


class _Draw:
    """A scene while it is drawn."""

    def __init__(self, rng: Generator, way: Way) -> None:
        self.rng, self.way = rng, way
        self.bodies: list[Spec] = []
        self.joints: list[Spec] = []
        self.able: list[Spec] = []  # joints that may mimic others: they close no loop
        # The bodies of each part, the anchor among them if it hangs on that.
        self.parts: list[list[str]] = []
        self.poses = {'world': (np.zeros(3), Rotation.identity())}

    def spec(self) -> Spec:
        """Return the scene."""
        rng = self.rng
        if self.way.anchor == 'carrier':
            self._add_carrier()
        while not self.joints:
            for part in range(rng.integers(1, 4)):
                place = np.array([*rng.uniform(-0.5, 0.5, 2), 1.0 + 0.9 * part])
                self._add_ring(place) if rng.random() < 0.25 else self._add_tree(place)
        for _ in range(rng.integers(0, 3)):
            self._close_a_loop()
        for _ in range(rng.integers(0, 3)):
            self._couple()
        if self.way.floor:
            self.bodies.insert(0, plane())
        return {'format': 1,
                'world': {'gravity': [0.0, 0.0, -G if self.way.gravity else 0.0],
                          'step': float(rng.choice([0.001, 0.002, 0.004]))},
                'materials': {'default': {'friction': float(rng.choice([0, 0.3, 0.8])),
                                          'restitution': float(rng.choice([0, 0, 0.3, 0.7]))}},
                'bodies': self.bodies, 'joints': self.joints}

    def _add_carrier(self) -> None:
        """Add what moves by itself; gravity does not change as it turns, so it turns about z."""
        rng = self.rng
        place, turn = np.array([0.0, 0.0, 2.0]), Rotation.from_quat(any_attitude(rng))
        spin = rng.normal(0.0, 3.0, 3) * ((0, 0, 1) if self.way.gravity else 1)
        self.poses['carrier'] = place, turn
        self.bodies.append({
            'name': 'carrier', 'kinematic': True, 'collides': bool(rng.random() < 0.5),
            'shape': draw_solid(rng, 0.2, NAMES_OF_SHAPES).shape,
            'pose': {'position': place.tolist(), 'orientation': turn.as_quat().tolist()},
            'twist': {'linear': rng.normal(0.0, 1.0, 3).tolist(), 'angular': spin.tolist()}})

    def _add_body(self, place: np.ndarray) -> str:
        rng, name = self.rng, f'body{len(self.bodies)}'
        # Without a floor they fly to where the middle one is.
        v = rng.normal(size=3) if self.way.floor else -4.0 * (place - [0.0, 0.0, 1.9])
        q = any_attitude(rng)
        solid = draw_solid(rng, rng.uniform(*SIZES), NAMES_OF_SHAPES)
        self.bodies.append(body(name, solid, between(rng, 0.1, 10.0), place, q, v,
                                2.0 * rng.normal(size=3)))
        self.poses[name] = place, Rotation.from_quat(q)
        return name

    def _begin_part(self, place: np.ndarray, kind: str,
                    axis: np.ndarray | None = None) -> list[str]:
        """Add a body, which hangs on the anchor in half of the cases."""
        part = [self._add_body(place)]
        if self.way.anchor is not None and self.rng.random() < 0.5:
            self._join(self.way.anchor, part[0], kind, place + self.rng.uniform(-0.2, 0.2, 3),
                       axis)
            part.append(self.way.anchor)
        self.parts.append(part)
        return part

    def _add_tree(self, place: np.ndarray) -> None:
        """Add a body, and some that hang on it."""
        rng = self.rng
        part = self._begin_part(place, str(rng.choice(TREE_TYPES)))
        for _ in range(rng.integers(0, 5)):
            parent = part[rng.integers(len(part))]
            at = self.poses[parent][0] if parent in self.poses and parent != 'world' else place
            child = self._add_body(at + rng.uniform(-0.4, 0.4, 3))
            self._join(parent, child, str(rng.choice(TREE_TYPES)),
                       at + rng.uniform(-0.2, 0.2, 3))
            part.append(child)

    def _add_ring(self, place: np.ndarray) -> None:
        """Add a linkage of three to five bodies with parallel axes: joints say things twice."""
        rng = self.rng
        n = direction(rng)
        across = np.linalg.svd(n[None])[2][1:]
        count = int(rng.integers(3, 6))
        part = self._begin_part(place, 'revolute', n)
        around = [place + 0.35 * (np.cos(a) * across[0] + np.sin(a) * across[1])
                  for a in 2.0 * np.pi * np.arange(1, count) / count]
        names = [part[0]]
        for at in around:
            child = self._add_body(at)
            hinge = 0.5 * (self.poses[names[-1]][0] + at) + rng.uniform(-0.05, 0.05, 3)
            self._join(names[-1], child, 'revolute', hinge, n)
            names.append(child)
        part += names[1:]
        end = part[1] if len(part) > count else names[0]
        kind = str(rng.choice(['revolute', 'continuous', 'universal', 'spherical', 'prismatic']))
        hinge = 0.5 * (place + around[-1]) + rng.uniform(-0.05, 0.05, 3)
        self._join(names[-1], end, kind, hinge, n if kind != 'prismatic' else across[0],
                   lawful=False)

    def _close_a_loop(self) -> None:
        """Add a joint between two bodies of one part, or of two, or a body and the anchor."""
        rng = self.rng
        names = [name for part in self.parts for name in part]
        if rng.random() < 0.7:
            names = self.parts[rng.integers(len(self.parts))]
        if len(set(names)) < 2:
            return
        first, second = rng.choice(sorted(set(names)), 2, replace=False).tolist()
        kind = str(rng.choice(LOOP_TYPES))
        middle = 0.5 * (self._place(first) + self._place(second))
        self._join(first, second, kind, middle + rng.uniform(-0.1, 0.1, 3), lawful=False)

    def _place(self, name: str) -> np.ndarray:
        return self.poses[name][0] if name != 'world' else np.array([0.0, 0.0, 2.0])

    def _couple(self) -> None:
        """Let a joint mimic one that was drawn before it."""
        rng = self.rng
        if len(self.able) < 2:
            return
        first, second = sorted(rng.choice(len(self.able), 2, replace=False).tolist())
        if 'mimic' not in self.able[second]:
            self.able[second]['mimic'] = {
                'joint': self.able[first]['name'],
                'multiplier': float(rng.choice([-1, 1]) * between(rng, 0.3, 3.0))}

    def _join(self, parent: str, child: str, kind: str, at: np.ndarray,
              axis: np.ndarray | None = None, lawful: bool = True) -> None:
        """Add a joint at a place, with an axis in the world or any, and what acts along it."""
        rng = self.rng
        p, R = self.poses[parent]
        joint: Spec = {'name': f'joint{len(self.joints)}', 'type': kind, 'parent': parent,
                       'child': child, 'pose': {'position': R.inv().apply(at - p).tolist()}}
        if kind not in ('fixed', 'spherical', 'distance'):
            joint['axis'] = R.inv().apply(direction(rng) if axis is None else axis).tolist()
        if kind == 'universal':
            joint['axis2'] = np.linalg.svd(np.array([joint['axis']]))[2][1].tolist()
        if kind == 'distance':
            # From that place to one in the child.
            joint['child_pose'] = {'position': rng.uniform(-0.1, 0.1, 3).tolist()}
        elif lawful and kind != 'fixed':
            joint |= self._laws(kind)
            if kind in ONE_AXIS:
                self.able.append(joint)
        self.joints.append(joint)

    def _laws(self, kind: str) -> Spec:
        """Draw what acts along the axes of a joint, from much too little to be seen to stiff."""
        rng = self.rng
        laws: Spec = {}
        # A planar joint has two translations and a rotation with one number: it cannot be scaled.
        if rng.random() < 0.3 and kind != 'planar':
            laws['damping'] = between(rng, 1e-3, 1e2)
        if kind not in ONE_AXIS:
            return laws
        if rng.random() < 0.3:
            laws['friction'] = between(rng, 1e-3, 1e1)
        if rng.random() < 0.2:
            laws['armature'] = between(rng, 1e-4, 1.0)
        if rng.random() < 0.25:
            laws['spring'] = {'stiffness': between(rng, 1.0, 1e4),
                              'rest': float(rng.uniform(-0.1, 0.1))}
        if kind != 'continuous' and rng.random() < 0.4:
            # Some begin at their limit.
            laws['limits'] = {'lower': -float(rng.choice([0.0, 0.1, 0.3])),
                              'upper': float(rng.choice([0.1, 0.5])),
                              'restitution': float(rng.choice([0.0, 0.0, 0.5, 1.0]))}
        if rng.random() < 0.25:
            laws |= self._drive(laws)
        return laws

    def _drive(self, laws: Spec) -> Spec:
        """Draw a drive that holds: it gives no energy but what it stores like a spring."""
        rng = self.rng
        limits = dict(laws.get('limits', {}))
        if rng.random() < 0.5:
            limits['effort'] = between(rng, 1e-2, 1e2)
        if rng.random() < 0.3:
            limits['velocity'] = between(rng, 0.1, 10.0)
        if rng.random() < 0.3:
            drive = {'mode': 'velocity', 'gain': between(rng, 1e-2, 1e2)}
        else:
            drive = {'mode': 'position', 'stiffness': between(rng, 1.0, 1e4),
                     'damping': float(rng.choice([0.0, between(rng, 1e-2, 1e2)])),
                     'position': float(rng.uniform(-0.3, 0.3))}
        return {'drive': drive} | ({'limits': limits} if limits else {})
