# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The contact model `timestep`: velocity level, for real time and for many bodies.

A step detects contacts once, lets what bounces bounce, and leaves touching bodies to a solver;
bodies that touch nothing fly as if there were no contacts at all, by the symplectic method.
"""

from typing import Any, NamedTuple

from numba import types
import numpy as np

from rigid_sim_ros.engine.constraints.contact_prediction import (
    make_prediction, predict_contacts, Prediction)
from rigid_sim_ros.engine.contact.collisions import (
    collide_bodies, CollisionWork, make_collision_work)
from rigid_sim_ros.engine.detection.detect import detect_stage, search_pair, WHOLE
from rigid_sim_ros.engine.detection.manifolds import (
    current, current_manifolds, earlier, grown, Manifolds, Memory, NO_SEARCH, rows_in_use)
from rigid_sim_ros.engine.detection.narrow_phase.collide import BOXES, CAPSULES, CONVEX, FAMILY
from rigid_sim_ros.engine.detection.parallel_detection import (
    detect_side_by_side, in_half, PLACE, REFRESH, share_stage)
from rigid_sim_ros.engine.dynamics.forces import add_scene_forces
from rigid_sim_ros.engine.dynamics.free_flight import BLOCK_SIZE as FLIGHT_SIZE, fly
from rigid_sim_ros.engine.dynamics.integrate import begin_loads, end_loads
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic, move_kinematic
from rigid_sim_ros.engine.dynamics.loads import empty_loads, kick, Loads
from rigid_sim_ros.engine.dynamics.wrenches import count_down, Wrenches
from rigid_sim_ros.engine.maths.vector import column, norm
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import CAPSULE, CYLINDER, Materials, PLANE, Shapes, SPHERE
from rigid_sim_ros.engine.solver.coloring import REGIONS
from rigid_sim_ros.engine.solver.direct_islands import differ
from rigid_sim_ros.engine.solver.direct_solve import Direct, make_direct
from rigid_sim_ros.engine.solver.partition import (
    begin_slots, choose_cut, Cut, ENOUGH, is_by_number, mark_touching, take_sides)
from rigid_sim_ros.engine.solver.sequential import (
    do_direct_stage, do_stage, make_work as make_sequential_work, SequentialSettings,
    SequentialWork, solve_contacts, store_half)
from rigid_sim_ros.engine.solver.sleeping import (
    fall_asleep, keep_pressing, mark_pushed, Rest, wake_disturbed, wake_touched)
from rigid_sim_ros.engine.state.body_order import middle_of
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.argument_pack import call, held, Kept
from rigid_sim_ros.kernels.arrays import Array, IntArray, integers
from rigid_sim_ros.kernels.kernel import apart, INDEX, kernel
from rigid_sim_ros.kernels.second_core import Helper, is_helped, make_desk
from rigid_sim_ros.kernels.separate import compile_late, compile_together


class TimestepSettings(NamedTuple):
    """The parameters of the model."""

    sequential: SequentialSettings = SequentialSettings()
    # contacts are found this far ahead, as a part of the half thickness of what may move: less
    # misses some, more costs time
    margin: float = 0.01
    bounce_speed: float = 1e-3  # [m/s] what approaches slower does not bounce
    sleep_steps: int = 0  # what has been at rest for so many steps sleeps; 0: nothing does


class TimestepWork(NamedTuple):
    """Buffers; only the impulses of the last step are worth reading afterwards."""

    loads: Loads
    later: Loads
    plain: IntArray  # (1,) 1 if the loads are those of gravity alone, as in most steps
    block: Array
    radius: Array  # (n,) [m] how far the shapes of a body reach from its centre of mass
    thickness: Array  # (s,) [m] half of the least that a shape measures across; of a plane 0
    round_shapes: IntArray  # (s,) 1: a ball about its centre of mass, or a body that never moves
    prediction: Prediction
    collision: CollisionWork
    solver: SequentialWork
    direct: Direct


def make_timestep_work(model: Model, shapes: Shapes, memory: Memory) -> TimestepWork:
    """Return buffers for a world whose manifolds live in `memory`."""
    n, capacity = model.m.shape[0], memory.pages[0].shape_a.shape[0]
    radius = np.zeros(n)
    for s in range(shapes.body.shape[0]):
        if shapes.kind[s] != PLANE:
            reach = float(np.linalg.norm(shapes.p_CS[s])) + shapes.bound[s]
            radius[shapes.body[s]] = max(radius[shapes.body[s]], reach)
    return TimestepWork(empty_loads(n), empty_loads(n), integers(1), np.zeros(FLIGHT_SIZE), radius,
                        _thickness(shapes), _round_shapes(model, shapes),
                        make_prediction(n, shapes.body.shape[0], capacity),
                        make_collision_work(n, capacity),
                        make_sequential_work(n, _middle(model, shapes.body), capacity),
                        make_direct(n, capacity))


def with_cut(work: TimestepWork, cut: Cut) -> TimestepWork:
    """Return buffers, the same, for a world that is cut in this way."""
    for there, field in zip(work.solver.sides.cut, cut, strict=True):
        there[:] = field
    return work


def _thickness(shapes: Shapes) -> Array:
    kind, size = shapes.kind, shapes.size
    least = np.where((kind == SPHERE) | (kind == CAPSULE), size[:, 0], size.min(axis=1))
    least = np.where(kind == CYLINDER, size[:, :2].min(axis=1), least)
    return np.where(kind == PLANE, 0.0, least)


def _round_shapes(model: Model, shapes: Shapes) -> IntArray:
    i = shapes.body
    alike = (model.inv_I_C[:, i] == model.inv_I_C[0, i]).all(axis=0)
    return np.where((shapes.ball == 1) & alike | (model.inv_m[i] == 0.0), 1, 0)


def _middle(model: Model, body: IntArray) -> tuple[int, int]:
    """
    Return the first body of the second half by number, and its first shape.

    Not quite in the middle where else a body would be on both sides.
    """
    before, after = np.maximum.accumulate(body), np.minimum.accumulate(body[::-1])[::-1]
    places = 1 + np.flatnonzero(before[:-1] < after[1:])
    later = places[after[places] >= middle_of(model.inv_m)]
    if len(later) == 0:
        return len(model.m), len(body)
    return int(after[later[0]]), int(later[0])


def advance(model: Model, state: State, wrenches: Wrenches, shapes: Shapes, materials: Materials,
            memory: Memory, settings: TimestepSettings, work: TimestepWork, rest: Rest,
            count: int, kept: Kept | None = None,
            helper: Helper | None = None) -> tuple[Memory, TimestepWork]:
    """
    Advance the state by `count` steps; return the memory and the buffers, which may have grown.

    The state, the wrenches' remaining steps, the memory and who sleeps change in place. A world
    that is stepped often keeps its arguments in `kept` from call to call. A helper takes over
    halves of what many contacts need; the results are the same bits.
    """
    done, kept = 0, kept or Kept(PIECES)
    desk = None if helper is None else helper.desk
    while True:
        box = boxed(kept, model, state, wrenches, shapes, materials, memory, settings, work, rest,
                    desk)
        if kept.compiled_for is not box:
            kinds = box.type, types.int64
            kept.addresses[:] = compile_together(
                _advance_kept, kinds, *_pieces(model, shapes, materials, settings,
                                               helper is not None), _SHARED_OUT)
            kept.compiled_for = box
        some = count - done if helper is None else min(count - done, _STEPS_WITHOUT_HELP)
        if helper is None or current_manifolds(memory).count[0] < ENOUGH:
            taken = box.run(_advance_kept, some)
        else:
            with helper:
                taken = box.run(_advance_kept, some)
        done += taken
        if done == count:
            return memory, work
        if taken == some:
            continue
        if memory.counters[NO_SEARCH] != 0:
            memory.counters[NO_SEARCH] = 0
            kept.addresses[_TO_SEARCH] = compile_late(_search, box.type)
            continue
        memory = grown(memory)
        if memory.pages[0].shape_a.shape[0] > work.collision.rows.shape[0]:
            work = with_cut(make_timestep_work(model, shapes, memory), work.solver.sides.cut)


def boxed(kept: Kept, model: Model, state: State, wrenches: Wrenches, shapes: Shapes,
          materials: Materials, memory: Memory, settings: TimestepSettings, work: TimestepWork,
          rest: Rest, desk: IntArray | None = None) -> Any:
    """Return the box that the kernels of a step get; without a desk nobody helps."""
    return kept.box(model, state, wrenches, shapes, materials, memory, settings, work, rest,
                    kept.addresses, _NOBODY if desk is None else desk)


# Steps in one call of a world that a helper may help, for until the next one nobody calls it.
_STEPS_WITHOUT_HELP = 64
# The arguments in a box, by their places in it.
(_MODEL, _STATE, _WRENCHES, _SHAPES, _MATERIALS, _MEMORY, _SETTINGS, _WORK, _REST, _ADDRESSES,
 _DESK) = range(11)
_NOBODY = make_desk()


# A stage besides those of `detect_stage`: to choose where the world is cut.
_CUT = 8


@kernel
def _detect(box: Any, stage: int) -> int:
    if stage == _CUT:
        choose_cut(held(box, _MODEL).inv_m, held(box, _STATE).x, held(box, _REST).asleep,
                   current(held(box, _MEMORY)), held(box, _WORK).solver.sides)
        return 1
    return int(detect_stage(stage, held(box, _MODEL), held(box, _STATE), held(box, _SHAPES),
                            held(box, _MEMORY), held(box, _ADDRESSES)[_TO_SEARCH], box))


@kernel
def _search(box: Any, number: int) -> int:
    return search_pair(number, held(box, _SHAPES), held(box, _MEMORY))


@kernel
def _share(box: Any, stage: int) -> int:
    sides = held(box, _WORK).solver.sides
    first = sides.middle[0], sides.middle[1]
    if PLACE <= stage < REFRESH:
        some, bodies = in_half(stage - PLACE, first, held(box, _STATE), held(box, _SHAPES))
        _begin(box, some, bodies)
    return int(share_stage(
        stage, held(box, _MODEL), held(box, _STATE), held(box, _SHAPES), held(box, _MEMORY),
        first, is_by_number(sides.cut)))


@kernel
def _begin(box: Any, shapes: tuple[int, int], bodies: tuple[int, int]) -> None:
    """Find how far ahead some shapes look, and on which side of the cut some bodies are."""
    model, state, solver = held(box, _MODEL), held(box, _STATE), held(box, _WORK).solver
    take_sides(model.inv_m, state.V, state.x, held(box, _REST).asleep, bodies[0], bodies[1],
               solver.sides, solver.bodies.slot, solver.bodies.flies)
    look_ahead(model.h, model.inv_m, model.inv_I_C, state.P, state.L, state.V,
               held(box, _SETTINGS), held(box, _WORK).radius, held(box, _WORK).thickness,
               held(box, _SHAPES).body, held(box, _MEMORY), shapes[0], shapes[1])


@kernel
def _predict(box: Any, _: int) -> int:
    memory, work = held(box, _MEMORY), held(box, _WORK)
    predict_contacts(
        held(box, _MODEL), held(box, _STATE), work.loads, held(box, _SHAPES), current(memory),
        memory.ahead, memory.calm, work.collision.waits, work.prediction, memory.scratch)
    return 0


@kernel
def _collide(box: Any, _: int) -> int:
    model, memory, work = held(box, _MODEL), held(box, _MEMORY), held(box, _WORK)
    acted = earlier(memory)
    return collide_bodies(
        model.h, model.inv_m, model.inv_I_C, held(box, _STATE), work.loads.F, held(box, _SHAPES),
        held(box, _MATERIALS), current(memory), held(box, _SETTINGS).bounce_speed, acted.impulse,
        acted.friction, work.collision)


@kernel
def _solve(box: Any, number: int) -> int:
    memory, work = held(box, _MEMORY), held(box, _WORK)
    do_stage(number // REGIONS, number % REGIONS, held(box, _MODEL), held(box, _STATE), work.loads,
             held(box, _SHAPES), held(box, _MATERIALS), work.round_shapes, current(memory),
             earlier(memory), work.prediction, work.collision.waits, memory.touching,
             work.collision.body, held(box, _SETTINGS).sequential, work.solver)
    return 0


@kernel
def _solve_directly(box: Any, stage: int) -> int:
    work = held(box, _WORK)
    do_direct_stage(stage, held(box, _MODEL).h, held(box, _SETTINGS).sequential.substeps,
                    work.solver, work.direct)
    return 0


@kernel
def _store(box: Any, half: int) -> int:
    store_half(half, held(box, _MODEL), held(box, _STATE),
               held(box, _SETTINGS).sequential.substeps, held(box, _WORK).solver)
    return 0


@kernel
def _add_forces(box: Any, later: int) -> int:
    model, state, work = held(box, _MODEL), held(box, _STATE), held(box, _WORK)
    if later == 1:
        add_scene_forces(model, state, work.later)
    else:
        add_scene_forces(model, state, work.loads)
    return 0


_DISTURBED, _TOUCHED, _AFTERWARDS = range(3)    # the parts of a step in which bodies wake or sleep


@kernel
def _sleep(box: Any, when: int) -> int:
    model, state, work = held(box, _MODEL), held(box, _STATE), held(box, _WORK)
    memory, rest = held(box, _MEMORY), held(box, _REST)
    manifolds, acted = current(memory), earlier(memory)
    if when == _DISTURBED:
        wake_disturbed(model.inv_m, state, work.loads, manifolds, rest)
    elif when == _TOUCHED:
        wake_touched(model.h, model.inv_m, model.inv_I_C, state, work.radius, manifolds, rest)
    else:
        keep_pressing(manifolds, work.solver.bodies.slot, rest, acted.impulse, acted.friction)
        fall_asleep(model.inv_m, model.inv_I_C, state, work.loads, work.radius, manifolds,
                    held(box, _SETTINGS).sleep_steps, rest)
    return 0


# What is compiled apart from the step, by place; the first three by a helper: they take as long
# as all others together.
(_TO_DETECT, _TO_STORE, _TO_PREDICT, _TO_SEARCH, _TO_COLLIDE, _TO_SOLVE, _TO_FORCES, _TO_SLEEP,
 _TO_SHARE, _TO_DIRECT) = range(10)
PIECES, _SHARED_OUT = 10, 4
ALWAYS = [_detect, _store]    # what every world has a helper compile


def _pieces(model: Model, shapes: Shapes, materials: Materials, settings: TimestepSettings,
            helped: bool) -> tuple[list[Any], set[int]]:
    """
    Return what a world needs, None in the place of a piece that is never called.

    With the places of those that hardly ever are: two boxes need a search when nothing else tells
    which way is out.
    """
    kinds = np.unique(shapes.kind)
    families = FAMILY[np.ix_(kinds, kinds)]
    searched = np.isin(families, (CAPSULES, CONVEX)).any()
    return [_detect, _store, _predict, _search if searched or (families == BOXES).any() else None,
            _collide if (materials.restitution > 0.0).any() else None, _solve,
            _add_forces if model.forces.kind.shape[0] > 0 else None,
            _sleep if settings.sleep_steps > 0 else None,
            _share if helped else None,
            _solve_directly if differ(model.inv_m) else None,
            ], set() if searched else {_TO_SEARCH}


@apart
def _sum_loads(box: Any, to: IntArray, loads: Loads, later: int) -> None:
    """Do what `sum_loads` does, the forces of the scene by address."""
    model, state = held(box, _MODEL), held(box, _STATE)
    begin_loads(model, state, loads)
    if model.forces.kind.shape[0] > 0:
        call(to[_TO_FORCES], box, later)
    end_loads(model, state, held(box, _WRENCHES), loads)


@kernel
def _advance_kept(box: Any, count: int) -> int:
    """Take steps until `count` are done or a buffer is too small; return how many were done."""
    for step in range(count):
        if not _step(box):
            return step
    return count


@kernel
def _step(box: Any) -> bool:
    """Take a step; return whether it was done, not left at its beginning for want of room."""
    model, state, wrenches = held(box, _MODEL), held(box, _STATE), held(box, _WRENCHES)
    shapes, memory, settings = held(box, _SHAPES), held(box, _MEMORY), held(box, _SETTINGS)
    work, rest = held(box, _WORK), held(box, _REST)
    to, desk = held(box, _ADDRESSES), held(box, _DESK)
    g, sleeps = model.gravity, settings.sleep_steps > 0
    loaded = model.forces.kind.shape[0] + wrenches.in_use[0] > 0
    # What moves by its twist feels no gravity: the loads are not those of gravity alone.
    loaded = begin_kinematic(model, state) or loaded
    if sleeps:
        _sum_loads(box, to, work.loads, 0)
        mark_pushed(wrenches, rest)
        call(to[_TO_SLEEP], box, _DISTURBED)
    many, cut = current(memory).count[0] >= ENOUGH, work.solver.sides.cut
    if not many:
        cut.halved[0], cut.left[0] = 0, 0
    elif cut.left[0] == 0:
        call(to[_TO_DETECT], box, _CUT)
    if many and is_helped(desk):
        found = detect_side_by_side(to[_TO_DETECT], to[_TO_SHARE], box, desk, memory.left,
                                    memory.counters)
    else:
        _begin(box, (0, shapes.body.shape[0]), (0, state.x.shape[1]))
        found = call(to[_TO_DETECT], box, WHOLE)
    if found == 0:
        return False
    manifolds, acted = current(memory), earlier(memory)
    if manifolds.count[0] == 0 and not loaded and not sleeps:
        fly(model, state, (g[0], g[1], g[2]), model.h, np.int64(1), work.block)
        end_kinematic(model, state)
        return True
    if sleeps:
        call(to[_TO_SLEEP], box, _TOUCHED)
        take_sides(model.inv_m, state.V, state.x, rest.asleep, 0, model.m.shape[0],
                   work.solver.sides, work.solver.bodies.slot, work.solver.bodies.flies)
    elif loaded or work.plain[0] == 0:
        _sum_loads(box, to, work.loads, 0)
        work.plain[0] = 0 if loaded else 1
    if sleeps or to[_TO_COLLIDE] != 0:
        # Of all others the solver writes them.
        clear_impulses(manifolds, acted.impulse, acted.friction)
    call(to[_TO_PREDICT], box, 0)
    if to[_TO_COLLIDE] != 0:
        work.solver.shifted[0] = 1 if call(to[_TO_COLLIDE], box, 0) > 0 else 0
        mark_touching(manifolds, work.collision.waits, memory.touching)
    work.solver.bodies.alike[0] = 0 if loaded else 1
    begin_slots(work.solver.sides, memory.touching, work.solver.bodies)
    solve_contacts(to[_TO_SOLVE], to[_TO_STORE], to[_TO_DIRECT], box, desk, model, state,
                   work.loads, settings.sequential.substeps, work.block, work.solver)
    move_kinematic(model, state, model.h)
    if loaded:
        # As in the symplectic method: half of the change of the loads, now at the new poses.
        _sum_loads(box, to, work.later, 1)
        kick(state, work.later, 0.5 * model.h)
        kick(state, work.loads, -0.5 * model.h)
    if sleeps:
        call(to[_TO_SLEEP], box, _AFTERWARDS)
    end_kinematic(model, state)
    count_down(wrenches)
    cut.left[0] = max(cut.left[0] - 1, 0)
    return True


@kernel
def look_ahead(h: float, inv_m: Array, inv_I_C: Array, P: Array, L: Array, V: Array,
               settings: TimestepSettings, radius: Array, thickness: Array, body: IntArray,
               memory: Memory, first: int, last: int) -> None:
    """
    Write how far ahead some shapes look for contacts [m]: a margin, and as far as they move.

    So nothing passes what is thinner than its way in a step, or is met late. thickness (s,) [m] is
    half of the least that a shape measures across.
    """
    for s in range(first, last):
        i = body[s] & INDEX
        v = inv_m[i] * norm(column(P, i)) + norm((V[0, i], V[1, i], V[2, i]))
        # Not below |w|, which would need the attitude.
        w = max(inv_I_C[0, i], inv_I_C[1, i], inv_I_C[2, i]) * norm(column(L, i))
        w += norm((V[3, i], V[4, i], V[5, i]))
        way = (v + w * radius[i]) * h
        memory.calm[s] = settings.margin * thickness[s] if inv_m[i] > 0.0 else 0.0
        memory.ahead[s] = memory.calm[s] + way


@kernel
def clear_impulses(manifolds: Manifolds, normal_impulse: Array, friction_impulse: Array) -> None:
    """Forget the impulses of the last step, as far as this one has points."""
    first, count = rows_in_use(manifolds)
    friction_impulse[first:first + count] = 0.0
    for k in range(count):
        r = (first + k) & INDEX
        for p in range(manifolds.points[r]):
            normal_impulse[p, r] = 0.0
