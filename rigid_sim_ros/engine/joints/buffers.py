# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What changes of joints while a world moves, and the scratch memory of a step."""

from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.dynamics.free_flight import BLOCK_SIZE
from rigid_sim_ros.engine.maths.spatial import SIZE
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.eight import LANES

EFFORT, VELOCITY, POSITION = range(3)       # modes of a drive
# [rad, or lengths of the articulation] Joints are closed to this. Ten times more would show in
# energies after a minute, ten times less cost one more round. Far from the origin it is a share of
# the distance: a joint is a difference of two positions, each rounded to 2^-53 of it, and of a
# quadruped 1 to 100 km away rounds of SHAKE were seen to leave 4 times that. What is asked for
# less is never reached.
TOLERANCE, ROUNDED = 1e-13, 8.0 * 2.0 ** -53
# Of an axis: its rate follows; its rate is given; the same, but it yields a little, where only
# that satisfies the conditions beside its tree.
UNLOCKED, LOCKED, STIFF = range(3)
# Bits of `AxisLaw.bound`: an axis whose limits are one position is at both.
AT_LOWER, AT_UPPER = 1, 2
# Places in `JointWork.known`: whether the factors, and what the axes feel, are of these poses, and
# the motions of the momenta with which the next half of a step begins; the stage of a step:
# 0 of one that has none, else 1 and more; whether the relative motions that joints will need are
# those of a way that was tried.
FACTORED, FELT, SOLVED, STAGE, FORESEEN = range(5)
PAST = 5        # steps whose curvature is remembered


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
    # (PAST, r, 6) latest first: the relative motion (c / h) that the joint conditions needed at
    # the start of a step so that they held at its end, and along its axes `LawWork.bent`; for
    # steps in stages as many more of each stage, see STAGE
    curvature: Array
    strain: Array       # (PAST, c) likewise of the conditions that close loops
    known: IntArray     # (2,) how many of these are known, and steps since a step was halved
    parts: IntArray     # (1,) in how many parts a step is taken at present, a power of 2
    held: IntArray      # (k,) 1: stuck by dry friction
    held_at: Array      # (k,) position where it stuck
    drives: Drives
    effort: Array       # (k,) of drive and spring, mean over the latest step
    wrench: Array       # (j, 6) force and moment on the child in its frame K, likewise


class LoopWork(NamedTuple):
    """Scratch memory for c conditions beside those of the tree, in g articulations."""

    direction: Array    # (c, 6) the row on the motion of B against A
    held_a: Array       # (c, 3) where A is held [m]
    held_b: Array       # (c, 3)
    answer: Array       # (c, most rows of an articulation, 6) M~^-1 C^T
    answer_rate: Array  # (c, most axes of an articulation) the same along the axes
    # (c, most axes of an articulation) what an impulse hands down along axes that are locked
    handed: Array
    S: Array            # (c, most conditions of an articulation) C M~^-1 C^T, then its factor
    free: Array         # (c,) the diagonal of S if the bodies were free, or their axes
    scale: Array        # (c,) of the factor
    order: IntArray     # (c,)
    rank: IntArray      # (g,)
    wanted: Array       # (c,) C V
    missing: Array      # (c,)
    impulse: Array      # (c,) of one correction
    total: Array        # (c,) of all in a step
    off: Array          # (c,) how far the condition is from being kept [m or rad]
    curved: Array       # (c,) wanted / h of the present step


