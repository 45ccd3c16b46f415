# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One visit of the sequential solver to eight manifolds; see contact_blocks.py."""

from collections.abc import Callable
from typing import NamedTuple

from rigid_sim_ros.engine.arrays import Array, IntArray, Vector
from rigid_sim_ros.engine.contact_blocks import (
    ABSENT, ARM_A, ARM_B, FRICTION, GAP, IMPULSE, INV_M_A, INV_M_B, INV_SPIN, INV_TT, J_A, J_B,
    K_NN, K_TN, K_TT, MASS, MOTION_A, MOTION_B, MOVED, MU, NORMAL, OVERLAP, POINT, POINT_ROWS,
    put_three,
    RESIDUAL, ROLL, ROLL_LEVER, ROLL_STEP, S, SHOVE, SLIDE, SPEED, SPIN_LEVER, symmetric, T,
    TANGENT, three, TORSION, TOTAL, TOTAL_T, TWIST, WRENCH)
from rigid_sim_ros.engine.kernel import inlined, kernel, part
from rigid_sim_ros.engine.solver_bodies import INDEX, LANES
from rigid_sim_ros.engine.vector import add, add_scaled, cross, dot, subtract


# Bodies this near to each other touch [m]. Below it, velocities do not depend on the gap, nor does
# the push before there is an overlap: in between nothing can oscillate. 0: a stack of five rocks
# for ever by micrometres that grow; larger: contacts rest this far apart.
SKIN = 2e-5
# An overlap that is not pushed apart [m].
NEGLIGIBLE = 1e-6


class Sweep(NamedTuple):
    """What a visit is for."""

    inv_h: float  # 1 / length of the substep [1/s]
    drift: float  # [s] the bodies moved for this long since the last visit; 0: they did not
    backwards: bool


@kernel
def visit(b: Array, motion: Array, drifted: Array, at_A: IntArray, at_B: IntArray, points: int,
          rolls: bool, sweep: Sweep) -> None:
    """
    Read the bodies of a block, solve normals and then friction, write the bodies.

    Friction comes last because the normal impulses bound it. Backwards the sweep takes the blocks
    in the opposite order, so that two sweeps make a nearly symmetric iteration: its errors decay,
    while those of a one-sided one also rotate, and the warm start, an extrapolation, would make
    that a growing sway of a stack.
    """
    if sweep.drift > 0.0:
        _gather(b, drifted, at_A, at_B)
        _drift(b, sweep.drift, points)
    _gather(b, motion, at_A, at_B)
    if points == 1 and not rolls:
        _solve_single(b, sweep)
        _scatter(b, motion, at_A, at_B)
        return
    _read_twist(b)
    for i in range(LANES):
        b[RESIDUAL * LANES + i] = 0.0
    if rolls:
        _solve_rolling(b)
    if points > 1:
        _solve_together(b, sweep)
    _solve_point_0(b, sweep)
    if points > 1:
        _solve_point_1(b, sweep)
    if points > 2:
        _solve_point_2(b, sweep)
        _solve_point_3(b, sweep)
    if not _presses(b):
        return
    _solve_friction(b)
    _push_bodies(b)
    _scatter(b, motion, at_A, at_B)


@part
def _solve_single(b: Array, sweep: Sweep) -> None:
    """
    Do all that the other parts do, for manifolds of one point: their common point c.

    There the direction of the normal impulse is (1, 0, 0), and six rows of the response suffice.
    """
    for i in range(LANES):
        n, t1 = three(b, NORMAL, i), three(b, TANGENT, i)
        t2 = cross(n, t1)
        _, u, w = _twist(b, i)
        old_N = b[(POINT + IMPULSE) * LANES + i]
        speed = dot(u, n)
        wanted = speed + max(b[(POINT + GAP) * LANES + i] - SKIN, 0.0) * sweep.inv_h
        pressure = max(old_N - b[(POINT + MASS) * LANES + i] * wanted, 0.0)
        change_N = pressure - old_N
        b[(POINT + IMPULSE) * LANES + i] = pressure
        b[(POINT + SPEED) * LANES + i] = speed + b[K_NN * LANES + i] * change_N

        k = K_TN * LANES + i
        twist = (dot(u, t1) + b[k] * change_N, dot(u, t2) + b[k + 3 * LANES] * change_N,
                 dot(w, n) + b[k + 6 * LANES] * change_N)
        old = three(b, FRICTION, i)
        new = _friction(b, i, twist, pressure, old)
        put_three(b, FRICTION, i, new)
        change = subtract(new, old)
        b[RESIDUAL * LANES + i] = (b[INV_M_A * LANES + i] + b[INV_M_B * LANES + i]) * max(
            abs(change_N), max(abs(change[0]), abs(change[1])))

        F = _combine(n, t1, t2, (change_N, change[0], change[1]))
        torque = (change[2] * n[0], change[2] * n[1], change[2] * n[2])
        _push_lane(b, i, F, torque)
        put_three(b, TORSION, i, add(three(b, TORSION, i), cross(three(b, MOVED, i), F)))


