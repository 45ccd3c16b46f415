# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One visit of the sequential solver to eight manifolds; contact_blocks.py explains the arithmetic."""

from typing import NamedTuple

from rigid_sim_ros.engine.arrays import Array, IntArray
from rigid_sim_ros.engine.contact_blocks import (
    ARM_A, ARM_B, FRICTION, GAP, IMPULSE, INV_M_A, INV_M_B, INV_SPIN, INV_TT, J_A, J_B, K_NN, K_TN,
    K_TT, MASS, MOTION_A, MOTION_B, MOVED, MU, NORMAL, PAIR, POINT, POINT_ROWS, put_three, RESIDUAL,
    ROLL, ROLL_LEVER, ROLL_STEP, S, SLIDE, SPIN_LEVER, symmetric, T, TANGENT, three, TORSION, TOTAL,
    TOTAL_T, TWIST, WRENCH)
from rigid_sim_ros.engine.kernel import inlined, kernel
from rigid_sim_ros.engine.solver_bodies import LANES
from rigid_sim_ros.engine.vector import add, add_scaled, cross, dot, subtract


class Sweep(NamedTuple):
    """What a visit is for."""

    inv_h: float  # 1 / length of the substep [1/s]
    drift: float  # [s] the bodies moved for this long since the last visit
    push_rate: float  # part of an overlap that is pushed out per second [1/s]
    push_speed: float  # [m/s] but not faster
    mass_scale: float  # 1: rigid; softer below
    impulse_scale: float  # 0: rigid; how much the impulse so far gives way
    total: float  # 1: this visit ends a substep, its impulses count for the step
    again: float  # 1: after this visit all impulses act once more, as the next warm start


@kernel
def visit(b: Array, motion: Array, at_A: IntArray, at_B: IntArray, points: int, rolls: bool,
          sweep: Sweep) -> None:
    """Read the bodies of a block, solve normals and then friction, write the bodies."""
    for i in range(LANES):
        for k in range(6):
            b[(MOTION_A + k) * LANES + i] = motion[at_A[i] + k * LANES]
            b[(MOTION_B + k) * LANES + i] = motion[at_B[i] + k * LANES]
    _read_twist(b, sweep.drift)
    if rolls:
        _solve_rolling(b)
    _solve_point(b, POINT, sweep)
    if points > 1:
        _solve_point(b, POINT + POINT_ROWS, sweep)
    if points > 2:
        _solve_point(b, POINT + 2 * POINT_ROWS, sweep)
        _solve_point(b, POINT + 3 * POINT_ROWS, sweep)
    _solve_friction(b, sweep)
    for i in range(LANES):
        for k in range(6):
            motion[at_A[i] + k * LANES] = b[(MOTION_A + k) * LANES + i]
            motion[at_B[i] + k * LANES] = b[(MOTION_B + k) * LANES + i]


@kernel
def _read_twist(b: Array, drift: float) -> None:
    """Write the twist of B relative to A at c, in the axes n, t1, t2; clear the sums of the visit."""
    for i in range(LANES):
        n, t1 = three(b, NORMAL, i), three(b, TANGENT, i)
        t2 = cross(n, t1)
        w_A = symmetric(b, J_A, i, three(b, MOTION_A + 3, i))
        w_B = symmetric(b, J_B, i, three(b, MOTION_B + 3, i))
        v = subtract(three(b, MOTION_B, i), three(b, MOTION_A, i))
        put_three(b, MOVED, i, add_scaled(three(b, MOVED, i), drift, v))
        u = subtract(add(v, cross(w_B, three(b, ARM_B, i))), cross(w_A, three(b, ARM_A, i)))
        w = subtract(w_B, w_A)
        put_three(b, TWIST, i, (dot(u, n), dot(w, t1), dot(w, t2)))
        put_three(b, TWIST + 3, i, (dot(u, t1), dot(u, t2), dot(w, n)))
        put_three(b, WRENCH, i, (0.0, 0.0, 0.0))
        b[(WRENCH + 3) * LANES + i] = 0.0
        b[RESIDUAL * LANES + i] = 0.0
        gap_rate = three(b, TWIST, i)
        for p in range(4):
            o = (POINT + p * POINT_ROWS) * LANES + i
            b[o + GAP * LANES] += drift * (gap_rate[0] + b[o + T * LANES] * gap_rate[1]
                                           - b[o + S * LANES] * gap_rate[2])


