# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A session comes out again to the bit, and nothing that was changed gets through."""

from bag.sessions import (
    messages_of, rewrite, session, shared_session, world, wrench_session)
import pytest

from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.verify import verify


@pytest.mark.parametrize('storage, compression', [
    ('mcap', 'none'), ('mcap', 'zstd'), ('sqlite3', 'none'), ('sqlite3', 'zstd')])
def test_a_session_of_everything_comes_out_again(storage, compression) -> None:
    verdict = verify(shared_session(storage, compression))
    assert (verdict.difference, verdict.faults, verdict.gaps, verdict.note) == (None, (), 0, '')
    assert verdict.steps == 313 + 500 + 700 + 600 + 1 + 500 + 900


def test_a_recording_that_begins_later_comes_out_again(tmp_path) -> None:
    the_world = world()
    the_world.step(777)
    the_world.apply_wrench('ball', (1, 0, 0), duration=1.0)
    batch = Batch(the_world, tmp_path / 'bag')
    batch.run(500)
    batch.close()
    verdict = verify(tmp_path / 'bag')
    assert verdict.holds
    assert verdict.steps == 500


# Every byte of the numbers would do; these are the first, one in the middle, and the last.
@pytest.mark.parametrize('kind, body', [
    (kinds.POSE, 'crate'), (kinds.POSE, 'ball'), (kinds.TWIST, 'crate'), (kinds.TWIST, 'ball'),
    (kinds.STATE, None), (kinds.STATE_HASH, ''), (kinds.CLOCK, '')])
@pytest.mark.parametrize('offset', [-1, -8, -4])
def test_one_changed_byte_is_found_with_step_and_body(tmp_path, kind, body, offset) -> None:
    seen = []

    def change(topic, data):
        if topic.kind == kind and topic.body in (body, ''):
            seen.append(data)
            if len(seen) == 3:
                spoiled = bytearray(data)
                spoiled[len(data) + (offset if kind != kinds.STATE else offset - 8)] ^= 1
                return bytes(spoiled)
        return data
    verdict = verify(rewrite(shared_session(), tmp_path, change))
    assert not verdict.holds
    # The third publication: at 100 Hz step 20; hashes come every 250 steps.
    assert verdict.difference.step == (500 if kind == kinds.STATE_HASH else 20)
    if body:
        assert verdict.difference.body == body
        assert ' by ' in verdict.difference.text


@pytest.mark.parametrize('kind, offset', [(kinds.APPLIED_WRENCH, -48), (kinds.APPLIED_WRENCH, -1)])
def test_one_changed_byte_of_a_wrench_is_found(tmp_path, kind, offset) -> None:
    def change(topic, data):
        if topic.kind == kind:
            spoiled = bytearray(data)
            spoiled[offset] ^= 1
            return bytes(spoiled)
        return data
    bag = wrench_session(tmp_path)
    assert verify(bag).holds
    verdict = verify(rewrite(bag, tmp_path, change))
    assert not verdict.holds
    assert (verdict.difference.step, verdict.difference.body) == (5, 'crate')


def test_a_changed_digit_of_an_input_is_found_though_it_moves_nothing(tmp_path) -> None:
    def change(topic, data):
        # The cancelled source acts on nothing any more; still, it is not what was recorded.
        return data.replace(b'"source": "wind"', b'"source": "wund"') if (
            topic.kind == kinds.EVENT and b'cancel' in data) else data
    verdict = verify(rewrite(shared_session(), tmp_path, change))
    assert not verdict.holds
    assert 'changed after it was recorded' in verdict.difference.text


def test_a_missing_input_is_found(tmp_path) -> None:
    verdict = verify(rewrite(shared_session(), tmp_path, lambda topic, data: (
        None if topic.kind == kinds.EVENT and b'cancel' in data else data)))
    assert not verdict.holds
    assert 'event 3 is missing' in verdict.difference.text


def test_a_changed_scene_is_found(tmp_path) -> None:
    verdict = verify(rewrite(shared_session(), tmp_path, lambda topic, data: (
        data.replace(b'9.81', b'9.82') if topic.kind == kinds.SCENE else data)))
    assert not verdict.holds


def test_a_changed_state_at_the_start_of_a_file_is_found(tmp_path) -> None:
    def change(topic, data):
        if topic.kind == kinds.SNAPSHOT:
            spoiled = bytearray(data)
            spoiled[-9] ^= 1
            return bytes(spoiled)
        return data
    verdict = verify(rewrite(shared_session(), tmp_path, change))
    assert not verdict.holds
    assert 'damaged' in verdict.difference.text


@pytest.mark.parametrize('byte', range(4, 12))
def test_a_step_that_was_changed_does_not_take_years(tmp_path, byte) -> None:
    seen = []

    def change(topic, data):
        if topic.kind == kinds.STEP:
            seen.append(data)
            if len(seen) == 30:
                spoiled = bytearray(data)
                spoiled[byte] ^= 0x40
                return bytes(spoiled)
        return data
    assert not verify(rewrite(shared_session(), tmp_path, change)).holds


@pytest.mark.parametrize('kind', [kinds.POSE, kinds.EVENT, kinds.STEP])
def test_a_byte_changed_in_the_file_itself_is_found(tmp_path, kind) -> None:
    bag = session(tmp_path)
    _, _, data = messages_of(bag, kind)[4]
    for path in bag.glob('*.mcap'):
        raw = bytearray(path.read_bytes())
        place = raw.find(data)
        if place >= 0:
            raw[place + len(data) - 7] ^= 1
            path.write_bytes(raw)
            break
    verdict = verify(bag)
    assert verdict.faults
    assert not verdict.holds
    if kind == kinds.POSE:
        assert verdict.difference.body == 'crate'


def test_a_bag_of_something_else_is_refused(tmp_path) -> None:
    bag = rewrite(shared_session(), tmp_path, lambda topic, data: (
        data if topic.kind == kinds.POSE else None))
    with pytest.raises(BagError, match='no recording of rigid_sim_ros'):
        verify(bag)


def test_a_world_that_leaves_all_numbers_comes_out_again(tmp_path) -> None:
    from rigid_sim_ros.world import World
    spring = {'type': 'spring', 'a': 'ball', 'b': 'world', 'anchor': [0, 0, 3], 'stiffness': 1e12,
              'rest_length': 1}
    scene = {'format': 1, 'world': {'step': 0.01, 'contact': 'none'}, 'forces': [spring],
             'bodies': [{'name': 'ball', 'shape': {'type': 'sphere', 'radius': 1}, 'mass': 1.0}]}
    batch = Batch(World.from_dict(scene), tmp_path / 'bag')
    with pytest.raises(ArithmeticError):
        batch.run(2000)
    batch.publish()
    batch.close()
    assert verify(tmp_path / 'bag').holds
