# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sweeps of small islands, which go on until an island is settled; see direct_islands.py."""

from rigid_sim_ros.engine.constraints.contact_rules import settled, Sweep
from rigid_sim_ros.engine.solver.coloring import Blocks, points_in
from rigid_sim_ros.engine.solver.contact_sweep import visit_lanes
from rigid_sim_ros.engine.solver.direct_islands import Islands
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.eight import LANES
from rigid_sim_ros.kernels.kernel import INDEX, kernel

# What so many sweeps do not settle is solved directly.
SWEEPS = 40
# Of what settles a manifold elsewhere: where sweeps converge slowly, a visit that changes little
# leaves many times that, and where they end depends on the order of the contacts.
CLOSER = 0.01


@kernel
def sweep_islands(blocks: Blocks, motion: Array, what: Sweep, islands: Islands) -> None:
    """
    Visit the contacts of small islands, forth and back by turns, until these are settled.

    But not those of uneven masses. islands.moved becomes 1 for those that are not settled.
    """
    _begin(blocks, islands)
    for turn in range(SWEEPS):
        for island in range(islands.count[0]):
            islands.moved[island] = 0
        _sweep(turn % 2 == 1, blocks, motion, what, islands)
        if not _end_turn(islands):
            break


@kernel
def _begin(blocks: Blocks, islands: Islands) -> None:
    """Let all lanes be visited that are awake and not of an uneven island."""
    for k in range(islands.blocks[0]):
        block = islands.block[k] & INDEX
        bits = blocks.direct[block] & ~blocks.dormant[block]
        for i in range(LANES):
            if bits & 1 << i != 0 and islands.uneven[_island(islands, block, i)] == 1:
                bits &= ~(1 << i)
        islands.visited[block] = bits


@kernel
def _island(islands: Islands, block: int, i: int) -> int:
    return islands.number[block * LANES + i & INDEX] & INDEX


@kernel
def _sweep(backwards: bool, blocks: Blocks, motion: Array, what: Sweep, islands: Islands) -> None:
    """Visit the lanes once, and note which islands that changed."""
    count = islands.blocks[0]
    for k in range(count):
        block = islands.block[count - 1 - k if backwards else k] & INDEX
        bits = islands.visited[block]
        if bits != 0:
            bits = visit_lanes(blocks, block, motion, what, bits,
                               CLOSER * settled(points_in(blocks.kind[block])), 0.0)
        for i in range(LANES if bits != 0 else 0):
            if bits & 1 << i != 0:
                islands.moved[_island(islands, block, i)] = 1


@kernel
def _end_turn(islands: Islands) -> bool:
    """Leave the islands alone that the last sweep did not change; return whether any are left."""
    left = False
    for k in range(islands.blocks[0]):
        block = islands.block[k] & INDEX
        bits = islands.visited[block]
        for i in range(LANES if bits != 0 else 0):
            if bits & 1 << i != 0 and islands.moved[_island(islands, block, i)] == 0:
                bits &= ~(1 << i)
        islands.visited[block] = bits
        left |= bits != 0
    return left
