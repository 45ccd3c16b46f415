# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How much of the impulses of the substep before an island begins with, where masses differ by much.

Impulses that have not been found yet, or whose directions have turned, are no balance. What a
heavy body lets pass through a light one is then a small part of it that is left over, and throws
the light one away faster than the sweeps that follow can make good. (What is carried over from
the step before, by feature: detection/carried_impulses.py.)

Of impulses f that act on bodies with the velocities v, G v those of their points, the energy
is

    T(s) = T(0) + s f . G v + s^2 f . A f / 2        for a part s of them,

and for those that solve the contacts, A f + G v = 0 where f is not 0, the minimum is at s = 1. So
where it is at less than 1 / 2, beyond which they would make energy, that part of them is taken.
"""

from rigid_sim_ros.engine.constraints.contact_blocks import (
    FRICTION, FRICTION_ASIDE, IMPULSE, IMPULSE_ASIDE, POINT, POINT_ROWS, ROLL, ROLL_ASIDE, SPIN,
    SPIN_ASIDE)
from rigid_sim_ros.engine.contact.colliding_body import get
from rigid_sim_ros.engine.maths.union_find import first_of
from rigid_sim_ros.engine.maths.vector import symmetric_times
from rigid_sim_ros.engine.solver.coloring import (
    are_balls, Blocks, first_block, numbers_of, points_in, REGIONS, resists)
from rigid_sim_ros.engine.solver.direct_islands import is_uneven, Islands, root_of
from rigid_sim_ros.engine.solver.impacts import Impacts
from rigid_sim_ros.engine.solver.solver_bodies import (
    INV_I_W, INV_M, slots_of, SolverBodies, STRIDE)
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.eight import LANES
from rigid_sim_ros.kernels.kernel import INDEX, kernel


@kernel
def temper_warm_start(blocks: Blocks, bodies: SolverBodies, h: float, impacts: Impacts,
                      islands: Islands) -> None:
    """Let no impulses of the substep before make energy in this one, which lasts h [s]."""
    if not _find_shares(bodies, h, islands):
        return
    _leave_carried(blocks, bodies, islands)
    for half in range(2):
        first, last = slots_of(bodies.used, half)
        for slot in range(first + 1, last):
            share = islands.share[first_of(islands.parent, slot)]
            for k in range(slot * STRIDE, slot * STRIDE + 6):
                bodies.base[k] *= share
    for region in range(REGIONS):
        begin = first_block(blocks, region)
        for block in range(begin, begin + blocks.count[region]):
            for i in range(LANES):
                lane = block * LANES + i
                if blocks.row[lane] >= 0:
                    share = islands.share[root_of(blocks, bodies, islands, lane)]
                    if share < 1.0:
                        _scale_lane(numbers_of(blocks, block), blocks.kind[block], i, share,
                                    impacts.hit[block] & 1 << i != 0)


@kernel
def _find_shares(bodies: SolverBodies, h: float, islands: Islands) -> bool:
    """Write how much each island begins with, at its root; return whether it is less anywhere."""
    islands.share[:], islands.bend[:] = 0.0, 0.0
    for half in range(2):
        first, last = slots_of(bodies.used, half)
        for slot in range(first + 1, last):
            at, root = slot * STRIDE, first_of(islands.parent, slot)
            if bodies.motion[at + INV_M] > 0.0:
                forces = first if bodies.alike[0] == 1 else slot
                slope, bend = _energy(bodies, at, forces * STRIDE, h)
                islands.share[root] -= slope
                islands.bend[root] += bend
    less = False
    for half in range(2):
        first, last = slots_of(bodies.used, half)
        for slot in range(first, last):
            gained, bend = islands.share[slot], islands.bend[slot]
            # Comparisons with what is not a number are false: it stays as it is.
            is_less = is_uneven(islands, slot) and 2.0 * gained < bend
            islands.share[slot] = max(gained, 0.0) / bend if is_less else 1.0
            less |= is_less
    return less


@kernel
def _energy(bodies: SolverBodies, at: int, smooth: int, h: float) -> tuple[float, float]:
    """Return dv . M v and dv . M dv of a body, v with its forces of h [s] and dv of contacts."""
    motion, base, mass = bodies.motion, bodies.base, bodies.mass
    dw = symmetric_times(get(mass, at + INV_I_W), get(mass, at + INV_I_W + 3), get(base, at + 3))
    slope = bend = 0.0
    for k in range(3):
        dP = base[at + k] / motion[at + INV_M]
        slope += dP * (motion[at + k] + h * bodies.smooth[smooth + k])
        slope += dw[k] * (motion[at + 3 + k] + h * bodies.smooth[smooth + 3 + k])
        bend += dP * base[at + k] + dw[k] * base[at + 3 + k]
    return slope, bend


@kernel
def _leave_carried(blocks: Blocks, bodies: SolverBodies, islands: Islands) -> None:
    """Leave islands as they are on which something moves by its twist: that may give energy."""
    for region in range(REGIONS):
        begin = first_block(blocks, region) * LANES
        for lane in range(begin, begin + blocks.count[region] * LANES):
            if blocks.row[lane] >= 0:
                for at in (blocks.at_A[lane] & INDEX, blocks.at_B[lane] & INDEX):
                    if bodies.motion[at + INV_M] == 0.0 and _moves(bodies.motion, at):
                        islands.share[root_of(blocks, bodies, islands, lane)] = 1.0


@kernel
def _moves(motion: Array, at: int) -> bool:
    total = 0.0
    for k in range(6):
        total += abs(motion[at + k])
    return total != 0.0


@kernel
def _scale_lane(b: Array, kind: int, i: int, share: float, hit: bool) -> None:
    """Multiply all impulses of lane i of a block, while an impact is solved those set aside."""
    impulse, friction, spin, roll = IMPULSE, FRICTION, SPIN, ROLL
    if hit:
        impulse, friction, spin, roll = IMPULSE_ASIDE, FRICTION_ASIDE, SPIN_ASIDE, ROLL_ASIDE
    for p in range(4 if points_in(kind) > 1 else 1):
        b[(POINT + p * POINT_ROWS + impulse) * LANES + i] *= share
    for k in range(2):
        b[(friction + k) * LANES + i] *= share
    if not are_balls(kind):
        b[spin * LANES + i] *= share
    for k in range(2 if resists(kind) else 0):
        b[(roll + k) * LANES + i] *= share
