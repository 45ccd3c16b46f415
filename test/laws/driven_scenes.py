# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Drives that start from rest before a wall, or before loose bodies.

A fist hangs on a slide, on an arm, on a slide that carries an arm or on two slides, and these on
the world or on a body that nothing holds. Gains reach from those that push to those that
have reached their goal within a step: then a body is where nobody saw it go.
"""

from laws.scenes import between, body, direction, fixed, G, penalty_stiffness, Scene, Spec
from laws.solids import box, draw_solid, Generator, Solid
import numpy as np
from scipy.spatial.transform import Rotation

SIZE = 0.2  # [m] of what moves
STEPS = (1e-4, 1e-3, 4e-3, 1 / 60)  # [s]
GAINS = 1.0, 1e5  # N/m, N s/m, or the same about an axis
TIME = 0.3  # [s] at most
MOST_STEPS = 120
HALF_WIDTH = 4.0  # [m] of a wall
THICKNESS = 0.005, 0.1  # [m] of a wall
REACH = 0.8  # [m] from an axis to the fist
KINDS = ('slide', 'arm', 'carried arm', 'two slides')
SHAPES = ('sphere', 'box', 'capsule', 'cylinder')


def draw_driven(rng: Generator) -> Scene:
    """Draw a mechanism before loose bodies, a wall, or both."""
    return _Draw(rng, str(rng.choice(['world', 'world', 'base']))).scene()


def draw_driven_floating(rng: Generator) -> Scene:
    """Draw a mechanism that nothing holds before loose bodies."""
    return _Draw(rng, 'base', walls=False).scene()


def draw_driven_at_a_wall(rng: Generator) -> Scene:
    """Draw a fist that the world holds before a wall from which nothing comes back."""
    return _Draw(rng, 'world', loose=False, restitution=0.0, kinds=('slide', 'arm')).scene()


class _Draw:
    """A scene while it is drawn: along x first, turned into any direction at the end."""

    def __init__(self, rng: Generator, base: str, walls: bool = True, loose: bool = True,
                 restitution: float | None = None, kinds: tuple[str, ...] = KINDS) -> None:
        self.rng, self.base, self.kinds = rng, base, kinds
        self.bodies: list[Spec] = []
        self.joints: list[Spec] = []
        if restitution is None:
            restitution = float(rng.choice([0.0, 0.0, 0.5, 1.0]))
        self.surface = {'friction': float(rng.choice([0.0, 0.5])), 'restitution': restitution}
        kind = rng.choice(['wall', 'loose', 'both', 'behind'])
        self.with_wall = walls and (kind != 'loose' or not loose)
        self.with_loose = loose and (kind in ('loose', 'both') or not walls)
        self.behind = loose and walls and kind == 'behind'

    def scene(self) -> Scene:
        """Return the scene."""
        rng = self.rng
        tip = self._add_mechanism()
        front, ahead = max(self._reach_of(self.fist), 0.5 * SIZE), []
        if self.with_loose:
            for k in range(rng.integers(1, 3)):
                front = self._add_loose(f'loose{k}', front + self._gap(), ahead)
        facts = {'fist': tip, 'ahead': ahead, 'wall': None}
        if self.with_wall:
            front += self._gap()
            thick = between(rng, *THICKNESS)
            self.bodies.append(fixed('wall', box((thick, 2 * HALF_WIDTH, 2 * HALF_WIDTH)),
                                     (front + 0.5 * thick, 0.0, 0.0)))
            facts['wall'] = 'wall'
            front += thick
            if self.behind:
                self._add_loose('behind', front + self._gap(), [])
        h = float(rng.choice(STEPS))
        gravity = [0.0, 0.0, -G if self._falls() else 0.0]
        spec = {'format': 1, 'world': {'step': h, 'gravity': gravity},
                'materials': {'default': self.surface | penalty_stiffness(self.bodies, h)},
                'bodies': self.bodies, 'joints': self.joints}
        facts['way'] = self._turn(spec)
        return Scene(spec, SIZE, int(np.clip(np.ceil(TIME / h), 20, MOST_STEPS)), facts)

    def _falls(self) -> bool:
        return self.base == 'world' and self.kinds == KINDS and bool(self.rng.random() < 0.3)

    def _gap(self) -> float:
        """Draw how far two of these are apart [m]."""
        return SIZE * between(self.rng, 1e-2, 3.0)

    def _reach_of(self, solid: Solid) -> float:
        return solid.reach(np.array([1.0, 0.0, 0.0]))

    def _add_mechanism(self) -> str:
        """Add what is driven, whose fist is at the origin; return the name of that."""
        rng = self.rng
        kind = str(rng.choice(self.kinds))
        parent, mass = 'world', between(rng, 0.1, 10.0)
        self.fist = draw_solid(rng, SIZE, SHAPES)
        back = np.array([-SIZE * 2.5, 0.0, 0.0])
        if self.base == 'base':
            self.bodies.append(body('base', box((SIZE, SIZE, SIZE)),
                                    mass * between(rng, 0.3, 100.0),
                                    back - [SIZE * 2.5, 0.0, 0.0]))
            parent = 'base'
        pivot = np.array([0.0, -REACH, 0.0])
        if kind in ('carried arm', 'two slides'):
            at = back if kind == 'two slides' else pivot
            self.bodies.append(body('carriage', box((SIZE, SIZE, SIZE)),
                                    mass * between(rng, 0.3, 3.0), at))
            self._drive(parent, 'carriage', 'prismatic', at)
            parent = 'carriage'
        self.bodies.append(body('fist', self.fist, mass, (0.0, 0.0, 0.0)))
        turns = kind in ('arm', 'carried arm')
        self._drive(parent, 'fist', 'revolute' if turns else 'prismatic',
                    pivot if turns else np.zeros(3))
        return 'fist'

    def _add_loose(self, name: str, at: float, ahead: list[str]) -> float:
        """Add a loose body whose rear is at this place; return where its front is."""
        rng = self.rng
        solid = draw_solid(rng, SIZE, SHAPES)
        rear = solid.reach(np.array([-1.0, 0.0, 0.0]))
        self.bodies.append(body(name, solid, between(rng, 0.01, 100.0), (at + rear, 0.0, 0.0)))
        ahead.append(name)
        return at + rear + self._reach_of(solid)

    def _drive(self, parent: str, child: str, kind: str, at: np.ndarray) -> None:
        """Hang a body on another by a joint that drives it along x, from rest."""
        rng = self.rng
        origin = next((np.array(one['pose']['position']) for one in self.bodies
                       if one['name'] == parent), np.zeros(3))
        # A turn about -z moves the fist, on +y of the pivot, along x.
        axis, far = ([1.0, 0.0, 0.0], 3.0) if kind == 'prismatic' else ([0.0, 0.0, -1.0], 1.5)
        gain, goal = between(rng, *GAINS), float(rng.uniform(0.3, 1.0)) * far
        if rng.random() < 0.5:
            drive = {'mode': 'velocity', 'gain': gain,
                     'velocity': between(rng, 0.3, 300.0) * goal}
        else:
            drive = {'mode': 'position', 'stiffness': gain, 'position': goal,
                     'damping': float(rng.choice([0.0, between(rng, 1e-3, 1.0)])) * gain}
        limits = {}
        if rng.random() < 0.4:
            limits['effort'] = between(rng, 1.0, 1e4)
        self.joints.append({'name': f'joint{len(self.joints)}', 'type': kind, 'parent': parent,
                            'child': child, 'pose': {'position': (at - origin).tolist()},
                            'axis': axis, 'drive': drive,
                            **({'limits': limits} if limits else {})})

    def _turn(self, spec: Spec) -> np.ndarray:
        """Turn all of it, in half of the scenes; return where x points then."""
        rng = self.rng
        if rng.random() < 0.5:
            return np.array([1.0, 0.0, 0.0])
        way = direction(rng)
        R = Rotation.align_vectors(way[None], [[1.0, 0.0, 0.0]])[0]
        for one in spec['bodies']:
            pose = one['pose']
            pose['position'] = R.apply(pose['position']).tolist()
            pose['orientation'] = R.as_quat().tolist()
        for joint in spec['joints']:
            if joint['parent'] == 'world':
                joint['pose']['position'] = R.apply(joint['pose']['position']).tolist()
                joint['axis'] = R.apply(joint['axis']).tolist()
        return R.apply([1.0, 0.0, 0.0])
