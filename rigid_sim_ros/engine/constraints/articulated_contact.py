# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The impulses at the points of contact in half a step of bodies that joints hold.

A step is kick, drift, kick. In the first half the impulses let no gap become negative by the drift
and stop what would slip in it; in the second half they stop the rates at the new poses, or send
points back that bounce. So what rests has no velocity at the end of a step, and moves nowhere in
it. The points of an island are solved for together (articulated_rows.py). What acts along the axes
of joints is piecewise straight (laws.py): where impulses put an axis on another piece, they are
found again together with what acts along it (articulated_axes.py).
"""

from rigid_sim_ros.engine.constraints.articulated_axes import (
    begin_with, free_rows, keep_pieces, let_yield, take_rows)
from rigid_sim_ros.engine.constraints.articulated_buffers import ContactBuffers
from rigid_sim_ros.engine.constraints.articulated_points import rate_of_gap, REBOUNDS
from rigid_sim_ros.engine.constraints.articulated_rows import (
    answer_to_impulses, moves, push_apart, read_row_rates, solve_system, take_off, write_system,
    write_velocities)
from rigid_sim_ros.engine.constraints.contact_rules import NEGLIGIBLE
from rigid_sim_ros.engine.constraints.foreseen_rates import note_foreseen
from rigid_sim_ros.engine.contact.carried_forces import keep_force, recall_forces
from rigid_sim_ros.engine.contact.classify import resting_speed
from rigid_sim_ros.engine.contact.contact_rows import all_rows, effect, rate, write_effects
from rigid_sim_ros.engine.contact.contacts import (
    add_contact_load, Contacts, push_rows, read_touched, read_velocity, relative, to_contact,
    to_world)
from rigid_sim_ros.engine.dynamics.force_and_torque import kick, Loads
from rigid_sim_ros.engine.joints.buffers import FORESEEN, JointMotion, JointWork, SOLVED
from rigid_sim_ros.engine.joints.settle import find_motions, find_motions_of_pieces, find_pieces
from rigid_sim_ros.engine.joints.shake import foresee
from rigid_sim_ros.engine.maths.rotation import quaternion
from rigid_sim_ros.engine.maths.union_find import first_of
from rigid_sim_ros.engine.maths.vector import add_scaled, column, cross, norm, scale
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.rates import spin_of
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Times at most that impulses are found for the axes that have left their pieces. In each, one at
# least becomes a row, and most do in the first two.
MOST_PIECES = 6
# Of the rates without impulses: less than this does not put an axis on another piece.
STEADY = 1e-9
# What `_solve_island` found.
SAME, OTHERS, YIELD = range(3)
# Of the size of a shape, in a step: a point that comes nearer by less does not, but for rounding.
CREEP = 1e-9
# Impulses that would move a body by so many sizes in a step are of bodies that are wedged in. They
# are not carried over, as rounding alone would make them grow.
FASTEST = 1e3
# In a step, overlaps are displaced by this part of themselves, at most by this part of the size.
PUSH, MOST_PUSH = 0.2, 0.003
# [rad] No body turns farther in a step by being displaced.
MOST_TURN = 0.02
# Shares of bounces that are tried so that these give no energy.
CHORDS = 4


@kernel
def solve_contacts(model: Model, state: State, table: JointTable, motion: JointMotion,
                   work: JointWork, loads: Loads, h: float, first: bool,
                   w: ContactBuffers) -> None:
    """
    Give the bodies the impulses of the chosen points in one half of a step of h [s].

    The momenta are those after the kick of that half, by the loads; joints have not answered yet.
    In the first half momenta that only displace are added, which `undo_displacing` takes.
    """
    if first:
        w.displacing.F[:], w.displacing.tau[:] = 0.0, 0.0
    if w.counts.points[0] == 0:
        return
    if first:
        foresee(table, motion, work)
    read_touched(model, state, loads.F, loads.tau, w.contacts, w.bodies)
    if first:
        _note_approach(h, w)
    if not first or work.known[FORESEEN] == 0:
        _begin_with(model, w.chosen[:w.counts.points[0]], w.counts.width[0], first, w)
    for k in w.chosen[:w.counts.points[0]]:
        push_rows(model, state, w.contacts, k, w.counts.width[0], w.impulse[k], 0)
    axes = w.system.axes
    axes.is_row[:] = 0
    found, freed, ahead = SAME, False, h if first else 0.0
    work.known[SOLVED] = 0
    for n in range(MOST_PIECES):
        if n == 0 or freed:
            find_motions(model, table, state, motion, work, h, first)
        else:   # what acts along the axes is the same, and most stay on their pieces
            find_pieces(model, table, state, work, ahead)
        read_velocities(model, state, table, work, w)
        if n > 0 and not take_rows(work, axes) and found != YIELD:
            work.known[SOLVED] = 1
            break
        keep_pieces(work, axes)
        freed = free_rows(table, work, axes)
        if freed:
            find_motions_of_pieces(model, table, state, work, ahead)
            read_velocities(model, state, table, work, w)
        found = SAME
        for island in range(w.counts.islands[0]):
            chosen = w.chosen[w.first[island]:w.first[island + 1]]
            found = max(found, _solve_island(model, state, table, work, chosen, h, first, w))
        if table.lawful == 0 or found == SAME:
            break
    axes.is_row[:] = 0
    if first:
        _add_displacing(model, state, table, work, w)


@kernel
def _note_approach(h: float, w: ContactBuffers) -> None:
    """Note the rates of the gaps before the kick of half a step of h [s]."""
    for k in w.chosen[:w.counts.points[0]]:
        gained = relative(w.bodies.acceleration, w.contacts, k)
        w.approach[k] = rate_of_gap(w, k) - 0.5 * h * to_contact(w.contacts, k, gained)[0]


@kernel
def read_velocities(model: Model, state: State, table: JointTable, work: JointWork,
                    w: ContactBuffers) -> None:
    """Write the velocities of all bodies, of those that joints hold the motions found last."""
    for i in range(model.m.shape[0]):
        if table.row_of_body[i] == NONE:
            read_velocity(model, state, i, w.bodies)
    write_velocities(table, work, 0, table.body.shape[0], w.bodies.velocity)


@kernel
def _begin_with(model: Model, chosen: IntArray, width: int, first: bool,
                w: ContactBuffers) -> None:
    """Begin with the impulses that were found in the step before, or in its other half."""
    recall_forces(model, w.contacts, chosen, width, w.carried if first else w.half, w.match, w.row)
    for c in range(chosen.shape[0]):
        k = chosen[c]
        is_sane = (abs(w.row[width * c]) * max(
            model.inv_m[w.contacts.body_a[k]], model.inv_m[w.contacts.body_b[k]])
            <= FASTEST * w.contacts.size[k] / model.h)
        for i in range(width):
            w.impulse[k, i] = w.row[width * c + i] if is_sane else 0.0
            w.pushed[k, i] = 0.0
        w.bounce[k] = 0.0 if first or w.match[k] < 0 else w.half_bounce[w.match[k]]


@kernel
def _solve_island(model: Model, state: State, table: JointTable, work: JointWork,
                  chosen: IntArray, h: float, first: bool, w: ContactBuffers) -> int:
    """
    Find the impulses of an island for the present pieces, and give them to the bodies.

    Returns whether they are the SAME as before, or OTHERS, or axes have to YIELD first.
    """
    contacts, system, width, m = w.contacts, w.system, w.counts.width[0], chosen.shape[0]
    rows = system.rows
    write_system(model, table, work, contacts, w.bodies, chosen, width, system)
    read_row_rates(rows, m, width, w.bodies.velocity, rows.b)
    if table.lawful > 0 and _must_yield(table, work, chosen, h, first, w):
        return YIELD
    for c in range(m):
        for i in range(width):
            rows.f[width * c + i] = w.impulse[chosen[c], i]
    take_off(rows, m, width, rows.f, rows.b)
    begin_with(system.axes, width * m, rows)
    known, changed, size = False, 0.0, 0.0
    for i in range(all_rows(rows, m, width)):
        known = known or rows.f[i] != 0.0
        w.free[i] = rows.b[i]
        size = max(size, abs(rows.b[i]))
    if first:
        _aim(contacts, chosen, width, h, w)
        if solve_system(system, m, width, not known) > 0.0:
            _take_no_energy(chosen, width, w)
        _note_work(chosen, width, w)
        note_foreseen(chosen, width, size, w)
    else:
        lost = 0.0
        for k in chosen:
            if w.match[k] >= 0:
                lost += w.half_work[w.match[k]]
        rebound(chosen, width, not known, lost, w)
    for c in range(m):
        k = chosen[c]
        for i in range(width):
            now = rows.f[width * c + i]
            w.row[i], w.impulse[k, i] = now - w.impulse[k, i], now
            changed = max(changed, abs(w.row[i]) * rows.stiff[width * c + i])
        push_rows(model, state, contacts, k, width, w.row, 0)
    if first:
        _displace(contacts, chosen, width, model.h, w)
    return OTHERS if changed > STEADY * size else SAME


@kernel
def _must_yield(table: JointTable, work: JointWork, chosen: IntArray, h: float, first: bool,
                w: ContactBuffers) -> bool:
    """
    Let axes yield that drive a point of an island on, though nothing can move it as they are.

    Dry friction that sticks, and a drive at the bound of its speed, lock an axis: all others of
    a way locked as well, no impulse stops what the point runs into. In the first half of a step
    of h [s] gaps may close. The rows have been written. Returns whether any axis
    became a row, for which the impulses are to be found anew.
    """
    contacts, rows, width, found = w.contacts, w.system.rows, w.counts.width[0], False
    for c in range(chosen.shape[0]):
        k, gap = chosen[c], 0.0
        if first:
            gap = max(contacts.gap[k], 0.0)
        closes = gap + h * rate_of_gap(w, k) < -CREEP * contacts.size[k]
        if closes and not moves(rows, width * c):
            for n in range(w.system.pushed[0]):
                found = let_yield(table, work, w.system.axes, w.system.pushed[1 + n]) or found
    return found


@kernel
def _aim(contacts: Contacts, chosen: IntArray, width: int, h: float, w: ContactBuffers) -> None:
    """Add to the rates b what lets gaps close within the step; note which points are to bounce."""
    b = w.system.rows.b
    for c in range(chosen.shape[0]):
        k, n = chosen[c], width * c
        gap, rate = contacts.gap[k], b[n]
        # A light leg gets far more from its drive than from its weight.
        given = max(resting_speed(contacts, w.bodies, k, h), w.approach[k] - rate)
        w.bounce[k] = 0.0
        if rate < -REBOUNDS * given and gap + h * rate < 0.0:
            w.bounce[k] = -contacts.restitution[k] * rate
        b[n] += max(gap, 0.0) / h


@kernel
def _note_work(chosen: IntArray, width: int, w: ContactBuffers) -> float:
    """
    Write the work of the impulses at each point of an island; return that of all.

    It is f . (u_0 + u_1) / 2 with the rates u_0 without them and u_1 = u_0 + A f with them.
    """
    rows, total = w.system.rows, 0.0
    write_effects(rows, chosen.shape[0], width, rows.f)
    for c in range(chosen.shape[0]):
        w.work[chosen[c]] = 0.0
        for i in range(width * c, width * c + width):
            mean = w.free[i] + 0.5 * effect(rows, c, i, rows.f)
            w.work[chosen[c]] += mean * rows.f[i]
        total += w.work[chosen[c]]
    return total


@kernel
def rebound(chosen: IntArray, width: int, is_new: bool, lost: float, w: ContactBuffers) -> None:
    """
    Find the impulses of points that bounce, so that they give no energy but what was lost [J].

    Each point is to come apart with its share of the rate with which it came, which several
    impacts at once, with friction, may only do with more energy than there was (Stronge, Rigid
    body collisions with friction, Proc. R. Soc. A 431 (1990)). All these bounces are then
    smaller by one factor. The work is a convex function of that: the chord from a factor that
    takes energy to one that gives it meets 0 before it does.
    """
    any_bounce = False
    for k in chosen:
        any_bounce = any_bounce or w.bounce[k] > 0.0
    high = _solve_rebound(chosen, width, 1.0, is_new, w) + lost
    if high <= 0.0 or not any_bounce:
        return
    upper, lower = 1.0, 0.0
    low = _solve_rebound(chosen, width, 0.0, False, w) + lost
    for _ in range(CHORDS):
        if low >= 0.0:
            break
        share = lower - low * (upper - lower) / (high - low)
        now = _solve_rebound(chosen, width, share, False, w) + lost
        if now <= 0.0:
            lower, low = share, now
        else:
            upper, high = share, now
    _solve_rebound(chosen, width, lower, False, w)      # the latest one may be on the other side
    if low > 0.0:
        _take_no_energy(chosen, width, w)


@kernel
def _take_no_energy(chosen: IntArray, width: int, w: ContactBuffers) -> None:
    """
    Make impulses that are no solution smaller where they would give energy.

    Their work is s f . u_0 + s^2 f . A f / 2 when they are s times what they are. A solution takes
    f . A f / 2 at least. Bodies that are wedged in may find none.
    """
    rows, m, linear, gain = w.system.rows, chosen.shape[0], 0.0, 0.0
    write_effects(rows, m, width, rows.f)
    for c in range(m):
        for i in range(width * c, width * c + width):
            linear += rows.f[i] * w.free[i]
            gain += 0.5 * rows.f[i] * effect(rows, c, i, rows.f)
    if linear + gain > 0.0:
        share = max(-linear / gain, 0.0) if gain > 0.0 else 0.0
        for i in range(width * m):
            rows.f[i] *= share


@kernel
def _solve_rebound(chosen: IntArray, width: int, share: float, is_new: bool,
                   w: ContactBuffers) -> float:
    """Find the impulses with this share of all bounces; return their work."""
    rows, m = w.system.rows, chosen.shape[0]
    for i in range(all_rows(rows, m, width)):
        rows.b[i] = w.free[i]
    for c in range(m):
        rows.b[width * c] -= share * w.bounce[chosen[c]]
    solve_system(w.system, m, width, is_new)
    return _note_work(chosen, width, w)


@kernel
def _displace(contacts: Contacts, chosen: IntArray, width: int, h: float,
              w: ContactBuffers) -> None:
    """
    Write impulses that displace what overlaps, and does not come apart by itself.

    h [s] is the whole step, of which a way has its share: displaced as far within a thousandth of
    it, bodies would be as fast as nothing else is, and what limits of joints make of that stays.
    """
    rows, m, any_wanted = w.system.rows, chosen.shape[0], False
    write_effects(rows, m, width, rows.f)
    for c in range(m):
        for i in range(width * c, width * c + width):
            w.row[i] = rate(rows, c, i, rows.f)
    for c in range(m):
        depth, size = -contacts.gap[chosen[c]], contacts.size[chosen[c]]
        is_pushed = depth > NEGLIGIBLE * size and moves(rows, width * c)
        wanted = min(PUSH * depth, MOST_PUSH * size) / h if is_pushed else 0.0
        apart = max(w.row[width * c], 0.0)
        any_wanted = any_wanted or wanted > apart
        for i in range(width):
            rows.b[width * c + i] = 0.0
        rows.b[width * c] = apart - wanted
    if any_wanted:
        push_apart(w.system, m, width, w.row)
    for c in range(m):
        for i in range(width):
            w.pushed[chosen[c], i] = w.row[width * c + i] if any_wanted else 0.0


@kernel
def _add_displacing(model: Model, state: State, table: JointTable, work: JointWork,
                    w: ContactBuffers) -> None:
    """
    Add the momenta with which bodies move as the impulses that displace let them.

    They are those of the answer of the joints, and less if a body would turn by too much.
    """
    loads, contacts, fastest, is_any = w.displacing, w.contacts, 0.0, False
    for k in w.chosen[:w.counts.points[0]]:
        if w.pushed[k, 0] > 0.0:
            is_any = True
            add_contact_load(model.inv_m, contacts, k, to_world(
                contacts, k, (w.pushed[k, 0], 0.0, 0.0)), (0.0, 0.0, 0.0), loads)
    if not is_any:
        return
    work.known[SOLVED] = 0
    for g in range(table.first_row.shape[0] - 1):
        answer_to_impulses(model, table, work, g, loads)
    for i in range(model.m.shape[0]):
        if model.inv_m[i] > 0.0:
            v = spin_of(quaternion(state.q, i), column(loads.tau, i), column(model.inv_I_C, i))
            fastest = max(fastest, norm(v))
    share = min(1.0, MOST_TURN / (model.h * fastest)) if fastest > 0.0 else 1.0
    for i in range(model.m.shape[0]):
        for k in range(3):
            loads.F[k, i] *= share
            loads.tau[k, i] *= share
    kick(state, loads, 1.0)


@kernel
def undo_displacing(model: Model, state: State, h: float, w: ContactBuffers) -> None:
    """
    Take back the momenta that displaced on a way of h [s].

    A displacement d of a body changes the angular momentum x x P by d x P. Of what nothing holds
    that is taken from its spin, so that the whole keeps its angular momentum: P less what a body
    has as all that it hangs together with flies on, V, or spins would depend on who looks at them.
    The sum is the same, as m d is 0 in sum.
    """
    kick(state, w.displacing, -1.0)
    flies = w.bodies.velocity    # scratch: of a set P in sum, and its mass
    _sum_momenta(model, state, w.parent, flies)
    for i in range(model.m.shape[0]):
        root = first_of(w.parent, i)
        if model.inv_m[i] > 0.0 and w.held[root] == 0:
            V = scale(1.0 / flies[root, 3], (flies[root, 0], flies[root, 1], flies[root, 2]))
            P = add_scaled(column(state.P, i), -model.m[i], V)
            gained = cross(column(w.displacing.F, i), P)
            for k in range(3):
                state.L[k, i] -= h * model.inv_m[i] * gained[k]


@kernel
def _sum_momenta(model: Model, state: State, parent: IntArray, total: Array) -> None:
    """Write P [kg m/s] and m [kg] in sum of each set of bodies to the row of its first, (n, 4)."""
    total[:, :4] = 0.0
    for i in range(model.m.shape[0]):
        root = first_of(parent, i)
        for k in range(3):
            total[root, k] += state.P[k, i]
        total[root, 3] += model.m[i]


@kernel
def keep_impulses(model: Model, first: bool, w: ContactBuffers) -> None:
    """Carry the impulses over to the other half of the step, or to the next step."""
    carried, kept = w.half if first else w.carried, w.counts.points[0]
    known = w.counts.half_known if first else w.counts.known
    for c in range(kept):
        k = w.chosen[c]
        keep_force(model, w.contacts, k, w.counts.width[0], w.impulse[k], carried, c)
        if first:
            w.half_bounce[c], w.half_work[c] = w.bounce[k], w.work[k]
    known[0] = kept
