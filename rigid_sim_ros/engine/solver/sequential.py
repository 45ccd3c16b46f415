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

from rigid_sim_ros.engine.constraints.contact_blocks import SIZE
from rigid_sim_ros.engine.constraints.contact_prediction import Prediction
from rigid_sim_ros.engine.constraints.contact_rules import SETTLED, Sweep
from rigid_sim_ros.engine.detection.manifolds import Manifolds
from rigid_sim_ros.engine.dynamics.free_flight import fly_free
from rigid_sim_ros.engine.dynamics.loads import Loads
from rigid_sim_ros.engine.maths.vector import norm
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.solver.coloring import (
    awake_in, begin_blocks, BETWEEN, Blocks, CACHED, CHANGED, color_piece, Coloring, fetch_block,
    first_block, make_blocks, make_coloring, make_room, most_blocks, numbers_of, OVERLAPPING,
    PIECE, REGIONS)
from rigid_sim_ros.engine.solver.contact_filling import (
    choose_manifolds, classify, DEEPEST, fill_blocks, keep_impulses, NEW, place_lanes, TOUCHING)
from rigid_sim_ros.engine.solver.contact_sweep import note_left, separate, visit_block
from rigid_sim_ros.engine.solver.direct_islands import find_islands
from rigid_sim_ros.engine.solver.direct_solve import Direct, solve_islands
from rigid_sim_ros.engine.solver.impacts import (
    drift_blocks, end_impacts, excuse_approaches, find_approaching, forget_excuses, Impacts,
    make_impacts, pass_on, TURNS, visit_waiting)
from rigid_sim_ros.engine.solver.partition import give_slots, make_sides, shared_out, Sides
from rigid_sim_ros.engine.solver.solver_bodies import (
    begin_push, begin_push_astride, begin_push_inside, drift_bodies, kick_bodies, load_bodies,
    make_bodies, mark_astride, SECOND_BEGIN, slots_of, SolverBodies, store_bodies, STRIDE,
    unkick_bodies)
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.argument_pack import call
from rigid_sim_ros.kernels.arrays import Array, IntArray, integers, room
from rigid_sim_ros.kernels.bits import fetch
from rigid_sim_ros.kernels.eight import any_of, LANES, load
from rigid_sim_ros.kernels.kernel import apart, INDEX, kernel, part
from rigid_sim_ros.kernels.second_core import side_by_side


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
    fresh: IntArray  # (blocks,) the bits of lanes that touch without an impulse to begin with
    impacts: Impacts
    shifted: IntArray  # (1,) 1 if collisions moved bodies since detection
    notes: Array  # (REGIONS, 8) see DEEPEST and LARGEST
    residual: Array  # (1,) [m/s] largest change of a contact's velocity in the last sweep
    overlap: Array  # (1,) [m] deepest


# More that is noted of a region: the residual, whether anything was pushed in this substep, which
# substep it is in, and whether anything waits for its part in an impact.
LARGEST, PUSHED, SUBSTEP, WAITING = 3, 4, 5, 6


def make_work(n: int, middle: tuple[int, int], capacity: int) -> SequentialWork:
    """Return buffers for n bodies and `capacity` manifolds; for `middle` see `make_sides`."""
    return SequentialWork(make_bodies(n), make_sides(n, middle), make_coloring(n, capacity),
                          make_blocks(capacity), integers(most_blocks(capacity)),
                          make_impacts(n, capacity), np.zeros(1, dtype=np.int64),
                          room(REGIONS, 8), np.zeros(1), np.zeros(1))


# The stages of a region: fill its blocks; see what approaches as the step begins; let what waits
# in an impact have a turn; kick and sweep forth; kick alone, and take it back; sweep forth or
# back; kick, visit what is new and sweep forth; sweep back what is not settled and push; drift;
# keep impulses.
(FILL, APPROACH, IMPACT_BACK, IMPACT, KICK_AND_SWEEP, KICK, UNKICK, SWEEP, SWEEP_BACK,
 SETTLE_AND_SWEEP, RETURN, DRIFT, KEEP) = range(13)


