# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A scene with joints in MuJoCo, all settings but the integrator as they come."""

from functools import partial
from typing import Any

import mujoco
import numpy as np
from run_mujoco import tag
from scipy.spatial.transform import Rotation

from rigid_sim_ros.scene import schema
from rigid_sim_ros.scene.build import Scene

VERSION = mujoco.__version__
# Otherwise MuJoCo writes its warnings into a file in the current folder.
mujoco.set_mju_user_warning(lambda message: None)

_TYPES = {'revolute': 'hinge', 'continuous': 'hinge', 'prismatic': 'slide'}

Frame = tuple[np.ndarray, Rotation]


def frame(pose: schema.Pose) -> Frame:
    """Return origin and axes of a pose of a scene."""
    return np.array(pose.position), Rotation.from_quat(pose.orientation)


def _within(outer: Frame, inner: Frame) -> Frame:
    """Return an inner frame, given in an outer one, in the frame that the outer is given in."""
    return outer[0] + outer[1].apply(inner[0]), outer[1] * inner[1]


def _seen_from(outer: Frame, inner: Frame) -> Frame:
    back = outer[1].inv()
    return back.apply(inner[0] - outer[0]), back * inner[1]


def _quaternion(turn: Rotation) -> np.ndarray:
    """Return w, x, y, z."""
    return turn.as_quat()[[3, 0, 1, 2]]


class _Writer:
    """Writes a scene as a model of MuJoCo."""

    def __init__(self, spec: schema.Scene) -> None:
        self.spec = spec
        self.frames: dict[str, Frame] = {'world': (np.zeros(3), Rotation.identity())} | {
            one.name: frame(one.pose) for one in spec.bodies}
        self.holds: dict[str, schema.Joint] = {}
        self.loops: list[schema.Joint] = []
        for one in spec.joints or ():
            if one.child in self.holds:
                self.loops.append(one)
            else:
                self.holds[one.child] = one

    def _geoms(self, one: schema.Body) -> str:
        if one.shape is None:
            return ''
        friction = self.spec.materials[one.material].friction
        surface = {'friction': (friction, 0.005, 0.0001), 'condim': '3'}
        if one.shape.type == 'plane':
            return tag('geom', type='plane', size=(0, 0, 1), **surface)
        return ''.join(tag('geom', type='sphere', size=part.radius, pos=part.pose.position,
                           **surface) for part in one.shape.compound)

    def _joint(self, one: schema.Joint, inner: Frame) -> str:
        """Return a joint of the body whose frame in that of its parent is `inner`."""
        if one.type == 'fixed':
            return ''
        place, axes = _seen_from(inner, frame(one.pose))
        more: dict[str, Any] = {}
        if one.limits.lower is not None:
            more = {'limited': 'true', 'range': (one.limits.lower, one.limits.upper)}
        return tag('joint', name=one.name, type=_TYPES[one.type], pos=place,
                   axis=axes.apply(one.axis), damping=one.damping, armature=one.armature,
                   frictionloss=one.friction, **more)

    def body(self, one: schema.Body) -> str:
        """Return a body with all that hangs on it."""
        held = self.holds.get(one.name)
        inner = _seen_from(self.frames[held.parent if held else 'world'], self.frames[one.name])
        mass = one.inertial
        if mass is None:
            raise ValueError(f'{one.name} has no inertial, must have one')
        parts = [self._joint(held, inner) if held else tag('freejoint', name=one.name),
                 tag('inertial', pos=mass.com, mass=mass.mass, fullinertia=mass.inertia),
                 self._geoms(one)]
        parts += [self.body(other) for other in self.spec.bodies
                  if other.name in self.holds and self.holds[other.name].parent == one.name]
        return tag('body', ''.join(parts), name=one.name, pos=inner[0],
                   quat=_quaternion(inner[1]))

    def _equalities(self) -> str:
        found = [tag('connect', body1=one.parent, body2=one.child, anchor=one.pose.position)
                 for one in self.loops]
        found += [tag('joint', joint1=one.name, joint2=one.mimic.joint, polycoef=(
            one.mimic.offset, one.mimic.multiplier, 0, 0, 0))
                  for one in self.spec.joints or () if one.mimic]
        return tag('equality', ''.join(found))

    def _actuators(self) -> str:
        found = []
        for one in self.spec.joints or ():
            drive = one.drive
            if drive and drive.mode == 'position':
                found.append(tag('position', name=one.name, joint=one.name, kp=drive.stiffness,
                                 kv=drive.damping))
            elif drive:
                found.append(tag('motor', name=one.name, joint=one.name))
        return tag('actuator', ''.join(found))

    def model(self, integrator: str) -> mujoco.MjModel:
        """Return the model; the anchors of loops are those of the scene in both bodies."""
        roots = [self._geoms(one) if one.fixed else self.body(one) for one in self.spec.bodies
                 if one.name not in self.holds or self.holds[one.name].parent == 'world']
        world = self.spec.world
        model = mujoco.MjModel.from_xml_string(tag('mujoco', ''.join([
            tag('compiler', angle='radian'), tag('option', integrator=integrator,
                                                 timestep=world.step, gravity=world.gravity),
            tag('worldbody', ''.join(roots)), self._equalities(), self._actuators()])))
        for row, one in zip(model.eq_data, self.loops, strict=False):
            if one.child_pose is None:
                raise ValueError(f'{one.name} closes a loop, must have a child_pose')
            row[:6] = (*one.pose.position, *one.child_pose.position)
        return model


