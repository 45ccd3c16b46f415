# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Sweeps of small islands, which go on until an island is settled; see direct_islands.py.

What sweeps leave has a direction. Under a load that moves, as of a ball that rolls on a box, they
let the box tilt towards it a little in each substep, and the tilt drives the ball on: from
rounding it grew by e every 11 s at 1/60 s, to 1.5 mm/s in five minutes. So what nearly rests, and
is settled after a sweep or two, is swept on until what is left does not tilt anything in hours.
"""

from rigid_sim_ros.engine.constraints.contact_rules import settled, Sweep
from rigid_sim_ros.engine.solver.coloring import Blocks, points_in
from rigid_sim_ros.engine.solver.contact_sweep import visit_lanes
from rigid_sim_ros.engine.solver.direct_islands import Islands
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.eight import LANES
from rigid_sim_ros.kernels.kernel import INDEX, kernel

# What so many sweeps do not settle is solved directly.
SWEEPS = 40
# What so many sweeps settle is swept on, at most so often, until it is right to this part of the
# tolerance; with a hundredth of it changes would be rounding. What tumbles takes more sweeps than
# AT_ONCE and is not asked: heaps that fall would take a fifth more time.
AT_ONCE, FINER, FINER_SWEEPS = 2, 1e-6, 20


@kernel
def sweep_islands(blocks: Blocks, motion: Array, what: Sweep, islands: Islands) -> None:
    """
    Visit the contacts of small islands, forth and back by turns, until these are settled.

    But not those of uneven masses. islands.moved becomes 1 for those that are not settled.
    """
    # Until then it is the last sweep that changed anything, counted from 1.
    for island in range(islands.count[0]):
        islands.moved[island] = 0
    _begin(0, 0, blocks, islands)
    for turn in range(SWEEPS):
        _sweep(turn, blocks, motion, what, islands)
        if not _end_turn(turn, blocks, islands):
            break
    _begin(1, AT_ONCE, blocks, islands)
    for turn in range(SWEEPS, SWEEPS + FINER_SWEEPS):
        _sweep(turn, blocks, motion, what, islands)
        if not _end_turn(turn, blocks, islands):
            break
    for island in range(islands.count[0]):
        islands.moved[island] = 1 if islands.moved[island] == SWEEPS else 0


@kernel
def _begin(least: int, most: int, blocks: Blocks, islands: Islands) -> None:
    """Let all lanes be visited that are awake and of an even island with these last sweeps."""
    for k in range(islands.blocks[0]):
        block = islands.block[k] & INDEX
        bits = blocks.direct[block] & ~blocks.dormant[block]
        for i in range(LANES):
            if bits & 1 << i != 0:
                island = _island(islands, block, i)
                if (islands.uneven[island] == 1
                        or not least <= islands.moved[island] <= most):
                    bits &= ~(1 << i)
        islands.visited[block] = bits


@kernel
def _island(islands: Islands, block: int, i: int) -> int:
    return islands.number[block * LANES + i & INDEX] & INDEX


@kernel
def _sweep(turn: int, blocks: Blocks, motion: Array, what: Sweep, islands: Islands) -> None:
    """Visit the lanes once, and note which islands that changed."""
    count = islands.blocks[0]
    # The first one tells whether there is anything to do finer than that.
    fine = FINER if turn == 0 or turn >= SWEEPS else 1.0
    for k in range(count):
        block = islands.block[count - 1 - k if turn % 2 == 1 else k] & INDEX
        bits = islands.visited[block]
        if bits != 0:
            bits = visit_lanes(blocks, block, motion, what, bits,
                               fine * settled(points_in(blocks.kind[block])), 0.0)
        for i in range(LANES if bits != 0 else 0):
            if bits & 1 << i != 0:
                islands.moved[_island(islands, block, i)] = turn + 1


@kernel
def _end_turn(turn: int, blocks: Blocks, islands: Islands) -> bool:
    """Leave the islands alone that the last sweep did not change; return whether any are left."""
    left = False
    for k in range(islands.blocks[0]):
        block = islands.block[k] & INDEX
        bits = islands.visited[block]
        for i in range(LANES if bits != 0 else 0):
            if bits & 1 << i != 0 and islands.moved[_island(islands, block, i)] != turn + 1:
                bits &= ~(1 << i)
        islands.visited[block] = bits
        left |= bits != 0
    return left
