# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What an impact sets aside in a block of eight manifolds, and puts back when it is over.

What the geometry of a contact does to its velocities in the step, TURN, is a quadratic form in the
velocities with which the step began, and holds as long as these do. Of a light body that spins
between heavy ones it is h w^2 r of some m/s, half of which forces would still ask of the heavy
ones once the impact has ended the spin. What is known of the form is its one value. So an impact
takes the part of it away that a change along the velocities themselves would: where twists x of
the two bodies become x + d, (1 - |d| / |x|)^2 of it stays, nothing where they are turned round.
"""

from rigid_sim_ros.engine.constraints.contact_blocks import (
    APPROACH, axes, FRICTION, FRICTION_ASIDE, IMPULSE, IMPULSE_ASIDE, INV_I_A, INV_I_B, LEVER_A,
    LEVER_B, load_three, Motion, NORMAL, POINT, POINT_ROWS, ROLL, ROLL_ASIDE, SIZE, SPIN,
    SPIN_ASIDE, symmetric, Three, TOTAL, TOTAL_T, TURN, TURN_T)
from rigid_sim_ros.engine.maths.vector import add, cross, dot, scale, subtract
from rigid_sim_ros.engine.solver.coloring import (
    are_balls, Blocks, lanes_of, numbers_of, points_in, resists)
from rigid_sim_ros.engine.solver.contact_sweep import point_speed, relative_twist
from rigid_sim_ros.engine.solver.solver_bodies import INV_I
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.eight import (
    any_of, Eight, EVERY, gather, lanes_in, load, Mask, root, select, store)
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
        _set_aside(b, point + IMPULSE, point + IMPULSE_ASIDE, mask)
    for k in range(2):
        _set_aside(b, FRICTION + k, FRICTION_ASIDE + k, mask)
    if not are_balls(kind):
        _set_aside(b, SPIN, SPIN_ASIDE, mask)
    for k in range(2 if resists(kind) else 0):
        _set_aside(b, ROLL + k, ROLL_ASIDE + k, mask)


@part
def _set_aside(b: Array, row: int, aside: int, mask: Mask) -> None:
    store(b, aside, select(mask, load(b, row), load(b, aside)))
    store(b, row, select(mask, 0.0, load(b, row)))


@part
def end_impact(blocks: Blocks, block: int, bits: int, motion: Array, drifted: Array) -> None:
    """
    Count the impulses of an impact with those of the step, and put back what was set aside.

    `drifted` is the motion before the impact.
    """
    b, kind, mask = numbers_of(blocks, block), blocks.kind[block], lanes_in(bits)
    lanes = lanes_of(block)
    _fade_turns(b, kind, blocks.at_A[lanes], blocks.at_B[lanes], drifted, motion, mask)
    for p in range(4 if points_in(kind) > 1 else 1):
        point = POINT + p * POINT_ROWS
        _put_back(b, point + IMPULSE, point + IMPULSE_ASIDE, point + TOTAL, mask)
    for k in range(2):
        _put_back(b, FRICTION + k, FRICTION_ASIDE + k, TOTAL_T + k, mask)
    if not are_balls(kind):
        store(b, SPIN, select(mask, load(b, SPIN_ASIDE), load(b, SPIN)))
    for k in range(2 if resists(kind) else 0):
        store(b, ROLL + k, select(mask, load(b, ROLL_ASIDE + k), load(b, ROLL + k)))
    _note_approach(b, kind, motion, blocks.at_A[lanes], blocks.at_B[lanes], mask)


@part
def _fade_turns(b: Array, kind: int, at_A: IntArray, at_B: IntArray, before: Array, after: Array,
                mask: Mask) -> None:
    """Take away what the geometry does no longer, of the lanes of a mask; see the top."""
    points = 4 if points_in(kind) > 1 else 1
    turns = abs(load(b, TURN_T)) + abs(load(b, TURN_T + 1))
    for p in range(points):
        turns = turns + abs(load(b, POINT + p * POINT_ROWS + TURN))
    if not any_of(turns > 0.0):
        return
    A, B = gather(after, at_A), gather(after, at_B)
    u, w_A, w_B = _relative_motion(b, kind, A, B, A[INV_I], B[INV_I])
    A_was, B_was = gather(before, at_A), gather(before, at_B)
    u_was, w_A_was, w_B_was = _relative_motion(b, kind, A_was, B_was, A[INV_I], B[INV_I])
    size = load(b, SIZE)
    was = dot(u_was, u_was) + size * size * (dot(w_A_was, w_A_was) + dot(w_B_was, w_B_was))
    du, dw_A, dw_B = subtract(u, u_was), subtract(w_A, w_A_was), subtract(w_B, w_B_was)
    change = dot(du, du) + size * size * (dot(dw_A, dw_A) + dot(dw_B, dw_B))
    left = max(1.0 - root(change / select(was > 0.0, was, 1.0)), 0.0)
    left = select(mask, left * left, 1.0)
    for k in range(2):
        store(b, TURN_T + k, left * load(b, TURN_T + k))
    for p in range(points):
        turn = POINT + p * POINT_ROWS + TURN
        store(b, turn, left * load(b, turn))


@part
def _relative_motion(b: Array, kind: int, A: Motion, B: Motion, inv_I_A: Eight,
                     inv_I_B: Eight) -> tuple[Three, Three, Three]:
    """Return the velocity of B relative to A at c, and both spins."""
    if are_balls(kind):
        n = load_three(b, NORMAL)
        w_A, w_B = scale(inv_I_A, (A[3], A[4], A[5])), scale(inv_I_B, (B[3], B[4], B[5]))
        turn = subtract(scale(load(b, LEVER_B), w_B), scale(load(b, LEVER_A), w_A))
        return add((B[0] - A[0], B[1] - A[1], B[2] - A[2]), cross(turn, n)), w_A, w_B
    _, u, _ = relative_twist(b, A, B)
    return u, symmetric(b, INV_I_A, (A[3], A[4], A[5])), symmetric(b, INV_I_B, (B[3], B[4], B[5]))


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
        store(b, POINT + p * POINT_ROWS + APPROACH, 0.0)


@part
def _note_approach(b: Array, kind: int, motion: Array, at_A: IntArray, at_B: IntArray,
                   mask: Mask) -> None:
    """Write how fast the points still approach, in the place of what was set aside."""
    A, B = gather(motion, at_A), gather(motion, at_B)
    if are_balls(kind):
        along = dot((B[0] - A[0], B[1] - A[1], B[2] - A[2]), load_three(b, NORMAL))
        store(b, POINT + APPROACH, select(mask, max(-along, 0.0), 0.0))
        return
    n, t1, t2 = axes(b)
    _, u, w = relative_twist(b, A, B)
    along, about_1, about_2 = dot(u, n), dot(w, t1), dot(w, t2)
    if points_in(kind) == 1:
        store(b, POINT + APPROACH, select(mask, max(-along, 0.0), 0.0))
        return
    for p in range(4):
        point = POINT + p * POINT_ROWS
        speed = point_speed(b, point, along, about_1, about_2)
        store(b, point + APPROACH, select(mask, max(-speed, 0.0), 0.0))
