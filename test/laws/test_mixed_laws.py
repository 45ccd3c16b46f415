# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The laws of mechanics in a few random scenes of articulations among loose bodies.

`python benchmarks/laws.py` asks many; `--law mixed-ground --model event --seed S --scenes 1` is
one of these again.
"""

from laws.book import builder, judge, MIXED, scene
from laws.mixed_laws import judge_ground
from laws.motion import Ours
from laws.scenes import with_model
import pytest

# Scenes of a law that looks at one world, and of one that compares four.
SCENES, TWINS = {'timestep': 5, 'event': 2}, {'timestep': 2, 'event': 1}
# In this one sleepers hang in the air where nothing wakes them.
MORE = {'mixed-asleep': {13}}
IS_TWIN = ('turned', 'shifted', 'mirrored', 'scaled', 'order', 'carried', 'split')
# Scenes that are known to break a law; docs/joints.md tells how many of a hundred do.
KNOWN: dict[tuple[str, str], set[int]] = {}
ASKED = [(law, model) for law in MIXED for model in SCENES if model in MIXED[law].models]


def seeds(law, model):
    """Return the seeds of a law and a model."""
    counts = TWINS if law.removeprefix('mixed-') in IS_TWIN else SCENES
    return sorted((set(range(counts[model])) | MORE.get(law, set()))
                  - KNOWN.get((law, model), set()))


@pytest.mark.parametrize(('law', 'model'), ASKED)
def test_law_holds_in_random_scenes_of_articulations_among_loose_bodies(law, model):
    broken = {}
    for seed in seeds(law, model):
        verdict = judge(law, seed, builder(model))
        if verdict.breach:
            broken[seed] = f'{verdict.figure:.3g} > {verdict.allowed:.3g} {verdict.what}'
    assert not broken, MIXED[law].says


def test_these_scenes_have_what_they_are_to_show():
    """Loose bodies touch joints' bodies, the floor and each other, some sleep, springs pull."""
    found = set()
    for seed in range(12):
        drawn = scene('mixed-energy', seed)
        spec, loose = drawn.spec, drawn.facts['loose']
        world = Ours(with_model(spec, 'timestep')).world
        found |= {force['type'] for force in spec.get('forces', ())}
        for _ in range(0, drawn.steps, 10):
            world.step(10)
            if world.contact_report().asleep:
                found.add('asleep')
            for row in world.contacts():
                if row['normal_force'] > 0.0:
                    pair = [world.names[row[end]] in loose for end in ('body_a', 'body_b')]
                    kinds = {one['name']: 'mass' if 'inertial' in one else 'floor'
                             for one in spec['bodies']}
                    moves = [kinds[world.names[row[end]]] == 'mass'
                             for end in ('body_a', 'body_b')]
                    found.add((sum(pair), sum(moves)))
    # Of the two bodies of a contact so many are loose, and so many can be pushed.
    assert {'spring', 'asleep', (1, 2), (1, 1), (2, 2), (0, 1)} <= found


@pytest.mark.parametrize('seed', [0, 4, 12, 14])
def test_what_bounced_in_a_part_of_a_step_is_among_its_contacts(seed):
    """In these the steps are taken in parts, and points of contact come and go between them."""
    verdict = judge_ground(scene('mixed-ground', seed), builder('timestep'))
    assert not verdict.breach, f'{verdict.figure:.3g} > {verdict.allowed:.3g} {verdict.what}'
