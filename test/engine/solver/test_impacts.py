# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Impacts: who waits, in which order, and what they do to energies and to later substeps."""

import functools

from engine.stepping import TimestepScene
from engine.touching import ball, box, ground
from hypothesis import given, settings, strategies as st
from inside import solver_of
import numpy as np
import pytest
from test_halves import LENGTH, members, row, rows_and, SPEED

from rigid_sim_ros.engine.constraints.contact_blocks import ABSENT, GAP, POINT, POINT_ROWS
from rigid_sim_ros.engine.constraints.contact_rules import Sweep
from rigid_sim_ros.engine.detection.manifolds import latest_impulses
from rigid_sim_ros.engine.model.shapes import Material
from rigid_sim_ros.engine.solver.coloring import (
    BETWEEN, first_block, make_blocks, points_in, REGIONS)
from rigid_sim_ros.engine.solver.impacts import (
    _tell, find_approaching, make_impacts, pass_on, TURNS, visit_waiting)
from rigid_sim_ros.engine.solver.solver_bodies import (
    FIRST_END, make_bodies, SECOND_BEGIN, SECOND_END, slots_of, STRIDE)
from rigid_sim_ros.kernels.eight import LANES
from rigid_sim_ros.world import World

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
    """Return the block of each lane, its bit, and the slots of its two bodies."""
    firsts = [(first_block(blocks, region), blocks.count[region]) for region in range(REGIONS)]
    return [(block, 1 << lane, {int(at[block * LANES + lane]) // STRIDE
                                for at in (blocks.at_A, blocks.at_B)})
            for first, count in firsts for block in range(first, first + count)
            for lane in range(LANES)]


def waiting_in(work):
    """Return the bits of the lanes of each block that wait, whoever told them."""
    return work.waits[0] | work.waits[1]


@settings(max_examples=40)
@given(seed=st.integers(0, 2 ** 32 - 1), halved=st.booleans())
def test_a_change_is_told_to_all_lanes_of_whom_it_moved(seed, halved):
    rng = np.random.default_rng(seed)
    bodies, blocks = some_blocks(rng, halved)
    work = make_impacts(BODIES, MOST * LANES)
    still = {0, int(bodies.used[SECOND_BEGIN])} if halved else {0}
    # What an earlier step left.
    work.first[:], work.further[:] = 7, 7
    everything = places(bodies, blocks)
    for region in range(REGIONS if halved else 1):
        if blocks.count[region] == 0:
            continue
        block = int(first_block(blocks, region) + rng.integers(blocks.count[region]))
        shaken = rng.random(LANES) < 0.3
        reached = {int(at[block * LANES + i]) // STRIDE for at in (blocks.at_A, blocks.at_B)
                   for i in np.flatnonzero(shaken)} - still
        expected = np.zeros(work.waits.shape[1], dtype=np.int64)
        for other, bit, slots in everything:
            expected[other] |= bit if slots & reached else 0
        work.waits[:] = 0
        _tell(region, blocks, block, int(shaken @ (1 << np.arange(LANES))), bodies.used, work)
        assert np.array_equal(waiting_in(work), expected)


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
    return solver_of(world)


# Of an impact in the middle of a step of four substeps of 1 / 960 s.
IMPACT = Sweep(960.0, False, 0.0)


def in_one_order(turns, blocks, bodies, work):
    """Visit what waits in the order of a sweep or the opposite one, as if there were no halves."""
    for _ in range(turns):
        for backwards, regions in ((True, (2, 1, 0)), (False, (0, 1, 2))):
            for region in regions:
                visit_waiting(region, backwards, blocks, bodies.motion, bodies.used, IMPACT, 0.0,
                              work)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2 ** 32 - 1), share=st.sampled_from([0.003, 0.03, 0.3]),
       turns=st.sampled_from([1, 2, TURNS]))
