# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The sequential solver: a step of touching bodies in short substeps.

Each substep lets the forces act, solves the velocities of all contacts one after the other, back
and forth, and moves the bodies (Macklin et al., Small Steps in Physics Simulation, SCA 2019: many
substeps converge better than many sweeps of one long step). Overlaps are pushed apart by
displacements of their own. A push by the velocities would make the warm-started impulses an
integral controller of the gap: with the rate e at which the sweeps converge and the rate b of the
push, an error obeys

    s^3 + e s^2 + e s + e b = 0,

which is unstable for b > e. A stack of ten has e = 0.01 a substep, so it would sway for ever.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray
from rigid_sim_ros.engine.calming import calm, Calming, make_calming
from rigid_sim_ros.engine.coloring import (
    Blocks, color_manifolds, Coloring, make_blocks, make_coloring, most_blocks,
    numbers_of, points_in)
from rigid_sim_ros.engine.contact_filling import (
    classify, fill_blocks, keep_impulses, place_lanes)
from rigid_sim_ros.engine.contact_rules import Sweep
from rigid_sim_ros.engine.contact_sweep import (
    count_impulses, is_settled, overlaps, separate, visit_block)
from rigid_sim_ros.engine.free_flight import fly
from rigid_sim_ros.engine.kernel import kernel
from rigid_sim_ros.engine.loads import kick, Loads
from rigid_sim_ros.engine.manifolds import Manifolds
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.shapes import Materials, Shapes
from rigid_sim_ros.engine.solver_bodies import (
    drift_bodies, kick_bodies, load_bodies, make_bodies, note_start, SolverBodies, stop_pushing,
    store_bodies)
from rigid_sim_ros.engine.state import State


class SequentialSettings(NamedTuple):
    """Numbers that trade accuracy for time and softness for speed."""

    substeps: int = 4  # more: stiffer and slower; an overlap under load shrinks with the square
    # part of an overlap that a substep pushes out; above 0.5 neighbours overshoot
    push: float = 0.2
    # [m/s] at most, out of an overlap; more throws what starts inside another
    push_speed: float = 3.0


class SequentialWork(NamedTuple):
    """Buffers for one step: nothing here outlives it but what is reported."""

    bodies: SolverBodies
    coloring: Coloring
    blocks: Blocks
    fresh: IntArray  # (blocks + 1,) lanes that touch without an impulse to begin with
    calming: Calming
    residual: Array  # (1,) [m/s] largest change of a contact's velocity in the last sweep
    overlap: Array  # (1,) [m] deepest


def make_work(n: int, capacity: int) -> SequentialWork:
    """Return buffers for n bodies and `capacity` manifolds."""
    blocks = most_blocks(capacity)
    return SequentialWork(make_bodies(n), make_coloring(n, capacity), make_blocks(capacity),
                          np.zeros(blocks + 1, dtype=np.int64), make_calming(n, capacity),
                          np.zeros(1), np.zeros(1))


