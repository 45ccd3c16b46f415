# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One visit of the sequential solver to eight manifolds; see contact_blocks.py."""

from rigid_sim_ros.engine.constraints.contact_blocks import (
    ABSENT, APPROACH, ARM_A, ARM_B, axes, begin_sums, combine, drift_together, friction_of, GAP,
    IMPULSE, INV_I_A, INV_I_B, K_N, K_NN, K_TN, keep_friction, load_three, load_two, MASS, Motion,
    NORMAL, normal_sum, POINT, POINT_ROWS, PRESSED, pushed, ROLL, ROLL_LEVER, ROLL_STEP, S, SHOVE,
    SHOVE_TURN, SIZE, smallest_gap, SPEED, store_two, symmetric, T, Three, TURN_T)
from rigid_sim_ros.engine.constraints.contact_rules import (
    approach_of, bounded_step, gap_of, is_open, least_speed, NEGLIGIBLE, normal_impulse, settled,
    SKIN, Sweep, wanted_of)
from rigid_sim_ros.engine.maths.vector import add, add_scaled, cross, dot, subtract
from rigid_sim_ros.engine.solver.coloring import (
    are_balls, awake_in, Blocks, CHANGED, is_small, lanes_of, numbers_of, OVERLAPPING, points_in,
    resists, SHOVED)
from rigid_sim_ros.engine.solver.friction_visit import coulomb
from rigid_sim_ros.engine.solver.solver_bodies import INV_M
from rigid_sim_ros.engine.solver.sphere_sweep import drift_balls, separate_balls, visit_balls
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.eight import (
    any_of, bits_of, Eight, either, gather, lanes_in, largest_of, load, Mask, scatter, select,
    spread, store)
from rigid_sim_ros.kernels.kernel import apart, part


@part
def visit(b: Array, motion: Array, at_A: IntArray, at_B: IntArray, points: int, rolls: bool,
          what: Sweep, mask: Mask) -> Eight:
    """
    Read the bodies of a block, solve normals and then friction, write the bodies.

    Only in the lanes of the mask. Friction comes last because the normal impulses bound it.
    Returns the largest change of a velocity, lane by lane [m/s].
    """
    if points == 1 and not rolls:
        return _visit_small(b, motion, at_A, at_B, what, mask)
    return _visit_many(b, motion, at_A, at_B, points, rolls, what, mask)


@part
def visit_block(blocks: Blocks, block: int, motion: Array, what: Sweep, bits: int) -> Eight:
    """Visit the lanes of a block, by its number, whose bits are set; return what `visit` does."""
    b, lanes, kind = numbers_of(blocks, block), lanes_of(block), blocks.kind[block]
    at_A, at_B = blocks.at_A[lanes], blocks.at_B[lanes]
    if are_balls(kind):
        residual = visit_balls(b, motion, at_A, at_B, what, lanes_in(bits))
    else:
        residual = visit(b, motion, at_A, at_B, points_in(kind), resists(kind), what,
                         lanes_in(bits))
    blocks.residual[block] = largest_of(residual)
    return residual


@apart
def visit_lanes(blocks: Blocks, block: int, motion: Array, what: Sweep, bits: int,
                tolerance: float, slow: float) -> int:
    """
    Visit the lanes of a block whose bits are set; return the bits of those that this changed.

    That is by more than the tolerance, a part of the size of a shape in a substep, and by more
    than `slow` [m/s] but in small islands, which end as if solved directly. For what is visited
    now and then: `visit_block` in each of these places took LLVM 2 s of the first start.
    """
    residual = visit_block(blocks, block, motion, what, bits)
    least = tolerance * what.inv_h * load(numbers_of(blocks, block), SIZE)
    least = select(lanes_in(blocks.direct[block]), least, max(least, slow))
    return bits & bits_of(residual > least)