def test_halves_that_are_visited_apart_end_as_one_world_in_its_order(seed, share, turns):
    rng, filled = np.random.default_rng(seed), impact()
    bodies, blocks = copy_of(filled.bodies), copy_of(filled.blocks)
    # All bodies at rest but for some.
    motion = bodies.motion.reshape(-1, STRIDE)
    motion[:, :6] = 0.0
    for half in range(2):
        still, last = slots_of(bodies.used, half)
        hit = still + 1 + np.flatnonzero(rng.random(last - still - 1) < share)
        motion[hit, :3] = rng.normal(scale=SPEED, size=(len(hit), 3))

    one, one_blocks, one_work = copy_of(bodies), copy_of(blocks), copy_of(filled.impacts)
    one_work.listed[:] = 0
    for region in range(REGIONS):
        find_approaching(region, one_blocks, one.motion, IMPACT, 0.0, one_work)
    in_one_order(turns, one_blocks, one, one_work)

    work = copy_of(filled.impacts)
    # What the step before left, and lists of another step.
    work.listed[:], work.waits[:], work.first[:], work.hit[:] = 0, 1, 7, 1
    # Two cores may take the halves in any order.
    halves = rng.permutation(2).tolist()
    for region in (*halves, BETWEEN):
        find_approaching(region, blocks, bodies.motion, IMPACT, 0.0, work)
    ended, regions = False, [slice(first_block(blocks, region), first_block(
        blocks, region) + blocks.count[region]) for region in range(REGIONS)]
    for _ in range(turns):
        visit_waiting(BETWEEN, True, blocks, bodies.motion, bodies.used, IMPACT, 0.0, work)
        # All of them have their turn, whoever waits.
        waiting = [pass_on(region, blocks, bodies.motion, bodies.used, IMPACT, 0.0, work)
                   for region in (*halves, BETWEEN)]
        if not any(waiting):
            ended = True
            break
    assert np.array_equal(bodies.motion, one.motion)
    assert np.array_equal(blocks.numbers, one_blocks.numbers)
    for some in regions:
        assert np.array_equal(waiting_in(work)[some], waiting_in(one_work)[some])
        assert not (ended and waiting_in(work)[some].any())
    assert ended or turns < TURNS


