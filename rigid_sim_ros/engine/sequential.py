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

from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.arrays import Array, IntArray, integers, room
from rigid_sim_ros.engine.bits import fetch
from rigid_sim_ros.engine.calming import (
    calm, Calming, CALMING_TURNS, make_calming, tell_of_sweep, visit_waiting)
from rigid_sim_ros.engine.coloring import (
    begin_blocks, BETWEEN, Blocks, CACHED, color_piece, Coloring, fetch_block, first_block,
    make_blocks, make_coloring, make_room, most_blocks, OVERLAPPING, PIECE, REGIONS, SHAKEN,
    UNSETTLED)
from rigid_sim_ros.engine.contact_filling import (
    choose_manifolds, classify, DEEPEST, fill_blocks, keep_impulses, NEW, place_lanes, TOUCHING)
from rigid_sim_ros.engine.contact_rules import Sweep
from rigid_sim_ros.engine.contact_sweep import (
    note_left, separate, SETTLED, visit_block)
from rigid_sim_ros.engine.free_flight import fly_free
from rigid_sim_ros.engine.kept import call
from rigid_sim_ros.engine.kernel import apart, INDEX, kernel, part
from rigid_sim_ros.engine.lanes import any_of, LANES
from rigid_sim_ros.engine.loads import Loads
from rigid_sim_ros.engine.manifolds import Manifolds
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.shapes import Materials, Shapes
from rigid_sim_ros.engine.slots import give_slots, make_sides, shared_out, Sides
from rigid_sim_ros.engine.solver_bodies import (
    begin_push, begin_push_astride, begin_push_inside, drift_and_kick, drift_bodies, FIRST_FREE,
    kick_bodies, load_bodies, make_bodies, mark_astride, SECOND_BEGIN, SECOND_FREE, slots_of,
    SolverBodies, store_bodies, STRIDE)
from rigid_sim_ros.engine.state import State
from rigid_sim_ros.engine.two_cores import side_by_side


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
    sides: Sides
    coloring: Coloring
    blocks: Blocks
    fresh: IntArray  # (blocks,) lanes that touch without an impulse to begin with
    calming: Calming
    shifted: IntArray  # (1,) 1 if collisions moved bodies since detection
    notes: Array  # (REGIONS, 8) see DEEPEST and ROUGH
    residual: Array  # (1,) [m/s] largest change of a contact's velocity in the last sweep
    overlap: Array  # (1,) [m] deepest


# More that is noted of a region: whether the last sweep changed anything roughly, the residual,
# whether anything was pushed in this substep, for how long its contacts have moved in this step
# [s], and whether anything may wait since an impact.
ROUGH, LARGEST, PUSHED, MOVED, WAITING = 3, 4, 5, 6, 7


def make_work(n: int, middle: tuple[int, int], capacity: int) -> SequentialWork:
    """Return buffers for n bodies and `capacity` manifolds; for `middle` see `make_sides`."""
    return SequentialWork(make_bodies(n), make_sides(n, middle), make_coloring(n, capacity),
                          make_blocks(capacity), integers(most_blocks(capacity)),
                          make_calming(n, capacity), np.zeros(1, dtype=np.int64),
                          room(REGIONS, 8), np.zeros(1), np.zeros(1))


# The stages of a region: fill its blocks; let forces act in the first substep; that, impulses for
# new contacts and a sweep forth; sweep forth or back before any body has moved; sweep forth after
# bodies have moved; let what waits after an impact have a turn; end a substep; end it and
# begin the next one; end the last one and keep impulses; write bodies back.
(FILL, START, BEGIN, SWEEP, SWEEP_BACK, MOVED_SWEEP, CALM_BACK, CALM, RETURN, NEXT,
 KEEP) = range(11)


