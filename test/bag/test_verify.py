# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A session comes out again to the bit, and nothing that was changed gets through."""

from bag.sessions import (
    forge, messages_of, NODE, rewrite, session, shared_session, world, wrench_session, WRENCHES)
import pytest

from rigid_sim_ros import __version__
from rigid_sim_ros.bag import events, session as sessions, topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.events import Event
from rigid_sim_ros.bag.outputs import state_topics
from rigid_sim_ros.bag.recorder import Recorder
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.messages import decode
from rigid_sim_ros.messages.codec import encode_bytes, encode_string, encode_wrench
from rigid_sim_ros.world.snapshot import pack, unpack


@pytest.mark.parametrize('storage, compression', [
    ('mcap', 'none'), ('mcap', 'zstd'), ('sqlite3', 'none'), ('sqlite3', 'zstd')])
def test_a_session_of_everything_comes_out_again(storage, compression) -> None:
    verdict = verify(shared_session(storage, compression))
    assert (verdict.difference, verdict.faults, verdict.gaps, verdict.note) == (None, (), 0, '')
    assert verdict.steps == 313 + 500 + 700 + 600 + 1 + 500 + 900
    assert verdict.seconds == pytest.approx(3.514)      # of 1 ms each


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


def with_gap(folder, *, lost: int, is_full: bool):
    """
    Return a session with a wrench that nobody echoed, a gap of one event, and another wrench.

    The gap tells of `lost` events; a full state follows it if `is_full`.
    """
    the_world = world()
    recorder = Recorder(folder / 'bag', the_world, [
        *state_topics(NODE, the_world.names), *WRENCHES], waits=True)
    recorder.snapshot(the_world)

    def push(force: tuple[float, float, float]) -> None:
        given = {'name': 'crate', 'force': force, 'frame': 'crate', 'source': 'crate/wrench'}
        the_world.apply_wrench(**given)
        recorder.event(the_world.step_index, 'apply_wrench', frame_id='crate', **given)

    push((0.1, 0.2, 0.3))
    the_world.step(5)
    recorder.event(the_world.step_index, 'pause')   # becomes the gap, of the event 1
    if is_full:
        recorder.snapshot(the_world)
    push((0.4, 0.5, 0.6))
    recorder.publish(the_world.step_index, [recorder.channel(WRENCHES[0].name)], [
        encode_wrench(the_world.time_ns, 'crate', (0.4, 0.5, 0.6), (0.0, 0.0, 0.0))])
    the_world.step(5)
    recorder.close(the_world)

    def change(topic, data):
        if topic.kind != kinds.EVENT or b'pause' not in data:
            return data
        return encode_string(Event(2, 5, events.GAP, {
            'since_step': 0, 'messages': 1, 'events': lost}).encode())
    return forge(folder / 'bag', folder, change=change, recount=True)


def test_a_wrench_whose_echo_was_lost_in_a_gap_is_not_waited_for(tmp_path) -> None:
    verdict = verify(with_gap(tmp_path, lost=1, is_full=True))
    assert verdict.difference is None
    assert verdict.gaps == 1


@pytest.mark.parametrize('lost, is_full, said', [
    (2, True, 'a gap of 2 events ends with the event 2, and begins with 1'),
    (1, False, 'a message comes before the full state that it follows from')])
def test_a_gap_that_does_not_fit_is_found(tmp_path, lost, is_full, said) -> None:
    difference = verify(with_gap(tmp_path, lost=lost, is_full=is_full)).difference
    assert difference is not None
    assert said in difference.text


@pytest.mark.parametrize('has_end', [True, False])
def test_a_recording_that_ends_in_a_gap_was_not_cut_off(tmp_path, has_end) -> None:
    """Its end is there, though nobody knows the state in which it ended."""
    batch = Batch(world(), tmp_path / 'bag', segment_s=0.0)
    batch.run(100)
    batch.tell('pause')     # becomes the gap, of the event 1: `end`
    batch.close()

    def change(topic, data):
        if topic.kind != kinds.EVENT:
            return data
        event = events.decode(decode.string(data))
        if event.kind == events.PAUSE:
            return encode_string(Event(1, event.step, events.GAP, {
                'since_step': 0, 'messages': 0, 'events': 1}).encode())
        return data if has_end else None
    verdict = verify(forge(tmp_path / 'bag', tmp_path, change=change, recount=True))
    assert (verdict.difference, verdict.gaps) == (None, 1)
    assert ('cut off' in verdict.note) == (not has_end)


def test_a_wrench_that_was_published_and_never_told_is_found(tmp_path) -> None:
    def change(topic, data):
        if topic.kind != kinds.EVENT or b'apply_wrench' not in data:
            return data
        return encode_string(Event(0, 5, events.PAUSE, {}).encode())
    difference = verify(forge(wrench_session(tmp_path), tmp_path, change=change)).difference
    assert difference is not None
    assert difference.body == 'crate'
    assert 'no event tells of' in difference.text