def heap(friction):
    """Return boxes and balls of 10 g to 100 kg that press on each other, and on the ground."""
    rng = np.random.default_rng(5)
    masses = 10.0 ** rng.uniform(-2.0, 2.0, 36)
    things = [ball(0.1, m, position=(0.2 * (k % 3), 0.2 * (k // 3 % 3), 0.1 + 0.2 * (k // 9)))
              if k % 2 else
              box((0.2, 0.2, 0.2), m,
                  position=(0.2 * (k % 3), 0.2 * (k // 3 % 3), 0.1 + 0.2 * (k // 9)))
              for k, m in enumerate(masses)]
    scene = TimestepScene([ground(), *things], Material(friction=friction), 1 / 240)
    scene.step(5)
    return scene.work.solver


def energy(bodies):
    """Return the kinetic energy of the bodies of the first half [J]."""
    first, last = slots_of(bodies.used, 0)
    rows = [numbers.reshape(-1, STRIDE)[first + 1:last] for numbers in (
        bodies.motion, bodies.mass)]
    v, L, inv_m, J = rows[0][:, :3], rows[0][:, 3:6], rows[1][:, 6], rows[1][:, :6]
    J = J[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    return 0.5 * ((v ** 2).sum(axis=1) / inv_m).sum() + 0.5 * np.einsum('ij,ijk,ik', L, J, L)


def in_any_order(filled, seed, after_each):
    """Give the bodies random velocities, and visit random blocks; call this with T0 and T."""
    rng = np.random.default_rng(seed)
    bodies, blocks, work = (copy_of(some) for some in (
        filled.bodies, filled.blocks, filled.impacts))
    first, last = slots_of(bodies.used, 0)
    motion, mass = (numbers.reshape(-1, STRIDE)[first + 1:last] for numbers in (
        bodies.motion, bodies.mass))
    # Each has some joules, and about as many in its rotation.
    motion[:, :3] = rng.normal(size=(len(mass), 3)) * np.sqrt(mass[:, 6])[:, None]
    motion[:, 3:6] = rng.normal(size=(len(mass), 3)) / np.sqrt(mass[:, [0, 3, 5]])
    work.listed[:] = 0
    find_approaching(0, blocks, bodies.motion, IMPACT, 0.0, work)
    start = energy(bodies)
    for _ in range(300):
        work.waits[:] = 0
        work.waits[0, rng.integers(blocks.count[0])] = (1 << LANES) - 1
        visit_waiting(0, False, blocks, bodies.motion, bodies.used, IMPACT, 0.0, work)
        after_each(start, energy(bodies))
    assert energy(bodies) < 0.9 * start


def test_no_visit_makes_energy_where_all_touch_without_friction():
    filled = heap(0.0)
    blocks, before = filled.blocks, [np.inf]
    assert blocks.count[1:].tolist() == [0, 0] and blocks.count[0] > 10
    for block in range(blocks.count[0]):
        for p in range(4 if points_in(blocks.kind[block]) > 1 else 1):
            gap = blocks.numbers[blocks.start[block] + (POINT + p * POINT_ROWS + GAP) * LANES:]
            gap[:LANES][gap[:LANES] < ABSENT] = 0.0

    def compare(start, now):
        # Rounding of some hundred numbers.
        assert now <= min(before[0], start) * (1.0 + 1e-12)
        before[0] = now

    for seed in range(20):
        before[0] = np.inf
        in_any_order(filled, seed, compare)


@pytest.mark.parametrize('friction', [0.0, 0.3, 1.0])
def test_an_impact_never_has_more_energy_than_at_its_start_whatever_the_order(friction):
    # A visit may give some back: where a gap may still close, or where less friction is left.
    def compare(start, now):
        assert now <= start

    filled = heap(friction)
    for seed in range(20):
        in_any_order(filled, seed, compare)


@pytest.mark.parametrize('thing, friction', [
    (ball(0.1, 2.0, position=(0.0, 0.0, 0.1), velocity=(1.0, 0.0, -3.0)), 0.05),
    (box((0.2, 0.2, 0.2), 2.0, position=(0.0, 0.0, 0.1), velocity=(1.0, 0.0, -3.0)), 0.0)],
    ids=['ball', 'box'])
def test_the_impulse_of_an_impact_acts_once(thing, friction):
    scene = TimestepScene([ground(), thing], Material(friction=friction), 1 / 240,
                          gravity=(0.0, 0.0, 0.0))
    scene.step()
    acted, manifolds = latest_impulses(scene.memory), scene.manifolds()
    points = manifolds.points[0]
    # N s: it stopped, and friction took its part: below 2/7 m v, at which a ball would roll.
    assert acted.normal[:points, 0].sum() == pytest.approx(6.0, abs=1e-12)
    assert acted.friction[0] == pytest.approx((-6.0 * friction, 0.0, 0.0), abs=1e-12)
    # What the next step begins with.
    assert (manifolds.impulse[:points, 0] == 0.0).all() and (manifolds.friction[0] == 0.0).all()
    P = scene.state.P.copy()
    scene.step(3)
    # Rounding of 6 N s.
    assert pytest.approx(P, abs=1e-14) == scene.state.P and abs(P[2, 1]) < 1e-14


def test_a_box_that_lands_flat_and_slides_does_not_hop():
    # Friction at the floor would turn it; the pressure moves forward by 0.02 m and keeps it flat.
    thing = box((0.2, 0.2, 0.2), 2.0, position=(0.0, 0.0, 0.1), velocity=(1.0, 0.0, -3.0))
    scene = TimestepScene([ground(), thing], Material(friction=0.2), 1 / 240,
                          gravity=(0.0, 0.0, 0.0))
    scene.step()
    # Visits go on until what one of them changes is 1e-8 of the size in a substep, 2e-6 m/s.
    assert scene.v[:, 1] == pytest.approx((1.0 - 0.2 * 3.0, 0.0, 0.0), abs=2e-5)
    assert scene.model.inv_I_C[:, 1] * scene.state.L[:, 1] == pytest.approx(0.0, abs=2e-4)


def test_a_light_body_that_spins_between_heavy_ones_does_not_throw_them_apart():
    # It spins by 0.2 rad a step, which alone would move its corners by h w^2 r = 1 m/s and more
    # against the heavy ones; they approach with 0.06 m/s, and the impact ends the spin.
    light = solid('light', {'type': 'cylinder', 'radius': 0.00715, 'length': 0.0091}, 1.1e-3,
                  (0.00061, 0.00054, 0.04218), (0.0092, -0.0244, 0.0091, 0.99962),
                  (0.93, 0.76, -0.03), (-348.0, 611.0, -10.0))
    low = solid('low', {'type': 'sphere', 'radius': 0.0024}, 3.7, (-0.00095, -0.00157, 0.03557),
                (0.0, 0.0, 0.0, 1.0), (-0.08, -0.1, -0.2), (0.0, 0.0, 0.0))
    high = solid('high', {'type': 'cylinder', 'radius': 0.00267, 'length': 0.0173}, 9.9,
                 (0.0, 0.0, 0.05538), (0.0011, -0.0048, 0.7071, 0.7071), (0.0, 0.0, -0.26),
                 (0.0, 0.0, 0.0))
    world = World.from_dict({
        'format': 1, 'world': {'gravity': [0.0, 0.0, 0.0], 'step': 3e-4, 'contact': 'timestep'},
        'materials': {'default': {'friction': 0.0, 'restitution': 0.0}},
        'bodies': [low, light, high]})
    before = world.kinetic_energy()
    world.step()
    # The square of 0.2 rad, of which the contact knows the middle only.
    assert world.kinetic_energy() < before * (1.0 + 0.2 ** 2)


def solid(name, shape, mass, position, orientation, linear, angular):
    return {'name': name, 'shape': shape, 'mass': mass,
            'pose': {'position': list(position), 'orientation': list(orientation)},
            'twist': {'linear': list(linear), 'angular': list(angular)}}