@part
def solve_contacts(to: int, to_store: int, box: Any, desk: IntArray, model: Model, state: State,
                   loads: Loads, substeps: int, flight: Array, work: SequentialWork) -> None:
    """
    Advance all bodies by one step, those with a slot in `work.bodies` with contacts.

    `flight` is scratch for `fly_free`. `to` is the address of a kernel that calls `do_stage` with
    REGIONS * stage + region, `to_store` that of one that calls `store_half`. What is across waits
    for both halves, so a substep has one meeting, and more after an impact: forth in both halves,
    then across and back across, and back in both halves.
    """
    bodies, notes, halved = work.bodies, work.notes, work.sides.cut.halved[0] == 1
    # Whatever an earlier step had in regions that this one does not have.
    work.blocks.count[:], notes[:], work.calming.listed[:] = 0, 0.0, 0
    _in_all(to, box, desk, halved, FILL)
    if bodies.used[FIRST_FREE] + bodies.used[SECOND_FREE] > 0:
        fly_free(model, state, loads, bodies.slot, model.h, flight)
    first = SWEEP if _is_mostly_new(notes) else BEGIN
    if first == SWEEP:
        _find_impulses(to, box, desk, halved)
    _in_halves(to, box, desk, halved, first)
    for substep in range(substeps):
        if halved:
            call(to, box, REGIONS * (first if substep == 0 else MOVED_SWEEP) + BETWEEN)
        if notes[0, ROUGH] + notes[1, ROUGH] + notes[2, ROUGH] > 0.0:
            _calm(to, box, desk, halved, notes)
        if halved:
            call(to, box, REGIONS * RETURN + BETWEEN)
        if substep + 1 < substeps:
            _in_halves(to, box, desk, halved, NEXT)
    _in_halves(to, box, desk, halved, KEEP)
    if halved:
        call(to, box, REGIONS * KEEP + BETWEEN)
    _in_halves(to_store, box, desk, halved, 0)
    work.overlap[0] = max(notes[0, DEEPEST], max(notes[1, DEEPEST], notes[2, DEEPEST]))
    work.residual[0] = max(notes[0, LARGEST], max(notes[1, LARGEST], notes[2, LARGEST]))


@apart
def _in_halves(to: int, box: Any, desk: IntArray, halved: bool, stage: int) -> None:
    if halved:
        side_by_side(desk, to, box, REGIONS * stage, REGIONS * stage + 1)
    else:
        call(to, box, REGIONS * stage)


@kernel
def _in_all(to: int, box: Any, desk: IntArray, halved: bool, stage: int) -> None:
    """Do a stage in both halves, and then across."""
    _in_halves(to, box, desk, halved, stage)
    if halved:
        call(to, box, REGIONS * stage + BETWEEN)


@kernel
def _calm(to: int, box: Any, desk: IntArray, halved: bool, notes: Array) -> None:
    """Visit what a rough change reached, until there is no more."""
    for _ in range(CALMING_TURNS):
        if halved:
            call(to, box, REGIONS * CALM_BACK + BETWEEN)
        _in_all(to, box, desk, halved, CALM)
        if notes[0, WAITING] + notes[1, WAITING] + notes[2, WAITING] == 0.0:
            break


# Visits to a block with new contacts. A box that is put down on a slope slips by 1e-7 m until its
# pressure has moved to where friction wants it; with 6 visits before the first sweep by 1e-10 m.
FRESH_VISITS = 6
# Sweeps where half of all that touches is new, as at the start of a scene: without them a stack of
# 20 sinks by 4 mm before its impulses have grown, and the shock moves it sideways.
FRESH_SWEEPS = 100


@kernel
def _is_mostly_new(notes: Array) -> bool:
    new = notes[0, NEW] + notes[1, NEW] + notes[2, NEW]
    return bool(2.0 * new > notes[0, TOUCHING] + notes[1, TOUCHING] + notes[2, TOUCHING])


@kernel
def _find_impulses(to: int, box: Any, desk: IntArray, halved: bool) -> None:
    """Let forces act in the first substep, and find impulses where most contacts are new."""
    _in_halves(to, box, desk, halved, START)
    for k in range(FRESH_SWEEPS):
        if k % 2 == 0:
            _in_all(to, box, desk, halved, SWEEP)
        else:
            if halved:
                call(to, box, REGIONS * SWEEP_BACK + BETWEEN)
            _in_halves(to, box, desk, halved, SWEEP_BACK)


