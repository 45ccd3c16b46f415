# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A scene with joints in Drake's discrete MultibodyPlant, its contact settings as they come."""

from collections.abc import Callable
from importlib.metadata import version

import numpy as np
from pydrake.geometry import HalfSpace, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation)
from pydrake.multibody.tree import (
    FixedOffsetFrame, PdControllerGains, RevoluteJoint, RotationalInertia, SpatialInertia,
    UnitInertia)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial.transform import Rotation

from rigid_sim_ros.scene import schema
from rigid_sim_ros.scene.build import Scene

VERSION = version('drake')


def _placement(pose: schema.Pose) -> RigidTransform:
    return RigidTransform(RotationMatrix(Rotation.from_quat(pose.orientation).as_matrix()),
                          np.array(pose.position))


def _inertia(one: schema.Inertial) -> SpatialInertia:
    xx, yy, zz, xy, xz, yz = one.inertia
    com = np.array(one.com)
    central = RotationalInertia(xx, yy, zz, xy, xz, yz)
    about = central.ShiftFromCenterOfMass(one.mass, -com)
    unit = UnitInertia(*(entry / one.mass for entry in (
        *about.get_moments(), *about.get_products())))
    return SpatialInertia(one.mass, com, unit, skip_validity_check=True)


class Drake:
    """A world of a scene; what has the name of something in a `World` is the same."""

    def __init__(self, spec: schema.Scene) -> None:
        """Build the plant; NotImplementedError for what joints of Drake do not have."""
        builder = DiagramBuilder()
        self.plant, _ = AddMultibodyPlantSceneGraph(builder, spec.world.step)
        self.plant.mutable_gravity_field().set_gravity_vector(np.array(spec.world.gravity))
        self._poses = {one.name: _placement(one.pose) for one in spec.bodies} | {
            'world': RigidTransform()}
        self.names = [one.name for one in spec.bodies]
        self._bodies = {'world': self.plant.world_body()}
        for one in spec.bodies:
            self._add(one, spec.materials)
        self._joints = [joint for joint in map(self._hold_together(), spec.joints or ()) if joint]
        self.plant.Finalize()
        self.simulator = Simulator(builder.Build())
        self._root = self.simulator.get_mutable_context()
        self._here = self.plant.GetMyMutableContextFromRoot(self._root)
        self._start(spec)
        self.simulator.Initialize()

    def _add(self, one: schema.Body, materials: dict[str, schema.Material]) -> None:
        if one.fixed:
            self._bodies[one.name] = self.plant.world_body()
        else:
            self._bodies[one.name] = self.plant.AddRigidBody(one.name, _inertia(one.inertial))
        if one.shape is None:
            return
        friction = CoulombFriction(*[materials[one.material].friction] * 2)
        shapes = ([(HalfSpace(), (0.0, 0.0, 0.0))] if one.shape.type == 'plane' else
                  [(Sphere(part.radius), part.pose.position) for part in one.shape.compound])
        for k, (shape, place) in enumerate(shapes):
            self.plant.RegisterCollisionGeometry(
                self._bodies[one.name], RigidTransform(np.array(place)), shape,
                f'{one.name}{k}', friction)

    def _hold_together(self) -> Callable[[schema.Joint], RevoluteJoint | None]:
        """Return what adds a joint: one of an axis is returned, one that closes a loop is not."""
        held: set[str] = set()

        def hold(one: schema.Joint) -> RevoluteJoint | None:
            driven = one.drive is not None and one.drive.mode != 'position'
            if driven or one.friction or one.limits.lower is not None or one.mimic:
                raise NotImplementedError(one.name)
            at = _placement(one.pose)
            parent, child = self._bodies[one.parent], self._bodies[one.child]
            if one.child in held:
                self.plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
                self.plant.AddBallConstraint(parent, np.array(one.pose.position), child,
                                             np.array(one.child_pose.position))
                return None
            held.add(one.child)
            in_child = (self._poses[one.child].inverse() @ self._poses[one.parent] @ at)
            frames = [self.plant.AddFrame(FixedOffsetFrame(
                f'{one.name}_{end}', body.body_frame(), place)) for end, body, place in (
                    ('parent', parent, at), ('child', child, in_child))]
            if one.type == 'fixed':
                self.plant.WeldFrames(*frames)
                return None
            joint = self.plant.AddJoint(RevoluteJoint(one.name, *frames, np.array(one.axis)))
            if one.drive:
                self.plant.AddJointActuator(one.name, joint).set_controller_gains(
                    PdControllerGains(p=one.drive.stiffness, d=one.drive.damping))
            return joint
        return hold

    def _start(self, spec: schema.Scene) -> None:
        for body in spec.bodies:
            if self._bodies[body.name].is_floating_base_body():
                self.plant.SetFreeBodyPose(self._here, self._bodies[body.name],
                                           self._poses[body.name])
        starts = {one.name: one.position or 0.0 for one in spec.joints or ()}
        for joint in self._joints:
            joint.set_angle(self._here, starts[joint.name()])
        goals = [starts[one.name] for one in spec.joints or () if one.drive]
        if goals:
            self.plant.get_desired_state_input_port(
                self._joints[0].model_instance()).FixValue(self._here, np.r_[
                    goals, np.zeros(len(goals))])

    def step(self, count: int = 1) -> None:
        """Advance by `count` steps."""
        h = self.plant.time_step()
        done = round(self._root.get_time() / h)
        try:
            self.simulator.AdvanceTo((done + count) * h)
        except RuntimeError as error:
            raise ArithmeticError('blew up') from error
        if not np.isfinite(self.plant.GetPositionsAndVelocities(self._here)).all():
            raise ArithmeticError('blew up')

    @property
    def joint_position(self) -> np.ndarray:
        """Of the revolute joints that close no loop [rad]."""
        return np.array([joint.get_angle(self._here) for joint in self._joints])

    @property
    def joint_velocity(self) -> np.ndarray:
        """Of the same joints [rad/s]."""
        return np.array([joint.get_angular_rate(self._here) for joint in self._joints])

    def _frames(self) -> list[RigidTransform]:
        return [self.plant.EvalBodyPoseInWorld(self._here, self._bodies[name])
                for name in self.names]

    @property
    def position(self) -> np.ndarray:
        """Of the bodies' frames, (n, 3) [m]."""
        return np.array([frame.translation() for frame in self._frames()])

    @property
    def orientation(self) -> np.ndarray:
        """Of the bodies, (n, 4) x, y, z, w."""
        return Rotation.from_matrix([frame.rotation().matrix()
                                     for frame in self._frames()]).as_quat()

    def kinetic_energy(self) -> float:
        """Return the kinetic energy [J]."""
        return float(self.plant.CalcKineticEnergy(self._here))

    def potential_energy(self) -> float:
        """Return the potential energy [J]."""
        return float(self.plant.CalcPotentialEnergy(self._here))

    def normal_force(self) -> float:
        """Return the vertical force of the ground [N]."""
        found = self.plant.get_contact_results_output_port().Eval(self._here)
        return abs(sum(found.point_pair_contact_info(k).contact_force()[2]
                       for k in range(found.num_point_pair_contacts())))

    def save(self) -> np.ndarray:
        """Return positions and velocities."""
        return self.plant.GetPositionsAndVelocities(self._here).copy()

    def restore(self, saved: np.ndarray) -> None:
        """Put positions and velocities back; time goes on."""
        self.plant.SetPositionsAndVelocities(self._here, saved)


def _of_scene(scene: Scene) -> Drake:
    return Drake(scene.spec)


ENGINES = {'Drake discrete': _of_scene}
