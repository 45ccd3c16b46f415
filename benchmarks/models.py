# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Real robot files beside Pinocchio: degrees of freedom, masses, frames, and the equations of motion.

    pip install pin example-robot-data            # Pinocchio and the files; BSD-2 and others
    python benchmarks/models.py                   # ten robots
    python benchmarks/models.py --all             # every URDF file of the collection
    python benchmarks/models.py FILE.urdf ...

Each robot is put at random joint positions within its limits, three times, as a scene's `models`
entry; the poses of its links and frames are those of the World that results. Largest differences
are printed, and those of the mass matrix, a Jacobian and the inverse dynamics at random
velocities, as parts of their largest numbers. For differences above 1e-9, or another number of
degrees of freedom, the exit code is 1; matrices of a mended robot are its own. A robot whose file
holds masses that no body can have is read with `mend_inertia`, which the table says; one that
cannot be read at all is named with the reason.
"""

import argparse
from pathlib import Path
import sys
import time

import numpy as np

from rigid_sim_ros import World
from rigid_sim_ros.models.findings import ModelError
from rigid_sim_ros.models.parts import ros_name
from rigid_sim_ros.models.read import read_model
from rigid_sim_ros.scene import SceneError

ONE_AXIS = ('revolute', 'continuous', 'prismatic')
AXES = {'fixed': 0, 'spherical': 3, 'universal': 2, 'planar': 3, 'free': 6}
TEN = ('panda_description/urdf/panda.urdf', 'tiago_pro_description/robots/tiago_pro.urdf',
       'talos_data/robots/talos_full_v2.urdf', 'pr2_description/urdf/pr2.urdf',
       'double_pendulum_description/urdf/double_pendulum.urdf',
       'g1_description/urdf/g1_29dof_rev_1_0.urdf', 'go2_description/urdf/go2.urdf',
       'ur_description/urdf/ur5_robot.urdf', 'anymal_b_simple_description/robots/anymal.urdf',
       'alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf')
TOLERANCE = 1e-9    # [m], [rad], and of the total mass
TRIALS = 3


def collection() -> Path:
    """Return the folder of example-robot-data."""
    import pinocchio

    for above in Path(pinocchio.__file__).resolve().parents:
        if (folder := above / 'share/example-robot-data/robots').is_dir():
            return folder
    raise SystemExit('the files are missing: pip install example-robot-data')


def positions(model, rng):
    """Return a position within the limits for each joint with one axis that follows no other."""
    found = {}
    for joint in model.joints:
        if joint.kind in ONE_AXIS and joint.mimic is None:
            low = -2.0 if joint.lower is None else joint.lower
            high = 2.0 if joint.upper is None else joint.upper
            found[joint.name] = float(rng.uniform(low, high))
    return found


def all_positions(model, free):
    """Return the positions of all joints with one axis, with those that follow others."""
    by_name = {joint.name: joint for joint in model.joints}

    def position(joint):
        if joint.mimic is None:
            return free[joint.name]
        return (joint.mimic.multiplier * position(by_name[joint.mimic.joint])
                + joint.mimic.offset)

    return {joint.name: position(joint) for joint in model.joints if joint.kind in ONE_AXIS}


def in_pinocchio(pin, peer, wanted):
    """Return the configuration of Pinocchio's model for these joint positions."""
    q = pin.neutral(peer)
    for name, value in wanted.items():
        joint = peer.joints[peer.getJointId(name)]
        q[joint.idx_q:joint.idx_q + joint.nq] = value if joint.nq == 1 else (
            np.cos(value), np.sin(value))
    return q


def difference(pin, peer, world, prefix, wanted):
    """Return the largest distance [m] and angle [rad] between frames of both."""
    data = peer.createData()
    pin.framesForwardKinematics(peer, data, in_pinocchio(pin, peer, wanted))
    frames = world.scene.spec.all_frames()
    far = turned = 0.0
    count = 0
    for frame, oMf in zip(peer.frames, data.oMf, strict=True):
        if frame.type != pin.FrameType.BODY or frame.name == 'universe':
            continue
        body, pose = frames[f'{prefix}/{ros_name(frame.name)}']
        R = pin.Quaternion(world.orientation[body]).matrix()
        here = world.position[body] + R @ np.array(pose.position)
        far = max(far, float(np.abs(here - oMf.translation).max()))
        R = R @ pin.Quaternion(np.array(pose.orientation)).matrix()
        turned = max(turned, float(np.abs(R - oMf.rotation).max()))
        count += 1
    return far, turned, count


