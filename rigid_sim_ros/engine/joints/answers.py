# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How articulations answer to impulses on their bodies: eight of them at once, one in each lane.

The recursion is that of articulated.solve, with nothing asked of the joints. Each row of contact
needs an answer, and the factors that all of them read are the same. Impulses act, and answers are
asked for, where an articulation is touched: what else hangs on it, as arms on a body that stands,
is left out.
"""

from rigid_sim_ros.engine.joints.articulated import along, axis_part
from rigid_sim_ros.engine.joints.buffers import AnswerWork, JointWork, LOCKED
from rigid_sim_ros.engine.maths.spatial import (
    force_about, minus, motion_at, product, set_six, Six, six)
from rigid_sim_ros.engine.maths.vector import add, cross, row
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.eight import Eight, LANES, load, spread, store
from rigid_sim_ros.kernels.kernel import inlined, kernel

SixEights = tuple[Eight, Eight, Eight, Eight, Eight, Eight]


@inlined
def _load_six(a: Array, i: int) -> SixEights:
    return (load(a, 6 * i), load(a, 6 * i + 1), load(a, 6 * i + 2), load(a, 6 * i + 3),
            load(a, 6 * i + 4), load(a, 6 * i + 5))


@inlined
def _store_six(a: Array, i: int, V: SixEights) -> None:
    store(a, 6 * i, V[0])
    store(a, 6 * i + 1, V[1])
    store(a, 6 * i + 2, V[2])
    store(a, 6 * i + 3, V[3])
    store(a, 6 * i + 4, V[4])
    store(a, 6 * i + 5, V[5])


@kernel
def push_nothing(table: JointTable, work: AnswerWork, first: int, last: int) -> None:
    """Let no impulse act on the rows from first to last, nor along their axes."""
    work.F[6 * LANES * first:6 * LANES * last] = 0.0
    work.tau[LANES * table.first_axis[first]:LANES * table.first_axis[last]] = 0.0


@kernel
def want_all(work: AnswerWork, first: int, last: int, wanted: bool) -> None:
    """Ask for the motions of all rows from first to last, which are whole trees, or of none."""
    for i in range(first, last):
        work.wanted[i] = 1 if wanted else 0


@kernel
def want_parents(table: JointTable, work: AnswerWork, first: int, last: int) -> None:
    """Ask for what the rows hang on whose motions are asked for."""
    for i in range(last - 1, first - 1, -1):
        if work.wanted[i] == 1 and table.parent[i] != NONE:
            work.wanted[table.parent[i]] = 1


@inlined
def push(work: JointWork, lane: int, r: int, f: Vector, n: Vector) -> None:
    """Add an impulse f [N s] with the moment n [N m s] about the centre of mass of row r."""
    about = add(n, cross(row(work.com, r), f))
    for k in range(3):
        work.answers.F[LANES * (6 * r + k) + lane] += f[k]
        work.answers.F[LANES * (6 * r + 3 + k) + lane] += about[k]


@kernel
def answer(table: JointTable, work: JointWork, first: int, last: int) -> None:
    """
    Write the motions V and the rates of the rows that are wanted, of those from first to last.

    These are whole trees; nothing acts on the others.
    """
    own = work.answers
    for back in range(last - first):
        i = last - 1 - back
        if own.wanted[i] == 0:
            continue
        h = _load_six(own.F, i)
        for n in range(table.first_axis[i + 1] - table.first_axis[i]):
            k = table.first_axis[i + 1] - 1 - n
            if work.locked[k] == LOCKED:
                continue
            t = (load(own.tau, k) + axis_part(table, work, k, h)) * work.inv_D[k]
            store(own.rate, k, t)
            h = minus(h, t, six(work.U, k))
        if table.parent[i] != NONE:
            F, on_parent = force_about(h, row(work.arm, i)), _load_six(own.F, table.parent[i])
            _store_six(own.F, table.parent[i], minus(on_parent, -1.0, F))
    zero = spread(0.0)
    for i in range(first, last):
        if own.wanted[i] == 0:
            continue
        parent = table.parent[i]
        V = (zero, zero, zero, zero, zero, zero)
        if parent != NONE:
            V = motion_at(_load_six(own.V, parent), row(work.arm, i))
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            rate = zero
            if work.locked[k] != LOCKED:
                rate = load(own.rate, k) - work.inv_D[k] * product(six(work.U, k), V)
                V = minus(V, -rate, along(table, work, k))
            store(own.rate, k, rate)
        _store_six(own.V, i, V)


@inlined
def motion_in(work: AnswerWork, lane: int, r: int) -> Six:
    """Return the motion of row r in a lane."""
    at = 6 * LANES * r + lane
    return (work.V[at], work.V[at + LANES], work.V[at + 2 * LANES], work.V[at + 3 * LANES],
            work.V[at + 4 * LANES], work.V[at + 5 * LANES])


@kernel
def take_answer(table: JointTable, work: JointWork, lane: int, first: int, last: int) -> None:
    """Write the motions and rates of a lane to where `articulated.solve` writes them."""
    for r in range(first, last):
        set_six(work.V, r, motion_in(work.answers, lane, r))
        for k in range(table.first_axis[r], table.first_axis[r + 1]):
            work.rate[k] = work.answers.rate[LANES * k + lane]
