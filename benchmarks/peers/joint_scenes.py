# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Scenes with joints that benchmarks compare, as the scenes of this package.

Those whose motion is known by other means are in test/engine/jointed.py, which this module uses;
here are robots that stand, and many pendulums at once. Masses and lengths are rounded from the
robots whose names the functions give; inertias are those of solid boxes of such masses.
"""

import math
from typing import Any, NamedTuple

from engine.jointed import body, joint, rod, scene

FRICTION = 0.8
STIFFNESS, DAMPING = 100.0, 2.0     # N m/rad, N m s/rad
_GROUND = {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}

Vector = tuple[float, float, float]


class Link(NamedTuple):
    """A link and the joint that holds it, along an axis of the frames, which are all parallel."""

    name: str
    parent: str
    at: Vector      # of the joint, in the parent [m]
    axis: Vector
    mass: float
    com: Vector     # in the link, whose frame is at its joint [m]
    size: Vector    # of a box of the same inertia [m]
    angle: float = 0.0      # at the start, which is the goal too [rad]


def _box(m: float, size: Vector) -> tuple[float, ...]:
    x, y, z = (side * side * m / 12.0 for side in size)
    return (y + z, x + z, x + y, 0.0, 0.0, 0.0)


def _balls(radius: float, points: list[Vector]) -> dict[str, Any]:
    return {'shape': {'compound': [{'type': 'sphere', 'radius': radius, 'pose': {
        'position': list(point)}} for point in points]}}


def _standing(base: dict[str, Any], links: list[Link], feet: dict[str, dict[str, Any]], h: float,
              gains: tuple[float, float]) -> dict[str, Any]:
    """Return a robot over a ground, each of its joints driven to where it starts."""
    places = {base['name']: tuple(base['pose']['position'])}
    bodies, joints = [base], []
    for one in links:
        here = tuple(a + b for a, b in zip(places[one.parent], one.at, strict=True))
        places[one.name] = here
        bodies.append(body(one.name, one.mass, one.com, _box(one.mass, one.size), here,
                           **feet.get(one.name, {})))
        joints.append(joint(one.name, one.parent, one.name, position=one.at, axis=one.axis,
                            drive={'mode': 'position', 'stiffness': gains[0],
                                   'damping': gains[1]}) | {'position': one.angle})
    found = scene([*bodies, _GROUND], joints, h)
    found['world']['contact'] = 'timestep'
    found['materials'] = {'default': {'friction': FRICTION, 'restitution': 0.0}}
    return found


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def quadruped(h: float = 1e-3) -> dict[str, Any]:
    """
    Return a robot of 15 kg like a Unitree Go2 that falls 3 mm onto four balls of 22 mm.

    Four legs of three joints; thighs and shanks of 0.213 m.
    """
    links, length = [], 0.213
    for front in (1, -1):
        for left in (1, -1):
            leg = ('front_' if front > 0 else 'rear_') + ('left_' if left > 0 else 'right_')
            links += [
                Link(leg + 'hip', 'trunk', (0.193 * front, 0.0465 * left, 0.0), X, 0.68,
                     (-0.005 * front, 0.002 * left, 0.0), (0.09, 0.09, 0.07)),
                Link(leg + 'thigh', leg + 'hip', (0.0, 0.0955 * left, 0.0), Y, 1.15,
                     (-0.004, -0.022 * left, -0.027), (0.1, 0.08, 0.21), 0.9),
                Link(leg + 'shank', leg + 'thigh', (0.0, 0.0, -length), Y, 0.2,
                     (0.004, 0.0, -0.13), (0.03, 0.03, 0.24), -1.8)]
    foot = _balls(0.022, [(0.0, 0.0, -length)])
    # The feet are 2 * 0.213 cos 0.9 = 0.265 m below the hips, and 22 mm thick.
    trunk = body('trunk', 6.92, (0.02, 0.0, -0.005), _box(6.92, (0.38, 0.2, 0.08)),
                 (0.0, 0.0, 0.29))
    return _standing(trunk, links, {one.name: foot for one in links if 'shank' in one.name}, h,
                     (STIFFNESS, DAMPING))


# A humanoid stands if its ankles are stiffer than its weight is high, 35 kg * 9.81 m/s^2
# * 0.67 m = 230 N m/rad, for both together and with knees and hips that yield in series.
HUMANOID_STIFFNESS = 400.0


def _leg(side: str, left: int) -> list[Link]:
    return [
        Link(f'{side}_hip_pitch', 'pelvis', (0.0, 0.065 * left, -0.1), Y, 1.35,
             (0.0, 0.03 * left, -0.01), (0.1, 0.08, 0.1), -0.27),
        Link(f'{side}_hip_roll', f'{side}_hip_pitch', (0.0, 0.052 * left, -0.03), X, 1.52,
             (0.03, 0.0, -0.1), (0.1, 0.1, 0.12)),
        Link(f'{side}_hip_yaw', f'{side}_hip_roll', (0.025, 0.0, -0.124), Z, 1.7,
             (-0.057, -0.01 * left, -0.15), (0.1, 0.1, 0.2)),
        Link(f'{side}_knee', f'{side}_hip_yaw', (-0.078, 0.002 * left, -0.177), Y, 1.93,
             (0.005, 0.004 * left, -0.12), (0.08, 0.08, 0.25), 0.4),
        Link(f'{side}_ankle_pitch', f'{side}_knee', (0.0, 0.0, -0.3), Y, 0.074,
             (-0.007, 0.0, 0.011), (0.03, 0.03, 0.03), -0.13),
        Link(f'{side}_ankle_roll', f'{side}_ankle_pitch', (0.0, 0.0, -0.018), X, 0.61,
             (0.027, 0.0, -0.017), (0.17, 0.06, 0.04))]


def _arm(side: str, left: int) -> list[Link]:
    links = [
        Link('shoulder_pitch', 'torso', (0.004, 0.1 * left, 0.248), Y, 0.72,
             (0.0, 0.036 * left, -0.012), (0.07, 0.08, 0.07)),
        Link('shoulder_roll', '', (0.0, 0.038 * left, -0.014), X, 0.64,
             (0.0, 0.006 * left, -0.063), (0.06, 0.06, 0.1), 0.2 * left),
        Link('shoulder_yaw', '', (0.0, 0.006 * left, -0.103), Z, 0.73, (0.01, 0.0, -0.07),
             (0.06, 0.06, 0.1)),
        Link('elbow', '', (0.016, 0.0, -0.08), Y, 0.6, (0.065, 0.004 * left, -0.01),
             (0.1, 0.05, 0.05), 0.6),
        Link('wrist_roll', '', (0.1, 0.002 * left, -0.01), X, 0.085, (0.017, 0.0, 0.0),
             (0.04, 0.04, 0.04)),
        Link('wrist_pitch', '', (0.038, 0.0, 0.0), Y, 0.48, (0.023, 0.0, 0.0), (0.06, 0.05, 0.05)),
        Link('wrist_yaw', '', (0.046, 0.0, 0.0), Z, 0.25, (0.07, 0.0, 0.0), (0.12, 0.05, 0.03))]
    names = [f'{side}_{one.name}' for one in links]
    return [one._replace(name=name, parent=one.parent or before)
            for one, name, before in zip(links, names, ['', *names[:-1]], strict=True)]


def humanoid(h: float = 1e-3) -> dict[str, Any]:
    """
    Return a robot of 35 kg and 29 joints like a Unitree G1 that stands on eight balls of 5 mm.

    Its joints have no armature and no damping but that of their drives, 2 N m s/rad: the ankle's
    parts of 74 g have 1e-5 kg m^2.
    """
    links = [Link('waist_yaw', 'pelvis', (-0.004, 0.0, 0.0), Z, 0.24, (0.0, 0.0, 0.02),
                  (0.08, 0.08, 0.04)),
             Link('waist_roll', 'waist_yaw', (0.0, 0.0, 0.035), X, 0.05, (0.0, 0.0, 0.01),
                  (0.03, 0.03, 0.03)),
             Link('torso', 'waist_roll', (0.0, 0.0, 0.019), Y, 9.6, (0.0, 0.0, 0.15),
                  (0.18, 0.2, 0.35))]
    for side, left in (('left', 1), ('right', -1)):
        links += _leg(side, left) + _arm(side, left)
    soles = _balls(0.005, [(x, y, -0.03) for x, y in (
        (-0.05, 0.025), (-0.05, -0.025), (0.12, 0.03), (0.12, -0.03))])
    pelvis = body('pelvis', 3.8, (0.0, 0.0, -0.07), _box(3.8, (0.12, 0.15, 0.12)),
                  (0.0, 0.0, _height(links)))
    return _standing(pelvis, links, {'left_ankle_roll': soles, 'right_ankle_roll': soles}, h,
                     (HUMANOID_STIFFNESS, DAMPING))


def _height(links: list[Link]) -> float:
    """Return how high the pelvis is when the soles of the left leg touch the ground [m]."""
    x, z, pitch = 0.0, 0.0, 0.0
    for one in links:
        if one.name.startswith('left_') and one.name.split('_', 1)[1] in (
                'hip_pitch', 'hip_roll', 'hip_yaw', 'knee', 'ankle_pitch', 'ankle_roll'):
            c, s = math.cos(pitch), math.sin(pitch)
            x, z = x + c * one.at[0] + s * one.at[2], z - s * one.at[0] + c * one.at[2]
            pitch += one.angle if one.axis == Y else 0.0
    return 0.035 - z


def pendulums(count: int = 100, h: float = 1e-3) -> dict[str, Any]:
    """Return double pendulums side by side, their upper rods at 1.5 rad."""
    bodies, joints = [], []
    for k in range(count):
        for i in range(2):
            place = (0.0, 3.0 * k, -float(i))
            bodies.append(body(f'rod{k}_{i}', 1.0, (0, 0, -0.5), rod(1.0, 1.0, 0.02), place))
            joints.append(joint(f'pin{k}_{i}', f'rod{k}_0' if i else 'world', f'rod{k}_{i}',
                                position=(0, 0, -1) if i else place)
                          | ({} if i else {'position': 1.5}))
    return scene(bodies, joints, h)
