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

from rigid_sim_ros.engine.constraints.contact_rules import SETTLED, Sweep
from rigid_sim_ros.engine.detection.manifolds import current, step_impulses
from rigid_sim_ros.engine.dynamics.free_flight import fly_free
from rigid_sim_ros.engine.maths.vector import norm
from rigid_sim_ros.engine.solver.arguments import Arguments, SequentialWork
from rigid_sim_ros.engine.solver.coloring import (
    awake_in, begin_blocks, BETWEEN, Blocks, CACHED, CHANGED, color_piece, fetch_block,
    first_block, make_room, OVERLAPPING, PIECE, REGIONS)
from rigid_sim_ros.engine.solver.contact_filling import (
    choose_manifolds, classify_blocks, DEEPEST, fill_blocks, NEW, place_lanes)
from rigid_sim_ros.engine.solver.contact_sweep import note_left, separate, visit_block, visit_lanes
from rigid_sim_ros.engine.solver.direct_islands import FEW, find_islands
from rigid_sim_ros.engine.solver.impacts import (
    drift_blocks, end_impacts, find_approaching, pass_on, TURNS, visit_waiting)
from rigid_sim_ros.engine.solver.impulse_keeping import store_impulses
from rigid_sim_ros.engine.solver.island_push import push_islands
from rigid_sim_ros.engine.solver.new_islands import (
    end_round, excuse_approaches, find_new_islands, forget_excuses, kick_new, sweep_new)
from rigid_sim_ros.engine.solver.partition import give_slots, shared_out
from rigid_sim_ros.engine.solver.small_islands import bear_islands, strike_islands
from rigid_sim_ros.engine.solver.solver_bodies import (
    begin_push, begin_push_astride, begin_push_inside, drift_bodies, kick_bodies, load_bodies,
    mark_astride, SECOND_BEGIN, slots_of, SolverBodies, store_bodies, STRIDE)
from rigid_sim_ros.engine.solver.warm_start_share import temper_warm_start
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.bits import fetch
from rigid_sim_ros.kernels.eight import bits_of, LANES, spread
from rigid_sim_ros.kernels.kernel import apart, INDEX, kernel, part
from rigid_sim_ros.kernels.second_core import side_by_side
from rigid_sim_ros.kernels.separate import address_of, by_address

# More that is noted of a region: the residual, whether anything was pushed in this substep, which
# substep it is in, whether anything waits for its part in an impact, and whether the latest sweep
# changed any velocity by much.
LARGEST, PUSHED, SUBSTEP, WAITING, UNSETTLED = 3, 4, 5, 6, 7


# The stages of a region: fill its blocks; see what approaches as the step begins; let what waits
# in an impact have a turn; kick and sweep forth; in islands that are new kick alone, and take it
# back, sweep forth or back; kick, visit what is new and sweep forth; visit what that changed by
# much back or forth; sweep back what is not settled and push; drift; keep impulses.
(FILL, APPROACH, IMPACT_BACK, IMPACT, KICK_AND_SWEEP, KICK_NEW, UNKICK_NEW, SWEEP_NEW,
 SWEEP_NEW_BACK, SETTLE_AND_SWEEP, AGAIN_BACK, AGAIN, RETURN, DRIFT, KEEP) = range(15)
# What a sweep changes by more than this part of what gravity does in a substep is visited again,
# back and forth. A heap of 1000 boxes of 0.2 m overlaps by 0.9 mm 5 s after it fell, and by 6 mm
# without, and takes a tenth less time: what is not settled moves, and is detected anew.
MUCH = 0.1


@part
def solve_contacts(c: Arguments) -> None:
    """
    Advance all bodies by one step, those with a slot in `c.work.solver.bodies` with contacts.

    Both halves of the bodies are solved side by side; what is across waits for both.
    """
    work, substeps = c.work.solver, c.settings.sequential.substeps
    notes = work.notes
    # Whatever an earlier step had in regions that this one does not have.
    work.blocks.count[:], notes[:], work.impacts.listed[:] = 0, 0.0, 0
    _in_all(c, FILL)
    solve_directly(c, LIST)
    if _is_any_new(c):
        _begin_new(c)
    _in_all(c, APPROACH)
    for substep in range(substeps):
        if _wait(notes):
            _solve_impacts(c)
        solve_directly(c, BEGIN)
        _in_all(c, SETTLE_AND_SWEEP if substep == 0 else KICK_AND_SWEEP)
        if _is_unsettled(notes):
            _in_all_back(c, AGAIN_BACK)
            _in_all(c, AGAIN)
        solve_directly(c, BEAR)
        _in_all_back(c, RETURN)
        _across(c, DRIFT)
    _in_all(c, KEEP)
    work.overlap[0] = max(notes[0, DEEPEST], max(notes[1, DEEPEST], notes[2, DEEPEST]))
    work.residual[0] = max(notes[0, LARGEST], max(notes[1, LARGEST], notes[2, LARGEST]))


