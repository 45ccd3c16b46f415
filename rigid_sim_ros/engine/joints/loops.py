# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Joints that close loops, and joints that are coupled: conditions beside those of the tree.

Each is a row C of the motions V of an articulation. The tree is solved first, as if there were no
conditions; impulses l along the rows then correct the motions within the joints of the tree:

    S l = wanted - C V,    V += M~^-1 C^T l,    S = C M~^-1 C^T,

with M~^-1 C^T the response of the articulation to a unit row. Rows that say what others say
already, such as those out of the plane of a planar linkage, are found by their pivots and left
out. (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 8.)
"""

from rigid_sim_ros.engine.joints.answers import take_answer
from rigid_sim_ros.engine.joints.articulated import axis_part, solve, STIFFNESS
from rigid_sim_ros.engine.joints.buffers import JointMotion, JointWork, STIFF
from rigid_sim_ros.engine.joints.joint_coordinates import (
    axis_x, axis_z, joint_distance, joint_error, joint_position, joint_side)
from rigid_sim_ros.engine.maths.cholesky import CUT_OFF, factor_semidefinite, solve_semidefinite
from rigid_sim_ros.engine.maths.rotation import quaternion
from rigid_sim_ros.engine.maths.spatial import (
    add_six, force_about, minus, motion_at, product, set_six, Six, six)
from rigid_sim_ros.engine.maths.vector import add, column, cross, dot, row, scale, subtract
from rigid_sim_ros.engine.model.joints import (
    DISTANCE, JointTable, MIMIC, NONE, PLANAR, PRISMATIC, UNIVERSAL)
from rigid_sim_ros.engine.model.model import Model, WORLD
from rigid_sim_ros.engine.state.rates import angular_velocity
from rigid_sim_ros.engine.state.state import body_spin, body_velocity, State
from rigid_sim_ros.kernels.arrays import Vector
from rigid_sim_ros.kernels.kernel import inlined, kernel

_ZERO = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def _direction(table: JointTable, state: State, j: int, place: int) -> Six:
    """Return condition `place` of joint j as a row on the motion of B against A, world axes."""
    kind = table.kind[j]
    if kind == DISTANCE:
        _, n = joint_distance(table, state, j)
        return (n[0], n[1], n[2], 0.0, 0.0, 0.0)
    _, q_A = joint_side(state, table.body_a[j], table.p_A, table.q_A, j)
    _, q_B = joint_side(state, table.body_b[j], table.p_B, table.q_B, j)
    z, x = axis_z(q_A), axis_x(q_A)
    y = cross(z, x)
    moves = 3
    if kind == PRISMATIC:
        moves = 2
    elif kind == PLANAR:
        moves = 1
    n = (x, y, z)[(place if place < moves else place - moves)]
    if place < moves:
        n = z if kind == PLANAR else n
        return (n[0], n[1], n[2], 0.0, 0.0, 0.0)
    if kind == UNIVERSAL:
        n = cross(axis_x(q_B), z)
        n = scale(1.0 / dot(n, n), n)
    return (0.0, 0.0, 0.0, n[0], n[1], n[2])


@inlined
def _end(table: JointTable, work: JointWork, m: int, body: int, side: int) -> Vector:
    """Return from the reference point of a body to where condition m holds it, 0 of others."""
    r = table.row_of_body[body]
    p = row(work.loop.held_a, m) if side == 0 else row(work.loop.held_b, m)
    return subtract(p, row(work.p, r))


@kernel
def place_conditions(model: Model, table: JointTable, state: State, work: JointWork) -> None:
    """Write the rows of all conditions and where they hold, at the present poses."""
    for m in range(table.condition_joint.shape[0]):
        if table.condition_place[m] == MIMIC:
            continue
        j = table.condition_joint[m]
        set_six(work.loop.direction, m, _direction(table, state, j, table.condition_place[m]))
        p_A, _ = joint_side(state, table.body_a[j], table.p_A, table.q_A, j)
        p_B, _ = joint_side(state, table.body_b[j], table.p_B, table.q_B, j)
        for k in range(3):
            work.loop.held_b[m, k] = p_B[k]
            # A slides under B: both are held where B is, but at the two ends of a distance.
            work.loop.held_a[m, k] = p_A[k] if table.kind[j] == DISTANCE else p_B[k]
        work.loop.free[m] = 0.0
        for side in range(2):
            body = table.body_a[j] if side == 0 else table.body_b[j]
            if body != WORLD and model.inv_m[body] > 0.0:
                p = row(work.loop.held_a, m) if side == 0 else row(work.loop.held_b, m)
                work.loop.free[m] += _free_answer(model, state, body, p,
                                                  six(work.loop.direction, m))


@inlined
def _free_answer(model: Model, state: State, body: int, p: Vector, C: Six) -> float:
    """Return C M^-1 C^T of a free body that is held at p [m]: how a joint could let it move."""
    f = (C[0], C[1], C[2])
    n = add((C[3], C[4], C[5]), cross(subtract(p, column(state.x, body)), f))
    w = angular_velocity(quaternion(state.q, body), n, column(model.inv_I_C, body))
    return model.inv_m[body] * dot(f, f) + dot(n, w)


@inlined
def impulse_of(work: JointWork, m: int) -> Six:
    """Return all that condition m has done to B since its total was 0, where it holds it."""
    return minus(_ZERO, -work.loop.total[m], six(work.loop.direction, m))


@kernel
def _push(table: JointTable, work: JointWork, m: int, size: float) -> None:
    """Add the impulse of condition m of this size to F and tau."""
    if table.condition_place[m] == MIMIC:
        work.tau[table.coupled_axis[m, 0]] += size
        work.tau[table.coupled_axis[m, 1]] -= size * table.coupling[m, 0]
        return
    j = table.condition_joint[m]
    F = minus(_ZERO, -size, six(work.loop.direction, m))
    a, b = table.body_a[j], table.body_b[j]
    if b != WORLD and table.row_of_body[b] != NONE:
        add_six(work.F, table.row_of_body[b], force_about(F, _end(table, work, m, b, 1)))
    if a != WORLD and table.row_of_body[a] != NONE:
        add_six(work.F, table.row_of_body[a],
                minus(_ZERO, 1.0, force_about(F, _end(table, work, m, a, 0))))


@kernel
def _rate_of(table: JointTable, work: JointWork, m: int) -> float:
    """Return C V of condition m, for the motions V of the bodies that joints hold."""
    if table.condition_place[m] == MIMIC:
        return (work.rate[table.coupled_axis[m, 0]]
                - table.coupling[m, 0] * work.rate[table.coupled_axis[m, 1]])
    j = table.condition_joint[m]
    a, b = table.body_a[j], table.body_b[j]
    V = _ZERO
    if b != WORLD and table.row_of_body[b] != NONE:
        V = motion_at(six(work.V, table.row_of_body[b]), _end(table, work, m, b, 1))
    if a != WORLD and table.row_of_body[a] != NONE:
        V = minus(V, 1.0, motion_at(six(work.V, table.row_of_body[a]),
                                    _end(table, work, m, a, 0)))
    return product(six(work.loop.direction, m), V)


@kernel
def _base_rate(model: Model, table: JointTable, state: State, work: JointWork, m: int) -> float:
    """Return the part of C V that comes from kinematic bodies."""
    total = 0.0
    if table.condition_place[m] == MIMIC:
        return total
    j = table.condition_joint[m]
    for side in range(2):
        body = table.body_a[j] if side == 0 else table.body_b[j]
        if body != WORLD and table.row_of_body[body] == NONE:
            p = row(work.loop.held_a, m) if side == 0 else row(work.loop.held_b, m)
            w = body_spin(model, state, body)
            v = add(body_velocity(model, state, body),
                    cross(w, subtract(p, column(state.x, body))))
            its = product(six(work.loop.direction, m), (v[0], v[1], v[2], w[0], w[1], w[2]))
            total += its if side == 1 else -its
    return total


@kernel
def factor_conditions(table: JointTable, work: JointWork) -> None:
    """Write the responses to all conditions and the factors of S; `factor` has been called."""
    for g in range(table.first_row.shape[0] - 1):
        first, last = table.first_condition[g], table.first_condition[g + 1]
        if first == last:
            continue
        begin, end = table.first_row[g], table.first_row[g + 1]
        start, stop = table.first_axis[begin], table.first_axis[end]
        for m in range(first, last):
            if table.condition_place[m] == MIMIC:
                own, other = table.coupled_axis[m, 0], table.coupled_axis[m, 1]
                work.loop.free[m] = (_answer_of(work, own)
                                     + table.coupling[m, 0] ** 2 * _answer_of(work, other))
            ask_nothing(table, work, begin, end)
            _push(table, work, m, 1.0)
            solve(table, work, begin, end, False, False)
            for r in range(begin, end):
                set_six(work.loop.answer[m], r - begin, six(work.V, r))
            for k in range(start, stop):
                work.loop.answer_rate[m, k - start] = work.rate[k]
            for r in range(begin, end):
                for k in range(table.first_axis[r], table.first_axis[r + 1]):
                    work.loop.handed[m, k - start] = (
                        work.tau[k] + axis_part(table, work, k, six(work.F, r)))
            for n in range(first, last):
                work.loop.S[m, n - first] = _rate_of(table, work, n)
            if work.loop.S[m, m - first] <= CUT_OFF * work.loop.free[m]:
                work.loop.S[m, m - first] = 0.0     # the tree itself forbids this motion
        ask_nothing(table, work, begin, end)
        work.loop.rank[g] = factor_semidefinite(
            work.loop.S[first:last], last - first, work.loop.free[first:last],
            work.loop.scale[first:last], work.loop.order[first:last])


@inlined
def _answer_of(work: JointWork, k: int) -> float:
    """Return by how much the rate of axis k would change with an impulse of 1, without a lock."""
    return work.inv_D[k] * (STIFFNESS if work.locked[k] == STIFF else 1.0)


@kernel
def ask_nothing(table: JointTable, work: JointWork, begin: int, end: int) -> None:
    """Ask for nothing."""
    for r in range(begin, end):
        set_six(work.F, r, _ZERO)
        set_six(work.c, r, _ZERO)
        for k in range(table.first_axis[r], table.first_axis[r + 1]):
            work.tau[k], work.given[k] = 0.0, 0.0


@kernel
def close(model: Model, table: JointTable, state: State, work: JointWork, whole: bool) -> None:
    """
    Change the motions V, of the tree alone, so that C V is as wanted; note the impulses.

    `whole` says whether V are motions or changes of motions, on which kinematic bodies have no
    part. Of rows that depend on others, what is wanted becomes what the others make of it.
    """
    for g in range(table.first_row.shape[0] - 1):
        if table.first_condition[g + 1] > table.first_condition[g]:
            close_one(model, table, state, work, whole, g)


@kernel
def close_one(model: Model, table: JointTable, state: State, work: JointWork, whole: bool,
              g: int) -> None:
    """Do what `close` does for articulation g, which has conditions."""
    first, last = table.first_condition[g], table.first_condition[g + 1]
    for m in range(first, last):
        work.loop.missing[m] = work.loop.wanted[m] - _rate_of(table, work, m)
        if whole:
            work.loop.missing[m] -= _base_rate(model, table, state, work, m)
    _close_by_missing(table, work, g)
    for m in range(first, last):
        before = 0.0 if whole else work.loop.total[m]
        work.loop.total[m] = before + work.loop.impulse[m]
    for n in range(work.loop.rank[g], last - first):
        m = first + work.loop.order[first + n]
        work.loop.wanted[m] = _rate_of(table, work, m)
        if whole:
            work.loop.wanted[m] += _base_rate(model, table, state, work, m)


@kernel
def answer_within_loops(table: JointTable, work: JointWork, g: int) -> None:
    """Change the answer V of the tree of articulation g to that of its loops as well."""
    for m in range(table.first_condition[g], table.first_condition[g + 1]):
        work.loop.missing[m] = -_rate_of(table, work, m)
    if table.first_condition[g + 1] > table.first_condition[g]:
        _close_by_missing(table, work, g)


@kernel
def take_within_loops(table: JointTable, work: JointWork, lane: int, g: int) -> bool:
    """
    Return whether articulation g has loops or couplings.

    Then V and the rates become its answer in a lane, with these.
    """
    closes = table.first_condition[g + 1] > table.first_condition[g]
    if closes:
        take_answer(table, work, lane, table.first_row[g], table.first_row[g + 1])
        answer_within_loops(table, work, g)
    return bool(closes)


@kernel
def _close_by_missing(table: JointTable, work: JointWork, g: int) -> None:
    """Change V and the rates of articulation g by what is missing; write the impulses of this."""
    first, last = table.first_condition[g], table.first_condition[g + 1]
    solve_semidefinite(work.loop.S[first:last], work.loop.rank[g], last - first,
                       work.loop.scale[first:last], work.loop.order[first:last],
                       work.loop.missing[first:last], work.loop.impulse[first:last])
    begin, end = table.first_row[g], table.first_row[g + 1]
    start, stop = table.first_axis[begin], table.first_axis[end]
    for m in range(first, last):
        size = work.loop.impulse[m]
        for r in range(begin, end):
            add_six(work.V, r, minus(_ZERO, -size, six(work.loop.answer[m], r - begin)))
        for k in range(start, stop):
            work.rate[k] += size * work.loop.answer_rate[m, k - start]


@kernel
def measure_conditions(table: JointTable, state: State, motion: JointMotion, work: JointWork,
                       g: int) -> float:
    """Write how the conditions of articulation g are off; return the largest as an angle [rad]."""
    worst = 0.0
    for m in range(table.first_condition[g], table.first_condition[g + 1]):
        j = table.condition_joint[m]
        e = 0.0
        if table.condition_place[m] == MIMIC:
            e = _coupling_error(table, state, motion, m)
        elif table.kind[j] == DISTANCE:
            e = joint_distance(table, state, j)[0] - table.length[j]
        else:
            # The rows of the start of the step, not of its end: they are the same to first order.
            e = product(six(work.loop.direction, m), joint_error(table, state, j))
        work.loop.off[m] = e
        off = abs(e) / condition_unit(table, work, m, g)
        worst = worst if off <= worst else off
    return worst


@inlined
def condition_unit(table: JointTable, work: JointWork, m: int, g: int) -> float:
    """Return 1 [rad], or the length [m] of articulation g where condition m is kept in metres."""
    if table.condition_place[m] == MIMIC:
        return work.unit[table.coupled_axis[m, 0]]
    d = six(work.loop.direction, m)
    return work.length[g] if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] > 0.0 else 1.0


@kernel
def _coupling_error(table: JointTable, state: State, motion: JointMotion, m: int) -> float:
    """Return own position - multiplier * other position - offset, with all turns."""
    own = table.axis_joint[table.coupled_axis[m, 0]]
    other = table.axis_joint[table.coupled_axis[m, 1]]
    return (joint_position(table, state, own, motion.position[own])
            - table.coupling[m, 0] * joint_position(table, state, other, motion.position[other])
            - table.coupling[m, 1])
