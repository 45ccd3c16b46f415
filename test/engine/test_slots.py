# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which bodies get a slot, and where a world is cut."""

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

from rigid_sim_ros.engine.manifolds import empty_pages
from rigid_sim_ros.engine.slots import (
    _BINS, _OF_FIRST, choose_cut, ENOUGH, FIRST, give_slots, make_sides, SECOND, STILL)
from rigid_sim_ros.engine.solver_bodies import make_bodies

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


@settings(max_examples=60)
@given(seed=st.integers(0, 2 ** 32 - 1), count=st.integers(0, 2 * ENOUGH), first=st.integers(0, 9),
       axis=st.integers(0, 2), place=st.sampled_from([0.0, 1e5]))
def test_a_world_is_cut_about_in_the_middle_of_its_manifolds(seed, count, first, axis, place):
    rng = np.random.default_rng(seed)
    spread = np.array([1.0, 1.0, 1.0])
    spread[axis] = 3.0
    x = (place + spread * rng.normal(size=(BODIES, 3))).T.copy()
    inv_m = rng.integers(2, size=BODIES).astype(float)
    asleep = (rng.random(BODIES) < 0.2).astype(np.int64)
    pairs, sides = some_pairs(rng, count), make_sides(BODIES)
    choose_cut(inv_m, x, asleep, manifolds_of(pairs, first), sides)
    assert sides.halved[0] == (1 if count >= ENOUGH else 0)
    if count < ENOUGH:
        return
    assert sides.axis[0] == axis
    # Each manifold counts where one of its bodies is, but for those that do not move.
    body = np.where(inv_m[pairs[:, 1]] > 0.0, pairs[:, 1], pairs[:, 0])
    body = body[(inv_m[body] > 0.0) & (asleep[body] == 0)]
    width = 4.0 * x[axis, np.unique(body)].std() / _BINS
    # Squares about a body some spreads away cancel, and lose a few of 16 digits.
    least = 1e-9 * width + 1e-15 * abs(place)
    beyond = 1.0 - 0.01 * _OF_FIRST
    assert np.mean(x[axis, body] > sides.end[0] + least) <= beyond + 1e-12
    assert np.mean(x[axis, body] > sides.end[0] - width - least) >= beyond - 1e-12


@pytest.mark.parametrize('axis', [0, 1, 2])
@pytest.mark.parametrize('numbered', [True, False])
def test_the_cut_has_the_numbers_of_either_half_on_a_side(axis, numbered):
    # As wide along the next axis as along this one, or a little wider.
    rng, other = np.random.default_rng(7 + axis), (axis + 1) % 3
    x = rng.uniform(-1.0, 1.0, size=(3, BODIES))
    x[other] *= 1.2
    x[(axis + 2) % 3] *= 0.5
    if numbered:
        x = x[:, np.argsort(x[axis], kind='stable')]
    sides = make_sides(BODIES)
    choose_cut(np.ones(BODIES), x, np.zeros(BODIES, dtype=np.int64),
               manifolds_of(some_pairs(rng, 2 * ENOUGH)), sides)
    assert sides.axis[0] == (axis if numbered else other)
    # Where half of the manifolds are, 4 % more or fewer of 200 bodies may be: sqrt(1 / 200) / 2;
    # and two more by intent.
    if numbered:
        first = x[axis] <= sides.end[0]
        assert np.mean(first[:BODIES // 2]) > 0.9
        assert np.mean(first[BODIES // 2:]) < 0.1


@settings(max_examples=60)
@given(seed=st.integers(0, 2 ** 32 - 1), count=st.integers(0, 300), halved=st.booleans())
def test_slots_are_in_order_of_sides_and_bodies(seed, count, halved):
    rng = np.random.default_rng(seed)
    x, inv_m = rng.normal(size=(3, BODIES)), rng.integers(2, size=BODIES).astype(float)
    asleep = (rng.random(BODIES) < 0.2).astype(np.int64)
    waits = (rng.random(count + 1) < 0.2).astype(np.int64)
    pairs, sides, bodies = some_pairs(rng, count), make_sides(BODIES), make_bodies(BODIES)
    sides.halved[0], sides.axis[0], sides.end[0] = halved, 1, 0.1
    # What an earlier step left.
    bodies.slot[:], bodies.body[:] = 7, 7
    give_slots(inv_m, x, manifolds_of(pairs), waits, asleep, sides, bodies)
    moves = (inv_m > 0.0) & (asleep == 0)
    touches = moves & np.isin(np.arange(BODIES), pairs[waits[:count] == 0])
    beyond = touches & halved & (x[1] > 0.1)
    one, other = np.flatnonzero(touches & ~beyond), np.flatnonzero(beyond)
    assert np.array_equal(sides.of_body, np.where(beyond, SECOND, np.where(touches, FIRST, STILL)))
    used = [-1, *one, *([-1, *other] if halved else [])]
    assert bodies.body[:len(used)].tolist() == used
    assert bodies.used.tolist() == [len(used), np.count_nonzero(moves & ~touches), 1 + len(one)]
    assert (bodies.slot[~touches] == 0).all()
    assert np.array_equal(bodies.body[bodies.slot[touches]], np.flatnonzero(touches))
