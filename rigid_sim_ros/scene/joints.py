# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The joints of a scene: what fits together, and the engine's table of them."""

from collections.abc import Mapping, Sequence
import math
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.joints.assembly import assemble, set_rates
from rigid_sim_ros.engine.joints.buffers import (
    Drives, EFFORT, joints_at_rest, make_joint_work, no_drives, POSITION, VELOCITY)
from rigid_sim_ros.engine.joints.joint_coordinates import (
    joint_distance, joint_error, joint_position)
from rigid_sim_ros.engine.maths.rotation_in_python import cross, from_matrix, multiply, rotate
from rigid_sim_ros.engine.model import joints as engine
from rigid_sim_ros.engine.model.joints import (
    axis_groups, build_joints, JointTable, Laws, LoopError, Mimic)
from rigid_sim_ros.engine.model.model import Model, WORLD
from rigid_sim_ros.engine.state.state import copy_into, copy_state, State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.scene import schema
from rigid_sim_ros.scene.errors import below, Report, shown
from rigid_sim_ros.words import nearest

_KINDS = {'fixed': engine.FIXED, 'revolute': engine.REVOLUTE, 'continuous': engine.REVOLUTE,
          'prismatic': engine.PRISMATIC, 'spherical': engine.SPHERICAL,
          'universal': engine.UNIVERSAL, 'planar': engine.PLANAR, 'distance': engine.DISTANCE,
          'free': engine.FREE}
MODES = {'effort': EFFORT, 'velocity': VELOCITY, 'position': POSITION}
_ONE_AXIS = schema.ONE_AXIS
# Keys that have a meaning for some types only, and these types.
_TYPES_OF_KEY = {
    'axis2': ('universal',), 'limits': _ONE_AXIS, 'friction': _ONE_AXIS, 'spring': _ONE_AXIS,
    'drive': _ONE_AXIS, 'mimic': _ONE_AXIS, 'position': _ONE_AXIS, 'velocity': _ONE_AXIS,
    'armature': _ONE_AXIS, 'damping': (*_ONE_AXIS, 'spherical', 'universal', 'planar'),
    'length': ('distance',)}
# cos of the least angle between the axes of a universal joint: nearer to parallel they are one.
_PARALLEL = 1e-6
# [m] How far apart the ends of a distance joint must be, at least, to have a direction.
_NEAR = 1e-9

# [m or rad] What is written with six digits is closed; joints take the rest away.
CLOSED = 1e-5

Pose = tuple[tuple[float, float, float], tuple[float, float, float, float]]


class SceneJoints(NamedTuple):
    """The joints of a scene as the engine has them."""

    table: JointTable
    position: Array     # (j,) at the start [rad] or [m]
    velocity: Array     # (k,) along the axes at the start, NaN: as the bodies' twists have it
    # (j, 4) x, y, z, w: axes of K, whose z axis is that of the joint, to those of the joint frame
    q_JK: Array
    drives: Drives


def check_joints(spec: schema.Scene, report: Report) -> None:
    """Report what does not fit together although each value is right by itself."""
    bodies = {body.name: body for body in spec.bodies}
    known = {'world': None, **bodies}
    joints = spec.joints or ()
    others = {joint.name: joint for joint in joints}
    leads_back: dict[str, bool] = {}
    by_name: dict[str, int] = {}
    for i, joint in enumerate(joints):
        here = below(('joints', i), report)
        if by_name.setdefault(joint.name, i) != i:
            here(('name',), f'{shown(joint.name)} is the name of joints[{by_name[joint.name]}] '
                 'too, must be unique')
        for key, name in (('parent', joint.parent), ('child', joint.child)):
            if name not in known:
                here((key,), f'{shown(name)} is no body, {nearest(name, known)}')
        ends = [bodies.get(name) for name in (joint.parent, joint.child)]
        if joint.parent == joint.child:
            here(('child',), f'{shown(joint.child)} is the parent too, must be another body')
        elif all(name in known for name in (joint.parent, joint.child)) and not any(
                body is not None and body.is_pushed for body in ends):
            here(('child',), f'neither {shown(joint.parent)} nor {shown(joint.child)} can move, '
                 'must be a body that is not fixed, or no joint')
        _check_keys(joint, here)
        _check_limits(joint, here)
        _check_mimic(joint, others, leads_back, here)
    if joints and spec.world.integrator not in ('symplectic', 'symplectic4'):
        report(('world', 'integrator'), f'{shown(spec.world.integrator)} beside joints, must be '
               'symplectic or symplectic4, which keep them closed')


