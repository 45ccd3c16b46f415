# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an impact sets aside in a block of eight manifolds, and puts back when it is over."""

from rigid_sim_ros.engine.constraints.contact_blocks import (
    axes, FRICTION, IMPULSE, load_three, NORMAL, POINT, POINT_ROWS, RESTING, RESTING_ROLL,
    RESTING_SPIN, RESTING_T, ROLL, SPIN, TOTAL, TOTAL_T)
from rigid_sim_ros.engine.maths.vector import dot
from rigid_sim_ros.engine.solver.coloring import (
    are_balls, Blocks, lanes_of, numbers_of, points_in, resists)
from rigid_sim_ros.engine.solver.contact_sweep import point_speed, relative_twist
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.eight import EVERY, gather, lanes_in, load, Mask, select, store
from rigid_sim_ros.kernels.kernel import part


@part
def begin_impact(blocks: Blocks, block: int, bits: int) -> None:
    """
    Set the impulses of some lanes of a block aside, those with which contacts bear forces.

    An impact begins with none, and none of its own is there when it is over: what stopped bodies
    once must not act on them again in the next substep.
    """
    b, kind, mask = numbers_of(blocks, block), blocks.kind[block], lanes_in(bits)
    for p in range(4 if points_in(kind) > 1 else 1):
        point = POINT + p * POINT_ROWS
        _set_aside(b, point + IMPULSE, point + RESTING, mask)
    for k in range(2):
        _set_aside(b, FRICTION + k, RESTING_T + k, mask)
    if not are_balls(kind):
        _set_aside(b, SPIN, RESTING_SPIN, mask)
    for k in range(2 if resists(kind) else 0):
        _set_aside(b, ROLL + k, RESTING_ROLL + k, mask)


@part
def _set_aside(b: Array, row: int, aside: int, mask: Mask) -> None:
    store(b, aside, select(mask, load(b, row), load(b, aside)))
    store(b, row, select(mask, 0.0, load(b, row)))


@part
def end_impact(blocks: Blocks, block: int, bits: int, motion: Array) -> None:
    """Count the impulses of an impact with those of the step, and put back what was set aside."""
    b, kind, mask = numbers_of(blocks, block), blocks.kind[block], lanes_in(bits)
    for p in range(4 if points_in(kind) > 1 else 1):
        point = POINT + p * POINT_ROWS
        _put_back(b, point + IMPULSE, point + RESTING, point + TOTAL, mask)
    for k in range(2):
        _put_back(b, FRICTION + k, RESTING_T + k, TOTAL_T + k, mask)
    if not are_balls(kind):
        store(b, SPIN, select(mask, load(b, RESTING_SPIN), load(b, SPIN)))
    for k in range(2 if resists(kind) else 0):
        store(b, ROLL + k, select(mask, load(b, RESTING_ROLL + k), load(b, ROLL + k)))
    _note_approach(b, kind, motion, blocks.at_A[lanes_of(block)], blocks.at_B[lanes_of(block)],
                   mask)


@part
def _put_back(b: Array, row: int, aside: int, total: int, mask: Mask) -> None:
    store(b, total, load(b, total) + select(mask, load(b, row), 0.0))
    store(b, row, select(mask, load(b, aside), load(b, row)))


@part
def excuse_approach(blocks: Blocks, block: int, motion: Array) -> None:
    """Let forces not stop how fast the points of a block approach, which is for an impact."""
    lanes = lanes_of(block)
    _note_approach(numbers_of(blocks, block), blocks.kind[block], motion, blocks.at_A[lanes],
                   blocks.at_B[lanes], lanes_in(EVERY))


@part
def forget_excuse(blocks: Blocks, block: int) -> None:
    """End what `excuse_approach` began."""
    b = numbers_of(blocks, block)
    for p in range(4 if points_in(blocks.kind[block]) > 1 else 1):
        store(b, POINT + p * POINT_ROWS + RESTING, 0.0)


@part
def _note_approach(b: Array, kind: int, motion: Array, at_A: IntArray, at_B: IntArray,
                   mask: Mask) -> None:
    """Write how fast the points still approach, in the place of what was set aside."""
    A, B = gather(motion, at_A), gather(motion, at_B)
    if are_balls(kind):
        along = dot((B[0] - A[0], B[1] - A[1], B[2] - A[2]), load_three(b, NORMAL))
        store(b, POINT + RESTING, select(mask, max(-along, 0.0), 0.0))
        return
    n, t1, t2 = axes(b)
    _, u, w = relative_twist(b, A, B)
    along, about_1, about_2 = dot(u, n), dot(w, t1), dot(w, t2)
    if points_in(kind) == 1:
        store(b, POINT + RESTING, select(mask, max(-along, 0.0), 0.0))
        return
    for p in range(4):
        point = POINT + p * POINT_ROWS
        speed = point_speed(b, point, along, about_1, about_2)
        store(b, point + RESTING, select(mask, max(-speed, 0.0), 0.0))