@kernel
def _presses(b: Array) -> bool:
    """Return whether any manifold of a block has an impulse, or had one before this visit."""
    for i in range(LANES):
        b[OVERLAP * LANES + i] = (
            b[RESIDUAL * LANES + i] + _pressure(b, i) + abs(b[FRICTION * LANES + i])
            + abs(b[(FRICTION + 1) * LANES + i]) + abs(b[(FRICTION + 2) * LANES + i])
            + abs(b[ROLL * LANES + i]) + abs(b[(ROLL + 1) * LANES + i]))
    for i in range(LANES):
        if b[OVERLAP * LANES + i] > 0.0:
            return True
    return False


@kernel
def is_settled(b: Array, speed: float) -> bool:
    """Return whether the last visit changed no velocity in a block by more than `speed` [m/s]."""
    for i in range(LANES):
        if b[RESIDUAL * LANES + i] > speed:
            return False
    return True


@kernel
def count_impulses(b: Array, points: int) -> None:
    """Add the impulses of a substep to those of the step."""
    for i in range(LANES):
        put_three(b, TOTAL_T, i, add(three(b, TOTAL_T, i), three(b, FRICTION, i)))
        b[(POINT + TOTAL) * LANES + i] += b[(POINT + IMPULSE) * LANES + i]
    if points > 1:
        for i in range(LANES):
            for p in range(1, 4):
                o = (POINT + p * POINT_ROWS) * LANES + i
                b[o + TOTAL * LANES] += b[o + IMPULSE * LANES]


@kernel
def overlaps(b: Array) -> bool:
    """Return whether any point of a block overlaps by more than is left alone."""
    for i in range(LANES):
        o = (POINT + GAP) * LANES + i
        b[OVERLAP * LANES + i] = min(
            min(b[o], b[o + POINT_ROWS * LANES]),
            min(b[o + 2 * POINT_ROWS * LANES], b[o + 3 * POINT_ROWS * LANES]))
    for i in range(LANES):
        if b[OVERLAP * LANES + i] < -NEGLIGIBLE:
            return True
    return False


@kernel
def separate(b: Array, push: Array, at_A: IntArray, at_B: IntArray, points: int, rate: float,
             speed: float) -> None:
    """
    Push the overlaps of a block apart by velocities that last for one substep only.

    They displace and are forgotten, so that the push feeds neither energy nor the warm start.
    `rate` [1/s] is the part of an overlap that goes per second, but not faster than `speed` [m/s].
    """
    _gather(b, push, at_A, at_B)
    _read_twist(b)
    if points > 1:
        _separate_together(b, rate, speed)
    _separate_point_0(b, rate, speed)
    if points > 1:
        _separate_point_1(b, rate, speed)
    if points > 2:
        _separate_point_2(b, rate, speed)
        _separate_point_3(b, rate, speed)
    for i in range(LANES):
        b[SHOVE * LANES + i] = b[WRENCH * LANES + i]
    _apply(b)
    _scatter(b, push, at_A, at_B)


@inlined
def _gather(b: Array, motion: Array, at_A: IntArray, at_B: IntArray) -> None:
    for i in range(LANES):
        at = at_A[i] & INDEX
        for k in range(6):
            b[(MOTION_A + k) * LANES + i] = motion[at + k]
    for i in range(LANES):
        at = at_B[i] & INDEX
        for k in range(6):
            b[(MOTION_B + k) * LANES + i] = motion[at + k]


@inlined
def _scatter(b: Array, motion: Array, at_A: IntArray, at_B: IntArray) -> None:
    for i in range(LANES):
        at = at_A[i] & INDEX
        for k in range(6):
            motion[at + k] = b[(MOTION_A + k) * LANES + i]
    for i in range(LANES):
        at = at_B[i] & INDEX
        for k in range(6):
            motion[at + k] = b[(MOTION_B + k) * LANES + i]


