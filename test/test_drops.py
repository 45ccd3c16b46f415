# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Every pair of shapes, dropped at random poses with every contact model.

The model `timestep` drops every pair 25 times, with `pytest --long` 100 times. The others take up
to a thousand times as long: they drop every pair of free bodies one to four times, and on fixed
bodies of the same kind only.
"""

from itertools import combinations_with_replacement, product
from typing import Any, NamedTuple

from dropping import Drops, SHAPES
from effort import either
import numpy as np
import pytest

pytestmark = pytest.mark.long
BATCH = 10  # steps between two looks
LOOKS = 5  # that a drop has to be slow, to be at rest


class Model(NamedTuple):
    """How a contact model drops a pair."""

    world: dict[str, Any]
    count: int  # of drops in a world
    duration: float  # [s], long enough to lie on the ground
    every_fixed: bool = False  # or those of the same kind only
    only_at_rest: bool = True  # or also count overlap while a body still topples or rolls


MODELS = {
    'timestep': Model({'contact': 'timestep'}, either(25, 100), 1.3, True, only_at_rest=False),
    # A ball of 14 kg sinks in by 0.7 mm.
    'penalty': Model({'contact': 'penalty', 'step': 4e-4,
                      'surface': {'stiffness': 4e5, 'damping': 2.0}}, 1, 1.0),
    'qp': Model({'contact': 'timestep', 'solver': 'qp', 'step': 2e-3}, 1, 0.6),
    'event': Model({'contact': 'event'}, either(2, 4), 1.0),
}
# None: on the ground alone.
CASES = [(model, *case) for model, how in MODELS.items() for case in (
    *((name, None, False) for name in SHAPES),
    *((*pair, False) for pair in combinations_with_replacement(SHAPES, 2)),
    *((*pair, True) for pair in product(SHAPES, SHAPES)
      if how.every_fixed or pair[0] == pair[1]))]


class Measures(NamedTuple):
    """What a world of drops went through."""

    momentum: float  # largest change of P in the air, relative to that of 1 m/s
    angular: float  # the same of L, relative to that of 0.1 m * 1 m/s
    energy: float  # largest gain, relative to the energy at the start
    overlap: float  # [m] the deepest in the last fifth of the time
    finite: bool  # all that the world says is a number


@pytest.fixture(scope='module', params=CASES,
                ids=lambda p: f'{p[0]}-{p[1]}-{"fixed " if p[3] else ""}{p[2] or "plane"}')
def measures(request) -> Measures:
    """Drop a pair and measure; the tests below share what comes of it."""
    model, first, second, fixed = request.param
    how = MODELS[model]
    drops = Drops(first, second, fixed, how.count, look=BATCH, **how.world)
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


def test_momentum_is_kept_between_contacts_with_the_ground(measures):
    assert measures.momentum < 1e-9


def test_angular_momentum_is_kept_between_contacts_with_the_ground(measures, request):
    if 'event' in request.node.name and 1e-9 <= measures.angular < 2e-7:
        pytest.xfail('event: pairs that displace an overlap may gain 1e-7 of their L')
    assert measures.angular < 1e-9


def test_nothing_lies_deeper_in_anything_than_2_mm(measures):
    assert measures.overlap < 2e-3


def test_contacts_without_bounce_give_no_energy(measures):
    # Rounding, but for `timestep`: what it pushes out of an overlap it lifts, by 0.3 mm at most of
    # the 0.3 m and more from which a drop starts.
    assert measures.energy < 1e-3


def test_every_number_is_finite(measures):
    assert measures.finite


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
