# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A tree of joints in Pinocchio: its articulated-body algorithm with semi-implicit Euler steps.

Pinocchio has no simulator of its own. Besides, its accelerations integrated by an eighth-order
method check the motions that joint_cases.py holds for true.
"""

from typing import Any

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from rigid_sim_ros.scene import schema
from rigid_sim_ros.scene.build import Scene

VERSION = pin.__version__


def _placement(pose: schema.Pose) -> pin.SE3:
    return pin.SE3(Rotation.from_quat(pose.orientation).as_matrix(), np.array(pose.position))


class Pinocchio:
    """A world of a scene of trees on the world; names are as those of a `World`."""

    def __init__(self, spec: schema.Scene) -> None:
        """Build the tree; NotImplementedError for more than free motion of revolute joints."""
        self.model, self.h = pin.Model(), spec.world.step
        self.model.gravity.linear = np.array(spec.world.gravity)
        self.names = [one.name for one in spec.bodies]
        poses = {one.name: _placement(one.pose) for one in spec.bodies} | {
            'world': pin.SE3.Identity()}
        # Of each body: the joint that it hangs on, and its frame in that of the joint.
        self._held = {'world': (0, pin.SE3.Identity())}
        start = []
        for one in spec.joints or ():
            if (one.type not in ('revolute', 'fixed') or one.drive or one.mimic or one.friction
                    or one.parent not in self._held or one.child in self._held):
                raise NotImplementedError(one.name)
            self._hold(one, poses)
            if one.type == 'revolute':
                start.append(one.position or 0.0)
        for one in spec.bodies:
            if one.name not in self._held or one.inertial is None:
                raise NotImplementedError(one.name)
            self._weigh(one)
        self.data = self.model.createData()
        self.joint_position, self.joint_velocity = np.array(start), np.zeros(len(start))
        self._none = np.zeros(len(start))

    def _hold(self, one: schema.Joint, poses: dict[str, pin.SE3]) -> None:
        parent, offset = self._held[one.parent]
        in_parent = poses[one.parent].inverse() * poses[one.child]
        joint = _placement(one.pose)
        if one.type == 'fixed':
            self._held[one.child] = (parent, offset * in_parent)
            return
        # The frame of the joint has the axes of the child and the origin of the joint.
        frame = pin.SE3(in_parent.rotation, joint.translation)
        axis = in_parent.rotation.T @ joint.rotation @ (
            np.array(one.axis) / np.linalg.norm(one.axis))
        made = self.model.addJoint(parent, pin.JointModelRevoluteUnaligned(axis), offset * frame,
                                   one.name)
        self._held[one.child] = (made, frame.inverse() * in_parent)

    def _weigh(self, one: schema.Body) -> None:
        joint, offset = self._held[one.name]
        xx, yy, zz, xy, xz, yz = one.inertial.inertia
        self.model.appendBodyToJoint(joint, pin.Inertia(
            one.inertial.mass, np.array(one.inertial.com),
            np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])), offset)

    def step(self, count: int = 1) -> None:
        """Advance by semi-implicit Euler steps."""
        for _ in range(count):
            self.joint_velocity += self.h * pin.aba(
                self.model, self.data, self.joint_position, self.joint_velocity, self._none)
            self.joint_position += self.h * self.joint_velocity
        if not np.isfinite(self.joint_velocity).all():
            raise ArithmeticError('blew up')

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the joint positions at some times from now, (times, joints), by DOP853."""
        n = len(self.joint_position)

        def rates(t: float, y: np.ndarray) -> np.ndarray:
            return np.r_[y[n:], pin.aba(self.model, self.data, y[:n], y[n:], self._none)]

        return solve_ivp(rates, (0.0, times[-1]), np.r_[self.joint_position, self.joint_velocity],
                         method='DOP853', rtol=3e-13, atol=1e-13, t_eval=times).y[:n].T

    def _frames(self) -> list[pin.SE3]:
        pin.forwardKinematics(self.model, self.data, self.joint_position)
        return [self.data.oMi[joint] * offset
                for joint, offset in (self._held[name] for name in self.names)]

    @property
    def position(self) -> np.ndarray:
        """Of the bodies' frames, (n, 3) [m]."""
        return np.array([frame.translation for frame in self._frames()])

    @property
    def orientation(self) -> np.ndarray:
        """Of the bodies, (n, 4) x, y, z, w."""
        return Rotation.from_matrix([frame.rotation for frame in self._frames()]).as_quat()

    def kinetic_energy(self) -> float:
        """Return the kinetic energy [J]."""
        return float(pin.computeKineticEnergy(self.model, self.data, self.joint_position,
                                              self.joint_velocity))

    def potential_energy(self) -> float:
        """Return the potential energy [J]."""
        return float(pin.computePotentialEnergy(self.model, self.data, self.joint_position))

    def save(self) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities."""
        return self.joint_position.copy(), self.joint_velocity.copy()

    def restore(self, saved: tuple[np.ndarray, np.ndarray]) -> None:
        """Put positions and velocities back."""
        self.joint_position[:], self.joint_velocity[:] = saved


def disagreement(scene: Scene, times: np.ndarray, true: np.ndarray, read: Any) -> float:
    """Return how far what is read of the motion by DOP853 is from what is held for true."""
    one, worst = Pinocchio(scene.spec), 0.0
    for q, point in zip(one.at(times), true, strict=True):
        one.joint_position[:] = q
        worst = max(worst, float(np.linalg.norm(read(one) - point)))
    return worst


def _of_scene(scene: Scene) -> Pinocchio:
    return Pinocchio(scene.spec)


ENGINES = {'Pinocchio ABA, Euler': _of_scene}
