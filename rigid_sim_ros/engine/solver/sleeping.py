# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Bodies that came to rest sleep: they stay where they are and cost the solver nothing.

Bodies that press against each other form an island, and those that joints hold together or
between which a force of the scene acts, through any number of others but not through the fixed
ones. It falls asleep when all its bodies have been slower than SLOW for as long as the scene says,
and wakes as a whole when one of them gets a wrench, when the load on one changes, when somebody
changes its pose or its velocity, when a body that nothing pushes moves and may touch it or is
joined to it, or when a body that is awake comes so near that it may touch in this step. What
drives do for it is in joint_rest.py. All that decides is in `Rest`, part of the dynamic state of a
world.
"""

import math

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.detection.manifolds import (
    current, Manifolds, Memory, rows_in_use, smallest_gap, StepImpulses)
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.dynamics.kinematic import is_carried
from rigid_sim_ros.engine.dynamics.wrenches import Wrenches
from rigid_sim_ros.engine.maths.union_find import first_of, unite
from rigid_sim_ros.engine.maths.vector import column, norm
from rigid_sim_ros.engine.model.joints import FREE, JointTable
from rigid_sim_ros.engine.model.model import Model, WORLD
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import INDEX, kernel

# [m/s] a body is at rest when its centre and the farthest point of its surface are slower.
SLOW = 0.01
# Part of a body's weight by which its load may change without waking it; torques by as much as
# that does at the end of the body's reach.
STEADY = 1e-3
# [m] an awake body wakes what it comes this near to, beyond what it moves in a step.
NEAR = 1e-4


class Rest(NamedTuple):
    """How long the n bodies have been at rest, and how those lie that sleep."""

    steps: IntArray  # (n,) at rest without a break
    asleep: IntArray  # (n,) 1 for a body that sleeps
    pose: Array  # (7, n) x and q of all bodies after the latest step
    load: Array  # (6, n) force [N] and torque [N m] when a body fell asleep
    island: IntArray  # (n,) scratch: the first body of the island
    linked: IntArray  # (l, 2) constant: bodies that joints or forces of the scene tie together


def no_rest(n: int, linked: IntArray) -> Rest:
    """Return that of n bodies before the first step; `linked` is what `linked_bodies` returns."""
    return Rest(np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64), np.zeros((7, n)),
                np.zeros((6, n)), np.zeros(n, dtype=np.int64), linked)


def linked_bodies(model: Model, table: JointTable | None) -> IntArray:
    """Return the pairs of bodies that joints hold together or between which forces act, (l, 2)."""
    ends = zip(model.forces.frame_a.tolist(), model.forces.frame_b.tolist(), strict=True)
    pairs = [(int(model.frame_body[a]), int(model.frame_body[b])) for a, b in ends
             if WORLD not in (a, b)]
    if table is not None:
        pairs += [(a, b) for kind, a, b in zip(
            table.kind.tolist(), table.body_a.tolist(), table.body_b.tolist(), strict=True)
            if kind != FREE and WORLD not in (a, b)]
        # Joints may be coupled without a body in common.
        first = table.body[table.first_row[:-1]].repeat(np.diff(table.first_row))
        pairs += zip(first.tolist(), table.body.tolist(), strict=True)
    return np.array(sorted({(a, b) for a, b in pairs if a != b}), dtype=np.int64).reshape(-1, 2)


@kernel
def mark_pushed(wrenches: Wrenches, rest: Rest) -> None:
    """Let bodies that a wrench acts on begin to rest anew; -1 for `wake_disturbed` to see it."""
    for r in range(wrenches.in_use[0]):
        rest.steps[wrenches.body[r]] = -1


@kernel
def wake_disturbed(model: Model, state: State, loads: Loads, radius: Array, manifolds: Manifolds,
                   rest: Rest) -> None:
    """Wake the islands in which a body was pushed, moved or loaded otherwise than before."""
    woken, inv_m = False, model.inv_m
    for i in range(inv_m.shape[0]):
        moved = False
        for k in range(3):
            moved = moved or state.x[k, i] != rest.pose[k, i]
        for k in range(4):
            moved = moved or state.q[k, i] != rest.pose[3 + k, i]
        moved = moved or is_carried(state, i)
        if inv_m[i] == 0.0:
            # What lies on a body that was moved, or is about to move, loses its rest.
            rest.island[i] = 1 if moved else 0
            woken = woken or moved
            continue
        rest.island[i] = 0
        if rest.asleep[i] == 0:
            continue
        for k in range(3):
            moved = moved or state.P[k, i] != 0.0 or state.L[k, i] != 0.0
        if moved or _is_loaded_anew(model, loads, radius, rest, i):
            rest.asleep[i], rest.steps[i], woken = 0, 0, True
    for i in range(inv_m.shape[0]):
        if rest.steps[i] < 0:
            rest.steps[i] = 0
            if rest.asleep[i] == 1:
                rest.asleep[i], woken = 0, True
    first, count = rows_in_use(manifolds)
    for r in range(first, first + count if woken else first):
        _wake_by_moved(inv_m, rest, manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX)
    for r in range(rest.linked.shape[0] if woken else 0):
        _wake_by_moved(inv_m, rest, rest.linked[r, 0], rest.linked[r, 1])
    if woken:
        _wake_neighbours(inv_m, manifolds, rest)


@kernel
def _is_loaded_anew(model: Model, loads: Loads, radius: Array, rest: Rest, i: int) -> bool:
    """Return whether a body bears another load than when it fell asleep."""
    # Of what hangs on a spring the load is none, and not its weight.
    weight = model.m[i] * norm((model.gravity[0], model.gravity[1], model.gravity[2]))
    for k in range(3):
        weight = max(weight, abs(rest.load[k, i]))
    turned = 0.0
    for k in range(3):
        if abs(loads.F[k, i] - rest.load[k, i]) > STEADY * weight:
            return True
        turned = max(turned, abs(loads.tau[k, i] - rest.load[3 + k, i]))
    return turned > 0.0 and turned > STEADY * weight * _reach(
        model.inv_m, model.inv_I_C, radius, i)


@kernel
def _wake_by_moved(inv_m: Array, rest: Rest, a: int, b: int) -> None:
    """Wake either body if the other one is such that nothing pushes it, and was moved."""
    if inv_m[a] == 0.0 and rest.island[a] == 1:
        _wake(rest, b)
    if inv_m[b] == 0.0 and rest.island[b] == 1:
        _wake(rest, a)


@kernel
def wake_touched(h: float, inv_m: Array, inv_I_C: Array, state: State, radius: Array,
                 memory: Memory, rest: Rest) -> None:
    """
    Wake the islands that an awake body may touch within h [s], or one that it may throw.

    What is thrown goes as far as its margin says; see thrown_margins.py.
    """
    manifolds, woken, again = current(memory), False, True
    first, count = rows_in_use(manifolds)
    while again:
        again = False
        for r in range(first, first + count):
            a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
            if rest.asleep[a] == rest.asleep[b] or inv_m[a] == 0.0 or inv_m[b] == 0.0:
                continue
            awake = b if rest.asleep[a] == 1 else a
            s = manifolds.shape_b[r] if awake == b else manifolds.shape_a[r]
            way = max(_speed(inv_m, inv_I_C, state, radius, awake) * h,
                      memory.margin[s] - memory.rest_margin[s])
            if smallest_gap(manifolds, r) < NEAR + way:
                _wake(rest, a)
                _wake(rest, b)
                woken = again = True
    if woken:
        _wake_neighbours(inv_m, manifolds, rest)


@kernel
def _wake(rest: Rest, i: int) -> None:
    if rest.asleep[i] == 1:
        keep_awake(rest, i)


@kernel
def keep_awake(rest: Rest, i: int) -> None:
    """Let body i be awake, and begin to rest anew."""
    rest.asleep[i], rest.steps[i] = 0, 0


@kernel
def _wake_neighbours(inv_m: Array, manifolds: Manifolds, rest: Rest) -> None:
    """Wake whatever presses against an awake body or is tied to one, until nothing is."""
    first, count = rows_in_use(manifolds)
    again = True
    while again:
        again = False
        for r in range(first, first + count):
            a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
            if _differ(inv_m, rest, a, b) and _press(manifolds, r):
                _wake(rest, a)
                _wake(rest, b)
                again = True
        for r in range(rest.linked.shape[0]):
            a, b = rest.linked[r, 0], rest.linked[r, 1]
            if _differ(inv_m, rest, a, b):
                _wake(rest, a)
                _wake(rest, b)
                again = True


@kernel
def _differ(inv_m: Array, rest: Rest, a: int, b: int) -> bool:
    """Return whether of two bodies that move one sleeps and one does not."""
    return rest.asleep[a] != rest.asleep[b] and inv_m[a] > 0.0 and inv_m[b] > 0.0


@kernel
def _press(manifolds: Manifolds, r: int) -> bool:
    for p in range(manifolds.points[r]):
        if manifolds.impulse[p, r] > 0.0:
            return True
    return False


@kernel
def _speed(inv_m: Array, inv_I_C: Array, state: State, radius: Array, i: int) -> float:
    """Return a bound of the speed of any point of a body [m/s]."""
    spin = max(inv_I_C[0, i], inv_I_C[1, i], inv_I_C[2, i]) * norm(column(state.L, i))
    return inv_m[i] * norm(column(state.P, i)) + _reach(inv_m, inv_I_C, radius, i) * spin


@kernel
def _reach(inv_m: Array, inv_I_C: Array, radius: Array, i: int) -> float:
    """
    Return how far a body reaches from its centre of mass [m].

    One without shapes, such as a rotor, reaches as far as its radius of gyration.
    """
    heavy = min(inv_I_C[0, i], inv_I_C[1, i], inv_I_C[2, i])
    return max(radius[i], math.sqrt(inv_m[i] / heavy) if heavy > 0.0 else 0.0)


@kernel
def fall_asleep(inv_m: Array, inv_I_C: Array, state: State, loads: Loads, radius: Array,
                manifolds: Manifolds, needed: int, rest: Rest) -> None:
    """Hold what sleeps in place; let the islands sleep that were at rest for `needed` steps."""
    n = inv_m.shape[0]
    for i in range(n):
        if rest.asleep[i] == 1:
            for k in range(3):
                state.x[k, i] = rest.pose[k, i]
                state.P[k, i] = state.L[k, i] = 0.0
            for k in range(4):
                state.q[k, i] = rest.pose[3 + k, i]
        elif inv_m[i] > 0.0:
            slow = _speed(inv_m, inv_I_C, state, radius, i) < SLOW
            rest.steps[i] = rest.steps[i] + 1 if slow else 0
    _unite_islands(inv_m, state, manifolds, rest)
    for i in range(n):
        # The most restless body of an island decides: its count moves to the first one.
        first = first_of(rest.island, i)
        rest.steps[first] = min(rest.steps[first], rest.steps[i])
    for i in range(n):
        first = first_of(rest.island, i)
        rest.steps[i] = rest.steps[first]
        if rest.asleep[i] == 0 and inv_m[i] > 0.0 and rest.steps[i] >= needed:
            rest.asleep[i] = 1
            for k in range(3):
                state.P[k, i] = state.L[k, i] = 0.0
                rest.load[k, i], rest.load[3 + k, i] = loads.F[k, i], loads.tau[k, i]
        for k in range(3):
            rest.pose[k, i] = state.x[k, i]
        for k in range(4):
            rest.pose[3 + k, i] = state.q[k, i]


@kernel
def _unite_islands(inv_m: Array, state: State, manifolds: Manifolds, rest: Rest) -> None:
    """Unite what presses against each other or is tied together."""
    for i in range(inv_m.shape[0]):
        rest.island[i] = i
    first, count = rows_in_use(manifolds)
    for r in range(first, first + count):
        a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
        _rest_together(inv_m, state, rest, a, b, _press(manifolds, r))
    for r in range(rest.linked.shape[0]):
        _rest_together(inv_m, state, rest, rest.linked[r, 0], rest.linked[r, 1], True)


@kernel
def _rest_together(inv_m: Array, state: State, rest: Rest, a: int, b: int, holds: bool) -> None:
    """Unite two bodies if one holds the other and both move."""
    # Nor is at rest what a body moves with its twist, however slowly.
    if is_carried(state, a):
        rest.steps[b] = 0
    if is_carried(state, b):
        rest.steps[a] = 0
    if holds and inv_m[a] > 0.0 and inv_m[b] > 0.0:
        unite(rest.island, a, b)


@kernel
def keep_pressing(manifolds: Manifolds, slot: IntArray, rest: Rest, acted: StepImpulses) -> None:
    """Report for what sleeps the impulses with which it fell asleep."""
    first, count = rows_in_use(manifolds)
    for r in range(first, first + count):
        a, b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
        if rest.asleep[a] + rest.asleep[b] > 0 and slot[a] == 0 and slot[b] == 0:
            for p in range(manifolds.points[r]):
                acted.normal[p, r] = manifolds.impulse[p, r]
            for k in range(3):
                acted.friction[r, k] = manifolds.friction[r, k]