@part
def do_stage(stage: int, region: int, model: Model, state: State, loads: Loads, shapes: Shapes,
             materials: Materials, round_shapes: IntArray, manifolds: Manifolds, acted: Manifolds,
             waits: IntArray, touching: IntArray, shifts: Array, settings: SequentialSettings,
             work: SequentialWork) -> None:
    """
    Do a stage in a region: 0 and 1, the halves, have bodies; 2, BETWEEN, has only contacts.

    Impulses of the manifolds are those to begin with, and afterwards those of this step; those of
    the whole step are added to what collisions wrote to `acted`. A manifold with waits (c,) of 1
    takes no part; touching (2, n) are 1 for the bodies of others. round_shapes (s,) are 1 for what
    may be in a block of balls. `shifts` are what collisions moved.
    """
    bodies, blocks, notes = work.bodies, work.blocks, work.notes[region]
    motion, alike, h = bodies.motion, bodies.alike[0] == 1, model.h / settings.substeps
    at_rest = Sweep(1.0 / h, 0.0, False)
    if stage == FILL:
        if region != BETWEEN:
            give_slots(region, work.sides, touching, bodies)
            load_bodies(region, model.gravity, model.inv_m, model.inv_I_C, state, loads, bodies)
        _fill(region, state.x, shapes, materials, round_shapes, manifolds, waits, shifts,
              1.0 / settings.substeps, work)
    if stage in (RETURN, NEXT) or (stage == KEEP and region != BETWEEN):
        notes[PUSHED] = 0.0
        if region == 1:
            _fetch_astride(blocks, bodies, work.notes[BETWEEN, PUSHED] > 0.0)
        if work.notes[BETWEEN, PUSHED] > 0.0:
            _begin_push(region, blocks, bodies, work.notes)
        sweep_back(region, blocks, bodies, at_rest, settings.push / h, settings.push_speed,
                   work.notes)
    pushed = notes[PUSHED] > 0.0
    if stage in (START, BEGIN) and region != BETWEEN:
        kick_bodies(region, bodies.used, motion, bodies.smooth, alike, bodies.base, h)
    elif stage == NEXT:
        drift_and_kick(region, bodies.used, motion, bodies.drifted, bodies.total,
                       notes[MOVED] == 0.0, pushed, bodies.smooth, alike, bodies.base, h)
    elif stage == KEEP and region != BETWEEN:
        drift_bodies(region, bodies.used, motion, bodies.drifted, pushed)
    if stage == BEGIN:
        settle(region, blocks, work.fresh, motion, at_rest)
    if stage in (BEGIN, SWEEP, SWEEP_BACK, MOVED_SWEEP, NEXT):
        drift = h if stage in (MOVED_SWEEP, NEXT) else 0.0
        sweep(region, blocks, motion, bodies.drifted, Sweep(1.0 / h, drift, notes[MOVED] == 0.0),
              stage == SWEEP_BACK, notes)
        notes[MOVED] += drift
        if stage != SWEEP_BACK:
            tell_of_sweep(region, notes[ROUGH] > 0.0, blocks, bodies, work.calming)
    elif stage == CALM_BACK:
        visit_waiting(region, True, blocks, bodies, at_rest, work.calming)
    elif stage == CALM:
        notes[WAITING] = 1.0 if calm(region, blocks, bodies, at_rest, work.calming) else 0.0
    if stage == KEEP:
        notes[LARGEST] = keep_impulses(region, blocks, work.coloring, manifolds, bodies, h,
                                       settings.substeps, work.shifted[0] == 1, acted.impulse,
                                       acted.friction)


@part
def store_half(half: int, model: Model, state: State, substeps: int,
               work: SequentialWork) -> None:
    """Write the bodies of a half back to the state, at the end of a step."""
    first, last = shared_out(work.sides, half)
    store_bodies(half, first, last, model.h, model.m, model.inv_m, model.inv_I_C, state,
                 work.bodies, substeps)


@kernel
def _fill(region: int, x: Array, shapes: Shapes, materials: Materials, round_shapes: IntArray,
          manifolds: Manifolds, waits: IntArray, shifts: Array, share: float,
          work: SequentialWork) -> None:
    """Bring the manifolds of a region into blocks."""
    shifted, sides = work.shifted[0] == 1, work.sides
    if region != BETWEEN:
        choose_manifolds(region, manifolds, sides, waits, work.coloring)
    classify(region, shapes.material, materials, round_shapes, shifted, manifolds, work.bodies,
             work.coloring)
    coloring, blocks, bodies = work.coloring, work.blocks, work.bodies
    begin_blocks(region, blocks)
    for begin in range(0, coloring.members[region], PIECE):
        end = min(begin + PIECE, coloring.members[region])
        block = first_block(blocks, region) + blocks.count[region]
        colors = color_piece(region, begin, end, manifolds.body_a, manifolds.body_b, bodies.slot,
                             coloring)
        make_room(region, begin, end, colors, coloring, blocks)
        place_lanes(region, begin, end, block, manifolds, bodies, coloring, blocks)
        fill_blocks(region, block, manifolds, x, shapes, materials, shifts, shifted, share,
                    bodies, blocks, work.fresh, work.notes[region])
    if region == BETWEEN:
        begin = first_block(blocks, region)
        mark_astride(begin * LANES, (begin + blocks.count[region]) * LANES, blocks.at_A,
                     blocks.at_B, bodies.astride)