@kernel
def solve_contacts(model: Model, state: State, loads: Loads, shapes: Shapes, materials: Materials,
                   round_shapes: IntArray, manifolds: Manifolds, acted: Manifolds, waits: IntArray,
                   shifts: Array, shifted: bool, settings: SequentialSettings,
                   work: SequentialWork, flight: Array) -> None:
    """
    Advance all bodies by one step, those with a slot in `work.bodies` with contacts.

    Impulses of the manifolds are those to begin with, and afterwards those of this step; those of
    the whole step are added to what collisions wrote to `acted`. A manifold with waits (c,) of 1
    takes no part. round_shapes (s,) are 1 for what may be in a block of balls. `shifts` are what
    collisions moved, if `shifted`; `flight` is scratch for `fly`.
    """
    bodies, blocks, substeps = work.bodies, work.blocks, settings.substeps
    motion, used, h = bodies.motion, bodies.used[0], model.h / substeps
    load_bodies(model.inv_m, model.inv_I_C, state, loads, bodies)
    classify(shapes.material, materials, round_shapes, shifted, manifolds, work.coloring.kind)
    count = color_manifolds(manifolds.count[0], manifolds.body_a, manifolds.body_b,
                            work.coloring.kind, bodies.slot, waits, work.coloring, blocks.kind,
                            blocks.start)
    place_lanes(manifolds.count[0], count, manifolds, bodies.slot, work.coloring, blocks)
    work.overlap[0] = fill_blocks(count, manifolds, state.x, shapes.material, materials, shifts,
                                  shifted, 1.0 / substeps, bodies, blocks, work.fresh)
    note_start(used, motion, bodies.mass)
    if bodies.used[1] > 0:
        kick(state, loads, 0.5 * model.h)
        fly(model, state, (0.0, 0.0, 0.0), model.h, np.int64(1), flight)
        kick(state, loads, 0.5 * model.h)
    work.calming.listed[0] = 0
    for substep in range(substeps):
        kick_bodies(used, motion, bodies.smooth, bodies.base, h, substep == 0)
        if substep == 0:
            settle(count, blocks, work.fresh, motion, 1.0 / h)
        sweep(count, blocks, motion, bodies.drifted, Sweep(1.0 / h, h if substep > 0 else 0.0),
              False)
        calm(count, blocks, motion, used, work.calming, 1.0 / h)
        stop_pushing(used, bodies.drifted)
        sweep_back(count, blocks, motion, bodies.drifted, 1.0 / h, settings.push / h,
                   settings.push_speed)
        drift_bodies(used, motion, bodies.drifted, bodies.total)
    work.residual[0] = keep_impulses(count, blocks, manifolds, bodies, h, substeps,
                                     acted.impulse, acted.friction)
    store_bodies(model.h, model.m, model.inv_I_C, state, bodies, substeps)


@kernel
def sweep(count: int, blocks: Blocks, motion: Array, drifted: Array, what: Sweep,
          backwards: bool) -> None:
    """
    Visit every block once.

    Backwards in the opposite order, so that two sweeps make a nearly symmetric iteration: its
    errors decay, while those of a one-sided one also rotate, and the warm start, an extrapolation,
    would make that a growing sway of a stack.
    """
    for k in range(count):
        visit_block(blocks, count - 1 - k if backwards else k, motion, drifted, what)


# Visits to a block with new contacts. A box that is put down on a slope slips by 1e-7 m until its
# pressure has moved to where friction wants it; with 6 visits before the first sweep by 1e-10 m.
FRESH_VISITS = 6
# Sweeps where half of all that touches is new, as at the start of a scene: without them a stack of
# 20 sinks by 4 mm before its impulses have grown, and the shock moves it sideways.
FRESH_SWEEPS = 100
# [m/s] a visit that changes velocities less has nothing left to do in this substep
SETTLED = 1e-6


@kernel
def settle(count: int, blocks: Blocks, fresh: IntArray, motion: Array, inv_h: float) -> None:
    """Find impulses for new contacts; the last entry of `fresh` says that these are many."""
    what = Sweep(inv_h, 0.0)
    if fresh[-1] == 1:
        for k in range(FRESH_SWEEPS):
            sweep(count, blocks, motion, motion, what, k % 2 == 1)
        return
    for block in range(count):
        for _ in range(FRESH_VISITS if fresh[block] > 0 else 0):
            visit_block(blocks, block, motion, motion, what)
            if is_settled(numbers_of(blocks, block), SETTLED):
                break


@kernel
def sweep_back(count: int, blocks: Blocks, motion: Array, push: Array, inv_h: float, rate: float,
               speed: float) -> None:
    """
    End a substep: visit what is not settled, in the opposite order, and push overlaps apart.

    What the forward sweep hardly changed is only read: the next one visits every block again.
    """
    for k in range(count):
        block = count - 1 - k
        b, points = numbers_of(blocks, block), points_in(blocks.kind[block])
        if not is_settled(b, SETTLED):
            visit_block(blocks, block, motion, motion, Sweep(inv_h, 0.0))
        count_impulses(b, points)
        if overlaps(b, points):
            separate(blocks, block, push, rate, speed)
