# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a kinematic body is told is recorded, and comes out again from any moment on."""

from pathlib import Path

from bag.sessions import events_of
from carrying import crate, floor, REST, UPRIGHT, world_of
import pytest

from rigid_sim_ros.bag import events
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.resume import find
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.world import World


def record(folder: Path, kind: str) -> tuple[Path, World]:
    """Record a crate on a belt that gets a twist, and poses at various intervals."""
    world = world_of('timestep', floor(**{kind: True}), crate())
    batch = Batch(world, folder / 'bag', segment_s=0.1, hash_interval=10)
    batch.run(50)
    if kind == 'kinematic':
        batch.tell('set_twist', name='floor', linear=(0.3, 0.0, 0.0), angular=(0.0, 0.0, 0.1))
        batch.run(100)
        batch.tell('set_twist', name='floor', linear=REST, angular=REST)
    x, y, z = world.position[0]
    q = world.orientation[0]
    for k in range(60):
        batch.tell('set_pose', name='floor', position=(x + 1e-3 * k, y, z + 5e-4 * k),
                   orientation=q)
        batch.run(1 if k < 40 else 5)
    batch.tell('set_pose', name='floor', position=(50.0, 0.0, -0.5), orientation=UPRIGHT)
    batch.run(50)
    batch.close()
    return folder / 'bag', world


@pytest.mark.parametrize('kind', ['kinematic', 'fixed'])
def test_a_session_of_moved_bodies_comes_out_again(tmp_path, kind):
    bag, _ = record(tmp_path, kind)
    verdict = verify(bag)
    assert (verdict.difference, verdict.faults) == (None, ())
    assert verdict.steps == 50 + (100 if kind == 'kinematic' else 0) + 40 + 100 + 50
    told = [event.kind for event in events_of(bag)]
    assert told.count('set_pose') == 61
    assert told.count('set_twist') == (2 if kind == 'kinematic' else 0)


# Amid the twist, amid the poses of every step, and amid a way of five steps.
@pytest.mark.parametrize('seconds', [0.1, 0.17, 0.223])
def test_a_session_goes_on_from_amid_a_motion_to_the_same_end(tmp_path, seconds):
    bag, _ = record(tmp_path, 'kinematic')
    moment = find(bag, seconds)
    again = World(moment.scene)
    moment.apply(again)
    assert again.linear_velocity[0].any()
    for event in events_of(bag):
        if event.step > moment.step:
            again.step(event.step - again.step_index)
            events.apply(event, again)
    assert (event.kind, event.arguments['state_hash']) == (events.END, again.state_hash())
