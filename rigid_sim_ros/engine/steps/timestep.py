# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The contact model `timestep`: velocity level, for real time and for many bodies.

A step detects contacts once, lets what bounces bounce, and leaves touching bodies to a solver;
bodies that touch nothing fly as if there were no contacts at all, by the symplectic method.
"""

from typing import Any

import numpy as np

from rigid_sim_ros.engine.constraints.contact_prediction import predict_contacts
from rigid_sim_ros.engine.constraints.next_touch import find_next_touches
from rigid_sim_ros.engine.contact.collisions import collide_bodies, collide_candidates, ROUNDS
from rigid_sim_ros.engine.detection.carried_impulses import clear_impulses
from rigid_sim_ros.engine.detection.detect import detect_part, SEAMS, THROWN, WHOLE
from rigid_sim_ros.engine.detection.manifolds import (
    current, current_manifolds, grown, NO_SEARCH, step_impulses)
from rigid_sim_ros.engine.detection.narrow_phase.collide import BOXES, FAMILY, SEARCHED
from rigid_sim_ros.engine.detection.pair_manifold import search
from rigid_sim_ros.engine.detection.thrown_margins import SEARCHES, widen_margins
from rigid_sim_ros.engine.dynamics.force_and_torque import Loads
from rigid_sim_ros.engine.dynamics.forces import add_scene_forces
from rigid_sim_ros.engine.dynamics.free_flight import fly
from rigid_sim_ros.engine.dynamics.integrate import (
    begin_loads, end_loads, kick_by_change, kick_drift_kick)
from rigid_sim_ros.engine.dynamics.kinematic import begin_kinematic, end_kinematic, move_kinematic
from rigid_sim_ros.engine.dynamics.wrenches import count_down
from rigid_sim_ros.engine.solver.arguments import Arguments, with_memory
from rigid_sim_ros.engine.solver.parallel_detection import (
    detect_in_parallel, set_margins_and_sides, share_part, take_sides_of)
from rigid_sim_ros.engine.solver.partition import (
    begin_slots, choose_cut, MANIFOLDS_TO_HALVE, mark_touching)
from rigid_sim_ros.engine.solver.passages import end_ways, hit_what_stopped, is_any_fast
from rigid_sim_ros.engine.solver.sequential import (
    move_solved, solve_contacts, solve_directly, solve_part, store_part)
from rigid_sim_ros.engine.solver.sleeping import (
    fall_asleep, keep_pressing, mark_pushed, wake_disturbed, wake_touched)
from rigid_sim_ros.engine.solver.turned_energy import gains_any_by_turning, take_back_gains
from rigid_sim_ros.kernels.argument_pack import ArgumentPack, packed
from rigid_sim_ros.kernels.kernel import apart, kernel
from rigid_sim_ros.kernels.second_core import Helper, is_helped
from rigid_sim_ros.kernels.separate import by_address, link, link_late, NO_NUMBER, Pieces

# Steps in one call of a world that a helper may help, for until the next one nobody calls it.
_STEPS_WITHOUT_HELP = 64


@kernel
def step(c: Arguments) -> bool:
    """Take a step; return whether it was done, not left at its beginning for want of room."""
    if not find_contacts(c):
        return False
    if is_free_flight(c):
        fly_all(c, np.int64(1))
    else:
        respond(c)
    end_step(c)
    return True


@kernel
def find_contacts(c: Arguments) -> bool:
    """Find what is near each other as a step begins; return whether there was room for it."""
    begin_step(c)
    apply_forces(c)
    wake_disturbed_islands(c)
    return detect(c)


@kernel
def respond(c: Arguments) -> None:
    """Move all bodies by a step, with the contacts that were found."""
    wake_touched_islands(c)
    move(c)
    let_islands_sleep(c)


@kernel
def move(c: Arguments) -> None:
    """Move all bodies that are awake by a step."""
    predict(c)
    bounce(c)
    solve(c)
    apply_later_forces(c)


@kernel
def advance_steps(c: Arguments, count: int) -> int:
    """Take steps until `count` are done or a buffer is too small; return how many were done."""
    for done in range(count):
        if not step(c):
            return done
    return count


FIND, MOVE = range(2)


@kernel
def take_half(c: Arguments, half: int) -> int:
    """
    Find contacts, or move bodies: the halves of a step; return 1 if it was done, else 0.

    Who wakes in between, and sleeps at its end, is for the caller to decide.
    """
    if half == FIND:
        return 1 if find_contacts(c) else 0
    move(c)
    end_step(c)
    return 1


@kernel
def advance_alone(c: Arguments, count: int) -> int:
    """Take steps of a world in which nothing can meet anything: kick, drift, kick."""
    model, state = c.model, c.state
    if model.forces.kind.shape[0] + c.wrenches.in_use[0] + model.fixed.shape[0] == 0:
        fly_all(c, count)
        return count
    for _ in range(count):
        begin_step(c)
        apply_forces(c)
        kick_drift_kick(model, state, c.work.loads, model.h, c.work.block)
        apply_later_forces(c)
        end_step(c)
    return count


@kernel
def begin_step(c: Arguments) -> None:
    """Let prescribed motion begin, and note whether anything but gravity acts."""
    # What moves by its twist feels no gravity: the loads are not those of gravity alone.
    moves = begin_kinematic(c.model, c.state)
    loaded = moves or c.model.forces.kind.shape[0] + c.wrenches.in_use[0] > 0
    c.work.loaded[0] = 1 if loaded else 0


@kernel
def apply_forces(c: Arguments) -> None:
    """Sum the loads at the start of the step; uniform gravity is there from an earlier one."""
    work = c.work
    if may_sleep(c) or work.loaded[0] == 1 or work.uniform[0] == 0:
        sum_loads(c, work.loads, START)
        work.uniform[0] = 1 - work.loaded[0]
    work.solver.bodies.alike[0] = 1 - work.loaded[0]


START, END = range(2)    # of a step: the times at which loads are summed


@apart
def sum_loads(c: Arguments, loads: Loads, when: int) -> None:
    """Sum gravity, the forces of the scene and the wrenches of users."""
    begin_loads(c.model, c.state, loads)
    if c.model.forces.kind.shape[0] > 0:
        add_forces(c, when)
    end_loads(c.model, c.state, c.wrenches, loads)


@by_address
def add_forces(c: Arguments, when: int) -> int:
    """Add the forces of the scene to the loads of the start of the step, or of its end."""
    if when == END:
        add_scene_forces(c.model, c.state, c.work.later)
    else:
        add_scene_forces(c.model, c.state, c.work.loads)
    return 0


@kernel
def may_sleep(c: Arguments) -> bool:
    """Return whether bodies may sleep."""
    return c.settings.sleep_steps > 0


_DISTURBED, _TOUCHED, _AFTERWARDS = range(3)    # the parts of a step in which bodies wake or sleep


@kernel
def wake_disturbed_islands(c: Arguments) -> None:
    """Wake what was pushed, moved or loaded otherwise since the last step."""
    if may_sleep(c):
        mark_pushed(c.wrenches, c.rest)
        wake_or_sleep(c, _DISTURBED)


@kernel
def wake_touched_islands(c: Arguments) -> None:
    """Wake what an awake body may touch."""
    if may_sleep(c):
        wake_or_sleep(c, _TOUCHED)
        take_sides_of(c, (0, c.model.m.shape[0]))


@kernel
def let_islands_sleep(c: Arguments) -> None:
    """Let islands sleep that have been at rest for long enough."""
    if may_sleep(c):
        wake_or_sleep(c, _AFTERWARDS)


@by_address
def wake_or_sleep(c: Arguments, when: int) -> int:
    """Let islands wake or sleep, in one of the parts of a step."""
    model, state, work, rest = c.model, c.state, c.work, c.rest
    manifolds = current(c.memory)
    if when == _DISTURBED:
        wake_disturbed(model, state, work.loads, work.radius, manifolds, rest)
    elif when == _TOUCHED:
        wake_touched(model.h, model.inv_m, model.inv_I_C, state, work.radius, c.memory, rest)
    else:
        keep_pressing(manifolds, work.solver.bodies.slot, rest, step_impulses(c.memory))
        fall_asleep(model.inv_m, model.inv_I_C, state, work.loads, work.radius, manifolds,
                    c.settings.sleep_steps, rest)
    return 0


@kernel
def detect(c: Arguments) -> bool:
    """Find the manifolds of what is near each other; return whether all was there for it."""
    if not detect_once(c):
        return False
    c.work.thrown[:] = 0
    for _ in range(SEARCHES):
        if not widen_margins(c.model.inv_m, c.work.thickness, c.shapes, c.materials, c.memory,
                             c.work.thrown):
            break
        if detect_part(c, THROWN) == 0:
            return False
    return detect_part(c, SEAMS) == 1


@kernel
def detect_once(c: Arguments) -> bool:
    """Find the manifolds within the margins of how bodies move as the step begins."""
    many, cut = current(c.memory).count[0] >= MANIFOLDS_TO_HALVE, c.work.solver.sides.cut
    if not many:
        cut.halved[0], cut.left[0] = 0, 0
    elif cut.left[0] == 0:
        choose_cut(c.model.inv_m, c.state.x, c.rest.asleep, current(c.memory),
                   c.work.solver.sides)
    if many and is_helped(c.job):
        return detect_in_parallel(c) == 1
    set_margins_and_sides(c, (0, c.shapes.body.shape[0]), (0, c.state.x.shape[1]))
    return detect_part(c, WHOLE) == 1


@kernel
def is_free_flight(c: Arguments) -> bool:
    """Return whether nothing is near anything, and gravity alone acts."""
    return current(c.memory).count[0] == 0 and c.work.loaded[0] == 0 and not may_sleep(c)


@kernel
def fly_all(c: Arguments, count: Any) -> None:
    """Move all bodies for some steps as if there were no contacts."""
    g = c.model.gravity
    fly(c.model, c.state, (g[0], g[1], g[2]), c.model.h, count, c.work.block)


@kernel
def predict(c: Arguments) -> None:
    """Give contacts the geometry of the time in which they act."""
    if may_sleep(c) or c.uses.bounces == 1:
        # Of all others the solver writes them.
        clear_impulses(current(c.memory), step_impulses(c.memory))
    predict_or_correct(c, PREDICT)


@kernel
def stop_before_passages(c: Arguments) -> None:
    """Let bodies stop where they would get through something that nothing pushes."""
    predict_or_correct(c, STOP)


@kernel
def take_back_energy(c: Arguments) -> None:
    """Take from bodies the energy that they gained by turning under their impulses."""
    predict_or_correct(c, TAKE_BACK)


@kernel
def collide_stopped(c: Arguments) -> None:
    """Let bodies collide with what stopped them, where the step began in an overlap."""
    predict_or_correct(c, COLLIDE_STOPPED)


PREDICT, STOP, TAKE_BACK, COLLIDE_STOPPED = range(4)


@by_address
def predict_or_correct(c: Arguments, stage: int) -> int:
    """
    Predict the contacts of a step, or correct a motion: stop bodies, take back energy, collide.

    One piece, for what is compiled apart has the searches for nearest points in it once more.
    """
    memory, work = c.memory, c.work
    if stage == STOP:
        end_ways(c)
        return 0
    if stage == TAKE_BACK:
        take_back_gains(c)
        return 0
    if stage == COLLIDE_STOPPED:
        hit_what_stopped(c)
        return 0
    predict_contacts(c.model, c.state, work.loads, c.shapes, c.materials, current(memory),
                     memory.pose, memory.margin, memory.rest_margin, work.collision.activity,
                     work.prediction, memory.scratch)
    return 0


@kernel
def bounce(c: Arguments) -> None:
    """Give colliding bodies their impulses, at the time at which they meet."""
    if c.uses.bounces == 1:
        c.work.solver.shifted[0] = 1 if collide(c, NO_NUMBER) > 0 else 0
        mark_touching(current(c.memory), c.work.collision.activity, c.memory.touching)


@by_address
def collide(c: Arguments, _: int) -> int:
    """Let what has a restitution collide, on new ways again; return how often."""
    model, work, acted, manifolds = c.model, c.work, step_impulses(c.memory), current(c.memory)
    count = collide_bodies(
        model.h, model.inv_m, model.inv_I_C, c.state, work.loads.F, c.shapes, c.materials,
        manifolds, acted, work.collision)
    for _ in range(ROUNDS if count > 0 else 0):
        if find_next_touches(
                model, c.state, work.loads, c.shapes, c.materials, manifolds, c.memory.margin,
                acted, work.prediction, c.memory.scratch, work.collision) == 0:
            break
        count += collide_candidates(
            model.h, model.inv_m, model.inv_I_C, c.state, c.shapes, c.materials, manifolds,
            acted, work.collision)
    return count


@kernel
def solve(c: Arguments) -> None:
    """Find the impulses of what touches, and move all bodies."""
    begin_slots(c.work.solver.sides, c.memory.touching, c.work.solver.bodies)
    solve_contacts(c)
    is_fast = is_any_fast(c)
    if is_fast:
        stop_before_passages(c)
    move_solved(c)
    if gains_any_by_turning(c):
        take_back_energy(c)
    move_kinematic(c.model, c.state, c.model.h)
    if is_fast:
        collide_stopped(c)


@kernel
def apply_later_forces(c: Arguments) -> None:
    """Kick by half of the change of the loads, as in the symplectic method: at the new poses."""
    if c.work.loaded[0] == 1:
        sum_loads(c, c.work.later, END)
        kick_by_change(c.state, c.work.loads, c.work.later, c.model.h)


@kernel
def end_step(c: Arguments) -> None:
    """Count down what lasts for some steps."""
    end_kinematic(c.model, c.state)
    count_down(c.wrenches)
    cut = c.work.solver.sides.cut
    cut.left[0] = max(cut.left[0] - 1, 0)


def advance(c: Arguments, count: int, pack: ArgumentPack | None = None,
            helper: Helper | None = None) -> tuple[Arguments, ArgumentPack]:
    """
    Advance the state by `count` steps; return the arguments, whose buffers may have grown.

    The state, the wrenches' remaining steps, the memory and who sleeps change in place. The pack
    that is returned is for the next call. A helper, whose job slot is that of the arguments, takes
    over halves of what many contacts need; the results are the same bits.
    """
    if c.uses.contacts == 0:
        pack = packed(c, pack)
        if not pack.is_linked:
            link(advance_alone, pack, pieces_alone(c))
        pack.run(advance_alone, count)
        return c, pack
    done = 0
    while True:
        pack = packed(c, pack)
        if not pack.is_linked:
            link(advance_steps, pack, pieces_of(c, helper is not None))
        some = count - done if helper is None else min(count - done, _STEPS_WITHOUT_HELP)
        if helper is None or current_manifolds(c.memory).count[0] < MANIFOLDS_TO_HALVE:
            taken = pack.run(advance_steps, some)
        else:
            with helper:
                taken = pack.run(advance_steps, some)
        done += taken
        if done == count:
            return c, pack
        if taken < some:
            c = with_room(c, pack)


def find(c: Arguments, pack: ArgumentPack | None) -> tuple[Arguments, ArgumentPack]:
    """Begin a step, which `take_half` ends; returns what `advance` does."""
    while True:
        pack = packed(c, pack)
        if not pack.is_linked:
            link(take_half, pack, pieces_of(c, helped=False))
        if pack.run(take_half, FIND) == 1:
            return c, pack
        c = with_room(c, pack)


def with_room(c: Arguments, pack: ArgumentPack) -> Arguments:
    """Return arguments with what an unfinished detection lacked."""
    if c.memory.counters[NO_SEARCH] != 0:
        c.memory.counters[NO_SEARCH] = 0
        link_late(search, pack)
        return c
    return with_memory(c, grown(c.memory))


def pieces_alone(c: Arguments) -> Pieces:
    """Return the pieces that are compiled apart of a step in which nothing can meet anything."""
    has_forces = c.model.forces.kind.shape[0] > 0
    return Pieces([add_forces] if has_forces else [], [], [], [] if has_forces else [add_forces])


def pieces_of(c: Arguments, helped: bool) -> Pieces:
    """
    Return the pieces of a step that are compiled apart, and which of them its world never calls.

    Two boxes need a search only where nothing else tells which way is out: nobody waits for it.
    """
    kinds = np.unique(c.shapes.kind)
    families = FAMILY[np.ix_(kinds, kinds)]
    searches = np.isin(families, SEARCHED).any()
    may_search = (families == BOXES).any() and not searches
    optional = {add_forces: c.model.forces.kind.shape[0] > 0, share_part: helped,
                wake_or_sleep: c.settings.sleep_steps > 0}
    bounces = [collide]
    # What the helper compiles takes as long as all the rest.
    return Pieces(
        here=[solve_part, solve_directly, store_part,
              *(piece for piece, is_used in optional.items() if is_used)],
        helped=[detect_part, predict_or_correct, *(bounces if c.uses.bounces == 1 else []),
                *([search] if searches else [])],
        late=[search] if may_search else [],
        unused=[*(piece for piece, is_used in optional.items() if not is_used),
                *(bounces if c.uses.bounces == 0 else []),
                *([] if searches or may_search else [search])])
