# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which bodies get a slot, and where a world is cut."""

from effort import examples
from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros.engine.detection.manifolds import empty_pages
from rigid_sim_ros.engine.solver.coloring import make_coloring, REGIONS
from rigid_sim_ros.engine.solver.contact_filling import choose_manifolds
from rigid_sim_ros.engine.solver.partition import (
    _BINS, begin_slots, choose_cut, FIRST, give_slots, make_sides, MANIFOLDS_TO_HALVE,
    mark_touching, SECOND, STILL, take_sides)
from rigid_sim_ros.engine.solver.solver_bodies import (
    make_bodies, most_slots, slots_between, slots_of)

BODIES = 200


def manifolds_of(pairs, first=0):
    """Return manifolds of these pairs of bodies, in the rows from `first` on."""
    page = empty_pages(first + len(pairs) + 1)[0]
    page.count[:] = len(pairs), first
    page.body_a[first:first + len(pairs)], page.body_b[first:first + len(pairs)] = pairs.T
    return page


def some_pairs(rng, count):
    """Return pairs of bodies, no body with itself."""
    a, b = rng.integers(BODIES, size=count), rng.integers(1, BODIES, size=count)
    return np.stack([a, (a + b) % BODIES], axis=1)


def some_sides(middle=BODIES // 2):
    """Return room for sides; as many shapes as bodies."""
    return make_sides(BODIES, (middle, middle))


@examples(60)
@given(seed=st.integers(0, 2 ** 32 - 1),
       count=st.integers(MANIFOLDS_TO_HALVE, 2 * MANIFOLDS_TO_HALVE),
       first=st.integers(0, 9), axis=st.integers(0, 2), place=st.sampled_from([0.0, 1e5]))
def test_a_plane_cuts_in_the_middle_of_the_manifolds(seed, count, first, axis, place):
    rng = np.random.default_rng(seed)
    spread = np.array([1.0, 1.0, 1.0])
    spread[axis] = 3.0
    x = (place + spread * rng.normal(size=(BODIES, 3))).T.copy()
    inv_m = rng.integers(2, size=BODIES).astype(float)
    asleep = (rng.random(BODIES) < 0.2).astype(np.int64)
    pairs, sides = some_pairs(rng, count), some_sides()
    choose_cut(inv_m, x, asleep, manifolds_of(pairs, first), sides)
    cut = sides.cut
    # Half of such pairs are across by number.
    assert (cut.halved[0], cut.by_place[0], cut.axis[0]) == (1, 1, axis) and cut.left[0] > 0
    # Each manifold counts where one of its bodies is, but for those that do not move.
    body = np.where(inv_m[pairs[:, 1]] > 0.0, pairs[:, 1], pairs[:, 0])
    body = body[(inv_m[body] > 0.0) & (asleep[body] == 0)]
    width = 4.0 * x[axis, np.unique(body)].std() / _BINS
    # Squares about a body some spreads away cancel, and lose a few of 16 digits.
    least = 1e-9 * width + 1e-15 * abs(place)
    assert np.mean(x[axis, body] > cut.end[0] + least) <= 0.5 + 1e-12
    assert np.mean(x[axis, body] > cut.end[0] - width - least) >= 0.5 - 1e-12


@pytest.mark.parametrize('middle, across, by_place', [
    (100, 0, 0), (100, 100, 0), (100, 120, 1), (78, 0, 1), (82, 0, 0), (118, 0, 0), (122, 0, 1)])
def test_numbers_cut_while_halves_are_fair_and_few_manifolds_are_across(middle, across, by_place):
    rng, ground = np.random.default_rng(3), BODIES - 1
    # As many manifolds for each body, the ground apart; `across` more of bodies far apart.
    pairs = np.stack([np.repeat(np.arange(BODIES - 1), 4), np.full(4 * (BODIES - 1), ground)], 1)
    pairs = np.concatenate([pairs, np.tile([[0, BODIES - 2]], (across, 1))])
    inv_m = np.ones(BODIES)
    inv_m[ground] = 0.0
    sides = some_sides(middle)
    choose_cut(inv_m, rng.normal(size=(3, BODIES)), np.zeros(BODIES, dtype=np.int64),
               manifolds_of(pairs), sides)
    assert (sides.cut.halved[0], sides.cut.by_place[0]) == (1, by_place)


@examples(60)
@given(seed=st.integers(0, 2 ** 32 - 1), count=st.integers(0, 300),
       cut=st.sampled_from(['not at all', 'by number', 'by place']))
def test_slots_are_in_order_of_sides_and_bodies(seed, count, cut):
    rng, middle = np.random.default_rng(seed), 80
    x, inv_m = rng.normal(size=(3, BODIES)), rng.integers(2, size=BODIES).astype(float)
    asleep = (rng.random(BODIES) < 0.2).astype(np.int64)
    waits = (rng.random(count + 1) < 0.2).astype(np.int64)
    pairs, sides, bodies = some_pairs(rng, count), some_sides(middle), make_bodies(BODIES)
    sides.cut.halved[0], sides.cut.by_place[0] = cut != 'not at all', cut == 'by place'
    sides.cut.axis[0], sides.cut.end[0] = 1, 0.1
    # What an earlier step left.
    touching = np.ones((2, BODIES), dtype=np.int8)
    bodies.slot[:], bodies.body[:], bodies.flies[:] = 7, 7, 7
    for some in (slice(60, BODIES), slice(0, 60)):
        take_sides(inv_m, np.zeros((6, BODIES)), x, asleep, some.start, some.stop, sides,
                   bodies.slot, bodies.flies)
    mark_touching(manifolds_of(pairs), waits, touching)
    # Marks of either thread count.
    touching[1, ::3], touching[0, ::3] = touching[0, ::3], 0
    begin_slots(sides, touching, bodies)
    for half in (1, 0) if cut != 'not at all' else (0,):
        give_slots(half, sides, touching, bodies)
    moves = (inv_m > 0.0) & (asleep == 0)
    touches = moves & np.isin(np.arange(BODIES), pairs[waits[:count] == 0])
    there = {'not at all': np.zeros(BODIES, dtype=bool), 'by number': np.arange(BODIES) >= middle,
             'by place': x[1] > 0.1}[cut]
    assert np.array_equal(sides.of_body, np.where(moves, np.where(there, SECOND, FIRST), STILL))
    if cut != 'not at all':
        begin, end = slots_of(bodies.used, 1)
        last = 1 + middle if cut == 'by number' else slots_of(bodies.used, 0)[1]
        assert begin == last + slots_between(BODIES) > last
        assert end <= most_slots(BODIES) == len(bodies.body)
    for half in range(2 if cut != 'not at all' else 1):
        first, last = slots_of(bodies.used, half)
        expected = np.flatnonzero(touches & (there == (half == 1)))
        assert bodies.body[first:last].tolist() == [-1, *expected]
        assert bodies.slot[expected].tolist() == list(range(first + 1, last))
    assert np.array_equal(bodies.flies, moves & ~touches)
    assert (bodies.slot[~touches] == 0).all()


@examples(60)
@given(seed=st.integers(0, 2 ** 32 - 1), count=st.integers(0, 300), first=st.integers(0, 9),
       cut=st.sampled_from(['not at all', 'by number', 'by place']))
def test_every_manifold_that_is_solved_is_in_one_region(seed, count, first, cut):
    rng = np.random.default_rng(seed)
    x, inv_m = rng.normal(size=(3, BODIES)), (rng.random(BODIES) < 0.8).astype(float)
    asleep = (rng.random(BODIES) < 0.2).astype(np.int64)
    waits = (rng.random(first + count + 1) < 0.2).astype(np.int64)
    pairs = np.sort(some_pairs(rng, count), axis=1)
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    manifolds, sides = manifolds_of(pairs, first), some_sides(80)
    manifolds.shape_a[first:first + count] = pairs[:, 0]
    sides.cut.halved[0], sides.cut.by_place[0] = cut != 'not at all', cut == 'by place'
    take_sides(inv_m, np.zeros((6, BODIES)), x, asleep, 0, BODIES, sides,
               *np.zeros((2, BODIES), dtype=np.int32))
    coloring, regions = make_coloring(BODIES, first + count + 1), []
    for region in range(2 if cut != 'not at all' else 1):
        choose_manifolds(region, manifolds, sides, waits, coloring)
    for region in range(REGIONS):
        rows = coloring.member[region, :coloring.members[region]] - first
        assert (np.diff(rows) > 0).all()
        regions.append(rows)
    moves = (inv_m > 0.0) & (asleep == 0)
    solved = moves[pairs].any(axis=1) & (waits[first:first + count] == 0)
    assert np.array_equal(np.sort(np.concatenate(regions)), np.flatnonzero(solved))
    # What moves in a half is on its side.
    for region, side in enumerate((FIRST, SECOND)):
        bodies = np.unique(pairs[regions[region]])
        assert (sides.of_body[bodies[moves[bodies]]] == side).all()
