# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The laws of mechanics in a few random scenes with joints; `python benchmarks/laws.py` asks many.

A failure names law, model and seed: `python benchmarks/laws.py --law L --model M --seed S
--scenes 1` is the same scene again.
"""

from effort import either
from laws.book import breaches, JOINTED, scene
from laws.jointed_scenes import CARRIED, draw_jointed, FREE, HUNG
from laws.motion import Ours
from laws.scenes import with_model
from laws.twin_laws import scaled_by
import numpy as np
import pytest

from rigid_sim_ros import World

# Scenes a law. Twins run four worlds, and what touches takes ten times as long.
SEEDS = {'none': 6, 'timestep': 6, 'event': 4}
TWINS = {'none': either(2, 3), 'timestep': either(1, 2), 'event': either(1, 2)}
ALONE = ('jointed-energy', 'jointed-momentum', 'jointed-bridge')     # laws without twins
TOUCHES = 2     # a scene of `jointed-energy` in which something presses on something
# In these two bodies meet at another edge at the end of a step than at its start, and bounce.
MORE = {('jointed-mirrored', 'timestep'): {41}}


def seeds(law, model):
    """Return the seeds of a law and a model."""
    count = (SEEDS if law in ALONE else TWINS)[model]
    return sorted(set(range(count)) | MORE.get((law, model), set()))


@pytest.mark.long
@pytest.mark.parametrize('model', SEEDS)
@pytest.mark.parametrize('law', JOINTED)
def test_law_holds_in_random_scenes_with_joints(law, model):
    assert not breaches(law, model, seeds(law, model)), JOINTED[law].says


@pytest.mark.parametrize('factor', [4.0 ** -5, 4.0 ** 3])
@pytest.mark.parametrize('seed', [2, 9, 10, 14])
def test_articulations_of_a_fifth_of_a_millimetre_and_of_13_m_move_alike(seed, factor):
    found = draw_jointed(np.random.default_rng(seed), (FREE, HUNG, CARRIED))
    twin = scaled_by(found, factor)
    one, other = (Ours(with_model(spec, 'none')) for spec in (found.spec, twin.spec))
    for run in (one, other):
        run.step(200)
    # Rounding: levers are exact, and the sums of two-dimensional loops and of laws nearly so.
    # Joints that close to a length of their own leave 2e-10 to 6e-3.
    assert np.abs(twin.back(other.motion()) - one.motion()).max() < 1e-10


@pytest.mark.parametrize('law', ['jointed-energy', 'jointed-momentum'])
def test_these_scenes_have_what_they_are_to_show(law):
    """Of each kind of thing that joints may have there is some in the suite."""
    found = set()
    for seed in seeds(law, 'none'):
        for joint in scene(law, seed).spec['joints']:
            found |= {joint['type'], *joint}
            if 'world' in joint.values() or 'carrier' in joint.values():
                found.add('anchor')
    wanted = {'revolute', 'continuous', 'prismatic', 'spherical', 'universal',
              'planar', 'distance', 'fixed', 'mimic', 'friction', 'damping', 'armature',
              'spring', 'limits', 'drive'}
    assert wanted | ({'anchor'} if law == 'jointed-energy' else set()) <= found


def test_there_is_contact_in_one_of_them():
    assert TOUCHES in seeds('jointed-energy', 'timestep')
    world = World.from_dict(with_model(scene('jointed-energy', TOUCHES).spec, 'timestep'))
    world.step(300)
    assert (world.contacts()['normal_force'] > 0.0).any()


# The first has ten joints, and its steps are divided: it takes a hundred times as long as others.
@pytest.mark.parametrize('model', ['timestep', 'event'])
@pytest.mark.parametrize(('seed', 'steps'), [(0, 30), (3, 300), (TOUCHES, 300)])
def test_a_world_goes_on_bit_for_bit_from_what_it_saved(seed, steps, model):
    spec = with_model(scene('jointed-energy', seed).spec, model)
    one, other = (World.from_dict(spec) for _ in range(2))
    one.step(steps)
    saved = one.save()
    one.step(steps // 3)
    other.restore(saved)
    for _ in range(steps // 3):
        other.step(1)
    assert one.state_hash() == other.state_hash()


def test_two_halves_that_a_fixed_joint_holds_slide_as_one_body():
    """With v = 2 m/s and mu = 0.4 it stops after v^2 / (2 mu g)."""
    half = {'mass': 1.0, 'shape': {'type': 'box', 'size': [0.2, 0.2, 0.1]},
            'twist': {'linear': [2.0, 0.0, 0.0]}}
    world = World.from_dict({
        'world': {'step': 0.001}, 'materials': {'default': {'friction': 0.4}},
        'bodies': [{'name': 'floor', 'fixed': True, 'shape': {'type': 'plane'}},
                   half | {'name': 'left', 'pose': {'position': [0.0, 0.0, 0.05]}},
                   half | {'name': 'right', 'pose': {'position': [0.2, 0.0, 0.05]}}],
        'joints': [{'name': 'seam', 'type': 'fixed', 'parent': 'left', 'child': 'right'}]})
    world.step(1000)
    # Kick, drift, kick is exact but for the step in which it stops: v h / 2 there at most.
    at = world.position[world.names.index('left')]
    assert abs(at[0] - 2.0 ** 2 / (2.0 * 0.4 * 9.81)) < 2e-6
    assert abs(at[2] - 0.05) < 1e-8
    assert np.abs(world.linear_velocity).max() < 1e-9


@pytest.mark.parametrize('contact', ['timestep', 'event'])
def test_what_passes_a_body_without_touching_it_feels_nothing(contact):
    """A cube with a tail flies past a post at a distance of 1 mm, 3 mm in each step."""
    cube = {'type': 'box', 'size': [0.03, 0.03, 0.03]}
    flies = {'twist': {'linear': [3.0, 0.0, 0.0]}}
    world = World.from_dict({
        'world': {'contact': contact, 'gravity': [0.0, 0.0, 0.0]},
        'bodies': [{'name': 'post', 'fixed': True, 'shape': {'type': 'box',
                                                             'size': [0.2, 0.2, 0.3]}},
                   {'name': 'cube', 'mass': 1.0, 'shape': cube,
                    'pose': {'position': [-0.3, 0.116, 0.0]}} | flies,
                   {'name': 'tail', 'mass': 0.1, 'shape': {'type': 'sphere', 'radius': 0.01},
                    'pose': {'position': [-0.4, 0.3, 0.0]}} | flies],
        'joints': [{'name': 'hinge', 'type': 'revolute', 'parent': 'cube', 'child': 'tail'}]})
    world.step(200)
    # Joints close to 1e-13 m in each step of 1 ms, which is 1e-10 m/s.
    assert world.position[1, 0] == pytest.approx(0.3, abs=1e-9)
    assert np.abs(world.linear_velocity[1:] - [3.0, 0.0, 0.0]).max() < 1e-9
    assert np.abs(world.angular_velocity[1:]).max() < 1e-8
