# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How a step of the model `timestep` is divided where joints hold some bodies and others not.

What touches nothing that joints hold, directly or through others, moves as in a world without
joints (timestep.py), and the rest by the solver that knows them (jointed_timestep.py). Both begin
at the same state, each sees the bodies of the other as if nothing could push them, and none of
these is near enough for either to reach it. Which body belongs where follows in each step from
what detection finds, and from the forces of the scene between bodies.
"""

from typing import NamedTuple

from rigid_sim_ros.engine.detection.manifolds import (
    current, earlier, Manifolds, POINTS, rows_in_use)
from rigid_sim_ros.engine.dynamics.wrenches import Wrenches
from rigid_sim_ros.engine.maths.union_find import first_of, unite
from rigid_sim_ros.engine.model.model import Model, WORLD
from rigid_sim_ros.engine.solver.arguments import Arguments
from rigid_sim_ros.engine.solver.parallel_detection import take_sides_of
from rigid_sim_ros.engine.solver.sleeping import keep_awake
from rigid_sim_ros.engine.state.state import copy_body, copy_into
from rigid_sim_ros.engine.steps.jointed_contact import JointedContact
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import INDEX, kernel


class Division(NamedTuple):
    """The arguments of both solvers, whose models and shapes are for `divide` to write."""

    free: Arguments  # its state and its wrenches are those of the world
    jointed: JointedContact
    inv_m: Array  # (n,) [1/kg] of all bodies
    inv_I_C: Array  # (3, n) [1/(kg m^2)] of all bodies
    has_joints: IntArray  # (n,) 1: belongs to an island with joints
    parent: IntArray  # (n,) scratch: which bodies hang together
    marked: IntArray  # (n,) scratch: 1 for the first body of an island with joints


@kernel
def divide(d: Division) -> None:
    """Find which bodies belong to islands with joints, and give either solver its own."""
    _unite_islands(d.free.model, d.inv_m, current(d.free.memory), d.parent)
    n, mine, memory = d.parent.shape[0], d.has_joints, d.jointed.memory
    changed = _mark_islands(d)
    for i in range(n):
        _show(d.free.model, d, i, mine[i] == 0)
        _show(d.jointed.joints.model, d, i, mine[i] == 1)
        if mine[i] == 1:
            keep_awake(d.free.rest, i)
    if changed:
        shapes = d.jointed.shapes
        for s in range(shapes.body.shape[0]):
            shapes.still[s] = 1 if d.jointed.joints.model.inv_m[shapes.body[s]] == 0.0 else 0
        memory.pair_count[0] = -1   # as before the first step: pairs are those of other bodies
    take_sides_of(d.free, (0, n))
    copy_into(d.jointed.joints.state, d.free.state)
    _copy_wrenches(d.jointed.joints.wrenches, d.free.wrenches)


@kernel
def _unite_islands(model: Model, inv_m: Array, manifolds: Manifolds, parent: IntArray) -> None:
    """Unite the moving bodies that are near each other, or between which a force acts."""
    for i in range(parent.shape[0]):
        parent[i] = i
    first, count = rows_in_use(manifolds)
    for k in range(count):
        r = (first + k) & INDEX
        _unite_moving(inv_m, parent, manifolds.body_a[r], manifolds.body_b[r])
    forces = model.forces
    for r in range(forces.kind.shape[0]):
        a, b = forces.frame_a[r], forces.frame_b[r]
        if a != WORLD and b != WORLD:
            _unite_moving(inv_m, parent, model.frame_body[a], model.frame_body[b])


@kernel
def _unite_moving(inv_m: Array, parent: IntArray, a: int, b: int) -> None:
    if inv_m[a] > 0.0 and inv_m[b] > 0.0:
        unite(parent, a, b)


@kernel
def _mark_islands(d: Division) -> bool:
    """Mark the bodies of islands with joints; return whether these are others than before."""
    parent, marked, changed = d.parent, d.marked, False
    marked[:] = 0
    for i in d.jointed.joints.table.body:
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
    state, moved = d.free.state, d.jointed.joints.state
    for i in range(d.has_joints.shape[0]):
        _show(d.free.model, d, i, True)
        if d.has_joints[i] == 1:
            copy_body(state, moved, i)
    memory = d.free.memory
    _take_impulses(d.has_joints, current(memory), earlier(memory), current(d.jointed.memory))


@kernel
def _take_impulses(has_joints: IntArray, manifolds: Manifolds, acted: Manifolds,
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
            acted.impulse[j, r] = manifolds.impulse[j, r]
        for i in range(3):
            acted.friction[r, i] = manifolds.friction[r, i]


@kernel
def _take_row(manifolds: Manifolds, r: int, solved: Manifolds, at: int) -> None:
    for j in range(solved.points[at]):
        point = 0
        for i in range(manifolds.points[r]):
            if manifolds.feature[i, r] == solved.feature[j, at]:
                point = i
        manifolds.impulse[point, r] += solved.impulse[j, at]
    for i in range(3):
        manifolds.friction[r, i] = solved.friction[at, i]
    manifolds.spin[r] = solved.spin[at]
