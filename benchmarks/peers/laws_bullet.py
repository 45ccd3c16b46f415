# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scenes of the laws in Bullet: bodies in maximal coordinates, other settings as they come."""

import math
from typing import Any

import numpy as np
import pybullet
from pybullet_utils.bullet_client import BulletClient


def _shape(client: Any, shape: dict[str, Any], shift: np.ndarray) -> int:
    """Return a collision shape; Bullet counts from the centre of mass, which `shift` [m] is."""
    parts = shape['compound'] if shape['type'] == 'compound' else [shape]
    if len(parts) == 1 and not shift.any():
        return int(client.createCollisionShape(**_one(parts[0])))
    kinds = [_one(part) for part in parts]
    keys = {key: [kind.get(key, default) for kind in kinds]
            for key, default in (('radius', 0.5), ('halfExtents', [1, 1, 1]), ('height', 1.0))}
    places = [part.get('pose', {}) for part in parts]
    return int(client.createCollisionShapeArray(
        shapeTypes=[kind['shapeType'] for kind in kinds], radii=keys['radius'],
        halfExtents=keys['halfExtents'], lengths=keys['height'],
        collisionFramePositions=[np.subtract(place.get('position', (0, 0, 0)), shift).tolist()
                                 for place in places],
        collisionFrameOrientations=[place.get('orientation', (0, 0, 0, 1)) for place in places]))


def _one(shape: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of a simple shape."""
    kind = shape['type']
    if kind == 'sphere':
        return {'shapeType': pybullet.GEOM_SPHERE, 'radius': shape['radius']}
    if kind == 'box':
        return {'shapeType': pybullet.GEOM_BOX, 'halfExtents': [0.5 * a for a in shape['size']]}
    if kind == 'mesh':
        return {'shapeType': pybullet.GEOM_MESH, 'vertices': shape['vertices']}
    if kind == 'plane':
        return {'shapeType': pybullet.GEOM_PLANE, 'planeNormal': [0, 0, 1]}
    what = pybullet.GEOM_CYLINDER if kind == 'cylinder' else pybullet.GEOM_CAPSULE
    return {'shapeType': what, 'radius': shape['radius'], 'height': shape['length']}


class Run:
    """A scene of the laws in Bullet."""

    def __init__(self, spec: dict[str, Any]) -> None:
        """
        Build the world.

        Bullet multiplies the coefficients of a pair, so each body gets their root. It takes
        principal moments only: NotImplementedError for a body whose axes are not these.
        """
        self._bullet = bullet = BulletClient(pybullet.DIRECT)
        world, surface = spec['world'], spec['materials']['default']
        bullet.setTimeStep(world['step'])
        bullet.setGravity(*world['gravity'])
        if surface['restitution'] > 0.0:
            bullet.setPhysicsEngineParameter(restitutionVelocityThreshold=0.05)
        self._surface = {'lateralFriction': math.sqrt(surface['friction']), 'rollingFriction': 0.0,
                         'spinningFriction': 0.0, 'restitution': math.sqrt(surface['restitution'])}
        self._spec, self._coms = spec['bodies'], []
        self._bodies = [self._add(body) for body in spec['bodies']]
        self._names = [body['name'] for body in spec['bodies']]

    def _add(self, body: dict[str, Any]) -> int:
        bullet = self._bullet
        pose, own = body.get('pose', {}), body.get('inertial', {})
        com = np.array(own.get('com', (0.0, 0.0, 0.0)))
        q = pose.get('orientation', (0, 0, 0, 1))
        arm = np.array(bullet.rotateVector(q, com.tolist())) if com.any() else com
        i = bullet.createMultiBody(
            own.get('mass', 0.0), _shape(bullet, body['shape'], com),
            basePosition=(np.array(pose.get('position', (0, 0, 0))) + arm).tolist(),
            baseOrientation=q, useMaximalCoordinates=True)
        bullet.changeDynamics(i, -1, linearDamping=0.0, angularDamping=0.0, **self._surface)
        self._coms.append(com)
        if own:
            moments, products = own['inertia'][:3], own['inertia'][3:]
            if np.abs(products).max() > 1e-9 * max(moments):
                raise NotImplementedError('axes that are not principal')
            bullet.changeDynamics(i, -1, mass=own['mass'], localInertiaDiagonal=moments)
            v, w = np.array(body['twist']['linear']), np.array(body['twist']['angular'])
            bullet.resetBaseVelocity(i, (v + np.cross(w, arm)).tolist(), w.tolist())
        return int(i)

    def step(self, count: int) -> None:
        """Advance."""
        for _ in range(count):
            self._bullet.stepSimulation()

    def motion(self) -> np.ndarray:
        """Return poses and twists of the body frames."""
        bullet, found = self._bullet, np.zeros((len(self._bodies), 13))
        for row, i, com in zip(found, self._bodies, self._coms, strict=True):
            x, q = bullet.getBasePositionAndOrientation(i)
            v, w = bullet.getBaseVelocity(i)
            arm = np.array(bullet.rotateVector(q, com.tolist())) if com.any() else com
            row[:] = [*(x - arm), *q, *(v - np.cross(w, arm)), *w]
        return found

    def deepest(self) -> float:
        """Return the deepest overlap [m]."""
        return max((0.0, *(-point[8] for point in self._bullet.getContactPoints() or ())))

    def force_on(self, name: str) -> np.ndarray:
        """Return the normal forces of the contacts on a body [N]; friction is left out."""
        total = np.zeros(3)
        one = self._bodies[self._names.index(name)]
        # A contact's normal points from B to A, which bodyA is.
        for point in self._bullet.getContactPoints(bodyA=one) or ():
            total += point[9] * np.array(point[7])
        return total