@part
def sweep(region: int, blocks: Blocks, motion: Array, drifted: Array, what: Sweep,
          backwards: bool, notes: Array) -> None:
    """
    Visit every block of a region once, and note whether any visit changed something roughly.

    Backwards in the opposite order, so that two sweeps make a nearly symmetric iteration: its
    errors decay, while those of a one-sided one also rotate, and the warm start, an extrapolation,
    would make that a growing sway of a stack.
    """
    first, count = first_block(blocks, region), blocks.count[region]
    notes[ROUGH] = 0.0
    for k in range(count):
        block = first + (count - 1 - k if backwards else k)
        if count > CACHED:
            fetch_block(blocks, block - 1 if backwards else block + 1)
        note_left(blocks, block, visit_block(blocks, block, motion, drifted, what))
        if blocks.left[block] >= SHAKEN:
            notes[ROUGH] = 1.0


@part
def settle(region: int, blocks: Blocks, fresh: IntArray, motion: Array, what: Sweep) -> None:
    """Visit the blocks of a region that have new contacts."""
    first = first_block(blocks, region)
    for block in range(first, first + blocks.count[region]):
        for _ in range(FRESH_VISITS if fresh[block] > 0 else 0):
            if not any_of(visit_block(blocks, block, motion, motion, what) > SETTLED):
                break


@part
def sweep_back(region: int, blocks: Blocks, bodies: SolverBodies, what: Sweep, rate: float,
               speed: float, notes: Array) -> None:
    """
    End a substep: visit what is not settled, in the opposite order, and push overlaps apart.

    What the forward sweep hardly changed is left alone: the next one visits every block again.
    """
    motion = bodies.motion
    first, many = first_block(blocks, region), blocks.count[region] > CACHED
    count = _list_left(first, blocks.count[region], blocks.left, blocks.again)
    for k in range(count):
        block = blocks.again[first + count - 1 - k & INDEX] & INDEX
        if many and k + 1 < count:
            fetch_block(blocks, blocks.again[first + count - 2 - k & INDEX])
        if blocks.left[block] & UNSETTLED != 0:
            visit_block(blocks, block, motion, motion, what)
        if blocks.left[block] & OVERLAPPING != 0:
            if notes[region, PUSHED] == 0.0:
                _begin_push(region, blocks, bodies, notes)
            separate(blocks, block, bodies.drifted, rate, speed)


@kernel
def _list_left(first: int, count: int, left: IntArray, again: IntArray) -> int:
    """List the blocks that have something left to do, from `first` on; return their number."""
    found = 0
    for block in range(first, first + count):
        again[first + found & INDEX] = block
        found += 1 if left[block & INDEX] != 0 else 0
    return found


@kernel
def _fetch_astride(blocks: Blocks, bodies: SolverBodies, pushed: bool) -> None:
    """
    Ask for the bodies of the second half that were touched across, where the first core did it.

    All at once: one by one each of them would be waited for.
    """
    begin, second = first_block(blocks, BETWEEN) * LANES, bodies.used[SECOND_BEGIN] * STRIDE
    for lane in range(begin, begin + blocks.count[BETWEEN] * LANES):
        a, b = blocks.at_A[lane], blocks.at_B[lane]
        at = b if b >= second else a
        if at >= second:
            fetch(bodies.motion, at)
            if pushed:
                fetch(bodies.drifted, at)


@kernel
def _begin_push(region: int, blocks: Blocks, bodies: SolverBodies, notes: Array) -> None:
    """
    Let nobody be pushed yet.

    Across there are only those astride. What a core writes of the other half it would take from
    there, and the other one would take it back.
    """
    first, last = slots_of(bodies.used, region)
    if region == BETWEEN:
        begin = first_block(blocks, BETWEEN) * LANES
        begin_push_astride(begin, begin + blocks.count[BETWEEN] * LANES, blocks.at_A,
                           blocks.at_B, bodies.motion, bodies.drifted)
    elif notes[BETWEEN, PUSHED] > 0.0:
        begin_push_inside(first, last, bodies.astride, bodies.motion, bodies.drifted)
    else:
        begin_push(first, last, bodies.motion, bodies.drifted)
    notes[region, PUSHED] = 1.0
