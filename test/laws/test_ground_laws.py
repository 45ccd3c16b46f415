# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The laws of mechanics on a few random grounds of triangles.

`python benchmarks/laws.py` asks many; `--law ground-shots --model event --seed S --scenes 1` is
one of these again.
"""

from effort import either
from laws.book import breaches, builder, GROUNDS, scene
import numpy as np
import pytest

SCENES = {'timestep': either(3, 4), 'event': either(2, 3)}
TWINS = {'timestep': either(1, 2), 'event': either(1, 2)}
# In these, bodies went through sheets: after 300 events in a step; in `timestep` where an impact
# turned them or threw them farther than their pairs were sought.
MORE = {('ground-shots', 'event'): {1, 9, 13, 16}, ('ground-through', 'timestep'): {26},
        ('ground-shots', 'timestep'): {6, 16, 20, 26, 31}, ('ground-turned', 'event'): {2},
        # Edges of slivers, and of what lies just above the floor, were walls.
        ('ground-plane', 'timestep'): {150, 167}}
# A scene that is known to break a law: a heap of more manifolds than are solved directly, of which
# sweeps leave 1e-6 of the speeds that depends on their order; in `event` 300 collisions in a step.
KNOWN = {**{('ground-mirrored', model): {0} for model in SCENES},
         ('ground-turned', 'event'): {0}, ('ground-order', 'event'): {0}}
IS_TWIN = ('turned', 'shifted', 'mirrored', 'scaled', 'order')
ASKED = [(law, model) for law in GROUNDS for model in SCENES if model in GROUNDS[law].models]


def seeds(law, model):
    """Return the seeds of a law and a model."""
    counts = TWINS if law.removeprefix('ground-') in IS_TWIN else SCENES
    known = KNOWN.get((law, model), set())
    return sorted((set(range(counts[model] + len(known))) | MORE.get((law, model), set())) - known)


@pytest.mark.long
@pytest.mark.parametrize(('law', 'model'), ASKED)
def test_law_holds_on_random_grounds_of_triangles(law, model):
    assert not breaches(law, model, seeds(law, model)), GROUNDS[law].says


@pytest.mark.parametrize('seed', [42, 113, 150, 167])
def test_what_slides_over_triangles_does_not_trip(seed):
    """
    It keeps its speed: nothing rubs.

    Up to what its wobbling takes: cylinders that stand come down on the points of some hundred
    triangles, each of which bears its part with the error of the sweeps. An edge takes all of it.
    """
    drawn = scene('ground-plane', seed)
    run = builder('timestep')(drawn.spec)
    before = run.motion()[0, 7:9]
    run.step(drawn.steps)
    assert np.abs(run.motion()[0, 7:9] - before).max() < 1e-3 * np.abs(before).max()


def test_these_grounds_are_of_every_kind():
    """Heightfields, meshes, flat, sloping, rough, cells of small and large sizes, slivers."""
    found = set()
    for seed in range(20):
        drawn = scene('ground-energy', seed)
        ground = drawn.facts['ground']
        edges = ground.vertices[ground.faces] - ground.vertices[ground.faces][:, [1, 2, 0]]
        edges = (edges[..., :2] ** 2).sum(axis=2) ** 0.5 / drawn.size
        found.add(ground.shape['type'])
        found.add('rough' if not ground.slope.any() and ground.vertices[:, 2].any() else
                  'slope' if ground.slope.any() else 'flat')
        found |= {'sliver'} if (edges.max(axis=1) > 20.0 * edges.min(axis=1)).any() else set()
        found |= {'fine'} if edges.mean() < 0.6 else {'coarse'} if edges.mean() > 3.0 else set()
    assert found == {'heightfield', 'mesh', 'rough', 'slope', 'flat', 'sliver', 'fine', 'coarse'}
