# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Overlaps of small islands are pushed apart all at once: no push depends on the order of contacts.

The velocities u of the push, which displace and are forgotten, are the smallest ones (in kinetic
energy) with which all overlaps shrink as fast as wanted:

    min u' M u / 2,   G u >= push - max(v_n, 0),

v_n the speed at which a point parts by itself. That is an impact with impulses along the normal
alone, and solved like one; see direct_solve.py.
"""

from rigid_sim_ros.engine.constraints.contact_blocks import (
    POINT, POINT_ROWS, S, SHOVE, SHOVE_TURN, T)
from rigid_sim_ros.engine.constraints.contact_rules import overlap_of, Sweep
from rigid_sim_ros.engine.solver.coloring import (
    are_balls, Blocks, is_small, numbers_of, OVERLAPPING, points_in)
from rigid_sim_ros.engine.solver.direct_islands import Islands
from rigid_sim_ros.engine.solver.direct_newton import Direct
from rigid_sim_ros.engine.solver.direct_rows import DirectRows, read_island, SLIDE, WIDTH
from rigid_sim_ros.engine.solver.direct_solve import solve_rows
from rigid_sim_ros.engine.solver.solver_bodies import SolverBodies
from rigid_sim_ros.kernels.eight import bits_of, LANES, store
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def push_islands(blocks: Blocks, bodies: SolverBodies, what: Sweep, rate: float,
                 work: Direct) -> None:
    """
    Find the impulses that push the overlaps of small islands apart, as SHOVE and SHOVE_TURN.

    `rate` [1/s] is the part of an overlap that goes per second.
    """
    islands, rows = work.islands, work.rows
    for island in range(islands.count[0] if _is_any_pushed(blocks, islands) else 0):
        lanes = islands.lane[islands.begin[island]:islands.begin[island + 1]]
        overlaps = False
        for lane in lanes:
            overlaps |= _overlaps(blocks, lane)
            _store_push(blocks, lane, 0.0, 0.0, 0.0)
        if overlaps:
            count, moving = read_island(blocks, bodies, lanes, what, rows)
            for c in range(count):
                _demand_push(blocks, lanes[c], c, rate, rows)
            solve_rows(count, moving, what.inv_h, False, work)
            for c in range(count):
                _store_sum(blocks, lanes[c], c, rows)


@kernel
def _is_any_pushed(blocks: Blocks, islands: Islands) -> bool:
    """Return whether any block with contacts of small islands will be pushed apart."""
    for k in range(islands.blocks[0]):
        if blocks.left[islands.block[k]] & OVERLAPPING != 0:
            return True
    return False


@kernel
def _overlaps(blocks: Blocks, lane: int) -> bool:
    """Return whether any point of a lane has an overlap to be pushed apart."""
    block, overlapping = lane // LANES, 0
    for p in range(4 if points_in(blocks.kind[block]) > 1 else 1):
        overlap = overlap_of(numbers_of(blocks, block), POINT + p * POINT_ROWS)
        overlapping |= bits_of(overlap > 0.0)
    return overlapping & ~blocks.dormant[block] & 1 << lane % LANES != 0


@kernel
def _demand_push(blocks: Blocks, lane: int, c: int, rate: float, rows: DirectRows) -> None:
    """Let the rows of manifold c demand that the overlaps of a lane go, and nothing else."""
    b, points = numbers_of(blocks, lane // LANES), points_in(blocks.kind[lane // LANES])
    for r in range(WIDTH):
        overlap = rows.f[c, r] = rows.start[c, r] = 0.0
        if r < (4 if points > 1 else 1):
            store(rows.scratch, 0, overlap_of(b, POINT + r * POINT_ROWS))
            overlap = rows.scratch[lane % LANES]
        if overlap > 0.0:
            parts = rows.rate[c, r] - rows.least[c, r]
            rows.least[c, r] = 0.0
            rows.rate[c, r] = max(parts, 0.0) - rate * overlap
        else:
            rows.there[c, r] = 0


@kernel
def _store_sum(blocks: Blocks, lane: int, c: int, rows: DirectRows) -> None:
    """Store the sum of the impulses of manifold c as the push of a lane."""
    b, i, f = numbers_of(blocks, lane // LANES), lane % LANES, rows.f
    if points_in(blocks.kind[lane // LANES]) == 1:
        _store_push(blocks, lane, f[c, 0], 0.0, 0.0)
        return
    along = about_1 = about_2 = 0.0
    for p in range(SLIDE):
        if rows.there[c, p] != 0:
            point = POINT + p * POINT_ROWS
            along += f[c, p]
            about_1 += b[(point + T) * LANES + i] * f[c, p]
            about_2 -= b[(point + S) * LANES + i] * f[c, p]
    _store_push(blocks, lane, along, about_1, about_2)


@kernel
def _store_push(blocks: Blocks, lane: int, along: float, about_1: float, about_2: float) -> None:
    block, i = lane // LANES, lane % LANES
    b, kind = numbers_of(blocks, block), blocks.kind[block]
    b[SHOVE * LANES + i] = along
    if not (are_balls(kind) or is_small(kind)):
        b[SHOVE_TURN * LANES + i], b[(SHOVE_TURN + 1) * LANES + i] = about_1, about_2