@part
def drift_block(blocks: Blocks, block: int, drifted: Array, h: float, what: Sweep,
                tolerance: float) -> int:
    """
    Move on the gaps of a block by the velocities with which its bodies drifted for h [s].

    Returns the bits of the pairs that would go on into each other faster than the tolerance [m/s].
    """
    b, lanes, kind = numbers_of(blocks, block), lanes_of(block), blocks.kind[block]
    at_A, at_B, shoved = blocks.at_A[lanes], blocks.at_B[lanes], blocks.left[block] & SHOVED != 0
    A, B = gather(drifted, at_A), gather(drifted, at_B)
    if are_balls(kind):
        meets = bits_of(drift_balls(b, A, B, h, shoved, what) < -tolerance)
    else:
        meets = bits_of(_drift(b, A, B, h, points_in(kind), shoved, what) < -tolerance)
    if blocks.dormant[block] != 0:
        _keep_apart(b, points_in(kind), lanes_in(blocks.dormant[block]))
    return meets & ~blocks.dormant[block]


@part
def _keep_apart(b: Array, points: int, mask: Mask) -> None:
    """Let no gap of some lanes be below 0: as long as they pass each other, nothing overlaps."""
    for p in range(4 if points > 1 else 1):
        gap = POINT + p * POINT_ROWS + GAP
        store(b, gap, select(mask, max(load(b, gap), 0.0), load(b, gap)))


@part
def begin_block(blocks: Blocks, block: int, motion: Array, what: Sweep,
                tolerance: float) -> int:
    """
    Begin the sums of a step.

    Returns the bits of the pairs that would get into each other faster than the tolerance [m/s].
    """
    b, lanes, kind = numbers_of(blocks, block), lanes_of(block), blocks.kind[block]
    begin_sums(b, points_in(kind))
    new = normal_sum(b, points_in(kind)) == 0.0
    A, B = gather(motion, blocks.at_A[lanes]), gather(motion, blocks.at_B[lanes])
    if are_balls(kind):
        n = load_three(b, NORMAL)
        v = (B[0] - A[0], B[1] - A[1], B[2] - A[2])
        speed = dot(v, n) + least_speed(b, POINT, what)
        approach = approach_of(speed, either(new, is_open(b, POINT)))
        return bits_of(approach < -tolerance) & ~blocks.dormant[block]
    n, t1, t2 = axes(b)
    _, u, w = relative_twist(b, A, B)
    along, about_1, about_2, least = dot(u, n), dot(w, t1), dot(w, t2), spread(ABSENT)
    for p in range(4 if points_in(kind) > 1 else 1):
        point = POINT + p * POINT_ROWS
        speed = point_speed(b, point, along, about_1, about_2) + least_speed(b, point, what)
        least = min(least, approach_of(speed, either(new, is_open(b, point))))
    return bits_of(least < -tolerance) & ~blocks.dormant[block]


@part
def point_speed(b: Array, point: int, along: Eight, about_1: Eight, about_2: Eight) -> Eight:
    """Return the normal velocity of a point, given three parts of the twist at c."""
    return along + load(b, point + T) * about_1 - load(b, point + S) * about_2


@part
def _visit_small(b: Array, motion: Array, at_A: IntArray, at_B: IntArray, what: Sweep,
                 mask: Mask) -> Eight:
    """
    Do all that `_visit_many` does, for manifolds of one point: their common point c.

    There the direction of the normal impulse is (1, 0, 0), and six rows of the response suffice.
    """
    A, B = gather(motion, at_A), gather(motion, at_B)
    n, t1, t2 = axes(b)
    _, u, w = relative_twist(b, A, B)
    old_N, speed, old = load(b, POINT + IMPULSE), dot(u, n), friction_of(b)
    pressure = normal_impulse(b, POINT, speed, what, mask)
    if not any_of(pressure + old_N + abs(old[0]) + abs(old[1]) + abs(old[2]) > 0.0):
        # Nothing presses, nor did anything before this visit.
        _keep_speed(b, POINT, speed, mask)
        return spread(0.0)
    change_N = pressure - old_N
    store(b, POINT + IMPULSE, pressure)
    _keep_speed(b, POINT, speed + load(b, K_N) * change_N, mask)

    turn = load_two(b, TURN_T)
    twist = (dot(u, t1) + load(b, K_N + 1) * change_N + what.when * turn[0],
             dot(u, t2) + load(b, K_N + 2) * change_N + what.when * turn[1],
             dot(w, n) + load(b, K_N + 3) * change_N)
    zero = spread(0.0)
    new = _within(mask, coulomb(b, twist, pressure, (zero, zero), old), old)
    keep_friction(b, new)
    change = subtract(new, old)

    F = combine(n, t1, t2, (change_N, change[0], change[1]))
    torque = (change[2] * n[0], change[2] * n[1], change[2] * n[2])
    scatter(motion, at_A, pushed(A, A[INV_M], load_three(b, ARM_A), F, torque, -1.0))
    scatter(motion, at_B, pushed(B, B[INV_M], load_three(b, ARM_B), F, torque, 1.0))
    return (A[INV_M] + B[INV_M]) * max(abs(change_N), max(abs(change[0]), abs(change[1])))