@inlined
def _twist(b: Array, i: int) -> tuple[Vector, Vector, Vector]:
    """Return v_B - v_A, the relative velocity at c and the relative spin, in W."""
    w_A = symmetric(b, J_A, i, three(b, MOTION_A + 3, i))
    w_B = symmetric(b, J_B, i, three(b, MOTION_B + 3, i))
    v = subtract(three(b, MOTION_B, i), three(b, MOTION_A, i))
    u = subtract(add(v, cross(w_B, three(b, ARM_B, i))), cross(w_A, three(b, ARM_A, i)))
    return v, u, subtract(w_B, w_A)


@part
def _drift(b: Array, h: float, points: int) -> None:
    """
    Move on the gaps by the velocities with which the bodies drifted for h [s].

    The impulses of the last substep have acted again since, as the warm start, where c was at the
    start of the step, while the pair has moved: that gains angular momentum. So does the push,
    which displaces momenta.
    """
    for i in range(LANES):
        n, t1 = three(b, NORMAL, i), three(b, TANGENT, i)
        t2 = cross(n, t1)
        v, u, w = _twist(b, i)
        moved = add_scaled(three(b, MOVED, i), h, v)
        put_three(b, MOVED, i, moved)
        put_three(b, TWIST, i, (h * dot(u, n), h * dot(w, t1), h * dot(w, t2)))
        F = _combine(n, t1, t2, (_pressure(b, i), b[FRICTION * LANES + i], b[(FRICTION
                                                                              + 1) * LANES + i]))
        shove = b[SHOVE * LANES + i] * h
        gained = add(cross(moved, F), cross((shove * n[0], shove * n[1], shove * n[2]), v))
        put_three(b, TORSION, i, add(three(b, TORSION, i), gained))
        b[SHOVE * LANES + i] = 0.0
    for p in range(4 if points > 1 else 1):
        point = (POINT + p * POINT_ROWS) * LANES
        for i in range(LANES):
            o = point + i
            b[o + GAP * LANES] += (b[TWIST * LANES + i]
                                   + b[o + T * LANES] * b[(TWIST + 1) * LANES + i]
                                   - b[o + S * LANES] * b[(TWIST + 2) * LANES + i])


@kernel
def _read_twist(b: Array) -> None:
    """Write the twist of B relative to A at c in axes n, t1, t2; clear the sums."""
    for i in range(LANES):
        n, t1 = three(b, NORMAL, i), three(b, TANGENT, i)
        t2 = cross(n, t1)
        _, u, w = _twist(b, i)
        put_three(b, TWIST, i, (dot(u, n), dot(w, t1), dot(w, t2)))
        put_three(b, TWIST + 3, i, (dot(u, t1), dot(u, t2), dot(w, n)))
        put_three(b, WRENCH, i, (0.0, 0.0, 0.0))
        put_three(b, WRENCH + 3, i, (0.0, 0.0, 0.0))


@inlined
def _gap(b: Array, point: int, i: int) -> float:
    """Return how far a point is from touching [m]."""
    return max(b[(point + GAP) * LANES + i] - SKIN, 0.0)


