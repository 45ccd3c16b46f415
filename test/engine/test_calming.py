# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who hears of a rough change before a substep ends, and in which order it is heard."""

import functools

from effort import examples
from halves import LENGTH, members, row, rows_and, SPEED
from hypothesis import given, strategies as st
import numpy as np

from rigid_sim_ros.engine.calming import (
    _tell, calm, make_calming, tell_of_sweep, visit_waiting)
from rigid_sim_ros.engine.coloring import (
    BETWEEN, first_block, make_blocks, OVERLAPPING, REGIONS, SHAKEN, SHOVED, UNSETTLED)
from rigid_sim_ros.engine.contact_rules import Sweep
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
        # Across is no body of the second half that stands still.
        across = region == BETWEEN
        sides = (0, 1) if across else (region, region)
        for at, side in zip((blocks.at_A, blocks.at_B), sides, strict=True):
            begin, end = halves[side]
            first_slot = begin + (across and side == 1)
            at[lanes] = STRIDE * rng.integers(first_slot, max(end, begin + 1), count)
    return bodies, blocks


def places(bodies, blocks):
    """Return the block of each lane, and the slots of its two bodies."""
    firsts = [(first_block(blocks, region), blocks.count[region]) for region in range(REGIONS)]
    return [(block, {int(at[lane]) // STRIDE for at in (blocks.at_A, blocks.at_B)})
            for first, count in firsts for block in range(first, first + count)
            for lane in range(block * LANES, (block + 1) * LANES)]


@examples(40)
@given(seed=st.integers(0, 2 ** 32 - 1), halved=st.booleans())
def test_a_rough_change_is_told_to_all_other_blocks_of_whom_it_moved(seed, halved):
    rng = np.random.default_rng(seed)
    bodies, blocks = some_blocks(rng, halved)
    work = make_calming(BODIES, MOST * LANES)
    still = {0, int(bodies.used[SECOND_BEGIN])} if halved else {0}
    # What an earlier step left.
    work.first[:], work.further[:] = 7, 7
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
        _tell(region, blocks, block, bodies, work)
        assert set(np.flatnonzero(work.waits)) == expected - {block}


def copy_of(record):
    """Return a copy of all arrays of a record."""
    return type(record)(*(np.copy(field) for field in record))


@functools.cache
def impact():
    """Return a world of two halves in the step in which rows of balls are hit, some across."""
    y, z = np.eye(3)[1:]
    across = [ball for k in range(1, 17)
              for ball in row(f'a{k}', 0.3 * k * z, y, LENGTH, 0.0, SPEED)]
    world = rows_and(across, SPEED)
    world.step(3)
    assert members(world)[BETWEEN] == 16
    return world._contact._work.solver


def in_one_order(turns, blocks, bodies, work, what):
    """Calm all regions in the order of a sweep or the opposite one, as if there were no halves."""
    for region in range(REGIONS):
        tell_of_sweep(region, True, blocks, bodies, work)
    for _ in range(turns):
        for backwards, regions in ((True, (2, 1, 0)), (False, (0, 1, 2))):
            for region in regions:
                visit_waiting(region, backwards, blocks, bodies, what, work)


@examples(40)
@given(seed=st.integers(0, 2 ** 32 - 1), share=st.sampled_from([0.003, 0.03, 0.3]),
       turns=st.sampled_from([1, 2, 50]))
def test_halves_that_calm_apart_end_as_one_world_in_its_order(seed, share, turns):
    rng, filled = np.random.default_rng(seed), impact()
    bodies, blocks = copy_of(filled.bodies), copy_of(filled.blocks)
    what = Sweep(960.0, 0.0, False)
    # All bodies at rest but for some, of which a visit has just told.
    motion = bodies.motion.reshape(-1, STRIDE)
    motion[:, :6] = 0.0
    rough = [False] * REGIONS
    for region in range(REGIONS):
        first = first_block(blocks, region)
        for block in range(first, first + blocks.count[region]):
            blocks.left[block] = 0
            if rng.random() < share:
                lane = block * LANES + int(rng.choice(np.flatnonzero(
                    blocks.at_A[block * LANES:][:LANES] % (bodies.used[SECOND_BEGIN] * STRIDE))))
                for at in (blocks.at_A[lane], blocks.at_B[lane]):
                    motion[at // STRIDE, :3] = rng.normal(scale=SPEED, size=3)
                blocks.left[block] = SHAKEN << lane % LANES
                rough[region] = True

    one, one_blocks, one_work = copy_of(bodies), copy_of(blocks), copy_of(filled.calming)
    one_work.listed[:] = 0
    in_one_order(turns, one_blocks, one, one_work, what)

    work = copy_of(filled.calming)
    # What the sweep before this left, and lists of another step.
    work.listed[:], work.waits[:], work.first[:] = 0, 1, 7
    # Two cores may take the halves in any order.
    halves = rng.permutation(2).tolist()
    for region in (*halves, BETWEEN):
        tell_of_sweep(region, rough[region], blocks, bodies, work)
    ended, regions = False, [slice(first_block(blocks, region), first_block(
        blocks, region) + blocks.count[region]) for region in range(REGIONS)]
    for _ in range(turns):
        visit_waiting(BETWEEN, True, blocks, bodies, what, work)
        if sum(calm(region, blocks, bodies, what, work) for region in (*halves, BETWEEN)) == 0:
            ended = True
            break
    assert np.array_equal(bodies.motion, one.motion)
    assert np.array_equal(blocks.numbers, one_blocks.numbers)
    for some in regions:
        assert np.array_equal(work.waits[some], one_work.waits[some])
        assert not (ended and work.waits[some].any())
    assert ended or turns < 50