class LawWork(NamedTuple):
    """
    What acts along each axis (k,), in half a step, as impulses over the rate v at its end.

    a - b v, and clamp(u - g v, -E, E) of a drive, and dry friction up to F; see `laws.py`.
    """

    a: Array
    b: Array
    u: Array
    g: Array
    E: Array
    F: Array
    low: Array      # the rate must not be below this
    high: Array     # nor above this
    bend: Array     # way of the position in a step less h v, over h: what the rate does not say
    # (k,) the same where what acts goes by the way itself, see `follows_way`; 0 else
    bent: Array
    stick: Array    # where dry friction holds: the rate with which the position stays
    fast: Array     # beyond which the drive does not accelerate, in both senses
    brakes: IntArray    # (k,) 1: there it holds the joint back
    begin: Array    # the straight piece that the rate is on goes from here
    end: Array      # to here
    before: Array   # position at the start of the step
    left_at: Array  # position then without whole turns, which would round it; see `follows_way`
    target: Array   # position that a locked axis is to have at the end of the step; inf: none
    bound: IntArray     # (k,) AT_LOWER, AT_UPPER: at which limits it is at the end of the step
    approach: Array     # rate with which it would have passed it
    back: Array         # rate with which it comes back from there
    share: Array        # of its rate with which an axis that has just met a limit comes back
    met: IntArray       # (k,) AT_LOWER, AT_UPPER: which limit that is
    astray: Array       # way from there of a locked axis
    half_rate: Array    # rate between the two halves of a step
    half_effort: Array  # impulse of drive and spring in the first half of the step
    effort: Array       # and in the whole step
    tau: Array          # what `JointWork.tau` and `given` hold for the pieces
    given: Array
    lock: IntArray      # how the axis is locked: STIFF in an articulation with conditions
    held: IntArray      # what `JointMotion` had of these at the start of the step
    held_at: Array


class AnswerWork(NamedTuple):
    """Scratch memory for answers to eight impulses at once; rows of eight numbers."""

    wanted: IntArray    # (r,) 1: the motion of the row, or of one that hangs on it, is asked for
    F: Array        # (6 r,) impulses on the bodies, then what the subtrees hand down
    tau: Array      # (k,) impulses along the axes
    V: Array        # (6 r,) motions
    rate: Array     # (k,) along the axes


class StartWork(NamedTuple):
    """Scratch memory: what `JointMotion` had of these as a part of a step began, in stages."""

    position: Array
    rate: Array
    effort: Array
    wrench: Array


class JointWork(NamedTuple):
    """Scratch memory; vectors in world axes, motions and forces about the reference points."""

    p: Array        # (r, 3) reference points: the frame K of the child
    arm: Array      # (r, 3) from the reference point of the parent
    com: Array      # (r, 3) from the reference point to the centre of mass
    I_W: Array      # (r, 6) inertia about the centre of mass, upper triangle
    A: Array        # (r, SIZE) articulated inertia
    s: Array        # (k, 3) the axes
    U: Array        # (k, 6) A s
    inv_D: Array    # (k,) 1 / (s . U + extra); 0 for an axis that is LOCKED
    extra: Array    # (k,) what armature and implicit forces add
    tau: Array      # (k,) impulse along the axis
    # (a,) [m] of each articulation: its longest lever, or radius of gyration of a body. What
    # joints are off in metres counts as an angle on that lever, whatever size all is of.
    length: Array
    tolerance: Array    # (a,) [rad] to which joints are closed at the present poses
    unit: Array     # (k,) 1 [rad], or that length [m], in which positions along an axis are told
    near: Array     # (k,) [rad or m] the tolerance in that unit
    known: IntArray     # (5,) see FACTORED
    factored_locked: IntArray   # (k,) what `locked` and `extra` were when A, U, D were written
    factored_extra: Array       # (k,)
    locked: IntArray    # (k,) UNLOCKED, LOCKED or STIFF
    given: Array    # (k,) that rate
    rate: Array     # (k,) rate that a solution gives
    F: Array        # (r, 6) impulses on the bodies, then what the subtrees hand down
    c: Array        # (r, 6) relative motion that is asked for beside that along the axes
    V: Array        # (r, 6) motion of the bodies
    base: Array     # (r, 6) motion of what a row hangs on, at its reference point
    error: Array    # (r, 6) of the joints' conditions
    # (2,) of the articulation measured last: the squares of the largest way [m] and angle [rad]
    # in `error`
    largest: Array
    curved: Array   # (r, 6) c / h of the present step
    x: Array        # (r, 3) poses at the start of the substep
    q: Array        # (r, 4)
    answer: Array   # (r, SIZE) of a body to a force, with the motion of what it hangs on
    felt: Array     # (k,) inertia that the axes feel, with that of their armatures
    before: Array   # (r, 6) momenta before the joints act
    block: Array    # for `drift_from`
    unresolved: IntArray    # (1,) parts of steps, too long for their motion, since the start
    loop: LoopWork
    law: LawWork
    answers: AnswerWork
    start: StartWork


