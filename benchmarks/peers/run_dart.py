# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Run a scene in DART with its default detector and solver; the ground is a large box."""

from typing import Any

import dartpy as dart
import numpy as np
from runner import each_step, main, Running

GROUND = 200.0  # [m] side of the ground, 10 m thick


def _rotation(q: list[float]) -> np.ndarray:
    x, y, z, w = q
    return np.eye(3) + 2.0 * np.array([[-y * y - z * z, x * y - w * z, x * z + w * y],
                                       [x * y + w * z, -x * x - z * z, y * z - w * x],
                                       [x * z - w * y, y * z + w * x, -x * x - y * y]])


def _pose(R: np.ndarray, p: Any) -> Any:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = R, p
    return dart.math.Isometry3(matrix)


def _surface(node: Any, shape: Any, scene: dict[str, Any]) -> None:
    shape_node = node.createShapeNode(shape)
    shape_node.createCollisionAspect()
    dynamics = shape_node.createDynamicsAspect()
    dynamics.setFrictionCoeff(scene['friction'])
    dynamics.setRestitutionCoeff(scene['restitution'])


def build(scene: dict[str, Any]) -> Running:
    """Return the scene; DART takes velocities of a free joint in body axes, angular first."""
    world = dart.simulation.World('scene')
    world.setTimeStep(scene['step'])
    world.setGravity(scene['gravity'])
    if scene['ground']:
        skeleton = dart.dynamics.Skeleton('ground')
        joint, node = skeleton.createWeldJointAndBodyNodePair()
        _surface(node, dart.dynamics.BoxShape([GROUND, GROUND, 10.0]), scene)
        joint.setTransformFromParentBodyNode(_pose(np.eye(3), (0.0, 0.0, -5.0)))
        world.addSkeleton(skeleton)
    nodes = []
    for i, body in enumerate(scene['bodies']):
        skeleton = dart.dynamics.Skeleton(f'b{i}')
        joint, node = skeleton.createFreeJointAndBodyNodePair()
        node.setInertia(dart.dynamics.Inertia(body['mass'], [0, 0, 0], np.diag(body['moments'])))
        if scene['ground']:
            shape = (dart.dynamics.SphereShape(body['size'][0]) if body['shape'] == 'sphere'
                     else dart.dynamics.BoxShape(body['size']))
            _surface(node, shape, scene)
        R = _rotation(body['orientation'])
        joint.setPositions(dart.dynamics.FreeJoint.convertToPositions(_pose(R, body['position'])))
        skeleton.setVelocities(np.concatenate((R.T @ body['angular'], R.T @ body['linear'])))
        world.addSkeleton(skeleton)
        nodes.append(node)

    def motion() -> np.ndarray:
        rows = []
        for node in nodes:
            pose = node.getTransform()
            w, x, y, z = pose.quaternion().wxyz()
            rows.append([*pose.translation(), x, y, z, w, *node.getLinearVelocity(),
                         *node.getAngularVelocity()])
        return np.array(rows)

    return Running(each_step(world.step), motion)


if __name__ == '__main__':
    main(build)
