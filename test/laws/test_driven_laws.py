# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The laws of mechanics in a few random scenes of drives that start from rest.

`python benchmarks/laws.py --law driven-through --model event` asks many.
"""

from laws.book import breaches, DRIVEN
import pytest

# In some of these a fist flies past a loose body within its first step, and what bounced between
# two others goes on at once.
SEEDS = {('driven-through', 'timestep'): (0, 1, 10, 35, 79), ('driven-through', 'event'): (0, 179),
         ('driven-inelastic', 'event'): (0, 103, 190)}
# A world of qp has the solver of timestep, without its division into islands.
ASKED = [(law, model) for law in DRIVEN for model in DRIVEN[law].models if model != 'qp']


@pytest.mark.parametrize(('law', 'model'), ASKED)
def test_law_holds_in_random_scenes_of_drives_that_start_from_rest(law, model):
    assert not breaches(law, model, SEEDS.get((law, model), (0, 1))), DRIVEN[law].says