@part
def solve_contacts(to: int, to_store: int, to_direct: int, box: Any, desk: IntArray, model: Model,
                   state: State, loads: Loads, substeps: int, flight: Array,
                   work: SequentialWork) -> None:
    """
    Advance all bodies by one step, those with a slot in `work.bodies` with contacts.

    `flight` is scratch for `fly_free`. `to` is the address of a kernel that calls `do_stage` with
    REGIONS * stage + region, `to_store` that of one that calls `store_half`, `to_direct` that of
    one that calls `do_direct_stage`, or 0. What is across waits for both halves.
    """
    notes, halved = work.notes, work.sides.cut.halved[0] == 1
    # Whatever an earlier step had in regions that this one does not have.
    work.blocks.count[:], notes[:], work.impacts.listed[:] = 0, 0.0, 0
    _in_all(to, box, desk, halved, FILL)
    _directly(to_direct, box, LIST)
    if _is_mostly_new(notes):
        _find_impulses(to, to_direct, box, desk, halved)
    _in_all(to, box, desk, halved, APPROACH)
    for substep in range(substeps):
        if notes[0, WAITING] + notes[1, WAITING] + notes[2, WAITING] > 0.0:
            _solve_impacts(to, to_direct, box, desk, halved, notes)
        _in_all(to, box, desk, halved, SETTLE_AND_SWEEP if substep == 0 else KICK_AND_SWEEP)
        _directly(to_direct, box, BEAR)
        if halved:
            call(to, box, REGIONS * RETURN + BETWEEN)
        _in_halves(to, box, desk, halved, RETURN)
        if halved:
            call(to, box, REGIONS * DRIFT + BETWEEN)
    _in_all(to, box, desk, halved, KEEP)
    _in_halves(to_store, box, desk, halved, 0)
    fly_free(model, state, loads, work.bodies.flies, model.h, flight)
    work.overlap[0] = max(notes[0, DEEPEST], max(notes[1, DEEPEST], notes[2, DEEPEST]))
    work.residual[0] = max(notes[0, LARGEST], max(notes[1, LARGEST], notes[2, LARGEST]))


# The stages of what is solved directly: find it; solve an impact; find what bears the forces.
LIST, STRIKE, BEAR = range(3)


@kernel
def _directly(to: int, box: Any, stage: int) -> None:
    if to != 0:
        call(to, box, stage)


@kernel
def do_direct_stage(stage: int, h: float, substeps: int, work: SequentialWork,
                    direct: Direct) -> None:
    """Do a stage for the islands that are solved directly, in steps of h [s]."""
    if stage == LIST:
        find_islands(work.blocks, work.bodies, direct.islands)
    else:
        what = _sweep_of(stage == BEAR, work.notes[0, SUBSTEP], h / substeps, substeps)
        solve_islands(work.blocks, work.bodies, what, work.impacts, direct)


@kernel
def _sweep_of(forces: bool, substep: float, h: float, substeps: int) -> Sweep:
    """Return what visits of a substep of h [s] are for."""
    # An impact is at the start of a substep; forces hold contacts to their geometry at its end.
    return Sweep(1.0 / h, forces, (substep + (1.0 if forces else 0.0)) / substeps - 0.5)


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
def _solve_impacts(to: int, to_direct: int, box: Any, desk: IntArray, halved: bool,
                   notes: Array) -> None:
    """Visit what approaches, and what that reaches, until nothing waits."""
    for _ in range(TURNS):
        _directly(to_direct, box, STRIKE)
        if halved:
            call(to, box, REGIONS * IMPACT_BACK + BETWEEN)
        _in_all(to, box, desk, halved, IMPACT)
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
def _find_impulses(to: int, to_direct: int, box: Any, desk: IntArray, halved: bool) -> None:
    """Find the impulses to begin with where most contacts are new: those that bear the forces."""
    _in_all(to, box, desk, halved, KICK)
    _directly(to_direct, box, BEAR)
    for k in range(FRESH_SWEEPS):
        if k % 2 == 0:
            _in_all(to, box, desk, halved, SWEEP)
        else:
            if halved:
                call(to, box, REGIONS * SWEEP_BACK + BETWEEN)
            _in_halves(to, box, desk, halved, SWEEP_BACK)
    _in_all(to, box, desk, halved, UNKICK)


