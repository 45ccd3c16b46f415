# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compiling begins with the scene: what a helper begins with is what the first step waits for."""
import json
import os
from pathlib import Path
import sys

import fresh
from kernels.caches import cache_without
import pytest

from rigid_sim_ros.kernels.helper_process import cores
from rigid_sim_ros.kernels.numba_target import SUPPORTED

TESTS = str(Path(__file__).parents[2])
# What a helper compiles for every world of the model.
HELPED = ['detect_part', 'predict_or_correct']
# Tells what is begun for which arguments, in place of beginning with it, and which a step has.
TOLD = """
import json
from rigid_sim_ros.engine.steps import precompile
begun = []
precompile.begin = lambda pieces, pack: begun.append(
    ([piece.__name__ for piece in pieces.helped], pack.type.name))
from rigid_sim_ros.world import World
for world in (World.from_dict(scene) for scene in {scenes}):
    world.step()
print(json.dumps([begun, world._contact._pack.type.name
                  if begun else type(world._contact).__name__]))
"""
BALL = {'name': 'ball', 'shape': {'type': 'sphere', 'radius': 0.1}, 'mass': 1.0}
OTHER = BALL | {'name': 'other', 'pose': {'position': [0, 0, 0.15]}}
GROUND = {'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True}
HINGE = {'name': 'hinge', 'type': 'revolute', 'parent': 'world', 'child': 'ball'}


def scene(contact, *bodies, **more):
    return {'format': 1, 'world': {'contact': contact}, 'bodies': bodies, **more}


HINGED = scene('timestep', BALL, GROUND, joints=[HINGE])


def told(*scenes):
    """Return what a process with these worlds has begun with, and what it needed."""
    done = fresh.run('-c', TOLD.format(scenes=repr(scenes)))
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize('one', [
    scene('timestep', BALL, OTHER),
    scene('timestep', BALL, GROUND, collision={'sleep_after': 1.0, 'substeps': 2},
          materials={'default': {'restitution': 0.5, 'rolling': 0.01}},
          forces=[{'type': 'spring', 'a': 'ball', 'anchor': [0, 0, 1], 'stiffness': 4,
                   'rest_length': 0.8}]),
], ids=['two balls', 'with all that is optional'])
def test_a_helper_begins_with_the_types_that_the_first_step_has(one):
    begun, needed = told(one, scene('timestep', BALL, OTHER))
    assert begun == [[HELPED, needed]]     # and once only


@pytest.mark.parametrize(('other', 'model'), [
    (scene('none', BALL, GROUND), 'FreeMotion'), (scene('timestep', BALL), 'Timestep')])
def test_nothing_is_begun_where_nothing_can_touch(other, model):
    assert told(other) == [[], model]


# Prints how many helpers a world has begun with, how many of them nobody has waited for; after a
# step how many there were, how they ended, and how often kernels were loaded.
HELPERS = """
from rigid_sim_ros.kernels import helper_process, separate
helper_process.PATIENCE = 900.0     # on a busy machine the helper hardly gets on
helper_process.__name__ = 'kernels.restoring_helper'    # what is started as the helper
started, start = [], helper_process.start
def counted(*arguments):
    started.append(start(*arguments))
    return started[-1]
helper_process.start = counted
from rigid_sim_ros.world import World
world = World.from_dict({scene})
begun = len(started), len(separate._begun)
world.step()
from rigid_sim_ros.engine.steps.{module} import {kernels}
print(*begun, len(started), len(separate._begun), started[0].process.returncode,
      *(sum(kernel.stats.cache_hits.values()) for kernel in ({kernels},)))
"""


@pytest.mark.skipif(not SUPPORTED or cores() < 2, reason='there is no helper')
@pytest.mark.parametrize(('one', 'module', 'kernels', 'begun'), [
    (scene('timestep', BALL, OTHER), 'timestep', HELPED, 1),
    (HINGED, 'jointed_contact', ['find_within'], 0)], ids=['two balls', 'with joints'])
def test_the_first_step_waits_for_the_one_helper(tmp_path, one, module, kernels, begun):
    full, lacking = tmp_path / 'full', tmp_path / 'lacking'
    cache_without(full)
    cache_without(lacking, kernels[-1])
    done = fresh.run(
        '-c', HELPERS.format(scene=repr(one), module=module, kernels=', '.join(kernels)),
        env=os.environ | {'NUMBA_CACHE_DIR': str(lacking), 'RESTORED_FROM': str(full),
                          'PYTHONPATH': os.pathsep.join([TESTS, *filter(None, sys.path)])})
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [str(begun), str(begun), '1', '0', '0', *['1'] * len(kernels)]
