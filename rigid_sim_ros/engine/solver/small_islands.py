# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The impulses of small islands: swept until they are settled, or found all at once."""

from rigid_sim_ros.engine.constraints.contact_rules import Sweep
from rigid_sim_ros.engine.solver.coloring import Blocks
from rigid_sim_ros.engine.solver.direct_islands import (
    begin_island_impact, begins_to_bear, let_island_wait)
from rigid_sim_ros.engine.solver.direct_newton import Direct
from rigid_sim_ros.engine.solver.direct_rows import read_island, write_island
from rigid_sim_ros.engine.solver.direct_solve import solve_rows
from rigid_sim_ros.engine.solver.impacts import Impacts
from rigid_sim_ros.engine.solver.island_sweeps import sweep_islands
from rigid_sim_ros.engine.solver.solver_bodies import SolverBodies
from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def strike_islands(all_of_them: bool, blocks: Blocks, bodies: SolverBodies, what: Sweep,
                   impacts: Impacts, work: Direct) -> None:
    """
    Find the impulses of an impact in the islands that wait, all of them or the uneven ones.

    Where none are found, all of the island waits for its turns.
    """
    islands = work.islands
    for island in range(islands.count[0]):
        if ((all_of_them or islands.uneven[island] == 1)
                and begin_island_impact(blocks, islands, island, impacts)
                and not _solve_island(island, False, blocks, bodies, what, work)):
            let_island_wait(islands, island, impacts)


@kernel
def bear_islands(blocks: Blocks, bodies: SolverBodies, fresh: IntArray, what: Sweep,
                 work: Direct) -> None:
    """
    Find the impulses that bear the forces of a substep in all small islands.

    An uneven one whose impulses are not found is swept like others, from then on: left alone it
    would keep those of the substep before, which for a light body are no balance. Where `fresh`
    manifolds begin to bear something the load is shared out anew; see begins_to_bear.
    """
    islands = work.islands
    for island in range(islands.count[0]):
        if islands.uneven[island] == 1:
            found = _solve_island(island, False, blocks, bodies, what, work)
            islands.uneven[island] = 1 if found else 0
    sweep_islands(blocks, bodies.motion, what, islands)
    for island in range(islands.count[0]):
        anew = begins_to_bear(blocks, fresh, islands, island)
        if anew or islands.moved[island] == 1:
            _solve_island(island, anew, blocks, bodies, what, work)


@kernel
def _solve_island(island: int, anew: bool, blocks: Blocks, bodies: SolverBodies, what: Sweep,
                  work: Direct) -> bool:
    """Solve for the impulses of an island, `anew` from none on; return whether any were found."""
    islands = work.islands
    lanes = islands.lane[islands.begin[island]:islands.begin[island + 1]]
    count, moving = read_island(blocks, bodies, lanes, what, work.rows)
    if count == 0:
        return True
    found = solve_rows(count, moving, what.inv_h, anew, work)
    if found:
        write_island(blocks, bodies, lanes, count, moving, work.p, work.rows)
    return found