@part
def _solve_together(b: Array, sweep: Sweep) -> None:
    """
    Stop the approach of all points that are equally near, with the same impulse at each.

    A step along the sum of their directions, before each is visited alone: it treats them alike,
    so that what lies symmetrically stays so, and it carries weight through a stack faster.
    """
    p0, p1, p2, p3 = POINT, POINT + POINT_ROWS, POINT + 2 * POINT_ROWS, POINT + 3 * POINT_ROWS
    for i in range(LANES):
        d0, d1, d2, d3 = _gap(b, p0, i), _gap(b, p1, i), _gap(b, p2, i), _gap(b, p3, i)
        nearest = min(min(d0, d1), min(d2, d3)) + SKIN
        w0, w1 = 1.0 if d0 < nearest else 0.0, 1.0 if d1 < nearest else 0.0
        w2, w3 = 1.0 if d2 < nearest else 0.0, 1.0 if d3 < nearest else 0.0
        g = _sum_of_points(b, i, w0, w1, w2, w3)
        gap = w0 * d0 + w1 * d1 + w2 * d2 + w3 * d3
        response = symmetric(b, K_NN, i, g)
        twist = three(b, TWIST, i)
        k = dot(g, response)
        change = -(dot(g, twist) + sweep.inv_h * gap) / k if k > 0.0 else 0.0
        # No impulse may fall below 0.
        f0, f1 = b[(p0 + IMPULSE) * LANES + i], b[(p1 + IMPULSE) * LANES + i]
        f2, f3 = b[(p2 + IMPULSE) * LANES + i], b[(p3 + IMPULSE) * LANES + i]
        least = min(min(f0 if w0 > 0.0 else ABSENT, f1 if w1 > 0.0 else ABSENT),
                    min(f2 if w2 > 0.0 else ABSENT, f3 if w3 > 0.0 else ABSENT))
        change = max(change, -least)
        b[(p0 + IMPULSE) * LANES + i] = f0 + w0 * change
        b[(p1 + IMPULSE) * LANES + i] = f1 + w1 * change
        b[(p2 + IMPULSE) * LANES + i] = f2 + w2 * change
        b[(p3 + IMPULSE) * LANES + i] = f3 + w3 * change
        put_three(b, TWIST, i, add_scaled(twist, change, response))
        put_three(b, WRENCH, i, add_scaled(three(b, WRENCH, i), change, g))


@inlined
def _sum_of_points(b: Array, i: int, w0: float, w1: float, w2: float, w3: float) -> Vector:
    """Return the sum of the columns g of the points, each times its weight."""
    p0, p1, p2, p3 = POINT, POINT + POINT_ROWS, POINT + 2 * POINT_ROWS, POINT + 3 * POINT_ROWS
    s0, s1, s2, s3 = b[p0 * LANES + i], b[p1 * LANES + i], b[p2 * LANES + i], b[p3 * LANES + i]
    t0, t1 = b[(p0 + T) * LANES + i], b[(p1 + T) * LANES + i]
    t2, t3 = b[(p2 + T) * LANES + i], b[(p3 + T) * LANES + i]
    return (w0 + w1 + w2 + w3, w0 * t0 + w1 * t1 + w2 * t2 + w3 * t3,
            -(w0 * s0 + w1 * s1 + w2 * s2 + w3 * s3))


def _point_solver(point: int) -> Callable[[Array, Sweep], None]:
    """Return the kernel for the point with its rows at `point`, a constant in it."""

    @kernel
    def solve_point(b: Array, sweep: Sweep) -> None:
        # The normal velocity is made not less than -(gap - SKIN) / h, nor less than 0, by an
        # impulse >= 0.
        for i in range(LANES):
            g = (1.0, b[(point + T) * LANES + i], -b[(point + S) * LANES + i])
            response = symmetric(b, K_NN, i, g)
            twist, impulse = three(b, TWIST, i), b[(point + IMPULSE) * LANES + i]
            speed = dot(g, twist) + max(b[(point + GAP) * LANES + i] - SKIN, 0.0) * sweep.inv_h
            after = max(impulse - b[(point + MASS) * LANES + i] * speed, 0.0)
            change = after - impulse
            b[(point + IMPULSE) * LANES + i] = after
            twist = add_scaled(twist, change, response)
            b[(point + SPEED) * LANES + i] = dot(g, twist)
            put_three(b, TWIST, i, twist)
            put_three(b, WRENCH, i, add_scaled(three(b, WRENCH, i), change, g))
            b[RESIDUAL * LANES + i] = max(b[RESIDUAL * LANES + i], abs(change))

    return solve_point


@inlined
def _wanted(b: Array, point: int, i: int, rate: float, speed: float) -> float:
    """Return the speed by which a point leaves its overlap too slowly, 0 without one [m/s]."""
    push = min(-rate * min(b[(point + GAP) * LANES + i], 0.0), speed)
    return max(push - max(b[(point + SPEED) * LANES + i], 0.0), 0.0)


