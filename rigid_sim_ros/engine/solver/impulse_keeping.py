# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The way of impulses from the blocks of the sequential solver back to the manifolds."""

from rigid_sim_ros.engine.constraints.contact_blocks import (
    ARM_A, ARM_B, axes, combine, FRICTION, gain_of, IMPULSE, LEVER_A, LEVER_B, load_three,
    load_two, NORMAL, normal_sum, POINT, POINT_ROWS, ROLL, SHOVE, SPIN, Three, TORSION, TOTAL,
    total_of)
from rigid_sim_ros.engine.constraints.contact_prediction import Prediction
from rigid_sim_ros.engine.detection.manifolds import Manifolds, POINTS, StepImpulses
from rigid_sim_ros.engine.maths.vector import add, scale, subtract
from rigid_sim_ros.engine.solver.coloring import (
    are_balls, Blocks, CACHED, Coloring, fetch_block, first_block, lanes_of, numbers_of, PIECE,
    points_in, resists, SHOVED)
from rigid_sim_ros.engine.solver.pair_momentum import without_gain
from rigid_sim_ros.engine.solver.solver_bodies import INV_M, SolverBodies, TOUCHED
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.bits import fetch
from rigid_sim_ros.kernels.eight import (
    any_of, both, Eight, gather, gather_integers, gather_rows_1, gather_rows_3, LANES, lanes_in,
    load, Mask, scatter, scatter_rows_1, scatter_rows_3, select, spread, store)
from rigid_sim_ros.kernels.kernel import INDEX, kernel, part


@part
def store_impulses(region: int, blocks: Blocks, coloring: Coloring, manifolds: Manifolds,
                   prediction: Prediction, bodies: SolverBodies, h: float, substeps: int,
                   adds: bool, all_acted: StepImpulses) -> float:
    """
    Keep the impulses of a region, and give pairs back what L their motion cost.

    Returns the residual [m/s], the largest change of a contact's velocity in the last visit.

    The manifolds get those of the last substep, as if it had lasted for the whole step: the next
    step begins with them. A mean over the substeps would lag behind, and a lag feeds the sway of a
    stack. What acted in all of them is written to `all_acted`, or added where it `adds` to what
    collisions did.
    """
    residual, first = 0.0, first_block(blocks, region)
    for block in range(first, first + blocks.count[region]):
        lanes = lanes_of(block)
        b, rows = numbers_of(blocks, block), blocks.row[lanes]
        if blocks.count[region] > CACHED:
            fetch_block(blocks, block + 1)
        # Of the next piece, in order: colour by colour nobody sees them coming.
        ahead = PIECE + (block - first) * LANES
        if ahead < coloring.members[region]:
            r = coloring.member[region, ahead] & INDEX
            _fetch_kept(r, manifolds.impulse, manifolds.friction)
            _fetch_kept(r, all_acted.normal, all_acted.friction)
        residual = max(residual, blocks.residual[block])
        n, t1, t2 = axes(b)
        zero = spread(0.0)
        points = points_in(blocks.kind[block])
        acted, last = total_of(b, points, 0.0), load_two(b, FRICTION)
        F = combine(n, t1, t2, (zero, substeps * last[0], substeps * last[1]))
        scatter_rows_3(manifolds.friction, rows, 3, 0, F)
        if not are_balls(blocks.kind[block]):
            _keep_spin(rows, substeps * load(b, SPIN), manifolds.spin)
        if resists(blocks.kind[block]):
            roll_1, roll_2 = substeps * load(b, ROLL), substeps * load(b, ROLL + 1)
            scatter_rows_3(manifolds.roll, rows, 3, 0, combine(n, t1, t2, (zero, roll_1, roll_2)))
        F = combine(n, t1, t2, (zero, acted[1], acted[2]))
        if adds:
            F = add(gather_rows_3(all_acted.friction, rows, 3, 0), F)
        scatter_rows_3(all_acted.friction, rows, 3, 0, F)
        _keep_normals(b, rows, points, manifolds.impulse, all_acted.normal, substeps, adds)
        at_A, at_B = blocks.at_A[lanes], blocks.at_B[lanes]
        if _mark_touched(b, points, acted, bodies, at_A, at_B, blocks.left[block] & SHOVED != 0):
            _give_back(b, acted, rows, prediction, bodies, at_A, at_B, h,
                       lanes_in(blocks.held[block]), are_balls(blocks.kind[block]))
    return residual