@inlined
def _solve_point(b: Array, point: int, sweep: Sweep) -> None:
    """
    Make the normal velocity at a point not less than -gap / h, by an impulse >= 0.

    An overlap is left at a bounded speed. A soft contact is a spring and a damper, solved
    implicitly (Catto, Soft Constraints, GDC 2011, and Solver2D, 2024).
    """
    for i in range(LANES):
        g = (1.0, b[(point + T) * LANES + i], -b[(point + S) * LANES + i])
        response = symmetric(b, K_NN, i, g)
        gap, impulse = b[(point + GAP) * LANES + i], b[(point + IMPULSE) * LANES + i]
        apart = gap > 0.0
        push = gap * sweep.inv_h if apart else max(gap * sweep.push_rate, -sweep.push_speed)
        mass_scale = 1.0 if apart else sweep.mass_scale
        impulse_scale = 0.0 if apart else sweep.impulse_scale
        twist = three(b, TWIST, i)
        speed = dot(g, twist) + push
        change = b[(point + MASS) * LANES + i] * (-mass_scale * speed) - impulse_scale * impulse
        after = max(impulse + change, 0.0)
        change = after - impulse
        b[(point + IMPULSE) * LANES + i] = after
        b[(point + TOTAL) * LANES + i] += sweep.total * after
        put_three(b, TWIST, i, add_scaled(twist, change, response))
        put_three(b, WRENCH, i, add_scaled(three(b, WRENCH, i), change, g))
        b[(WRENCH + 3) * LANES + i] += after
        b[RESIDUAL * LANES + i] = max(b[RESIDUAL * LANES + i], abs(change))


@kernel
def _solve_rolling(b: Array) -> None:
    """Stop the rolling as far as the normal impulses of the last visit allow."""
    for i in range(LANES):
        twist = three(b, TWIST, i)
        pressure = (b[(POINT + IMPULSE) * LANES + i] + b[(POINT + POINT_ROWS + IMPULSE) * LANES + i]
                    + b[(POINT + 2 * POINT_ROWS + IMPULSE) * LANES + i]
                    + b[(POINT + 3 * POINT_ROWS + IMPULSE) * LANES + i])
        limit = b[ROLL_LEVER * LANES + i] * pressure
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


@kernel
def _solve_friction(b: Array, sweep: Sweep) -> None:
    """
    Stop the sliding and the spinning at c within Coulomb's cone, and let the bodies feel the visit.

    Inside the cone the impulse that stops both directions at once. On the cone the impulse must oppose
    the velocity that is left, while K need not be isotropic: there the step is a multiple of the
    velocity, short enough to converge.
    """
    for i in range(LANES):
        wrench_N = three(b, WRENCH, i)
        k = K_TN * LANES + i
        twist = add(three(b, TWIST + 3, i), (
            b[k] * wrench_N[0] + b[k + LANES] * wrench_N[1] + b[k + 2 * LANES] * wrench_N[2],
            b[k + 3 * LANES] * wrench_N[0] + b[k + 4 * LANES] * wrench_N[1] + b[k + 5 * LANES] * wrench_N[2],
            b[k + 6 * LANES] * wrench_N[0] + b[k + 7 * LANES] * wrench_N[1] + b[k + 8 * LANES] * wrench_N[2]))
        pressure = b[(WRENCH + 3) * LANES + i]
        old = three(b, FRICTION, i)

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
        new = (stick1 if sticks else scale * slide1, stick2 if sticks else scale * slide2, spin)
        put_three(b, FRICTION, i, new)
        put_three(b, TOTAL_T, i, add_scaled(three(b, TOTAL_T, i), sweep.total, new))
        wrench_T = subtract(new, old)

        n, t1 = three(b, NORMAL, i), three(b, TANGENT, i)
        t2 = cross(n, t1)
        F = _combine(n, t1, t2, (wrench_N[0], wrench_T[0], wrench_T[1]))
        torque = _combine(n, t1, t2, (wrench_T[2], wrench_N[1], wrench_N[2]))
        put_three(b, MOTION_A, i, add_scaled(three(b, MOTION_A, i), -b[INV_M_A * LANES + i], F))
        put_three(b, MOTION_B, i, add_scaled(three(b, MOTION_B, i), b[INV_M_B * LANES + i], F))
        L_A, L_B = three(b, MOTION_A + 3, i), three(b, MOTION_B + 3, i)
        moves_A = 1.0 if b[INV_M_A * LANES + i] > 0.0 else 0.0
        moves_B = 1.0 if b[INV_M_B * LANES + i] > 0.0 else 0.0
        turn_A = add(cross(three(b, ARM_A, i), F), torque)
        turn_B = add(cross(three(b, ARM_B, i), F), torque)
        put_three(b, MOTION_A + 3, i, add_scaled(L_A, -moves_A, turn_A))
        put_three(b, MOTION_B + 3, i, add_scaled(L_B, moves_B, turn_B))

        # Impulses act where c was at the start of the step; the pair has moved since.
        ahead = _combine(n, t1, t2, (sweep.again * pressure, sweep.again * new[0], sweep.again * new[1]))
        gained = cross(three(b, MOVED, i), add(F, ahead))
        put_three(b, TORSION, i, add(three(b, TORSION, i), gained))
        b[RESIDUAL * LANES + i] *= b[INV_M_A * LANES + i] + b[INV_M_B * LANES + i]


@inlined
def _combine(n: tuple[float, float, float], t1: tuple[float, float, float], t2: tuple[float, float, float],
             c: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return c0 n + c1 t1 + c2 t2."""
    return (c[0] * n[0] + c[1] * t1[0] + c[2] * t2[0], c[0] * n[1] + c[1] * t1[1] + c[2] * t2[1],
            c[0] * n[2] + c[1] * t1[2] + c[2] * t2[2])
