# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Run a scene in Bullet (bodies in maximal coordinates), the other settings as they come."""

import math
from typing import Any

import numpy as np
import pybullet as bullet
from runner import each_step, main, Running


def _collision_shape(body: dict[str, Any], known: dict[tuple[Any, ...], int]) -> int:
    key = (body['shape'], *body['size'])
    if key not in known:
        known[key] = (
            bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=body['size'][0])
            if body['shape'] == 'sphere' else bullet.createCollisionShape(
                bullet.GEOM_BOX, halfExtents=[0.5 * side for side in body['size']]))
    return known[key]


def build(scene: dict[str, Any]) -> Running:
    """Return the scene; Bullet multiplies the coefficients of a pair, so each gets its root."""
    bullet.connect(bullet.DIRECT)
    bullet.setTimeStep(scene['step'])
    bullet.setGravity(*scene['gravity'])
    surface = {'lateralFriction': math.sqrt(scene['friction']), 'rollingFriction': 0.0,
               'spinningFriction': 0.0, 'restitution': math.sqrt(scene['restitution'])}
    ground = -1
    if scene['ground']:
        ground = bullet.createMultiBody(0.0, bullet.createCollisionShape(bullet.GEOM_PLANE),
                                        useMaximalCoordinates=True)
        bullet.changeDynamics(ground, -1, **surface)
    if scene['restitution'] > 0.0:
        bullet.setPhysicsEngineParameter(restitutionVelocityThreshold=0.05)
    bodies: list[int] = []
    shapes: dict[tuple[Any, ...], int] = {}
    for body in scene['bodies']:
        i = bullet.createMultiBody(body['mass'], _collision_shape(body, shapes),
                                   basePosition=body['position'],
                                   baseOrientation=body['orientation'],
                                   useMaximalCoordinates=True)
        bullet.changeDynamics(i, -1, linearDamping=0.0, angularDamping=0.0, **surface)
        if scene['name'] == 'torque-free':
            # The others are solid, which is what Bullet assumes.
            bullet.changeDynamics(i, -1, mass=body['mass'], localInertiaDiagonal=body['moments'])
        bullet.resetBaseVelocity(i, body['linear'], body['angular'])
        bodies.append(i)

    def motion() -> np.ndarray:
        return np.array([np.concatenate((*bullet.getBasePositionAndOrientation(i),
                                         *bullet.getBaseVelocity(i))) for i in bodies])

    def ground_force() -> float | None:
        if ground < 0:
            return None
        return float(sum(point[9] for point in bullet.getContactPoints(bodyA=ground) or ()))

    return Running(each_step(bullet.stepSimulation), motion, ground_force)


if __name__ == '__main__':
    main(build)