def _check_keys(joint: schema.Joint, here: Report) -> None:
    default = {name: field.default for name, field in schema.Joint.model_fields.items()}
    for key, types in _TYPES_OF_KEY.items():
        if getattr(joint, key) != default[key] and joint.type not in types:
            here((key,), f'stands in a {joint.type} joint, must stand in one of the type '
                 f'{", ".join(types)}')
    if joint.type == 'distance' and joint.child_pose is None:
        here(('child_pose',), 'is missing, must say to which point of the child the distance is')
    drive = joint.drive
    if drive is not None:
        needed = {'velocity': 'gain', 'position': 'stiffness'}.get(drive.mode)
        if needed is not None and getattr(drive, needed) is None:
            here(('drive', needed), f'is missing, must be given for the mode {drive.mode}')


def _check_limits(joint: schema.Joint, here: Report) -> None:
    lower, upper = joint.limits.lower, joint.limits.upper
    if joint.type == 'continuous' and (lower is not None or upper is not None):
        here(('limits',), 'has bounds in a continuous joint, must have none, or the type be '
             'revolute')
    elif lower is not None and upper is not None and lower > upper:
        here(('limits', 'lower'), f'{lower:g} is above upper {upper:g}, must be below it')
    elif joint.type in _ONE_AXIS and (joint.position is not None or joint.mimic is None):
        position, (lowest, highest) = joint.position or 0.0, joint.limits.range
        if not lowest <= position <= highest:
            here(('position',), f'{position:g} is beyond the limits, must be within '
                 f'{lowest:g} .. {highest:g}')


def _check_mimic(joint: schema.Joint, others: Mapping[str, schema.Joint],
                 leads_back: dict[str, bool], here: Report) -> None:
    """Report a joint that follows none, or itself; `leads_back` keeps what is known of others."""
    if joint.mimic is None:
        return
    other = others.get(joint.mimic.joint)
    if other is None or other.type not in _ONE_AXIS:
        ok = [name for name, one in others.items() if one.type in _ONE_AXIS]
        here(('mimic', 'joint'), f'{shown(joint.mimic.joint)} is no joint with one axis, '
             f'{nearest(joint.mimic.joint, ok)}')
        return
    seen = {joint.name}
    while (other is not None and other.mimic is not None and other.name not in seen
           and other.name not in leads_back):
        seen.add(other.name)
        other = others.get(other.mimic.joint)
    verdict = other is not None and (other.name in seen or leads_back.get(other.name, False))
    leads_back.update(dict.fromkeys(seen, verdict))
    if verdict:
        here(('mimic', 'joint'), f'{shown(joint.mimic.joint)} leads back to this joint, must not')


def build_scene_joints(spec: schema.Scene, model: Model, report: Report) -> SceneJoints | None:
    """Return the joints; None if there are none, or after a report of what cannot be built."""
    joints = spec.joints or ()
    if not joints:
        return None
    index = {body.name: i for i, body in enumerate(spec.bodies)} | {'world': WORLD}
    by_name = {joint.name: i for i, joint in enumerate(joints)}
    made = []
    for i, joint in enumerate(joints):
        one = _joint(spec, model, joint, index, by_name, below(('joints', i), report))
        if one is None:
            return None
        made.append(one)
    try:
        table = build_joints(made, np.where(model.inv_m > 0.0, model.m, 0.0).tolist())
    except LoopError as error:
        report(('joints', error.joint), 'closes a loop and has forces along its axis, must have '
               'none: let a joint without forces close the loop')
        return None
    position = _starts(joints)
    velocity = np.full(len(table.translates), np.nan)
    drives = no_drives(table)
    for i, joint in enumerate(joints):
        r = table.row_of_joint[i]
        if r == engine.NONE or joint.type not in _ONE_AXIS:
            continue
        k = int(table.first_axis[r])
        if joint.velocity is not None:
            velocity[k] = joint.velocity
        if joint.drive is not None:
            set_drive(drives, k, joint.drive, joint.drive.mode, (
                float(position[i]) if joint.drive.position is None else joint.drive.position),
                joint.drive.velocity, joint.drive.effort)
    turned = np.array([_axes(joint) for joint in joints], dtype=np.float64)
    return SceneJoints(table, position, velocity, turned, drives)


