# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A copy of a world goes on by itself, also in another process."""
import copy
from pathlib import Path
import pickle
from tempfile import TemporaryDirectory

import fresh
import numpy as np
import pytest

from rigid_sim_ros import World

BALL = {'shape': {'type': 'sphere', 'radius': 0.1}, 'mass': 1.0}
WORLDS = {
    'touching': {'format': 1, 'bodies': [
        *(BALL | {'name': f'b{k}', 'pose': {'position': [0.01 * k, 0, 0.1 + 0.199 * k]}}
          for k in range(3)), {'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True}]},
    'jointed': {'format': 1, 'world': {'contact': 'none'}, 'bodies': [
        BALL | {'name': 'bob', 'pose': {'position': [1, 0, 0]}}], 'joints': [
        {'name': 'pin', 'type': 'revolute', 'parent': 'world', 'child': 'bob', 'axis': [0, 1, 0],
         'damping': 0.1}]},
    'free': {'format': 1, 'world': {'contact': 'none'}, 'bodies': [
        BALL | {'name': 'b', 'twist': {'angular': [1, 2, 3]}}]},
}
ELSEWHERE = """
import pickle
import sys
from pathlib import Path
given, found = map(Path, sys.argv[1:])
world = pickle.loads(given.read_bytes())
world.step(20)
found.write_bytes(pickle.dumps((world.state_hash(), world.position)))
"""


def elsewhere(world):
    """Return the hash and the positions after 20 more steps in another process."""
    with TemporaryDirectory() as folder:
        given, found = Path(folder, 'given'), Path(folder, 'found')
        given.write_bytes(pickle.dumps(world))
        done = fresh.run('-c', ELSEWHERE, str(given), str(found))
        assert (done.returncode, done.stderr) == (0, '')
        return pickle.loads(found.read_bytes())


def here(twin):
    """Return a function that takes 20 more steps with a copy that is made in this process."""
    def found(world):
        other = twin(world)
        other.step(20)
        return other.state_hash(), other.position
    return found


@pytest.mark.parametrize('scene', WORLDS.values(), ids=WORLDS)
def test_what_is_pickled_holds_no_kernel_that_another_process_would_compile(scene):
    world = World.from_dict(scene)
    world.step(10)
    assert b'numba' not in pickle.dumps(world)


@pytest.mark.parametrize('scene', WORLDS.values(), ids=WORLDS)
@pytest.mark.parametrize('go_on', [
    here(copy.deepcopy), here(lambda world: pickle.loads(pickle.dumps(world))), elsewhere,
], ids=['deepcopy', 'pickle', 'another process'])
def test_a_copy_goes_on_as_the_world_does_and_leaves_it_alone(scene, go_on):
    world = World.from_dict(scene)
    world.step(10)
    world.apply_wrench(world.names[0], force=(0.1, 0.0, 0.0), duration=0.01)
    before = world.state_hash(), world.position
    mark, position = go_on(world)
    assert (world.state_hash(), world.position.tobytes()) == (before[0], before[1].tobytes())
    world.step(20)
    assert mark == world.state_hash() != before[0]
    np.testing.assert_array_equal(position, world.position)