class MuJoCo:
    """A world of this scene; what has the name of something in a `World` is the same."""

    def __init__(self, spec: schema.Scene, integrator: str) -> None:
        """Put the scene's joints to their positions."""
        self.model = _Writer(spec).model(integrator)
        self.data, self._scratch = mujoco.MjData(self.model), mujoco.MjData(self.model)
        self.names = [one.name for one in spec.bodies]
        self._bodies = [0 if one.fixed else self.model.body(one.name).id for one in spec.bodies]
        joints = [one for one in spec.joints or () if one.type != 'fixed' and one.name in {
            self.model.joint(j).name for j in range(self.model.njnt)}]
        rows = [self.model.joint(one.name) for one in joints]
        self._q = np.array([row.qposadr[0] for row in rows], dtype=np.int64)
        self._v = np.array([row.dofadr[0] for row in rows], dtype=np.int64)
        self.data.qpos[self._q] = [one.position or 0.0 for one in joints]
        for one in joints:
            if one.drive:
                goal = one.drive.position if one.drive.position is not None else one.position
                self.data.ctrl[self.model.actuator(one.name).id] = (
                    goal if one.drive.mode == 'position' else one.drive.effort)

    def step(self, count: int = 1) -> None:
        """Advance by `count` steps; ArithmeticError where MuJoCo had to start anew."""
        mujoco.mj_step(self.model, self.data, count)
        for kind in ('BADQPOS', 'BADQVEL', 'BADQACC'):
            if self.data.warning[getattr(mujoco.mjtWarning, f'mjWARN_{kind}')].number:
                raise ArithmeticError('blew up')

    @property
    def joint_position(self) -> np.ndarray:
        """Of the joints with an axis that close no loop, in the order of the scene [rad or m]."""
        return self.data.qpos[self._q]

    @property
    def joint_velocity(self) -> np.ndarray:
        """Of the same joints [rad/s or m/s]."""
        return self.data.qvel[self._v]

    @property
    def position(self) -> np.ndarray:
        """Of the bodies' frames, (n, 3) [m]."""
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.xpos[self._bodies]

    @property
    def orientation(self) -> np.ndarray:
        """Of the bodies, (n, 4) x, y, z, w."""
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.xquat[self._bodies][:, [1, 2, 3, 0]]

    def _energies(self) -> np.ndarray:
        there = self._scratch
        there.qpos[:], there.qvel[:] = self.data.qpos, self.data.qvel
        mujoco.mj_fwdPosition(self.model, there)
        mujoco.mj_fwdVelocity(self.model, there)
        mujoco.mj_energyPos(self.model, there)
        mujoco.mj_energyVel(self.model, there)
        return there.energy

    def kinetic_energy(self) -> float:
        """Return the kinetic energy [J]."""
        return float(self._energies()[1])

    def potential_energy(self) -> float:
        """Return the potential energy [J]."""
        return float(self._energies()[0])

    def normal_force(self) -> float:
        """Return the sum of the normal forces of all contacts in the latest step [N]."""
        wrench, total = np.zeros(6), 0.0
        for k in range(self.data.ncon):
            mujoco.mj_contactForce(self.model, self.data, k, wrench)
            total += wrench[0]
        return total

    def count_contacts(self) -> int:
        """Return how many points touch."""
        return int(self.data.ncon)

    def save(self) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities."""
        return self.data.qpos.copy(), self.data.qvel.copy()

    def restore(self, saved: tuple[np.ndarray, np.ndarray]) -> None:
        """Put positions and velocities back."""
        self.data.qpos[:], self.data.qvel[:] = saved


def _of_scene(integrator: str, scene: Scene) -> MuJoCo:
    return MuJoCo(scene.spec, integrator)


ENGINES = {f'MuJoCo {name}': partial(_of_scene, name) for name in (
    'Euler', 'implicitfast', 'RK4')}
