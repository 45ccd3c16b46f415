# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What changes of joints while a world moves, and the scratch memory of a step."""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.maths.spatial import SIZE
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.kernels.arrays import Array, IntArray

EFFORT, VELOCITY, POSITION = range(3)       # modes of a drive
PAST = 3        # steps whose curvature is remembered


class Drives(NamedTuple):
    """What the drives are told, along each axis (k,); translations in m and N."""

    mode: IntArray          # EFFORT, VELOCITY or POSITION
    stiffness: Array        # [N m/rad] 0 but in the mode POSITION
    damping: Array          # [N m s/rad] 0 in the mode EFFORT
    position: Array         # wanted [rad]
    velocity: Array         # wanted [rad/s]
    effort: Array           # constant [N m]
    steps_left: IntArray    # for which the command holds; LASTS until another one is given


LASTS = -1


class JointMotion(NamedTuple):
    """The dynamic state of joints beside that of their bodies, and what the latest step did."""

    position: Array     # (j,) [rad] or [m], whole turns counted; of a joint with one coordinate
    rate: Array         # (k,) velocities along the axes [rad/s] or [m/s]
    # (3, r, 6) latest first: the relative motion (c / h) that the joint conditions needed at the
    # start of a step so that they held at its end
    curvature: Array
    known: IntArray     # (2,) how many of these are known, and steps since a step was halved
    parts: IntArray     # (1,) in how many parts a step is taken at present, a power of 2
    held: IntArray      # (k,) 1: stuck by dry friction
    held_at: Array      # (k,) position where it stuck
    drives: Drives
    effort: Array       # (k,) of drive and spring, mean over the latest step
    wrench: Array       # (j, 6) force and moment on the child in its frame K, likewise


class JointWork(NamedTuple):
    """Scratch memory; vectors in world axes, motions and forces about the reference points."""

    p: Array        # (r, 3) reference points: the frame K of the child
    arm: Array      # (r, 3) from the reference point of the parent
    com: Array      # (r, 3) from the reference point to the centre of mass
    I_W: Array      # (r, 6) inertia about the centre of mass, upper triangle
    A: Array        # (r, SIZE) articulated inertia
    s: Array        # (k, 3) the axes
    U: Array        # (k, 6) A s
    inv_D: Array    # (k,) 1 / (s . U + extra); 0 for an axis that is locked
    extra: Array    # (k,) what armature and implicit forces add
    tau: Array      # (k,) impulse along the axis
    locked: IntArray    # (k,) 1: the rate is given
    given: Array    # (k,) that rate
    rate: Array     # (k,) rate that a solution gives
    F: Array        # (r, 6) impulses on the bodies, then what the subtrees hand down
    c: Array        # (r, 6) relative motion that is asked for beside that along the axes
    V: Array        # (r, 6) motion of the bodies
    base: Array     # (r, 6) motion of what a row hangs on, at its reference point
    error: Array    # (r, 6) of the joints' conditions
    curved: Array   # (r, 6) c / h of the present step
    x: Array        # (r, 3) poses at the start of the substep
    q: Array        # (r, 4)
    wrench: Array   # (r, 6) impulse through the joint of a row on its body


def make_joint_work(table: JointTable) -> JointWork:
    """Return scratch memory for the joints of a table."""
    r, k = len(table.body), len(table.translates)
    z = np.zeros
    return JointWork(
        z((r, 3)), z((r, 3)), z((r, 3)), z((r, 6)), z((r, SIZE)), z((k, 3)), z((k, 6)), z(k),
        z(k), z(k), z(k, dtype=np.int64), z(k), z(k), z((r, 6)), z((r, 6)), z((r, 6)), z((r, 6)),
        z((r, 6)), z((r, 6)), z((r, 3)), z((r, 4)), z((r, 6)))


def no_drives(table: JointTable) -> Drives:
    """Return drives that exert nothing."""
    k = len(table.translates)
    return Drives(np.zeros(k, dtype=np.int64), *(np.zeros(k) for _ in range(5)),
                  np.full(k, LASTS, dtype=np.int64))


def joints_at_rest(table: JointTable, drives: Drives) -> JointMotion:
    """Return the state of joints at position and velocity 0, with nothing known of the past."""
    j, k, r = len(table.kind), len(table.translates), len(table.body)
    return JointMotion(
        np.zeros(j), np.zeros(k), np.zeros((PAST, r, 6)), np.zeros(2, dtype=np.int64),
        np.ones(1, dtype=np.int64), np.zeros(k, dtype=np.int64), np.zeros(k), drives, np.zeros(k),
        np.zeros((j, 6)))
