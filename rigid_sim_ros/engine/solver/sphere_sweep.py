# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Visits of the sequential solver to eight contacts of balls; see contact_blocks.py.

The common point c = x_A + a n = x_B + b n lies on the normal through both centres of mass, and the
inertia of each body is a number I. With m = b w_B - a w_A the relative velocity at c is

    u = v_B - v_A + m x n,   u . n = (v_B - v_A) . n,   u . t1 = (v_B - v_A) . t1 + m . t2, ...

so the response K is diagonal: 1/m_A + 1/m_B along n, besides a^2 / I_A + b^2 / I_B along t1 and
t2. About n a point makes no torque; where something resists spinning, the blocks are those of
other shapes. That takes a third of the work of other contacts and half of their memory.
"""

from rigid_sim_ros.engine.constraints.contact_blocks import (
    ABSENT, APPROACH, axes, combine, drift_together, FRICTION, GAP, IMPULSE, inverse_of, LEVER_A,
    LEVER_B, load_three, load_two, make_basis, MASS, Motion, MU, NORMAL, POINT, SHOVE, SIZE, SPEED,
    STICK, store_two, Three, TURN_T)
from rigid_sim_ros.engine.constraints.contact_rules import (
    approach_of, bounded_step, is_open, least_speed, NEGLIGIBLE, normal_impulse, Sweep, wanted_of)
from rigid_sim_ros.engine.maths.vector import add_scaled, dot, scale, subtract
from rigid_sim_ros.engine.solver.solver_bodies import INV_I, INV_M
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.eight import (
    any_of, Eight, gather, load, Mask, scatter, select, spread, store)
from rigid_sim_ros.kernels.kernel import part


@part
def prepare_balls(b: Array, inv_m_A: Eight, inv_m_B: Eight, inv_I_A: Eight,
                  inv_I_B: Eight) -> None:
    """
    Work out frames and responses, given the inverse masses and inertias.

    Filled in before: what `prepare_block` asks for, but levers in place of arms and of where the
    point is.
    """
    make_basis(b)
    a, c = load(b, LEVER_A), load(b, LEVER_B)
    straight = inv_m_A + inv_m_B
    store(b, POINT + MASS, select(load(b, POINT + GAP) < ABSENT, inverse_of(straight), 0.0))
    store(b, STICK, inverse_of(straight + a * a * inv_I_A + c * c * inv_I_B))


@part
def warm_balls(b: Array, warm: Array, at_A: IntArray, at_B: IntArray, inv_m_A: Eight,
               inv_m_B: Eight) -> None:
    """Let the impulses of a block act at the start of the first substep."""
    n, t1, t2 = axes(b)
    along, (slide_1, slide_2) = load(b, POINT + IMPULSE), load_two(b, FRICTION)
    if not any_of(along + abs(slide_1) + abs(slide_2) > 0.0):
        return
    F = combine(n, t1, t2, (along, slide_1, slide_2))
    turn = subtract(scale(slide_1, t2), scale(slide_2, t1))
    A, B = gather(warm, at_A), gather(warm, at_B)
    scatter(warm, at_A, _pushed(A, inv_m_A, load(b, LEVER_A), F, turn, -1.0))
    scatter(warm, at_B, _pushed(B, inv_m_B, load(b, LEVER_B), F, turn, 1.0))


@part
def visit_balls(b: Array, motion: Array, at_A: IntArray, at_B: IntArray, what: Sweep,
                mask: Mask) -> Eight:
    """Solve the normals and then the friction of a block of balls; see `visit`."""
    A, B = gather(motion, at_A), gather(motion, at_B)
    n, t1, t2 = axes(b)
    v = (B[0] - A[0], B[1] - A[1], B[2] - A[2])
    old_N, speed = load(b, POINT + IMPULSE), dot(v, n)
    pressure, old = normal_impulse(b, POINT, speed, what, mask), load_two(b, FRICTION)
    if not any_of(pressure + old_N + abs(old[0]) + abs(old[1]) > 0.0):
        # Nothing presses, nor did anything before this visit.
        _keep_speed(b, speed, mask)
        return spread(0.0)
    straight, change_N = A[INV_M] + B[INV_M], pressure - old_N
    store(b, POINT + IMPULSE, pressure)
    _keep_speed(b, speed + straight * change_N, mask)

    w_A, w_B = scale(A[INV_I], (A[3], A[4], A[5])), scale(B[INV_I], (B[3], B[4], B[5]))
    m = subtract(scale(load(b, LEVER_B), w_B), scale(load(b, LEVER_A), w_A))
    turns = load_two(b, TURN_T)
    sliding = (dot(v, t1) + dot(m, t2) + what.when * turns[0],
               dot(v, t2) - dot(m, t1) + what.when * turns[1])
    new = bounded_step(old, load(b, STICK), sliding, load(b, MU) * pressure)
    new = (select(mask, new[0], old[0]), select(mask, new[1], old[1]))
    store_two(b, FRICTION, new)
    change = (new[0] - old[0], new[1] - old[1])

    F = combine(n, t1, t2, (change_N, change[0], change[1]))
    turn = subtract(scale(change[0], t2), scale(change[1], t1))     # n x F
    scatter(motion, at_A, _pushed(A, A[INV_M], load(b, LEVER_A), F, turn, -1.0))
    scatter(motion, at_B, _pushed(B, B[INV_M], load(b, LEVER_B), F, turn, 1.0))
    return straight * max(abs(change_N), max(abs(change[0]), abs(change[1])))


@part
def _keep_speed(b: Array, speed: Eight, mask: Mask) -> None:
    """
    Write the normal velocity if anybody will ask for it, see `wanted_of`.

    In the lanes that are visited.
    """
    if any_of(load(b, POINT + GAP) < -NEGLIGIBLE * load(b, SIZE)):
        store(b, POINT + SPEED, select(mask, speed, load(b, POINT + SPEED)))


@part
def _pushed(motion: Motion, inv_m: Eight, lever: Eight, F: Three, turn: Three,
            sign: float) -> Motion:
    """Return the motion after an impulse at c, `sign` times F; `turn` is n x F."""
    moves = select(inv_m > 0.0, sign, 0.0)
    v = add_scaled((motion[0], motion[1], motion[2]), sign * inv_m, F)
    L = add_scaled((motion[3], motion[4], motion[5]), moves * lever, turn)
    return (v[0], v[1], v[2], L[0], L[1], L[2], motion[6], motion[7])


@part
def drift_balls(b: Array, A: Motion, B: Motion, h: float, shoved: bool, what: Sweep) -> Eight:
    """Move on the gaps by the velocities with which the bodies drifted; see contact_sweep.py."""
    n = load_three(b, NORMAL)
    v = (B[0] - A[0], B[1] - A[1], B[2] - A[2])
    drift_together(b, 1, shoved, v, h)
    was_open, speed = is_open(b, POINT), dot(v, n)
    store(b, POINT + GAP, load(b, POINT + GAP) + h * speed)
    store(b, POINT + APPROACH, 0.0)
    return approach_of(speed + least_speed(b, POINT, what), was_open)


@part
def separate_balls(b: Array, push: Array, at_A: IntArray, at_B: IntArray, rate: float,
                   mask: Mask, found: Mask) -> None:
    """Push balls apart along the line of centres, which turns nobody; see `separate`."""
    A, B, n = gather(push, at_A), gather(push, at_B), load_three(b, NORMAL)
    wanted = wanted_of(b, POINT, rate, mask)
    parting = dot((B[0] - A[0], B[1] - A[1], B[2] - A[2]), n)
    shove = max(load(b, POINT + MASS) * (wanted - parting), 0.0)
    shove = select(found, load(b, SHOVE), select(wanted > 0.0, shove, 0.0))
    store(b, SHOVE, shove)
    to_A, to_B = -A[INV_M] * shove, B[INV_M] * shove
    scatter(push, at_A, (A[0] + to_A * n[0], A[1] + to_A * n[1], A[2] + to_A * n[2], A[3], A[4],
                         A[5], A[6], A[7]))
    scatter(push, at_B, (B[0] + to_B * n[0], B[1] + to_B * n[1], B[2] + to_B * n[2], B[3], B[4],
                         B[5], B[6], B[7]))