@kernel
def _fetch_kept(r: int, impulse: Array, friction: Array) -> None:
    """Ask for the impulses of eight manifolds, from r on, to be written soon."""
    fetch(impulse, r)
    for k in range(0, 3 * LANES, LANES):
        fetch(friction, 3 * r + k)


@part
def _keep_spin(rows: IntArray, spin: Eight, kept: Array) -> None:
    """Keep the impulse about the normal; where it is 0, as it was, the memory stays untouched."""
    (before,) = gather_rows_1(kept, rows, 1, 0)
    if any_of(abs(before) + abs(spin) > 0.0):
        # Never -0.0: what is kept must not depend on whether another lane has an impulse.
        scatter_rows_1(kept, rows, 1, 0, (spin + 0.0,))


@part
def _keep_normals(b: Array, rows: IntArray, points: int, impulse: Array, acted: Array,
                  substeps: int, adds: bool) -> None:
    """Keep the normal impulses."""
    for p in range(POINTS if points > 1 else 1):
        point, first = POINT + p * POINT_ROWS, p * impulse.shape[1]
        total = load(b, point + TOTAL)
        if adds:
            (before,) = gather_rows_1(acted, rows, 1, first)
            total = before + total
        scatter_rows_1(acted, rows, 1, first, (total,))
        scatter_rows_1(impulse, rows, 1, first, (substeps * load(b, point + IMPULSE),))


@part
def _give_back(b: Array, acted: Three, rows: IntArray, prediction: Prediction,
               bodies: SolverBodies, at_A: IntArray, at_B: IntArray, h: float, held: Mask,
               balls: bool) -> None:
    """
    Take the L that a pair gained from its bodies, see pair_momentum.py.

    But not where the pair is held: the L of that is nothing that stays, and what a light body
    under a heavy one gets turns it out of the load.
    """
    A, B = gather(bodies.total, at_A), gather(bodies.total, at_B)
    # From where the manifold was found, which is where its levers are those of one point.
    before = gather_rows_3(prediction.moved, rows, 3, 0)
    given = gather_integers(prediction.given, rows)
    moved = (select(given > 0.0, before[0], 0.0), select(given > 0.0, before[1], 0.0),
             select(given > 0.0, before[2], 0.0))
    moved = (h * (B[0] - A[0]) - moved[0], h * (B[1] - A[1]) - moved[1],
             h * (B[2] - A[2]) - moved[2])
    gained, apart = gain_of(b, acted, moved), add(moved, _between_centres(b, balls))
    A, B = gather(bodies.motion, at_A), gather(bodies.motion, at_B)
    # Of what is fixed or moves by its twist the inverse mass is 0: then neither gives anything.
    gives = both(both(A[INV_M] > 0.0, B[INV_M] > 0.0), select(held, 0.0, 1.0) > 0.0)
    inv_I_A, inv_I_B = gather(bodies.mass, at_A), gather(bodies.mass, at_B)
    A, B = without_gain(A, B, inv_I_A[:6], inv_I_B[:6], apart, gained, gives)
    scatter(bodies.motion, at_A, A)
    scatter(bodies.motion, at_B, B)


@part
def _between_centres(b: Array, balls: bool) -> Three:
    """Return x_B - x_A where a manifold was found [m]."""
    if balls:
        return scale(load(b, LEVER_A) - load(b, LEVER_B), load_three(b, NORMAL))
    return subtract(load_three(b, ARM_A), load_three(b, ARM_B))


@part
def _mark_touched(b: Array, points: int, acted: Three, bodies: SolverBodies, at_A: IntArray,
                  at_B: IntArray, shoved: bool) -> bool:
    """
    Mark the bodies of the lanes in which anything acted; return whether there are any.

    What was shoved in an earlier substep alone has gained angular momentum, too.
    """
    gained = load_three(b, TORSION)
    acts = abs(acted[0]) + abs(acted[1]) + abs(acted[2]) + normal_sum(b, points)
    acts = acts + (abs(gained[0]) + abs(gained[1]) + abs(gained[2]))
    if shoved:
        acts = acts + load(b, SHOVE)
    if not any_of(acts > 0.0):
        return False
    # Nobody asks for the friction any more. Without a branch: whether a pair presses the processor
    # could only guess.
    store(b, FRICTION, select(acts > 0.0, 1.0, 0.0))
    for i in range(LANES):
        acts_here = b[FRICTION * LANES + i]
        for at in (at_A[i] & INDEX, at_B[i] & INDEX):
            bodies.drifted[at + TOUCHED] = max(bodies.drifted[at + TOUCHED], acts_here)
    return True