def make_joint_work(table: JointTable) -> JointWork:
    """Return scratch memory for the joints of a table."""
    j, r, k = len(table.kind), len(table.body), len(table.translates)
    a, z = len(table.first_row) - 1, np.zeros
    return JointWork(
        z((r, 3)), z((r, 3)), z((r, 3)), z((r, 6)), z((r, SIZE)), z((k, 3)), z((k, 6)), z(k),
        z(k), z(k), z(a), z(a), z(k), z(k), z(5, dtype=np.int64), z(k, dtype=np.int64), z(k),
        z(k, dtype=np.int64), z(k), z(k), z((r, 6)), z((r, 6)), z((r, 6)), z((r, 6)), z((r, 6)),
        z(2), z((r, 6)), z((r, 3)), z((r, 4)), z((r, SIZE)), z(k), z((r, 6)), z(BLOCK_SIZE),
        z(1, dtype=np.int64), _loop_work(table), _law_work(table),
        AnswerWork(z(r, dtype=np.int64), z(6 * LANES * r), z(LANES * k), z(6 * LANES * r),
                   z(LANES * k)),
        StartWork(z(j), z(k), z(k), z((j, 6))))


def _loop_work(table: JointTable) -> LoopWork:
    c, z = len(table.condition_joint), np.zeros
    rows, conditions = np.diff(table.first_row), np.diff(table.first_condition)
    axes = np.diff(table.first_axis[table.first_row])
    most = [int(counts.max(initial=0)) for counts in (rows, axes, conditions)]
    return LoopWork(
        z((c, 6)), z((c, 3)), z((c, 3)), z((c, most[0], 6)), z((c, most[1])), z((c, most[1])),
        z((c, most[2])),
        z(c), z(c), z(c, dtype=np.int64), z(len(rows), dtype=np.int64), *(z(c) for _ in range(6)))


def _law_work(table: JointTable) -> LawWork:
    k, whole = len(table.translates), ('brakes', 'bound', 'met', 'held', 'lock')
    arrays: list[Any] = [np.zeros(k, dtype=np.int64 if name in whole else np.float64)
                         for name in LawWork._fields]
    work = LawWork._make(arrays)
    conditions = np.repeat(np.diff(table.first_condition),
                           np.diff(table.first_axis[table.first_row]))
    work.lock[:] = np.where(conditions > 0, STIFF, LOCKED)
    return work


def no_drives(table: JointTable) -> Drives:
    """Return drives that exert nothing."""
    k = len(table.translates)
    return Drives(np.zeros(k, dtype=np.int64), np.zeros(k), np.zeros(k), np.zeros(k), np.zeros(k),
                  np.zeros(k), np.full(k, LASTS, dtype=np.int64))


def joints_at_rest(table: JointTable, drives: Drives, stages: int = 0) -> JointMotion:
    """
    Return the state of joints at position and velocity 0, with nothing known of the past.

    Of steps in so many stages, 0 for those that have none.
    """
    j, k, r, past = len(table.kind), len(table.translates), len(table.body), PAST + stages * PAST
    return JointMotion(
        np.zeros(j), np.zeros(k), np.zeros((past, r, 6)),
        np.zeros((past, len(table.condition_joint))), np.zeros(2, dtype=np.int64),
        np.ones(1, dtype=np.int64), np.zeros(k, dtype=np.int64), np.zeros(k), drives, np.zeros(k),
        np.zeros((j, 6)))