@pytest.mark.parametrize('kind', [kinds.SCENE, kinds.SESSION])
def test_a_later_file_with_another_scene_or_session_is_found(tmp_path, kind) -> None:
    seen = 0

    def change(topic, data):
        nonlocal seen
        seen += topic.kind == kind
        if topic.kind != kind or seen != 2:
            return data
        text = decode.string(data)
        if kind == kinds.SCENE:
            return encode_string(text.replace('9.81', '9.82'))
        return encode_string(sessions.decode(text)._replace(software={}).encode())
    difference = verify(rewrite(shared_session(), tmp_path, change)).difference
    assert difference is not None
    assert 'is another than at the beginning' in difference.text


def test_each_file_can_be_verified_by_itself() -> None:
    steps = 0
    for path in sorted(shared_session().glob('*.mcap')):
        verdict = verify(path)
        assert verdict.difference is None, path
        assert verdict.messages > 0
        steps += verdict.steps
    # What lies between the last state of a file and the first of the next is in neither.
    assert steps > 3000


def test_a_last_state_with_another_hash_is_found(tmp_path) -> None:
    def change(topic, data):
        if topic.kind != kinds.EVENT:
            return data
        event = events.decode(decode.string(data))
        if event.kind != events.END:
            return data
        said = {**event.arguments, 'state_hash': event.arguments['state_hash'] ^ 1}
        return encode_string(event._replace(arguments=said).encode())
    difference = verify(rewrite(shared_session(), tmp_path, change)).difference
    assert difference is not None
    assert "the last state's hash" in difference.text


def test_another_version_is_noted(tmp_path) -> None:
    bag = forge(shared_session(), tmp_path, describe=lambda session: session._replace(
        software={**session.software, 'rigid_sim_ros': '0.0.7'}))
    assert verify(bag).note.startswith('recorded with version 0.0.7')


def test_what_another_version_recorded_is_compared_by_what_it_says_of_the_world(tmp_path) -> None:
    def change(topic, data):
        if topic.kind != kinds.SNAPSHOT:
            return data
        meta, arrays = unpack(decode.byte_array(data))
        return encode_bytes(pack({**meta, 'version': '0.0.7 (12345678)'}, arrays))
    bag = rewrite(shared_session(), tmp_path, change)
    assert verify(bag).difference is None


def test_another_state_of_the_source_is_noted(tmp_path) -> None:
    bag = forge(shared_session(), tmp_path, describe=lambda session: session._replace(
        software={**session.software, 'source': '12345678'}))
    assert verify(bag).note.startswith(f'recorded with version {__version__} (12345678)')


@pytest.mark.parametrize('change', [{'step_ns': 7}, {'bodies': ('crate',)}])
def test_a_session_of_another_scene_is_refused(tmp_path, change) -> None:
    bag = forge(shared_session(), tmp_path, describe=lambda session: session._replace(**change))
    with pytest.raises(BagError, match='do not fit together'):
        verify(bag)


def test_a_bag_that_ends_after_wrong_checksums_is_a_difference(tmp_path) -> None:
    bag = session(tmp_path)
    first, second = sorted(bag.glob('*.mcap'))[:2]
    raw = bytearray(first.read_bytes())
    # A name in the index, which has a checksum and holds no message.
    raw[raw.rfind(b'/rigid_sim/crate/pose') + 1] ^= 1
    first.write_bytes(raw)
    second.write_bytes(second.read_bytes()[:5000])
    verdict = verify(bag)
    assert verdict.faults
    assert verdict.difference is not None


def test_a_saved_state_with_another_motion_is_found_with_its_body(tmp_path) -> None:
    seen = 0

    def change(topic, data):
        nonlocal seen
        seen += topic.kind == kinds.SNAPSHOT
        if topic.kind != kinds.SNAPSHOT or seen != 2:
            return data
        meta, arrays = unpack(decode.byte_array(data))
        arrays['x'] = arrays['x'].copy()
        arrays['x'][0, 1] += 1.0
        return encode_bytes(pack(meta, arrays))
    difference = verify(rewrite(shared_session(), tmp_path, change)).difference
    assert difference is not None
    assert difference.body == 'ball'
    assert difference.text.startswith('the saved state differs by 1')


def test_an_input_with_an_argument_that_there_is_not_is_refused(tmp_path) -> None:
    def change(topic, data):
        if topic.kind != kinds.EVENT or b'set_twist' not in data:
            return data
        event = events.decode(decode.string(data))
        return encode_string(event._replace(arguments={**event.arguments, 'colour': 1}).encode())
    difference = verify(rewrite(shared_session(), tmp_path, change)).difference
    assert difference is not None
    assert 'is refused' in difference.text
