# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Every pair of shapes, dropped at random poses with every contact model.

The model `timestep` drops every pair 4 times, with `pytest --long` 100 times. The others take up
to a thousand times as long: they drop every pair of free bodies one to four times, and on fixed
bodies of the same kind only.
"""

from itertools import product
from typing import Any, NamedTuple

from dropping import Drops, SHAPES
from effort import either
import numpy as np
import pytest

pytestmark = pytest.mark.long
BATCH = 20  # steps between two looks
LOOKS = 3  # that a drop has to be slow, to be at rest


class Model(NamedTuple):
    """How a contact model drops a pair."""

    world: dict[str, Any]
    count: int  # of drops in a world
    duration: float  # [s], long enough to lie on the ground
    every_fixed: bool = False  # or those of the same kind only
    only_at_rest: bool = True  # or also count overlap while a body still topples or rolls


MODELS = {
    'timestep': Model({'contact': 'timestep'}, either(4, 100), 1.3, True, only_at_rest=False),
    # A ball of 14 kg sinks in by 0.7 mm.
    'penalty': Model({'contact': 'penalty', 'step': 4e-4,
                      'surface': {'stiffness': 4e5, 'damping': 2.0}}, 1, 1.0),
    'qp': Model({'contact': 'timestep', 'solver': 'qp', 'step': 2e-3}, 1, 0.6),
    'event': Model({'contact': 'event'}, either(1, 4), 1.0),
}


class Pair(NamedTuple):
    """What is dropped on what."""

    second: str | None  # None: on the ground alone
    is_fixed: bool = False


def pairs(model: str, first: str) -> list[Pair]:
    """Return what a shape is dropped with: each other one once, in the air, or fixed below it."""
    names = list(SHAPES)
    return [Pair(None), *(Pair(name) for name in names[names.index(first):]), *(
        Pair(name, is_fixed=True) for name in names if MODELS[model].every_fixed or name == first)]


class Measures(NamedTuple):
    """What a world of drops went through."""

    momentum: float  # largest change of P in the air, relative to that of 1 m/s
    angular: float  # the same of L, relative to that of 0.1 m * 1 m/s
    energy: float  # largest gain, relative to the energy at the start
    overlap: float  # [m] the deepest in the last fifth of the time
    finite: bool  # all that the world says is a number


def measure(model: str, first: str, pair: Pair) -> Measures:
    """Drop a pair and measure."""
    how = MODELS[model]
    drops = Drops(first, pair.second, pair.is_fixed, how.count, look=BATCH, **how.world)
    start, batches = drops.energy(), round(how.duration / (BATCH * drops.h))
    energy, overlap, momentum = 0.0, 0.0, np.zeros(2)
    finite, slow = True, np.zeros(how.count)
    for k in range(1, batches + 1):
        momentum = np.maximum(momentum, drops.change_of_momentum())
        energy = max(energy, float((drops.energy() / start - 1.0).max()))
        slow = (slow + 1) * drops.slow()
        if k > 0.8 * batches and k % LOOKS == 0:
            resting = slow >= (LOOKS if how.only_at_rest else 0)
            overlap = max(overlap, drops.overlap(1e-3)[resting].max(initial=0.0))
            finite = finite and all(np.isfinite(drops.world.contacts()[field]).all()
                                    for field in ('gap', 'normal_force', 'friction_force'))
    return Measures(float(momentum[0]), float(momentum[1]), energy,
                    float(overlap), finite)


class Dropped(NamedTuple):
    """What came of the drops of a shape."""

    model: str
    of: dict[Pair, Measures]

    def above(self, what: str, most: float) -> dict[Pair, float]:
        """Return the pairs of which a measure is not below its limit."""
        return {pair: found for pair, measures in self.of.items()
                if not (found := getattr(measures, what)) < most}


@pytest.fixture(scope='module', params=list(product(MODELS, SHAPES)), ids='-'.join)
def dropped(request) -> Dropped:
    """Drop a shape with each other one and measure; the tests below share what comes of it."""
    model, first = request.param
    return Dropped(model, {pair: measure(model, first, pair) for pair in pairs(model, first)})


def test_momentum_is_kept_between_contacts_with_the_ground(dropped):
    assert dropped.above('momentum', 1e-9) == {}


def test_angular_momentum_is_kept_between_contacts_with_the_ground(dropped):
    # In `event` a pair that displaces an overlap may gain 1e-7 of its L.
    assert dropped.above('angular', 2e-7 if dropped.model == 'event' else 1e-9) == {}


def test_nothing_lies_deeper_in_anything_than_2_mm(dropped):
    assert dropped.above('overlap', 2e-3) == {}


def test_contacts_without_bounce_give_no_energy(dropped):
    # Rounding, but for `timestep`: what it pushes out of an overlap it lifts, by 0.3 mm at most of
    # the 0.3 m and more from which a drop starts.
    assert dropped.above('energy', 1e-3) == {}


def test_every_number_is_finite(dropped):
    assert all(measures.finite for measures in dropped.of.values())


def test_a_strong_damper_does_not_throw_fast_bodies_back():
    # At 3 m/s it would be stronger, by far, than what stops a point in a step.
    drops = Drops('mesh', 'mesh', False, 9, contact='penalty', step=2.5e-4, density=200,
                  surface={'stiffness': 2e5, 'damping': 20.0})
    energy = start = drops.energy()
    while drops.world.step_index < 3000:
        drops.world.step(BATCH)
        before, energy = energy, drops.energy()
        # The springs give back a little of what they took just before.
        assert (energy - before < 0.01 * start).all()
        assert (energy < (1.0 + 1e-6) * start).all()
    assert (energy < 0.2 * start).all()