@kernel
def _separate_together(b: Array, rate: float, speed: float) -> None:
    """Push all points that overlap with the same impulse, as `_solve_together` stops them."""
    p0, p1, p2, p3 = POINT, POINT + POINT_ROWS, POINT + 2 * POINT_ROWS, POINT + 3 * POINT_ROWS
    for i in range(LANES):
        u0, u1 = _wanted(b, p0, i, rate, speed), _wanted(b, p1, i, rate, speed)
        u2, u3 = _wanted(b, p2, i, rate, speed), _wanted(b, p3, i, rate, speed)
        w0, w1 = 1.0 if u0 > 0.0 else 0.0, 1.0 if u1 > 0.0 else 0.0
        w2, w3 = 1.0 if u2 > 0.0 else 0.0, 1.0 if u3 > 0.0 else 0.0
        g = _sum_of_points(b, i, w0, w1, w2, w3)
        response = symmetric(b, K_NN, i, g)
        twist = three(b, TWIST, i)
        k = dot(g, response)
        change = max((u0 + u1 + u2 + u3 - dot(g, twist)) / k if k > 0.0 else 0.0, 0.0)
        put_three(b, TWIST, i, add_scaled(twist, change, response))
        put_three(b, WRENCH, i, add_scaled(three(b, WRENCH, i), change, g))


def _point_separator(point: int) -> Callable[[Array, float, float], None]:
    """Return the kernel that pushes one point out of its overlap."""

    @kernel
    def separate_point(b: Array, rate: float, speed: float) -> None:
        for i in range(LANES):
            g = (1.0, b[(point + T) * LANES + i], -b[(point + S) * LANES + i])
            twist, wanted = three(b, TWIST, i), _wanted(b, point, i, rate, speed)
            change = max(b[(point + MASS) * LANES + i] * (wanted - dot(g, twist)), 0.0)
            change = change if wanted > 0.0 else 0.0
            put_three(b, TWIST, i, add_scaled(twist, change, symmetric(b, K_NN, i, g)))
            put_three(b, WRENCH, i, add_scaled(three(b, WRENCH, i), change, g))

    return separate_point


_separate_point_0 = _point_separator(POINT)
_separate_point_1 = _point_separator(POINT + POINT_ROWS)
_separate_point_2 = _point_separator(POINT + 2 * POINT_ROWS)
_separate_point_3 = _point_separator(POINT + 3 * POINT_ROWS)
_solve_point_0 = _point_solver(POINT)
_solve_point_1 = _point_solver(POINT + POINT_ROWS)
_solve_point_2 = _point_solver(POINT + 2 * POINT_ROWS)
_solve_point_3 = _point_solver(POINT + 3 * POINT_ROWS)


@inlined
def _pressure(b: Array, i: int) -> float:
    """Return the sum of the normal impulses [N s]."""
    return (b[(POINT + IMPULSE) * LANES + i] + b[(POINT + POINT_ROWS + IMPULSE) * LANES + i]
            + b[(POINT + 2 * POINT_ROWS + IMPULSE) * LANES + i]
            + b[(POINT + 3 * POINT_ROWS + IMPULSE) * LANES + i])


@kernel
def _solve_rolling(b: Array) -> None:
    """Stop the rolling as far as the normal impulses allow."""
    for i in range(LANES):
        twist = three(b, TWIST, i)
        limit = b[ROLL_LEVER * LANES + i] * _pressure(b, i)
        r1, r2 = b[ROLL * LANES + i], b[(ROLL + 1) * LANES + i]
        step = b[ROLL_STEP * LANES + i]
        a1, a2 = r1 - step * twist[1], r2 - step * twist[2]
        square = a1 * a1 + a2 * a2
        scale = limit / square ** 0.5 if square > limit * limit else 1.0
        change = (0.0, scale * a1 - r1, scale * a2 - r2)
        b[ROLL * LANES + i] = scale * a1
        b[(ROLL + 1) * LANES + i] = scale * a2
        put_three(b, TWIST, i, add(twist, symmetric(b, K_NN, i, change)))
        put_three(b, WRENCH, i, add(three(b, WRENCH, i), change))


@part
def _solve_friction(b: Array) -> None:
    """
    Stop the sliding and the spinning at c within Coulomb's cone.

    Inside the cone the impulse that stops both directions at once. On the cone the impulse must
    oppose the velocity that is left, while K need not be isotropic: there the step is a multiple
    of the velocity, short enough to converge.
    """
    for i in range(LANES):
        wrench_N = three(b, WRENCH, i)
        first, second = three(b, K_TN, i), three(b, K_TN + 3, i)
        third = three(b, K_TN + 6, i)
        twist = add(three(b, TWIST + 3, i),
                    (dot(first, wrench_N), dot(second, wrench_N), dot(third, wrench_N)))
        old = three(b, FRICTION, i)
        new = _friction(b, i, twist, _pressure(b, i), old)
        put_three(b, FRICTION, i, new)
        change = subtract(new, old)
        b[RESIDUAL * LANES + i] = max(b[RESIDUAL * LANES + i],
                                      max(abs(change[0]), abs(change[1])))
        put_three(b, WRENCH + 3, i, change)
        put_three(b, TWIST, i, add(three(b, TWIST, i), _combine(first, second, third, change)))


