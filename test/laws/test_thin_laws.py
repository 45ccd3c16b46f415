# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The laws of mechanics for thin bodies: needles, plates, discs, splinters and frames.

`python benchmarks/laws.py --law thin-energy --model timestep --seed S --scenes 1` is one of these
again.
"""

from laws.book import breaches, THIN
import pytest

SCENES = {'timestep': 8, 'event': 3}
# Scenes that are known to break a law, or that take minutes.
KNOWN: dict[tuple[str, str], set[int]] = {('thin-turned', 'event'): {2}}
ASKED = [(law, model) for law in THIN for model in SCENES if model in THIN[law].models]


# What gravity alone takes through the ground in a step, what turned through it to get rid of
# energy, and a needle that was stopped and did not collide.
THROUGH = 36, 91, 32


@pytest.mark.parametrize(('law', 'model'), ASKED)
def test_law_holds_for_thin_bodies(law, model):
    seeds = set(range(SCENES[model])) - KNOWN.get((law, model), set())
    assert not breaches(law, model, seeds), THIN[law].says


@pytest.mark.parametrize('seed', THROUGH)
def test_what_once_got_through_the_ground_does_not(seed):
    assert not breaches('thin-through', 'timestep', [seed])


# In `event`, disks whose rim wobbled sank through a mesh: four points in one plane were to bear
# what touched beside them, or were themselves only about to touch.
@pytest.mark.parametrize('seed', [3, 16])
def test_a_disk_that_wobbles_does_not_get_through_a_mesh(seed):
    assert not breaches('thin-through', 'event', [seed])


# In `event`, columns toppled off a needle under a disk as long as it, of which the points that
# were kept bore half of the width; and a needle under a million times its weight tilted, and was
# squeezed out, by what its points yielded: that counts against its thickness, not its length.
@pytest.mark.parametrize('seed', [1052, 1060, 1092])
def test_a_column_on_a_needle_stands(seed):
    assert not breaches('thin-weight', 'event', [seed])