@part
def do_stage(stage: int, region: int, model: Model, state: State, loads: Loads, shapes: Shapes,
             materials: Materials, round_shapes: IntArray, manifolds: Manifolds, acted: Manifolds,
             prediction: Prediction, waits: IntArray, touching: IntArray, shifts: Array,
             settings: SequentialSettings, work: SequentialWork) -> None:
    """
    Do a stage in a region: 0 and 1, the halves, have bodies; 2, BETWEEN, has only contacts.

    Impulses of the manifolds are those to begin with, and afterwards those of this step; those of
    the whole step are added to what collisions wrote to `acted`. waits (c,) tell which manifolds
    take part; touching (2, n) are 1 for their bodies. round_shapes (s,) are 1 for what may be in
    a block of balls. `shifts` are what collisions moved.
    """
    bodies, blocks, notes, impacts = work.bodies, work.blocks, work.notes[region], work.impacts
    motion, alike, h = bodies.motion, bodies.alike[0] == 1, model.h / settings.substeps
    what = _sweep_of(stage not in (APPROACH, IMPACT_BACK, IMPACT), notes[SUBSTEP], h,
                     settings.substeps)
    # What gravity does in a substep: below it an approach is the work of forces, not an impact.
    slow = h * norm((model.gravity[0], model.gravity[1], model.gravity[2]))
    if stage == FILL:
        if region != BETWEEN:
            give_slots(region, work.sides, touching, bodies)
            load_bodies(region, model.h, model.gravity, model.inv_m, model.inv_I_C, state, loads,
                        bodies)
        _fill(region, state.x, shapes, materials, round_shapes, manifolds, prediction, waits,
              shifts, 1.0 / settings.substeps, work)
    elif stage == APPROACH:
        notes[WAITING] = 1.0 if find_approaching(region, blocks, motion, what, slow,
                                                 impacts) else 0.0
    elif stage == IMPACT_BACK:
        visit_waiting(region, True, blocks, motion, bodies.used, what, slow, impacts)
    elif stage == IMPACT:
        notes[WAITING] = 1.0 if pass_on(region, blocks, motion, bodies.used, what, slow,
                                        impacts) else 0.0
    elif stage == KICK:
        excuse_approaches(region, blocks, motion)
        if region != BETWEEN:
            kick_bodies(region, bodies.used, motion, bodies.smooth, alike, bodies.base, h)
    elif stage == UNKICK:
        forget_excuses(region, blocks)
        if region != BETWEEN:
            unkick_bodies(region, bodies.used, motion, bodies.smooth, alike, bodies.base, h)
    elif stage in (KICK_AND_SWEEP, SETTLE_AND_SWEEP):
        end_impacts(region, blocks, motion, impacts)
        if region != BETWEEN:
            kick_bodies(region, bodies.used, motion, bodies.smooth, alike, bodies.base, h)
        if stage == SETTLE_AND_SWEEP:
            settle(region, blocks, work.fresh, motion, what)
    if stage in (KICK_AND_SWEEP, SETTLE_AND_SWEEP, SWEEP, SWEEP_BACK):
        sweep(region, blocks, motion, what, stage == SWEEP_BACK)
    elif stage == RETURN:
        _return(region, what, settings.push / h, work)
    if (stage == RETURN and region != BETWEEN) or stage == DRIFT:
        if region != BETWEEN:
            drift_bodies(region, bodies.used, motion, bodies.drifted, bodies.total,
                         bodies.smooth, alike, bodies.base, h, notes[PUSHED] > 0.0)
        meets = drift_blocks(region, blocks, bodies.drifted, h, what, slow, impacts)
        notes[WAITING], notes[SUBSTEP] = 1.0 if meets else 0.0, notes[SUBSTEP] + 1.0
    elif stage == KEEP:
        notes[LARGEST] = keep_impulses(
            region, blocks, work.coloring, manifolds, prediction, bodies, h, settings.substeps,
            work.shifted[0] == 1, acted.impulse, acted.friction)


