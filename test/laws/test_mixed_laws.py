# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The laws of mechanics in a few random scenes of articulations among loose bodies.

`python benchmarks/laws.py` asks many; `--law mixed-ground --model event --seed S --scenes 1` is
one of these again.
"""

from effort import either
from laws.book import breaches, builder, judge, MIXED, scene
from laws.mixed_laws import judge_ground
from laws.motion import Ours
from laws.scenes import with_model
import pytest

# Scenes of a law that looks at one world, and of one that compares four.
SCENES = {'timestep': either(2, 3), 'event': either(1, 2)}
TWINS = {'timestep': either(1, 2), 'event': 1}
# In these something falls on what sleeps, what is coupled meets its limits, what is carried along
# is fast and light, and light feet meet the floor on ways that are far from straight.
MORE = {'mixed-asleep': {7, 12, 13}, 'mixed-momentum': {11, 15}, 'mixed-carried': {38, 42},
        'mixed-standing': {66}}
IS_TWIN = ('turned', 'shifted', 'mirrored', 'scaled', 'order', 'carried', 'split')
ASKED = [(law, model) for law in MIXED for model in SCENES if model in MIXED[law].models]


def seeds(law, model):
    """Return the seeds of a law and a model."""
    counts = TWINS if law.removeprefix('mixed-') in IS_TWIN else SCENES
    return sorted(set(range(counts[model])) | MORE.get(law, set()))


@pytest.mark.long
@pytest.mark.parametrize(('law', 'model'), ASKED)
def test_law_holds_in_random_scenes_of_articulations_among_loose_bodies(law, model):
    assert not breaches(law, model, seeds(law, model)), MIXED[law].says


def test_these_scenes_have_what_they_are_to_show():
    """Loose bodies touch those of joints, the floor and each other; springs pull."""
    found = set()
    for seed in range(6):
        drawn = scene('mixed-energy', seed)
        spec, loose = drawn.spec, drawn.facts['loose']
        world = Ours(with_model(spec, 'timestep')).world
        moves = {one['name'] for one in spec['bodies'] if 'inertial' in one}
        found |= {force['type'] for force in spec.get('forces', ())}
        for _ in range(0, drawn.steps, 10):
            world.step(10)
            rows = world.contacts()
            for row in rows[rows['normal_force'] > 0.0]:
                pair = {world.names[row[end]] for end in ('body_a', 'body_b')}
                found.add((len(pair & set(loose)), len(pair & moves)))
    # Of the two bodies of a contact so many are loose, and so many can be pushed.
    assert {'spring', (1, 2), (1, 1), (2, 2), (0, 1)} <= found


def test_in_these_scenes_bodies_fall_asleep_and_are_woken():
    slept, woken = 0, 0
    for seed in seeds('mixed-asleep', 'timestep'):
        drawn, before = scene('mixed-asleep', seed), 0
        world = Ours(with_model(drawn.spec, 'timestep')).world
        for _ in range(0, drawn.steps, 4):
            world.step(4)
            now = world.contact_report().asleep
            slept, woken, before = slept + (now > before), woken + (now < before), now
    assert slept > 3 and woken > 1


@pytest.mark.parametrize(('model', 'seed'), [('timestep', 12), ('timestep', 23), ('event', 13)])
def test_what_bounced_in_a_part_of_a_step_is_among_its_contacts(model, seed):
    """In these the steps are taken in parts, and points of contact come and go between them."""
    verdict = judge_ground(scene('mixed-ground', seed), builder(model))
    assert not verdict.breach, f'{verdict.figure:.3g} > {verdict.allowed:.3g} {verdict.what}'


@pytest.mark.parametrize(('model', 'seed'), [('timestep', 2), ('timestep', 17), ('event', 2)])
def test_how_a_body_is_divided_does_not_change_what_a_step_does(model, seed):
    """In these a half is pushed out of what it overlaps, or a step is taken in parts or not."""
    verdict = judge('mixed-split', seed, builder(model))
    assert not verdict.breach, f'{verdict.figure:.3g} > {verdict.allowed:.3g} {verdict.what}'
