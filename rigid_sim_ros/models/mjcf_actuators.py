# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The actuators of a compiled MuJoCo model become drives of joints.

An actuator with the gear g on a joint at q, and the control u, exerts there the effort
g (k u + b0 + b1 g q + b2 g dq/dt), where k is its gain and b its bias (MuJoCo, Computation,
Actuation model). Without bias it is a motor; with b0 = 0 and b1 < 0 it pulls towards a position
like a spring of stiffness -g^2 b1 with the damping -g^2 b2; with b1 = 0 and b2 < 0 it holds a
velocity with the gain -g^2 b2. These are what drives are; what has other terms, or a state of its
own, is none.

One that pulls a fixed tendon, of the length c q, has the gear g c at its joint; where the tendon
has several joints, all of which follow one, c is the sum of theirs, each times its multiplier.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigid_sim_ros.models.description import Joint
from rigid_sim_ros.models.findings import Findings
from rigid_sim_ros.models.xml_tree import Element


@dataclass
class _Drive:
    """What the actuators of one joint are together."""

    joint: Joint
    stiffness: float | None = None
    damping: float = 0.0
    gain: float | None = None
    position: float | None = None
    effort: float = 0.0     # the most that all may exert, or infinite
    kinds: tuple[str, ...] = ()


def read_actuators(mujoco: Any, m: Any, joints: Mapping[int, Joint],
                   place: Callable[[str], Element], findings: Findings) -> None:
    """
    Write the drives that actuators are to joints with one axis, by their rows in MuJoCo.

    `place` gives where an actuator with a name stands. Those that are no drives have a line each.
    """
    drives: dict[int, _Drive] = {}
    for i in range(len(m.actuator_trntype)):
        name = str(m.actuator(i).name) or f'actuator{i}'
        row, lever = _end(mujoco, m, i, joints)
        why = _add(mujoco, m, i, joints.get(row), row, lever * float(m.actuator_gear[i][0]),
                   drives)
        if why:
            findings.ignore(place(name), f'actuator {name[:60]!r}', why)
    for drive in drives.values():
        _write(drive)


def _end(mujoco: Any, m: Any, i: int, joints: Mapping[int, Joint]) -> tuple[int, float]:
    """Return the row of the joint on which an actuator acts, -1 for none, and its lever there."""
    kind, row = int(m.actuator_trntype[i]), int(m.actuator_trnid[i][0])
    names = mujoco.mjtTrn
    if kind in (int(names.mjTRN_JOINT), int(names.mjTRN_JOINTINPARENT)):
        return row, 1.0
    if kind != int(names.mjTRN_TENDON):
        return -1, 0.0
    rows, ends = {joint.name: row for row, joint in joints.items()}, set[int]()
    lever, first = 0.0, int(m.tendon_adr[row])
    for k in range(first, first + int(m.tendon_num[row])):
        if int(m.wrap_type[k]) != int(mujoco.mjtWrap.mjWRAP_JOINT):
            return -1, 0.0
        at, share = int(m.wrap_objid[k]), float(m.wrap_prm[k])
        follows = joints[at].mimic if at in joints else None
        if follows is not None and follows.offset == 0.0:
            at, share = rows[follows.joint], share * follows.multiplier
        ends.add(at)
        lever += share
    return (ends.pop(), lever) if len(ends) == 1 else (-1, 0.0)