@kernel
def _is_halved(c: Arguments) -> bool:
    return c.work.solver.sides.cut.halved[0] == 1


@apart
def _in_halves(c: Arguments, stage: int) -> None:
    if _is_halved(c):
        side_by_side(c.job, address_of(solve_part, c), c, REGIONS * stage, REGIONS * stage + 1)
    else:
        solve_part(c, REGIONS * stage)


@kernel
def _across(c: Arguments, stage: int) -> None:
    if _is_halved(c):
        solve_part(c, REGIONS * stage + BETWEEN)


@kernel
def _in_all(c: Arguments, stage: int) -> None:
    """Run a stage of the solver in both halves, and then between them."""
    _in_halves(c, stage)
    _across(c, stage)


@kernel
def _in_all_back(c: Arguments, stage: int) -> None:
    """Run a stage of the solver between the halves, and then in both."""
    _across(c, stage)
    _in_halves(c, stage)


@part
def move_solved(c: Arguments) -> None:
    """Move the bodies that were solved, and those that nothing touches."""
    if _is_halved(c):
        side_by_side(c.job, address_of(store_part, c), c, 0, 1)
    else:
        store_part(c, 0)
    fly_free(c.model, c.state, c.work.loads, c.work.solver.bodies.flies, c.model.h, c.work.block)


@kernel
def _wait(notes: Array) -> bool:
    """Return whether anything waits for its part in an impact."""
    return bool(notes[0, WAITING] + notes[1, WAITING] + notes[2, WAITING] > 0.0)


@kernel
def _is_unsettled(notes: Array) -> bool:
    """Return whether the latest sweep changed anything by much."""
    return bool(notes[0, UNSETTLED] + notes[1, UNSETTLED] + notes[2, UNSETTLED] > 0.0)


@kernel
def _solve_impacts(c: Arguments) -> None:
    """Visit what approaches, and what that reaches, until nothing waits."""
    for turn in range(TURNS):
        if turn == 0 or turn == PATIENCE:
            solve_directly(c, STRIKE_UNEVEN if turn == 0 else STRIKE)
        _across(c, IMPACT_BACK)
        _in_all(c, IMPACT)
        if not _wait(c.work.solver.notes):
            break


# What waits in a small island after so many turns is solved directly.
PATIENCE = 8
# The stages of small islands: find them; solve an impact, of the uneven ones or of all; see what
# those of uneven masses begin with; find what bears the forces.
LIST, STRIKE_UNEVEN, STRIKE, BEGIN, BEAR = range(5)


@by_address
def solve_directly(c: Arguments, stage: int) -> int:
    """Do a stage for the small islands."""
    work, substeps = c.work.solver, c.settings.sequential.substeps
    what = _sweep_of(stage == BEAR, work.notes[0, SUBSTEP], c.model.h / substeps, substeps)
    if stage == LIST:
        few = current(c.memory).count[0] <= FEW
        if few or c.uses.uneven == 1:
            find_islands(few, work.blocks, work.bodies, c.work.direct.islands)
        else:
            c.work.direct.islands.count[0] = c.work.direct.islands.blocks[0] = 0
    elif stage == BEGIN:
        if c.uses.uneven == 1:
            temper_warm_start(work.blocks, work.bodies, c.model.h / substeps, work.impacts,
                              c.work.direct.islands)
    elif stage == BEAR:
        bear_islands(work.blocks, work.bodies, work.fresh, what, c.work.direct)
        push_islands(work.blocks, work.bodies, what, c.settings.sequential.push * what.inv_h,
                     c.work.direct)
    else:
        strike_islands(stage == STRIKE, work.blocks, work.bodies, what, work.impacts,
                       c.work.direct)
    return 0


@kernel
def _sweep_of(forces: bool, substep: float, h: float, substeps: int) -> Sweep:
    """Return what visits of a substep of h [s] are for."""
    # An impact is at the start of a substep; forces hold contacts to their geometry at its end.
    return Sweep(1.0 / h, forces, (substep + (1.0 if forces else 0.0)) / substeps - 0.5)


# Visits to a block with new contacts. A box that is put down on a slope slips by 1e-7 m until its
# pressure has moved to where friction wants it; with 6 visits before the first sweep by 1e-10 m.
FRESH_VISITS = 6
# Rounds of sweeps, forth and back, in islands that are new: without them the boxes of a pyramid of
# 20 rows move by 3.4 mm before its impulses have grown, with them by 0.6 mm.
NEW_ROUNDS = 50