@part
def _visit_many(b: Array, motion: Array, at_A: IntArray, at_B: IntArray, points: int, rolls: bool,
                what: Sweep, mask: Mask) -> Eight:
    """
    Visit manifolds of several points, or that resist rolling.

    The twist of B relative to A at c, in the triples N and T, stands for the motion of both bodies
    until the end; the wrench is what this visit added to the impulses.
    """
    A, B = gather(motion, at_A), gather(motion, at_B)
    n, t1, t2 = axes(b)
    twist_N, twist_T = _twist(b, A, B)
    zero = spread(0.0)
    wrench, residual = (zero, zero, zero), zero
    if rolls:
        twist_N, wrench = _solve_rolling(b, twist_N, wrench, points, mask)
    if points > 1:
        twist_N, wrench = _solve_together(b, twist_N, wrench, what, mask)
    for p in range(4 if points > 2 else points):
        twist_N, wrench, residual = _solve_point(b, POINT + p * POINT_ROWS, twist_N, wrench,
                                                 residual, what, mask)
    # What all points had together in common, and what each had alone.
    residual = max(residual, abs(wrench[0]))
    pressure = normal_sum(b, points)
    old = friction_of(b)
    if not any_of(residual + pressure + abs(old[0]) + abs(old[1]) + abs(old[2])
                  + abs(load(b, ROLL)) + abs(load(b, ROLL + 1)) > 0.0):
        # Nothing presses, nor did anything before this visit.
        return spread(0.0)
    first, second, third = load_three(b, K_TN), load_three(b, K_TN + 3), load_three(b, K_TN + 6)
    turn = load_two(b, TURN_T)
    new = coulomb(b, (twist_T[0] + dot(first, wrench) + what.when * turn[0],
                      twist_T[1] + dot(second, wrench) + what.when * turn[1],
                      twist_T[2] + dot(third, wrench)),
                  pressure, load_two(b, PRESSED) if points > 1 else (zero, zero), old)
    new = _within(mask, new, old)
    keep_friction(b, new)
    change = subtract(new, old)

    F = combine(n, t1, t2, (wrench[0], change[0], change[1]))
    torque = combine(n, t1, t2, (change[2], wrench[1], wrench[2]))
    scatter(motion, at_A, pushed(A, A[INV_M], load_three(b, ARM_A), F, torque, -1.0))
    scatter(motion, at_B, pushed(B, B[INV_M], load_three(b, ARM_B), F, torque, 1.0))
    return (A[INV_M] + B[INV_M]) * max(residual, max(abs(change[0]), abs(change[1])))


@part
def _within(mask: Mask, new: Three, old: Three) -> Three:
    """Return what is new in the lanes of a mask, elsewhere what was."""
    return (select(mask, new[0], old[0]), select(mask, new[1], old[1]),
            select(mask, new[2], old[2]))


