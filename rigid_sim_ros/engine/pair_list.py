# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The list of pairs whose manifolds detection looks for, from step to step.

What moved out of its fat box is looked up in the grid, by one thread or by two, and the pairs that
come out are taken in.
"""

from rigid_sim_ros.engine.broad_phase import (
    fill_grid, forget_parted, look_around, refresh, take_in, update_pairs)
from rigid_sim_ros.engine.kernel import kernel
from rigid_sim_ros.engine.manifolds import Memory, REBUILT, SHORT_PAIRS
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.shapes import Shapes
from rigid_sim_ros.engine.state import State


@kernel
def find_pairs(model: Model, state: State, shapes: Shapes, memory: Memory) -> bool:
    """Keep the list of pairs up to date; return whether there was room for them."""
    note_moved(model, state, shapes, memory)
    return memory.counters[REBUILT] == 0 or update_alone(model, shapes, memory)


@kernel
def note_moved(model: Model, state: State, shapes: Shapes, memory: Memory) -> None:
    """Find which shapes left their fat boxes, and let the grid know their new ones."""
    count = memory.pair_count[0]
    moved = refresh(shapes.kind, shapes.body, memory.pose, memory.box, model.inv_m, state.P,
                    model.h, count < 0, memory.fat, memory.moved)
    memory.counters[REBUILT] = moved
    if count >= 0:
        forget_parted(shapes.kind, memory.fat, memory.ahead, moved, memory.pair, memory.axis,
                      memory.pair_count)
    if moved > 0:
        fill_grid(shapes.kind, memory.fat, memory.moved, memory.cells, memory.buckets,
                  memory.members, memory.keys, memory.tally, memory.levels)


@kernel
def update_alone(model: Model, shapes: Shapes, memory: Memory) -> bool:
    """Find the pairs of what moved; return whether there was room for them."""
    return _keep_count(memory, update_pairs(
        shapes, memory.fat, memory.moved, memory.cells, memory.buckets, memory.members,
        memory.keys, memory.tally, memory.levels, memory.fresh, memory.pair, memory.axis,
        max(memory.pair_count[0], 0), model.m.shape[0], memory.ahead, memory.near[0]))


@kernel
def look_for_share(model: Model, shapes: Shapes, memory: Memory, thread: int) -> None:
    """List the partners of every second shape that moved, for one of two threads."""
    end, found = look_around(
        shapes, memory.fat, memory.moved, memory.cells, memory.buckets, memory.members,
        memory.keys, memory.levels, memory.fresh, model.m.shape[0], memory.ahead,
        memory.near[thread], thread, 2, 0)
    memory.looked[thread] = found if end == shapes.kind.shape[0] else -1


@kernel
def take_shares(model: Model, shapes: Shapes, memory: Memory) -> bool:
    """Take in what both threads listed; return whether there was room for it."""
    first, second, fresh = memory.looked[0], memory.looked[1], memory.fresh
    if min(first, second) < 0 or first + second > fresh.shape[1]:
        return update_alone(model, shapes, memory)
    for k in range(second):
        fresh[0, first + k, 0], fresh[0, first + k, 1] = fresh[1, k, 0], fresh[1, k, 1]
    return _keep_count(memory, take_in(shapes.kind, fresh, first + second, memory.tally,
                                       memory.pair, memory.axis, max(memory.pair_count[0], 0)))


@kernel
def _keep_count(memory: Memory, count: int) -> bool:
    """Note how many pairs there are; return whether there was room for them."""
    short = count > memory.pair.shape[0]
    if short:
        memory.counters[SHORT_PAIRS] = count
    memory.pair_count[0] = -1 if short else count
    return not short
