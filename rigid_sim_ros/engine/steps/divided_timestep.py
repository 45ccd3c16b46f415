# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How a step of the model `timestep` is divided where joints hold bodies and others not, or sleep.

What touches nothing that joints hold, directly or through others, moves as in a world without
joints (timestep.py), and the rest by the solver that knows them (jointed_timestep.py). Both begin
at the same state, neither has to do with the bodies of the other, and none of these is near enough
for either to reach it. Which body belongs where follows in each step from
what detection finds, how fast that comes nearer, and from the forces of the scene between bodies:
how fast all fly by together does not matter. What sleeps belongs to neither: both see it as if
nothing could push it, and the solver with joints has only those articulations that are awake.
"""

from typing import NamedTuple

from rigid_sim_ros.engine.detection.manifold_rows import pack_rows
from rigid_sim_ros.engine.detection.manifolds import (
    current, Manifolds, Memory, point_of_feature, POINTS, rows_in_use, smallest_gap, step_impulses,
    StepImpulses)
from rigid_sim_ros.engine.dynamics.wrenches import Wrenches
from rigid_sim_ros.engine.joints.buffers import JointMotion
from rigid_sim_ros.engine.joints.part import Part, put_back, take_out
from rigid_sim_ros.engine.maths.rotation import quaternion
from rigid_sim_ros.engine.maths.union_find import first_of, unite
from rigid_sim_ros.engine.maths.vector import column, norm, scale, subtract
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.engine.model.model import Model, WORLD
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.solver.arguments import Arguments
from rigid_sim_ros.engine.solver.joint_rest import mark_told
from rigid_sim_ros.engine.solver.parallel_detection import take_sides_of
from rigid_sim_ros.engine.solver.sleeping import (
    fall_asleep, keep_awake, keep_pressing, Rest, wake_touched)
from rigid_sim_ros.engine.state.rates import spin_of
from rigid_sim_ros.engine.state.state import copy_body, copy_into, State
from rigid_sim_ros.engine.steps.articulated import end_command
from rigid_sim_ros.engine.steps.jointed_contact import CALLED
from rigid_sim_ros.engine.steps.timestep import may_sleep
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import INDEX, kernel


class StartedMotion(NamedTuple):
    """What a step changes of joints, and the next one needs, as it was when the step began."""

    position: Array  # (j,) [rad or m]
    rate: Array  # (k,) [rad/s or m/s]
    held: IntArray  # (k,)
    held_at: Array  # (k,)


class Division(NamedTuple):
    """What both solvers have of a world, whose models and shapes are for `divide` to write."""

    free: Arguments  # its state and its wrenches are those of the world
    # --- what the solver with joints has of its own
    model: Model
    state: State
    wrenches: Wrenches
    shapes: Shapes
    memory: Memory
    elsewhere: IntArray  # (n,) 1: the other solver moves the body; CALLED: it is met here
    looked: Array  # (s,) [m] how far shapes go in the step, as was known when it was divided
    part: Part  # of the joints
    # --- of the world
    table: JointTable  # of all joints
    motion: JointMotion
    started: StartedMotion
    told: Array  # (TOLD, k) see joint_rest.py
    inv_m: Array  # (n,) [1/kg] of all bodies
    inv_I_C: Array  # (3, n) [1/(kg m^2)] of all bodies
    has_joints: IntArray  # (n,) 1: awake, and belongs to an island with joints
    awake: IntArray  # (a,) 1: an articulation that is awake
    parent: IntArray  # (n,) scratch: which bodies hang together
    marked: IntArray  # (n,) scratch: 1 for the first body of an island with joints


# What `run` does: before any step, at three moments of each, and where bodies are called.
COMMANDS, DIVIDE, BEGIN, MERGE, TAKE_CALLED = range(5)


@kernel
def run(d: Division, what: int) -> int:
    """
    Do a part of what divides steps: one kernel, or some would be compiled in the midst of a run.

    Of DIVIDE returns 1 if other articulations are awake than before, else 0.
    """
    if what == COMMANDS:
        if may_sleep(d.free):
            mark_told(d.table, d.motion, d.told, d.free.rest)
    elif what == DIVIDE:
        return 1 if divide(d) else 0
    elif what == BEGIN:
        take_out(d.part, d.motion)
    elif what == TAKE_CALLED:
        take_called(d)
    else:
        merge(d)
    return 0


@kernel
def divide(d: Division) -> bool:
    """
    Find which bodies belong to islands with joints, and give either solver its own.

    Returns whether other articulations are awake than before.
    """
    if may_sleep(d.free):
        _wake_touched(d.free)
    others = _note_awake(d.table, d.free.rest, d.awake)
    _unite_islands(d)
    _give(d, _mark_islands(d))
    for s in range(d.looked.shape[0]):
        d.looked[s] = d.free.memory.margin[s]
    copy_into(d.state, d.free.state)
    _copy_wrenches(d.wrenches, d.free.wrenches)
    _copy_motion(d.started, d.motion)
    return others


@kernel
def take_called(d: Division) -> None:
    """
    Give the solver with joints what it met though it was elsewhere, with all its island.

    It begins the step anew, with the state that all bodies had then.
    """
    for i in range(d.elsewhere.shape[0]):
        if d.elsewhere[i] == CALLED:
            d.marked[first_of(d.parent, i)] = 1
    for i in range(d.elsewhere.shape[0]):
        if d.marked[first_of(d.parent, i)] == 1:
            d.has_joints[i] = 1
    _give(d, True)
    copy_into(d.state, d.free.state)
    _copy_motion(d.motion, d.started)
    take_out(d.part, d.motion)
    d.motion.known[0] = d.motion.known[1] = 0


@kernel
def _copy_motion(target: StartedMotion | JointMotion, source: StartedMotion | JointMotion) -> None:
    for j in range(source.position.shape[0]):
        target.position[j] = source.position[j]
    for k in range(source.rate.shape[0]):
        target.rate[k] = source.rate[k]
        target.held[k], target.held_at[k] = source.held[k], source.held_at[k]


@kernel
def _give(d: Division, changed: bool) -> None:
    """Give either solver its bodies; `changed`: they are others than before."""
    n, mine = d.parent.shape[0], d.has_joints
    for i in range(n):
        _show(d.free.model, d, i, mine[i] == 0)
        _show(d.model, d, i, mine[i] == 1)
    if changed:
        for s in range(d.shapes.body.shape[0]):
            d.shapes.still[s] = 1 if d.model.inv_m[d.shapes.body[s]] == 0.0 else 0
        d.memory.pair_count[0] = -1   # as before the first step: pairs of other bodies
    _part_from_each_other(d)
    take_sides_of(d.free, (0, n))


@kernel
def _wake_touched(c: Arguments) -> None:
    wake_touched(c.model.h, c.model.inv_m, c.model.inv_I_C, c.state, c.work.radius, c.memory,
                 c.rest)


@kernel
def _note_awake(table: JointTable, rest: Rest, awake: IntArray) -> bool:
    """Note which articulations are awake, as a whole; return whether these are others."""
    others = False
    for g in range(awake.shape[0]):
        now = 0
        for r in range(table.first_row[g], table.first_row[g + 1]):
            now = max(now, 1 - rest.asleep[table.body[r]])
        for r in range(table.first_row[g], table.first_row[g + 1]):
            if now == 1 and rest.asleep[table.body[r]] == 1:
                keep_awake(rest, table.body[r])
        others = others or now != awake[g]
        awake[g] = now
    return others


@kernel
def _unite_islands(d: Division) -> None:
    """Unite the bodies that are awake and near each other, or between which a force acts."""
    model, manifolds = d.free.model, current(d.free.memory)
    for i in range(d.parent.shape[0]):
        d.parent[i] = i
    first, count = rows_in_use(manifolds)
    for k in range(count):
        r = (first + k) & INDEX
        a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
        if _both_move(d, a, b) and _may_meet(d, manifolds, r, a, b):
            unite(d.parent, a, b)
    forces = model.forces
    for r in range(forces.kind.shape[0]):
        frame_a, frame_b = forces.frame_a[r], forces.frame_b[r]
        if frame_a != WORLD and frame_b != WORLD:
            a, b = model.frame_body[frame_a], model.frame_body[frame_b]
            if _both_move(d, a, b):
                unite(d.parent, a, b)


@kernel
def _both_move(d: Division, a: int, b: int) -> bool:
    asleep = d.free.rest.asleep
    return bool(d.inv_m[a] > 0.0 and d.inv_m[b] > 0.0 and asleep[a] + asleep[b] == 0)


@kernel
def _may_meet(d: Division, manifolds: Manifolds, r: int, a: int, b: int) -> bool:
    """
    Return whether the shapes of a manifold are as near as they may come in the step, or nearly so.

    That is detection's rule (margins.py) with the velocity of one body against the other: of what
    detection finds it leaves out what only flies fast in company.
    """
    c = d.free
    v_a, w_a = _motion(d, a)
    v_b, w_b = _motion(d, b)
    way = c.model.h * (norm(subtract(v_a, v_b)) + c.work.radius[a] * norm(w_a)
                       + c.work.radius[b] * norm(w_b))
    margins = c.memory.rest_margin
    return bool(smallest_gap(manifolds, r)
                <= way + margins[manifolds.shape_a[r]] + margins[manifolds.shape_b[r]])


@kernel
def _motion(d: Division, i: int) -> tuple[Vector, Vector]:
    """Return v of the centre of mass [m/s] and w [rad/s] of a body that can be pushed."""
    state = d.free.state
    return (scale(d.inv_m[i], column(state.P, i)),
            spin_of(quaternion(state.q, i), column(state.L, i), column(d.inv_I_C, i)))


@kernel
def _part_from_each_other(d: Division) -> None:
    """Let neither solver have the manifolds between its bodies and those of the other."""
    mine, manifolds, touching = d.has_joints, current(d.free.memory), d.free.memory.touching
    for i in range(mine.shape[0]):
        moves = d.inv_m[i] > 0.0 and d.free.rest.asleep[i] == 0
        d.elsewhere[i] = 1 if moves and mine[i] == 0 else 0
    first, count = rows_in_use(manifolds)
    for k in range(count):
        r = (first + k) & INDEX
        a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
        if mine[a] != mine[b] and _both_move(d, a, b):
            manifolds.points[r] = 0
    pack_rows(manifolds)
    if manifolds.count[0] == count:
        return
    touching[:] = 0
    for k in range(manifolds.count[0]):
        r = (first + k) & INDEX
        touching[0, manifolds.body_a[r] & INDEX] = touching[0, manifolds.body_b[r] & INDEX] = 1


@kernel
def _mark_islands(d: Division) -> bool:
    """Mark the bodies of islands with joints; return whether these are others than before."""
    parent, marked, changed = d.parent, d.marked, False
    marked[:] = 0
    for i in d.table.body:
        if d.free.rest.asleep[i] == 0:
            marked[first_of(parent, i)] = 1
    for i in range(parent.shape[0]):
        now = marked[first_of(parent, i)]
        changed = changed or now != d.has_joints[i]
        d.has_joints[i] = now
    return changed


@kernel
def _show(model: Model, d: Division, i: int, moves: bool) -> None:
    """Let a solver push a body, if it can be pushed, or see it as one that nothing pushes."""
    model.inv_m[i] = d.inv_m[i] if moves else 0.0
    for k in range(3):
        model.inv_I_C[k, i] = d.inv_I_C[k, i] if moves else 0.0


@kernel
def _copy_wrenches(target: Wrenches, source: Wrenches) -> None:
    """Let both solvers have the wrenches of the step: each counts its own down."""
    target.in_use[0] = source.in_use[0]
    for r in range(source.in_use[0]):
        target.body[r], target.frame[r] = source.body[r], source.frame[r]
        target.at_point[r], target.steps_left[r] = source.at_point[r], source.steps_left[r]
        for k in range(3):
            target.force[r, k] = source.force[r, k]
            target.torque[r, k] = source.torque[r, k]
            target.point[r, k] = source.point[r, k]


@kernel
def merge(d: Division) -> None:
    """Bring both parts of a step together: the motion of bodies, and what pressed on what."""
    state, moved = d.free.state, d.state
    for i in range(d.has_joints.shape[0]):
        _show(d.free.model, d, i, True)
        if d.has_joints[i] == 1:
            copy_body(state, moved, i)
    put_back(d.part, d.motion)
    memory = d.free.memory
    _take_impulses(d.has_joints, current(memory), step_impulses(memory), current(d.memory))
    if may_sleep(d.free):
        _let_sleep(d)


@kernel
def _let_sleep(d: Division) -> None:
    """Let islands sleep that have been at rest for long enough, whoever solved them."""
    c, memory = d.free, d.free.memory
    for i in range(d.table.body.shape[0]):
        if c.rest.asleep[d.table.body[i]] == 1:
            for k in range(d.table.first_axis[i], d.table.first_axis[i + 1]):
                end_command(d.motion.drives, k)
    mark_told(d.table, d.motion, d.told, c.rest)
    keep_pressing(current(memory), c.work.solver.bodies.slot, c.rest, step_impulses(memory))
    fall_asleep(d.inv_m, d.inv_I_C, c.state, c.work.loads, c.work.radius, current(memory),
                c.settings.sleep_steps, c.rest)
    for i in range(d.table.body.shape[0]):
        if c.rest.asleep[d.table.body[i]] == 1:
            for k in range(d.table.first_axis[i], d.table.first_axis[i + 1]):
                d.motion.rate[k] = 0.0


@kernel
def _take_impulses(has_joints: IntArray, manifolds: Manifolds, acted: StepImpulses,
                   solved: Manifolds) -> None:
    """
    Write what the solver with joints found to the manifolds of the world.

    For those who ask, and to begin with where the joints let go. Both are in the order of their
    shapes. A point that is no longer there is the first one of its manifold.
    """
    first, count = rows_in_use(manifolds)
    at = 0
    for n in range(count):
        r = (first + n) & INDEX
        if has_joints[manifolds.body_a[r]] + has_joints[manifolds.body_b[r]] == 0:
            continue
        for j in range(POINTS):
            manifolds.impulse[j, r] = 0.0
        for i in range(3):
            manifolds.friction[r, i] = manifolds.roll[r, i] = 0.0
        manifolds.spin[r] = 0.0
        a, b = manifolds.shape_a[r], manifolds.shape_b[r]
        while at < solved.count[0] and (solved.shape_a[at] < a or (
                solved.shape_a[at] == a and solved.shape_b[at] < b)):
            at += 1
        if at < solved.count[0] and solved.shape_a[at] == a and solved.shape_b[at] == b:
            _take_row(manifolds, r, solved, at)
        for j in range(POINTS):
            acted.normal[j, r] = manifolds.impulse[j, r]
        for i in range(3):
            acted.friction[r, i] = manifolds.friction[r, i]


@kernel
def _take_row(manifolds: Manifolds, r: int, solved: Manifolds, at: int) -> None:
    for j in range(solved.points[at]):
        point = max(point_of_feature(manifolds, r, solved.feature[j, at]), 0)
        manifolds.impulse[point, r] += solved.impulse[j, at]
    for i in range(3):
        manifolds.friction[r, i] = solved.friction[at, i]
    manifolds.spin[r] = solved.spin[at]