@part
def note_left(blocks: Blocks, block: int, residual: Eight, what: Sweep) -> None:
    """
    Note what a visit, which returned `residual`, leaves to do in a block.

    On the way back no other is looked at.
    """
    b, points = numbers_of(blocks, block), points_in(blocks.kind[block])
    size = load(b, SIZE)
    overlaps = (bits_of(smallest_gap(b, points) < -NEGLIGIBLE * size)
                & ~blocks.dormant[block]) != 0
    blocks.left[block] = ((OVERLAPPING if overlaps else 0)
                          | CHANGED * bits_of(residual > settled(points) * what.inv_h * size))


@part
def separate(blocks: Blocks, block: int, push: Array, rate: float) -> None:
    """
    Push the overlaps of a block apart by velocities that last for one substep only.

    They displace and are forgotten, so that the push feeds neither energy nor the warm start.
    `rate` [1/s] is the part of an overlap that goes per second. What is dormant stays where it is.
    For small islands the push has been found, see island_push.py.
    """
    b, lanes, kind = numbers_of(blocks, block), lanes_of(block), blocks.kind[block]
    at_A, at_B = blocks.at_A[lanes], blocks.at_B[lanes]
    blocks.left[block] |= SHOVED
    mask, found = lanes_in(awake_in(blocks, block)), lanes_in(blocks.direct[block])
    if are_balls(kind):
        separate_balls(b, push, at_A, at_B, rate, mask, found)
    elif is_small(kind):
        _separate_small(b, push, at_A, at_B, rate, mask, found)
    else:
        _separate_many(b, push, at_A, at_B, points_in(kind), rate, mask, found)


@part
def _separate_many(b: Array, push: Array, at_A: IntArray, at_B: IntArray, points: int,
                   rate: float, mask: Mask, found: Mask) -> None:
    """Push several points, or one that resists rolling."""
    A, B = gather(push, at_A), gather(push, at_B)
    n, t1, t2 = axes(b)
    twist, _ = _twist(b, A, B)
    zero = spread(0.0)
    wrench = (zero, zero, zero)
    if points > 1:
        twist, wrench = _separate_together(b, twist, wrench, rate, mask)
    for p in range(4 if points > 2 else points):
        twist, wrench = _separate_point(b, POINT + p * POINT_ROWS, twist, wrench, rate, mask)
    wrench = (select(found, load(b, SHOVE), wrench[0]),
              select(found, load(b, SHOVE_TURN), wrench[1]),
              select(found, load(b, SHOVE_TURN + 1), wrench[2]))
    store(b, SHOVE, wrench[0])
    F = combine(n, t1, t2, (wrench[0], zero, zero))
    torque = combine(n, t1, t2, (zero, wrench[1], wrench[2]))
    scatter(push, at_A, pushed(A, A[INV_M], load_three(b, ARM_A), F, torque, -1.0))
    scatter(push, at_B, pushed(B, B[INV_M], load_three(b, ARM_B), F, torque, 1.0))


@part
def _separate_small(b: Array, push: Array, at_A: IntArray, at_B: IntArray, rate: float,
                    mask: Mask, found: Mask) -> None:
    """Push manifolds of one point, which is their common point c."""
    A, B, n = gather(push, at_A), gather(push, at_B), load_three(b, NORMAL)
    _, u, _ = relative_twist(b, A, B)
    wanted = wanted_of(b, POINT, rate, mask)
    shove = max(load(b, POINT + MASS) * (wanted - dot(u, n)), 0.0)
    shove = select(found, load(b, SHOVE), select(wanted > 0.0, shove, 0.0))
    store(b, SHOVE, shove)
    F, none = (shove * n[0], shove * n[1], shove * n[2]), (0.0 * shove, 0.0 * shove, 0.0 * shove)
    scatter(push, at_A, pushed(A, A[INV_M], load_three(b, ARM_A), F, none, -1.0))
    scatter(push, at_B, pushed(B, B[INV_M], load_three(b, ARM_B), F, none, 1.0))


@part
def relative_twist(b: Array, A: Motion, B: Motion) -> tuple[Three, Three, Three]:
    """Return v_B - v_A, the relative velocity at c and the relative spin, in W."""
    w_A, w_B = symmetric(b, INV_I_A, (A[3], A[4], A[5])), symmetric(b, INV_I_B, (B[3], B[4], B[5]))
    v = (B[0] - A[0], B[1] - A[1], B[2] - A[2])
    at_c = subtract(add(v, cross(w_B, load_three(b, ARM_B))), cross(w_A, load_three(b, ARM_A)))
    return v, at_c, subtract(w_B, w_A)


