# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Any moment of a session can be gone back to, and is what it was."""

from bag.sessions import record_all, rewrite, SCENE, session, shared_session, world
import pytest

from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.resume import find
from rigid_sim_ros.world import World


def at(bag, seconds: float) -> World:
    """Return a world that was brought to a moment of a bag."""
    moment = find(bag, seconds)
    other = World(moment.scene)
    moment.apply(other)
    return other


class Watched(Batch):
    """Keeps the hash of the state at each step, after all that the world was told then."""

    hashes: dict[int, int]

    def run(self, steps: int, progress=None) -> None:
        self.hashes = getattr(self, 'hashes', {})
        for _ in range(steps):
            self.hashes[self.world.step_index] = self.world.state_hash()
            super().run(1, progress)
            self.hashes[self.world.step_index] = self.world.state_hash()


@pytest.fixture(scope='module')
def watched(tmp_path_factory) -> tuple:
    """Give a session and the hashes of its states; the last that a step number had counts."""
    folder = tmp_path_factory.mktemp('watched')
    batch = Watched(world(), folder / 'session', segment_s=1.0)
    record_all(batch)
    batch.hashes[batch.world.step_index] = batch.world.state_hash()
    batch.close()
    return folder / 'session', batch.hashes


# Before, at and after inputs (313, 813, 1513), at a pause and a single step (600, 601), at a reset
# that keeps the time (1101), at the edges of files, and at the end.
@pytest.mark.parametrize('step', [
    0, 1, 312, 313, 314, 600, 601, 602, 813, 814, 999, 1000, 1001, 1101, 1102, 1513, 2000, 2001])
def test_a_moment_is_what_it_was(watched, step) -> None:
    bag, hashes = watched
    assert at(bag, step * 1e-3).state_hash() == hashes[step]


def test_a_wrench_keeps_the_time_that_it_has_left(tmp_path) -> None:
    batch = Batch(world(), tmp_path / 'bag')
    batch.run(100)
    batch.tell('apply_wrench', name='ball', force=(1.0, 0.0, 0.0), duration=0.5, source='push')
    batch.run(900)
    batch.close()
    other = at(tmp_path / 'bag', 0.4)
    assert other.wrench_sources == ['push']
    other.step(199)
    assert other.wrench_sources == ['push']
    other.step(1)
    assert other.wrench_sources == []
    other.step(400)
    assert other.state_hash() == batch.world.state_hash()


@pytest.mark.parametrize('seconds', [3.6, 1e9, 4e300])
def test_a_time_outside_is_refused_with_the_range(seconds) -> None:
    with pytest.raises(BagError, match=r'lies outside of .*, must be from 0 s to 2.001 s'):
        find(shared_session(), seconds)


def test_the_range_of_a_recording_that_begins_later_does_too(tmp_path) -> None:
    the_world = world()
    the_world.step(500)
    batch = Batch(the_world, tmp_path / 'bag')
    batch.run(100)
    batch.close()
    assert at(tmp_path / 'bag', 0.55).step_index == 550
    with pytest.raises(BagError, match=r'must be from 0\.5 s to 0\.6 s'):
        find(tmp_path / 'bag', 0.4)


def test_a_moment_in_a_gap_is_refused(tmp_path) -> None:
    # Without its states and events in the middle a gap stands for what happened.
    batch = Batch(world(), tmp_path / 'bag')
    batch.run(100)
    batch.recorder.event(100, 'gap', since_step=100, messages=3, events=2)
    batch.recorder.wants_snapshot = False
    batch.world.step(200)
    batch.recorder.snapshot(batch.world)
    batch.run(100)
    batch.close()
    assert at(tmp_path / 'bag', 0.05).step_index == 50
    assert at(tmp_path / 'bag', 0.35).step_index == 350
    with pytest.raises(BagError, match='lies in a gap'):
        find(tmp_path / 'bag', 0.2)


def test_a_damaged_bag_is_refused(tmp_path) -> None:
    bag = session(tmp_path)
    path = sorted(bag.glob('*.mcap'))[0]
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 2] ^= 1
    path.write_bytes(raw)
    with pytest.raises(BagError, match='rigid_sim recover'):
        find(bag, 0.5)


def test_a_bag_of_something_else_is_refused(tmp_path) -> None:
    bag = rewrite(shared_session(), tmp_path, lambda topic, data: (
        data if topic.kind == kinds.POSE else None))
    with pytest.raises(BagError, match='no recording of rigid_sim_ros'):
        find(bag, 0.5)


def test_a_moment_has_the_scene_and_the_parameters_of_its_session() -> None:
    moment = find(shared_session(), 0.5)
    assert moment.parameters['publish_rate'] == 100.0
    assert [body['name'] for body in SCENE['bodies']] == list(moment.scene.names)
