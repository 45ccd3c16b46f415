# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who hears of a rough change before a substep ends."""

from hypothesis import given, settings, strategies as st
import numpy as np

from rigid_sim_ros.engine.calming import _list_blocks, _tell, make_calming
from rigid_sim_ros.engine.coloring import (
    BETWEEN, first_block, make_blocks, OVERLAPPING, REGIONS, SHAKEN, SHOVED, UNSETTLED)
from rigid_sim_ros.engine.lanes import LANES
from rigid_sim_ros.engine.solver_bodies import (
    FIRST_END, make_bodies, SECOND_BEGIN, SECOND_END, slots_of, STRIDE)

BODIES, MOST = 100, 40


def some_blocks(rng, halved):
    """Return bodies with slots in the halves, and blocks of lanes between them, some empty."""
    bodies, blocks = make_bodies(BODIES), make_blocks(MOST * LANES)
    ends = [20, 30, 50] if halved else [50, 50, 50]
    bodies.used[[FIRST_END, SECOND_BEGIN, SECOND_END]] = ends
    blocks.count[:] = rng.integers(0, MOST, REGIONS) if halved else [MOST, 0, 0]
    halves = [slots_of(bodies.used, half) for half in range(2)]
    for region in range(REGIONS):
        first = first_block(blocks, region)
        lanes = slice(first * LANES, (first + blocks.count[region]) * LANES)
        count = lanes.stop - lanes.start
        # Across are none but moving bodies.
        across = 1 if region == BETWEEN else 0
        sides = (0, 1) if across else (region, region)
        for at, side in zip((blocks.at_A, blocks.at_B), sides, strict=True):
            begin, end = halves[side]
            at[lanes] = STRIDE * rng.integers(begin + across, max(end, begin + 1), count)
    return bodies, blocks


def places(bodies, blocks):
    """Return the block of each lane, and the slots of its two bodies."""
    firsts = [(first_block(blocks, region), blocks.count[region]) for region in range(REGIONS)]
    return [(block, {int(at[lane]) // STRIDE for at in (blocks.at_A, blocks.at_B)})
            for first, count in firsts for block in range(first, first + count)
            for lane in range(block * LANES, (block + 1) * LANES)]


@settings(max_examples=40)
@given(seed=st.integers(0, 2 ** 32 - 1), halved=st.booleans())
def test_a_rough_change_is_told_to_all_other_blocks_of_whom_it_moved(seed, halved):
    rng = np.random.default_rng(seed)
    bodies, blocks = some_blocks(rng, halved)
    work = make_calming(BODIES, MOST * LANES)
    still = {0, int(bodies.used[SECOND_BEGIN])} if halved else {0}
    # What an earlier step left.
    work.first[:], work.further[:] = 7, 7
    _list_blocks(blocks, bodies.used, work)
    everything = places(bodies, blocks)
    for region in range(REGIONS if halved else 1):
        if blocks.count[region] == 0:
            continue
        block = int(first_block(blocks, region) + rng.integers(blocks.count[region]))
        shaken = rng.random(LANES) < 0.3
        # Beside what is no rough change.
        flags = int(rng.choice([0, UNSETTLED, OVERLAPPING, SHOVED]))
        blocks.left[block] = flags + SHAKEN * int(shaken @ (1 << np.arange(LANES)))
        reached = {int(at[block * LANES + i]) // STRIDE for at in (blocks.at_A, blocks.at_B)
                   for i in np.flatnonzero(shaken)} - still
        expected = {other for other, slots in everything if slots & reached}
        work.waits[:] = 0
        _tell(blocks, block, work)
        assert set(np.flatnonzero(work.waits)) == expected - {block}