def dynamics(pin, peer, model, world, wanted, rng):
    """Return how far mass matrix, Jacobian and inverse dynamics are off, and the velocities."""
    joints = [joint for joint in world.scene.spec.joints or () if joint.type in ONE_AXIS]
    if not joints:
        return [0.0, 0.0, 0.0]
    names = {f'robot/{ros_name(joint.name)}': joint.name for joint in model.joints}
    rows = [peer.joints[peer.getJointId(names[joint.name])].idx_v for joint in joints]
    data, q = peer.createData(), in_pinocchio(pin, peer, wanted)
    M = np.triu(pin.crba(peer, data, q))
    M = (M + np.triu(M, 1).T)[np.ix_(rows, rows)]
    frame = max((one for one in peer.frames if one.type == pin.FrameType.BODY),
                key=lambda one: one.parentJoint).name
    J = pin.computeFrameJacobian(peer, data, q, peer.getFrameId(frame),
                                 pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:, rows]
    moving = world.scene.spec.model_dump(exclude_none=True)
    for joint in moving['joints']:
        if joint['type'] in ONE_AXIS:   # every coordinate by itself
            joint |= {'velocity': float(rng.normal()), 'position': wanted[names[joint['name']]]}
            for key in ('mimic', 'limits'):
                joint.pop(key, None)
    moving = World.from_dict(moving)
    v, a = np.zeros(peer.nv), rng.normal(size=peer.nv)
    v[rows] = [rate for rate, joint in zip(moving.joint_velocity, world.scene.spec.joints,
                                           strict=True) if joint.type in ONE_AXIS]
    efforts = pin.rnea(peer, data, q, v, a)[rows]
    return [float(np.abs(mine - theirs).max() / np.abs(theirs).max()) if theirs.any() else 0.0
            for mine, theirs in (
                (world.mass_matrix('robot'), M),
                (world.jacobian('robot', f'robot/{ros_name(frame)}'), J),
                (moving.inverse_dynamics('robot', a[rows]), efforts))]


def compare(pin, path):
    """Return the row of a robot, and whether it is as Pinocchio has it."""
    model = read_model(path)
    axes = sum(AXES.get(joint.kind, 1) for joint in model.joints)
    peer = pin.buildModelFromUrdf(str(path))
    rng = np.random.default_rng(1)
    far = turned = 0.0
    mended, spent = '', 0.0
    for _ in range(TRIALS):
        free = positions(model, rng)
        entry = {'name': 'robot', 'file': str(path), 'joints': free, 'fixed_base': True,
                 'visuals': False}
        scene = {'world': {'contact': 'none'}, 'models': [entry]}
        start = time.perf_counter()
        try:
            world = World.from_dict(scene)
        except SceneError:
            entry['mend_inertia'] = True
            mended = 'mended'
            world = World.from_dict(scene)
        spent = time.perf_counter() - start
        one, other, count = difference(pin, peer, world, 'robot', all_positions(model, free))
        far, turned = max(far, one), max(turned, other)
    mass = sum(body.inertial.mass for body in world.scene.spec.bodies if body.inertial)
    wanted = sum(inertia.mass for inertia in peer.inertias)
    off = abs(mass - wanted) / max(wanted, 1e-30)
    followers = sum(joint.mimic is not None for joint in model.joints)
    errors = dynamics(pin, peer, model, world, all_positions(model, free), rng)
    good = axes == peer.nv and max(far, turned, off) <= TOLERANCE and (
        mended or max(errors) <= TOLERANCE)
    return (f'{path.stem:34} {len(world.names):6} {count:6} {axes:4} {peer.nv:4} {followers:5} '
            f'{mass:10.4f} {off:8.1e} {far:9.1e} {turned:9.1e} {errors[0]:8.1e} {errors[1]:8.1e} '
            f'{errors[2]:8.1e} {spent:6.2f}  {mended}'), good


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('files', nargs='*', type=Path)
    parser.add_argument('--all', action='store_true')
    options = parser.parse_args()
    import pinocchio as pin

    folder = collection()
    files = options.files or (sorted(folder.rglob('*.urdf')) if options.all
                              else [folder / name for name in TEN])
    print(f'{"robot":34} {"bodies":>6} {"frames":>6} {"axes":>4} {"nv":>4} {"mimic":>5} '
          f'{"mass [kg]":>10} {"off":>8} {"far [m]":>9} {"turned":>9} {"M":>8} {"J":>8} '
          f'{"rnea":>8} {"s":>6}')
    wrong = 0
    for path in files:
        try:
            row, good = compare(pin, path)
        except (ModelError, SceneError) as error:
            print(f'{path.stem:34} cannot be read: {str(error).splitlines()[0]}'
                  .replace(str(folder), ''))
            continue
        wrong += not good
        print(row, '' if good else '  DIFFERS')
    return int(wrong > 0)


if __name__ == '__main__':
    sys.exit(main())