def set_drive(drives: Drives, k: int, drive: schema.JointDrive, mode: str, position: float,
              velocity: float, effort: float) -> None:
    """Give the drive of axis k a goal in one of its modes."""
    drives.mode[k] = MODES[mode]
    drives.stiffness[k] = (drive.stiffness or 0.0) if mode == 'position' else 0.0
    drives.damping[k] = {'effort': 0.0, 'velocity': drive.gain or 0.0,
                         'position': drive.damping}[mode]
    drives.position[k], drives.velocity[k], drives.effort[k] = position, velocity, effort


def _starts(joints: Sequence[schema.Joint]) -> Array:
    """Return the positions at the start, of joints that mimic from those that they follow."""
    by_name = {joint.name: joint for joint in joints}
    found: dict[str, float] = {}
    for joint in joints:
        followers = []
        while joint.name not in found and joint.position is None and joint.mimic is not None:
            followers.append((joint.name, joint.mimic))
            joint = by_name[joint.mimic.joint]
        position = found.setdefault(joint.name, joint.position or 0.0)
        for name, mimic in reversed(followers):
            position = found[name] = mimic.multiplier * position + mimic.offset
    return np.array([found[joint.name] for joint in joints])


def _joint(spec: schema.Scene, model: Model, joint: schema.Joint, index: Mapping[str, int],
           by_name: Mapping[str, int], here: Report) -> engine.Joint | None:
    a, b = index[joint.parent], index[joint.child]
    q_JK = _axes(joint)
    if q_JK is None:
        here(('axis2',), f'{list(joint.axis2 or ())} is not at right angles to the axis '
             f'{list(joint.axis)}, must be')
        return None
    p_PJ, q_PJ = joint.pose.position, joint.pose.orientation
    poses = [_pose(spec, body) for body in (a, b)]
    if joint.child_pose is not None:
        p_DJ, q_DJ = joint.child_pose.position, joint.child_pose.orientation
    else:
        p_DJ, q_DJ = frame_in_child(poses[0], poses[1], (p_PJ, q_PJ))
    length = joint.length if joint.length is not None else math.dist(
        combined(poses[0], (p_PJ, q_PJ))[0], combined(poses[1], (p_DJ, q_DJ))[0])
    if joint.type == 'distance' and length < _NEAR:
        here(('child_pose',), 'is where the frame in the parent is, must be away from it: '
             'the distance between both is kept')
        return None
    p_A, q_A = combined(_body_frame(model, a), (p_PJ, multiply(q_PJ, q_JK)))
    p_B, q_B = combined(_body_frame(model, b), (p_DJ, multiply(q_DJ, q_JK)))
    mimic = None
    if joint.mimic is not None:
        mimic = Mimic(by_name[joint.mimic.joint], joint.mimic.multiplier, joint.mimic.offset)
    return engine.Joint(_KINDS[joint.type], a, b, np.array(p_A), np.array(q_A), np.array(p_B),
                        np.array(q_B), length, _laws(joint), joint.drive is not None, mimic)


def _laws(joint: schema.Joint) -> Laws:
    limits, spring = joint.limits, joint.spring or schema.JointSpring(stiffness=0.0)
    return Laws(joint.armature, joint.damping, joint.friction, spring.stiffness, spring.rest,
                *limits.range, limits.restitution,
                math.inf if limits.velocity is None else limits.velocity,
                math.inf if limits.effort is None else limits.effort)


def _axes(joint: schema.Joint) -> tuple[float, float, float, float] | None:
    """Return q_JK, see `SceneJoints`; None if the second axis is not at right angles."""
    z = np.array(joint.axis) / math.hypot(*joint.axis)
    near = np.eye(3)[int(np.argmin(np.abs(z)))] if joint.axis2 is None else np.array(joint.axis2)
    x = near / math.hypot(*near.tolist())
    x = x - (x @ z) * z
    size = math.hypot(*x.tolist())
    if joint.axis2 is not None and size < 1.0 - _PARALLEL:
        return None
    x = x / size
    a, c = x.tolist(), z.tolist()
    b = cross(c, a)
    q: tuple[float, float, float, float] = from_matrix(
        ((a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2])))
    return q


def _pose(spec: schema.Scene, body: int) -> Pose:
    if body == WORLD:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    return spec.bodies[body].pose.position, spec.bodies[body].pose.orientation