@kernel
def _return(region: int, what: Sweep, rate: float, work: SequentialWork) -> None:
    """End the sweeps of a substep on the way back, and push overlaps apart."""
    bodies, blocks, notes = work.bodies, work.blocks, work.notes
    notes[region, PUSHED] = 0.0
    if region == 1:
        _fetch_astride(blocks, bodies, notes[BETWEEN, PUSHED] > 0.0)
    if notes[BETWEEN, PUSHED] > 0.0:
        _begin_push(region, blocks, bodies, notes)
    sweep_back(region, blocks, bodies, what, rate, notes)


@part
def store_half(half: int, model: Model, state: State, substeps: int,
               work: SequentialWork) -> None:
    """Write the bodies of a half back to the state, at the end of a step."""
    first, last = shared_out(work.sides, half)
    store_bodies(half, first, last, model.h, model.m, model.inv_m, model.inv_I_C, state,
                 work.bodies, substeps)


@kernel
def _fill(region: int, x: Array, shapes: Shapes, materials: Materials, round_shapes: IntArray,
          manifolds: Manifolds, prediction: Prediction, waits: IntArray, shifts: Array,
          share: float, work: SequentialWork) -> None:
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
        fill_blocks(region, block, manifolds, prediction, x, waits, shapes, materials, shifts,
                    shifted, share, bodies, blocks, work.fresh, work.notes[region])
    if region == BETWEEN:
        begin = first_block(blocks, region)
        mark_astride(begin * LANES, (begin + blocks.count[region]) * LANES, blocks.at_A,
                     blocks.at_B, bodies.astride)


@part
def sweep(region: int, blocks: Blocks, motion: Array, what: Sweep, backwards: bool) -> None:
    """
    Visit every block of a region once, and note what is left to do.

    Backwards in the opposite order, so that two sweeps make a nearly symmetric iteration: its
    errors decay, while those of a one-sided one also rotate, and the warm start, an extrapolation,
    would make that a growing sway of a stack.
    """
    first, count = first_block(blocks, region), blocks.count[region]
    for k in range(count):
        block = first + (count - 1 - k if backwards else k)
        if count > CACHED:
            fetch_block(blocks, block - 1 if backwards else block + 1)
        note_left(blocks, block, visit_block(blocks, block, motion, what, awake_in(blocks, block)),
                  what)


@part
def settle(region: int, blocks: Blocks, fresh: IntArray, motion: Array, what: Sweep) -> None:
    """Visit the blocks of a region that have new contacts."""
    first = first_block(blocks, region)
    for block in range(first, first + blocks.count[region]):
        least = SETTLED * what.inv_h * load(numbers_of(blocks, block), SIZE)
        for _ in range(FRESH_VISITS if fresh[block] > 0 else 0):
            bits = fresh[block] & awake_in(blocks, block)
            if not any_of(visit_block(blocks, block, motion, what, bits) > least):
                break


@part
def sweep_back(region: int, blocks: Blocks, bodies: SolverBodies, what: Sweep, rate: float,
               notes: Array) -> None:
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
        if blocks.left[block] >= CHANGED:
            visit_block(blocks, block, motion, what, blocks.left[block] // CHANGED)
        if blocks.left[block] & OVERLAPPING != 0:
            if notes[region, PUSHED] == 0.0:
                _begin_push(region, blocks, bodies, notes)
            separate(blocks, block, bodies.drifted, rate)


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