@part
def _twist(b: Array, A: Motion, B: Motion) -> tuple[Three, Three]:
    """Return the twist of B relative to A at c, as the triples N and T."""
    n, t1, t2 = axes(b)
    _, u, w = relative_twist(b, A, B)
    return (dot(u, n), dot(w, t1), dot(w, t2)), (dot(u, t1), dot(u, t2), dot(w, n))


@part
def _drift(b: Array, A: Motion, B: Motion, h: float, points: int, shoved: bool,
           what: Sweep) -> Eight:
    """Let gaps change by the motion of h [s]; return the fastest approach of each pair [m/s]."""
    n, t1, t2 = axes(b)
    v, u, w = relative_twist(b, A, B)
    drift_together(b, points, shoved, v, h)
    along, about_1, about_2, least = dot(u, n), dot(w, t1), dot(w, t2), spread(ABSENT)
    for p in range(4 if points > 1 else 1):
        point = POINT + p * POINT_ROWS
        was_open, speed = is_open(b, point), point_speed(b, point, along, about_1, about_2)
        store(b, point + GAP, load(b, point + GAP) + h * speed)
        store(b, point + APPROACH, 0.0)
        least = min(least, approach_of(speed + least_speed(b, point, what), was_open))
    return least


@part
def _column(b: Array, point: int) -> Three:
    """Return the column g of a point: its normal impulse as a wrench N."""
    return (spread(1.0), load(b, point + T), -load(b, point + S))


@part
def _sum_of_points(b: Array, w0: Eight, w1: Eight, w2: Eight, w3: Eight) -> Three:
    """Return the sum of the columns g of the points, each times its weight."""
    p0, p1, p2, p3 = POINT, POINT + POINT_ROWS, POINT + 2 * POINT_ROWS, POINT + 3 * POINT_ROWS
    return (w0 + w1 + w2 + w3,
            w0 * load(b, p0 + T) + w1 * load(b, p1 + T) + w2 * load(b, p2 + T)
            + w3 * load(b, p3 + T),
            -(w0 * load(b, p0 + S) + w1 * load(b, p1 + S) + w2 * load(b, p2 + S)
              + w3 * load(b, p3 + S)))


@part
def _solve_together(b: Array, twist: Three, wrench: Three, what: Sweep,
                    mask: Mask) -> tuple[Three, Three]:
    """
    Stop the approach of all points that are equally near, with the same impulse at each.

    A step along the sum of their directions, before each is visited alone: it treats them alike,
    so that what lies symmetrically stays so, and it carries weight through a stack faster.
    """
    p0, p1, p2, p3 = POINT, POINT + POINT_ROWS, POINT + 2 * POINT_ROWS, POINT + 3 * POINT_ROWS
    d0, d1, d2, d3 = gap_of(b, p0), gap_of(b, p1), gap_of(b, p2), gap_of(b, p3)
    nearest = min(min(d0, d1), min(d2, d3)) + SKIN * load(b, SIZE)
    w0, w1 = select(d0 < nearest, 1.0, 0.0), select(d1 < nearest, 1.0, 0.0)
    w2, w3 = select(d2 < nearest, 1.0, 0.0), select(d3 < nearest, 1.0, 0.0)
    g = _sum_of_points(b, w0, w1, w2, w3)
    least = (w0 * least_speed(b, p0, what) + w1 * least_speed(b, p1, what)
             + w2 * least_speed(b, p2, what) + w3 * least_speed(b, p3, what))
    response = symmetric(b, K_NN, g)
    k = dot(g, response)
    change = select(k > 0.0, -(dot(g, twist) + least) / k, 0.0)
    # No impulse may fall below 0.
    f0, f1, f2, f3 = (load(b, p0 + IMPULSE), load(b, p1 + IMPULSE), load(b, p2 + IMPULSE),
                      load(b, p3 + IMPULSE))
    smallest = min(min(select(w0 > 0.0, f0, ABSENT), select(w1 > 0.0, f1, ABSENT)),
                   min(select(w2 > 0.0, f2, ABSENT), select(w3 > 0.0, f3, ABSENT)))
    change = select(mask, max(change, -smallest), 0.0)
    store(b, p0 + IMPULSE, f0 + w0 * change)
    store(b, p1 + IMPULSE, f1 + w1 * change)
    store(b, p2 + IMPULSE, f2 + w2 * change)
    store(b, p3 + IMPULSE, f3 + w3 * change)
    return add_scaled(twist, change, response), add_scaled(wrench, change, g)


