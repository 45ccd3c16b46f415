# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Mass matrix, Jacobians and inverse dynamics of the models in a world.

Worked out from where the bodies are and how they move, in world axes: each coordinate of a model
moves the bodies behind its joint, and what it does to them are the columns of their Jacobians.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.maths.rotation_in_python import multiply, rotate, to_matrix
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.scene import schema
from rigid_sim_ros.world.drives import WithDrives
from rigid_sim_ros.world.values import some

# Motions of a joint, as how many coordinates.
_COUNT = {'fixed': 0, 'revolute': 1, 'continuous': 1, 'prismatic': 1, 'spherical': 3}
_BASE = 6   # of a base that is free


class _Link(NamedTuple):
    """A body of a model, behind its parent in the list."""

    body: int
    parent: int     # in the list, -1: the world
    joint: int      # in the scene, -1: a base
    first: int      # its first coordinate
    number: int     # of its coordinates
    axes: Array     # (number, 3) world axes of its joint
    point: Array    # (3,) origin of its joint [m], of a base that of its body


class _Tree(NamedTuple):
    """A model, and its Jacobians."""

    links: list[_Link]
    v: Array    # (l, 3, nv) of the velocity of each link's centre of mass [m/s]
    w: Array    # (l, 3, nv) of its angular velocity [rad/s]
    com: Array  # (l, 3) [m]
    m: Array    # (l,) [kg]
    I: Array    # noqa: E741, (l, 3, 3) about the centre of mass, world axes [kg m^2]
    armature: Array     # (nv,)


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
        tree = self._tree(model)
        M = (np.einsum('l,lik,lij->kj', tree.m, tree.v, tree.v)
             + np.einsum('lak,lab,lbj->kj', tree.w, tree.I, tree.w))
        return np.asarray(0.5 * (M + M.T) + np.diag(tree.armature))

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
            raise ValueError(f'frame {frame!r} is not of the model {model!r}, must be')
        arm = self.frame_pose(frame)[0] - tree.com[k]
        return np.vstack([tree.v[k] - np.cross(arm, tree.w[k], axisb=0, axisc=0), tree.w[k]])

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
        a, alpha = self._accelerations(tree, given)
        w = self._current_motion().angular[self._rows_of(tree)]
        f = tree.m[:, None] * (a - self._model.gravity)
        n = np.einsum('lab,lb->la', tree.I, alpha)
        n += np.cross(w, np.einsum('lab,lb->la', tree.I, w))
        forces = np.einsum('lak,la->k', tree.v, f) + np.einsum('lak,la->k', tree.w, n)
        return np.asarray(forces + tree.armature * given)

    # --- how it is worked out -----------------------------------------------------------------

    def _known_frame(self, frame: str) -> tuple[int, schema.Pose]:
        frames = self.scene.spec.all_frames()
        if frame not in frames:
            raise ValueError(f'frame {frame!r} does not exist, must be one of: '
                             f'{some(list(frames))}')
        return frames[frame]

    def _rows_of(self, tree: _Tree) -> IntArray:
        rows: IntArray = self._row[[link.body for link in tree.links]]
        return rows

    def _tree(self, model: str) -> _Tree:
        links = self._links(model)
        rows = self._row[[link.body for link in links]]
        motion, constants = self._current_motion(), self._model
        l, nv = len(links), sum(link.number for link in links)  # noqa: E741
        com = self._state.x[:, rows].T.copy()
        R_WC = np.array([to_matrix(_quaternion(q)) for q in self._state.q[:, rows].T])
        tree = _Tree(links, np.zeros((l, 3, nv)), np.zeros((l, 3, nv)), com, constants.m[rows],
                     np.einsum('lab,bl,lcb->lac', R_WC, constants.I_C[:, rows], R_WC),
                     np.zeros(nv))
        joints = self.scene.spec.joints or ()
        for k, link in enumerate(links):
            if link.parent >= 0:
                arm = com[k] - com[link.parent]
                tree.w[k] = tree.w[link.parent]
                tree.v[k] = tree.v[link.parent] + np.cross(tree.w[link.parent], arm, axisa=0,
                                                           axisc=0)
            mine = slice(link.first, link.first + link.number)
            if link.joint < 0:
                if link.number:
                    arm = com[k] - motion.position[rows[k]]
                    tree.v[k][:, mine] = np.hstack([np.eye(3), np.cross(np.eye(3), arm).T])
                    tree.w[k][:, mine] = np.hstack([np.zeros((3, 3)), np.eye(3)])
            elif joints[link.joint].type == 'prismatic':
                tree.v[k][:, mine] += link.axes.T
            elif link.number:
                tree.w[k][:, mine] += link.axes.T
                tree.v[k][:, mine] += np.cross(link.axes, com[k] - link.point).T
                tree.armature[mine] = joints[link.joint].armature
            if link.joint >= 0 and link.number == 1:
                tree.armature[mine] = joints[link.joint].armature
        return tree

    def _links(self, model: str) -> list[_Link]:
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
        links: list[_Link] = []
        place: dict[str, int] = {}
        held = {joint.child for _, joint in joints if joint.type in _COUNT}
        found = sum(not spec.bodies[i].fixed and name not in held for name, i in mine.items())
        first = _BASE * found
        starts = _coordinates(joints, first)
        bases = 0
        waiting = [name for name in mine if name not in held]
        for name in waiting:
            i = mine[name]
            free = not spec.bodies[i].fixed
            place[name] = len(links)
            links.append(_Link(i, -1, -1, _BASE * bases, _BASE if free else 0, np.zeros((0, 3)),
                               self._current_motion().position[self._row[i]]))
            bases += free
        self._grow(links, place, joints, starts, mine)
        return links

    def _grow(self, links: list[_Link], place: dict[str, int],
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
                links.append(_Link(mine[joint.child], place.get(joint.parent, -1), j, starts[j],
                                   _COUNT[joint.type], axes, point))
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

    def _accelerations(self, tree: _Tree, given: Array) -> tuple[Array, Array]:
        """Return accelerations (l, 3) of the centres of mass, and angular ones."""
        rows, motion = self._rows_of(tree), self._current_motion()
        p, w, v = motion.position[rows], motion.angular[rows], motion.linear[rows]
        a, alpha = np.zeros_like(p), np.zeros_like(p)   # of the origins of the body frames
        joints = self.scene.spec.joints or ()
        for k, link in enumerate(tree.links):
            mine = given[link.first:link.first + link.number]
            if link.joint < 0:
                if link.number:
                    a[k], alpha[k] = mine[:3], mine[3:]
                continue
            i = link.parent
            w_p, alpha_p, a_p, p_p, v_p = (
                (np.zeros(3),) * 5 if i < 0 else (w[i], alpha[i], a[i], p[i], v[i]))
            if joints[link.joint].type == 'prismatic':
                arm = p[k] - p_p
                # The rate along the axis, which turns with the parent.
                along = v[k] - v_p - np.cross(w_p, arm)
                alpha[k] = alpha_p
                a[k] = (a_p + np.cross(alpha_p, arm) + np.cross(w_p, np.cross(w_p, arm))
                        + mine @ link.axes + 2.0 * np.cross(w_p, along))
                continue
            to_joint, from_joint = link.point - p_p, p[k] - link.point
            alpha[k] = alpha_p + mine @ link.axes + np.cross(w_p, w[k] - w_p)
            a[k] = (a_p + np.cross(alpha_p, to_joint) + np.cross(w_p, np.cross(w_p, to_joint))
                    + np.cross(alpha[k], from_joint) + np.cross(w[k], np.cross(w[k], from_joint)))
        arm = tree.com - p
        return a + np.cross(alpha, arm) + np.cross(w, np.cross(w, arm)), alpha


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