def _add(mujoco: Any, m: Any, i: int, joint: Joint | None, row: int, g: float,
         drives: dict[int, _Drive]) -> str:
    """Add an actuator with the gear g to the drive of its joint, or return why it cannot be."""
    if joint is None:
        return 'it acts on no joint with one axis'
    if int(_of(m, 'actuator_group', i)) in _disabled(m):
        return 'its group is disabled'
    terms = _terms(mujoco, m, i)
    if terms is None or g == 0.0:
        return 'it is no motor, and no servo of a position or a velocity'
    k, b1, b2 = terms
    kind = 'position' if b1 < 0.0 else 'velocity' if b2 < 0.0 else 'effort'
    drive = drives.setdefault(row, _Drive(joint))
    if kind in drive.kinds:
        return f'{joint.name!r} has another one of the mode {kind}'
    drive.kinds += (kind,)
    # Reflected by the gear: of what turns g times as fast.
    joint.armature += g * g * float(_of(m, 'actuator_armature', i))
    joint.damping += g * g * float(_of(m, 'actuator_damping', i))
    low, high = _range(m, i)
    if kind == 'position':
        drive.stiffness, drive.damping = -g * g * b1, drive.damping - g * g * b2
        zero = float(m.qpos0[int(m.jnt_qposadr[row])])
        # The control is 0 at first, or what is nearest to it.
        drive.position = -k / (b1 * g) * min(max(0.0, low), high) - zero
    elif kind == 'velocity':
        drive.gain = -g * g * b2
        drive.damping += drive.gain
    bounds = [abs(float(bound)) for bound in m.actuator_forcerange[i]] if bool(
        m.actuator_forcelimited[i]) else [np.inf]
    if kind == 'effort':
        bounds.append(abs(k) * max(abs(low), abs(high)))
    drive.effort += abs(g) * min(bounds)
    return ''


def _terms(mujoco: Any, m: Any, i: int) -> tuple[float, float, float] | None:
    """Return the gain and the bias of an actuator on length and velocity; None for others."""
    is_plain = (int(m.actuator_dyntype[i]) == int(mujoco.mjtDyn.mjDYN_NONE)
                and int(m.actuator_gaintype[i]) == int(mujoco.mjtGain.mjGAIN_FIXED)
                and int(_of(m, 'actuator_plugin', i, -1)) < 0
                and not float(_of(m, 'actuator_delay', i))
                and not np.any(_of(m, 'actuator_dampingpoly', i)))
    k = float(m.actuator_gainprm[i][0])
    if not is_plain or k == 0.0:
        return None
    if int(m.actuator_biastype[i]) == int(mujoco.mjtBias.mjBIAS_NONE):
        return k, 0.0, 0.0
    b0, b1, b2 = (float(value) for value in m.actuator_biasprm[i][:3])
    if int(m.actuator_biastype[i]) != int(mujoco.mjtBias.mjBIAS_AFFINE) or (
            b0 != 0.0 or b1 > 0.0 or b2 > 0.0):
        return None
    return k, b1, b2


def _disabled(m: Any) -> set[int]:
    """Return the groups of actuators that do nothing; a bit for each."""
    return {group for group in range(31) if int(m.opt.disableactuator) >> group & 1}


def _range(m: Any, i: int) -> tuple[float, float]:
    """Return the bounds of the control."""
    if not m.actuator_ctrllimited[i]:
        return -np.inf, np.inf
    low, high = m.actuator_ctrlrange[int(_of(m, 'actuator_ctrladr', i, i))]
    return float(low), float(high)


def _of(m: Any, name: str, i: int, default: float = 0.0) -> Any:
    """Return a field that not every version of MuJoCo has."""
    values: Sequence[Any] | None = getattr(m, name, None)
    return default if values is None else values[i]


def _write(drive: _Drive) -> None:
    """Write a drive to its joint, as a scene has it."""
    joint = drive.joint
    mode = next(mode for mode in ('position', 'velocity', 'effort') if mode in drive.kinds)
    made: dict[str, Any] = {'mode': mode}
    if drive.stiffness is not None:
        made |= {'stiffness': drive.stiffness, 'damping': drive.damping,
                 'position': drive.position}
    if drive.gain is not None:
        made['gain'] = drive.gain
    joint.drive = made
    if np.isfinite(drive.effort):
        joint.effort = drive.effort if joint.effort is None else min(joint.effort, drive.effort)