@part
def _solve_point(b: Array, point: int, twist: Three, wrench: Three, residual: Eight,
                 what: Sweep, mask: Mask) -> tuple[Three, Three, Eight]:
    """Make the normal velocity of a point not less than what `least_speed` allows."""
    g = _column(b, point)
    response, after = symmetric(b, K_NN, g), normal_impulse(b, point, dot(g, twist), what, mask)
    change = after - load(b, point + IMPULSE)
    store(b, point + IMPULSE, after)
    twist = add_scaled(twist, change, response)
    _keep_speed(b, point, dot(g, twist), mask)
    return twist, add_scaled(wrench, change, g), max(residual, abs(change))


@part
def _keep_speed(b: Array, point: int, speed: Eight, mask: Mask) -> None:
    """Write the normal velocity of a point in the lanes that are visited, see `wanted_of`."""
    store(b, point + SPEED, select(mask, speed, load(b, point + SPEED)))


@part
def _separate_together(b: Array, twist: Three, wrench: Three, rate: float,
                       mask: Mask) -> tuple[Three, Three]:
    """Push all points that overlap with the same impulse, as `_solve_together` stops them."""
    p0, p1, p2, p3 = POINT, POINT + POINT_ROWS, POINT + 2 * POINT_ROWS, POINT + 3 * POINT_ROWS
    u0, u1 = wanted_of(b, p0, rate, mask), wanted_of(b, p1, rate, mask)
    u2, u3 = wanted_of(b, p2, rate, mask), wanted_of(b, p3, rate, mask)
    g = _sum_of_points(b, select(u0 > 0.0, 1.0, 0.0), select(u1 > 0.0, 1.0, 0.0),
                       select(u2 > 0.0, 1.0, 0.0), select(u3 > 0.0, 1.0, 0.0))
    response = symmetric(b, K_NN, g)
    k = dot(g, response)
    change = max(select(k > 0.0, (u0 + u1 + u2 + u3 - dot(g, twist)) / k, 0.0), 0.0)
    return add_scaled(twist, change, response), add_scaled(wrench, change, g)


@part
def _separate_point(b: Array, point: int, twist: Three, wrench: Three, rate: float,
                    mask: Mask) -> tuple[Three, Three]:
    """Push one point out of its overlap."""
    g, wanted = _column(b, point), wanted_of(b, point, rate, mask)
    change = max(load(b, point + MASS) * (wanted - dot(g, twist)), 0.0)
    change = select(wanted > 0.0, change, 0.0)
    return add_scaled(twist, change, symmetric(b, K_NN, g)), add_scaled(wrench, change, g)


@part
def _solve_rolling(b: Array, twist: Three, wrench: Three, points: int,
                   mask: Mask) -> tuple[Three, Three]:
    """Stop the rolling as far as the normal impulses allow."""
    limit = load(b, ROLL_LEVER) * normal_sum(b, points)
    old = load_two(b, ROLL)
    new = bounded_step(old, load(b, ROLL_STEP), (twist[1], twist[2]), limit)
    new = (select(mask, new[0], old[0]), select(mask, new[1], old[1]))
    change = (spread(0.0), new[0] - old[0], new[1] - old[1])
    store_two(b, ROLL, new)
    return add(twist, symmetric(b, K_NN, change)), add(wrench, change)