@kernel
def _is_any_new(c: Arguments) -> bool:
    """Return whether any island is new, and find them."""
    work = c.work.solver
    new = work.notes[0, NEW] + work.notes[1, NEW] + work.notes[2, NEW]
    return bool(new > 0.0) and find_new_islands(work.blocks, work.bodies, work.fresh, work.begin)


@kernel
def _begin_new(c: Arguments) -> None:
    """Find the impulses to begin with in islands that are new: those that bear the forces."""
    work = c.work.solver
    _in_all(c, KICK_NEW)
    for _ in range(NEW_ROUNDS):
        _in_all(c, SWEEP_NEW)
        _in_all_back(c, SWEEP_NEW_BACK)
        if not end_round(work.blocks, work.bodies, work.begin):
            break
    _in_all(c, UNKICK_NEW)


@by_address
def solve_part(c: Arguments, number: int) -> int:
    """
    Do a stage in a region, by the number REGIONS * stage + region.

    0 and 1, the halves, have bodies; 2, BETWEEN, has only contacts. Impulses of the manifolds are
    those to begin with, and afterwards those of this step; those of the whole step are added to
    what collisions wrote.
    """
    stage, region = number // REGIONS, number % REGIONS
    work, h = c.work.solver, c.model.h / c.settings.sequential.substeps
    bodies, blocks, notes, impacts = work.bodies, work.blocks, work.notes[region], work.impacts
    motion = bodies.motion
    what = _sweep_of(stage not in (APPROACH, IMPACT_BACK, IMPACT), notes[SUBSTEP], h,
                     c.settings.sequential.substeps)
    # What gravity does in a substep: below it an approach is the work of forces, not an impact.
    slow = h * norm((c.model.gravity[0], c.model.gravity[1], c.model.gravity[2]))
    if stage == FILL:
        _fill(c, region)
    elif stage == APPROACH:
        waits = find_approaching(region, blocks, motion, what, slow, impacts)
        notes[WAITING] = 1.0 if waits else 0.0
    elif stage == IMPACT_BACK:
        visit_waiting(region, True, blocks, motion, bodies.used, what, slow, impacts)
    elif stage == IMPACT:
        waits = pass_on(region, blocks, motion, bodies.used, what, slow, impacts)
        notes[WAITING] = 1.0 if waits else 0.0
    elif stage == KICK_NEW:
        excuse_approaches(region, blocks, motion, work.begin)
        if region != BETWEEN:
            kick_new(region, True, bodies, h, work.begin)
    elif stage == UNKICK_NEW:
        forget_excuses(region, blocks, work.begin)
        if region != BETWEEN:
            kick_new(region, False, bodies, h, work.begin)
    elif stage in (SWEEP_NEW, SWEEP_NEW_BACK):
        sweep_new(region, stage == SWEEP_NEW_BACK, blocks, bodies, what, work.begin)
    elif stage in (KICK_AND_SWEEP, SETTLE_AND_SWEEP):
        end_impacts(region, blocks, motion, bodies.drifted, impacts)
        _kick(region, bodies, h)
        if stage == SETTLE_AND_SWEEP:
            settle(region, blocks, work.fresh, motion, what)
        notes[UNSETTLED] = 1.0 if sweep(region, blocks, motion, what, MUCH * slow) else 0.0
    elif stage in (AGAIN_BACK, AGAIN):
        visit_unsettled(region, stage == AGAIN_BACK, blocks, motion, what, MUCH * slow)
    elif stage == RETURN:
        _return(region, what, c.settings.sequential.push / h, work)
    if (stage == RETURN and region != BETWEEN) or stage == DRIFT:
        _drift(region, what, slow, h, work)
    elif stage == KEEP:
        notes[LARGEST] = store_impulses(
            region, blocks, work.coloring, current(c.memory), c.work.prediction, bodies, h,
            c.settings.sequential.substeps, work.shifted[0] == 1, step_impulses(c.memory))
    return 0


@kernel
def _kick(region: int, bodies: SolverBodies, h: float) -> None:
    """Let forces act on the bodies of a region for a substep of h [s]."""
    if region != BETWEEN:
        kick_bodies(region, bodies.used, bodies.motion, bodies.smooth, bodies.alike[0] == 1,
                    bodies.base, h)


@kernel
def _drift(region: int, what: Sweep, slow: float, h: float, work: SequentialWork) -> None:
    """Move the bodies of a region for a substep of h [s], and see what meets."""
    bodies, notes = work.bodies, work.notes[region]
    if region != BETWEEN:
        drift_bodies(region, bodies.used, bodies.motion, bodies.drifted, bodies.total,
                     bodies.smooth, bodies.alike[0] == 1, bodies.base, h, notes[PUSHED] > 0.0)
    meets = drift_blocks(region, work.blocks, bodies.drifted, h, what, slow, work.impacts)
    notes[WAITING], notes[SUBSTEP] = 1.0 if meets else 0.0, notes[SUBSTEP] + 1.0


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


