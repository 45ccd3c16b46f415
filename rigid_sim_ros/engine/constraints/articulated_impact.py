# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Impacts of bodies that joints hold, in no time.

All points of one pair of bodies are solved together; pairs are solved one after the other, the one
that approaches fastest first, until nothing approaches, as without joints (contact/impulse.py).
The joints answer to each (articulated_rows.py), with axes locked that are driven
against their limits.
"""

from rigid_sim_ros.engine.constraints.articulated_axes import any_left_piece, keep_pieces
from rigid_sim_ros.engine.constraints.articulated_buffers import ContactBuffers
from rigid_sim_ros.engine.constraints.articulated_contact import (
    MOST_PIECES, read_velocities, rebound)
from rigid_sim_ros.engine.constraints.articulated_points import rate_of_gap
from rigid_sim_ros.engine.constraints.articulated_rows import (
    read_row_rates, take_off, write_system)
from rigid_sim_ros.engine.contact.classify import classify, COLLIDING, resting_speed
from rigid_sim_ros.engine.contact.contacts import push_rows
from rigid_sim_ros.engine.joints.articulated import write_momenta
from rigid_sim_ros.engine.joints.buffers import JointMotion, JointWork
from rigid_sim_ros.engine.joints.settle import find_motions_after_impact, prepare_step
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Collisions of pairs, for each pair, after which all points stop at once.
MOST_COLLISIONS = 20
# Times at most that impulses are halved which give energy.
MOST_HALVINGS = 12
# Of the work of impulses each way: more energy than this is none of rounding.
ROUNDING = 1e-9


@kernel
def collide(model: Model, state: State, table: JointTable, motion: JointMotion, work: JointWork,
            h: float, elastic: bool, w: ContactBuffers) -> int:
    """
    Give the bodies impulses until no touching point approaches faster than it may at rest.

    The points have been chosen and the bodies read; `prepare_step` is of the present poses. h [s]
    is the step, and the impulses are those of `w.impulse` afterwards. Returns the number of
    collisions; with none nothing is changed.
    """
    for k in w.chosen[:w.counts.points[0]]:
        w.impulse[k, :] = 0.0
    most = MOST_COLLISIONS * w.contacts.count[1]
    for count in range(most + 1):
        m = _fastest_pair(h, w)
        if m == 0:
            if count > 0:
                _end(model, state, table, motion, work)
            return count
        if count == 0:
            find_motions_after_impact(model, table, state, motion, work)
        if count < most:
            _collide(model, state, table, motion, work, w.pair[:m], h, elastic, w)
        else:
            for n in range(w.counts.islands[0]):
                _collide(model, state, table, motion, work,
                         w.chosen[w.first[n]:w.first[n + 1]], h, False, w)
    _end(model, state, table, motion, work)
    return most


@kernel
def _end(model: Model, state: State, table: JointTable, motion: JointMotion,
         work: JointWork) -> None:
    """Give the bodies the momenta of the motions that were found."""
    write_momenta(model, table, state, work)
    for k in range(work.rate.shape[0]):
        motion.rate[k] = work.rate[k]
    prepare_step(model, table, state, work)


@kernel
def _fastest_pair(h: float, w: ContactBuffers) -> int:
    """Write the touching points of the pair that approaches fastest; return how many, 0: none."""
    contacts, block, fastest = w.contacts, -1, 0.0
    for n in range(contacts.count[1]):
        for k in range(contacts.first[n], contacts.first[n + 1]):
            if w.active[k] == 1:
                u, slow = rate_of_gap(w, k), resting_speed(contacts, w.bodies, k, h)
                if u < fastest and classify(u, slow) == COLLIDING:
                    block, fastest = n, u
    m = 0
    if block >= 0:
        for k in range(contacts.first[block], contacts.first[block + 1]):
            if w.active[k] == 1:
                w.pair[m] = k
                m += 1
    return m


@kernel
def _collide(model: Model, state: State, table: JointTable, motion: JointMotion, work: JointWork,
             chosen: IntArray, h: float, elastic: bool, w: ContactBuffers) -> None:
    """
    Give the bodies the impulses of the points of one pair, or of an island.

    They are found again where they put an axis on another piece, off its limit or against it.
    """
    contacts, rows, width, m = w.contacts, w.system.rows, w.counts.width[0], chosen.shape[0]
    r = width * m
    for c in range(m):
        k = chosen[c]
        back = -contacts.restitution[k] * min(rate_of_gap(w, k), 0.0)
        bounces = elastic and back > resting_speed(contacts, w.bodies, k, h)
        w.bounce[k] = back if bounces else 0.0
        for i in range(width):
            rows.f[width * c + i] = 0.0
    for n in range(MOST_PIECES):
        keep_pieces(work, w.system.axes)
        write_system(model, table, work, contacts, w.bodies, chosen, width, w.system)
        read_row_rates(rows, m, width, w.bodies.velocity, rows.b)
        for i in range(r):
            if n == 0:
                w.before[i] = rows.b[i]
            w.row[i], w.free[i] = rows.f[i], rows.b[i]
        take_off(rows, m, width, rows.f, w.free)
        rebound(chosen, width, n == 0, 0.0, w)
        for i in range(r):
            w.row[i] = rows.f[i] - w.row[i]
        _push(model, state, table, motion, work, chosen, w)
        if table.lawful == 0 or not any_left_piece(work, w.system.axes):
            break
    _take_no_energy(model, state, table, motion, work, chosen, w)
    for c in range(m):
        for i in range(width):
            w.impulse[chosen[c], i] += rows.f[width * c + i]


@kernel
def _push(model: Model, state: State, table: JointTable, motion: JointMotion, work: JointWork,
          chosen: IntArray, w: ContactBuffers) -> None:
    """Give the bodies the impulses w.row, and read how they move then."""
    width = w.counts.width[0]
    for c in range(chosen.shape[0]):
        push_rows(model, state, w.contacts, chosen[c], width, w.row, width * c)
    find_motions_after_impact(model, table, state, motion, work)
    read_velocities(model, state, table, work, w)


@kernel
def _take_no_energy(model: Model, state: State, table: JointTable, motion: JointMotion,
                    work: JointWork, chosen: IntArray, w: ContactBuffers) -> None:
    """Halve impulses that give energy, as those may for which no pieces were found."""
    rows, width, m = w.system.rows, w.counts.width[0], chosen.shape[0]
    for _ in range(MOST_HALVINGS):
        read_row_rates(rows, m, width, w.bodies.velocity, rows.b)
        given, moved = 0.0, 0.0
        for i in range(width * m):
            given += 0.5 * rows.f[i] * (w.before[i] + rows.b[i])
            moved += abs(rows.f[i]) * (abs(w.before[i]) + abs(rows.b[i]))
        if given <= ROUNDING * moved:
            return
        for i in range(width * m):
            rows.f[i] *= 0.5
            w.row[i] = -rows.f[i]
        _push(model, state, table, motion, work, chosen, w)