def _body_frame(model: Model, body: int) -> Pose:
    """Return the pose of frame B in C, of the world in itself."""
    if body == WORLD:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    x, y, z = model.p_CB[body].tolist()
    a, b, c, d = model.q_CB[body].tolist()
    return (x, y, z), (a, b, c, d)


def frame_in_child(parent: Pose, child: Pose, frame: Pose) -> Pose:
    """Return the pose in the child of a frame in the parent, for bodies at these poses."""
    return combined(_inverse(child), combined(parent, frame))


def combined(outer: Pose, inner: Pose) -> Pose:
    """Return the pose of a frame that is given in another one."""
    x, y, z = rotate(outer[1], inner[0])
    return (outer[0][0] + x, outer[0][1] + y, outer[0][2] + z), multiply(outer[1], inner[1])


def _inverse(pose: Pose) -> Pose:
    q = (-pose[1][0], -pose[1][1], -pose[1][2], pose[1][3])
    x, y, z = rotate(q, pose[0])
    return (-x, -y, -z), q


def put_together(spec: schema.Scene, model: Model, state: State, joints: SceneJoints,
                 report: Report) -> None:
    """
    Move the bodies of the first state to where the positions of the joints want them.

    Where joints close loops, those whose positions are written keep them, as far as they agree.
    Reports joints whose two frames do not meet where the bodies are written, or after the others
    have moved to their positions.
    """
    table, named = joints.table, spec.joints or ()
    for i, joint in enumerate(named):
        gap = gap_of(table, state, i)
        # A joint that closes a loop need not be closed where the others are at 0.
        if table.row_of_joint[i] != engine.NONE and gap > CLOSED and not joint.brings_child:
            report(('joints', i), f'its frames in {shown(joint.parent)} and {shown(joint.child)} '
                   f'are {gap:.3g} m or rad apart where these bodies are written, must meet at '
                   'position 0: leave child_pose out, move a body, or write brings_child: true')
            return
    motion = joints_at_rest(table, joints.drives)
    work = make_joint_work(table)
    motion.position[:] = joints.position
    apart = (axis_groups(table) == engine.NONE).astype(np.int64)
    given, before = _given(named, table, apart), copy_state(state)
    gap = assemble(model, table, state, motion, work, joints.position, given)
    if not gap <= CLOSED and given.any():
        copy_into(state, before)
        given = apart
        gap = assemble(model, table, state, motion, work, joints.position, given)
    if not gap <= CLOSED:
        worst = max(range(len(named)), key=lambda i: gap_of(table, state, i))
        report(('joints', worst), f'does not close: its frames stay {gap:.3g} m or rad apart, '
               'must meet where the other joints are at their positions')
        return
    for i, joint in enumerate(named):
        _check_start(joint, joint_position(table, state, i, float(joints.position[i])),
                     below(('joints', i), report))
    velocity = joints.velocity
    if len(table.condition_joint) > 0 and not np.isnan(velocity).all():
        # Bodies move as written, as far as joints let them; of those joints that then get another
        # velocity, only loops and couplings tell others.
        set_rates(model, table, state, motion, work, np.full_like(velocity, np.nan))
        velocity = np.where((apart == 1) & np.isnan(velocity), motion.rate, velocity)
    set_rates(model, table, state, motion, work, velocity)


def _given(named: Sequence[schema.Joint], table: JointTable, apart: IntArray) -> IntArray:
    """
    Return (k,) 1 for axes that keep their position while others let loops close.

    Those are the axes whose position is written, and with a 1 in apart (k,) those that no loop
    and no coupling sees.
    """
    given = apart.copy()
    for k, j in enumerate(table.axis_joint):
        given[k] |= int(j != engine.NONE and named[j].position is not None)
    return given


def _check_start(joint: schema.Joint, position: float, here: Report) -> None:
    """Report a joint that others have taken beyond its limits."""
    lower, upper = joint.limits.range
    if joint.type in _ONE_AXIS and not lower - CLOSED <= position <= upper + CLOSED:
        here(('limits',), f'do not hold at the start: other joints take this one to '
             f'{position:.4g}, must be within, with other positions of these or other limits')


def gap_of(table: JointTable, state: State, j: int) -> float:
    """Return how far a joint is from being closed [m or rad]."""
    if table.kind[j] == engine.FREE:
        return 0.0
    if table.kind[j] == engine.DISTANCE:
        return abs(joint_distance(table, state, j)[0] - float(table.length[j]))
    return float(np.abs(joint_error(table, state, j)).max())