@inlined
def _friction(b: Array, i: int, twist: Vector, pressure: float, old: Vector) -> Vector:
    """Return the impulses of friction along t1, t2 and about n; `twist` is T with the old ones."""
    most = b[SPIN_LEVER * LANES + i] * pressure
    spin = min(max(old[2] - b[INV_SPIN * LANES + i] * twist[2], -most), most)
    k = K_TT * LANES + i
    u1 = twist[0] + b[k + 2 * LANES] * (spin - old[2])
    u2 = twist[1] + b[k + 4 * LANES] * (spin - old[2])
    limit = b[MU * LANES + i] * pressure
    inv00, inv01, inv11 = three(b, INV_TT, i)
    stick1, stick2 = old[0] - inv00 * u1 - inv01 * u2, old[1] - inv01 * u1 - inv11 * u2
    sticks = stick1 * stick1 + stick2 * stick2 <= limit * limit
    slide = b[SLIDE * LANES + i]
    slide1, slide2 = old[0] - slide * u1, old[1] - slide * u2
    square = slide1 * slide1 + slide2 * slide2
    scale = limit / square ** 0.5 if square > limit * limit else 1.0
    return (stick1 if sticks else scale * slide1, stick2 if sticks else scale * slide2, spin)


@part
def _push_bodies(b: Array) -> None:
    """Let the bodies feel the impulses of this visit."""
    _apply(b)
    for i in range(LANES):
        put_three(b, TORSION, i, add(three(b, TORSION, i), three(b, TWIST, i)))
        b[RESIDUAL * LANES + i] *= b[INV_M_A * LANES + i] + b[INV_M_B * LANES + i]


@kernel
def _apply(b: Array) -> None:
    """Change the motion of the bodies; TWIST becomes what L the pair gains."""
    for i in range(LANES):
        wrench_N, wrench_T = three(b, WRENCH, i), three(b, WRENCH + 3, i)
        n, t1 = three(b, NORMAL, i), three(b, TANGENT, i)
        t2 = cross(n, t1)
        F = _combine(n, t1, t2, (wrench_N[0], wrench_T[0], wrench_T[1]))
        torque = _combine(n, t1, t2, (wrench_T[2], wrench_N[1], wrench_N[2]))
        _push_lane(b, i, F, torque)
        put_three(b, TWIST, i, cross(three(b, MOVED, i), F))


@inlined
def _push_lane(b: Array, i: int, F: Vector, torque: Vector) -> None:
    """Let an impulse at c act on the copies of both bodies of a lane."""
    put_three(b, MOTION_A, i, add_scaled(three(b, MOTION_A, i), -b[INV_M_A * LANES + i], F))
    put_three(b, MOTION_B, i, add_scaled(three(b, MOTION_B, i), b[INV_M_B * LANES + i], F))
    L_A, L_B = three(b, MOTION_A + 3, i), three(b, MOTION_B + 3, i)
    moves_A = 1.0 if b[INV_M_A * LANES + i] > 0.0 else 0.0
    moves_B = 1.0 if b[INV_M_B * LANES + i] > 0.0 else 0.0
    turn_A = add(cross(three(b, ARM_A, i), F), torque)
    turn_B = add(cross(three(b, ARM_B, i), F), torque)
    put_three(b, MOTION_A + 3, i, add_scaled(L_A, -moves_A, turn_A))
    put_three(b, MOTION_B + 3, i, add_scaled(L_B, moves_B, turn_B))


@inlined
def _combine(n: Vector, t1: Vector, t2: Vector,
             c: Vector) -> Vector:
    """Return c0 n + c1 t1 + c2 t2."""
    return (c[0] * n[0] + c[1] * t1[0] + c[2] * t2[0], c[0] * n[1] + c[1] * t1[1] + c[2] * t2[1],
            c[0] * n[2] + c[1] * t1[2] + c[2] * t2[2])