@by_address
def store_part(c: Arguments, half: int) -> int:
    """Write the bodies of a half back to the state, at the end of a step."""
    model, work = c.model, c.work.solver
    first, last = shared_out(work.sides, half)
    store_bodies(half, first, last, model.h, model.m, model.inv_m, model.inv_I_C, c.state,
                 work.bodies, c.settings.sequential.substeps)
    return 0


@kernel
def _fill(c: Arguments, region: int) -> None:
    """Bring the bodies and the manifolds of a region into blocks."""
    model, state, work, sides = c.model, c.state, c.work.solver, c.work.solver.sides
    manifolds, activity = current(c.memory), c.work.collision.activity
    shifted = work.shifted[0] == 1
    if region != BETWEEN:
        give_slots(region, sides, c.memory.touching, work.bodies)
        load_bodies(region, model.h, model.gravity, model.inv_m, model.inv_I_C, state,
                    c.work.loads, work.bodies)
        choose_manifolds(region, manifolds, sides, activity, work.coloring)
    classify_blocks(region, c.shapes.material, c.materials, c.work.round_shapes,
                    c.work.collision.body, shifted, manifolds, work.bodies, work.coloring)
    coloring, blocks, bodies = work.coloring, work.blocks, work.bodies
    begin_blocks(region, blocks)
    for begin in range(0, coloring.members[region], PIECE):
        end = min(begin + PIECE, coloring.members[region])
        block = first_block(blocks, region) + blocks.count[region]
        colors = color_piece(region, begin, end, manifolds.body_a, manifolds.body_b, bodies.slot,
                             coloring)
        make_room(region, begin, end, colors, coloring, blocks)
        place_lanes(region, begin, end, block, manifolds, bodies, coloring, blocks)
        fill_blocks(region, block, manifolds, c.work.prediction, state.x, activity, c.shapes,
                    c.materials, c.work.collision.body, shifted,
                    1.0 / c.settings.sequential.substeps, bodies, blocks, work.fresh,
                    work.notes[region])
    if region == BETWEEN:
        begin = first_block(blocks, region)
        mark_astride(begin * LANES, (begin + blocks.count[region]) * LANES, blocks.at_A,
                     blocks.at_B, bodies.astride)


@part
def sweep(region: int, blocks: Blocks, motion: Array, what: Sweep, much: float) -> bool:
    """
    Visit every block of a region once, and note what is left to do.

    Returns whether any lane is UNSETTLED: changed by more than `much` [m/s].

    `sweep_back` goes in the opposite order, so that both make a nearly symmetric iteration: its
    errors decay, while those of a one-sided one also rotate, and the warm start, an extrapolation,
    would make that a growing sway of a stack.
    """
    first, count, unsettled = first_block(blocks, region), blocks.count[region], 0
    for block in range(first, first + count):
        if count > CACHED:
            fetch_block(blocks, block + 1)
        bits, residual = awake_in(blocks, block), spread(0.0)
        if bits != 0:
            residual = visit_block(blocks, block, motion, what, bits)
        note_left(blocks, block, residual, what)
        blocks.unsettled[block] = bits_of(residual > much) & blocks.left[block] // CHANGED
        unsettled |= blocks.unsettled[block]
    return unsettled != 0


@kernel
def visit_unsettled(region: int, backwards: bool, blocks: Blocks, motion: Array, what: Sweep,
                    much: float) -> None:
    """
    Visit what the latest visits changed by more than `much` [m/s].

    Lane by lane, so that what happens elsewhere does not change how often one is visited.
    """
    first, count = first_block(blocks, region), blocks.count[region]
    for k in range(count):
        block = first + (count - 1 - k if backwards else k) & INDEX
        bits = blocks.unsettled[block]
        if bits != 0:
            blocks.unsettled[block] = visit_lanes(blocks, block, motion, what, bits, SETTLED, much)


@part
def settle(region: int, blocks: Blocks, fresh: IntArray, motion: Array, what: Sweep) -> None:
    """Visit the blocks of a region that have new contacts."""
    first = first_block(blocks, region)
    for block in range(first, first + blocks.count[region]):
        bits = fresh[block] & awake_in(blocks, block)
        for _ in range(FRESH_VISITS):
            if bits == 0:
                break
            # Lane by lane: who else is in the block must not change how often one is visited.
            bits = visit_lanes(blocks, block, motion, what, bits, SETTLED, 0.0)


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
