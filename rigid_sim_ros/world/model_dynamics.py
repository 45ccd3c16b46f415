# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mass matrix, Jacobians and inverse dynamics of the models in a world."""

import numpy as np

from rigid_sim_ros.engine.joints import model_dynamics
from rigid_sim_ros.engine.joints.model_dynamics import FREE, Link, Poses, Tree
from rigid_sim_ros.engine.maths.rotation_in_python import multiply, rotate, to_matrix
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.scene import schema
from rigid_sim_ros.world.drives import WithDrives
from rigid_sim_ros.world.values import some

# Motions of a joint, as how many coordinates.
_COUNT = {'fixed': 0, 'revolute': 1, 'continuous': 1, 'prismatic': 1, 'spherical': 3}


class WithModels(WithDrives):
    """
    The part of `World` that is about models as a whole.

    The coordinates of a model are, of a base that is free, the velocity of its body frame's origin
    and its angular velocity (6, world axes), and then those of the model's joints in the order of
    `joint_names`: 1 of a revolute, continuous or prismatic one, 3 of a spherical one (angular
    velocity in the axes of the parent's joint frame). A joint that mimics has its own. Joints
    that close loops have none.
    """

    frame_names: dict[str, int]

    def frame_pose(self, frame: str) -> tuple[Array, Array]:
        """
        Return position (3,) [m] and orientation (4,) x, y, z, w of a body or a named frame.

        In world axes. ValueError for a frame that does not exist.
        """
        i, pose = self._known_frame(frame)
        q = _quaternion(self._current_motion().orientation[self._row[i]])
        p = self._current_motion().position[self._row[i]] + rotate(q, pose.position)
        return p, np.array(multiply(q, pose.orientation))

    def mass_matrix(self, model: str) -> Array:
        """
        Return the mass matrix of a model, (nv, nv) [kg, kg m, kg m^2], with armatures.

        ValueError for a model that does not exist, or has universal or planar joints.
        """
        return model_dynamics.mass_matrix(self._tree(model))

    def jacobian(self, model: str, frame: str) -> Array:
        """
        Return the matrix that gives a frame's twist from the velocities of a model, (6, nv).

        Rows are the velocity of the frame's origin [m/s] and its angular velocity [rad/s], in
        world axes. ValueError for what does not exist, or a frame that is not of the model.
        """
        tree = self._tree(model)
        i, _ = self._known_frame(frame)
        k = next((k for k, link in enumerate(tree.links) if link.body == i), None)
        if k is None:
            raise ValueError(f'frame {frame!r} is not of the model {model!r}, must be '
                             f'on one of its bodies')
        return model_dynamics.jacobian(tree, k, self.frame_pose(frame)[0])

    def inverse_dynamics(self, model: str, acceleration: Array) -> Array:
        """
        Return the generalized forces that give a model these accelerations now, (nv,).

        They balance inertia, gravity and what velocities make; friction, dampers, springs, limits
        and contacts are not in them. `acceleration` (nv,) are the time derivatives of the
        velocities. ValueError for a model that does not exist, or another number of them.
        """
        tree = self._tree(model)
        given = np.asarray(acceleration, dtype=np.float64)
        if given.shape != tree.armature.shape or not np.isfinite(given).all():
            raise ValueError(f'acceleration has the shape {given.shape}, must be '
                             f'{tree.armature.shape} finite numbers')
        return model_dynamics.inverse_dynamics(tree, given, self._model.gravity)

    # --- how it is worked out -----------------------------------------------------------------

    def _known_frame(self, frame: str) -> tuple[int, schema.Pose]:
        frames = self.scene.spec.all_frames()
        if frame not in frames:
            raise ValueError(f'frame {frame!r} does not exist, must be one of: '
                             f'{some(list(frames))}')
        return frames[frame]

    def _tree(self, model: str) -> Tree:
        links = self._links(model)
        rows = self._row[[link.body for link in links]]
        motion, state = self._current_motion(), self._state
        poses = Poses(state.x[:, rows].T.copy(), state.q[:, rows].T.copy(), motion.position[rows],
                      motion.linear[rows], motion.angular[rows])
        return model_dynamics.make_tree(links, poses, self._model.m[rows],
                                        self._model.I_C[:, rows].T)

    def _links(self, model: str) -> list[Link]:
        """Return the bodies of a model, each behind its parent, with the axes of their joints."""
        spec = self.scene.spec
        mine = {body.name: i for i, body in enumerate(spec.bodies)
                if body.name.startswith(f'{model}/')}
        if not mine:
            models = list(dict.fromkeys(body.name.partition('/')[0] for body in spec.bodies
                                        if '/' in body.name))
            raise ValueError(f'model {model!r} does not exist, must be one of: '
                             f'{some(models) if models else "none"}')
        joints = [(j, joint) for j, joint in enumerate(spec.joints or ()) if joint.child in mine]
        for _, joint in joints:
            if joint.type not in (*_COUNT, 'distance', 'free'):
                raise ValueError(f'joint {joint.name!r} is {joint.type}, must be one of: '
                                 f'{", ".join(_COUNT)}')
        links: list[Link] = []
        place: dict[str, int] = {}
        held = {joint.child for _, joint in joints if joint.type in _COUNT}
        found = sum(not spec.bodies[i].fixed and name not in held for name, i in mine.items())
        first = FREE * found
        starts = _coordinates(joints, first)
        bases = 0
        waiting = [name for name in mine if name not in held]
        for name in waiting:
            i = mine[name]
            free = not spec.bodies[i].fixed
            place[name] = len(links)
            links.append(Link(i, -1, True, False, FREE * bases, FREE if free else 0,
                              np.zeros((0, 3)),
                              self._current_motion().position[self._row[i]], 0.0))
            bases += free
        self._grow(links, place, joints, starts, mine)
        return links

    def _grow(self, links: list[Link], place: dict[str, int],
              joints: list[tuple[int, schema.Joint]], starts: dict[int, int],
              mine: dict[str, int]) -> None:
        """Add the bodies that joints hold, each behind its parent."""
        left = [(j, joint) for j, joint in joints if joint.type in _COUNT]
        while left:
            later = []
            for j, joint in left:
                if joint.child in place:
                    continue    # a loop
                if joint.parent not in place and joint.parent in mine:
                    later.append((j, joint))
                    continue
                axes, point = self._axes(joint)
                place[joint.child] = len(links)
                links.append(Link(mine[joint.child], place.get(joint.parent, -1), False,
                                  joint.type == 'prismatic', starts[j], _COUNT[joint.type],
                                  axes, point, joint.armature))
            if len(later) == len(left):
                raise ValueError(f'joint {later[0][1].name!r} hangs on itself by a ring of joints')
            left = later

    def _axes(self, joint: schema.Joint) -> tuple[Array, Array]:
        """Return the axes (number, 3) of a joint and its origin (3,) [m], of the world."""
        p, q = np.zeros(3), (0.0, 0.0, 0.0, 1.0)
        if joint.parent != 'world':
            p, there = self.frame_pose(joint.parent)
            q = _quaternion(there)
        point = p + rotate(q, joint.pose.position)
        R = np.array(to_matrix(multiply(q, joint.pose.orientation)))
        if joint.type == 'spherical':
            return R.T.copy(), point
        axis = R @ np.array(joint.axis) / np.linalg.norm(joint.axis)
        return axis[None, :][:_COUNT[joint.type]], point


def _coordinates(joints: list[tuple[int, schema.Joint]], first: int) -> dict[int, int]:
    """Return the first coordinate of each joint that holds a body first."""
    starts, held = {}, set()
    for j, joint in joints:
        if joint.type in _COUNT and joint.child not in held:
            held.add(joint.child)
            starts[j] = first
            first += _COUNT[joint.type]
    return starts


def _quaternion(q: Array) -> tuple[float, float, float, float]:
    x, y, z, w = q.tolist()
    return x, y, z, w
